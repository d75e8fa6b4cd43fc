//! Nearest points on shapes and on primitives of the user's own, among triangles.

use std::sync::Arc;

use firsthit_accel::{
    BuildOptions, ClosestPoint, Geometry, Layout, Level, Scene, SceneBuilder, SignMethod, Solid, UserPrimitives,
    reference,
};
use firsthit_geometry::distance::Feature;
use firsthit_geometry::shapes::{ClosestOnSurface, Cuboid, Disk, Plane, Polygon, Quadric, Sphere};
use firsthit_geometry::{Aabb, Ray, Shape, SurfaceHit, shapes};
use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::nearest::same;
use crate::single::{mesh, place, vector};
use crate::user::Balls;

/// One of each shape, about a place.
fn shapes_at(at: DVec3, axis: DVec3, size: f64) -> Vec<Shape<f64>> {
    let axis = axis.normalize_or(DVec3::Y);
    let (side, other) = axis.any_orthonormal_pair();
    let corners = [side, other, -side, -other].map(|p| at + p * size).to_vec();
    let cone = Quadric::cone(size, at.y, at.y + size).expect("a cone");
    vec![
        Sphere::new(at, size).expect("a sphere").into(),
        Disk::new(at, axis, size, 0.4 * size).expect("a disk").into(),
        Polygon::new(vec![corners]).expect("a polygon").into(),
        Cuboid::new(at - size, at + DVec3::new(size, 2.0 * size, 0.0)).expect("a box").into(),
        Quadric::ellipsoid(DVec3::new(size, 0.3, 1.0)).expect("an ellipsoid").into(),
        Quadric::cylinder(size, at.y, f64::INFINITY).expect("a cylinder").into(),
        shapes::Solid::new(cone).into(),
        Quadric::paraboloid(size, 1.0).expect("a bowl").into(),
    ]
}

fn built(options: BuildOptions, mesh: &[Geometry], places: &[DAffine3]) -> Scene {
    let mut builder = SceneBuilder::new(options);
    let index = builder.add_mesh(mesh.to_vec());
    places.iter().for_each(|place| _ = builder.add_instance(index, *place));
    builder.build().expect("good shapes")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn shapes_have_the_nearest_points_of_the_slow_twin(
        at in prop::collection::vec((vector(), vector(), 0.05..1.0f64), 1..6), plane: bool, balls in 0usize..4,
        (positions, triangles) in mesh(), places in prop::collection::vec(place(), 1..6),
        points in prop::collection::vec((any::<prop::sample::Index>(), vector(), prop::sample::select(vec![0.01, 1.0, 3.0, 1e4, 1e12])), 12),
        radius in prop::sample::select(vec![0.0, 0.1, 1.0, 10.0]), count in 0usize..9,
    ) {
        let mut parts: Vec<Geometry> = at.iter().flat_map(|(at, axis, size)| shapes_at(*at, *axis, *size)).map(Geometry::Shape).collect();
        parts.push(Geometry::Triangles { positions, triangles });
        let spheres = at.iter().map(|(at, axis, size)| Sphere::new(*at + *axis, *size).expect("a sphere"));
        parts.push(Geometry::User(Arc::new(Balls(spheres.take(balls).collect()))));
        if plane {
            parts.push(Geometry::Shape(Plane::new(at[0].1 * 3.0, at[0].0 + DVec3::X * 2.0).expect("a plane").into()));
        }
        for layout in Layout::ALL {
            for simd in [Level::Scalar, Level::default()] {
                let scene = built(BuildOptions { layout, simd, ..BuildOptions::default() }, &parts, &places);
                let of = |(which, off, far): &(prop::sample::Index, DVec3, f64)| which.get(&places).translation + *off * *far;
                let points: Vec<DVec3> = points.iter().map(of).collect();
                let (mut batch, mut within) = (vec![None; points.len()], vec![None; points.len()]);
                scene.closest_points(&points, f64::INFINITY, &mut batch);
                scene.par_closest_points(&points, radius, &mut within);
                for ((p, batch), within) in points.iter().zip(batch).zip(within) {
                    let expected = reference::closest_point(&scene, *p);
                    same(&scene.closest_point(*p), &expected)?;
                    same(&batch, &expected)?;
                    prop_assert_eq!(Some(scene.distance(*p)), expected.map(|e| e.distance));
                    same(&within, &reference::nearest_k(&scene, *p, 1, radius).first().copied())?;
                    let (got, near) = (scene.nearest_k(*p, count, radius), reference::nearest_k(&scene, *p, count, radius));
                    prop_assert_eq!(got.len(), near.len());
                    for (got, expected) in got.iter().zip(&near) {
                        same(&Some(*got), &Some(*expected))?;
                    }
                }
            }
        }
    }

    /// Against formulas, in instances that keep angles: and those of the user are no other than those that are known.
    #[test]
    fn the_user_s_balls_are_as_near_as_spheres(
        balls in prop::collection::vec((vector(), 0.01..0.5f64), 1..40), turn in vector(), angle in -3.0..3.0f64,
        scale in prop::sample::select(vec![1.0, 0.01, 300.0]), points in prop::collection::vec(vector(), 12),
    ) {
        let place = DAffine3::from_translation(turn * 9.0)
            * DAffine3::from_axis_angle(turn.normalize_or(DVec3::X), angle) * DAffine3::from_scale(DVec3::splat(scale));
        let spheres: Vec<_> = balls.iter().map(|(c, r)| Sphere::new(*c, *r).expect("a sphere")).collect();
        let known: Vec<_> = spheres.iter().map(|s| Geometry::Shape((*s).into())).collect();
        let known = built(BuildOptions::default(), &known, &[place]);
        let user = built(BuildOptions::default(), &[Geometry::User(Arc::new(Balls(spheres)))], &[place]);
        for p in &points {
            let p = place.transform_point3(*p * 2.0);
            let of = |(c, r): &(DVec3, f64)| (place.transform_point3(*c).distance(p) - r * scale).abs();
            let least = balls.iter().map(of).fold(f64::INFINITY, f64::min);
            let room = 1e-13 * (1.0 + p.length() + scale);
            for (scene, which) in [(&known, 0), (&user, 1)] {
                let got = scene.closest_point(p).expect("a ball");
                prop_assert!((got.distance - least).abs() <= room, "{} {}", got.distance, least);
                prop_assert!((got.point.distance(p) - got.distance).abs() <= room);
                prop_assert!(got.feature == Feature::Face && (which == 0 || (got.u, got.v) == (0.25, 0.5)));
                // The way there is along the normal.
                let (c, _) = balls[[got.id.geometry, got.id.primitive][which] as usize];
                let outward = (got.point - place.transform_point3(c)).normalize();
                prop_assert!(got.normal().dot(outward) > 1.0 - 1e-9, "{:?} {outward}", got.normal());
            }
        }
    }
}

/// A sphere becomes an ellipsoid, a box a parallelepiped; what has no nearest points there is left out.
#[test]
fn stretched_instances() {
    let cube = Geometry::Shape(Cuboid::new(DVec3::ZERO, DVec3::ONE).expect("a box").into());
    let ball = Geometry::Shape(Sphere::new(DVec3::ZERO, 1.0).expect("a sphere").into());
    let can = Geometry::Shape(shapes::Solid::new(Quadric::cylinder(1.0, 0.0, 2.0).expect("a cylinder")).into());
    let user = Geometry::User(Arc::new(Balls(vec![Sphere::new(DVec3::ZERO, 1.0).expect("a sphere")])));
    let nearest = |part: &Geometry, place: DAffine3, p: [f64; 3]| {
        built(BuildOptions::default(), std::slice::from_ref(part), &[place]).closest_point(DVec3::from(p))
    };
    let flat = DAffine3::from_scale(DVec3::new(4.0, 1.0, 0.5));
    assert_eq!(nearest(&ball, flat, [0.0, 0.0, 3.0]).map(|n| (n.point, n.normal())), Some((DVec3::Z * 0.5, DVec3::Z)));
    assert_eq!(nearest(&ball, flat, [0.0, 0.0, 0.0]).map(|n| n.distance), Some(0.5));
    let slanted = DAffine3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z, DVec3::ZERO);
    assert_eq!(nearest(&cube, slanted, [0.0, 1.0, 0.5]).map(|n| n.point), Some(DVec3::new(0.5, 0.5, 0.5)));
    for part in [&can, &user] {
        assert!(nearest(part, flat, [3.0, 1.0, 0.0]).is_none());
        let near = nearest(part, DAffine3::from_scale(DVec3::splat(-2.0)), [5.0, 0.0, 0.0]).expect("nearest points");
        assert!((near.point - DVec3::X * 2.0).length() < 1e-15 && near.normal().dot(DVec3::X) > 0.999, "{near:?}");
    }
    assert!(nearest(&can, DAffine3::IDENTITY, [0.2, 1.9, 0.0]).is_some_and(|n| n.normal() == DVec3::Y));
}

/// What a user says is checked.
#[test]
fn odd_points_of_the_user_are_not_taken() {
    #[derive(Debug)]
    struct Odd(DVec3);
    impl UserPrimitives for Odd {
        fn count(&self) -> u32 {
            1
        }
        fn bounds(&self, _: u32) -> Aabb<f64> {
            Aabb::new(DVec3::ZERO, DVec3::ONE)
        }
        fn closest_hit(&self, _: u32, _: &Ray<f64>) -> Option<SurfaceHit<f64>> {
            None
        }
        fn closest_point(&self, _: u32, point: DVec3) -> Option<ClosestOnSurface> {
            assert!(point.is_finite());
            Some(ClosestOnSurface { point: self.0, u: f64::NAN, v: 0.0, normal: None })
        }
    }
    let scene = |p: DVec3| built(BuildOptions::default(), &[Geometry::User(Arc::new(Odd(p)))], &[DAffine3::IDENTITY]);
    for p in [DVec3::NAN, DVec3::INFINITY] {
        assert!(scene(p).closest_point(DVec3::ONE).is_none() && scene(p).nearest_k(DVec3::ONE, 2, 9.0).is_empty());
    }
    let near: ClosestPoint = scene(DVec3::ZERO).closest_point(DVec3::X).expect("a point");
    assert_eq!((near.distance, near.normal_direction), (1.0, DVec3::ZERO));
}

/// A body is made of triangles: what else is there does not count, by any method.
#[test]
fn signed_distances_are_those_of_the_triangles() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let body = Geometry::Triangles { positions, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] };
    let ball = Geometry::Shape(Sphere::new(DVec3::splat(0.2), 0.05).expect("a sphere").into());
    let scenes = [vec![body.clone()], vec![body, ball]]
        .map(|parts| built(BuildOptions::default(), &parts, &[DAffine3::IDENTITY]));
    for method in [SignMethod::Winding, SignMethod::Parity { votes: 1 }, SignMethod::Pseudonormal, SignMethod::Exact] {
        let [alone, beside] = scenes.each_ref().map(|scene| Solid::with_method(scene, method));
        for i in 0..1000 {
            let p = DVec3::new((i % 10) as f64, (i / 10 % 10) as f64, (i / 100) as f64) * 0.11 - 0.25;
            assert_eq!(alone.signed_distance(p), beside.signed_distance(p), "{method:?} {p}");
        }
    }
    assert!(scenes[1].distance(DVec3::splat(0.2)) < scenes[0].distance(DVec3::splat(0.2)));
}
