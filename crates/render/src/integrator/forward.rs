//! Light tracing: from the lights to the camera.
//!
//! The way of the rays is that of the light ("forward ray tracing"): Arvo, "Backward Ray Tracing" (1986); Dutré,
//! Lafortune and Willems, "Monte Carlo Light Tracing with Direct Computation of Pixel Intensities" (1993). A path
//! starts at a light; wherever it meets a surface that spreads light, that point is joined with the camera, and what
//! goes there is added to the pixel in which the camera sees it. Most of these points are not seen.
//!
//! What a surface sends to a viewer is always asked of the surface as that viewer sees it: materials here need not be
//! the same both ways (shading normals, layers, change of radiance with the index of refraction), and what a path from
//! the camera finds is what is meant. With F = f |cos| towards the light about the shading normal, light that arrives
//! along `l` and goes on along `v` is multiplied by F(v, l) |v.g| / |l.g|, g the geometric normal: Veach, "Robust Monte
//! Carlo Methods for Light Transport Simulation" (1997), section 5.3.2.
//!
//! No path from a light can hit a camera by chance. So where the camera sees a mirror or clear glass, its own paths
//! answer ([`Limits::mirrors`](super::whitted::Limits::mirrors)), and where it sees a light: both together are complete.

use std::f32::consts::FRAC_1_PI;
use std::mem::discriminant;

use firsthit_accel::{Hit, HitId, SurfacePoint};
use firsthit_geometry::Ray;
use glam::{DVec2, DVec3, Vec3};

use super::scatter::{family, is_delta};
use super::tracer::{Clear, Tracer};
use super::whitted::Limits;
use crate::camera::{Cone, FilmCamera};
use crate::kernel::{Kernel, MAX_LOBES};
use crate::light::LightEnd;
use crate::light::emitters::{Emitters, Leaving, Power};
use crate::material::lobes::{Lobe, LobeKind};
use crate::material::{Bsdf, Colors, Material};
use crate::sampler::{Dimension, PixelSampler};
use crate::splat::{Contribution, Reach};
use crate::surface::Surface;
use crate::{LightPaths, RayKind, Stage, warp};

/// After this bounce chance ends paths that have become dim.
const ROULETTE: u32 = 2;
/// Dim is what has lost more than all but this share of its light.
const DIM: f32 = 1.0 / 3.0;
/// At so many surfaces in a row that let a ray pass, it meets the next.
const MOST_LAYERS: u32 = 500;
/// So often a direction is drawn about the flat normal where shading normals differ from it: a viewer may be where the
/// lobes, drawn from as if for the light, send nothing.
const FLAT: f32 = 0.1;

/// What all paths of a picture share.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub(crate) emitters: &'a Emitters,
    pub(crate) camera: &'a FilmCamera,
    /// Of the camera's view, for textures.
    pub(crate) cone: Cone,
    /// Where contributions count.
    pub(crate) reach: Reach,
    pub(crate) limits: Limits,
}

/// The end of a path so far.
struct Walk {
    ray: Ray<f64>,
    source: Option<HitId>,
    kind: RayKind,
    /// What it carries; until it first arrives somewhere, what is to be multiplied with `unknown`.
    light: Vec3,
    unknown: Option<Power>,
    /// It comes straight from infinitely far away.
    afar: bool,
    /// What bounces have left of the light it began with.
    kept: Vec3,
    /// Part of that which is a change of radiance with the index of refraction: it does not make a path dim.
    scale: f32,
    bounce: u32,
    /// Surfaces passed since the last bounce.
    layers: u32,
    /// Absorption of what the ray is in.
    absorption: Vec3,
    colors: Colors,
}

/// A surface that light meets.
struct Vertex<'a> {
    hit: &'a Hit,
    point: SurfacePoint,
    material: &'a Material,
    /// Towards where the light comes from.
    from: Vec3,
    /// Cosine of that to the geometric normal, > 0.
    cos: f32,
    colors: Colors,
    /// Lobes that count: the surface next to the light may use all, others those that are followed.
    lobes: LobeKind,
}

/// A way on.
struct Onward {
    direction: Vec3,
    /// Multiplies the light.
    weight: Vec3,
    /// How much of that is a change with the index of refraction.
    scale: f32,
    /// Which of the surface's lobes it was, as the viewer in that direction sees it; `None`: of all of them.
    lobe: Option<Lobe>,
}

impl<K: Kernel> Tracer<'_, K> {
    /// Follows light from a light, and adds what the camera sees of it.
    pub(crate) fn light_path(
        &mut self,
        scene: &Scene<'_>,
        sampler: PixelSampler,
        out: &mut Vec<Contribution>,
    ) -> LightPaths {
        let mut done = LightPaths { paths: 1, ..LightPaths::default() };
        let stage = self.stage;
        let Some(leaving) = scene.emitters.sample::<K>(stage, &sampler) else { return done };
        let mut walk = Walk::new(&leaving, self.colors(sampler));
        while let Some(hit) = self.closest(walk.kind, &walk.ray, walk.source) {
            let point = stage.accel.surface_point(&walk.ray, &hit);
            if !self.arrive(&mut walk, &hit, point, scene, sampler, out, &mut done) {
                break;
            }
        }
        done
    }

    /// Light that meets a surface; false: it ends there.
    fn arrive(
        &mut self,
        walk: &mut Walk,
        hit: &Hit,
        point: SurfacePoint,
        scene: &Scene<'_>,
        sampler: PixelSampler,
        out: &mut Vec<Contribution>,
        done: &mut LightPaths,
    ) -> bool {
        let stage = self.stage;
        let from = -walk.ray.direction.as_vec3();
        let back = if walk.afar {
            Ray::new(point.position, from.as_dvec3())
        } else {
            Ray::segment(point.position, walk.ray.origin)
        };
        if self.lamp_before(&back) {
            return false;
        }
        if walk.absorption != Vec3::ZERO {
            let way = hit.t * walk.ray.direction.length();
            walk.light *= (walk.absorption * -(way as f32)).map(f32::exp);
        }
        // What one would see who stood at the light.
        let mut surface = stage.world.surface(hit, point, from, 0.0);
        surface.colors = walk.colors;
        let material = &stage.materials[stage.world.material(hit.id)];
        // Numbers are of the vertex: the light itself has the first.
        let number = 1 + walk.bounce;
        let here = if walk.layers == 0 { sampler } else { sampler.branch(walk.layers) };
        if K::FILTERED && material.has_alpha() && walk.layers < MOST_LAYERS {
            let covered = material.coverage::<K>(&surface);
            if covered < 1.0 && sampler.branch(walk.layers).get1(Dimension::Alpha(number)) >= covered {
                walk.pass(&surface, RayKind::Transparency);
                return true;
            }
        }
        let bsdf = material.shade::<K>(&surface).bsdf;
        let lobes = if walk.bounce == 0 { LobeKind::all() } else { scene.limits.follow };
        let cos = from.dot(surface.geometric);
        if bsdf.lobes().is_empty() || !(cos > 0.0) {
            return false;
        }
        let at = Vertex { hit, point, material, from, cos, colors: walk.colors, lobes };
        let Some(light) = walk.arriving(stage, point.position) else { return false };
        if walk.bounce < scene.limits.bounces && bsdf.lobes().iter().any(|l| !is_delta(l)) {
            done.vertices += 1;
            let on_lens = if scene.camera.has_lens() {
                warp::disk(here.get2(Dimension::LightPosition(number))).as_dvec2()
            } else {
                DVec2::ZERO
            };
            done.seen += u64::from(self.show(&at, light, scene, on_lens, out));
        }
        // Clear sheets are passed at the last surface too, as camera rays pass them.
        let (ends, sheet) = (walk.bounce + 1 >= scene.limits.bounces, material.is_clear() && !material.solid);
        if ends && !sheet {
            return false;
        }
        let Some(on) = self.onward(&at, &surface, &bsdf, &here, number, scene.limits.follow) else { return false };
        let unbent = matches!(&on.lobe, Some(Lobe::SpecularTransmission(s)) if s.eta == 1.0);
        if unbent && !material.solid && walk.layers < MOST_LAYERS {
            walk.light *= on.weight;
            walk.pass(&surface, RayKind::Transmission);
            return true;
        }
        walk.light = light * on.weight;
        if ends || !(walk.light.max_element() > 0.0 && walk.light.is_finite()) {
            return false;
        }
        walk.go_on(&on, &surface, material);
        if walk.bounce > ROULETTE {
            let chance = walk.kept.max_element() / (DIM * walk.scale);
            if chance < 1.0 {
                if !(here.get1(Dimension::Roulette(number)) < chance) {
                    return false;
                }
                walk.light /= chance;
                walk.kept /= chance;
            }
        }
        true
    }

    /// Joins a point with the camera; whether anything of it is seen.
    fn show(
        &mut self,
        at: &Vertex<'_>,
        light: Vec3,
        scene: &Scene<'_>,
        on_lens: DVec2,
        out: &mut Vec<Contribution>,
    ) -> bool {
        let Some(seen) =
            scene.camera.project(at.point.position, on_lens.to_array()).filter(|s| scene.reach.contains(s.at))
        else {
            return false;
        };
        let way = seen.eye - at.point.position;
        let distance = way.length();
        let direction = (way / distance).as_vec3();
        if K::FILTERED && self.is_culled(at.hit, self.stage.world.material(at.hit.id), -way) {
            return false;
        }
        let width = (scene.cone.width + scene.cone.spread * distance) as f32;
        let (surface, bsdf) = self.seen_from(at, direction, width);
        let cos = direction.dot(surface.geometric);
        let light = light * scattered(at, &surface, &bsdf) * (cos / at.cos * seen.pixels_per_area as f32);
        if !(light.max_element() > 0.0 && light.is_finite()) {
            return false;
        }
        if self.lamp_before(&Ray::segment(seen.eye, at.point.position)) {
            return false;
        }
        let passed = self.sight(at.point.spawn(direction.as_dvec3()), seen.eye, at.hit.id);
        if passed == Vec3::ZERO {
            return false;
        }
        out.push(Contribution { at: seen.at.map(|x| x as f32), light: light * passed });
        true
    }

    /// Whether a lamp that is not part of the scene's trees stands in the way of light: it is there for who looks at its
    /// glowing side, so `back` runs against the light.
    fn lamp_before(&self, back: &Ray<f64>) -> bool {
        /// The lamp that the light comes from is not in its way.
        const BEFORE_LIGHT: f64 = 1.0 - 1e-6;
        let area = &self.stage.lights.area;
        let most = if back.t_max.is_finite() { BEFORE_LIGHT * back.t_max } else { back.t_max };
        area.has_own() && area.own_hit(&back.with_interval(0.0, most)).is_some()
    }

    /// The surface as a viewer in this direction sees it.
    fn seen_from(&self, at: &Vertex<'_>, viewer: Vec3, width: f32) -> (Surface<'_>, Bsdf<K>) {
        let mut surface = self.stage.world.surface(at.hit, at.point, viewer, width);
        surface.colors = at.colors;
        let bsdf = at.material.shade::<K>(&surface).bsdf;
        (surface, bsdf)
    }

    /// Draws a direction as for a viewer where the light is, and weighs it by what the viewer sees who is there.
    fn onward(
        &self,
        at: &Vertex<'_>,
        surface: &Surface<'_>,
        bsdf: &Bsdf<K>,
        sampler: &PixelSampler,
        number: u32,
        follow: LobeKind,
    ) -> Option<Onward> {
        let lobes = bsdf.lobes();
        let wo = bsdf.local(at.from);
        let chances = chances::<K>(lobes, wo, at.lobes, follow)?;
        let spreads = lobes.iter().zip(chances).any(|(l, c)| c > 0.0 && !is_delta(l));
        let tilted = bsdf.normal != surface.geometric || surface.smooth != surface.geometric;
        let flat = if spreads && tilted { FLAT } else { 0.0 };
        let u = sampler.get2(Dimension::Direction(number));
        let mut choice = sampler.get1(Dimension::Lobe(number));
        let mut drawn = None;
        if choice >= flat {
            choice = (choice - flat) / (1.0 - flat);
            for (i, chance) in chances.iter().enumerate().filter(|(_, c)| **c > 0.0) {
                drawn = Some(i);
                choice -= chance;
                if choice < 0.0 {
                    break;
                }
            }
        }
        let direction = match drawn {
            Some(i) => bsdf.world(lobes[i].sample::<K>(wo, u)?.wi),
            None => {
                let (x, y) = warp::frame(surface.geometric);
                let w = warp::cosine_hemisphere(u);
                x * w.x + y * w.y + surface.geometric * w.z
            }
        };
        let direction = direction.as_dvec3().normalize().as_vec3();
        let (there, seen) = self.seen_from(at, direction, 0.0);
        let cosines = direction.dot(there.geometric) / at.cos;
        if let Some(i) = drawn.filter(|i| is_delta(&lobes[*i])) {
            let lobe = *seen.lobes().iter().find(|l| discriminant(*l) == discriminant(&lobes[i]))?;
            let viewer = seen.local(direction);
            let share = lobe.sample::<K>(viewer, u)?.weight;
            let through = matches!(lobe, Lobe::SpecularTransmission(_));
            if through != (direction.dot(surface.geometric) < 0.0) {
                return None;
            }
            // How a cone of light is widened by refraction: |cos| times solid angle is as the index squared.
            let bent = bend(&lobe);
            let widened = if let Lobe::SpecularTransmission(s) = lobe { s.eta * s.eta * wo.z / viewer.z } else { 1.0 };
            let weight = share * (cosines * widened / ((1.0 - flat) * chances[i]));
            return Some(Onward { direction, weight, scale: bent, lobe: Some(lobe) });
        }
        let side = direction.dot(surface.geometric);
        let mut pdf = flat * FRAC_1_PI * side.max(0.0);
        let wi = bsdf.local(direction);
        for (lobe, chance) in lobes.iter().zip(chances).filter(|(_, c)| *c > 0.0) {
            pdf += (1.0 - flat) * chance * lobe.pdf::<K>(wo, wi);
        }
        let weight = scattered(at, &there, &seen) * (cosines / pdf);
        let lobe = drawn.map(|i| lobes[i]);
        let scale = lobe.as_ref().map_or(1.0, |l| 1.0 / bend(l));
        (pdf > 0.0).then_some(Onward { direction, weight, scale, lobe })
    }

    /// The share of light that gets from a point to the camera: as sight does, it passes holes, partly covering
    /// surfaces and smooth sheets.
    fn sight(&mut self, from: DVec3, eye: DVec3, source: HitId) -> Vec3 {
        let ray = Ray::segment(from, eye);
        self.timed(RayKind::ToCamera, |this| {
            let Some(ray) = this.clipped(&ray) else { return Vec3::ONE };
            if K::FILTERED {
                return this.filtered_transmittance(&ray, None, source, Clear::SmoothSheets);
            }
            if this.stage.accel.any_hit(&ray) { Vec3::ZERO } else { Vec3::ONE }
        })
    }
}

/// How often each lobe is followed; `None`: none is. Of those at the light itself (`lobes`), the ones in `follow`.
fn chances<K: Kernel>(all: &[Lobe], wo: Vec3, lobes: LobeKind, follow: LobeKind) -> Option<[f32; MAX_LOBES]> {
    let mut chances = [0.0; MAX_LOBES];
    let mut sum = 0.0;
    for (chance, lobe) in chances.iter_mut().zip(all) {
        // What the last surface before the camera scatters needs no following: only mirrors must be followed to be seen.
        let kinds = if is_delta(lobe) { follow } else { lobes };
        if kinds.contains(family(lobe)) {
            *chance = lobe.albedo::<K>(wo).max_element().max(0.0);
            sum += *chance;
        }
    }
    if !(sum > 0.0 && sum.is_finite()) {
        return None;
    }
    for chance in &mut chances {
        *chance /= sum;
    }
    Some(chances)
}

/// F(viewer, light) of all lobes that spread light.
fn scattered<K: Kernel>(at: &Vertex<'_>, surface: &Surface<'_>, bsdf: &Bsdf<K>) -> Vec3 {
    let (wo, wi) = (bsdf.local(surface.wo), bsdf.local(at.from));
    // Shading normals may have light on the other side of the triangle than it is.
    let side = at.from.dot(surface.geometric);
    if !(side * wi.z > 0.0) {
        return Vec3::ZERO;
    }
    bsdf.lobes().iter().filter(|l| at.lobes.contains(family(l))).map(|l| l.eval::<K>(wo, wi)).sum()
}

/// By how much refraction as this viewer sees it changes what light carries: nothing where radiance changes with the
/// index.
fn bend(lobe: &Lobe) -> f32 {
    match lobe {
        Lobe::SpecularTransmission(s) => s.eta * s.eta * s.scale,
        Lobe::GgxTransmission(s) => s.eta * s.eta * s.scale,
        _ => 1.0,
    }
}

impl Walk {
    fn new(leaving: &Leaving, colors: Colors) -> Self {
        let (light, unknown) = match leaving.power {
            Power::Known(power) => (power, None),
            power @ Power::OfPunctual { .. } => (Vec3::ONE, Some(power)),
        };
        Self {
            ray: Ray::new(leaving.origin, leaving.direction.as_dvec3()),
            source: leaving.source,
            kind: RayKind::Light,
            light,
            unknown,
            afar: leaving.afar,
            kept: Vec3::ONE,
            scale: 1.0,
            bounce: 0,
            layers: 0,
            absorption: Vec3::ZERO,
            colors,
        }
    }

    /// What it carries where it arrives.
    fn arriving(&self, stage: &Stage, at: DVec3) -> Option<Vec3> {
        let Some(Power::OfPunctual { light, per_density }) = self.unknown else { return Some(self.light) };
        let light = stage.lights.punctual.get(light)?;
        let sample = light.sample_followed(at, [0.5; 2])?;
        let LightEnd::At(place) = sample.end else { return None };
        Some(self.light * sample.radiance * ((place - at).length_squared() as f32 * per_density))
    }

    /// Goes on straight behind a surface.
    fn pass(&mut self, surface: &Surface<'_>, kind: RayKind) {
        let direction = self.ray.direction;
        self.ray = Ray::new(surface.point.spawn(direction), direction);
        (self.source, self.kind, self.afar) = (Some(surface.id), kind, false);
        self.layers += 1;
    }

    /// Leaves a surface; `light` is already what it then carries.
    fn go_on(&mut self, on: &Onward, surface: &Surface<'_>, material: &Material) {
        let direction = on.direction.as_dvec3().normalize();
        let through = on.direction.dot(surface.geometric) < 0.0;
        if through && material.parts_colors {
            self.colors = self.colors.parted();
        }
        let entered = through && material.solid;
        if entered {
            self.absorption = if surface.front { material.absorption } else { Vec3::ZERO };
        }
        self.kind = match on.lobe.as_ref().map_or(LobeKind::DIFFUSE, family) {
            _ if entered => RayKind::Refraction,
            LobeKind::REFLECTION => RayKind::Reflection,
            LobeKind::TRANSMISSION => RayKind::Transmission,
            _ => RayKind::Indirect,
        };
        self.kept *= on.weight;
        self.scale *= on.scale;
        self.ray = Ray::new(surface.point.spawn(direction), direction);
        (self.source, self.unknown, self.afar) = (Some(surface.id), None, false);
        self.layers = 0;
        self.bounce += 1;
    }
}
