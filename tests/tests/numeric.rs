//! The hard cases at every tier: exact expected answers, by each primitive's own test and through a scene; and rays
//! that leave shapes.

use std::ops::ControlFlow;

use firsthit_accel::{BuildOptions, Geometry, SceneBuilder};
use firsthit_geometry::exact::{ExactHit, ExactRay};
use firsthit_geometry::shapes::{Cuboid, Quadric, Solid, Sphere};
use firsthit_geometry::{Precision, Primitive as _, Ray, Real, Shape, Vector3 as _};
use firsthit_measure::corpus::{self, Case, Engine, Outcome, Primitive};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

fn cases() -> Vec<Case> {
    corpus::read(&firsthit_tests::hard_cases()).expect("the hard cases can be read")
}

/// Prints the table of each engine and fails on what a tier must have right.
fn check(engines: impl Iterator<Item = Engine>) {
    let cases = cases();
    for engine in engines {
        let report = corpus::run(&cases, &[engine], &Precision::ALL);
        firsthit_tests::summary(&format!("hard cases, {engine}:\n{}", report.to_string().trim_end()));
        let failures: Vec<String> = report.failures.iter().map(ToString::to_string).collect();
        assert!(failures.is_empty(), "{} required answers are wrong:\n{}", failures.len(), failures.join("\n"));
    }
}

#[test]
fn primitives_pass_the_hard_cases() {
    check([Engine::Primitives].into_iter());
}

#[test]
fn box_tests_of_the_trees_pass_the_hard_cases() {
    check([Engine::Slabs].into_iter());
}

/// Every layout and SIMD level, by one ray, a slice of rays, and on several threads.
#[test]
fn scenes_pass_the_hard_cases() {
    check(Engine::all().into_iter().filter(|e| matches!(e, Engine::Scene(..))));
}

/// The exact triangle test has every case right, whatever its margin: hit or miss, all nearest triangles, and `t` to the
/// last bit.
#[test]
fn exact_triangles_have_every_case_right() {
    let (mut ran, mut fallbacks) = (0, 0);
    for case in cases() {
        let triangles: Vec<[Vec3; 3]> = match &case.prim {
            Primitive::Triangle { v } => vec![v.map(corpus::vector)],
            Primitive::Mesh { verts, tris } => tris.iter().map(|t| t.map(|i| corpus::vector(verts[i]))).collect(),
            _ => continue,
        };
        let valid = triangles.iter().flatten().all(|p| p.is_finite());
        let ray = ExactRay::new(case.ray.to_f64()).filter(|_| valid);
        let hits: Vec<_> = triangles.iter().map(|v| ray.and_then(|ray| ray.hit(v.map(|p| p.as_dvec3())))).collect();
        let nearest = ray.and_then(|ray| hits.iter().flatten().min_by(|a, b| ray.order(a, b)));
        let expected = matches!(case.expect.result, Outcome::Hit | Outcome::Either);
        assert_eq!(nearest.is_some(), expected, "{}", case.id);
        if let (Some(ray), Some(nearest)) = (ray, nearest) {
            let first = |hit: &Option<ExactHit>| hit.as_ref().is_some_and(|h| ray.order(h, nearest).is_eq());
            let ids: Vec<usize> = (0..hits.len()).filter(|i| first(&hits[*i])).collect();
            assert!(case.expect.ids.is_empty() || case.expect.ids == ids, "{}: {ids:?}", case.id);
            assert_eq!(Some(ray.t_f32(nearest)), case.expect.t_f32.map(|t| t.0), "{}", case.id);
        }
        ran += 1;
        fallbacks += usize::from(hits.iter().flatten().any(|h| h.fallback));
    }
    firsthit_tests::summary(&format!(
        "hard cases, exact triangle test: {ran} ran, {ran} passed, exact numbers were needed in {fallbacks}"
    ));
}

/// The exact forms of the shapes have every case right, whatever its margin, in both arithmetics: hit or miss, and `t`
/// to the last bit.
#[test]
fn exact_shapes_have_every_case_right() {
    fn check<R: Real>(case: &Case, shape: &Shape<R>, ray: &Ray<R>, failures: &mut Vec<String>) -> bool {
        let mut first = None;
        let fallback = shape.visit_exact(ray, &mut |found, _| {
            first = Some(found.hit);
            ControlFlow::Break(())
        });
        let t = first.map(|hit| hit.t.to_f32());
        // Inside a box no surface need be crossed, and of a polygon's boundary both answers are right.
        let expected = case.expect.t_f32.map(|t| t.0).filter(|_| case.expect.result != Outcome::Miss);
        let either = case.expect.result == Outcome::Either && t.is_none();
        if t != expected && !either {
            failures.push(format!("{}: {t:?}, not {expected:?}", case.id));
        }
        if let (Some(first), Some(n)) = (first, &case.expect.n) {
            let exact = DVec3::from_array(n.each_ref().map(|x| x.parse().unwrap_or(f64::NAN)));
            let off = first.normal.map_or(f64::INFINITY, |n| n.to_f64().distance(exact));
            if R::MAX.to_f64() == f64::MAX && !(off <= 1e-7) {
                failures.push(format!("{}: normal off by {off:e}", case.id));
            }
        }
        if let Shape::Cuboid(cuboid) = shape
            && cuboid.overlap_exact(ray).is_some() != (case.expect.result == Outcome::Hit)
        {
            failures.push(format!("{}: in the box or not", case.id));
        }
        fallback
    }
    let (mut ran, mut fallbacks, mut failures) = (0, 0, Vec::new());
    for case in cases() {
        if matches!(case.prim, Primitive::Triangle { .. } | Primitive::Mesh { .. }) {
            continue;
        }
        let refused = case.expect.result == Outcome::NoHitOrError || case.category == "inverted-empty";
        match (corpus::shape::<f64>(&case.prim), corpus::shape::<f32>(&case.prim)) {
            (Ok(Some(double)), Ok(Some(single))) => {
                check(&case, &single, &case.ray, &mut failures);
                fallbacks += usize::from(check(&case, &double, &case.ray.to_f64(), &mut failures));
            }
            (double, single) if !refused && case.expect.result != Outcome::Miss => {
                failures.push(format!("{}: refused, {double:?}, {single:?}", case.id));
            }
            _ => {}
        }
        ran += 1;
    }
    assert!(failures.is_empty(), "{} answers are wrong:\n{}", failures.len(), failures.join("\n"));
    firsthit_tests::summary(&format!(
        "hard cases, exact shapes: {ran} ran, {ran} passed, exact numbers were needed in {fallbacks}"
    ));
}

/// The suite has teeth: cutting corners, as the fast tier does, shows.
#[test]
fn the_fast_tier_is_caught_leaking() {
    let watertight: Vec<Case> = cases().into_iter().filter(|c| c.group == "watertight").collect();
    let fast = corpus::run(&watertight, &[Engine::Primitives], &[Precision::Fast]);
    assert!(watertight.is_empty() || !fast.excused.is_empty(), "no case shows the leaks of the shortest formula");
}

/// Closed convex shapes of about unit size.
fn convex() -> impl Strategy<Value = Shape<f64>> {
    let size = || 0.2..1.0_f64;
    prop_oneof![
        size().prop_map(|r| Sphere::new(DVec3::splat(0.1), r).map(Shape::from)),
        (size(), size()).prop_map(|(x, y)| Cuboid::new(DVec3::ZERO, DVec3::new(x, y, 1.0)).map(Shape::from)),
        (size(), size()).prop_map(|(r, y)| Quadric::cylinder(r, -y, y).map(|q| Solid::new(q).into())),
        (size(), size()).prop_map(|(r, y)| Quadric::cone(r, 0.0, y).map(|q| Solid::new(q).into())),
        (size(), size()).prop_map(|(r, y)| Quadric::paraboloid(r, y).map(|q| Solid::new(q).into())),
        (size(), size()).prop_map(|(a, b)| Quadric::ellipsoid(DVec3::new(a, b, 1.0)).map(|q| Solid::new(q).into())),
    ]
    .prop_map(|shape| shape.expect("valid parameters"))
}

fn vector() -> impl Strategy<Value = DVec3> {
    let x = || -1.0..1.0_f64;
    (x(), x(), x()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// Turned, stretched unevenly and carried far away.
fn placement() -> impl Strategy<Value = DAffine3> {
    let factor = || (-2.0..2.0_f64).prop_map(|e| 10.0_f64.powf(e));
    let away = prop_oneof![Just(0.0), (0.0..7.0_f64).prop_map(|e| 10.0_f64.powf(e))];
    (vector(), 0.0..6.3_f64, (factor(), factor(), factor()), vector(), away).prop_filter_map(
        "a rotation needs an axis",
        |(axis, angle, (x, y, z), direction, away)| {
            let rotation = DQuat::from_axis_angle(axis.try_normalize()?, angle);
            Some(DAffine3::from_scale_rotation_translation(DVec3::new(x, y, z), rotation, direction * away))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A ray that leaves a convex solid never meets it again, and one that goes in comes out: no self-intersection and
    /// no leak, wherever the solid stands and however it is stretched.
    #[test]
    fn rays_leave_convex_shapes_for_good(
        shape in convex(), placed in placement(), from in vector(), to in vector(), away in vector(),
        precision in prop::sample::select(Precision::ALL.to_vec()),
    ) {
        let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
        let mesh = builder.add_mesh(vec![Geometry::Shape(shape)]);
        builder.add_instance(mesh, placed);
        let scene = builder.build().expect("a valid scene");

        let world = |p: DVec3| placed.transform_point3(p);
        let (eye, target) = (world(from.normalize_or(DVec3::X) * 10.0), world(to));
        let ray = Ray::<f64>::new(eye, target - eye);
        let Some(hit) = scene.closest_hit(&ray) else { return Ok(()) };
        prop_assert!(hit.normal().dot(ray.direction) <= 0.0, "from outside, the front is met first");
        // At an apex there is no side to leave to.
        prop_assume!(hit.normal() != DVec3::ZERO && away.length() > 0.01);

        let point = scene.surface_point(&ray, &hit);
        let outward = if away.dot(hit.normal()) < 0.0 { -away } else { away };
        let leaving = Ray::<f64>::new(point.spawn(outward), outward);
        prop_assert_eq!(scene.closest_hit(&leaving).map(|h| h.t), None);

        // Straight on through the solid, unless only an edge was grazed.
        if hit.normal().dot(ray.direction.normalize()) < -0.01 {
            let inner = Ray::<f64>::new(point.spawn(ray.direction), ray.direction);
            if let Some(exit) = scene.closest_hit(&inner) {
                prop_assert!(exit.normal().dot(ray.direction) >= 0.0, "hit the front again at {}", exit.t);
            }
        }
    }
}

/// `docs/from-the-lecture.md` names files and tests that exist.
#[test]
fn the_lecture_table_is_true() {
    names_what_exists("docs/from-the-lecture.md", 20);
}

/// `docs/queries.md` too.
#[test]
fn the_table_of_queries_is_true() {
    names_what_exists("docs/queries.md", 3);
}

fn names_what_exists(document: &str, least: usize) {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = std::fs::read_to_string(root.join(document)).expect("the document");

    let links: Vec<&str> = text.split("](").skip(1).filter_map(|s| s.split(')').next()).collect();
    assert!(links.len() > least, "the document has its table");
    let broken: Vec<_> = links.iter().filter(|l| !root.join("docs").join(l).exists()).collect();
    assert!(broken.is_empty(), "broken links: {broken:?}");

    // Names of tests are code spans of three words and more.
    let is_name = |s: &&str| s.matches('_').count() >= 2 && s.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let mut sources = String::new();
    let mut folders = vec![root.join("crates"), root.join("tests/tests"), root.join("tests/checks")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder of the repository").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                sources += &std::fs::read_to_string(path).expect("a source file");
            }
        }
    }
    let unknown: Vec<_> =
        text.split('`').skip(1).step_by(2).filter(is_name).filter(|n| !sources.contains(&format!("fn {n}("))).collect();
    assert!(unknown.is_empty(), "tests that do not exist: {unknown:?}");
}
