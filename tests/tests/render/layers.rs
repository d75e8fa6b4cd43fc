//! What glTF's extensions lay over a material or let through it, against answers known in closed form.

use std::f64::consts::PI;

use firsthit_import::SceneDesc;
use firsthit_import::scene::{
    Anisotropy, Clearcoat, DiffuseTransmission, EnvironmentDesc, Filter, ImageDesc, Iridescence, LightKind,
    MaterialModel, PbrMaterial, Pixels, Sheen, TextureRef,
};
use firsthit_render::{EffectOverrides, EffectSet, IntegratorChoice, StageOptions};
use glam::{DVec3, Vec3};

use crate::common::{self, Probe, ball, mapped_quad, quad, scene_of};
use crate::{assert_near, bits, diffuse, glow, light, pbr, small, surrounded};

/// A dielectric that reflects nothing by itself.
fn matt(color: f32, change: impl FnOnce(&mut PbrMaterial)) -> MaterialModel {
    pbr(|m| {
        m.base_color = Vec3::splat(color).extend(1.0);
        m.metallic = 0.0;
        m.specular = 0.0;
        m.double_sided = true;
        change(m);
    })
}

fn coat(factor: f32, roughness: f32) -> Option<Box<Clearcoat>> {
    Some(Box::new(Clearcoat { factor, roughness, ..Clearcoat::default() }))
}

/// A plain under an even sky.
fn plain_under_sky(material: MaterialModel) -> SceneDesc {
    let mut scene = scene_of(&[material]);
    mapped_quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    surrounded(scene, 1.0)
}

/// Seen at an angle of this cosine to the normal.
fn seen(scene: &SceneDesc, cos: f64) -> DVec3 {
    let eye = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0) * 3.0;
    Probe::new(scene).from(eye).spp(4096).look(DVec3::ZERO)
}

fn schlick(cos: f64) -> f64 {
    0.04 + 0.96 * (1.0 - cos).powi(5)
}

#[test]
fn a_smooth_coat_mirrors_by_schlick_and_dims_what_is_below_by_the_same() {
    for (factor, cos) in [(1.0, 1.0), (1.0, 0.5), (0.5, 0.3)] {
        let on = |color| seen(&plain_under_sky(matt(color, |m| m.clearcoat = coat(factor, 0.0))), cos).x;
        let reflected = f64::from(factor) * schlick(cos);
        assert_near(on(0.0), reflected, 2e-2);
        assert_near(on(0.8), reflected + 0.8 * (1.0 - reflected), 1e-2);
    }
}

/// What glows below a coat loses what the coat would reflect of it, seen or asked for.
#[test]
fn a_coat_dims_what_glows_below_it() {
    let factor = 0.8;
    let lamp = matt(0.0, |m| (m.emissive, m.clearcoat) = (Vec3::splat(5.0), coat(factor, 0.2)));
    let through = |cos: f64| 1.0 - f64::from(factor) * schlick(cos);
    let mut scene = scene_of(std::slice::from_ref(&lamp));
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    for cos in [1.0, 0.5, 0.1f64] {
        let eye = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0) * 3.0;
        for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted] {
            let found = Probe::new(&scene).integrator(integrator).depth(0).from(eye).look(DVec3::ZERO).x;
            assert_near(found, 5.0 * through(cos), 1e-4);
        }
    }
    // Over a floor, facing down, near enough that angles differ.
    let mut scene = scene_of(&[matt(0.6, |_| {}), lamp]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    quad(&mut scene, DVec3::new(-1.0, 0.4, -1.0), DVec3::X * 2.0, DVec3::Z * 2.0, 1);
    let (at, n) = (DVec3::new(1.3, 0.0, 0.0), 600);
    let share = (2.0 / f64::from(n)).powi(2);
    let sum: f64 = (0..n * n)
        .map(|i| {
            let step = |k: i32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let way = DVec3::new(step(i % n), 0.4, step(i / n)) - at;
            let cos = way.normalize().y;
            5.0 * through(cos) * cos * cos / way.length_squared() * share
        })
        .sum();
    let eye = DVec3::new(4.0, 1.0, 0.0);
    // Whitted's method chooses triangle and point by numbers that one pixel does not mix well; without the coat it would
    // be brighter by 8 per cent.
    for (integrator, tolerance) in [(IntegratorChoice::Path, 0.01), (IntegratorChoice::Whitted, 0.03)] {
        let found = Probe::new(&scene).integrator(integrator).depth(1).spp(1 << 14).from(eye).look(at).x;
        assert_near(found, 0.6 / PI * sum, tolerance);
    }
}

#[test]
fn a_white_surface_under_sheen_neither_loses_nor_makes_light() {
    for roughness in [0.3, 0.6, 1.0] {
        for cos in [1.0, 0.6, 0.2] {
            let sheen = Sheen { color: Vec3::ONE, roughness, ..Sheen::default() };
            let scene = plain_under_sky(matt(1.0, |m| m.sheen = Some(Box::new(sheen))));
            assert_near(seen(&scene, cos).x, 1.0, 0.02);
        }
    }
}

#[test]
fn rough_white_metal_keeps_all_light_unless_compensation_is_off() {
    for roughness in [0.3, 0.7, 1.0] {
        for cos in [0.9f64, 0.4] {
            let scene = plain_under_sky(pbr(|m| (m.roughness, m.double_sided) = (roughness, true)));
            let eye = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0) * 3.0;
            let with = |energy_compensation| {
                let stage = StageOptions { energy_compensation, ..StageOptions::default() };
                Probe::new(&scene).stage(stage).from(eye).spp(4096).look(DVec3::ZERO).x
            };
            assert_near(with(true), 1.0, 5e-3);
            let lost = 1.0 - with(false);
            assert!(lost > if roughness > 0.5 { 0.05 } else { 0.0 } && lost < 0.7, "{roughness} {cos}: {lost}");
        }
    }
}

/// Rough glass and rough sheets, from outside and from inside.
#[test]
fn rough_glass_keeps_all_light() {
    for (thickness, roughness) in [(1.0, 0.4), (1.0, 0.8), (0.0, 0.6)] {
        let glass = matt(1.0, |m| {
            (m.transmission, m.thickness, m.roughness, m.specular) = (1.0, thickness, roughness, 1.0);
        });
        let scene = plain_under_sky(glass);
        for cos in [0.9, 0.4, -0.9, -0.4] {
            assert_near(seen(&scene, cos).x, 1.0, 0.012);
        }
    }
}

/// As Khronos' TransmissionRoughnessTest says: facets of an index of 1 change no direction, and reflect nothing.
#[test]
fn rough_air_is_as_clear_as_air() {
    let air = |thickness, specular| {
        matt(0.5, |m| {
            (m.transmission, m.thickness, m.ior) = (1.0, thickness, 1.0);
            (m.roughness, m.specular) = (0.9, specular);
        })
    };
    for (material, passed) in [(air(1.0, 1.0), 0.25), (air(0.0, 0.0), 0.25)] {
        let mut scene = scene_of(&[material, glow(1.0)]);
        quad(&mut scene, DVec3::new(-9.0, 2.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        quad(&mut scene, DVec3::new(-9.0, 1.0, 9.0), DVec3::Z * -18.0, DVec3::X * 18.0, 0);
        // Light on the left alone: what is blurred would mix both.
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 9.0, DVec3::Z * -18.0, 1);
        for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted] {
            for eye in [DVec3::new(0.3, 5.0, 0.2), DVec3::new(-0.2, 2.5, 8.0)] {
                let look = |x| Probe::new(&scene).integrator(integrator).from(eye).look(DVec3::new(x, 0.0, 0.1)).x;
                assert_near(look(-0.1), passed, 1e-4);
                assert_near(look(0.1), 0.0, 1e-4);
            }
        }
    }
}

#[test]
fn light_from_behind_comes_through_diffusely() {
    let through = |factor| {
        let through = DiffuseTransmission { factor, color: Vec3::new(1.0, 0.5, 0.25), ..Default::default() };
        matt(0.8, |m| m.diffuse_transmission = Some(Box::new(through)))
    };
    for factor in [0.25, 1.0] {
        let mut scene = scene_of(&[through(factor)]);
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        let irradiance = Vec3::splat(PI as f32);
        scene.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
        let (at, factor) = (DVec3::new(0.1, 0.0, 0.25), f64::from(factor));
        let below = Probe::new(&scene).from(DVec3::new(0.0, -3.0, 0.0)).look(at);
        assert!((below - DVec3::new(1.0, 0.5, 0.25) * factor).abs().max_element() < 1e-4, "{below}");
        let above = Probe::new(&scene).from(DVec3::new(0.0, 3.0, 0.0)).look(at);
        assert!((above - DVec3::splat(0.8 * (1.0 - factor))).abs().max_element() < 1e-4, "{above}");
    }
}

/// What is not reflected comes from the sky behind.
#[test]
fn a_white_sheet_that_lets_light_through_vanishes_under_an_even_sky() {
    for factor in [0.3, 1.0] {
        let through = DiffuseTransmission { factor, ..DiffuseTransmission::default() };
        let scene = plain_under_sky(matt(1.0, |m| m.diffuse_transmission = Some(Box::new(through))));
        for cos in [0.9, -0.3f64] {
            for integrator in [IntegratorChoice::Whitted, IntegratorChoice::Path] {
                let eye = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0) * 3.0;
                let probe = Probe::new(&scene).integrator(integrator).spp(1024);
                assert_near(probe.from(eye).look(DVec3::ZERO).x, 1.0, 0.01);
            }
        }
    }
}

/// The other integrator finds the same: every layer, through the integrator that follows all of them.
#[test]
fn path_tracing_agrees_about_layers() {
    let film = Iridescence { factor: 1.0, thickness_max: 450.0, ..Iridescence::default() };
    let sheen = Sheen { color: Vec3::new(0.9, 0.5, 0.2), roughness: 0.5, ..Sheen::default() };
    let brushed = Anisotropy { strength: 0.7, rotation: 0.5, texture: None };
    let materials = [
        matt(0.4, |m| m.clearcoat = coat(1.0, 0.4)),
        matt(0.4, |m| m.sheen = Some(Box::new(sheen))),
        matt(0.4, |m| (m.specular, m.roughness, m.iridescence) = (1.0, 0.4, Some(Box::new(film)))),
        pbr(|m| (m.roughness, m.anisotropy, m.double_sided) = (0.4, Some(Box::new(brushed)), true)),
    ];
    for (i, material) in materials.into_iter().enumerate() {
        let scene = plain_under_sky(material);
        let look = |integrator| {
            let eye = DVec3::new(0.8, 0.6, 0.0) * 3.0;
            Probe::new(&scene).integrator(integrator).spp(4096).from(eye).look(DVec3::ZERO)
        };
        let (whitted, path) = (look(IntegratorChoice::Whitted), look(IntegratorChoice::Path));
        assert!((whitted / path - 1.0).abs().max_element() < 0.015, "{i}: {whitted} {path}");
    }
}

/// Small lamps in each of the three colours' places, below the surface of a body that parts them.
#[test]
fn each_colour_is_bent_by_its_own_index() {
    let dispersion = 2.0f32;
    let body = matt(1.0, |m| {
        (m.transmission, m.thickness, m.roughness, m.dispersion) = (1.0, 1.0, 0.0, dispersion);
        (m.specular, m.ior) = (0.0, 1.5);
    });
    let sin = 0.8f64;
    for (color, shift) in [(0, -1.0), (1, 0.0), (2, 1.0)] {
        let n = 1.5 + 0.5 * 0.025 * f64::from(dispersion) * shift;
        let along = (sin / n) / (1.0 - (sin / n) * (sin / n)).sqrt();
        let mut scene = scene_of(&[body.clone(), glow(6.0)]);
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        let lamp = DVec3::new(along - 2e-3, -1.0, 2e-3);
        quad(&mut scene, lamp, DVec3::X * 4e-3, DVec3::Z * -4e-3, 1);
        let found = Probe::new(&scene).from(DVec3::new(-sin, 0.6, 0.0)).spp(4096).look(DVec3::ZERO);
        for c in 0..3 {
            assert_near(found[c], if c == color { 6.0 } else { 0.0 }, 0.01);
        }
    }
}

#[test]
fn glass_that_parts_colours_is_white_under_an_even_sky() {
    let body = matt(1.0, |m| (m.transmission, m.thickness, m.roughness, m.dispersion) = (1.0, 1.0, 0.0, 3.0));
    let mut scene = scene_of(&[body]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let found = Probe::new(&surrounded(scene, 1.0)).from(DVec3::new(0.0, 0.0, 4.0)).spp(4096).look(DVec3::X * 0.5);
    assert!((found - DVec3::ONE).abs().max_element() < 1e-3, "{found}");
}

#[test]
fn a_film_gives_hues_that_change_with_the_angle() {
    let film = Iridescence { factor: 1.0, thickness_max: 450.0, ..Iridescence::default() };
    let bare = plain_under_sky(matt(0.0, |m| (m.specular, m.roughness) = (1.0, 0.0)));
    let filmed = plain_under_sky(matt(0.0, |m| {
        (m.specular, m.roughness, m.iridescence) = (1.0, 0.0, Some(Box::new(film)));
    }));
    let spread = |c: DVec3| (c.max_element() - c.min_element()) / c.max_element();
    assert!(spread(seen(&bare, 0.9)) < 1e-3);
    let (steep, flat) = (seen(&filmed, 0.9), seen(&filmed, 0.5));
    assert!(spread(steep) > 0.2, "{steep}");
    assert!((steep / steep.max_element() - flat / flat.max_element()).length() > 0.1, "{steep} {flat}");
}

/// A highlight is wide along the direction of the greater roughness, and turns with it.
#[test]
fn brushed_metal_spreads_light_along_its_direction() {
    for (rotation, wide) in [(0.0, DVec3::X), (std::f32::consts::FRAC_PI_2, DVec3::Z)] {
        let brushed = Anisotropy { strength: 0.7, rotation, texture: None };
        let metal = pbr(|m| (m.roughness, m.anisotropy) = (0.3, Some(Box::new(brushed))));
        let mut scene = scene_of(&[metal]);
        mapped_quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        scene.lights.push(light(LightKind::Point {
            position: DVec3::Y * 3.0,
            intensity: Vec3::splat(9.0),
            range: None,
        }));
        let at = |p: DVec3| Probe::new(&scene).from(DVec3::Y * 2.9).look(p).x;
        let narrow = DVec3::new(wide.z, 0.0, wide.x);
        let (along, across) = (at(wide * 1.2), at(narrow * 1.2));
        assert!(along > 4.0 * across, "rotation {rotation}: {along} along, {across} across");
    }
}

/// However steep a normal map, it makes no light, and no black where mirror directions leave the surface.
#[test]
fn normal_maps_make_no_light() {
    // Steeper and steeper, turning round.
    let texel = |i: u32| {
        let (angle, tilt) = (f64::from(i) * 2.4, f64::from(i % 16) / 16.0);
        let encode = |x: f64| ((x * 0.5 + 0.5) * 255.0).round() as u8;
        let z = (1.0 - tilt * tilt).sqrt();
        [encode(tilt * angle.cos()), encode(tilt * angle.sin()), encode(z), 255]
    };
    let pixels = Pixels::Rgba8((0..64).map(texel).collect());
    for (metallic, roughness) in [(0.0, 1.0), (1.0, 0.1), (1.0, 0.5)] {
        let material = matt(1.0, |m| {
            (m.metallic, m.roughness) = (metallic, roughness);
            let texture = TextureRef { filter: Filter::Nearest, ..TextureRef::new(0) };
            m.normal_texture = Some(texture);
        });
        let mut scene = plain_under_sky(material);
        scene.images.push(ImageDesc { name: "normals".into(), width: 8, height: 8, pixels: pixels.clone() });
        for i in 0..64 {
            let at = DVec3::new(f64::from(i % 8) - 3.5, 0.0, f64::from(i / 8) - 3.5) * (18.0 / 8.0);
            for eye in [DVec3::new(0.3, 3.0, 0.2), DVec3::new(5.0, 1.0, 0.0)] {
                let found = Probe::new(&scene).from(at + eye).spp(256).look(at).x;
                assert!(found < 1.05 && found > 0.3, "metallic {metallic}, texel {i}: {found}");
            }
        }
    }
}

/// A scene with every layer.
pub(crate) fn everything() -> SceneDesc {
    let layers: [fn(&mut PbrMaterial); 6] = [
        |m| m.clearcoat = coat(1.0, 0.1),
        |m| m.sheen = Some(Box::new(Sheen { color: Vec3::new(0.9, 0.5, 0.3), roughness: 0.4, ..Sheen::default() })),
        |m| {
            m.iridescence = Some(Box::new(Iridescence { factor: 1.0, ..Iridescence::default() }));
            m.specular = 1.0;
            m.roughness = 0.2;
        },
        |m| {
            m.anisotropy = Some(Box::new(Anisotropy { strength: 0.7, rotation: 0.4, texture: None }));
            (m.metallic, m.roughness) = (1.0, 0.3);
        },
        |m| m.diffuse_transmission = Some(Box::new(DiffuseTransmission { factor: 0.6, ..Default::default() })),
        |m| (m.transmission, m.thickness, m.roughness, m.dispersion) = (1.0, 1.0, 0.0, 1.0),
    ];
    let mut materials = vec![diffuse(0.6)];
    materials.extend(layers.map(|layer| matt(0.5, layer)));
    let mut scene = scene_of(&materials);
    quad(&mut scene, DVec3::new(-6.0, -1.0, 6.0), DVec3::X * 12.0, DVec3::Z * -12.0, 0);
    for i in 1..=6 {
        ball(&mut scene, DVec3::new(f64::from(i as u8) - 3.5, -0.5, 0.0), 0.45, i);
    }
    scene.lights.push(light(LightKind::Point {
        position: DVec3::new(1.0, 3.0, 2.0),
        intensity: Vec3::splat(6.0),
        range: None,
    }));
    scene.environment = Some(EnvironmentDesc::Constant { radiance: Vec3::splat(0.4) });
    scene
}

const LAYERS: [EffectSet; 6] = [
    EffectSet::CLEARCOAT,
    EffectSet::SHEEN,
    EffectSet::IRIDESCENCE,
    EffectSet::ANISOTROPY,
    EffectSet::DIFFUSE_TRANSMISSION,
    EffectSet::DISPERSION,
];

#[test]
fn every_layer_is_called_for_by_its_material_and_changes_the_picture() {
    let scene = everything();
    let with = |remove| {
        let effects = EffectOverrides { remove, ..EffectOverrides::default() };
        common::render_scene(&scene, &StageOptions { effects, ..StageOptions::default() }, &small(4))
    };
    let all = with(EffectSet::empty());
    assert_eq!(all.stats.bad_samples, 0);
    for (i, effect) in LAYERS.into_iter().enumerate() {
        let entry = all.effects.entries.iter().find(|e| e.effect == effect).unwrap();
        assert!(entry.called_for && entry.simulated, "{}", entry.name);
        assert_eq!(entry.by, [format!("material 'm{}'", i + 1)]);
        assert_ne!(bits(&all), bits(&with(effect)), "{}", entry.name);
    }
}

/// Taken away, a layer leaves the very picture of the material that never had it.
#[test]
fn a_layer_that_is_not_simulated_leaves_no_trace() {
    let layered = everything();
    let mut bare = layered.clone();
    for material in &mut bare.materials {
        if let MaterialModel::Pbr(m) = &mut material.model {
            (m.clearcoat, m.sheen, m.iridescence, m.anisotropy) = (None, None, None, None);
            (m.diffuse_transmission, m.dispersion) = (None, 0.0);
        }
    }
    let effects = EffectOverrides { remove: LAYERS.into_iter().collect(), ..EffectOverrides::default() };
    let a = common::render_scene(&layered, &StageOptions { effects, ..StageOptions::default() }, &small(4));
    let b = common::render_scene(&bare, &StageOptions::default(), &small(4));
    assert_eq!(bits(&a), bits(&b));
    assert_eq!(a.stats.rays, b.stats.rays);
    assert!(b.effects.entries.iter().all(|e| !LAYERS.contains(&e.effect) || !e.called_for));
}

/// Coloured reflections leave no tint of the opposite colour in the base (KHR_materials_specular).
#[test]
fn what_is_below_a_coloured_reflection_keeps_its_colour() {
    let scene = plain_under_sky(matt(0.5, |m| {
        (m.specular, m.specular_color, m.roughness) = (1.0, Vec3::new(10.0, 0.0, 0.0), 1.0);
    }));
    let found = seen(&scene, 0.9);
    assert!((found.y - found.z).abs() < 1e-3 && found.x > found.y, "{found}");
}
