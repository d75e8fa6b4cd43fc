//! What the exact forms of several shapes share.

use core::ops::ControlFlow;

use glam::DVec3;

use super::{ExactSurfaceHit, ExactVisitor, SurfaceHit};
use crate::exact::Root;
use crate::exact::number::{Number, differences, dot, vector};
use crate::exact::quadratic::{Count, Equation, Formula, Fraction, Quadratic, Side};
use crate::{Aabb, Ray, Real};

/// Visits the roots that are in the ray's interval and `admitted`. Returns whether exact numbers were needed.
pub(super) fn visit_roots<R: Real, E: Equation>(
    quadratic: &Quadratic<E>,
    ray: &Ray<R>,
    admitted: impl Fn(Side) -> bool,
    hit: impl Fn(R) -> SurfaceHit<R>,
    visit: &mut ExactVisitor<'_, R>,
) -> bool {
    let (count, interval) = (quadratic.count(), ray.to_f64());
    for &side in count.sides() {
        if quadratic.admits(side, &interval) && admitted(side) {
            let found = |t| ExactSurfaceHit { hit: hit(t), crosses: count != Count::Double };
            if visit_at(quadratic.nearest(side), found, &|| quadratic.root(side), visit).is_break() {
                break;
            }
        }
    }
    quadratic.fallback()
}

/// Visits a hit unless its parameter is beyond the largest number.
pub(super) fn visit_at<R: Real>(
    t: R,
    hit: impl FnOnce(R) -> ExactSurfaceHit<R>,
    root: &dyn Fn() -> Root,
    visit: &mut ExactVisitor<'_, R>,
) -> ControlFlow<()> {
    if t.is_finite() { visit(hit(t), root) } else { ControlFlow::Continue(()) }
}

/// `n.(o + t d - p) = 0`
pub(super) struct OnPlane {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
}

impl Equation for OnPlane {
    fn coefficients<N: Number>(&self) -> [N; 3] {
        let n = vector(self.normal);
        let offset = dot(&n, &differences(self.origin, self.point));
        [N::new(0.0), dot(&n, &vector(self.direction)), offset.twice()]
    }
}

/// A coordinate of the hit point relative to `from`, times `2 B`, where the equation is `2 B t + C = 0`.
pub(super) struct Coordinate {
    pub(super) origin: f64,
    pub(super) direction: f64,
    pub(super) from: f64,
}

impl Formula for Coordinate {
    fn value<N: Number>(&self, [_, b, c]: &[N; 3]) -> N {
        N::difference(self.origin, self.from).times(&b.twice()).minus(&N::new(self.direction).times(c))
    }
}

/// Whether a root's point lies in a closed box.
pub(super) fn in_box<E: Equation>(q: &Quadratic<E>, side: Side, ray: &Ray<f64>, bounds: &Aabb<f64>) -> bool {
    (0..3).all(|axis| {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        if d == 0.0 {
            return low <= o && o <= high;
        }
        // Travelling down, the higher bound comes first.
        let (first, last) = if d < 0.0 { (high, low) } else { (low, high) };
        let order = |bound: f64| q.order(side, Fraction::new(bound, o, d));
        let forward = d.signum();
        let after = if first.is_finite() { order(first).is_ge() } else { first * forward < 0.0 };
        let before = || if last.is_finite() { order(last).is_le() } else { last * forward > 0.0 };
        after && before()
    })
}
