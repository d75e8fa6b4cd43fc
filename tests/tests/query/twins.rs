//! Against slow twins: brute force in f64 over the scene, and an oracle that shares no code with it.

use firsthit_accel::Geometry;
use firsthit_accel::{BuildError, SceneBuilder, reference};
use firsthit_geometry::{Precision, Ray, Shape, shapes::Sphere};
use firsthit_tests::oracle::{FlatScene, Mesh, Rng, icosphere, soup};
use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;

use crate::{options, triangles};

/// Rotation, non-uniform and negative scale, shear, anywhere; condition number at most about 1000.
fn affine(rng: &mut Rng) -> DAffine3 {
    let turn = DMat3::from_axis_angle(rng.direction(), rng.unit() * 6.0);
    let back = DMat3::from_axis_angle(rng.direction(), rng.unit() * 6.0);
    let stretch = DVec3::new(10f64.powf(rng.signed()), 10f64.powf(rng.signed()), 10f64.powf(rng.signed()));
    let mirror = DVec3::new(if rng.below(2) == 0 { -1.0 } else { 1.0 }, 1.0, 1.0);
    let size = 10f64.powf(rng.signed() * 3.0);
    DAffine3 {
        matrix3: turn * DMat3::from_diagonal(stretch * mirror * size) * back,
        translation: rng.in_cube() * size * 3.0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// S11: instances against the flattened mesh.
    #[test]
    fn instances_answer_as_the_flattened_mesh(seed in any::<u64>()) {
        let mut rng = Rng(seed);
        let mut builders = Precision::ALL.map(|p| SceneBuilder::new(options(p)));
        let mut flat = FlatScene::default();
        let common = affine(&mut rng);
        let mut mirrored = Vec::new();
        for i in 0..3u32 {
            let parts: Vec<Mesh> = (0..2).map(|_| soup(&mut rng, 20)).collect();
            let transform = common * affine(&mut rng);
            mirrored.push(transform.matrix3.determinant() < 0.0);
            for builder in &mut builders {
                let m = builder.add_mesh(parts.iter().map(triangles).collect());
                builder.add_instance(m, transform);
            }
            for (g, part) in parts.iter().enumerate() {
                flat.add(i, g as u32, part, transform);
            }
        }
        let scenes = builders.map(|b| b.build().expect("conditioned well enough"));
        let bounds = scenes[0].bounds();
        let (center, size) = (bounds.center(), bounds.extent().max_element());
        let mut clear_cases = 0;
        for _ in 0..200 {
            let origin = center + rng.in_cube() * size;
            let target = flat.triangles[rng.below(flat.triangles.len())].1.iter().sum::<DVec3>() / 3.0;
            let direction = target - origin + rng.in_cube() * size * 0.01;
            let (expected, clear) = flat.closest_hit(origin, direction, 1e-4);
            if !clear {
                continue;
            }
            clear_cases += 1;
            let ray = Ray::new(origin, direction);
            for (scene, precision) in scenes.iter().zip(Precision::ALL) {
                let hit = scene.closest_hit(&ray);
                prop_assert_eq!(hit.map(|h| [h.id.instance, h.id.geometry, h.id.primitive]), expected.map(|h| h.id), "{}", precision);
                prop_assert_eq!(scene.any_hit(&ray), expected.is_some());
                let (Some(h), Some(e)) = (hit, expected) else { continue };
                if precision != Precision::Fast {
                    // t is found in f64 at Robust too.
                    prop_assert!((h.t - e.t).abs() < 1e-9 * (1.0 + e.t) / e.cosine, "{} {} {}", precision, h.t, e.t);
                }
                let tolerance = 1e-3 / e.cosine;
                prop_assert!((f64::from(h.u) - e.uv.0).abs() < tolerance && (f64::from(h.v) - e.uv.1).abs() < tolerance);
                prop_assert!((h.normal().length() - 1.0).abs() < 1e-12);
                // The outside stays outside: against the flattened winding the normal turns where space is mirrored.
                let side = if mirrored[h.id.instance as usize] { -1.0 } else { 1.0 };
                prop_assert!((h.normal() * side - e.normal).length() < 1e-6, "{} {}", h.normal(), e.normal);
            }
        }
        prop_assert!(clear_cases > 50, "{}", clear_cases);
    }

    /// Shapes and triangles in one tree, against brute force over the scene.
    #[test]
    fn mixed_meshes_answer_as_brute_force(seed in any::<u64>()) {
        let mut rng = Rng(seed);
        for precision in [Precision::Robust, Precision::Double] {
            let mut builder = SceneBuilder::new(options(precision));
            for _ in 0..2 {
                let mut parts = vec![triangles(&soup(&mut rng, 10))];
                for _ in 0..5 {
                    let sphere = Sphere::new(rng.in_cube(), 0.05 + rng.unit() * 0.3).expect("a good sphere");
                    parts.push(Geometry::Shape(Shape::Sphere(sphere)));
                }
                let m = builder.add_mesh(parts);
                for _ in 0..2 {
                    builder.add_instance(m, affine(&mut rng));
                }
            }
            let scene = builder.build().expect("a good scene");
            let bounds = scene.bounds();
            for _ in 0..300 {
                let origin = bounds.center() + rng.in_cube() * bounds.extent();
                let direction = bounds.center() + rng.in_cube() * bounds.extent() * 0.3 - origin;
                let ray = Ray::new(origin, direction);
                let (hit, twin) = (scene.closest_hit(&ray), reference::closest_hit(&scene, &ray));
                if let (Some(h), Some(t)) = (&hit, &twin) {
                    if h.id != t.id {
                        // Only where the first two are too close to call.
                        let all = reference::all_hits(&scene, &ray);
                        prop_assert!(all.iter().any(|a| a.id == h.id && (a.t - t.t).abs() < 1e-6 * t.t));
                        continue;
                    }
                    prop_assert!((h.t - t.t).abs() <= 1e-9 * t.t.abs(), "{} {}", h.t, t.t);
                    prop_assert!(h.normal().dot(t.normal()) > 1.0 - 1e-9);
                }
                prop_assert_eq!(hit.is_some(), twin.is_some());
                prop_assert_eq!(scene.any_hit(&ray), hit.is_some());
            }
        }
    }
}

#[test]
fn ill_conditioned_instances_are_refused_by_name() {
    for (linear, good) in [
        (DMat3::from_diagonal(DVec3::new(1e-3, 1.0, 1e3)), true),
        (DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e7)), false),
        (DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)), false),
        (DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z), false),
        (DMat3::from_diagonal(DVec3::new(f64::INFINITY, 1.0, 1.0)), false),
    ] {
        let mut builder = SceneBuilder::default();
        let m = builder.add_mesh(vec![triangles(&icosphere(1))]);
        builder.add_instance(m, DAffine3::IDENTITY);
        builder.add_instance(m, DAffine3::from_mat3(linear));
        match builder.build() {
            Ok(_) => assert!(good),
            Err(e) => {
                assert!(!good);
                assert_eq!(e, BuildError::IllConditioned { instance: 1 });
            }
        }
    }
}

#[test]
fn bounds_hold_what_is_seen() {
    let mut builder = SceneBuilder::default();
    let m = builder.add_mesh(vec![triangles(&icosphere(3))]);
    builder.add_instance(m, DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0)));
    let s = builder.add_mesh(vec![Geometry::Shape(Shape::Sphere(Sphere::new(DVec3::ZERO, 2.0).expect("good")))]);
    builder.add_instance(s, DAffine3::from_scale(DVec3::new(1.0, 3.0, 1.0)));
    let scene = builder.build().expect("a good scene");
    let b = scene.bounds();
    assert!((b.min - DVec3::new(-2.0, -6.0, -2.0)).abs().max_element() < 1e-5, "{b:?}");
    assert!((b.max - DVec3::new(6.0, 6.0, 2.0)).abs().max_element() < 2e-2, "{b:?}");
    let stats = scene.stats();
    assert_eq!((stats.stored_triangles, stats.instanced_triangles, stats.instances), (1280, 1280, 2));
    assert!(stats.depth > 3 && stats.depth < 40 && stats.bytes > 1280 * 36 && stats.sah_cost > 1.0);
    assert!(SceneBuilder::default().build().expect("nothing is a scene").bounds().is_empty());
}

/// S11, S14 and S15 by the scenarios.
#[test]
fn instances_invalid_rays_and_overlapping_faces() {
    crate::holds("S11", 5_000);
    crate::holds("S14", 30_000);
    crate::holds("S15", 2_000);
}
