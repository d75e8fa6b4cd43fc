//! Rays of all lengths and intervals; invalid ones; batches.

use firsthit_accel::{Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Mesh, Rng, icosphere};
use glam::{DAffine3, DVec3, Vec3};

use crate::{bits, options, scene_of, triangles};

/// The square `z = 0`, `|x|, |y| <= 1`.
fn square(precision: Precision) -> Scene {
    let mesh = Mesh {
        positions: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    scene_of(&mesh, DAffine3::IDENTITY, precision)
}

#[test]
fn directions_of_any_length() {
    for precision in Precision::ALL {
        let scene = square(precision);
        for exponent in -30..=30 {
            let length = 10f64.powi(exponent);
            let ray = Ray::new(DVec3::new(0.3, 0.2, 2.0), DVec3::NEG_Z * length);
            let hit = scene.closest_hit(&ray).expect("ahead");
            let digits = if precision == Precision::Fast { 1e-6 } else { 4e-15 };
            assert!((hit.t * length - 2.0).abs() < digits, "{precision} {length} {}", hit.t);
            let oblique = Ray::new(DVec3::new(0.3, 0.2, 2.0), DVec3::new(0.1, -0.3, -2.0) * length);
            assert!((scene.closest_hit(&oblique).expect("ahead").t * length - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn the_interval_is_closed_and_may_be_negative() {
    for precision in Precision::ALL {
        let scene = square(precision);
        let ray = Ray::new(DVec3::new(0.3, 0.2, 2.0), DVec3::NEG_Z);
        for (t_min, t_max, expected) in [
            (0.0, 2.0, true),
            (2.0, 2.0, true),
            (2.0, 9.0, true),
            (0.0, 2.0f64.next_down(), false),
            (2.0f64.next_up(), 9.0, false),
            (f64::NEG_INFINITY, f64::INFINITY, true),
            (f64::NEG_INFINITY, 1.0, false),
        ] {
            let r = ray.with_interval(t_min, t_max);
            assert_eq!(scene.closest_hit(&r).is_some(), expected, "{precision} [{t_min}, {t_max}]");
            assert_eq!(scene.any_hit(&r), expected);
        }
        // Backwards along a line.
        let away = Ray::new(DVec3::new(0.3, 0.2, 2.0), DVec3::Z).with_interval(f64::NEG_INFINITY, 0.0);
        assert_eq!(scene.closest_hit(&away).map(|h| h.t), Some(-2.0));
        assert_eq!(scene.closest_hit(&away.with_interval(-2.0, -2.0)).map(|h| h.t), Some(-2.0));
        assert!(scene.closest_hit(&away.with_interval(-1.9, 5.0)).is_none());
    }
}

#[test]
fn invalid_rays_hit_nothing_and_disturb_nobody() {
    let scene = scene_of(&icosphere(3), DAffine3::IDENTITY, Precision::Robust);
    let mut rng = Rng(3);
    let good: Vec<Ray<f64>> = (0..3000).map(|_| Ray::new(rng.in_cube() * 2.0, rng.direction())).collect();
    let spoil = |k: usize, mut r: Ray<f64>| {
        match k % 8 {
            0 => r.origin.x = f64::NAN,
            1 => r.origin.y = f64::INFINITY,
            2 => r.direction = DVec3::ZERO,
            3 => r.direction.z = f64::NAN,
            4 => r.direction.x = f64::NEG_INFINITY,
            5 => (r.t_min, r.t_max) = (1.0, 0.0),
            6 => r.t_min = f64::NAN,
            _ => r.t_max = f64::NAN,
        }
        r
    };
    let mixed: Vec<Ray<f64>> =
        good.iter().enumerate().map(|(k, &r)| if k % 3 == 0 { spoil(k / 3, r) } else { r }).collect();
    let mut expected = vec![None; good.len()];
    scene.closest_hits(&good, &mut expected);
    let mut got = vec![None; good.len()];
    scene.closest_hits(&mixed, &mut got);
    for (k, (e, g)) in expected.iter().zip(&got).enumerate() {
        assert_eq!(if k % 3 == 0 { &None } else { e }, g, "{k}");
    }
    for r in mixed.iter().step_by(3) {
        assert!(!scene.any_hit(r) && firsthit_accel::reference::closest_hit(&scene, r).is_none());
    }
}

#[test]
fn batches_give_the_bits_of_single_rays_on_any_number_of_threads() {
    let mut builder = SceneBuilder::new(options(Precision::Robust));
    let mesh = builder.add_mesh(vec![triangles(&icosphere(4))]);
    let mut rng = Rng(5);
    for _ in 0..20 {
        builder.add_instance(
            mesh,
            DAffine3::from_scale_rotation_translation(
                DVec3::ONE + rng.in_cube() * 0.5,
                glam::DQuat::from_axis_angle(rng.direction(), 1.0),
                rng.in_cube() * 3.0,
            ),
        );
    }
    let scene = builder.build().expect("a good scene");
    let rays: Vec<Ray<f64>> = (0..20_000).map(|_| Ray::new(rng.in_cube() * 5.0, rng.direction())).collect();
    let single: Vec<_> = rays.iter().map(|r| bits(&scene.closest_hit(r))).collect();
    let any: Vec<bool> = rays.iter().map(|r| scene.any_hit(r)).collect();
    assert!(any.iter().filter(|&&a| a).count() > 1000);
    for (one, closest) in any.iter().zip(&single) {
        assert_eq!(*one, closest.is_some());
    }
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut hits = vec![None; rays.len()];
        let mut shadows = vec![false; rays.len()];
        pool.install(|| {
            scene.par_closest_hits(&rays, &mut hits);
            scene.par_any_hits(&rays, &mut shadows);
        });
        assert!(hits.iter().map(bits).eq(single.iter().copied()), "{threads} threads");
        assert_eq!(shadows, any);
    }
}

#[test]
fn scenes_are_shared_between_threads() {
    fn shared<T: Send + Sync + Clone>() {}
    shared::<Scene>();
}

#[test]
fn a_filter_that_refuses_is_asked_about_every_hit_once() {
    let mesh = icosphere(3);
    for precision in Precision::ALL {
        let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
        let mut rng = Rng(11);
        for _ in 0..500 {
            let ray = Ray::new(rng.direction() * 3.0, DVec3::ZERO);
            let ray = Ray { direction: rng.in_cube() * 0.5 - ray.origin, ..ray };
            let mut asked = Vec::new();
            assert!(!scene.any_hit_filtered(&ray, None, |h| {
                asked.push((h.id, h.t.to_bits()));
                false
            }));
            asked.sort_unstable();
            let mut expected: Vec<_> = firsthit_accel::reference::all_hits(&scene, &ray).iter().map(|h| h.id).collect();
            expected.sort_unstable();
            assert_eq!(asked.iter().map(|a| a.0).collect::<Vec<_>>(), expected, "{precision}");
        }
    }
}

#[test]
fn counts_tell_the_cost_and_change_no_answer() {
    let scene = scene_of(&icosphere(5), DAffine3::IDENTITY, Precision::Robust);
    let mut rng = Rng(12);
    let mut tested = 0;
    for _ in 0..1000 {
        let ray = Ray::new(rng.in_cube(), rng.direction());
        let (hit, counts) = scene.closest_hit_counted(&ray);
        assert_eq!(bits(&hit), bits(&scene.closest_hit(&ray)));
        tested += u64::from(counts.primitives);
    }
    // 20480 triangles; a tree worth its name tests a handful.
    assert!(tested < 1000 * 60, "{tested}");
}
