//! Where exactly a hit is.

use firsthit_geometry::{Precision, Ray, Real, transform::Transform, triangle};
use glam::{DMat3, DVec3};

use crate::model::Surface;
use crate::{BuildOptions, Guards, Hit, Scene, SurfacePoint};

/// The textbook's epsilon, in units of the world: what takes the bound's place without [`Guards::OFFSET`].
const CONSTANT_OFFSET: f64 = 1e-4;

impl Scene {
    /// Where exactly a hit is, for starting other rays there. `ray` is the ray that found it.
    ///
    /// On a triangle the point is made from the barycentric weights in double precision, which is closer to the
    /// surface than `origin + t * direction`: its distance from the plane does not grow with that of the ray's origin.
    #[must_use]
    pub fn surface_point(&self, ray: &Ray<f64>, hit: &Hit) -> SurfacePoint {
        let world_normal = hit.normal();
        let fallback = SurfacePoint { position: ray.at(hit.t), normal: world_normal, error: 0.0 };
        let Some((instance, surface)) = self.surface(&hit.id) else { return fallback };
        let transform = &instance.transform;
        let BuildOptions { precision, guards, .. } = self.options();
        let (point, error) = match surface {
            Surface::Triangle(v) => on_triangle(v, hit, precision),
            Surface::Shape(s) => {
                // In the object's space: far from the world's origin `ray.at(t)` has lost digits that are known here.
                let point = transform.ray_to_object(ray).at(hit.t);
                // A unit normal of the world, back: the inverse transpose of the inverse transpose.
                let normal = (transform.linear().transpose() * world_normal).normalize_or_zero();
                let (point, error) = s.refine(point, (normal != DVec3::ZERO).then_some(normal));
                (point, DVec3::splat(error))
            }
        };
        let scale = transform.is_uniform().then_some(transform.linear().x_axis.x);
        let position = match scale {
            Some(scale) => point * scale + transform.translation(),
            None => transform.point(point),
        };
        let error = if precision == Precision::Robust && !guards.contains(Guards::OFFSET) {
            CONSTANT_OFFSET
        } else if scale.is_some() {
            distance_uniform(transform, point, error, world_normal, position)
        } else {
            distance(transform, point, error, world_normal, position)
        };
        SurfacePoint { position, normal: world_normal, error }
    }
}

/// Of a smaller sine (squared) of its sharpest angle the area has to be computed with care.
const SLIVER: f64 = 1.0 / (1u64 << 40) as f64;

/// Of two numbers; `f64::max` would take care of NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The point of a triangle with a hit's weights, and its error in each axis together with that of the tests that rays
/// from there undergo.
#[inline]
fn on_triangle(v: [DVec3; 3], hit: &Hit, precision: Precision) -> (DVec3, DVec3) {
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let point = v[0] + e1 * f64::from(hit.u) + e2 * f64::from(hit.v);
    let magnitude = v[0].abs() + e1.abs() + e2.abs();
    let error = match precision {
        // The test works on vertices relative to a rounded origin, in f32.
        Precision::Fast => magnitude * (8.0 * f64::from(f32::UNIT_ROUNDOFF)),
        // The test's distance comes from the plane in f64, whose normal tilts by some roundings times the aspect.
        Precision::Robust | Precision::Double | Precision::Exact => {
            let e3 = e2 - e1;
            let (l1, l2, l3) = (e1.length_squared(), e2.length_squared(), e3.length_squared());
            let longest2 = larger(larger(l1, l2), l3);
            // Of any two edges where that is good enough for the ninth rounding.
            let mut area2 = e1.cross(e2).length_squared();
            if !(area2 > SLIVER * (longest2 * longest2)) {
                area2 = triangle::area_vector(v).length_squared();
            }
            // The longest edge times its square over the area.
            let tilted = if area2 > 0.0 { longest2 * (longest2 / area2).sqrt() } else { longest2.sqrt() };
            magnitude * gamma(8) + DVec3::splat(tilted * gamma(9))
        }
    };
    (point, error)
}

/// How far to go along the world's normal so as to be off the surface for certain: from `error` in the object's space,
/// the roundings of the way to the world and back, and those of the point in the world.
///
/// What lies along a unit of the object's normal `n` is divided by how far that goes along the world's, which is
/// `w = M^-T n / |M^-T n|`: so the object's side counts by `M^T w`, and its normal need not be known.
#[inline]
fn distance(transform: &Transform, point: DVec3, error: DVec3, normal: DVec3, position: DVec3) -> f64 {
    let (linear, translation) = (transform.linear(), transform.translation());
    let sizes = linear.abs();
    let image = sizes * point.abs();
    let to_world = (image + translation.abs()) * gamma(4);
    // The inverse is rounded too: going there and back moves a point by |M^-1| |M| |p| times a few roundings.
    let from = (position + to_world - translation).abs() * gamma(4) + image * gamma(16);
    let back = transform.inverse_linear().abs() * from;
    let along = |m: DMat3, n: DVec3| DVec3::new(m.x_axis.dot(n), m.y_axis.dot(n), m.z_axis.dot(n));
    let world = normal.abs();
    let object = along(linear, normal).abs() + along(sizes, world) * gamma(4);
    object.dot(error + back) + world.dot(to_world + position.abs() * gamma(2))
}

/// The same where all lengths change alike, as in most scenes: every matrix is a number, and the normal is that of the
/// world.
#[inline]
fn distance_uniform(transform: &Transform, point: DVec3, error: DVec3, normal: DVec3, position: DVec3) -> f64 {
    let (scale, inverse) = (transform.linear().x_axis.x.abs(), transform.inverse_linear().x_axis.x.abs());
    let (point, translation) = (point.abs(), transform.translation());
    let to_world = (point * scale + translation.abs()) * gamma(4);
    let back = (position + to_world - translation).abs() * (inverse * gamma(4));
    let bijection = point * (scale * inverse * gamma(16));
    let normal = normal.abs();
    normal.dot(error + back + bijection) / inverse + normal.dot(to_world + position.abs() * gamma(2))
}

fn gamma(n: u32) -> f64 {
    <f64 as Real>::gamma(n)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;
    use proptest::prelude::*;

    use super::*;

    /// The same by the normal of the object, step by step.
    fn by_object(transform: &Transform, point: DVec3, error: DVec3, normal: DVec3, position: DVec3) -> f64 {
        let to_world = transform.point_error(point, DVec3::ZERO);
        let back = transform.point_to_object_error(position + to_world);
        let bijection = transform.inverse_linear().abs() * (transform.linear().abs() * point.abs()) * gamma(16);
        let object = normal.abs().dot(error + back + bijection);
        let unit = (transform.inverse_linear().transpose() * normal).length();
        object / unit + transform.normal(normal).abs().dot(to_world + position.abs() * gamma(2))
    }

    fn vector() -> impl Strategy<Value = DVec3> {
        proptest::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from)
    }

    proptest! {
        #[test]
        fn the_bound_is_that_by_the_normal_of_the_object(
            columns in proptest::array::uniform3(vector()),
            translation in vector(),
            (point, error, normal) in (vector(), vector(), vector()),
            scales in proptest::array::uniform3(-12..12_i32),
        ) {
            let matrix3 = DMat3::from_cols_array_2d(&columns.map(|c| c.to_array()));
            let [m, t, e] = scales.map(|k| 2f64.powi(k));
            let placed = DAffine3 { matrix3: matrix3 * m, translation: translation * t };
            prop_assume!(matrix3.determinant().abs() > 1e-3 && normal.length() > 1e-3);
            let transform = Transform::new(placed).unwrap();
            let (normal, error) = (normal.normalize(), error.abs() * e * 1e-16);
            let (position, world) = (transform.point(point), transform.normal(normal));
            let fast = distance(&transform, point, error, world, position);
            let slow = by_object(&transform, point, error, normal, position);
            prop_assert!((fast / slow - 1.0).abs() < 1e-9, "{} instead of {}", fast, slow);
        }
    }

    #[test]
    fn a_uniform_transform_needs_no_matrix() {
        let placed = DAffine3::from_scale(DVec3::splat(3.0)) * DAffine3::from_translation(DVec3::new(1e3, -2.0, 0.5));
        let transform = Transform::new(placed).unwrap();
        let point = DVec3::new(0.6, 0.0, 0.8);
        let (position, error) = (transform.point(point), DVec3::splat(1e-16));
        let both = [distance, distance_uniform].map(|f| f(&transform, point, error, point, position));
        assert!((both[0] / both[1] - 1.0).abs() < 1e-9, "{both:?}");
    }
}
