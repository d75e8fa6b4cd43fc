//! A sphere.

use glam::DVec3;

use super::Touch;
use crate::Ray;
use crate::distance::closest_on_triangle;

/// When a sphere whose center moves along a ray first has a point in common with a triangle: at the start of the interval,
/// if it has one there.
///
/// That is where the center enters what is not farther from the triangle than the radius: two copies of the face, cylinders
/// about the edges and spheres about the corners, each with the root of its equation. (A face
/// thinner than 1e-8 of its longest edge counts as its edges.) Error of the center's place: some `u`
/// times the distances between ray and triangle, and near a tangent the root of that. `None` also for a ray that is not
/// valid or has no finite start, and a radius that is no finite number from 0 on.
///
/// ```
/// use firsthit_geometry::{Ray, sweep::sphere_to_triangle};
/// use glam::DVec3;
/// let falling = Ray::new(DVec3::new(0.2, 0.2, 5.0), DVec3::NEG_Z);
/// let touch = sphere_to_triangle(&falling, 0.5, [DVec3::ZERO, DVec3::X, DVec3::Y]).unwrap();
/// assert_eq!((touch.t, touch.point), (4.5, DVec3::new(0.2, 0.2, 0.0)));
/// ```
#[must_use]
pub fn sphere_to_triangle(ray: &Ray<f64>, radius: f64, corners: [DVec3; 3]) -> Option<Touch> {
    if !(ray.is_valid() && ray.t_min.is_finite() && radius.is_finite() && radius >= 0.0) {
        return None;
    }
    let nearest = closest_on_triangle::<f64>(corners, ray.at(ray.t_min)).point;
    if nearest.distance(ray.at(ray.t_min)) <= radius {
        return Some(Touch { t: ray.t_min, point: nearest });
    }
    // From where the ray is about nearest: small numbers, and little is rounded.
    let d = ray.direction;
    let dd = d.dot(d);
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0 - ray.origin;
    let base = (middle.dot(d) / dd).max(ray.t_min);
    let at = ray.at(base);
    let from = ray.t_min - base;
    let [a, b, c] = corners.map(|p| p - at);
    let mut best: Option<(f64, DVec3)> = None;
    let mut offer = |s: f64, point: DVec3| {
        if s >= from && best.is_none_or(|(t, _)| s < t) {
            best = Some((s, point));
        }
    };

    // The face, on the side where the sphere starts.
    if let Some((n, on)) = normal([a, b, c]) {
        let start = n.dot(d * from - on);
        let side = radius.copysign(start);
        let s = (side + n.dot(on)) / n.dot(d);
        let point = d * s - n * side;
        if start.abs() >= radius && s.is_finite() && contains([a, b, c], n, point) {
            offer(s, point);
        }
    }
    let square = radius * radius;
    for [p, q] in [[a, b], [b, c], [c, a]] {
        // A corner, and the cylinder about the edge that begins there.
        if let Some(s) = entry(d, p, square) {
            offer(s, p);
        }
        let e = (q - p).normalize_or_zero();
        let (across, off) = (d - e * d.dot(e), p - e * p.dot(e));
        if let Some(s) = entry(across, off, square) {
            let along = e.dot(d * s - p);
            if along >= 0.0 && along <= p.distance(q) {
                offer(s, p + e * along);
            }
        }
    }
    let (s, point) = best?;
    let t = base + s;
    ray.contains(t).then_some(Touch { t, point: at + point })
}

/// When a point that moves from the origin comes as near to `p` as the root of `square`. From the nearest point of its line,
/// so that a radius far smaller than the way is not lost in squares of that.
fn entry(d: DVec3, p: DVec3, square: f64) -> Option<f64> {
    let dd = d.dot(d);
    let nearest = p.dot(d) / dd;
    let within = square - (p - d * nearest).length_squared();
    // False also for a point that does not move.
    (within >= 0.0).then(|| nearest - (within / dd).sqrt())
}

/// The unit normal and a point of the plane, where it is not too thin to tell.
fn normal([a, b, c]: [DVec3; 3]) -> Option<(DVec3, DVec3)> {
    let [(from, e), ..] = {
        let mut edges = [(a, b - a), (b, c - b), (c, a - c)];
        edges.sort_by(|x, y| y.1.length_squared().total_cmp(&x.1.length_squared()));
        edges
    };
    let n = (b - a).cross(c - a);
    if !(n.length() > 1e-8 * e.length_squared()) {
        return None;
    }
    // What is rounded matters most along the longest edge.
    let e = e.normalize_or_zero();
    let n = n.normalize_or_zero();
    Some(((n - e * n.dot(e)).normalize_or_zero(), from))
}

/// Whether a point of the triangle's plane is in it.
fn contains([a, b, c]: [DVec3; 3], n: DVec3, p: DVec3) -> bool {
    [[a, b], [b, c], [c, a]].into_iter().all(|[from, to]| n.dot((to - from).cross(p - from)) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::distance_to_triangle;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        let coordinate = || prop_oneof![(-3..=3).prop_map(f64::from), -3.0..3.0];
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        /// Before it touches it is farther away than the radius, and when it does it is not.
        #[test]
        fn a_sphere_touches_when_it_is_near_enough(
            corners in [vector(), vector(), vector()], origin in vector(), direction in vector(),
            radius in prop_oneof![Just(0.0), Just(1.0), 0.0..2.0f64], flat: bool, far in prop_oneof![Just(0.0), Just(1e3)],
        ) {
            prop_assume!(direction != DVec3::ZERO);
            let corners = if flat { [corners[0], corners[1], corners[0]] } else { corners };
            let origin = origin - direction * far;
            let ray = Ray::new(origin, direction).with_interval(0.0, 10.0 + far);
            let distance = |t: f64| distance_to_triangle::<f64>(corners, ray.at(t));
            let touch = sphere_to_triangle(&ray, radius, corners);
            let end = touch.map_or(ray.t_max, |h| h.t);
            if let Some(touch) = touch {
                prop_assert!((touch.point.distance(ray.at(touch.t)) - radius).abs() < 1e-8 || touch.t == 0.0);
                prop_assert!(distance_to_triangle::<f64>(corners, touch.point) < 1e-8);
            }
            let first = far.max(0.0) - 1.0;
            for i in 0..=400 {
                let t = (first + f64::from(i) * 11.0 / 400.0).max(0.0);
                prop_assert!(t >= end || distance(t) >= radius - 1e-8, "at {}, before {}", t, end);
            }
        }
    }

    #[test]
    fn what_is_no_number_touches_nothing() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let ray = Ray::new(DVec3::Z, DVec3::NEG_Z);
        for radius in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(sphere_to_triangle(&ray, radius, corners).is_none());
        }
        assert!(sphere_to_triangle(&ray.with_interval(f64::NEG_INFINITY, 1.0), 1.0, corners).is_none());
        assert!(sphere_to_triangle(&Ray::new(DVec3::NAN, DVec3::X), 1.0, corners).is_none());
    }
}
