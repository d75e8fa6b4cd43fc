//! Writing, and what files are tied to.

use twox_hash::XxHash3_64;

use super::{MAGIC, TreeShape, VERSION};
use crate::model::Model;

/// All models one after the other, then a checksum.
pub(super) fn trees(models: &[impl AsRef<Model>]) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend(MAGIC);
    word(&mut out, VERSION);
    word(&mut out, models.len() as u32);
    for model in models {
        let model = model.as_ref();
        out.extend(hash(model).to_le_bytes());
        match model.shape() {
            None => word(&mut out, 0),
            Some(TreeShape::Wide { root, children, numbers, .. }) => {
                word(&mut out, 1);
                word(&mut out, root);
                words(&mut out, children.as_flattened());
                words(&mut out, &numbers);
            }
            Some(TreeShape::Binary { root, nodes, numbers, .. }) => {
                word(&mut out, 2);
                let root = root.unwrap_or_default();
                word(&mut out, root.first);
                word(&mut out, root.count);
                let flat: Vec<u32> = nodes.iter().flatten().flat_map(|c| [c.first, c.count]).collect();
                words(&mut out, &flat);
                words(&mut out, &numbers);
            }
        }
    }
    let sum = XxHash3_64::oneshot(&out);
    out.extend(sum.to_le_bytes());
    out
}

fn word(out: &mut Vec<u8>, x: u32) {
    out.extend(x.to_le_bytes());
}

/// With their number.
fn words(out: &mut Vec<u8>, all: &[u32]) {
    word(out, all.len() as u32);
    out.reserve(all.len() * 4);
    all.iter().for_each(|&x| word(out, x));
}

/// Of the triangles that are in the tree, with their numbers.
pub(super) fn hash(model: &Model) -> u64 {
    use core::hash::Hasher;
    let mut hasher = XxHash3_64::new();
    hasher.write(&model.scale().to_le_bytes());
    // Many at once.
    let mut block = Vec::with_capacity(40 * 256);
    model.each_triangle(|number, corners| {
        block.extend(number.to_le_bytes());
        corners.iter().flat_map(|p| p.to_array()).for_each(|x| block.extend(x.to_bits().to_le_bytes()));
        if block.len() >= 40 * 256 {
            hasher.write(&block);
            block.clear();
        }
    });
    hasher.write(&block);
    hasher.finish()
}
