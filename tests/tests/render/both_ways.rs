//! Light that may be asked for or met by a path: both ways together count it once.

use std::f64::consts::PI;

use firsthit_import::SceneDesc;
use firsthit_import::scene::{
    AlphaMode, Clearcoat, Iridescence, LightKind, MaterialModel, PbrMaterial, Sheen, SurfaceDesc,
};
use firsthit_render::{EffectOverrides, EffectSet, IntegratorChoice, StageOptions};
use glam::{DVec3, Vec3, Vec4};

use super::common::{Probe, ball, quad, scene_of};
use super::{assert_near, diffuse, glow, light, pbr, surrounded};

fn probe(scene: &SceneDesc) -> Probe<'_> {
    Probe::new(scene).integrator(IntegratorChoice::Path)
}

fn without(effects: EffectSet) -> StageOptions {
    let effects = EffectOverrides { remove: effects, ..EffectOverrides::default() };
    StageOptions { effects, ..StageOptions::default() }
}

/// A horizontal square about the y axis, facing up.
fn level(scene: &mut SceneDesc, y: f64, half: f64, material: usize) {
    quad(scene, DVec3::new(-half, y, half), DVec3::X * (2.0 * half), DVec3::Z * (-2.0 * half), material);
}

/// A sheet that all light goes through which it does not reflect.
fn sheet(roughness: f32, change: impl FnOnce(&mut PbrMaterial)) -> MaterialModel {
    pbr(|m| {
        (m.metallic, m.roughness, m.transmission, m.double_sided) = (0.0, roughness, 1.0, true);
        change(m);
    })
}

fn coat(factor: f32) -> Option<Box<Clearcoat>> {
    Some(Box::new(Clearcoat { factor, ..Clearcoat::default() }))
}

/// What scatters light does not let it straight through as well, with a layer on top or without.
#[test]
fn a_thin_coat_over_a_rough_sheet_changes_almost_nothing() {
    let below = |factor: f32| {
        let mut scene = scene_of(&[diffuse(0.8), sheet(0.6, |m| m.clearcoat = coat(factor).filter(|_| factor > 0.0))]);
        level(&mut scene, 0.0, 5.0, 0);
        level(&mut scene, 3.0, 5.0, 1);
        let (position, intensity) = (DVec3::Y * 5.0, Vec3::splat(100.0));
        scene.lights.push(light(LightKind::Point { position, intensity, range: None }));
        probe(&scene).depth(3).spp(16384).from(DVec3::new(-3.0, 1.0, 0.2)).look(DVec3::new(0.3, 0.0, 0.1)).x
    };
    assert_near(below(1e-3), below(0.0), 0.03);
}

/// The sun, which is asked for through the sheet, loses as much there as a lamp that is seen through it.
#[test]
fn a_layered_sheet_takes_as_much_of_light_that_is_asked_for_as_of_sight() {
    let sheen = || Some(Box::new(Sheen { color: Vec3::new(0.9, 0.5, 0.2), roughness: 0.5, ..Sheen::default() }));
    let film = || Some(Box::new(Iridescence { factor: 1.0, thickness_max: 450.0, ..Iridescence::default() }));
    let sheets = [
        sheet(0.0, |m| m.clearcoat = coat(1.0)),
        sheet(0.0, |m| m.sheen = sheen()),
        sheet(0.0, |m| m.iridescence = film()),
        sheet(0.0, |m| (m.clearcoat, m.sheen, m.iridescence) = (coat(0.5), sheen(), film())),
    ];
    for (i, sheet) in sheets.into_iter().enumerate() {
        let mut scene = scene_of(&[diffuse(0.5), sheet, glow(1.0)]);
        level(&mut scene, 1.0, 9.0, 1);
        let mut lamp = scene.clone();
        // Facing down.
        quad(&mut lamp, DVec3::new(-2.0, 2.0, -2.0), DVec3::X * 4.0, DVec3::Z * 4.0, 2);
        let seen = probe(&lamp).depth(0).spp(16384).from(DVec3::new(0.1, -1.0, 0.25)).look(DVec3::new(0.1, 2.0, 0.25));
        level(&mut scene, 0.0, 9.0, 0);
        let irradiance = Vec3::splat(PI as f32);
        scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
        for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted] {
            let look = probe(&scene).integrator(integrator).depth(1);
            let asked = look.from(DVec3::new(-3.0, 0.5, 0.0)).look(DVec3::new(0.1, 0.0, 0.25)) / 0.5;
            assert!((asked / seen - 1.0).abs().max_element() < 0.01, "{i}: {asked} asked for, {seen} seen");
            assert!(asked.min_element() < 0.97, "{i}: {asked}");
        }
    }
}

/// The reflection of a plastic is not followed then, and takes all of its light by asking.
#[test]
fn plastic_in_the_open_is_as_bright_without_indirect_light() {
    let mut scene =
        scene_of(&[pbr(|m| (m.metallic, m.roughness, m.base_color) = (0.0, 0.5, Vec4::new(0.1, 0.1, 0.1, 1.0)))]);
    level(&mut scene, 0.0, 5.0, 0);
    let scene = surrounded(scene, 1.0);
    for cos in [0.9f64, 0.3] {
        let look = |stage| {
            let eye = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0) * 3.0;
            probe(&scene).stage(stage).spp(16384).from(eye).look(DVec3::ZERO).x
        };
        assert_near(look(without(EffectSet::INDIRECT_LIGHT)), look(StageOptions::default()), 0.01);
    }
}

/// A lamp that is there in part sends its part: as much of it as is seen.
#[test]
fn a_lamp_with_alpha_lights_by_as_much_as_covers() {
    let lamp = |alpha: f32, double_sided| {
        pbr(|m| {
            m.base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
            (m.metallic, m.specular, m.emissive, m.alpha_mode) = (0.0, 0.0, Vec3::splat(3.0), AlphaMode::Blend);
            m.double_sided = double_sided;
        })
    };
    let below = |alpha, round, double_sided, integrator, spp| {
        let mut scene = scene_of(&[diffuse(0.5), lamp(alpha, double_sided)]);
        level(&mut scene, 0.0, 5.0, 0);
        if round {
            ball(&mut scene, DVec3::new(0.3, 2.0, 0.0), 0.7, 1);
        } else {
            quad(&mut scene, DVec3::new(-1.0, 2.0, -1.0), DVec3::X * 2.0, DVec3::Z * 2.0, 1);
        }
        let at = DVec3::new(0.1, 0.0, 0.25);
        probe(&scene).integrator(integrator).depth(1).spp(spp).from(DVec3::new(-3.0, 0.5, 0.0)).look(at).x
    };
    for (round, double_sided) in [(false, true), (true, false)] {
        for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted] {
            let share = below(0.25, round, double_sided, integrator, 16384)
                / below(1.0, round, double_sided, integrator, 16384);
            assert_near(share, 0.25, 0.01);
        }
    }
    // The far side of a ball shines through the near one; it is met alone, which is noisier.
    let share = below(0.25, true, true, IntegratorChoice::Path, 1 << 18)
        / below(1.0, true, true, IntegratorChoice::Path, 1 << 18);
    assert_near(share, 0.25 + 0.75 * 0.25, 0.02);
}

/// Where normals turn away from the viewer they are bent back; light from the side that they turned from is met alone.
#[test]
fn normals_that_turn_away_lose_no_light() {
    let white = pbr(|m| (m.metallic, m.specular) = (0.0, 0.0));
    let mut scene = scene_of(&[white, glow(1.0)]);
    level(&mut scene, 0.0, 1e-3, 0);
    if let SurfaceDesc::Triangles(mesh) = &mut scene.meshes[0].geometries[0].surface {
        let (sin, cos) = 70f32.to_radians().sin_cos();
        mesh.normals = vec![Vec3::new(sin, cos, 0.0); 4];
    }
    // A wall on the viewer's side, facing the patch.
    quad(&mut scene, DVec3::new(-3.0, 0.1, -5.0), DVec3::Y * 9.0, DVec3::Z * 10.0, 1);
    let look = |stage| {
        let eye = DVec3::new(-1.0, 0.7, 0.0);
        probe(&scene).stage(stage).depth(1).spp(65536).from(eye).look(DVec3::new(1e-4, 0.0, 2e-4)).x
    };
    let met = look(without(EffectSet::AREA_LIGHTS));
    assert!(met > 0.02, "{met}");
    assert_near(look(StageOptions::default()), met, 0.02);
}

/// A ball of light of the file, half a unit below the surface of what halves light on that way.
#[test]
fn light_inside_a_solid_is_absorbed_on_its_way_out() {
    let color = Vec3::new(0.5, 0.25, 1.0);
    let solid = pbr(|m| {
        (m.metallic, m.roughness, m.transmission, m.thickness, m.ior, m.specular) = (0.0, 0.0, 1.0, 1.0, 1.0, 0.0);
        (m.attenuation_color, m.attenuation_distance) = (color, 0.5);
    });
    let mut scene = scene_of(&[solid]);
    level(&mut scene, 2.0, 9.0, 0);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::Z * -18.0, DVec3::X * 18.0, 0);
    let (center, radiance) = (DVec3::Y, Vec3::splat(3.0));
    scene.lights.push(light(LightKind::Sphere { center, radius: 0.5, radiance }));
    for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted] {
        let found =
            probe(&scene).integrator(integrator).from(DVec3::new(0.0, 5.0, 0.0)).look(DVec3::new(1e-6, 1.0, 0.0));
        assert!((found - 3.0 * color.as_dvec3()).abs().max_element() < 1e-3, "{integrator:?}: {found}");
    }
}
