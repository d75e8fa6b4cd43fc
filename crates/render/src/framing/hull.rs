//! Rooms: is the scene one, and where does one stand in it?

use std::f64::consts::TAU;

use firsthit_accel::Scene;
use firsthit_geometry::{Aabb, Ray};
use glam::DVec3;

use super::look;
use crate::Camera;

/// A scene that surrounds its middle.
pub(super) enum Hull {
    /// To be seen from inside.
    Room { camera: Camera, reason: String },
    /// To be seen through an opening on this side (a unit vector along an axis).
    OpenTo(DVec3),
}

/// Full vertical angle of view of pictures from inside, radians (60 degrees).
const INSIDE_FOV: f64 = TAU / 6.0;
/// Least share of the rays from the middle that end on something, in a hull.
const CLOSED: f64 = 0.7;
/// Least share of those that see a front side. From the middle of a solid, all sides are back sides.
const FRONT: f64 = 0.6;
/// Least share of the view down that is level floor.
const FLOOR: f64 = 0.3;

/// Looks around from the middle of the scene.
pub(super) fn find(scene: &Scene, bounds: &Aabb<f64>) -> Option<Hull> {
    const RAYS: usize = 512;
    let middle = bounds.center();
    let (mut ended, mut front, mut free) = (0, 0, DVec3::ZERO);
    for direction in (0..RAYS).map(|i| spread(i, RAYS)) {
        match scene.closest_hit(&Ray::new(middle, direction)) {
            Some(hit) => {
                ended += 1;
                front += usize::from(hit.normal().dot(direction) < 0.0);
            }
            None => free += direction,
        }
    }
    let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
    if share(ended, RAYS) < CLOSED || share(front, ended) < FRONT {
        return None;
    }
    let floor = Floor::find(scene, bounds)?;
    open_side(free, RAYS - ended, RAYS).map(Hull::OpenTo).or_else(|| stand(scene, bounds, &floor, share(ended, RAYS)))
}

/// The side, if any, to which the rays that end nowhere leave: all through one open side of a box.
fn open_side(free: DVec3, count: usize, all: usize) -> Option<DVec3> {
    if (count as f64) < 0.05 * all as f64 {
        return None;
    }
    // Directions spread evenly over a sixth of the sphere have a mean of about 0.83.
    let mean = free / count as f64;
    let side = if mean.x.abs() > mean.z.abs() { DVec3::X * mean.x.signum() } else { DVec3::Z * mean.z.signum() };
    (mean.dot(side) > 0.7).then_some(side)
}

/// A level floor, and the height of what is above it.
struct Floor {
    height: f64,
    headroom: f64,
}

impl Floor {
    /// The height at which most rays downwards from the middle height end on something level.
    fn find(scene: &Scene, bounds: &Aabb<f64>) -> Option<Self> {
        const GRID: usize = 16;
        let size = bounds.extent();
        let mut heights = Vec::new();
        let mut tops = Vec::new();
        for (i, j) in (0..GRID * GRID).map(|k| (k % GRID, k / GRID)) {
            let at = |k: usize| 0.2 + 0.6 * (k as f64 + 0.5) / GRID as f64;
            let origin = bounds.min + size * DVec3::new(at(i), 0.5, at(j));
            if let Some(hit) = scene.closest_hit(&Ray::new(origin, DVec3::NEG_Y))
                && hit.normal().y.abs() > 0.98
            {
                heights.push(origin.y - hit.t);
            }
            tops.extend(scene.closest_hit(&Ray::new(origin, DVec3::Y)).map(|hit| origin.y + hit.t));
        }
        heights.sort_by(f64::total_cmp);
        tops.sort_by(f64::total_cmp);
        let tolerance = 0.03 * size.y;
        // The lowest of the heights within the tolerance of which most others lie.
        let near = |h: f64| heights.iter().filter(|x| (0.0..=tolerance).contains(&(**x - h))).count();
        let (height, count) = heights.iter().map(|h| (*h, near(*h))).rev().max_by_key(|(_, n)| *n)?;
        let top = tops.get(tops.len() / 2).copied().unwrap_or(bounds.max.y);
        ((count as f64) >= FLOOR * (GRID * GRID) as f64).then_some(Self { height, headroom: top - height })
    }

    /// Eye height: a person's where lengths look like metres, else a fair share of the room's height.
    fn eye(&self) -> f64 {
        const PERSON: f64 = 1.7;
        let h = self.headroom;
        self.height + if (2.0..80.0).contains(&h) { PERSON.clamp(0.12 * h, 0.6 * h) } else { 0.4 * h }
    }
}

/// Stands where, and looks to where, there is the deepest view.
fn stand(scene: &Scene, bounds: &Aabb<f64>, floor: &Floor, closed: f64) -> Option<Hull> {
    const GRID: usize = 9;
    const FAN: usize = 32;
    /// By how many steps of the fan a direction is off the middle of the picture.
    const WEIGHTS: [f64; 5] = [1.0, 0.6, 0.5, 0.4, 0.3];
    let size = bounds.extent();
    let eye = floor.eye();
    let widest = size.x.max(size.z);
    let ahead = |k: usize| {
        let (x, z) = (TAU * k as f64 / FAN as f64).sin_cos();
        DVec3::new(x, 0.0, z)
    };
    let mut best: Option<(f64, DVec3, DVec3, f64)> = None;
    for (i, j) in (0..GRID * GRID).map(|k| (k % GRID, k / GRID)) {
        let at = |k: usize| 0.08 + 0.84 * k as f64 / (GRID - 1) as f64;
        let mut position = bounds.min + size * DVec3::new(at(i), 0.0, at(j));
        position.y = eye;
        // On the floor, not above a table or outside.
        let below = scene.closest_hit(&Ray::new(position, DVec3::NEG_Y)).map(|hit| eye - hit.t);
        if !below.is_some_and(|y| (y - floor.height).abs() <= 0.35 * (eye - floor.height)) {
            continue;
        }
        let views: [_; FAN] = std::array::from_fn(|k| scene.closest_hit(&Ray::new(position, ahead(k))));
        // Where a ray leaves the hull there is nothing to look at.
        let free = views.map(|hit| hit.map_or(0.0, |hit| hit.t.min(widest)));
        // Not inside a solid either, of which all sides are back sides.
        let back = (0..FAN).filter(|k| views[*k].is_some_and(|hit| hit.normal().dot(ahead(*k)) > 0.0)).count();
        if free.iter().any(|d| *d < 0.02 * widest) || 2 * back > FAN {
            continue;
        }
        for k in 0..FAN {
            // What is in the middle of the picture counts most; by the root, since what is near hides much.
            let depth: f64 = WEIGHTS
                .into_iter()
                .enumerate()
                .map(|(turn, weight)| weight * (free[(k + turn) % FAN].sqrt() + free[(k + FAN - turn) % FAN].sqrt()))
                .sum();
            if best.is_none_or(|(d, ..)| depth > d) {
                best = Some((depth, position, ahead(k), free[k]));
            }
        }
    }
    let (_, position, direction, distance) = best?;
    let camera = look(position, position + direction * (0.5 * distance), INSIDE_FOV);
    let reason = format!(
        "a hull ({:.0} % of the rays from its middle end inside): seen from within, {:.3} above the floor, along the \
         longest free way",
        100.0 * closed,
        eye - floor.height
    );
    Some(Hull::Room { camera, reason })
}

/// The i-th of n directions spread evenly over the sphere (a Fibonacci lattice).
fn spread(i: usize, n: usize) -> DVec3 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let y = 1.0 - (2 * i + 1) as f64 / n as f64;
    let (sin, cos) = (TAU * (i as f64 * GOLDEN).fract()).sin_cos();
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * sin, y, radius * cos)
}
