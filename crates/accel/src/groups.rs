//! Instances of several levels: groups of meshes, and groups of groups.
//!
//! They are resolved when they are placed, so that queries know one level only, and pay for one.

use core::ops::Range;

use glam::DAffine3;

use crate::instance::Placed;
use crate::model::limit;
use crate::{BuildError, Scene, SceneBuilder};

/// What a group is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupMember {
    /// The mesh with this index: [`SceneBuilder::add_mesh`].
    Mesh(usize),
    /// The group with this index: [`SceneBuilder::add_group`].
    Group(usize),
}

/// What is placed together.
#[derive(Clone, Debug)]
struct Group {
    children: Vec<(GroupMember, DAffine3)>,
    /// Meshes in the children up to and including each.
    ends: Vec<u64>,
}

/// All groups, and where they are placed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    groups: Vec<Group>,
    /// The instances that came of a group.
    placed: Vec<(Range<usize>, usize)>,
}

impl Groups {
    /// Meshes in it, however deep.
    fn size(&self, child: GroupMember) -> u64 {
        match child {
            GroupMember::Mesh(_) => 1,
            GroupMember::Group(g) => self.groups.get(g).and_then(|g| g.ends.last().copied()).unwrap_or(0),
        }
    }

    /// The instances of a group, depth first. On a stack of its own: groups may be nested deeply.
    fn place(&self, group: usize, transform: DAffine3, out: &mut Vec<Placed>) {
        let children = |group: usize| self.groups.get(group).map_or(&[][..], |g| &g.children).iter();
        let mut stack = vec![(children(group), transform)];
        while let Some((rest, transform)) = stack.last_mut() {
            let Some((child, own)) = rest.next() else {
                stack.pop();
                continue;
            };
            let placed = *transform * *own;
            match child {
                GroupMember::Mesh(mesh) => out.push(Placed::new(*mesh, placed)),
                // Nothing of nothing of nothing could take forever.
                GroupMember::Group(inner) if self.size(*child) > 0 => stack.push((children(*inner), placed)),
                GroupMember::Group(_) => {}
            }
        }
    }

    fn path(&self, instance: usize) -> Vec<u32> {
        let k = self.placed.partition_point(|(range, _)| range.end <= instance);
        let Some((range, group)) = self.placed.get(k).filter(|(range, _)| range.contains(&instance)) else {
            return vec![instance as u32];
        };
        let mut path = vec![range.start as u32];
        let (mut group, mut rest) = (*group, (instance - range.start) as u64);
        while let Some(Group { children, ends }) = self.groups.get(group) {
            let k = ends.partition_point(|end| *end <= rest);
            path.push(k as u32);
            let before = k.checked_sub(1).and_then(|k| ends.get(k)).copied().unwrap_or(0);
            rest -= before;
            match children.get(k) {
                Some((GroupMember::Group(inner), _)) => group = *inner,
                _ => break,
            }
        }
        path
    }
}

/// Instances of several levels.
impl SceneBuilder {
    /// Adds a group: meshes, and groups that were added before, each where it is in the group. The answer is its index, for
    /// [`SceneBuilder::add_instances_of`].
    ///
    /// A child that does not exist is an error of [`SceneBuilder::build`].
    pub fn add_group(&mut self, children: impl IntoIterator<Item = (GroupMember, DAffine3)>) -> usize {
        let count = self.groups_mut().groups.len();
        let mut group = Group { children: Vec::new(), ends: Vec::new() };
        let mut end = 0u64;
        for (child, transform) in children {
            // Only what was there before: so there are no circles.
            if let GroupMember::Group(g) = child
                && g >= count
            {
                self.fail(BuildError::NoSuchGroup { group: g, count });
                continue;
            }
            end = end.saturating_add(self.groups_mut().size(child));
            group.children.push((child, transform));
            group.ends.push(end);
        }
        self.groups_mut().groups.push(group);
        count
    }

    /// Places a group in the world: one instance for each mesh in it, depth first. The answer is their indices, which are the
    /// `instance` of their hits; [`Scene::instance_path`] tells which part of the group each is.
    ///
    /// Transforms are multiplied in `f64`, from the outside to the inside.
    ///
    /// ```
    /// use firsthit_accel::{GroupMember, Geometry, SceneBuilder};
    /// use firsthit_geometry::{Ray, shapes::Sphere};
    /// use glam::{DAffine3, DVec3};
    ///
    /// let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    /// let mut builder = SceneBuilder::default();
    /// let ball = builder.add_mesh(vec![Geometry::Shape(Sphere::new(DVec3::ZERO, 1.0)?.into())]);
    /// let pair = builder.add_group([(GroupMember::Mesh(ball), at(0.0, 0.0, 0.0)), (GroupMember::Mesh(ball), at(5.0, 0.0, 0.0))]);
    /// let square = builder.add_group([(GroupMember::Group(pair), at(0.0, 0.0, 0.0)), (GroupMember::Group(pair), at(0.0, 5.0, 0.0))]);
    /// assert_eq!(builder.add_instances_of(square, at(0.0, 0.0, -9.0)), 0..4);
    ///
    /// let scene = builder.build()?;
    /// let hit = scene.closest_hit(&Ray::new(DVec3::new(5.0, 5.0, 0.0), DVec3::NEG_Z)).unwrap();
    /// assert_eq!((hit.id.instance, hit.t), (3, 8.0));
    /// // Of what was placed at 0: its child 1, and of that the child 1.
    /// assert_eq!(scene.instance_path(3), [0, 1, 1]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add_instances_of(&mut self, group: usize, transform: DAffine3) -> Range<usize> {
        let first = self.placed().len();
        let groups = self.groups_mut();
        let count = groups.groups.len();
        if group >= count {
            self.fail(BuildError::NoSuchGroup { group, count });
            return first..first;
        }
        // Groups of groups grow quickly: counted before they are made.
        let size = groups.size(GroupMember::Group(group));
        if let Err(error) = limit("instances", size.saturating_add(first as u64)) {
            self.fail(error);
            return first..first;
        }
        let mut new = Vec::new();
        if new.try_reserve_exact(size as usize).is_err() {
            self.fail(BuildError::TooMany { what: "instances", count: size, limit: 0 });
            return first..first;
        }
        let groups = self.groups_mut();
        groups.place(group, transform, &mut new);
        let range = first..first + new.len();
        groups.placed.push((range.clone(), group));
        self.placed_mut().extend(new);
        range
    }
}

impl Scene {
    /// Which part of a group an instance is: the first instance of the group that was placed, then the index of the child in each
    /// group from the outside to the inside. Of an instance that was placed alone, its own index.
    #[must_use]
    pub fn instance_path(&self, instance: u32) -> Vec<u32> {
        self.groups().path(instance as usize)
    }
}
