//! Ray against triangle, exactly.
//!
//! With `A, B, C` the vertices relative to the origin, the ray's line meets the closed triangle exactly if the edge
//! functions `d.(B x C)`, `d.(C x A)`, `d.(A x B)` do not differ in sign and their sum, `d.n`, is not 0. There
//! `t = n.A / n.d`. All are triple products of differences of the input.
//!
//! A decision goes through up to three stages: edge functions in the sheared plane, with one bound for the triangle
//! (nearly every triangle ends here); triple products, each with a bound of its own; exact numbers.
//!
//! # Each crossing once
//! Where the ray meets an edge or a vertex, several triangles of a closed mesh are hit. To count a crossing once, the
//! origin is thought to be moved by `(e, e^2, e^3)` with `e > 0` as small as need be: then no edge function is 0, and
//! one triangle remains (or two or none, where the ray only touches the surface). Moving the origin by `m` adds
//! `m.(d x (C - B))` to the edge function of `B` and `C`, so the sign is that of the first component of `d x (C - B)`
//! that is not 0. The neighbour has the edge the other way round, and exactly the other sign. If all three are 0 the
//! edge is parallel to the ray, and the triangle is seen from its side: not crossed. (Edelsbrunner and Mucke,
//! "Simulation of Simplicity", ACM TOG 9(1) 1990.)

use core::cmp::Ordering;

use glam::DVec3;

use super::dyadic::{Dyadic, Place, cross, dot, minus, vector};
use super::root::Root;
use super::twofold::Twofold;
use crate::{Ray, triangle::Shear};

/// Unit roundoff.
const U: f64 = f64::EPSILON / 2.0;

/// Relative to the sum of the absolute values of its terms, no computed triple product is off by more than this.
///
/// Each of the six terms of `a.(b x c)` has at most three rounded differences and two products, and takes part in at
/// most three sums: (1 + u)^8. The computed sum of absolute values is itself short by at most (1 + u)^8. 16 u covers
/// 8 u / (1 - 8 u) * (1 + 9 u) with room, at the price of a rare needless fallback.
const FILTER: f64 = 16.0 * U;

/// Numbers below [`LARGE`] multiplied with what underflow loses stay below this; nothing so small is trusted.
const TINY: f64 = power_of_two(-700);
/// Input from here on goes straight to exact numbers, so that nothing overflows.
const LARGE: f64 = power_of_two(300);

const fn power_of_two(e: i64) -> f64 {
    f64::from_bits(((e + 1023) as u64) << 52)
}

/// A ray whose intersections are decided exactly.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    ray: Ray<f64>,
    /// A point on the line that vertices are seen from in `f64`: the origin, or one nearer to them.
    anchor: DVec3,
    /// How far the anchor may be off the line in each axis.
    off: f64,
    shear: Shear<f64>,
    /// Whether `f64` may be tried at all.
    tame: bool,
}

/// An exact hit.
#[derive(Clone, Copy, Debug)]
pub struct ExactHit {
    /// The ray parameter, correctly rounded.
    pub t: f64,
    /// Weight of vertex 1, from `f64`.
    pub u: f64,
    /// Weight of vertex 2, from `f64`.
    pub v: f64,
    /// Whether the triangle is the one that counts where the ray meets an edge or a vertex of a mesh: see the module's
    /// description. A closed mesh is crossed an even number of times by every line.
    pub crosses: bool,
    /// Whether `f64` could not decide, or not round, and exact numbers were needed.
    pub fallback: bool,
    vertices: [DVec3; 3],
}

/// Outcome of the first stage.
enum Sides {
    Outside,
    /// Strictly inside, with the weights of vertices 1 and 2.
    Inside(f64, f64),
    Unclear,
}

/// Outcome of the edge functions.
enum Inside {
    Strictly,
    /// The signs of the edge functions, -1, 0 or 1, known exactly.
    Signs([i32; 3]),
}

impl ExactRay {
    /// Prepares a ray; `None` if it is not valid (see [`Ray::is_valid`]).
    #[must_use]
    pub fn new(ray: Ray<f64>) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let largest = ray.direction.abs().max(ray.origin.abs()).max_element();
        let shear = Shear::new(ray.direction);
        Some(Self { ray, anchor: ray.origin, off: 0.0, shear, tame: largest < LARGE })
    }

    /// The same ray for triangles near the point at `t`: fewer decisions about a distant object need exact numbers.
    /// The answers are the same.
    #[inline]
    #[must_use]
    pub fn near(self, t: f64) -> Self {
        let way = self.ray.direction * t;
        let anchor = self.ray.origin + way;
        // Two roundings, each of at most u of its result; doubled to cover the rounding of this.
        let off = 2.0 * U * (way.abs().max_element() + anchor.abs().max_element());
        Self { anchor, off, tame: self.tame && off < LARGE, ..self }
    }

    /// The ray it was made from.
    #[must_use]
    pub fn ray(&self) -> &Ray<f64> {
        &self.ray
    }

    /// The hit with a closed triangle of finite vertices, in the ray's closed interval.
    ///
    /// ```
    /// use firsthit_geometry::{Ray, exact::ExactRay};
    /// use glam::DVec3;
    /// let ray = ExactRay::new(Ray::new(DVec3::new(0.1, 0.9, 3.0), DVec3::NEG_Z)).unwrap();
    /// // The floats nearest to 0.1 and 0.9 add up to a little more than 1: outside, though in f64 they add up to 1.
    /// assert!(ray.hit([DVec3::ZERO, DVec3::X, DVec3::Y]).is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn hit(&self, vertices: [DVec3; 3]) -> Option<ExactHit> {
        self.hit_before(vertices, f64::INFINITY)
    }

    /// As [`Self::hit`], of hits whose rounded parameter is at most `t_max`; others cost less.
    #[inline]
    #[must_use]
    pub fn hit_before(&self, vertices: [DVec3; 3], t_max: f64) -> Option<ExactHit> {
        match self.sides(&vertices) {
            Sides::Outside => None,
            Sides::Inside(u, v) => self.place(vertices, t_max, (u, v), Inside::Strictly, false),
            Sides::Unclear => self.careful(vertices, t_max),
        }
    }

    /// Whether [`Self::hit_before`] finds a hit. The parameter is not rounded unless it lies near an end of the interval, so this
    /// costs less.
    ///
    /// ```
    /// use firsthit_geometry::{Ray, exact::ExactRay};
    /// use glam::DVec3;
    /// let ray = ExactRay::new(Ray::new(DVec3::new(0.25, 0.25, 3.0), DVec3::NEG_Z)).unwrap();
    /// let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    /// assert!(ray.is_hit_before(triangle, 3.0) && !ray.is_hit_before(triangle, 2.9));
    /// ```
    #[inline]
    #[must_use]
    pub fn is_hit_before(&self, vertices: [DVec3; 3], t_max: f64) -> bool {
        match self.sides(&vertices) {
            Sides::Outside => false,
            Sides::Inside(u, v) => {
                let (first, last) = self.parameter_range(&vertices);
                let surely = self.ray.t_min < first && last < self.ray.t_max.min(t_max) && last.is_finite();
                surely || self.place(vertices, t_max, (u, v), Inside::Strictly, false).is_some()
            }
            Sides::Unclear => self.careful(vertices, t_max).is_some(),
        }
    }

    /// The first stage: edge functions in the sheared plane.
    #[inline(always)]
    fn sides(&self, vertices: &[DVec3; 3]) -> Sides {
        let [a, b, c] = [vertices[0] - self.anchor, vertices[1] - self.anchor, vertices[2] - self.anchor];
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        if !(self.tame && reach < LARGE) {
            return Sides::Unclear;
        }
        let ((ax, ay), (bx, by), (cx, cy)) = (self.shear.apply(a), self.shear.apply(b), self.shear.apply(c));
        let e0 = cx * by - cy * bx;
        let e1 = ax * cy - ay * cx;
        let e2 = bx * ay - by * ax;
        // With R the reach and h the anchor's error: a difference is off by uR + h, a sheared coordinate (at most 2R)
        // by x = 2h + 6uR: two differences, the shear, its product and the last difference. So a product is off by
        // 4Rx + x^2 + 4uR^2, an edge function by 16Rh + 48uR^2 + 2x^2 + 16uR^2. What is left of 17 and 70 covers terms
        // in u^2 and the rounding of this line.
        let bound = reach * (17.0 * self.off + 70.0 * U * reach) + 9.0 * self.off * self.off + TINY;
        let below = e0 < -bound || e1 < -bound || e2 < -bound;
        let above = e0 > bound || e1 > bound || e2 > bound;
        if below && above {
            return Sides::Outside;
        }
        if e0.abs() > bound && e1.abs() > bound && e2.abs() > bound {
            let inverse = 1.0 / (e0 + e1 + e2);
            return Sides::Inside(e1 * inverse, e2 * inverse);
        }
        Sides::Unclear
    }

    /// The exact order of two hits of this ray along it.
    #[must_use]
    pub fn order(&self, a: &ExactHit, b: &ExactHit) -> Ordering {
        // Rounding is monotone.
        a.t.total_cmp(&b.t).then_with(|| {
            let ((n, d), (m, e)) = (self.quotient(&a.vertices), self.quotient(&b.vertices));
            (n * e).cmp(&(m * d))
        })
    }

    /// The exact parameter of a hit of this ray, to order it among hits on other surfaces.
    #[must_use]
    pub fn root(&self, hit: &ExactHit) -> Root {
        let (n, d) = self.quotient(&hit.vertices);
        Root::quotient(n, d)
    }

    /// The parameter of a hit of this ray, correctly rounded to `f32`: once, not from the rounded `f64`.
    #[must_use]
    pub fn t_f32(&self, hit: &ExactHit) -> f32 {
        // Rounding twice goes wrong only where the first lands on a tie of the second.
        let near = f64::from(hit.t as f32);
        if near == hit.t {
            return hit.t as f32;
        }
        self.locate(&hit.vertices, hit.t).to_f32()
    }

    /// Decides by triple products, and by exact numbers where those cannot.
    #[cold]
    #[inline(never)]
    fn careful(&self, vertices: [DVec3; 3], t_max: f64) -> Option<ExactHit> {
        let [a, b, c] = vertices.map(|v| v - self.anchor);
        let d = self.ray.direction;
        let edges = [triple(d, b, c), triple(d, c, a), triple(d, a, b)];
        let sides = [c - b, a - c, b - a];
        let length = |v: DVec3| v.abs().element_sum();
        let tame = self.tame && a.abs().max(b.abs()).max(c.abs()).max_element() < LARGE;
        let mut fallback = false;
        let signs = [0, 1, 2].map(|i| {
            // The anchor's error m adds m.(d x side).
            let (value, bound) = (edges[i].0, edges[i].1 + self.off * 1.01 * length(d) * length(sides[i]) + TINY);
            if tame && value.abs() > bound {
                if value > 0.0 { 1 } else { -1 }
            } else {
                fallback = true;
                self.edge_sign(&vertices, i)
            }
        });
        // Mixed signs: outside. All zero: no area, or the ray lies in the plane.
        let orientation = signs.iter().copied().find(|s| *s != 0)?;
        if signs.contains(&-orientation) {
            return None;
        }
        let e = [0, 1, 2].map(|i| if signs[i] == 0 { 0.0 } else { edges[i].0.abs() });
        let sum = e[0] + e[1] + e[2];
        let weight = |x: f64| if sum > 0.0 && sum.is_finite() { x / sum } else { 1.0 / 3.0 };
        self.place(vertices, t_max, (weight(e[1]), weight(e[2])), Inside::Signs(signs), fallback)
    }

    /// Where on the ray the hit is, if in its interval.
    #[inline(never)]
    fn place(
        &self,
        vertices: [DVec3; 3],
        t_max: f64,
        (u, v): (f64, f64),
        inside: Inside,
        mut fallback: bool,
    ) -> Option<ExactHit> {
        let (first, last) = self.parameter_range(&vertices);
        if last < self.ray.t_min || first > self.ray.t_max.min(t_max) {
            return None;
        }
        let t = self.rounded(&vertices).unwrap_or_else(|| {
            fallback = true;
            self.locate(&vertices, 0.5 * (first + last)).to_f64()
        });
        // Nothing beyond the largest number is a hit, whatever the interval.
        if !t.is_finite() || t < self.ray.t_min || t > self.ray.t_max.min(t_max) {
            return None;
        }
        if t == self.ray.t_min || t == self.ray.t_max {
            // An end of the interval: the number that was rounded may lie on either side.
            fallback = true;
            let against =
                |end: f64| if end == t { self.compare(&vertices, &Dyadic::new(end)) } else { Ordering::Equal };
            if against(self.ray.t_min).is_lt() || against(self.ray.t_max).is_gt() {
                return None;
            }
        }
        let crosses = match inside {
            Inside::Strictly => true,
            Inside::Signs(signs) => self.crosses(&vertices, signs),
        };
        Some(ExactHit { t, u: u.clamp(0.0, 1.0), v: v.clamp(0.0, 1.0), crosses, fallback, vertices })
    }

    /// An interval around the parameter of the triangle's plane; everything where `f64` cannot tell.
    fn parameter_range(&self, v: &[DVec3; 3]) -> (f64, f64) {
        let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
        let (num, num_bound) = triple(v[0] - self.ray.origin, e1, e2);
        let (den, den_bound) = triple(self.ray.direction, e1, e2);
        let t = num / den;
        // |t - t*| <= (num_bound + |t| den_bound) / (|den| - den_bound); doubled for the roundings of this line itself.
        let off = 2.0 * ((num_bound + t.abs() * den_bound + TINY) / (den.abs() - den_bound) + t.abs() * f64::EPSILON);
        let sure = self.tame
            && den.abs() > den_bound + TINY
            && v[0].abs().max(v[1].abs()).max(v[2].abs()).max_element() < LARGE;
        if sure && off.is_finite() { (t - off, t + off) } else { (f64::NEG_INFINITY, f64::INFINITY) }
    }

    /// The parameter correctly rounded, if twice the digits of `f64` can tell (Ziv's test).
    fn rounded(&self, v: &[DVec3; 3]) -> Option<f64> {
        let difference = |a: DVec3, b: DVec3| [0, 1, 2].map(|i| Twofold::difference(a[i], b[i]));
        let (e1, e2, a) = (difference(v[1], v[0]), difference(v[2], v[0]), difference(v[0], self.ray.origin));
        let (mut n, mut n_size) = (Twofold::from(0.0), 0.0);
        let (mut d, mut d_size) = (Twofold::from(0.0), 0.0);
        #[allow(clippy::needless_range_loop, reason = "of three arrays, two by cyclic indices")]
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (p, q) = (e1[j] * e2[k], e1[k] * e2[j]);
            let (normal, size) = (p - q, p.abs() + q.abs());
            n = n + normal * a[i];
            n_size += size * a[i].abs();
            let direction = self.ray.direction[i];
            d = d + normal * direction.into();
            d_size += size * direction.abs();
        }
        // Each operation is good to 2^-100 of its operands' sizes; some eight of them lie between input and sum.
        const ERROR: f64 = power_of_two(-95);
        let (n_off, d_off) = (n_size * ERROR, d_size * ERROR);
        let in_range = |x: f64| x > power_of_two(-500) && x < power_of_two(900);
        if !(in_range(n_size) && in_range(d_size) && d.abs() > 2.0 * d_off) {
            return None;
        }
        let t = n.high / d.high;
        let rest = n - d * t.into();
        let correction = rest.high / d.high;
        let h = t + correction;
        let l = (t - h) + correction;
        let off =
            4.0 * ((n_off + t.abs() * d_off) / d.abs() + correction.abs() * f64::EPSILON) + t.abs() * power_of_two(-98);
        // What is left of the sum must not reach the middle to the next float, whatever the error.
        (t.abs() > power_of_two(-500) && h + (l + off) == h && h + (l - off) == h).then_some(h)
    }

    /// Numerator and positive denominator of the parameter.
    fn quotient(&self, v: &[DVec3; 3]) -> (Dyadic, Dyadic) {
        let [v0, v1, v2] = v.map(vector);
        let n = cross(&minus(&v1, &v0), &minus(&v2, &v0));
        let numerator = dot(&minus(&v0, &vector(self.ray.origin)), &n);
        let denominator = dot(&vector(self.ray.direction), &n);
        if denominator.signum() < 0 { (-numerator, -denominator) } else { (numerator, denominator) }
    }

    /// The parameter against a number.
    fn compare(&self, v: &[DVec3; 3], x: &Dyadic) -> Ordering {
        let (n, d) = self.quotient(v);
        n.cmp(&(&d * x))
    }

    fn locate(&self, v: &[DVec3; 3], guess: f64) -> Place {
        let (n, d) = self.quotient(v);
        let guess = if guess.is_finite() { guess } else { n.approximate_quotient(&d) };
        Place::find(guess, |x| n.cmp(&(&d * x)))
    }

    /// Sign of the edge function opposite vertex `i`.
    fn edge_sign(&self, v: &[DVec3; 3], i: usize) -> i32 {
        let o = vector(self.ray.origin);
        let (b, c) = (vector(v[(i + 1) % 3]), vector(v[(i + 2) % 3]));
        dot(&vector(self.ray.direction), &cross(&minus(&b, &o), &minus(&c, &o))).signum()
    }

    /// Whether all edge functions have one sign once the origin is moved.
    fn crosses(&self, v: &[DVec3; 3], mut signs: [i32; 3]) -> bool {
        for (i, sign) in signs.iter_mut().enumerate().filter(|(_, s)| **s == 0) {
            let side = minus(&vector(v[(i + 2) % 3]), &vector(v[(i + 1) % 3]));
            let change = cross(&vector(self.ray.direction), &side);
            *sign = change.iter().map(Dyadic::signum).find(|s| *s != 0).unwrap_or(0);
        }
        signs[0] != 0 && signs[0] == signs[1] && signs[1] == signs[2]
    }
}

/// `a.(b x c)` and a bound on its error.
#[inline(always)]
fn triple(a: DVec3, b: DVec3, c: DVec3) -> (f64, f64) {
    let x = (b.y * c.z, b.z * c.y);
    let y = (b.z * c.x, b.x * c.z);
    let z = (b.x * c.y, b.y * c.x);
    let value = a.x * (x.0 - x.1) + a.y * (y.0 - y.1) + a.z * (z.0 - z.1);
    let size =
        a.x.abs() * (x.0.abs() + x.1.abs()) + a.y.abs() * (y.0.abs() + y.1.abs()) + a.z.abs() * (z.0.abs() + z.1.abs());
    (value, size * FILTER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type P = [i32; 3];

    fn point(size: i32) -> impl Strategy<Value = P> {
        [-size..=size, -size..=size, -size..=size]
    }

    fn vec(p: P, scale: f64) -> DVec3 {
        DVec3::new(p[0].into(), p[1].into(), p[2].into()) * scale
    }

    fn line(o: P, d: P, scale: f64) -> ExactRay {
        let line = Ray::<f64>::new(vec(o, scale), vec(d, scale));
        ExactRay::new(line.with_interval(f64::NEG_INFINITY, f64::INFINITY)).unwrap()
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
            v in [point(4), point(4), point(4)], o in point(6), d in point(4),
            e in prop_oneof![Just(0), -120i32..100, -330i32..330], near in -3.0..3.0,
        ) {
            prop_assume!(d != [0; 3]);
            let s = 2f64.powi(e);
            let line = line(o, d, s);
            let expected = oracle(v, o, d);
            for ray in [line, line.near(near)] {
                let hit = ray.hit(v.map(|p| vec(p, s)));
                prop_assert_eq!(hit.is_some(), expected.is_some());
                if let (Some(hit), Some((n, d))) = (hit, expected) {
                    // A quotient of small integers is rounded once by the processor too.
                    prop_assert_eq!(hit.t, n as f64 / d as f64);
                    // Its f64 lies on a tie of f32 only if it is exact.
                    prop_assert_eq!(ray.t_f32(&hit), hit.t as f32);
                }
            }
        }

        /// Whether there is a hit is told without rounding its parameter, and alike: near the ends of the interval too.
        #[test]
        fn whether_is_where_without_its_number(
            v in [point(4), point(4), point(4)], o in point(6), d in point(4), e in prop_oneof![Just(0), -120i32..100, -330i32..330],
            ends in [-2i64..3, -2i64..3], [low, high, most] in [0usize..4, 0..4, 0..4],
        ) {
            prop_assume!(d != [0; 3]);
            let s = 2f64.powi(e);
            let v = v.map(|p| vec(p, s));
            let t = line(o, d, s).hit(v).map_or(0.5, |hit| hit.t);
            let beside = |k: i64| f64::from_bits(t.to_bits().wrapping_add_signed(k));
            let ends = [f64::NEG_INFINITY, beside(ends[0]), beside(ends[1]), f64::INFINITY];
            let (low, high, most) = (ends[low], ends[high], ends[most]);
            let ray = Ray::<f64>::new(vec(o, s), vec(d, s)).with_interval(low, high);
            if let Some(ray) = ExactRay::new(ray) {
                for ray in [ray, ray.near(t)] {
                    prop_assert_eq!(ray.is_hit_before(v, most), ray.hit_before(v, most).is_some());
                }
            }
        }

        /// Interval ends are compared exactly: t is in [t, t] exactly where it is representable.
        #[test]
        fn the_interval_is_closed(v in [point(4), point(4), point(4)], o in point(6), d in point(4)) {
            prop_assume!(d != [0; 3]);
            if let Some((n, m)) = oracle(v, o, d) {
                let t = n as f64 / m as f64;
                let representable = Dyadic::new(t) * Dyadic::new(m as f64) == Dyadic::new(n as f64);
                let v = v.map(|p| vec(p, 1.0));
                let base = Ray::<f64>::new(vec(o, 1.0), vec(d, 1.0));
                let hits = |lo, hi| ExactRay::new(base.with_interval(lo, hi)).unwrap().hit(v).is_some();
                prop_assert_eq!(hits(t, t), representable);
                prop_assert!(hits(t.next_down(), t.next_up()));
                prop_assert!(!hits(t.next_up(), f64::INFINITY) && !hits(f64::NEG_INFINITY, t.next_down()));
            }
        }

        /// Of two triangles through lattice points, the order is that of the quotients.
        #[test]
        fn order_is_exact(
            v in [point(4), point(4), point(4)], w in [point(4), point(4), point(4)], o in point(6), d in point(4)
        ) {
            prop_assume!(d != [0; 3]);
            if let (Some((n0, d0)), Some((n1, d1))) = (oracle(v, o, d), oracle(w, o, d)) {
                let ray = line(o, d, 1.0);
                let (a, b) = (ray.hit(v.map(|p| vec(p, 1.0))).unwrap(), ray.hit(w.map(|p| vec(p, 1.0))).unwrap());
                prop_assert_eq!(ray.order(&a, &b), (n0 * d1).cmp(&(n1 * d0)));
            }
        }

        /// Every line crosses a closed surface an even number of times, through whatever edges and vertices it goes:
        /// here the doubled faces of a tetrahedron and of an octahedron, flat and degenerate ones among them.
        #[test]
        fn closed_surfaces_are_crossed_an_even_number_of_times(
            p in prop::array::uniform6(point(3)), o in point(3), d in point(2), near in -3.0..3.0
        ) {
            prop_assume!(d != [0; 3]);
            let tetrahedron = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
            let octahedron =
                [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
            for faces in [tetrahedron.as_slice(), octahedron.as_slice()] {
                for ray in [line(o, d, 1.0), line(o, d, 1.0).near(near)] {
                    let crossed = |f: &&[usize; 3]| ray.hit(f.map(|i| vec(p[i], 1.0))).is_some_and(|h| h.crosses);
                    prop_assert_eq!(faces.iter().filter(crossed).count() % 2, 0);
                }
            }
        }

        /// The parameter is rounded once, as the comparison of exact numbers says, and never needs them for ordinary
        /// input.
        #[test]
        fn ordinary_rays_stay_in_floats(x in prop::array::uniform15(-100.0..100.0f32), near in 0.0..2.0) {
            let at = |i: usize| DVec3::new(x[i].into(), x[i + 1].into(), x[i + 2].into());
            // Aimed inside the triangle.
            let v = [at(6), at(9), at(12)];
            let d = (v[0] + v[1] * 0.5 + v[2] * 0.7) / 2.2 - at(0);
            let ray = ExactRay::new(Ray::<f64>::new(at(0), d)).unwrap().near(near);
            if let Some(hit) = ray.hit(v) {
                let place = ray.locate(&v, 1.0);
                prop_assert_eq!(hit.t, place.to_f64());
                prop_assert_eq!(ray.t_f32(&hit), place.to_f32());
                prop_assert!(!hit.fallback || (v[1] - v[0]).cross(v[2] - v[0]).length() < 1e-2);
            }
        }

        /// Any finite input, denormals and the largest numbers included: no panic.
        #[test]
        fn any_finite_input(bits in prop::array::uniform15(any::<u64>()), single in any::<bool>(), near in -1e3..1e3) {
            let x = bits.map(|b| if single { f32::from_bits(b as u32).into() } else { f64::from_bits(b) });
            prop_assume!(x.iter().all(|x: &f64| x.is_finite()));
            let at = |i: usize| DVec3::new(x[i], x[i + 1], x[i + 2]);
            if let Some(ray) = ExactRay::new(Ray::<f64>::new(at(0), at(3)))
                && let Some(hit) = ray.near(near).hit([at(6), at(9), at(12)])
            {
                prop_assert!(hit.t >= 0.0);
                prop_assert!((0.0..=1.0).contains(&hit.u) && (0.0..=1.0).contains(&hit.v));
                prop_assert_eq!(ray.hit([at(6), at(9), at(12)]).map(|h| h.t), Some(hit.t));
            }
        }
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        // x = 2^24 + 1 over d = 2^24 lies in the middle between 1 and its successor in f32; with 53 for 24, in f64.
        let wall = |x: f64| [DVec3::new(x, -1e9, -1e9), DVec3::new(x, 1e9, -1e9), DVec3::new(x, 0.0, 1e9)];
        let single = |o: f64, far: f64| {
            let ray = ExactRay::new(Ray::<f64>::new(DVec3::new(o, 0.0, 0.0), DVec3::X * far)).unwrap();
            ray.t_f32(&ray.hit(wall(far)).unwrap())
        };
        let far = 2f64.powi(24);
        // (2^24 - (-1)) / 2^24: the tie goes to the even neighbour, 1.
        assert_eq!(single(-1.0, far), 1.0);
        // Just beyond the tie, where an f64 in between would be the tie itself.
        assert_eq!(single(-1.0 - 2f64.powi(-52), far), 1.0 + f32::EPSILON);
        // (2^24 + 3) / 2^24 = 1 + 1.5 ulp: the tie goes up to the even one.
        assert_eq!(single(-3.0, far), 1.0 + 2.0 * f32::EPSILON);

        let double = |o: f64, far: f64| {
            let ray = ExactRay::new(Ray::<f64>::new(DVec3::new(o, 0.0, 0.0), DVec3::X * far)).unwrap();
            ray.hit(wall(far)).unwrap()
        };
        let far = 2f64.powi(53);
        assert_eq!(double(-1.0, far).t, 1.0);
        assert!(double(-1.0, far).fallback);
        assert_eq!(double(-3.0, far).t, 1.0 + 2.0 * f64::EPSILON);
    }
}
