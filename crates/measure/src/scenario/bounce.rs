//! S4: rays that leave a surface do not meet it again, and do not jump over what is near.

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::shapes::Sphere;
use firsthit_geometry::{Precision, Ray, Shape};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::{Check, scene_of};
use crate::mesh::{Mesh, torus};
use crate::random::Rng;

/// Scales from 1e-5 to 1e6 and offsets to 1e6, turned so that nothing is axis-parallel.
fn places() -> Vec<DAffine3> {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -1.0, 0.7).normalize(), 0.8);
    let place = |scale: f64, offset: f64| {
        let at = DVec3::new(offset, -offset, 0.7 * offset);
        DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turn, at)
    };
    [1e-5, 1e-2, 1.0, 1e3, 1e6].into_iter().flat_map(|s| [0.0, 1.0, 1e3, 1e6].map(|o| place(s, o))).collect()
}

/// Slivers of aspect 1e5 through the middle, and a few wide triangles that are hit by chance.
fn slivers(rng: &mut Rng) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..210u32 {
        let (a, b) = (rng.direction(), rng.direction());
        let corners = if k < 10 { [a, b, rng.direction()] } else { [-a, a, a + b * 1e-5] };
        mesh.positions.extend(corners.map(|p| p.as_vec3()));
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    mesh
}

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "cosine-like and grazing rays to both sides from hits on a torus, on slivers of aspect 1e5 and on a sphere, at \
         scales 1e-5 to 1e6 and offsets to 1e6; no source is named, the offset alone must do. And from a triangle to one \
         16 ulp (f32) above it, which must be met",
    );
    let mut rng = Rng(check.settings.seed);
    let meshes = [("torus", torus(64, 32, 0.5)), ("slivers", slivers(&mut rng))];
    let tiers = check.tiers();
    let places = places();
    let each = check.wanted().div_ceil((tiers.len() * places.len()).max(1) as u64);
    for &precision in &tiers {
        let (mut offsets, mut at_origin) = (Vec::new(), Vec::new());
        for (i, &place) in places.iter().enumerate() {
            if check.stop(i as f64 / places.len() as f64) {
                return;
            }
            for (name, mesh) in &meshes {
                let Some(scene) = scene_of(check, mesh, place, precision) else { return };
                let offset = bounce(check, name, &scene, place, each, false, &mut rng);
                if *name == "torus" {
                    offsets.push(offset);
                    at_origin.extend((place.translation == DVec3::ZERO).then_some(offset));
                }
            }
            let Some(scene) = sphere(check, place, precision) else { return };
            bounce(check, "sphere", &scene, place, each, true, &mut rng);
        }
        let worst = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
        check.measured(format!(
            "{precision}: mean offset on the torus {:.1e} ulp (f32) of its size, {:.1e} at the worst place",
            worst(&at_origin),
            worst(&offsets)
        ));
        gaps(check, precision, each);
    }
}

fn sphere(check: &mut Check<'_>, place: DAffine3, precision: Precision) -> Option<Scene> {
    let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
    let shape = Sphere::new(DVec3::new(0.2, 0.1, 0.0), 0.8).ok()?;
    let m = builder.add_mesh(vec![Geometry::Shape(Shape::Sphere(shape))]);
    builder.add_instance(m, place);
    builder.build().map_err(|e| check.fail(1, || format!("a good sphere was refused: {e}"))).ok()
}

/// Bounces rays; the answer is the mean offset in f32 ulps of the object's size.
fn bounce(
    check: &mut Check<'_>,
    name: &str,
    scene: &Scene,
    place: DAffine3,
    count: u64,
    convex: bool,
    rng: &mut Rng,
) -> f64 {
    let size = place.matrix3.x_axis.length();
    let precision = scene.options().precision;
    let (mut offset, mut bounces) = (0.0, 0u32);
    for _ in 0..count {
        let origin = place.transform_point3(rng.direction() * 3.0);
        let ray = Ray::new(origin, place.transform_point3(rng.in_cube()) - origin);
        let Some(hit) = scene.closest_hit(&ray) else { continue };
        let point = scene.surface_point(&ray, &hit);
        offset += point.error / size;
        bounces += 1;
        for side in [1.0, -1.0] {
            let d = rng.direction();
            let d = d * d.dot(hit.normal()).signum() * side;
            let d = if rng.below(2) == 0 { d } else { (d - hit.normal() * d.dot(hit.normal()) * 0.999).normalize() };
            let next = scene.closest_hit(&Ray::new(point.spawn(d), d));
            let again = next.is_some_and(|n| n.id == hit.id);
            // A sphere is met again from inside, at its other side, and only then.
            let right = if convex { again == (side < 0.0) } else { !again };
            check.expect(right, || format!("{name}, {precision}, {place:?}: {hit:?}, then {next:?}"));
        }
    }
    offset / f64::from(bounces.max(1)) / f64::from(f32::EPSILON)
}

/// The offset is not so large that light leaks.
fn gaps(check: &mut Check<'_>, precision: Precision, count: u64) {
    for (scale, offset) in [(1.0f32, 0.0f32), (1e-4, 0.0), (1e5, 0.0), (1.0, 100.0)] {
        let z = offset + scale;
        let gap = 16.0 * (z.next_up() - z);
        let at = |x: f32, y: f32, z: f32| Vec3::new(x * scale + offset, y * scale + offset, z);
        let mut mesh = Mesh { positions: Vec::new(), triangles: vec![[0, 1, 2], [3, 4, 5]] };
        for z in [z, z + gap] {
            mesh.positions.extend([at(-1.0, -1.0, z), at(1.0, -1.0, z), at(0.0, 1.0, z)]);
        }
        let Some(scene) = scene_of(check, &mesh, DAffine3::IDENTITY, precision) else { return };
        let (scale, offset, z) = (f64::from(scale), f64::from(offset), f64::from(z));
        let mut rng = Rng(check.settings.seed);
        for _ in 0..count {
            let target = DVec3::new(rng.signed() * 0.2 * scale + offset, rng.signed() * 0.2 * scale + offset, z);
            let ray = Ray::new(target - DVec3::Z * scale, DVec3::Z);
            let next = scene.closest_hit(&ray).map(|hit| {
                let up = DVec3::Z + rng.in_cube() * 0.5;
                scene.closest_hit(&Ray::new(scene.surface_point(&ray, &hit).spawn(up), up)).map(|n| n.id.primitive)
            });
            check.expect(next == Some(Some(1)), || format!("{precision}: a gap of 16 ulp at scale {scale}: {next:?}"));
        }
    }
}
