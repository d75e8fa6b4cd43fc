//! Clipping lines to boxes and convex regions: Liang-Barsky and Cyrus-Beck.
//!
//! Both keep the answer in the ray's own parameter: nothing is moved or shortened, so a clipped ray reports the same
//! `t`, bit for bit, as the whole one. Regions are closed, and so are the intervals that come out: a ray that touches
//! a corner is left with one point. A polygon clipper has no place here; [`crate::frustum`] decides whether boxes and
//! triangles meet a view frustum.

use crate::{Aabb, Ray, Real, Vector3};

/// The points with `normal . p <= offset`. The normal points out of the half-space and need not be unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace<R: Real> {
    /// Outward normal, any length but zero.
    pub normal: R::Vec3,
    /// `normal . p` on the boundary.
    pub offset: R,
}

impl<R: Real> HalfSpace<R> {
    /// From its normal and offset.
    #[must_use]
    pub fn new(normal: R::Vec3, offset: R) -> Self {
        Self { normal, offset }
    }

    /// The half-space that ends at `point`.
    #[must_use]
    pub fn through(point: R::Vec3, normal: R::Vec3) -> Self {
        Self { normal, offset: normal.dot(point) }
    }

    /// `normal . p - offset`: negative inside, in units of the normal's length.
    #[inline]
    #[must_use]
    pub fn signed_distance(&self, p: R::Vec3) -> R {
        self.normal.dot(p) - self.offset
    }

    /// Whether the closed half-space holds `p`; false for NaN.
    #[inline]
    #[must_use]
    pub fn contains(&self, p: R::Vec3) -> bool {
        self.signed_distance(p) <= R::ZERO
    }
}

/// A parameter interval that shrinks from either end. `None` as soon as it is empty or cannot be compared.
#[derive(Clone, Copy)]
struct Interval<R> {
    min: R,
    max: R,
}

impl<R: Real> Interval<R> {
    /// Keeps the `t` with `slope * t <= distance`: the step that both algorithms share.
    ///
    /// A falling bound is where the line enters, a rising one where it leaves; a constant one keeps all or nothing.
    #[inline]
    fn cut(self, slope: R, distance: R) -> Option<Self> {
        let Self { min, max } = self;
        let t = distance / slope;
        let cut = if distance.is_nan() {
            return None;
        } else if slope < R::ZERO {
            Self { min: if t > min { t } else { min }, max }
        } else if slope > R::ZERO {
            Self { min, max: if t < max { t } else { max } }
        } else if distance >= R::ZERO {
            self
        } else {
            return None;
        };
        (cut.min <= cut.max).then_some(cut)
    }
}

/// The part of a ray's interval that lies in a closed box (Liang and Barsky, ACM TOG 3(1), 1984).
///
/// Works for segments ([`Ray::segment`]), rays and lines (`t_min = -infinity`) alike. Bounds of the box may be infinite.
/// Each end carries two roundings. `None` for an invalid ray and where nothing is left. This is the exact-arithmetic
/// algorithm of text-books: where a false miss is worse than a false hit, as in a tree, use [`crate::slab::padded`].
///
/// ```
/// use firsthit_geometry::{Aabb, Ray, clip};
/// use glam::DVec3;
/// let cube = Aabb::new(DVec3::ZERO, DVec3::ONE);
/// let segment = Ray::segment(DVec3::new(-1.0, 0.5, 0.5), DVec3::new(3.0, 0.5, 0.5));
/// assert_eq!(clip::liang_barsky(&cube, &segment), Some((0.25, 0.5)));
/// ```
#[must_use]
pub fn liang_barsky<R: Real>(bounds: &Aabb<R>, ray: &Ray<R>) -> Option<(R, R)> {
    if !ray.is_valid() || bounds.is_empty() {
        return None;
    }
    let mut interval = Interval { min: ray.t_min, max: ray.t_max };
    for axis in 0..3 {
        let (o, d) = (ray.origin.axis(axis), ray.direction.axis(axis));
        interval = interval.cut(-d, o - bounds.min.axis(axis))?.cut(d, bounds.max.axis(axis) - o)?;
    }
    Some((interval.min, interval.max))
}

/// The part of a ray's interval that lies in all of some half-spaces, a convex region that may be unbounded (Cyrus and
/// Beck, *Computers & Graphics* 3(1), 1978).
///
/// Each end carries the rounding of `offset - n.o` divided by `n.d`. `None` for an invalid ray and where nothing is
/// left.
///
/// ```
/// use firsthit_geometry::{Ray, clip::{HalfSpace, cyrus_beck}};
/// use glam::DVec3;
/// // The wedge x >= 0, x + y <= 4.
/// let wedge = [HalfSpace::new(DVec3::NEG_X, 0.0), HalfSpace::new(DVec3::new(1.0, 1.0, 0.0), 4.0)];
/// let ray = Ray::new(DVec3::new(-2.0, 1.0, 0.0), DVec3::X);
/// assert_eq!(cyrus_beck(&wedge, &ray), Some((2.0, 5.0)));
/// ```
#[must_use]
pub fn cyrus_beck<R: Real>(half_spaces: &[HalfSpace<R>], ray: &Ray<R>) -> Option<(R, R)> {
    if !ray.is_valid() {
        return None;
    }
    let mut interval = Interval { min: ray.t_min, max: ray.t_max };
    for h in half_spaces {
        interval = interval.cut(h.normal.dot(ray.direction), -h.signed_distance(ray.origin))?;
    }
    Some((interval.min, interval.max))
}

/// Where a scene is shown: inside a box and a set of half-spaces, each optional.
///
/// Rays are clipped rather than surfaces, so a cut through a closed model shows its inside.
///
/// ```
/// use firsthit_geometry::{Ray, clip::{ClipRegion, HalfSpace}};
/// use glam::DVec3;
/// let region = ClipRegion { bounds: None, half_spaces: vec![HalfSpace::new(DVec3::Z, 1.0)] };
/// let ray = Ray::new(DVec3::new(0.0, 0.0, 4.0), DVec3::NEG_Z);
/// assert_eq!(region.clip(&ray).unwrap().t_min, 3.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ClipRegion<R: Real> {
    /// Only inside this box.
    pub bounds: Option<Aabb<R>>,
    /// Only inside all of these.
    pub half_spaces: Vec<HalfSpace<R>>,
}

impl<R: Real> Default for ClipRegion<R> {
    /// All of space.
    fn default() -> Self {
        Self { bounds: None, half_spaces: Vec::new() }
    }
}

impl<R: Real> ClipRegion<R> {
    /// Whether nothing is cut away.
    #[must_use]
    pub fn is_all(&self) -> bool {
        self.bounds.is_none() && self.half_spaces.is_empty()
    }

    /// Whether the region holds `p`.
    #[must_use]
    pub fn contains(&self, p: R::Vec3) -> bool {
        self.bounds.is_none_or(|b| b.contains(p)) && self.half_spaces.iter().all(|h| h.contains(p))
    }

    /// The same ray over the part of its interval inside the region, `None` if there is none.
    #[must_use]
    pub fn clip(&self, ray: &Ray<R>) -> Option<Ray<R>> {
        let (t_min, t_max) = match &self.bounds {
            Some(bounds) => liang_barsky(bounds, ray)?,
            None => (ray.t_min, ray.t_max),
        };
        let ray = ray.with_interval(t_min, t_max);
        let (t_min, t_max) = cyrus_beck(&self.half_spaces, &ray)?;
        Some(ray.with_interval(t_min, t_max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};
    use proptest::prelude::*;

    const CUBE: Aabb<f64> = Aabb { min: DVec3::NEG_ONE, max: DVec3::ONE };

    fn faces(b: &Aabb<f64>) -> [HalfSpace<f64>; 6] {
        core::array::from_fn(|i| {
            let (axis, upper) = (i / 2, i % 2 == 1);
            let n = DVec3::ZERO.with_axis(axis, if upper { 1.0 } else { -1.0 });
            HalfSpace::through(if upper { b.max } else { b.min }, n)
        })
    }

    #[test]
    fn parallel_touching_and_inside() {
        let along_edge = Ray::new(DVec3::new(-3.0, 1.0, 1.0), DVec3::X);
        assert_eq!(liang_barsky(&CUBE, &along_edge), Some((2.0, 4.0)));
        let corner = Ray::new(DVec3::new(0.0, 2.0, 1.0), DVec3::new(1.0, -1.0, -0.0));
        assert_eq!(liang_barsky(&CUBE, &corner), Some((1.0, 1.0)));
        let beside = Ray::new(DVec3::new(-3.0, 1.5, 0.0), DVec3::new(1.0, -0.0, 0.0));
        assert_eq!(liang_barsky(&CUBE, &beside), None);
        let inside = Ray::segment(DVec3::ZERO, DVec3::splat(0.5));
        assert_eq!(liang_barsky(&CUBE, &inside), Some((0.0, 1.0)));
    }

    #[test]
    fn unbounded_and_empty_boxes() {
        let slab = Aabb::new(Vec3::new(f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY), Vec3::new(f32::INFINITY, 1.0, 9.0));
        let ray = Ray::new(Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, -1.0, 0.0));
        assert_eq!(liang_barsky(&slab, &ray), Some((2.0, 3.0)));
        assert_eq!(liang_barsky(&Aabb::<f32>::empty(), &ray), None);
        assert_eq!(liang_barsky(&Aabb::<f32>::infinite(), &ray), Some((0.0, f32::INFINITY)));
    }

    #[test]
    fn nan_keeps_nothing() {
        let ray = Ray::new(DVec3::ZERO, DVec3::X);
        assert_eq!(cyrus_beck(&[HalfSpace::new(DVec3::NAN, 1.0)], &ray), None);
        assert_eq!(cyrus_beck(&[HalfSpace::new(DVec3::X, f64::NAN)], &ray), None);
        assert_eq!(liang_barsky(&CUBE, &Ray::new(DVec3::NAN, DVec3::X)), None);
    }

    fn point() -> impl Strategy<Value = DVec3> {
        // Small integers among the reals: rays along axes, through corners and in faces come up.
        let coordinate = || prop_oneof![(-3..=3).prop_map(f64::from), -3.0..3.0];
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        /// The box is the convex region of its six faces, so both algorithms must leave the same.
        #[test]
        fn liang_barsky_is_cyrus_beck_on_a_box(o in point(), d in point()) {
            let ray = Ray::new(o, d);
            prop_assert_eq!(liang_barsky(&CUBE, &ray), cyrus_beck(&faces(&CUBE), &ray));
        }

        /// Sampled points of the segment are kept exactly where they are in the region.
        #[test]
        fn clipping_agrees_with_point_tests(a in point(), b in point(), n in point(), offset in -2.0..2.0_f64) {
            let region = ClipRegion { bounds: Some(CUBE), half_spaces: vec![HalfSpace::new(n, offset)] };
            let ray = Ray::segment(a, b);
            let kept = region.clip(&ray).map_or((2.0, -2.0), |r| (r.t_min, r.t_max));
            for i in 0..=64 {
                let t = f64::from(i) / 64.0;
                // Points within rounding of an end may go either way.
                let near_end = (t - kept.0).abs().min((t - kept.1).abs()) < 1e-12;
                let p = ray.at(t);
                let on_boundary = (p.abs() - 1.0).abs().min_element() < 1e-12
                    || (n.dot(p) - offset).abs() < 1e-12;
                let inside = region.contains(p);
                prop_assert!(near_end || on_boundary || inside == (kept.0 <= t && t <= kept.1), "{t} {kept:?}");
            }
        }
    }
}
