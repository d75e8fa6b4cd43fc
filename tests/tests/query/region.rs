//! Regions, visitors and trees against trees: the answers of slow twins, whatever the tree, the instructions and the place.

use core::ops::ControlFlow;

use firsthit_accel::{
    BuildOptions, Geometry, HitId, Layout, Level, Scene, SceneBuilder, VisitedTriangle, Visitor, reference,
};
use firsthit_geometry::Aabb;
use firsthit_geometry::clip::HalfSpace;
use firsthit_geometry::frustum::{Containment, Frustum};
use firsthit_geometry::overlap::{Capsule, Convex, OrientedBox, Region, Sphere};
use glam::{DAffine3, DMat3, DVec3, Vec3};
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
