//! How fast queries are on the user's own model and machine: every layout, tier and build that is asked for, and obvhs's
//! own traversals beside them, in turn on the same rays. And how fast pictures become good: [`run_renders`].

mod engine;
mod rays;
mod render;
mod result;

use std::time::{Duration, Instant};

use firsthit_accel::{BuildQuality, Layout, Level};
use firsthit_geometry::Precision;
use firsthit_render::Monitor;
use rayon::ThreadPoolBuilder;

use crate::run::{MeasureError, machine};
use crate::subject::Subject;
use crate::timing::{Paired, Spread, quantile};

use self::engine::{Asked, Engine, Spec};
pub use self::rays::BenchRays;
use self::rays::{Set, ray_sets};
pub use self::render::{PartsRow, RenderBench, RenderBenchOptions, RenderRow, RenderSubject, run_renders};
pub use self::result::{Bench, BenchModel, BuildRow, SpeedRow};

/// What to measure: every combination of layouts, tiers, levels and builds.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Kinds of rays.
    pub rays: Vec<BenchRays>,
    /// Memory layouts.
    pub layouts: Vec<Layout>,
    /// Tiers.
    pub precisions: Vec<Precision>,
    /// Instructions that queries may use; those that the processor has not are an error.
    pub levels: Vec<Level>,
    /// How trees are built.
    pub builds: Vec<BuildQuality>,
    /// Whether obvhs's own traversals are measured too.
    pub peers: bool,
    /// Threads of builds and queries.
    pub threads: usize,
    /// Rays of each kind.
    pub count: usize,
    /// Of all rays.
    pub seed: u64,
    /// For the timings of all models together.
    pub budget: Duration,
}

impl Default for BenchOptions {
    fn default() -> Self {
        Self {
            rays: BenchRays::ALL.to_vec(),
            layouts: Layout::ALL.to_vec(),
            precisions: vec![Precision::Fast, Precision::Robust],
            levels: vec![engine::usual_level()],
            builds: vec![BuildQuality::default()],
            peers: true,
            threads: 1,
            count: 1 << 16,
            seed: 1,
            budget: Duration::from_secs(20),
        }
    }
}

/// Least and most repetitions of a timing.
const REPETITIONS: (usize, usize) = (5, 31);

/// Measures models. What `monitor` cancels is left out, and a note says so.
///
/// ```no_run
/// use firsthit_measure::{Subject, bench::{self, BenchOptions}};
/// let bench = bench::run(&[Subject::builtin()], &BenchOptions::default(), &())?;
/// for row in &bench.rows {
///     println!("{} {}: {:.1} million rays a second", row.engine, row.rays, row.mrays_per_s_median);
/// }
/// # Ok::<(), firsthit_measure::MeasureError>(())
/// ```
///
/// # Errors
/// When the trees of a model cannot be built, a level is not there, or no threads can be started.
pub fn run(subjects: &[Subject], options: &BenchOptions, monitor: &dyn Monitor) -> Result<Bench, MeasureError> {
    let started = Instant::now();
    if let Some(level) = options.levels.iter().find(|l| !l.is_available()) {
        return Err(MeasureError::Level(*level));
    }
    let pool = ThreadPoolBuilder::new().num_threads(options.threads.max(1)).build();
    let pool = pool.map_err(|e| MeasureError::Threads(e.to_string()))?;
    let specs = Spec::all(options);
    let mut run = Run {
        options,
        monitor,
        done: 0,
        total: (subjects.len() * (specs.len() + options.rays.len())) as u64,
        rays: 0,
        noise: Vec::new(),
        bench: Bench {
            version: env!("CARGO_PKG_VERSION").into(),
            machine: machine(),
            seed: options.seed,
            threads: options.threads.max(1),
            ..Bench::default()
        },
    };
    // The pool's threads do all the work, so that builds and parallel queries take no more than was asked for.
    pool.install(|| subjects.iter().try_for_each(|s| run.subject(s, &specs, options.budget / subjects.len() as u32)))?;
    let Run { mut bench, noise, .. } = run;
    bench.machine.noise = Spread::new(&noise).median;
    if monitor.cancelled() {
        bench.notes.push("interrupted: what was not measured yet is missing".into());
    }
    bench.notes.push("nodes are counted by their boxes; of any-hit queries nothing is counted".into());
    bench.notes.push("timings are not pinned to a core: compare within one run only".into());
    bench.seconds = started.elapsed().as_secs_f64();
    Ok(bench)
}

struct Run<'a> {
    options: &'a BenchOptions,
    monitor: &'a dyn Monitor,
    done: u64,
    total: u64,
    /// Asked so far.
    rays: u64,
    /// Relative spread of each timing.
    noise: Vec<f64>,
    bench: Bench,
}

impl Run<'_> {
    fn step(&mut self) {
        self.done += 1;
        self.monitor.progress(self.done, self.total, self.rays);
    }

    fn subject(&mut self, subject: &Subject, specs: &[Spec], budget: Duration) -> Result<(), MeasureError> {
        let failed = |error| MeasureError::Build { model: subject.name.clone(), error };
        let model = BenchModel { name: subject.name.clone(), triangles: subject.triangles() };
        self.bench.models.push(model);
        let mut engines: Vec<Engine> = Vec::new();
        for spec in specs {
            if self.monitor.cancelled() {
                return Ok(());
            }
            match Engine::build(spec, subject).map_err(failed)? {
                Some(engine) => {
                    self.bench.builds.push(engine.row(subject));
                    engines.push(engine);
                }
                None => self.bench.notes.push(format!(
                    "{}: {} is left out: it has no instances, and so many triangles of its own would not fit",
                    subject.name,
                    spec.name()
                )),
            }
            self.step();
        }
        let sets = ray_sets(subject, self.options).map_err(failed)?;
        for set in &sets {
            if self.monitor.cancelled() {
                return Ok(());
            }
            self.set(subject, &engines, set, budget / sets.len() as u32);
            self.step();
        }
        Ok(())
    }

    /// Times all engines on one set of rays.
    fn set(&mut self, subject: &Subject, engines: &[Engine], set: &Set, budget: Duration) {
        if set.rays.is_empty() {
            self.bench.notes.push(format!("{}: there are no {} rays: nothing is seen", subject.name, set.kind));
            return;
        }
        let parallel = self.options.threads > 1;
        let mut asked: Vec<Asked<'_>> = engines.iter().map(|e| e.asked(set)).collect();
        let monitor = self.monitor;
        let ask = |way: usize| asked[way].ask(parallel);
        let paired = Paired::run(engines.len(), REPETITIONS, budget, ask, || monitor.cancelled());
        for (way, (engine, asked)) in engines.iter().zip(&asked).enumerate() {
            let mut seconds = paired.seconds[way].clone();
            if seconds.is_empty() {
                return;
            }
            seconds.sort_by(f64::total_cmp);
            self.noise.push(Spread::new(&seconds).relative());
            self.rays += (seconds.len() * set.rays.len()) as u64;
            let speed = |q: f64| set.rays.len() as f64 / quantile(&seconds, q) * 1e-6;
            let (boxes, primitives) = engine.counts(set).unzip();
            self.bench.rows.push(SpeedRow {
                model: subject.name.clone(),
                engine: engine.name().into(),
                rays: set.kind.name().into(),
                count: set.rays.len() as u64,
                repetitions: seconds.len() as u64,
                mrays_per_s_best: speed(0.0),
                mrays_per_s_median: speed(0.5),
                hits: asked.hits(),
                boxes_per_ray: boxes,
                primitives_per_ray: primitives,
            });
        }
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

    fn quick() -> BenchOptions {
        BenchOptions { count: 1024, budget: Duration::ZERO, ..BenchOptions::default() }
    }

    #[test]
    fn every_engine_has_a_row_for_each_kind_of_rays_and_all_agree() {
        for threads in [1, 2] {
            let options = BenchOptions { levels: vec![Level::Scalar], threads, ..quick() };
            let bench = run(&[small()], &options, &()).unwrap();
            let engines = 2 * Layout::ALL.len() + 2;
            assert_eq!((bench.builds.len(), bench.rows.len()), (engines, engines * BenchRays::ALL.len()));
            for row in &bench.rows {
                assert!(row.mrays_per_s_best >= row.mrays_per_s_median && row.mrays_per_s_median > 0.0, "{row:?}");
                assert!(row.repetitions == 5 && row.count > 100);
                let first = bench.rows.iter().find(|r| r.rays == row.rays).unwrap();
                assert!(row.hits.abs_diff(first.hits) <= 2, "{row:?} {first:?}");
                let counted = !row.engine.starts_with("obvhs") && !["shadow", "ao"].contains(&row.rays.as_str());
                assert_eq!(row.boxes_per_ray.is_some_and(|n| n > 1.0), counted, "{row:?}");
            }
            for build in &bench.builds {
                assert!(build.seconds > 0.0 && build.bytes_per_triangle > 30.0 && build.depth != Some(0), "{build:?}");
            }
            assert!(bench.rows.iter().any(|r| r.rays == "random" && r.hits > 0));
        }
    }

    #[test]
    fn only_what_is_asked_for_is_measured() {
        let options = BenchOptions {
            rays: vec![BenchRays::Ao],
            layouts: vec![Layout::Bvh2],
            precisions: vec![Precision::Exact],
            builds: vec![BuildQuality::Fast, BuildQuality::High],
            peers: false,
            ..quick()
        };
        let bench = run(&[small()], &options, &()).unwrap();
        let names: Vec<&str> = bench.rows.iter().map(|r| r.engine.as_str()).collect();
        assert_eq!(names, ["exact bvh2 fast", "exact bvh2 high"]);
    }

    #[test]
    fn an_interrupted_run_says_so() {
        let bench = run(&[small()], &quick(), &AtomicBool::new(true)).unwrap();
        assert!(bench.rows.is_empty() && bench.notes.iter().any(|n| n.starts_with("interrupted")));
    }
}
