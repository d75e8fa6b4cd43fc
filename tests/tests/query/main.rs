//! Queries of built scenes: no leaks, the same answers as slow twins, whatever the tree, order, scale or place.

mod crossings;
mod degenerate;
mod exact;
mod guards;
mod invariance;
mod leaks;
mod rays;
mod shapes;
mod spawn;
mod twins;

use firsthit_accel::{BuildOptions, Geometry, Hit, HitId, Scene, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_tests::oracle::Mesh;
use glam::DAffine3;

/// The tiers that promise answers which do not depend on the tree: all but the fast one, whose boxes are not padded.
fn careful() -> impl Iterator<Item = Precision> {
    [Precision::Robust, Precision::Double, Precision::Exact].into_iter()
}

fn options(precision: Precision) -> BuildOptions {
    BuildOptions { precision, ..BuildOptions::default() }
}

fn triangles(mesh: &Mesh) -> Geometry {
    Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() }
}

/// One mesh, placed once.
fn scene_of(mesh: &Mesh, transform: DAffine3, precision: Precision) -> Scene {
    let mut builder = SceneBuilder::new(options(precision));
    let m = builder.add_mesh(vec![triangles(mesh)]);
    builder.add_instance(m, transform);
    builder.build().expect("a good mesh")
}

/// A hit in bits: id, t, u, v, normal.
type Bits = (HitId, u64, u32, u32, [u64; 3]);

/// For comparisons in which no bit may differ, not even a sign of zero.
fn bits(h: &Option<Hit>) -> Option<Bits> {
    h.map(|h| (h.id, h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.normal.to_array().map(f64::to_bits)))
}
