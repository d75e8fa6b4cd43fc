//! One ray's way into a mesh: what [`LocalRay`] is, with all axes side by side, and made no larger than a query of one tier
//! needs.
//!
//! The first test of boxes waits for this, so what it needs is worked out by the shortest chains of operations: reciprocals of the
//! direction before it is scaled, boxes that are met as if larger by no less than is needed, but by the same for all rays that
//! start nearby. What comes later (the scaled direction, the line in double precision) is worked out beside.

use firsthit_geometry::{Ray, transform::Transform};
use glam::{DVec3, Vec3};

use crate::local::{Extent, Line, LocalRay, OFF, slack};
use crate::scene::is_interval;
use crate::simd::{Four, Lanes};
use crate::wide::{FARTHEST, SMALLEST, in_lanes};

/// A ray in an object's normalised space. What is the same as in a [`LocalRay`] has the same bits: it comes from the operations of
/// [`LocalRay::enter`] in their order.
#[derive(Clone, Copy)]
pub(crate) struct Entered<L: Lanes> {
    pub(crate) line: Line,
    pub(crate) t_scale: f64,
    pub(crate) t_unscale: f64,
    /// Not below [`LocalRay::delta`].
    pub(crate) delta: f32,
    /// Origin and direction in single precision, in the first three lanes.
    pub(crate) origin: L,
    pub(crate) direction: L,
    /// Reciprocals of the direction, finite.
    pub(crate) inverse: L,
    /// The boxes' interval.
    pub(crate) interval: [f32; 2],
    /// How far moving the origin may put the end of the boxes' interval off.
    slack: f32,
}

/// Directions whose largest component lies between this and its reciprocal have room for reciprocals before they are
/// scaled.
const LEAST: f64 = 1.0 / (1u32 << 20) as f64;

/// The last lane is of no use.
#[inline(always)]
pub(crate) fn four<F: Four>(v: DVec3) -> F {
    F::new(v.x, v.y, v.z, v.z)
}

#[inline(always)]
fn three<F: Four>(v: F) -> DVec3 {
    let [x, y, z, _] = v.store();
    DVec3::new(x, y, z)
}

/// Finite reciprocals of a direction whose smallest components are taken to be `smallest`.
#[inline(always)]
pub(crate) fn reciprocals<L: Lanes>(direction: L, smallest: f32) -> L {
    L::splat(1.0).div(direction.abs().max(L::splat(smallest)).turned_by(direction))
}

/// By how much boxes are met as if larger by a ray that starts so far `apart` from an object's centre, with a direction of this
/// `size`, in each axis. `None` if it starts far away, or if its largest component does not lie between `least` and its reciprocal.
#[inline(always)]
pub(crate) fn delta_of<F: Four>(apart: F, size: F, least: f64, object: &Extent) -> Option<f32> {
    let [(far, delta), (near, least_delta)] = object.bounds_of_rays();
    let here = apart.le(F::splat(far)) & size.le(F::splat(1.0 / least));
    if !(here & 7 == 7 && F::splat(least).le(size) & 7 != 0) {
        return None;
    }
    Some(if apart.le(F::splat(near)) & 7 == 7 { least_delta } else { delta })
}

impl<L: Lanes> Entered<L> {
    /// `None` as of [`LocalRay::enter`], and for an interval that is none.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray<f64>, transform: &Transform, object: &Extent) -> Option<Self> {
        if !is_interval(ray) {
            return None;
        }
        let (origin, direction): (L::Four, L::Four) = if transform.is_uniform() {
            let scale = L::Four::splat(transform.inverse_linear().x_axis.x);
            let from: L::Four = four(ray.origin);
            let along: L::Four = four(ray.direction);
            (from.sub(four(transform.translation())).mul(scale), along.mul(scale))
        } else {
            (four(transform.point_to_object(ray.origin)), four(transform.vector_to_object(ray.direction)))
        };
        let (center, _, half) = object.parts();
        let center: L::Four = L::Four::new(center[0], center[1], center[2], center[2]);
        let (apart, size) = (origin.sub(center).abs(), direction.abs());
        let Some(delta) = delta_of(apart, size, LEAST, object) else { return Self::rare(ray, transform, object) };
        let (scale, unscale) = size.powers();
        let scale32 = L::narrow_four(scale);
        // Of what is smaller than `SMALLEST`, once it is scaled, that reciprocal is taken that `Boxes` would take.
        let short = L::narrow_four(direction);
        let inverse = reciprocals(short.abs(), SMALLEST * LEAST as f32).mul(scale32);
        let inverse = inverse.min(L::splat(1.0 / SMALLEST)).turned_by(short);
        let direction = direction.mul(unscale);
        let ends = L::narrow_four(L::Four::new(ray.t_min, ray.t_max, ray.t_min, ray.t_max)).mul(scale32);
        let out = ends.abs().mul(L::load(&[-OFF, OFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let [start, end, ..] = ends.add(out).store();
        let (line, farthest) = (three(direction), apart.largest() + half);
        let [t_scale, ..] = scale.store();
        let [t_unscale, ..] = unscale.store();
        Some(Self {
            line: Line {
                origin: three(origin),
                direction: line,
                length_squared: line.length_squared(),
                span: farthest,
                shift: 0.0,
                farthest,
                off: 0.0,
            },
            t_scale,
            t_unscale,
            delta,
            origin: L::narrow_four(origin),
            direction: L::narrow_four(direction),
            inverse,
            interval: [start, end],
            slack: 0.0,
        })
    }

    /// A ray that starts far away, or has a direction that is very short or long, or is none.
    #[inline(always)]
    fn rare(ray: &Ray<f64>, transform: &Transform, object: &Extent) -> Option<Self> {
        let ray = careful(*ray, transform, object)?;
        let direction: L = in_lanes(ray.direction32);
        Some(Self {
            line: ray.line(),
            t_scale: ray.t_scale,
            t_unscale: ray.t_unscale,
            delta: ray.delta.min(FARTHEST),
            origin: in_lanes(ray.origin32.clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST))),
            direction,
            inverse: reciprocals(direction, SMALLEST),
            interval: [ray.box_t_min(ray.world[0]), ray.box_t_max(ray.world[1])],
            slack: slack(ray.shift),
        })
    }

    /// The end of the boxes' interval for a hit at this distance, local and counted from the moved origin.
    #[inline(always)]
    pub(super) fn end(&self, t: f32) -> f32 {
        t + (t.abs() * OFF + self.slack)
    }
}

#[cold]
#[inline(never)]
fn careful(ray: Ray<f64>, transform: &Transform, object: &Extent) -> Option<LocalRay> {
    LocalRay::enter(&ray, transform, object)
}
