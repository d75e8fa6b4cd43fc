//! The watertight test: Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1) 2013.
//!
//! Space is sheared so that the ray becomes an axis; the decision is then made in two dimensions by three edge
//! functions. A vertex is sheared alike in every triangle that has it, and the edge function of a shared edge is the
//! exact negative of the neighbour's: `a*b - c*d` with two rounded products has the right sign or is 0, since rounding
//! is monotone. Where one is 0 all three are computed again in double precision from the same sheared coordinates, and
//! then the signs are exact. So the sheared mesh has no gaps, and neither has the test.

use core::cmp::Ordering;

use super::{TriangleHit, plane_parameter};
use crate::{Ray, Real, Vector3, error::difference_of_products};

/// What the test needs to know of a ray's direction: made once per ray.
#[derive(Clone, Copy, Debug)]
pub struct Shear<R: Real> {
    /// The axis that the ray follows most.
    axis: usize,
    x: R,
    y: R,
}

/// Barycentric weights of a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights<R: Real> {
    /// Weight of vertex 1, in `[0, 1]`.
    pub u: R,
    /// Weight of vertex 2, in `[0, 1]`.
    pub v: R,
}

impl<R: Real> Weights<R> {
    /// The weights that edge functions of one sign tell, those of the edges opposite to the vertices as
    /// [`Shear::weights`] computes them. `None` where one is 0 (and `ZERO_TELLS_NOTHING`), or products over- or
    /// underflowed: then their signs tell nothing for certain.
    #[inline(always)]
    #[must_use]
    pub fn told<const ZERO_TELLS_NOTHING: bool>([e0, e1, e2]: [R; 3]) -> Option<Self> {
        let inverse = R::ONE / (e0 + e1 + e2);
        // A sum that is infinite or NaN (overflow), or too small for a reciprocal, tells nothing either.
        let usable = inverse.is_finite() && inverse != R::ZERO;
        let zero = e0 == R::ZERO || e1 == R::ZERO || e2 == R::ZERO;
        let at_most_one = |x: R| if x < R::ONE { x } else { R::ONE };
        (usable && !(ZERO_TELLS_NOTHING && zero))
            .then(|| Self { u: at_most_one(e1 * inverse), v: at_most_one(e2 * inverse) })
    }
}

impl<R: Real> Shear<R> {
    /// Setup for a direction, finite and not zero.
    #[inline]
    #[must_use]
    pub fn new(direction: R::Vec3) -> Self {
        // No branches: directions of many rays are not to be predicted.
        let a = direction.abs();
        let not_x = a.x() <= a.y();
        let larger = if not_x { a.y() } else { a.x() };
        let z = usize::from(larger <= a.z());
        let axis = (usize::from(not_x) & (z ^ 1)) | z << 1;
        let d = [direction.x(), direction.y(), direction.z(), direction.x(), direction.y(), R::ONE, R::ONE, R::ONE];
        let of = |i: usize| d[(axis + i) & 7];
        Self { axis, x: of(1) / of(0), y: of(2) / of(0) }
    }

    /// The shears of the first and second axis, in cyclic order after the one that the ray follows most.
    #[inline(always)]
    #[must_use]
    pub fn slopes(&self) -> (R, R) {
        (self.x, self.y)
    }

    /// Whether the line through the origin meets the triangle whose vertices are given *relative to the ray's origin*,
    /// and where; whatever the ray parameter is.
    ///
    /// Vertices must lie within about 1e-9 to 1e9 of the origin for `f32`, or products may overflow.
    #[inline(always)]
    #[must_use]
    pub fn weights(&self, vertices: [R::Vec3; 3]) -> Option<Weights<R>> {
        self.decide::<true>(vertices, exact)
    }

    /// The same by the rounded edge functions alone, without double precision where one is 0: what that guard is worth
    /// can be measured against this.
    ///
    /// Where all three round to 0, a triangle that the line does meet is missed.
    #[inline(always)]
    #[must_use]
    pub fn weights_unguarded(&self, vertices: [R::Vec3; 3]) -> Option<Weights<R>> {
        self.decide::<false>(vertices, |_| None)
    }

    /// By the rounded edge functions; where they do not tell, by `undecided`. Without `ZERO_TELLS_NOTHING` an edge
    /// function that rounds to 0 counts as inside.
    #[inline(always)]
    fn decide<const ZERO_TELLS_NOTHING: bool>(
        &self,
        vertices: [R::Vec3; 3],
        undecided: impl FnOnce([(R, R); 3]) -> Option<Weights<R>>,
    ) -> Option<Weights<R>> {
        // Written out: `map` on arrays is not always inlined, and cost a sixth of the time.
        let [a, b, c] = vertices;
        let ((ax, ay), (bx, by), (cx, cy)) = (self.apply(a), self.apply(b), self.apply(c));
        let e0 = cx * by - cy * bx;
        let e1 = ax * cy - ay * cx;
        let e2 = bx * ay - by * ax;
        let below = e0 < R::ZERO || e1 < R::ZERO || e2 < R::ZERO;
        let above = e0 > R::ZERO || e1 > R::ZERO || e2 > R::ZERO;
        if below && above {
            return None;
        }
        if let Some(weights) = Weights::told::<ZERO_TELLS_NOTHING>([e0, e1, e2]) {
            return Some(weights);
        }
        undecided([(ax, ay), (bx, by), (cx, cy)])
    }

    /// Whether the line *crosses* the triangle: as [`Shear::weights`], but of the triangles that share the point where
    /// it passes, one answers for all. A closed mesh is crossed an even number of times by every line.
    ///
    /// Where an edge function is 0, the ray passes through the edge (in the sheared plane). Then its sign is that for
    /// the ray shifted by (eps, eps^2), with eps > 0 smaller than anything: with `e0 = cx*by - cy*bx`, a shift by (p, q)
    /// adds `p (cy - by) + q (bx - cx)`, so the sign is that of `cy - by`, and if this is 0 too, that of `bx - cx`
    /// (simulation of simplicity: Edelsbrunner and Muecke 1990). A neighbour sees the same numbers negated, hence the
    /// other sign. The shifted ray passes through no edge and no vertex, so it crosses what is in its way, or not; an
    /// edge that is seen as a point, or a triangle seen as a segment, is never crossed. Touching, as at a silhouette,
    /// counts 0 or 2.
    ///
    /// ```
    /// use firsthit_geometry::triangle::Shear;
    /// use glam::DVec3;
    ///
    /// let [a, b, c, d] = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 5.0));
    /// let down = Shear::<f64>::new(DVec3::Z);
    /// // Both halves of a square contain the point in the middle of their common edge; one is crossed there.
    /// assert!(down.weights([a, b, c]).is_some() && down.weights([a, c, d]).is_some());
    /// assert!(down.crosses([a, b, c]).is_some() != down.crosses([a, c, d]).is_some());
    /// ```
    #[inline(always)]
    #[must_use]
    pub fn crosses(&self, vertices: [R::Vec3; 3]) -> Option<Weights<R>> {
        self.decide::<true>(vertices, exact_crossing)
    }

    /// How the line passes through a triangle that it meets or crosses, as seen by this test: `Less` against the normal
    /// by winding, `Greater` along it, when it goes towards growing coordinates of [`Shear::axis`] (else the other way
    /// round); `Equal` where the triangle is seen from its side.
    ///
    /// Neighbours agree, so the crossings of a closed mesh are as often the one as the other.
    #[must_use]
    pub fn side(&self, vertices: [R::Vec3; 3]) -> Ordering {
        let [(ax, ay), (bx, by), (cx, cy)] = vertices.map(|v| self.apply(v));
        // Not of different signs, if the triangle is met. So their sum has the sign of any that is not 0.
        let twice_area = difference_of_products(cx, by, cy, bx)
            + difference_of_products(ax, cy, ay, cx)
            + difference_of_products(bx, ay, by, ax);
        0.0.partial_cmp(&twice_area).unwrap_or(Ordering::Equal)
    }

    /// The axis that the ray follows most: 0, 1 or 2.
    #[inline]
    #[must_use]
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// A point, relative to the ray's origin, in the sheared plane: there the ray is at (0, 0).
    #[inline(always)]
    #[must_use]
    pub fn apply(&self, p: R::Vec3) -> (R, R) {
        let (x, y, z) = permuted::<R>(p, self.axis);
        (x - self.x * z, y - self.y * z)
    }
}

/// The components in cyclic order with `axis` last.
#[inline(always)]
fn permuted<R: Real>(v: R::Vec3, axis: usize) -> (R, R, R) {
    match axis {
        0 => (v.y(), v.z(), v.x()),
        1 => (v.z(), v.x(), v.y()),
        _ => (v.x(), v.y(), v.z()),
    }
}

/// The decision by edge functions of exact sign.
#[cold]
#[inline(never)]
fn exact<R: Real>([(ax, ay), (bx, by), (cx, cy)]: [(R, R); 3]) -> Option<Weights<R>> {
    let e0 = difference_of_products(cx, by, cy, bx);
    let e1 = difference_of_products(ax, cy, ay, cx);
    let e2 = difference_of_products(bx, ay, by, ax);
    if e0.min(e1).min(e2) < 0.0 && e0.max(e1).max(e2) > 0.0 {
        return None;
    }
    let sum = e0 + e1 + e2;
    let (u, v) = (e1 / sum, e2 / sum);
    // A sum of 0 (no area in the sheared plane) makes both NaN.
    (u >= 0.0 && v >= 0.0).then(|| Weights { u: R::from_f64(u), v: R::from_f64(v) })
}

/// The decision of [`Shear::crosses`] by edge functions of exact sign.
#[cold]
#[inline(never)]
fn exact_crossing<R: Real>([a, b, c]: [(R, R); 3]) -> Option<Weights<R>> {
    // The edge from `p` to `q`: its value, and its sign for the shifted ray, which is 0 only if `p` is `q`.
    let edge = |p: (R, R), q: (R, R)| {
        let e = difference_of_products(q.0, p.1, q.1, p.0);
        let sign = |x: Ordering, y: Ordering| if x == Ordering::Equal { y } else { x };
        let order = |x: R, y: R| x.partial_cmp(&y).unwrap_or(Ordering::Equal);
        let side = if e > 0.0 { Ordering::Greater } else { Ordering::Less };
        (e, if e == 0.0 { sign(order(q.1, p.1), order(p.0, q.0)) } else { side })
    };
    let ((e0, s0), (e1, s1), (e2, s2)) = (edge(b, c), edge(c, a), edge(a, b));
    if s0 == Ordering::Equal || s0 != s1 || s1 != s2 {
        return None;
    }
    let sum = e0 + e1 + e2;
    let (u, v) = (e1 / sum, e2 / sum);
    // NaN: an overflow.
    (u >= 0.0 && v >= 0.0).then(|| Weights { u: R::from_f64(u), v: R::from_f64(v) })
}

/// The hit by the watertight test; `t` from the triangle's plane in double precision, rounded to `R` once.
///
/// Any magnitudes: vertices and direction are scaled by powers of two, exactly. `t` is right to one rounding of `R` as
/// far as the condition of the plane allows double precision to tell.
///
/// For many triangles and one ray make a [`Shear`] once instead.
#[must_use]
pub fn watertight<R: Real>(vertices: [R::Vec3; 3], ray: &Ray<R>) -> Option<TriangleHit<R>> {
    if !ray.is_valid() {
        return None;
    }
    // Scaled once before the differences, which may overflow, and once after, when they may have become small.
    let largest = |v: [R::Vec3; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs()).max_element();
    let before = largest(vertices).max(ray.origin.abs().max_element()).power_of_two_below();
    let k = R::ONE / before;
    let relative = vertices.map(|p| p * k - ray.origin * k);
    let after = largest(relative).power_of_two_below();
    let relative = relative.map(|p| p * (R::ONE / after));
    let length = ray.direction.abs().max_element().power_of_two_below();
    let direction = ray.direction * (R::ONE / length);

    let w = Shear::new(direction).weights(relative)?;
    let t = plane_parameter(relative.map(Vector3::to_f64), glam::DVec3::ZERO, direction.to_f64())?;
    let t = R::from_f64(t * after.to_f64() * before.to_f64() / length.to_f64());
    (t.is_finite() && ray.contains(t)).then_some(TriangleHit { t, u: w.u, v: w.v })
}
