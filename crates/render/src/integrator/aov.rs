//! What is there: the values of the pictures beside the colour.

use firsthit_accel::{Hit, TraversalCounts};
use firsthit_geometry::Ray;
use glam::{Vec2, Vec3};

use super::Tracer;
use super::whitted::Seen;
use crate::camera::Cone;
use crate::kernel::Kernel;
use crate::material::Shading;
use crate::surface::Surface;
use crate::{Aov, RayKind};

/// What pictures beside the colour show of the first surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct First {
    depth: f32,
    normal: Vec3,
    geometric: Vec3,
    pub(crate) albedo: Vec3,
    uv: Vec2,
    parameters: Vec2,
    instance: u32,
    geometry: u32,
    primitive: u32,
    material: u32,
}

impl First {
    pub(crate) fn new<K: Kernel>(
        ray: &Ray<f64>,
        hit: &Hit,
        surface: &Surface<'_>,
        shading: &Shading<K>,
        material: usize,
    ) -> Self {
        Self {
            depth: (hit.t * ray.direction.length()) as f32,
            normal: shading.bsdf.normal,
            geometric: surface.geometric,
            albedo: shading.base_color,
            uv: surface.uv(0),
            parameters: surface.parameters(),
            instance: hit.id.instance,
            geometry: hit.id.geometry,
            primitive: hit.id.primitive,
            material: material as u32,
        }
    }

    /// The values of one picture.
    pub(crate) fn value(&self, aov: Aov, cost: TraversalCounts) -> Vec3 {
        match aov {
            Aov::Depth => Vec3::splat(self.depth),
            Aov::Normal => self.normal,
            Aov::GeometricNormal => self.geometric,
            Aov::Albedo => self.albedo,
            Aov::Uv => self.uv.extend(0.0),
            Aov::Barycentric => {
                Vec3::new(1.0 - self.parameters.x - self.parameters.y, self.parameters.x, self.parameters.y)
            }
            Aov::InstanceId => distinct(self.instance),
            Aov::MaterialId => distinct(self.material),
            Aov::PrimitiveId => distinct(self.primitive ^ self.geometry.wrapping_mul(0x9e37_79b9)),
            Aov::Heat => heat(cost),
            Aov::Samples | Aov::Variance => Vec3::ZERO,
        }
    }

    /// The values as a picture to look at: everything between 0 and 1. Depths are compared with `far`.
    pub(crate) fn shown(&self, aov: Aov, cost: TraversalCounts, far: f32) -> Vec3 {
        let value = self.value(aov, cost);
        match aov {
            Aov::Depth => 1.0 / (1.0 + value / far),
            Aov::Normal | Aov::GeometricNormal => value * 0.5 + 0.5,
            Aov::Uv => value - value.floor(),
            _ => value,
        }
    }
}

impl<K: Kernel> Tracer<'_, K> {
    /// What a camera ray meets first, without any light.
    pub(crate) fn values(&mut self, ray: Ray<f64>, cone: Cone) -> Seen {
        let Some(hit) = self.closest(RayKind::Camera, &ray, None) else { return Seen::default() };
        let stage = self.stage;
        let point = stage.accel.surface_point(&ray, &hit);
        let width = (cone.width + cone.spread * hit.t) as f32;
        let surface = stage.world.surface(&hit, point, -ray.direction.as_vec3(), width);
        let material = stage.world.material(hit.id);
        let shading = stage.materials[material].shade::<K>(&surface);
        Seen { color: Vec3::ZERO, alpha: 1.0, first: Some(First::new(&ray, &hit, &surface, &shading, material)) }
    }
}

/// A colour for a number; neighbours differ much.
fn distinct(id: u32) -> Vec3 {
    // The golden ratio spreads hues evenly; brightness changes more slowly.
    let hue = (id.wrapping_add(1) as f32 * 0.618_034).fract() * 6.0;
    let light = 0.55 + 0.35 * ((id as f32 * 0.754_877_7).fract());
    let channel = |shift: f32| {
        let x = ((hue + shift) % 6.0 - 3.0).abs() - 1.0;
        light * (0.25 + 0.75 * x.clamp(0.0, 1.0))
    };
    Vec3::new(channel(0.0), channel(4.0), channel(2.0))
}

/// Black, blue, red, yellow, white: by the logarithm of the boxes and primitives tested, white from 1000 on.
fn heat(cost: TraversalCounts) -> Vec3 {
    const COLORS: [Vec3; 5] =
        [Vec3::ZERO, Vec3::new(0.05, 0.1, 0.7), Vec3::new(0.8, 0.05, 0.05), Vec3::new(1.0, 0.85, 0.1), Vec3::ONE];
    let x = ((1.0 + (cost.boxes + cost.primitives) as f32).log10() / 3.0).clamp(0.0, 1.0) * 4.0;
    let i = (x as usize).min(3);
    COLORS[i].lerp(COLORS[i + 1], x - i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_ids_stay_within_the_display_and_differ() {
        for id in 0..200 {
            let (a, b) = (distinct(id), distinct(id + 1));
            assert!(a.min_element() >= 0.0 && a.max_element() <= 1.0);
            assert!((a - b).abs().max_element() > 0.1, "{id}: {a} {b}");
        }
        let _ = distinct(u32::MAX);
    }

    #[test]
    fn heat_grows_with_the_cost() {
        let at = |boxes| heat(TraversalCounts { boxes, ..TraversalCounts::default() });
        assert_eq!(at(0), Vec3::ZERO);
        assert!((at(100_000) - Vec3::ONE).abs().max_element() < 1e-6);
    }
}
