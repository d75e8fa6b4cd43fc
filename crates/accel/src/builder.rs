//! Gathering what a scene is made of.

use core::ops::ControlFlow;
use std::sync::Arc;

use firsthit_geometry::Shape;
use glam::{DAffine3, Vec3};

use crate::groups::Groups;
use crate::instance::Placed;
use crate::progress::Watch;
use crate::{BuildError, BuildOptions, Scene, UserPrimitives};

/// A part of a mesh.
#[allow(clippy::large_enum_variant, reason = "one for each shape of a scene, not for each primitive")]
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Indexed triangles.
    Triangles {
        /// Vertex positions in the mesh's space.
        positions: Vec<Vec3>,
        /// Vertices of each triangle.
        triangles: Vec<[u32; 3]>,
    },
    /// An analytic shape.
    Shape(Shape<f64>),
    /// Primitives of the user's own.
    User(Arc<dyn UserPrimitives>),
}

impl Geometry {
    /// The parts of a mesh of a file. Vertices that move are where they are when the camera's shutter opens.
    #[cfg(feature = "import")]
    #[must_use]
    pub fn from_desc(mesh: &firsthit_import::scene::MeshDesc) -> Vec<Self> {
        use firsthit_import::scene::SurfaceDesc;
        let part = |surface: &SurfaceDesc| match surface {
            SurfaceDesc::Triangles(m) => {
                Self::Triangles { positions: m.positions.clone(), triangles: m.triangles.clone() }
            }
            SurfaceDesc::Shape(s) => Self::Shape(s.clone()),
        };
        mesh.geometries.iter().map(|g| part(&g.surface)).collect()
    }

    /// How many primitives it has.
    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Triangles { triangles, .. } => triangles.len() as u64,
            Self::Shape(_) => 1,
            Self::User(user) => user.count().into(),
        }
    }
}

/// Gathers meshes and instances, then builds.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    options: BuildOptions,
    meshes: Vec<Vec<Geometry>>,
    instances: Vec<Placed>,
    groups: Groups,
    /// What went wrong first.
    error: Option<BuildError>,
}

impl SceneBuilder {
    /// An empty scene with these options.
    #[must_use]
    pub fn new(options: BuildOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// A builder filled from a file's content: mesh and instance indices are those of the description.
    #[cfg(feature = "import")]
    #[must_use]
    pub fn from_desc(desc: &firsthit_import::SceneDesc, options: BuildOptions) -> Self {
        let mut builder = Self::new(options);
        desc.meshes.iter().for_each(|mesh| {
            builder.add_mesh(Geometry::from_desc(mesh));
        });
        for i in &desc.instances {
            builder.add_instance(i.mesh, i.transform);
        }
        builder
    }

    /// Adds a mesh; the answer is its index, for [`SceneBuilder::add_instance`].
    pub fn add_mesh(&mut self, geometries: Vec<Geometry>) -> usize {
        self.meshes.push(geometries);
        self.meshes.len() - 1
    }

    /// Places a mesh in the world; the answer is the `instance` of its hits.
    pub fn add_instance(&mut self, mesh: usize, transform: DAffine3) -> usize {
        self.instances.push(Placed::new(mesh, transform));
        self.instances.len() - 1
    }

    /// Says to which layers an instance belongs, one bit each: [`Scene::seen_by`] asks about some of them. All instances
    /// belong to all layers at first; one that belongs to none is met by no query.
    ///
    /// An instance that does not exist is an error of [`SceneBuilder::build`].
    pub fn set_mask(&mut self, instance: usize, mask: u32) {
        let count = self.instances.len();
        match self.instances.get_mut(instance) {
            Some(placed) => placed.mask = mask,
            None => self.fail(BuildError::NoSuchInstance { instance, count }),
        }
    }

    /// Kept until it is built.
    pub(crate) fn fail(&mut self, error: BuildError) {
        self.error.get_or_insert(error);
    }

    pub(crate) fn placed(&self) -> &[Placed] {
        &self.instances
    }

    pub(crate) fn placed_mut(&mut self) -> &mut Vec<Placed> {
        &mut self.instances
    }

    pub(crate) fn groups_mut(&mut self) -> &mut Groups {
        &mut self.groups
    }

    pub(crate) fn into_parts(self) -> Result<Parts, BuildError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let Self { options, meshes, instances, groups, .. } = self;
        Ok(Parts { options, meshes, instances, groups: Arc::new(groups) })
    }

    /// Builds one tree for each mesh and one over the instances, on the threads of the rayon pool it is called from.
    ///
    /// # Errors
    /// When a vertex, index or transform is unusable, or the memory is limited: see [`BuildError`].
    pub fn build(self) -> Result<Scene, BuildError> {
        self.into_parts()?.build(None)
    }

    /// The same, watched: `watch` is told now and then, by any thread, which part of the work is done, from 0 to 1. If it
    /// breaks, the build is given up (what a thread has begun it finishes: of a large mesh, up to two thirds of its work). The tree over the instances, built last, is
    /// not counted.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use firsthit_accel::{BuildError, Geometry, SceneBuilder};
    /// use glam::Vec3;
    /// let mut builder = SceneBuilder::default();
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    /// assert!(builder.clone().build_watched(&|done| { eprint!("\r{:3.0} %", 100.0 * done); ControlFlow::Continue(()) }).is_ok());
    /// let cancelled = builder.build_watched(&|_| ControlFlow::Break(()));
    /// assert_eq!(cancelled.unwrap_err(), BuildError::Cancelled);
    /// ```
    ///
    /// # Errors
    /// As [`SceneBuilder::build`], and [`BuildError::Cancelled`].
    pub fn build_watched(self, watch: &(dyn Fn(f64) -> ControlFlow<()> + Sync)) -> Result<Scene, BuildError> {
        self.into_parts()?.build(Some(watch))
    }
}

/// What a builder has gathered.
pub(crate) struct Parts {
    pub(crate) options: BuildOptions,
    pub(crate) meshes: Vec<Vec<Geometry>>,
    pub(crate) instances: Vec<Placed>,
    pub(crate) groups: Arc<Groups>,
}

impl Parts {
    fn build(self, watch: Watch<'_>) -> Result<Scene, BuildError> {
        let Self { options, meshes, instances, groups } = self;
        Scene::new(options, &meshes, instances, groups, watch)
    }
}
