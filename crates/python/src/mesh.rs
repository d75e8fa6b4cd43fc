//! Triangles from arrays.

use firsthit_accel::{BuildError, BuildOptions, Geometry, SceneBuilder};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DVec3, Vec3};
use pyo3::prelude::*;

use crate::arrays::{Floats, Numbers};
use crate::error;

/// A mesh as scenes hold it: 32-bit positions, and where their origin lies.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) origin: DVec3,
}

impl Mesh {
    /// Vertices of shape `(n, 3)`. What 32 bits do not hold is stored as seen from the middle of the mesh, so that what
    /// is rounded is small against the mesh, however far from the origin it lies.
    ///
    /// # Errors
    /// When they have another shape, or one is not finite.
    pub(crate) fn new(vertices: &Bound<'_, PyAny>, triangles: Vec<[u32; 3]>) -> PyResult<Self> {
        let floats = Floats::new(vertices)?;
        let shape = floats.shape();
        if shape != [0] && (shape.len() != 2 || shape[1] != 3) {
            return Err(error::value(format_args!("vertices: shape {shape:?}; (n, 3) is needed")));
        }
        let wide = match floats.numbers() {
            Numbers::Narrow(numbers) => {
                let positions = numbers.as_chunks::<3>().0.iter().copied().map(Vec3::from).collect();
                return Ok(Self { positions, triangles, origin: DVec3::ZERO });
            }
            Numbers::Wide(numbers) => numbers.as_chunks::<3>().0,
        };
        let points = || wide.iter().copied().map(DVec3::from);
        if let Some(vertex) = points().position(|p| !p.is_finite()) {
            return Err(error::value(format_args!("vertices: vertex {vertex} is not finite")));
        }
        let origin = if points().all(|p| p.as_vec3().as_dvec3() == p) {
            DVec3::ZERO
        } else {
            let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
            0.5 * low + 0.5 * high
        };
        let positions = points().map(|p| (p - origin).as_vec3()).collect();
        Ok(Self { positions, triangles, origin })
    }

    fn placed(&self) -> DAffine3 {
        DAffine3::from_translation(self.origin)
    }

    /// # Errors
    /// When a vertex or index is unusable.
    pub(crate) fn build(&self, options: BuildOptions) -> Result<firsthit_accel::Scene, BuildError> {
        let mut builder = SceneBuilder::new(options);
        let mesh = builder.add_mesh(vec![Geometry::Triangles {
            positions: self.positions.clone(),
            triangles: self.triangles.clone(),
        }]);
        builder.add_instance(mesh, self.placed());
        builder.build()
    }

    /// The same as a scene that can be rendered, of the default material.
    pub(crate) fn desc(&self) -> SceneDesc {
        let (positions, triangles) = (self.positions.clone(), self.triangles.clone());
        let surface = SurfaceDesc::Triangles(TriangleMesh { positions, triangles, ..TriangleMesh::default() });
        let geometry = GeometryDesc { name: String::new(), surface, material: None };
        SceneDesc {
            meshes: vec![MeshDesc { name: String::new(), geometries: vec![geometry] }],
            instances: vec![InstanceDesc { name: String::new(), mesh: 0, transform: self.placed(), moves_to: None }],
            ..SceneDesc::default()
        }
    }
}
