//! Scenes that change: a new scene of an old one, which stays as it is for those who are asking it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use crate::instance::Placed;
use crate::memory::{self, AtOnce};
use crate::model::{Model, limit};
use crate::renew::{self, Followed, Step};
use crate::{BuildError, Geometry, Scene};

/// Changes to a scene, gathered: see [`Scene::update`].
#[derive(Clone, Debug)]
pub struct SceneUpdate {
    scene: Scene,
    placed: Vec<Placed>,
    /// New content of meshes, those that are added too.
    meshes: BTreeMap<usize, Vec<Geometry>>,
    /// How many meshes there will be.
    count: usize,
    error: Option<BuildError>,
}

impl Scene {
    /// Begins to change a scene: instances are moved, hidden, added and removed, vertices are moved, meshes are added, and
    /// [`SceneUpdate::finish`] makes a new scene of it. This one stays as it is, and so do its queries on other threads; the
    /// new scene shares with it all meshes that have not changed.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let at = |z: f32| Geometry::Triangles {
    ///     positions: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * z).to_vec(),
    ///     triangles: vec![[0, 1, 2]],
    /// };
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![at(0.0)]);
    /// let first = builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let before = builder.build()?;
    ///
    /// let mut update = before.update();
    /// let second = update.add_instance(mesh, DAffine3::from_translation(DVec3::Z * 2.0));
    /// update.move_vertices(mesh, vec![at(0.5)]);
    /// let (after, done) = update.finish()?;
    /// assert_eq!(done.refitted, 1);
    ///
    /// let t = |scene: &firsthit_accel::Scene| {
    ///     scene.closest_hit(&Ray::new(DVec3::new(0.2, 0.2, 5.0), DVec3::NEG_Z)).map(|hit| (hit.t, hit.id.instance as usize))
    /// };
    /// assert_eq!((t(&before), t(&after)), (Some((5.0, first)), Some((2.5, second))));
    ///
    /// let mut update = after.update();
    /// update.remove_instance(first).remove_instance(second);
    /// assert_eq!(t(&update.finish()?.0), None);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn update(&self) -> SceneUpdate {
        let (placed, count) = (self.placed().to_vec(), self.models().len());
        SceneUpdate { scene: self.clone(), placed, meshes: BTreeMap::new(), count, error: None }
    }
}

impl SceneUpdate {
    fn change(&mut self, instance: usize, change: impl FnOnce(&mut Placed)) -> &mut Self {
        let count = self.placed.len();
        match self.placed.get_mut(instance) {
            Some(placed) => change(placed),
            None => {
                self.error.get_or_insert(BuildError::NoSuchInstance { instance, count });
            }
        }
        self
    }

    /// Places an instance elsewhere.
    pub fn set_transform(&mut self, instance: usize, transform: DAffine3) -> &mut Self {
        self.change(instance, |placed| placed.transform = transform)
    }

    /// Puts an instance on other layers: see [`Scene::seen_by`].
    pub fn set_mask(&mut self, instance: usize, mask: u32) -> &mut Self {
        self.change(instance, |placed| placed.mask = mask)
    }

    /// Removes an instance: no query meets it any more. The others keep their indices, and its own is not given again (some
    /// hundred bytes are kept of it, which a scene built anew does not have).
    pub fn remove_instance(&mut self, instance: usize) -> &mut Self {
        self.set_mask(instance, 0)
    }

    /// Adds an instance; the answer is the `instance` of its hits.
    pub fn add_instance(&mut self, mesh: usize, transform: DAffine3) -> usize {
        self.placed.push(Placed::new(mesh, transform));
        self.placed.len() - 1
    }

    /// Adds a mesh; the answer is its index.
    pub fn add_mesh(&mut self, geometries: Vec<Geometry>) -> usize {
        self.count += 1;
        self.meshes.insert(self.count - 1, geometries);
        self.count - 1
    }

    /// Gives a mesh other vertices (or shapes), as [`Scene::refit`] does: as many geometries of the same kind with as many
    /// triangles as before. Its tree gets new boxes; if that makes it half as costly again as when it was built (by the
    /// surface area heuristic), it is built anew.
    pub fn move_vertices(&mut self, mesh: usize, geometries: Vec<Geometry>) -> &mut Self {
        if mesh >= self.count {
            self.error.get_or_insert(BuildError::UnknownMesh { mesh, count: self.count });
        } else {
            self.meshes.insert(mesh, geometries);
        }
        self
    }

    /// The scene with all changes, and what was done for it. Trees are built and refitted on the threads of the rayon pool it is
    /// called from; the tree over the instances is always built anew.
    ///
    /// # Errors
    /// When a change names what does not exist, a vertex, index or transform is unusable, or the memory is limited: see
    /// [`BuildError`].
    pub fn finish(&self) -> Result<(Scene, Followed), BuildError> {
        if let Some(error) = &self.error {
            return Err(error.clone());
        }
        limit("meshes", self.count as u64)?;
        limit("instances", self.placed.len() as u64)?;
        let (old, options) = (self.scene.models(), self.scene.options());
        let renewed = |i: usize| match (old.get(i), self.meshes.get(&i)) {
            (Some(old), None) => Ok((Arc::clone(old), Step::Kept)),
            (Some(old), Some(parts)) => renew::moved(old, i, parts, options),
            (None, parts) => {
                let parts = parts.map_or(&[][..], |parts| parts);
                Ok((Arc::new(Model::new(i, parts, options)?), Step::Built))
            }
        };
        let made: Vec<_> = match memory::check(self.meshes.values(), self.placed.len(), options)? {
            AtOnce::All => (0..self.count).into_par_iter().map(renewed).collect::<Result<_, BuildError>>()?,
            AtOnce::One => (0..self.count).map(renewed).collect::<Result<_, BuildError>>()?,
        };
        let followed = Followed::of(made.iter().map(|(_, step)| *step));
        let models = made.into_iter().map(|(model, _)| model).collect();
        let (mask, groups) = (self.scene.mask(), Arc::clone(self.scene.groups()));
        Ok((Scene::place(options, models, self.placed.clone(), mask, groups)?, followed))
    }
}
