//! Distances and angles by plain numbers and by those of twice as many digits: pairs of `f64` whose sum is meant (Dekker 1971, Knuth's TwoSum). Apart from
//! the library's own arithmetic.

use std::ops::{Add, Div, Mul, Sub};

use glam::DVec3;

/// A number as the sum of two, the second no larger than the rounding of the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair(f64, f64);

impl Pair {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }

    fn renewed(a: f64, b: f64) -> Self {
        let s = a + b;
        Self(s, b - (s - a))
    }

    /// Its root.
    #[must_use]
    pub fn root(self) -> Self {
        if self.0 <= 0.0 {
            return Self(0.0, 0.0);
        }
        // One step of Newton's.
        let x = self.0.sqrt();
        let square = Self(x * x, x.mul_add(x, -(x * x)));
        Self::renewed(x, (self - square).0 / (2.0 * x))
    }
}

impl Add for Pair {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let (s, t) = (Self::sum(self.0, o.0), Self::sum(self.1, o.1));
        let s = Self::renewed(s.0, s.1 + t.0);
        Self::renewed(s.0, s.1 + t.1)
    }
}

impl Sub for Pair {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + Self(-o.0, -o.1)
    }
}

impl Mul for Pair {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let p = self.0 * o.0;
        let rest = self.0.mul_add(o.0, -p);
        Self::renewed(p, rest + (self.0 * o.1 + self.1 * o.0))
    }
}

impl Div for Pair {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let q = self.0 / o.0;
        let rest = self - o * Self(q, 0.0);
        let next = rest.0 / o.0;
        let rest = rest - o * Self(next, 0.0);
        Self::renewed(q, next) + Self(rest.0 / o.0, 0.0)
    }
}

/// Numbers to calculate with.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// `b - a`
    fn between(a: f64, b: f64) -> Self;
    /// Rounded.
    fn rounded(self) -> f64;
}

impl Number for Pair {
    fn between(a: f64, b: f64) -> Self {
        Self::sum(b, -a)
    }
    fn rounded(self) -> f64 {
        self.0
    }
}

impl Number for f64 {
    fn between(a: f64, b: f64) -> Self {
        b - a
    }
    fn rounded(self) -> f64 {
        self
    }
}

type Vector<N> = [N; 3];

fn from<N: Number>(a: DVec3, b: DVec3) -> Vector<N> {
    let (a, b) = (a.to_array(), b.to_array());
    [0, 1, 2].map(|k| N::between(a[k], b[k]))
}

fn dot<N: Number>(a: &Vector<N>, b: &Vector<N>) -> N {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn less<N: Number>(x: N, y: N) -> N {
    if (y - x).rounded() < 0.0 { y } else { x }
}

/// Squared distance of a point from a segment.
fn to_segment<N: Number>(a: DVec3, b: DVec3, p: DVec3) -> N {
    let (along, to) = (from::<N>(a, b), from(a, p));
    let (whole, part) = (dot(&along, &along), dot(&along, &to));
    if !(part.rounded() > 0.0) {
        return dot(&to, &to);
    }
    if (whole - part).rounded() <= 0.0 {
        let to = from(b, p);
        return dot(&to, &to);
    }
    let across = cross(&along, &to);
    dot(&across, &across) / whole
}

/// Squared distance of two segments.
#[must_use]
pub fn between_segments<N: Number>((a, b): (DVec3, DVec3), (p, q): (DVec3, DVec3)) -> N {
    let ends = less(less(to_segment(p, q, a), to_segment(p, q, b)), less(to_segment(a, b, p), to_segment(a, b, q)));
    // Where the lines are nearest, if that is on both.
    let (along, other, to) = (from::<N>(a, b), from(p, q), from(a, p));
    let normal = cross(&along, &other);
    let squared = dot(&normal, &normal);
    if !(squared.rounded() > 0.0) {
        return ends;
    }
    let (s, t) = (dot(&cross(&to, &other), &normal), dot(&cross(&to, &along), &normal));
    let on = |x: N| x.rounded() >= 0.0 && (squared - x).rounded() >= 0.0;
    if on(s) && on(t) {
        let height = dot(&normal, &to);
        return less(ends, height * height / squared);
    }
    ends
}

/// Squared distance of a point from a triangle.
#[must_use]
pub fn to_triangle<N: Number>([a, b, c]: [DVec3; 3], p: DVec3) -> N {
    let edges = [(a, b), (b, c), (c, a)];
    let normal = cross(&from::<N>(a, b), &from(a, c));
    // On the inner side of each edge, as seen along the normal?
    let within = edges.iter().all(|(a, b)| dot(&cross(&from(*a, *b), &from(*a, p)), &normal).rounded() >= 0.0);
    let squared = dot(&normal, &normal);
    if within && squared.rounded() > 0.0 {
        let height = dot(&normal, &from(a, p));
        return height * height / squared;
    }
    let [x, y, z] = edges.map(|(a, b)| to_segment(a, b, p));
    less(less(x, y), z)
}

/// Half the solid angle of a triangle as seen from a point (van Oosterom and Strackee 1983), positive from behind.
#[must_use]
pub fn half_angle(corners: [DVec3; 3], p: DVec3) -> f64 {
    let [a, b, c] = corners.map(|corner| from::<Pair>(p, corner));
    let [la, lb, lc] = [&a, &b, &c].map(|v| dot(v, v).root());
    let around = la * lb * lc + dot(&a, &b) * lc + dot(&b, &c) * la + dot(&c, &a) * lb;
    dot(&a, &cross(&b, &c)).0.atan2(around.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_geometry::distance::distance_to_triangle;
    use firsthit_measure::random::Rng;

    #[test]
    fn distances_are_those_of_f64_and_better() {
        let mut rng = Rng(3);
        for _ in 0..10_000 {
            let triangle = [rng.in_cube(), rng.in_cube(), rng.in_cube()];
            let p = rng.in_cube() * 2.0;
            let plain = distance_to_triangle::<f64>(triangle, p);
            assert!((to_triangle::<Pair>(triangle, p).root().rounded() - plain).abs() < 1e-12);
        }
        // A point 2^-60 above a plane that no axis sees straight on.
        let [a, b, c] = [DVec3::X, DVec3::Y, DVec3::Z];
        let p = DVec3::new(0.25, 0.25, 0.5 + f64::EPSILON / 2.0);
        assert!(
            (to_triangle::<Pair>([a, b, c], p).root().rounded() / (f64::EPSILON / 2.0 / 3f64.sqrt()) - 1.0).abs()
                < 1e-12
        );
    }

    #[test]
    fn segments_are_as_far_apart_as_many_of_their_points_are() {
        let mut rng = Rng(7);
        for _ in 0..2000 {
            let [a, b, p, q] = std::array::from_fn(|_| rng.in_cube());
            let exact = between_segments::<Pair>((a, b), (p, q)).root().rounded();
            let tried =
                (0..=64).map(|k| to_segment::<Pair>(p, q, a + (b - a) * (f64::from(k) / 64.0)).root().rounded());
            let tried = tried.fold(f64::INFINITY, f64::min);
            assert!(exact <= tried && tried - exact < 0.06, "{exact} {tried}");
        }
        assert_eq!(between_segments::<Pair>((DVec3::ZERO, DVec3::X), (DVec3::Y, DVec3::X + DVec3::Y)).rounded(), 1.0);
    }

    #[test]
    fn pairs_have_some_31_digits() {
        let third = Pair(1.0, 0.0) / Pair(3.0, 0.0);
        let one = third * Pair(3.0, 0.0) - Pair(1.0, 0.0);
        assert!(one.0.abs() < 1e-31);
        assert_eq!(Pair(2.0, 0.0).root().rounded(), 2f64.sqrt());
    }
}
