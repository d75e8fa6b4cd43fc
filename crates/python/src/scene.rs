//! Scenes and what they are asked.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use firsthit_accel::{BuildOptions, BuildQuality, Crossings, SceneBuilder, SignMethod, Solid};
use firsthit_geometry::{Precision, Ray};
use firsthit_import::{Imported, Options, UpAxis};
use glam::{DVec3, Vec3};
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;

use crate::arrays::triangles;
use crate::change;
use crate::error;
use crate::hits::{ClosestPoints, Found, HitLists, Hits, Slots};
use crate::mesh::{Mesh, once, rows};
use crate::points;
use crate::pool::pool;
use crate::rays::Rays;

/// Rays or points that one task takes.
pub(crate) const CHUNK: usize = 1024;

/// So few are answered at once, without letting Python go.
const FEW: usize = 16;

/// Where a scene comes from: what it is pickled and rendered by.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Arrays(Arc<Mesh>),
    File { path: PathBuf, up: Option<String>, variant: Option<String> },
}

/// A scene; see `_firsthit.pyi`.
#[pyclass(frozen, module = "firsthit", subclass)]
pub struct Scene {
    scene: firsthit_accel::Scene,
    pub(crate) source: Source,
    warnings: Vec<String>,
    /// Only instances of these layers are met.
    pub(crate) mask: u32,
    /// By how inside is told from outside; made when it is first asked about.
    pub(crate) solids: Mutex<Vec<(Option<SignMethod>, Arc<Solid>)>>,
    /// What was last seen by masks of single calls, the latest at the end.
    views: Mutex<Vec<Arc<Self>>>,
}

/// So many of them are kept.
const VIEWS: usize = 8;

/// What a call is about: the scene itself, or what is seen of it by the call's mask.
enum Seen<'a> {
    All(&'a Scene),
    Masked(Arc<Scene>),
}

impl Deref for Seen<'_> {
    type Target = Scene;

    fn deref(&self) -> &Scene {
        match self {
            Self::All(scene) => scene,
            Self::Masked(scene) => scene,
        }
    }
}

/// How trees are built, by name.
pub(crate) fn build_options(precision: &str, quality: &str) -> PyResult<BuildOptions> {
    let precision: Precision = precision.parse().map_err(error::value)?;
    let quality = match quality {
        "fast" => BuildQuality::Fast,
        "balanced" => BuildQuality::Balanced,
        "high" => BuildQuality::High,
        other => return Err(error::value(format_args!("unknown quality '{other}' (fast, balanced or high)"))),
    };
    Ok(BuildOptions { precision, quality, ..BuildOptions::default() })
}

fn crossings(name: &str) -> PyResult<Crossings> {
    match name {
        "triangles" => Ok(Crossings::Triangles),
        "surfaces" => Ok(Crossings::Surfaces),
        other => Err(error::value(format_args!("unknown crossings '{other}' (triangles or surfaces)"))),
    }
}

fn quality_name(quality: BuildQuality) -> &'static str {
    match quality {
        BuildQuality::Fast => "fast",
        BuildQuality::Balanced => "balanced",
        BuildQuality::High => "high",
    }
}

impl Source {
    /// Reads the file, with what could be read only in part; an array has all in it.
    pub(crate) fn read(&self, mask: u32) -> PyResult<(firsthit_import::SceneDesc, Vec<String>)> {
        match self {
            Self::Arrays(mesh) => Ok((mesh.desc(mask), Vec::new())),
            Self::File { path, up, variant } => {
                let up = up.as_deref().map(str::parse::<UpAxis>).transpose().map_err(error::value)?;
                let options = Options {
                    up,
                    variant: variant.clone(),
                    decode: firsthit_import::Decode::Seen,
                    ..Options::default()
                };
                let Imported { mut scene, report } =
                    firsthit_import::open(path, &options).map_err(|e| error::import(&e))?;
                // All its instances are on all layers.
                if mask == 0 {
                    scene.instances.clear();
                }
                Ok((scene, report.warnings.iter().map(ToString::to_string).collect()))
            }
        }
    }
}

impl Scene {
    pub(crate) fn options(&self) -> BuildOptions {
        self.scene.options()
    }

    fn of_mesh(py: Python<'_>, mesh: Mesh, options: BuildOptions, threads: usize) -> PyResult<Self> {
        let pool = pool(threads)?;
        let scene = py.detach(|| pool.install(|| mesh.build(options))).map_err(error::value)?;
        let (source, warnings) = (Source::Arrays(Arc::new(mesh)), Vec::new());
        Ok(Self { scene, source, warnings, mask: u32::MAX, solids: Mutex::default(), views: Mutex::default() })
    }

    /// As this one, but of other trees.
    pub(crate) fn of_trees(&self, scene: firsthit_accel::Scene, source: Source) -> Self {
        Self {
            scene,
            source,
            warnings: self.warnings.clone(),
            mask: self.mask,
            solids: Mutex::default(),
            views: Mutex::default(),
        }
    }

    /// With instances of these layers only.
    fn masked(&self, mask: u32) -> Self {
        Self { mask, ..self.of_trees(self.scene.seen_by(mask), self.source.clone()) }
    }

    /// What a call with this mask is about.
    fn seen(&self, py: Python<'_>, mask: Option<u32>) -> Seen<'_> {
        let Some(mask) = mask.filter(|mask| *mask != self.mask) else { return Seen::All(self) };
        // It is locked only for a look, never while Python may be let go.
        let views = || self.views.lock().unwrap_or_else(PoisonError::into_inner);
        let known = views().iter().find(|view| view.mask == mask).cloned();
        Seen::Masked(known.unwrap_or_else(|| {
            let view = Arc::new(py.detach(|| self.masked(mask)));
            let mut views = views();
            let most = views.len().saturating_sub(VIEWS - 1);
            views.drain(..most);
            views.push(view.clone());
            view
        }))
    }

    fn open(py: Python<'_>, source: Source, options: BuildOptions, threads: usize) -> PyResult<Self> {
        let pool = pool(threads)?;
        let (scene, warnings) = py.detach(|| {
            pool.install(|| {
                let (desc, warnings) = source.read(u32::MAX)?;
                let scene = SceneBuilder::from_desc(&desc, options).build().map_err(error::value)?;
                PyResult::Ok((scene, warnings))
            })
        })?;
        Ok(Self { scene, source, warnings, mask: u32::MAX, solids: Mutex::default(), views: Mutex::default() })
    }

    pub(crate) fn trees(&self) -> &firsthit_accel::Scene {
        &self.scene
    }
}

/// One value for each of some rays or points, from a function of many.
pub(crate) fn each<'py, Q, T: Element + Copy + Default + Send>(
    py: Python<'py>,
    shape: &[usize],
    item: impl Fn(usize) -> Q + Sync,
    threads: usize,
    answer: impl Fn(&[Q], &mut [T]) + Sync,
) -> PyResult<Bound<'py, PyAny>> {
    let count = shape.iter().product();
    let mut answers = vec![T::default(); count];
    let parts: Vec<&mut [T]> = answers.chunks_mut(CHUNK).collect();
    in_chunks(py, (count, item), threads, parts, |items, part| answer(items, part))?;
    Ok(PyArray1::from_vec(py, answers).reshape(shape.to_vec())?.into_any())
}

/// Gives each chunk of so many rays or points its part of the answers, on threads unless there are few.
pub(crate) fn in_chunks<Q, P: Send>(
    py: Python<'_>,
    (count, item): (usize, impl Fn(usize) -> Q + Sync),
    threads: usize,
    parts: Vec<P>,
    answer: impl Fn(&[Q], P) + Sync,
) -> PyResult<()> {
    let one = |buffer: &mut Vec<Q>, chunk: usize, part: P| {
        buffer.clear();
        buffer.extend((chunk * CHUNK..count.min((chunk + 1) * CHUNK)).map(&item));
        answer(buffer, part);
    };
    let in_turn = |parts: Vec<P>| {
        let mut buffer = Vec::with_capacity(CHUNK.min(count));
        parts.into_iter().enumerate().for_each(|(chunk, part)| one(&mut buffer, chunk, part));
    };
    if count <= FEW {
        in_turn(parts);
    } else if threads == 1 || count <= CHUNK {
        py.detach(|| in_turn(parts));
    } else {
        let pool = pool(threads)?;
        py.detach(|| {
            pool.install(|| {
                let parts = parts.into_par_iter().enumerate();
                parts.for_each_init(Vec::new, |buffer, (chunk, part)| one(buffer, chunk, part));
            });
        });
    }
    Ok(())
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (vertices, triangles=None, *, transforms=None, masks=None, precision="robust", quality="balanced", threads=0))]
    #[allow(clippy::too_many_arguments, reason = "named in Python")]
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        transforms: Option<&Bound<'_, PyAny>>,
        masks: Option<&Bound<'_, PyAny>>,
        precision: &str,
        quality: &str,
        threads: usize,
    ) -> PyResult<Self> {
        let options = build_options(precision, quality)?;
        let mut mesh = match triangles {
            Some(triangles) => Mesh::new(vertices, self::triangles(triangles)?)?,
            // A mesh of trimesh, or of Open3D.
            None if vertices.hasattr("vertices")? => {
                let name = if vertices.hasattr("faces")? { "faces" } else { "triangles" };
                Mesh::new(&vertices.getattr("vertices")?, self::triangles(&vertices.getattr(name)?)?)?
            }
            None => return Err(error::value("vertices and triangles are needed, or an object that has them")),
        };
        mesh.place(transforms, masks)?;
        Self::of_mesh(py, mesh, options, threads)
    }

    #[pyo3(signature = (vertices, *, threads=0))]
    fn refit(&self, py: Python<'_>, vertices: &Bound<'_, PyAny>, threads: usize) -> PyResult<Self> {
        change::refit(py, self, vertices, threads)
    }

    #[pyo3(signature = (transforms, *, masks=None, threads=0))]
    fn with_transforms(
        &self,
        py: Python<'_>,
        transforms: &Bound<'_, PyAny>,
        masks: Option<&Bound<'_, PyAny>>,
        threads: usize,
    ) -> PyResult<Self> {
        change::with_transforms(py, self, transforms, masks, threads)
    }

    fn seen_by(&self, py: Python<'_>, mask: u32) -> Self {
        py.detach(|| self.masked(mask))
    }

    #[pyo3(signature = (rays, directions=None, *, t_min=None, t_max=None, mask=None, threads=0))]
    fn closest_hit(
        &self,
        py: Python<'_>,
        rays: &Bound<'_, PyAny>,
        directions: Option<&Bound<'_, PyAny>>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Hits> {
        let rays = Rays::new(rays, directions, t_min, t_max)?;
        let seen = self.seen(py, mask);
        let view = rays.view();
        let mut found = Found::zeroed(rays.count);
        if rays.count == 1 {
            found.slots().set(0, seen.scene.closest_hit(&view.ray(0)).as_ref());
            return Ok(Hits::new(rays.shape, found));
        }
        let parts = found.slots().chunks(CHUNK);
        in_chunks(py, (rays.count, |i| view.ray(i)), threads, parts, |rays, mut part: Slots<'_>| {
            // On the stack: it is filled anew for each few, and stays near.
            let mut hits = [None; 64];
            for (k, rays) in rays.chunks(hits.len()).enumerate() {
                let hits = &mut hits[..rays.len()];
                seen.scene.closest_hits(rays, hits);
                for (i, hit) in hits.iter().enumerate() {
                    part.set(64 * k + i, hit.as_ref());
                }
            }
        })?;
        Ok(Hits::new(rays.shape, found))
    }

    /// The name of the slice form in Rust: here one does it all.
    #[pyo3(signature = (rays, directions=None, *, t_min=None, t_max=None, mask=None, threads=0))]
    fn closest_hits(
        &self,
        py: Python<'_>,
        rays: &Bound<'_, PyAny>,
        directions: Option<&Bound<'_, PyAny>>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Hits> {
        self.closest_hit(py, rays, directions, t_min, t_max, mask, threads)
    }

    #[pyo3(signature = (rays, directions=None, *, t_min=None, t_max=None, mask=None, threads=0))]
    fn any_hit<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rays = Rays::new(rays, directions, t_min, t_max)?;
        let seen = self.seen(py, mask);
        let view = rays.view();
        each(py, &rays.shape, |i| view.ray(i), threads, |rays, hits| seen.scene.any_hits(rays, hits))
    }

    #[pyo3(signature = (rays, directions=None, *, t_min=None, t_max=None, crossings="triangles", mask=None, threads=0))]
    fn count_hits<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        crossings: &str,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let crossings = self::crossings(crossings)?;
        let rays = Rays::new(rays, directions, t_min, t_max)?;
        let seen = self.seen(py, mask);
        let view = rays.view();
        let count = |rays: &[Ray<f64>], counts: &mut [u32]| seen.scene.count_hits_each(rays, crossings, counts);
        each(py, &rays.shape, |i| view.ray(i), threads, count)
    }

    #[pyo3(signature = (rays, directions=None, *, t_min=None, t_max=None, crossings="triangles", mask=None, threads=0))]
    fn all_hits(
        &self,
        py: Python<'_>,
        rays: &Bound<'_, PyAny>,
        directions: Option<&Bound<'_, PyAny>>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        crossings: &str,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<HitLists> {
        let crossings = self::crossings(crossings)?;
        let rays = Rays::new(rays, directions, t_min, t_max)?;
        let seen = self.seen(py, mask);
        let mut lists = vec![firsthit_accel::HitLists::default(); rays.count.div_ceil(CHUNK)];
        let parts: Vec<_> = lists.iter_mut().collect();
        let view = rays.view();
        in_chunks(py, (rays.count, |i| view.ray(i)), threads, parts, |rays, list| {
            *list = seen.scene.all_hits_each(rays, crossings);
        })?;
        let (splits, found) = py.detach(|| {
            let total = lists.iter().map(|l| l.hits().len()).sum();
            let mut splits = Vec::with_capacity(rays.count + 1);
            splits.push(0);
            let mut found = Found::zeroed(total);
            let mut slots = found.slots();
            let mut end = 0;
            for hits in lists.iter().flat_map(firsthit_accel::HitLists::iter) {
                for hit in hits {
                    slots.set(end, Some(hit));
                    end += 1;
                }
                splits.push(end as i64);
            }
            (splits, found)
        });
        Ok(HitLists::new(rays.shape, splits, found))
    }

    #[pyo3(signature = (points, *, radius=None, mask=None, threads=0))]
    fn closest_point(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        radius: Option<&Bound<'_, PyAny>>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<ClosestPoints> {
        points::closest(&self.seen(py, mask), py, points, radius, threads)
    }

    #[pyo3(signature = (points, *, mask=None, threads=0))]
    fn furthest_point(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<ClosestPoints> {
        points::furthest(&self.seen(py, mask), py, points, threads)
    }

    #[pyo3(signature = (points, *, mask=None, threads=0))]
    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        points::distance(&self.seen(py, mask), py, points, threads)
    }

    #[pyo3(signature = (points, *, sign="auto", mask=None, threads=0))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        sign: &str,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        points::signed_distance(&self.seen(py, mask), py, points, sign, threads)
    }

    #[pyo3(signature = (points, *, sign="auto", mask=None, threads=0))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        sign: &str,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        points::contains(&self.seen(py, mask), py, points, sign, threads)
    }

    #[pyo3(signature = (points, *, sign="auto", mask=None, threads=0))]
    fn winding_number<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        sign: &str,
        mask: Option<u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        points::winding_number(&self.seen(py, mask), py, points, sign, threads)
    }

    fn is_watertight(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(points::solid(self, py, "auto", 0)?.is_watertight())
    }

    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bounds = self.scene.bounds();
        let corners = [bounds.min.to_array(), bounds.max.to_array()].concat();
        Ok(PyArray1::from_vec(py, corners).reshape([2, 3])?.into_any())
    }

    #[getter]
    fn precision(&self) -> &'static str {
        self.options().precision.name()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = self.scene.stats();
        let out = PyDict::new(py);
        out.set_item("stored_triangles", stats.stored_triangles)?;
        out.set_item("instanced_triangles", stats.instanced_triangles)?;
        out.set_item("instances", stats.instances)?;
        out.set_item("degenerate_triangles", stats.degenerate_triangles)?;
        out.set_item("bytes", stats.bytes)?;
        out.set_item("depth", stats.depth)?;
        out.set_item("sah_cost", stats.sah_cost)?;
        Ok(out)
    }

    fn __repr__(&self) -> String {
        let stats = self.scene.stats();
        let (triangles, instances) = (stats.instanced_triangles, stats.instances);
        format!("<firsthit.Scene of {triangles} triangles in {instances} instances, {}>", self.precision())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let module = py.import("firsthit._firsthit")?;
        let (precision, quality) = (self.precision(), quality_name(self.options().quality));
        match &self.source {
            Source::Arrays(mesh) => {
                let positions: Vec<f32> = mesh.positions.iter().flat_map(|p| p.to_array()).collect();
                let positions = PyArray1::from_vec(py, positions);
                let triangles = PyArray1::from_vec(py, mesh.triangles.as_flattened().to_vec());
                let transforms = PyArray1::from_vec(py, rows(&mesh.places)).reshape([mesh.places.len(), 4, 4])?;
                let masks: Vec<u32> = mesh.places.iter().map(|(_, mask)| *mask).collect();
                let origin = mesh.origin.to_array();
                let arguments = (positions, triangles, origin, precision, quality, transforms, masks, self.mask);
                (module.getattr("_restore")?, arguments).into_pyobject(py)
            }
            Source::File { path, up, variant } => {
                let arguments = (path, precision, quality, up, variant, self.mask);
                (module.getattr("_reload")?, arguments).into_pyobject(py)
            }
        }
    }
}

/// Reads a model; see `_firsthit.pyi`.
#[pyfunction]
#[pyo3(signature = (path, *, precision="robust", quality="balanced", up=None, variant=None, threads=0))]
pub fn load(
    py: Python<'_>,
    path: PathBuf,
    precision: &str,
    quality: &str,
    up: Option<String>,
    variant: Option<String>,
    threads: usize,
) -> PyResult<Scene> {
    let options = build_options(precision, quality)?;
    // A pickled scene is found again from another folder.
    let path = std::path::absolute(&path).unwrap_or(path);
    Scene::open(py, Source::File { path, up, variant }, options, threads)
}

/// A scene of a file that was pickled.
#[pyfunction(name = "_reload")]
pub fn reload(
    py: Python<'_>,
    path: PathBuf,
    precision: &str,
    quality: &str,
    up: Option<String>,
    variant: Option<String>,
    mask: u32,
) -> PyResult<Scene> {
    Ok(load(py, path, precision, quality, up, variant, 0)?.masked(mask))
}

/// A scene of arrays that was pickled.
#[pyfunction(name = "_restore")]
#[allow(clippy::too_many_arguments, reason = "what a scene is made of")]
pub fn restore(
    py: Python<'_>,
    positions: &Bound<'_, PyArray1<f32>>,
    triangles: &Bound<'_, PyArray1<u32>>,
    origin: [f64; 3],
    precision: &str,
    quality: &str,
    transforms: &Bound<'_, PyAny>,
    masks: &Bound<'_, PyAny>,
    mask: u32,
) -> PyResult<Scene> {
    let positions = positions.try_readonly().map_err(error::value)?;
    let triangles = triangles.try_readonly().map_err(error::value)?;
    let positions = positions.as_slice().map_err(error::value)?.as_chunks::<3>().0;
    let triangles = triangles.as_slice().map_err(error::value)?.as_chunks::<3>().0;
    let mut mesh = Mesh {
        positions: positions.iter().copied().map(Vec3::from).collect(),
        triangles: triangles.to_vec(),
        origin: DVec3::from(origin),
        places: once(),
    };
    mesh.place(Some(transforms), Some(masks))?;
    Ok(Scene::of_mesh(py, mesh, build_options(precision, quality)?, 0)?.masked(mask))
}
