//! Axis-aligned boxes.

use crate::{Real, Vector3};

/// An axis-aligned box, closed: `min <= p <= max`.
///
/// Empty when `min > max` in some axis. Bounds may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb<R: Real> {
    /// Lower corner.
    pub min: R::Vec3,
    /// Upper corner.
    pub max: R::Vec3,
}

impl<R: Real> Default for Aabb<R> {
    fn default() -> Self {
        Self::empty()
    }
}

impl<R: Real> Aabb<R> {
    /// A box from its corners, taken as they are.
    #[inline]
    #[must_use]
    pub fn new(min: R::Vec3, max: R::Vec3) -> Self {
        Self { min, max }
    }

    /// The empty box: joining it with anything gives that.
    #[inline]
    #[must_use]
    pub fn empty() -> Self {
        Self::new(R::Vec3::splat(R::INFINITY), R::Vec3::splat(-R::INFINITY))
    }

    /// All of space.
    #[inline]
    #[must_use]
    pub fn infinite() -> Self {
        Self::new(R::Vec3::splat(-R::INFINITY), R::Vec3::splat(R::INFINITY))
    }

    /// The smallest box around points.
    #[must_use]
    pub fn from_points(points: impl IntoIterator<Item = R::Vec3>) -> Self {
        points.into_iter().fold(Self::empty(), Self::with_point)
    }

    /// Whether no point is inside (also when a bound is NaN).
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !(0..3).all(|i| self.min.axis(i) <= self.max.axis(i))
    }

    /// Whether all bounds are finite.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    /// This box grown to hold `p`.
    #[inline]
    #[must_use]
    pub fn with_point(self, p: R::Vec3) -> Self {
        Self::new(self.min.min(p), self.max.max(p))
    }

    /// The smallest box around both.
    #[inline]
    #[must_use]
    pub fn union(self, o: Self) -> Self {
        Self::new(self.min.min(o.min), self.max.max(o.max))
    }

    /// The part common to both; may be empty.
    #[inline]
    #[must_use]
    pub fn intersection(self, o: Self) -> Self {
        Self::new(self.min.max(o.min), self.max.min(o.max))
    }

    /// Whether `p` is in the closed box.
    #[inline]
    #[must_use]
    pub fn contains(&self, p: R::Vec3) -> bool {
        (0..3).all(|i| self.min.axis(i) <= p.axis(i) && p.axis(i) <= self.max.axis(i))
    }

    /// The middle. NaN for an empty or infinite box.
    #[inline]
    #[must_use]
    pub fn center(&self) -> R::Vec3 {
        self.min * R::HALF + self.max * R::HALF
    }

    /// Edge lengths; negative where empty.
    #[inline]
    #[must_use]
    pub fn extent(&self) -> R::Vec3 {
        self.max - self.min
    }

    /// Surface area; 0 for an empty box.
    #[must_use]
    pub fn area(&self) -> R {
        if self.is_empty() {
            return R::ZERO;
        }
        let e = self.extent();
        R::TWO * (e.x() * e.y() + e.y() * e.z() + e.z() * e.x())
    }

    /// The eight corners; bit 0, 1, 2 of the index picks the upper x, y, z.
    #[must_use]
    pub fn corners(&self) -> [R::Vec3; 8] {
        core::array::from_fn(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 1 { self.max.axis(axis) } else { self.min.axis(axis) }
            };
            R::Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The box in double precision, exactly.
    #[must_use]
    pub fn to_f64(&self) -> Aabb<f64> {
        Aabb::new(self.min.to_f64(), self.max.to_f64())
    }
}

impl Aabb<f64> {
    /// The smallest f32 box that holds this one: bounds are rounded outward.
    #[must_use]
    pub fn to_f32_outward(&self) -> Aabb<f32> {
        let down = |x: f64| {
            let y = x.to_f32();
            if f64::from(y) > x { y.next_down() } else { y }
        };
        let up = |x: f64| {
            let y = x.to_f32();
            if f64::from(y) < x { y.next_up() } else { y }
        };
        Aabb::new(
            glam::Vec3::new(down(self.min.x), down(self.min.y), down(self.min.z)),
            glam::Vec3::new(up(self.max.x), up(self.max.y), up(self.max.z)),
        )
    }
}
