//! What brute force says of a ray, and what the library says.

use firsthit_accel::{Crossings, Hit, HitLists, Scene};
use firsthit_geometry::Ray;
use firsthit_geometry::exact::{ExactHit, ExactRay};
use glam::DVec3;

use super::tally::{Source, Tally};

/// A hit of a triangle, by brute force.
pub struct Found {
    /// The triangle.
    pub triangle: u32,
    /// The exact hit.
    pub hit: ExactHit,
}

/// All hits of a ray with the triangles of a list, in exact order, then by number.
#[must_use]
pub fn all_hits(ray: &Ray<f64>, corners: &[[DVec3; 3]], of: impl Iterator<Item = u32>) -> Vec<Found> {
    let Some(exact) = ExactRay::new(*ray) else { return Vec::new() };
    let found = |triangle: u32| Some(Found { triangle, hit: exact.hit(corners[triangle as usize])? });
    let mut hits: Vec<Found> = of.filter_map(found).collect();
    hits.sort_by(|a, b| exact.order(&a.hit, &b.hit).then(a.triangle.cmp(&b.triangle)));
    hits
}

/// Everything that the library says about some rays.
pub struct Answers {
    closest: [Vec<Option<Hit>>; 2],
    any: [Vec<bool>; 2],
    all: [HitLists; 2],
    first: [Vec<Vec<Hit>>; 2],
    counts: [Vec<u32>; 2],
}

const BOTH: [Crossings; 2] = [Crossings::Triangles, Crossings::Surfaces];

/// Of the first few hits of a ray so many are asked for.
const fn few(index: usize) -> usize {
    1 + index % 4
}

impl Answers {
    /// Asks everything: one by one, and many at once where there is a way to.
    #[must_use]
    pub fn new(scene: &Scene, rays: &[Ray<f64>]) -> Self {
        let (mut closest, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
        scene.closest_hits(rays, &mut closest);
        scene.any_hits(rays, &mut any);
        let first = |what| rays.iter().enumerate().map(|(i, r)| scene.first_k_hits(r, few(i), what)).collect();
        let counts = |what| rays.iter().map(|r| scene.count_hits(r, what)).collect();
        Self {
            closest: [rays.iter().map(|r| scene.closest_hit(r)).collect(), closest],
            any: [rays.iter().map(|r| scene.any_hit(r)).collect(), any],
            all: BOTH.map(|what| scene.all_hits_each(rays, what)),
            first: BOTH.map(first),
            counts: BOTH.map(counts),
        }
    }

    /// Against brute force: ids, their order and the bits of `t`.
    pub fn judge(&self, i: usize, ray: &Ray<f64>, expected: &[Found], source: Source, tally: &mut Tally) {
        let of = (source, 0);
        let told = |got: &dyn std::fmt::Debug| {
            let expected: Vec<_> = expected.iter().map(|f| (f.triangle, f.hit.t, f.hit.crosses)).collect();
            format!("{ray:?}: {got:?} instead of {expected:?}")
        };
        for (query, got) in ["closest_hit", "closest_hits"].into_iter().zip(&self.closest) {
            let right = match (&got[i], expected.first()) {
                (Some(hit), Some(found)) => same(hit, found),
                (got, expected) => got.is_none() == expected.is_none(),
            };
            tally.add(query, of, right, || told(&got[i]));
        }
        for (query, got) in ["any_hit", "any_hits"].into_iter().zip(&self.any) {
            tally.add(query, of, got[i] != expected.is_empty(), || told(&got[i]));
        }
        for (k, what) in BOTH.into_iter().enumerate() {
            let counts = |f: &&Found| what == Crossings::Triangles || f.hit.crosses;
            let expected: Vec<&Found> = expected.iter().filter(counts).collect();
            let equal = |got: &[Hit], count: usize| {
                got.len() == expected.len().min(count) && got.iter().zip(&expected).all(|(g, e)| same(g, e))
            };
            let all = self.all[k].get(i).unwrap_or_default();
            tally.add(ALL[k], of, equal(all, usize::MAX), || told(&all));
            tally.add(FIRST[k], of, equal(&self.first[k][i], few(i)), || told(&self.first[k][i]));
            tally.add(COUNT[k], of, self.counts[k][i] as usize == expected.len(), || told(&self.counts[k][i]));
        }
    }

    /// Against the answers `whole` for the mesh and the rays that these are a power of two of: nothing but sizes may change.
    pub fn compare(&self, whole: &Self, exponent: i32, source: Source, tally: &mut Tally) {
        let of = (source, exponent);
        let scale = 2f64.powi(exponent);
        let equal = |a: &Hit, b: &Hit| {
            let parts = |h: &Hit, t: f64| (h.id, t.to_bits(), h.u.to_bits(), h.v.to_bits());
            parts(a, a.t) == parts(b, b.t * scale)
        };
        let lists = |a: &[Hit], b: &[Hit]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b));
        for i in 0..self.closest[0].len() {
            for (k, query) in ["closest_hit", "closest_hits"].into_iter().enumerate() {
                let (a, b) = (&self.closest[k][i], &whole.closest[k][i]);
                tally.add(query, of, lists(a.as_slice(), b.as_slice()), || format!("{a:?} {b:?}"));
            }
            for (k, query) in ["any_hit", "any_hits"].into_iter().enumerate() {
                tally.add(query, of, self.any[k][i] == whole.any[k][i], String::new);
            }
            for k in 0..2 {
                let (a, b) = (self.all[k].get(i).unwrap_or_default(), whole.all[k].get(i).unwrap_or_default());
                tally.add(ALL[k], of, lists(a, b), || format!("{a:?} {b:?}"));
                let (a, b) = (&self.first[k][i], &whole.first[k][i]);
                tally.add(FIRST[k], of, lists(a, b), || format!("{a:?} {b:?}"));
                tally.add(COUNT[k], of, self.counts[k][i] == whole.counts[k][i], String::new);
            }
        }
    }
}

const ALL: [&str; 2] = ["all_hits, triangles", "all_hits, surfaces"];
const FIRST: [&str; 2] = ["first_k_hits, triangles", "first_k_hits, surfaces"];
const COUNT: [&str; 2] = ["count_hits, triangles", "count_hits, surfaces"];

fn same(hit: &Hit, found: &Found) -> bool {
    // -0 is given as 0.
    (hit.id.instance, hit.id.geometry, hit.id.primitive, hit.t.to_bits())
        == (0, 0, found.triangle, (found.hit.t + 0.0).to_bits())
}

/// A ray of a scene that is scaled by a power of two: its parameter is scaled too.
#[must_use]
pub fn scaled(ray: &Ray<f64>, exponent: i32) -> Ray<f64> {
    let scale = 2f64.powi(exponent);
    Ray { origin: ray.origin * scale, direction: ray.direction, t_min: ray.t_min * scale, t_max: ray.t_max * scale }
}
