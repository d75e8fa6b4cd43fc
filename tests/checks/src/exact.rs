//! Exact numbers from another library, and what they say about rays: independent truth for the exact tier.

use core::cmp::Ordering;
use core::ops::{Add, Mul, Neg, Sub};

use firsthit_geometry::Ray;
use glam::DVec3;
use num_bigint::{BigInt, Sign};

/// `mantissa * 2^exponent`.
#[derive(Clone, Debug)]
pub struct Exact {
    mantissa: BigInt,
    exponent: i32,
}

impl Exact {
    /// The value of a finite float.
    ///
    /// # Panics
    /// If it is not finite.
    #[must_use]
    pub fn new(x: f64) -> Self {
        assert!(x.is_finite(), "{x} has no value");
        let bits = x.to_bits();
        let (field, fraction) = ((bits >> 52 & 0x7ff) as i32, (bits & ((1 << 52) - 1)) as i64);
        let mantissa = if field == 0 { fraction } else { fraction | 1 << 52 };
        let mantissa = BigInt::from(if x < 0.0 { -mantissa } else { mantissa });
        Self { mantissa, exponent: field.max(1) - 1075 }
    }

    /// `2^exponent`.
    #[must_use]
    pub fn power_of_two(exponent: i32) -> Self {
        Self { mantissa: BigInt::from(1), exponent }
    }

    /// -1, 0 or 1.
    #[must_use]
    pub fn signum(&self) -> i32 {
        match self.mantissa.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// Without its sign.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.signum() < 0 { -self } else { self.clone() }
    }

    fn shifted(&self, exponent: i32) -> BigInt {
        self.mantissa.clone() << (self.exponent - exponent)
    }
}

impl Add for &Exact {
    type Output = Exact;
    fn add(self, other: Self) -> Exact {
        // A zero has any exponent: it must not stretch the other's digits.
        if self.signum() == 0 || other.signum() == 0 {
            return if self.signum() == 0 { other.clone() } else { self.clone() };
        }
        let exponent = self.exponent.min(other.exponent);
        Exact { mantissa: self.shifted(exponent) + other.shifted(exponent), exponent }
    }
}

impl Neg for &Exact {
    type Output = Exact;
    fn neg(self) -> Exact {
        Exact { mantissa: -self.mantissa.clone(), exponent: self.exponent }
    }
}

impl Sub for &Exact {
    type Output = Exact;
    fn sub(self, other: Self) -> Exact {
        self + &-other
    }
}

impl Mul for &Exact {
    type Output = Exact;
    fn mul(self, other: Self) -> Exact {
        Exact { mantissa: &self.mantissa * &other.mantissa, exponent: self.exponent + other.exponent }
    }
}

impl PartialEq for Exact {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Exact {}
impl PartialOrd for Exact {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Exact {
    fn cmp(&self, other: &Self) -> Ordering {
        (self - other).signum().cmp(&0)
    }
}

/// A vector of exact numbers.
pub type Vector = [Exact; 3];

/// The exact value of a vector.
#[must_use]
pub fn vector(v: DVec3) -> Vector {
    v.to_array().map(Exact::new)
}

/// `a - b`.
#[must_use]
pub fn minus(a: &Vector, b: &Vector) -> Vector {
    [&a[0] - &b[0], &a[1] - &b[1], &a[2] - &b[2]]
}

/// `a . b`.
#[must_use]
pub fn dot(a: &Vector, b: &Vector) -> Exact {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

/// `a x b`.
#[must_use]
pub fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &(&a[i] * &b[j]) - &(&a[j] * &b[i]))
}

/// The largest component, without its sign.
#[must_use]
pub fn size(v: &Vector) -> Exact {
    let [x, y, z] = [v[0].abs(), v[1].abs(), v[2].abs()];
    x.max(y).max(z)
}

/// A quotient with a positive denominator.
#[derive(Clone, Debug)]
pub struct Quotient {
    num: Exact,
    den: Exact,
}

impl Quotient {
    /// `None` if the denominator is 0.
    #[must_use]
    pub fn new(num: Exact, den: Exact) -> Option<Self> {
        match den.signum() {
            0 => None,
            1 => Some(Self { num, den }),
            _ => Some(Self { num: -&num, den: -&den }),
        }
    }

    /// Against a float, which may be infinite.
    #[must_use]
    pub fn cmp_float(&self, x: f64) -> Ordering {
        if x.is_infinite() { 0.0_f64.total_cmp(&x) } else { self.cmp_exact(&Exact::new(x)) }
    }

    /// Against an exact number.
    #[must_use]
    pub fn cmp_exact(&self, x: &Exact) -> Ordering {
        self.num.cmp(&(&self.den * x))
    }

    /// Against another.
    #[must_use]
    pub fn compare(&self, other: &Self) -> Ordering {
        (&self.num * &other.den).cmp(&(&other.num * &self.den))
    }
}

/// Whether `x` is the `f64` nearest to what `cmp` compares with exact numbers, a tie going to the even one.
#[must_use]
pub fn is_nearest(x: f64, cmp: impl Fn(&Exact) -> Ordering) -> bool {
    nearest(x, x.next_down(), x.next_up(), 1024, x.to_bits() & 1 == 0, cmp)
}

/// The same for `f32`.
#[must_use]
pub fn is_nearest_f32(x: f32, cmp: impl Fn(&Exact) -> Ordering) -> bool {
    nearest(x.into(), x.next_down().into(), x.next_up().into(), 128, x.to_bits() & 1 == 0, cmp)
}

fn nearest(x: f64, below: f64, above: f64, end: i32, even: bool, cmp: impl Fn(&Exact) -> Ordering) -> bool {
    if !x.is_finite() {
        return false;
    }
    // Beyond the largest float the next would be a power of two.
    let exact = |x: f64| match (x.is_finite(), x > 0.0) {
        (true, _) => Exact::new(x),
        (_, true) => Exact::power_of_two(end),
        (_, false) => -&Exact::power_of_two(end),
    };
    let half = Exact::power_of_two(-1);
    let middle = |y: f64| &(&exact(x) + &exact(y)) * &half;
    let (low, high) = (cmp(&middle(below)), cmp(&middle(above)));
    (low.is_gt() || even && low.is_eq()) && (high.is_lt() || even && high.is_eq())
}

/// What is at least this far from 0 rounds to infinity: half a unit beyond the largest float.
#[must_use]
pub fn end(double: bool) -> Exact {
    let (exponent, digits) = if double { (1024, 53) } else { (128, 24) };
    &Exact::power_of_two(exponent) - &Exact::power_of_two(exponent - digits - 1)
}

/// What exact numbers say of a ray's line and a triangle.
#[derive(Clone, Debug)]
pub struct Crossed {
    /// The parameter.
    pub t: Quotient,
    /// Whether the triangle answers for the crossing when the origin is moved by `(e, e^2, e^3)`, `e` towards 0.
    pub crosses: bool,
}

/// The line's hit with a closed triangle; `None` for one seen from its side. Whatever the interval.
#[must_use]
pub fn line_triangle(ray: &Ray<f64>, vertices: [DVec3; 3]) -> Option<Crossed> {
    let (o, d) = (vector(ray.origin), vector(ray.direction));
    let v = vertices.map(vector);
    let [a, b, c] = [0, 1, 2].map(|i| minus(&v[i], &o));
    let edge = |p: &Vector, q: &Vector| {
        let sign = dot(&d, &cross(p, q)).signum();
        let moved = || cross(&d, &minus(q, p)).iter().map(Exact::signum).find(|&s| s != 0).unwrap_or(0);
        (sign, if sign == 0 { moved() } else { sign })
    };
    let edges = [edge(&b, &c), edge(&c, &a), edge(&a, &b)];
    if edges.iter().any(|e| e.0 < 0) && edges.iter().any(|e| e.0 > 0) {
        return None;
    }
    let n = cross(&minus(&v[1], &v[0]), &minus(&v[2], &v[0]));
    let t = Quotient::new(dot(&n, &a), dot(&n, &d))?;
    Some(Crossed { t, crosses: edges.iter().all(|e| e.1 != 0 && e.1 == edges[0].1) })
}

/// The hit of a valid ray with a closed triangle, in the ray's closed interval.
#[must_use]
pub fn ray_triangle(ray: &Ray<f64>, vertices: [DVec3; 3]) -> Option<Crossed> {
    line_triangle(ray, vertices).filter(|h| h.t.cmp_float(ray.t_min).is_ge() && h.t.cmp_float(ray.t_max).is_le())
}

/// A root of `a t^2 + 2 b t + c`.
#[derive(Clone, Debug)]
pub struct Root<'a> {
    equation: &'a [Exact; 3],
    /// The larger of two.
    larger: bool,
}

impl Root<'_> {
    /// The roots in ascending order, a double one once; none of an equation without `t`.
    #[must_use]
    pub fn of(equation: &[Exact; 3]) -> Vec<Root<'_>> {
        let [a, b, c] = equation;
        let roots = match (a.signum(), b.signum()) {
            (0, 0) => 0,
            (0, _) => 1,
            _ => 1 + (&(b * b) - &(a * c)).signum(),
        };
        (0..roots).map(|k| Root { equation, larger: k > 0 }).collect()
    }

    /// Against an exact number, by the sign of the polynomial there.
    #[must_use]
    pub fn compare(&self, x: &Exact) -> Ordering {
        let [a, b, c] = self.equation;
        let slope = &(a * x) + b;
        let value = &(&(&slope + b) * x) + c;
        if a.signum() == 0 {
            // Linear: beyond the root the value has the sign of b.
            return 0.cmp(&(value.signum() * b.signum()));
        }
        let (value, slope) = (value.signum() * a.signum(), slope.signum() * a.signum());
        match (value, self.larger) {
            // Between the roots.
            (-1, false) => Ordering::Less,
            (-1, true) => Ordering::Greater,
            // Outside: before both or after both.
            (1, _) => 0.cmp(&slope),
            // At one of them, or both.
            (_, false) => {
                if slope > 0 {
                    Ordering::Less
                } else {
                    Ordering::Equal
                }
            }
            (_, true) => {
                if slope < 0 {
                    Ordering::Greater
                } else {
                    Ordering::Equal
                }
            }
        }
    }

    /// Against a float, which may be infinite.
    #[must_use]
    pub fn cmp_float(&self, x: f64) -> Ordering {
        if x.is_infinite() { 0.0_f64.total_cmp(&x) } else { self.compare(&Exact::new(x)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_what_they_are() {
        for x in [1.0, -0.75, f64::MAX, 5e-324, -1e-310, 0.1] {
            assert!(is_nearest(x, |y| Exact::new(x).cmp(y)));
            assert!(!is_nearest(x.next_up(), |y| Exact::new(x).cmp(y)));
        }
        let sum = &Exact::new(1.0) + &Exact::new(2f64.powi(-53));
        assert!(is_nearest(1.0, |y| sum.cmp(y)) && !is_nearest(1.0f64.next_up(), |y| sum.cmp(y)), "a tie is even");
        assert!(is_nearest_f32(0.1, |y| Exact::new(0.1).cmp(y)));
        let far = Exact::power_of_two(1024);
        assert!(!is_nearest(f64::MAX, |y| far.cmp(y)) && !is_nearest(f64::INFINITY, |y| far.cmp(y)));
        let (end, little) = (end(true), Exact::power_of_two(900));
        assert!(!is_nearest(f64::MAX, |y| end.cmp(y)) && is_nearest(f64::MAX, |y| (&end - &little).cmp(y)));
    }

    #[test]
    fn roots_are_where_the_signs_change() {
        // (t - 1) (t + 3) = t^2 + 2 t - 3, and its negative.
        for s in [1.0, -1.0] {
            let equation = [s, s, -3.0 * s].map(Exact::new);
            let roots = Root::of(&equation);
            assert_eq!(roots.len(), 2);
            for (root, t) in roots.iter().zip([-3.0, 1.0]) {
                for x in [-4.0, -3.0, -1.0, 0.5, 1.0, 7.0] {
                    assert_eq!(Some(root.compare(&Exact::new(x))), t.partial_cmp(&x), "{t} {x}");
                }
            }
        }
        let linear = [0.0, 0.5, -2.0].map(Exact::new);
        let [root] = Root::of(&linear).try_into().unwrap();
        assert_eq!([1.0, 2.0, 3.0].map(|x| root.cmp_float(x)), [Ordering::Greater, Ordering::Equal, Ordering::Less]);
        assert!(Root::of(&[1.0, 0.0, 1.0].map(Exact::new)).is_empty());
        assert_eq!(Root::of(&[1.0, -2.0, 4.0].map(Exact::new)).len(), 1);
    }
}
