//! What is hardest for boxes: hits at edges that a ray meets at the flattest angle at which they are not kept within
//! boxes, slivers, tiny things far from the origin, rays from everywhere. Every order of visits, layout and level must
//! give the same bits, and a closed interval that ends or begins at a hit must have it.

use firsthit_accel::{BuildOptions, Crossings, Guards, Hit, Layout, Level, Scene, SceneBuilder, VisitOrder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Aim, Mesh, Rng};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use crate::{bits, careful, triangles};

fn one_of<const N: usize>(of: [f64; N], rng: &mut Rng) -> f64 {
    of[rng.below(N)]
}

/// Slivers, triangles in planes of the axes, any.
fn triangle(center: DVec3, size: f64, rng: &mut Rng) -> [Vec3; 3] {
    let corner = (center + rng.in_cube() * size).as_vec3();
    let size = size * (-8.0 * rng.unit()).exp2();
    let (mut a, mut b) = (rng.in_cube(), rng.in_cube());
    match rng.below(4) {
        0 => b = a * one_of([1.0, 0.7], rng) + rng.direction() * (-21.5 + 6.0 * rng.unit()).exp2(),
        1 => {
            let axis = rng.below(3);
            (a[axis], b[axis]) = (0.0, 0.0);
        }
        _ => {}
    }
    let mut v = [corner, corner + (a * size).as_vec3(), corner + (b * size).as_vec3()];
    v.rotate_left(rng.below(3));
    v
}

/// A ray at a triangle, and by how much it may be off.
fn ray(v: [DVec3; 3], size: f64, rng: &mut Rng) -> Ray<f64> {
    let target = Aim::ALL[rng.below(3)].point(v, rng);
    let normal = (v[1] - v[0]).cross(v[2] - v[0]).normalize_or(DVec3::X);
    let side = normal.cross(rng.direction()).normalize_or(DVec3::Y);
    let cosine: f64 = match rng.below(4) {
        0 => 0.25 + 1e-3 * rng.signed(),
        1 => 0.25 + 0.02 * rng.unit(),
        2 => 0.3 * rng.unit(),
        _ => rng.unit(),
    };
    let direction = (normal * cosine + side * (1.0 - cosine * cosine).sqrt()) * one_of([1.0, -1.0], rng);
    let distance =
        size * one_of([0.0, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 9.0, 11.0, 1e3, 1e6, 1e9], rng) * (0.5 + rng.unit());
    // Some roundings of f32 beside.
    let near = distance.min(size * 9.0) + target.abs().max_element();
    let target = target + rng.in_cube() * (near * 6e-8 * one_of([0.0, 1.0, 4.0, 8.0, 16.0], rng));
    Ray::new(target - direction * distance, direction * 10f64.powf(3.0 * rng.signed()))
}

fn placed(size: f64, rng: &mut Rng) -> Vec<DAffine3> {
    if rng.below(3) > 0 {
        return vec![DAffine3::IDENTITY];
    }
    let away = size * one_of([0.0, 1.0, 1e3, 1e6], rng);
    let place = |_| {
        let scale = (DVec3::ONE + rng.in_cube() * 0.7) * 10f64.powf(2.0 * rng.signed());
        let turn = DQuat::from_axis_angle(rng.direction(), rng.signed() * 3.0);
        DAffine3::from_scale_rotation_translation(scale, turn, rng.in_cube() * away)
    };
    (0..12).map(place).collect()
}

/// The same hits, and the same nearest ones in intervals, by every way.
fn agree(scenes: &[Scene], ray: &Ray<f64>, name: &str) -> usize {
    let line = ray.with_interval(f64::NEG_INFINITY, f64::INFINITY);
    let in_bits = |hits: Vec<Hit>| hits.into_iter().map(|h| bits(&Some(h))).collect::<Vec<_>>();
    let mut first = Vec::new();
    for what in [Crossings::Surfaces, Crossings::Triangles] {
        first = scenes[0].all_hits(&line, what);
        let expected = in_bits(first.clone());
        for scene in scenes {
            assert_eq!(in_bits(scene.all_hits(&line, what)), expected, "{name} {what:?} {ray:?}");
            assert_eq!(scene.all_hits_exhaustively(&line, what).len(), expected.len(), "{name} {what:?} {ray:?}");
        }
    }
    for hit in &first {
        // At `Exact` the interval is compared with what `t` is before it is rounded.
        let exact = scenes[0].options().precision == Precision::Exact;
        let (low, high) = if exact { (hit.t.next_down(), hit.t.next_up()) } else { (hit.t, hit.t) };
        for (low, high) in [(low, high), (low, f64::INFINITY), (f64::NEG_INFINITY, high)] {
            let part = ray.with_interval(low, high);
            let expected = scenes[0].closest_hit_in_order(&part, VisitOrder::Exhaustive);
            assert!(expected.is_some(), "{name} {part:?}");
            for scene in scenes {
                let found = [scene.closest_hit(&part), scene.closest_hit_in_order(&part, VisitOrder::FarFirst)];
                assert!(found.iter().all(|h| bits(h) == bits(&expected)) && scene.any_hit(&part), "{name} {part:?}");
            }
        }
    }
    first.len()
}

fn agree_in_scenes(options: BuildOptions, count: u64) {
    let mut hits = 0;
    for seed in 0..count {
        let mut rng = Rng(seed * 7919 + 1);
        let center = rng.direction() * one_of([0.0, 1.0, 3.0, 100.0, 1e4], &mut rng);
        let size = center.length().max(1.0) * one_of([1.0, 1e-1, 1e-2, 1e-4, 1e-6], &mut rng);
        let corners: Vec<_> = (0..10 + rng.below(60)).map(|_| triangle(center, size, &mut rng)).collect();
        let indices = (0..corners.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = Mesh { positions: corners.as_flattened().to_vec(), triangles: indices };
        let places = placed(size, &mut rng);
        let ways = [
            (Layout::Bvh2, Level::Scalar),
            (Layout::Wide8, Level::Scalar),
            (Layout::Wide8, Level::default()),
            (Layout::Compact8, Level::default()),
        ];
        let scenes = ways.map(|(layout, simd)| {
            let mut builder = SceneBuilder::new(BuildOptions { layout, simd, ..options });
            let m = builder.add_mesh(vec![triangles(&mesh)]);
            for &place in &places {
                builder.add_instance(m, place);
            }
            builder.build().expect("a good mesh")
        });
        for _ in 0..200 {
            let local = ray(corners[rng.below(corners.len())].map(|p| p.as_dvec3()), size, &mut rng);
            let m = places[rng.below(places.len())];
            let ray = Ray::new(m.transform_point3(local.origin), m.transform_vector3(local.direction));
            hits += agree(&scenes, &ray, &format!("{} {} {seed}", options.precision, options.guards));
        }
    }
    assert!(hits > count as usize * 50, "{hits} hits are few");
}

#[test]
fn hard_hits_depend_on_no_tree() {
    for precision in careful() {
        agree_in_scenes(BuildOptions { precision, ..BuildOptions::default() }, 60);
    }
}

/// The other guards are not what keeps answers from depending on the tree.
#[test]
fn padding_alone_sees_to_that() {
    for (_, guards) in Guards::combinations().filter(|(_, g)| g.contains(Guards::PADDING)) {
        agree_in_scenes(BuildOptions { guards, ..BuildOptions::default() }, 12);
    }
}
