//! A triangle against one ray, by tier, with no more work than it takes to tell where: the rest waits until it is known to
//! be the nearest.

use firsthit_geometry::triangle::Weights;
use glam::{DVec3, Vec3};

use super::enter::Entered;
use crate::kernel::{Fast, Kernel, MOST, Plane, Robust, Short, careful_plane, double, short_plane};
use crate::local::Line;
use crate::offer::within_triangle;
use crate::simd::Lanes;
use crate::wide::{Filter, Plain, Sheared};

/// Where a ray meets a triangle that has passed the filter.
pub(crate) enum Seen<K> {
    /// At this `t`, local and counted from the true origin, and from the moved one; with what is known then.
    At(f64, f32, K),
    Nowhere,
    /// The kernel has to tell.
    Unclear,
}

/// A tier whose single rays take the short way: the answers are those of its [`Kernel`], bit by bit.
pub(crate) trait Lean: Kernel {
    /// Boxes are met as if larger.
    const PADDED: bool;
    /// What picks from the triangles of a leaf.
    type Picks<L: Lanes>: Filter<L>;
    /// What is kept of a hit.
    type Kept: Copy + Default;
    fn picks<L: Lanes>(ray: &Entered<L>) -> Self::Picks<L>;
    /// `from`: start of the interval, local.
    fn seen<L: Lanes>(ray: &Entered<L>, triangle: &[Vec3; 3], known: [f32; 3], from: f64) -> Seen<Self::Kept>;
    /// Weights of the second and third vertex of a triangle that was seen, and a normal by winding.
    fn finish(triangle: &[Vec3; 3], known: [f32; 3], kept: Self::Kept) -> (f32, f32, DVec3);
}

/// As [`plane`](crate::kernel::plane) where the short way does not do. By value: what is passed by reference has to be kept in
/// memory by the caller, always. Not so rare, but cold: registers are for what lies around it.
#[cold]
#[inline(never)]
pub(crate) fn careful<const GRAZED: bool>(triangle: [Vec3; 3], line: Line) -> Option<Plane> {
    let mut plane = careful_plane(triangle, line, GRAZED)?;
    if GRAZED {
        plane.t = within_triangle(line, plane.t, triangle)?;
    }
    Some(plane)
}

/// Whether edge functions tell the weights: as of `Weights::told`, without its division. What is near the ends of what numbers
/// there are is not for here, nor where one is 0.
#[inline(always)]
pub(crate) fn tell([e0, e1, e2]: [f32; 3]) -> bool {
    (1e-36..=1e36).contains(&(e0 + e1 + e2).abs()) & (e0 != 0.0) & (e1 != 0.0) & (e2 != 0.0)
}

impl Lean for Fast {
    const PADDED: bool = false;
    type Picks<L: Lanes> = Plain<L>;
    type Kept = ();

    #[inline(always)]
    fn picks<L: Lanes>(ray: &Entered<L>) -> Plain<L> {
        Plain::in_lanes(ray.origin, ray.direction)
    }

    #[inline(always)]
    fn seen<L: Lanes>(ray: &Entered<L>, _: &[Vec3; 3], [t, ..]: [f32; 3], _: f64) -> Seen<()> {
        Seen::At(f64::from(t) + ray.line.shift, t, ())
    }

    #[inline(always)]
    fn finish(triangle: &[Vec3; 3], [_, u, v]: [f32; 3], (): ()) -> (f32, f32, DVec3) {
        let [a, b, c] = double(triangle);
        (u, v, (b - a).cross(c - a))
    }
}

impl Lean for Robust {
    const PADDED: bool = true;
    type Picks<L: Lanes> = Sheared<L>;
    /// The normal: the plane has told it.
    type Kept = DVec3;

    #[inline(always)]
    fn picks<L: Lanes>(ray: &Entered<L>) -> Sheared<L> {
        Sheared::new(ray.origin, ray.direction, 0.0, 2.0 * ray.delta)
    }

    #[inline(always)]
    fn seen<L: Lanes>(ray: &Entered<L>, triangle: &[Vec3; 3], known: [f32; 3], from: f64) -> Seen<DVec3> {
        if !tell(known) {
            return Seen::Unclear;
        }
        let plane = match short_plane(triangle, &ray.line, MOST, from) {
            Short::Met(plane) => Some(plane),
            Short::Before => None,
            Short::Grazed => careful::<true>(*triangle, ray.line),
            Short::Lost => careful::<false>(*triangle, ray.line),
        };
        plane.map_or(Seen::Nowhere, |p| Seen::At(p.t, (p.t - ray.line.shift) as f32, p.normal))
    }

    #[inline(always)]
    fn finish(_: &[Vec3; 3], known: [f32; 3], normal: DVec3) -> (f32, f32, DVec3) {
        let Weights { u, v } = Weights::told::<true>(known).unwrap_or(Weights { u: 0.0, v: 0.0 });
        (u, v, normal)
    }
}
