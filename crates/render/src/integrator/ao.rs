//! Ambient occlusion: the share of the hemisphere over a point, weighted by the cosine, that is free nearby.

use firsthit_geometry::Ray;
use glam::Vec3;

use super::whitted::Seen;
use super::{Tracer, aov};
use crate::RayKind;
use crate::kernel::Kernel;
use crate::sampler::{Dimension, PixelSampler};
use crate::surface::Surface;
use crate::warp;

/// Keeps the numbers apart from those of the lobes.
const BRANCH: u32 = 0x500_0000;

impl<K: Kernel> Tracer<'_, K> {
    /// How much of the even light of rooms gets to a surface: one sample, where that is simulated, else all.
    pub(super) fn openness(&mut self, surface: &Surface<'_>, sampler: PixelSampler, bounce: u32) -> f32 {
        match self.occlusion_reach {
            Some(reach) if bounce == 0 => self.free(surface, reach, sampler.branch(BRANCH), bounce),
            _ => 1.0,
        }
    }

    /// 1 if a cosine-weighted direction is free within `reach`, else 0.
    fn free(&mut self, surface: &Surface<'_>, reach: f64, sampler: PixelSampler, bounce: u32) -> f32 {
        let w = warp::cosine_hemisphere(sampler.get2(Dimension::Direction(bounce)));
        let (x, y) = warp::frame(surface.smooth);
        let direction = x * w.x + y * w.y + surface.smooth * w.z;
        let mut lifted = surface.point;
        lifted.position += surface.lift();
        let origin = lifted.spawn(surface.geometric.as_dvec3());
        let away = Ray::new(origin, direction.as_dvec3()).with_interval(0.0, reach);
        let covers = sampler.get1(Dimension::Alpha(bounce));
        if self.occluded(RayKind::AmbientOcclusion, &away, surface.id, covers) { 0.0 } else { 1.0 }
    }

    /// One sample of the occlusion at the first surface that a camera ray meets; only what is nearer than `reach`
    /// occludes. Black and transparent where there is nothing.
    pub(crate) fn ambient_occlusion(&mut self, ray: Ray<f64>, reach: f64, sampler: PixelSampler) -> Seen {
        let Some(hit) = self.closest(RayKind::Camera, &ray, None) else { return Seen::default() };
        let stage = self.stage;
        let point = stage.accel.surface_point(&ray, &hit);
        let surface = stage.world.surface(&hit, point, -ray.direction.as_vec3(), 0.0);
        let material = stage.world.material(hit.id);
        let shading = stage.materials[material].shade::<K>(&surface);
        let first = aov::First::new(&ray, &hit, &surface, &shading, material);

        let color = Vec3::splat(self.free(&surface, reach, sampler, 0));
        Seen { color, alpha: 1.0, first: Some(first) }
    }
}
