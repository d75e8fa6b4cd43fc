//! Every hit, counted by triangles and by surfaces.

use firsthit_accel::{Crossings, Geometry, Hit, SceneBuilder, reference};
use firsthit_geometry::{Precision, Ray, Shape, shapes::Sphere};
use firsthit_tests::oracle::{Aim, Mesh, Rng, grid_cube, icosphere, torus};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use crate::{bits, careful, options, scene_of, triangles};

fn line(ray: Ray<f64>) -> Ray<f64> {
    ray.with_interval(f64::NEG_INFINITY, f64::INFINITY)
}

fn places() -> [DAffine3; 7] {
    let turned = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    [
        DAffine3::IDENTITY,
        DAffine3::from_scale(DVec3::splat(1e-6)),
        DAffine3::from_translation(DVec3::new(1e7, 1e7, -1e7)),
        DAffine3::from_scale_rotation_translation(DVec3::splat(1e-3), turned, DVec3::splat(1e5)),
        DAffine3::from_scale_rotation_translation(DVec3::new(1e-2, 1.0, 1e2), turned, DVec3::ZERO),
        DAffine3::from_scale_rotation_translation(DVec3::new(-1.0, 2.0, 0.5), turned, DVec3::splat(-1e6)),
        DAffine3::from_mat3(glam::DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(-0.3, 0.4, 1.0))),
    ]
}

/// Picks a point inside a mesh.
type Inside = fn(&mut Rng) -> DVec3;

/// Aimed at vertices, edges and faces: lines are even, rays from inside odd, rays from outside even.
#[test]
fn closed_meshes_have_exact_parity() {
    let near_middle = |rng: &mut Rng| rng.in_cube() * 0.4;
    let in_tube = |rng: &mut Rng| {
        let a = rng.unit() * std::f64::consts::TAU;
        DVec3::new(a.cos(), a.sin(), 0.0) + rng.in_cube() * 0.1
    };
    let meshes: [(Mesh, Inside); 3] =
        [(icosphere(4), near_middle), (grid_cube(8), near_middle), (torus(48, 24, 0.4), in_tube)];
    let mut odd = 0;
    for (mesh, inside) in &meshes {
        for place in places() {
            for precision in careful() {
                let scene = scene_of(mesh, place, precision);
                let mut rng = Rng(81);
                for k in 0..3000 {
                    let target = Aim::ALL[k % 3].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
                    let target = place.transform_point3(target);
                    let from = |p: DVec3| Ray::new(p, target - p);
                    let within = from(place.transform_point3(inside(&mut rng)));
                    let outside = from(place.transform_point3(rng.direction() * 3.0));
                    let count = |ray: &Ray<f64>| scene.count_hits(ray, Crossings::Surfaces);
                    assert_eq!(count(&within) % 2, 1, "{precision} {place:?} {within:?}");
                    assert_eq!(count(&line(within)) % 2, 0, "{precision} {place:?} {within:?}");
                    let hits = scene.all_hits(&outside, Crossings::Surfaces);
                    let enter = hits.iter().filter(|h| scene.enters(&outside, h)).count();
                    assert_eq!(2 * enter, hits.len(), "{precision} {place:?} {outside:?}");
                    let toward = outside.direction.normalize();
                    for h in hits.iter().filter(|h| h.normal().dot(toward).abs() > 1e-3) {
                        assert_eq!(scene.enters(&outside, h), h.normal().dot(toward) < 0.0, "{precision} {place:?}");
                    }
                    odd += scene.count_hits(&line(within), Crossings::Triangles) % 2;
                }
            }
        }
    }
    assert!(odd > 0, "the triangles' count would not tell");
}

/// Through vertices and along edges of a grid, nothing rounded: each line crosses the cube twice, or not at all where
/// it runs in a side.
#[test]
fn axis_parallel_lines_on_a_grid_have_exact_parity() {
    let n = 8;
    let mesh = grid_cube(n);
    for precision in careful() {
        let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for (i, j) in (0..=4 * n).flat_map(|i| (0..=4 * n).map(move |j| (i, j))) {
                    let place = |k: u32| f64::from(k) / f64::from(2 * n) - 1.0;
                    let (mut origin, mut direction) = ([0.0; 3], [0.0; 3]);
                    (origin[(axis + 1) % 3], origin[(axis + 2) % 3]) = (place(i), place(j));
                    direction[axis] = side * 0.25;
                    let ray = Ray::new(DVec3::from(origin), DVec3::from(direction));
                    let ahead = scene.count_hits(&ray, Crossings::Surfaces);
                    let all = scene.count_hits(&line(ray), Crossings::Surfaces);
                    if i % (4 * n) == 0 || j % (4 * n) == 0 {
                        assert!(all == 0 || all == 2, "{precision} {ray:?}: {all}");
                    } else {
                        assert_eq!((ahead, all), (1, 2), "{precision} {ray:?}");
                        let hits = scene.all_hits(&line(ray), Crossings::Surfaces);
                        assert_eq!([hits[0].t, hits[1].t], [-4.0, 4.0]);
                    }
                    // In the plane of an edge and along it: from a vertex towards its neighbours.
                    let oblique = DVec3::from(direction) + DVec3::from(origin) * 0.125;
                    let ray = line(Ray::new(DVec3::ZERO, oblique));
                    assert_eq!(scene.count_hits(&ray, Crossings::Surfaces) % 2, 0, "{precision} {ray:?}");
                }
            }
        }
    }
}

/// Triangles whose vertices lie in a line close the gaps that rounding opens between their neighbours.
#[test]
fn parity_holds_with_triangles_of_no_area() {
    // A tetrahedron whose edge 0 1 is split on one side only: the sliver 0 1 m fills the seam.
    let p = [[0.1, 0.2, 0.3], [0.7, 0.5, 0.9], [-0.8, 0.3, -0.2], [0.1, -0.9, 0.4]].map(Vec3::from);
    let mut rng = Rng(82);
    for precision in careful() {
        for _ in 0..50 {
            // Coordinates of few digits, so that the middle is exact.
            let p = p.map(|p| ((p + rng.in_cube().as_vec3() * 0.1) * 4096.0).round() / 2048.0);
            let middle = (p[0] + p[1]) / 2.0;
            let mesh = Mesh {
                positions: vec![p[0], p[1], p[2], p[3], middle],
                triangles: vec![[0, 1, 2], [0, 4, 3], [4, 1, 3], [0, 3, 2], [1, 2, 3], [1, 0, 4]],
            };
            let scene = scene_of(&mesh, DAffine3::from_rotation_y(0.3), precision);
            assert_eq!(scene.stats().degenerate_triangles, 1);
            let turn = DAffine3::from_rotation_y(0.3);
            for _ in 0..400 {
                let on_edge = p[0].as_dvec3().lerp(p[1].as_dvec3(), rng.unit());
                let origin = rng.direction() * 5.0;
                let ray = line(Ray::new(origin, turn.transform_point3(on_edge) - origin));
                assert_eq!(scene.count_hits(&ray, Crossings::Surfaces) % 2, 0, "{precision} {ray:?}");
            }
        }
    }
}

fn ids(hits: &[Hit]) -> Vec<[u32; 3]> {
    let mut ids: Vec<_> = hits.iter().map(|h| [h.id.instance, h.id.geometry, h.id.primitive]).collect();
    ids.sort_unstable();
    ids
}

/// At `Double` the twin decides in the same arithmetic: the same set for every ray. At `Robust` off the edges.
#[test]
fn all_hits_are_those_of_brute_force() {
    let mesh = torus(32, 16, 0.5);
    for place in places() {
        for precision in careful() {
            let scene = scene_of(&mesh, place, precision);
            let mut rng = Rng(83);
            for k in 0..600 {
                let aim = if precision == Precision::Double { Aim::ALL[k % 3] } else { Aim::Face };
                let target = aim.point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
                let origin = place.transform_point3(rng.direction() * 3.0);
                let ray = Ray::new(origin, place.transform_point3(target) - origin);
                for what in [Crossings::Triangles, Crossings::Surfaces] {
                    let (hits, twin) = (scene.all_hits(&ray, what), reference::crossings(&scene, &ray, what));
                    for count in [0, 1, 2, 9] {
                        let first = &hits[..hits.len().min(count)];
                        assert_eq!(scene.first_k_hits(&ray, count, what), first, "{precision} {what:?} {ray:?}");
                    }
                    let least = |h: &Hit| h.u.min(h.v).min(1.0 - h.u - h.v);
                    let on_edge = twin.iter().chain(&hits).any(|h| least(h) < 1e-4);
                    if on_edge && precision != Precision::Double {
                        continue;
                    }
                    assert_eq!(ids(&hits), ids(&twin), "{precision} {what:?} {ray:?}");
                    assert_eq!(scene.count_hits(&ray, what), reference::count_hits(&scene, &ray, what));
                    for hit in &hits {
                        let same = twin.iter().find(|t| t.id == hit.id).expect("the same ids");
                        assert!((hit.t - same.t).abs() <= 1e-6 * same.t && hit.normal().dot(same.normal()) > 0.999_999);
                    }
                }
            }
        }
    }
}

/// S15: coplanar faces on each other, also of other instances, are all found, sorted, and found again from there.
#[test]
fn overlapping_faces_are_all_found_in_order() {
    let mut mesh = icosphere(1);
    for _ in 0..3 {
        mesh.triangles.extend_from_within(0..80);
    }
    for precision in careful() {
        let mut builder = SceneBuilder::new(options(precision));
        let m = builder.add_mesh(vec![triangles(&mesh), triangles(&mesh)]);
        builder.add_instance(m, DAffine3::IDENTITY);
        builder.add_instance(m, DAffine3::IDENTITY);
        let sphere = Shape::Sphere(Sphere::new(DVec3::ZERO, 0.5).expect("a good sphere"));
        let s = builder.add_mesh(vec![Geometry::Shape(sphere)]);
        builder.add_instance(s, DAffine3::IDENTITY);
        let scene = builder.build().expect("a good scene");
        let mut rng = Rng(84);
        for k in 0..600 {
            let aim = Aim::ALL[k % 3].point(mesh.corners(rng.below(80)), &mut rng);
            let origin = rng.direction() * 2.0;
            let ray = Ray::new(origin, aim - origin);
            let hits = scene.all_hits(&ray, Crossings::Triangles);
            assert_eq!(scene.first_k_hits(&ray, 3, Crossings::Triangles), hits[..hits.len().min(3)]);
            // At `Exact` the exact order comes before the id.
            let in_order = |a: &Hit, b: &Hit| a.t < b.t || a.t == b.t && (a.id < b.id || precision == Precision::Exact);
            assert!(hits.is_sorted_by(in_order), "{precision} {ray:?}");
            assert_eq!(hits.len() as u32, scene.count_hits(&ray, Crossings::Triangles));
            assert_eq!(bits(&hits.first().copied()), bits(&scene.closest_hit(&ray)), "{precision} {ray:?}");
            assert_eq!(!hits.is_empty(), scene.any_hit(&ray));
            let surfaces = scene.all_hits(&ray, Crossings::Surfaces);
            assert_eq!(surfaces.len() as u32, scene.count_hits(&ray, Crossings::Surfaces));
            let of_mesh = |h: &&Hit| h.id.instance < 2;
            // Sixteen faces on each other, in and out.
            assert_eq!(surfaces.iter().filter(of_mesh).count() % 32, 0, "{precision} {ray:?}");
            assert!(surfaces.iter().all(|s| hits.iter().any(|h| h == s)));
            for hit in hits.iter().step_by(7) {
                // At `Exact` the interval is compared before t is rounded.
                let start = if precision == Precision::Exact { hit.t.next_down() } else { hit.t };
                let rest = scene.all_hits(&ray.with_interval(start, f64::INFINITY), Crossings::Triangles);
                let from_here = |list: &[Hit]| list.iter().filter(|h| h.t >= hit.t).copied().collect::<Vec<_>>();
                assert!(from_here(&rest) == from_here(&hits) && rest[0].t >= start, "{precision} {ray:?}");
            }
        }
    }
}

#[test]
fn filters_and_batches_give_what_single_rays_give() {
    let mesh = torus(32, 16, 0.5);
    for precision in Precision::ALL {
        let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
        let mut rng = Rng(85);
        let mut rays: Vec<_> = (0..5000).map(|_| Ray::new(rng.in_cube() * 2.0, rng.direction())).collect();
        rays[17].direction = DVec3::ZERO;
        for what in [Crossings::Triangles, Crossings::Surfaces] {
            let lists = scene.par_all_hits(&rays, what);
            assert_eq!(lists, scene.all_hits_each(&rays, what));
            assert_eq!(lists.len(), rays.len());
            let mut counts = vec![u32::MAX; rays.len()];
            scene.par_count_hits(&rays, what, &mut counts);
            let mut odd = Vec::new();
            for ((ray, list), count) in rays.iter().zip(lists.iter()).zip(&counts) {
                assert_eq!(list, scene.all_hits(ray, what));
                assert_eq!(list.len() as u32, *count);
                let is_odd = |h: &Hit| h.id.primitive % 2 == 1;
                scene.all_hits_filtered_into(ray, what, None, is_odd, &mut odd);
                assert!(list.iter().filter(|h| is_odd(h)).eq(&odd));
                assert_eq!(scene.count_hits_filtered(ray, what, None, is_odd), odd.len() as u32);
                if let Some(first) = list.first() {
                    let others = scene.count_hits_filtered(ray, what, Some(first.id), |_| true);
                    assert_eq!(others, count - 1);
                }
            }
            assert_eq!(counts[17], 0);
            assert!(lists.get(rays.len()).is_none() && lists.hits().len() > 1000);
        }
    }
}

/// Of a shape every root in the interval counts.
#[test]
fn shapes_are_crossed_at_every_root() {
    for precision in Precision::ALL {
        let mut builder = SceneBuilder::new(options(precision));
        let sphere = |r: f64| Geometry::Shape(Shape::Sphere(Sphere::new(DVec3::ZERO, r).expect("a good sphere")));
        let m = builder.add_mesh(vec![sphere(1.0), sphere(2.0)]);
        builder.add_instance(m, DAffine3::IDENTITY);
        let scene = builder.build().expect("a good scene");
        let ray = Ray::new(DVec3::new(0.0, 0.0, 3.0), DVec3::NEG_Z);
        for what in [Crossings::Triangles, Crossings::Surfaces] {
            let t = |ray: &Ray<f64>| scene.all_hits(ray, what).iter().map(|h| h.t).collect::<Vec<_>>();
            assert_eq!(t(&ray), [1.0, 2.0, 4.0, 5.0], "{precision}");
            assert_eq!(t(&ray.with_interval(2.0, 4.5)), [2.0, 4.0]);
            assert_eq!(scene.count_hits(&ray.with_interval(1.5, 3.0), what), 1);
        }
    }
}
