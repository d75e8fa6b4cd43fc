//! Whether answers are right.

use firsthit_geometry::Real;
use firsthit_measure::decision::{Decision, Level};
use firsthit_measure::subject::Placed;
use glam::DAffine3;
use rayon::prelude::*;

use crate::model::Model;
use crate::peer::{Answer, Ray32};
use crate::rays::RaySet;
use crate::reference::{Reference, Truth, double};

/// Wrong answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wrong {
    /// Hit or miss differs from the reference, or `t` by more than 1e-4 of it and 1e-5 of the model's diagonal.
    pub all: u64,
    /// Of these, those where the reference's hit is further than 1e-4 (barycentric) inside its triangle.
    pub sure: u64,
    /// What no rounding of single precision excuses: a decision with a margin of 64 roundings that is wrong, a surface
    /// gone through that all rays close around hit, or a `t` that is off by more than 16 roundings times its condition.
    pub inexcusable: u64,
}

impl std::ops::Add for Wrong {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { all: self.all + o.all, sure: self.sure + o.sure, inexcusable: self.inexcusable + o.inexcusable }
    }
}

/// Judges the answers to every `stride`-th ray of a set.
#[must_use]
pub fn judge(model: &Model, reference: &Reference<'_>, set: &RaySet, stride: usize, answers: &[Answer]) -> Wrong {
    let judge = Judge { model, reference, diagonal: f64::from(model.diagonal()), any: set.kind.any() };
    let each = answers.par_iter().enumerate();
    each.map(|(k, a)| judge.one(&set.rays[k * stride], set.truth[k * stride].as_ref(), a))
        .reduce(Wrong::default, |a, b| a + b)
}

/// How far apart rays of length 1 are close: beyond what roundings of single precision do at a clear hit.
const NEARBY: f32 = 128.0 * f32::EPSILON;

struct Judge<'a> {
    model: &'a Model,
    reference: &'a Reference<'a>,
    diagonal: f64,
    any: bool,
}

impl Judge<'_> {
    fn one(&self, ray: &Ray32, truth: Option<&Truth>, answer: &Answer) -> Wrong {
        let wrong = match truth {
            Some(t) if answer.is_hit() => !self.any && (answer.t - t.t).abs() > 1e-4 * t.t + 1e-5 * self.diagonal,
            other => other.is_some() != answer.is_hit(),
        };
        let sure = wrong && truth.is_some_and(|t| t.inside > 1e-4);
        let inexcusable = match truth {
            None if !answer.is_hit() => false,
            // Of an any-hit query it is not known what was hit: is there anything that could be in doubt?
            None if self.any => !self.near(ray).any(|d| d.level() > Level::F32),
            None => self.clear(ray, answer.triangle),
            Some(truth) if !answer.is_hit() => self.lost(ray, truth, f64::INFINITY),
            Some(_) if self.any => false,
            Some(truth) => self.misplaced(ray, truth, answer),
        };
        Wrong { all: wrong.into(), sure: sure.into(), inexcusable: inexcusable.into() }
    }

    fn decision(&self, ray: &Ray32, triangle: u32) -> Option<Decision> {
        let corners = self.model.mesh.triangles.get(triangle as usize)?.map(|i| self.model.mesh.positions[i as usize]);
        Decision::new(&Placed { corners, transform: DAffine3::IDENTITY }, &double(ray))
    }

    fn clear(&self, ray: &Ray32, triangle: u32) -> bool {
        self.decision(ray, triangle).is_none_or(|d| d.level() == Level::F32)
    }

    /// All triangles that a slightly thicker ray might meet.
    fn near(&self, ray: &Ray32) -> impl Iterator<Item = Decision> {
        self.reference.near(ray, 1e-5 * self.diagonal).into_iter().filter_map(|t| self.decision(ray, t))
    }

    /// Whether a clear hit before `end` was not found, or the surface at the true one was gone through.
    fn lost(&self, ray: &Ray32, truth: &Truth, end: f64) -> bool {
        let clear = || self.reference.all(ray).iter().any(|hit| hit.t < end && self.clear(ray, hit.triangle));
        (truth.t < end && self.surrounded(ray, truth.t, end)) || clear()
    }

    /// Whether eight rays close around, beyond what roundings do, all hit something near `t` and well before `end`: then
    /// the surface has no end there.
    fn surrounded(&self, ray: &Ray32, t: f64, end: f64) -> bool {
        let side = ray.direction.any_orthonormal_vector();
        let up = ray.direction.cross(side);
        let t_max = (t + 0.01 * t.abs()).min(0.5 * (t + end)).min(f64::from(ray.t_max)) as f32;
        (0..8).all(|k| {
            let (sin, cos) = (k as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            let direction = ray.direction + (side * cos + up * sin) * NEARBY;
            self.reference.any(&Ray32 { direction, t_max, ..*ray }).is_some()
        })
    }

    fn misplaced(&self, ray: &Ray32, truth: &Truth, answer: &Answer) -> bool {
        let Some(decision) = self.decision(ray, answer.triangle) else { return true };
        let allowed = 16.0 * decision.kappa * f64::from(f32::UNIT_ROUNDOFF) * truth.t.abs();
        match answer.t - truth.t {
            off if off.abs() <= allowed => false,
            _ if answer.triangle == truth.triangle => true,
            off if off > 0.0 => self.lost(ray, truth, answer.t - allowed),
            _ => self.clear(ray, answer.triangle),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peer::{Firsthit, Peer as _};
    use crate::rays::{Kind, ray_sets};
    use firsthit_geometry::Precision;
    use firsthit_measure::mesh::bumpy_sphere;

    #[test]
    fn right_answers_pass_and_wrong_ones_do_not() {
        let model = Model { name: "ball".into(), mesh: bumpy_sphere(4) };
        let reference = Reference::new(&model.mesh);
        for set in ray_sets(&model, &reference, &Kind::ALL, 4096).unwrap() {
            let engine = Firsthit::new(&model.mesh, Precision::Robust);
            let mut batch = engine.batch(&set.rays, set.kind).unwrap();
            batch.ask(false);
            let good = batch.answers();
            assert_eq!(judge(&model, &reference, &set, 1, &good), Wrong::default(), "{}", set.kind);
            let hits = good.iter().filter(|a| a.is_hit()).count() as u64;
            let none = judge(&model, &reference, &set, 1, &vec![Answer::MISS; good.len()]);
            assert_eq!(none.all, hits);
            assert!(none.sure <= hits && none.inexcusable >= none.sure * 9 / 10, "{none:?}");
            if !set.kind.any() {
                let late: Vec<Answer> = good.iter().map(|a| Answer { t: a.t * 1.001, ..*a }).collect();
                assert_eq!(judge(&model, &reference, &set, 1, &late).inexcusable, hits);
            }
        }
    }
}
