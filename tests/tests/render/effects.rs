//! Only what a scene calls for is done, to the last ray, sample and look-up; and what a picture is without an effect.

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use firsthit_import::SceneDesc;
use firsthit_import::scene::{
    AlphaMode, Anisotropy, Clearcoat, DiffuseTransmission, EnvironmentDesc, FogDesc, ImageDesc, Iridescence, LightKind,
    MaterialModel, PbrMaterial, Pixels, Sheen, SurfaceDesc, TextureRef,
};
use firsthit_render::{
    AblateError, AblateOptions, Ablations, CameraChanges, Clip, EffectOverrides, EffectSet, FilterChoice,
    IntegratorChoice, KernelChoice, Monitor, RenderOptions, Rendered, StageOptions, ablate, render,
};
use glam::{DAffine3, DVec3, Vec3, Vec4};

use crate::common::{accel, mapped_quad, quad, render_scene, scene_of, stage};
use crate::{assert_near, bits, diffuse, light, pbr, small, surrounded};

type Change = fn(&mut PbrMaterial);

/// A material for each effect of materials.
const SPECIMENS: [(EffectSet, Change); 15] = [
    (EffectSet::REFLECTION, |m| (m.metallic, m.roughness) = (1.0, 0.1)),
    (EffectSet::REFRACTION, |m| (m.transmission, m.thickness, m.roughness) = (1.0, 1.0, 0.0)),
    (EffectSet::TRANSMISSION, |m| (m.transmission, m.roughness) = (1.0, 0.0)),
    (EffectSet::ALPHA_MASK, |m| {
        m.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        m.base_color_texture = Some(TextureRef::new(0));
    }),
    (EffectSet::ALPHA_BLEND, |m| {
        m.alpha_mode = AlphaMode::Blend;
        m.base_color_texture = Some(TextureRef::new(0));
    }),
    (EffectSet::TEXTURES, |m| m.base_color_texture = Some(TextureRef::new(0))),
    (EffectSet::NORMAL_MAPS, |m| m.normal_texture = Some(TextureRef::new(0))),
    (EffectSet::EMISSION, |m| m.emissive = Vec3::splat(2.0)),
    (EffectSet::ABSORPTION, |m| {
        (m.transmission, m.thickness, m.roughness) = (1.0, 1.0, 0.0);
        (m.attenuation_color, m.attenuation_distance) = (Vec3::new(0.2, 0.9, 0.3), 0.5);
    }),
    (EffectSet::UNLIT, |m| m.unlit = true),
    (EffectSet::CLEARCOAT, |m| {
        m.clearcoat = Some(Box::new(Clearcoat {
            factor: 1.0,
            texture: Some(TextureRef::new(0)),
            roughness: 0.1,
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
        }));
    }),
    (EffectSet::SHEEN, |m| m.sheen = Some(Box::new(Sheen { color: Vec3::ONE, roughness: 0.4, ..Sheen::default() }))),
    (EffectSet::IRIDESCENCE, |m| m.iridescence = Some(Box::new(Iridescence { factor: 1.0, ..Iridescence::default() }))),
    (EffectSet::ANISOTROPY, |m| {
        m.anisotropy = Some(Box::new(Anisotropy { strength: 0.7, rotation: 0.4, texture: None }));
        (m.metallic, m.roughness) = (1.0, 0.3);
    }),
    (EffectSet::DIFFUSE_TRANSMISSION, |m| {
        m.diffuse_transmission = Some(Box::new(DiffuseTransmission { factor: 0.6, ..Default::default() }));
    }),
];

/// A scene that calls for every effect but a section, and (as path tracing has no use for it) occlusion.
fn zoo() -> SceneDesc {
    let mut materials = vec![diffuse(0.6)];
    materials.extend(SPECIMENS.map(|(_, change)| {
        pbr(|m| {
            (m.base_color, m.metallic, m.double_sided) = (Vec4::new(0.7, 0.6, 0.5, 1.0), 0.0, true);
            change(m);
        })
    }));
    // Dispersion has a material of its own, so that it can be told from refraction.
    materials.push(pbr(|m| {
        (m.metallic, m.transmission, m.thickness, m.roughness, m.dispersion) = (0.0, 1.0, 1.0, 0.0, 1.0);
    }));
    let count = materials.len() - 1;
    let mut scene = scene_of(&materials);
    // Bluish, so that it is a normal map as well; alpha from nothing to all.
    let texel = |i: u32| [100 + (i % 4) as u8 * 18, 100 + (i / 4) as u8 * 18, 220, (i * 17) as u8];
    scene.images.push(ImageDesc {
        name: "image".into(),
        width: 4,
        height: 4,
        pixels: Pixels::Rgba8((0..16).map(texel).collect()),
    });
    quad(&mut scene, DVec3::new(-9.0, -0.01, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    // Tiles above the floor, the first with vertex colours.
    for i in 0..count {
        let corner = DVec3::new((i % 4) as f64 - 2.0, 0.3, 2.0 - (i / 4) as f64);
        mapped_quad(&mut scene, corner, DVec3::X * 0.9, DVec3::Z * -0.9, i + 1);
    }
    if let SurfaceDesc::Triangles(mesh) = &mut scene.meshes[1].geometries[0].surface {
        mesh.colors = vec![Vec4::new(0.9, 0.2, 0.2, 1.0); 4];
    }
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
    let sky = |i: u32| [60 + i as u8 * 20, 80, 90, 255];
    scene.images.push(ImageDesc {
        name: "sky".into(),
        width: 4,
        height: 2,
        pixels: Pixels::Rgba8((0..8).map(sky).collect()),
    });
    scene.environment = Some(EnvironmentDesc::LatLong { image: 1, rotation: 0.0, scale: Vec3::ONE });
    scene.instances[2].moves_to = Some(DAffine3::from_translation(DVec3::Y * 0.2));
    scene.fog = Some(FogDesc {
        scattering: Vec3::splat(0.1),
        absorption: Vec3::splat(0.02),
        g: 0.3,
        bounds: Some((DVec3::splat(-4.0), DVec3::splat(4.0))),
    });
    scene
}

fn looking_down() -> StageOptions {
    let camera_changes = CameraChanges {
        position: Some(DVec3::new(0.0, 6.0, 4.0)),
        focal_point: Some(DVec3::new(0.0, 0.0, 0.0)),
        view_angle: Some(0.8),
        ..CameraChanges::default()
    };
    StageOptions { camera_changes, ..StageOptions::default() }
}

fn cut() -> Clip {
    Clip { bounds: None, planes: vec![(DVec3::X, 1.9)] }
}

/// The zoo with these effects, or those without which it is nothing.
fn zoo_with(effects: EffectOverrides, options: &RenderOptions) -> Rendered {
    let mut stage = StageOptions { effects, ..looking_down() };
    stage.camera_changes.aperture = Some(0.05);
    render_scene(&zoo(), &stage, options)
}

const INTEGRATORS: [IntegratorChoice; 2] = [IntegratorChoice::Path, IntegratorChoice::Whitted];

fn work(rendered: &Rendered, effect: EffectSet) -> u64 {
    let entry = rendered.effects.entries.iter().find(|e| e.effect == effect).unwrap();
    [entry.rays, entry.samples, entry.look_ups].into_iter().flatten().sum()
}

/// What is not simulated costs nothing: no ray, no sample, no look-up. Each effect is taken away from a scene that calls
/// for all of them, where it costs something.
#[test]
fn an_effect_that_is_not_simulated_has_no_rays_no_samples_and_no_look_ups() {
    for integrator in INTEGRATORS {
        let options = |clip| RenderOptions { integrator, clip, ..small(4) };
        let add = EffectSet::AMBIENT_OCCLUSION;
        let all = zoo_with(EffectOverrides { add, ..EffectOverrides::default() }, &options(cut()));
        for entry in &all.effects.entries {
            // Each integrator has effects that are not its own; even light is for rooms, of which this is none.
            let idle = match integrator {
                IntegratorChoice::Path => EffectSet::AMBIENT_OCCLUSION,
                _ => EffectSet::INDIRECT_LIGHT | EffectSet::FOG | EffectSet::AMBIENT_OCCLUSION,
            };
            let works = work(&all, entry.effect) > 0;
            assert_eq!(works, !idle.contains(entry.effect), "{} by {integrator:?}", entry.name);

            let clip = if entry.effect == EffectSet::CLIPPING { Clip::default() } else { cut() };
            let without = zoo_with(EffectOverrides { add, remove: entry.effect, ..Default::default() }, &options(clip));
            assert_eq!(work(&without, entry.effect), 0, "{} by {integrator:?}", entry.name);
            assert_eq!(without.stats.bad_samples, 0);
        }
    }
}

/// A plain scene costs none of the effects of the zoo.
#[test]
fn a_plain_scene_has_no_samples_of_what_it_does_not_call_for() {
    let mut scene = scene_of(&[diffuse(0.6)]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    let scene = surrounded(scene, 0.8);
    for integrator in INTEGRATORS {
        let rendered = render_scene(&scene, &looking_down(), &RenderOptions { integrator, ..small(4) });
        for entry in rendered.effects.entries.iter().filter(|e| !e.called_for) {
            assert_eq!(work(&rendered, entry.effect), 0, "{}", entry.name);
        }
        let look_ups: u64 = rendered.effects.entries.iter().filter_map(|e| e.look_ups).sum();
        assert_eq!(look_ups, 0);
    }
}

/// Each kernel is chosen for a scene that needs just that, and gives the bits of the full one.
#[test]
fn every_kernel_gives_the_bits_of_the_full_one() {
    let single_sided = |m: &mut PbrMaterial| (m.metallic, m.double_sided) = (0.0, false);
    let textured = |m: &mut PbrMaterial| m.base_color_texture = Some(TextureRef::new(0));
    let glass = |m: &mut PbrMaterial| (m.transmission, m.thickness, m.roughness) = (1.0, 1.0, 0.0);
    let coat = |m: &mut PbrMaterial| {
        m.sheen = Some(Box::new(Sheen { color: Vec3::ONE, roughness: 0.4, ..Sheen::default() }));
    };
    let changed = |changes: &[&dyn Fn(&mut PbrMaterial)]| {
        pbr(|m| {
            (m.metallic, m.roughness, m.double_sided) = (0.0, 0.3, true);
            changes.iter().for_each(|change| change(m));
        })
    };
    let cases: [(KernelChoice, MaterialModel); 6] = [
        (KernelChoice::Plain, changed(&[])),
        (KernelChoice::Textured, changed(&[&textured])),
        (KernelChoice::Filtered, changed(&[&single_sided])),
        (KernelChoice::TexturedFiltered, changed(&[&single_sided, &textured])),
        (KernelChoice::Clear, changed(&[&glass])),
        (KernelChoice::Full, changed(&[&coat])),
    ];
    for (kernel, material) in cases {
        let mut scene = scene_of(&[diffuse(0.6), material]);
        scene.images = zoo().images;
        scene.environment = zoo().environment;
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        mapped_quad(&mut scene, DVec3::new(-2.0, 0.5, 2.0), DVec3::X * 3.0, DVec3::Z * -3.0, 1);
        mapped_quad(&mut scene, DVec3::new(0.0, 0.1, 1.0), DVec3::new(1.0, 2.0, 0.0), DVec3::Z * -2.0, 1);
        let scene = Arc::new(scene);
        let full = EffectOverrides { add: EffectSet::all(), ..EffectOverrides::default() };
        let full = StageOptions { effects: full, ..looking_down() };
        assert_eq!(stage(&scene, &looking_down()).kernel(), kernel);
        assert_eq!(stage(&scene, &full).kernel(), KernelChoice::Full);
        for integrator in INTEGRATORS {
            let options = RenderOptions { integrator, ..small(8) };
            let a = render_scene(&scene, &looking_down(), &options);
            let b = render_scene(&scene, &full, &options);
            assert!(bits(&a) == bits(&b) && a.stats.rays == b.stats.rays, "{kernel:?} by {integrator:?}");
        }
    }
}

/// A floor seen straight from above, filling the picture: an even light of radiance `sky`, and a sun that brings `sun` per
/// area. A screen above the camera, which the sky is too even to mind much, keeps the sun from the left half.
fn floor(sky: f32, sun: f32, screen: bool) -> (Arc<SceneDesc>, StageOptions) {
    let mut scene = scene_of(&[diffuse(0.5)]);
    quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    if screen {
        quad(&mut scene, DVec3::new(-9.0, 5.0, 9.0), DVec3::X * 9.0, DVec3::Z * -18.0, 0);
    }
    if sun > 0.0 {
        let irradiance = Vec3::splat(sun);
        scene.lights.push(light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 }));
    }
    let camera_changes = CameraChanges {
        position: Some(DVec3::Y * 4.0),
        focal_point: Some(DVec3::ZERO),
        view_up: Some(DVec3::Z),
        view_angle: Some(0.5),
        ..CameraChanges::default()
    };
    (Arc::new(surrounded(scene, sky)), StageOptions { camera_changes, ..StageOptions::default() })
}

fn ablated(scene: &Arc<SceneDesc>, setup: &StageOptions, integrator: IntegratorChoice) -> Ablations {
    let stage = firsthit_render::Stage::new(scene.clone(), accel(scene), setup).unwrap();
    let options = RenderOptions {
        width: 64,
        height: 64,
        max_depth: 1,
        integrator,
        filter: FilterChoice::Box,
        ..RenderOptions::default()
    };
    ablate(&stage, setup, &options, &AblateOptions { width: 32, spp: 64, repetitions: 2 }, &()).unwrap()
}

fn of(ablations: &Ablations, effect: EffectSet) -> &firsthit_render::Ablation {
    ablations.effects.iter().find(|e| e.effect == effect).unwrap()
}

/// Light adds up: without the sun a floor is darker by what the sun gives, without the sky by what the sky gives.
#[test]
fn without_a_light_the_picture_lacks_what_it_gave() {
    let (sky, sun) = (0.8, 1.5);
    let (scene, setup) = floor(sky, sun, false);
    for integrator in INTEGRATORS {
        let ablations = ablated(&scene, &setup, integrator);
        let (by_sky, by_sun) = (0.5 * f64::from(sky), 0.5 * f64::from(sun) / PI);
        assert_near(of(&ablations, EffectSet::PUNCTUAL_LIGHTS).rmse, by_sun, 1e-3);
        assert_near(of(&ablations, EffectSet::ENVIRONMENT).rmse, by_sky, 1e-3);
        let relative = of(&ablations, EffectSet::PUNCTUAL_LIGHTS).relative;
        assert_near(relative, by_sun / (by_sun + by_sky), 1e-3);
        assert_eq!((ablations.width, ablations.height, ablations.spp), (32, 32, 64));
        assert!(ablations.seconds > 0.0 && ablations.effects.iter().all(|e| e.seconds > 0.0));
        // What each way saves is measured against the same whole.
        for e in &ablations.effects {
            assert!(e.saved <= ablations.seconds.max(e.seconds) * 1.5, "{}: {} s", e.name, e.saved);
        }
    }
}

/// Where half of a floor lies in shadow, taking shadows away lights that half.
#[test]
fn without_shadows_what_was_dark_is_lit() {
    let (scene, setup) = floor(0.0, 2.0, true);
    for integrator in INTEGRATORS {
        let ablations = ablated(&scene, &setup, integrator);
        let lit = 0.5 * 2.0 / PI;
        let shadows = of(&ablations, EffectSet::SHADOWS);
        assert_near(shadows.rmse, lit * 0.5f64.sqrt(), 1e-3);
        assert_near(shadows.relative, 1.0, 1e-3);
        // Nothing but the sun gives light: without it the picture is black.
        assert_near(of(&ablations, EffectSet::PUNCTUAL_LIGHTS).relative, 1.0, 1e-12);
        assert!(shadows.film.color().pixels.iter().all(|p| p[0] > 0.9 * lit as f32));
    }
}

/// What cannot change a picture changes no bit of it.
#[test]
fn without_what_is_not_seen_nothing_changes() {
    let (scene, setup) = floor(0.8, 0.0, false);
    let add = EffectSet::AMBIENT_OCCLUSION | EffectSet::SHEEN | EffectSet::DISPERSION | EffectSet::ALPHA_MASK;
    let effects = EffectOverrides { add, ..EffectOverrides::default() };
    let ablations = ablated(&scene, &StageOptions { effects, ..setup }, IntegratorChoice::Path);
    for effect in add.iter() {
        let e = of(&ablations, effect);
        assert_eq!((e.rmse, e.relative), (0.0, 0.0), "{}", e.name);
        assert!(e.film == ablations.film);
    }
    let simulated = EffectSet::ENVIRONMENT | EffectSet::SHADOWS | EffectSet::INDIRECT_LIGHT | add;
    assert_eq!(ablations.effects.iter().map(|e| e.effect).collect::<EffectSet>(), simulated);
}

/// Watches ablations, and cancels after so many pictures.
struct Patience {
    pictures: u64,
    seen: AtomicU64,
    total: AtomicU64,
}

impl Patience {
    fn for_pictures(pictures: u64) -> Self {
        Self { pictures, seen: AtomicU64::new(0), total: AtomicU64::new(0) }
    }
}

impl Monitor for Patience {
    fn progress(&self, done: u64, total: u64, _: u64) {
        self.seen.store(done, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.pictures
    }
}

/// What a render says that it simulates is taken away, each in turn, and nothing else.
#[test]
fn ablations_take_away_what_the_plan_says_is_simulated() {
    let (scene, setup) = (Arc::new(zoo()), looking_down());
    let stage = stage(&scene, &setup);
    let how = AblateOptions { width: 8, spp: 1, repetitions: 1 };
    for integrator in [IntegratorChoice::Path, IntegratorChoice::Light, IntegratorChoice::Whitted] {
        let options = RenderOptions { integrator, clip: cut(), ..small(1) };
        let simulated = render(&stage, &options, &()).unwrap().effects.simulated();
        assert_eq!(simulated.contains(EffectSet::FOG), integrator == IntegratorChoice::Path);
        assert_eq!(simulated.contains(EffectSet::INDIRECT_LIGHT), integrator != IntegratorChoice::Whitted);
        assert!(simulated.contains(EffectSet::CLIPPING));

        let patience = Patience::for_pictures(u64::MAX);
        let ablations = ablate(&stage, &setup, &options, &how, &patience).unwrap();
        let taken: EffectSet = ablations.effects.iter().map(|e| e.effect).collect();
        assert_eq!(taken, simulated, "{integrator:?}");
        assert_eq!(patience.seen.into_inner(), patience.total.into_inner());
    }
}

/// Ablations are cancelled between two pictures.
#[test]
fn ablations_can_be_cancelled() {
    let (scene, setup) = floor(0.8, 1.5, false);
    let stage = stage(&scene, &setup);
    let how = AblateOptions { width: 8, spp: 1, repetitions: 2 };
    for pictures in [0, 1, 4, 5] {
        let patience = Patience::for_pictures(pictures);
        let cancelled = ablate(&stage, &setup, &small(1), &how, &patience);
        assert_eq!(cancelled.err(), Some(AblateError::Cancelled));
        assert_eq!(patience.seen.into_inner(), pictures);
    }
}
