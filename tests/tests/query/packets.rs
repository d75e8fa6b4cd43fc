//! Batches trace rays together that go the same way: the same bits as one by one.

use firsthit_accel::{BuildOptions, Geometry, Guards, Level, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Aim, Mesh, Rng, grid_cube, icosphere, read_obj, soup};
use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;

use crate::{bits, triangles};

fn scene(mesh: &Mesh, transform: DAffine3, options: BuildOptions) -> Scene {
    let mut builder = SceneBuilder::new(options);
    let m = builder.add_mesh(vec![triangles(mesh)]);
    builder.add_instance(m, transform);
    builder.build().expect("a good mesh")
}

/// The rays of a camera's square picture, neighbours near each other in the list.
fn camera(eye: DVec3, at: DVec3, up: DVec3, angle: f64, side: u32) -> Vec<Ray<f64>> {
    let forward = (at - eye).normalize();
    let right = forward.cross(up).normalize();
    let up = right.cross(forward);
    let every_other = |code: u32| (0..16).fold(0, |x, bit| x | (code >> (2 * bit) & 1) << bit);
    (0..side * side)
        .map(|k| {
            let at = |p: u32| (2.0 * (f64::from(every_other(p)) + 0.5) / f64::from(side) - 1.0) * angle;
            Ray::new(eye, forward + right * at(k) - up * at(k >> 1))
        })
        .collect()
}

/// Fails where a batch differs from single rays; says how many rays hit.
fn same(scene: &Scene, rays: &[Ray<f64>], name: &str) -> usize {
    let careful = scene.options().precision != Precision::Fast;
    let (mut hits, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
    scene.closest_hits(rays, &mut hits);
    scene.any_hits(rays, &mut any);
    let mut different = 0;
    for ((ray, hit), any) in rays.iter().zip(&hits).zip(any) {
        let single = scene.closest_hit(ray);
        let alike = bits(hit) == bits(&single) && any == single.is_some();
        assert!(alike || !careful, "{name}: {ray:?} {hit:?} {single:?} {any}");
        different += usize::from(!alike);
    }
    // Of `Fast`, only what lies at the very edge of a box may differ.
    assert!(different * 1000 <= rays.len(), "{name}: {different} of {}", rays.len());
    hits.iter().flatten().count()
}

/// At each tier and level.
fn same_at_all(mesh: &Mesh, transform: DAffine3, rays: &[Ray<f64>], name: &str) {
    for precision in Precision::ALL {
        for simd in Level::ALL {
            let scene = scene(mesh, transform, BuildOptions { precision, simd, ..BuildOptions::default() });
            let hits = same(&scene, rays, &format!("{name}, {precision}, {simd}"));
            assert!(hits * 20 > rays.len(), "{name}: {hits} of {}", rays.len());
        }
    }
}

#[test]
fn cameras_see_what_single_rays_see() {
    let scans = ["spot/spot.obj", "stanford-bunny/stanford-bunny.obj", "sibenik/sibenik.obj", "teapot/teapot.obj"];
    let shared = firsthit_tests::shared();
    let scans = scans.iter().filter_map(|s| Some((*s, read_obj(&shared.as_ref()?.join("assets").join(s))?)));
    let made = [("icosphere", icosphere(5)), ("grid", grid_cube(12))];
    for (name, mesh) in made.into_iter().chain(scans) {
        let (low, high) =
            mesh.positions.iter().fold((mesh.positions[0], mesh.positions[0]), |(a, b), p| (a.min(*p), b.max(*p)));
        let (center, size) = (((low + high) * 0.5).as_dvec3(), f64::from((high - low).max_element()));
        // From outside, from far away, and from within along an axis, so that packets go several ways.
        let eyes = [DVec3::new(0.9, 0.5, 1.3), DVec3::new(-300.0, 100.0, 200.0), DVec3::new(0.1, 0.05, 0.0)];
        let rays: Vec<Ray<f64>> = eyes
            .into_iter()
            .zip([0.4, 0.002, 1.0])
            .flat_map(|(eye, angle)| camera(center + eye * size, center, DVec3::new(0.1, 1.0, 0.0), angle, 48))
            .collect();
        same_at_all(&mesh, DAffine3::IDENTITY, &rays, name);
    }
}

#[test]
fn shadow_rays_to_one_light() {
    let mesh = icosphere(5);
    for precision in Precision::ALL {
        let scene = scene(&mesh, DAffine3::IDENTITY, BuildOptions { precision, ..BuildOptions::default() });
        let seen = camera(DVec3::new(0.0, 1.0, 3.0), DVec3::ZERO, DVec3::Y, 0.35, 64);
        for (light, name) in [(DVec3::new(2.0, 3.0, 2.0), "lit"), (DVec3::new(-3.0, 0.3, -0.2), "half in shadow")] {
            let rays: Vec<Ray<f64>> = seen
                .iter()
                .filter_map(|ray| scene.closest_hit(ray).map(|hit| Ray::segment(ray.at(hit.t), light)))
                .collect();
            same(&scene, &rays, name);
            let moved: Vec<Ray<f64>> = rays.iter().map(|r| r.with_interval(1e-6, 1.0)).collect();
            assert!(same(&scene, &moved, name) > 100);
        }
    }
}

/// Rays into all directions from anywhere, in lists of every length; some can't hit anything, some are whole lines.
#[test]
fn rays_that_have_nothing_in_common() {
    let mut rng = Rng(11);
    let mut vector = move || DVec3::new(rng.signed(), rng.signed(), rng.signed());
    let rays: Vec<Ray<f64>> = (0..4096)
        .map(|k| {
            let (from, to) = (vector() * 3.0, vector() * 0.7);
            match k % 61 {
                7 => Ray::new(from, DVec3::ZERO),
                17 => Ray::new(from, DVec3::NAN),
                27 => Ray::new(from * f64::INFINITY, to - from),
                37 => Ray::new(from, to - from).with_interval(2.0, 1.0),
                47 => Ray::new(from, to - from).with_interval(f64::NEG_INFINITY, f64::INFINITY),
                57 => Ray::new(from * 1e9, to - from * 1e9),
                _ if k % 3 == 0 => Ray::segment(from, to),
                _ => Ray::new(from, to - from),
            }
        })
        .collect();
    let turned = DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
    for (name, mesh) in [("ball", icosphere(5)), ("one leaf", soup(&mut Rng(6), 6)), ("soup", soup(&mut Rng(5), 3000))]
    {
        for precision in Precision::ALL {
            for simd in Level::ALL {
                let options = BuildOptions { precision, simd, ..BuildOptions::default() };
                let hits = same(&scene(&mesh, turned, options), &rays, &format!("{name}, {precision}, {simd}"));
                assert!(hits > 100, "{name}: {hits}");
            }
        }
    }
    let scene = scene(&icosphere(4), turned, BuildOptions::default());
    for length in 0..80 {
        same(&scene, &rays[length..2 * length], &format!("{length} rays"));
    }
}

/// Of one direction, but far from each other: such rays are given up as packets when they have visited too much, and
/// packets are tried again later. Neighbours among them make some that are not given up.
#[test]
fn rays_side_by_side_that_begin_far_apart() {
    let mesh = icosphere(7);
    for precision in [Precision::Fast, Precision::Robust] {
        let scene = scene(&mesh, DAffine3::IDENTITY, BuildOptions { precision, ..BuildOptions::default() });
        let mut rng = Rng(7);
        let mut at = DVec3::ZERO;
        let rays: Vec<Ray<f64>> = (0..64 * 96)
            .map(|k| {
                let far = k / 512 % 2 == 0 || k % 32 == 0;
                let step = DVec3::new(rng.signed(), rng.signed(), 0.0);
                at = if far { step } else { at + step * 1e-3 };
                Ray::new(DVec3::new(at.x, at.y, 2.0), DVec3::new(0.0, 0.02 * rng.signed(), -1.0))
            })
            .collect();
        assert!(same(&scene, &rays, "side by side") > 1000);
    }
}

/// Any of the guards may be missing; then there are no packets, or they must not tell.
#[test]
fn guards_make_no_difference_between_batches_and_single_rays() {
    let mesh = icosphere(4);
    let rays = camera(DVec3::new(1.0, 1.0, 3.0), DVec3::ZERO, DVec3::Y, 0.4, 32);
    for (name, guards) in Guards::combinations() {
        let scene = scene(&mesh, DAffine3::IDENTITY, BuildOptions { guards, ..BuildOptions::default() });
        same(&scene, &rays, &name);
    }
}

/// Several geometries, and triangles that lie on each other: ties go to the smaller id.
#[test]
fn ties_go_to_the_first() {
    let ball = icosphere(3);
    let rays = camera(DVec3::new(1.0, 1.0, 3.0), DVec3::ZERO, DVec3::Y, 0.4, 64);
    for precision in Precision::ALL {
        for reversed in [false, true] {
            let mut again = ball.clone();
            if reversed {
                again.triangles.reverse();
            }
            let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
            let mut parts: Vec<Geometry> = vec![triangles(&again), triangles(&ball), triangles(&again)];
            parts.push(triangles(&icosphere(2)));
            let m = builder.add_mesh(parts);
            builder.add_instance(m, DAffine3::IDENTITY);
            let scene = builder.build().expect("a good mesh");
            assert!(same(&scene, &rays, "ties") > 1000);
            let mut hits = vec![None; rays.len()];
            scene.closest_hits(&rays, &mut hits);
            assert!(hits.iter().flatten().all(|h| h.id.geometry != 2), "{precision}");
        }
    }
}

fn interval(rng: &mut Rng) -> (f64, f64) {
    match rng.below(8) {
        0 => (f64::NEG_INFINITY, f64::INFINITY),
        1 => (rng.signed(), 1.0 + rng.signed()),
        2 => (1.0, 1.0),
        3 => (0.0, 1e300),
        4 => (f64::INFINITY, f64::INFINITY),
        _ => (0.0, f64::INFINITY),
    }
}

fn spoil(rng: &mut Rng, ray: &mut Ray<f64>) {
    match rng.below(8) {
        0 => ray.origin.x = f64::NAN,
        1 => ray.origin.y = f64::INFINITY,
        2 => ray.direction = DVec3::ZERO,
        3 => ray.direction.z = f64::NAN,
        4 => ray.direction *= 1e-200,
        5 => (ray.t_min, ray.t_max) = (1.0, 0.0),
        6 => ray.t_min = f64::NAN,
        _ => ray.direction = rng.direction(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Narrow bundles of rays at vertices, edges and faces, in all directions and along the axes, of any interval, some of
    /// them not valid; of meshes anywhere.
    #[test]
    fn bundles_answer_as_single_rays(seed in any::<u64>()) {
        let mut rng = Rng(seed);
        let mesh = match rng.below(3) {
            0 => soup(&mut rng, 300),
            1 => icosphere(3),
            _ => grid_cube(6),
        };
        let size = mesh.positions.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let transform = match rng.below(3) {
            0 => DAffine3::IDENTITY,
            1 => DAffine3::from_translation(rng.in_cube() * 1e5),
            _ => DAffine3 {
                matrix3: DMat3::from_axis_angle(rng.direction(), rng.unit() * 6.0)
                    * DMat3::from_diagonal(DVec3::new(-1.0, 0.5, 2.0) + rng.in_cube() * 0.3),
                translation: rng.in_cube(),
            },
        };
        let mut rays = Vec::new();
        for _ in 0..24 {
            let corners = mesh.corners(rng.below(mesh.triangles.len()));
            let target = Aim::ALL[rng.below(3)].point(corners, &mut rng);
            let way = match rng.below(4) {
                0 => [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z][rng.below(6)],
                _ => rng.direction(),
            };
            let distance = f64::from(size) * [0.3, 2.0, 500.0][rng.below(3)];
            let width = [0.0, 1e-7, 1e-3, 0.05][rng.below(4)];
            let length = 2f64.powi(rng.below(7) as i32 - 3);
            let (spread, bad, same_interval) = (rng.below(2) == 0, rng.below(4) == 0, rng.below(2) == 0);
            let common = interval(&mut rng);
            // A number that leaves some over.
            for _ in 0..(40 + rng.below(40)) {
                let aim = match rng.below(3) {
                    // Straight at something.
                    0 => Aim::ALL[rng.below(3)].point(corners, &mut rng),
                    _ => target + rng.in_cube() * (width * f64::from(size)),
                };
                let origin = target - way * distance + if spread { rng.in_cube() * (width * distance) } else { DVec3::ZERO };
                let (from, to) = (transform.transform_point3(origin), transform.transform_point3(aim));
                let mut ray = Ray::new(from, (to - from) * length);
                let (t_min, t_max) = if same_interval { common } else { interval(&mut rng) };
                ray = ray.with_interval(t_min / length, t_max / length);
                if bad && rng.below(10) == 0 {
                    spoil(&mut rng, &mut ray);
                }
                rays.push(ray);
            }
        }
        let level = Level::ALL[rng.below(3)];
        for precision in [Precision::Robust, Precision::Double, Precision::Fast] {
            let scene = scene(&mesh, transform, BuildOptions { precision, simd: level, ..BuildOptions::default() });
            if precision == Precision::Fast {
                // Aimed at edges and run along faces: nothing is promised but that nothing breaks.
                let (mut hits, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
                scene.closest_hits(&rays, &mut hits);
                scene.any_hits(&rays, &mut any);
                prop_assert!(hits.iter().zip(&any).all(|(h, a)| h.is_some() == *a));
                continue;
            }
            same(&scene, &rays, &format!("seed {seed}, {precision}, {level}"));
        }
    }
}
