//! Inside and outside.

mod boundary;
mod clusters;
mod loops;
mod pseudonormal;

use core::f64::consts::PI;
use core::ops::ControlFlow;
use std::sync::Arc;

use firsthit_geometry::Ray;
use glam::DVec3;
use rayon::prelude::*;

use crate::instance::Instance;
use crate::kernel::{Exact, Kernel, Robust};
use crate::model::{Model, Surface};
use crate::query::{Collect, Crossed, Dyn, Take};
use crate::scene::Inner;
use crate::stats::Off;
use crate::{Hit, Scene};
use boundary::Boundary;
use clusters::Clusters;
use loops::{Placed, Viewpoint};

/// How inside is told from outside.
///
/// | method | needs | wrong where | cost |
/// |---|---|---|---|
/// | `Winding` | triangles that agree about what is outside | where they do not; holes are closed by what the number makes of them | a ray, and as many of the edges at holes as it takes to tell |
/// | `FastWinding` | the same | there too, and close to the surface of open meshes, where the number is near one half | some hundred terms |
/// | `Parity` | closed meshes, of any orientation | bodies that overlap | a ray for each vote |
/// | `Pseudonormal` | closed, oriented meshes that do not cut themselves | elsewhere | none beside the distance |
/// | `Exact` | closed meshes, of any orientation | bodies that overlap | a ray, decided exactly |
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SignMethod {
    /// Inside is where the generalised winding number (Jacobson, Kavan and Sorkine-Hornung 2013) is beyond one half, of
    /// either sign. It is found without approximation: the signed crossings of one ray, and the solid angle between the ray and each
    /// edge where the surface ends (the cone that closes the surface; as in Martens and Bessmeltsev 2025). Bodies may
    /// overlap, and holes have a natural lid.
    Winding,
    /// The same number by sums over clusters of triangles, each taken as a point if it is farther than `accuracy` times
    /// its radius (Barill et al. 2018; 2 is their choice, larger is slower and more exact). For meshes that are hardly
    /// connected at all.
    FastWinding {
        /// Distance in radii from which a cluster is taken as a point.
        accuracy: f64,
    },
    /// Inside is from where rays meet the surface an odd number of times: the majority of so many rays, at least one. Each
    /// crossing counts once, through edges and vertices too.
    Parity {
        /// Number of rays.
        votes: u32,
    },
    /// The side of the nearest triangle, edge or vertex, whose normals are weighted by angles (Baerentzen and Aanaes 2005).
    Pseudonormal,
    /// One ray whose crossings are decided by exact arithmetic, in the space of the mesh.
    Exact,
}

/// A scene's triangles as the surface of a body: which points are inside?
///
/// It is made explicitly, since it takes a look at the whole mesh (O(n log n)): whether that is closed and oriented, and where it
/// ends. Queries follow the scene's threads and promises: the same bits for one, many and any number of threads. Analytic shapes
/// do not count.
///
/// ```
/// use firsthit_accel::{Geometry, SceneBuilder, Solid};
/// use glam::{DAffine3, DVec3, Vec3};
///
/// let mut builder = SceneBuilder::default();
/// let tetrahedron = builder.add_mesh(vec![Geometry::Triangles {
///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
///     triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
/// }]);
/// builder.add_instance(tetrahedron, DAffine3::IDENTITY);
/// let solid = Solid::new(&builder.build()?);
///
/// assert!(solid.is_watertight());
/// assert!(solid.contains(DVec3::splat(0.1)) && !solid.contains(DVec3::splat(0.5)));
/// assert_eq!(solid.signed_distance(DVec3::new(0.1, 0.2, 0.3)), -0.1);
/// assert_eq!(solid.winding_number(DVec3::splat(0.1)), 1.0);
/// # Ok::<(), firsthit_accel::BuildError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solid {
    scene: Scene,
    method: SignMethod,
    /// By model.
    boundaries: Vec<Arc<Boundary>>,
    /// Of each instance that has any.
    loops: Vec<Placed>,
    /// By model, where the method needs them.
    clusters: Vec<Arc<Clusters>>,
}

/// Up to so many edges where a surface ends are summed one by one.
const FEW: usize = 4096;

impl Solid {
    /// By the method that is right for these meshes: [`SignMethod::Winding`]; for closed meshes whose triangles disagree about
    /// what is outside, [`SignMethod::Parity`]; for meshes that end at thousands of edges,
    /// [`SignMethod::FastWinding`].
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let boundaries = boundaries(scene);
        let all = |f: fn(&Boundary) -> bool| boundaries.iter().all(|b| f(b));
        let edges: usize = scene.shown().map(|(_, i)| boundaries[i.model as usize].edges).sum();
        let method = if all(|b| b.edges == 0) {
            SignMethod::Winding
        } else if all(|b| b.closed) {
            SignMethod::Parity { votes: 1 }
        } else if edges <= FEW {
            SignMethod::Winding
        } else {
            SignMethod::FastWinding { accuracy: 2.0 }
        };
        Self::of(scene, method, boundaries)
    }

    /// By this method.
    #[must_use]
    pub fn with_method(scene: &Scene, method: SignMethod) -> Self {
        Self::of(scene, method, boundaries(scene))
    }

    fn of(scene: &Scene, method: SignMethod, boundaries: Vec<Arc<Boundary>>) -> Self {
        let clusters = match method {
            SignMethod::FastWinding { .. } => {
                scene.models().par_iter().map(|model| Arc::new(Clusters::new(model))).collect()
            }
            _ => Vec::new(),
        };
        let open = scene.shown().filter(|(_, i)| boundaries[i.model as usize].edges > 0);
        let placed = |(_, i): (u32, &Instance)| Placed::new(boundaries[i.model as usize].loops.clone(), &i.transform);
        let loops = open.map(placed).collect();
        Self { scene: scene.clone(), method, boundaries, loops, clusters }
    }

    /// The method that is used.
    #[must_use]
    pub fn method(&self) -> SignMethod {
        self.method
    }

    /// The scene that it is made of.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Whether each edge of each mesh has an even number of triangles, so that the surface has no holes.
    #[must_use]
    pub fn is_watertight(&self) -> bool {
        self.boundaries.iter().all(|b| b.closed)
    }

    /// Number of edges at which the surfaces of the meshes end, or at which neighbours disagree about what is outside.
    #[must_use]
    pub fn boundary_edges(&self) -> usize {
        self.boundaries.iter().map(|b| b.edges).sum()
    }

    /// Whether the point is inside; false for one that is not finite. On the surface it is either.
    #[must_use]
    pub fn contains(&self, point: DVec3) -> bool {
        if !point.is_finite() {
            return false;
        }
        match self.method {
            SignMethod::Winding => self.is_wound_around(point),
            SignMethod::FastWinding { .. } => self.winding_number(point).abs() > 0.5,
            SignMethod::Parity { votes } => {
                let votes = votes.max(1);
                let inside = (0..votes).filter(|&k| self.crossings(&self.ray(point, k)).count % 2 == 1).count();
                2 * inside > votes as usize
            }
            SignMethod::Pseudonormal => pseudonormal::is_inside(&self.scene, point),
            SignMethod::Exact => self.crossed_by::<Exact>(&self.ray(point, 0)).count % 2 == 1,
        }
    }

    /// [`Solid::contains`] for each point, into the slot of the same index. The shorter slice decides how many.
    pub fn contains_each(&self, points: &[DVec3], inside: &mut [bool]) {
        for (point, inside) in points.iter().zip(inside) {
            *inside = self.contains(*point);
        }
    }

    /// As [`Solid::contains_each`], on the threads of the rayon pool it is called from.
    pub fn par_contains(&self, points: &[DVec3], inside: &mut [bool]) {
        let chunks = points.par_chunks(CHUNK).zip(inside.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, inside)| self.contains_each(points, inside));
    }

    /// [`Scene::distance`] of the triangles, negative inside.
    #[must_use]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        let mut distance = [0.0];
        self.signed_distances(&[point], &mut distance);
        distance[0]
    }

    /// [`Solid::signed_distance`] for each point, into the slot of the same index. The shorter slice decides how many.
    pub fn signed_distances(&self, points: &[DVec3], distances: &mut [f64]) {
        self.scene.distances_of_triangles(points, distances);
        for (point, distance) in points.iter().zip(distances) {
            *distance = self.signed(*point, *distance);
        }
    }

    /// As [`Solid::signed_distances`], on the threads of the rayon pool it is called from.
    pub fn par_signed_distances(&self, points: &[DVec3], distances: &mut [f64]) {
        let chunks = points.par_chunks(CHUNK).zip(distances.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, distances)| self.signed_distances(points, distances));
    }

    fn signed(&self, point: DVec3, distance: f64) -> f64 {
        if distance > 0.0 && self.contains(point) { -distance } else { distance }
    }

    /// How often the surface winds around the point: 1 inside of a closed mesh whose normals point outwards, 0 outside; the sum
    /// over all instances. Of open meshes it is a fraction, their solid angle as seen from the point over 4 pi. NaN for a
    /// point that is not finite.
    ///
    /// Exact but for rounding, unless the method is [`SignMethod::FastWinding`].
    #[must_use]
    pub fn winding_number(&self, point: DVec3) -> f64 {
        if !point.is_finite() {
            return f64::NAN;
        }
        if let SignMethod::FastWinding { accuracy } = self.method {
            let of =
                |(i, clusters): (&Instance, &Arc<Clusters>)| clusters.winding_number(&i.transform, point, accuracy);
            return self.of_instances(&self.clusters).map(of).sum();
        }
        if self.loops.is_empty() {
            return self.crossings(&self.ray(point, 0)).signed() as f64;
        }
        let of_loops = |ray: &Ray<f64>, from: Viewpoint| {
            let open = from.sum(&self.loops)?;
            Some(self.crossings(ray).signed() as f64 + open / (4.0 * PI))
        };
        // On an edge, as far as can be told: the sum that needs no ray.
        self.attempts(point, of_loops).unwrap_or_else(|| crate::reference::winding_number(&self.scene, point))
    }

    /// Whether the winding number is beyond one half: of loops far away not every edge has to be looked at.
    fn is_wound_around(&self, point: DVec3) -> bool {
        if self.loops.is_empty() {
            return self.crossings(&self.ray(point, 0)).signed() != 0;
        }
        let of_loops =
            |ray: &Ray<f64>, from: Viewpoint| from.is_beyond_half(&self.loops, self.crossings(ray).signed() as f64);
        let beyond = self.attempts(point, of_loops);
        beyond.unwrap_or_else(|| crate::reference::winding_number(&self.scene, point).abs() > 0.5)
    }

    /// What is told by a ray from the point that passes no edge of a loop closely: where one does, another one is taken.
    fn attempts<T>(&self, point: DVec3, tell: impl Fn(&Ray<f64>, Viewpoint) -> Option<T>) -> Option<T> {
        let size = self.scene.bounds().extent().max_element();
        (0..ATTEMPTS).find_map(|vote| {
            let ray = self.ray(point, vote);
            tell(&ray, Viewpoint::new(point, ray.direction, size))
        })
    }

    /// Each instance with what belongs to its model.
    fn of_instances<'a, T>(&'a self, of: &'a [T]) -> impl Iterator<Item = (&'a Instance, &'a T)> {
        self.scene.shown().filter_map(|(_, i)| Some((i, of.get(i.model as usize)?)))
    }

    /// From a point to where the scene ends soonest, and not along anything that people align with axes.
    fn ray(&self, point: DVec3, vote: u32) -> Ray<f64> {
        let bounds = self.scene.bounds();
        let (below, above) = (point - bounds.min, bounds.max - point);
        let [x, y, z] = [below.x.min(above.x), below.y.min(above.y), below.z.min(above.z)];
        let axis = if x <= y && x <= z { 0 } else { usize::from(y > z) + 1 };
        let side = if below[axis] < above[axis] { -1.0 } else { 1.0 };
        // Other directions for other votes: by the golden angle.
        let turn = f64::from(vote) * 2.399_963_229_728_653 + 0.7;
        let (sin, cos) = if vote == 0 { FIRST_TURN } else { turn.sin_cos() };
        let tilt = [0.312_7 * cos + 0.011_3, 0.287_1 * sin - 0.017_9];
        let mut direction = DVec3::ZERO;
        direction[axis] = side;
        direction[(axis + 1) % 3] = tilt[0];
        direction[(axis + 2) % 3] = tilt[1];
        Ray { origin: point, direction, t_min: 0.0, t_max: f64::INFINITY }
    }

    fn crossings(&self, ray: &Ray<f64>) -> Crossed {
        if let Some(crossed) = self.scene.inner().crossings(ray) {
            return crossed;
        }
        if self.scene.options().precision == firsthit_geometry::Precision::Fast {
            // It does not know surfaces.
            return self.crossed_by::<Robust>(ray);
        }
        let mut all = Collect::new(ray, None, |_| true, self.nothing(ray));
        let _ = self.scene.collect(ray, crate::Crossings::Surfaces, &mut all);
        all.take.crossed
    }

    fn crossed_by<K: Kernel>(&self, ray: &Ray<f64>) -> Crossed {
        let mut all = Collect::new(ray, None, |_| true, self.nothing(ray));
        let _ = self.scene.inner().trace_by::<true, K, _, _>(ray, &mut Dyn(&mut all), &mut Off);
        all.take.crossed
    }

    fn nothing(&self, ray: &Ray<f64>) -> Triangles<'_> {
        Triangles { scene: &self.scene, direction: ray.direction, crossed: Crossed::default() }
    }
}

/// Sine and cosine of 0.7, which most rays are turned by.
const FIRST_TURN: (f64, f64) = (0.644_217_687_237_691, 0.764_842_187_284_488_5);

/// Directions that are tried.
const ATTEMPTS: u32 = 16;

/// Points that one task takes.
const CHUNK: usize = 1024;

fn boundaries(scene: &Scene) -> Vec<Arc<Boundary>> {
    let inner: &Inner = scene.inner();
    let mut shown = vec![false; inner.models.len()];
    scene.shown().for_each(|(_, i)| shown[i.model as usize] = true);
    // What no query meets has no holes.
    let of = |(model, shown): (&Arc<Model>, &bool)| if *shown { Boundary::new(model) } else { Boundary::default() };
    inner.models.par_iter().zip(&shown).map(|of_model| Arc::new(of(of_model))).collect()
}

/// Counts crossings of triangles.
struct Triangles<'a> {
    scene: &'a Scene,
    direction: DVec3,
    crossed: Crossed,
}

impl Take for Triangles<'_> {
    const ORDERED: bool = false;

    fn take(&mut self, hit: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        if matches!(self.scene.surface(&hit.id), Some((_, Surface::Triangle(_)))) {
            self.crossed.add(Crossed::of(self.scene.finished(hit).normal_direction, self.direction));
        }
        ControlFlow::Continue(false)
    }
}
