//! The tests have teeth: each guard of the robust tier that is taken away fails at something that all together hold.

use firsthit_accel::{BuildOptions, Guards, Scene, SceneBuilder, VisitOrder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Aim, Mesh, Rng, icosphere};
use glam::{DAffine3, DVec3, Vec3};

use crate::{bits, scene_of, triangles};

fn guarded(mesh: &Mesh, guards: Guards) -> Scene {
    let mut builder = SceneBuilder::new(BuildOptions { guards, ..BuildOptions::default() });
    let m = builder.add_mesh(vec![triangles(mesh)]);
    builder.add_instance(m, DAffine3::IDENTITY);
    builder.build().expect("a good mesh")
}

/// From inside the unit sphere at its vertices and edges.
fn aimed(mesh: &Mesh, count: usize) -> Vec<Ray<f64>> {
    let mut rng = Rng(71);
    (0..count)
        .map(|k| {
            let target = Aim::ALL[k % 2].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
            let origin = rng.in_cube() * 0.4;
            Ray::new(origin, target - origin)
        })
        .collect()
}

/// Rays without a hit: by the tree, and by testing every triangle.
fn lost(scene: &Scene, rays: &[Ray<f64>]) -> [usize; 2] {
    [VisitOrder::NearFirst, VisitOrder::Exhaustive]
        .map(|order| rays.iter().filter(|r| scene.closest_hit_in_order(r, order).is_none()).count())
}

#[test]
fn without_padding_boxes_are_missed() {
    let mesh = icosphere(4);
    let rays = aimed(&mesh, 20_000);
    let [by_tree, by_all] = lost(&guarded(&mesh, Guards::ALL - Guards::PADDING), &rays[..]);
    assert!(by_tree > 0, "the plain slab test misses");
    assert_eq!(by_all, 0, "the triangle test does not");
    assert_eq!(lost(&guarded(&mesh, Guards::ALL), &rays), [0, 0]);
}

#[test]
fn without_the_watertight_test_triangles_leak() {
    let mesh = icosphere(4);
    let rays = aimed(&mesh, 20_000);
    let [by_tree, by_all] = lost(&guarded(&mesh, Guards::ALL - Guards::WATERTIGHT), &rays[..]);
    assert!(by_tree > 0 && by_all > 0);
}

/// Products of such small coordinates vanish in f32: all edge functions are 0.
#[test]
fn without_the_fallback_tiny_triangles_are_lost() {
    let mut mesh = icosphere(1).map(|p| p * 1e-25);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([Vec3::new(1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, 2.0), Vec3::new(1.0, 2.0, 1.0)]);
    mesh.triangles.push([first, first + 1, first + 2]);
    let mut rng = Rng(72);
    let rays: Vec<_> = (0..1000).map(|_| Ray::new(DVec3::ZERO, rng.direction())).collect();
    let inside = |guards| lost(&guarded(&mesh, guards), &rays)[0];
    assert_eq!(inside(Guards::ALL), 0);
    assert!(inside(Guards::ALL - Guards::FALLBACK) > 900);
}

#[test]
fn without_the_plane_t_has_the_digits_of_f32() {
    let mesh = icosphere(3);
    let exact = scene_of(&mesh, DAffine3::IDENTITY, Precision::Double);
    let mut rng = Rng(73);
    let rays: Vec<_> = (0..2000).map(|_| Ray::new(rng.in_cube() * 0.4, rng.direction())).collect();
    let worst = |guards| {
        let scene = guarded(&mesh, guards);
        rays.iter().fold(0.0f64, |worst, r| match (scene.closest_hit(r), exact.closest_hit(r)) {
            (Some(a), Some(b)) if a.id == b.id => worst.max((a.t / b.t - 1.0).abs()),
            _ => worst,
        })
    };
    assert!(worst(Guards::ALL) < 1e-14);
    assert!(worst(Guards::ALL - Guards::PLANE_T) > 1e-8);
    assert!(worst(Guards::ALL - Guards::PLANE_T) < 1e-5);
}

/// A constant offset fails at both ends: it jumps out of a small sphere, and is lost in the rounding of a huge one.
#[test]
fn without_the_bounded_offset_size_matters() {
    let wrong = |guards: Guards, scale: f32| {
        let mesh = icosphere(3).map(|p| p * scale);
        let scene = guarded(&mesh, guards);
        let mut rng = Rng(74);
        (0..2000)
            .filter(|_| {
                let ray = Ray::new(rng.in_cube() * 0.4 * f64::from(scale), rng.direction());
                let hit = scene.closest_hit(&ray).expect("inside");
                let inward = -hit.normal() + rng.direction() * 0.999;
                let start = scene.surface_point(&ray, &hit).spawn(inward);
                // The far side must be met, and not the triangle that the ray leaves.
                scene.closest_hit(&Ray::new(start, inward)).is_none_or(|next| next.id == hit.id)
            })
            .count()
    };
    for scale in [1e-5, 1.0, 1e14] {
        assert_eq!(wrong(Guards::ALL, scale), 0, "{scale}");
    }
    let constant = Guards::ALL - Guards::OFFSET;
    assert!(wrong(constant, 1e-5) > 0 && wrong(constant, 1e14) > 0);
    assert_eq!(wrong(constant, 1.0), 0, "what it was made for");
}

/// The same test but for one fused multiply-add in each edge function, which makes signs wrong: the mesh leaks.
#[test]
fn an_edge_function_with_a_single_fma_leaks() {
    type Edge = fn(f32, f32, f32, f32) -> f32;
    let rounded: Edge = |a, b, c, d| a * b - c * d;
    let fused: Edge = |a, b, c, d| a.mul_add(b, -(c * d));
    let mesh = icosphere(3);
    let leaks = |edge: Edge| {
        aimed(&mesh, 4000)
            .iter()
            .filter(|ray| {
                let (o, d) = (ray.origin.as_vec3(), ray.direction.as_vec3());
                let k = [0, 1, 2].into_iter().max_by(|&i, &j| d[i].abs().total_cmp(&d[j].abs())).unwrap_or(0);
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let (sx, sy) = (d[i] / d[k], d[j] / d[k]);
                // Any hit on the line will do: from inside, a leak loses one of the two.
                let hits = mesh.triangles.iter().filter(|t| {
                    let [a, b, c] = t.map(|v| {
                        let p = mesh.positions[v as usize] - o;
                        (p[i] - sx * p[k], p[j] - sy * p[k], p[k] / d[k])
                    });
                    let e = [edge(c.0, b.1, c.1, b.0), edge(a.0, c.1, a.1, c.0), edge(b.0, a.1, b.1, a.0)];
                    let mixed = e.iter().any(|x| *x < 0.0) && e.iter().any(|x| *x > 0.0);
                    !mixed && a.2.max(b.2).max(c.2) > 0.0
                });
                hits.count() == 0
            })
            .count()
    };
    assert_eq!(leaks(rounded), 0);
    assert!(leaks(fused) > 0);
}

/// Every combination answers: the same hits as all guards off the edges, and as any hit and batches everywhere.
#[test]
fn combinations_agree_off_the_edges() {
    let mesh = icosphere(3);
    let all = guarded(&mesh, Guards::ALL);
    let mut rng = Rng(75);
    let rays: Vec<_> = (0..1000).map(|_| Ray::new(rng.in_cube() * 0.4, rng.direction())).collect();
    for (name, guards) in Guards::combinations() {
        let scene = guarded(&mesh, guards);
        for ray in &rays {
            let (hit, expected) = (scene.closest_hit(ray), all.closest_hit(ray).expect("inside"));
            assert_eq!(bits(&hit), bits(&scene.closest_hit_filtered(ray, None, |_| true)), "{name}");
            assert_eq!(hit.is_some(), scene.any_hit(ray), "{name}");
            let least = expected.u.min(expected.v).min(1.0 - expected.u - expected.v);
            if least > 1e-4 {
                assert_eq!(hit.map(|h| h.id), Some(expected.id), "{name}");
            }
        }
    }
}
