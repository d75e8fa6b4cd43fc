//! What a measurement comes to: plain data for every kind of report.

use serde::Serialize;

/// Everything that one run measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Accuracy {
    /// Version of the program.
    pub version: String,
    /// Where it was measured.
    pub machine: Machine,
    /// Seed of all rays.
    pub seed: u64,
    /// `quick`, `default` or `thorough`.
    pub effort: String,
    /// Wall-clock time of the whole run, in seconds.
    pub seconds: f64,
    /// The models, in the order given.
    pub models: Vec<Model>,
    /// One row for each model, tier (or guard) and kind of rays.
    pub tiers: Vec<TierRow>,
    /// One row for each analytic shape, form and kind of rays.
    pub shapes: Vec<ShapeRow>,
    /// One row for each model and tier: what the tier does to a picture.
    pub pictures: Vec<PictureRow>,
    /// What the reader must know: skipped parts, a noisy machine.
    pub notes: Vec<String>,
}

/// The machine, as far as it can be told.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Machine {
    /// Name of the processor.
    pub cpu: String,
    /// Logical processors.
    pub cores: usize,
    /// Operating system and architecture.
    pub os: String,
    /// Spread of repeated timings of the same work: interquartile range over median.
    pub noise: f64,
}

/// A measured model.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Model {
    /// Its file's name.
    pub name: String,
    /// Triangles as instanced.
    pub triangles: u64,
    /// Whether it is closed, so that a ray from inside that hits nothing has leaked.
    pub closed: bool,
    /// A plain sentence: which tier to use for this model, and what it costs.
    pub verdict: String,
}

/// Time and errors of one tier, or of one guard of the robust tier, on one kind of rays.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TierRow {
    /// The model's name.
    pub model: String,
    /// `fast`, `robust`, `double`, `exact`.
    pub tier: String,
    /// Empty for a whole tier; else which guards are on: `only padding`, `all but watertight`.
    pub guard: String,
    /// Kind of rays: `primary`, `shadow`, `incoherent`, `aimed`.
    pub rays: String,
    /// Number of rays timed.
    pub count: u64,
    /// Nanoseconds for a ray, median over repetitions.
    pub ns_per_ray: f64,
    /// Lower quartile.
    pub ns_low: f64,
    /// Upper quartile.
    pub ns_high: f64,
    /// Median of the ratio to the fast tier's time in the same repetition.
    pub ratio_to_fast: f64,
    /// Rays from inside a closed mesh that hit nothing; only of `aimed` rays, and only for a closed model.
    pub leaks: Option<u64>,
    /// Number of rays behind `leaks`.
    pub aimed_rays: u64,
    /// Number of rays compared with the exact answer.
    pub compared: u64,
    /// Hits where exactly there is none.
    pub false_hits: u64,
    /// No hit where exactly there is one.
    pub false_misses: u64,
    /// Of `false_hits`, those that 64 roundings of f32 leave no excuse for; then f64; then those below even that.
    pub false_hits_by_level: [u64; 3],
    /// The same of `false_misses`.
    pub false_misses_by_level: [u64; 3],
    /// Another triangle than any of the exactly nearest.
    pub wrong_ids: u64,
    /// Rays that slipped through a surface: it was missed, or something behind it hit, though all rays close around hit
    /// it, and the mesh does not end there. From inside a closed model these are the leaks; here they count for open
    /// models too. What rounding decides at a silhouette, a rim or a crack in the mesh is not among them.
    pub slipped: u64,
    /// Error of t against the exact one, in f32 ulps: median, 99 %, largest.
    pub t_ulp_p50: f64,
    /// 99th percentile.
    pub t_ulp_p99: f64,
    /// Largest.
    pub t_ulp_max: f64,
    /// Largest error of t in ulps, each divided by the condition of its t.
    pub t_ulp_kappa_max: f64,
    /// Distance of the hit point from the true surface, in f32 ulps of its largest coordinate: 99 %.
    pub surface_ulp_p99: f64,
    /// Largest.
    pub surface_ulp_max: f64,
    /// Bounced rays that hit the triangle they left.
    pub self_hits: u64,
    /// Number of bounced rays.
    pub bounces: u64,
    /// Error of the geometric normal, in radians: 99 %.
    pub normal_p99: f64,
    /// Largest.
    pub normal_max: f64,
    /// Share of rays for which the exact tier needed more than f64; only of that tier.
    pub fallback_rate: Option<f64>,
}

/// Time and errors of one form of an analytic intersection.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ShapeRow {
    /// `sphere`, `plane`, `disk`, `box`, `quadric`, `polygon`, `triangle`.
    pub shape: String,
    /// `textbook f32`, `stable f32`, `stable f64`, `exact`.
    pub form: String,
    /// `easy` or `hard`.
    pub rays: String,
    /// Number of rays.
    pub count: u64,
    /// Nanoseconds for a test, median.
    pub ns_per_ray: f64,
    /// Hits where exactly there is none.
    pub false_hits: u64,
    /// No hit where exactly there is one.
    pub false_misses: u64,
    /// Error of t in f32 ulps: median.
    pub t_ulp_p50: f64,
    /// 99th percentile.
    pub t_ulp_p99: f64,
    /// Largest.
    pub t_ulp_max: f64,
}

/// What a tier does to a picture.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PictureRow {
    /// The model's name.
    pub model: String,
    /// `fast`, `robust`, `double`, `exact`.
    pub tier: String,
    /// Seconds to render, median.
    pub seconds: f64,
    /// Ratio to the fast tier's time.
    pub ratio_to_fast: f64,
    /// Root mean square difference from the exact tier's picture, in linear radiance.
    pub rmse: f64,
    /// Mean FLIP difference from the exact tier's picture (Andersson et al. 2020).
    pub flip: f64,
    /// Pixels that differ.
    pub different_pixels: u64,
    /// Pixels.
    pub pixels: u64,
}
