//! Closest points: on a segment, a box, a triangle, and between two of these.

use glam::DVec3;

use crate::{Aabb, Real, Vector3};

/// The nearest point of a primitive, and where on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint<R: Real> {
    /// The point itself.
    pub point: R::Vec3,
    /// Its weights: of the segment's two ends (the third is 0), or of the triangle's vertices 0, 1 and 2. They are
    /// not negative and sum to 1.
    pub weights: [R; 3],
}

/// What of a triangle a point lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Feature {
    /// Its inside.
    Face,
    /// The edge from this vertex to the next, without its ends.
    Edge(u8),
    /// This vertex.
    Vertex(u8),
}

impl<R: Real> ClosestPoint<R> {
    /// What of the triangle the point lies on: told by the weights that are 0.
    ///
    /// ```
    /// use firsthit_geometry::distance::{Feature, closest_on_triangle};
    /// use glam::DVec3;
    /// let nearest = closest_on_triangle::<f64>([DVec3::ZERO, DVec3::X, DVec3::Y], DVec3::new(1.0, 1.0, 2.0));
    /// assert_eq!(nearest.feature(), Feature::Edge(1));
    /// ```
    #[must_use]
    pub fn feature(&self) -> Feature {
        match self.weights.map(|w| w == R::ZERO) {
            [_, true, true] => Feature::Vertex(0),
            [true, _, true] => Feature::Vertex(1),
            [true, true, _] => Feature::Vertex(2),
            [_, _, true] => Feature::Edge(0),
            [true, _, _] => Feature::Edge(1),
            [_, true, _] => Feature::Edge(2),
            _ => Feature::Face,
        }
    }
}

/// The point of the segment from `a` to `b` nearest to `p`. The ends may coincide.
///
/// Error: some `u` times the largest distance between the three points.
#[must_use]
pub fn closest_on_segment<R: Real>(a: R::Vec3, b: R::Vec3, p: R::Vec3) -> ClosestPoint<R> {
    let (ab, ap) = (b - a, p - a);
    // Scaled, so that the squares neither overflow nor vanish; a segment without length gives 0/0 and is cut to 0.
    let k = R::ONE / ab.abs().max_element().power_of_two_below();
    let e = ab * k;
    let t = (ap * k).dot(e) / e.dot(e);
    let t = if t > R::ZERO { t.min(R::ONE) } else { R::ZERO };
    // From the nearer end: at the end itself the result is that end, bit for bit.
    let point = if t <= R::HALF { a + ab * t } else { b - ab * (R::ONE - t) };
    ClosestPoint { point, weights: [R::ONE - t, t, R::ZERO] }
}

/// The point of a closed box nearest to `p`: `p` itself if it is inside. Exact. An empty box gives its lower corner's
/// coordinates where it is inverted.
#[must_use]
pub fn closest_on_box<R: Real>(bounds: &Aabb<R>, p: R::Vec3) -> R::Vec3 {
    p.min(bounds.max).max(bounds.min)
}

/// The point of a triangle nearest to `p`. Triangles without area are the segment or point that they are.
///
/// The perpendicular foot where it falls inside, else the best of the three edges (the regions of Ericson, *Real-Time
/// Collision Detection*, section 5.1.5, without its divisions by areas that may vanish). Error: some `u` times the
/// largest distance between the four points, divided by the sine of the smallest angle for the foot. On an edge the
/// point has the same bits for both triangles of that edge, whichever way they run through it.
///
/// ```
/// use firsthit_geometry::distance::closest_on_triangle;
/// use glam::DVec3;
/// let nearest = closest_on_triangle::<f64>([DVec3::ZERO, DVec3::X, DVec3::Y], DVec3::new(0.25, 0.25, 3.0));
/// assert_eq!(nearest.point, DVec3::new(0.25, 0.25, 0.0));
/// assert_eq!(nearest.weights, [0.5, 0.25, 0.25]);
/// ```
#[must_use]
pub fn closest_on_triangle<R: Real>([a, b, c]: [R::Vec3; 3], p: R::Vec3) -> ClosestPoint<R> {
    let (ab, ac) = (b - a, c - a);
    let k = R::ONE / ab.abs().max(ac.abs()).max_element().power_of_two_below();
    let (e, f, q) = (ab * k, ac * k, (p - a) * k);
    let n = e.cross(f);
    let area = n.dot(n);
    let (v, w) = (n.dot(q.cross(f)) / area, n.dot(e.cross(q)) / area);
    let inside = v >= R::ZERO && w >= R::ZERO && v + w <= R::ONE;
    let foot = ClosestPoint { point: a + ab * v + ac * w, weights: [R::ONE - v - w, v, w] };
    // Of a sliver the area is mostly rounding, and the foot may be anywhere in it: then the edges are asked too.
    let sliver = area <= e.dot(e) * f.dot(f) * R::UNIT_ROUNDOFF;
    if inside && !sliver {
        return foot;
    }
    let edge = |from: R::Vec3, to: R::Vec3, order: [usize; 3]| {
        let turned = precedes::<R>(to, from);
        let (from, to) = if turned { (to, from) } else { (from, to) };
        let [i, j, _] = if turned { [order[1], order[0], order[2]] } else { order };
        let on_edge = closest_on_segment::<R>(from, to, p);
        let mut weights = [R::ZERO; 3];
        (weights[i], weights[j]) = (on_edge.weights[0], on_edge.weights[1]);
        (squared_distance::<R>(on_edge.point, p), ClosestPoint { weights, ..on_edge })
    };
    let first = edge(a, b, [0, 1, 2]);
    let best = [edge(b, c, [1, 2, 0]), edge(c, a, [2, 0, 1])]
        .into_iter()
        .fold(first, |best, other| if other.0 < best.0 { other } else { best });
    if inside && squared_distance::<R>(foot.point, p) < best.0 { foot } else { best.1 }
}

/// Distance of a point from a triangle, in world units.
#[must_use]
pub fn distance_to_triangle<R: Real>(vertices: [R::Vec3; 3], p: R::Vec3) -> R {
    let d = closest_on_triangle::<R>(vertices, p).point - p;
    // Scaled against overflow of the squares.
    let k = d.abs().max_element().power_of_two_below();
    (d * (R::ONE / k)).length() * k
}

/// Whether `a` comes before `b`, by x, then y, then z.
fn precedes<R: Real>(a: R::Vec3, b: R::Vec3) -> bool {
    let first = (0..3).find(|&k| a.axis(k) != b.axis(k));
    first.is_some_and(|k| a.axis(k) < b.axis(k))
}

fn squared_distance<R: Real>(a: R::Vec3, b: R::Vec3) -> R {
    let d = a - b;
    d.dot(d)
}

/// Two points, one of each of two bodies: those that are nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPair {
    /// Of the first body.
    pub first: DVec3,
    /// Of the second.
    pub second: DVec3,
}

impl ClosestPair {
    /// How far they are from each other.
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.first.distance(self.second)
    }

    fn swapped(self) -> Self {
        Self { first: self.second, second: self.first }
    }

    fn nearer(self, other: Self) -> Self {
        let squared = |p: &Self| (p.first - p.second).length_squared();
        if squared(&other) < squared(&self) { other } else { self }
    }
}

/// The points of two segments that are nearest to each other; of parallel ones, some of these. Ends may coincide.
///
/// Error: some `u` times the largest distance between the points, divided by the sine of the angle.
#[must_use]
pub fn closest_between_segments(first: [DVec3; 2], second: [DVec3; 2]) -> ClosestPair {
    let ([a, b], [c, d]) = (first, second);
    let on = |ends: [DVec3; 2], p: DVec3| closest_on_segment::<f64>(ends[0], ends[1], p).point;
    // Where an end is nearest; right also for segments that are parallel.
    let of_first = |p: DVec3| ClosestPair { first: p, second: on(second, p) };
    let of_second = |p: DVec3| ClosestPair { first: on(first, p), second: p };
    let ends = of_first(a).nearer(of_first(b)).nearer(of_second(c)).nearer(of_second(d));
    // Or both inside.
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv, uw, vw) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let sine = uu * vv - uv * uv;
    let (s, t) = ((uv * vw - vv * uw) / sine, (uu * vw - uv * uw) / sine);
    if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        // The nearest to a point that may be rounded is the better of the two.
        let p = of_first(a + u * s);
        ends.nearer(ClosestPair { first: on(first, p.second), second: p.second })
    } else {
        ends
    }
}

/// The points of a segment and a triangle that are nearest to each other: the same one where they meet.
#[must_use]
pub fn segment_to_triangle(segment: [DVec3; 2], triangle: [DVec3; 3]) -> ClosestPair {
    let [p, q] = segment;
    let [a, b, c] = triangle;
    let of_end = |p: DVec3| ClosestPair { first: p, second: closest_on_triangle::<f64>(triangle, p).point };
    let mut best = of_end(p).nearer(of_end(q));
    for edge in [[a, b], [b, c], [c, a]] {
        best = best.nearer(closest_between_segments(segment, edge));
    }
    // Through the face.
    let n = (b - a).cross(c - a);
    let (hp, hq) = (n.dot(p - a), n.dot(q - a));
    if (hp < 0.0) != (hq < 0.0) {
        best = best.nearer(of_end(p.lerp(q, hp / (hp - hq))));
    }
    best
}

/// The points of two triangles that are nearest to each other; where they meet, one point twice, but for rounding.
///
/// ```
/// use firsthit_geometry::distance::closest_between_triangles;
/// use glam::DVec3;
/// let floor = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
/// let above = [DVec3::new(1.0, 1.0, 2.0), DVec3::new(1.0, 1.0, 5.0), DVec3::new(1.0, 2.0, 5.0)];
/// assert_eq!(closest_between_triangles(floor, above).distance(), 2.0);
/// ```
#[must_use]
pub fn closest_between_triangles(first: [DVec3; 3], second: [DVec3; 3]) -> ClosestPair {
    let edges = |[a, b, c]: [DVec3; 3]| [[a, b], [b, c], [c, a]];
    let of_first = edges(first).map(|e| segment_to_triangle(e, second));
    let of_second = edges(second).map(|e| segment_to_triangle(e, first).swapped());
    let start = of_first[0];
    of_first.into_iter().skip(1).chain(of_second).fold(start, ClosestPair::nearer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};
    use proptest::prelude::*;

    #[test]
    fn degenerate_input() {
        let p = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(closest_on_segment::<f64>(p, p, DVec3::ZERO).point, p);
        assert_eq!(closest_on_triangle::<f64>([p; 3], DVec3::ZERO).point, p);
        let line = [DVec3::ZERO, DVec3::X * 2.0, DVec3::X];
        assert_eq!(closest_on_triangle::<f64>(line, DVec3::new(1.5, 1.0, 0.0)).point, DVec3::X * 1.5);
        let tiny = [Vec3::ZERO, Vec3::X * 1e-38, Vec3::Y * 1e-38];
        assert_eq!(closest_on_triangle::<f32>(tiny, Vec3::X).point, Vec3::X * 1e-38);
    }

    #[test]
    fn every_region_of_a_triangle() {
        let t = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
        let cases = [
            (DVec3::new(1.0, 1.0, -2.0), DVec3::new(1.0, 1.0, 0.0)),
            (DVec3::new(-1.0, -1.0, 1.0), DVec3::ZERO),
            (DVec3::new(6.0, -1.0, 1.0), DVec3::X * 4.0),
            (DVec3::new(-1.0, 7.0, 1.0), DVec3::Y * 4.0),
            (DVec3::new(2.0, -1.0, 1.0), DVec3::X * 2.0),
            (DVec3::new(-3.0, 1.0, 1.0), DVec3::Y),
            (DVec3::new(4.0, 4.0, 5.0), DVec3::new(2.0, 2.0, 0.0)),
        ];
        for (p, expected) in cases {
            assert_eq!(closest_on_triangle::<f64>(t, p).point, expected, "{p}");
        }
        assert_eq!(distance_to_triangle::<f64>(t, DVec3::new(1.0, 1.0, -2.0)), 2.0);
    }

    #[test]
    fn features() {
        let t = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
        let cases = [
            (DVec3::new(1.0, 1.0, -2.0), Feature::Face),
            (DVec3::new(2.0, -1.0, 1.0), Feature::Edge(0)),
            (DVec3::new(4.0, 4.0, 5.0), Feature::Edge(1)),
            (DVec3::new(-3.0, 1.0, 1.0), Feature::Edge(2)),
            (DVec3::new(-1.0, -1.0, 1.0), Feature::Vertex(0)),
            (DVec3::new(6.0, -1.0, 1.0), Feature::Vertex(1)),
            (DVec3::new(-1.0, 7.0, 1.0), Feature::Vertex(2)),
        ];
        for (p, feature) in cases {
            assert_eq!(closest_on_triangle::<f64>(t, p).feature(), feature, "{p}");
        }
    }

    #[test]
    fn box_clamps() {
        let b = Aabb::<f32>::new(Vec3::ZERO, Vec3::ONE);
        assert_eq!(closest_on_box(&b, Vec3::new(2.0, 0.5, -1.0)), Vec3::new(1.0, 0.5, 0.0));
        assert_eq!(closest_on_box(&b, Vec3::splat(0.25)), Vec3::splat(0.25));
    }

    fn point() -> impl Strategy<Value = DVec3> {
        (-2.0..2.0_f64, -2.0..2.0_f64, -2.0..2.0_f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        /// No sampled point of the triangle is nearer, the weights give the point, and f32 agrees with f64.
        #[test]
        fn nothing_is_nearer(v in [point(), point(), point()], p in point()) {
            let nearest = closest_on_triangle::<f64>(v, p);
            let distance = distance_to_triangle::<f64>(v, p);
            let weighted = v[0] * nearest.weights[0] + v[1] * nearest.weights[1] + v[2] * nearest.weights[2];
            prop_assert!(weighted.distance(nearest.point) < 1e-12);
            prop_assert!(nearest.weights.iter().all(|&w| w >= -1e-15));
            for i in 0..=32 {
                for j in 0..=32 - i {
                    let (a, b) = (f64::from(i) / 32.0, f64::from(j) / 32.0);
                    let q = v[0] + (v[1] - v[0]) * a + (v[2] - v[0]) * b;
                    prop_assert!(q.distance(p) >= distance - 1e-12);
                }
            }
            let v32 = v.map(|x| x.as_vec3());
            let exact = distance_to_triangle::<f64>(v32.map(|x| x.as_dvec3()), p.as_vec3().as_dvec3());
            let got = f64::from(distance_to_triangle::<f32>(v32, p.as_vec3()));
            prop_assert!((got - exact).abs() < 1e-4, "{got} {exact}");
        }

        /// Slivers down to those whose area is nothing but rounding.
        #[test]
        fn nothing_of_a_sliver_is_nearer(
            a in point(), b in point(), off in point(), p in point(), at in -0.5..1.5f64, thin in 0..20i32,
        ) {
            let c = a.lerp(b, at) + off * 10f64.powi(-thin);
            let distance = distance_to_triangle::<f64>([a, b, c], p);
            for i in 0..=64 {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    let q = from.lerp(to, f64::from(i) / 64.0);
                    prop_assert!(q.distance(p) >= distance - 1e-12, "{} {}", q.distance(p), distance);
                }
            }
        }

        /// Triangles that share an edge agree about its nearest point, to the bit.
        #[test]
        fn edges_have_one_nearest_point(v in [point(), point(), point()], p in point()) {
            let [a, b, c] = v;
            for other in [[b, a, c], [c, b, a], [a, c, b], [b, c, a], [c, a, b]] {
                let (x, y) = (closest_on_triangle::<f64>(v, p), closest_on_triangle::<f64>(other, p));
                if x.feature() != Feature::Face && y.feature() != Feature::Face {
                    prop_assert_eq!(x.point, y.point);
                }
            }
        }

        #[test]
        fn power_of_two_scaling_is_exact(v in [point(), point(), point()], p in point(), e in -60..60_i32) {
            let s = 2.0_f64.powi(e);
            let small = closest_on_triangle::<f64>(v, p);
            let scaled = closest_on_triangle::<f64>(v.map(|x| x * s), p * s);
            prop_assert_eq!(small.point * s, scaled.point);
            prop_assert_eq!(small.weights, scaled.weights);
        }
    }
}
