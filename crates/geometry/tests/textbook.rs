//! The forms that lectures and text-books show, beside the ones used here: where they differ, and known answers.

use core::f64::consts::FRAC_1_SQRT_2;

use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Aabb, Primitive, Ray, Shape, quadratic, slab};
use glam::{DVec3, Vec3};

fn ray(o: [f64; 3], d: [f64; 3]) -> Ray<f64> {
    Ray::new(o.into(), d.into())
}

/// `(-b +- sqrt(b^2 - a c)) / a`.
fn text_book_roots(a: f32, b: f32, c: f32) -> [f32; 2] {
    let s = (b * b - a * c).sqrt();
    [(-b - s) / a, (-b + s) / a]
}

#[test]
fn the_quadratic_formula_cancels() {
    // The roots of t^2 - 2e4 t + 1 are 5.00000001e-5 and 2e4.
    let (a, b, c) = (1.0_f32, -1e4, 1.0);
    assert_eq!(text_book_roots(a, b, c)[0], 0.0, "all digits are lost");
    let [small, _] = quadratic::roots(a, b, c).unwrap();
    assert!((small - 5e-5).abs() < 1e-11);
    assert!(text_book_roots(0.0, 1.0, 1.0)[1].is_nan(), "0 / 0");
    assert_eq!(quadratic::roots(0.0_f32, 1.0, 1.0), Some([-0.5, -0.5]));
}

#[test]
fn far_spheres_need_the_geometric_discriminant() {
    // 4096 radii away, and 2 % of the radius beside the sphere.
    let sphere = Sphere::<f32>::new(Vec3::ZERO, 1.0).unwrap();
    let beside = Ray::new(Vec3::new(1.02, 0.0, 4096.0), Vec3::NEG_Z);
    assert!(sphere.roots_algebraic(&beside).is_some(), "the algebraic discriminant has no digit left");
    assert!(sphere.roots_geometric(&beside).is_none());
}

#[test]
fn a_centre_behind_is_no_miss_from_inside() {
    // t_ca = (c - o).d < 0, which the text-book form takes for a miss.
    let sphere = Sphere::new(DVec3::ZERO, 2.0).unwrap();
    assert_eq!(sphere.closest_hit(&ray([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])).map(|h| h.t), Some(1.0));
}

#[test]
fn the_nearest_hit_need_not_be_the_smaller_root() {
    // At the smaller root, t = 2, the tube is cut away (y = 1.5): its far wall is seen.
    let tube = Quadric::cylinder(1.0, 0.0, 1.0).unwrap();
    let hit = tube.closest_hit(&ray([3.0, 2.5, 0.0], [-1.0, -0.5, 0.0])).unwrap();
    assert_eq!(hit.t, 4.0);
}

#[test]
fn parallel_rays_meet_a_quadric_once() {
    let bowl = Quadric::paraboloid(1.0, 4.0).unwrap();
    assert_eq!(bowl.closest_hit(&ray([0.5, 9.0, 0.0], [0.0, -1.0, 0.0])).map(|h| h.t), Some(8.0));
    // A generator of the cone lies in it; a parallel to it meets the double cone once.
    let cone = Quadric::<f64>::new([1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0]).unwrap();
    assert_eq!(cone.closest_hit(&ray([2.0, 2.0, 0.0], [-1.0, -1.0, 0.0])), None);
    assert_eq!(cone.closest_hit(&ray([4.0, 2.0, 0.0], [-1.0, -1.0, 0.0])).map(|h| h.t), Some(3.0));
}

#[test]
fn mixed_coefficients_count_twice() {
    // 2 B x y with B = 1/2, and J = -1: the hyperbola x y = 1.
    let hyperbola = Quadric::new([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0]).unwrap();
    assert_eq!(hyperbola.closest_hit(&ray([2.0, 5.0, 0.0], [0.0, -1.0, 0.0])).map(|h| h.t), Some(4.5));
}

#[test]
fn slabs_survive_rays_in_the_face() {
    let cube = Aabb::<f32>::new(Vec3::ZERO, Vec3::ONE);
    let along = Ray::<f32>::new(Vec3::new(0.5, 1.0, -1.0), Vec3::new(0.0, -0.0, 1.0));
    // The text-book interval of the y slab: 0 / -0.
    assert!(((cube.max.y - along.origin.y) / along.direction.y).is_nan());
    assert_eq!(slab::plain(&cube, &along), Some((1.0, 2.0)));
    assert_eq!(Cuboid::<f32>::new(cube.min, cube.max).unwrap().closest_hit(&along).map(|h| h.t), Some(1.0));
}

#[test]
fn parity_counts_vertices_once() {
    // The scan line of the inner point runs through the vertex (2, 0); the outer one's through (0, -1).
    let v = |x, y| DVec3::new(x, y, 0.0);
    let diamond = Polygon::<f64>::new(vec![vec![v(2.0, 0.0), v(0.0, 1.0), v(-2.0, 0.0), v(0.0, -1.0)]]).unwrap();
    for (x, y, inside) in [(0.0, 0.0, true), (-3.0, 0.0, false), (-1.0, -1.0, false), (-1.0, 1.0, false)] {
        assert_eq!(diamond.contains(v(x, y)), inside, "{x} {y}");
    }
    // Squares that tile a plane: points on their common sides belong to exactly one.
    let square = |x: f64, y: f64| {
        Polygon::<f64>::new(vec![vec![v(x, y), v(x + 1.0, y), v(x + 1.0, y + 1.0), v(x, y + 1.0)]]).unwrap()
    };
    let tiles: Vec<_> = (0..9).map(|i| square(f64::from(i % 3), f64::from(i / 3))).collect();
    for i in 1..12 {
        for j in 1..12 {
            let p = v(f64::from(i) / 4.0, f64::from(j) / 4.0);
            assert_eq!(tiles.iter().filter(|t| t.contains(p)).count(), 1, "{p}");
        }
    }
}

/// Closed-form answers: `t`, `u`, `v`, normal.
#[test]
fn known_hits() {
    let cap = |q: Quadric<f64>| Shape::from(Solid::new(q));
    let s = FRAC_1_SQRT_2;
    let square = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]];
    let square = square.into_iter().map(|[x, y]| DVec3::new(x, y, 1.0)).collect();
    let cases: [(Shape<f64>, _, _, _); 14] = [
        (
            Sphere::new(DVec3::ZERO, 1.0).unwrap().into(),
            ray([0.0, 0.0, -3.0], [0.0, 0.0, 2.0]),
            (1.0, 0.25, 0.5),
            [0.0, 0.0, -1.0],
        ),
        (
            Plane::new(DVec3::Y, DVec3::new(0.0, 3.0, 0.0)).unwrap().into(),
            ray([0.0, 3.0, 0.0], [0.0, -1.0, 0.0]),
            (2.0, 0.0, 0.0),
            [0.0, 1.0, 0.0],
        ),
        (
            Disk::new(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap().into(),
            ray([0.0, 2.0, 4.0], [0.0, 0.0, -1.0]),
            (4.0, 0.25, 0.5),
            [0.0, 0.0, 1.0],
        ),
        (
            Polygon::new(vec![square]).unwrap().into(),
            ray([0.5, 3.0, 0.0], [0.0, 0.0, 1.0]),
            (1.0, 0.25, 0.75),
            [0.0, 0.0, 1.0],
        ),
        (
            Cuboid::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 4.0)).unwrap().into(),
            ray([-1.0, 0.5, 3.0], [1.0, 0.0, 0.0]),
            (1.0, 0.25, 0.75),
            [-1.0, 0.0, 0.0],
        ),
        // From inside: the far face.
        (
            Cuboid::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 4.0)).unwrap().into(),
            ray([0.5, 0.5, 3.0], [1.0, 0.0, 0.0]),
            (0.5, 0.25, 0.75),
            [1.0, 0.0, 0.0],
        ),
        (
            Quadric::cylinder(1.0, 0.0, 4.0).unwrap().into(),
            ray([5.0, 1.0, 0.0], [-1.0, 0.0, 0.0]),
            (4.0, 0.0, 0.25),
            [1.0, 0.0, 0.0],
        ),
        (
            cap(Quadric::cylinder(1.0, 0.0, 4.0).unwrap()),
            ray([0.5, 9.0, 0.0], [0.0, -1.0, 0.0]),
            (5.0, 0.75, 0.5),
            [0.0, 1.0, 0.0],
        ),
        (
            cap(Quadric::cone(1.0, 0.0, 1.0).unwrap()),
            ray([2.0, 0.5, 0.0], [-1.0, 0.0, 0.0]),
            (1.5, 0.0, 0.5),
            [s, s, 0.0],
        ),
        (
            cap(Quadric::cone(1.0, 0.0, 1.0).unwrap()),
            ray([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]),
            (1.0, 0.5, 0.5),
            [0.0, -1.0, 0.0],
        ),
        (
            Quadric::ellipsoid(DVec3::new(1.0, 2.0, 3.0)).unwrap().into(),
            ray([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]),
            (2.0, 0.75, 0.5),
            [0.0, 0.0, 1.0],
        ),
        (
            Quadric::paraboloid(2.0, 4.0).unwrap().into(),
            ray([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]),
            (1.0, 0.0, 0.0),
            [0.0, -1.0, 0.0],
        ),
        (
            Quadric::hyperboloid_one(1.0, 1.0, -2.0, 2.0).unwrap().into(),
            ray([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            (3.0, 0.5, 0.5),
            [-1.0, 0.0, 0.0],
        ),
        (
            Quadric::hyperboloid_two(1.0, 1.0, -2.0, 2.0).unwrap().into(),
            ray([0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            (1.0, 0.0, 0.75),
            [0.0, -1.0, 0.0],
        ),
    ];
    for (shape, ray, (t, u, v), normal) in cases {
        let hit = shape.closest_hit(&ray).unwrap_or_else(|| panic!("{} is missed", shape.kind()));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(hit.t, t), "{}: t = {}", shape.kind(), hit.t);
        assert!(near(hit.v, v) && near(hit.u, u), "{}: u, v = {}, {}", shape.kind(), hit.u, hit.v);
        let n = hit.normal.unwrap();
        assert!(n.distance(normal.into()) < 1e-12, "{}: n = {n}", shape.kind());
    }
}

#[test]
fn culling_sees_through_the_back() {
    let plane = Plane::<f64>::new(DVec3::ZERO, DVec3::Y).unwrap().with_culling(true);
    assert!(plane.any_hit(&ray([0.0, 1.0, 0.0], [0.0, -1.0, 0.0])));
    assert!(!plane.any_hit(&ray([0.0, -1.0, 0.0], [0.0, 1.0, 0.0])));
    assert!(plane.with_culling(false).any_hit(&ray([0.0, -1.0, 0.0], [0.0, 1.0, 0.0])));
}

#[test]
fn the_apex_has_no_normal() {
    let cone = Quadric::cone(1.0, 0.0, 1.0).unwrap();
    let hit = cone.closest_hit(&ray([-1.0, 1.0, 0.0], [1.0, 0.0, 0.0])).unwrap();
    assert_eq!((hit.t, hit.normal), (1.0, None));
}

#[test]
fn what_is_no_shape_is_refused_with_its_cause() {
    let message = |e: Result<Shape<f64>, firsthit_geometry::ShapeError>| e.unwrap_err().to_string();
    assert_eq!(message(Sphere::new(DVec3::ZERO, -1.0).map(Shape::from)), "radius must be > 0, but is -1");
    assert!(message(Sphere::new(DVec3::NAN, 1.0).map(Shape::from)).contains("center must be finite"));
    assert!(message(Plane::new(DVec3::ZERO, DVec3::ZERO).map(Shape::from)).contains("the normal is zero"));
    assert!(message(Disk::new(DVec3::ZERO, DVec3::Z, 1.0, 2.0).map(Shape::from)).contains("inner radius"));
    assert!(message(Cuboid::new(DVec3::ONE, DVec3::ZERO).map(Shape::from)).contains("the box is empty"));
    assert!(message(Quadric::new([0.0; 10]).map(Shape::from)).contains("all coefficients"));
    let bent = vec![vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.1), DVec3::Y]];
    assert!(message(Polygon::new(bent).map(Shape::from)).contains("not flat"));
}
