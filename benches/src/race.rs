//! Engines take turns on the same rays, so that what disturbs the machine disturbs all alike.

use std::borrow::Cow;
use std::hint::black_box;
use std::time::Duration;

use firsthit_accel::Level;
use rayon::{ThreadPool, prelude::*};
use serde::Serialize;

use crate::engine::{Built, Engine};
use crate::judge::{Wrong, judge};
use crate::model::Model;
use crate::peer::{Answer, Batch, Peer, Ray32};
use crate::rays::{Kind, RaySet, ray_sets};
use crate::reference::Reference;
use firsthit_measure::timing::{Paired, quantile};

/// What is raced.
#[derive(Clone, Debug)]
pub struct Course {
    /// The engines.
    pub engines: Vec<Engine>,
    /// Kinds of rays.
    pub kinds: Vec<Kind>,
    /// Rays of each kind.
    pub count: usize,
    /// Repetitions that are timed; one more comes before, whose answers are judged.
    pub repetitions: usize,
    /// Times that each tree is built; the best counts.
    pub builds: usize,
    /// The level of firsthit's instructions, if it is forced.
    pub simd: Option<Level>,
}

/// One engine on one kind of rays.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The model's name.
    pub scene: String,
    /// Its triangles.
    pub triangles: usize,
    /// The kind of rays.
    pub rays: &'static str,
    /// Rays asked.
    pub count: usize,
    /// The engine.
    pub engine: &'static str,
    /// Millions of rays a second: in the best repetition.
    pub mrays_per_s_best: f64,
    /// In the median one.
    pub mrays_per_s_median: f64,
    /// Wrong answers: see [`Wrong::all`].
    pub wrong: u64,
    /// See [`Wrong::sure`].
    pub wrong_sure: u64,
    /// See [`Wrong::inexcusable`].
    pub wrong_inexcusable: u64,
    /// Seconds to build the tree.
    pub build_s: f64,
    /// Bytes that it holds: see [`Built::bytes`].
    pub bytes_per_triangle: f64,
    /// Bytes of nodes and primitives by the engine's own account.
    pub own_bytes_per_triangle: Option<f64>,
}

/// Races over one model. `say` is told what is going on.
///
/// # Errors
/// When the model cannot be looked at. An engine that cannot be built is only said to be left out.
pub fn race(model: &Model, course: &Course, pool: &ThreadPool, say: &dyn Fn(String)) -> Result<Vec<Row>, String> {
    let name = &model.name;
    let triangles = model.mesh.triangles.len();
    say(format!("{name}: {triangles} triangles; making rays and finding what is right"));
    let reference = Reference::new(&model.mesh);
    let sets = ray_sets(model, &reference, &course.kinds, course.count)?;

    // One tree for all engines that ask it.
    let mut built: Vec<(Engine, Built)> = Vec::new();
    let mut asked: Vec<(Engine, usize)> = Vec::new();
    for engine in &course.engines {
        if let Some(at) = built.iter().position(|(e, _)| e.tree == engine.tree) {
            asked.push((*engine, at));
            continue;
        }
        match build(engine, model, course, pool) {
            Ok(b) => {
                say(format!("{name}: {} built in {:.2} s", engine.name, b.seconds));
                asked.push((*engine, built.len()));
                built.push((*engine, b));
            }
            Err(why) => say(format!("{name}: {} is left out: {why}", engine.name)),
        }
    }

    let mut rows = Vec::new();
    for set in &sets {
        say(format!("{name}: {} rays", set.kind));
        let runners: Vec<(Engine, &Built, Runner<'_>)> = asked
            .iter()
            .filter_map(|(e, at)| {
                let b = &built[*at].1;
                Some((*e, b, Runner::new(e, b.peer.as_ref(), set)?))
            })
            .collect();
        rows.extend(one_set(model, &reference, set, course, pool, runners));
    }
    Ok(rows)
}

fn build(engine: &Engine, model: &Model, course: &Course, pool: &ThreadPool) -> Result<Built, String> {
    let once = || engine.tree.build(&model.mesh, pool, course.simd);
    let mut built = once()?;
    for _ in 1..course.builds {
        let best = built.seconds;
        // The old one first: large trees twice may not fit into memory.
        drop(built);
        built = once()?;
        built.seconds = built.seconds.min(best);
    }
    Ok(built)
}

fn one_set(
    model: &Model,
    reference: &Reference<'_>,
    set: &RaySet,
    course: &Course,
    pool: &ThreadPool,
    mut runners: Vec<(Engine, &Built, Runner<'_>)>,
) -> Vec<Row> {
    let ask = |way: usize, runners: &mut [(Engine, &Built, Runner<'_>)]| runners[way].2.ask(pool);
    let times = (course.repetitions, course.repetitions);
    let count = runners.len();
    let paired = Paired::run(count, times, Duration::MAX, |way| ask(way, black_box(&mut runners)), || false);
    let triangles = model.mesh.triangles.len();
    let rows = runners.into_iter().zip(paired.seconds).map(|((engine, built, runner), mut seconds)| {
        seconds.sort_by(f64::total_cmp);
        let speed = |q: f64| runner.len() as f64 / quantile(&seconds, q) * 1e-6;
        let wrong: Wrong = judge(model, reference, set, engine.stride, &runner.answers());
        Row {
            scene: model.name.clone(),
            triangles,
            rays: set.kind.name(),
            count: runner.len(),
            engine: engine.name,
            mrays_per_s_best: speed(0.0),
            mrays_per_s_median: speed(0.5),
            wrong: wrong.all,
            wrong_sure: wrong.sure,
            wrong_inexcusable: wrong.inexcusable,
            build_s: built.seconds,
            bytes_per_triangle: built.bytes as f64 / triangles as f64,
            own_bytes_per_triangle: built.peer.own_bytes().map(|b| b as f64 / triangles as f64),
        }
    });
    rows.collect()
}

/// Rays put to an engine, with room for its answers.
enum Runner<'a> {
    Closest { peer: &'a dyn Peer, rays: Cow<'a, [Ray32]>, answers: Vec<Answer> },
    Any { peer: &'a dyn Peer, rays: Cow<'a, [Ray32]>, answers: Vec<bool> },
    Batch { batch: Box<dyn Batch + 'a>, len: usize },
}

/// Rays that one task takes where there are several threads.
const CHUNK: usize = 4096;

impl<'a> Runner<'a> {
    fn new(engine: &Engine, peer: &'a dyn Peer, set: &'a RaySet) -> Option<Self> {
        let rays: Cow<'a, [Ray32]> = match engine.stride {
            1 => Cow::Borrowed(&set.rays),
            stride => set.rays.iter().step_by(stride).copied().collect(),
        };
        let len = rays.len();
        if engine.batch {
            return Some(Self::Batch { batch: peer.batch(&rays, set.kind)?, len });
        }
        Some(match set.kind.any() {
            true => Self::Any { peer, rays, answers: vec![false; len] },
            false => Self::Closest { peer, rays, answers: vec![Answer::MISS; len] },
        })
    }

    fn ask(&mut self, pool: &ThreadPool) {
        let parallel = pool.current_num_threads() > 1;
        match self {
            Self::Closest { peer, rays, answers } if parallel => {
                let chunks = rays.par_chunks(CHUNK).zip(answers.par_chunks_mut(CHUNK));
                pool.install(|| chunks.for_each(|(r, a)| peer.closest_each(r, a)));
            }
            Self::Any { peer, rays, answers } if parallel => {
                let chunks = rays.par_chunks(CHUNK).zip(answers.par_chunks_mut(CHUNK));
                pool.install(|| chunks.for_each(|(r, a)| peer.any_each(r, a)));
            }
            Self::Batch { batch, .. } if parallel => pool.install(|| batch.ask(true)),
            Self::Closest { peer, rays, answers } => peer.closest_each(rays, answers),
            Self::Any { peer, rays, answers } => peer.any_each(rays, answers),
            Self::Batch { batch, .. } => batch.ask(false),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Closest { rays, .. } | Self::Any { rays, .. } => rays.len(),
            Self::Batch { len, .. } => *len,
        }
    }

    fn answers(&self) -> Vec<Answer> {
        match self {
            Self::Closest { answers, .. } => answers.clone(),
            Self::Any { answers, .. } => {
                let of = |hit: &bool| if *hit { Answer { triangle: 0, ..Answer::MISS } } else { Answer::MISS };
                answers.iter().map(of).collect()
            }
            Self::Batch { batch, .. } => batch.answers(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::named;
    use firsthit_measure::mesh::bumpy_sphere;
    use std::cell::RefCell;

    #[test]
    fn every_engine_that_is_here_has_a_row_for_each_kind_and_few_wrong_answers() {
        let model = Model { name: "ball".into(), mesh: bumpy_sphere(4) };
        let said = RefCell::new(Vec::new());
        for threads in [1, 2] {
            let course = Course {
                engines: named(&[]).unwrap(),
                kinds: Kind::ALL.to_vec(),
                count: 2048,
                repetitions: 3,
                builds: 2,
                simd: None,
            };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let rows = race(&model, &course, &pool, &|s| said.borrow_mut().push(s)).unwrap();
            let left_out = said.take().iter().filter(|s| s.contains("left out")).count();
            assert!(rows.len() >= 4 * 11, "{} rows, {left_out} engines left out", rows.len());
            for row in &rows {
                assert!(row.mrays_per_s_best >= row.mrays_per_s_median && row.mrays_per_s_median > 0.0);
                assert!(row.build_s > 0.0 && row.count >= 256);
                assert!(row.wrong_sure == 0 && row.wrong_inexcusable == 0, "{row:?}");
                let robust = ["firsthit-robust", "firsthit-exact", "firsthit-robust-batch"].contains(&row.engine);
                assert!(!robust || row.wrong == 0, "{row:?}");
            }
        }
    }
}
