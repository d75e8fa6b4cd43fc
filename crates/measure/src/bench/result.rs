//! What a measurement of speed comes to: plain data for every kind of report.

use serde::Serialize;

use crate::result::Machine;

/// Everything that one run measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Bench {
    /// Version of the program.
    pub version: String,
    /// Where it was measured.
    pub machine: Machine,
    /// Seed of all rays.
    pub seed: u64,
    /// Threads of builds and queries.
    pub threads: usize,
    /// Wall-clock time of the whole run, in seconds.
    pub seconds: f64,
    /// The models, in the order given.
    pub models: Vec<BenchModel>,
    /// One row for each model and engine.
    pub builds: Vec<BuildRow>,
    /// One row for each model, engine and kind of rays.
    pub rows: Vec<SpeedRow>,
    /// What the reader must know: skipped parts, an interruption.
    pub notes: Vec<String>,
}

/// A measured model.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BenchModel {
    /// Its file's name.
    pub name: String,
    /// Triangles as instanced.
    pub triangles: u64,
}

/// A tree that was built.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BuildRow {
    /// The model's name.
    pub model: String,
    /// Its name in the other rows: tier, layout and what else tells it apart; or obvhs's tree.
    pub engine: String,
    /// Seconds from the description in memory to ready for queries.
    pub seconds: f64,
    /// Surface-area cost; obvhs's is not known.
    pub sah_cost: Option<f64>,
    /// Nodes from the root to the deepest leaf; that of obvhs's wide tree is not known.
    pub depth: Option<u32>,
    /// Bytes of trees and primitives for each stored triangle.
    pub bytes_per_triangle: f64,
}

/// Speed of one engine on one kind of rays.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SpeedRow {
    /// The model's name.
    pub model: String,
    /// The engine's name.
    pub engine: String,
    /// Kind of rays: `primary`, `shadow`, `ao`, `diffuse`, `random`.
    pub rays: String,
    /// Number of rays.
    pub count: u64,
    /// Times that they were asked.
    pub repetitions: u64,
    /// Millions of rays a second in the best repetition.
    pub mrays_per_s_best: f64,
    /// In the median one.
    pub mrays_per_s_median: f64,
    /// Rays that hit something.
    pub hits: u64,
    /// Boxes tested for a ray, on average; of closest-hit queries only.
    pub boxes_per_ray: Option<f64>,
    /// Triangles and shapes tested for a ray, on average; of closest-hit queries only.
    pub primitives_per_ray: Option<f64>,
}
