//! Motion blur against how long things cover what is behind them.

use firsthit_import::SceneDesc;
use firsthit_import::scene::{CameraDesc, Projection, SurfaceDesc, Vertices};
use firsthit_render::{
    CameraChanges, CameraChoice, EffectOverrides, EffectSet, FilterChoice, IntegratorChoice, RenderOptions, Rendered,
    StageOptions,
};
use glam::{DAffine3, DVec2, DVec3};

use super::common::{ball, quad, render_scene, scene_of};
use super::{bits, diffuse, everything, glow, small, surrounded};

const SIDE: u32 = 64;
const STEPS: u32 = 128;

/// Looks along -Z, without perspective, at a square with sides of 2 about the origin.
fn flat(motion_steps: u32) -> StageOptions {
    StageOptions {
        aspect: 1.0,
        motion_steps,
        camera_changes: CameraChanges {
            position: Some(DVec3::Z * 5.0),
            focal_point: Some(DVec3::ZERO),
            view_up: Some(DVec3::Y),
            view_angle: Some(2.0 * (1.0_f64 / 5.0).atan()),
            orthographic: true,
            ..CameraChanges::default()
        },
        ..StageOptions::default()
    }
}

fn rendered(scene: &SceneDesc, integrator: IntegratorChoice) -> Rendered {
    let options = RenderOptions {
        width: SIDE,
        height: SIDE,
        spp: 512,
        max_depth: 1,
        filter: FilterChoice::Box,
        integrator,
        ..RenderOptions::default()
    };
    render_scene(scene, &flat(STEPS), &options)
}

fn moving_ball(radius: f64, way: f64) -> SceneDesc {
    let mut scene = scene_of(&[glow(1.0)]);
    ball(&mut scene, DVec3::new(-0.5 * way, 0.0, 0.0), radius, 0);
    scene.instances[0].moves_to = Some(DAffine3::from_translation(DVec3::X * way));
    scene
}

/// The share of the time for which a point is covered by a ball that moves along x.
fn covered(at: DVec2, radius: f64, way: f64) -> f64 {
    let half = (radius * radius - at.y * at.y).max(0.0).sqrt();
    let (first, last) = ((at.x - half).max(-0.5 * way), (at.x + half).min(0.5 * way));
    (last - first).max(0.0) / way
}

#[test]
fn a_moving_ball_covers_each_point_for_its_share_of_the_time() {
    let (radius, way) = (0.2, 0.8);
    let scene = moving_ball(radius, way);
    for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted, IntegratorChoice::Light] {
        let rendered = rendered(&scene, integrator);
        let pixels = rendered.film.color().pixels;
        let (mut worst, mut sum) = (0.0_f64, 0.0);
        for (i, p) in pixels.iter().enumerate() {
            let corner = DVec2::new((i as u32 % SIDE) as f64, (i as u32 / SIDE) as f64);
            // The mean over the pixel.
            let n = 16;
            let mean = (0..n * n)
                .map(|k| {
                    let inside = DVec2::new((k % n) as f64 + 0.5, (k / n) as f64 + 0.5) / n as f64;
                    covered((corner + inside) * (2.0 / f64::from(SIDE)) - 1.0, radius, way)
                })
                .sum::<f64>()
                / (n * n) as f64;
            worst = worst.max((f64::from(p[0]) - mean).abs());
            sum += f64::from(p[0]) * (2.0 / f64::from(SIDE)).powi(2);
        }
        println!("{integrator:?}: worst pixel off by {worst:.4}, in all {sum:.5}");
        // One step more or less, and the noise of 512 samples.
        assert!(worst < 1.0 / f64::from(STEPS) + 0.02, "{worst}");
        let all = std::f64::consts::PI * radius * radius;
        assert!((sum / all - 1.0).abs() < 2e-3, "{sum} instead of {all}");
        assert_eq!(rendered.effects.simulated() & EffectSet::MOTION, EffectSet::MOTION);
    }
}

/// Where a square that grows from nothing to sides of 2 covers what is behind it: from when its border gets there.
#[test]
fn a_mesh_that_grows_covers_each_point_from_when_it_gets_there() {
    let mut scene = scene_of(&[glow(1.0)]);
    quad(&mut scene, DVec3::new(-1.0, -1.0, 0.0), DVec3::X * 2.0, DVec3::Y * 2.0, 0);
    let SurfaceDesc::Triangles(mesh) = &mut scene.meshes[0].geometries[0].surface else { unreachable!() };
    let grown = mesh.positions.clone();
    mesh.positions.iter_mut().for_each(|p| *p *= 1.0 / 1024.0);
    mesh.moves_to = Some(Box::new(Vertices { positions: grown, ..Vertices::default() }));
    for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted, IntegratorChoice::Light] {
        let rendered = rendered(&scene, integrator);
        let at = |i: u32| ((f64::from(i) + 0.5) * (2.0 / f64::from(SIDE)) - 1.0).abs();
        let (mut worst, mut sum) = (0.0_f64, 0.0);
        for (i, p) in rendered.film.color().pixels.iter().enumerate() {
            let (x, y) = (at(i as u32 % SIDE), at(i as u32 / SIDE));
            worst = worst.max((f64::from(p[0]) - (1.0 - x.max(y))).abs());
            sum += f64::from(p[0]) / f64::from(SIDE * SIDE);
        }
        println!("{integrator:?}: worst pixel off by {worst:.4}, in all {sum:.5}");
        // A step more or less. In all: the mean of 1 - max(|x|, |y|) is 1/3.
        assert!(worst < 1.0 / f64::from(STEPS) + 0.01, "{worst}");
        assert!((sum * 3.0 - 1.0).abs() < 1e-2, "{sum}");
        assert!(rendered.effects.simulated().contains(EffectSet::MOTION));
    }
}

/// Who walks past a ball sees what one sees past whom the ball goes.
#[test]
fn a_camera_that_moves_sees_what_moves_the_other_way() {
    let way = DVec3::new(0.5, 0.25, 0.0);
    let mut passing = scene_of(&[glow(1.0)]);
    ball(&mut passing, DVec3::ZERO, 0.3, 0);
    passing.cameras.push(CameraDesc {
        name: "here".into(),
        transform: DAffine3::from_translation(DVec3::Z * 5.0),
        projection: Projection::Orthographic { half_height: 1.0, aspect: None },
        lens: None,
        moves_to: None,
    });
    let mut walking = passing.clone();
    passing.instances[0].moves_to = Some(DAffine3::from_translation(-way));
    walking.cameras[0].moves_to = Some(DAffine3::from_translation(DVec3::Z * 5.0 + way));
    for integrator in [IntegratorChoice::Path, IntegratorChoice::Whitted, IntegratorChoice::Light] {
        let options = RenderOptions { width: SIDE, height: SIDE, integrator, ..small(64) };
        let camera = CameraChoice::Named("here".into());
        let setup = StageOptions { camera, aspect: 1.0, ..StageOptions::default() };
        let pictures = [&passing, &walking].map(|scene| {
            let rendered = render_scene(scene, &setup, &options);
            assert!(rendered.effects.simulated().contains(EffectSet::MOTION));
            rendered.film.color().pixels
        });
        let pairs = pictures[0].iter().zip(&pictures[1]);
        let worst = pairs.map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
        let mean = pictures.each_ref().map(|p| p.iter().map(|p| f64::from(p[0])).sum::<f64>());
        println!("{integrator:?}: worst pixel off by {worst:.4}, in all {mean:?}");
        // Rays that graze the ball may miss it from elsewhere.
        assert!(worst < 0.05, "{worst}");
        assert!(mean[0] > 0.0 && (mean[0] / mean[1] - 1.0).abs() < 2e-3, "{mean:?}");
    }
}

/// A moving lamp lights by the mean of where it was: the floor below is as bright along its way as the closed form of a
/// line says, by every integrator alike.
#[test]
fn moving_lamps_and_shadows_are_the_same_for_every_integrator() {
    let mut scene = scene_of(&[diffuse(0.7), glow(20.0)]);
    quad(&mut scene, DVec3::new(-2.0, -2.0, -0.5), DVec3::X * 4.0, DVec3::Y * 4.0, 0);
    ball(&mut scene, DVec3::new(-0.6, 0.5, 0.3), 0.15, 1);
    ball(&mut scene, DVec3::new(0.0, 0.0, 0.0), 0.3, 0);
    scene.instances[1].moves_to = Some(DAffine3::from_translation(DVec3::X * 1.2));
    scene.instances[2].moves_to = Some(DAffine3::from_translation(DVec3::new(0.3, -0.4, 0.1)));
    let mean = |integrator| {
        let pixels = rendered(&scene, integrator).film.color().pixels;
        let half = |upper: bool| {
            let of = pixels.iter().enumerate().filter(|(i, _)| (i / (SIDE * SIDE / 2) as usize == 0) == upper);
            of.map(|(_, p)| f64::from(p[0])).sum::<f64>()
        };
        [half(true), half(false)]
    };
    let path = mean(IntegratorChoice::Path);
    for integrator in [IntegratorChoice::Whitted, IntegratorChoice::Light] {
        let other = mean(integrator);
        println!("{integrator:?}: {other:?}, by paths {path:?}");
        for (a, b) in path.iter().zip(other) {
            assert!((a / b - 1.0).abs() < 5e-3, "{integrator:?}: {other:?} instead of {path:?}");
        }
    }
}

#[test]
fn what_stands_still_costs_nothing() {
    let still = everything();
    let mut same = still.clone();
    for instance in &mut same.instances {
        instance.moves_to = Some(instance.transform);
    }
    let mut moving = still.clone();
    moving.instances[1].moves_to = Some(DAffine3::from_translation(DVec3::Y));
    let plain = StageOptions::default();
    let without = StageOptions {
        effects: EffectOverrides { remove: EffectSet::MOTION, ..EffectOverrides::default() },
        ..StageOptions::default()
    };
    let base = render_scene(&still, &plain, &small(4));
    for other in [render_scene(&same, &plain, &small(4)), render_scene(&moving, &without, &small(4))] {
        assert_eq!(bits(&base), bits(&other));
        assert_eq!(base.stats.rays, other.stats.rays);
    }
    assert!(!base.effects.called_for().contains(EffectSet::MOTION));
    assert_ne!(bits(&base), bits(&render_scene(&moving, &plain, &small(4))));
    // Threads do not matter.
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&render_scene(&surrounded(moving.clone(), 0.5), &plain, &small(4))))
    };
    assert_eq!(with(1), with(2));
}
