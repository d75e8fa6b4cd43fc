//! Answers: arrays that are made when they are asked for.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

use firsthit_accel::{ClosestPoint, Hit};
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyList;

use crate::arrays::module;

/// The id of what there is not.
pub(crate) const INVALID_ID: u32 = u32::MAX;

/// Values of one kind. One alone needs no memory of its own: asked for one by one, that would take as long as the answer.
pub(crate) enum Values<T> {
    One([T; 1]),
    Many(Vec<T>),
}

impl<T: Clone> Values<T> {
    /// So many times the same. (Memory that is all zeros is not touched before it is written.)
    pub(crate) fn all(value: T, count: usize) -> Self {
        if count == 1 { Self::One([value]) } else { Self::Many(vec![value; count]) }
    }
}

impl<T> Values<T> {
    fn into_vec(self) -> Vec<T> {
        match self {
            Self::One(one) => one.into(),
            Self::Many(values) => values,
        }
    }
}

impl<T> Deref for Values<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        match self {
            Self::One(one) => one,
            Self::Many(values) => values,
        }
    }
}

impl<T> DerefMut for Values<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match self {
            Self::One(one) => one,
            Self::Many(values) => values,
        }
    }
}

/// The values of one field: as they were found, until they become an array.
pub(crate) struct Field<T> {
    found: Mutex<Values<T>>,
    array: PyOnceLock<Py<PyAny>>,
}

impl<T> Field<T> {
    pub(crate) fn new(found: Values<T>) -> Self {
        Self { found: Mutex::new(found), array: PyOnceLock::new() }
    }

    /// The array, with the numbers of each value as its last dimension; always the same one.
    fn get<U: Element>(
        &self,
        py: Python<'_>,
        shape: &[usize],
        last: Option<usize>,
        flat: impl FnOnce(Vec<T>) -> Vec<U>,
    ) -> PyResult<Py<PyAny>> {
        let array = self.array.get_or_try_init(py, || {
            let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
            let found = std::mem::replace(&mut *found, Values::Many(Vec::new()));
            let array = PyArray1::from_vec(py, flat(found.into_vec()));
            let shape: Vec<usize> = shape.iter().copied().chain(last).collect();
            PyResult::Ok(array.reshape(shape)?.into_any().unbind())
        })?;
        Ok(array.clone_ref(py))
    }
}

/// Values by field.
pub(crate) struct Found {
    t: Values<f64>,
    instances: Values<u32>,
    geometries: Values<u32>,
    primitives: Values<u32>,
    uvs: Values<[f32; 2]>,
    normals: Values<[f64; 3]>,
}

/// Part of [`Found`] to be filled.
pub(crate) struct Slots<'a> {
    pub(crate) t: &'a mut [f64],
    pub(crate) instances: &'a mut [u32],
    pub(crate) geometries: &'a mut [u32],
    pub(crate) primitives: &'a mut [u32],
    pub(crate) uvs: &'a mut [[f32; 2]],
    pub(crate) normals: &'a mut [[f64; 3]],
}

impl Found {
    /// Room for so many.
    pub(crate) fn zeroed(count: usize) -> Self {
        Self {
            t: Values::all(0.0, count),
            instances: Values::all(0, count),
            geometries: Values::all(0, count),
            primitives: Values::all(0, count),
            uvs: Values::all([0.0; 2], count),
            normals: Values::all([0.0; 3], count),
        }
    }

    pub(crate) fn slots(&mut self) -> Slots<'_> {
        Slots {
            t: &mut self.t,
            instances: &mut self.instances,
            geometries: &mut self.geometries,
            primitives: &mut self.primitives,
            uvs: &mut self.uvs,
            normals: &mut self.normals,
        }
    }
}

impl<'a> Slots<'a> {
    /// Cut into parts of so many; the last may be shorter.
    pub(crate) fn chunks(self, size: usize) -> Vec<Slots<'a>> {
        let rest = self.instances.chunks_mut(size).zip(self.geometries.chunks_mut(size));
        let rest = rest.zip(self.primitives.chunks_mut(size)).zip(self.uvs.chunks_mut(size));
        let all = self.t.chunks_mut(size).zip(self.normals.chunks_mut(size)).zip(rest);
        all.map(|((t, normals), (((instances, geometries), primitives), uvs))| Slots {
            t,
            instances,
            geometries,
            primitives,
            uvs,
            normals,
        })
        .collect()
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, hit: Option<&Hit>) {
        match hit {
            Some(hit) => {
                self.t[i] = hit.t;
                self.instances[i] = hit.id.instance;
                self.geometries[i] = hit.id.geometry;
                self.primitives[i] = hit.id.primitive;
                self.uvs[i] = [hit.u, hit.v];
                self.normals[i] = hit.normal().to_array();
            }
            None => {
                self.t[i] = f64::INFINITY;
                self.instances[i] = INVALID_ID;
                self.geometries[i] = INVALID_ID;
                self.primitives[i] = INVALID_ID;
            }
        }
    }
}

/// Nearest points: `t` is the distance.
impl Slots<'_> {
    #[inline(always)]
    pub(crate) fn set_nearest(&mut self, i: usize, near: Option<&ClosestPoint>, place: &mut [f64; 3]) {
        *place = near.map_or([f64::NAN; 3], |near| near.point.to_array());
        let hit = near.map(|near| Hit {
            id: near.id,
            t: near.distance,
            u: near.u,
            v: near.v,
            normal_direction: near.normal_direction,
        });
        self.set(i, hit.as_ref());
    }
}

/// The fields that all answers have.
struct Fields {
    shape: Vec<usize>,
    t: Field<f64>,
    instances: Field<u32>,
    geometries: Field<u32>,
    primitives: Field<u32>,
    uvs: Field<[f32; 2]>,
    normals: Field<[f64; 3]>,
}

const KEYS: [&str; 6] =
    ["t_hit", "instance_ids", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals"];

impl Fields {
    fn new(shape: Vec<usize>, found: Found) -> Self {
        Self {
            shape,
            t: Field::new(found.t),
            instances: Field::new(found.instances),
            geometries: Field::new(found.geometries),
            primitives: Field::new(found.primitives),
            uvs: Field::new(found.uvs),
            normals: Field::new(found.normals),
        }
    }

    fn get(&self, py: Python<'_>, key: &str) -> PyResult<Py<PyAny>> {
        let shape = &self.shape;
        match key {
            "t_hit" => self.t.get(py, shape, None, |t| t),
            "instance_ids" => self.instances.get(py, shape, None, |ids| ids),
            "geometry_ids" => self.geometries.get(py, shape, None, |ids| ids),
            "primitive_ids" => self.primitives.get(py, shape, None, |ids| ids),
            "primitive_uvs" => self.uvs.get(py, shape, Some(2), Vec::into_flattened),
            "primitive_normals" => self.normals.get(py, shape, Some(3), Vec::into_flattened),
            other => Err(PyKeyError::new_err(other.to_owned())),
        }
    }
}

/// Closest hits; see `_firsthit.pyi`.
#[pyclass(frozen, module = "firsthit")]
pub struct Hits(Fields);

impl Hits {
    pub(crate) fn new(shape: Vec<usize>, found: Found) -> Self {
        Self(Fields::new(shape, found))
    }
}

#[pymethods]
impl Hits {
    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(pyo3::types::PyTuple::new(py, &self.0.shape)?.into_any().unbind())
    }

    #[getter]
    fn hit(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let t = self.0.get(py, "t_hit")?;
        Ok(module(py)?.call_method1("isfinite", (t,))?.unbind())
    }

    #[getter]
    fn t_hit(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "t_hit")
    }

    #[getter]
    fn instance_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "instance_ids")
    }

    #[getter]
    fn geometry_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "geometry_ids")
    }

    #[getter]
    fn primitive_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "primitive_ids")
    }

    #[getter]
    fn primitive_uvs(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "primitive_uvs")
    }

    #[getter]
    fn primitive_normals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.get(py, "primitive_normals")
    }

    fn __getitem__(&self, py: Python<'_>, key: &str) -> PyResult<Py<PyAny>> {
        self.0.get(py, key)
    }

    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, KEYS)
    }

    fn __repr__(&self) -> String {
        format!("<firsthit.Hits of shape {:?}>", self.0.shape)
    }
}

/// Nearest points of the surface; see `_firsthit.pyi`.
#[pyclass(frozen, module = "firsthit")]
pub struct ClosestPoints {
    fields: Fields,
    points: Field<[f64; 3]>,
}

impl ClosestPoints {
    pub(crate) fn new(shape: Vec<usize>, found: Found, points: Values<[f64; 3]>) -> Self {
        Self { fields: Fields::new(shape, found), points: Field::new(points) }
    }
}

#[pymethods]
impl ClosestPoints {
    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(pyo3::types::PyTuple::new(py, &self.fields.shape)?.into_any().unbind())
    }

    #[getter]
    fn points(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.points.get(py, &self.fields.shape, Some(3), Vec::into_flattened)
    }

    #[getter]
    fn distance(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "t_hit")
    }

    #[getter]
    fn instance_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "instance_ids")
    }

    #[getter]
    fn geometry_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "geometry_ids")
    }

    #[getter]
    fn primitive_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_ids")
    }

    #[getter]
    fn primitive_uvs(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_uvs")
    }

    #[getter]
    fn primitive_normals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_normals")
    }

    fn __getitem__(&self, py: Python<'_>, key: &str) -> PyResult<Py<PyAny>> {
        match key {
            "points" => self.points(py),
            "distance" => self.distance(py),
            "t_hit" => Err(PyKeyError::new_err("t_hit")),
            other => self.fields.get(py, other),
        }
    }

    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, ["points", "distance"].iter().chain(&KEYS[1..]))
    }

    fn __repr__(&self) -> String {
        format!("<firsthit.ClosestPoints of shape {:?}>", self.fields.shape)
    }
}

/// All hits, one list after the other; see `_firsthit.pyi`.
#[pyclass(frozen, module = "firsthit")]
pub struct HitLists {
    fields: Fields,
    /// The shape of the rays.
    shape: Vec<usize>,
    splits: Field<i64>,
    rays: Field<i64>,
}

impl HitLists {
    /// `splits`: where each ray's hits begin, and the end of the last.
    pub(crate) fn new(shape: Vec<usize>, splits: Vec<i64>, found: Found) -> Self {
        let mut rays = Vec::with_capacity(found.t.len());
        for (ray, ends) in (0..).zip(splits.windows(2)) {
            rays.resize(ends[1] as usize, ray);
        }
        let fields = Fields::new(vec![found.t.len()], found);
        Self { fields, shape, splits: Field::new(Values::Many(splits)), rays: Field::new(Values::Many(rays)) }
    }
}

#[pymethods]
impl HitLists {
    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(pyo3::types::PyTuple::new(py, &self.shape)?.into_any().unbind())
    }

    #[getter]
    fn ray_splits(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.splits.get(py, &[self.shape.iter().product::<usize>() + 1], None, |s| s)
    }

    #[getter]
    fn ray_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.rays.get(py, &self.fields.shape, None, |r| r)
    }

    #[getter]
    fn t_hit(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "t_hit")
    }

    #[getter]
    fn instance_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "instance_ids")
    }

    #[getter]
    fn geometry_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "geometry_ids")
    }

    #[getter]
    fn primitive_ids(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_ids")
    }

    #[getter]
    fn primitive_uvs(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_uvs")
    }

    #[getter]
    fn primitive_normals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.fields.get(py, "primitive_normals")
    }

    fn __getitem__(&self, py: Python<'_>, key: &str) -> PyResult<Py<PyAny>> {
        match key {
            "ray_splits" => self.ray_splits(py),
            "ray_ids" => self.ray_ids(py),
            other => self.fields.get(py, other),
        }
    }

    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, ["ray_splits", "ray_ids"].into_iter().chain(KEYS).collect::<Vec<_>>())
    }

    fn __len__(&self) -> usize {
        self.fields.shape[0]
    }

    fn __repr__(&self) -> String {
        format!("<firsthit.HitLists of {} hits, rays of shape {:?}>", self.fields.shape[0], self.shape)
    }
}
