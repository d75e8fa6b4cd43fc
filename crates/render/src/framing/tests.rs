use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_geometry::shapes::Sphere;
use firsthit_geometry::{Ray, Shape};
use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DQuat, Vec3};

use super::*;

const ASPECT: f64 = 1.6;

/// A quadrilateral a, b, c, d, seen counter-clockwise from its front.
fn quads(corners: &[[Vec3; 4]]) -> SurfaceDesc {
    let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
    let triangles = (0..corners.len() as u32).map(|i| 4 * i).flat_map(|i| [[i, i + 1, i + 2], [i, i + 2, i + 3]]);
    SurfaceDesc::Triangles(TriangleMesh { triangles: triangles.collect(), positions, ..Default::default() })
}

/// The sides of a box (-x, +x, -y, +y, -z, +z) with this half size around a point, fronts outward or inward.
fn sides(half: Vec3, at: Vec3, inward: bool) -> Vec<[Vec3; 4]> {
    let mut sides = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let n = Vec3::AXES[axis] * sign;
            let (a, b) = (Vec3::AXES[(axis + 1) % 3], Vec3::AXES[(axis + 2) % 3] * sign);
            let mut side = [-a - b, a - b, a + b, b - a].map(|c| at + (n + c) * half);
            if inward {
                side.reverse();
            }
            sides.push(side);
        }
    }
    sides
}

fn scene(surfaces: Vec<SurfaceDesc>, transform: DAffine3) -> SceneDesc {
    let geometries =
        surfaces.into_iter().map(|surface| GeometryDesc { name: String::new(), surface, material: None }).collect();
    SceneDesc {
        meshes: vec![MeshDesc { name: String::new(), geometries }],
        instances: vec![InstanceDesc { name: String::new(), mesh: 0, transform, moves_to: None }],
        ..Default::default()
    }
}

fn framed(desc: &SceneDesc) -> (Framing, Scene) {
    let scene = SceneBuilder::from_desc(desc, BuildOptions::default()).build().unwrap();
    (frame(desc, &scene, ASPECT), scene)
}

/// Where points are in the picture: the least and greatest x and y, from -1 to 1.
fn extent(camera: &Camera, points: &[DVec3]) -> [f64; 4] {
    let tan = (0.5 * OUTSIDE_FOV).tan();
    points.iter().fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY], |e, p| {
        let d = *p - camera.position();
        let z = d.dot(camera.forward());
        assert!(z > 0.0, "behind the camera");
        let (x, y) = (d.dot(camera.right()) / (z * tan * ASPECT), d.dot(camera.up()) / (z * tan));
        [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)]
    })
}

fn assert_fills_the_picture(camera: &Camera, points: &[DVec3]) {
    let [left, bottom, right, top] = extent(camera, points);
    let edge = 1.0 - 2.0 * MARGIN + 1e-6;
    assert!(left >= -edge && bottom >= -edge && right <= edge && top <= edge, "{left} {bottom} {right} {top}");
    assert!((right - left).max(top - bottom) > 2.0 * edge - 0.01, "as large as fits");
    assert!((right + left).abs() < 1e-3 && (top + bottom).abs() < 1e-3, "in the middle: {left} {bottom} {right} {top}");
}

fn box_corners(half: Vec3, transform: &DAffine3) -> Vec<DVec3> {
    sides(half, Vec3::ZERO, false).iter().flatten().map(|p| transform.transform_point3(p.as_dvec3())).collect()
}

#[test]
fn an_object_fills_the_picture_in_three_quarter_view() {
    let half = Vec3::new(1.0, 0.8, 0.9);
    let (f, _) = framed(&scene(vec![quads(&sides(half, Vec3::ZERO, false))], DAffine3::IDENTITY));
    assert!(!f.inside);
    assert_fills_the_picture(&f.camera, &box_corners(half, &DAffine3::IDENTITY));
    let away = -f.camera.forward();
    assert!(away.x > 0.3 && away.y > 0.2 && away.z > 0.7, "{away}");
    assert_eq!(f.reason, "three-quarter view, fitted to the model");
}

/// The same picture at any size and place: the camera moves along.
#[test]
fn scale_and_place_do_not_matter() {
    let half = Vec3::new(1.0, 0.8, 0.9);
    let object = || vec![quads(&sides(half, Vec3::ZERO, false))];
    let room = || vec![quads(&sides(Vec3::new(3.0, 1.0, 2.0), Vec3::ZERO, true))];
    for (scale, offset) in [(1e-6, DVec3::ZERO), (1e6, DVec3::ZERO), (1.0, DVec3::splat(1e7)), (1e-3, DVec3::X * 1e4)] {
        let transform = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), DQuat::IDENTITY, offset);
        for surfaces in [object(), room()] {
            let (still, _) = framed(&scene(surfaces.clone(), DAffine3::IDENTITY));
            let (moved, _) = framed(&scene(surfaces, transform));
            assert_eq!(moved.inside, still.inside);
            if !still.inside {
                let expected = still.camera.position() * scale + offset;
                let error = (moved.camera.position() - expected).length();
                assert!(error < 1e-6 * scale + 1e-9 * offset.length(), "{scale} {offset}: {error}");
                assert!((moved.camera.forward() - still.camera.forward()).length() < 1e-6);
            }
        }
    }
}

#[test]
fn a_room_is_seen_from_inside_along_its_length() {
    let (f, scene) =
        framed(&scene(vec![quads(&sides(Vec3::new(9.0, 2.0, 3.0), Vec3::ZERO, true))], DAffine3::IDENTITY));
    assert!(f.inside);
    let p = f.camera.position();
    assert!(p.x.abs() < 9.0 && p.z.abs() < 3.0 && (p.y - (1.7 - 2.0)).abs() < 1e-6, "eye height: {p}");
    assert!(f.camera.forward().x.abs() > 0.9, "along the length: {}", f.camera.forward());
    let ahead = scene.closest_hit(&Ray::new(p, f.camera.forward())).unwrap();
    assert!(ahead.t > 12.0, "most of the length is in front");
}

/// The same walls seen from their backs are a solid box.
#[test]
fn a_closed_solid_is_not_a_room() {
    let (f, _) = framed(&scene(vec![quads(&sides(Vec3::new(9.0, 2.0, 3.0), Vec3::ZERO, false))], DAffine3::IDENTITY));
    assert!(!f.inside);
}

#[test]
fn a_room_with_one_open_side_is_looked_into() {
    for (open, side) in [(5, DVec3::Z), (4, DVec3::NEG_Z), (0, DVec3::NEG_X)] {
        let mut walls = sides(Vec3::ONE, Vec3::ZERO, true);
        walls.remove(open);
        let (f, scene) = framed(&scene(vec![quads(&walls)], DAffine3::IDENTITY));
        assert!(!f.inside);
        assert!((f.camera.forward() + side).length() < 1e-9, "{side}: {}", f.camera.forward());
        assert_fills_the_picture(&f.camera, &box_corners(Vec3::ONE, &DAffine3::IDENTITY));
        let back = scene.closest_hit(&Ray::new(f.camera.position(), f.camera.forward())).unwrap();
        assert!(back.normal().dot(side) > 0.99, "the far wall is seen from its front");
    }
}

#[test]
fn a_sheet_is_faced() {
    let sheet =
        [Vec3::new(-2.0, -1.0, 0.0), Vec3::new(2.0, -1.0, 0.0), Vec3::new(2.0, 1.0, 0.0), Vec3::new(-2.0, 1.0, 0.0)];
    for turn in [0.0, 1.0, 2.0, 3.0] {
        let quarter = std::f64::consts::FRAC_PI_2;
        let transform = DAffine3::from_rotation_y(turn * quarter);
        let (f, _) = framed(&scene(vec![quads(&[sheet])], transform));
        let facing = transform.transform_vector3(DVec3::Z).dot(-f.camera.forward());
        assert!(facing > 0.95, "quarter turn {turn}: {facing}");
        // Mirrored by the instance, the front is still the side that was the front.
        let (f, _) =
            framed(&scene(vec![quads(&[sheet])], transform * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))));
        assert!(transform.transform_vector3(DVec3::Z).dot(-f.camera.forward()) > 0.95);
    }
    for up in [1.0, -1.0] {
        let lying = DAffine3::from_rotation_x(-up * std::f64::consts::FRAC_PI_2);
        let (f, _) = framed(&scene(vec![quads(&[sheet])], lying));
        assert!(-f.camera.forward().y * up > 0.7, "{}", f.camera.forward());
    }
}

#[test]
fn a_wide_ground_is_left_out() {
    let ground = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]| Vec3::new(50.0 * x, -0.8, 50.0 * z));
    let half = Vec3::new(1.0, 0.8, 0.9);
    let (f, _) = framed(&scene(vec![quads(&[ground]), quads(&sides(half, Vec3::ZERO, false))], DAffine3::IDENTITY));
    assert_fills_the_picture(&f.camera, &box_corners(half, &DAffine3::IDENTITY));
    assert!(f.reason.ends_with("the ground may go beyond the picture"));
    // Alone, it is the subject.
    let (f, _) = framed(&scene(vec![quads(&[ground])], DAffine3::IDENTITY));
    assert!(f.camera.position().y > 20.0);
}

#[test]
fn shapes_are_framed_by_their_surface() {
    let center = DVec3::new(3.0, 1.0, -2.0);
    let sphere = Shape::Sphere(Sphere::new(center, 0.5).unwrap());
    let (f, _) = framed(&scene(vec![SurfaceDesc::Shape(sphere)], DAffine3::IDENTITY));
    let sight = (center - f.camera.position()).normalize();
    assert!(sight.angle_between(f.camera.forward()) < 0.02);
    // Its silhouette's angle, against the usable half angle of view; its points are a grid, hence the tolerance.
    let silhouette = (0.5 / (center - f.camera.position()).length()).asin().tan();
    let usable = (0.5 * OUTSIDE_FOV).tan() * (1.0 - 2.0 * MARGIN);
    assert!((silhouette / usable - 1.0).abs() < 0.05, "{silhouette} {usable}");
}

#[test]
fn there_is_a_camera_for_nothing_and_for_a_point() {
    let (f, _) = framed(&SceneDesc::default());
    assert_eq!(f.reason, "there is nothing to frame");
    let point = quads(&[[Vec3::splat(3.0); 4]]);
    let (f, _) = framed(&scene(vec![point], DAffine3::from_translation(DVec3::splat(1e6))));
    let sight = (DVec3::splat(1e6 + 3.0) - f.camera.position()).normalize();
    assert!((sight - f.camera.forward()).length() < 1e-6);
}
