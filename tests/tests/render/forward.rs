//! Light tracing against path tracing: other ways of asking, the same light.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use firsthit_import::SceneDesc;
use firsthit_import::scene::{
    EnvironmentDesc, ImageDesc, LightKind, MaterialModel, Pixels, SpotRamp, SurfaceDesc, TextureRef, TriangleMesh,
};
use firsthit_render::{
    Aov, Checkpoint, Crop, FilterChoice, IntegratorChoice, Monitor, RayKind, RenderError, RenderOptions, Rendered,
    Stage, StageOptions, TextureFilter, render, render_from,
};
use glam::{DVec3, Vec3, Vec4};

use super::common::{self, add, ball, mapped_quad, quad, scene_of};
use super::{bits, diffuse, everything, glow, layers, light, pbr, surrounded};

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;
const BLOCK: u32 = 8;
/// Renders of each kind that means and their spread are taken of.
const RUNS: u64 = 12;

fn options(integrator: IntegratorChoice, spp: u32) -> RenderOptions {
    RenderOptions {
        width: WIDTH,
        height: HEIGHT,
        spp,
        integrator,
        max_depth: 64,
        filter: FilterChoice::Box,
        ..RenderOptions::default()
    }
}

/// What both do alike: no shadow rays from where no surface is, textures at their full size.
fn plain() -> StageOptions {
    StageOptions {
        shadow_terminator: false,
        texture_filter: TextureFilter::Bilinear,
        aspect: f64::from(WIDTH) / f64::from(HEIGHT),
        ..StageOptions::default()
    }
}

/// The means of the picture's blocks and of the whole, by colour.
fn blocks(rendered: &Rendered) -> Vec<DVec3> {
    let picture = rendered.film.color();
    let across = WIDTH / BLOCK;
    let mut sums = vec![DVec3::ZERO; (across * (HEIGHT / BLOCK)) as usize + 1];
    for (i, p) in picture.pixels.iter().enumerate() {
        let (x, y) = (i as u32 % WIDTH, i as u32 / WIDTH);
        let value = DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        sums[(y / BLOCK * across + x / BLOCK) as usize] += value / f64::from(BLOCK * BLOCK);
        if let Some(whole) = sums.last_mut() {
            *whole += value / f64::from(WIDTH * HEIGHT);
        }
    }
    sums
}

/// Mean and squared standard deviation of that mean, of some runs.
fn measured(stage: &Stage, options: &RenderOptions) -> Vec<(DVec3, DVec3)> {
    let runs: Vec<Vec<DVec3>> = (0..RUNS)
        .map(|seed| {
            let rendered = render(stage, &RenderOptions { seed: 1 + seed, ..options.clone() }, &()).unwrap();
            assert_eq!(rendered.stats.bad_samples, 0);
            blocks(&rendered)
        })
        .collect();
    let n = RUNS as f64;
    (0..runs[0].len())
        .map(|b| {
            let mean = runs.iter().map(|r| r[b]).sum::<DVec3>() / n;
            let spread = runs.iter().map(|r| (r[b] - mean) * (r[b] - mean)).sum::<DVec3>() / (n - 1.0);
            (mean, spread / n)
        })
        .collect()
}

/// Holds `light` with so many samples to `path`: the whole picture within 3 standard deviations of the difference, and
/// no more blocks beyond them than chance explains.
#[track_caller]
fn agree(name: &str, scene: SceneDesc, samples: [u32; 2]) {
    agree_as(name, scene, &plain(), samples);
}

#[track_caller]
fn agree_as(name: &str, scene: SceneDesc, stage: &StageOptions, [by_path, by_light]: [u32; 2]) {
    let stage = common::stage(&Arc::new(scene), stage);
    let path = measured(&stage, &options(IntegratorChoice::Path, by_path));
    let light = measured(&stage, &options(IntegratorChoice::Light, by_light));
    let (mut beyond, mut worst, mut count) = (0, 0.0_f64, 0);
    let mut whole = DVec3::ZERO;
    // Where it is so dark that few paths bring any light, their spread says little.
    let dark = path.last().map_or(DVec3::ZERO, |(mean, _)| *mean * 3e-3);
    for (i, ((a, va), (b, vb))) in path.iter().zip(&light).enumerate() {
        let tolerance = if i + 1 == path.len() { DVec3::splat(1e-7) } else { dark };
        let z = (*b - *a) / ((*va + *vb).map(f64::sqrt) + tolerance);
        if i + 1 == path.len() {
            whole = z;
            println!("{name}: path {a:.5}, light {b:.5}, ratio {:.5}, z {z:.2}", *b / *a);
            continue;
        }
        for z in z.to_array() {
            count += 1;
            beyond += usize::from(z.abs() > 3.0);
            worst = worst.max(z.abs());
        }
    }
    println!("{name}: {beyond} of {count} blocks beyond 3 sigma, worst {worst:.2}");
    assert!(whole.abs().max_element() < 3.0, "{name}: {whole}");
    // Of 22 degrees of freedom 0.66 % are beyond 3 by chance; colours of a block go together.
    assert!(beyond <= 3 + count / 50 && worst < 6.0, "{name}: {beyond} of {count}, worst {worst}");
}

/// An open box with two blocks and a lamp at its top.
fn cornell() -> SceneDesc {
    let of = |r, g, b| MaterialModel::Diffuse { albedo: Vec3::new(r, g, b) };
    let mut scene = scene_of(&[of(0.7, 0.7, 0.68), of(0.6, 0.06, 0.05), of(0.14, 0.45, 0.09), glow(12.0)]);
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0);
    let corner = DVec3::splat(-1.0);
    quad(&mut scene, corner, z, x, 0);
    quad(&mut scene, corner + y, x, z, 0);
    quad(&mut scene, corner, x, y, 0);
    quad(&mut scene, corner, y, z, 1);
    quad(&mut scene, corner + x, z, y, 2);
    quad(&mut scene, DVec3::new(-0.3, 0.98, -0.3), DVec3::X * 0.6, DVec3::Z * 0.6, 3);
    ball(&mut scene, DVec3::new(-0.4, -0.6, -0.2), 0.4, 0);
    ball(&mut scene, DVec3::new(0.45, -0.65, 0.3), 0.35, 0);
    scene.settings.reference_conventions = true;
    scene
}

/// A ball of few triangles with smooth normals.
fn smooth_ball(scene: &mut SceneDesc, center: Vec3, radius: f32, material: usize) {
    let (rows, columns) = (8_u32, 12_u32);
    let mut mesh = TriangleMesh::default();
    for i in 0..=rows {
        for k in 0..columns {
            let (theta, phi) =
                (std::f32::consts::PI * i as f32 / rows as f32, std::f32::consts::TAU * k as f32 / columns as f32);
            let n = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(center + n * radius);
            mesh.normals.push(n);
        }
    }
    for i in 0..rows {
        for k in 0..columns {
            let at = |i: u32, k: u32| i * columns + k % columns;
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            if i + 1 < rows {
                mesh.triangles.push([a, b, c]);
            }
            if i > 0 {
                mesh.triangles.push([a, c, d]);
            }
        }
    }
    add(scene, SurfaceDesc::Triangles(mesh), material);
}

fn checkers() -> ImageDesc {
    let pixels: Vec<[u8; 4]> =
        (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { [230, 220, 200, 255] } else { [40, 70, 160, 255] }).collect();
    ImageDesc { name: "checkers".into(), width: 8, height: 8, pixels: Pixels::Rgba8(pixels.into()) }
}

/// A sky that is brighter to one side.
fn sky() -> ImageDesc {
    let pixels: Vec<[f32; 3]> = (0..32 * 16)
        .map(|i| {
            let (x, y) = (i % 32, i / 32);
            let sun = if (x, y) == (9, 4) { 40.0 } else { 0.0 };
            let blue = 0.6 - 0.03 * y as f32;
            [0.3 * blue + sun, 0.5 * blue + sun, blue + sun]
        })
        .collect();
    ImageDesc { name: "sky".into(), width: 32, height: 16, pixels: Pixels::Rgb32F(pixels.into()) }
}

/// A floor with a texture, a rough metal and a smooth mesh on it.
fn table() -> SceneDesc {
    let checked = pbr(|m| {
        (m.metallic, m.roughness, m.double_sided) = (0.0, 0.9, true);
        m.base_color_texture = Some(TextureRef::new(0));
    });
    let metal = pbr(|m| {
        (m.metallic, m.roughness, m.double_sided) = (1.0, 0.45, true);
        m.base_color = Vec4::new(0.9, 0.7, 0.4, 1.0);
    });
    let plastic = pbr(|m| {
        (m.metallic, m.roughness, m.double_sided) = (0.0, 0.4, true);
        m.base_color = Vec4::new(0.3, 0.7, 0.4, 1.0);
    });
    let mut scene = scene_of(&[checked, metal, plastic]);
    scene.images.push(checkers());
    mapped_quad(&mut scene, DVec3::new(-3.0, -1.0, 3.0), DVec3::X * 6.0, DVec3::Z * -6.0, 0);
    ball(&mut scene, DVec3::new(-1.0, -0.3, 0.0), 0.7, 1);
    smooth_ball(&mut scene, Vec3::new(0.9, -0.2, 0.2), 0.8, 2);
    scene
}

fn lamps() -> [LightKind; 3] {
    [
        LightKind::Point { position: DVec3::new(1.0, 2.5, 1.5), intensity: Vec3::new(6.0, 5.0, 4.0), range: Some(9.0) },
        LightKind::Spot {
            position: DVec3::new(-1.5, 3.0, 1.0),
            direction: DVec3::new(0.3, -1.0, -0.2),
            intensity: Vec3::splat(15.0),
            inner: 0.3,
            outer: 0.5,
            ramp: SpotRamp::Gltf,
            range: None,
        },
        LightKind::Directional { direction: DVec3::new(0.4, -1.0, -0.6), irradiance: Vec3::splat(1.5), angle: 0.05 },
    ]
}

#[test]
fn light_tracing_agrees_with_path_tracing_in_a_box() {
    agree("box", cornell(), [48, 48]);
}

#[test]
fn light_tracing_agrees_with_path_tracing_through_a_lens_and_without_perspective() {
    let mut stage = plain();
    (stage.camera_changes.aperture, stage.camera_changes.focus_distance) = (Some(0.5), Some(2.0));
    agree_as("lens", cornell(), &stage, [48, 48]);
    stage.camera_changes.orthographic = true;
    agree_as("parallel lens", cornell(), &stage, [48, 48]);
    stage.camera_changes.aperture = None;
    agree_as("parallel", cornell(), &stage, [48, 48]);
}

#[test]
fn light_tracing_agrees_with_path_tracing_for_every_kind_of_light() {
    for (i, kind) in lamps().into_iter().enumerate() {
        let mut scene = table();
        scene.lights.push(light(kind));
        agree(["point", "spot", "sun"][i], scene, [48, 64]);
    }
    let mut scene = table();
    scene.images.push(sky());
    scene.environment = Some(EnvironmentDesc::LatLong { image: 1, rotation: 0.5, scale: Vec3::ONE });
    agree("sky", scene.clone(), [64, 96]);
    scene.lights.extend(lamps().map(light));
    scene.lights.push(light(LightKind::Sphere {
        center: DVec3::new(0.0, 1.2, 0.6),
        radius: 0.2,
        radiance: Vec3::splat(8.0),
    }));
    agree("all lights", scene, [64, 96]);
}

/// Glass, frosted glass, veils, coats: what the camera sees in mirrors its own paths find.
#[test]
fn light_tracing_agrees_with_path_tracing_for_every_material() {
    for (name, mut scene) in [("everything", everything()), ("layers", layers::everything())] {
        // Paths take the light of points to pass solids unbent.
        scene.lights.retain(|l| matches!(l.kind, LightKind::Rectangle { .. } | LightKind::Sphere { .. }));
        for material in &mut scene.materials {
            if let MaterialModel::Pbr(m) = &mut material.model {
                m.double_sided = true;
            }
        }
        agree(name, scene, [96, 96]);
    }
}

/// A ball of clear glass over a floor, below a square lamp with sides of this length.
fn caustic(side: f64) -> SceneDesc {
    let mut scene = scene_of(&[diffuse(0.8), MaterialModel::Glass { ior: 1.5 }]);
    quad(&mut scene, DVec3::new(-2.0, -1.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0, 0);
    ball(&mut scene, DVec3::new(0.0, -0.1, 0.0), 0.6, 1);
    scene.lights.push(light(LightKind::Rectangle {
        corner: DVec3::new(0.9, 2.0, -0.5),
        edge_u: DVec3::X * side,
        edge_v: DVec3::Z * side,
        radiance: Vec3::splat((4.0 / (side * side)) as f32),
    }));
    scene
}

/// Light through glass: paths from the camera seldom find the lamp, those from the lamp always find the floor.
#[test]
fn caustics_agree_and_cost_less_by_light_tracing() {
    agree("caustic", caustic(0.4), [512, 32]);
    let mut stage = plain();
    stage.camera_changes.position = Some(DVec3::new(-2.0, 2.0, 3.5));
    stage.camera_changes.focal_point = Some(DVec3::new(-0.3, -0.8, 0.2));
    stage.camera_changes.view_angle = Some(0.6);
    let stage = common::stage(&Arc::new(caustic(0.05)), &stage);
    // What is not the floor both do alike.
    let albedo = RenderOptions { aovs: vec![Aov::Albedo], ..options(IntegratorChoice::Path, 16) };
    let albedo = render(&stage, &albedo, &()).unwrap().film.aov(Aov::Albedo).unwrap().pixels;
    let floor: Vec<usize> = (0..albedo.len()).filter(|i| (albedo[*i][0] - 0.8).abs() < 1e-5).collect();
    assert!(floor.len() > 500);
    // Variance of a pixel's mean times the time that it takes.
    let cost = |integrator, spp| {
        let started = Instant::now();
        let pictures: Vec<Vec<[f32; 4]>> = (0..RUNS)
            .map(|seed| {
                let options = RenderOptions { seed: 100 + seed, ..options(integrator, spp) };
                render(&stage, &options, &()).unwrap().film.color().pixels
            })
            .collect();
        let seconds = started.elapsed().as_secs_f64();
        let variance = floor.iter().map(|i| {
            let values = || pictures.iter().map(|p| f64::from(p[*i][1]));
            let mean = values().sum::<f64>() / RUNS as f64;
            values().map(|v| (v - mean).powi(2)).sum::<f64>() / (RUNS - 1) as f64
        });
        variance.sum::<f64>() / floor.len() as f64 * seconds
    };
    let (path, light) = (cost(IntegratorChoice::Path, 128), cost(IntegratorChoice::Light, 32));
    println!("caustic: variance times time by path over that by light: {:.1}", path / light);
    assert!(path > 3.0 * light, "{path} against {light}");
}

fn by_light(spp: u32) -> RenderOptions {
    RenderOptions { filter: FilterChoice::Auto, seed: 3, max_depth: 8, ..options(IntegratorChoice::Light, spp) }
}

#[test]
fn light_paths_give_the_same_bits_for_any_number_of_threads() {
    let stage = common::stage(&Arc::new(everything()), &StageOptions::default());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&stage, &by_light(6), &()).unwrap())
    };
    let (one, two, three) = (with(1), with(2), with(3));
    assert_eq!(bits(&one), bits(&two));
    assert_eq!(bits(&one), bits(&three));
    assert_eq!((one.stats.rays, one.stats.light), (two.stats.rays, two.stats.light));
    let light = one.stats.light;
    assert_eq!(light.paths, 6 * u64::from(WIDTH * HEIGHT));
    assert!(light.vertices > light.seen && light.seen > 0);
    assert!(light.seen <= one.stats.rays[RayKind::ToCamera] && one.stats.rays[RayKind::Light] <= light.paths);
    assert_eq!(one.stats.bad_samples, 0);
}

#[test]
fn a_crop_by_light_tracing_has_the_bits_of_the_whole() {
    let stage = common::stage(&Arc::new(everything()), &StageOptions::default());
    let whole = render(&stage, &by_light(5), &()).unwrap().film.color();
    let crop = Crop { x: 11, y: 6, width: 20, height: 13 };
    let part = render(&stage, &RenderOptions { crop: Some(crop), ..by_light(5) }, &()).unwrap().film.color();
    for y in 0..crop.height {
        for x in 0..crop.width {
            let a = whole.pixels[((y + crop.y) * WIDTH + x + crop.x) as usize];
            let b = part.pixels[(y * crop.width + x) as usize];
            assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits), "{x} {y}");
        }
    }
}

#[test]
fn light_tracing_can_be_put_aside_and_made_in_shares() {
    struct Kept(std::sync::Mutex<Vec<u8>>);
    impl Monitor for Kept {
        fn wants_checkpoint(&self) -> bool {
            self.0.lock().unwrap().is_empty()
        }
        fn checkpoint(&self, sums: &firsthit_render::Sums<'_>) {
            sums.write(&mut *self.0.lock().unwrap(), "light").unwrap();
        }
    }
    let stage = common::stage(&Arc::new(everything()), &StageOptions::default());
    let whole = render(&stage, &by_light(40), &()).unwrap();
    let kept = Kept(std::sync::Mutex::default());
    render(&stage, &by_light(3), &kept).unwrap();
    let bytes = kept.0.into_inner().unwrap();
    let (aside, _) = Checkpoint::read(&mut bytes.as_slice()).unwrap();
    let resumed = render_from(&stage, &by_light(40), Some(aside), &()).unwrap();
    assert_eq!(bits(&whole), bits(&resumed));
}

/// Light paths of one sample may be many: between them too time can be up, and a checkpoint be made.
#[test]
fn light_paths_are_left_when_time_is_up() {
    const LIMIT: Duration = Duration::from_secs(2);

    /// Wants a checkpoint after the first sample, and one more, which takes until time is up.
    #[derive(Default)]
    struct Slow {
        begun: AtomicBool,
        kept: std::sync::Mutex<Vec<Vec<u8>>>,
    }
    impl Monitor for Slow {
        fn progress(&self, _: u64, _: u64, _: u64) {
            self.begun.store(true, Ordering::Relaxed);
        }
        fn wants_checkpoint(&self) -> bool {
            self.begun.load(Ordering::Relaxed) && self.kept.lock().unwrap().len() < 2
        }
        fn checkpoint(&self, sums: &firsthit_render::Sums<'_>) {
            assert_eq!(sums.film().samples_per_pixel(), 1.0);
            let mut bytes = Vec::new();
            sums.write(&mut bytes, "light").unwrap();
            let mut kept = self.kept.lock().unwrap();
            kept.push(bytes);
            if kept.len() == 2 {
                std::thread::sleep(LIMIT);
            }
        }
    }
    let stage = common::stage(&Arc::new(everything()), &StageOptions::default());
    // Of a large picture a few pixels: there is little to do but to follow light, in four batches for each sample.
    let (width, height, crop) = (64, 64, Some(Crop { x: 20, y: 30, width: 8, height: 4 }));
    let of = |spp| RenderOptions { width, height, crop, max_depth: 1024, ..by_light(spp) };
    let slow = Slow::default();
    let late = render(&stage, &RenderOptions { time_limit: Some(LIMIT), ..of(9) }, &slow).unwrap();
    assert!(late.out_of_time && !late.interrupted);
    let paths = late.stats.light.paths;
    assert!(paths > 64 * 64 && paths < 2 * 64 * 64, "{paths} paths");
    // Nothing of the second sample is kept.
    assert_eq!(bits(&late), bits(&render(&stage, &of(1), &()).unwrap()));
    let whole = bits(&render(&stage, &of(3), &()).unwrap());
    let kept = slow.kept.into_inner().unwrap();
    assert_eq!(kept.len(), 2);
    for bytes in kept {
        let (aside, _) = Checkpoint::read(&mut bytes.as_slice()).unwrap();
        assert_eq!(bits(&render_from(&stage, &of(3), Some(aside), &()).unwrap()), whole);
    }
    // Every pixel gets its first sample, whatever the limit.
    let hasty = render(&stage, &RenderOptions { time_limit: Some(Duration::ZERO), ..of(9) }, &()).unwrap();
    assert!(hasty.out_of_time && hasty.stats.light.paths == 64 * 64);
    assert_eq!(bits(&hasty), bits(&late));
}

/// What no light path brings is not simulated, and what the others do costs nothing.
#[test]
fn only_the_integrator_light_follows_light() {
    let stage = common::stage(&Arc::new(everything()), &StageOptions::default());
    let path = render(&stage, &RenderOptions { integrator: IntegratorChoice::Path, ..by_light(2) }, &()).unwrap();
    assert_eq!((path.stats.rays[RayKind::Light], path.stats.rays[RayKind::ToCamera]), (0, 0));
    assert_eq!(path.stats.light, firsthit_render::LightPaths::default());
    assert_eq!(path.stats.light.share(), None);
    // Without mirrors the camera's own rays see lamps and the sky alone.
    let light = render(&common::stage(&Arc::new(cornell()), &plain()), &by_light(2), &()).unwrap();
    assert_eq!(light.stats.rays.shadow(), 0);
    assert!(light.stats.light.share().is_some_and(|s| s > 0.3 && s < 1.0));
    // Without light there is nothing to follow.
    let mut dark = table();
    dark.lights.clear();
    let dark = render(&common::stage(&Arc::new(dark), &plain()), &by_light(2), &()).unwrap();
    assert_eq!((dark.stats.rays[RayKind::Light], dark.stats.light.paths), (0, 0));
}

#[test]
fn a_sky_over_a_scene_without_end_is_refused() {
    let mut scene = scene_of(&[diffuse(0.5)]);
    let plane = firsthit_geometry::shapes::Plane::new(DVec3::ZERO, DVec3::Y).unwrap();
    add(&mut scene, SurfaceDesc::Shape(firsthit_geometry::Shape::Plane(plane)), 0);
    let mut lit = scene.clone();
    lit.lights.push(light(lamps()[0].clone()));
    let mut stage = plain();
    stage.camera_changes.position = Some(DVec3::new(0.0, 2.0, 5.0));
    stage.camera_changes.focal_point = Some(DVec3::ZERO);
    let refused = render(&common::stage(&Arc::new(surrounded(scene, 1.0)), &stage), &by_light(1), &());
    assert_eq!(refused.err(), Some(RenderError::Endless));
    let lamp = render(&common::stage(&Arc::new(lit), &stage), &by_light(16), &()).unwrap();
    assert!(lamp.film.color().pixels.iter().any(|p| p[0] > 0.0));
}
