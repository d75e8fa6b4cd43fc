//! Path tracing against closed forms, against Whitted's method where both know the answer, and against itself.

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_import::SceneDesc;
use firsthit_import::scene::{AlphaMode, LightKind, MaterialModel};
use firsthit_render::sampler::SamplerChoice;
use firsthit_render::{
    Aov, Checkpoint, Crop, EffectOverrides, EffectSet, IntegratorChoice, Monitor, RayKind, RenderOptions, Stage,
    StageOptions, render, render_from,
};
use glam::{DVec3, Vec3, Vec4};

use super::common::{self, Probe, ball, quad, scene_of};
use super::{assert_near, below_corner, bits, diffuse, everything, floor, glow, light, pbr, small, surrounded};

fn probe(scene: &SceneDesc) -> Probe<'_> {
    Probe::new(scene).integrator(IntegratorChoice::Path)
}

/// A closed box (cube of side 2 about the origin) whose walls glow with `radiance` and reflect `albedo` of the light:
/// radiance / (1 - albedo) everywhere.
fn closed_box(albedo: f32, radiance: f32) -> SceneDesc {
    let wall = pbr(|m| {
        m.base_color = Vec4::new(albedo, albedo, albedo, 1.0);
        m.metallic = 0.0;
        m.specular = 0.0;
        m.emissive = Vec3::splat(radiance);
        m.double_sided = true;
    });
    let mut scene = scene_of(&[wall]);
    for axis in 0..3 {
        let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
        for side in [-1.0, 1.0] {
            quad(&mut scene, DVec3::AXES[axis] * side - u - v, u * 2.0, v * 2.0, 0);
        }
    }
    scene
}

/// A closed room without lights is lit from the camera: light that goes round in it must not wash it out.
#[test]
fn rooms_lit_from_the_camera_are_as_bright_as_by_direct_light() {
    for albedo in [0.2, 0.5, 0.8] {
        let scene = Arc::new(closed_box(albedo, 0.0));
        let mut setup = StageOptions::default();
        let eye = DVec3::new(-0.7, 0.2, 0.1);
        (setup.camera_changes.position, setup.camera_changes.focal_point) = (Some(eye), Some(DVec3::ZERO));
        let stage = Stage::new(Arc::clone(&scene), common::accel(&scene), &setup).unwrap();
        let mean = |integrator| {
            let options = RenderOptions { width: 16, height: 9, spp: 32, integrator, ..RenderOptions::default() };
            let color = render(&stage, &options, &()).unwrap().film.color();
            color.pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / color.pixels.len() as f64
        };
        // Whitted's method has a guess of even light in place of what walls send to each other.
        let (path, direct) = (mean(IntegratorChoice::Path), mean(IntegratorChoice::Whitted));
        assert!((0.5..1.5).contains(&(path / direct)), "albedo {albedo}: {path} and {direct}");
    }
}

#[test]
fn light_between_the_walls_of_a_closed_box_is_a_geometric_series() {
    for albedo in [0.5f32, 0.8] {
        let scene = closed_box(albedo, 1.0);
        let found = probe(&scene).depth(200).spp(4096).look(DVec3::new(0.3, 0.2, 1.0)).x;
        assert_near(found, 1.0 / (1.0 - f64::from(albedo)), 0.01);
        // Cut after n bounces the series ends there.
        for n in [0, 1, 2] {
            let found = probe(&scene).depth(n).spp(4096).look(DVec3::new(0.3, 0.2, 1.0)).x;
            let sum: f64 = (0..=n).map(|i| f64::from(albedo).powi(i as i32)).sum();
            assert_near(found, sum, 0.01);
        }
    }
}

/// A ball in an even sky sends back its albedo of it, from everywhere.
#[test]
fn a_ball_in_a_constant_sky_shows_its_albedo() {
    let mut scene = scene_of(&[diffuse(0.6)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let scene = surrounded(scene, 2.0);
    for at in [DVec3::X, DVec3::Y, DVec3::new(0.6, 0.0, 0.8)] {
        assert_near(probe(&scene).from(at * 3.0).look(at).x, 1.2, 1e-5);
    }
}

/// As a light of the file, and as a glowing mesh, which paths meet as well.
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
        let look = || probe(&scene).from(DVec3::new(-1.0, 1.0, -1.0)).spp(4096);
        assert_near(look().look(DVec3::ZERO).x, 0.7 * 6.0 * below_corner(a, b, h), 5e-3);
        assert_near(look().look(DVec3::new(0.4, h, 0.3)).x, 6.0, 1e-6);
    }
}

/// In even light, which nobody asks, a dim lamp is seldom asked, and a bright one always: the light is the same.
#[test]
fn a_lamp_in_an_even_sky_gives_its_light_however_seldom_it_is_asked() {
    let (a, b, h) = (1.5, 0.8, 1.2);
    let share = below_corner(a, b, h);
    let mut asked = Vec::new();
    for radiance in [0.5f32, 3.0, 100.0] {
        let mut scene = scene_of(&[diffuse(0.7), glow(radiance)]);
        quad(&mut scene, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
        quad(&mut scene, DVec3::new(0.0, h, 0.0), DVec3::X * a, DVec3::Z * b, 1);
        let scene = surrounded(scene, 1.0);
        let found = probe(&scene).depth(1).from(DVec3::new(-1.0, 1.0, -1.0)).spp(16384).look(DVec3::ZERO).x;
        // The lamp takes the place of its part of the sky.
        assert_near(found, 0.7 * (f64::from(radiance) * share + (1.0 - share)), 5e-3);
        let options = RenderOptions { integrator: IntegratorChoice::Path, ..small(4) };
        let mut setup = StageOptions::default();
        let eye = DVec3::new(-1.0, 1.0, -1.0);
        (setup.camera_changes.position, setup.camera_changes.focal_point) = (Some(eye), Some(DVec3::ZERO));
        asked.push(common::render_scene(&scene, &setup, &options).stats.rays[RayKind::ShadowArea]);
    }
    assert!(asked[0] > 0 && 3 * asked[0] < asked[2] && asked[1] <= asked[2], "{asked:?}");
}

#[test]
fn a_ball_of_light_lights_a_plane_as_if_by_its_middle() {
    let (center, radius) = (DVec3::new(1.0, 2.0, 0.0), 0.6);
    let (mut as_light, _) = floor(diffuse(0.7));
    as_light.lights.push(light(LightKind::Sphere { center, radius, radiance: Vec3::splat(5.0) }));
    let mut as_shape = scene_of(&[diffuse(0.7), glow(5.0)]);
    quad(&mut as_shape, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    ball(&mut as_shape, center, radius, 1);
    for scene in [as_light, as_shape] {
        let found = probe(&scene).from(DVec3::new(-1.0, 1.0, 0.0)).spp(4096).look(DVec3::ZERO).x;
        assert_near(found, 0.7 * 5.0 * (radius * radius / 5.0) * (2.0 / 5f64.sqrt()), 5e-3);
    }
}

/// n mirrors in a row: what is seen in the end has lost as often.
#[test]
fn parallel_mirrors_lose_the_same_at_each_bounce() {
    let r = 0.9f32;
    let mut scene = scene_of(&[MaterialModel::Mirror { reflectance: Vec3::splat(r) }, glow(3.0)]);
    // Two mirrors at z = -1 and z = 1, facing each other; a lamp closes the corridor at x = 10.
    quad(&mut scene, DVec3::new(-10.0, -5.0, -1.0), DVec3::X * 20.0, DVec3::Y * 10.0, 0);
    quad(&mut scene, DVec3::new(-10.0, -5.0, 1.0), DVec3::Y * 10.0, DVec3::X * 20.0, 0);
    quad(&mut scene, DVec3::new(10.0, -5.0, -1.0), DVec3::Z * 2.0, DVec3::Y * 10.0, 1);
    for bounces in [1, 4, 9, 16] {
        // From the middle: the first mirror after a way of 1, the others after 2 each, the lamp after 1 more.
        let slope = 10.0 / (2.0 * f64::from(bounces));
        let found = probe(&scene).depth(bounces).spp(4096).look(DVec3::new(slope, 0.0, 1.0)).x;
        // Chance ends some of the paths, and makes up for them in the others.
        assert_near(found, 3.0 * f64::from(r).powi(bounces as i32), if bounces < 10 { 1e-5 } else { 0.06 });
        assert_eq!(probe(&scene).depth(bounces - 1).spp(1).look(DVec3::new(slope, 0.0, 1.0)).x, 0.0);
    }
}

/// Whitted's method asks every light and splits at every surface; where nothing is diffuse twice both must agree.
#[test]
fn one_bounce_agrees_with_asking_every_light() {
    let mut scene = everything();
    // Boundaries of solids differ by what shadow rays do there.
    scene.materials[2].model = diffuse(0.3);
    scene.materials[5].model = diffuse(0.4);
    let mean = |integrator| {
        let options = RenderOptions { integrator, max_depth: 1, ..small(256) };
        let pixels = common::render_scene(&scene, &StageOptions::default(), &options).film.color().pixels;
        pixels.iter().map(|p| f64::from(p[0] + p[1] + p[2])).sum::<f64>()
    };
    assert_near(mean(IntegratorChoice::Path), mean(IntegratorChoice::Whitted), 4e-3);
}

#[test]
fn what_covers_in_part_passes_light_and_sight_in_part() {
    let veil = pbr(|m| {
        m.base_color = Vec4::new(0.0, 0.0, 0.0, 0.25);
        m.specular = 0.0;
        m.alpha_mode = AlphaMode::Blend;
        m.double_sided = true;
        m.metallic = 0.0;
    });
    let pane = pbr(|m| {
        m.base_color = Vec4::new(0.9, 0.4, 0.2, 1.0);
        m.metallic = 0.0;
        m.roughness = 0.0;
        m.transmission = 1.0;
        m.ior = 1.0;
        m.specular = 0.0;
        m.double_sided = true;
    });
    for (cover, through) in [(veil, Vec3::splat(0.75)), (pane, Vec3::new(0.9, 0.4, 0.2))] {
        let through = through.as_dvec3();
        // Light by each way: of a point, of a lamp that paths meet as well, of the sky.
        let mut scene = scene_of(&[diffuse(0.5), cover, glow(4.0)]);
        quad(&mut scene, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
        quad(&mut scene, DVec3::new(-50.0, 1.0, 50.0), DVec3::X * 100.0, DVec3::Z * -100.0, 1);
        let mut by_lamp = scene.clone();
        let (a, b, h) = (3.0, 2.0, 2.0);
        quad(&mut by_lamp, DVec3::new(0.1, h, 0.25), DVec3::X * a, DVec3::Z * b, 2);
        let mut by_sun = scene.clone();
        let irradiance = Vec3::splat(PI as f32);
        by_sun.lights = vec![light(LightKind::Directional { direction: DVec3::NEG_Y, irradiance, angle: 0.0 })];
        let mut by_sky = surrounded(scene, 1.0);
        // So that nothing is done about the lack of lights below the cover.
        let (position, intensity) = (DVec3::new(0.0, -9.0, 0.0), Vec3::splat(1e-9));
        by_sky.lights = vec![light(LightKind::Point { position, intensity, range: None })];
        let at = DVec3::new(0.1, 0.0, 0.25);
        let expected = [(by_lamp, 0.5 * 4.0 * below_corner(a, b, h)), (by_sun, 0.5), (by_sky, 0.5)];
        for (scene, bare) in expected {
            let below = probe(&scene).depth(1).spp(4096).from(DVec3::new(-3.0, 0.5, 0.0)).look(at);
            assert!((below / (through * bare) - 1.0).abs().max_element() < 0.012, "{below} not {}", through * bare);
        }
    }
}

/// A scene with 10 000 small lamps and a sun, over a floor.
fn many_lamps() -> SceneDesc {
    let mut scene = scene_of(&[diffuse(0.6), glow(60.0)]);
    quad(&mut scene, DVec3::new(-10.0, 0.0, 10.0), DVec3::X * 20.0, DVec3::Z * -20.0, 0);
    let (corner, u, v) = (DVec3::ZERO, DVec3::X, DVec3::Z);
    quad(&mut scene, corner, u, v, 1);
    let Some(mesh) = scene.meshes.last_mut() else { return scene };
    let firsthit_import::scene::SurfaceDesc::Triangles(mesh) = &mut mesh.geometries[0].surface else { return scene };
    mesh.positions.clear();
    mesh.triangles.clear();
    for i in 0..10_000_u32 {
        let at = |by: f32| (i as f32 * by).fract();
        let p = Vec3::new(at(0.618_034) * 16.0 - 8.0, 0.3 + 2.0 * at(0.569_84), at(0.754_877_7) * 16.0 - 8.0);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([p, p + Vec3::X * 0.02, p + Vec3::Z * 0.02]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    let irradiance = Vec3::splat(0.5);
    scene.lights.push(light(LightKind::Directional { direction: DVec3::new(0.3, -1.0, 0.2), irradiance, angle: 0.01 }));
    scene.settings.reference_conventions = true;
    scene
}

/// Many lights: the noise at a point of the floor against that of choosing one of them evenly, and of the sun apart.
#[test]
fn ten_thousand_lamps_and_a_sun_converge() {
    let scene = many_lamps();
    let firsthit_import::scene::SurfaceDesc::Triangles(lamps) = &scene.meshes[1].geometries[0].surface else {
        panic!()
    };
    let at = Vec3::new(0.5, 0.0, 0.5);
    let area = 0.5 * 0.02 * 0.02;
    let (mut sum, mut squares) = (0.0, 0.0);
    for [a, b, c] in &lamps.triangles {
        let [a, b, c] = [a, b, c].map(|i| lamps.positions[*i as usize]);
        let way = (a + b + c) / 3.0 - at;
        let cos = way.normalize().y;
        let light = f64::from(0.6 / PI as f32 * 60.0 * area * cos * cos / way.length_squared());
        sum += light;
        squares += light * light;
    }
    let evenly = lamps.triangles.len() as f64 * squares - sum * sum;
    let mut stage = StageOptions { aspect: 1.0, ..StageOptions::default() };
    stage.camera_changes.position = Some(DVec3::new(0.5, 0.2, 0.5));
    stage.camera_changes.focal_point = Some(at.as_dvec3());
    stage.camera_changes.view_up = Some(DVec3::X);
    stage.camera_changes.view_angle = Some(1e-5);
    let sampler = SamplerChoice::Independent;
    let options = RenderOptions {
        width: 8,
        height: 8,
        spp: 512,
        max_depth: 1,
        sampler,
        aovs: vec![Aov::Variance],
        ..RenderOptions::default()
    };
    let rendered = common::render_scene(&scene, &stage, &options);
    let mean = |pixels: &[[f32; 4]]| pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / 64.0;
    let variance = mean(&rendered.film.aov(Aov::Variance).unwrap().pixels) * 512.0;
    // The sun's light, none of which the lamps take away worth mention.
    let sun = 0.6 / PI * 0.5 * f64::from(Vec3::new(0.3, -1.0, 0.2).normalize().y.abs());
    let found = mean(&rendered.film.color().pixels);
    println!("{found} instead of {}; variance {variance}, evenly {evenly}", sum + sun);
    assert!(rendered.stats.rays[RayKind::ShadowArea] > 0 && rendered.stats.rays[RayKind::ShadowPunctual] > 0);
    assert_near(found, sum + sun, 0.05);
    assert!(variance < 0.2 * evenly, "{variance} against {evenly}");
}

/// What nothing calls for is not simulated, to the last ray; what is taken away neither.
#[test]
fn rays_are_cast_for_effects_that_are_simulated_alone() {
    let (mut scene, _) = floor(diffuse(0.5));
    scene.lights.push(light(LightKind::Point { position: DVec3::Y, intensity: Vec3::ONE, range: None }));
    scene.settings.reference_conventions = true;
    let rendered = common::render_scene(&scene, &StageOptions::default(), &small(2));
    for kind in RayKind::ALL {
        let called = matches!(kind, RayKind::Camera | RayKind::ShadowPunctual | RayKind::Indirect);
        assert_eq!(rendered.stats.rays[kind] > 0, called, "{kind:?}");
    }
    let scene = everything();
    let without = |remove| {
        let effects = EffectOverrides { remove, ..EffectOverrides::default() };
        common::render_scene(&scene, &StageOptions { effects, ..StageOptions::default() }, &small(2)).stats.rays
    };
    assert_eq!(without(EffectSet::SHADOWS).shadow(), 0);
    assert_eq!(without(EffectSet::REFLECTION)[RayKind::Reflection], 0);
    assert_eq!(without(EffectSet::REFRACTION)[RayKind::Refraction], 0);
    assert_eq!(without(EffectSet::ALPHA_BLEND)[RayKind::Transparency], 0);
    assert_eq!(without(EffectSet::AREA_LIGHTS)[RayKind::ShadowArea], 0);
    assert_eq!(without(EffectSet::INDIRECT_LIGHT)[RayKind::Indirect], 0);
}

/// Without indirect light the surroundings are asked instead of met: what is lit once stays as bright.
#[test]
fn direct_light_from_around_does_not_depend_on_indirect_light() {
    let mut scene = scene_of(&[diffuse(0.6)]);
    ball(&mut scene, DVec3::ZERO, 1.0, 0);
    let scene = surrounded(scene, 2.0);
    let effects = EffectOverrides { remove: EffectSet::INDIRECT_LIGHT, ..EffectOverrides::default() };
    let stage = StageOptions { effects, ..StageOptions::default() };
    assert_near(probe(&scene).stage(stage).spp(4096).from(DVec3::X * 3.0).look(DVec3::X).x, 1.2, 5e-3);
}

#[test]
fn a_crop_has_the_bits_of_the_whole() {
    let scene = everything();
    let options = RenderOptions { aovs: vec![Aov::Samples, Aov::Variance, Aov::Normal], ..small(36) };
    let whole = common::render_scene(&scene, &StageOptions::default(), &options);
    let crop = Crop { x: 13, y: 7, width: 21, height: 19 };
    let options = RenderOptions { crop: Some(crop), ..options };
    let part = common::render_scene(&scene, &StageOptions::default(), &options);
    for aov in [None, Some(Aov::Samples), Some(Aov::Variance), Some(Aov::Normal)] {
        let of = |r: &firsthit_render::Rendered| aov.map_or_else(|| r.film.color(), |a| r.film.aov(a).unwrap());
        let (whole, part) = (of(&whole), of(&part));
        for y in 0..crop.height {
            for x in 0..crop.width {
                let a = whole.pixels[((y + crop.y) * 48 + x + crop.x) as usize];
                let b = part.pixels[(y * crop.width + x) as usize];
                assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits), "{aov:?} {x} {y}");
            }
        }
    }
}

#[test]
fn noisy_tiles_get_more_samples_and_threads_do_not_matter() {
    let scene = everything();
    let options = RenderOptions { noise_threshold: Some(0.03), aovs: vec![Aov::Samples], ..small(256) };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| common::render_scene(&scene, &StageOptions::default(), &options))
    };
    let (one, two) = (with(1), with(2));
    assert_eq!(bits(&one), bits(&two));
    let samples = one.film.aov(Aov::Samples).unwrap().pixels;
    let (least, most) = samples.iter().fold((f32::MAX, 0.0f32), |(a, b), p| (a.min(p[0]), b.max(p[0])));
    assert!(least >= 32.0 && most > least && most <= 256.0, "{least} to {most}");
    let sum: f32 = samples.iter().map(|p| p[0]).sum();
    assert_eq!(sum as u64, one.stats.samples);
    let noise = one.stats.noise.unwrap();
    assert!(noise <= 0.03 || most == 256.0, "{noise}");
    assert!(!one.out_of_time && !one.interrupted);
}

#[test]
fn a_time_limit_ends_a_render_with_all_of_the_picture() {
    let options = RenderOptions { time_limit: Some(Duration::from_millis(1)), ..small(100_000) };
    let rendered = common::render_scene(&everything(), &StageOptions::default(), &options);
    assert!(rendered.out_of_time && !rendered.interrupted);
    let (least, most) = (48 * 32, 48 * 32 * 100_000);
    assert!((least..most).contains(&rendered.stats.samples), "{}", rendered.stats.samples);
}

/// Ordered points leave less noise than as many independent ones.
#[test]
fn ordered_points_are_better_than_independent_ones() {
    let mut scene = scene_of(&[diffuse(0.7), glow(5.0)]);
    quad(&mut scene, DVec3::new(-2.0, 0.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0, 0);
    quad(&mut scene, DVec3::new(-2.0, 0.0, -2.0), DVec3::X * 4.0, DVec3::Y * 4.0, 0);
    quad(&mut scene, DVec3::new(-1.0, 2.0, -1.0), DVec3::X * 2.0, DVec3::Z * 2.0, 1);
    let picture =
        |options: RenderOptions| common::render_scene(&scene, &StageOptions::default(), &options).film.color().pixels;
    let good = picture(RenderOptions { seed: 77, ..small(2048) });
    let error = |sampler| {
        let found = picture(RenderOptions { sampler, ..small(64) });
        let of = |(a, b): (&[f32; 4], &[f32; 4])| f64::from((a[0] - b[0]).powi(2));
        found.iter().zip(&good).map(of).sum::<f64>()
    };
    let (sobol, independent) = (error(SamplerChoice::Sobol), error(SamplerChoice::Independent));
    println!("Sobol {sobol}, independent {independent}");
    assert!(sobol < 0.6 * independent, "{sobol} against {independent}");
}

/// A render that is stopped anywhere, kept, and gone on with has the bits of one without a pause; so have shares.
#[test]
fn pauses_and_shares_leave_no_trace() {
    /// Stops after so many pieces of work.
    struct Stop(std::sync::atomic::AtomicI64);
    impl Monitor for Stop {
        fn progress(&self, _: u64, _: u64, _: u64) {
            self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.0.load(std::sync::atomic::Ordering::Relaxed) <= 0
        }
    }
    let scene = Arc::new(everything());
    let stage = common::stage(&scene, &StageOptions::default());
    let kept = |sums: &firsthit_render::Sums<'_>| {
        let mut bytes = Vec::new();
        sums.write(&mut bytes, "words").unwrap();
        assert!(
            Checkpoint::read(&mut &bytes[..bytes.len() - 1]).is_err() && Checkpoint::read(&mut &bytes[1..]).is_err()
        );
        let (read, words) = Checkpoint::read(&mut bytes.as_slice()).unwrap();
        assert_eq!(words, "words");
        read
    };
    let aovs = vec![Aov::Normal, Aov::Samples, Aov::Variance];
    for threshold in [None, Some(0.05)] {
        let options = RenderOptions { noise_threshold: threshold, aovs: aovs.clone(), ..small(96) };
        let whole = render(&stage, &options, &()).unwrap();
        for pieces in [1, 9, 30, 45] {
            let part = render(&stage, &options, &Stop(pieces.into())).unwrap();
            assert!(part.interrupted && part.stats.samples < whole.stats.samples);
            let resumed = render_from(&stage, &options, Some(kept(&part.sums())), &()).unwrap();
            assert_eq!(resumed.film, whole.film, "{threshold:?}, after {pieces} pieces");
        }
        // Nothing is judged within a block, where the render without a pause judges nothing.
        let part = render(&stage, &RenderOptions { spp: 37, ..options.clone() }, &()).unwrap();
        assert_eq!(render_from(&stage, &options, Some(kept(&part.sums())), &()).unwrap().film, whole.film);
    }
    // With fewer samples first, and a lower threshold later.
    let options = RenderOptions { aovs, ..small(96) };
    let whole = render(&stage, &options, &()).unwrap();
    for first in
        [RenderOptions { spp: 37, ..options.clone() }, RenderOptions { noise_threshold: Some(1.0), ..options.clone() }]
    {
        let part = render(&stage, &first, &()).unwrap();
        assert_eq!(render_from(&stage, &options, Some(kept(&part.sums())), &()).unwrap().film, whole.film);
    }
    let share = |first_sample, spp| {
        let options = RenderOptions { first_sample, spp, ..options.clone() };
        kept(&render(&stage, &options, &()).unwrap().sums())
    };
    let mut joined = share(0, 32);
    assert!(joined.join(&share(48, 96)).is_err(), "samples 32 to 47 are missing");
    joined.join(&share(32, 48)).unwrap();
    joined.join(&share(48, 96)).unwrap();
    assert_eq!(joined.samples(), 0..96);
    assert_eq!(joined.film, whole.film, "variance and all");
    let other = RenderOptions { width: 47, ..options.clone() };
    assert!(render_from(&stage, &other, Some(joined), &()).is_err(), "another picture");
    assert!(render(&stage, &RenderOptions { first_sample: 8, ..options }, &()).is_err(), "not at a block");
}

/// A checkpoint is made within a row of pixels of being wanted, however long a pass is, and any of them can be gone on with.
#[test]
fn a_checkpoint_loses_no_more_than_the_rows_at_hand() {
    use std::sync::Mutex;

    /// Wants a checkpoint all the time, and keeps some.
    #[derive(Default)]
    struct Eager(Mutex<(Vec<u64>, Vec<Vec<u8>>)>);
    impl Monitor for Eager {
        fn wants_checkpoint(&self) -> bool {
            true
        }
        fn checkpoint(&self, sums: &firsthit_render::Sums<'_>) {
            let (counts, kept) = &mut *self.0.lock().unwrap();
            counts.push((sums.film().samples_per_pixel() * 48.0 * 32.0).round() as u64);
            if counts.len() % 7 == 3 {
                let mut bytes = Vec::new();
                sums.write(&mut bytes, "").unwrap();
                kept.push(bytes);
            }
        }
    }
    let scene = Arc::new(everything());
    for precision in [Precision::Robust, Precision::Fast] {
        let build = BuildOptions { precision, ..BuildOptions::default() };
        let accel = SceneBuilder::from_desc(&scene, build).build().unwrap();
        let stage = Stage::new(scene.clone(), accel, &StageOptions::default()).unwrap();
        let options = small(40);
        let plain = render(&stage, &options, &()).unwrap();
        let eager = Eager::default();
        let watched = render(&stage, &options, &eager).unwrap();
        assert_eq!(watched.film, plain.film);
        assert_eq!(watched.stats.rays, plain.stats.rays);
        assert_eq!(watched.stats.samples, plain.stats.samples);
        let (counts, kept) = eager.0.into_inner().unwrap();
        let mut before = 0;
        for count in &counts {
            // One row of each of the eight bands, 16 samples a pixel.
            assert!(count - before <= 8 * 48 * 16, "{before} to {count}");
            before = *count;
        }
        assert_eq!(before, plain.stats.samples);
        assert!(kept.len() >= 2);
        for bytes in kept {
            let (start, _) = Checkpoint::read(&mut bytes.as_slice()).unwrap();
            assert_eq!(render_from(&stage, &options, Some(start), &()).unwrap().film, plain.film);
        }
    }
}
