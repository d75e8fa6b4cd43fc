//! Every answer of firsthit against every triangle: no tree, exact decisions.
//!
//! Of a ray all exact hits with all triangles are found; from these follow the closest hit, any hit, the first few, their
//! order and their number. Of a point the distance to each triangle. What cannot matter is sorted out by balls around the
//! triangles ([`sieve`]), in single precision with room for its rounding; every [`UNSIEVED`]-th query is put to all triangles
//! without that. The triangles that are left are judged by exact arithmetic (rays, inside and outside) or by the same
//! `f64` arithmetic as the library's and by numbers of twice as many digits (distances).
//!
//! Then the same is asked of the mesh scaled by powers of two, which may change nothing but the sizes.

pub mod angles;
pub mod closed;
pub mod judge_points;
pub mod judge_rays;
pub mod judge_regions;
pub mod points;
pub mod precise;
pub mod rays;
pub mod regions;
pub mod run;
pub mod sieve;
pub mod tally;

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_measure::mesh::Mesh;
use firsthit_measure::random::Rng;
use glam::{DAffine3, DVec3};

/// Of so many queries one is put to all triangles.
pub const UNSIEVED: usize = 2000;

/// One of the triangles, from any of its corners on.
fn any_triangle(corners: &[[DVec3; 3]], rng: &mut Rng) -> [DVec3; 3] {
    let mut triangle = corners[rng.below(corners.len())];
    triangle.rotate_left(rng.below(3));
    triangle
}

/// A scene of one mesh at the exact tier, all of it scaled by a power of two.
///
/// # Errors
/// When the mesh cannot be built, or the scale would cost its coordinates digits.
pub fn scene(mesh: &Mesh, exponent: i32) -> Result<Scene, String> {
    let scale = 2f32.powi(exponent);
    let positions: Vec<_> = mesh.positions.iter().map(|p| *p * scale).collect();
    let back = 2f64.powi(-exponent);
    if positions.iter().zip(&mesh.positions).any(|(p, q)| p.as_dvec3() * back != q.as_dvec3()) {
        return Err(format!("2^{exponent}: single precision has no room for this mesh at that scale"));
    }
    let options = BuildOptions { precision: Precision::Exact, ..BuildOptions::default() };
    let mut builder = SceneBuilder::new(options);
    let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: mesh.triangles.clone() }]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    builder.build().map_err(|e| e.to_string())
}

/// Corners in double precision, by triangle.
#[must_use]
pub fn corners(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize].as_dvec3())).collect()
}
