//! Triangles from arrays.

use firsthit_accel::{BuildError, BuildOptions, Geometry, SceneBuilder};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use pyo3::prelude::*;

use crate::arrays::{Floats, Numbers};
use crate::error;

/// A mesh as scenes hold it: 32-bit positions, and where their origin lies.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) origin: DVec3,
    /// Where it is, and on which layers.
    pub(crate) places: Vec<(DAffine3, u32)>,
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
                return Ok(Self { positions, triangles, origin: DVec3::ZERO, places: once() });
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
        Ok(Self { positions, triangles, origin, places: once() })
    }

    /// Places of an array of matrices of shape `(n, 4, 4)`, and one mask for each.
    ///
    /// # Errors
    /// When the arrays have another shape, a last row is not 0, 0, 0, 1, or a mask is no number of 32 bits.
    pub(crate) fn place(
        &mut self,
        transforms: Option<&Bound<'_, PyAny>>,
        masks: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        if let Some(transforms) = transforms {
            // Masks stay, by index.
            let old = self.places.iter().map(|(_, mask)| *mask).chain(core::iter::repeat(u32::MAX));
            self.places = matrices(transforms)?.into_iter().zip(old).collect();
        }
        let Some(masks) = masks else { return Ok(()) };
        let masks: Vec<u32> = masks
            .extract()
            .map_err(|e| error::value(format_args!("masks: numbers from 0 to 2^32 - 1 are needed ({e})")))?;
        if masks.len() != self.places.len() {
            let (masks, places) = (masks.len(), self.places.len());
            return Err(error::value(format_args!("{masks} masks for {places} instances")));
        }
        self.places.iter_mut().zip(masks).for_each(|((_, mask), new)| *mask = new);
        Ok(())
    }

    /// From the mesh as it is stored to the world, with a mask.
    pub(crate) fn placed(&self) -> impl Iterator<Item = (DAffine3, u32)> + '_ {
        let origin = DAffine3::from_translation(self.origin);
        self.places.iter().map(move |(m, mask)| (*m * origin, *mask))
    }

    pub(crate) fn geometry(&self) -> Geometry {
        Geometry::Triangles { positions: self.positions.clone(), triangles: self.triangles.clone() }
    }

    /// # Errors
    /// When a vertex or index is unusable.
    pub(crate) fn build(&self, options: BuildOptions) -> Result<firsthit_accel::Scene, BuildError> {
        let mut builder = SceneBuilder::new(options);
        let mesh = builder.add_mesh(vec![self.geometry()]);
        for (transform, mask) in self.placed() {
            let instance = builder.add_instance(mesh, transform);
            builder.set_mask(instance, mask);
        }
        builder.build()
    }

    /// What of it these layers see, as a scene that can be rendered, of the default material.
    pub(crate) fn desc(&self, mask: u32) -> SceneDesc {
        let (positions, triangles) = (self.positions.clone(), self.triangles.clone());
        let surface = SurfaceDesc::Triangles(TriangleMesh { positions, triangles, ..TriangleMesh::default() });
        let instance = |transform| InstanceDesc { name: String::new(), mesh: 0, transform, moves_to: None };
        let geometry = GeometryDesc { name: String::new(), surface, material: None };
        SceneDesc {
            meshes: vec![MeshDesc { name: String::new(), geometries: vec![geometry] }],
            instances: self.placed().filter(|(_, own)| own & mask != 0).map(|(m, _)| instance(m)).collect(),
            ..SceneDesc::default()
        }
    }
}

/// Where it is, for all.
pub(crate) fn once() -> Vec<(DAffine3, u32)> {
    vec![(DAffine3::IDENTITY, u32::MAX)]
}

/// Affine maps of an array of shape `(n, 4, 4)`, or `(4, 4)` for one.
fn matrices(object: &Bound<'_, PyAny>) -> PyResult<Vec<DAffine3>> {
    let floats = Floats::new(object)?;
    let shape = floats.shape();
    if !matches!(shape, [4, 4] | [_, 4, 4]) {
        return Err(error::value(format_args!("transforms: shape {shape:?}; (n, 4, 4) is needed")));
    }
    let (count, numbers) = (shape.iter().product::<usize>() / 16, floats.numbers());
    let matrix = |i: usize| {
        let at = |row: usize, column: usize| numbers.get(16 * i + 4 * row + column);
        if [at(3, 0), at(3, 1), at(3, 2), at(3, 3)] != [0.0, 0.0, 0.0, 1.0] {
            return Err(error::value(format_args!("transforms: the last row of matrix {i} is not 0, 0, 0, 1")));
        }
        let column = |c| DVec3::new(at(0, c), at(1, c), at(2, c));
        Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) })
    };
    (0..count).map(matrix).collect()
}

/// The matrices as [`matrices`] reads them.
pub(crate) fn rows(places: &[(DAffine3, u32)]) -> Vec<f64> {
    let of = |(m, _): &(DAffine3, u32)| {
        let (m, t) = (m.matrix3, m.translation);
        let row = |r: usize| [m.x_axis[r], m.y_axis[r], m.z_axis[r], t[r]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]].concat()
    };
    places.iter().flat_map(of).collect()
}
