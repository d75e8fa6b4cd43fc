//! Regions, visitors and trees against trees: the answers of slow twins, whatever the tree, the instructions and the place.

use core::ops::ControlFlow;

use firsthit_accel::{
    BuildOptions, Geometry, HitId, Layout, Level, Scene, SceneBuilder, View, VisitedTriangle, Visitor, reference,
};
use firsthit_geometry::clip::HalfSpace;
use firsthit_geometry::frustum::{Containment, Frustum};
use firsthit_geometry::overlap::{Capsule, Convex, OrientedBox, Region, Sphere};
use firsthit_geometry::sweep::ConvexBody;
use firsthit_geometry::{Aabb, Precision, Ray, shapes};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

use crate::single::{mesh, place, vector};

/// One mesh at some places, by each layout and level of instructions.
fn scenes<'a>(
    (positions, triangles): &'a (Vec<Vec3>, Vec<[u32; 3]>),
    places: &'a [DAffine3],
) -> impl Iterator<Item = Scene> + 'a {
    Level::ALL.iter().flat_map(|&l| Layout::ALL.map(|layout| (layout, l))).map(move |(layout, simd)| {
        let mut builder = SceneBuilder::new(BuildOptions { layout, simd, ..BuildOptions::default() });
        let mesh =
            builder.add_mesh(vec![Geometry::Triangles { positions: positions.clone(), triangles: triangles.clone() }]);
        for place in places {
            builder.add_instance(mesh, *place);
        }
        builder.build().expect("a mesh")
    })
}

fn check(scene: &Scene, region: &impl Region) -> Result<(), TestCaseError> {
    let expected = reference::overlapping(scene, region);
    prop_assert_eq!(scene.overlaps(region), !expected.is_empty());
    prop_assert_eq!(&scene.par_overlapping(core::slice::from_ref(region)), core::slice::from_ref(&expected));
    prop_assert_eq!(scene.overlapping(region), expected);
    Ok(())
}

/// Everything, in order of the distance from a point.
struct All {
    from: DVec3,
    boxes: Vec<Aabb<f64>>,
    found: Vec<HitId>,
    held: bool,
    most: usize,
}

impl Visitor for All {
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
        self.boxes.push(*bounds);
        Containment::Intersecting
    }
    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
        self.held &= self.boxes.last().is_some_and(|b| triangle.corners.iter().all(|p| b.contains(*p)));
        self.found.push(triangle.id);
        if self.found.len() == self.most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
    fn order(&self, bounds: &Aabb<f64>) -> f64 {
        bounds.center().distance(self.from)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn what_overlaps_is_what_the_slow_twin_finds(
        mesh in mesh(), places in prop::collection::vec(place(), 1..12), which: prop::sample::Index,
        (v, w) in prop_oneof![Just((0.0, 0.0)), (0.0..0.5f64, 0.0..0.5f64)], (from, half, axis) in (vector(), vector(), vector()), angle in -3.0..3.0f64,
        far in prop::sample::select(vec![0.0, 1e-3, 0.1, 1.0, 10.0]), wide in prop::sample::select(vec![0.0, 1e-6, 0.1, 0.5, 3.0, 1e3]),
    ) {
        for scene in scenes(&mesh, &places) {
            let all = reference::overlapping(&scene, &Convex::default());
            check(&scene, &Convex::default())?;
            prop_assume!(!all.is_empty());
            let mut visitor = All { from, boxes: Vec::new(), found: Vec::new(), held: true, most: usize::MAX };
            prop_assert!(scene.visit(&mut visitor).is_continue() && visitor.held, "a corner lies beside its box");
            visitor.found.sort_unstable();
            prop_assert_eq!(&visitor.found, &all);
            visitor = All { found: Vec::new(), most: 1, ..visitor };
            prop_assert!(scene.visit(&mut visitor).is_break());
            // About a point of a triangle, of the size of the mesh.
            let id = all[which.index(all.len())];
            let corners = mesh.1[id.primitive as usize].map(|i| places[id.instance as usize].transform_point3(mesh.0[i as usize].as_dvec3()));
            let size = corners.iter().fold(0.0f64, |m, p| m.max(p.distance(corners[0]))).max(1e-30);
            let on = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
            let center = on + from * (size * far);
            let half = half.abs() * (size * wide);
            let radius = half.x;
            check(&scene, &Aabb::new(center - half, center + half))?;
            // Touches a corner exactly.
            check(&scene, &Aabb::new(corners[0], corners[0] + half))?;
            let axes = DMat3::from_axis_angle(axis.normalize_or(DVec3::Z), angle);
            check(&scene, &OrientedBox { center, half, axes })?;
            check(&scene, &Sphere { center, radius })?;
            check(&scene, &Sphere { center: corners[0] + DVec3::X * radius, radius })?;
            check(&scene, &Capsule { a: center, b: on + axis * size, radius: half.y })?;
            check(&scene, &Capsule { a: center, b: center, radius })?;
            let through = |n: DVec3, p: DVec3| HalfSpace::through(p, n);
            check(&scene, &Convex { half_spaces: vec![through(axis, on), through(-axis, center), through(from, corners[1])] })?;
            let far = size * wide + size * 0.01;
            if let Some(camera) = Frustum::perspective(center, axis, DVec3::Y, 0.9, 1.5, far * 0.1, far) {
                check(&scene, &camera)?;
            }
        }
    }
}

/// A moving sphere: aimed at which triangle and where on it, from where, how far, how large, and what is odd about it.
type Throw = (prop::sample::Index, (f64, f64), DVec3, f64, f64, u8);

fn throw() -> impl Strategy<Value = Throw> {
    let distance = prop::sample::select(vec![0.0, 0.3, 3.0, 20.0, 1e4]);
    let radius = prop::sample::select(vec![0.0, 1e-6, 0.01, 0.3, 1.0, 5.0]);
    let weight = prop_oneof![Just(0.0), Just(0.5), 0.0..0.5f64];
    (any::<prop::sample::Index>(), (weight.clone(), weight), vector(), distance, radius, 0u8..24)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn moving_bodies_touch_what_the_slow_twin_finds(
        mesh in mesh(), places in prop::collection::vec(place(), 1..12), throws in prop::collection::vec(throw(), 6),
    ) {
        let mut rays = Vec::new();
        for (which, (v, w), from, distance, radius, odd) in throws {
            let (which, of) = (which.index(mesh.1.len() * places.len()), mesh.1.len());
            let corners = mesh.1[which % of].map(|i| places[which / of].transform_point3(mesh.0[i as usize].as_dvec3()));
            let size = corners.iter().fold(0.0f64, |m, p| m.max(p.distance(corners[0]))).max(1e-30);
            let target = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
            let mut ray = Ray::new(target + from * (size * distance), -from);
            match odd {
                0 => ray.origin.x = f64::NAN,
                1 => ray.direction = DVec3::ZERO,
                2 => ray.t_min = f64::NEG_INFINITY,
                3 => ray.t_max = size * distance,
                4 => ray = Ray { origin: target + DVec3::Z * (size * radius), direction: DVec3::X, t_min: -size, t_max: size },
                _ => {}
            }
            rays.push((ray, if odd == 5 { f64::NAN } else { radius * size }));
        }
        for scene in scenes(&mesh, &places) {
            for (ray, radius) in &rays {
                prop_assert_eq!(scene.cast_sphere(ray, *radius), reference::cast_sphere(&scene, ray, *radius));
                // A tetrahedron in the sphere's place.
                let corners = [DVec3::ZERO, DVec3::X, DVec3::new(0.2, 1.0, 0.1), DVec3::new(-0.3, 0.1, 1.0)].map(|p| p * *radius);
                let Ok(body) = ConvexBody::new(&corners) else { continue };
                prop_assert_eq!(scene.cast_convex(ray, &body), reference::cast_convex(&scene, ray, &body));
            }
        }
    }

    #[test]
    fn meshes_meet_as_the_slow_twins_say(
        mesh in mesh(), places in prop::collection::vec(place(), 1..4), others in prop::collection::vec(place(), 1..3), far: bool,
    ) {
        let moved = |p: &DAffine3| DAffine3::from_translation(DVec3::splat(if far { 1e3 } else { 0.0 })) * *p;
        let others: Vec<DAffine3> = others.iter().map(moved).collect();
        let mut expected = None;
        for (scene, other) in scenes(&mesh, &places).zip(scenes(&mesh, &others)) {
            let (pairs, own, apart) = expected.get_or_insert_with(|| (
                reference::intersecting_pairs(&scene, &other),
                reference::self_intersections(&scene),
                reference::distance_between(&scene, &other),
            ));
            prop_assert_eq!(scene.intersects(&other), !pairs.is_empty());
            prop_assert_eq!(&scene.intersecting_pairs(&other), &*pairs);
            prop_assert_eq!(&scene.self_intersections(), &*own);
            prop_assert_eq!(&scene.distance_between(&other), &*apart);
            let curve = scene.intersection_curve(&other);
            prop_assert!(curve.iter().all(|c| pairs.contains(&c.ids)) && curve.is_sorted_by_key(|c| c.ids));
        }
    }

    /// On a lattice, where much touches, lies in one plane and shares corners.
    #[test]
    fn meshes_on_a_lattice_meet_as_the_slow_twins_say(
        corners in prop::collection::vec([0i8..4, 0..4, 0..3], 3..20), indices in prop::collection::vec([0usize..20, 0..20, 0..20], 1..40),
        shifts in prop::collection::vec([-2i8..3, -2..3, -1..2], 1..4),
    ) {
        let at = |c: &[i8; 3]| DVec3::new(c[0].into(), c[1].into(), c[2].into());
        let positions: Vec<Vec3> = corners.iter().map(|c| at(c).as_vec3()).collect();
        let triangles = indices.iter().map(|t| t.map(|i| (i % positions.len()) as u32)).collect();
        let mesh = (positions, triangles);
        let places: Vec<DAffine3> = shifts.iter().map(|s| DAffine3::from_translation(at(s))).collect();
        let mut expected = None;
        for (scene, other) in scenes(&mesh, &places[..1]).zip(scenes(&mesh, &places)) {
            let (pairs, own, apart) = expected.get_or_insert_with(|| (
                reference::intersecting_pairs(&scene, &other),
                reference::self_intersections(&other),
                reference::distance_between(&scene, &other),
            ));
            prop_assert_eq!(&scene.intersecting_pairs(&other), &*pairs);
            prop_assert_eq!(&other.self_intersections(), &*own);
            prop_assert_eq!(&scene.distance_between(&other), &*apart);
        }
    }

    #[test]
    fn parts_are_those_of_the_slow_twins(
        meshes in prop::collection::vec(mesh(), 1..4), places in prop::collection::vec((place(), any::<prop::sample::Index>()), 0..8),
        (eye, axis) in (vector(), vector()), angle in -3.0..3.0f64, layout in prop::sample::select(Layout::ALL.to_vec()), shape: bool,
    ) {
        let mut builder = SceneBuilder::new(BuildOptions { layout, precision: Precision::Double, ..BuildOptions::default() });
        // Two geometries each, and a shape.
        let mut numbers = Vec::new();
        for (positions, triangles) in &meshes {
            let (some, others) = triangles.split_at(triangles.len() / 2);
            let half = |t: &[[u32; 3]]| Geometry::Triangles { positions: positions.clone(), triangles: t.to_vec() };
            let mut geometries = vec![half(some), half(others)];
            if shape {
                geometries.push(Geometry::Shape(shapes::Sphere::new(DVec3::X, 0.3).expect("a sphere").into()));
            }
            numbers.push(builder.add_mesh(geometries));
        }
        for (place, which) in &places {
            builder.add_instance(numbers[which.index(numbers.len())], *place);
        }
        let scene = builder.build().expect("meshes");
        let rotation = DQuat::from_axis_angle(axis.normalize_or(DVec3::Y), angle);
        let view = View { eye: eye * 3.0, rotation, vertical_angle: 0.9, width: 12, height: 9 };
        let rays: Vec<_> = (0..9).flat_map(|y| (0..12).map(move |x| view.ray(x, y))).collect();
        let seen = scene.visible_parts(&view);
        prop_assert_eq!(&seen, &scene.parts_along(&rays));
        prop_assert_eq!(&seen, &reference::parts_along(&scene, &rays));
        let frustum = view.frustum(1e-3, 1e7).expect("a view");
        let near = scene.parts_in(&frustum);
        prop_assert_eq!(&near, &reference::parts_in(&scene, &frustum));
        // What is seen may be seen, unless it is nearer or farther than the frustum.
        let within = |ray: &Ray<f64>| scene.closest_hit(ray).is_none_or(|h| !(1.1e-3..9e6).contains(&h.t) || near.contains(&h.id.into()));
        prop_assert!(rays.iter().all(within));
    }
}

#[test]
fn nothing_meets_nothing() {
    let empty = SceneBuilder::default().build().expect("an empty scene");
    let mesh = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    for scene in scenes(&mesh, &[DAffine3::IDENTITY]) {
        assert!(!scene.intersects(&empty) && !empty.intersects(&scene) && empty.self_intersections().is_empty());
        assert!(scene.distance_between(&empty).is_none() && scene.self_intersections().is_empty());
        assert!(scene.intersects(&scene) && scene.distance_between(&scene).is_some_and(|s| s.distance == 0.0));
        assert!(empty.cast_sphere(&Ray::new(DVec3::Z, DVec3::X), 1.0).is_none());
        let nan = View { eye: DVec3::NAN, rotation: DQuat::NAN, vertical_angle: f64::NAN, width: 3, height: 3 };
        assert!(scene.visible_parts(&nan).is_empty() && nan.frustum(0.1, 1.0).is_none());
        assert!(scene.visible_parts(&View { width: 0, height: 0, ..nan }).is_empty());
    }
}

#[test]
fn what_is_not_valid_overlaps_nothing() {
    let mesh = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let nan = DVec3::new(0.0, f64::NAN, 0.0);
    for scene in scenes(&mesh, &[DAffine3::IDENTITY]).chain(scenes(&mesh, &[])) {
        assert!(!scene.overlaps(&Aabb::<f64>::empty()) && !scene.overlaps(&Aabb::new(nan, DVec3::ONE)));
        for center in [nan, DVec3::INFINITY] {
            assert!(!scene.overlaps(&Sphere { center, radius: 1.0 }));
            assert!(scene.overlapping(&Capsule { a: DVec3::ZERO, b: center, radius: 1.0 }).is_empty());
        }
        for radius in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(!scene.overlaps(&Sphere { center: DVec3::ZERO, radius }));
        }
        assert!(!scene.overlaps(&Convex { half_spaces: vec![HalfSpace::new(nan, 0.0)] }));
    }
    let empty = SceneBuilder::default().build().expect("an empty scene");
    assert!(!empty.overlaps(&Convex::default()));
}

/// A visitor may ask the scene that it walks through.
#[test]
fn visitors_may_ask_the_scene() {
    struct Ask<'a>(&'a Scene, usize);
    impl Visitor for Ask<'_> {
        fn bounds(&mut self, _: &Aabb<f64>) -> Containment {
            Containment::Inside
        }
        fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
            assert!(triangle.inside);
            self.1 += self.0.overlapping(&Aabb::from_points(triangle.corners)).len();
            ControlFlow::Continue(())
        }
    }
    let mesh = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    for scene in scenes(&mesh, &[DAffine3::IDENTITY, DAffine3::from_translation(DVec3::Z)]) {
        let mut ask = Ask(&scene, 0);
        assert!(scene.visit(&mut ask).is_continue());
        assert_eq!(ask.1, 2);
    }
}
