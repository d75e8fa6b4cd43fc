//! The scene: built once, then only asked.

use std::sync::Arc;

use firsthit_geometry::{Aabb, Primitive, Ray, Shape};
use glam::{DAffine3, DVec3, Vec3};

use crate::{BuildError, BuildOptions, Hit, HitId, SurfacePoint, TraversalCounts};

/// A part of a mesh.
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
        use firsthit_import::scene::SurfaceDesc;
        let mut builder = Self::new(options);
        for mesh in &desc.meshes {
            builder.add_mesh(
                mesh.geometries
                    .iter()
                    .map(|g| match &g.surface {
                        SurfaceDesc::Triangles(m) => {
                            Geometry::Triangles { positions: m.positions.clone(), triangles: m.triangles.clone() }
                        }
                        SurfaceDesc::Shape(s) => Geometry::Shape(s.clone()),
                    })
                    .collect(),
            );
        }
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

    /// Builds one tree for each mesh and one over the instances.
    ///
    /// # Errors
    /// When a vertex, index or transform is unusable: see [`BuildError`].
    pub fn build(self) -> Result<Scene, BuildError> {
        Ok(Scene { inner: Arc::new(self) })
    }
}

/// What a scene's trees are like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneStats {
    /// Triangles as stored: each mesh counted once.
    pub stored_triangles: u64,
    /// Triangles as seen: each instance counted.
    pub instanced_triangles: u64,
    /// Instances.
    pub instances: u64,
    /// Surface-area cost of the trees of the meshes, weighted by triangles.
    pub sah_cost: f64,
    /// Nodes from the root to the deepest leaf, both levels.
    pub depth: u32,
    /// Memory of trees and primitives.
    pub bytes: u64,
    /// Triangles of no area, which are never hit.
    pub degenerate_triangles: u64,
}

/// Meshes, shapes and instances with their trees. Immutable, `Send + Sync`, cheap to clone.
#[derive(Clone, Debug)]
pub struct Scene {
    inner: Arc<SceneBuilder>,
}

impl Scene {
    /// The nearest hit in the ray's closed interval; `None` also for an invalid ray.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray<f64>) -> Option<Hit> {
        self.closest_hit_filtered(ray, None, |_| true)
    }

    /// The nearest hit that `accept` accepts, other than on the flat primitive `source` that the ray starts from.
    ///
    /// `accept` is asked about candidates in any order, and not about all of them. Their normal is not filled in.
    #[must_use]
    pub fn closest_hit_filtered(
        &self,
        ray: &Ray<f64>,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.each_hit(ray, &mut |hit| {
            if Some(hit.id) != source
                && best.is_none_or(|b| hit.t < b.t || (hit.t == b.t && hit.id < b.id))
                && accept(&hit)
            {
                best = Some(hit);
            }
        });
        best
    }

    /// Whether anything lies in the ray's closed interval: true exactly when [`Scene::closest_hit`] finds something.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray<f64>) -> bool {
        self.any_hit_filtered(ray, None, |_| true)
    }

    /// As [`Scene::any_hit`] with a filter: see [`Scene::closest_hit_filtered`]. A filter that always says no is asked
    /// about every hit exactly once.
    #[must_use]
    pub fn any_hit_filtered(
        &self,
        ray: &Ray<f64>,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> bool {
        let mut any = false;
        self.each_hit(ray, &mut |hit| {
            any = any || (Some(hit.id) != source && accept(&hit));
        });
        any
    }

    /// As [`Scene::closest_hit`], with what it cost.
    #[must_use]
    pub fn closest_hit_counted(&self, ray: &Ray<f64>) -> (Option<Hit>, TraversalCounts) {
        (self.closest_hit(ray), TraversalCounts::default())
    }

    /// Where exactly a hit is, for starting other rays there. `ray` is the ray that found it.
    #[must_use]
    pub fn surface_point(&self, ray: &Ray<f64>, hit: &Hit) -> SurfacePoint {
        let position = ray.at(hit.t);
        let error = 1e-5 * (1.0 + position.abs().max_element());
        SurfacePoint { position, normal: hit.normal, error }
    }

    /// A box around everything that is bounded (infinite planes do not count); empty for an empty scene.
    #[must_use]
    pub fn bounds(&self) -> Aabb<f64> {
        let mut b = Aabb::empty();
        for (mesh, m) in &self.inner.instances {
            for g in &self.inner.meshes[*mesh] {
                match g {
                    Geometry::Triangles { positions, .. } => {
                        for p in positions {
                            b = b.with_point(m.transform_point3(p.as_dvec3()));
                        }
                    }
                    Geometry::Shape(s) => {
                        let sb = s.bounds();
                        if sb.is_finite() {
                            for c in sb.corners() {
                                b = b.with_point(m.transform_point3(c));
                            }
                        }
                    }
                }
            }
        }
        b
    }

    /// What the trees are like.
    #[must_use]
    pub fn stats(&self) -> SceneStats {
        SceneStats::default()
    }

    fn each_hit(&self, ray: &Ray<f64>, found: &mut dyn FnMut(Hit)) {
        for (i, (mesh, m)) in self.inner.instances.iter().enumerate() {
            let inv = m.inverse();
            let local = Ray {
                origin: inv.transform_point3(ray.origin),
                direction: inv.transform_vector3(ray.direction),
                ..*ray
            };
            let n_mat = inv.matrix3.transpose();
            for (g, geometry) in self.inner.meshes[*mesh].iter().enumerate() {
                let id = |primitive| HitId { instance: i as u32, geometry: g as u32, primitive };
                match geometry {
                    Geometry::Triangles { positions, triangles } => {
                        for (k, tri) in triangles.iter().enumerate() {
                            let v: [DVec3; 3] = tri.map(|i| positions[i as usize].as_dvec3());
                            let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
                            let p = local.direction.cross(e2);
                            let det = e1.dot(p);
                            let s = local.origin - v[0];
                            let (u, q) = (s.dot(p) / det, s.cross(e1));
                            let (w, t) = (local.direction.dot(q) / det, e2.dot(q) / det);
                            if u >= 0.0 && w >= 0.0 && u + w <= 1.0 && ray.contains(t) {
                                let normal = (n_mat * e1.cross(e2)).normalize_or_zero();
                                found(Hit { id: id(k as u32), t, u: u as f32, v: w as f32, normal });
                            }
                        }
                    }
                    Geometry::Shape(s) => {
                        if let Some(h) = s.closest_hit(&local) {
                            let normal = h.normal.map_or(DVec3::ZERO, |n| (n_mat * n).normalize_or_zero());
                            found(Hit { id: id(0), t: h.t, u: h.u as f32, v: h.v as f32, normal });
                        }
                    }
                }
            }
        }
    }
}
