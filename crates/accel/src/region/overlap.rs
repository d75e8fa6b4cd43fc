//! What overlaps a region.

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use firsthit_geometry::frustum::Containment;
use firsthit_geometry::overlap::Region;
use glam::DVec3;
use rayon::prelude::*;

use super::{VisitedTriangle, Visitor};
use crate::{HitId, Scene};

/// Whether a triangle meets a region: what decides with and without a tree.
pub(crate) fn meets(region: &impl Region, corners: [DVec3; 3]) -> bool {
    match region.classify_box(&Aabb::from_points(corners)) {
        Containment::Outside => false,
        Containment::Intersecting => region.meets_triangle(corners),
        Containment::Inside => true,
    }
}

/// Tells of the triangles that meet a region.
struct Overlap<'a, R, F> {
    region: &'a R,
    size: f64,
    found: F,
}

impl<R: Region, F: FnMut(HitId) -> ControlFlow<()>> Visitor for Overlap<'_, R, F> {
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
        // Grown by more than anything is rounded, so that what is decided for a box is what its triangles say.
        let size = bounds.min.abs().max(bounds.max.abs()).max_element().max(self.size);
        let room = DVec3::splat(size * 2f64.powi(-40));
        self.region.classify_box(&Aabb::new(bounds.min - room, bounds.max + room))
    }
    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
        if triangle.inside || meets(self.region, triangle.corners) {
            return (self.found)(triangle.id);
        }
        ControlFlow::Continue(())
    }
}

/// What overlaps a region: a box, a sphere, a capsule, a view frustum, any [`Region`].
impl Scene {
    /// Whether any triangle has a point in common with the closed region. `false` for one that is not valid (see
    /// [`Region::is_valid`]).
    ///
    /// It is decided in `f64` in the world, at any tier; what is as near as some roundings overlaps. Surfaces overlap, not
    /// what they enclose: a region deep in a solid overlaps nothing (see [`crate::Solid::contains`] for that). Analytic
    /// shapes have no such query yet.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, HitId, SceneBuilder};
    /// use firsthit_geometry::{Aabb, overlap::Sphere};
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let scene = builder.build()?;
    ///
    /// assert!(scene.overlaps(&Sphere { center: DVec3::new(0.2, 0.2, 0.5), radius: 0.5 }));
    /// // In the triangle's box, but beyond its longest edge.
    /// assert!(!scene.overlaps(&Aabb::new(DVec3::new(0.6, 0.6, -1.0), DVec3::ONE)));
    /// let found = scene.overlapping(&Aabb::new(DVec3::splat(-1.0), DVec3::splat(0.1)));
    /// assert_eq!(found, [HitId { instance: 0, geometry: 0, primitive: 0 }]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn overlaps(&self, region: &impl Region) -> bool {
        self.each_overlapping(region, |_| ControlFlow::Break(())).is_break()
    }

    /// The triangles that have a point in common with the region, by id. See [`Scene::overlaps`].
    #[must_use]
    pub fn overlapping(&self, region: &impl Region) -> Vec<HitId> {
        let mut found = Vec::new();
        self.overlapping_into(region, &mut found);
        found
    }

    /// The same into a list that is emptied first. Where that has room enough, nothing is allocated.
    pub fn overlapping_into(&self, region: &impl Region, found: &mut Vec<HitId>) {
        found.clear();
        let _ = self.each_overlapping(region, |id| {
            found.push(id);
            ControlFlow::Continue(())
        });
        found.sort_unstable();
    }

    /// Tells of the triangles that have a point in common with the region, in the order of the tree, until `found` breaks.
    pub fn each_overlapping(
        &self,
        region: &impl Region,
        found: impl FnMut(HitId) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if !region.is_valid() {
            return ControlFlow::Continue(());
        }
        self.visit(&mut Overlap { region, size: region.size(), found })
    }

    /// [`Scene::overlaps`] for each region, on the threads of the rayon pool it is called from.
    #[must_use]
    pub fn par_overlaps<R: Region>(&self, regions: &[R]) -> Vec<bool> {
        regions.par_iter().map(|region| self.overlaps(region)).collect()
    }

    /// [`Scene::overlapping`] for each region, on the threads of the rayon pool it is called from.
    #[must_use]
    pub fn par_overlapping<R: Region>(&self, regions: &[R]) -> Vec<Vec<HitId>> {
        regions.par_iter().map(|region| self.overlapping(region)).collect()
    }
}
