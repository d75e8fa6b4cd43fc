//! Would the clustering stall?
//!
//! PLOC sorts boxes along a Morton curve and then, round by round, joins pairs that are each other's nearest. Where
//! distances are equal (a row of equal things) or grow steadily (coincident and concentric triangles), every box
//! prefers the same side and one pair is joined a round: quadratic time, and a list for a tree. Measured with obvhs: 13 s
//! for a row of 20,000. A dry run that looks at direct neighbours only tells beforehand, at a few percent of the cost.

use firsthit_geometry::Aabb;
use glam::Vec3;
use rayon::prelude::*;

/// Fewer boxes than this may be joined as slowly as they like.
const HARMLESS: usize = 1024;
/// In a round at least one in so many boxes must find a partner; at random it is one in three.
const SLOWEST: usize = 64;

/// Whether joining these boxes by pairs of nearest neighbours would stall.
pub(super) fn stalls(boxes: &[Aabb<f32>]) -> bool {
    if boxes.len() <= HARMLESS {
        return false;
    }
    let mut current = sorted(boxes);
    let mut next = Vec::with_capacity(current.len());
    while current.len() > HARMLESS {
        let cost = |i: usize| {
            let e = current[i].union(current[i + 1]).extent();
            e.x * e.y + e.y * e.z + e.z * e.x
        };
        let mut i = 0;
        let mut before = f32::INFINITY;
        while i + 1 < current.len() {
            let here = cost(i);
            let after = if i + 2 < current.len() { cost(i + 1) } else { f32::INFINITY };
            // i prefers i + 1 (to the right if equal), and i + 1 prefers i.
            if before >= here && here < after {
                next.push(current[i].union(current[i + 1]));
                before = after;
                i += 2;
            } else {
                next.push(current[i]);
                before = here;
                i += 1;
            }
        }
        next.extend(current.get(i));
        if (current.len() - next.len()) * SLOWEST < current.len() {
            return true;
        }
        core::mem::swap(&mut current, &mut next);
        next.clear();
    }
    false
}

/// The boxes by the Morton code of their centres; equal codes by index.
fn sorted(boxes: &[Aabb<f32>]) -> Vec<Aabb<f32>> {
    let all = boxes.iter().fold(Aabb::empty(), |a, b| a.union(*b));
    // Code and index share a word, which sorts twice as fast as two. At least ten bits an axis are left.
    let index_bits = usize::BITS - boxes.len().leading_zeros();
    let bits = ((u64::BITS - index_bits) / 3).min(21);
    let cells = (1u32 << bits) as f32;
    let scale = Vec3::from(all.extent().to_array().map(|e| if e > 0.0 { cells / e } else { 0.0 }));
    let mut keys: Vec<u64> = boxes
        .par_iter()
        .enumerate()
        .map(|(i, b)| {
            let cell = ((b.center() - all.min) * scale).as_uvec3().min(glam::UVec3::splat((1 << bits) - 1));
            (spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2) << index_bits | i as u64
        })
        .collect();
    keys.par_sort_unstable();
    keys.into_par_iter().map(|key| boxes[(key & ((1 << index_bits) - 1)) as usize]).collect()
}

/// Two zero bits between each two of the low 21 bits.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stall_and_scatter_does_not() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let at = |p: Vec3, s: f32| Aabb::new(p, p + unit.max * s);
        assert!(stalls(&(0..5000).map(|k| at(Vec3::X * k as f32, 0.8)).collect::<Vec<_>>()));
        assert!(stalls(&vec![unit; 5000]));
        assert!(!stalls(&vec![unit; 500]));
        let random = |k: u32| (k.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
        let scattered = |k: u32| Vec3::new(random(k), random(k + 77_777), random(k * 3 + 1));
        assert!(!stalls(&(0..5000).map(|k| at(scattered(k), 0.01)).collect::<Vec<_>>()));
    }
}
