//! Axis-aligned boxes as primitives.

use super::common::{cast, padded};
use super::{Primitive, ShapeError, SurfaceHit};
use crate::{Aabb, Ray, Real, Vector3};

/// The surface of an axis-aligned box. It may be flat (zero extent along an axis) or infinite.
///
/// On each face `u` and `v` run from 0 to 1 along the other two axes, taken in the order x, y, z (world units from the
/// lower bound where that is infinite, 0 where the face has no extent). Normals point outward.
///
/// Error of `t`: 4 ulp. No ray that meets the box misses it; one that passes within 4 ulp of an edge may hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid<R: Real> {
    bounds: Aabb<R>,
}

/// The stay of a ray in a box: parameters of entry and exit, each with the axis of the face crossed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stay<R> {
    pub(super) enter: R,
    pub(super) enter_axis: usize,
    pub(super) exit: R,
    pub(super) exit_axis: usize,
}

/// Where a line is inside a closed box, or `None` if nowhere. The parameters carry 2 roundings each; a stay that
/// rounding alone would make empty counts.
///
/// A bound that cannot be compared (a ray in the plane of a face gives 0/0) is dropped: the closed box has that point.
pub(super) fn stay<R: Real>(bounds: &Aabb<R>, origin: R::Vec3, direction: R::Vec3) -> Option<Stay<R>> {
    let mut s = Stay { enter: -R::INFINITY, enter_axis: 0, exit: R::INFINITY, exit_axis: 0 };
    for axis in 0..3 {
        let (o, d) = (origin.axis(axis), direction.axis(axis));
        let (lo, hi) = (bounds.min.axis(axis), bounds.max.axis(axis));
        // By the sign bit: -0 must pick as a negative number does, so that the infinities come out right.
        let (near, far) = if d.is_sign_negative() { (hi, lo) } else { (lo, hi) };
        let (near, far) = ((near - o) / d, (far - o) / d);
        if near > s.enter {
            (s.enter, s.enter_axis) = (near, axis);
        }
        if far < s.exit {
            (s.exit, s.exit_axis) = (far, axis);
        }
    }
    (s.enter <= later(s.exit)).then_some(s)
}

/// `t` moved up by more than the rounding of two computed parameters can hide.
fn later<R: Real>(t: R) -> R {
    t + R::gamma(6) * t.abs()
}

impl<R: Real> Cuboid<R> {
    /// A box from its corners.
    ///
    /// # Errors
    /// When a bound is NaN, the box is inverted, or it lies wholly at infinity.
    pub fn new(min: R::Vec3, max: R::Vec3) -> Result<Self, ShapeError> {
        for axis in 0..3 {
            let (lo, hi) = (min.axis(axis), max.axis(axis));
            if lo.is_nan() || hi.is_nan() {
                return Err(ShapeError::NotFinite { what: "corner of the box", value: f64::NAN });
            }
            if lo > hi || lo == R::INFINITY || hi == -R::INFINITY {
                return Err(ShapeError::Degenerate("the box is empty: its lower corner is above its upper one"));
            }
        }
        Ok(Self { bounds: Aabb::new(min, max) })
    }

    /// The corners.
    #[must_use]
    pub fn corners(&self) -> Aabb<R> {
        self.bounds
    }

    /// The same box in another arithmetic.
    ///
    /// # Errors
    /// Never for a box that could be made; the signature is that of the other shapes.
    pub fn cast<S: Real>(&self) -> Result<Cuboid<S>, ShapeError> {
        Cuboid::new(cast::<R, S>(self.bounds.min), cast::<R, S>(self.bounds.max))
    }

    /// The part of the ray's interval that lies in the solid box: entry and exit, or `None`.
    ///
    /// Unlike [`Primitive::closest_hit`], this also answers for an interval that lies wholly inside.
    #[must_use]
    pub fn overlap(&self, ray: &Ray<R>) -> Option<[R; 2]> {
        let s = self.admitted(ray)?;
        Some([s.enter.max(ray.t_min).min(ray.t_max), s.exit.min(ray.t_max).max(ray.t_min)])
    }

    /// The stay in the box if it meets the ray's interval.
    fn admitted(&self, ray: &Ray<R>) -> Option<Stay<R>> {
        if !ray.is_valid() {
            return None;
        }
        let s = stay(&self.bounds, ray.origin, ray.direction)?;
        (s.enter <= later(ray.t_max) && ray.t_min <= later(s.exit)).then_some(s)
    }

    /// `t`, axis and whether it is the entry.
    fn nearest(&self, ray: &Ray<R>) -> Option<(R, usize, bool)> {
        let s = self.admitted(ray)?;
        let clamped = |t: R| t.max(ray.t_min).min(ray.t_max);
        if ray.t_min <= s.enter {
            Some((clamped(s.enter), s.enter_axis, true)).filter(|c| c.0.is_finite())
        } else if s.exit <= ray.t_max {
            Some((clamped(s.exit), s.exit_axis, false)).filter(|c| c.0.is_finite())
        } else {
            None
        }
    }

    /// The hit on a face.
    pub(super) fn face_hit(bounds: &Aabb<R>, ray: &Ray<R>, t: R, axis: usize, entry: bool) -> SurfaceHit<R> {
        let p = ray.at(t);
        let outward = if entry == ray.direction.axis(axis).is_sign_negative() { R::ONE } else { -R::ONE };
        let coordinate = |i: usize| {
            let (lo, hi, x) = (bounds.min.axis(i), bounds.max.axis(i), p.axis(i));
            match (hi - lo).is_finite() {
                true if hi > lo => ((x - lo) / (hi - lo)).max(R::ZERO).min(R::ONE),
                true => R::ZERO,
                false if lo.is_finite() => x - lo,
                false => x,
            }
        };
        let (first, second) = [(1, 2), (0, 2), (0, 1)][axis];
        let normal = R::Vec3::default().with_axis(axis, outward);
        SurfaceHit::new(t, coordinate(first), coordinate(second), Some(normal))
    }

    /// Moves a point near a face onto it; see [`Primitive::refine`].
    pub(super) fn project(bounds: &Aabb<R>, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R) {
        let gap = |axis: usize, upper: bool| {
            let face = if upper { bounds.max.axis(axis) } else { bounds.min.axis(axis) };
            ((point.axis(axis) - face).abs(), face)
        };
        let axis_upper = match normal {
            Some(n) => {
                let axis = (0..3).max_by(|&i, &j| n.axis(i).abs().to_f64().total_cmp(&n.axis(j).abs().to_f64()));
                axis.map(|axis| (axis, n.axis(axis) > R::ZERO))
            }
            None => (0..6)
                .map(|i| (i / 2, i % 2 == 1))
                .min_by(|&i, &j| gap(i.0, i.1).0.to_f64().total_cmp(&gap(j.0, j.1).0.to_f64())),
        };
        let (axis, upper) = axis_upper.unwrap_or((0, false));
        let (_, face) = gap(axis, upper);
        let p = if face.is_finite() { point.with_axis(axis, face) } else { point };
        let size = bounds.min.abs().max(bounds.max.abs()).axis(axis);
        (p, R::gamma(4) * if size.is_finite() { size } else { face.abs() })
    }
}

impl<R: Real> Primitive<R> for Cuboid<R> {
    fn bounds(&self) -> Aabb<R> {
        padded(self.bounds)
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        let (t, axis, entry) = self.nearest(ray)?;
        Some(Self::face_hit(&self.bounds, ray, t, axis, entry))
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Sets the coordinate of the face: nothing is left but the rounding of the next test.
    fn refine(&self, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R) {
        Self::project(&self.bounds, point, normal)
    }
}
