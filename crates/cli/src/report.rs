//! What is printed about a render: JSON for programs, lines for people.

use std::collections::BTreeMap;
use std::fmt;

use firsthit_import::scene::SurfaceDesc;
use firsthit_import::{Report, SceneDesc};
use firsthit_render::{EffectEntry, EffectPlan, RayCounts};
use serde::Serialize;

use crate::console::{count, short};

/// The JSON of `render --json`.
#[derive(Serialize)]
pub(crate) struct RenderReport<'a> {
    /// The file written; `-` is standard output.
    pub(crate) output: String,
    /// Files of the pictures beside the colour.
    pub(crate) aov_files: Vec<String>,
    pub(crate) model: String,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) spp: u32,
    pub(crate) max_depth: u32,
    pub(crate) seed: u64,
    pub(crate) threads: usize,
    pub(crate) precision: &'static str,
    /// Triangles of the scene as seen: every instance counted.
    pub(crate) triangles: u64,
    /// Analytic shapes, every instance counted.
    pub(crate) shapes: u64,
    pub(crate) instances: u64,
    pub(crate) seconds: Seconds,
    /// Rays cast, by kind.
    pub(crate) rays: BTreeMap<&'static str, u64>,
    pub(crate) samples: u64,
    /// Estimated noise of the noisiest tile; `null` below 32 samples.
    pub(crate) noise: Option<f32>,
    /// Whether the time limit ended it.
    pub(crate) out_of_time: bool,
    /// Samples that were not finite and count as black.
    pub(crate) bad_samples: u64,
    pub(crate) interrupted: bool,
    pub(crate) effects: Vec<Effect<'a>>,
    /// Which camera, light and background were chosen, and why.
    pub(crate) choices: &'a [String],
    pub(crate) warnings: Vec<String>,
    /// Warnings beyond those listed.
    pub(crate) more_warnings: u64,
}

/// What a scene shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Triangles, every instance counted.
    pub(crate) triangles: u64,
    /// Analytic shapes, every instance counted.
    pub(crate) shapes: u64,
    pub(crate) instances: u64,
}

impl Counts {
    pub(crate) fn new(scene: &SceneDesc) -> Self {
        let mut counts = Self { instances: scene.instances.len() as u64, ..Self::default() };
        for geometry in scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries) {
            match &geometry.surface {
                SurfaceDesc::Triangles(mesh) => counts.triangles += mesh.triangles.len() as u64,
                SurfaceDesc::Shape(_) => counts.shapes += 1,
            }
        }
        counts
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.triangles, self.shapes) {
            (_, 0) => f.write_str(&count(self.triangles, "triangle")),
            (0, _) => f.write_str(&count(self.shapes, "shape")),
            _ => write!(f, "{}, {}", count(self.triangles, "triangle"), count(self.shapes, "shape")),
        }
    }
}

/// Wall-clock seconds of each step.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Seconds {
    /// Reading the files.
    pub(crate) load: f64,
    /// Trees, textures, lights.
    pub(crate) build: f64,
    pub(crate) render: f64,
    /// Encoding and writing the image.
    pub(crate) write: f64,
}

/// An effect as it is reported.
#[derive(Serialize)]
pub(crate) struct Effect<'a> {
    pub(crate) name: &'a str,
    pub(crate) called_for: bool,
    by: &'a [String],
    simulated: bool,
    /// Rays cast for it alone; absent before rendering.
    #[serde(skip_serializing_if = "Option::is_none")]
    rays: Option<u64>,
    /// Processor seconds in those rays; absent where they were not measured apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    seconds: Option<f64>,
}

/// The plan as it is reported.
pub(crate) fn effects(plan: &EffectPlan) -> Vec<Effect<'_>> {
    plan.entries.iter().map(Effect::from).collect()
}

impl<'a> From<&'a EffectEntry> for Effect<'a> {
    fn from(e: &'a EffectEntry) -> Self {
        Self {
            name: e.name,
            called_for: e.called_for,
            by: &e.by,
            simulated: e.simulated,
            rays: e.rays,
            seconds: e.seconds,
        }
    }
}

impl Effect<'_> {
    /// What calls for it, the first three.
    pub(crate) fn by_in_words(&self) -> String {
        match self.by {
            [first, second, third, rest @ ..] if !rest.is_empty() => {
                format!("{first}, {second}, {third} and {} more", rest.len())
            }
            few => few.join(", "),
        }
    }
}

/// The plan as lines: each effect, who calls for it, whether it is simulated, and what it cost.
pub(crate) fn explain_effects(plan: &EffectPlan) -> Vec<String> {
    let line = |e: &Effect<'_>| {
        let (verdict, by) = match (e.called_for, e.simulated) {
            (true, true) => ("yes", e.by_in_words()),
            (true, false) => ("left out", e.by_in_words()),
            (false, true) => ("added", "by --effects".into()),
            (false, false) => ("no", "not called for".into()),
        };
        let cost = match (e.rays, e.seconds) {
            (Some(0) | None, _) => String::new(),
            (Some(n), None) => format!("; {} rays", short(n as f64)),
            (Some(n), Some(s)) => format!("; {} rays, {s:.2} s", short(n as f64)),
        };
        format!("  {:18} {verdict:8} {by}{cost}", e.name)
    };
    std::iter::once("effects:".into()).chain(effects(plan).iter().map(line)).collect()
}

/// Rays by kind, without the kinds that were not cast.
pub(crate) fn rays_in_words(rays: &RayCounts) -> String {
    let kinds = rays.by_name().into_iter().filter(|(_, n)| *n > 0);
    let kinds: Vec<String> = kinds.map(|(name, n)| format!("{name} {}", short(n as f64))).collect();
    format!("{} rays ({})", short(rays.total() as f64), kinds.join(", "))
}

/// Warnings as texts.
pub(crate) fn warnings(report: &Report) -> Vec<String> {
    report.warnings.iter().map(ToString::to_string).collect()
}
