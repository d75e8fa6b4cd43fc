//! A block's four triangles at once, after the filter: where the ray meets them.
//!
//! Each lane does what the tier's scalar test does, in its order, so it has the same bits. Where that test would go
//! another way than the usual one (an edge function is 0, a plane is grazed), the lane is left to it.

use firsthit_geometry::triangle::Shear;

use super::vectors::{Vectors, cross, dot, minus};
use crate::kernel::{SLIVER, STEEP, behind};
use crate::layout::wide8::Block;
use crate::local::LocalRay;
use crate::simd::Doubles;

/// Where the ray meets four triangles.
pub(crate) struct Four<D> {
    /// In the object's space.
    pub(crate) t: D,
    /// Those of the second and third vertices, where the test in `f64` tells them.
    pub(crate) weights: [[f32; 4]; 2],
    /// Lanes for which this holds.
    pub(crate) sure: u32,
    /// Lanes without a hit. Those in neither mask are left to the scalar test.
    pub(crate) none: u32,
}

/// Where a ray meets four planes.
pub(crate) struct Planes<D> {
    pub(crate) t: D,
    /// Lanes whose `t` has the digits that were asked for.
    pub(crate) plain: u32,
    /// Lanes whose triangle certainly lies before the interval.
    pub(crate) before: u32,
}

/// As `kernel::plane`: each of its conditions, so that it is also known which way that would go.
#[inline(always)]
pub(crate) fn planes<D: Doubles>(block: &Block, ray: &LocalRay, loss: f64, from: f64) -> Planes<D> {
    let [a, b, c] = [vertex::<D>(block, 0), vertex::<D>(block, 1), vertex::<D>(block, 2)];
    let (e1, e2) = (minus(b, a), minus(c, a));
    let edges = dot(e1, e1).mul(dot(e2, e2));
    let normal = cross(e1, e2);
    let nn = dot(normal, normal);
    let along = dot(normal, splat(ray.direction.to_array()));
    let t = dot(normal, minus(a, splat(ray.origin.to_array()))).div(along);
    let steep = D::splat(SLIVER).mul(edges).lt(nn)
        & D::splat(STEEP).mul(nn.mul(D::splat(ray.length_squared))).lt(along.mul(along));
    let least = loss * ray.span;
    let long = edges.mul(D::splat(least * least)).lt(nn.mul(t.mul(t)));
    Planes { t, plain: steep & long, before: steep & !long & t.lt(D::splat(behind(ray, from))) }
}

/// `Shear::weights` in double precision: the weights, and as in [`Four`] the lanes of which it is known, or known that the
/// line misses them.
#[inline(always)]
pub(crate) fn sheared_double<D: Doubles>(
    block: &Block,
    ray: &LocalRay,
    shear: &Shear<f64>,
) -> ([[f32; 4]; 2], u32, u32) {
    let (x, y, z) = ([1, 2, 0, 0][shear.axis() & 3], [2, 0, 1, 0][shear.axis() & 3], [0, 1, 2, 2][shear.axis() & 3]);
    let o = ray.origin.to_array();
    let o = [D::splat(o[x]), D::splat(o[y]), D::splat(o[z])];
    let slopes = shear.slopes();
    let slopes = [D::splat(slopes.0), D::splat(slopes.1)];
    let [a, b, c] = [
        corner(&block.0[0], [x, y, z], o, slopes),
        corner(&block.0[1], [x, y, z], o, slopes),
        corner(&block.0[2], [x, y, z], o, slopes),
    ];
    let (e0, e1, e2) = (edge(c, b), edge(a, c), edge(b, a));
    let (zero, one) = (D::splat(0.0), D::splat(1.0));
    let inverse = one.div(e0.add(e1).add(e2));
    let below = e0.lt(zero) | e1.lt(zero) | e2.lt(zero);
    let above = zero.lt(e0) | zero.lt(e1) | zero.lt(e2);
    // Not 0: on either side of it, and finite.
    let edges = (e0.lt(zero) | zero.lt(e0)) & (e1.lt(zero) | zero.lt(e1)) & (e2.lt(zero) | zero.lt(e2));
    let usable = (inverse.lt(zero) & D::splat(f64::MIN).le(inverse)) | (zero.lt(inverse) & inverse.le(D::splat(f64::MAX)));
    let (u, v) = (e1.mul(inverse).min(one), e2.mul(inverse).min(one));
    ([u.narrow(), v.narrow()], edges & usable, below & above)
}

#[inline(always)]
fn corner<D: Doubles>(vertex: &[[f32; 4]; 3], [x, y, z]: [usize; 3], o: [D; 3], slopes: [D; 2]) -> [D; 2] {
    let (x, y, z) = (D::widen(&vertex[x]).sub(o[0]), D::widen(&vertex[y]).sub(o[1]), D::widen(&vertex[z]).sub(o[2]));
    [x.sub(slopes[0].mul(z)), y.sub(slopes[1].mul(z))]
}

#[inline(always)]
fn edge<D: Doubles>(p: [D; 2], q: [D; 2]) -> D {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}

#[inline(always)]
fn vertex<D: Doubles>(block: &Block, vertex: usize) -> Vectors<D> {
    let [x, y, z] = &block.0[vertex];
    [D::widen(x), D::widen(y), D::widen(z)]
}

#[inline(always)]
fn splat<D: Doubles>([x, y, z]: [f64; 3]) -> Vectors<D> {
    [D::splat(x), D::splat(y), D::splat(z)]
}
