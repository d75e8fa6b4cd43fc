//! Distances and angles by numbers of twice as many digits: pairs of `f64` whose sum is meant (Dekker 1971, Knuth's TwoSum). Apart from
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

    /// Rounded.
    #[must_use]
    pub fn rounded(self) -> f64 {
        self.0
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

type Vector = [Pair; 3];

fn from(a: DVec3, b: DVec3) -> Vector {
    let (a, b) = (a.to_array(), b.to_array());
    [0, 1, 2].map(|k| Pair::sum(b[k], -a[k]))
}

fn dot(a: &Vector, b: &Vector) -> Pair {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Squared distance of a point from a segment.
fn to_segment(a: DVec3, b: DVec3, p: DVec3) -> Pair {
    let (along, to) = (from(a, b), from(a, p));
    let (whole, part) = (dot(&along, &along), dot(&along, &to));
    if !(part.0 > 0.0) {
        return dot(&to, &to);
    }
    if (whole - part).0 <= 0.0 {
        let to = from(b, p);
        return dot(&to, &to);
    }
    let across = cross(&along, &to);
    dot(&across, &across) / whole
}

/// Squared distance of a point from a triangle.
#[must_use]
pub fn to_triangle([a, b, c]: [DVec3; 3], p: DVec3) -> Pair {
    let edges = [(a, b), (b, c), (c, a)];
    let normal = cross(&from(a, b), &from(a, c));
    // On the inner side of each edge, as seen along the normal?
    let within = edges.iter().all(|(a, b)| dot(&cross(&from(*a, *b), &from(*a, p)), &normal).0 >= 0.0);
    let squared = dot(&normal, &normal);
    if within && squared.0 > 0.0 {
        let height = dot(&normal, &from(a, p));
        return height * height / squared;
    }
    let [x, y, z] = edges.map(|(a, b)| to_segment(a, b, p));
    let less = |x: Pair, y: Pair| if (y - x).0 < 0.0 { y } else { x };
    less(less(x, y), z)
}

/// Half the solid angle of a triangle as seen from a point (van Oosterom and Strackee 1983), positive from behind.
#[must_use]
pub fn half_angle(corners: [DVec3; 3], p: DVec3) -> f64 {
    let [a, b, c] = corners.map(|corner| from(p, corner));
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
            assert!((to_triangle(triangle, p).root().rounded() - plain).abs() < 1e-12);
        }
        // A point 2^-60 above a plane that no axis sees straight on.
        let [a, b, c] = [DVec3::X, DVec3::Y, DVec3::Z];
        let p = DVec3::new(0.25, 0.25, 0.5 + f64::EPSILON / 2.0);
        assert!((to_triangle([a, b, c], p).root().rounded() / (f64::EPSILON / 2.0 / 3f64.sqrt()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn pairs_have_some_31_digits() {
        let third = Pair(1.0, 0.0) / Pair(3.0, 0.0);
        let one = third * Pair(3.0, 0.0) - Pair(1.0, 0.0);
        assert!(one.0.abs() < 1e-31);
        assert_eq!(Pair(2.0, 0.0).root().rounded(), 2f64.sqrt());
    }
}
