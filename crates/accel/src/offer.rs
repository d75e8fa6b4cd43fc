//! Triangles offered to a collector: tested by a tier, clamped where it asks for that, and told by their ids.

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use glam::Vec3;

use crate::HitId;
use crate::kernel::{Found, Kernel, double};
use crate::local::{Line, LocalRay};
use crate::model::Model;
use crate::query::{Candidate, Collector};
use crate::stats::Probe;
use crate::wide::{Visit, WideTree};

/// Tests triangles for one ray, and offers what is hit.
pub(crate) struct OfferTriangle<'a, const SURFACES: bool, K: Kernel> {
    model: &'a Model,
    ray: &'a LocalRay,
    instance: u32,
    pub(crate) setup: K::Setup,
    /// End of the interval in the instance's space.
    limit: f64,
}

impl<'a, const SURFACES: bool, K: Kernel> OfferTriangle<'a, SURFACES, K> {
    #[inline(always)]
    pub(crate) fn new<C: Collector>(model: &'a Model, ray: &'a LocalRay, instance: u32, collector: &C) -> Self {
        Self { model, ray, instance, setup: K::setup(ray, model.guards), limit: collector.t_max() * ray.t_scale }
    }

    /// The new end of the boxes' interval if the hit was taken.
    #[inline(always)]
    pub(crate) fn offer<C: Collector, P: Probe>(
        &mut self,
        place: usize,
        triangle: &[Vec3; 3],
        known: Option<[f32; 3]>,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<(), Option<f32>> {
        if !SURFACES
            && collector.asks_only_whether()
            && let Some(is_hit) = K::is_hit(&self.setup, triangle, self.limit)
        {
            return match is_hit && self.model.id(place).is_some() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(None),
            };
        }
        let found = match known {
            _ if SURFACES => K::crosses(&self.setup, self.ray, triangle, self.limit),
            Some(known) => K::test_known(&self.setup, self.ray, triangle, known, self.limit),
            None => K::test(&self.setup, self.ray, triangle, self.limit),
        };
        let Some(Found { mut t, u, v, normal, grazing, fallback }) = found else { return ControlFlow::Continue(None) };
        if fallback {
            probe.fallback();
        }
        if grazing && K::clamped(&self.setup) {
            let Some(within) = within_triangle(self.ray.line(), t, *triangle) else {
                return ControlFlow::Continue(None);
            };
            t = within;
        }
        let t = t * self.ray.t_unscale;
        // Before anything is fetched about it.
        if !(collector.t_min() <= t && t <= collector.t_max()) {
            return ControlFlow::Continue(None);
        }
        let Some(id) = self.model.id(place) else { return ControlFlow::Continue(None) };
        let id = HitId { instance: self.instance, geometry: id.geometry, primitive: id.primitive };
        let taken = collector.offer(Candidate::new(id, t, u, v, normal))?;
        ControlFlow::Continue(if taken { Some(self.shortened(collector)) } else { None })
    }

    /// The end of the boxes' interval, now that a hit was taken.
    #[inline(always)]
    pub(crate) fn shortened<C: Collector>(&mut self, collector: &C) -> f32 {
        self.limit = collector.t_max() * self.ray.t_scale;
        self.ray.box_t_max(collector.t_max())
    }
}

/// Offers the triangles of the wide tree.
pub(crate) struct OfferTo<'a, const SURFACES: bool, T, K: Kernel, C> {
    pub(crate) tree: &'a T,
    pub(crate) offer: OfferTriangle<'a, SURFACES, K>,
    pub(crate) collector: &'a mut C,
}

impl<const SURFACES: bool, T: WideTree, K: Kernel, C: Collector, P: Probe> Visit<P> for OfferTo<'_, SURFACES, T, K, C> {
    #[inline(always)]
    fn visit(&mut self, place: usize, known: [f32; 3], probe: &mut P) -> ControlFlow<(), Option<f32>> {
        let triangle = self.tree.triangle(place);
        self.offer.offer(place, &triangle, Some(known), self.collector, probe)
    }
}

/// [`Line::within_box`] for a triangle. By value, as `careful_plane`.
#[cold]
#[inline(never)]
pub(crate) fn within_triangle(line: Line, t: f64, vertices: [Vec3; 3]) -> Option<f64> {
    let [a, b, c] = double(&vertices);
    line.within_box(t, &Aabb::new(a.min(b).min(c), a.max(b).max(c)))
}
