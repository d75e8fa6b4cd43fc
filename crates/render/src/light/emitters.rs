//! Light that leaves the lights, for paths that start there.
//!
//! A light is chosen by about how much it sends into the scene. Glowing surfaces send from points that are chosen
//! evenly, by the cosine; points within the cone in which they shine; what is infinitely far away through the disk that
//! the whole scene fills, seen from there.

use std::f64::consts::PI;

use firsthit_accel::HitId;
use firsthit_geometry::{Precision, Primitive};
use firsthit_import::SceneDesc;
use firsthit_import::scene::SurfaceDesc;
use glam::{DVec3, Vec3};

use super::area::Shines;
use super::choice::Chosen;
use super::environment::luminance;
use crate::distribution::Distribution1D;
use crate::kernel::Kernel;
use crate::sampler::{Dimension, PixelSampler};
use crate::{Stage, warp};

/// Some light as it leaves its source.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaving {
    pub(crate) origin: DVec3,
    /// Unit.
    pub(crate) direction: Vec3,
    /// The primitive that it comes from.
    pub(crate) source: Option<HitId>,
    /// It comes from infinitely far away, and only begins here.
    pub(crate) afar: bool,
    pub(crate) power: Power,
}

/// How much light a path carries.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Power {
    /// So much, W by colour.
    Known(Vec3),
    /// What this light without extent gives where the path arrives, over its density in solid angle.
    OfPunctual { light: usize, per_density: f32 },
}

/// Chooses where light starts.
#[derive(Clone, Debug)]
pub(crate) struct Emitters {
    table: Distribution1D,
    punctual: usize,
    shapes: usize,
    triangles: usize,
    /// A ball about the whole scene.
    middle: DVec3,
    radius: f64,
    exact: bool,
}

/// Planes and the like, which the bounds of a scene leave out.
fn has_endless_shapes(scene: &SceneDesc) -> bool {
    let used = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries);
    used.into_iter().any(|g| matches!(&g.surface, SurfaceDesc::Shape(shape) if !shape.bounds().is_finite()))
}

/// Light from infinitely far away has no disk to come through where the scene has no end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Endless;

impl Emitters {
    /// `None` where nothing shines.
    pub(crate) fn new(stage: &Stage) -> Result<Option<Self>, Endless> {
        let lights = &stage.lights;
        let bounds = stage.accel.bounds();
        let radius = 0.5 * bounds.extent().length() * (1.0 + 1e-6);
        let endless = has_endless_shapes(stage.scene());
        if bounds.is_empty() && !endless {
            // Without a surface there is nothing to light.
            return Ok(None);
        }
        let bounded = bounds.is_finite() && !endless;
        let mut powers: Vec<f32> = Vec::new();
        for (i, light) in lights.punctual.iter().enumerate() {
            let asked = lights.choice.asks(i);
            if asked && !bounded && light.leaving([0.5; 2]).is_none() {
                return Err(Endless);
            }
            powers.push(if asked { light.power(radius) } else { 0.0 });
        }
        lights.area.powers(&mut powers);
        let triangles = powers.len() - lights.punctual.len() - lights.area.shapes.len();
        powers.push(match &lights.environment {
            Some(_) if !bounded => return Err(Endless),
            Some(e) => 4.0 * (PI * PI * radius * radius) as f32 * luminance(e.mean_radiance()),
            None => 0.0,
        });
        Ok(Distribution1D::new(&powers).map(|table| Self {
            table,
            punctual: lights.punctual.len(),
            shapes: lights.area.shapes.len(),
            triangles,
            middle: bounds.center(),
            radius,
            exact: stage.accel.options().precision != Precision::Fast,
        }))
    }

    /// The light that a cell of the table stands for.
    fn light(&self, cell: usize) -> Chosen {
        let shape = cell.wrapping_sub(self.punctual);
        let triangle = shape.wrapping_sub(self.shapes);
        if cell < self.punctual {
            Chosen::Punctual(cell)
        } else if shape < self.shapes {
            Chosen::Shape(shape)
        } else if triangle < self.triangles {
            Chosen::Triangle(triangle)
        } else {
            Chosen::Environment
        }
    }

    /// Light that leaves one of the lights.
    pub(crate) fn sample<K: Kernel>(&self, stage: &Stage, sampler: &PixelSampler) -> Option<Leaving> {
        let (cell, inside) = self.table.sample(sampler.get1(Dimension::LightChoice(0)));
        let probability = self.table.probability(cell);
        let [place, way] = [Dimension::LightPosition(0), Dimension::Direction(0)].map(|d| sampler.get2(d));
        let lights = &stage.lights;
        match self.light(cell) {
            Chosen::Punctual(i) => {
                let light = lights.punctual.get(i)?;
                if let Some((origin, direction)) = light.leaving(way) {
                    let per_density = light.solid_angle() / probability;
                    let power = Power::OfPunctual { light: i, per_density };
                    return Some(Leaving { origin, direction, source: None, afar: false, power });
                }
                let sample = light.sample(self.middle, way)?;
                Some(self.afar(sample.direction, sample.radiance / probability, place))
            }
            Chosen::Environment => {
                let sample = lights.environment.as_ref()?.sample(way)?;
                Some(self.afar(sample.direction, sample.radiance / (sample.pdf * probability), place))
            }
            light => {
                let from = lights.area.point_of(light, place, self.exact)?;
                let back = from.both_sides && inside >= 0.5;
                let outward = if back { -from.point.normal } else { from.point.normal }.as_vec3();
                let (x, y) = warp::frame(outward);
                let w = warp::cosine_hemisphere(way);
                let direction = x * w.x + y * w.y + outward * w.z;
                let (radiance, source) = match from.shines {
                    Shines::Evenly(radiance) => (radiance, None),
                    Shines::ByMaterial(hit) => {
                        let surface = stage.world.surface(&hit, from.point, direction, 0.0);
                        let material = &stage.materials[stage.world.material(hit.id)];
                        (material.glow::<K>(&surface), Some(hit.id))
                    }
                };
                let sides = if from.both_sides { 2.0 } else { 1.0 };
                let power = radiance * ((PI * from.area * sides) as f32 / probability);
                let origin = from.point.spawn(direction.as_dvec3());
                let usable = w.z > 0.0 && power.is_finite() && power.max_element() > 0.0;
                usable.then_some(Leaving { origin, direction, source, afar: false, power: Power::Known(power) })
            }
        }
    }

    /// Light through the disk about the whole scene, of this irradiance on it.
    fn afar(&self, towards: Vec3, irradiance: Vec3, u: [f32; 2]) -> Leaving {
        let (x, y) = warp::frame(towards);
        let p = warp::disk(u);
        let across = x.as_dvec3() * f64::from(p.x) + y.as_dvec3() * f64::from(p.y);
        let origin = self.middle + (across + towards.as_dvec3()) * self.radius;
        let power = Power::Known(irradiance * (PI * self.radius * self.radius) as f32);
        Leaving { origin, direction: -towards, source: None, afar: true, power }
    }
}
