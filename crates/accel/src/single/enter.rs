//! One ray's way into a mesh: what [`LocalRay`] is, with all axes side by side, and made no larger than a query of one tier
//! needs.

use firsthit_geometry::{Ray, Real, transform::Transform};
use glam::DVec3;

use crate::local::{Extent, FAR, Line, U, delta, far, scales};
use crate::scene::is_interval;
use crate::simd::{Four, Lanes};

/// A ray in an object's normalised space. What is the same as in a [`LocalRay`](crate::local::LocalRay) has the same bits:
/// it comes from the operations of [`LocalRay::enter`](crate::local::LocalRay::enter) in their order.
#[derive(Clone, Copy)]
pub(crate) struct Entered<L: Lanes> {
    pub(super) line: Line,
    pub(super) t_scale: f64,
    pub(super) t_unscale: f64,
    /// By how much boxes are to be met as if larger.
    pub(super) delta: f32,
    /// Origin and direction in single precision, in the first three lanes.
    pub(super) origin: L,
    pub(super) direction: L,
    /// The boxes' interval.
    pub(super) interval: [f32; 2],
}

#[inline(always)]
fn four<F: Four>(v: DVec3) -> F {
    F::new(v.x, v.y, v.z, 0.0)
}

#[inline(always)]
fn three<F: Four>(v: F) -> DVec3 {
    let [x, y, z, _] = v.store();
    DVec3::new(x, y, z)
}

impl<L: Lanes> Entered<L> {
    /// `None` as of [`LocalRay::enter`](crate::local::LocalRay::enter), and for an interval that is none.
    #[inline(always)]
    pub(super) fn new(ray: &Ray<f64>, transform: &Transform, object: &Extent) -> Option<Self> {
        let (center, magnitude, half) = object.parts();
        let (origin, direction) = if transform.is_uniform() {
            let scale = L::Four::splat(transform.inverse_linear().x_axis.x);
            let origin: L::Four = four(ray.origin);
            let direction: L::Four = four(ray.direction);
            (origin.sub(four(transform.translation())).mul(scale), direction.mul(scale))
        } else {
            (four(transform.point_to_object(ray.origin)), four(transform.vector_to_object(ray.direction)))
        };
        let most = L::Four::splat(f64::MAX);
        let finite = origin.abs().le(most) & direction.abs().le(most);
        if !(finite & 7 == 7 && is_interval(ray)) {
            return None;
        }
        let (t_scale, t_unscale) = scales(direction.abs().largest())?;
        let direction = direction.mul(L::Four::splat(t_unscale));
        let line = three(direction);
        let (mut moved, mut shift, mut off) = (origin, 0.0, 0.0);
        let center: L::Four = L::Four::new(center[0], center[1], center[2], 0.0);
        let relative = origin.sub(center);
        let mut farthest = relative.abs().largest() + half;
        if farthest > (FAR + 1.0) * half {
            (shift, off) = far(three(relative), line, half);
            moved = origin.add(direction.mul(L::Four::splat(shift)));
            farthest = moved.sub(center).abs().largest() + half;
        }
        // `LocalRay::box_t` of both ends.
        let local = L::Four::new(ray.t_min, ray.t_max, 0.0, 0.0).mul(L::Four::splat(t_scale));
        let from_moved = local.sub(L::Four::splat(shift));
        let rounded = local.abs().add(L::Four::splat(shift.abs())).mul(L::Four::splat(16.0 * f64::UNIT_ROUNDOFF));
        let error = from_moved.abs().mul(L::Four::splat(16.0 * U)).add(rounded);
        let [start, end, ..] = L::narrow_four(from_moved.add(L::Four::new(-1.0, 1.0, 0.0, 0.0).mul(error))).store();
        Some(Self {
            line: Line {
                origin: three(origin),
                direction: line,
                length_squared: line.length_squared(),
                span: farthest + 2.0 * shift.abs(),
                shift,
                farthest,
                off,
            },
            t_scale,
            t_unscale,
            delta: delta(farthest, magnitude, off).to_f32(),
            origin: L::narrow_four(moved),
            direction: L::narrow_four(direction),
            interval: [start, end],
        })
    }
}
