//! tinybvh through the crate tinybvh-rs, which compiles it for the processor at hand. Its fastest tree, of eight children,
//! is offered only where Rust too is compiled for AVX2 (`RUSTFLAGS="-C target-cpu=native"`). Otherwise this is its binary
//! tree, which through this crate gives wrong answers on some meshes: to 18 % of the primary rays at a scan of 69,451
//! triangles, with spatial splits and without, but to none at a room of 66,450; the column of wrong answers tells. The
//! crate has no query for any hit: that is a closest hit within the interval.

use std::sync::Arc;
use std::time::Instant;

use firsthit_measure::mesh::Mesh;
use tinybvh_rs::{INFINITE, Intersection, Intersector, Ray, bvh};

use super::{Answer, Peer, Ray32};

#[cfg(target_feature = "avx2")]
type Tree = tinybvh_rs::bvh8_cpu::BVH;
#[cfg(not(target_feature = "avx2"))]
type Tree = bvh::BVH<'static>;

/// A tree of tinybvh.
pub struct Tiny {
    // Before the corners, which it may refer to: fields are dropped in this order.
    tree: Tree,
    _corners: Arc<[[f32; 4]]>,
}

// SAFETY: queries only read the tree, and it is not changed after it was built.
unsafe impl Send for Tiny {}
// SAFETY: as above.
unsafe impl Sync for Tiny {}

/// C++ wants it aligned so.
#[repr(align(64))]
struct Aligned(Ray);

impl Tiny {
    /// Builds the tree, on one thread: also the seconds that it took and the bytes that it holds, a copy of all corners
    /// included.
    ///
    /// # Errors
    /// When tinybvh refuses the mesh.
    pub fn new(mesh: &Mesh) -> Result<(Self, f64, u64), String> {
        let before = in_use();
        let start = Instant::now();
        let corner = |&i: &u32| mesh.positions[i as usize].extend(0.0).to_array();
        let corners: Arc<[[f32; 4]]> = mesh.triangles.iter().flatten().map(corner).collect();
        // SAFETY: the tree is dropped before its corners, which do not move within the `Arc`.
        let lasting: &'static [[f32; 4]] = unsafe { std::slice::from_raw_parts(corners.as_ptr(), corners.len()) };
        let tree = build(lasting).map_err(|e| format!("tinybvh: {e:?}"))?;
        let seconds = start.elapsed().as_secs_f64();
        Ok((Self { tree, _corners: corners }, seconds, in_use().saturating_sub(before)))
    }
}

#[cfg(target_feature = "avx2")]
fn build(corners: &'static [[f32; 4]]) -> Result<Tree, tinybvh_rs::Error> {
    let mut binary = bvh::BVH::new(corners.into())?;
    binary.split_leaves(4);
    Tree::new(&tinybvh_rs::mbvh::BVH::new(&binary))
}

#[cfg(not(target_feature = "avx2"))]
fn build(corners: &'static [[f32; 4]]) -> Result<Tree, tinybvh_rs::Error> {
    Tree::new(corners.into())
}

/// Bytes that C's allocator has given out, to Rust and C++.
fn in_use() -> u64 {
    // SAFETY: it only counts.
    let info = unsafe { libc::mallinfo2() };
    (info.uordblks + info.hblkhd) as u64
}

impl Peer for Tiny {
    #[inline(always)]
    fn closest(&self, r: &Ray32) -> Option<Answer> {
        // As tinybvh does it: no direction is quite 0.
        let inverse = |x: f32| if x.abs() < 1e-12 { INFINITE.copysign(x) } else { 1.0 / x };
        let mut ray = Aligned(Ray {
            origin: r.origin.to_array(),
            padding_0: 0xffff,
            dir: r.direction.to_array(),
            padding_1: 0,
            r_d: r.direction.to_array().map(inverse),
            padding_2: 0,
            hit: Intersection { t: r.t_max.min(INFINITE), u: 0.0, v: 0.0, prim: u32::MAX },
        });
        self.tree.intersect(&mut ray.0);
        let hit = ray.0.hit;
        let found = hit.prim != u32::MAX;
        found.then_some(Answer { t: f64::from(hit.t), triangle: hit.prim, u: hit.u, v: hit.v })
    }

    #[inline(always)]
    fn any(&self, ray: &Ray32) -> bool {
        self.closest(ray).is_some()
    }
}
