//! A camera for a scene that brings none.
//!
//! * An **object** is seen from outside in three-quarter view, as close as all of it fits into the picture. The flatter
//!   it is, the more it is faced.
//! * A **room** (a hull: most rays from its middle end on its inner side, and there is a floor) is seen from inside, at
//!   eye height, along the longest free way.
//! * A **room with one side open** (a stage, a Cornell box) is seen from outside through that side.

mod hull;
mod motion;
mod points;

use firsthit_accel::Scene;
use firsthit_import::SceneDesc;
use glam::DVec3;

use crate::Camera;
use hull::Hull;
pub use motion::all_poses;
use points::Points;

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

/// Full vertical angle of view of pictures from outside, radians (30 degrees).
const OUTSIDE_FOV: f64 = std::f64::consts::PI / 6.0;
/// Share of the picture's width and height left free on each side.
const MARGIN: f64 = 0.06;

/// Finds a camera for a picture of this width / height.
///
/// Works at any scale and place: every length is measured by the scene's own.
#[must_use]
pub fn frame(desc: &SceneDesc, scene: &Scene, aspect: f64) -> Framing {
    let points = Points::visible(desc);
    let outside = |towards_camera, reason: &str| Framing {
        camera: fit(&points.all, towards_camera, aspect),
        inside: false,
        reason: format!(
            "{reason}{}",
            if points.ground_left_out { "; the ground may go beyond the picture" } else { "" }
        ),
    };
    if points.all.is_empty() {
        return outside(DVec3::Z, "there is nothing to frame");
    }
    match hull::find(scene, &points.bounds) {
        Some(Hull::Room { camera, reason }) => Framing { camera, inside: true, reason },
        Some(Hull::OpenTo(side)) => outside(side, "a room that is open to one side: seen through the opening"),
        None => {
            let (towards_camera, reason) = outside_direction(&points);
            outside(towards_camera, reason)
        }
    }
}

/// From which side an object shows itself best.
fn outside_direction(points: &Points) -> (DVec3, &'static str) {
    let size = points.bounds.extent();
    let flatness = |thin: f64, a: f64, b: f64| if a.min(b) > 0.0 { thin / a.min(b) } else { 1.0 };
    let (flat_x, flat_y, flat_z) =
        (flatness(size.x, size.y, size.z), flatness(size.y, size.x, size.z), flatness(size.z, size.x, size.y));
    // 0: a sheet; 1: as deep as it is wide.
    let depth = |flat: f64| ((flat - 0.02) / 0.5).clamp(0.0, 1.0);
    let between = |sheet: f64, solid: f64, flat: f64| (sheet + (solid - sheet) * depth(flat)).to_radians();
    // A sheet has a front, which may be the far side. What has none is seen from +X, +Y, +Z.
    let side = |facing: f64| if facing < -0.5 { -1.0 } else { 1.0 };
    let front = points.mean_normal;

    let least = flat_x.min(flat_y).min(flat_z);
    if least == flat_y && depth(flat_y) < 1.0 {
        let below = if depth(flat_y) == 0.0 { side(front.y) } else { 1.0 };
        let d = direction(30_f64.to_radians(), between(55.0, 18.0, flat_y));
        return (DVec3::new(d.x, d.y * below, d.z), "flat and lying: seen from above");
    }
    if least == flat_x && depth(flat_x) < 1.0 {
        let d = direction(between(14.0, 60.0, flat_x), between(7.0, 18.0, flat_x));
        return (DVec3::new(d.z * side(front.x), d.y, d.x), "flat: its broad side faced");
    }
    let d = direction(between(14.0, 30.0, flat_z), between(7.0, 18.0, flat_z));
    let reason =
        if depth(flat_z) < 1.0 { "flat: its broad side faced" } else { "three-quarter view, fitted to the model" };
    let facing = if depth(flat_z) < 0.2 { side(front.z) } else { 1.0 };
    (DVec3::new(d.x * facing, d.y, d.z * facing), reason)
}

/// The unit direction at this angle from +Z towards +X and this angle above the horizon.
fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    DVec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos())
}

/// The closest perspective camera on that side from which all points are in the picture.
fn fit(points: &[DVec3], towards_camera: DVec3, aspect: f64) -> Camera {
    let forward = -towards_camera.normalize();
    let right = forward.cross(if forward.y.abs() < 0.999 { DVec3::Y } else { DVec3::NEG_Z }).normalize();
    let up = right.cross(forward);
    let origin = points.first().copied().unwrap_or(DVec3::ZERO);
    let aspect = if aspect > 0.0 && aspect.is_finite() { aspect } else { 1.0 };
    let tan_y = (0.5 * OUTSIDE_FOV).tan() * (1.0 - 2.0 * MARGIN);
    let tan_x = tan_y * aspect;
    // A camera at `x right + y up - d forward` sees a point within `tan` of its axis if |p.right - x| <= tan
    // (p.forward + d), and so for y. The two most demanding points on either side give d, and the x between them.
    let tightest = |axis: DVec3, tan: f64| {
        let reach = |axis: DVec3| {
            let demand = |p: &DVec3| (*p - origin).dot(axis) - tan * (*p - origin).dot(forward);
            points.iter().map(demand).fold(f64::NEG_INFINITY, f64::max)
        };
        let (more, less) = (reach(axis), reach(-axis));
        ((more + less) / (2.0 * tan), 0.5 * (more - less))
    };
    let distance = tightest(right, tan_x).0.max(tightest(up, tan_y).0);
    // Along the axis with room to spare, the angle is found that would just do, so that both margins are the same.
    let centred = |axis: DVec3, mut tan: f64| {
        const STEPS: u32 = 8;
        for _ in 0..STEPS {
            let needed = tightest(axis, tan).0 / distance;
            if !(needed > 0.0 && needed < 1.0) {
                break;
            }
            tan *= needed;
        }
        tightest(axis, tan).1
    };
    let position = origin + right * centred(right, tan_x) + up * centred(up, tan_y) - forward * distance;
    let depths = points.iter().map(|p| (*p - position).dot(forward));
    let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
    // No points, or only one: there is no distance to keep. One as far as the point is from the origin will do.
    let extent = distance + (far - near);
    if !(extent > 1e-12 * origin.abs().max_element()) || !extent.is_finite() {
        let away = towards_camera * origin.abs().max_element().max(1.0);
        return look(origin + away, origin, OUTSIDE_FOV);
    }
    look(position, position + forward * (0.5 * (near + far)), OUTSIDE_FOV)
}

/// A camera that is known to have a direction.
fn look(position: DVec3, focal_point: DVec3, fov: f64) -> Camera {
    Camera::look_at(position, focal_point, DVec3::Y, fov)
        .or_else(|_| Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, fov))
        .unwrap_or_else(|_| unreachable!("the second one is fixed"))
}

#[cfg(test)]
mod tests;
