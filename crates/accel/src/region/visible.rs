//! What a camera sees.

use core::ops::ControlFlow;
use std::collections::{BTreeMap, BTreeSet};

use firsthit_geometry::Ray;
use firsthit_geometry::frustum::{Containment, Frustum};
use firsthit_geometry::overlap::Region;
use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::{HitId, Scene};

/// A geometry of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Part {
    /// Index of the instance.
    pub instance: u32,
    /// Index of the geometry in its mesh.
    pub geometry: u32,
}

impl From<HitId> for Part {
    fn from(id: HitId) -> Self {
        Self { instance: id.instance, geometry: id.geometry }
    }
}

/// A perspective camera and its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it is.
    pub eye: DVec3,
    /// Turns a camera that looks along -z, with y upwards and x to the right.
    pub rotation: DQuat,
    /// The full angle of view in radians, from bottom to top.
    pub vertical_angle: f64,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl View {
    /// The ray through the middle of a pixel: the first row is at the top.
    #[must_use]
    pub fn ray(&self, x: u32, y: u32) -> Ray<f64> {
        let slope = (self.vertical_angle / 2.0).tan();
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let right = (2.0 * f64::from(x) + 1.0 - width) / height;
        let up = 1.0 - (2.0 * f64::from(y) + 1.0) / height;
        Ray::new(self.eye, self.rotation * DVec3::new(right * slope, up * slope, -1.0))
    }

    /// What lies in the picture between two distances, along the middle of the view.
    #[must_use]
    pub fn frustum(&self, near: f64, far: f64) -> Option<Frustum> {
        let aspect = f64::from(self.width) / f64::from(self.height);
        let (forward, up) = (self.rotation * DVec3::NEG_Z, self.rotation * DVec3::Y);
        Frustum::perspective(self.eye, forward, up, self.vertical_angle, aspect, near, far)
    }
}

/// What is seen, and what may be.
impl Scene {
    /// Which parts the rays through the middles of all pixels meet first, and how many each: by part. On the threads of the
    /// rayon pool it is called from; the same for any number.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, Part, SceneBuilder, View};
    /// use glam::{DAffine3, DQuat, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 3.0, 0.0)],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// for z in [-5.0, -9.0] {
    ///     builder.add_instance(mesh, DAffine3::from_translation(DVec3::Z * z));
    /// }
    /// let scene = builder.build()?;
    /// let view = View { eye: DVec3::ZERO, rotation: DQuat::IDENTITY, vertical_angle: 0.2, width: 8, height: 8 };
    ///
    /// // The second is behind the first.
    /// let [first, second] = [0, 1].map(|instance| Part { instance, geometry: 0 });
    /// assert_eq!(scene.visible_parts(&view), [(first, 64)]);
    /// assert_eq!(scene.parts_in(&view.frustum(0.1, 20.0).unwrap()), [first, second]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn visible_parts(&self, view: &View) -> Vec<(Part, u64)> {
        let row = |y: u32| (0..view.width).map(|x| view.ray(x, y)).collect::<Vec<_>>();
        let counts = (0..view.height).into_par_iter().map(|y| self.seen(&row(y))).reduce(BTreeMap::new, joined);
        counts.into_iter().collect()
    }

    /// Which parts some rays meet first, and how many each: by part. See [`Scene::visible_parts`].
    #[must_use]
    pub fn parts_along(&self, rays: &[Ray<f64>]) -> Vec<(Part, u64)> {
        let counts = rays.par_chunks(1024).map(|rays| self.seen(rays)).reduce(BTreeMap::new, joined);
        counts.into_iter().collect()
    }

    /// The parts that have a point in a region, in a view's frustum say, whether or not others hide them: by part. Triangles
    /// decide, as in [`Scene::overlapping`]; of analytic shapes their boxes, so that one too many may be named.
    #[must_use]
    pub fn parts_in(&self, region: &impl Region) -> Vec<Part> {
        let mut parts = BTreeSet::new();
        if region.is_valid() {
            parts.extend(self.shapes_near(region));
        }
        let mut last = None;
        let _ = self.each_overlapping(region, |id| {
            // Neighbours in the tree are mostly of one part.
            let part = Part::from(id);
            if last != Some(part) {
                parts.insert(part);
                last = Some(part);
            }
            ControlFlow::Continue(())
        });
        parts.into_iter().collect()
    }

    /// Shapes whose boxes meet a region, and those that have none.
    pub(crate) fn shapes_near(&self, region: &impl Region) -> impl Iterator<Item = Part> {
        self.shown().flat_map(move |(i, instance)| {
            let shapes = self.models()[instance.model as usize].shape_boxes();
            shapes.filter_map(move |(geometry, bounds)| {
                let bounds = instance.transform.aabb(&bounds);
                let near = !bounds.is_finite() || region.classify_box(&bounds) != Containment::Outside;
                near.then_some(Part { instance: i, geometry })
            })
        })
    }

    fn seen(&self, rays: &[Ray<f64>]) -> BTreeMap<Part, u64> {
        let mut hits = vec![None; rays.len()];
        self.closest_hits(rays, &mut hits);
        let mut counts = BTreeMap::new();
        for hit in hits.iter().flatten() {
            *counts.entry(Part::from(hit.id)).or_insert(0) += 1;
        }
        counts
    }
}

fn joined(mut a: BTreeMap<Part, u64>, b: BTreeMap<Part, u64>) -> BTreeMap<Part, u64> {
    for (part, count) in b {
        *a.entry(part).or_insert(0) += count;
    }
    a
}
