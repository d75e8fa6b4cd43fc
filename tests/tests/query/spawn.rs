//! S4: rays that leave a surface do not meet it again, and do not jump over what is near.

use firsthit_accel::{Geometry, Scene, SceneBuilder, SurfacePoint};
use firsthit_geometry::{Precision, Ray, Shape, shapes::Sphere};
use firsthit_tests::oracle::{Mesh, Rng, torus};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use crate::{options, scene_of};

/// Scales and offsets of the scenario, with a rotation so that nothing is axis-parallel.
fn places() -> impl Iterator<Item = DAffine3> {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -1.0, 0.7).normalize(), 0.8);
    [1e-5, 1e-2, 1.0, 1e3, 1e6].into_iter().flat_map(move |scale| {
        [0.0, 1.0, 1e3, 1e6].into_iter().map(move |offset| {
            DAffine3::from_scale_rotation_translation(
                DVec3::splat(scale),
                turn,
                DVec3::new(offset, -offset, 0.7 * offset),
            )
        })
    })
}

/// A random direction on the side of the normal, often grazing.
fn leaving(rng: &mut Rng, normal: DVec3) -> DVec3 {
    let d = rng.direction();
    let d = d * d.dot(normal).signum();
    if rng.below(2) == 0 { d } else { (d - normal * d.dot(normal) * 0.999).normalize() }
}

/// Hits on the same primitive, of rays that bounce off `scene`; and the mean offset in units of f32 rounding of the
/// object's size.
fn bounce(scene: &Scene, place: DAffine3, count: usize) -> (usize, f64) {
    let mut rng = Rng(51);
    let (mut again, mut bounces, mut offset) = (0, 0, 0.0);
    for _ in 0..count {
        let origin = place.transform_point3(rng.direction() * 3.0);
        let target = place.transform_point3(rng.in_cube());
        let ray = Ray::new(origin, target - origin);
        let Some(hit) = scene.closest_hit(&ray) else { continue };
        let point: SurfacePoint = scene.surface_point(&ray, &hit);
        bounces += 1;
        offset += point.error / place.matrix3.x_axis.length();
        for side in [1.0, -1.0] {
            let direction = leaving(&mut rng, hit.normal() * side);
            // No source is skipped here: the offset alone must do.
            let away = Ray::new(point.spawn(direction), direction);
            let next = scene.closest_hit(&away);
            // Nor does it change anything where it is left out.
            assert_eq!(next, scene.closest_hit_from(&away, hit.id));
            assert_eq!(next.is_some(), scene.any_hit_from(&away, hit.id));
            again += usize::from(next.is_some_and(|n| n.id == hit.id && n.t * 1e3 < place.matrix3.x_axis.length()));
        }
    }
    assert!(bounces > count / 20, "{bounces}");
    (again, offset / f64::from(bounces as u32) / f64::from(f32::EPSILON))
}

#[test]
fn triangles_are_not_met_again() {
    let mut rng = Rng(8);
    // Slivers of aspect 1e5 through the middle.
    let mut slivers = Mesh::default();
    for k in 0..200u32 {
        let (a, b) = (rng.direction(), rng.direction());
        slivers.positions.extend([-a, a, a + b * 1e-5].map(|p| p.as_vec3()));
        slivers.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    // Wide enough to be hit by chance: triangles through the middle.
    let mut wide = Mesh::default();
    for k in 0..10u32 {
        wide.positions.extend([rng.direction(), rng.direction(), rng.direction()].map(|p| p.as_vec3()));
        wide.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    wide.positions.extend(slivers.positions);
    wide.triangles.extend(slivers.triangles.iter().map(|t| t.map(|i| i + 30)));
    for (name, mesh) in [("torus", torus(64, 32, 0.5)), ("soup and slivers", wide)] {
        for precision in Precision::ALL {
            let mut worst: f64 = 0.0;
            for place in places() {
                let scene = scene_of(&mesh, place, precision);
                let (again, offset) = bounce(&scene, place, 4000);
                assert_eq!(again, 0, "{name} {precision} {place:?}");
                worst = worst.max(offset);
            }
            println!("{name} {precision}: largest mean offset {worst:.4} ulp (f32) of the object's size");
        }
    }
}

#[test]
fn spheres_are_not_met_again_from_outside() {
    for precision in Precision::ALL {
        for place in places() {
            let mut builder = SceneBuilder::new(options(precision));
            let sphere = Shape::Sphere(Sphere::new(DVec3::new(0.2, 0.1, 0.0), 0.8).expect("good"));
            let m = builder.add_mesh(vec![Geometry::Shape(sphere)]);
            builder.add_instance(m, place);
            let scene = builder.build().expect("a good scene");
            let mut rng = Rng(9);
            for _ in 0..2000 {
                let origin = place.transform_point3(rng.direction() * 3.0);
                let ray = Ray::new(origin, place.transform_point3(rng.in_cube()) - origin);
                let Some(hit) = scene.closest_hit(&ray) else { continue };
                let point = scene.surface_point(&ray, &hit);
                let out = leaving(&mut rng, hit.normal());
                assert!(!scene.any_hit(&Ray::new(point.spawn(out), out)), "{precision} {place:?}");
                // Inwards it must meet the other side, well away.
                let inward = -leaving(&mut rng, hit.normal());
                assert!(scene.any_hit(&Ray::new(point.spawn(inward), inward)), "{precision} {place:?}");
            }
        }
    }
}

/// The offset is not so large that light leaks: what lies 16 ulp (f32) above is met.
#[test]
fn a_gap_of_sixteen_ulp_is_not_jumped() {
    for (scale, offset) in [(1.0f32, 0.0f32), (1e-4, 0.0), (1e5, 0.0), (1.0, 100.0)] {
        let z = offset + scale;
        let gap = 16.0 * (z.next_up() - z);
        let at = |x: f32, y: f32, z: f32| Vec3::new(x * scale + offset, y * scale + offset, z);
        let mut mesh = Mesh::default();
        for z in [z, z + gap] {
            mesh.positions.extend([at(-1.0, -1.0, z), at(1.0, -1.0, z), at(0.0, 1.0, z)]);
        }
        mesh.triangles = vec![[0, 1, 2], [3, 4, 5]];
        for precision in [Precision::Robust, Precision::Double] {
            let scene = scene_of(&mesh, DAffine3::IDENTITY, precision);
            let mut rng = Rng(10);
            for _ in 0..2000 {
                let target = DVec3::new(rng.signed() * 0.2, rng.signed() * 0.2, 0.0) * f64::from(scale)
                    + DVec3::new(f64::from(offset), f64::from(offset), f64::from(z));
                let ray = Ray::new(target - DVec3::Z * f64::from(scale), DVec3::Z);
                let hit = scene.closest_hit(&ray).expect("aimed at");
                assert_eq!(hit.id.primitive, 0);
                let point = scene.surface_point(&ray, &hit);
                let up = DVec3::Z + rng.in_cube() * 0.5;
                let next = scene.closest_hit(&Ray::new(point.spawn(up), up));
                assert_eq!(next.map(|n| n.id.primitive), Some(1), "{precision} {scale} {offset}");
            }
        }
    }
}

#[test]
fn the_source_is_skipped_but_not_its_neighbours() {
    let mesh = torus(16, 8, 0.5);
    let scene = scene_of(&mesh, DAffine3::IDENTITY, Precision::Robust);
    let ray = Ray::new(DVec3::new(1.0, 0.2, 3.0), DVec3::NEG_Z);
    let first = scene.closest_hit(&ray).expect("above the tube");
    let second = scene.closest_hit_filtered(&ray, Some(first.id), |_| true).expect("below it");
    assert!(second.t > first.t && second.id != first.id);
}

/// S4: 10^6 bounces at scales 1e-5 to 1e6 and offsets to 1e6.
#[test]
fn a_million_bounced_rays_do_not_meet_what_they_left() {
    crate::holds("S4", 300_000);
}
