//! Vectors in lanes, by the operations of `glam` in their order.

use crate::simd::Numbers;

/// As many vectors as there are lanes.
pub(super) type Vectors<N> = [N; 3];

#[inline(always)]
pub(super) fn minus<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> Vectors<N> {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
pub(super) fn cross<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> Vectors<N> {
    [a[1].mul(b[2]).sub(b[1].mul(a[2])), a[2].mul(b[0]).sub(b[2].mul(a[0])), a[0].mul(b[1]).sub(b[0].mul(a[1]))]
}

#[inline(always)]
pub(super) fn dot<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> N {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}
