//! Pictures against answers that are known in closed form.

mod both_ways;
mod common;
mod effects;
mod fog;
mod forward;
mod layers;
mod lens;
mod motion;
mod path;
mod references;

use std::f64::consts::PI;
use std::sync::Arc;

use common::{Probe, ball, quad, scene_of};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{AlphaMode, EnvironmentDesc, LightDesc, LightKind, MaterialModel, PbrMaterial, SpotRamp};
use firsthit_render::{
    Clip, EffectOverrides, EffectSet, IntegratorChoice, RayKind, RenderOptions, Rendered, StageOptions,
};
use glam::{DAffine3, DVec3, Vec3, Vec4};

pub(crate) fn diffuse(albedo: f32) -> MaterialModel {
    MaterialModel::Diffuse { albedo: Vec3::splat(albedo) }
}

pub(crate) fn glow(radiance: f32) -> MaterialModel {
    MaterialModel::Emission { radiance: Vec3::splat(radiance) }
}

pub(crate) fn pbr(change: impl FnOnce(&mut PbrMaterial)) -> MaterialModel {
    let mut m = PbrMaterial::default();
    change(&mut m);
    MaterialModel::Pbr(Box::new(m))
}

pub(crate) fn light(kind: LightKind) -> LightDesc {
    LightDesc { name: String::new(), kind }
}

pub(crate) fn surrounded(mut scene: SceneDesc, radiance: f32) -> SceneDesc {
    scene.environment = Some(EnvironmentDesc::Constant { radiance: Vec3::splat(radiance) });
    scene
}

/// A floor of 20 x 20 at y = 0, facing up.
fn floor(material: MaterialModel) -> (SceneDesc, usize) {
    let mut scene = scene_of(&[material]);
    quad(&mut scene, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    (scene, 0)
}

#[track_caller]
pub(crate) fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * expected.abs().max(1e-12), "{found} instead of {expected}");
}

#[test]
fn a_point_light_over_a_plane_falls_off_by_lamberts_law() {
    let (mut scene, _) = floor(diffuse(0.8));
    let (position, intensity) = (DVec3::new(0.3, 2.0, -0.4), 5.0f32);
    scene.lights.push(light(LightKind::Point { position, intensity: Vec3::splat(intensity), range: None }));
    for at in [DVec3::ZERO, DVec3::new(3.0, 0.0, 1.0), DVec3::new(-4.0, 0.0, 6.0)] {
        let found = Probe::new(&scene).from(at + DVec3::new(0.5, 3.0, 0.5)).look(at).x;
        let d = position - at;
        let expected = 0.8 / PI * f64::from(intensity) * (d.y / d.length()) / d.length_squared();
        assert_near(found, expected, 1e-4);
    }
}

#[test]
fn a_point_light_on_a_sphere_follows_the_normal_and_leaves_the_far_side_dark() {
    let mut scene = scene_of(&[diffuse(1.0)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let position = DVec3::new(0.0, 4.0, 0.0);
    scene.lights.push(light(LightKind::Point { position, intensity: Vec3::splat(10.0), range: None }));
    for degrees in [5.0f64, 30.0, 60.0, 74.0] {
        let n = DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let found = Probe::new(&scene).from(n * 3.0).look(n).x;
        let d = position - n;
        assert_near(found, 1.0 / PI * 10.0 * (n.dot(d) / d.length()) / d.length_squared(), 1e-3);
    }
    // The horizon lies at acos(1/4) = 75.5 degrees.
    let n = DVec3::new(77f64.to_radians().sin(), 77f64.to_radians().cos(), 0.0);
    assert_eq!(Probe::new(&scene).from(n * 3.0).look(n).x, 0.0);
}

#[test]
fn directional_and_spot_lights_give_their_irradiance() {
    let (mut scene, _) = floor(diffuse(0.5));
    let direction = DVec3::new(0.6, -0.8, 0.0);
    scene.lights = vec![light(LightKind::Directional { direction, irradiance: Vec3::splat(3.0), angle: 0.0 })];
    let eye = DVec3::new(0.1, 2.0, 0.2);
    assert_near(Probe::new(&scene).from(eye).look(DVec3::ZERO).x, 0.5 / PI * 3.0 * 0.8, 1e-4);

    scene.lights = vec![light(LightKind::Spot {
        position: DVec3::new(0.0, 2.0, 0.0),
        direction: DVec3::NEG_Y,
        intensity: Vec3::splat(8.0),
        inner: 0.2,
        outer: 0.4,
        ramp: SpotRamp::LinearAngle,
        range: None,
    })];
    assert_near(Probe::new(&scene).from(eye).look(DVec3::ZERO).x, 0.5 / PI * 2.0, 1e-4);
    let at = DVec3::new(2.0 * 0.3f64.tan(), 0.0, 0.0);
    let cos = 0.3f64.cos();
    assert_near(Probe::new(&scene).from(eye).look(at).x, 0.5 / PI * 8.0 * 0.5 * cos.powi(3) / 4.0, 1e-3);
    assert_eq!(Probe::new(&scene).from(eye).look(DVec3::new(1.0, 0.0, 0.0)).x, 0.0);
}

/// Irradiance at a point below a corner of a rectangle that is parallel to the plane (Howell's catalogue of view
/// factors, B-3).
fn below_corner(a: f64, b: f64, h: f64) -> f64 {
    let (x, y) = (a / h, b / h);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / (2.0 * PI)
}

/// The same lamp as a light of the file and as a glowing mesh; both by form factors.
#[test]
fn a_rectangle_lights_a_plane_by_its_form_factor() {
    let (a, b, h) = (1.5, 0.8, 1.2);
    let (corner, u, v) = (DVec3::new(0.0, h, 0.0), DVec3::X * a, DVec3::Z * b);
    let (mut as_light, _) = floor(diffuse(0.7));
    as_light.lights.push(light(LightKind::Rectangle { corner, edge_u: u, edge_v: v, radiance: Vec3::splat(6.0) }));
    let mut as_mesh = scene_of(&[diffuse(0.7), glow(6.0)]);
    quad(&mut as_mesh, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    quad(&mut as_mesh, corner, u, v, 1);
    for scene in [as_light, as_mesh] {
        let probe = || Probe::new(&scene).from(DVec3::new(-1.0, 1.0, -1.0)).spp(4096);
        let expected = 0.7 * 6.0 * below_corner(a, b, h);
        assert_near(probe().look(DVec3::ZERO).x, expected, 4e-3);
        // Seen from below it glows, from above it is black or not there.
        assert_near(probe().look(DVec3::new(0.4, h, 0.3)).x, 6.0, 1e-6);
        assert!(probe().from(DVec3::new(0.4, 3.0, 0.3)).look(DVec3::new(0.4, h, 0.31)).x < 6.0);
    }
}

#[test]
fn a_ball_of_light_lights_a_plane_as_if_by_its_middle() {
    // E = pi L (r/d)^2 cos, exact while the ball is above the horizon. Also as a shape of the scene.
    let (center, radius) = (DVec3::new(1.0, 2.0, 0.0), 0.6);
    let (mut as_light, _) = floor(diffuse(0.7));
    as_light.lights.push(light(LightKind::Sphere { center, radius, radiance: Vec3::splat(5.0) }));
    let mut as_shape = scene_of(&[diffuse(0.7), glow(5.0)]);
    quad(&mut as_shape, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    ball(&mut as_shape, center, radius, 1);
    for scene in [as_light, as_shape] {
        let found = Probe::new(&scene).from(DVec3::new(-1.0, 1.0, 0.0)).spp(2048).look(DVec3::ZERO).x;
        assert_near(found, 0.7 * 5.0 * (radius * radius / 5.0) * (2.0 / 5f64.sqrt()), 4e-3);
    }
}

#[test]
fn a_wall_takes_half_of_the_sky() {
    // At the foot of an endless wall half of an even sky is hidden: E = pi / 2.
    let mut scene = scene_of(&[diffuse(0.6), diffuse(0.0)]);
    quad(&mut scene, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    quad(&mut scene, DVec3::new(1e-4, 0.0, 5e3), DVec3::Z * -1e4, DVec3::Y * 1e4, 1);
    let scene = surrounded(scene, 2.0);
    let found = Probe::new(&scene).from(DVec3::new(-2.0, 2.0, 0.0)).spp(4096).look(DVec3::ZERO).x;
    assert_near(found, 0.6 * 2.0 * 0.5, 0.01);
}

/// Where a ray comes out that goes down through a slab of glass, by Snell's law.
#[test]
fn glass_bends_light_by_snells_law() {
    let glass = MaterialModel::Glass { ior: 1.5 };
    let (sin_in, sin_out) = (0.6f64, 0.6f64 / 1.5);
    let shift = (1.0 / (1.0 - sin_out * sin_out).sqrt()) * sin_out;
    let mut scene = scene_of(&[glass, glow(4.0), glow(1.0)]);
    // The slab from y = 0 to y = -1, with outward faces; a small lamp under it.
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(-9.0, -1.0, 9.0), DVec3::Z * -18.0, DVec3::X * 18.0, 0);
    let tan_in = sin_in / (1.0 - sin_in * sin_in).sqrt();
    let lamp = DVec3::new(shift + tan_in, -2.0, 0.0);
    quad(&mut scene, lamp + DVec3::new(-0.01, 0.0, 0.01), DVec3::X * 0.02, DVec3::Z * -0.02, 1);
    scene.settings.reference_conventions = true;
    let eye = DVec3::new(-3.0 * tan_in, 3.0, 0.0);
    let f = |cos_i: f64, cos_t: f64| {
        let rs: f64 = (cos_i - 1.5 * cos_t) / (cos_i + 1.5 * cos_t);
        let rp: f64 = (1.5 * cos_i - cos_t) / (1.5 * cos_i + cos_t);
        0.5 * (rs * rs + rp * rp)
    };
    let through = 1.0 - f(0.8, (1.0 - sin_out * sin_out).sqrt());
    let found = Probe::new(&scene).from(eye).look(DVec3::ZERO).x;
    // Straight through, and by two, four, ... inner reflections elsewhere: the lamp is too small for those.
    assert_near(found, 4.0 * through * through, 1e-3);
    let beside = Probe::new(&scene).from(eye).look(DVec3::new(0.05, 0.0, 0.0)).x;
    assert_eq!(beside, 0.0);
}

#[test]
fn inside_glass_all_light_is_reflected_beyond_the_critical_angle() {
    let mut scene = scene_of(&[MaterialModel::Glass { ior: 1.5 }, glow(3.0)]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    // A lamp below the surface, inside the glass, facing up; the eye is inside as well.
    quad(&mut scene, DVec3::new(-1.0, -1.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 1);
    scene.settings.reference_conventions = true;
    for (tan, total) in [(1.0f64, true), (0.5, false)] {
        let at = DVec3::new(-tan * 0.9, 0.0, 0.0);
        let eye = at + DVec3::new(-tan, -1.0, 0.0) * 0.9;
        let found = Probe::new(&scene).from(eye).look(at).x;
        if total {
            assert_near(found, 3.0, 1e-6);
        } else {
            assert!(found > 0.0 && found < 0.5, "{found}");
        }
    }
}

#[test]
fn a_mirror_shows_what_is_at_the_mirrored_place() {
    let mut scene = scene_of(&[MaterialModel::Mirror { reflectance: Vec3::new(0.9, 0.5, 0.1) }, glow(2.0)]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(1.9, 1.0, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, 1);
    let found = Probe::new(&scene).from(DVec3::new(-2.0, 1.0, 0.0)).look(DVec3::ZERO);
    assert!((found - DVec3::new(1.8, 1.0, 0.2)).abs().max_element() < 1e-5, "{found}");
    assert_eq!(Probe::new(&scene).from(DVec3::new(-2.0, 1.0, 0.0)).look(DVec3::X * 0.2).x, 0.0);
}

#[test]
fn a_mask_has_holes_for_sight_and_for_light() {
    for (alpha, there) in [(0.6, true), (0.4, false)] {
        let mask = pbr(|m| {
            m.base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
            m.specular = 0.0;
            m.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
            m.double_sided = true;
            m.metallic = 0.0;
        });
        let mut scene = scene_of(&[diffuse(0.5), mask]);
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        quad(&mut scene, DVec3::new(-1.0, 1.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 1);
        let irradiance = Vec3::splat(PI as f32);
        scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
        let below = Probe::new(&scene).from(DVec3::new(-3.0, 0.5, 0.0)).look(DVec3::ZERO).x;
        let above = Probe::new(&scene).from(DVec3::new(0.1, 3.0, 0.0)).look(DVec3::ZERO).x;
        let expected = if there { 0.0 } else { 0.5 };
        assert_near(below, expected, 1e-4);
        assert_near(above, expected, 1e-4);
    }
}

#[test]
fn a_surface_that_covers_a_quarter_lets_three_quarters_of_sight_and_light_pass() {
    let veil = pbr(|m| {
        m.base_color = Vec4::new(0.0, 0.0, 0.0, 0.25);
        m.specular = 0.0;
        m.alpha_mode = AlphaMode::Blend;
        m.double_sided = true;
        m.metallic = 0.0;
        m.emissive = Vec3::splat(2.0);
    });
    let mut scene = scene_of(&[diffuse(0.5), veil]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(-1.0, 1.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 1);
    // Not on the edge that the two triangles share, where each of them counts.
    let (at, above_eye) = (DVec3::new(0.1, 0.0, 0.25), DVec3::new(0.2, 3.0, 0.2));
    let irradiance = Vec3::splat(PI as f32);
    scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
    let no_glow = StageOptions {
        effects: EffectOverrides { remove: EffectSet::AREA_LIGHTS, ..EffectOverrides::default() },
        ..StageOptions::default()
    };
    let probe = || Probe::new(&scene).stage(no_glow.clone());
    assert_near(probe().from(DVec3::new(-3.0, 0.5, 0.0)).look(at).x, 0.5 * 0.75, 1e-4);
    let above = probe().from(above_eye).look(at);
    assert_near(above.x, 0.25 * 2.0 + 0.75 * 0.5 * 0.75, 1e-4);
}

#[test]
fn a_thin_coloured_pane_tints_sight_and_light() {
    let tint = Vec4::new(0.9, 0.4, 0.2, 1.0);
    let pane = pbr(|m| {
        m.base_color = tint;
        m.metallic = 0.0;
        m.roughness = 0.0;
        m.transmission = 1.0;
        m.ior = 1.0;
        m.specular = 0.0;
        m.double_sided = true;
    });
    let mut scene = scene_of(&[diffuse(0.5), pane]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(-1.0, 1.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 1);
    // Not on the edge that the two triangles share, where each of them counts.
    let (at, above_eye) = (DVec3::new(0.1, 0.0, 0.25), DVec3::new(0.2, 3.0, 0.2));
    let irradiance = Vec3::splat(PI as f32);
    scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
    let below = Probe::new(&scene).from(DVec3::new(-3.0, 0.5, 0.0)).look(at);
    let above = Probe::new(&scene).from(above_eye).look(at);
    let t = tint.truncate().as_dvec3();
    assert!((below - 0.5 * t).abs().max_element() < 1e-4, "{below}");
    assert!((above - 0.5 * t * t).abs().max_element() < 1e-4, "{above}");
}

#[test]
fn solids_absorb_by_beers_law() {
    // A slab of thickness 2 with index 1: nothing is bent or reflected along the normal (specular 0).
    let solid = pbr(|m| {
        m.metallic = 0.0;
        m.roughness = 0.0;
        m.transmission = 1.0;
        m.thickness = 1.0;
        m.ior = 1.0;
        m.specular = 0.0;
        m.attenuation_color = Vec3::new(0.5, 0.25, 1.0);
        m.attenuation_distance = 1.0;
    });
    let mut scene = scene_of(&[solid, glow(1.0)]);
    quad(&mut scene, DVec3::new(-9.0, 2.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::Z * -18.0, DVec3::X * 18.0, 0);
    quad(&mut scene, DVec3::new(-9.0, -1.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 1);
    let found = Probe::new(&scene).from(DVec3::new(0.0, 5.0, 0.0)).look(DVec3::new(1e-6, 0.0, 0.0));
    assert!((found - DVec3::new(0.25, 0.0625, 1.0)).abs().max_element() < 1e-4, "{found}");
}

#[test]
fn back_faces_of_single_sided_materials_are_not_there_for_sight_and_light() {
    let sided = |double_sided| {
        pbr(|m| {
            m.base_color = Vec4::new(0.0, 0.0, 0.0, 1.0);
            m.metallic = 0.0;
            m.specular = 0.0;
            m.emissive = Vec3::splat(1.0);
            m.double_sided = double_sided;
        })
    };
    for double_sided in [false, true] {
        let mut scene = scene_of(&[sided(double_sided)]);
        quad(&mut scene, DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, 0);
        let scene = surrounded(scene, 7.0);
        let above = Probe::new(&scene).from(DVec3::new(0.1, 3.0, 0.0)).look(DVec3::ZERO).x;
        let below = Probe::new(&scene).from(DVec3::new(0.1, -3.0, 0.0)).look(DVec3::ZERO).x;
        assert_near(above, 1.0, 1e-5);
        assert_near(below, if double_sided { 1.0 } else { 7.0 }, 1e-5);

        // A mirrored instance keeps its outside.
        let mut mirrored = scene;
        mirrored.instances[0].transform = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let above = Probe::new(&mirrored).from(DVec3::new(0.1, 3.0, 0.0)).look(DVec3::ZERO).x;
        assert_near(above, 1.0, 1e-5);
    }
    // Light that meets the back goes on; light that meets the front casts a shadow.
    for (edge_u, edge_v, arriving) in [(DVec3::Z * -2.0, DVec3::X * 2.0, 1.0), (DVec3::X * 2.0, DVec3::Z * -2.0, 0.0)] {
        let mut scene = scene_of(&[diffuse(0.5), sided(false)]);
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        quad(&mut scene, DVec3::new(-1.0, 1.0, 1.0), edge_u, edge_v, 1);
        let irradiance = Vec3::splat(1.0);
        scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
        let options = StageOptions {
            effects: EffectOverrides { remove: EffectSet::AREA_LIGHTS, ..EffectOverrides::default() },
            ..StageOptions::default()
        };
        let seen = Probe::new(&scene).stage(options).from(DVec3::new(-3.0, 0.5, 0.0)).look(DVec3::ZERO).x;
        assert_near(seen, arriving * 0.5 / PI, 1e-5);
    }
}

#[test]
fn a_cut_shows_the_inside() {
    let mut scene = scene_of(&[diffuse(1.0), glow(2.0)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    ball(&mut scene, DVec3::ZERO, 0.2, 1);
    let plane = Clip { bounds: None, planes: vec![(DVec3::Z, 0.5)] };
    let whole = Probe::new(&scene).from(DVec3::Z * 3.0).look(DVec3::ZERO).x;
    let cut = Probe::new(&scene).clip(plane).from(DVec3::Z * 3.0).look(DVec3::ZERO).x;
    assert_eq!((whole, cut), (0.0, 2.0));
    let half = Clip { bounds: Some((DVec3::splat(-2.0), DVec3::new(2.0, 2.0, 0.0))), planes: vec![] };
    // The lamp is cut in half as well: one looks into its black inside.
    assert_eq!(Probe::new(&scene).clip(half).from(DVec3::Z * 3.0).look(DVec3::ZERO).x, 0.0);
}

#[test]
fn ambient_occlusion_is_one_on_a_plain_and_half_at_a_wall() {
    let mut scene = scene_of(&[diffuse(0.6)]);
    quad(&mut scene, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    let probe = |scene: &SceneDesc| {
        Probe::new(scene)
            .integrator(IntegratorChoice::AmbientOcclusion)
            .from(DVec3::new(-2.0, 2.0, 0.0))
            .spp(2048)
            .look(DVec3::ZERO)
            .x
    };
    assert_eq!(probe(&scene), 1.0);
    quad(&mut scene, DVec3::new(1e-4, 0.0, 5e3), DVec3::Z * -1e4, DVec3::Y * 1e4, 0);
    assert_near(probe(&scene), 0.5, 0.02);
}

/// A scene with a bit of everything.
pub(crate) fn everything() -> SceneDesc {
    let gloss = pbr(|m| {
        m.base_color = Vec4::new(0.8, 0.3, 0.2, 1.0);
        m.roughness = 0.3;
        m.metallic = 0.0;
    });
    let veil = pbr(|m| {
        m.base_color = Vec4::new(0.1, 0.7, 0.2, 0.4);
        m.alpha_mode = AlphaMode::Blend;
        m.double_sided = true;
    });
    let metal = MaterialModel::RoughMirror { alpha: 0.2, reflectance: Vec3::new(0.9, 0.7, 0.4) };
    let frosted = MaterialModel::RoughGlass { ior: 1.4, alpha: 0.15 };
    let mut scene = scene_of(&[diffuse(0.6), gloss, MaterialModel::Glass { ior: 1.5 }, metal, veil, frosted]);
    quad(&mut scene, DVec3::new(-6.0, -1.0, 6.0), DVec3::X * 12.0, DVec3::Z * -12.0, 0);
    ball(&mut scene, DVec3::new(-1.2, -0.4, 0.0), 0.6, 1);
    ball(&mut scene, DVec3::new(0.0, -0.4, 0.3), 0.6, 2);
    ball(&mut scene, DVec3::new(1.2, -0.4, 0.0), 0.6, 3);
    quad(&mut scene, DVec3::new(-2.0, -1.0, 1.2), DVec3::X * 1.0, DVec3::Y * 1.5, 4);
    ball(&mut scene, DVec3::new(0.6, -0.7, 1.1), 0.3, 5);
    scene.lights.push(light(LightKind::Point {
        position: DVec3::new(1.0, 3.0, 2.0),
        intensity: Vec3::splat(6.0),
        range: None,
    }));
    scene.lights.push(light(LightKind::Rectangle {
        corner: DVec3::new(-1.0, 2.5, -1.0),
        edge_u: DVec3::X,
        edge_v: DVec3::Z,
        radiance: Vec3::splat(4.0),
    }));
    surrounded(scene, 0.3)
}

pub(crate) fn small(spp: u32) -> RenderOptions {
    RenderOptions { width: 48, height: 32, spp, seed: 5, max_depth: 8, ..RenderOptions::default() }
}

fn whitted(spp: u32) -> RenderOptions {
    RenderOptions { integrator: IntegratorChoice::Whitted, ..small(spp) }
}

pub(crate) fn bits(rendered: &Rendered) -> Vec<[u32; 4]> {
    rendered.film.color().pixels.iter().map(|p| p.map(f32::to_bits)).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = everything();
    for options in [small(4), whitted(4)] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| common::render_scene(&scene, &StageOptions::default(), &options))
        };
        let (one, two, three) = (with(1), with(2), with(3));
        assert_eq!(bits(&one), bits(&two));
        assert_eq!(bits(&one), bits(&three));
        assert_eq!(one.stats.rays, two.stats.rays);
    }
    let one = common::render_scene(&scene, &StageOptions::default(), &small(4));
    let other = common::render_scene(&scene, &StageOptions::default(), &RenderOptions { seed: 6, ..small(4) });
    assert_ne!(bits(&one), bits(&other));
}

#[test]
fn all_samples_are_light() {
    let rendered = common::render_scene(&everything(), &StageOptions::default(), &small(16));
    assert_eq!(rendered.stats.bad_samples, 0);
    assert_eq!(rendered.stats.samples, 48 * 32 * 16);
    for p in rendered.film.color().pixels {
        assert!(p.iter().all(|v| v.is_finite() && *v >= 0.0));
    }
}

#[test]
fn numbers_that_are_no_light_are_dropped_and_counted() {
    let mut scene = scene_of(&[glow(f32::INFINITY)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let rendered = common::render_scene(&scene, &StageOptions::default(), &small(1));
    assert!(rendered.stats.bad_samples > 0);
    assert!(rendered.film.color().pixels.iter().flatten().all(|v| v.is_finite()));
}

/// What nothing in the scene calls for is not simulated, to the last ray.
#[test]
fn no_ray_is_cast_for_an_effect_that_nothing_calls_for() {
    let (mut scene, _) = floor(diffuse(0.5));
    scene.lights.push(light(LightKind::Point { position: DVec3::Y, intensity: Vec3::ONE, range: None }));
    scene.settings.reference_conventions = true;
    let rendered = common::render_scene(&scene, &StageOptions::default(), &whitted(2));
    for kind in RayKind::ALL {
        let called = matches!(kind, RayKind::Camera | RayKind::ShadowPunctual);
        assert_eq!(rendered.stats.rays[kind] > 0, called, "{kind:?}");
    }
    for entry in &rendered.effects.entries {
        let called = EffectSet::SHADOWS | EffectSet::PUNCTUAL_LIGHTS | EffectSet::INDIRECT_LIGHT;
        assert_eq!(entry.called_for, called.contains(entry.effect), "{}", entry.name);
        let simulated = called - EffectSet::INDIRECT_LIGHT;
        assert_eq!(entry.simulated, simulated.contains(entry.effect), "{}", entry.name);
        assert!(entry.simulated || entry.rays.is_none_or(|r| r == 0), "{}", entry.name);
    }
    assert_eq!(rendered.effects.entries[1].by, ["1 point light"]);
}

#[test]
fn effects_that_are_taken_away_cast_no_rays() {
    let scene = everything();
    let without = |remove| {
        let effects = EffectOverrides { remove, ..EffectOverrides::default() };
        common::render_scene(&scene, &StageOptions { effects, ..StageOptions::default() }, &whitted(1)).stats.rays
    };
    let all = without(EffectSet::empty());
    for kind in RayKind::ALL {
        let not_here = matches!(
            kind,
            RayKind::Transmission
                | RayKind::AmbientOcclusion
                | RayKind::Indirect
                | RayKind::Fog
                | RayKind::Light
                | RayKind::ToCamera
        );
        assert_eq!(all[kind] > 0, !not_here, "{kind:?}");
    }
    assert_eq!(without(EffectSet::SHADOWS).shadow(), 0);
    assert_eq!(without(EffectSet::REFLECTION)[RayKind::Reflection], 0);
    assert_eq!(without(EffectSet::REFRACTION)[RayKind::Refraction], 0);
    assert_eq!(without(EffectSet::ALPHA_BLEND)[RayKind::Transparency], 0);
    assert_eq!(without(EffectSet::AREA_LIGHTS)[RayKind::ShadowArea], 0);
    assert_eq!(without(EffectSet::ENVIRONMENT)[RayKind::ShadowEnvironment], 0);
}

/// The kernel that is compiled for what a scene calls for gives the very bits of the one that can do all.
#[test]
fn the_specialised_kernel_gives_the_bits_of_the_full_one() {
    let mut plain = scene_of(&[diffuse(0.6), MaterialModel::Mirror { reflectance: Vec3::splat(0.9) }]);
    quad(&mut plain, DVec3::new(-6.0, -1.0, 6.0), DVec3::X * 12.0, DVec3::Z * -12.0, 0);
    ball(&mut plain, DVec3::ZERO, 1.0, 1);
    for scene in [surrounded(plain, 0.8), everything(), layers::everything()] {
        let full = StageOptions {
            effects: EffectOverrides { add: EffectSet::all(), ..EffectOverrides::default() },
            ..StageOptions::default()
        };
        for options in [small(4), whitted(4)] {
            let a = common::render_scene(&scene, &StageOptions::default(), &options);
            let b = common::render_scene(&scene, &full, &options);
            assert_eq!(bits(&a), bits(&b));
            assert_eq!(a.stats.rays, b.stats.rays);
        }
    }
}

/// World space is f64: far away a scene looks as at the origin.
#[test]
fn a_scene_at_ten_million_looks_as_at_the_origin() {
    let near = everything();
    let far_by = DVec3::new(1e7, -2e7, 3e7);
    let mut far = near.clone();
    for instance in &mut far.instances {
        instance.transform = DAffine3::from_translation(far_by) * instance.transform;
    }
    for l in &mut far.lights {
        match &mut l.kind {
            LightKind::Point { position, .. } => *position += far_by,
            LightKind::Rectangle { corner, .. } => *corner += far_by,
            _ => {}
        }
    }
    let from = |scene: &SceneDesc, shift: DVec3| {
        let mut stage = StageOptions::default();
        stage.camera_changes.position = Some(DVec3::new(0.5, 1.0, 5.0) + shift);
        stage.camera_changes.focal_point = Some(shift);
        common::render_scene(scene, &stage, &whitted(4)).film.color().pixels
    };
    let (a, b) = (from(&near, DVec3::ZERO), from(&far, far_by));
    let mut different = 0;
    for (p, q) in a.iter().zip(&b) {
        let d = (0..3).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
        different += usize::from(d > 0.02);
    }
    // World coordinates there are exact to 4e-9: a few rays choose another side of an edge.
    assert!(different <= 2, "{different} of {} pixels differ", a.len());
}

#[test]
fn a_cancelled_render_is_a_picture_with_fewer_samples() {
    struct AfterOnePass;
    impl firsthit_render::Monitor for AfterOnePass {
        fn cancelled(&self) -> bool {
            DONE.load(std::sync::atomic::Ordering::Relaxed) >= 8
        }
        fn progress(&self, done: u64, _: u64, _: u64) {
            DONE.store(done, std::sync::atomic::Ordering::Relaxed);
        }
    }
    static DONE: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
    let scene = Arc::new(everything());
    let stage = common::stage(&scene, &StageOptions::default());
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let cancelled = one_thread.install(|| firsthit_render::render(&stage, &small(64), &AfterOnePass)).unwrap();
    assert!(cancelled.interrupted);
    // 8 bands of 4 rows: exactly the first pass, of one sample.
    let first_pass = firsthit_render::render(&stage, &small(1), &()).unwrap();
    assert_eq!(bits(&cancelled), bits(&first_pass));
    assert!(!first_pass.interrupted);
}

#[test]
fn a_transparent_background_has_no_alpha() {
    let mut scene = scene_of(&[diffuse(0.5)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let scene = surrounded(scene, 1.0);
    let stage = StageOptions { background: firsthit_render::Background::Transparent, ..StageOptions::default() };
    let picture = common::render_scene(&scene, &stage, &small(4)).film.color();
    assert_eq!(picture.pixels[0], [0.0; 4]);
    let middle = picture.pixels[16 * 48 + 24];
    assert!((middle[3] - 1.0).abs() < 1e-6 && middle[0] > 0.4);
}

#[test]
fn options_without_a_picture_are_refused() {
    use firsthit_render::{Crop, RenderError, render};
    let stage = common::stage(&Arc::new(SceneDesc::default()), &StageOptions::default());
    let options = |change: fn(&mut RenderOptions)| {
        let mut o = small(1);
        change(&mut o);
        o
    };
    assert_eq!(render(&stage, &options(|o| o.width = 0), &()).unwrap_err(), RenderError::Size { width: 0, height: 32 });
    assert_eq!(render(&stage, &options(|o| o.spp = 0), &()).unwrap_err(), RenderError::NoSamples);
    let outside = options(|o| o.crop = Some(Crop { x: 48, y: 0, width: 5, height: 5 }));
    assert_eq!(render(&stage, &outside, &()).unwrap_err(), RenderError::EmptyCrop);
}

#[test]
fn a_missing_camera_is_named_with_those_that_there_are() {
    use firsthit_render::{CameraChoice, Stage};
    let scene = Arc::new(everything());
    let accel = common::accel(&scene);
    let options = StageOptions { camera: CameraChoice::Named("front".into()), ..StageOptions::default() };
    let error = Stage::new(scene, accel, &options).unwrap_err();
    assert_eq!(error.to_string(), "there is no camera 'front' (the scene has none; 'auto' frames the model)");
}
