//! Scenes so small that a query is hardly more than one kernel, and rays for them: what criterion times and valgrind counts.

use firsthit_accel::{BuildOptions, BuildQuality, Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::{Mesh, bumpy_sphere};
use firsthit_measure::random::Rng;
use glam::{DAffine3, DVec3, Vec3};

/// A scene of one mesh at a tier.
///
/// # Panics
/// If the mesh cannot be built.
#[must_use]
pub fn scene(mesh: &Mesh, precision: Precision, quality: BuildQuality) -> Scene {
    let mut builder = SceneBuilder::new(BuildOptions { precision, quality, ..BuildOptions::default() });
    let geometry = Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
    let mesh = builder.add_mesh(vec![geometry]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    builder.build().expect("a mesh that can be built")
}

/// The mesh of queries and builds: 20,480 triangles that fit into a cache.
#[must_use]
pub fn ball() -> Mesh {
    bumpy_sphere(5)
}

/// `count` small triangles that face +z, one behind another around the z axis.
fn stack(count: u32, at: Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..count {
        let center = at + Vec3::Z * (0.01 * k as f32);
        mesh.positions.extend([Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::Y].map(|p| center + p));
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    mesh
}

/// Eight triangles close together: one block.
#[must_use]
pub fn block() -> Mesh {
    stack(8, Vec3::ZERO)
}

/// Eight blocks far from each other: one node of eight boxes.
#[must_use]
pub fn node() -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..8_u32 {
        let corner = |bit: u32| if k >> bit & 1 == 1 { 40.0 } else { -40.0 };
        let part = stack(8, Vec3::new(corner(0), corner(1), corner(2)));
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions);
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    mesh
}

/// Rays along the z axis through all triangles of a [`block`].
#[must_use]
pub fn through_block(count: usize) -> Vec<Ray<f64>> {
    let mut rng = Rng(3);
    let near = |rng: &mut Rng| DVec3::new(0.2 * rng.signed(), 0.2 * rng.signed(), -3.0);
    (0..count).map(|_| Ray::new(near(&mut rng), near(&mut rng) * DVec3::new(0.1, 0.1, -0.3))).collect()
}

/// Rays through the middle of a [`node`], past all its boxes.
#[must_use]
pub fn past_boxes(count: usize) -> Vec<Ray<f64>> {
    let mut rng = Rng(4);
    (0..count).map(|_| Ray::new(rng.in_cube() * 5.0 + DVec3::NEG_Z * 90.0, DVec3::Z + rng.in_cube() * 0.1)).collect()
}

/// Rays from all around at a box of size 2.
#[must_use]
pub fn around(count: usize) -> Vec<Ray<f64>> {
    let mut rng = Rng(5);
    (0..count)
        .map(|_| {
            let origin = rng.direction() * 3.0;
            Ray::new(origin, rng.in_cube() * 0.9 - origin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the names promise: that one kernel is what a query does.
    #[test]
    fn one_node_and_one_block_are_tested() {
        for precision in Precision::ALL {
            let block = scene(&block(), precision, BuildQuality::Balanced);
            for ray in through_block(100) {
                let (hit, counts) = block.closest_hit_counted(&ray);
                assert_eq!((hit.map(|h| h.id.primitive), counts.primitives), (Some(0), 8), "{precision}");
                assert!(counts.boxes <= 8, "{counts:?}");
            }
            let node = scene(&node(), precision, BuildQuality::Balanced);
            for ray in past_boxes(100) {
                let (hit, counts) = node.closest_hit_counted(&ray);
                assert_eq!((hit, counts.primitives, counts.boxes), (None, 0, 8), "{precision}");
            }
        }
    }
}
