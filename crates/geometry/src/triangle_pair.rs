//! Two triangles: whether they meet, and where.
//!
//! Decided by exact orientations, so touching and coplanar triangles are told from those that are a hair apart. Triangles are
//! closed: a common point is enough, be it a corner. One without area (exactly) meets nothing, nor does one that is not
//! finite.

use glam::DVec3;

use crate::exact::{orient2d, orient3d};

type Triangle = [DVec3; 3];
type Segment = [DVec3; 2];

fn edges([a, b, c]: Triangle) -> [Segment; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Whether two triangles have a point in common.
///
/// ```
/// use firsthit_geometry::triangle_pair::meet;
/// use glam::DVec3;
/// let floor = [DVec3::ZERO, DVec3::X, DVec3::Y];
/// let standing = |z: f64| [DVec3::new(0.2, 0.2, z), DVec3::new(0.2, 0.2, 1.0), DVec3::new(0.4, 0.2, 1.0)];
/// assert!(meet(floor, standing(0.0)) && meet(floor, standing(-1e-300)) && !meet(floor, standing(1e-300)));
/// ```
#[must_use]
pub fn meet(first: Triangle, second: Triangle) -> bool {
    let (Some(one), Some(two)) = (Flat::new(first), Flat::new(second)) else { return false };
    // Mostly one is on one side of the other.
    if one.has_aside(second) || two.has_aside(first) {
        return false;
    }
    edges(first).into_iter().any(|e| two.meets(e)) || edges(second).into_iter().any(|e| one.meets(e))
}

/// Whether two triangles have a point in common other than their common corners and edges. Corners are common if they have the
/// same coordinates; two triangles of the same three corners do have.
#[must_use]
pub fn meet_otherwise(first: Triangle, second: Triangle) -> bool {
    let (Some(one), Some(two)) = (Flat::new(first), Flat::new(second)) else { return false };
    let apart = |t: Triangle, other: Triangle| -> Alone { t.map(|p| (!other.contains(&p)).then_some(p)) };
    let alone = (apart(first, second), apart(second, first));
    match (alone.0.iter().flatten().count(), alone.1.iter().flatten().count()) {
        (0, 0) => true,
        (1, 1) => {
            // A common edge: then they meet if one is folded onto the other.
            let (Some(p), Some(q)) = (alone.0.iter().flatten().next(), alone.1.iter().flatten().next()) else {
                return false;
            };
            let common = first.map(|c| (second.contains(&c)).then_some(c));
            let mut common = common.into_iter().flatten();
            let (Some(a), Some(b)) = (common.next(), common.next()) else { return false };
            one.side(*q) == 0 && one.turn(a, b, *p) == one.turn(a, b, *q)
        }
        (2, 2) => {
            // A common corner: anything else in common reaches an edge opposite to it.
            let opposite = |alone: Alone| -> Option<Segment> {
                let mut points = alone.into_iter().flatten();
                Some([points.next()?, points.next()?])
            };
            opposite(alone.0).is_some_and(|e| two.meets(e)) || opposite(alone.1).is_some_and(|e| one.meets(e))
        }
        _ => meet(first, second),
    }
}

/// The corners that another triangle has not.
type Alone = [Option<DVec3>; 3];

/// The segment that two triangles have in common, or the point twice, rounded. `None` if they do not meet, and if they lie in
/// one plane.
#[must_use]
pub fn common_segment(first: Triangle, second: Triangle) -> Option<Segment> {
    if !meet(first, second) {
        return None;
    }
    let (one, two) = (Flat::new(first)?, Flat::new(second)?);
    let of = |flat: Flat, other: Triangle| edges(other).map(|e| flat.crossing(e));
    let points = of(two, first).into_iter().chain(of(one, second)).flatten();
    // The two that are farthest apart, along the line that both planes have in common.
    let normal = |[a, b, c]: Triangle| (b - a).cross(c - a).normalize_or_zero();
    let along = normal(first).cross(normal(second));
    let mut ends: Option<[(f64, DVec3); 2]> = None;
    for p in points {
        let k = along.dot(p - first[0]);
        ends = Some(ends.map_or([(k, p); 2], |[low, high]| {
            [if k < low.0 { (k, p) } else { low }, if k > high.0 { (k, p) } else { high }]
        }));
    }
    ends.map(|[low, high]| [low.1, high.1])
}

/// A triangle with area, and the axes of a plane in which it has one too.
#[derive(Clone, Copy)]
struct Flat {
    corners: Triangle,
    axes: [usize; 2],
}

impl Flat {
    fn new(corners: Triangle) -> Option<Self> {
        let [a, b, c] = corners;
        if !corners.iter().all(|p| p.is_finite()) {
            return None;
        }
        let n = (b - a).cross(c - a).abs();
        let largest = if n.x >= n.y && n.x >= n.z {
            0
        } else if n.y >= n.z {
            1
        } else {
            2
        };
        (0..3).map(|k| (largest + k) % 3).find_map(|drop| {
            let flat = Self { corners, axes: [(drop + 1) % 3, (drop + 2) % 3] };
            (flat.turn(a, b, c) != 0).then_some(flat)
        })
    }

    /// On which side of its plane a point lies.
    fn side(&self, p: DVec3) -> i32 {
        let [a, b, c] = self.corners;
        orient3d(a, b, c, p)
    }

    /// In its plane, on which side of a line.
    fn turn(&self, a: DVec3, b: DVec3, p: DVec3) -> i32 {
        let flat = |p: DVec3| self.axes.map(|k| p[k]);
        orient2d(flat(a), flat(b), flat(p))
    }

    /// Whether all of a triangle lies on one side.
    fn has_aside(&self, other: Triangle) -> bool {
        let [x, y, z] = other.map(|p| self.side(p));
        x != 0 && x == y && y == z
    }

    /// Whether a segment has a point in common with it.
    fn meets(&self, [p, q]: Segment) -> bool {
        match (self.side(p), self.side(q)) {
            (0, 0) => self.meets_in_plane([p, q]),
            (x, y) if x == y => false,
            _ => self.is_pierced([p, q]),
        }
    }

    /// Whether the line through a segment that is not in its plane goes through it.
    fn is_pierced(&self, [p, q]: Segment) -> bool {
        let around = edges(self.corners).map(|[a, b]| orient3d(p, q, a, b));
        around.iter().all(|s| *s >= 0) || around.iter().all(|s| *s <= 0)
    }

    fn meets_in_plane(&self, [p, q]: Segment) -> bool {
        let within = |p: DVec3| {
            let around = edges(self.corners).map(|[a, b]| self.turn(a, b, p));
            around.iter().all(|s| *s >= 0) || around.iter().all(|s| *s <= 0)
        };
        let crosses = |[a, b]: Segment| {
            let of = [self.turn(p, q, a), self.turn(p, q, b)];
            let to = [self.turn(a, b, p), self.turn(a, b, q)];
            // All in a line: one end is in the triangle, or the whole edge is on the segment.
            let line = of == [0, 0] && to == [0, 0];
            if line { self.is_between(a, [p, q]) } else { of[0] * of[1] <= 0 && to[0] * to[1] <= 0 }
        };
        within(p) || within(q) || edges(self.corners).into_iter().any(crosses)
    }

    /// Of points in a line.
    fn is_between(&self, p: DVec3, [a, b]: Segment) -> bool {
        self.axes.iter().all(|&k| a[k].min(b[k]) <= p[k] && p[k] <= a[k].max(b[k]))
    }

    /// Where a segment goes through it, if it is not in its plane.
    fn crossing(&self, [p, q]: Segment) -> Option<DVec3> {
        let (x, y) = (self.side(p), self.side(q));
        if x == y || !self.is_pierced([p, q]) {
            return None;
        }
        match (x, y) {
            (0, _) => Some(p),
            (_, 0) => Some(q),
            _ => {
                let [a, b, c] = self.corners;
                let n = (b - a).cross(c - a);
                let (from, to) = (n.dot(p - a).abs(), n.dot(q - a).abs());
                let k = if from + to > 0.0 { from / (from + to) } else { 0.5 };
                Some(p.lerp(q, k))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::closest_between_triangles;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        [-2i32..=2, -2..=2, -2..=2].prop_map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into()))
    }

    /// Whether two triangles of small integers meet, by an independent way: the
    /// distance of the closest points, which for such coordinates is either 0 or far more than what is rounded.
    fn by_distance(a: Triangle, b: Triangle) -> bool {
        closest_between_triangles(a, b).distance() < 1e-7
    }

    fn has_area([a, b, c]: Triangle) -> bool {
        (b - a).cross(c - a) != DVec3::ZERO
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn triangles_meet_where_their_distance_is_zero(a in [point(), point(), point()], b in [point(), point(), point()], flat: bool) {
            let onto = |t: Triangle| if flat { t.map(|p| p.with_z(0.0)) } else { t };
            let (a, b) = (onto(a), onto(b));
            prop_assert_eq!(meet(a, b), has_area(a) && has_area(b) && by_distance(a, b));
            prop_assert_eq!(meet(a, b), meet(b, [a[2], a[0], a[1]]));
            prop_assert_eq!(meet_otherwise(a, b), meet_otherwise(b, [a[1], a[0], a[2]]));
            prop_assert!(!meet_otherwise(a, b) || meet(a, b));
            if let Some(segment) = common_segment(a, b) {
                for p in segment {
                    let off = [a, b].map(|t| crate::distance::distance_to_triangle::<f64>(t, p));
                    prop_assert!(off[0] < 1e-12 && off[1] < 1e-12, "{:?}", off);
                }
            }
        }

        /// Without a strip along what they share, two triangles meet only if they have more than that in common.
        #[test]
        fn common_corners_and_edges_do_not_count(a in [point(), point(), point()], third in [point(), point()], edge: bool, flat: bool) {
            let onto = |t: Triangle| if flat { t.map(|p| p.with_z(0.0)) } else { t };
            let b = onto([a[0], if edge { a[1] } else { third[0] }, third[1]]);
            let a = onto(a);
            if !(has_area(a) && has_area(b)) {
                return Ok(());
            }
            let (shared, rest): (Vec<DVec3>, Vec<DVec3>) = a.into_iter().partition(|p| b.contains(p));
            // What is common reaches much farther than that.
            let cut = |from: DVec3, to: DVec3| from.lerp(to, 1.0 / 1024.0);
            let pieces = match (&shared[..], &rest[..]) {
                (&[], _) => vec![a],
                (&[v], &[p, q]) => vec![[cut(v, p), p, q], [cut(v, p), q, cut(v, q)]],
                (&[v, w], &[p]) => vec![[cut(v, p), cut(w, p), p]],
                _ => vec![b],
            };
            prop_assert_eq!(meet_otherwise(a, b), pieces.into_iter().any(|piece| by_distance(piece, b)));
        }
    }

    #[test]
    fn what_has_no_area_meets_nothing() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        assert!(meet(t, t) && meet_otherwise(t, t) && !meet(t, line) && !meet(line, t));
        assert!(!meet(t, [DVec3::NAN; 3]) && common_segment(t, t).is_none());
    }
}
