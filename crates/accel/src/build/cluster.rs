//! Boxes that sit on one another.
//!
//! obvhs takes quadratic time, and makes a list of a tree, when many boxes have one centre (coincident triangles,
//! concentric shells): each then prefers the same neighbour. Such boxes are found here and given to it as one.

use firsthit_geometry::Aabb;

/// Groups of boxes, and the rest.
pub(super) struct Clusters {
    /// Boxes of no group.
    pub(super) loose: Vec<u32>,
    /// Groups.
    pub(super) groups: Vec<Vec<u32>>,
}

/// So many boxes with exactly the same centre are a group.
const SAME_CENTER: usize = 8;
/// So many boxes of a similar size, with centres within an eighth of it, are a group.
const NEARLY_SAME_CENTER: usize = 64;

/// Finds the groups.
pub(super) fn find(boxes: &[Aabb<f32>]) -> Clusters {
    let mut clusters = Clusters { loose: (0..boxes.len() as u32).collect(), groups: Vec::new() };
    clusters.take(SAME_CENTER, |i| {
        let c = boxes[i as usize].min + boxes[i as usize].max;
        // + 0 makes -0 and 0 alike.
        [0, (c.x + 0.0).to_bits(), (c.y + 0.0).to_bits(), (c.z + 0.0).to_bits()]
    });
    clusters.take(NEARLY_SAME_CENTER, |i| {
        let b = &boxes[i as usize];
        let c = (b.min + b.max) * 0.5;
        // Eight cells to the size, rounded down to a power of two.
        let exponent = b.extent().max_element().to_bits() >> 23;
        let per_unit = f64::from(exponent).mul_add(-1.0, 127.0 + 3.0).exp2();
        let cell = |x: f32| (f64::from(x) * per_unit).floor() as i64 as u32;
        [exponent, cell(c.x), cell(c.y), cell(c.z)]
    });
    clusters
}

impl Clusters {
    /// Moves loose boxes that share a key with at least `least - 1` others into groups.
    fn take(&mut self, least: usize, key: impl Fn(u32) -> [u32; 4]) {
        if self.loose.len() < least {
            return;
        }
        // A table of counts by hash finds the candidates; usually there are none.
        let bits = (usize::BITS - self.loose.len().leading_zeros()).clamp(8, 26);
        let mut counts = vec![0u8; 1 << bits];
        let slot = |k: [u32; 4]| (hash(k) >> (64 - bits)) as usize;
        for &i in &self.loose {
            let c = &mut counts[slot(key(i))];
            *c = c.saturating_add(1);
        }
        let mut candidates: Vec<([u32; 4], u32)> =
            self.loose.iter().map(|&i| (key(i), i)).filter(|&(k, _)| usize::from(counts[slot(k)]) >= least).collect();
        if candidates.is_empty() {
            return;
        }
        candidates.sort_unstable();
        let mut taken = Vec::new();
        for group in candidates.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() >= least) {
            let group: Vec<u32> = group.iter().map(|&(_, i)| i).collect();
            taken.extend_from_slice(&group);
            self.groups.push(group);
        }
        taken.sort_unstable();
        self.loose.retain(|i| taken.binary_search(i).is_err());
    }
}

/// A mixing hash (the finaliser of splitmix64 over each word).
fn hash(key: [u32; 4]) -> u64 {
    key.into_iter().fold(0x9e37_79b9_7f4a_7c15, |h: u64, word| {
        let x = (h ^ u64::from(word)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (x ^ (x >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb)
    })
}
