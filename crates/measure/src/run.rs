//! One measurement: models, tiers and guards, ray sets; times and errors.

use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use firsthit_accel::{BuildError, BuildOptions, Guards, Hit, Level, Scene, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_render::{Monitor, RenderOptions};

use crate::metric::{Errors, Truth, compare, lost_by_traversal};
use crate::picture::{self, PictureError, PictureOptions};
use crate::result::{Accuracy, Machine, Model, TierRow};
use crate::shapes;
use crate::subject::Subject;
use crate::timing::{Paired, Spread};
use crate::verdict::verdict;
use crate::workload::{RayKind, RaySet, Size, ray_sets};

/// How much is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// Seconds: the tiers without their guards.
    Quick,
    /// Less than a minute.
    #[default]
    Normal,
    /// Minutes.
    Thorough,
}

impl Effort {
    fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Normal => "default",
            Self::Thorough => "thorough",
        }
    }

    fn size(self) -> Size {
        match self {
            Self::Quick => Size { picture: 64, aimed: 30_000 },
            Self::Normal => Size { picture: 96, aimed: 150_000 },
            Self::Thorough => Size { picture: 256, aimed: 2_000_000 },
        }
    }

    /// Least and most repetitions of a timing.
    fn repetitions(self) -> (usize, usize) {
        match self {
            Self::Quick => (9, 15),
            Self::Normal => (9, 31),
            Self::Thorough => (25, 101),
        }
    }

    /// For the timings of one model.
    fn budget(self) -> Duration {
        Duration::from_secs(match self {
            Self::Quick => 2,
            Self::Normal => 12,
            Self::Thorough => 180,
        })
    }
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// How much.
    pub effort: Effort,
    /// Of all rays.
    pub seed: u64,
    /// Tiers to report.
    pub tiers: Vec<Precision>,
    /// Kinds of rays.
    pub rays: Vec<RayKind>,
    /// Whether to measure the analytic shapes too.
    pub shapes: bool,
    /// Whether to render a picture of each model at each tier; never with [`Effort::Quick`].
    pub pictures: bool,
    /// The most demanding instructions that queries may use.
    pub simd: Level,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            effort: Effort::Normal,
            seed: 1,
            tiers: Precision::ALL.to_vec(),
            rays: RayKind::ALL.to_vec(),
            shapes: true,
            pictures: true,
            simd: Level::default(),
        }
    }
}

/// A model that cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// No trees can be built.
    #[error("{model}: {error}")]
    Build {
        /// The model's name.
        model: String,
        /// Why.
        error: BuildError,
    },
    /// The processor has no such instructions.
    #[error("this processor has no {0}")]
    Level(Level),
    /// No threads can be started.
    #[error("threads: {0}")]
    Threads(String),
    /// It cannot be rendered.
    #[error("{model}: {error}")]
    Picture {
        /// The model's name.
        model: String,
        /// Why.
        error: PictureError,
    },
}

/// Measures models. What `monitor` cancels is left out, and a note says so.
///
/// # Errors
/// When the trees of a model cannot be built.
pub fn run(subjects: &[Subject], options: &Options, monitor: &dyn Monitor) -> Result<Accuracy, MeasureError> {
    let started = Instant::now();
    let mut run = Run {
        options,
        monitor,
        done: 0,
        total: 0,
        rays: 0,
        accuracy: Accuracy {
            version: env!("CARGO_PKG_VERSION").into(),
            machine: machine(),
            seed: options.seed,
            effort: options.effort.name().into(),
            ..Accuracy::default()
        },
        noise: Vec::new(),
    };
    let steps = options.rays.len() * variants(options).len() + usize::from(run.renders());
    run.total = (subjects.len() * steps + usize::from(options.shapes)) as u64;
    for subject in subjects {
        let model = || subject.name.clone();
        run.subject(subject).map_err(|error| MeasureError::Build { model: model(), error })?;
        if run.renders() && !monitor.cancelled() {
            run.pictures(subject).map_err(|error| MeasureError::Picture { model: model(), error })?;
        }
    }
    if options.shapes && !monitor.cancelled() {
        let count = if options.effort == Effort::Quick { 500 } else { 4000 };
        run.accuracy.shapes = shapes::measure(count, options.effort.repetitions().0, options.seed, monitor);
        run.step(0);
    }
    let Run { mut accuracy, noise, .. } = run;
    accuracy.machine.noise = Spread::new(&noise).median;
    for model in &mut accuracy.models {
        model.verdict = verdict(&accuracy.tiers, &model.name);
    }
    if options.effort == Effort::Quick {
        accuracy.notes.push("quick: no pictures, and the robust tier's guards were not measured one by one".into());
    }
    if monitor.cancelled() {
        accuracy.notes.push("interrupted: what was not measured yet is missing".into());
    }
    accuracy.notes.push("timed on one thread, which is not pinned to a core".into());
    accuracy.seconds = started.elapsed().as_secs_f64();
    Ok(accuracy)
}

/// A way to build a model.
#[derive(Clone, Debug)]
struct Variant {
    /// Empty for a whole tier.
    guard: String,
    options: BuildOptions,
}

/// Tiers first, then the robust tier's guards.
fn variants(options: &Options) -> Vec<Variant> {
    let tier = |&precision: &Precision| Variant {
        guard: String::new(),
        options: BuildOptions { precision, simd: options.simd, ..BuildOptions::default() },
    };
    let robust = options.tiers.contains(&Precision::Robust) && options.effort != Effort::Quick;
    let guards = Guards::combinations().filter(|(_, g)| robust && *g != Guards::ALL).map(|(guard, guards)| Variant {
        guard,
        options: BuildOptions { precision: Precision::Robust, guards, simd: options.simd, ..BuildOptions::default() },
    });
    options.tiers.iter().map(tier).chain(guards).collect()
}

struct Run<'a> {
    options: &'a Options,
    monitor: &'a dyn Monitor,
    done: u64,
    total: u64,
    /// Compared so far.
    rays: u64,
    accuracy: Accuracy,
    /// Relative spread of each timing.
    noise: Vec<f64>,
}

/// Passes on a wish to stop, but not the progress of each picture.
struct Quiet<'a>(&'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// A ray set with what is right.
struct Asked {
    set: RaySet,
    truth: Vec<Option<Hit>>,
}

impl Run<'_> {
    fn step(&mut self, rays: u64) {
        self.done += 1;
        self.rays += rays;
        self.monitor.progress(self.done, self.total, self.rays);
    }

    fn subject(&mut self, subject: &Subject) -> Result<(), BuildError> {
        let Options { effort, seed, simd, .. } = *self.options;
        let build = |options| SceneBuilder::from_desc(&subject.desc, options).build();
        let of = |precision| build(BuildOptions { precision, simd, ..BuildOptions::default() });
        let best = of(Precision::ALL[Precision::ALL.len() - 1])?;
        let fast = of(Precision::Fast)?;
        let asked: Vec<Asked> = ray_sets(subject, &best, &fast, &self.options.rays, effort.size(), seed)
            .into_iter()
            .map(|set| {
                let mut truth = vec![None; set.rays.len()];
                best.par_closest_hits(&set.rays, &mut truth);
                Asked { set, truth }
            })
            .collect();
        self.accuracy.models.push(Model {
            name: subject.name.clone(),
            triangles: subject.triangles(),
            closed: subject.closed,
            verdict: String::new(),
        });

        let variants = variants(self.options);
        let (tiers, guards): (Vec<_>, Vec<_>) = variants.into_iter().partition(|v| v.guard.is_empty());
        // Half of the time for the tiers, the rest for the guards.
        let budget = effort.budget() / (2 * self.options.rays.len().max(1)) as u32;

        let mut scenes = vec![fast.clone()];
        for tier in &tiers {
            scenes.push(match tier.options.precision {
                Precision::Fast => fast.clone(),
                p if p == best.options().precision => best.clone(),
                p => of(p)?,
            });
        }
        for asked in &asked {
            self.group(subject, asked, &best, &scenes, &tiers, budget);
        }
        scenes.truncate(1);
        for guard in &guards {
            if self.monitor.cancelled() {
                break;
            }
            // One at a time: not all trees need be in memory.
            let pair = [fast.clone(), build(guard.options)?];
            for asked in &asked {
                self.group(subject, asked, &best, &pair, std::slice::from_ref(guard), budget / guards.len() as u32);
            }
        }
        Ok(())
    }

    fn renders(&self) -> bool {
        self.options.pictures && self.options.effort != Effort::Quick
    }

    /// Renders the model at each tier.
    fn pictures(&mut self, subject: &Subject) -> Result<(), PictureError> {
        let (width, height, spp) = match self.options.effort {
            Effort::Thorough => (640, 360, 4),
            _ => (320, 180, 1),
        };
        let of_tiers = PictureOptions::default().render;
        let render = RenderOptions { width, height, spp, seed: self.options.seed, ..of_tiers };
        let build = BuildOptions { simd: self.options.simd, ..BuildOptions::default() };
        let tiers = self.options.tiers.clone();
        let options = PictureOptions { tiers, render, build, ..PictureOptions::default() };
        let scene = Arc::new(subject.desc.clone());
        match picture::measure(&subject.name, &scene, &options, &Quiet(self.monitor)) {
            Ok(rows) => self.accuracy.pictures.extend(rows),
            Err(PictureError::Cancelled) => {}
            Err(error) => return Err(error),
        }
        self.step(0);
        Ok(())
    }

    /// Times and compares variants on one set of rays. `scenes` has the fast tier first, then that of each variant.
    fn group(
        &mut self,
        subject: &Subject,
        Asked { set, truth }: &Asked,
        best: &Scene,
        scenes: &[Scene],
        variants: &[Variant],
        budget: Duration,
    ) {
        let rays = &set.rays[..set.timed];
        let mut hits = vec![None; rays.len()];
        let mut any = vec![false; rays.len()];
        let cancelled = || self.monitor.cancelled();
        // The fast tier, if it is asked for too, is one scene: timed once.
        let same_as_first = |v: &Variant| v.guard.is_empty() && v.options.precision == Precision::Fast;
        let ways: Vec<&Scene> = std::iter::once(&scenes[0])
            .chain(scenes[1..].iter().zip(variants).filter(|(_, v)| !same_as_first(v)).map(|(s, _)| s))
            .collect();
        let ask = |way: usize| match set.kind {
            RayKind::Shadow => ways[way].any_hits(black_box(rays), black_box(&mut any)),
            _ => ways[way].closest_hits(black_box(rays), black_box(&mut hits)),
        };
        let paired = Paired::run(ways.len(), self.options.effort.repetitions(), budget, ask, cancelled);
        self.noise.push(paired.spread(0).relative());

        let mut way = 0;
        for (variant, scene) in variants.iter().zip(&scenes[1..]) {
            if self.monitor.cancelled() {
                return;
            }
            let own = if same_as_first(variant) {
                0
            } else {
                way += 1;
                way
            };
            let mut row = TierRow {
                model: subject.name.clone(),
                tier: variant.options.precision.name().into(),
                guard: variant.guard.clone(),
                rays: set.kind.name().into(),
                count: rays.len() as u64,
                ratio_to_fast: paired.ratio(own, 0),
                ..TierRow::default()
            };
            let ns = 1e9 / rays.len() as f64;
            let spread = paired.spread(own);
            (row.ns_low, row.ns_per_ray, row.ns_high) = (spread.low * ns, spread.median * ns, spread.high * ns);

            let truth = Truth { scene: best, hits: truth };
            let monitor = self.monitor;
            let errors = compare(subject, scene, truth, set, set.timed, &|| monitor.cancelled());
            self.blame(subject, variant, scene, set, &errors);
            let compared = errors.compared;
            errors.fill(&mut row, set);
            self.accuracy.tiers.push(row);
            self.step(compared);
        }
    }

    /// Says of leaks whose they are: the triangle test's or the traversal's.
    fn blame(&mut self, subject: &Subject, variant: &Variant, scene: &Scene, set: &RaySet, errors: &Errors) {
        if errors.leaked.is_empty() || self.monitor.cancelled() {
            return;
        }
        // Brute force over every triangle takes its time.
        let most = (20_000_000 / subject.triangles().max(1)).clamp(1, 1000) as usize;
        let rays: Vec<_> = errors.leaked.iter().take(most).map(|&k| set.rays[k]).collect();
        let traversal = lost_by_traversal(scene, &rays);
        let guard = if variant.guard.is_empty() { String::new() } else { format!(" ({})", variant.guard) };
        self.accuracy.notes.push(format!(
            "{}, {}{guard}: of {} leaks {} were tried again by brute force: {traversal} are the traversal's, {} the \
             triangle test's",
            subject.name,
            variant.options.precision,
            errors.leaked.len(),
            rays.len(),
            rays.len() - traversal
        ));
    }
}

/// The machine, as far as it can be told.
pub(crate) fn machine() -> Machine {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':').map(|(_, n)| n.trim().to_owned()));
    Machine {
        cpu: name.unwrap_or_else(|| "unknown".into()),
        cores: std::thread::available_parallelism().map_or(1, Into::into),
        os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        noise: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::bumpy_sphere;
    use crate::subject::desc_of;
    use std::sync::atomic::AtomicBool;

    fn small() -> Subject {
        Subject::new("small", desc_of(&bumpy_sphere(3)))
    }

    #[test]
    fn every_tier_and_kind_of_rays_has_a_row() {
        let options = Options { effort: Effort::Quick, shapes: false, pictures: false, ..Options::default() };
        let accuracy = run(&[small()], &options, &()).unwrap();
        assert_eq!(accuracy.tiers.len(), Precision::ALL.len() * RayKind::ALL.len());
        for row in &accuracy.tiers {
            assert!(row.ns_per_ray > 0.0 && row.ns_low <= row.ns_per_ray && row.ns_per_ray <= row.ns_high, "{row:?}");
            assert!(row.ratio_to_fast > 0.0 && (row.tier != "fast" || row.ratio_to_fast == 1.0));
            assert!(row.compared >= row.count && row.leaks.is_some() == (row.rays == "aimed"));
        }
        assert!(accuracy.models[0].closed && accuracy.models[0].verdict.starts_with("Use robust"));
        let leaked = accuracy.notes.iter().any(|n| n.contains("fast") && n.contains("brute force"));
        assert!(leaked, "{:?}", accuracy.notes);
    }

    #[test]
    fn only_what_is_asked_for_is_measured() {
        let tiers = vec![Precision::Double];
        let rays = vec![RayKind::Shadow];
        let options = Options {
            effort: Effort::Quick,
            tiers,
            rays,
            shapes: false,
            pictures: false,
            seed: 3,
            ..Options::default()
        };
        let accuracy = run(&[small()], &options, &()).unwrap();
        assert_eq!(accuracy.tiers.len(), 1);
        assert_eq!((accuracy.tiers[0].tier.as_str(), accuracy.tiers[0].rays.as_str()), ("double", "shadow"));
        assert!(accuracy.tiers[0].ratio_to_fast > 0.0, "the fast tier is timed beside it");
    }

    #[test]
    fn an_interrupted_run_says_so() {
        let accuracy = run(&[small()], &Options::default(), &AtomicBool::new(true)).unwrap();
        assert!(accuracy.tiers.is_empty() && accuracy.notes.iter().any(|n| n.starts_with("interrupted")));
    }
}
