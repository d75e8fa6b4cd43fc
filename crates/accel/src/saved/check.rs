//! Whether what a file describes is a tree, with each primitive in one leaf, and no deeper than traversals have room for.

use super::SavedTreesError;
use crate::build::{Child, MAX_DEPTH};
use crate::layout::wide8::Reference;

const NO_TREE: SavedTreesError = SavedTreesError::Damaged("it describes no tree");

/// What was met on the way down.
struct Seen {
    /// Nodes to their depths; 0 for those that nothing leads to.
    depths: Vec<u32>,
    /// Whether a leaf has the place.
    places: Vec<bool>,
    deepest: u32,
}

impl Seen {
    fn new(nodes: usize, places: usize) -> Self {
        Self { depths: vec![0; nodes], places: vec![false; places], deepest: 0 }
    }

    fn reach(&mut self, depth: u32) -> Result<u32, SavedTreesError> {
        self.deepest = self.deepest.max(depth);
        if depth <= MAX_DEPTH { Ok(depth) } else { Err(SavedTreesError::Damaged("a tree is too deep")) }
    }

    /// A node below one at `depth`; those are in the order in which they are met.
    fn node(&mut self, at: usize, after: usize, depth: u32) -> Result<(), SavedTreesError> {
        let depth = self.reach(depth + 1)?;
        let slot = self.depths.get_mut(at).filter(|d| at > after && **d == 0).ok_or(NO_TREE)?;
        *slot = depth;
        Ok(())
    }

    fn leaf(&mut self, places: core::ops::Range<usize>, depth: u32) -> Result<(), SavedTreesError> {
        self.reach(depth + 1)?;
        for place in self.places.get_mut(places).ok_or(NO_TREE)? {
            if core::mem::replace(place, true) {
                return Err(NO_TREE);
            }
        }
        Ok(())
    }

    /// Everything is reached once; the answer is the depth.
    fn end(&self, numbers: &[u32]) -> Result<u32, SavedTreesError> {
        let all = numbers.iter().zip(&self.places).all(|(&number, &reached)| number == u32::MAX || reached);
        let mut sorted: Vec<u32> = numbers.iter().copied().filter(|&n| n != u32::MAX).collect();
        sorted.sort_unstable();
        let twice = sorted.windows(2).any(|w| w[0] == w[1]);
        if all && !twice && self.depths.iter().all(|&d| d > 0) { Ok(self.deepest) } else { Err(NO_TREE) }
    }
}

/// The depth of a tree of eight children a node.
pub(super) fn check_wide(root: u32, children: &[[u32; 8]], numbers: &[u32]) -> Result<u32, SavedTreesError> {
    let mut seen = Seen::new(children.len(), numbers.len());
    if !numbers.len().is_multiple_of(4) {
        return Err(NO_TREE);
    }
    let blocks = numbers.len() / 4;
    let leaf = |seen: &mut Seen, at: Reference, depth| {
        // In two blocks at most, that are both there.
        let (lanes, high) = (at.lanes(), at.block() + usize::from(at.lanes() > 0xf));
        if lanes > 0xff || high >= blocks {
            return Err(NO_TREE);
        }
        seen.leaf(at.places(), depth)
    };
    match Reference(root) {
        Reference::NOTHING => {}
        at if at.is_leaf() => leaf(&mut seen, at, 0)?,
        Reference(0) if !children.is_empty() => seen.depths[0] = 1,
        _ => return Err(NO_TREE),
    }
    for (i, node) in children.iter().enumerate() {
        let depth = seen.depths[i];
        let used = node.iter().position(|&c| c == Reference::NOTHING.0).unwrap_or(8);
        // What is missing comes last.
        if depth == 0 || used == 0 || node[used..].iter().any(|&c| c != Reference::NOTHING.0) {
            return Err(NO_TREE);
        }
        for &child in &node[..used] {
            let at = Reference(child);
            if at.is_leaf() {
                leaf(&mut seen, at, depth)?;
            } else {
                seen.node(at.index(), i, depth)?;
            }
        }
    }
    seen.end(numbers)
}

/// The depth of a binary tree.
pub(super) fn check_binary(root: Option<Child>, nodes: &[[Child; 2]], numbers: &[u32]) -> Result<u32, SavedTreesError> {
    let mut seen = Seen::new(nodes.len(), numbers.len());
    let run = |c: Child| c.first as usize..(c.first as usize).saturating_add(c.count as usize);
    match root {
        None => {}
        Some(root) if root.is_leaf() => seen.leaf(run(root), 0)?,
        Some(Child { first: 0, .. }) if !nodes.is_empty() => seen.depths[0] = 1,
        Some(_) => return Err(NO_TREE),
    }
    for (i, node) in nodes.iter().enumerate() {
        let depth = seen.depths[i];
        if depth == 0 {
            return Err(NO_TREE);
        }
        for &child in node {
            if child.is_leaf() {
                seen.leaf(run(child), depth)?;
            } else {
                seen.node(child.first as usize, i, depth)?;
            }
        }
    }
    seen.end(numbers)
}
