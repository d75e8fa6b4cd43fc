//! Against the reference images, where Whitted's ray tracing gives the whole answer.
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
use firsthit_render::{RenderOptions, StageOptions, render};
use glam::Vec3;

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

/// The scene as its file says; of paths without end, `END` bounces.
fn picture(name: &str, spp: u32) -> Vec<Vec3> {
    let imported =
        firsthit_import::open(folder(name).join("scene.json"), &firsthit_import::Options::default()).unwrap();
    let settings = &imported.scene.settings;
    assert!(settings.reference_conventions);
    assert_eq!(settings.resolution, Some((SIDE as u32, SIDE as u32)));
    let bounces = settings.max_path_edges.map_or(END, |edges| edges.saturating_sub(1).min(END));
    let scene = Arc::new(imported.scene);
    let options = StageOptions { aspect: 1.0, ..StageOptions::default() };
    let stage = super::common::stage(&scene, &options);
    let options =
        RenderOptions { width: SIDE as u32, height: SIDE as u32, spp, max_depth: bounces, ..RenderOptions::default() };
    let rendered = render(&stage, &options, &()).unwrap();
    assert_eq!(rendered.stats.bad_samples, 0);
    rendered.film.color().pixels.iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect()
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
