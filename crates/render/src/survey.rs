//! Looking over a scene: which effects it calls for, and whether it needs a light at the camera.

use firsthit_geometry::Ray;
use firsthit_geometry::clip::ClipRegion;
use firsthit_import::SceneDesc;
use firsthit_import::scene::{AlphaMode, LightKind, MaterialModel, PbrMaterial, SurfaceDesc};
use glam::{DVec3, Vec3};

use crate::camera::Camera;
use crate::camera::Cone;
use crate::integrator::aov::First;
use crate::integrator::whitted::{Limits, Seen};
use crate::integrator::{ROUGHEST_FOLLOWED, Tracer};
use crate::kernel::Full;
use crate::light::environment::luminance;
use crate::light::punctual::PunctualLight;
use crate::material::layers;
use crate::material::lobes::LobeKind;
use crate::sampler::{Dimension, PixelSampler};
use crate::{EffectPlan, EffectSet, Environment, Stage, warp};

/// Even light in rooms that are lit from the camera, as radiance.
pub(crate) const AMBIENT: Vec3 = Vec3::splat(0.27);

/// At most so many materials are named for each effect.
const NAMED: usize = 6;

/// Which materials visible geometry has: those of the scene, then the default material.
pub(crate) fn used_materials(scene: &SceneDesc) -> Vec<bool> {
    let mut used = vec![false; scene.materials.len() + 1];
    for geometry in scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries) {
        used[geometry.material.unwrap_or(scene.materials.len())] = true;
    }
    used
}

/// The effects that the materials of visible geometry call for.
pub(crate) fn call_for_materials(plan: &mut EffectPlan, scene: &SceneDesc, used: &[bool]) {
    let colors = scene
        .instances
        .iter()
        .flat_map(|i| &scene.meshes[i.mesh].geometries)
        .any(|g| matches!(&g.surface, SurfaceDesc::Triangles(mesh) if !mesh.colors.is_empty()));
    let mut calls: Vec<(EffectSet, String)> = scene
        .materials
        .iter()
        .zip(used)
        .enumerate()
        .filter(|(_, (_, used))| **used)
        .map(|(i, (m, _))| {
            let name = if m.name.is_empty() { format!("material {i}") } else { format!("material '{}'", m.name) };
            (effects_of(&m.model), name)
        })
        .collect();
    if used.last() == Some(&true) {
        calls.push((effects_of(&MaterialModel::Pbr(Box::default())), "the default material".into()));
    }
    if colors {
        calls.push((EffectSet::VERTEX_COLORS, "meshes with vertex colours".into()));
    }
    for effect in EffectSet::all().iter() {
        let mut by = calls.iter().filter(|(e, _)| e.contains(effect)).map(|(_, name)| name);
        for name in by.by_ref().take(NAMED) {
            plan.call(effect, name);
        }
        let more = by.count();
        if more > 0 {
            plan.call(effect, format!("{more} more"));
        }
    }
}

fn effects_of(model: &MaterialModel) -> EffectSet {
    match model {
        MaterialModel::Pbr(pbr) => effects_of_pbr(pbr),
        MaterialModel::Diffuse { .. } => EffectSet::INDIRECT_LIGHT,
        MaterialModel::Mirror { .. } => EffectSet::REFLECTION,
        MaterialModel::RoughMirror { alpha, .. } => EffectSet::REFLECTION | even(*alpha),
        MaterialModel::Glass { .. } => EffectSet::REFLECTION | EffectSet::REFRACTION,
        MaterialModel::RoughGlass { alpha, .. } => EffectSet::REFLECTION | EffectSet::REFRACTION | even(*alpha),
        MaterialModel::Emission { radiance } if radiance.max_element() > 0.0 => {
            EffectSet::EMISSION | EffectSet::AREA_LIGHTS
        }
        MaterialModel::Emission { .. } => EffectSet::empty(),
    }
}

/// What is so rough reflects about evenly.
fn even(alpha: f32) -> EffectSet {
    if alpha > ROUGHEST_FOLLOWED { EffectSet::INDIRECT_LIGHT } else { EffectSet::empty() }
}

fn effects_of_pbr(m: &PbrMaterial) -> EffectSet {
    let mut set = EffectSet::empty();
    let textures = [
        &m.base_color_texture,
        &m.opacity_texture,
        &m.metallic_texture,
        &m.roughness_texture,
        &m.emissive_texture,
        &m.transmission_texture,
        &m.specular_texture,
        &m.specular_color_texture,
    ];
    set.set(EffectSet::TEXTURES, textures.iter().any(|t| t.is_some()) || layers::have_textures(m));
    match m.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { .. } => set |= EffectSet::ALPHA_MASK,
        AlphaMode::Blend => set |= EffectSet::ALPHA_BLEND,
    }
    if m.unlit {
        return set | EffectSet::UNLIT;
    }
    let over = layers::effects(m);
    set |= over;
    let coat_normals = m.clearcoat.as_ref().is_some_and(|c| c.normal_texture.is_some());
    if m.normal_texture.is_some() || m.bump_texture.is_some() || coat_normals {
        set |= EffectSet::TEXTURES | EffectSet::NORMAL_MAPS;
    }
    if m.emissive.max_element() > 0.0 {
        set |= EffectSet::EMISSION | EffectSet::AREA_LIGHTS;
    }
    let smooth = m.roughness_texture.is_some() || m.roughness * m.roughness <= ROUGHEST_FOLLOWED;
    // Pure and smooth metals without anything over them mirror, and do nothing else.
    let mirror = m.metallic >= 1.0 && m.metallic_texture.is_none() && smooth && m.roughness_texture.is_none();
    set.set(EffectSet::INDIRECT_LIGHT, !mirror || m.clearcoat.is_some() || m.sheen.is_some());
    let coated = m.specular > 0.0 && m.ior != 1.0 && smooth;
    let mirrors = EffectSet::CLEARCOAT | EffectSet::IRIDESCENCE;
    set.set(EffectSet::REFLECTION, m.metallic > 0.0 || coated || over.intersects(mirrors));
    if m.transmission > 0.0 || over.contains(EffectSet::DIFFUSE_TRANSMISSION) {
        if m.thickness > 0.0 {
            set |= EffectSet::REFRACTION | EffectSet::REFLECTION;
            set.set(EffectSet::ABSORPTION, m.attenuation_distance.is_finite() && m.attenuation_color != Vec3::ONE);
        } else if m.transmission > 0.0 {
            set |= EffectSet::TRANSMISSION;
        }
    }
    set
}

/// The effects that lights call for.
pub(crate) fn call_for_lights(plan: &mut EffectPlan, scene: &SceneDesc, environment: Option<&Environment>, name: &str) {
    let count = |of: fn(&LightKind) -> bool| scene.lights.iter().filter(|l| of(&l.kind)).count();
    let kinds: [(EffectSet, &str, usize); 5] = [
        (EffectSet::PUNCTUAL_LIGHTS, "point light", count(|k| matches!(k, LightKind::Point { .. }))),
        (EffectSet::PUNCTUAL_LIGHTS, "spot light", count(|k| matches!(k, LightKind::Spot { .. }))),
        (EffectSet::PUNCTUAL_LIGHTS, "directional light", count(|k| matches!(k, LightKind::Directional { .. }))),
        (
            EffectSet::AREA_LIGHTS | EffectSet::EMISSION,
            "rectangle light",
            count(|k| matches!(k, LightKind::Rectangle { .. })),
        ),
        (
            EffectSet::AREA_LIGHTS | EffectSet::EMISSION,
            "sphere light",
            count(|k| matches!(k, LightKind::Sphere { .. })),
        ),
    ];
    for (effects, name, n) in kinds {
        if n > 0 {
            let words = if n == 1 { format!("1 {name}") } else { format!("{n} {name}s") };
            plan.call(effects | EffectSet::SHADOWS, words);
        }
    }
    if environment.is_some_and(|e| !e.is_black()) {
        plan.call(EffectSet::ENVIRONMENT | EffectSet::SHADOWS, name);
    }
    if plan.called_for().contains(EffectSet::AREA_LIGHTS) && !plan.called_for().contains(EffectSet::SHADOWS) {
        plan.call(EffectSet::SHADOWS, "glowing surfaces");
    }
}

/// A light at the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Headlight {
    pub(crate) position: DVec3,
    /// How far away half of what is seen is.
    pub(crate) distance: f64,
}

impl Headlight {
    pub(crate) fn light(&self) -> PunctualLight {
        let Self { position, distance } = *self;
        PunctualLight::Headlight { position, irradiance: 2.6, distance, share: 1.0 }
    }
}

/// What the camera sees, looked over by a few rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    /// How far away half of what is seen is.
    pub(crate) distance: f64,
    /// Share of its hemisphere that is open to the surroundings at a typical visible point.
    pub(crate) open: f64,
    /// It fills the picture, and the surroundings hardly reach it.
    pub(crate) indoors: bool,
}

const ROWS: u32 = 18;

/// The rays that look a view over.
fn looks(camera: &Camera, aspect: f64) -> impl Iterator<Item = ((u32, u32), Ray<f64>)> {
    let columns = ((f64::from(ROWS) * aspect) as u32).clamp(1, 64);
    let rays = camera.on_film(columns, ROWS);
    (0..ROWS * columns).map(move |i| {
        let (x, y) = (i % columns, i / columns);
        ((x, y), rays.ray([f64::from(x) + 0.5, f64::from(y) + 0.5]))
    })
}

/// Looks a view over; `None` where there is hardly anything to see.
pub(crate) fn view(accel: &firsthit_accel::Scene, camera: &Camera, aspect: f64) -> Option<View> {
    /// With less of its hemisphere open to the surroundings a typical visible point counts as indoors.
    const INDOORS: f64 = 0.2;
    const DIRECTIONS: u32 = 4;
    let (mut distances, mut open, mut all) = (Vec::new(), 0.0, 0);
    for (pixel, ray) in looks(camera, aspect) {
        all += 1;
        let Some(hit) = accel.closest_hit(&ray) else { continue };
        distances.push(hit.t * ray.direction.length());
        let point = accel.surface_point(&ray, &hit);
        let normal = if point.normal.dot(ray.direction) > 0.0 { -point.normal } else { point.normal };
        let (tangent, bitangent) = warp::frame(normal.as_vec3());
        let sampler = PixelSampler::new(0, pixel, 0);
        for branch in 0..DIRECTIONS {
            let w = warp::cosine_hemisphere(sampler.branch(branch).get2(Dimension::Direction(0)));
            let d = (tangent * w.x + bitangent * w.y).as_dvec3() + normal * f64::from(w.z);
            let away = Ray::new(point.spawn(d), d);
            if !accel.any_hit_filtered(&away, Some(hit.id), |_| true) {
                open += 1.0 / f64::from(DIRECTIONS);
            }
        }
    }
    let seen = distances.len();
    distances.sort_unstable_by(f64::total_cmp);
    let (distance, open) = (*distances.get(seen / 2)?, open / seen as f64);
    Some(View { distance, open, indoors: 2 * seen >= all && open < INDOORS })
}

/// Which share of a light at the camera is enough where the light that surfaces send to each other is followed. In a
/// closed room whose surfaces reflect the share `r`, each sends on `r` of what it gets: `1 + r + r^2 + ...` of the light.
pub(crate) fn share_of_headlight(stage: &Stage, view: &View, aspect: f64) -> f32 {
    /// Of the whitest room.
    const LEAST: f32 = 0.15;
    let mut sum = 0.0;
    let seen = first_sights(stage, aspect, |first, _| {
        let albedo = luminance(first.albedo);
        sum += if albedo.is_finite() { albedo.clamp(0.0, 1.0) } else { 0.0 };
    });
    let reflected = if seen > 0 { (1.0 - view.open) as f32 * sum / seen as f32 } else { 0.0 };
    (1.0 - reflected).max(LEAST)
}

/// Even light for a stage with lights of its own, in place of the light that surfaces send to each other: the mean
/// radiance of what is seen, for the share of directions that is not open (as the ambient term of progressive
/// radiosity, Cohen et al. 1988, by a guess instead of a sum).
pub(crate) fn even_light(stage: &Stage, view: &View, aspect: f64) -> Vec3 {
    let (mut sum, mut seen) = (0.0, 0);
    first_sights(stage, aspect, |_, color| {
        let light = luminance(color);
        if light.is_finite() {
            // What glows or glares must not count for everything.
            sum += light.min(1.0);
            seen += 1;
        }
    });
    Vec3::splat(if seen > 0 { (1.0 - view.open) as f32 * sum / seen as f32 } else { 0.0 })
}

/// Tells of the surfaces that a few rays of the camera see first, and of their radiance by direct light; how many there
/// are.
fn first_sights(stage: &Stage, aspect: f64, mut tell: impl FnMut(&First, Vec3)) -> u32 {
    let clip = ClipRegion::default();
    let mut tracer = Tracer::<Full>::new(stage, &clip);
    let limits = Limits { bounces: 1, follow: LobeKind::empty(), mirrors: false };
    let cone = Cone { width: 0.0, spread: 0.0 };
    let mut seen = 0;
    for (pixel, ray) in looks(&stage.camera, aspect) {
        let sampler = PixelSampler::new(0, pixel, 0);
        if let Seen { color, first: Some(first), .. } = tracer.radiance(ray, cone, [0.5; 2], sampler, limits) {
            tell(&first, color);
            seen += 1;
        }
    }
    seen
}
