//! The exact tier against exact brute force, and the others against the exact tier.

use firsthit_accel::{Crossings, Geometry, Hit, Scene, SceneBuilder, reference};
use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Precision, Ray, Shape};
use firsthit_tests::oracle::{Aim, Mesh, Rng, grid_cube, icosphere, torus};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use crate::{options, scene_of, triangles};

/// What is compared bit for bit.
fn key(hit: &Hit) -> (u32, u32, u32, u64) {
    (hit.id.instance, hit.id.geometry, hit.id.primitive, hit.t.to_bits())
}

fn same_as_brute_force(scene: &Scene, ray: &Ray<f64>) {
    for what in [Crossings::Triangles, Crossings::Surfaces] {
        let (hits, twin) = (scene.all_hits(ray, what), reference::exact_crossings(scene, ray, what));
        assert_eq!(hits.iter().map(key).collect::<Vec<_>>(), twin.iter().map(key).collect::<Vec<_>>(), "{ray:?}");
        assert_eq!(scene.count_hits(ray, what) as usize, twin.len());
    }
    let twin = reference::exact_crossings(scene, ray, Crossings::Triangles);
    assert_eq!(scene.closest_hit(ray).as_ref().map(key), twin.first().map(key), "{ray:?}");
    assert_eq!(scene.any_hit(ray), !twin.is_empty());
    assert_eq!(scene.closest_hit_counted(ray).0, scene.closest_hit(ray));
}

/// Long and short triangles, many of them degenerate or coplanar.
fn soup(rng: &mut Rng, lattice: Option<f64>) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..60 {
        let (center, size) = (rng.in_cube(), 0.05 + rng.unit());
        mesh.positions.extend((0..3).map(|_| {
            let p = center + rng.in_cube() * size;
            lattice.map_or(p, |n| (p * n).round() / n).as_vec3()
        }));
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    mesh
}

#[test]
fn scenes_answer_as_exact_brute_force() {
    let mut rng = Rng(91);
    let turned = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let places = [
        DAffine3::IDENTITY,
        DAffine3::from_translation(DVec3::new(1e7, 1e7, -1e7)),
        DAffine3::from_scale_rotation_translation(DVec3::new(-1.0, 2e-3, 0.5), turned, DVec3::splat(7.0)),
    ];
    for round in 0..8 {
        let meshes =
            [soup(&mut rng, None), soup(&mut rng, Some(3.0)), soup(&mut rng, Some(4.0)), grid_cube(3), icosphere(2)];
        for (mesh, place) in meshes.iter().flat_map(|m| places.map(|p| (m, p))) {
            let scene = scene_of(mesh, place, Precision::Exact);
            for k in 0..30 {
                let target = Aim::ALL[k % 3].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
                // Near, on the lattice, and so far that boxes are far smaller than the rounding of the origin.
                let origin = match k % 4 {
                    0 => rng.in_cube() * 3.0,
                    1 => (rng.in_cube() * 8.0).round() / 4.0,
                    2 => rng.in_cube() * 1e5,
                    _ => rng.in_cube() * 1e14,
                };
                let (origin, target) = (place.transform_point3(origin), place.transform_point3(target));
                let ray = Ray::new(origin, target - origin);
                if ray.is_valid() {
                    same_as_brute_force(&scene, &ray);
                    same_as_brute_force(&scene, &ray.with_interval(f64::NEG_INFINITY, 1.0));
                }
                let axis = Ray::new((target * 4.0).round() / 4.0, [DVec3::X, DVec3::NEG_Y, DVec3::Z][(k + round) % 3]);
                same_as_brute_force(&scene, &axis.with_interval(f64::NEG_INFINITY, f64::INFINITY));
            }
        }
    }
}

/// Several instances on each other: across them the rounded t decides, then the id.
#[test]
fn instances_answer_as_exact_brute_force() {
    let mut rng = Rng(92);
    let mesh = soup(&mut rng, Some(3.0));
    let mut builder = SceneBuilder::new(options(Precision::Exact));
    let m = builder.add_mesh(vec![triangles(&mesh), triangles(&icosphere(1))]);
    for k in 0..6 {
        builder.add_instance(m, DAffine3::from_translation(DVec3::X * f64::from(k / 2) * 0.5));
    }
    let scene = builder.build().expect("a good scene");
    for k in 0..2000 {
        let target = Aim::ALL[k % 3].point(mesh.corners(rng.below(60)), &mut rng);
        let origin = rng.in_cube() * 4.0;
        same_as_brute_force(&scene, &Ray::new(origin, target - origin));
    }
}

/// Shapes and triangles together, touching each other along lattice points: what is nearest, in which order, what counts
/// as a crossing.
#[test]
fn shapes_answer_as_exact_brute_force() {
    let mut rng = Rng(94);
    let can = Quadric::cylinder(1.0, -1.0, 1.0).expect("a cylinder");
    let shapes: Vec<Shape<f64>> = vec![
        Sphere::new(DVec3::ZERO, 1.0).expect("a sphere").into(),
        Sphere::new(DVec3::X, 1.0).expect("a sphere").into(),
        Cuboid::new(DVec3::splat(-1.0), DVec3::ONE).expect("a box").into(),
        Disk::new(DVec3::Y, DVec3::Y, 1.0, 0.5).expect("a disk").into(),
        Plane::new(DVec3::NEG_Y, DVec3::new(0.0, 1.0, 0.0)).expect("a plane").into(),
        Polygon::new(vec![vec![DVec3::NEG_X, DVec3::X, DVec3::new(0.0, 2.0, 1.0)]]).expect("a triangle").into(),
        can.into(),
        Solid::new(can).into(),
        Solid::new(Quadric::cone(1.0, -1.0, 1.0).expect("a cone")).into(),
    ];
    let turned = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let places = [
        DAffine3::IDENTITY,
        DAffine3::from_translation(DVec3::new(1e7, 1e7, -1e7)),
        DAffine3::from_scale_rotation_translation(DVec3::new(-1.0, 2e-3, 0.5), turned, DVec3::splat(7.0)),
    ];
    for place in places {
        let mut builder = SceneBuilder::new(options(Precision::Exact));
        let together = shapes.iter().cloned().map(Geometry::Shape).chain([triangles(&grid_cube(2))]).collect();
        let all = builder.add_mesh(together);
        builder.add_instance(all, place);
        for shape in &shapes {
            let alone = builder.add_mesh(vec![Geometry::Shape(shape.clone())]);
            builder.add_instance(alone, place);
        }
        let scene = builder.build().expect("a good scene");
        for k in 0..800 {
            let lattice = |p: DVec3| (p * 4.0).round() / 2.0;
            let origin = match k % 4 {
                0 => rng.in_cube() * 3.0,
                1 => lattice(rng.in_cube() * 2.0),
                2 => lattice(rng.in_cube()) * 1024.0,
                _ => rng.in_cube() * 1e9,
            };
            let target = if k % 3 == 0 { rng.in_cube() } else { lattice(rng.in_cube() * 0.75) };
            let (origin, target) = (place.transform_point3(origin), place.transform_point3(target));
            let ray = Ray::new(origin, target - origin);
            if ray.is_valid() {
                same_as_brute_force(&scene, &ray);
                same_as_brute_force(&scene, &ray.with_interval(f64::NEG_INFINITY, 1.0));
            }
        }
    }
}

/// Coordinates so far apart that dividing by the largest would lose the small ones.
#[test]
fn no_digit_is_lost_in_a_mesh_of_all_sizes() {
    let mut mesh = icosphere(1).map(|p| p * 1e-30);
    for k in 1..60 {
        let big = icosphere(0).map(|p| p * 10f32.powi(k - 30));
        let first = mesh.positions.len() as u32;
        mesh.triangles.extend(big.triangles.iter().map(|t| t.map(|i| i + first)));
        mesh.positions.extend(big.positions);
    }
    let scene = scene_of(&mesh, DAffine3::IDENTITY, Precision::Exact);
    let mut rng = Rng(93);
    for _ in 0..200 {
        let ray = Ray::new(rng.in_cube() * 1e-31, rng.direction());
        let hits = scene.all_hits(&ray, Crossings::Surfaces);
        assert_eq!(hits.len(), 60);
        assert!(hits.is_sorted_by(|a, b| a.t < b.t) && hits[0].t < 2e-30);
        same_as_brute_force(&scene, &ray);
        // Each t is that of the plane, to the last digit but a few.
        for hit in &hits {
            let [a, b, c] = mesh.corners(hit.id.primitive as usize).map(|p| p / hit.t);
            let n = (b - a).cross(c - a);
            let t = n.dot(a - ray.origin / hit.t) / n.dot(ray.direction);
            assert!((t - 1.0).abs() < 1e-13, "{t}");
        }
    }
}

/// Of two surfaces closer to each other than `t` can tell, the exact order decides, not the id.
#[test]
fn the_exact_order_decides_where_t_is_equal() {
    // Two parallel planes 2^-23 apart, seen from 2^40 away: t is the same.
    let wall = |z: f32| [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
    let positions = [wall(0.5f32.next_down()), wall(0.5)].concat();
    let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [3, 4, 5]] };
    let scene = scene_of(&mesh, DAffine3::IDENTITY, Precision::Exact);
    let far = 2f64.powi(40);
    for (sign, order) in [(1.0, [1, 0]), (-1.0, [0, 1])] {
        let ray = Ray::new(DVec3::new(0.0, 0.0, sign * far), DVec3::Z * -sign);
        let hits = scene.all_hits(&ray, Crossings::Triangles);
        assert_eq!(hits[0].t, hits[1].t);
        assert_eq!([hits[0].id.primitive, hits[1].id.primitive], order);
        assert_eq!(scene.closest_hit(&ray).map(|h| h.id.primitive), Some(order[0]));
    }
}

#[test]
fn fallbacks_are_counted() {
    let mesh = grid_cube(4);
    let scene = scene_of(&mesh, DAffine3::IDENTITY, Precision::Exact);
    let fallbacks = |ray: &Ray<f64>| scene.closest_hit_counted(ray).1.fallbacks;
    assert!(fallbacks(&Ray::new(DVec3::ZERO, DVec3::X)) > 0, "through a vertex");
    assert_eq!(fallbacks(&Ray::new(DVec3::ZERO, DVec3::new(1.0, 0.123, 0.2))), 0);
}

/// What is not flagged as decided at an edge, the exact test hits too.
#[test]
fn edge_decided_flags_every_close_call() {
    let mesh = torus(48, 24, 0.4);
    for place in [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::splat(1e6)) * DAffine3::from_rotation_x(0.7)] {
        for precision in [Precision::Robust, Precision::Double] {
            let scene = scene_of(&mesh, place, precision);
            let mut rng = Rng(94);
            let mut flagged = [0; 3];
            for k in 0..6000 {
                let target = Aim::ALL[k % 3].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
                let origin = place.transform_point3(rng.in_cube() * if k % 2 == 0 { 3.0 } else { 1e4 });
                let ray = Ray::new(origin, place.transform_point3(target) - origin);
                let exact = reference::exact_crossings(&scene, &ray, Crossings::Triangles);
                for hit in scene.all_hits(&ray, Crossings::Triangles) {
                    if scene.edge_decided(&ray, &hit) {
                        flagged[k % 3] += 1;
                    } else {
                        assert!(exact.iter().any(|e| e.id == hit.id), "{precision} {ray:?} {hit:?}");
                    }
                }
            }
            // Vertices, edges, faces.
            assert!(flagged[0] > 100 && flagged[1] > 100 && flagged[2] < 20, "{precision} {flagged:?}");
        }
    }
    let exact = scene_of(&mesh, DAffine3::IDENTITY, Precision::Exact);
    let ray = Ray::new(DVec3::new(1.0, 0.0, 3.0), DVec3::NEG_Z);
    let hit = exact.closest_hit(&ray).expect("the top of the tube");
    assert!(!exact.edge_decided(&ray, &hit));
}

/// Off the edges the tiers agree on every hit, and t to their rounding.
#[test]
fn other_tiers_agree_off_the_edges() {
    let mesh = torus(48, 24, 0.4);
    let exact = scene_of(&mesh, DAffine3::IDENTITY, Precision::Exact);
    for precision in [Precision::Robust, Precision::Double] {
        let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
        let mut rng = Rng(95);
        for _ in 0..5000 {
            let ray = Ray::new(rng.in_cube() * 2.0, rng.direction());
            let (hits, truth) = [&scene, &exact].map(|s| s.all_hits(&ray, Crossings::Triangles)).into();
            if hits.iter().any(|h| scene.edge_decided(&ray, h)) {
                continue;
            }
            assert_eq!(hits.iter().map(|h| h.id).collect::<Vec<_>>(), truth.iter().map(|h| h.id).collect::<Vec<_>>());
            assert!(hits.iter().zip(&truth).all(|(h, t)| {
                let cosine = h.normal().dot(ray.direction).abs();
                (h.t - t.t).abs() <= 1e-14 / cosine
            }));
        }
    }
}
