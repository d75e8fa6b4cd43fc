//! Reading: nothing is believed.

use twox_hash::XxHash3_64;

use super::check::{check_binary, check_wide};
use super::{MAGIC, SavedTree, SavedTreesError, TreeShape, VERSION};
use crate::build::Child;

/// What is left of a file.
struct Reader<'a>(&'a [u8]);

const SHORT: SavedTreesError = SavedTreesError::Damaged("it ends too soon");

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], SavedTreesError> {
        let (first, rest) = self.0.split_first_chunk().ok_or(SHORT)?;
        self.0 = rest;
        Ok(*first)
    }

    fn word(&mut self) -> Result<u32, SavedTreesError> {
        self.bytes().map(u32::from_le_bytes)
    }

    /// So many as are said to follow, in groups; no more is taken from memory than the file has.
    fn words<const N: usize>(&mut self) -> Result<Vec<[u32; N]>, SavedTreesError> {
        let count = self.word()? as usize;
        let (these, rest) = self.0.split_at_checked(count.checked_mul(4).ok_or(SHORT)?).ok_or(SHORT)?;
        self.0 = rest;
        let words: Vec<u32> = these.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let (groups, []) = words.as_chunks() else { return Err(SavedTreesError::Damaged("a node is not whole")) };
        Ok(groups.to_vec())
    }
}

/// All trees of a file.
pub(super) fn trees(file: &[u8]) -> Result<Vec<SavedTree>, SavedTreesError> {
    if file.first_chunk() != Some(&MAGIC) {
        return Err(SavedTreesError::Foreign);
    }
    let mut reader = Reader(&file[MAGIC.len()..]);
    let found = reader.word()?;
    if found != VERSION {
        return Err(SavedTreesError::Version { found });
    }
    let (content, sum) = file.split_last_chunk::<8>().ok_or(SHORT)?;
    if XxHash3_64::oneshot(content) != u64::from_le_bytes(*sum) {
        return Err(SavedTreesError::Damaged("its checksum does not fit"));
    }
    let mut reader = Reader(content.get(MAGIC.len() + 4..).ok_or(SHORT)?);
    let count = reader.word()?;
    let mut trees = Vec::new();
    for _ in 0..count {
        trees.push(tree(&mut reader)?);
    }
    if !reader.0.is_empty() {
        return Err(SavedTreesError::Damaged("something follows the trees"));
    }
    Ok(trees)
}

fn tree(reader: &mut Reader<'_>) -> Result<SavedTree, SavedTreesError> {
    let hash = reader.bytes().map(u64::from_le_bytes)?;
    let shape = match reader.word()? {
        0 => None,
        1 => {
            let root = reader.word()?;
            let children = reader.words::<8>()?;
            let numbers = reader.words::<1>()?.as_flattened().to_vec();
            let depth = check_wide(root, &children, &numbers)?;
            Some(TreeShape::Wide { root, children, numbers, depth })
        }
        2 => {
            let root = Child { first: reader.word()?, count: reader.word()? };
            let nodes = reader.words::<4>()?;
            let of = |[a, b, c, d]: [u32; 4]| [Child { first: a, count: b }, Child { first: c, count: d }];
            let nodes: Vec<[Child; 2]> = nodes.into_iter().map(of).collect();
            let numbers = reader.words::<1>()?.as_flattened().to_vec();
            let root = (!numbers.is_empty()).then_some(root);
            let depth = check_binary(root, &nodes, &numbers)?;
            Some(TreeShape::Binary { root, nodes, numbers, depth })
        }
        _ => return Err(SavedTreesError::Damaged("an unknown kind of tree")),
    };
    Ok(SavedTree { hash, shape })
}
