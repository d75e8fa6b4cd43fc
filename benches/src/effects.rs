//! What it buys that a scene is rendered by a kernel without the effects that it does not call for: the same scene by the
//! kernel chosen for it and by the one that can do everything, in turn, with the same bits as the answer.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_measure::timing::Paired;
use firsthit_render::{EffectOverrides, EffectSet, RenderOptions, Stage, StageOptions, render};
use serde::{Deserialize, Serialize};

/// Models that come with the project, as paths in its `assets`.
pub const SCENES: [&str; 9] = [
    "cornell-box/CornellBox-Original.obj",
    "cornell-box/CornellBox-Mirror.obj",
    "cornell-box/CornellBox-Sphere.obj",
    "flight-helmet/FlightHelmet.gltf",
    "lights-punctual/lights.gltf",
    "scenes/lecture-optics.toml",
    "scenes/lecture-shadows.toml",
    "scenes/shapes.toml",
    "spot/spot.toml",
];

/// By which kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// The one chosen for the scene.
    Chosen,
    /// The one for everything.
    Full,
}

impl By {
    /// As an argument has it.
    pub const NAMES: [(Self, &'static str); 2] = [(Self::Chosen, "chosen"), (Self::Full, "full")];
}

/// How much is rendered.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Work {
    /// Width of the picture; its height is three quarters of that.
    pub width: u32,
    /// Samples of a pixel.
    pub spp: u32,
}

impl Work {
    fn options(self) -> RenderOptions {
        let height = (self.width * 3 / 4).max(1);
        RenderOptions { width: self.width.max(1), height, spp: self.spp.max(1), ..RenderOptions::default() }
    }
}

/// One scene by two kernels.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Row {
    /// The scene's file.
    pub scene: String,
    /// Name of the kernel chosen for it.
    pub kernel: String,
    /// Names of the effects that it does not call for.
    pub without: Vec<String>,
    /// Seconds by the chosen kernel: the median.
    pub seconds_chosen: f64,
    /// Seconds by the full kernel: the median.
    pub seconds_full: f64,
    /// Median over repetitions of the full kernel's time over the chosen one's.
    pub time: f64,
    /// Instructions by the full kernel over those by the chosen one, where they were counted.
    pub instructions: Option<f64>,
    /// Instructions of a sample by the chosen kernel, where they were counted.
    pub instructions_per_sample: Option<f64>,
}

/// A scene, ready to be rendered.
///
/// # Errors
/// When it cannot be read or staged.
pub fn stage(path: &Path, by: By) -> Result<Stage, String> {
    let at = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let scene = firsthit_import::open(path, &firsthit_import::Options::default()).map_err(|e| at(&e))?.scene;
    let trees = SceneBuilder::from_desc(&scene, BuildOptions::default()).build().map_err(|e| at(&e))?;
    let add = if by == By::Full { EffectSet::all() } else { EffectSet::empty() };
    let options = StageOptions {
        effects: EffectOverrides { add, ..EffectOverrides::default() },
        aspect: 4.0 / 3.0,
        ..StageOptions::default()
    };
    Stage::new(Arc::new(scene), trees, &options).map_err(|e| at(&e))
}

/// Renders, and throws the picture away. A function of its own, so that valgrind can be told of it.
///
/// # Errors
/// When there is nothing to render.
#[inline(never)]
pub fn counted_render(stage: &Stage, work: Work) -> Result<u64, String> {
    let rendered = render(stage, &work.options(), &()).map_err(|e| e.to_string())?;
    Ok(black_box(rendered).stats.samples)
}

/// Times one scene by both kernels in turn, on the pool that it is called in.
///
/// # Errors
/// When it cannot be rendered, or the kernels' pictures differ in a bit.
pub fn measure(path: &Path, work: Work, repetitions: usize) -> Result<Row, String> {
    let stages = [stage(path, By::Chosen)?, stage(path, By::Full)?];
    let mut pictures = Vec::new();
    for stage in &stages {
        let rendered = render(stage, &Work { spp: 2, ..work }.options(), &()).map_err(|e| e.to_string())?;
        pictures.push(rendered.film.color().pixels.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>());
    }
    if pictures[0] != pictures[1] {
        return Err(format!("{}: the kernels' pictures differ", path.display()));
    }
    let mut failed = None;
    let paired = Paired::run(
        stages.len(),
        (repetitions, repetitions),
        Duration::ZERO,
        |way| failed = counted_render(&stages[way], work).err().or_else(|| failed.take()),
        || false,
    );
    if let Some(message) = failed {
        return Err(message);
    }
    let plan = stages[0].plan();
    Ok(Row {
        scene: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        kernel: stages[0].kernel().name().into(),
        without: plan.entries.iter().filter(|e| !e.called_for).map(|e| e.name.into()).collect(),
        seconds_chosen: paired.spread(0).median,
        seconds_full: paired.spread(1).median,
        time: paired.ratio(1, 0),
        instructions: None,
        instructions_per_sample: None,
    })
}

/// Instructions of a render by one kernel, counted by valgrind: this program is run again under it, with arguments that
/// make it call [`counted_render`] once. `None` where there is no valgrind.
///
/// # Errors
/// When valgrind finds something else than a number.
pub fn instructions(path: &Path, by: By, work: Work) -> Result<Option<u64>, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let name = By::NAMES.iter().find(|(b, _)| *b == by).map_or("chosen", |(_, name)| name);
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*counted_render*"])
        .arg(program)
        .args(["--only", name, "--width", &work.width.to_string(), "--spp", &work.spp.to_string()])
        .arg(path)
        .output();
    let Ok(output) = output else { return Ok(None) };
    let text = String::from_utf8_lossy(&output.stderr);
    let collected = text.lines().find_map(|l| l.split_once("Collected :")?.1.trim().parse().ok());
    collected.map(Some).ok_or_else(|| format!("valgrind said: {text}"))
}

fn geometric_mean(numbers: &[f64]) -> f64 {
    (numbers.iter().map(|x| x.ln()).sum::<f64>() / numbers.len() as f64).exp()
}

/// Scenes and effects as tables.
#[must_use]
pub fn markdown(rows: &[Row]) -> String {
    let number = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.3}"));
    let mut text = String::from(
        "| scene | kernel | chosen, s | full, s | time: full / chosen | instructions: full / chosen | instructions of a \
         sample |\n|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        text += &format!(
            "| {} | {} | {:.3} | {:.3} | {:.3} | {} | {} |\n",
            r.scene,
            r.kernel,
            r.seconds_chosen,
            r.seconds_full,
            r.time,
            number(r.instructions),
            r.instructions_per_sample.map_or_else(|| "-".into(), |x| format!("{x:.0}")),
        );
    }
    text += "\n| effect | scenes without it | time: full / chosen | instructions: full / chosen |\n|---|---|---|---|\n";
    let mut means = Vec::new();
    for (_, name) in EffectSet::NAMES {
        let lack: Vec<&Row> = rows.iter().filter(|r| r.without.iter().any(|w| w == name)).collect();
        if lack.is_empty() {
            continue;
        }
        let time = geometric_mean(&lack.iter().map(|r| r.time).collect::<Vec<_>>());
        let counted: Vec<f64> = lack.iter().filter_map(|r| r.instructions).collect();
        let counted = (counted.len() == lack.len()).then(|| geometric_mean(&counted));
        text += &format!("| {name} | {} | {time:.3} | {} |\n", lack.len(), number(counted));
        means.push((time, counted));
    }
    let time = geometric_mean(&means.iter().map(|m| m.0).collect::<Vec<_>>());
    let counted: Option<Vec<f64>> = means.iter().map(|m| m.1).collect();
    let counted = counted.map(|c| geometric_mean(&c));
    text + &format!("| **geometric mean** of {} effects | | {time:.3} | {} |\n", means.len(), number(counted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_means_over_the_scenes_without_an_effect() {
        let row = |without: &[&str], time, instructions| Row {
            scene: "s".into(),
            kernel: "plain".into(),
            without: without.iter().map(|w| (*w).into()).collect(),
            seconds_chosen: 1.0,
            seconds_full: time,
            time,
            instructions,
            instructions_per_sample: Some(1000.0),
        };
        let rows = [row(&["sheen", "textures"], 2.0, Some(1.5)), row(&["sheen"], 8.0, Some(1.5))];
        let text = markdown(&rows);
        assert!(text.contains("| sheen | 2 | 4.000 | 1.500 |"), "{text}");
        assert!(text.contains("| textures | 1 | 2.000 | 1.500 |"), "{text}");
        assert!(text.contains("of 2 effects | | 2.828 | 1.500 |"), "{text}");
    }
}
