//! What obvhs is asked to do.

use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser::collapse, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

use crate::BuildQuality;

/// How a tree is clustered and improved.
///
/// The figures were chosen by what each buys, in expected nodes and leaves, for its time: see docs/traversal.md. obvhs's
/// own presets search farther for partners and reinsert in 16 rounds that become ever smaller; a few rounds of one size
/// give better trees for less, and what the longer search finds reinsertion finds too.
pub(super) struct Recipe {
    /// How far along the Morton curve a partner is looked for.
    distance: PlocSearchDistance,
    /// So many rounds of clustering look at direct neighbours only.
    near: usize,
    /// Rounds of reinsertion: the share of all nodes, the largest, that is moved to where it costs least.
    rounds: &'static [f32],
}

/// Cost of a node against that of a primitive, where leaves are made.
const NODE_COST: f32 = 3.0;

impl Recipe {
    pub(super) fn new(quality: BuildQuality) -> Self {
        match quality {
            BuildQuality::Fast => Self { distance: PlocSearchDistance::VeryLow, near: 2, rounds: &[0.01; 2] },
            BuildQuality::Balanced => Self { distance: PlocSearchDistance::Low, near: 1, rounds: &[0.02; 4] },
            BuildQuality::High => Self { distance: PlocSearchDistance::Low, near: 1, rounds: &[0.1, 0.05, 0.03, 0.02] },
        }
    }

    /// The tree over some boxes, with so many of them in a leaf at most.
    pub(super) fn build(&self, boxes: &[Aabb], leaf: u32) -> Bvh2 {
        let all = (0..boxes.len() as u32).collect();
        let mut tree =
            PlocBuilder::with_capacity(boxes.len()).build(self.distance, boxes, all, SortPrecision::U64, self.near);
        let mut reinsertion = ReinsertionOptimizer::default();
        let mut improve = |tree: &mut Bvh2| reinsertion.run(tree, 1.0, Some(self.rounds.to_vec()));
        improve(&mut tree);
        if leaf > 1 {
            collapse(&mut tree, leaf, NODE_COST);
            improve(&mut tree);
        }
        tree
    }
}
