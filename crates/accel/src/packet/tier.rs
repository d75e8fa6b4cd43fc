//! A triangle against eight rays, by tier.
//!
//! Each lane does the operations of the tier's [`Kernel`] in their order: the same decisions and the same bits. What is
//! rare is left to the kernel itself.

use firsthit_geometry::{
    Real,
    triangle::{self, Weights},
};
use glam::{DVec3, Vec3};

use super::group::{Doubles, Group};
use super::vectors::{self, Vectors};
use crate::kernel::{Fast, Found, MOST, Robust, SLIVER, STEEP, double, plane};
use crate::local::{LocalRay, U};
use crate::simd::{Eight, Lanes};
use crate::single::Lean;
use crate::wide::{Filter, Plain, Sheared};

/// The way that the rays of a packet go.
#[derive(Clone, Copy)]
pub(crate) struct Way {
    pub(super) negative: [bool; 3],
    /// The sheared axes, and that which they follow most.
    pub(super) axes: [usize; 3],
}

/// What eight rays know of one triangle after the filter: as [`Known`](crate::wide::Known).
pub(crate) type Known<L> = [L; 3];

/// Where eight rays meet one triangle.
pub(crate) struct Met<L: Lanes> {
    pub(super) t: L::Eight,
    pub(super) u: L,
    pub(super) v: L,
    /// By winding, of any length.
    pub(super) normal: Vectors<L::Eight>,
    /// Lanes for which this holds.
    pub(super) plain: u32,
    /// Lanes for which the kernel has to tell.
    pub(super) unclear: u32,
}

/// A tier whose rays go in packets.
pub(crate) trait Tier: Lean {
    /// The filter of one ray for eight triangles.
    type One<L: Lanes>: Filter<L>;
    fn one<L: Lanes>(group: &Group, way: &Way, lane: usize) -> Self::One<L>;
    /// The same filter of eight rays for one triangle.
    fn candidates<L: Lanes>(group: &Group, way: &Way, triangle: &[Vec3; 3]) -> (u32, Known<L>);
    /// The kernel's test of a triangle that passed the filter of one ray; `None` if only the kernel itself can tell.
    fn meet_one(ray: &LocalRay, triangle: &[Vec3; 3], known: [f32; 3]) -> Option<Option<Found>>;
    /// The kernel's test of a triangle that passed the filter of the rays in the mask.
    fn meet<L: Lanes>(group: &Group, way: &Way, triangle: &[Vec3; 3], mask: u32, known: Known<L>) -> Met<L>;
}

/// A vertex in the sheared plane of each ray, and its depth.
#[inline(always)]
fn corner<L: Lanes>(group: &Group, axes: [usize; 3], p: Vec3) -> [L; 3] {
    let p = [p.x, p.y, p.z];
    let x = L::splat(p[axes[0]]).sub(L::load(&group.sheared[0]));
    let y = L::splat(p[axes[1]]).sub(L::load(&group.sheared[1]));
    let z = L::splat(p[axes[2]]).sub(L::load(&group.sheared[2]));
    [x.sub(L::load(&group.slopes[0]).mul(z)), y.sub(L::load(&group.slopes[1]).mul(z)), z]
}

#[inline(always)]
fn edge<L: Lanes>(p: [L; 3], q: [L; 3]) -> L {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}

#[inline(always)]
fn load<L: Lanes>([x, y, z]: &[Doubles; 3]) -> Vectors<L::Eight> {
    [L::Eight::load(x), L::Eight::load(y), L::Eight::load(z)]
}

/// The same for all rays.
#[inline(always)]
fn all<E: Eight>(v: DVec3) -> Vectors<E> {
    [E::splat(v.x), E::splat(v.y), E::splat(v.z)]
}

/// `t` with all digits and within the triangle's box, as `kernel::careful_plane` and
/// [`Line::within_box`](crate::local::Line::within_box) do it, and the lanes in which there is one.
#[inline(always)]
fn graze<L: Lanes>(group: &Group, way: &Way, corners: [DVec3; 3]) -> (L::Eight, u32) {
    let of = L::Eight::splat;
    let (origin, direction) = (load::<L>(&group.origin), load::<L>(&group.direction));
    // `triangle::plane_parameter`.
    let n = all(triangle::area_vector(corners));
    let [a, b, c] = corners;
    let r = [vectors::sub(all(a), origin), vectors::sub(all(b), origin), vectors::sub(all(c), origin)];
    let l = [vectors::dot(r[0], r[0]), vectors::dot(r[1], r[1]), vectors::dot(r[2], r[2])];
    let (first, second) = (l[0].le(l[1]) & l[0].le(l[2]), l[1].le(l[2]));
    let mut near = r[2];
    for axis in 0..3 {
        near[axis] = r[0][axis].select(first, r[1][axis].select(second, near[axis]));
    }
    let t = vectors::dot(n, near).div(vectors::dot(n, direction));
    let finite = t.abs().le(of(f64::MAX));

    // `Line::within_box`.
    let (low, high) = (a.min(b).min(c).to_array(), a.max(b).max(c).to_array());
    let shift = L::Eight::load(&group.shift);
    let off = shift.abs().mul(of(32.0 * f64::UNIT_ROUNDOFF));
    let common = of(8.0 * U).mul(L::Eight::load(&group.farthest)).add(off);
    let (mut enter, mut leave) = (of(f64::NEG_INFINITY), of(f64::INFINITY));
    for axis in 0..3 {
        let moved = origin[axis].add(direction[axis].mul(shift));
        let reach = moved.abs().mul(of(U)).add(common);
        let (low, high) = (of(low[axis]).sub(reach), of(high[axis]).add(reach));
        let (entry, exit) = if way.negative[axis] { (high, low) } else { (low, high) };
        let inverse = of(1.0).div(direction[axis]);
        // What is not a number is dropped.
        enter = entry.sub(moved).mul(inverse).max(enter);
        leave = exit.sub(moved).mul(inverse).min(leave);
    }
    let pad = 2.0 * <f64 as Real>::gamma(4);
    let leave = leave.mul(of(1.0 + pad)).max(leave.mul(of(1.0 - pad)));
    (t.min(leave.add(shift)).max(enter.add(shift)), finite & enter.le(leave))
}

impl Tier for Robust {
    type One<L: Lanes> = Sheared<L, false>;

    #[inline(always)]
    fn one<L: Lanes>(group: &Group, way: &Way, lane: usize) -> Sheared<L, false> {
        let origin = [group.sheared[0][lane], group.sheared[1][lane], group.sheared[2][lane]];
        let slopes = [group.slopes[0][lane], group.slopes[1][lane]];
        Sheared::known(origin, way.axes, slopes, group.direction32[way.axes[2]][lane], 2.0 * group.delta[lane])
    }

    #[inline(always)]
    fn candidates<L: Lanes>(group: &Group, way: &Way, triangle: &[Vec3; 3]) -> (u32, Known<L>) {
        let [a, b, c] = triangle;
        let (a, b, c) =
            (corner::<L>(group, way.axes, *a), corner::<L>(group, way.axes, *b), corner::<L>(group, way.axes, *c));
        let [e0, e1, e2] = [edge(c, b), edge(a, c), edge(b, a)];
        let zero = L::splat(0.0);
        let hit = zero.le(e0.min(e1).min(e2)) | e0.max(e1).max(e2).le(zero);
        (hit & group.awake, [e0, e1, e2])
    }

    #[inline(always)]
    fn meet_one(ray: &LocalRay, triangle: &[Vec3; 3], known: [f32; 3]) -> Option<Option<Found>> {
        let w = Weights::told::<true>(known)?;
        Some(plane(triangle, &ray.line(), MOST, ray.t_min).map(|plane| plane.at(w.u, w.v)))
    }

    #[inline(always)]
    fn meet<L: Lanes>(group: &Group, way: &Way, triangle: &[Vec3; 3], mask: u32, [e0, e1, e2]: Known<L>) -> Met<L> {
        // `Weights::told`.
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let inverse = one.div(e0.add(e1).add(e2));
        let size = inverse.abs();
        let usable = size.le(L::splat(f32::MAX)) & !size.le(zero);
        let told = usable & !(e0.abs().min(e1.abs()).min(e2.abs()).le(zero));
        let (u, v) = (e1.mul(inverse).min(one), e2.mul(inverse).min(one));

        // `kernel::plane`: what is the triangle's alone, then by rays.
        let of = L::Eight::splat;
        let corners = double(triangle);
        let [a, b, c] = corners;
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let nn = normal.length_squared();
        let edges = e1.length_squared() * e2.length_squared();
        let (origin, direction) = (load::<L>(&group.origin), load::<L>(&group.direction));
        let mut n = all(normal);
        let along = vectors::dot(n, direction);
        let mut t = vectors::dot(n, vectors::sub(all(a), origin)).div(along);
        let dd = L::Eight::load(&group.length_squared);
        let steep = of(STEEP).mul(of(nn).mul(dd)).lt(along.mul(along));
        let span = L::Eight::load(&group.span);
        let least = of(MOST).mul(span);
        let long = of(edges).mul(least.mul(least)).lt(of(nn).mul(t.mul(t)));
        let steep = if nn > SLIVER * edges { steep } else { 0 };
        let from = L::Eight::load(&group.local_t_min).sub(span.mul(of(1.0 / (1u64 << 26) as f64)));
        let mut nothing = steep & !long & t.lt(from);
        let mut plain = steep & long & told;
        let grazing = mask & told & !steep;
        if grazing != 0 {
            let (found, lanes) = graze::<L>(group, way, corners);
            t = found.select(grazing, t);
            let other: Vectors<L::Eight> = all(triangle::area_vector(corners));
            n = [other[0].select(grazing, n[0]), other[1].select(grazing, n[1]), other[2].select(grazing, n[2])];
            plain |= grazing & lanes;
            nothing |= grazing & !lanes;
        }
        let t = t.mul(L::Eight::load(&group.t_unscale));
        Met { t, u, v, normal: n, plain, unclear: !(plain | nothing) }
    }
}

#[inline(always)]
fn splat<L: Lanes>(v: Vec3) -> [L; 3] {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}
#[inline(always)]
fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1].mul(b[2]).sub(b[1].mul(a[2])), a[2].mul(b[0]).sub(b[2].mul(a[0])), a[0].mul(b[1]).sub(b[0].mul(a[1]))]
}
#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

impl Tier for Fast {
    type One<L: Lanes> = Plain<L, false>;

    #[inline(always)]
    fn one<L: Lanes>(group: &Group, _: &Way, lane: usize) -> Plain<L, false> {
        let ([x, y, z], d) = (&group.origin32, &group.direction32);
        Plain::new(Vec3::new(x[lane], y[lane], z[lane]), Vec3::new(d[0][lane], d[1][lane], d[2][lane]))
    }

    /// As the filter `Plain`.
    #[inline(always)]
    fn candidates<L: Lanes>(group: &Group, _: &Way, triangle: &[Vec3; 3]) -> (u32, Known<L>) {
        let [v0, v1, v2] = *triangle;
        let (e1, e2) = (splat::<L>(v1 - v0), splat::<L>(v2 - v0));
        let [x, y, z] = &group.direction32;
        let direction = [L::load(x), L::load(y), L::load(z)];
        let [x, y, z] = &group.origin32;
        let s = [L::load(x).sub(L::splat(v0.x)), L::load(y).sub(L::splat(v0.y)), L::load(z).sub(L::splat(v0.z))];
        let p = cross(direction, e2);
        let det = dot(e1, p);
        let q = cross(s, e1);
        let (u, v) = (dot(s, p), dot(direction, q));
        let (a, b, zero) = (u.turned_by(det), v.turned_by(det), L::splat(0.0));
        let inside = zero.le(a) & zero.le(b) & a.add(b).le(det.abs()) & group.awake;
        if inside == 0 {
            return (0, [zero; 3]);
        }
        let inverse = L::splat(1.0).div(det);
        let t = dot(e2, q).mul(inverse);
        let within = L::load(&group.start).le(t) & t.le(L::load(&group.end));
        (inside & within, [t, u.mul(inverse), v.mul(inverse)])
    }

    #[inline(always)]
    fn meet_one(ray: &LocalRay, triangle: &[Vec3; 3], known: [f32; 3]) -> Option<Option<Found>> {
        Some(Some(Self::found(known, ray, triangle)))
    }

    #[inline(always)]
    fn meet<L: Lanes>(group: &Group, _: &Way, triangle: &[Vec3; 3], _: u32, [t, u, v]: Known<L>) -> Met<L> {
        let [a, b, c] = double(triangle);
        let normal = (b - a).cross(c - a);
        let t = L::widen(t).add(L::Eight::load(&group.shift)).mul(L::Eight::load(&group.t_unscale));
        Met { t, u, v, normal: all(normal), plain: !0, unclear: 0 }
    }
}
