//! Ray against triangle, exactly.
//!
//! With `A, B, C` the vertices relative to the origin, the ray's line meets the closed triangle exactly if the edge
//! functions `d.(B x C)`, `d.(C x A)`, `d.(A x B)` do not differ in sign and their sum, `d.n`, is not 0. There
//! `t = n.A / n.d`. All are triple products of differences of the input, polynomials that integers compute exactly.

use core::cmp::Ordering;

use glam::{DVec3, Vec3};

use super::int::Int;
use crate::Ray;

/// Relative to the sum of the absolute values of its terms, no computed triple product is off by more than this.
///
/// Each of the six terms of `a.(b x c)` has at most three rounded differences and two products, and takes part in at
/// most three sums: (1 + u)^8. The computed sum of absolute values is itself short by at most (1 + u)^8. 16 u covers
/// 8 u / (1 - 8 u) * (1 + 9 u) with room, at the price of a rare needless fallback. Nothing overflows or underflows:
/// differences of `f32` lie within 2^-149 and 2^129, their triple products within 2^-447 and 2^387.
const FILTER: f64 = 16.0 * f64::EPSILON / 2.0;

/// A coordinate, scaled by 2^149: 277 bits and a sign; a difference takes one more.
type Coordinate = Int<5>;
/// A cross product of differences: 559 bits.
type Cross = Int<9>;
/// A triple product of differences: 841 bits.
type Triple = Int<14>;
/// A triple product times a coordinate: 1119 bits.
type Scaled = Int<18>;
/// A product of two triple products.
type Quotients = Int<27>;

/// A ray whose intersections are decided exactly. The ray must be valid.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    ray: Ray<f32>,
    origin: DVec3,
    direction: DVec3,
}

/// An exact hit: its place along the ray is kept as a quotient that can be compared without rounding.
#[derive(Clone, Copy, Debug)]
pub struct ExactHit {
    /// The ray parameter, correctly rounded.
    pub t: f32,
    /// Weight of vertex 1, rounded from `f64`.
    pub u: f32,
    /// Weight of vertex 2, rounded from `f64`.
    pub v: f32,
    /// Whether integers were needed for the decision or the rounding.
    pub fallback: bool,
    vertices: [Vec3; 3],
    /// The exact parameter lies in this interval.
    range: (f64, f64),
}

/// A quotient of triple products with a positive denominator: the exact ray parameter.
#[derive(Clone, Copy, Debug)]
struct Parameter {
    numerator: Triple,
    denominator: Triple,
}

impl ExactRay {
    /// Prepares a ray; `None` if it is not valid (see [`Ray::is_valid`]).
    #[must_use]
    pub fn new(ray: Ray<f32>) -> Option<Self> {
        ray.is_valid().then(|| Self { ray, origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3() })
    }

    /// The hit with a closed triangle of finite vertices, in the ray's closed interval.
    ///
    /// ```
    /// use firsthit_geometry::{Ray, exact::ExactRay};
    /// use glam::Vec3;
    /// let ray = ExactRay::new(Ray::new(Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z)).unwrap();
    /// // 0.1f32 + 0.2f32 + 0.7f32 is 1 only after rounding; the exact test knows on which side of the edge it is.
    /// let hit = ray.hit([Vec3::ZERO, Vec3::X, Vec3::Y]).unwrap();
    /// assert_eq!(hit.t, 3.0);
    /// ```
    #[must_use]
    pub fn hit(&self, vertices: [Vec3; 3]) -> Option<ExactHit> {
        let [a, b, c] = vertices.map(|v| v.as_dvec3() - self.origin);
        let d = self.direction;
        let edges = [triple(d, b, c), triple(d, c, a), triple(d, a, b)];
        let mut fallback = false;
        let mut sign = |(value, bound): (f64, f64), of: fn(&Self, [Vec3; 3]) -> Triple, order: [usize; 3]| {
            if value.abs() > bound {
                if value > 0.0 { 1 } else { -1 }
            } else {
                fallback = true;
                of(self, order.map(|i| vertices[i])).signum()
            }
        };
        let signs = [
            sign(edges[0], Self::edge, [0, 1, 2]),
            sign(edges[1], Self::edge, [1, 2, 0]),
            sign(edges[2], Self::edge, [2, 0, 1]),
        ];
        // Mixed signs: outside. All zero: no area, or the ray lies in the plane.
        let orientation = signs.iter().copied().find(|s| *s != 0)?;
        if signs.contains(&-orientation) {
            return None;
        }
        let sum = edges.map(|e| e.0).iter().sum::<f64>();
        let range = self.parameter_range(vertices);
        let (t_min, t_max) = (f64::from(self.ray.t_min), f64::from(self.ray.t_max));
        let inside = range.0 >= t_min && range.1 <= t_max;
        if !inside && (range.1 < t_min || range.0 > t_max) {
            return None;
        }
        // Rounding is monotone: if both ends of the interval round alike, so does what lies between.
        let t = if inside && range.0 as f32 == range.1 as f32 {
            range.0 as f32
        } else {
            fallback = true;
            let p = self.parameter(vertices);
            if p.cmp_f32(self.ray.t_min) == Ordering::Less || p.cmp_f32(self.ray.t_max) == Ordering::Greater {
                return None;
            }
            p.rounded()
        };
        let weight = |e: (f64, f64)| (e.0 / sum).clamp(0.0, 1.0) as f32;
        Some(ExactHit { t, u: weight(edges[1]), v: weight(edges[2]), fallback, vertices, range })
    }

    /// The exact order of two hits of this ray along it.
    #[must_use]
    pub fn order(&self, a: &ExactHit, b: &ExactHit) -> Ordering {
        if a.range.1 < b.range.0 {
            Ordering::Less
        } else if a.range.0 > b.range.1 {
            Ordering::Greater
        } else {
            let (p, q) = (self.parameter(a.vertices), self.parameter(b.vertices));
            let left: Quotients = p.numerator.mul(&q.denominator);
            left.cmp(&q.numerator.mul(&p.denominator))
        }
    }

    /// An interval around the exact parameter of the triangle's plane; everything where `f64` cannot tell.
    fn parameter_range(&self, v: [Vec3; 3]) -> (f64, f64) {
        let [v0, v1, v2] = v.map(Vec3::as_dvec3);
        let (e1, e2) = (v1 - v0, v2 - v0);
        let (num, num_bound) = triple(v0 - self.origin, e1, e2);
        let (den, den_bound) = triple(self.direction, e1, e2);
        if den.abs() <= den_bound {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        let t = num / den;
        // |t - t*| <= (num_bound + |t| den_bound) / (|den| - den_bound); doubled for the roundings of this line itself.
        let off = 2.0 * ((num_bound + t.abs() * den_bound) / (den.abs() - den_bound) + t.abs() * f64::EPSILON);
        (t - off, t + off)
    }

    /// `d.(B x C)` in the order of the vertices given: the edge function opposite the first.
    fn edge(&self, [_, b, c]: [Vec3; 3]) -> Triple {
        let o = exact(self.ray.origin);
        dot(&exact(self.ray.direction), &cross(&minus(&exact(b), &o), &minus(&exact(c), &o)))
    }

    /// The exact parameter; the denominator must not be 0.
    fn parameter(&self, v: [Vec3; 3]) -> Parameter {
        let [v0, v1, v2] = v.map(exact);
        let n = cross(&minus(&v1, &v0), &minus(&v2, &v0));
        let numerator = dot(&minus(&v0, &exact(self.ray.origin)), &n);
        let denominator = dot(&exact(self.ray.direction), &n);
        if denominator.signum() < 0 {
            Parameter { numerator: numerator.neg(), denominator: denominator.neg() }
        } else {
            Parameter { numerator, denominator }
        }
    }
}

impl Parameter {
    /// Compares with a number, which may be infinite.
    fn cmp_f32(&self, x: f32) -> Ordering {
        if x.is_infinite() {
            return if x > 0.0 { Ordering::Less } else { Ordering::Greater };
        }
        self.cmp_scaled(&Coordinate::from_f32(x), 0)
    }

    /// Compares with `x * 2^-(149 + extra)`.
    fn cmp_scaled(&self, x: &Coordinate, extra: u32) -> Ordering {
        let left = self.numerator.widen::<18>().shl(149 + extra);
        let right: Scaled = self.denominator.mul(x);
        left.cmp(&right)
    }

    /// The nearest `f32`, ties to even.
    fn rounded(&self) -> f32 {
        let ((n, en), (d, ed)) = (self.numerator.approximate(), self.denominator.approximate());
        if n == 0.0 {
            return 0.0;
        }
        // Good to 2^-51: at most one step away from the right answer. In two steps, as 2^(en - ed) alone may overflow.
        let e = (en - ed).clamp(-1000, 1000);
        let mut t = (n / d * 2f64.powi(e / 2) * 2f64.powi(e - e / 2)) as f32;
        for _ in 0..2 {
            if t.is_infinite() {
                // The tie between the largest number and infinity belongs to infinity.
                let largest = f32::MAX.copysign(t);
                if self.beyond_midpoint(largest, t) == Ordering::Less { t = largest } else { return t }
            }
            let (up, down) = (t.next_up(), t.next_down());
            let (above, below) = (self.cmp_midpoint(t, up), self.cmp_midpoint(down, t));
            let odd = t.to_bits() & 1 == 1;
            t = match (above, below) {
                (Ordering::Greater, _) => up,
                (_, Ordering::Less) => down,
                (Ordering::Equal, _) if odd => up,
                (_, Ordering::Equal) if odd => down,
                _ => return t,
            };
        }
        t
    }

    /// Compares with the middle of two neighbouring numbers.
    fn cmp_midpoint(&self, low: f32, high: f32) -> Ordering {
        if high.is_infinite() || low.is_infinite() {
            let (finite, infinite) = if high.is_infinite() { (low, high) } else { (high, low) };
            let beyond = self.beyond_midpoint(finite, infinite);
            return if infinite > 0.0 { beyond } else { beyond.reverse() };
        }
        // (low + high) / 2, in units of 2^-150.
        self.cmp_scaled(&Coordinate::from_f32(low).add(&Coordinate::from_f32(high)), 1)
    }

    /// Compares the magnitude with the largest number and half a step more.
    fn beyond_midpoint(&self, largest: f32, infinite: f32) -> Ordering {
        let step = Coordinate::from_f32(f32::MAX).sub(&Coordinate::from_f32(f32::MAX.next_down()));
        let twice = Coordinate::from_f32(largest.abs());
        let middle = twice.add(&twice).add(&step);
        let magnitude = Self { numerator: self.numerator.magnitude(), denominator: self.denominator };
        if (self.numerator.signum() < 0) != (infinite < 0.0) {
            return Ordering::Less;
        }
        magnitude.cmp_scaled(&middle, 1)
    }
}

/// `a.(b x c)` and a bound on its error.
fn triple(a: DVec3, b: DVec3, c: DVec3) -> (f64, f64) {
    let x = (b.y * c.z, b.z * c.y);
    let y = (b.z * c.x, b.x * c.z);
    let z = (b.x * c.y, b.y * c.x);
    let value = a.x * (x.0 - x.1) + a.y * (y.0 - y.1) + a.z * (z.0 - z.1);
    let size =
        a.x.abs() * (x.0.abs() + x.1.abs()) + a.y.abs() * (y.0.abs() + y.1.abs()) + a.z.abs() * (z.0.abs() + z.1.abs());
    (value, size * FILTER)
}

fn exact(v: Vec3) -> [Coordinate; 3] {
    v.to_array().map(Coordinate::from_f32)
}

fn minus(a: &[Coordinate; 3], b: &[Coordinate; 3]) -> [Coordinate; 3] {
    core::array::from_fn(|i| a[i].sub(&b[i]))
}

fn cross(a: &[Coordinate; 3], b: &[Coordinate; 3]) -> [Cross; 3] {
    core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j].mul::<5, 9>(&b[k]).sub(&a[k].mul(&b[j]))
    })
}

fn dot(a: &[Coordinate; 3], b: &[Cross; 3]) -> Triple {
    (0..3).fold(Triple::ZERO, |s, i| s.add(&a[i].mul(&b[i])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type P = [i32; 3];

    fn point(size: i32) -> impl Strategy<Value = P> {
        [-size..=size, -size..=size, -size..=size]
    }

    fn vec(p: P, scale: f32) -> Vec3 {
        Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32) * scale
    }

    /// The same decision in 128-bit integers, for small input: numerator and (positive) denominator of t.
    fn oracle(v: [P; 3], o: P, d: P) -> Option<(i128, i128)> {
        let sub = |a: P, b: P| [0, 1, 2].map(|i| i128::from(a[i]) - i128::from(b[i]));
        let det = |a: [i128; 3], b: [i128; 3], c: [i128; 3]| {
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        let dir = d.map(i128::from);
        let [a, b, c] = v.map(|p| sub(p, o));
        let e = [det(dir, b, c), det(dir, c, a), det(dir, a, b)];
        let sum: i128 = e.iter().sum();
        if sum == 0 || e.iter().any(|x| *x < 0) && e.iter().any(|x| *x > 0) {
            return None;
        }
        let num = det(a, sub(v[1], v[0]), sub(v[2], v[0]));
        Some((num * sum.signum(), sum.abs()))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A coarse grid makes edge hits, vertex hits, coplanar rays and slivers common.
        #[test]
        fn decisions_are_those_of_integers(
            v in [point(4), point(4), point(4)], o in point(6), d in point(4), e in prop_oneof![Just(0), -120i32..100]
        ) {
            prop_assume!(d != [0; 3]);
            let s = 2f32.powi(e);
            let line = Ray::new(vec(o, s), vec(d, s)).with_interval(f32::NEG_INFINITY, f32::INFINITY);
            let exact = ExactRay::new(line).unwrap().hit(v.map(|p| vec(p, s)));
            let expected = oracle(v, o, d);
            prop_assert_eq!(exact.is_some(), expected.is_some());
            if let (Some(hit), Some((n, d))) = (exact, expected) {
                // Small numbers: the f64 quotient is far from the middle of two f32 unless it is exact.
                prop_assert_eq!(hit.t, (n as f64 / d as f64) as f32);
            }
        }

        /// Interval ends are compared exactly: t is in [t, t] exactly where it is representable.
        #[test]
        fn the_interval_is_closed(v in [point(4), point(4), point(4)], o in point(6), d in point(4)) {
            prop_assume!(d != [0; 3]);
            if let Some((n, m)) = oracle(v, o, d) {
                let line = Ray::new(vec(o, 1.0), vec(d, 1.0));
                let t = (n as f64 / m as f64) as f32;
                let representable = f64::from(t) * m as f64 == n as f64;
                let v = v.map(|p| vec(p, 1.0));
                let hits = |lo, hi| ExactRay::new(line.with_interval(lo, hi)).unwrap().hit(v).is_some();
                prop_assert_eq!(hits(t, t), representable);
                prop_assert!(hits(t.next_down(), t.next_up()));
                prop_assert!(!hits(t.next_up(), f32::INFINITY) && !hits(f32::NEG_INFINITY, t.next_down()));
            }
        }

        /// Of two triangles through lattice points, the order is that of the quotients.
        #[test]
        fn order_is_exact(
            v in [point(4), point(4), point(4)], w in [point(4), point(4), point(4)], o in point(6), d in point(4)
        ) {
            prop_assume!(d != [0; 3]);
            if let (Some((n0, d0)), Some((n1, d1))) = (oracle(v, o, d), oracle(w, o, d)) {
                let line = Ray::new(vec(o, 1.0), vec(d, 1.0)).with_interval(f32::NEG_INFINITY, f32::INFINITY);
                let ray = ExactRay::new(line).unwrap();
                let (a, b) = (ray.hit(v.map(|p| vec(p, 1.0))).unwrap(), ray.hit(w.map(|p| vec(p, 1.0))).unwrap());
                prop_assert_eq!(ray.order(&a, &b), (n0 * d1).cmp(&(n1 * d0)));
            }
        }

        /// Any finite input, denormals and the largest numbers included: no panic, and t within a rounding of f64's.
        #[test]
        fn any_finite_input(bits in prop::array::uniform15(any::<u32>())) {
            let x = bits.map(f32::from_bits);
            prop_assume!(x.iter().all(|x| x.is_finite()));
            let at = |i: usize| Vec3::new(x[i], x[i + 1], x[i + 2]);
            if let Some(ray) = ExactRay::new(Ray::new(at(0), at(3)))
                && let Some(hit) = ray.hit([at(6), at(9), at(12)])
            {
                prop_assert!(hit.t >= 0.0);
                prop_assert!((0.0..=1.0).contains(&hit.u) && (0.0..=1.0).contains(&hit.v));
            }
        }
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        // A plane at x = 1 + 2^-24, the middle of 1 and its successor, cannot be an f32; x = 2^24 + 1 over d = 2^24 is it.
        let far = 16_777_216.0f32;
        let wall = |x: f32| [Vec3::new(x, -1e9, -1e9), Vec3::new(x, 1e9, -1e9), Vec3::new(x, 0.0, 1e9)];
        let t = |o: f32, x: f32| {
            let ray = Ray::new(Vec3::new(o, 0.0, 0.0), Vec3::X * far);
            ExactRay::new(ray).unwrap().hit(wall(x)).unwrap()
        };
        // (2^24 - (-1)) / 2^24: the tie goes to the even neighbour, 1.
        assert_eq!(t(-1.0, far).t, 1.0);
        assert!(t(-1.0, far).fallback);
        // Just beyond the tie.
        assert_eq!(t(-1.0 - f32::EPSILON, far).t, 1.0 + f32::EPSILON);
        // (2^24 + 3) / 2^24 = 1 + 1.5 ulp: the tie goes up to the even one.
        assert_eq!(t(-3.0, far).t, 1.0 + 2.0 * f32::EPSILON);
    }
}
