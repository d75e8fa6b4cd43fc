//! The queries of one model, chunk by chunk.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

use firsthit_accel::{Scene, SignMethod, SphereHit};
use firsthit_geometry::Ray;
use firsthit_measure::random::Rng;
use glam::DVec3;

use super::angles::Angles;
use super::closed::Edges;
use super::judge_points::{self, Asked, FEW, Inside, Judge, METHODS};
use super::judge_rays::{self, all_hits};
use super::judge_regions;
use super::points::Points;
use super::rays::Rays;
use super::regions::{KINDS, Moving, Placed, Regions};
use super::sieve::Sieve;
use super::tally::{Source, Tally};
use super::{UNSIEVED, corners, scene};
use crate::model::Model;

/// What is asked.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Rays, and points, from everywhere.
    pub random: usize,
    /// At what is hard.
    pub aimed: usize,
    /// Whether rays are asked.
    pub rays: bool,
    /// Whether points are.
    pub points: bool,
    /// Whether regions and spheres that move are.
    pub regions: bool,
    /// Powers of two by which the mesh is scaled.
    pub exponents: Vec<i32>,
    /// Of so many chunks of queries one is asked at these scales too.
    pub scaled_every: usize,
    /// Seed of rays and points.
    pub seed: u64,
}

/// What came of it.
pub struct Outcome {
    /// The numbers.
    pub tally: Tally,
    /// How the mesh is made.
    pub edges: Edges,
    /// Pairs of triangles that meet elsewhere than in what they share: with any, normals do not tell inside from outside.
    pub self_intersections: usize,
    /// [`Judge::worst_distance`].
    pub worst_distance: f64,
    /// [`Judge::worst_winding`].
    pub worst_winding: f64,
    /// Seconds that it took.
    pub seconds: f64,
    /// Whether it was interrupted.
    pub interrupted: bool,
}

/// Queries that are asked together.
const CHUNK: usize = 256;

/// Whether to stop, and what to say on the way: how much is done.
pub struct Watch<'a> {
    /// Set from outside.
    pub stop: &'a AtomicBool,
    /// Told the name of what is done, how much of it, and how many wrong answers there are.
    pub say: &'a dyn Fn(&str, f64, u64),
}

/// Asks and judges.
///
/// # Errors
/// When the model cannot be built at one of the scales.
pub fn run(model: &Model, plan: &Plan, watch: &Watch<'_>) -> Result<Outcome, String> {
    let start = Instant::now();
    let mesh = &model.mesh;
    let whole = scene(mesh, 0)?;
    let scaled: Vec<(i32, Scene)> =
        plan.exponents.iter().map(|&e| Ok((e, scene(mesh, e)?))).collect::<Result<_, String>>()?;
    let edges = Edges::new(mesh);
    let self_intersections = whole.self_intersections().len();
    let mut tally = Tally::new(&model.name, mesh.triangles.len());
    let corners = corners(mesh);
    let sieve = Sieve::new(&corners);

    let mut job = Job { plan, watch, corners: &corners, sieve: &sieve, tally: &mut tally };
    if plan.rays {
        job.rays(&whole, &scaled);
    }
    let methods: Vec<(SignMethod, &str)> = METHODS
        .into_iter()
        .filter(|(method, _)| match method {
            SignMethod::Winding | SignMethod::FastWinding { .. } => true,
            SignMethod::Pseudonormal => edges.closed() && self_intersections == 0,
            _ => edges.ends == 0,
        })
        .collect();
    let size = whole.bounds().extent().length();
    let mut judge = Judge { corners: &corners, closed: edges.closed(), size, worst_distance: 0.0, worst_winding: 0.0 };
    if plan.points {
        job.points(&whole, &scaled, &methods, &mut judge);
    }
    let (worst_distance, worst_winding) = (judge.worst_distance, judge.worst_winding);
    if plan.regions {
        job.regions(&whole, &scaled);
    }
    let interrupted = watch.stop.load(Relaxed);
    let seconds = start.elapsed().as_secs_f64();
    Ok(Outcome { tally, edges, self_intersections, worst_distance, worst_winding, seconds, interrupted })
}

struct Job<'a> {
    plan: &'a Plan,
    watch: &'a Watch<'a>,
    corners: &'a [[DVec3; 3]],
    sieve: &'a Sieve,
    tally: &'a mut Tally,
}

impl Job<'_> {
    /// Chunks of queries of both sources.
    fn chunks(&mut self, what: &str, mut each: impl FnMut(&mut Self, Source, usize, usize)) {
        for (source, count) in [(Source::Random, self.plan.random), (Source::Aimed, self.plan.aimed)] {
            for start in (0..count).step_by(CHUNK) {
                if self.watch.stop.load(Relaxed) {
                    return;
                }
                each(self, source, start, CHUNK.min(count - start));
                let done = (start + CHUNK) as f64 / count as f64;
                (self.watch.say)(&format!("{what}, {source:?}"), done.min(1.0), self.tally.wrong());
            }
        }
    }

    /// All triangles for a few of the queries, those that the sieve leaves for the others.
    fn of<'b>(&self, all: &'b [u32], sieved: &'b [u32], index: usize) -> &'b [u32] {
        if index.is_multiple_of(UNSIEVED) { all } else { sieved }
    }

    fn rays(&mut self, whole: &Scene, scaled: &[(i32, Scene)]) {
        let mut make = Rays::new(self.corners, self.plan.seed);
        let mut sieved = Vec::new();
        let all: Vec<u32> = (0..self.corners.len() as u32).collect();
        self.chunks("rays", |job, source, start, count| {
            let rays: Vec<Ray<f64>> = (0..count).map(|_| make.next(source)).collect();
            let lines: Vec<_> = rays.iter().map(|r| (r.origin, r.direction)).collect();
            job.sieve.near_lines(&lines, &mut sieved);
            let answers = judge_rays::Answers::new(whole, &rays);
            for (i, (ray, near)) in rays.iter().zip(&sieved).enumerate() {
                let of = job.of(&all, near, start + i);
                let expected = all_hits(ray, job.corners, of.iter().copied());
                answers.judge(i, ray, &expected, source, job.tally);
            }
            for (exponent, scene) in scaled.iter().filter(|_| (start / CHUNK).is_multiple_of(job.plan.scaled_every)) {
                let rays: Vec<_> = rays.iter().map(|r| judge_rays::scaled(r, *exponent)).collect();
                judge_rays::Answers::new(scene, &rays).compare(&answers, *exponent, source, job.tally);
            }
        });
    }

    fn points(
        &mut self,
        whole: &Scene,
        scaled: &[(i32, Scene)],
        methods: &[(SignMethod, &'static str)],
        judge: &mut Judge<'_>,
    ) {
        let asked = Asked::new(whole, methods);
        let scaled: Vec<(i32, Asked)> = scaled.iter().map(|(e, scene)| (*e, Asked::new(scene, methods))).collect();
        let mut make = Points::new(self.corners, self.plan.seed ^ 0x5eed);
        let mut rng = Rng(self.plan.seed ^ 0xd1ec);
        let angles = Angles::new(self.corners);
        let (mut near, mut around) = (Vec::new(), Vec::new());
        let all: Vec<u32> = (0..self.corners.len() as u32).collect();
        self.chunks("points", |job, source, start, count| {
            let points: Vec<DVec3> = (0..count).map(|_| make.next(source)).collect();
            job.sieve.near_points(&points, FEW, &mut near);
            // Not the direction that the library takes.
            let rays: Vec<Ray<f64>> = points.iter().map(|p| Ray::new(*p, rng.direction())).collect();
            if judge.closed {
                let lines: Vec<_> = rays.iter().map(|r| (r.origin, r.direction)).collect();
                job.sieve.near_lines(&lines, &mut around);
            }
            let answers = judge_points::Answers::new(&asked, &points);
            for (i, p) in points.iter().enumerate() {
                let inside = if judge.closed {
                    Inside::of_closed(&rays[i], job.corners, job.of(&all, &around[i], start + i))
                } else {
                    Inside { winding: Some(angles.with_care(*p, &near[i], job.corners)), odd: false }
                };
                let of = job.of(&all, &near[i], start + i);
                judge.judge((&asked, &answers), (i, *p), of, inside, source, job.tally);
            }
            for (exponent, asked) in scaled.iter().filter(|_| (start / CHUNK).is_multiple_of(job.plan.scaled_every)) {
                let points: Vec<_> = points.iter().map(|p| *p * 2f64.powi(*exponent)).collect();
                let there = judge_points::Answers::new(asked, &points);
                judge_points::compare(asked, &there, &answers, *exponent, source, job.tally);
            }
        });
    }
}

/// Regions of each kind, and spheres that move.
impl Job<'_> {
    fn regions(&mut self, whole: &Scene, scaled: &[(i32, Scene)]) {
        let mut make = Regions::new(self.corners, self.plan.seed ^ 0x4e61);
        let mut sieved = Vec::new();
        let all: Vec<u32> = (0..self.corners.len() as u32).collect();
        let size = self.corners.iter().flatten().fold(0.0, |m: f64, p| m.max(p.length()));
        for kind in 0..KINDS {
            self.chunks("regions", |job, source, start, count| {
                let placed: Vec<Placed> = (0..count).map(|_| make.next(kind, source)).collect();
                let balls: Vec<_> = placed.iter().map(|p| (p.middle, p.reach)).collect();
                job.sieve.near_balls(&balls, &mut sieved);
                let answers: Vec<_> = placed.iter().map(|p| judge_regions::ask(whole, &p.region)).collect();
                for (i, (placed, near)) in placed.iter().zip(&sieved).enumerate() {
                    let of = job.of(&all, near, start + i);
                    judge_regions::judge(&answers[i], placed, job.corners, of, (source, size), job.tally);
                }
                for (exponent, scene) in scaled.iter().filter(|_| (start / CHUNK).is_multiple_of(job.plan.scaled_every))
                {
                    for (placed, answer) in placed.iter().zip(&answers) {
                        let there = judge_regions::ask(scene, &placed.region.scaled(*exponent));
                        let tell = || format!("{answer:?} became {there:?}: {:?}", placed.region);
                        job.tally.add(placed.region.name(), (source, *exponent), there == *answer, tell);
                    }
                }
            });
        }
        self.chunks("spheres that move", |job, source, start, count| {
            let moving: Vec<Moving> = (0..count).map(|_| make.moving(source)).collect();
            let balls = moving.iter().map(|m| (m.way.at(0.5), m.radius + 0.5 * m.way.direction.length()));
            job.sieve.near_balls(&balls.collect::<Vec<_>>(), &mut sieved);
            let cast = |scene: &Scene, m: &Moving, s: f64| {
                let way = Ray::new(m.way.origin * s, m.way.direction * s).with_interval(m.way.t_min, m.way.t_max);
                scene.cast_sphere(&way, m.radius * s)
            };
            let answers: Vec<_> = moving.iter().map(|m| cast(whole, m, 1.0)).collect();
            for (i, (moving, near)) in moving.iter().zip(&mut sieved).enumerate() {
                // Of the ball about the whole way most is far from it.
                near.retain(|&t| judge_regions::is_near(moving, job.corners[t as usize]));
                let of = job.of(&all, near, start + i);
                judge_regions::judge_cast(answers[i].as_ref(), moving, job.corners, of, (source, size), job.tally);
            }
            for (exponent, scene) in scaled.iter().filter(|_| (start / CHUNK).is_multiple_of(job.plan.scaled_every)) {
                for (moving, answer) in moving.iter().zip(&answers) {
                    let there = cast(scene, moving, 2f64.powi(*exponent));
                    let same = |h: &SphereHit| (h.id, h.t);
                    let right = there.as_ref().map(same) == answer.as_ref().map(same);
                    let tell = || format!("{answer:?} became {there:?}: {moving:?}");
                    job.tally.add(judge_regions::CAST, (source, *exponent), right, tell);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::bumpy_sphere;

    #[test]
    fn a_ball_has_no_wrong_answers_and_an_open_one_neither() {
        let mut mesh = bumpy_sphere(3);
        for open in [false, true] {
            if open {
                mesh.triangles.truncate(700);
            }
            let model = Model { name: "ball".into(), mesh: mesh.clone() };
            let (random, aimed, exponents) = (3000, 3000, vec![-40, 20]);
            let plan =
                Plan { random, aimed, rays: true, points: true, regions: true, exponents, scaled_every: 1, seed: 1 };
            let watch = Watch { stop: &AtomicBool::new(false), say: &|_, _, _| {} };
            let outcome = run(&model, &plan, &watch).unwrap();
            assert_eq!(outcome.tally.wrong(), 0, "{:#?}", outcome.tally.failures);
            assert_eq!(outcome.edges.closed(), !open);
            let asked: u64 = outcome.tally.rows.iter().map(|r| r.asked).sum();
            assert!(asked > 300_000, "{asked}");
        }
    }
}
