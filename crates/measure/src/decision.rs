//! How clear it is whether a ray meets a triangle, and how well conditioned where.

use firsthit_geometry::transform::Transform;
use firsthit_geometry::{Ray, Real};
use glam::DVec3;

use crate::subject::Placed;

/// The lowest precision whose rounding leaves no excuse for a wrong decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Single.
    F32,
    /// Double.
    F64,
    /// Neither: nearer to the edge than 64 roundings of `f64`.
    Exact,
}

/// So many roundings of a precision are a margin.
const UNITS: f64 = 64.0;

/// A ray against a triangle, in the mesh's own space and in double precision.
#[derive(Clone, Copy, Debug)]
pub struct Decision {
    /// How far the decisive quantity is from changing sign, relative to the sum of the absolute values of its terms: an
    /// edge function, or `t` against an end of the interval. Negative for a miss. What the ray's rounding to `f32` adds
    /// is in the terms: coordinates count instead of their differences.
    pub margin_f32: f64,
    /// The same with the differences as terms, as `f64` has the ray exactly.
    pub margin_f64: f64,
    /// The part of `margin_f32` of each edge, by the vertex opposite to it.
    pub edges: [f64; 3],
    /// Condition of `t`: sum of the absolute terms of its numerator over its magnitude, plus that of its denominator.
    /// A backward-stable evaluation of unit roundoff u errs by at most `16 kappa u` relative. Infinite for t = 0.
    pub kappa: f64,
}

impl Decision {
    /// Looks at a ray of the world and a placed triangle. `None` where the triangle cannot be placed.
    #[must_use]
    pub fn new(placed: &Placed, ray: &Ray<f64>) -> Option<Self> {
        let ray = Transform::new(placed.transform).ok()?.ray_to_object(ray);
        Some(Self::local(placed.corners.map(|p| p.as_dvec3()), &ray))
    }

    fn local(v: [DVec3; 3], ray: &Ray<f64>) -> Self {
        let d = ray.direction;
        let [a, b, c] = v.map(|p| p - ray.origin);
        let edges = [triple(d, b, c), triple(d, c, a), triple(d, a, b)];
        let orientation = edges.iter().map(|e| e.0).sum::<f64>().signum();

        // With all terms of the coordinates: |p| + |o| for p - o.
        let coarse = v.map(|p| p.abs() + ray.origin.abs());
        let sizes = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| size(d.abs(), coarse[i], coarse[j]));
        let relative =
            |sizes: [f64; 3]| [0, 1, 2].map(|k| if sizes[k] > 0.0 { orientation * edges[k].0 / sizes[k] } else { 0.0 });
        let least = |margins: [f64; 3]| margins[0].min(margins[1]).min(margins[2]);

        let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
        let (numerator, denominator) = (triple(a, e1, e2), triple(d, e1, e2));
        let t = numerator.0 / denominator.0;
        let kappa = numerator.1 / numerator.0.abs() + denominator.1 / denominator.0.abs();
        let end = |gap: f64, end: f64| {
            let size = t.abs() * kappa + end.abs();
            if end.is_finite() && size > 0.0 { gap / size } else { f64::INFINITY }
        };
        let interval = end(t - ray.t_min, ray.t_min).min(end(ray.t_max - t, ray.t_max));
        Self {
            margin_f32: least(relative(sizes)).min(interval),
            margin_f64: least(relative(edges.map(|e| e.1))).min(interval),
            edges: relative(sizes),
            kappa: if kappa.is_finite() { kappa } else { f64::INFINITY },
        }
    }

    /// The level of the decision.
    #[must_use]
    pub fn level(&self) -> Level {
        if self.margin_f32.abs() >= UNITS * f64::from(f32::UNIT_ROUNDOFF) {
            Level::F32
        } else if self.margin_f64.abs() >= UNITS * f64::UNIT_ROUNDOFF {
            Level::F64
        } else {
            Level::Exact
        }
    }
}

/// `a.(b x c)` and the sum of the absolute values of its terms.
fn triple(a: DVec3, b: DVec3, c: DVec3) -> (f64, f64) {
    (a.dot(b.cross(c)), size(a.abs(), b.abs(), c.abs()))
}

/// The sum of the terms of `a.(b x c)`, all with the sign +.
fn size(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let plus = |x: f64, y: f64| x + y;
    a.dot(DVec3::new(plus(b.y * c.z, b.z * c.y), plus(b.z * c.x, b.x * c.z), plus(b.x * c.y, b.y * c.x)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, Vec3};

    fn decision(corners: [Vec3; 3], ray: Ray<f64>) -> Decision {
        Decision::new(&Placed { corners, transform: DAffine3::IDENTITY }, &ray).unwrap()
    }

    const TRIANGLE: [Vec3; 3] = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];

    #[test]
    fn levels_follow_the_distance_from_the_edge() {
        let at = |y: f64| decision(TRIANGLE, Ray::new(DVec3::new(0.0, y, 1.0), DVec3::NEG_Z));
        for (y, level, hit) in [
            (-0.5, Level::F32, true),
            (-1.5, Level::F32, false),
            (-1.0 + 1e-7, Level::F64, true),
            (-1.0 - 1e-7, Level::F64, false),
            (-1.0 + 1e-15, Level::F64, true),
            (-1.0, Level::Exact, true),
        ] {
            let d = at(y);
            assert_eq!((d.level(), d.margin_f64 >= 0.0), (level, hit), "{y}: {d:?}");
        }
    }

    #[test]
    fn ends_of_the_interval_decide_too() {
        let ray = Ray::new(DVec3::new(0.0, -0.5, 1.0), DVec3::NEG_Z);
        assert_eq!(decision(TRIANGLE, ray.with_interval(0.0, 1.0)).level(), Level::Exact);
        assert_eq!(decision(TRIANGLE, ray.with_interval(0.0, 2.0)).level(), Level::F32);
        assert!(decision(TRIANGLE, ray.with_interval(0.0, 0.5)).margin_f64 < 0.0);
    }

    /// The definition of the hard cases: their condition numbers are met.
    #[test]
    fn kappa_is_that_of_the_hard_cases() {
        use crate::corpus::{self, Primitive};
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/corpus");
        let mut compared = 0;
        for case in corpus::read(std::path::Path::new(folder)).unwrap() {
            let (Primitive::Triangle { v }, Some(kappa)) = (&case.prim, case.expect.kappa) else { continue };
            let found = decision(v.map(corpus::vector), case.ray.to_f64()).kappa;
            if found.is_finite() {
                assert!((found / kappa - 1.0).abs() < 0.01, "{}: {found} {kappa}", case.id);
                compared += 1;
            }
        }
        assert!(compared > 150, "{compared}");
    }
}
