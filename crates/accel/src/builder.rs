//! Gathering what a scene is made of.

use firsthit_geometry::Shape;
use glam::{DAffine3, Vec3};

use crate::{BuildError, BuildOptions, Scene};

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
}

/// Gathers meshes and instances, then builds.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    options: BuildOptions,
    meshes: Vec<Vec<Geometry>>,
    instances: Vec<(usize, DAffine3)>,
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
            builder.add_mesh(geometries(mesh));
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
        self.instances.push((mesh, transform));
        self.instances.len() - 1
    }

    pub(crate) fn into_parts(self) -> (BuildOptions, Vec<Vec<Geometry>>, Vec<(usize, DAffine3)>) {
        (self.options, self.meshes, self.instances)
    }

    /// Builds one tree for each mesh and one over the instances, on the threads of the rayon pool it is called from.
    ///
    /// # Errors
    /// When a vertex, index or transform is unusable: see [`BuildError`].
    pub fn build(self) -> Result<Scene, BuildError> {
        Scene::new(self.options, &self.meshes, self.instances)
    }
}

/// The parts of a mesh of a file.
#[cfg(feature = "import")]
pub(crate) fn geometries(mesh: &firsthit_import::scene::MeshDesc) -> Vec<Geometry> {
    use firsthit_import::scene::SurfaceDesc;
    let part = |surface: &SurfaceDesc| match surface {
        SurfaceDesc::Triangles(m) => {
            Geometry::Triangles { positions: m.positions.clone(), triangles: m.triangles.clone() }
        }
        SurfaceDesc::Shape(s) => Geometry::Shape(s.clone()),
    };
    mesh.geometries.iter().map(|g| part(&g.surface)).collect()
}
