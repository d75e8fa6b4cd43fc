//! How fast pictures become good: time and error of path tracing by the number of samples, and where the time goes.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use firsthit_accel::{BuildOptions, Level, SceneBuilder};
use firsthit_import::scene::Settings;
use firsthit_import::{ImportError, SceneDesc};
use firsthit_render::film::Picture;
use firsthit_render::{Breakdown, Monitor, RenderOptions, Rendered, Stage, StageOptions, render};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

use crate::picture::{self, PictureError};
use crate::result::Machine;
use crate::run::{MeasureError, machine};
use crate::timing::Spread;

/// A scene to render, and what it should look like.
#[derive(Clone, Debug)]
pub struct RenderSubject {
    /// For reports.
    pub name: String,
    /// The scene.
    pub scene: Arc<SceneDesc>,
    /// Its picture without noise, of the size that the scene asks for.
    pub reference: Option<Picture>,
}

impl RenderSubject {
    /// The name of the reference picture beside a `scene.json`.
    pub const REFERENCE: &str = "ref.exr";

    /// A scene that was read from a file: the picture `ref.exr` beside a file `scene.json` is its reference.
    ///
    /// # Errors
    /// When there is such a picture, and it cannot be read.
    pub fn read(name: &str, file: &Path, scene: SceneDesc) -> Result<Self, ImportError> {
        let beside = file.with_file_name(Self::REFERENCE);
        let has = file.file_name().is_some_and(|f| f == "scene.json") && beside.exists();
        let reference = if has { Some(picture::read(beside)?) } else { None };
        Ok(Self { name: name.into(), scene: Arc::new(scene), reference })
    }
}

/// What to render.
#[derive(Clone, Debug)]
pub struct RenderBenchOptions {
    /// Samples per pixel of each picture.
    pub spp: Vec<u32>,
    /// Numbers of threads.
    pub threads: Vec<usize>,
    /// Width and height of scenes that do not say, pixels.
    pub size: (u32, u32),
    /// Of all samples.
    pub seed: u64,
    /// The instructions that rays are traced by.
    pub simd: Level,
}

impl Default for RenderBenchOptions {
    fn default() -> Self {
        let all = std::thread::available_parallelism().map_or(1, Into::into);
        let threads = if all > 1 { vec![1, all] } else { vec![1] };
        Self { spp: vec![4, 16, 64, 256], threads, size: (640, 360), seed: 0, simd: Level::default() }
    }
}

/// Everything that one run measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RenderBench {
    /// Version of the program.
    pub version: String,
    /// Where it was measured.
    pub machine: Machine,
    /// Seed of all samples.
    pub seed: u64,
    /// Wall-clock time of the whole run, in seconds.
    pub seconds: f64,
    /// One row for each scene, number of samples and number of threads.
    pub rows: Vec<RenderRow>,
    /// One row for each scene.
    pub parts: Vec<PartsRow>,
    /// What the reader must know: an interruption, scenes without a reference.
    pub notes: Vec<String>,
}

/// Time and error of one picture.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RenderRow {
    /// The scene's name.
    pub scene: String,
    /// Samples per pixel.
    pub spp: u32,
    /// Threads.
    pub threads: usize,
    /// Wall-clock seconds of the render alone: the median of `repetitions`.
    pub seconds: f64,
    /// How often it was rendered.
    pub repetitions: usize,
    /// Rays of all kinds.
    pub rays: u64,
    /// Millions of rays a second.
    pub mrays_per_s: f64,
    /// Mean of (x - r)^2, r the reference.
    pub mse: Option<f64>,
    /// Mean of (x - r)^2 / (r^2 + 0.01) without the worst 0.1 % of the pixels.
    pub trimmed_rel_mse: Option<f64>,
    /// Mean of the picture over mean of the reference.
    pub mean_ratio: Option<f64>,
    /// 1 / (seconds x MSE): higher is better.
    pub efficiency: Option<f64>,
    /// Seconds x trimmed relative error: lower is better.
    pub cost: Option<f64>,
}

/// Where the time of a scene goes, as shares in [0, 1]: from a render of its own, in which some pixels are timed.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PartsRow {
    /// The scene's name.
    pub scene: String,
    /// Rays on their way.
    pub traversal: f64,
    /// Surfaces, materials, lights, camera, sums.
    pub shading: f64,
    /// Look-ups of textures.
    pub texturing: f64,
    /// Sample points.
    pub sampling: f64,
}

impl PartsRow {
    fn new(scene: &str, b: Breakdown) -> Self {
        let Breakdown { traversal, texturing, sampling } = b;
        Self { scene: scene.into(), traversal, shading: b.shading().max(0.0), texturing, sampling }
    }
}

/// Renders that take less are repeated, so often.
const SHORT: f64 = 1.0;
const REPETITIONS: usize = 3;
/// Most samples per pixel of the render whose parts are timed.
const TIMED_SPP: u32 = 16;
/// Most bounces where the scene sets no limit, or none that a picture would need.
const BOUNCES: u32 = 64;

/// Renders scenes. What `monitor` cancels is left out, and a note says so.
///
/// ```
/// use std::sync::Arc;
/// use firsthit_import::SceneDesc;
/// use firsthit_measure::bench::{RenderBenchOptions, RenderSubject, run_renders};
/// let nothing = RenderSubject { name: "nothing".into(), scene: Arc::new(SceneDesc::default()), reference: None };
/// let options = RenderBenchOptions { spp: vec![4], threads: vec![1], size: (8, 8), ..Default::default() };
/// let bench = run_renders(&[nothing], &options, &())?;
/// assert_eq!((bench.rows[0].spp, bench.rows[0].rays), (4, 0)); // where there is nothing no ray is cast
/// # Ok::<(), firsthit_measure::MeasureError>(())
/// ```
///
/// # Errors
/// When a scene cannot be built or rendered, a reference is of another size, or no threads can be started.
pub fn run_renders(
    subjects: &[RenderSubject],
    options: &RenderBenchOptions,
    monitor: &dyn Monitor,
) -> Result<RenderBench, MeasureError> {
    let started = Instant::now();
    let bench = RenderBench {
        version: env!("CARGO_PKG_VERSION").into(),
        machine: machine(),
        seed: options.seed,
        ..RenderBench::default()
    };
    let samples: u64 = options.spp.iter().map(|s| u64::from(*s)).sum();
    let each = samples * options.threads.len() as u64 + u64::from(TIMED_SPP);
    let watch = Watch { monitor, before: 0, part: 0, total: each * subjects.len() as u64, rays: 0 };
    let mut run = Run { options, watch, bench, noise: Vec::new() };
    for subject in subjects {
        run.subject(subject)?;
    }
    let Run { mut bench, noise, .. } = run;
    if !noise.is_empty() {
        bench.machine.noise = Spread::new(&noise).median;
    }
    if monitor.cancelled() {
        bench.notes.push("interrupted: what was not measured yet is missing".into());
    }
    bench.notes.push("shares are of a render of its own on one thread, in which one pixel of seven is timed".into());
    bench.notes.push("timings are not pinned to a core: compare within one run only".into());
    bench.seconds = started.elapsed().as_secs_f64();
    Ok(bench)
}

/// Tells of each render as a part of all.
struct Watch<'a> {
    monitor: &'a dyn Monitor,
    /// Samples per pixel of what is done.
    before: u64,
    /// And of what is being done.
    part: u64,
    total: u64,
    rays: u64,
}

impl Monitor for Watch<'_> {
    fn progress(&self, done: u64, total: u64, rays: u64) {
        let part = (self.part as f64 * done as f64 / total.max(1) as f64) as u64;
        self.monitor.progress(self.before + part, self.total, self.rays + rays);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled()
    }
}

struct Run<'a> {
    options: &'a RenderBenchOptions,
    watch: Watch<'a>,
    bench: RenderBench,
    /// Relative spread of each repeated timing.
    noise: Vec<f64>,
}

impl Run<'_> {
    fn subject(&mut self, subject: &RenderSubject) -> Result<(), MeasureError> {
        let Settings { resolution, max_path_edges, .. } = subject.scene.settings;
        let (width, height) = resolution.unwrap_or(self.options.size);
        let bounces = max_path_edges.map_or(BOUNCES, |edges| edges.saturating_sub(1).min(BOUNCES));
        let usual = RenderOptions { width, height, max_depth: bounces, seed: self.options.seed, ..Default::default() };
        let failed = |error| MeasureError::Picture { model: subject.name.clone(), error };
        let aspect = f64::from(width) / f64::from(height);
        let stage_options = StageOptions { aspect, ..StageOptions::default() };
        if subject.reference.is_none() {
            self.bench.notes.push(format!("{}: there is no reference, so that only time is told of", subject.name));
        }
        // One scene for all threads: only the pool differs.
        let mut stage = None;
        for &threads in &self.options.threads {
            let pool = ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
            let pool = pool.map_err(|e| MeasureError::Threads(e.to_string()))?;
            if stage.is_none() {
                let build = BuildOptions { simd: self.options.simd, ..BuildOptions::default() };
                let made = pool.install(|| -> Result<Stage, PictureError> {
                    let accel = SceneBuilder::from_desc(&subject.scene, build).build()?;
                    Ok(Stage::new(subject.scene.clone(), accel, &stage_options)?)
                });
                stage = Some(made.map_err(failed)?);
            }
            let Some(stage) = &stage else { continue };
            for &spp in &self.options.spp {
                let options = RenderOptions { spp, ..usual.clone() };
                let Some(row) = pool.install(|| self.row(subject, stage, &options, threads)).map_err(failed)? else {
                    return Ok(());
                };
                self.bench.rows.push(row);
            }
        }
        let Some(stage) = stage else { return Ok(()) };
        let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| MeasureError::Threads(e.to_string()))?;
        let spp = self.options.spp.iter().copied().max().unwrap_or(1).min(TIMED_SPP);
        let options = RenderOptions { spp, profile: true, ..usual };
        self.watch.part = TIMED_SPP.into();
        let rendered = pool.install(|| render(&stage, &options, &self.watch)).map_err(|e| failed(e.into()))?;
        self.watch.before += self.watch.part;
        if let (Some(breakdown), false) = (rendered.stats.breakdown, rendered.interrupted) {
            self.bench.parts.push(PartsRow::new(&subject.name, breakdown));
        }
        Ok(())
    }

    /// One picture; `None` if it was interrupted.
    fn row(
        &mut self,
        subject: &RenderSubject,
        stage: &Stage,
        options: &RenderOptions,
        threads: usize,
    ) -> Result<Option<RenderRow>, PictureError> {
        self.watch.part = options.spp.into();
        let (mut seconds, mut last): (Vec<f64>, Option<Rendered>) = (Vec::new(), None);
        while seconds.len() < REPETITIONS && seconds.iter().sum::<f64>() < SHORT {
            let rendered = render(stage, options, &self.watch)?;
            if rendered.interrupted {
                return Ok(None);
            }
            self.watch.rays += rendered.stats.rays.total();
            seconds.push(rendered.stats.seconds);
            last = Some(rendered);
        }
        self.watch.before += self.watch.part;
        let Some(rendered) = last else { return Ok(None) };
        let spread = Spread::new(&seconds);
        if seconds.len() > 1 {
            self.noise.push(spread.relative());
        }
        let rays = rendered.stats.rays.total();
        let mut row = RenderRow {
            scene: subject.name.clone(),
            spp: options.spp,
            threads,
            seconds: spread.median,
            repetitions: seconds.len(),
            rays,
            mrays_per_s: rays as f64 / spread.median * 1e-6,
            ..RenderRow::default()
        };
        if let Some(reference) = &subject.reference {
            let c = picture::compare(reference, &rendered.film.color())?;
            row.mse = Some(c.mse);
            row.trimmed_rel_mse = Some(c.trimmed_rel_mse);
            row.mean_ratio = Some(c.mean_ratio);
            // Of equal pictures it is infinite, which JSON has not.
            row.efficiency = Some(1.0 / (spread.median * c.mse)).filter(|e| e.is_finite());
            row.cost = Some(spread.median * c.trimmed_rel_mse);
        }
        Ok(Some(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::bumpy_sphere;
    use crate::subject::desc_of;
    use std::sync::atomic::AtomicBool;

    const SIZE: (u32, u32) = (24, 16);

    fn subject(reference: Option<Picture>) -> RenderSubject {
        RenderSubject { name: "ball".into(), scene: Arc::new(desc_of(&bumpy_sphere(3))), reference }
    }

    fn quick() -> RenderBenchOptions {
        RenderBenchOptions { spp: vec![4, 16], threads: vec![1, 2], size: SIZE, seed: 3, simd: Level::default() }
    }

    fn flat(value: f32) -> Picture {
        let pixels = vec![[value, value, value, 1.0]; (SIZE.0 * SIZE.1) as usize];
        Picture { width: SIZE.0, height: SIZE.1, pixels }
    }

    #[test]
    fn each_scene_has_a_row_for_each_number_of_samples_and_threads_and_shares_of_its_time() {
        let bench = run_renders(&[subject(Some(flat(0.5))), subject(None)], &quick(), &()).unwrap();
        assert_eq!((bench.rows.len(), bench.parts.len()), (8, 2));
        for (i, row) in bench.rows.iter().enumerate() {
            let (spp, threads) = ([4, 16][i % 2], [1, 2][i / 2 % 2]);
            assert_eq!((row.spp, row.threads, row.repetitions), (spp, threads, REPETITIONS));
            assert!(row.seconds > 0.0 && row.rays >= u64::from(spp * SIZE.0 * SIZE.1), "{row:?}");
            assert_eq!([row.mse, row.efficiency, row.cost, row.mean_ratio].iter().all(Option::is_some), i < 4);
            if let (Some(mse), Some(trimmed)) = (row.mse, row.trimmed_rel_mse) {
                assert!((row.efficiency.unwrap() * row.seconds * mse - 1.0).abs() < 1e-9);
                assert!((row.cost.unwrap() / row.seconds / trimmed - 1.0).abs() < 1e-9);
            }
        }
        // The same bits by any number of threads.
        assert_eq!(bench.rows[0].mse, bench.rows[2].mse);
        for p in &bench.parts {
            let sum = p.traversal + p.shading + p.texturing + p.sampling;
            assert!((sum - 1.0).abs() < 1e-9 && p.traversal > 0.0 && p.sampling > 0.0, "{p:?}");
            assert_eq!(p.texturing, 0.0, "there is no texture");
        }
    }

    #[test]
    fn a_reference_of_another_size_is_an_error_and_an_interruption_is_noted() {
        let other = Picture { width: 1, height: 1, pixels: vec![[0.0; 4]] };
        let error = run_renders(&[subject(Some(other))], &quick(), &()).unwrap_err();
        assert!(error.to_string().starts_with("ball: pictures of 1 x 1"), "{error}");
        let bench = run_renders(&[subject(None)], &quick(), &AtomicBool::new(true)).unwrap();
        assert!(bench.rows.is_empty() && bench.parts.is_empty());
        assert!(bench.notes.iter().any(|n| n.starts_with("interrupted")));
    }
}
