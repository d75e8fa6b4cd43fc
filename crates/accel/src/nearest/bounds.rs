//! Bounds on distances from a point, of eight boxes or triangles at once: squared, in single precision.
//!
//! No closures and no `map` here: what is not inlined into the function compiled for the level is slow.

use glam::Vec3;

use crate::simd::Lanes;
use crate::wide::Leaf;

/// A point in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct Point<L>(pub(super) [L; 3]);

/// Products of a few numbers that are rounded once or twice each are off by less than this part of the sizes that went in.
const OFF: f32 = 1.0 / (1 << 18) as f32;

/// Triangles of less (four times their squared area) are near any point: what is divided by them might be anything.
const FLAT: f32 = 1e-30;

impl<L: Lanes> Point<L> {
    #[inline(always)]
    pub(super) fn new(p: Vec3) -> Self {
        Self([L::splat(p.x), L::splat(p.y), L::splat(p.z)])
    }

    /// Squared distances of the point from eight boxes. Rounded: some three parts in a million off.
    #[inline(always)]
    pub(super) fn to_boxes(self, low: [L; 3], high: [L; 3]) -> L {
        let zero = L::splat(0.0);
        let [x, y, z] = self.0;
        let dx = low[0].sub(x).max(x.sub(high[0])).max(zero);
        let dy = low[1].sub(y).max(y.sub(high[1])).max(zero);
        let dz = low[2].sub(z).max(z.sub(high[2])).max(zero);
        dz.mul_add(dz, dy.mul_add(dy, dx.mul(dx)))
    }

    /// Numbers that are not above the squared distances of the point from the triangles of a leaf (with the same room for
    /// rounding as above), NaN where that is not known.
    ///
    /// The distance from a triangle's plane is never above that from the triangle. Where the point's foot is outside of it
    /// for certain, the nearest of its edges tells. The bound on what is rounded grows as the triangle gets thinner.
    #[inline(always)]
    pub(super) fn to_triangles(self, leaf: &impl Leaf) -> L {
        let a = [leaf.load::<L>(0, 0), leaf.load::<L>(0, 1), leaf.load::<L>(0, 2)];
        let b = [leaf.load::<L>(1, 0), leaf.load::<L>(1, 1), leaf.load::<L>(1, 2)];
        let c = [leaf.load::<L>(2, 0), leaf.load::<L>(2, 1), leaf.load::<L>(2, 2)];
        let (q, r, s) = (sub(self.0, a), sub(self.0, b), sub(self.0, c));
        let (e, f, g) = (sub(b, a), sub(c, a), sub(c, b));
        let (ee, ff, ef) = (dot(e, e), dot(f, f), dot(e, f));
        let (qe, qf) = (dot(q, e), dot(q, f));
        let size = dot(q, q).max(dot(r, r)).max(dot(s, s));
        let n = cross(e, f);
        let (nn, h) = (dot(n, n), dot(n, q));

        // Of the plane: what is rounded is some 8u |e| |f| |q|, so its square is below 2^-36 of those.
        let most = ee.mul(ff);
        let room = most.mul(size).mul(L::splat(OFF));
        let plane = h.mul_sub(h, room).div(nn);

        // Of the edges.
        let (ab, ac) = (along(q, e, qe.div(ee)), along(q, f, qf.div(ff)));
        let bc = along(r, g, dot(r, g).div(dot(g, g)));
        let edges = ab.min(ac).min(bc).sub(size.mul(L::splat(OFF)));

        // Weights of the foot, times the squared area: signs that are certain. What is rounded is some 8u |e| |f|^2 |q| and
        // the like.
        let v = ff.mul(qe).sub(ef.mul(qf));
        let w = ee.mul(qf).sub(ef.mul(qe));
        let u = nn.sub(v).sub(w);
        let (lq, le, lf) = (length(q), length(e), length(f));
        let noise = ff.mul(le).max(ee.mul(lf)).mul(lq.add(le).add(lf)).mul(L::splat(-OFF));
        let outside = v.min(w).min(u).le(noise);
        let bound = edges.choose(outside, plane);
        bound.choose(L::splat(FLAT).le(nn), L::splat(f32::NAN))
    }
}

/// Squared length of `q` less what of it lies along `e`, up to its end; `t` is how far that is.
#[inline(always)]
fn along<L: Lanes>(q: [L; 3], e: [L; 3], t: L) -> L {
    let t = t.max(L::splat(0.0)).min(L::splat(1.0));
    let d = [q[0].sub(t.mul(e[0])), q[1].sub(t.mul(e[1])), q[2].sub(t.mul(e[2]))];
    dot(d, d)
}

/// At least as large as the length, and less than twice that.
#[inline(always)]
fn length<L: Lanes>(a: [L; 3]) -> L {
    a[0].abs().add(a[1].abs()).add(a[2].abs())
}

#[inline(always)]
fn sub<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

#[inline(always)]
fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1].mul(b[2]).sub(a[2].mul(b[1])), a[2].mul(b[0]).sub(a[0].mul(b[2])), a[0].mul(b[1]).sub(a[1].mul(b[0]))]
}
