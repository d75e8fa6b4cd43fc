//! Depth of field against the geometry of a thin lens.

use firsthit_import::SceneDesc;
use firsthit_render::{
    CameraChanges, EffectOverrides, EffectSet, FilterChoice, IntegratorChoice, RenderOptions, Rendered, StageOptions,
};
use glam::{DVec2, DVec3};

use super::common::{ball, quad, render_scene, scene_of};
use super::{bits, everything, glow, small};

const SIDE: u32 = 96;
const ANGLE: f64 = 0.4;

/// Looks along -Z from the origin, which is sharp at 4.
fn looking(aperture: Option<f64>) -> StageOptions {
    StageOptions {
        aspect: 1.0,
        camera_changes: CameraChanges {
            position: Some(DVec3::ZERO),
            focal_point: Some(DVec3::NEG_Z),
            view_up: Some(DVec3::Y),
            view_angle: Some(ANGLE),
            aperture,
            focus_distance: Some(4.0),
            ..CameraChanges::default()
        },
        ..StageOptions::default()
    }
}

fn rendered(scene: &SceneDesc, stage: &StageOptions, integrator: IntegratorChoice) -> Rendered {
    let options = RenderOptions {
        width: SIDE,
        height: SIDE,
        spp: 2048,
        max_depth: 1,
        filter: FilterChoice::Box,
        integrator,
        ..RenderOptions::default()
    };
    render_scene(scene, stage, &options)
}

/// The picture of a small ball of light is an even disk, as large as similar triangles say.
#[test]
fn a_point_out_of_focus_is_an_even_disk() {
    let aperture = 0.2_f64;
    // Pixels on a picture at distance 1.
    let pixels = f64::from(SIDE) / (2.0 * (0.5 * ANGLE).tan());
    for depth in [2.0, 2.5, 12.0_f64] {
        let disk = 0.5 * aperture * (0.25 - 1.0 / depth).abs() * pixels;
        let own = 0.25 * disk;
        let mut scene = scene_of(&[glow(1.0)]);
        ball(&mut scene, DVec3::new(0.0, 0.0, -depth), own / pixels * depth, 0);
        let rendered = rendered(&scene, &looking(Some(aperture)), IntegratorChoice::Path);
        let (mut sum, mut moment, mut farthest) = (0.0, 0.0, 0.0_f64);
        let (mut even, mut count) = (0.0, 0);
        for (i, p) in rendered.film.color().pixels.iter().enumerate() {
            let at = DVec2::new((i as u32 % SIDE) as f64, (i as u32 / SIDE) as f64) + 0.5;
            let r = (at - 0.5 * f64::from(SIDE)).length();
            let light = f64::from(p[0]);
            sum += light;
            moment += light * r * r;
            farthest = farthest.max(if light > 0.0 { r } else { 0.0 });
            if r < disk - own - 0.71 {
                (even, count) = (even + light, count + 1);
            }
        }
        // Squared distances of two disks add up, and those within a pixel.
        let expected = 0.5 * (disk * disk + own * own) + 1.0 / 6.0;
        println!("depth {depth}: disk of {disk:.2} pixels, mean square {:.3} instead of {expected:.3}", moment / sum);
        assert!((moment / sum / expected - 1.0).abs() < 0.03, "depth {depth}");
        assert!(farthest < disk + own + 1.5, "{farthest}");
        // Where all of the ball's picture is in the disk, a pixel has the ball's share of it.
        let share = even / f64::from(count) * disk * disk / (own * own);
        assert!((share - 1.0).abs() < 0.04, "depth {depth}: {share} of {count} pixels");
        let all = std::f64::consts::PI * own * own;
        assert!((sum / all - 1.0).abs() < 0.03, "{sum} instead of {all}");
    }
}

/// Rays that meet at the same point see the same.
#[test]
fn what_is_in_focus_is_sharp() {
    let mut scene = scene_of(&[glow(1.0)]);
    for i in 0..6 {
        let x = -0.6 + 0.2 * f64::from(i);
        quad(&mut scene, DVec3::new(x, -0.55, -4.0), DVec3::X * 0.1, DVec3::Y * 1.1, 0);
    }
    let sharp = rendered(&scene, &looking(None), IntegratorChoice::Path).film.color();
    let wide = rendered(&scene, &looking(Some(1.0)), IntegratorChoice::Path).film.color();
    let most = sharp.pixels.iter().zip(&wide.pixels).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
    // A ray may fall on the other side of an edge by a rounding.
    assert!(most <= 2.0 / 2048.0, "{most}");
    assert!(sharp.pixels.iter().any(|p| p[0] > 0.9) && sharp.pixels.iter().any(|p| p[0] < 0.1));
}

#[test]
fn a_lens_that_is_closed_costs_nothing() {
    let scene = everything();
    let with = |changes: CameraChanges, remove| {
        let effects = EffectOverrides { remove, ..EffectOverrides::default() };
        render_scene(&scene, &StageOptions { camera_changes: changes, effects, ..StageOptions::default() }, &small(4))
    };
    let none = EffectSet::empty();
    let pinhole = with(CameraChanges::default(), none);
    let closed = with(CameraChanges { aperture: Some(0.0), focus_distance: Some(2.0), ..Default::default() }, none);
    let open = CameraChanges { aperture: Some(0.3), focus_distance: Some(2.0), ..Default::default() };
    let left_out = with(open, EffectSet::DEPTH_OF_FIELD);
    for other in [&closed, &left_out] {
        assert_eq!(bits(&pinhole), bits(other));
        assert_eq!(pinhole.stats.rays, other.stats.rays);
    }
    let called = |r: &Rendered| r.effects.called_for().contains(EffectSet::DEPTH_OF_FIELD);
    assert!(!called(&pinhole) && !called(&closed) && called(&left_out));
    assert_ne!(bits(&pinhole), bits(&with(open, none)));
}
