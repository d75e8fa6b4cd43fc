//! Whether the trees of a scene are what they should be.

use std::fmt;

use firsthit_geometry::Aabb;

use crate::Scene;
use crate::build::{Child, MAX_DEPTH};
use crate::instance::tight_boxes;
use crate::kernel::double;
use crate::layout::wide8::Reference;
use crate::model::Model;
use crate::region::At;
use crate::scene::Inner;
use crate::wide::WideTree;

/// A tree that is not what it should be: see [`Scene::validate`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidTree {
    /// Index of the mesh; `None` for the tree over the instances.
    pub mesh: Option<usize>,
    /// What is wrong with it.
    pub fault: TreeFault,
}

impl fmt::Display for InvalidTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.mesh {
            Some(mesh) => write!(f, "the tree of mesh {mesh}: ")?,
            None => write!(f, "the tree over the instances: ")?,
        }
        self.fault.fmt(f)
    }
}

impl core::error::Error for InvalidTree {}

/// What is wrong with a tree. Items are the primitives of a mesh, counted through all its geometries, or the instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeFault {
    /// A node or leaf that is not there, or that is reached twice.
    #[error("a node or leaf is not there or is reached twice")]
    NoTree,
    /// It is deeper than queries have room for.
    #[error("it is deeper than {MAX_DEPTH} nodes")]
    TooDeep,
    /// What must be in one leaf is in none or in several, or what must be in none is in one.
    #[error("item {item} is in a wrong number of leaves")]
    Misplaced {
        /// Which.
        item: u32,
    },
    /// The box of a leaf does not hold what is in it.
    #[error("item {item} is not within the box of its leaf")]
    OutsideLeaf {
        /// Which.
        item: u32,
    },
    /// The box of a node does not hold what is below.
    #[error("a node's box does not hold what is below")]
    OutsideNode,
}

impl Scene {
    /// Checks all trees of the scene, of the meshes and over the instances, as they lie in memory: whether each primitive
    /// that can be met is in one leaf, each box holds all that is below, and no tree is too deep. It takes time in
    /// proportion to the size of the scene.
    ///
    /// Every scene passes: it is for those who work on builders or doubt their memory. What comes from files is checked when
    /// it is read ([`SceneBuilder::build_with_trees`](crate::SceneBuilder::build_with_trees)).
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use glam::{DAffine3, Vec3};
    /// let mut builder = SceneBuilder::default();
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// assert_eq!(builder.build()?.validate(), Ok(()));
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// What is wrong with the first tree with which anything is.
    pub fn validate(&self) -> Result<(), InvalidTree> {
        for (mesh, model) in self.models().iter().enumerate() {
            check(&**model).map_err(|fault| InvalidTree { mesh: Some(mesh), fault })?;
        }
        let inner = self.inner();
        let instances = Instances { inner, boxes: tight_boxes(&inner.instances, &inner.models) };
        check(&instances).map_err(|fault| InvalidTree { mesh: None, fault })
    }
}

/// A tree with something in its leaves.
trait Tree {
    type At: Copy;
    /// Where it begins, with a box around it all.
    fn root(&self) -> Option<(Self::At, Aabb<f64>)>;
    fn node_count(&self) -> usize;
    /// The index of a node; `None` for a leaf.
    fn node(&self, at: Self::At) -> Option<usize>;
    /// Tells of what is below a node that is there.
    fn below(&self, at: Self::At, f: &mut dyn FnMut(Self::At, Aabb<f64>));
    /// Tells what is in a leaf, with its box; `None` if that is not there.
    fn items(&self, at: Self::At, f: &mut dyn FnMut(u32, Aabb<f64>)) -> Option<()>;
    /// Tells of everything that must be in a leaf.
    fn all(&self, f: &mut dyn FnMut(u32));
    /// Numbers of items are below that.
    fn item_limit(&self) -> usize;
    /// Whether the boxes of children are within that of their parent, and not only what is below.
    fn is_nested(&self) -> bool;
}

/// Of an item.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Leaves {
    Unwanted,
    Wanted,
    Reached,
}

/// What was met on the way down.
struct Walk {
    nodes: Vec<bool>,
    items: Vec<Leaves>,
}

fn check<T: Tree>(tree: &T) -> Result<(), TreeFault> {
    let mut walk = Walk { nodes: vec![false; tree.node_count()], items: vec![Leaves::Unwanted; tree.item_limit()] };
    tree.all(&mut |item| walk.items[item as usize] = Leaves::Wanted);
    if let Some((root, bounds)) = tree.root() {
        walk.down(tree, root, &bounds, 1)?;
    }
    if !walk.nodes.iter().all(|reached| *reached) {
        return Err(TreeFault::NoTree);
    }
    match walk.items.iter().position(|item| *item == Leaves::Wanted) {
        Some(item) => Err(TreeFault::Misplaced { item: item as u32 }),
        None => Ok(()),
    }
}

impl Walk {
    /// A box around all that is below; no deeper than trees may be.
    fn down<T: Tree>(&mut self, tree: &T, at: T::At, bounds: &Aabb<f64>, depth: u32) -> Result<Aabb<f64>, TreeFault> {
        if depth > MAX_DEPTH {
            return Err(TreeFault::TooDeep);
        }
        let mut all = Aabb::empty();
        let Some(index) = tree.node(at) else {
            let mut fault = None;
            let there = tree.items(at, &mut |item, inside| {
                let reached = self.items.get_mut(item as usize).filter(|i| **i == Leaves::Wanted);
                let new = match reached.map(|i| *i = Leaves::Reached) {
                    None => Some(TreeFault::Misplaced { item }),
                    Some(()) => (!holds(bounds, &inside)).then_some(TreeFault::OutsideLeaf { item }),
                };
                fault = fault.or(new);
                all = all.union(inside);
            });
            there.ok_or(TreeFault::NoTree)?;
            return fault.map_or(Ok(all), Err);
        };
        let slot = self.nodes.get_mut(index).filter(|reached| !**reached).ok_or(TreeFault::NoTree)?;
        *slot = true;
        let mut below = Vec::new();
        tree.below(at, &mut |child, inner| below.push((child, inner)));
        for (child, inner) in below {
            if tree.is_nested() && !holds(bounds, &inner) {
                return Err(TreeFault::OutsideNode);
            }
            all = all.union(self.down(tree, child, &inner, depth + 1)?);
        }
        if holds(bounds, &all) { Ok(all) } else { Err(TreeFault::OutsideNode) }
    }
}

fn holds(outer: &Aabb<f64>, inner: &Aabb<f64>) -> bool {
    inner.is_empty() || outer.min.cmple(inner.min).all() && inner.max.cmple(outer.max).all()
}

impl Tree for Model {
    type At = At;

    fn root(&self) -> Option<(At, Aabb<f64>)> {
        Some((self.first()?, *self.bounds()))
    }

    fn node_count(&self) -> usize {
        match (self.wide(), self.compact(), self.binary()) {
            (Some((tree, _)), ..) => tree.nodes.len(),
            (_, Some((tree, _)), _) => tree.node_count(),
            (.., tree) => tree.map_or(0, |tree| tree.node_count()),
        }
    }

    fn node(&self, at: At) -> Option<usize> {
        match at {
            At::Binary(node) => (!node.is_leaf()).then_some(node.first as usize),
            At::Wide(node) => (!node.is_leaf()).then(|| node.index()),
        }
    }

    fn below(&self, at: At, f: &mut dyn FnMut(At, Aabb<f64>)) {
        Model::below(self, at, &mut |child, bounds| f(child, *bounds));
    }

    fn items(&self, at: At, f: &mut dyn FnMut(u32, Aabb<f64>)) -> Option<()> {
        match at {
            At::Binary(Child { first, count }) => {
                for place in first as usize..(first as usize).checked_add(count as usize)? {
                    self.number(place)?;
                    if let Some((number, corners)) = self.numbered(place) {
                        f(number, Aabb::from_points(double(&corners)));
                    } else if let Some((number, shape)) = self.numbered_shape(place) {
                        f(number, shape.bounds);
                    }
                }
            }
            At::Wide(leaf) => {
                let places = if let Some((tree, _)) = self.compact() {
                    tree.leaf_places(leaf)?
                } else {
                    let (tree, _) = self.wide()?;
                    is_in_two_blocks(leaf, tree.blocks.len()).then(|| leaf.places())?
                };
                for place in places {
                    let number = self.number(place)?;
                    // It must be where it is said to be; a lane may be empty after a refit.
                    match self.id(place).map(|id| self.place(id)) {
                        Some(Some(known)) if known == place => {}
                        None => continue,
                        _ => return None,
                    }
                    let corners = match (self.wide(), self.compact()) {
                        (Some((tree, _)), _) => WideTree::triangle(tree, place),
                        (_, Some((tree, _))) => tree.triangle(place),
                        _ => return None,
                    };
                    f(number, Aabb::from_points(double(&corners)));
                }
            }
        }
        Some(())
    }

    fn all(&self, f: &mut dyn FnMut(u32)) {
        self.each_triangle(|number, _| f(number));
        self.each_shape(true, |number, _| f(number));
    }

    fn item_limit(&self) -> usize {
        (self.triangle_count() + self.shape_count()) as usize
    }

    fn is_nested(&self) -> bool {
        // Compact nodes round their children's boxes outward, each on a grid of its own.
        self.compact().is_none()
    }
}

fn is_in_two_blocks(leaf: Reference, blocks: usize) -> bool {
    leaf.lanes() <= 0xff && leaf.block() + usize::from(leaf.lanes() > 0xf) < blocks
}

/// The tree over the instances.
struct Instances<'a> {
    inner: &'a Inner,
    /// In the world; empty for those that are not in the tree.
    boxes: Vec<Aabb<f64>>,
}

impl Tree for Instances<'_> {
    /// A node, or a run of positions.
    type At = Result<u32, (u32, u32)>;

    fn root(&self) -> Option<(Self::At, Aabb<f64>)> {
        let run = (0, self.inner.bounded_count());
        (run.1 > 0).then(|| (self.inner.above().first().ok_or(run), Aabb::infinite()))
    }

    fn node_count(&self) -> usize {
        self.inner.above().node_count()
    }

    fn node(&self, at: Self::At) -> Option<usize> {
        at.ok().map(|node| node as usize)
    }

    fn below(&self, at: Self::At, f: &mut dyn FnMut(Self::At, Aabb<f64>)) {
        if let Ok(node) = at {
            self.inner.above().below(node, &mut |child, bounds| f(child.map_err(|run| (run.start, run.end)), bounds));
        }
    }

    fn items(&self, at: Self::At, f: &mut dyn FnMut(u32, Aabb<f64>)) -> Option<()> {
        let (start, end) = at.err()?;
        if end > self.inner.bounded_count() {
            return None;
        }
        for position in start..end {
            let instance = self.inner.bounded(self.inner.above().numbered(position));
            f(instance, *self.boxes.get(instance as usize)?);
        }
        Some(())
    }

    fn all(&self, f: &mut dyn FnMut(u32)) {
        let there = self.boxes.iter().enumerate().filter(|(_, b)| !b.is_empty());
        there.for_each(|(instance, _)| f(instance as u32));
    }

    fn item_limit(&self) -> usize {
        self.boxes.len()
    }

    fn is_nested(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Geometry, Layout};
    use glam::Vec3;

    fn model(layout: Layout) -> Model {
        let at = |k: u32| Vec3::new((k % 7) as f32, (k % 11) as f32, (k % 13) as f32);
        let positions = (0..300).flat_map(|k| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + at(k))).collect();
        let triangles = (0..300).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = [Geometry::Triangles { positions, triangles }];
        Model::new(0, &mesh, BuildOptions { layout, ..BuildOptions::default() }).expect("a mesh")
    }

    #[test]
    fn damaged_trees_are_told() {
        for layout in Layout::ALL {
            let whole = model(layout);
            assert_eq!(check(&whole), Ok(()));
            let damaged = |damage: &dyn Fn(&mut Model)| {
                let mut model = whole.clone();
                damage(&mut model);
                check(&model)
            };
            let shrunken = damaged(&|model| model.shrink_a_box());
            assert!(matches!(shrunken, Err(TreeFault::OutsideNode | TreeFault::OutsideLeaf { .. })), "{shrunken:?}");
            if layout == Layout::Compact8 {
                continue;
            }
            // A number twice, or for good.
            let used = |model: &mut Model| (0..).find(|&k| model.numbers_mut()[k] == 5).expect("the sixth");
            for number in [6, u32::MAX, 300] {
                let renamed = damaged(&|model| {
                    let k = used(model);
                    model.numbers_mut()[k] = number;
                });
                assert!(matches!(renamed, Err(TreeFault::Misplaced { .. } | TreeFault::NoTree)), "{renamed:?}");
            }
        }
    }

    #[test]
    fn what_is_no_tree_is_told() {
        let nodes = model(Layout::Wide8).wide().expect("a wide tree").0.nodes.clone();
        let inner = (0..8).find(|&k| !Reference(nodes[0].children[k]).is_leaf()).expect("a node below the root");
        let damaged = |child: u32| {
            let mut model = model(Layout::Wide8);
            model.wide_mut().expect("a wide tree").nodes[0].children[inner] = child;
            check(&model)
        };
        let sibling = (0..8).find(|&k| k != inner && nodes[0].children[k] != u32::MAX).expect("another child");
        // A ring, a node and a leaf that are not there, a child twice, a subtree that is lost.
        for child in [0, nodes.len() as u32, Reference::leaf(1 << 20, 4).0, nodes[0].children[sibling], u32::MAX] {
            let fault = damaged(child);
            assert!(fault.is_err_and(|fault| fault != TreeFault::TooDeep), "{child:#x}: {fault:?}");
        }
    }

    #[test]
    fn trees_over_instances_are_checked() {
        use crate::SceneBuilder;
        use glam::{DAffine3, DVec3};
        for layout in Layout::ALL {
            let mut builder = SceneBuilder::new(BuildOptions { layout, ..BuildOptions::default() });
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
            let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
            for i in 0..50 {
                builder.add_instance(mesh, DAffine3::from_translation(DVec3::X * f64::from(i)));
            }
            let scene = builder.build().expect("a mesh");
            assert_eq!(scene.validate(), Ok(()));
            // As if one had moved by itself.
            let inner = scene.inner();
            let mut boxes = tight_boxes(&inner.instances, &inner.models);
            boxes[17] = Aabb::new(boxes[17].min, boxes[17].max + DVec3::X * 40.0);
            assert_eq!(check(&Instances { inner, boxes }), Err(TreeFault::OutsideLeaf { item: 17 }));
            let mut boxes = tight_boxes(&inner.instances, &inner.models);
            boxes[20] = Aabb::empty();
            assert_eq!(check(&Instances { inner, boxes }), Err(TreeFault::Misplaced { item: 20 }));
        }
    }
}
