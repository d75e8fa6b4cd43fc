//! One way into the trees of all layouts, of both levels: a place in them with its box in the world, and what is below.

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use glam::Vec3;

use crate::HitId;
use crate::build::Child;
use crate::kernel::double;
use crate::layout::wide8::Reference;
use crate::region::VisitedTriangle;
use crate::scene::Inner;
use crate::wide::{Leaf, WideTree};

/// A place in the trees of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cursor {
    place: Place,
    /// Around all that is below, in the world.
    pub(crate) bounds: Aabb<f64>,
}

/// A node or a leaf: of a binary tree or of one of eight children a node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum At {
    Binary(Child),
    Wide(Reference),
}

#[derive(Clone, Copy, Debug)]
enum Place {
    /// A node of the tree over instances.
    Above(u32),
    /// So many of the instances in the order of that tree.
    Run(u32, u32),
    /// In the tree of an instance.
    Model(u32, At),
}

/// Up to eight places.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Few {
    items: [Cursor; 8],
    count: usize,
}

impl Few {
    fn new() -> Self {
        Self {
            items: [Cursor { place: Place::Run(0, 0), bounds: Aabb { min: glam::DVec3::ZERO, max: glam::DVec3::ZERO } };
                8],
            count: 0,
        }
    }
    fn push(&mut self, cursor: Cursor) {
        if let Some(item) = self.items.get_mut(self.count) {
            *item = cursor;
            self.count += 1;
        }
    }
    pub(crate) fn iter(&self) -> core::slice::Iter<'_, Cursor> {
        self.items[..self.count].iter()
    }
    /// By a key, smaller ones first; equal ones stay as they are.
    pub(crate) fn sort_by_key(&mut self, key: impl Fn(&Cursor) -> f64) {
        self.items[..self.count].sort_by(|a, b| key(a).total_cmp(&key(b)));
    }
}

impl Inner {
    /// Where to begin; `None` if nothing is bounded.
    pub(crate) fn cursor(&self) -> Option<Cursor> {
        let count = self.bounded_count();
        let place = match self.above().first() {
            _ if count == 0 => return None,
            Some(node) => Place::Above(node),
            None => Place::Run(0, count),
        };
        Some(Cursor { place, bounds: self.whole() })
    }

    /// A box around the boxes of all instances.
    pub(crate) fn placed_boxes(&self) -> Aabb<f64> {
        (0..self.bounded_count()).fold(Aabb::empty(), |all: Aabb<f64>, k| all.union(self.placed_box(k).1))
    }

    /// The instance at a place of the order above, and its box.
    fn placed_box(&self, k: u32) -> (u32, Aabb<f64>) {
        let i = self.bounded(self.above().numbered(k));
        let instance = &self.instances[i as usize];
        (i, instance.transform.aabb(self.models[instance.model as usize].bounds()))
    }

    /// What is below; `None` for a leaf.
    pub(crate) fn below(&self, cursor: &Cursor) -> Option<Few> {
        let mut few = Few::new();
        match cursor.place {
            Place::Above(node) => self.above().below(node, &mut |child, bounds| {
                let place = match child {
                    Ok(node) => Place::Above(node),
                    Err(run) => Place::Run(run.start, run.end),
                };
                few.push(Cursor { place, bounds });
            }),
            Place::Run(start, end) if end - start > 8 => {
                let middle = start + (end - start) / 2;
                for place in [Place::Run(start, middle), Place::Run(middle, end)] {
                    few.push(Cursor { place, ..*cursor });
                }
            }
            Place::Run(start, end) => {
                for k in start..end {
                    let (i, bounds) = self.placed_box(k);
                    if let Some(at) = self.models[self.instances[i as usize].model as usize].first() {
                        few.push(Cursor { place: Place::Model(i, at), bounds });
                    }
                }
            }
            Place::Model(i, at) => {
                let instance = &self.instances[i as usize];
                let inner = self.models[instance.model as usize].below(at, &mut |at, bounds| {
                    few.push(Cursor { place: Place::Model(i, at), bounds: instance.transform.aabb(bounds) });
                });
                if !inner {
                    return None;
                }
            }
        }
        Some(few)
    }

    /// The triangles of a leaf, in the world.
    pub(crate) fn leaf(
        &self,
        cursor: &Cursor,
        inside: bool,
        f: &mut dyn FnMut(&VisitedTriangle) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Place::Model(i, at) = cursor.place else { return ControlFlow::Continue(()) };
        let instance = &self.instances[i as usize];
        let model = &self.models[instance.model as usize];
        model.in_leaf(at, &mut |number, corners| {
            let Some(part) = model.of_number(number) else { return ControlFlow::Continue(()) };
            let id = HitId { instance: i, geometry: part.geometry, primitive: part.primitive };
            f(&VisitedTriangle { id, corners: double(&corners).map(|p| instance.transform.point(p)), inside })
        })
    }
}

impl crate::model::Model {
    /// Where its tree begins.
    pub(crate) fn first(&self) -> Option<At> {
        let wide = |root: Reference| (root != Reference::NOTHING).then_some(At::Wide(root));
        if let Some((tree, _)) = self.wide() {
            wide(tree.root())
        } else if let Some((tree, _)) = self.compact() {
            wide(tree.root())
        } else {
            self.binary()?.first().map(At::Binary)
        }
    }

    /// Tells what is below a node, with its boxes; whether it is one.
    pub(crate) fn below(&self, at: At, f: &mut dyn FnMut(At, &Aabb<f64>)) -> bool {
        match at {
            At::Binary(node) if !node.is_leaf() => {
                for (child, bounds) in self.binary().into_iter().flat_map(|tree| tree.below(node.first)) {
                    f(At::Binary(child), &bounds.to_f64());
                }
                true
            }
            At::Wide(node) if !node.is_leaf() => {
                if let Some((tree, _)) = self.wide() {
                    tree.node(node).each(|child, bounds| f(At::Wide(child), &bounds.to_f64()));
                } else if let Some((tree, _)) = self.compact() {
                    tree.node(node).each(|child, bounds| f(At::Wide(child), &bounds));
                }
                true
            }
            _ => false,
        }
    }

    /// The triangles of a leaf with their numbers.
    fn in_leaf(&self, at: At, f: &mut dyn FnMut(u32, [Vec3; 3]) -> ControlFlow<()>) -> ControlFlow<()> {
        match at {
            At::Binary(leaf) => {
                for place in leaf.range() {
                    if let Some((number, corners)) = self.numbered(place) {
                        f(number, corners)?;
                    }
                }
                ControlFlow::Continue(())
            }
            At::Wide(leaf) => {
                if let Some((tree, _)) = self.wide() {
                    self.in_wide_leaf(tree, leaf, f)
                } else if let Some((tree, _)) = self.compact() {
                    self.in_wide_leaf(tree, leaf, f)
                } else {
                    ControlFlow::Continue(())
                }
            }
        }
    }

    fn in_wide_leaf(
        &self,
        tree: &impl WideTree,
        at: Reference,
        f: &mut dyn FnMut(u32, [Vec3; 3]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let leaf = tree.leaf(at);
        let mut rest = leaf.lanes();
        while rest != 0 {
            let place = leaf.place(rest.trailing_zeros() as usize);
            rest &= rest - 1;
            if let Some(number) = self.number(place).filter(|&n| n != u32::MAX) {
                f(number, tree.triangle(place))?;
            }
        }
        ControlFlow::Continue(())
    }
}
