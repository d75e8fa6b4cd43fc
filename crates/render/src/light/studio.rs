//! The built-in studio: a large soft key light at the upper left, a fill on the right, a rim light behind, a bright
//! ceiling and a darker floor. Neutral white, smooth, with enough structure for metals to show their shape.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;

use super::environment::from_map;

/// A softbox: a rounded rectangle of light on the sphere of directions, with soft edges.
struct Panel {
    /// Degrees from +Z (towards the viewer of a front view) to +X (right).
    azimuth: f32,
    /// Degrees above the horizon.
    elevation: f32,
    /// Half its width and height, degrees.
    half_size: [f32; 2],
    /// Over how many degrees its edge fades.
    softness: f32,
    /// Radiance in the middle.
    radiance: f32,
}

/// Placed for a camera in three-quarter view (30 degrees from +Z towards +X).
const PANELS: [Panel; 5] = [
    // Key: upper left, in front.
    Panel { azimuth: -22.0, elevation: 46.0, half_size: [26.0, 20.0], softness: 14.0, radiance: 6.6 },
    // Fill: right, lower, large and weak.
    Panel { azimuth: 102.0, elevation: 14.0, half_size: [16.0, 36.0], softness: 16.0, radiance: 1.4 },
    // Rims: behind, on both sides.
    Panel { azimuth: 178.0, elevation: 30.0, half_size: [10.0, 34.0], softness: 10.0, radiance: 4.0 },
    Panel { azimuth: -104.0, elevation: 20.0, half_size: [8.0, 34.0], softness: 10.0, radiance: 2.6 },
    // Overhead.
    Panel { azimuth: 30.0, elevation: 86.0, half_size: [30.0, 16.0], softness: 16.0, radiance: 1.4 },
];

/// The studio as a map by longitude and latitude: width, height, pixels.
pub(super) fn bake() -> (usize, usize, Arc<[[f32; 3]]>) {
    const WIDTH: usize = 256;
    const HEIGHT: usize = 128;
    let pixels = (0..WIDTH * HEIGHT)
        .map(|i| {
            let u = ((i % WIDTH) as f32 + 0.5) / WIDTH as f32;
            let v = ((i / WIDTH) as f32 + 0.5) / HEIGHT as f32;
            radiance(from_map([u, v])).to_array()
        })
        .collect();
    (WIDTH, HEIGHT, pixels)
}

/// The studio's radiance from a unit direction.
fn radiance(d: Vec3) -> Vec3 {
    // The walls are darkest a little below the horizon: a dark line in which metals show their shape.
    let walls = if d.y >= 0.0 { 0.22 + 0.28 * smooth(d.y) } else { 0.22 + 0.13 * smooth(-d.y) };
    Vec3::splat(walls + PANELS.iter().map(|p| p.radiance * p.coverage(d)).sum::<f32>())
}

impl Panel {
    /// How much of the panel is seen in a direction: 1 in its middle, 0 outside.
    fn coverage(&self, d: Vec3) -> f32 {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        let forward = Vec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
        let right = Vec3::new(cos_a, 0.0, -sin_a);
        let up = forward.cross(right);
        let z = d.dot(forward);
        let angle = |x: f32| x.atan2(z).abs() * 180.0 / PI;
        let (x, y) = (angle(d.dot(right)), angle(d.dot(up)));
        let edge = |a: f32, half: f32| (a - half) / self.softness + 1.0;
        let (ex, ey) = (edge(x, self.half_size[0]).max(0.0), edge(y, self.half_size[1]).max(0.0));
        1.0 - smooth(ex.hypot(ey))
    }
}

/// 0 to 1 with no kink at either end.
fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

/// What the camera sees behind a model in the studio: plain, light, a little darker towards the edges of the picture.
///
/// `x` and `y` are 0 at the left and top of the picture, 1 at the right and bottom. The answer is linear RGB.
#[must_use]
pub fn backdrop(x: f32, y: f32) -> Vec3 {
    let from_middle = Vec3::new((x - 0.5) * 1.1, y - 0.42, 0.0).length();
    Vec3::splat(0.66 - 0.34 * smooth(from_middle / 0.9))
}
