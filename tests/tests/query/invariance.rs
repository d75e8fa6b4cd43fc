//! Answers depend on the scene alone: not on order, tree, scale by powers of two, or place.

use firsthit_accel::{BuildOptions, BuildQuality, Crossings, Hit, Layout, Level, Scene, SceneBuilder, VisitOrder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Aim, Mesh, Rng, grid_cube, icosphere, read_obj};
use glam::{DAffine3, DVec3, Vec3};

use crate::{bits, careful, scene_of, triangles};

/// Rays at vertices, edges and faces, from around and inside.
fn aimed(mesh: &Mesh, count: usize) -> Vec<Ray<f64>> {
    let mut rng = Rng(21);
    let size = mesh.positions.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
    (0..count)
        .map(|k| {
            let target = Aim::ALL[k % 3].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
            let origin = rng.in_cube() * f64::from(size) * if k % 2 == 0 { 0.5 } else { 30.0 };
            Ray::new(origin, target - origin)
        })
        .collect()
}

fn same_in_any_order(scene: &Scene, rays: &[Ray<f64>], name: &str) {
    for ray in rays {
        let near = scene.closest_hit_in_order(ray, VisitOrder::NearFirst);
        for order in [VisitOrder::FarFirst, VisitOrder::Exhaustive] {
            let other = scene.closest_hit_in_order(ray, order);
            assert_eq!(bits(&near), bits(&other), "{name}: {order:?} {ray:?}");
        }
    }
}

#[test]
fn order_of_visits_and_boxes_change_nothing() {
    for precision in careful() {
        for (name, mesh) in [("icosphere", icosphere(4)), ("grid", grid_cube(12))] {
            let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
            same_in_any_order(&scene, &aimed(&mesh, 3000), name);
        }
    }
}

#[test]
fn order_of_visits_and_boxes_change_nothing_on_scans() {
    let Some(shared) = firsthit_tests::shared() else { return };
    for (name, count) in
        [("spot/spot.obj", 3000), ("stanford-bunny/stanford-bunny.obj", 300), ("sibenik/sibenik.obj", 300)]
    {
        let mesh = read_obj(&shared.join("assets").join(name)).expect(name);
        for precision in careful() {
            same_in_any_order(&scene_of(&mesh, DAffine3::IDENTITY, precision), &aimed(&mesh, count), name);
        }
    }
}

#[test]
fn overlapping_instances_in_any_order() {
    // The same sphere many times at the same place and nearly so: ties between instances.
    let mesh = icosphere(2);
    for precision in careful() {
        let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
        let m = builder.add_mesh(vec![triangles(&mesh)]);
        for k in 0..30 {
            builder.add_instance(m, DAffine3::from_translation(DVec3::X * f64::from(k / 3) * 0.1));
        }
        let scene = builder.build().expect("a good scene");
        let rays = aimed(&mesh, 2000);
        same_in_any_order(&scene, &rays, "instances");
        for ray in &rays {
            // Of three equal instances the first is reported.
            assert!(scene.closest_hit(ray).is_none_or(|h| h.id.instance % 3 == 0));
        }
    }
}

#[test]
fn trees_of_any_quality_answer_alike() {
    let mesh = icosphere(4);
    let rays = aimed(&mesh, 10_000);
    for precision in careful() {
        let answers = [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::High].map(|quality| {
            let mut builder = SceneBuilder::new(BuildOptions { precision, quality, ..BuildOptions::default() });
            let m = builder.add_mesh(vec![triangles(&mesh)]);
            builder.add_instance(m, DAffine3::from_rotation_y(0.3));
            let scene = builder.build().expect("a good mesh");
            rays.iter().map(|r| bits(&scene.closest_hit(r))).collect::<Vec<_>>()
        });
        assert!(answers[0] == answers[1] && answers[1] == answers[2], "{precision}");
    }
}

/// S3: scaling by a power of two scales t alone, or nothing if the direction is scaled too.
/// Neither the memory layout nor the instructions used change a bit, of any query.
#[test]
fn layouts_and_instructions_answer_alike() {
    let scan = firsthit_tests::shared().and_then(|s| read_obj(&s.join("assets/spot/spot.obj")));
    let meshes = [Some(icosphere(4)), Some(grid_cube(12)), scan];
    for mesh in meshes.iter().flatten() {
        let rays = aimed(mesh, 3000);
        for precision in careful() {
            let answers = |layout, simd, instances| {
                let mut builder =
                    SceneBuilder::new(BuildOptions { layout, simd, precision, ..BuildOptions::default() });
                let m = builder.add_mesh(vec![triangles(mesh)]);
                builder.add_instance(m, DAffine3::IDENTITY);
                if instances > 1 {
                    builder.add_instance(m, DAffine3::from_scale(DVec3::splat(0.7)));
                }
                let scene = builder.build().expect("a good mesh");
                let answer = |r: &Ray<f64>| {
                    let line = r.with_interval(f64::NEG_INFINITY, f64::INFINITY);
                    let lists: Vec<_> = [Crossings::Triangles, Crossings::Surfaces]
                        .into_iter()
                        .flat_map(|c| scene.all_hits(&line, c))
                        .map(|h| bits(&Some(h)))
                        .collect();
                    (bits(&scene.closest_hit(r)), scene.any_hit(r), bits(&scene.closest_hit(&line)), lists)
                };
                rays.iter().map(answer).collect::<Vec<_>>()
            };
            for instances in [1, 2] {
                let first = answers(Layout::Bvh2, Level::Scalar, instances);
                for layout in [Layout::Wide8, Layout::Compact8] {
                    for level in Level::ALL {
                        let same = answers(layout, level, instances) == first;
                        assert!(same, "{precision} {layout:?} {level}, {instances}");
                    }
                }
            }
        }
    }
}

#[test]
fn powers_of_two_change_no_bit() {
    let mesh = icosphere(3);
    let rays = aimed(&mesh, 2000);
    for precision in careful().chain([Precision::Fast]) {
        let plain = scene_of(&mesh, DAffine3::IDENTITY, precision);
        for exponent in [-60, -20, -1, 1, 20, 60] {
            let s = 2f64.powi(exponent);
            let baked = scene_of(&mesh.clone().map(|p| p * s as f32), DAffine3::IDENTITY, precision);
            let placed = scene_of(&mesh, DAffine3::from_scale(DVec3::splat(s)), precision);
            for ray in &rays {
                let expected = plain.closest_hit(ray);
                let both = Ray::new(ray.origin * s, ray.direction * s);
                let kept = Ray::new(ray.origin * s, ray.direction);
                let stretched = expected.map(|h| Hit { t: h.t * s, ..h });
                for scene in [&baked, &placed] {
                    assert_eq!(bits(&scene.closest_hit(&both)), bits(&expected), "{precision} 2^{exponent}");
                    assert_eq!(bits(&scene.closest_hit(&kept)), bits(&stretched), "{precision} 2^{exponent}");
                    for what in [Crossings::Surfaces, Crossings::Triangles] {
                        assert_eq!(scene.all_hits(&both, what), plain.all_hits(ray, what), "{precision} 2^{exponent}");
                        assert_eq!(scene.count_hits(&kept, what), plain.count_hits(ray, what));
                    }
                }
            }
        }
    }
}

/// A model far away answers as at the origin: what is rounded is the world's f64, nothing else.
#[test]
fn ten_million_units_away() {
    let mesh = icosphere(4);
    let offset = DVec3::new(1e7, -1e7, 1e7);
    for precision in careful() {
        let here = scene_of(&mesh, DAffine3::IDENTITY, precision);
        let there = scene_of(&mesh, DAffine3::from_translation(offset), precision);
        let mut rng = Rng(31);
        let mut hits = 0;
        for _ in 0..20_000 {
            // An origin that the offset does not round.
            let origin = (rng.in_cube() * 3.0 * 65536.0).round() / 65536.0;
            let direction = rng.direction();
            let a = here.closest_hit(&Ray::new(origin, direction));
            let b = there.closest_hit(&Ray::new(origin + offset, direction));
            assert_eq!(bits(&a), bits(&b));
            hits += usize::from(a.is_some());
        }
        assert!(hits > 1000);
    }
}

/// Rays from far away lose no digit in the object: an eye a million sizes off sees what one nearby sees.
#[test]
fn an_origin_far_outside() {
    let mesh = Mesh {
        positions: vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
        triangles: vec![[0, 1, 2]],
    };
    for precision in careful() {
        let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
        let mut rng = Rng(41);
        for _ in 0..2000 {
            let target = DVec3::new(rng.signed() * 0.2, rng.signed() * 0.2, 0.0);
            let direction = DVec3::new(rng.signed() * 0.5, rng.signed() * 0.5, -1.0);
            let origin = target - direction * 1e6;
            let hit = scene.closest_hit(&Ray::new(origin, direction)).expect("aimed inside");
            assert!((hit.t - 1e6).abs() < 1e-8, "{precision} {}", hit.t);
            // u + v / 2 ... by where it was aimed: v is the height over the base, u follows.
            let v = (target.y + 1.0) / 2.0;
            let u = (target.x + 1.0 - v) / 2.0;
            assert!((f64::from(hit.u) - u).abs() < 2e-6 && (f64::from(hit.v) - v).abs() < 2e-6, "{precision}");
        }
    }
}

/// S3 and S13: scaled, moved, rounded again, built again, on other threads.
#[test]
fn scale_place_threads_and_builds_change_no_answer() {
    crate::holds("S3", 8_000);
    crate::holds("S13", 20_000);
}
