//! Fog against closed forms and sums.

use std::f64::consts::PI;

use firsthit_import::SceneDesc;
use firsthit_import::scene::{FogDesc, LightKind};
use firsthit_render::{EffectOverrides, EffectSet, IntegratorChoice, RayKind, RenderOptions, StageOptions};
use glam::{DVec3, Vec3};

use super::common::{Probe, ball, quad, render_scene, scene_of};
use super::{assert_near, bits, diffuse, everything, glow, light, small, surrounded};

fn fog(scattering: Vec3, absorption: Vec3, g: f32) -> Option<FogDesc> {
    Some(FogDesc { scattering, absorption, g, bounds: None })
}

fn probe(scene: &SceneDesc) -> Probe<'_> {
    Probe::new(scene).integrator(IntegratorChoice::Path)
}

/// What only absorbs takes away an exponential share of sight and of the light that is asked: exactly, sample by sample.
#[test]
fn fog_that_absorbs_takes_away_exponentially() {
    let absorption = Vec3::new(0.1, 0.4, 0.0);
    let left = |way: f64| absorption.as_dvec3().to_array().map(|a| (-a * way).exp());
    let mut lamp = scene_of(&[glow(2.0)]);
    quad(&mut lamp, DVec3::new(-1.0, -1.0, -3.0), DVec3::X * 2.0, DVec3::Y * 2.0, 0);
    lamp.fog = fog(Vec3::ZERO, absorption, 0.5);
    let seen = probe(&lamp).spp(1).look(DVec3::new(0.0, 0.0, -3.0));
    for (found, left) in seen.to_array().into_iter().zip(left(3.0)) {
        assert_near(found, 2.0 * left, 1e-5);
    }
    let mut lit = scene_of(&[diffuse(0.8)]);
    quad(&mut lit, DVec3::new(-9.0, 0.0, 9.0), DVec3::X * 18.0, DVec3::Z * -18.0, 0);
    lit.lights.push(light(LightKind::Point { position: DVec3::Y * 2.0, intensity: Vec3::splat(5.0), range: None }));
    lit.fog = fog(Vec3::ZERO, absorption, 0.0);
    let eye = DVec3::new(3.0, 4.0, 0.0);
    let seen = probe(&lit).depth(1).spp(1).from(eye).look(DVec3::ZERO);
    for (found, left) in seen.to_array().into_iter().zip(left(2.0 + 5.0)) {
        assert_near(found, 0.8 / PI * 5.0 / 4.0 * left, 1e-4);
    }
    // A sky through a box of it.
    let mut sky = surrounded(scene_of(&[]), 1.5);
    sky.fog = Some(FogDesc {
        bounds: Some((DVec3::new(-1.0, -1.0, -4.0), DVec3::new(1.0, 1.0, -1.0))),
        ..fog(Vec3::ZERO, absorption, 0.0).unwrap()
    });
    let seen = probe(&sky).spp(1).look(DVec3::NEG_Z);
    for (found, left) in seen.to_array().into_iter().zip(left(3.0)) {
        assert_near(found, 1.5 * left, 1e-5);
    }
}

/// Fog that takes nothing away is not to be seen under an even sky, nor is a white ball in it.
#[test]
fn white_fog_vanishes_in_an_even_sky() {
    for g in [-0.5, 0.0, 0.8] {
        for with_ball in [false, true] {
            let mut scene = scene_of(&[diffuse(1.0)]);
            if with_ball {
                ball(&mut scene, DVec3::new(0.2, 0.0, -3.0), 0.5, 0);
            }
            let mut scene = surrounded(scene, 1.0);
            let side = DVec3::splat(1.5);
            let middle = DVec3::NEG_Z * 3.0;
            scene.fog = Some(FogDesc {
                bounds: Some((middle - side, middle + side)),
                ..fog(Vec3::new(0.3, 0.7, 1.2), Vec3::ZERO, g).unwrap()
            });
            for at in [DVec3::new(0.1, 0.2, -3.0), DVec3::new(0.9, -0.3, -3.0)] {
                let seen = probe(&scene).depth(400).spp(4096).look(at);
                assert!((seen - 1.0).abs().max_element() < 0.03, "g {g}, ball {with_ball}: {seen}");
            }
        }
    }
}

/// The light of a point that is scattered once on the way of a ray that meets nothing.
#[test]
fn light_that_is_scattered_once_is_the_integral_over_the_ray() {
    let (scattering, absorption) = (Vec3::new(0.05, 0.2, 0.4), Vec3::new(0.1, 0.0, 0.05));
    let lamp = DVec3::new(0.7, 1.0, -2.0);
    let intensity = 8.0;
    for g in [0.0, 0.7, -0.4] {
        let mut scene = scene_of(&[]);
        let (position, intensity_of) = (lamp, Vec3::splat(intensity as f32));
        scene.lights.push(light(LightKind::Point { position, intensity: intensity_of, range: None }));
        scene.fog = fog(scattering, absorption, g);
        let found = probe(&scene).depth(1).spp(1 << 17).look(DVec3::NEG_Z);
        let g = f64::from(g);
        let phase = |cos: f64| (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
        for c in 0..3 {
            let (s, t) = (f64::from(scattering[c]), f64::from(scattering[c] + absorption[c]));
            let (n, far) = (200_000, 100.0);
            let sum: f64 = (0..n)
                .map(|i| {
                    let z = (f64::from(i) + 0.5) / f64::from(n) * far;
                    let way = lamp - DVec3::NEG_Z * z;
                    let d = way.length();
                    // Light comes along -way and goes on towards the eye.
                    let cos = (-way / d).dot(DVec3::Z);
                    s * (-t * (z + d)).exp() * phase(cos) * intensity / (d * d) * far / f64::from(n)
                })
                .sum();
            println!("g {g}, colour {c}: {} instead of {sum}", found[c]);
            assert_near(found[c], sum, 0.015);
        }
    }
}

/// The same light by more bounces than one: both ways of finding a lamp in fog together count it once.
#[test]
fn lamps_in_fog_are_as_bright_asked_for_as_met() {
    let with = |as_light: bool| {
        let mut scene = scene_of(&[diffuse(0.5), glow(6.0)]);
        quad(&mut scene, DVec3::new(-4.0, -1.0, 4.0), DVec3::X * 8.0, DVec3::Z * -8.0, 0);
        let (center, radius) = (DVec3::new(0.4, 0.6, -3.0), 0.5);
        if as_light {
            scene.lights.push(light(LightKind::Sphere { center, radius, radiance: Vec3::splat(6.0) }));
        } else {
            ball(&mut scene, center, radius, 1);
        }
        scene.fog = fog(Vec3::splat(0.3), Vec3::splat(0.05), 0.6);
        // The light of a lamp that is asked, in turn, without asking: single scattering alone.
        let all = probe(&scene).depth(6).spp(1 << 15).look(DVec3::new(-0.4, 0.3, -3.0)).x;
        let remove = EffectSet::INDIRECT_LIGHT;
        let stage = StageOptions { effects: EffectOverrides { remove, ..Default::default() }, ..Default::default() };
        (all, probe(&scene).stage(stage).depth(1).spp(1 << 15).look(DVec3::new(-0.4, 0.3, -3.0)).x)
    };
    let ((a, once_a), (b, once_b)) = (with(true), with(false));
    assert_near(a, b, 0.02);
    assert_near(once_a, once_b, 0.02);
    let mut scene = scene_of(&[glow(6.0)]);
    ball(&mut scene, DVec3::new(0.4, 0.6, -3.0), 0.5, 0);
    scene.fog = fog(Vec3::splat(0.3), Vec3::splat(0.05), 0.6);
    // Once, with directions followed as well.
    let once = probe(&scene).depth(1).spp(1 << 15).look(DVec3::new(-0.4, 0.3, -3.0)).x;
    let (lamp, radius, n) = (DVec3::new(0.4, 0.6, -3.0), 0.5_f64, 4000);
    let eye = DVec3::new(-0.4, 0.3, -3.0).normalize();
    // By shells of equal steps along the ray and over the lamp's disk of directions.
    let mut sum = 0.0;
    for i in 0..n {
        let z = (f64::from(i) + 0.5) / f64::from(n) * 40.0;
        let way = lamp - eye * z;
        let d = way.length();
        let most = 1.0 - (1.0 - (radius / d).powi(2)).sqrt();
        let (x, m) = (way.normalize().any_orthonormal_vector(), 12);
        let y = way.normalize().cross(x);
        for j in 0..m {
            for k in 0..m {
                let cos = 1.0 - most * (f64::from(j) + 0.5) / f64::from(m);
                let phi = 2.0 * PI * (f64::from(k) + 0.5) / f64::from(m);
                let sin = (1.0 - cos * cos).sqrt();
                let w = way.normalize() * cos + (x * phi.cos() + y * phi.sin()) * sin;
                let b = w.dot(way);
                let t = b - (radius * radius - (d * d - b * b)).max(0.0).sqrt();
                let g = 0.6;
                let phase = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * w.dot(eye)).powf(1.5));
                let share = 2.0 * PI * most / f64::from(m * m) * 40.0 / f64::from(n);
                sum += 0.3 * (-0.35 * (z + t)).exp() * phase * 6.0 * share;
            }
        }
    }
    println!("once: {once} instead of {sum}");
    assert_near(once, sum, 0.02);
}

#[test]
fn where_there_is_no_fog_it_costs_nothing() {
    let scene = everything();
    let mut foggy = scene.clone();
    foggy.fog = Some(FogDesc {
        bounds: Some((DVec3::splat(-4.0), DVec3::splat(4.0))),
        ..fog(Vec3::splat(0.1), Vec3::splat(0.02), 0.3).unwrap()
    });
    let mut thin = scene.clone();
    thin.fog = fog(Vec3::ZERO, Vec3::ZERO, 0.0);
    let without = StageOptions {
        effects: EffectOverrides { remove: EffectSet::FOG, ..EffectOverrides::default() },
        ..StageOptions::default()
    };
    let clear = render_scene(&scene, &StageOptions::default(), &small(4));
    assert_eq!(clear.stats.rays[RayKind::Fog], 0);
    for other in [render_scene(&thin, &StageOptions::default(), &small(4)), render_scene(&foggy, &without, &small(4))] {
        assert_eq!(bits(&clear), bits(&other));
        assert_eq!(clear.stats.rays, other.stats.rays);
    }
    let fogged = render_scene(&foggy, &StageOptions::default(), &small(4));
    assert!(fogged.stats.rays[RayKind::Fog] > 0 && fogged.effects.simulated().contains(EffectSet::FOG));
    assert_eq!(fogged.stats.bad_samples, 0);
    assert_ne!(bits(&clear), bits(&fogged));
    // Others leave it out, and say so.
    let whitted = RenderOptions { integrator: IntegratorChoice::Whitted, ..small(1) };
    let whitted = render_scene(&foggy, &StageOptions::default(), &whitted);
    assert!(whitted.effects.called_for().contains(EffectSet::FOG));
    assert!(!whitted.effects.simulated().contains(EffectSet::FOG));
}
