//! Errors of a tier against the most careful one.

use firsthit_accel::{Crossings, Hit, Scene};
use firsthit_geometry::error::difference_of_products;
use firsthit_geometry::transform::Transform;
use firsthit_geometry::{Precision, Ray, Real};
use glam::DVec3;
use rayon::prelude::*;

use crate::decision::{Decision, Level};
use crate::random::Rng;
use crate::result::TierRow;
use crate::subject::{Placed, Subject};
use crate::timing::quantile;
use crate::workload::RaySet;

/// How far apart, relative to their length, rays are close: beyond what roundings of f32 do at a clear hit.
const NEARBY: f64 = 128.0 * f32::EPSILON as f64;

/// Rays that one task compares.
const CHUNK: usize = 1024;

/// What is wrong with the answers to some rays.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    /// Rays compared.
    pub compared: u64,
    /// Hits where exactly there is none, by level.
    pub false_hits: [u64; 3],
    /// No hit where exactly there is one, by level.
    pub false_misses: [u64; 3],
    /// Another triangle than any of the exactly nearest.
    pub wrong_ids: u64,
    /// Rays that went through a surface which all rays close around hit: see [`TierRow::slipped`].
    pub slipped: u64,
    /// Rays from inside that hit nothing, by their index.
    pub leaked: Vec<usize>,
    /// Bounced rays that hit the triangle they left.
    pub self_hits: u64,
    /// Bounced rays.
    pub bounces: u64,
    /// Of the rays in `counted`, those for which the exact tier needed more than `f64`.
    pub fallbacks: u64,
    /// The first rays, of which a hit is bounced.
    pub counted: u64,
    /// Error of t in f32 ulps, of hits on an exactly nearest triangle.
    t_ulp: Vec<f64>,
    t_ulp_kappa_max: f64,
    /// Distance of `ray.at(t)` from the triangle's plane, in f32 ulps of the point's largest coordinate.
    surface_ulp: Vec<f64>,
    /// Angle to the accurate normal, in radians.
    normal: Vec<f64>,
}

/// What answers are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// The model at the most careful tier.
    pub scene: &'a Scene,
    /// Its answers to the rays of the set.
    pub hits: &'a [Option<Hit>],
}

/// Compares a scene's answers with the true ones, and bounces a ray off every hit of the first `bounces` rays.
#[must_use]
pub fn compare(
    subject: &Subject,
    scene: &Scene,
    truth: Truth<'_>,
    set: &RaySet,
    bounces: usize,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Errors {
    let chunks = set.rays.par_chunks(CHUNK).zip(truth.hits.par_chunks(CHUNK)).enumerate();
    let compared = chunks.map(|(c, (rays, hits))| {
        let mut errors = Errors::default();
        if cancelled() {
            return errors;
        }
        for (k, (ray, exact)) in rays.iter().zip(hits).enumerate() {
            let index = c * CHUNK + k;
            let found = scene.closest_hit(ray);
            errors.compare(subject, truth.scene, ray, found.as_ref(), exact.as_ref());
            if set.inside && found.is_none() {
                errors.leaked.push(index);
            }
            if index < bounces {
                errors.counted += 1;
                errors.fallbacks += u64::from(scene.closest_hit_counted(ray).1.fallbacks > 0);
            }
            if let Some(hit) = found.filter(|_| index < bounces) {
                errors.bounce(scene, ray, &hit, &mut Rng(index as u64));
            }
        }
        errors
    });
    compared.reduce(Errors::default, Errors::merge)
}

impl Errors {
    fn compare(&mut self, subject: &Subject, exact: &Scene, ray: &Ray<f64>, found: Option<&Hit>, truth: Option<&Hit>) {
        self.compared += 1;
        match (found, truth) {
            (None, None) => {}
            (Some(hit), None) => self.false_hits[level(subject, ray, hit)] += 1,
            (None, Some(first)) => {
                // The clearest of all hits: none of them was found.
                let all = exact.all_hits(ray, Crossings::Triangles);
                let clearest = all.iter().chain([first]).map(|h| level(subject, ray, h)).min();
                self.false_misses[clearest.unwrap_or(Level::Exact as usize)] += 1;
                self.slipped += u64::from(slipped(subject, exact, ray, first, f64::INFINITY));
            }
            (Some(hit), Some(first)) => {
                // One of several that are exactly nearest is as good as the first of them.
                let end = ray.with_interval(ray.t_min, first.t);
                if hit.id == first.id || exact.any_hit_filtered(&end, None, |h| h.id == hit.id && h.t == first.t) {
                    self.place(subject, ray, hit, first);
                } else {
                    self.wrong_ids += 1;
                    // Clearly behind: at an edge the neighbour's t differs by roundings.
                    let behind = hit.t - first.t > 2.0 * NEARBY * first.t.abs();
                    self.slipped += u64::from(behind && slipped(subject, exact, ray, first, hit.t));
                }
            }
        }
    }

    /// Notes how far off a hit on the right triangle is.
    fn place(&mut self, subject: &Subject, ray: &Ray<f64>, hit: &Hit, exact: &Hit) {
        let error = (hit.t - exact.t).abs() / ulp(exact.t);
        self.t_ulp.push(error);
        let Some(triangle) = subject.triangle(hit.id) else { return };
        if let Some(d) = Decision::new(&triangle, ray) {
            self.t_ulp_kappa_max = self.t_ulp_kappa_max.max(error / d.kappa);
        }
        let Some(normal) = accurate_normal(&triangle) else { return };
        self.normal.push(hit.normal().cross(normal).length().atan2(hit.normal().dot(normal)));
        let point = ray.at(hit.t);
        let off = triangle.in_world().map(|v| (point - v).dot(normal).abs());
        self.surface_ulp.push(off[0].min(off[1]).min(off[2]) / ulp(point.abs().max_element()));
    }

    /// Sends a ray away from a hit on the side it was seen from. Nothing is told of where it starts: the offset alone
    /// must do.
    fn bounce(&mut self, scene: &Scene, ray: &Ray<f64>, hit: &Hit, rng: &mut Rng) {
        let facing = hit.normal_against(ray.direction);
        if facing == DVec3::ZERO {
            return;
        }
        let direction = facing * (1.0 + 1e-9) + rng.direction();
        let from = scene.surface_point(ray, hit).spawn(direction);
        let next = scene.closest_hit(&Ray::new(from, direction));
        self.bounces += 1;
        self.self_hits += u64::from(next.is_some_and(|n| n.id == hit.id));
    }

    fn merge(mut self, other: Self) -> Self {
        self.compared += other.compared;
        for k in 0..3 {
            self.false_hits[k] += other.false_hits[k];
            self.false_misses[k] += other.false_misses[k];
        }
        self.wrong_ids += other.wrong_ids;
        self.slipped += other.slipped;
        self.leaked.extend(other.leaked);
        self.self_hits += other.self_hits;
        self.bounces += other.bounces;
        self.fallbacks += other.fallbacks;
        self.counted += other.counted;
        self.t_ulp.extend(other.t_ulp);
        self.t_ulp_kappa_max = self.t_ulp_kappa_max.max(other.t_ulp_kappa_max);
        self.surface_ulp.extend(other.surface_ulp);
        self.normal.extend(other.normal);
        self
    }

    /// Fills the fields of a row that these errors are about.
    pub fn fill(mut self, row: &mut TierRow, set: &RaySet) {
        row.leaks = set.inside.then_some(self.leaked.len() as u64);
        row.aimed_rays = if set.inside { self.compared } else { 0 };
        row.compared = self.compared;
        row.false_hits = self.false_hits.iter().sum();
        row.false_misses = self.false_misses.iter().sum();
        row.false_hits_by_level = self.false_hits;
        row.false_misses_by_level = self.false_misses;
        row.wrong_ids = self.wrong_ids;
        row.slipped = self.slipped;
        row.self_hits = self.self_hits;
        row.bounces = self.bounces;
        let exact = row.tier == Precision::Exact.name() && self.counted > 0;
        row.fallback_rate = exact.then(|| self.fallbacks as f64 / self.counted as f64);
        self.t_ulp.sort_by(f64::total_cmp);
        self.surface_ulp.sort_by(f64::total_cmp);
        self.normal.sort_by(f64::total_cmp);
        (row.t_ulp_p50, row.t_ulp_p99, row.t_ulp_max) =
            (quantile(&self.t_ulp, 0.5), quantile(&self.t_ulp, 0.99), quantile(&self.t_ulp, 1.0));
        row.t_ulp_kappa_max = self.t_ulp_kappa_max;
        (row.surface_ulp_p99, row.surface_ulp_max) =
            (quantile(&self.surface_ulp, 0.99), quantile(&self.surface_ulp, 1.0));
        (row.normal_p99, row.normal_max) = (quantile(&self.normal, 0.99), quantile(&self.normal, 1.0));
    }
}

/// Of leaked rays, those that brute force over all triangles hits: they were lost by the traversal, the others by the
/// triangle test.
#[must_use]
pub fn lost_by_traversal(scene: &Scene, rays: &[Ray<f64>]) -> usize {
    let hits = |ray: &&Ray<f64>| scene.closest_hit_in_order(ray, firsthit_accel::VisitOrder::Exhaustive).is_some();
    rays.par_iter().filter(hits).count()
}

/// Whether a ray went through a surface that has no end near its exact first hit, on to `beyond`.
fn slipped(subject: &Subject, exact: &Scene, ray: &Ray<f64>, first: &Hit, beyond: f64) -> bool {
    let triangle = subject.triangle(first.id);
    let ends = triangle.is_some_and(|triangle| {
        let near = Decision::new(&triangle, ray).map_or([true; 3], |d| d.edges.map(|e| e < NEARBY));
        subject.ends_at(&triangle, near)
    });
    !ends && hit_all_around(exact, ray, first.t, beyond)
}

/// Whether rays that differ from `ray` by some roundings of f32 all hit something near `t`, and before the middle
/// between `t` and `beyond`: then the surface there has no end that rounding could have found.
fn hit_all_around(exact: &Scene, ray: &Ray<f64>, t: f64, beyond: f64) -> bool {
    let side = ray.direction.any_orthogonal_vector().normalize() * ray.direction.length();
    let up = ray.direction.normalize().cross(side);
    let end = (t + 0.01 * t.abs()).min(0.5 * t + 0.5 * beyond);
    (0..8).all(|k| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
        let direction = ray.direction + (side * cos + up * sin) * NEARBY;
        exact.any_hit(&Ray { direction, t_max: end.min(ray.t_max), origin: ray.origin, t_min: ray.t_min })
    })
}

/// How excusable a wrong decision about a hit is, as an index: see [`Level`]. Of shapes the margin is not known.
fn level(subject: &Subject, ray: &Ray<f64>, hit: &Hit) -> usize {
    let decision = subject.triangle(hit.id).and_then(|t| Decision::new(&t, ray));
    decision.map_or(Level::Exact, |d| d.level()) as usize
}

/// The spacing of `f32` at `x`.
#[must_use]
pub fn ulp(x: f64) -> f64 {
    x.abs().power_of_two_below() * f64::from(f32::EPSILON)
}

/// The unit normal in the world from products without cancellation: right to some roundings of `f64` for any aspect.
fn accurate_normal(triangle: &Placed) -> Option<DVec3> {
    let [a, b, c] = triangle.corners.map(|p| p.as_dvec3());
    let (p, q) = (b - a, c - a);
    let normal = DVec3::new(
        difference_of_products(p.y, q.z, p.z, q.y),
        difference_of_products(p.z, q.x, p.x, q.z),
        difference_of_products(p.x, q.y, p.y, q.x),
    );
    let normal = normal * (1.0 / normal.abs().max_element().power_of_two_below());
    (normal != DVec3::ZERO).then(|| Transform::new(triangle.transform).ok().map(|m| m.normal(normal)))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::Subject;
    use crate::workload::{RayKind, Size, ray_sets};
    use firsthit_accel::{BuildOptions, SceneBuilder};

    fn errors(options: BuildOptions, kind: RayKind) -> (TierRow, Errors) {
        let subject = Subject::builtin();
        let build = |options| SceneBuilder::from_desc(&subject.desc, options).build().unwrap();
        let best = Precision::ALL[Precision::ALL.len() - 1];
        let exact = build(BuildOptions { precision: best, ..BuildOptions::default() });
        let set = ray_sets(&subject, &exact, &exact, &[kind], Size { picture: 32, aimed: 20_000 }, 1).remove(0);
        let hits: Vec<_> = set.rays.iter().map(|r| exact.closest_hit(r)).collect();
        let truth = Truth { scene: &exact, hits: &hits };
        let errors = compare(&subject, &build(options), truth, &set, usize::MAX, &|| false);
        let mut row = TierRow::default();
        errors.clone().fill(&mut row, &set);
        (row, errors)
    }

    fn tier(precision: Precision) -> BuildOptions {
        BuildOptions { precision, ..BuildOptions::default() }
    }

    #[test]
    fn the_fast_tier_leaks_and_others_do_not() {
        let (fast, errors) = errors_of_fast();
        assert!(fast.leaks.unwrap() > 0 && fast.aimed_rays == 20_000);
        assert_eq!(fast.false_misses_by_level[0], 0, "rounding excuses what it loses at edges");
        assert_eq!(errors.leaked.len() as u64, fast.false_misses);
        assert!(fast.slipped > fast.false_misses / 2, "inside, leaks are slips, but for narrow ridges: {fast:?}");
        assert!(fast.t_ulp_max > 0.5 && fast.t_ulp_p50 < 4.0 && fast.t_ulp_kappa_max < 16.0);
        for precision in &Precision::ALL[1..] {
            let row = self::errors(tier(*precision), RayKind::Aimed).0;
            assert_eq!((row.leaks, row.false_hits, row.slipped), (Some(0), 0, 0), "{precision}");
            assert!(row.t_ulp_max < 1e-3 && row.normal_max < 1e-7 && row.surface_ulp_max < 1.0, "{row:?}");
        }
    }

    fn errors_of_fast() -> (TierRow, Errors) {
        errors(tier(Precision::Fast), RayKind::Aimed)
    }

    #[test]
    fn bounced_rays_do_not_hit_what_they_left() {
        for precision in Precision::ALL {
            let row = errors(tier(precision), RayKind::Primary).0;
            assert!(row.bounces > 300 && row.leaks.is_none());
            assert_eq!(row.self_hits, 0, "{precision}");
        }
    }
}
