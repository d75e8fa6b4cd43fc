//! Analytic shapes in scenes: placed anywhere, bounded or not, and left by rays.

use firsthit_accel::{Geometry, Scene, SceneBuilder, VisitOrder, reference};
use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Precision, Ray, Shape};
use firsthit_tests::oracle::{Rng, icosphere};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::{options, triangles};

/// One of each kind, within a few units of the origin (but for the plane), and whether it is convex and closed.
fn shapes() -> Vec<(Shape<f64>, bool)> {
    let square = vec![
        DVec3::new(-1.0, -1.0, 0.1),
        DVec3::new(1.0, -1.0, 0.1),
        DVec3::new(1.0, 1.0, 0.1),
        DVec3::new(-1.0, 1.0, 0.1),
    ];
    let hole = vec![DVec3::new(-0.3, -0.3, 0.1), DVec3::new(0.3, -0.3, 0.1), DVec3::new(0.0, 0.4, 0.1)];
    vec![
        (Shape::Sphere(Sphere::new(DVec3::new(0.1, 0.2, 0.3), 0.8).unwrap()), true),
        (Shape::Plane(Plane::new(DVec3::new(0.0, -0.2, 0.0), DVec3::new(0.1, 1.0, 0.2)).unwrap()), false),
        (Shape::Disk(Disk::new(DVec3::ZERO, DVec3::new(0.3, 1.0, -0.5), 0.9, 0.3).unwrap()), false),
        (Shape::Polygon(Polygon::new(vec![square, hole]).unwrap()), false),
        (Shape::Cuboid(Cuboid::new(DVec3::new(-0.7, -0.5, -0.9), DVec3::new(0.6, 0.8, 0.4)).unwrap()), true),
        (Shape::Quadric(Quadric::hyperboloid_one(0.4, 0.5, -0.8, 0.9).unwrap()), false),
        (Shape::Quadric(Quadric::paraboloid(0.8, 1.1).unwrap()), false),
        (Shape::Quadric(Quadric::cone(0.7, -0.5, 0.8).unwrap()), false),
        (Shape::Solid(Solid::new(Quadric::cylinder(0.6, -0.7, 0.5).unwrap())), true),
        (Shape::Solid(Solid::new(Quadric::ellipsoid(DVec3::new(0.9, 0.4, 0.6)).unwrap())), true),
    ]
}

fn places() -> Vec<DAffine3> {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -1.0, 0.7).normalize(), 0.8);
    let place = |scale: DVec3, at: DVec3| DAffine3::from_scale_rotation_translation(scale, turn, at);
    vec![
        DAffine3::IDENTITY,
        place(DVec3::splat(1e-5), DVec3::splat(1.0)),
        place(DVec3::splat(1e6), DVec3::splat(-1e6)),
        place(DVec3::ONE, DVec3::new(1e6, -1e6, 1e6)),
        place(DVec3::new(-1.0, 2.0, 0.5), DVec3::new(3.0, 4.0, 5.0)),
        DAffine3 {
            matrix3: DMat3::from_cols(DVec3::X, DVec3::new(0.6, 1.0, 0.0), DVec3::Z * 2.0),
            translation: DVec3::ONE,
        },
    ]
}

fn scene(shape: &Shape<f64>, place: DAffine3, precision: Precision) -> Scene {
    let mut builder = SceneBuilder::new(options(precision));
    let m = builder.add_mesh(vec![Geometry::Shape(shape.clone())]);
    builder.add_instance(m, place);
    builder.build().expect("a good scene")
}

fn ray_towards(place: DAffine3, rng: &mut Rng) -> Ray<f64> {
    let origin = place.transform_point3(rng.direction() * 4.0);
    Ray::new(origin, place.transform_point3(rng.in_cube()) - origin)
}

#[test]
fn placed_shapes_answer_as_brute_force() {
    for (shape, _) in shapes() {
        for place in places() {
            for precision in [Precision::Robust, Precision::Double] {
                let scene = scene(&shape, place, precision);
                let mut rng = Rng(61);
                let mut hits = 0;
                for _ in 0..500 {
                    let ray = ray_towards(place, &mut rng);
                    let (hit, twin) = (scene.closest_hit(&ray), reference::closest_hit(&scene, &ray));
                    assert_eq!(hit.is_some(), twin.is_some(), "{} {precision} {place:?}", shape.kind());
                    assert_eq!(hit.is_some(), scene.any_hit(&ray));
                    if let (Some(h), Some(t)) = (hit, twin) {
                        hits += 1;
                        assert!((h.t - t.t).abs() <= 1e-7 * t.t, "{} {precision} {place:?} {h:?} {t:?}", shape.kind());
                        assert!((h.normal().length() - 1.0).abs() < 1e-12 || h.normal() == DVec3::ZERO);
                    }
                }
                assert!(hits > 20, "{} {hits}", shape.kind());
            }
        }
    }
}

/// Shapes that have no box are tested outside the tree; the rest of their mesh stays in it.
#[test]
fn an_infinite_plane_among_bounded_things() {
    for precision in Precision::ALL {
        let mut builder = SceneBuilder::new(options(precision));
        let floor = Shape::Plane(Plane::new(DVec3::ZERO, DVec3::Y).unwrap());
        let m = builder.add_mesh(vec![Geometry::Shape(floor), triangles(&icosphere(3))]);
        builder.add_instance(m, DAffine3::from_translation(DVec3::new(0.0, 2.0, 0.0)));
        builder.add_instance(m, DAffine3::from_translation(DVec3::new(10.0, 2.0, 0.0)));
        let scene = builder.build().expect("a good scene");
        assert!((scene.bounds().extent() - DVec3::new(12.0, 2.0, 2.0)).abs().max_element() < 0.05);
        // Both planes are y = 2: the first instance's is named.
        for x in [-1e9, 4.0, 1e9] {
            let hit =
                scene.closest_hit(&Ray::new(DVec3::new(x, 7.0, 3.0), DVec3::NEG_Y * 0.5)).expect("a floor everywhere");
            assert_eq!((hit.id.instance, hit.id.geometry, hit.t, hit.normal()), (0, 0, 10.0, DVec3::Y));
        }
        let hit = scene.closest_hit(&Ray::new(DVec3::new(10.1, 7.0, 0.1), DVec3::NEG_Y)).expect("the second sphere");
        assert_eq!((hit.id.instance, hit.id.geometry), (1, 1));
    }
}

#[test]
fn order_of_visits_changes_nothing_with_shapes() {
    for precision in crate::careful() {
        let mut builder = SceneBuilder::new(options(precision));
        let mut rng = Rng(62);
        for _ in 0..6 {
            let all = shapes().into_iter().map(|(s, _)| Geometry::Shape(s)).chain([triangles(&icosphere(1))]).collect();
            let m = builder.add_mesh(all);
            for _ in 0..2 {
                let turn = DQuat::from_axis_angle(rng.direction(), 1.0);
                builder.add_instance(m, DAffine3::from_rotation_translation(turn, rng.in_cube() * 5.0));
            }
        }
        let scene = builder.build().expect("a good scene");
        for _ in 0..2000 {
            let ray = Ray::new(rng.in_cube() * 8.0, rng.direction());
            let near = scene.closest_hit_in_order(&ray, VisitOrder::NearFirst);
            for order in [VisitOrder::FarFirst, VisitOrder::Exhaustive] {
                assert_eq!(near, scene.closest_hit_in_order(&ray, order), "{precision} {order:?} {ray:?}");
            }
        }
    }
}

/// Rays that leave a closed convex shape outwards never meet it again; rays that leave a flat one on either side neither.
#[test]
fn shapes_are_left_for_good() {
    for (shape, convex) in shapes() {
        let flat = matches!(shape, Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_));
        if !convex && !flat {
            continue;
        }
        for place in places() {
            for precision in Precision::ALL {
                let scene = scene(&shape, place, precision);
                let mut rng = Rng(63);
                for _ in 0..1000 {
                    let ray = ray_towards(place, &mut rng);
                    let Some(hit) = scene.closest_hit(&ray) else { continue };
                    let point = scene.surface_point(&ray, &hit);
                    let d = rng.direction();
                    let d = d * d.dot(hit.normal()).signum();
                    // Often grazing.
                    let d = if rng.below(2) == 0 { d } else { d - hit.normal() * (d.dot(hit.normal()) * 0.999) };
                    for d in [d, -d].into_iter().take(if flat { 2 } else { 1 }) {
                        let next = scene.closest_hit(&Ray::new(point.spawn(d), d));
                        assert!(next.is_none(), "{} {precision} {place:?} {hit:?} {next:?}", shape.kind());
                    }
                }
            }
        }
    }
}
