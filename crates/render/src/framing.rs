//! A camera for a scene that brings none.

use firsthit_import::SceneDesc;
use firsthit_import::scene::SurfaceDesc;
use glam::DVec3;

use crate::Camera;

/// A camera that was found, and why it is where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Framing {
    /// The camera.
    pub camera: Camera,
    /// Whether it stands inside a hull (a room, a hall).
    pub inside: bool,
    /// One sentence for people.
    pub reason: String,
}

/// Full vertical angle of view of pictures from outside, degrees.
const OUTSIDE_FOV: f64 = 30.0;
/// Share of the picture's width and height left free on each side.
const MARGIN: f64 = 0.06;

/// Finds a camera for a picture of this width / height.
#[must_use]
pub fn frame(desc: &SceneDesc, scene: &firsthit_accel::Scene, aspect: f64) -> Framing {
    let _ = scene;
    let points = points(desc);
    let (azimuth, elevation) = (30_f64.to_radians(), 18_f64.to_radians());
    let towards_camera = DVec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
    let camera = fit(&points, towards_camera, OUTSIDE_FOV.to_radians(), aspect);
    Framing { camera, inside: false, reason: "three-quarter view, fitted to the model".into() }
}

/// The closest perspective camera on that side from which all points are in the picture.
fn fit(points: &[DVec3], towards_camera: DVec3, fov: f64, aspect: f64) -> Camera {
    let forward = -towards_camera.normalize();
    let right = forward.cross(if forward.y.abs() < 0.999 { DVec3::Y } else { DVec3::NEG_Z }).normalize();
    let up = right.cross(forward);
    let origin = points.first().copied().unwrap_or(DVec3::ZERO);
    let aspect = if aspect > 0.0 && aspect.is_finite() { aspect } else { 1.0 };
    let tan_y = (0.5 * fov).tan() * (1.0 - 2.0 * MARGIN);
    let tan_x = tan_y * aspect;
    // A camera at `x right + y up - d forward` sees a point if |p.right - x| <= tan_x (p.forward + d), and so for y.
    // The two most demanding points on either side give d and the x in the middle between them.
    let reach = |axis: DVec3, tan: f64| {
        points.iter().map(|p| *p - origin).map(|p| p.dot(axis) - tan * p.dot(forward)).fold(f64::NEG_INFINITY, f64::max)
    };
    let (r, l, t, b) = (reach(right, tan_x), reach(-right, tan_x), reach(up, tan_y), reach(-up, tan_y));
    let distance = ((r + l) / (2.0 * tan_x)).max((t + b) / (2.0 * tan_y));
    let position = origin + right * (0.5 * (r - l)) + up * (0.5 * (t - b)) - forward * distance;
    let middle = 0.5
        * points
            .iter()
            .map(|p| (*p - position).dot(forward))
            .fold((f64::INFINITY, 0.0_f64), |(a, b), z| (a.min(z), b.max(z)))
            .1
        + 0.5 * points.iter().map(|p| (*p - position).dot(forward)).fold(f64::INFINITY, f64::min);
    Camera::look_at(position, position + forward * middle, up, fov).unwrap_or_else(|_| fallback(origin))
}

/// For a scene without extent: one unit away from its point.
fn fallback(at: DVec3) -> Camera {
    let away = DVec3::Z * at.abs().max_element().max(1.0);
    Camera::look_at(at + away, at, DVec3::Y, OUTSIDE_FOV.to_radians())
        .unwrap_or_else(|_| unreachable!("a finite point and another one beside it"))
}

fn points(desc: &SceneDesc) -> Vec<DVec3> {
    let mut points = Vec::new();
    for instance in &desc.instances {
        for geometry in &desc.meshes[instance.mesh].geometries {
            match &geometry.surface {
                SurfaceDesc::Triangles(mesh) => {
                    points.extend(mesh.positions.iter().map(|p| instance.transform.transform_point3(p.as_dvec3())));
                }
                SurfaceDesc::Shape(shape) => {
                    let bounds = firsthit_geometry::Primitive::bounds(shape);
                    if bounds.is_finite() {
                        points.extend(bounds.corners().map(|c| instance.transform.transform_point3(c)));
                    }
                }
            }
        }
    }
    points
}
