//! A convex body.

use glam::DVec3;

use super::Touch;
use crate::clip::HalfSpace;
use crate::distance::closest_on_triangle;
use crate::overlap::{Convex, OrientedBox};
use crate::{Aabb, Ray, Real};

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
    /// Unit directions of the edges.
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
        if !(size > 0.0 && size.is_finite()) {
            return Err(ConvexBodyError::Flat);
        }
        // Of size near 1, and near 0: products are numbers, whatever the size.
        let scale = size.power_of_two_below();
        let middle = points[0];
        let near: Vec<DVec3> = points.iter().map(|p| (*p - middle) / scale).collect();
        let room = 2.0 * THIN;

        let mut normals: Vec<DVec3> = Vec::new();
        for (i, &a) in near.iter().enumerate() {
            for (j, &b) in near.iter().enumerate().skip(i + 1) {
                for &c in &near[j + 1..] {
                    let normal = (b - a).cross(c - a);
                    // Of three points nearly in a line there is a better triple.
                    if !(normal.length() > room * (b - a).length().max((c - a).length())) {
                        continue;
                    }
                    let normal = normal.normalize();
                    let heights = near.iter().map(|p| normal.dot(*p - a));
                    let (low, high) = heights.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
                    let outward = match (low < -room, high > room) {
                        (true, false) => normal,
                        (false, true) => -normal,
                        (true, true) => continue,
                        (false, false) => return Err(ConvexBodyError::Flat),
                    };
                    if normals.iter().all(|n| (*n - outward).length() > THIN) {
                        normals.push(outward);
                    }
                }
            }
        }
        if normals.is_empty() {
            return Err(ConvexBodyError::Flat);
        }
        let highest = |n: DVec3, points: &[DVec3]| points.iter().map(|p| n.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
        let tops: Vec<f64> = normals.iter().map(|n| highest(*n, &near)).collect();
        // In which faces a point lies. An edge is where two of them meet.
        let on = |p: DVec3, face: usize| normals[face].dot(p) >= tops[face] - room;
        let mut edges: Vec<DVec3> = Vec::new();
        for (i, &a) in near.iter().enumerate() {
            for &b in &near[i + 1..] {
                let edge = (b - a).normalize_or_zero();
                let common = (0..normals.len()).filter(|&f| on(a, f) && on(b, f)).count();
                if common > 1 && edge != DVec3::ZERO && edges.iter().all(|e| e.cross(edge).length() > THIN) {
                    edges.push(edge);
                }
            }
        }
        let corner = |p: DVec3| (0..normals.len()).filter(|&f| on(p, f)).count() > 2;
        let kept = points.iter().zip(&near).filter(|(_, n)| corner(**n)).map(|(p, _)| *p).collect();
        let faces = normals.iter().map(|n| HalfSpace::new(*n, highest(*n, points))).collect();
        Ok(Self { points: kept, faces, edges, bounds })
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

/// When something is on an axis: from when until when, as it comes out, and with room for all that is rounded.
struct Meeting {
    enter: f64,
    surely: [f64; 2],
    /// Where the triangle lies from the body, at the last to let it.
    normal: DVec3,
}

/// Heights along an axis.
fn heights(axis: DVec3, points: &[DVec3]) -> [f64; 2] {
    let heights = points.iter().map(|p| axis.dot(*p));
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(x), h.max(x)])
}

impl Meeting {
    /// Whether they never meet along this unit axis. `room`: what heights may be off by.
    fn never(&mut self, axis: DVec3, direction: DVec3, body: &[DVec3], triangle: &[DVec3], room: f64) -> bool {
        let ([low, high], [from, to]) = (heights(axis, body), heights(axis, triangle));
        let speed = axis.dot(direction);
        // Not moving along the axis, as far as can be told.
        if speed.abs() <= direction.length() * (8.0 * f64::EPSILON) {
            return low > to + room || high < from - room;
        }
        // Over the triangle's interval, upward or downward.
        let (first, last) = if speed > 0.0 { (from - high, to - low) } else { (to - low, from - high) };
        let (first, last, late) = (first / speed, last / speed, room / speed.abs());
        if first > self.enter {
            self.enter = first;
            self.normal = if speed > 0.0 { -axis } else { axis };
        }
        // A touch in passing has no time between: it is not lost to what is rounded.
        self.surely = [self.surely[0].max(first - late), self.surely[1].min(last + late)];
        self.surely[0] > self.surely[1]
    }
}

/// When a body whose origin moves along a ray first has a point in common with a triangle, and the unit direction from the
/// triangle to the body then: at the start of the interval, if it has one there (with a direction of 0).
///
/// By separating axes whose ends move (as in Schneider and Eberly, *Geometric Tools for Computer Graphics*, 2003, 11.12): along
/// face normals of either and cross products of edges, the body is beside the triangle until some `t`; it touches when the
/// last of them lets it. The place of the body then is off by some `u` times the distances between the ray's origin, body and
/// triangle, over the sine between motion and face; what is apart by no more than that touches. The point is some point of
/// contact: the middle of them, if there are many. `None` also for a ray that is not valid or has no finite start.
#[must_use]
pub fn convex_to_triangle(ray: &Ray<f64>, body: &ConvexBody, corners: [DVec3; 3]) -> Option<(Touch, DVec3)> {
    if !(ray.is_valid() && ray.t_min.is_finite()) {
        return None;
    }
    // From where the ray is about nearest: small numbers, and little is rounded.
    let d = ray.direction;
    let apart = corners.map(|p| p - ray.origin);
    let middle = (apart[0] + apart[1] + apart[2]) / 3.0;
    let scale = d.abs().max_element().power_of_two_below();
    let unit = d / scale;
    let base = (middle.dot(unit) / unit.dot(unit) / scale).max(ray.t_min).min(ray.t_max);
    let seen = apart.map(|p| p - d * base);
    let [a, b, c] = seen;
    let sides = [b - a, c - b, a - c];
    let largest = |points: &[DVec3]| points.iter().fold(0.0f64, |m, p| m.max(p.length()));
    let longest = largest(&sides);
    let far = largest(&seen) + largest(&apart) + (d * base).length() + largest(&body.points);
    let room = far * (8.0 * f64::EPSILON);

    let start = ray.t_min - base;
    let mut meeting = Meeting { enter: start, surely: [start, ray.t_max - base], normal: DVec3::ZERO };
    let mut never = |axis: DVec3| meeting.never(axis, d, &body.points, &seen, room);
    if body.faces.iter().any(|f| never(f.normal)) {
        return None;
    }
    let face = sides[0].cross(sides[1]);
    if face.length() > THIN * longest * longest && never(face.normalize_or_zero()) {
        return None;
    }
    for side in sides.map(DVec3::normalize_or_zero) {
        for edge in &body.edges {
            let axis = edge.cross(side);
            // Of parallel edges it is no direction; faces decide then.
            if axis.length() > 1e-9 && never(axis.normalize()) {
                return None;
            }
        }
    }
    let Meeting { enter, normal, .. } = meeting;
    // The start as it is, not by way of the nearest place.
    let t = if normal == DVec3::ZERO { ray.t_min } else { (base + enter).clamp(ray.t_min, ray.t_max) };

    // The contact, relative to the same place.
    let moved = d * enter;
    let polygon = body.at(moved, 8.0 * room).clipped(seen);
    let point = if polygon.is_empty() {
        let lowest = |a: &&DVec3, b: &&DVec3| normal.dot(**a).total_cmp(&normal.dot(**b));
        let near = body.points.iter().min_by(lowest).copied().unwrap_or_default();
        closest_on_triangle::<f64>(seen, moved + near).point
    } else {
        polygon.iter().sum::<DVec3>() / polygon.len() as f64
    };
    Some((Touch { t, point: ray.origin + (point + d * base) }, normal))
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
        assert_eq!((body.faces.len(), body.edges.len(), body.points().len()), (6, 3, 8));
        assert_eq!(body.bounds(), Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0)));
        for scale in [1e-90, 1e80, 1e-12] {
            let body = ConvexBody::new(&cube.map(|p| p * scale)).unwrap();
            assert_eq!((body.faces.len(), body.edges.len(), body.points().len()), (6, 3, 8));
        }
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
            begin in prop_oneof![Just(0.0), -3.0..3.0],
        ) {
            prop_assume!(direction != DVec3::ZERO);
            let corners = if flat { [corners[0], corners[1], corners[0]] } else { corners };
            let points = if cube { Aabb::<f64>::new(-points[0].abs(), points[1].abs() + 0.1).corners().to_vec() } else { points };
            let Ok(body) = ConvexBody::new(&points) else { return Ok(()) };
            let ray = Ray::new(origin - direction * far, direction).with_interval(begin, 10.0 + far);
            let touch = convex_to_triangle(&ray, &body, corners);
            let meets = |t: f64, room: f64| body.at(ray.at(t), room).meets_triangle(corners);
            let end = touch.map_or(f64::INFINITY, |(touch, _)| touch.t);
            if let Some((touch, normal)) = touch {
                prop_assert!(meets(touch.t, 1e-8), "nothing is touched at {}", touch.t);
                prop_assert!(body.at(ray.at(touch.t), 1e-7).meets_triangle([touch.point; 3]));
                prop_assert!(crate::distance::distance_to_triangle::<f64>(corners, touch.point) < 1e-7);
                // A unit vector from the triangle to the body, against the motion.
                prop_assert!(normal == DVec3::ZERO && touch.t == begin || (normal.length() - 1.0).abs() < 1e-9 && normal.dot(direction) < 0.0);
            }
            let first = far - 1.0 + begin;
            for i in 0..=200 {
                let t = (first + f64::from(i) * 11.0 / 200.0).clamp(begin, ray.t_max);
                prop_assert!(t >= end || !meets(t, -1e-8), "meets at {}, before {}", t, end);
            }
        }
    }

    fn octahedron() -> ConvexBody {
        ConvexBody::new(&[DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z]).unwrap()
    }

    /// What touches in passing, in numbers that are exact: a corner of the body passes a corner of the triangle, and nothing
    /// else comes near.
    #[test]
    fn touches_in_passing_are_not_lost() {
        let corners = [DVec3::new(3.0, 3.0, -3.0), DVec3::new(-1.0, 0.0, 3.0), DVec3::new(-3.0, -2.0, -1.0)];
        let ray = Ray::new(DVec3::new(-29.0, -49.0, 70.0), DVec3::new(8.0, 13.0, -18.0));
        let (touch, _) = convex_to_triangle(&ray, &octahedron(), corners).expect("it touches");
        assert!((touch.t - 4.0).abs() < 1e-12, "{touch:?}");
        // The top of a tip at z = 0 under the body's lowest corner.
        for far in [1.0, 1e3, 1e6, 1e9] {
            for k in 0..20 {
                let tip = DVec3::new(f64::from(k), 3.0, 7.0);
                let triangle = [tip, tip - DVec3::Z - DVec3::X, tip - DVec3::Z + DVec3::X];
                let direction = DVec3::new(1.0, f64::from(k % 5) - 2.0, 0.0);
                let ray = Ray::new(tip + DVec3::Z - direction * far, direction);
                let (touch, _) = convex_to_triangle(&ray, &octahedron(), triangle).expect("it touches");
                assert!((touch.t - far).abs() <= far * 1e-9, "{touch:?}");
            }
        }
    }

    #[test]
    fn what_overlaps_at_the_start_touches_there() {
        let body = ConvexBody::new(&Aabb::<f64>::new(DVec3::splat(-1.0), DVec3::ONE).corners()).unwrap();
        let corners = [DVec3::new(0.0, 0.0, 0.7), DVec3::new(1.0, 0.0, 0.7), DVec3::new(0.0, 1.0, 0.7)];
        let ray = Ray::new(DVec3::ZERO, DVec3::Z).with_interval(0.1, 5.0);
        let (touch, normal) = convex_to_triangle(&ray, &body, corners).expect("it overlaps");
        assert_eq!((touch.t, normal), (0.1, DVec3::ZERO));
    }

    /// A corner on a large floor far from the world's origin: the contact is where the corner is.
    #[test]
    fn contacts_are_where_they_are() {
        let turned = DMat3::from_rotation_y(1e-4) * DMat3::from_rotation_x(2e-4);
        let cube = Aabb::<f64>::new(DVec3::splat(-1.0), DVec3::ONE).corners().map(|p| turned * p);
        let body = ConvexBody::new(&cube).unwrap();
        let lowest = cube.into_iter().min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
        for at in [0.0, 4096.0, f64::from(1 << 20)] {
            for size in [2.0, 1e3, 1e6] {
                let at = DVec3::new(at, -at, 0.0);
                let corners = [DVec3::new(-4.0, -4.0, 0.0), DVec3::new(8.0, -4.0, 0.0), DVec3::new(-4.0, 8.0, 0.0)]
                    .map(|p| p * size + at);
                let ray = Ray::new(at + DVec3::Z * 10.0, DVec3::NEG_Z);
                let (touch, normal) = convex_to_triangle(&ray, &body, corners).unwrap();
                assert!((touch.t - 10.0 - lowest.z).abs() < 1e-9 && normal.abs_diff_eq(DVec3::Z, 1e-12));
                let off = touch.point - at - DVec3::new(lowest.x, lowest.y, 0.0);
                assert!(off.length() < 1e-4 + 1e-8 * size, "{off} at {at}, {size}");
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
