//! One source for f32 and f64.

use core::fmt::{Debug, Display};
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use glam::{DVec3, Vec3};

/// A floating-point scalar, `f32` or `f64`, with its glam vector.
///
/// The operations are the IEEE ones, separately rounded: nothing here contracts `a * b - c * d`.
pub trait Real:
    Copy
    + Debug
    + Default
    + Display
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Sum
    + Send
    + Sync
    + 'static
{
    /// The vector of three such scalars.
    type Vec3: Vector3<Self>;

    /// 0
    const ZERO: Self;
    /// 1/2
    const HALF: Self;
    /// 1
    const ONE: Self;
    /// 2
    const TWO: Self;
    /// Positive infinity.
    const INFINITY: Self;
    /// The largest finite value.
    const MAX: Self;
    /// The smallest positive normal value.
    const MIN_POSITIVE: Self;
    /// The unit roundoff u: half an ulp of 1 (2^-24 for `f32`, 2^-53 for `f64`).
    const UNIT_ROUNDOFF: Self;

    /// Nearest value to an `f64`.
    fn from_f64(x: f64) -> Self;
    /// Exact value of an `f32`.
    fn from_f32(x: f32) -> Self;
    /// Exact value as `f64`.
    fn to_f64(self) -> f64;
    /// Nearest `f32`.
    fn to_f32(self) -> f32;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// `self` with the sign bit of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
    /// Whether this is NaN.
    fn is_nan(self) -> bool;
    /// Whether the sign bit is set (true for -0.0).
    fn is_sign_negative(self) -> bool;
    /// The smaller; drops a NaN operand.
    fn min(self, other: Self) -> Self;
    /// The larger; drops a NaN operand.
    fn max(self, other: Self) -> Self;
    /// The next representable value upwards.
    fn next_up(self) -> Self;
    /// The next representable value downwards.
    fn next_down(self) -> Self;
    /// The power of two with the exponent of `self` (1 for zero, infinite or NaN), kept within half the exponent
    /// range so that its reciprocal is exact too.
    fn power_of_two_below(self) -> Self;

    /// Higham's `gamma(n) = n u / (1 - n u)`: the relative error of `n` roundings is at most this.
    #[must_use]
    fn gamma(n: u32) -> Self {
        let nu = Self::from_f64(f64::from(n)) * Self::UNIT_ROUNDOFF;
        nu / (Self::ONE - nu)
    }
}

macro_rules! real {
    ($t:ident, $bits:ident, $vec:ident, $mantissa:expr, $exp_mask:expr, $bias:expr) => {
        impl Real for $t {
            type Vec3 = $vec;
            const ZERO: Self = 0.0;
            const HALF: Self = 0.5;
            const ONE: Self = 1.0;
            const TWO: Self = 2.0;
            const INFINITY: Self = $t::INFINITY;
            const MAX: Self = $t::MAX;
            const MIN_POSITIVE: Self = $t::MIN_POSITIVE;
            const UNIT_ROUNDOFF: Self = $t::EPSILON / 2.0;

            #[inline(always)]
            #[allow(clippy::cast_possible_truncation, reason = "rounding to nearest is what is asked for")]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn from_f32(x: f32) -> Self {
                x.into()
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self.into()
            }
            #[inline(always)]
            #[allow(clippy::cast_possible_truncation, reason = "rounding to nearest is what is asked for")]
            #[allow(clippy::unnecessary_cast, reason = "one body for f32 and f64")]
            fn to_f32(self) -> f32 {
                self as f32
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                self.copysign(sign)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline(always)]
            fn is_nan(self) -> bool {
                self.is_nan()
            }
            #[inline(always)]
            fn is_sign_negative(self) -> bool {
                self.is_sign_negative()
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.min(other)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.max(other)
            }
            #[inline(always)]
            fn next_up(self) -> Self {
                self.next_up()
            }
            #[inline(always)]
            fn next_down(self) -> Self {
                self.next_down()
            }
            #[inline]
            fn power_of_two_below(self) -> Self {
                const BIAS: $bits = $bias;
                let e = (self.to_bits() >> $mantissa) & $exp_mask;
                if e == $exp_mask || self == 0.0 {
                    return 1.0;
                }
                let e = e.clamp(BIAS - BIAS / 2, BIAS + BIAS / 2);
                $t::from_bits(e << $mantissa)
            }
        }
    };
}
real!(f32, u32, Vec3, 23, 0xff, 127);
real!(f64, u64, DVec3, 52, 0x7ff, 1023);

/// Three scalars: glam's `Vec3` or `DVec3`.
pub trait Vector3<R>:
    Copy
    + Debug
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<R, Output = Self>
    + Neg<Output = Self>
    + Send
    + Sync
    + 'static
{
    /// From components.
    fn new(x: R, y: R, z: R) -> Self;
    /// All components equal.
    fn splat(v: R) -> Self;
    /// First component.
    fn x(self) -> R;
    /// Second component.
    fn y(self) -> R;
    /// Third component.
    fn z(self) -> R;
    /// Component 0, 1 or 2.
    fn axis(self, i: usize) -> R;
    /// This vector with component `i` replaced.
    #[must_use]
    fn with_axis(self, i: usize, v: R) -> Self;
    /// Inner product.
    fn dot(self, o: Self) -> R;
    /// Cross product.
    #[must_use]
    fn cross(self, o: Self) -> Self;
    /// Componentwise minimum.
    #[must_use]
    fn min(self, o: Self) -> Self;
    /// Componentwise maximum.
    #[must_use]
    fn max(self, o: Self) -> Self;
    /// Componentwise absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// The largest component.
    fn max_element(self) -> R;
    /// Euclidean length.
    fn length(self) -> R;
    /// Every component finite.
    fn is_finite(self) -> bool;
    /// From double precision, rounding each component to nearest.
    fn from_f64(v: DVec3) -> Self;
    /// To double precision, exactly.
    fn to_f64(self) -> DVec3;
}

macro_rules! vector {
    ($t:ident, $vec:ident, $to:expr, $from:expr) => {
        impl Vector3<$t> for $vec {
            #[inline(always)]
            fn new(x: $t, y: $t, z: $t) -> Self {
                $vec::new(x, y, z)
            }
            #[inline(always)]
            fn splat(v: $t) -> Self {
                $vec::splat(v)
            }
            #[inline(always)]
            fn x(self) -> $t {
                self.x
            }
            #[inline(always)]
            fn y(self) -> $t {
                self.y
            }
            #[inline(always)]
            fn z(self) -> $t {
                self.z
            }
            #[inline(always)]
            fn axis(self, i: usize) -> $t {
                self[i]
            }
            #[inline(always)]
            fn with_axis(mut self, i: usize, v: $t) -> Self {
                self[i] = v;
                self
            }
            #[inline(always)]
            fn dot(self, o: Self) -> $t {
                $vec::dot(self, o)
            }
            #[inline(always)]
            fn cross(self, o: Self) -> Self {
                $vec::cross(self, o)
            }
            #[inline(always)]
            fn min(self, o: Self) -> Self {
                $vec::min(self, o)
            }
            #[inline(always)]
            fn max(self, o: Self) -> Self {
                $vec::max(self, o)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $vec::abs(self)
            }
            #[inline(always)]
            fn max_element(self) -> $t {
                $vec::max_element(self)
            }
            #[inline(always)]
            fn length(self) -> $t {
                $vec::length(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $vec::is_finite(self)
            }
            #[inline(always)]
            fn from_f64(v: DVec3) -> Self {
                $from(v)
            }
            #[inline(always)]
            fn to_f64(self) -> DVec3 {
                $to(self)
            }
        }
    };
}
vector!(f32, Vec3, |v: Vec3| v.as_dvec3(), |v: DVec3| v.as_vec3());
vector!(f64, DVec3, |v: DVec3| v, |v: DVec3| v);
