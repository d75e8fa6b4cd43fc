//! Against the reference images: path tracing in everything, Whitted's ray tracing where it gives the whole answer.
//!
//! Path tracing is compared in every scene there is: the mean to 1 per cent, every block of 8 x 8 pixels to 1 per cent
//! and three standard deviations (of our own variance and of the reference's noise). Of Whitted's:
//!
//! | scene | compared | why the rest is not |
//! |---|---|---|
//! | furnace_glass | every pixel, exactly 1 | - |
//! | furnace_diffuse | every pixel, exactly 1 | - |
//! | furnace_metal | every block of 8 x 8 pixels | - |
//! | env_sun | the sky, the mirror's image of the sky, the metal's upper part | diffuse light between floor and balls |
//! | cornell | the lamp and what is outside; elsewhere direct light is the lower bound | diffuse light between walls |

use std::path::PathBuf;
use std::sync::Arc;

use exr::prelude::{ReadChannels, ReadLayers};
use firsthit_render::{
    Aov, EnvironmentChoice, FilterChoice, IntegratorChoice, RenderOptions, Rendered, StageOptions, TextureFilter,
    render,
};
use glam::{DVec3, Vec3};

const SIDE: usize = 256;
const BLOCK: usize = 8;
/// Near the silhouette of a glass ball a share T of the light gets in, and each time a share T of it gets out again:
/// n bounces lose T (1 - T)^n of it, at most 1 / (e n).
const END: u32 = 1000;

fn folder(name: &str) -> PathBuf {
    let base = std::env::var_os("FIRSTHIT_REFERENCES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("references"), PathBuf::from);
    base.join(name)
}

/// The reference picture, row 0 at the top.
fn reference(name: &str) -> Vec<Vec3> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| vec![Vec3::ZERO; size.width() * size.height()],
            |pixels: &mut Vec<Vec3>, at, (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * SIDE + at.x()] = Vec3::new(r, g, b)
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(folder(name).join("ref.exr"))
        .unwrap();
    image.layer_data.channel_data.pixels
}

/// By Whitted's method.
fn picture(name: &str, spp: u32) -> Vec<Vec3> {
    let options = RenderOptions { spp, integrator: IntegratorChoice::Whitted, ..RenderOptions::default() };
    colors(&rendered(name, options))
}

fn colors(rendered: &Rendered) -> Vec<Vec3> {
    rendered.film.color().pixels.iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect()
}

/// The scene as its file says; of paths without end, `END` bounces.
fn rendered(name: &str, options: RenderOptions) -> Rendered {
    let imported =
        firsthit_import::open(folder(name).join("scene.json"), &firsthit_import::Options::default()).unwrap();
    let settings = &imported.scene.settings;
    assert!(settings.reference_conventions);
    assert_eq!(settings.resolution, Some((SIDE as u32, SIDE as u32)));
    let bounces = settings.max_path_edges.map_or(END, |edges| edges.saturating_sub(1).min(END));
    let scene = Arc::new(imported.scene);
    let as_square = StageOptions { aspect: 1.0, ..StageOptions::default() };
    let stage = super::common::stage(&scene, &as_square);
    let options = RenderOptions { width: SIDE as u32, height: SIDE as u32, max_depth: bounces, ..options };
    let rendered = render(&stage, &options, &()).unwrap();
    assert_eq!(rendered.stats.bad_samples, 0);
    rendered
}

/// How a picture by path tracing differs from the reference.
#[derive(Debug)]
struct Difference {
    /// Of each colour: our mean over theirs.
    ratio: [f32; 3],
    /// Share of blocks beyond what is allowed.
    beyond: f32,
}

fn difference(name: &str, spp: u32) -> Difference {
    let options = RenderOptions { spp, aovs: vec![Aov::Variance], ..RenderOptions::default() };
    compared(name, &rendered(name, options))
}

fn compared(name: &str, rendered: &Rendered) -> Difference {
    let (ours, theirs) = (colors(rendered), reference(name));
    let variance = rendered.film.aov(Aov::Variance).unwrap().pixels;
    let noise: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder(name).join("ref.json")).unwrap()).unwrap();
    let noise = noise["ref_noise_mse"].as_f64().unwrap();
    let sum = |p: &[Vec3]| p.iter().map(|p| p.as_dvec3()).sum::<DVec3>();
    let (all, expected) = (sum(&ours), sum(&theirs));
    let all_variance: f64 =
        variance.iter().map(|v| f64::from(v[0] + v[1] + v[2]) / 3.0).sum::<f64>() / ours.len() as f64;
    let mut beyond = 0;
    for by in 0..SIDE / BLOCK {
        for bx in 0..SIDE / BLOCK {
            let (mut ours_sum, mut theirs_sum, mut var) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
            for i in 0..BLOCK * BLOCK {
                let at = (by * BLOCK + i / BLOCK) * SIDE + bx * BLOCK + i % BLOCK;
                ours_sum += ours[at];
                theirs_sum += theirs[at];
                var += Vec3::new(variance[at][0], variance[at][1], variance[at][2]);
            }
            let n = (BLOCK * BLOCK) as f32;
            // The reference's noise, spread as ours is.
            let var = var * (1.0 + (noise / all_variance.max(1e-12)) as f32);
            let allowed = 0.01 * theirs_sum / n + 3.0 * var.map(f32::sqrt) / n + 1e-5;
            beyond += usize::from((ours_sum / n - theirs_sum / n).abs().cmpgt(allowed).any());
        }
    }
    let blocks = (SIDE / BLOCK).pow(2) as f32;
    let ratio = std::array::from_fn(|c| if expected[c] > 0.0 { (all[c] / expected[c]) as f32 } else { 1.0 });
    Difference { ratio, beyond: beyond as f32 / blocks }
}

#[test]
fn path_tracing_agrees_with_every_reference() {
    let base = folder("");
    let mut names: Vec<String> = std::fs::read_dir(&base)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().join("scene.json").exists())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 5, "{names:?}");
    for name in names {
        let found = difference(&name, 64);
        println!("{name}: {found:?}");
        assert!(found.ratio.iter().all(|r| (r - 1.0).abs() < 0.01), "{name}: {found:?}");
        // Three standard deviations of each of three colours of 1024 blocks: a few by chance.
        assert!(found.beyond <= 0.01, "{name}: {found:?}");
    }
}

/// The glTF files of scenes named `gltf_*`, read as any glTF file is: light and camera of the scene, and the switches
/// that make it the core of the specification.
#[test]
fn gltf_files_by_themselves_agree_with_their_references() {
    for entry in std::fs::read_dir(folder("")).unwrap().map(|e| e.unwrap()) {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(text) = std::fs::read(entry.path().join("scene.json")) else { continue };
        if !name.starts_with("gltf_") {
            continue;
        }
        let json: serde_json::Value = serde_json::from_slice(&text).unwrap();
        let vector = |v: &serde_json::Value| DVec3::from_array([0, 1, 2].map(|i| v[i].as_f64().unwrap()));
        let file = entry.path().join(json["objects"][0]["file"].as_str().unwrap());
        let scene = Arc::new(firsthit_import::open(file, &firsthit_import::Options::default()).unwrap().scene);
        let mut stage = StageOptions {
            aspect: 1.0,
            environment: EnvironmentChoice::White,
            energy_compensation: false,
            shadow_terminator: false,
            texture_filter: TextureFilter::Bilinear,
            ..StageOptions::default()
        };
        let camera = &json["camera"];
        stage.camera_changes.position = Some(vector(&camera["origin"]));
        stage.camera_changes.focal_point = Some(vector(&camera["target"]));
        stage.camera_changes.view_up = Some(vector(&camera["up"]));
        stage.camera_changes.view_angle = Some(camera["vfov_deg"].as_f64().unwrap().to_radians());
        let options = RenderOptions {
            width: SIDE as u32,
            height: SIDE as u32,
            spp: 64,
            max_depth: END,
            filter: FilterChoice::Box,
            aovs: vec![Aov::Variance],
            ..RenderOptions::default()
        };
        let found = compared(&name, &render(&super::common::stage(&scene, &stage), &options, &()).unwrap());
        println!("{name} by its glTF file: {found:?}");
        assert!(found.ratio.iter().all(|r| (r - 1.0).abs() < 0.01) && found.beyond <= 0.01, "{name}: {found:?}");
    }
}

/// At each pixel.
#[test]
fn in_a_white_furnace_path_tracing_sees_nothing() {
    for name in ["furnace_diffuse", "furnace_glass"] {
        let options = RenderOptions { spp: 16, ..RenderOptions::default() };
        for (i, p) in colors(&rendered(name, options)).iter().enumerate() {
            assert!((*p - Vec3::ONE).abs().max_element() < 5e-3, "{name}, pixel {i}: {p}");
        }
    }
}

/// Means of blocks of 8 x 8 pixels, and the standard deviation of such a mean, estimated from its pixels.
fn blocks(pixels: &[Vec3]) -> Vec<(Vec3, Vec3)> {
    let n = (BLOCK * BLOCK) as f32;
    let mut blocks = Vec::new();
    for by in 0..SIDE / BLOCK {
        for bx in 0..SIDE / BLOCK {
            let of = |i: usize| pixels[(by * BLOCK + i / BLOCK) * SIDE + bx * BLOCK + i % BLOCK];
            let mean = (0..BLOCK * BLOCK).map(of).sum::<Vec3>() / n;
            let variance = (0..BLOCK * BLOCK).map(|i| (of(i) - mean) * (of(i) - mean)).sum::<Vec3>() / (n - 1.0);
            blocks.push((mean, (variance / n).map(f32::sqrt)));
        }
    }
    blocks
}

/// Whether two pictures agree in a block: to 1 per cent or three standard deviations.
#[track_caller]
fn assert_block(name: &str, at: usize, (ours, deviation): (Vec3, Vec3), (theirs, _): (Vec3, Vec3)) {
    let allowed = (0.01 * theirs).max(3.0 * deviation) + 1e-3;
    assert!(
        (ours - theirs).abs().cmple(allowed).all(),
        "{name}, block ({}, {}): {ours} instead of {theirs}, allowed {allowed}",
        at % (SIDE / BLOCK),
        at / (SIDE / BLOCK),
    );
}

#[test]
fn in_a_white_furnace_glass_vanishes() {
    for (i, p) in picture("furnace_glass", 4).iter().enumerate() {
        assert!((*p - Vec3::ONE).abs().max_element() < 4e-4, "pixel {i}: {p}");
    }
}

#[test]
fn in_a_white_furnace_white_vanishes() {
    for (i, p) in picture("furnace_diffuse", 4).iter().enumerate() {
        assert!((*p - Vec3::ONE).abs().max_element() < 2e-5, "pixel {i}: {p}");
    }
}

#[test]
fn rough_metal_loses_as_much_light_as_in_the_reference() {
    let (ours, theirs) = (blocks(&picture("furnace_metal", 64)), blocks(&reference("furnace_metal")));
    for (i, (a, b)) in ours.iter().zip(&theirs).enumerate() {
        assert_block("furnace_metal", i, *a, *b);
    }
    let mean = |b: &[(Vec3, Vec3)]| b.iter().map(|(m, _)| m.x).sum::<f32>() / b.len() as f32;
    assert!((mean(&ours) / mean(&theirs) - 1.0).abs() < 5e-4, "{} against {}", mean(&ours), mean(&theirs));
}

#[test]
fn sky_mirror_and_metal_show_the_sky_as_in_the_reference() {
    let (ours, theirs) = (blocks(&picture("env_sun", 64)), blocks(&reference("env_sun")));
    // In blocks: the sky over the balls; in the middle of the mirror and of the metal, above their equators.
    let sky = (0..32 * 7).collect::<Vec<_>>();
    let ball = |column: usize| (12..14).flat_map(move |row| (column..column + 2).map(move |c| row * 32 + c));
    for i in sky.into_iter().chain(ball(7)).chain(ball(23)) {
        assert_block("env_sun", i, ours[i], theirs[i]);
    }
}

#[test]
fn the_cornell_box_shows_its_lamp_and_no_more_light_than_the_reference() {
    let pixels = picture("cornell", 64);
    let (ours, theirs) = (blocks(&pixels), blocks(&reference("cornell")));
    let mut direct_share = 0.0;
    for (i, (a, b)) in ours.iter().zip(&theirs).enumerate() {
        let allowed = 3.0 * a.1 + 0.01 * b.0 + 1e-3;
        assert!(a.0.cmple(b.0 + allowed).all(), "block {i}: {} is more than {}", a.0, b.0);
        direct_share += a.0.x / b.0.x.max(1e-3) / 1024.0;
        // Outside the box it is black.
        if b.0 == Vec3::ZERO {
            assert_eq!(a.0, Vec3::ZERO);
        }
    }
    assert!((0.2..0.9).contains(&direct_share), "{direct_share}");
    let lamp = Vec3::new(17.0, 12.0, 4.0);
    let (mut ours_lit, mut theirs_lit) = (0, 0);
    for (a, b) in pixels.iter().zip(reference("cornell")) {
        ours_lit += usize::from((*a - lamp).abs().max_element() < 0.01);
        theirs_lit += usize::from((b - lamp).abs().max_element() < 0.01);
    }
    assert!(theirs_lit > 100 && ours_lit.abs_diff(theirs_lit) <= theirs_lit / 20, "{ours_lit}, {theirs_lit}");
}
