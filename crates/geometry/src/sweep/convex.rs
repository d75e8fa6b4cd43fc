//! A convex body.

use glam::DVec3;

use super::Touch;
use crate::clip::HalfSpace;
use crate::distance::closest_on_triangle;
use crate::overlap::{Convex, OrientedBox};
use crate::{Aabb, Ray};

/// The convex hull of some points, for moving it: the place of its origin is that of the ray.
///
/// ```
/// use firsthit_geometry::{Ray, sweep::{ConvexBody, convex_to_triangle}};
/// use glam::DVec3;
/// // Falls with a corner ahead.
/// let octahedron = ConvexBody::new(&[DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z])?;
/// let falling = Ray::new(DVec3::new(0.25, 0.25, 5.0), DVec3::NEG_Z);
/// let (touch, normal) = convex_to_triangle(&falling, &octahedron, [DVec3::ZERO, DVec3::X, DVec3::Y]).unwrap();
/// assert_eq!((touch.t, normal), (4.0, DVec3::Z));
/// # Ok::<(), firsthit_geometry::sweep::ConvexBodyError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexBody {
    points: Vec<DVec3>,
    /// Of the faces, outward and unit.
    faces: Vec<HalfSpace<f64>>,
    /// Unit directions of the edges, and perhaps of diagonals of faces.
    edges: Vec<DVec3>,
    bounds: Aabb<f64>,
}

/// Points that are no body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConvexBodyError {
    /// A coordinate is NaN or infinite.
    #[error("point {0} of the convex body is not finite")]
    NotFinite(usize),
    /// They lie in a plane, or are too few.
    #[error("the points of the convex body lie in a plane")]
    Flat,
    /// Its faces are found by trying all of them.
    #[error("a convex body of {0} points (at most {MOST} are allowed)")]
    TooMany(usize),
}

/// Points of a body: three of them are tried for each face.
const MOST: usize = 96;
/// Of the body's size: what is nearer to a plane is in it.
const THIN: f64 = 1e-12;

impl ConvexBody {
    /// The hull of these points, whose order does not matter; points inside are left out.
    ///
    /// # Errors
    /// When they are more than 96, not finite, or lie in a plane (to within 1e-12 of their size).
    pub fn new(points: &[DVec3]) -> Result<Self, ConvexBodyError> {
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(ConvexBodyError::NotFinite(i));
        }
        if points.len() > MOST {
            return Err(ConvexBodyError::TooMany(points.len()));
        }
        let bounds = Aabb::<f64>::from_points(points.iter().copied());
        let size = if points.is_empty() { 0.0 } else { bounds.extent().max_element() };
        let room = size * THIN;
        let mut body = Self { points: Vec::new(), faces: Vec::new(), edges: Vec::new(), bounds };
        let mut kept = vec![false; points.len()];
        for (i, &a) in points.iter().enumerate() {
            for (j, &b) in points.iter().enumerate().skip(i + 1) {
                for (k, &c) in points.iter().enumerate().skip(j + 1) {
                    let normal = (b - a).cross(c - a);
                    // Of three points nearly in a line there is a better triple.
                    if !(normal.length() > room * (b - a).length().max((c - a).length())) {
                        continue;
                    }
                    let normal = normal.normalize();
                    let heights = points.iter().map(|p| normal.dot(*p - a));
                    let (low, high) = heights.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
                    let outward = match (low < -room, high > room) {
                        (true, false) => normal,
                        (false, true) => -normal,
                        (true, true) => continue,
                        (false, false) => return Err(ConvexBodyError::Flat),
                    };
                    [i, j, k].into_iter().for_each(|i| kept[i] = true);
                    if body.faces.iter().all(|f| (f.normal - outward).length() > THIN) {
                        let offset = points.iter().map(|p| outward.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
                        body.faces.push(HalfSpace::new(outward, offset));
                    }
                    for edge in [b - a, c - b, a - c].map(DVec3::normalize_or_zero) {
                        if body.edges.iter().all(|e| e.cross(edge).length() > THIN) {
                            body.edges.push(edge);
                        }
                    }
                }
            }
        }
        if body.faces.is_empty() {
            return Err(ConvexBodyError::Flat);
        }
        body.points = points.iter().zip(kept).filter_map(|(p, kept)| kept.then_some(*p)).collect();
        Ok(body)
    }

    /// A box, perhaps turned.
    ///
    /// # Errors
    /// When it is flat or not finite.
    pub fn of_box(solid: &OrientedBox) -> Result<Self, ConvexBodyError> {
        let points: Vec<DVec3> = solid.corners().collect();
        Self::new(&points)
    }

    /// Its box, where its origin is at 0.
    #[must_use]
    pub fn bounds(&self) -> Aabb<f64> {
        self.bounds
    }

    /// Corners, without points that lie inside.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// What of space it fills when its origin is at `at`, grown by `room`.
    fn at(&self, at: DVec3, room: f64) -> Convex {
        let moved = |f: &HalfSpace<f64>| HalfSpace::new(f.normal, f.offset + f.normal.dot(at) + room);
        Convex { half_spaces: self.faces.iter().map(moved).collect() }
    }
}

/// When a body whose origin moves along a ray first has a point in common with a triangle, and the unit direction from the
/// triangle to the body then: at the start of the interval, if it has one there (with a direction of 0).
///
/// By separating axes whose ends move (as in Schneider and Eberly, *Geometric Tools for Computer Graphics*, 2003, 11.12): along face normals of
/// either and cross products of edges, the body is beside the triangle until some `t`; it touches when the last of them lets
/// it. `t` is off by some `u` times the distances between ray, body and triangle. The point is some point of contact: the
/// middle of them, if there are many. `None` also for a ray that is not valid or has no finite start.
#[must_use]
pub fn convex_to_triangle(ray: &Ray<f64>, body: &ConvexBody, corners: [DVec3; 3]) -> Option<(Touch, DVec3)> {
    if !(ray.is_valid() && ray.t_min.is_finite()) {
        return None;
    }
    // From where the ray is about nearest: small numbers, and little is rounded.
    let d = ray.direction;
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0 - ray.origin;
    let base = (middle.dot(d) / d.dot(d)).max(ray.t_min).min(ray.t_max);
    let at = ray.at(base);
    let seen = corners.map(|p| p - at);
    let [a, b, c] = seen;
    let sides = [b - a, c - b, a - c];
    let longest = sides.iter().fold(0.0f64, |m, e| m.max(e.length()));
    let far = seen.iter().fold(longest, |m, p| m.max(p.length())) + body.bounds.extent().length();

    let (mut enter, mut leave) = (ray.t_min - base, ray.t_max - base);
    let mut normal = DVec3::ZERO;
    let mut apart = |axis: DVec3| -> bool {
        let of = |points: &[DVec3]| {
            let heights = points.iter().map(|p| axis.dot(*p));
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
        };
        let ((low, high), (from, to)) = (of(&body.points), of(&seen));
        let (speed, room) = (axis.dot(d), far * (16.0 * f64::EPSILON));
        // Not moving along the axis, as far as can be told.
        if speed.abs() <= d.length() * (8.0 * f64::EPSILON) {
            return low > to + room || high < from - room;
        }
        // Over the triangle's interval, upward or downward.
        let (first, last) = if speed > 0.0 { (from - high, to - low) } else { (to - low, from - high) };
        if first / speed > enter {
            enter = first / speed;
            normal = if speed > 0.0 { -axis } else { axis };
        }
        leave = leave.min(last / speed);
        // A touch in passing has no time between.
        enter > leave + room / speed.abs()
    };

    if body.faces.iter().any(|f| apart(f.normal)) {
        return None;
    }
    let face = sides[0].cross(sides[1]);
    if face.length() > THIN * longest * longest && apart(face.normalize_or_zero()) {
        return None;
    }
    for side in sides.map(DVec3::normalize_or_zero) {
        for edge in &body.edges {
            let axis = edge.cross(side);
            // Of parallel edges it is no direction; faces decide then.
            if axis.length() > 1e-9 && apart(axis.normalize()) {
                return None;
            }
        }
    }
    let t = base + enter;
    if !ray.contains(t) {
        return None;
    }
    let polygon = body.at(ray.at(t) - at, far * 1e-9).clipped(seen);
    let point = if polygon.is_empty() {
        let center = ray.at(t) - at + body.bounds.center();
        closest_on_triangle::<f64>(seen, center).point
    } else {
        polygon.iter().sum::<DVec3>() / polygon.len() as f64
    };
    Some((Touch { t, point: at + point }, normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlap::Region;
    use glam::DMat3;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        let coordinate = || prop_oneof![(-3..=3).prop_map(f64::from), -3.0..3.0];
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    #[test]
    fn hulls_have_their_faces() {
        let cube = Aabb::<f64>::new(DVec3::splat(-1.0), DVec3::splat(1.0)).corners();
        let inner = cube.map(|p| p * 0.5);
        let body = ConvexBody::new(&[&cube[..], &inner[..], &[DVec3::X, DVec3::ZERO]].concat()).unwrap();
        assert_eq!((body.faces.len(), body.bounds()), (6, Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0))));
        assert!(body.points().iter().all(|p| p.abs().max_element() == 1.0));
        let turned =
            OrientedBox { center: DVec3::X, half: DVec3::new(1.0, 2.0, 3.0), axes: DMat3::from_rotation_y(0.3) };
        assert_eq!(ConvexBody::of_box(&turned).unwrap().faces.len(), 6);

        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y];
        assert_eq!(ConvexBody::new(&flat), Err(ConvexBodyError::Flat));
        for points in [&flat[..0], &flat[..1], &flat[..2], &[DVec3::X; 9]] {
            assert_eq!(ConvexBody::new(points), Err(ConvexBodyError::Flat));
        }
        assert_eq!(ConvexBody::new(&[DVec3::ZERO, DVec3::NAN]), Err(ConvexBodyError::NotFinite(1)));
        assert_eq!(ConvexBody::new(&[DVec3::ZERO; 97]), Err(ConvexBodyError::TooMany(97)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Regions that do not move are the witness: before it touches it meets nothing, then it does.
        #[test]
        fn a_body_touches_when_it_gets_there(
            corners in [vector(), vector(), vector()], origin in vector(), direction in vector(),
            points in prop::collection::vec(vector(), 4..9), flat: bool, cube: bool, far in prop_oneof![Just(0.0), Just(1e3)],
        ) {
            prop_assume!(direction != DVec3::ZERO);
            let corners = if flat { [corners[0], corners[1], corners[0]] } else { corners };
            let points = if cube { Aabb::<f64>::new(-points[0].abs(), points[1].abs() + 0.1).corners().to_vec() } else { points };
            let Ok(body) = ConvexBody::new(&points) else { return Ok(()) };
            let ray = Ray::new(origin - direction * far, direction).with_interval(0.0, 10.0 + far);
            let touch = convex_to_triangle(&ray, &body, corners);
            let meets = |t: f64, room: f64| body.at(ray.at(t), room).meets_triangle(corners);
            let end = touch.map_or(f64::INFINITY, |(touch, _)| touch.t);
            if let Some((touch, normal)) = touch {
                prop_assert!(meets(touch.t, 1e-8), "nothing is touched at {}", touch.t);
                prop_assert!(body.at(ray.at(touch.t), 1e-7).meets_triangle([touch.point; 3]));
                prop_assert!(crate::distance::distance_to_triangle::<f64>(corners, touch.point) < 1e-7);
                // A unit vector from the triangle to the body, against the motion.
                prop_assert!(normal == DVec3::ZERO && touch.t == 0.0 || (normal.length() - 1.0).abs() < 1e-9 && normal.dot(direction) < 0.0);
            }
            let first = far.max(0.0) - 1.0;
            for i in 0..=200 {
                let t = (first + f64::from(i) * 11.0 / 200.0).clamp(0.0, ray.t_max);
                prop_assert!(t >= end || !meets(t, -1e-8), "meets at {}, before {}", t, end);
            }
        }
    }

    #[test]
    fn what_is_no_number_touches_nothing() {
        let body = ConvexBody::new(&Aabb::<f64>::new(DVec3::ZERO, DVec3::ONE).corners()).unwrap();
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let ray = Ray::new(DVec3::Z * 3.0, DVec3::NEG_Z);
        assert!(convex_to_triangle(&ray, &body, corners).is_some());
        assert!(convex_to_triangle(&ray.with_interval(f64::NEG_INFINITY, 1.0), &body, corners).is_none());
        assert!(convex_to_triangle(&ray.with_interval(0.0, 1.0), &body, corners).is_none());
        assert!(convex_to_triangle(&Ray::new(DVec3::NAN, DVec3::X), &body, corners).is_none());
    }
}
