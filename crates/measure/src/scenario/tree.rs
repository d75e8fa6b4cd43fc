//! S5 to S8: meshes that break builders.

use std::time::Instant;

use firsthit_accel::{Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use glam::{DAffine3, DVec3, Vec3};

use super::{Check, scene_of, triangles};
use crate::mesh::{Mesh, icosphere};
use crate::random::Rng;

const FLAT: [Vec3; 3] = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];

/// No tree is deeper.
const MAX_DEPTH: u32 = 128;

fn of_triangles(all: impl Iterator<Item = [Vec3; 3]>) -> Mesh {
    let mut mesh = Mesh::default();
    for t in all {
        let k = mesh.positions.len() as u32;
        mesh.positions.extend(t);
        mesh.triangles.push([k, k + 1, k + 2]);
    }
    mesh
}

/// The scene and the least seconds of some builds, since other work may share the machine.
fn build(check: &mut Check<'_>, mesh: &Mesh, times: u32) -> Option<(Scene, f64)> {
    let mut least = f64::INFINITY;
    let mut scene = None;
    for _ in 0..times {
        let start = Instant::now();
        scene = scene_of(check, mesh, DAffine3::IDENTITY, Precision::Robust);
        least = least.min(start.elapsed().as_secs_f64());
    }
    Some((scene?, least))
}

/// S5: strips of needles cover a plane without gaps, and their normals are right to what rounding left of the plane.
pub(super) fn needles(check: &mut Check<'_>) {
    check
        .recipe("strips of 400 needles of aspect 1e2 to 1e8 in a tilted plane, rays from all around at its inner half");
    let count = check.wanted();
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
        for precision in check.tiers() {
            let Some(scene) = scene_of(check, &mesh, DAffine3::IDENTITY, precision) else { return };
            let mut rng = Rng(check.settings.seed);
            for _ in 0..count / 4 {
                // Away from the rim, which rounding moves by more than the width of the thinnest needles.
                let at = f64::from(x(n / 4 + rng.below(n / 2)));
                let target = DVec3::new(at, rng.signed() * 0.9, 0.1 * at);
                let origin = DVec3::new(rng.signed() * 0.3, rng.signed(), 1.0);
                let hit = scene.closest_hit(&Ray::new(origin, target - origin));
                // Coordinates x and z round to f32, so the slope of 0.1 is kept to that only.
                let exact = DVec3::new(-0.1, 0.0, 1.0).normalize();
                let right = hit.is_some_and(|h| (h.normal() - exact).length() < 1e-4);
                check.expect(right, || format!("{precision}, aspect {aspect}: {hit:?}"));
            }
        }
    }
}

/// S6.
pub(super) fn coincident(check: &mut Check<'_>) {
    check.recipe(
        "coincident triangles, concentric ones, and shells of a geometric series: they build within 10 times the time of \
         as many random ones, the first of coincident ones is hit, no tree is deep; least time of three builds",
    );
    let n = (check.wanted() as usize).clamp(10, 2_000_000);
    let mut rng = Rng(check.settings.seed);
    let random = of_triangles((0..n).map(|_| {
        let c = rng.in_cube().as_vec3();
        FLAT.map(|v| c + v * 0.01)
    }));
    let shapes = [
        ("coincident", of_triangles((0..n).map(|_| FLAT))),
        ("concentric", of_triangles((0..n).map(|k| FLAT.map(|v| v * (1.0 + k as f32 / n as f32))))),
        ("shells", of_triangles((0..n).map(|k| FLAT.map(|v| v * 1.001f32.powi((k % 20_000) as i32))))),
    ];
    let Some((_, base)) = build(check, &random, 3) else { return };
    for (i, (name, mesh)) in shapes.iter().enumerate() {
        if check.stop(i as f64 / 3.0) {
            return;
        }
        let Some((scene, seconds)) = build(check, mesh, 3) else { return };
        check.measured(format!("{n} {name}: {:.1} times a random mesh ({base:.3} s)", seconds / base));
        check.expect(seconds <= 10.0 * base, || format!("{name}: {seconds} s, random {base} s"));
        let ray = Ray::new(DVec3::new(0.0, 0.0, 1.0), DVec3::NEG_Z);
        let (hit, counts) = scene.closest_hit_counted(&ray);
        let first = hit.map(|h| (h.id.primitive, h.t)) == Some((0, 1.0));
        check.expect(first, || format!("{name}: {hit:?}"));
        let bounded = counts.primitives as usize <= n && scene.stats().depth <= MAX_DEPTH;
        check.expect(bounded, || format!("{name}: {counts:?}, depth {}", scene.stats().depth));
    }
}

/// S7.
pub(super) fn deep(check: &mut Check<'_>) {
    check.recipe(
        "a geometric series 2^-i, a sorted line, and one huge triangle with many tiny ones: depth, and each is hit",
    );
    let n = (check.wanted() as usize).clamp(100, 2_000_000);
    let mut rng = Rng(check.settings.seed);
    let meshes = [
        ("series", of_triangles((0..120).map(|k| FLAT.map(|v| (v + Vec3::X * 3.0) * 2f32.powi(-k))))),
        ("line", of_triangles((0..n).map(|k| FLAT.map(|v| v * 0.4 + Vec3::X * k as f32)))),
        (
            "huge and tiny",
            of_triangles((0..n).map(|k| {
                if k == 0 {
                    return FLAT.map(|v| v * 1e4 - Vec3::Z);
                }
                let c = rng.in_cube().as_vec3() * 0.01;
                FLAT.map(|v| c + v * 1e-5)
            })),
        ),
    ];
    for (name, mesh) in &meshes {
        let Some((scene, seconds)) = build(check, mesh, 1) else { return };
        let depth = scene.stats().depth;
        check.measured(format!("{name}: {} triangles, depth {depth}, {seconds:.3} s", mesh.triangles.len()));
        check.expect(depth <= MAX_DEPTH, || format!("{name}: depth {depth}"));
        let step = (mesh.triangles.len() / 1000).max(1);
        for k in (0..mesh.triangles.len()).step_by(step) {
            let target = mesh.corners(k).iter().sum::<DVec3>() / 3.0;
            let hit = scene.any_hit(&Ray::new(target + DVec3::Z * 0.1, DVec3::NEG_Z));
            check.expect(hit, || format!("{name}: triangle {k} is not hit"));
        }
        if check.stop(0.5) {
            return;
        }
    }
}

/// S8.
pub(super) fn few(check: &mut Check<'_>) {
    check.recipe("0 to 3 triangles, meshes without area, all in one plane, empty meshes: no panic, right answers");
    let count = check.wanted() as usize;
    let ray = Ray::new(DVec3::new(0.1, 0.0, 5.0), DVec3::NEG_Z);
    // The fast tier too: few triangles are no excuse.
    for precision in check.settings.tiers.clone() {
        for n in 0..4 {
            let mesh = of_triangles((0..n).map(|k| FLAT.map(|v| v - Vec3::Z * k as f32)));
            let Some(scene) = scene_of(check, &mesh, DAffine3::IDENTITY, precision) else { return };
            let hit = scene.closest_hit(&ray).map(|h| (h.id.primitive, h.t));
            check.expect(hit == (n > 0).then_some((0, 5.0)), || format!("{precision}: {n} triangles: {hit:?}"));
            check.expect(scene.any_hit(&ray) == (n > 0), || format!("{precision}: {n} triangles, any hit"));
        }
        let point = of_triangles((0..count).map(|_| [Vec3::ZERO; 3]));
        let line = of_triangles((0..count).map(|k| [Vec3::ZERO, Vec3::X * k as f32, Vec3::X * 2.0 * k as f32]));
        for mesh in [point, line] {
            let Some(scene) = scene_of(check, &mesh, DAffine3::IDENTITY, precision) else { return };
            let degenerate = scene.stats().degenerate_triangles;
            check.expect(degenerate == count as u64, || format!("{precision}: {degenerate} of {count} without area"));
            for target in [DVec3::ZERO, DVec3::X, DVec3::X * 0.3] {
                let from = DVec3::new(0.0, 1.0, 3.0);
                let hit = scene.closest_hit(&Ray::segment(from, target * 2.0 - from));
                check.expect(hit.is_none(), || format!("{precision}: hit what has no area: {hit:?}"));
            }
        }
        // All in one plane: flat boxes everywhere.
        let mut rng = Rng(check.settings.seed);
        let plane = of_triangles((0..count).map(|_| {
            let c = Vec3::new(rng.signed() as f32, rng.signed() as f32, 0.0) * 10.0;
            FLAT.map(|v| c + v)
        }));
        let Some(scene) = scene_of(check, &plane, DAffine3::IDENTITY, precision) else { return };
        for k in 0..count {
            let target = plane.corners(k).iter().sum::<DVec3>() / 3.0;
            let hit = scene.any_hit(&Ray::new(target + DVec3::Z, DVec3::NEG_Z));
            check.expect(hit, || format!("{precision}: triangle {k} of a plane is not hit"));
        }
    }
    // A mesh without instances, an empty mesh, a geometry without triangles.
    let mut builder = SceneBuilder::default();
    builder.add_mesh(vec![triangles(&icosphere(1))]);
    let empty = builder.add_mesh(vec![]);
    let none = builder.add_mesh(vec![Geometry::Triangles { positions: vec![], triangles: vec![] }]);
    builder.add_instance(empty, DAffine3::IDENTITY);
    builder.add_instance(none, DAffine3::IDENTITY);
    let nothing = builder.build().map(|scene| scene.closest_hit(&ray).is_none());
    check.expect(nothing == Ok(true), || format!("empty meshes: {nothing:?}"));
}
