//! Axis-aligned boxes as primitives.

use core::cmp::Ordering;
use core::ops::ControlFlow;

use super::common::{cast, padded};
use super::exact::visit_at;
use super::{ExactSurfaceHit, ExactVisitor, Primitive, ShapeError, SurfaceHit};
use crate::exact::Root;
use crate::exact::quadratic::{Fraction, Quadratic, Side};
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

/// An end of the exact stay of a ray in a box.
#[derive(Clone, Copy)]
pub(super) struct ExactEnd {
    pub(super) at: Fraction,
    pub(super) axis: usize,
    pub(super) entry: bool,
}

impl ExactEnd {
    pub(super) fn root(&self) -> Root {
        Quadratic::new(self.at).root(Side::Lower)
    }

    /// Its parameter, correctly rounded.
    pub(super) fn nearest<R: Real>(&self, fallback: &mut bool) -> R {
        let equation = Quadratic::new(self.at);
        let t = equation.nearest(Side::Lower);
        *fallback |= equation.fallback();
        t
    }
}

/// Where a ray's line is inside a closed box, exactly: entry and exit, each `None` where the box has no end.
#[derive(Clone, Copy)]
pub(super) struct ExactStay {
    pub(super) enter: Option<ExactEnd>,
    pub(super) exit: Option<ExactEnd>,
}

/// [`stay`], exactly.
pub(super) fn exact_stay(bounds: &Aabb<f64>, ray: &Ray<f64>, fallback: &mut bool) -> Option<ExactStay> {
    let mut s = ExactStay { enter: None, exit: None };
    for axis in 0..3 {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        let (lo, hi) = (bounds.min[axis], bounds.max[axis]);
        // The latter two hold for boxes that lie wholly at infinity.
        let beside = d == 0.0 && !(lo <= o && o <= hi);
        if beside || lo == f64::INFINITY || hi == f64::NEG_INFINITY {
            return None;
        }
        if d == 0.0 {
            continue;
        }
        let (near, far) = if d < 0.0 { (hi, lo) } else { (lo, hi) };
        let end = |plane: f64, entry: bool| ExactEnd { at: Fraction::new(plane, o, d), axis, entry };
        let mut replace = |place: &mut Option<ExactEnd>, new: ExactEnd, wanted: Ordering| {
            if place.is_none_or(|old| new.at.order(old.at, fallback) == wanted) {
                *place = Some(new);
            }
        };
        if near.is_finite() {
            replace(&mut s.enter, end(near, true), Ordering::Greater);
        }
        if far.is_finite() {
            replace(&mut s.exit, end(far, false), Ordering::Less);
        }
    }
    let inverted = matches!(s, ExactStay { enter: Some(a), exit: Some(b) } if a.at.order(b.at, fallback).is_gt());
    (!inverted).then_some(s)
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

    /// [`Self::overlap`], exactly: whether there is one is certain, and the ends are correctly rounded.
    #[must_use]
    pub fn overlap_exact(&self, ray: &Ray<R>) -> Option<[R; 2]> {
        let (line, mut fallback) = (ray.to_f64(), false);
        let s = ray.is_valid().then(|| exact_stay(&self.bounds.to_f64(), &line, &mut fallback))??;
        let too_late = s.enter.is_some_and(|e| !e.at.is_to(line.t_max, &mut fallback));
        let too_early = s.exit.is_some_and(|e| !e.at.is_from(line.t_min, &mut fallback));
        if too_late || too_early {
            return None;
        }
        let mut rounded = |end: Option<ExactEnd>, without: R| end.map_or(without, |e| e.nearest(&mut fallback));
        Some([rounded(s.enter, -R::INFINITY).max(ray.t_min), rounded(s.exit, R::INFINITY).min(ray.t_max)])
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

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let (line, mut fallback) = (ray.to_f64(), false);
        let Some(ExactStay { enter, exit }) = exact_stay(&self.bounds.to_f64(), &line, &mut fallback) else {
            return fallback;
        };
        // An edge or corner that is touched has entry and exit in one.
        let touched =
            enter.zip(exit).is_some_and(|(a, b): (ExactEnd, ExactEnd)| a.at.order(b.at, &mut fallback).is_eq());
        for end in [enter, exit.filter(|_| !touched)].into_iter().flatten() {
            if end.at.is_in(&line, &mut fallback) {
                let hit = |t| Self::face_hit(&self.bounds, ray, t, end.axis, end.entry);
                let found = |t| ExactSurfaceHit { hit: hit(t), crosses: !touched };
                if visit_at(end.nearest(&mut fallback), found, &|| end.root(), visit) == ControlFlow::Break(()) {
                    break;
                }
            }
        }
        fallback
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Sets the coordinate of the face: nothing is left but the rounding of the next test.
    fn refine(&self, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R) {
        Self::project(&self.bounds, point, normal)
    }
}
