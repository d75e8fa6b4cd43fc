//! Rays that have nothing in common, some of them under way at a time.
//!
//! They enter in groups, eight side by side, and end so. Between, each goes its own way through the tree, doing what a single
//! ray does in the same order; but all take their steps together. First the boxes (or triangles) of every ray's node (or leaf) are
//! tested, which asks nothing of one ray that another would have to wait for; then it is seen for each where it goes. What a
//! single ray waits for, its tests and the memory they need, is so waited for once for all.

use super::group::Group;
use super::tier::{Tier, Way};
use super::trace::Among;
use crate::layout::wide8::{Reference, Wide8};
use crate::simd::{Lanes, Stacks};
use crate::wide::{BoxNode, Filter, Leaf, WideTree};

/// Groups under way at a time.
pub(super) const GROUPS: usize = 4;

/// Rays under way at a time.
const RAYS: usize = 8 * GROUPS;

/// Where the rays under way are, and what is left for them to visit: keys if near hits are to be found first, else children.
pub(crate) struct Courses {
    current: [Reference; RAYS],
    keys: Stacks<u64, RAYS>,
    children: Stacks<u32, RAYS>,
}

impl Courses {
    /// For a tree.
    pub(crate) fn new(tree: &Wide8) -> Self {
        let (keys, children) = (Stacks::new(tree.depth()), Stacks::new(tree.depth()));
        Self { current: [Reference::NOTHING; RAYS], keys, children }
    }
}

/// Some of the rays.
#[derive(Clone, Copy)]
struct List {
    rays: [u8; RAYS],
    len: usize,
}

impl List {
    const EMPTY: Self = Self { rays: [0; RAYS], len: 0 };

    #[inline(always)]
    fn push_if(&mut self, whether: bool, ray: usize) {
        self.rays[self.len % RAYS] = ray as u8;
        self.len += usize::from(whether);
    }

    #[inline(always)]
    fn ray(&self, k: usize) -> usize {
        usize::from(self.rays[k % RAYS]) % RAYS
    }
}

/// Where rays go next.
struct Ahead {
    nodes: List,
    leaves: List,
}

impl Ahead {
    #[inline(always)]
    fn go(&mut self, ray: usize, at: Reference) {
        self.nodes.push_if(!at.is_leaf(), ray);
        self.leaves.push_if(at.is_leaf(), ray);
    }
}

/// Traces the rays of at most [`GROUPS`] groups: each finds its nearest hit, or `ANY` hit. There must be a tree.
#[inline(always)]
pub(super) fn trace<L: Lanes, T: Tier, const ANY: bool>(
    among: &Among<'_>,
    groups: &mut [Group; GROUPS],
    courses: &mut Courses,
) {
    let tree = among.tree;
    let large = tree.is_large();
    let mut now = Ahead { nodes: List::EMPTY, leaves: List::EMPTY };
    courses.keys.clear();
    courses.children.clear();
    for (index, group) in groups.iter_mut().enumerate() {
        group.part::<L>();
        for lane in 0..8 {
            let ray = index * 8 + lane;
            courses.current[ray] = tree.root;
            if group.awake >> lane & 1 == 1 {
                now.go(ray, tree.root);
            }
        }
    }
    // Of each node or leaf what was found there.
    let mut keys = [[0u64; 8]; RAYS];
    let mut words = [[0u32; 8]; RAYS];
    let mut masks = [0u32; RAYS];
    let mut known = [[[0.0f32; 8]; 3]; RAYS];
    while now.nodes.len + now.leaves.len > 0 {
        let mut next = Ahead { nodes: List::EMPTY, leaves: List::EMPTY };
        for k in 0..now.nodes.len.min(RAYS) {
            let ray = now.nodes.ray(k);
            let (group, lane) = (&groups[ray / 8], ray % 8);
            let node = tree.node(courses.current[ray]);
            let (hits, enter) =
                group.boxes::<L>(lane).test(node, L::splat(group.start[lane]), L::splat(group.end[lane]));
            masks[k] = hits;
            if ANY {
                words[k] = L::pack_words(node.children(), hits);
            } else {
                keys[k] = enter.max(L::splat(0.0)).pack(node.children(), hits);
            }
        }
        for k in 0..now.nodes.len.min(RAYS) {
            let ray = now.nodes.ray(k);
            let n = masks[k].count_ones() as usize;
            let at = if n == 0 {
                let Some(at) = pop::<ANY>(courses, ray, groups[ray / 8].end[ray % 8]) else { continue };
                at
            } else if ANY {
                courses.children.top(ray).push(&words[k], n - 1);
                Reference(words[k][(n - 1) & 7])
            } else {
                Reference(courses.keys.top(ray).push_all_but_nearest(keys[k], n, false) as u32)
            };
            if large {
                tree.prefetch(at);
            }
            courses.current[ray] = at;
            next.go(ray, at);
        }
        for k in 0..now.leaves.len.min(RAYS) {
            let ray = now.leaves.ray(k);
            let (group, lane) = (&groups[ray / 8], ray % 8);
            let leaf = tree.leaf(courses.current[ray]);
            let way = Way { negative: [false; 3], axes: [[1, 2, 0], [2, 0, 1], [0, 1, 2]][group.axis(lane as u32)] };
            let filter = T::one::<L>(group, &way, lane);
            let (candidates, of) = filter.candidates(&leaf, &filter.interval(group.start[lane], group.end[lane]));
            masks[k] = candidates;
            of[0].put(&mut known[k][0]);
            of[1].put(&mut known[k][1]);
            of[2].put(&mut known[k][2]);
        }
        for k in 0..now.leaves.len.min(RAYS) {
            let ray = now.leaves.ray(k);
            let (index, lane) = (ray / 8, ray % 8);
            let group = &mut groups[index];
            let mut candidates = masks[k];
            if candidates != 0 {
                let leaf = tree.leaf(courses.current[ray]);
                let mut taken = false;
                while candidates != 0 {
                    let c = candidates.trailing_zeros() as usize & 7;
                    candidates &= candidates - 1;
                    let place = leaf.place(c);
                    let triangle = WideTree::triangle(tree, place);
                    let known = [known[k][0][c], known[k][1][c], known[k][2][c]];
                    taken |= group.offer_alone::<T, ANY>(among, index, lane, place, &triangle, known);
                    if ANY && taken {
                        break;
                    }
                }
                if ANY && taken {
                    continue;
                }
            }
            let Some(at) = pop::<ANY>(courses, ray, group.end[lane]) else { continue };
            if large {
                tree.prefetch(at);
            }
            courses.current[ray] = at;
            next.go(ray, at);
        }
        now = next;
    }
}

/// What is next of what is left.
#[inline(always)]
fn pop<const ANY: bool>(courses: &mut Courses, ray: usize, end: f32) -> Option<Reference> {
    if ANY {
        return courses.children.top(ray).pop().map(Reference);
    }
    loop {
        let key = courses.keys.top(ray).pop()?;
        if f32::from_bits((key >> 32) as u32) <= end.max(0.0) {
            return Some(Reference(key as u32));
        }
    }
}
