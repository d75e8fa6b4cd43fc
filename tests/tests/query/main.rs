//! Queries of built scenes: no leaks, the same answers as slow twins, whatever the tree, order, scale or place.

mod crossings;
mod degenerate;
mod exact;
mod guards;
mod hard;
mod invariance;
mod leaks;
mod nearest;
mod nearest_shapes;
mod packets;
mod rays;
mod region;
mod saved;
mod shapes;
mod single;
mod solid;
mod spawn;
mod twins;
mod update;
mod user;
mod validate;

use firsthit_accel::{BuildOptions, Geometry, Hit, HitId, Scene, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_measure::scenario::{self, Settings};
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

/// Runs a scenario on so many rays, prints what it came to, and fails if anything did not hold.
fn holds(id: &str, count: u64) {
    holds_at(id, count, &Precision::ALL);
}

fn holds_at(id: &str, count: u64, tiers: &[Precision]) {
    let known = scenario::ALL.into_iter().find(|s| s.id == id).expect("a scenario");
    let settings = Settings { count: Some(count), tiers: tiers.to_vec(), ..Settings::default() };
    for outcome in scenario::run(&[known], &settings) {
        firsthit_tests::summary(outcome.to_string().trim_end());
        assert!(outcome.passed() && outcome.count > 0, "{outcome}");
    }
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
    h.map(|h| (h.id, h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.normal_direction.to_array().map(f64::to_bits)))
}
