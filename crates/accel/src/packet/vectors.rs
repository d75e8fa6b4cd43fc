//! Vectors in eight lanes, by the operations of `glam` in their order.

use crate::simd::Eight;

/// Eight vectors.
pub(super) type Vectors<E> = [E; 3];

#[inline(always)]
pub(super) fn add<E: Eight>(a: Vectors<E>, b: Vectors<E>) -> Vectors<E> {
    [a[0].add(b[0]), a[1].add(b[1]), a[2].add(b[2])]
}

#[inline(always)]
pub(super) fn sub<E: Eight>(a: Vectors<E>, b: Vectors<E>) -> Vectors<E> {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
pub(super) fn scaled<E: Eight>(a: Vectors<E>, by: E) -> Vectors<E> {
    [a[0].mul(by), a[1].mul(by), a[2].mul(by)]
}

#[inline(always)]
pub(super) fn dot<E: Eight>(a: Vectors<E>, b: Vectors<E>) -> E {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}
