//! S5 to S9: inputs that break builders.

use std::time::Instant;

use firsthit_accel::{BuildError, Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Mesh, Rng, icosphere};
use glam::{DAffine3, DVec3, Vec3};

use crate::{scene_of, triangles};

fn build(mesh: &Mesh) -> (Scene, f64) {
    let start = Instant::now();
    let scene = scene_of(mesh, DAffine3::IDENTITY, Precision::Robust);
    (scene, start.elapsed().as_secs_f64())
}

fn of_triangles(all: impl Iterator<Item = [Vec3; 3]>) -> Mesh {
    let mut mesh = Mesh::default();
    for t in all {
        let k = mesh.positions.len() as u32;
        mesh.positions.extend(t);
        mesh.triangles.push([k, k + 1, k + 2]);
    }
    mesh
}

const FLAT: [Vec3; 3] = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];

/// S6. The least time of three, since other work shares the machine.
#[test]
fn coincident_and_concentric_triangles_build_fast() {
    const N: usize = 100_000;
    let mut rng = Rng(1);
    let random = of_triangles((0..N).map(|_| {
        let c = rng.in_cube().as_vec3();
        FLAT.map(|v| c + v * 0.01)
    }));
    let coincident = of_triangles((0..N).map(|_| FLAT));
    let concentric = of_triangles((0..N).map(|k| FLAT.map(|v| v * (1.0 + k as f32 / N as f32))));
    let shells = of_triangles((0..N).map(|k| FLAT.map(|v| v * 1.001f32.powi((k % 20_000) as i32))));
    let least = |mesh: &Mesh| (0..3).map(|_| build(mesh).1).fold(f64::INFINITY, f64::min);
    let base = least(&random);
    for (name, mesh) in [("coincident", &coincident), ("concentric", &concentric), ("shells", &shells)] {
        let time = least(mesh);
        println!("{name}: {:.1} times a random mesh ({base:.3} s)", time / base);
        assert!(time <= 10.0 * base, "{name}: {time} s, random {base} s");
        let (scene, _) = build(mesh);
        let ray = Ray::new(DVec3::new(0.0, 0.0, 1.0), DVec3::NEG_Z);
        let (hit, counts) = scene.closest_hit_counted(&ray);
        // All at t = 1: the first in the file.
        assert_eq!(hit.map(|h| (h.id.primitive, h.t)), Some((0, 1.0)), "{name}");
        assert!(counts.primitives as usize <= N && scene.stats().depth <= 128, "{name}: {counts:?}");
    }
}

/// S7.
#[test]
fn deep_trees_do_not_overflow() {
    let series = of_triangles((0..120).map(|k| FLAT.map(|v| (v + Vec3::X * 3.0) * 2f32.powi(-k))));
    let line = of_triangles((0..50_000).map(|k| FLAT.map(|v| v * 0.4 + Vec3::X * k as f32)));
    let mut rng = Rng(2);
    let huge_and_tiny = of_triangles((0..100_000).map(|k| {
        if k == 0 {
            return FLAT.map(|v| v * 1e4 - Vec3::Z);
        }
        let c = rng.in_cube().as_vec3() * 0.01;
        FLAT.map(|v| c + v * 1e-5)
    }));
    for (name, mesh) in [("series", series), ("line", line), ("huge and tiny", huge_and_tiny)] {
        let (scene, seconds) = build(&mesh);
        assert!(scene.stats().depth <= 128, "{name}: {:?}", scene.stats());
        assert!(seconds < 20.0);
        let last = mesh.triangles.len() - 1;
        for k in [0, last / 2, last] {
            let target = mesh.corners(k).iter().sum::<DVec3>() / 3.0;
            let ray = Ray::new(target + DVec3::Z * 0.1, DVec3::NEG_Z);
            assert!(scene.closest_hit(&ray).is_some(), "{name} {k}");
        }
    }
}

/// S8.
#[test]
fn few_flat_and_degenerate_triangles() {
    let ray = Ray::new(DVec3::new(0.1, 0.0, 5.0), DVec3::NEG_Z);
    for n in 0..4 {
        let mesh = of_triangles((0..n).map(|k| FLAT.map(|v| v - Vec3::Z * k as f32)));
        let scene = scene_of(&mesh, DAffine3::IDENTITY, Precision::Robust);
        assert_eq!(scene.closest_hit(&ray).map(|h| (h.id.primitive, h.t)), (n > 0).then_some((0, 5.0)));
        assert_eq!(scene.any_hit(&ray), n > 0);
    }
    for precision in Precision::ALL {
        for mesh in [
            of_triangles((0..1000).map(|_| [Vec3::ZERO; 3])),
            of_triangles((0..1000).map(|k| [Vec3::ZERO, Vec3::X * k as f32, Vec3::X * 2.0 * k as f32])),
        ] {
            let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
            assert_eq!(scene.stats().degenerate_triangles, 1000);
            for target in [DVec3::ZERO, DVec3::X, DVec3::X * 0.3] {
                assert!(
                    scene
                        .closest_hit(&Ray::segment(DVec3::new(0.0, 1.0, 3.0), target * 2.0 - DVec3::new(0.0, 1.0, 3.0)))
                        .is_none()
                );
            }
        }
        // All in one plane: flat boxes everywhere.
        let mut rng = Rng(4);
        let plane = of_triangles((0..2000).map(|_| {
            let c = Vec3::new(rng.signed() as f32, rng.signed() as f32, 0.0) * 10.0;
            FLAT.map(|v| c + v)
        }));
        let scene = scene_of(&plane, DAffine3::IDENTITY, precision);
        for k in 0..2000 {
            let target = plane.corners(k).iter().sum::<DVec3>() / 3.0;
            assert!(scene.any_hit(&Ray::new(target + DVec3::Z, DVec3::NEG_Z)), "{precision} {k}");
        }
    }
    // A mesh without instances, an empty mesh, a geometry without triangles.
    let mut builder = SceneBuilder::default();
    builder.add_mesh(vec![triangles(&icosphere(1))]);
    let empty = builder.add_mesh(vec![]);
    let none = builder.add_mesh(vec![Geometry::Triangles { positions: vec![], triangles: vec![] }]);
    builder.add_instance(empty, DAffine3::IDENTITY);
    builder.add_instance(none, DAffine3::IDENTITY);
    assert!(builder.build().expect("empty, not wrong").closest_hit(&ray).is_none());
}

/// S9.
#[test]
fn bad_numbers_and_indices_are_named() {
    let good = icosphere(2);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut mesh = good.clone();
        mesh.positions[17].y = value;
        let mut builder = SceneBuilder::default();
        builder.add_mesh(vec![triangles(&good)]);
        builder.add_mesh(vec![triangles(&good), triangles(&mesh)]);
        assert_eq!(builder.build().err(), Some(BuildError::NotFinite { mesh: 1, geometry: 1, vertex: 17 }));
    }
    let mut mesh = good.clone();
    mesh.triangles[5][2] = 9999;
    let mut builder = SceneBuilder::default();
    builder.add_mesh(vec![triangles(&mesh)]);
    let count = mesh.positions.len();
    assert_eq!(
        builder.build().err(),
        Some(BuildError::IndexOutOfRange { mesh: 0, geometry: 0, triangle: 5, index: 9999, count })
    );
    let mut builder = SceneBuilder::default();
    builder.add_instance(3, DAffine3::IDENTITY);
    assert_eq!(builder.build().err(), Some(BuildError::NoSuchMesh { instance: 0, mesh: 3, count: 0 }));

    // The largest floats are numbers like any other.
    let huge = good.map(|p| p * 3e38);
    let scene = scene_of(&huge, DAffine3::IDENTITY, Precision::Robust);
    let hit = scene.closest_hit(&Ray::new(DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3) * 1e38)).expect("inside");
    assert!((hit.t * DVec3::new(0.1, 0.2, 0.3).length() / 3.0 - 1.0).abs() < 0.05);
}

/// S5: strips of needles cover a plane without gaps.
#[test]
fn needles_leave_no_gaps() {
    for aspect in [1e2f32, 1e4, 1e6, 1e8] {
        let n = 200;
        let x = |k: usize| k as f32 / aspect;
        let mut mesh = Mesh::default();
        for k in 0..=n {
            mesh.positions.extend([Vec3::new(x(k), -1.0, 0.1 * x(k)), Vec3::new(x(k), 1.0, 0.1 * x(k))]);
        }
        for k in 0..n as u32 {
            mesh.triangles.extend([[2 * k, 2 * k + 2, 2 * k + 3], [2 * k, 2 * k + 3, 2 * k + 1]]);
        }
        for precision in [Precision::Robust, Precision::Double] {
            let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
            let mut rng = Rng(6);
            for _ in 0..20_000 {
                // Away from the rim, which rounding moves by more than the width of the thinnest needles.
                let at = f64::from(x(n / 4 + rng.below(n / 2)));
                let target = DVec3::new(at, rng.signed() * 0.9, 0.1 * at);
                let origin = DVec3::new(rng.signed() * 0.3, rng.signed(), 1.0);
                let hit = scene.closest_hit(&Ray::new(origin, target - origin));
                assert!(hit.is_some(), "{precision} {aspect}");
                // Coordinates x and z round to f32, so the slope of 0.1 is kept to that only.
                let exact = DVec3::new(-0.1, 0.0, 1.0).normalize();
                assert!(hit.is_some_and(|h| (h.normal - exact).length() < 1e-4), "{precision} {aspect} {hit:?}");
            }
        }
    }
}
