//! What is printed about a render: JSON for programs, lines for people.

use std::collections::BTreeMap;
use std::fmt;

use firsthit_import::scene::SurfaceDesc;
use firsthit_import::{Report, SceneDesc};
use firsthit_render::{Ablations, EffectEntry, EffectPlan, LightPaths, RayCounts};
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
    /// Paths from the lights; absent where none were followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) light_paths: Option<Paths>,
    /// Estimated noise of the noisiest tile; `null` below 32 samples.
    pub(crate) noise: Option<f32>,
    /// Whether the time limit ended it.
    pub(crate) out_of_time: bool,
    /// Samples that were not finite and count as black.
    pub(crate) bad_samples: u64,
    pub(crate) interrupted: bool,
    pub(crate) effects: Vec<Effect<'a>>,
    /// The kernel that was chosen for them.
    pub(crate) kernel: &'static str,
    /// What the picture is without each effect; absent unless asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ablation: Option<Ablation>,
    /// Which camera, light and background were chosen, and why.
    pub(crate) choices: &'a [String],
    pub(crate) warnings: Vec<String>,
    /// Warnings beyond those listed.
    pub(crate) more_warnings: u64,
}

/// Paths from the lights.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Paths {
    pub(crate) paths: u64,
    /// Points where light met a surface that spreads it.
    pub(crate) vertices: u64,
    /// Those of them that the camera saw.
    pub(crate) seen: u64,
    /// Their share.
    pub(crate) share_seen: Option<f64>,
}

impl Paths {
    /// `None` where there were none.
    pub(crate) fn new(light: &LightPaths) -> Option<Self> {
        let LightPaths { paths, vertices, seen } = *light;
        (paths > 0).then(|| Self { paths, vertices, seen, share_seen: light.share() })
    }

    /// In words, for people.
    pub(crate) fn in_words(&self) -> String {
        let share = self.share_seen.unwrap_or(0.0);
        format!(
            "{} light paths met surfaces {} times; {:.1} % of these points are seen by the camera",
            short(self.paths as f64),
            short(self.vertices as f64),
            100.0 * share
        )
    }
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
    /// How often it was evaluated at a point, or a light of its kind was asked; absent where rays tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u64>,
    /// Look-ups of images for it; absent where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    look_ups: Option<u64>,
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
            samples: e.samples,
            look_ups: e.look_ups,
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

/// The plan as lines: each effect, who calls for it, whether it is simulated, and what it cost of the processor `seconds` of
/// the render.
pub(crate) fn explain_effects(plan: &EffectPlan, kernel: &str, seconds: f64) -> Vec<String> {
    let line = |e: &Effect<'_>| {
        let (verdict, by) = match (e.called_for, e.simulated) {
            (true, true) => ("yes", e.by_in_words()),
            (true, false) => ("left out", e.by_in_words()),
            (false, true) => ("added", "by --effects".into()),
            (false, false) => ("no", "not called for".into()),
        };
        let counts = [(e.rays, "rays"), (e.samples, "samples"), (e.look_ups, "look-ups")];
        let mut costs: Vec<String> = counts
            .iter()
            .filter_map(|(n, what)| Some(format!("{} {what}", short(n.filter(|n| *n > 0)? as f64))))
            .collect();
        if let (Some(s), true) = (e.seconds, e.rays.is_some_and(|n| n > 0)) {
            costs.push(format!("{s:.2} s in rays ({:.0} %)", 100.0 * s / seconds));
        }
        let cost = if costs.is_empty() { String::new() } else { format!("; {}", costs.join(", ")) };
        format!("  {:20} {verdict:8} {by}{cost}", e.name)
    };
    [format!("kernel: {kernel}"), "effects:".into()].into_iter().chain(effects(plan).iter().map(line)).collect()
}

/// What the picture is without each effect.
#[derive(Serialize)]
pub(crate) struct Ablation {
    width: u32,
    height: u32,
    spp: u32,
    repetitions: u32,
    /// With all effects.
    seconds: f64,
    /// How much other random numbers change the picture.
    noise: f64,
    effects: Vec<Ablated>,
}

#[derive(Serialize)]
struct Ablated {
    name: &'static str,
    rmse: f64,
    /// `rmse` over the root mean square of the whole picture; `null` of a black one.
    relative: Option<f64>,
    /// Without it.
    seconds: f64,
    /// Seconds with all effects less those without it.
    saved: f64,
}

impl From<&Ablations> for Ablation {
    fn from(a: &Ablations) -> Self {
        let effect = |e: &firsthit_render::Ablation| Ablated {
            name: e.name,
            rmse: e.rmse,
            relative: Some(e.relative).filter(|r| r.is_finite()),
            seconds: e.seconds,
            saved: e.saved,
        };
        Self {
            width: a.width,
            height: a.height,
            spp: a.spp,
            repetitions: a.repetitions,
            seconds: a.seconds,
            noise: a.noise,
            effects: a.effects.iter().map(effect).collect(),
        }
    }
}

impl Ablation {
    /// As a table: what changes the picture most comes first.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            format!(
                "without each effect in turn ({}x{}, {} samples per pixel, {:.2} s with all; median of {}):",
                self.width, self.height, self.spp, self.seconds, self.repetitions
            ),
            format!("  {:20} {:>10} {:>10} {:>9} {:>7}", "without", "rmse", "relative", "saves", "of all"),
        ];
        let mut effects: Vec<&Ablated> = self.effects.iter().collect();
        effects.sort_by(|a, b| b.rmse.total_cmp(&a.rmse));
        lines.extend(effects.iter().map(|e| {
            let relative = e.relative.map_or_else(|| "-".into(), |r| format!("{:.2} %", 100.0 * r));
            let share = 100.0 * e.saved / self.seconds;
            format!("  {:20} {:>10.5} {relative:>10} {:>7.3} s {share:>5.0} %", e.name, e.rmse, e.saved)
        }));
        lines.push(format!("  other random numbers alone: rmse {:.5}", self.noise));
        lines
    }
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
