use glam::{DMat3, DVec3};
use proptest::prelude::*;

use super::*;
use crate::clip::HalfSpace;
use crate::distance::{closest_between_triangles, closest_on_segment};

fn vector(range: f64) -> impl Strategy<Value = DVec3> {
    // Whole numbers among the reals: touching and parallel cases come up.
    let coordinate = move || prop_oneof![(-3..=3).prop_map(f64::from), -range..range];
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// Points all over a triangle, none farther from the next than this part of the longest edge.
const STEP: f64 = 1.0 / 48.0;

fn samples([a, b, c]: [DVec3; 3]) -> impl Iterator<Item = DVec3> {
    (0..=48).flat_map(move |i| {
        (0..=48 - i).map(move |j| a + (b - a) * (f64::from(i) * STEP) + (c - a) * (f64::from(j) * STEP))
    })
}

/// Distance from a region, or a lower bound on it that is 0 on its boundary; negative inside. Never steeper than 1.
fn check(
    region: &impl Region,
    distance: impl Fn(DVec3) -> f64,
    triangle: [DVec3; 3],
    bounds: &Aabb<f64>,
) -> Result<(), TestCaseError> {
    let [a, b, c] = triangle;
    let apart = (b - a).length().max((c - a).length()).max((c - b).length()) * STEP;
    let nearest = samples(triangle).map(&distance).fold(f64::INFINITY, f64::min);
    let meets = region.meets_triangle(triangle);
    prop_assert!(meets || nearest > 0.0, "a point is {} inside", -nearest);
    prop_assert!(!meets || nearest <= apart * 1.001 + 1e-9, "all points are {} outside", nearest);
    match region.classify_box(&Aabb::from_points(triangle)) {
        Containment::Outside => prop_assert!(nearest > -1e-9),
        Containment::Inside => prop_assert!(samples(triangle).all(|p| distance(p) <= 1e-9) && meets),
        Containment::Intersecting => {}
    }
    let within =
        (0..=8).flat_map(|i| (0..=8).flat_map(move |j| (0..=8).map(move |k| DVec3::new(i.into(), j.into(), k.into()))));
    let mut within = within.map(|w: DVec3| bounds.min + bounds.extent() * w / 8.0);
    match region.classify_box(bounds) {
        Containment::Outside => prop_assert!(within.all(|p| distance(p) > -1e-9)),
        Containment::Inside => prop_assert!(within.all(|p| distance(p) <= 1e-9)),
        Containment::Intersecting => {}
    }
    Ok(())
}

fn to_box(b: &Aabb<f64>, p: DVec3) -> f64 {
    let out = (b.min - p).max(p - b.max);
    if out.max_element() <= 0.0 { out.max_element() } else { out.max(DVec3::ZERO).length() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn regions_agree_with_distances_of_sampled_points(
        corners in [vector(3.0), vector(3.0), vector(3.0)], shrink in prop_oneof![Just(1.0), Just(0.0), 0.0..1.0f64],
        center in vector(2.0), other in vector(2.0), half in vector(1.5), radius in 0.0..2.0f64, axis in vector(1.0), angle in -3.0..3.0f64,
        planes in prop::collection::vec((vector(1.0), vector(1.0)), 0..6),
    ) {
        // Some without area.
        let triangle = [corners[0], corners[1], corners[0].lerp(corners[2], shrink)];
        let bounds = Aabb::new(other - half.abs() * 0.3, other + half.abs() * 0.3);
        let aabb = Aabb::new(center - half.abs(), center + half.abs());
        check(&aabb, |p| to_box(&aabb, p), triangle, &bounds)?;
        let axes = DMat3::from_axis_angle(axis.normalize_or(DVec3::Z), angle);
        let turned = OrientedBox { center, half: half.abs(), axes };
        prop_assert!(turned.is_valid());
        let local = Aabb::new(-half.abs(), half.abs());
        check(&turned, |p| to_box(&local, axes.transpose() * (p - center)), triangle, &bounds)?;
        check(&Sphere { center, radius }, |p| p.distance(center) - radius, triangle, &bounds)?;
        let capsule = Capsule { a: center, b: other, radius };
        check(&capsule, |p| closest_on_segment::<f64>(center, other, p).point.distance(p) - radius, triangle, &bounds)?;
        let half_spaces: Vec<_> = planes.iter().map(|(p, n)| HalfSpace::through(*p, n.normalize_or(DVec3::X))).collect();
        let convex = Convex { half_spaces };
        let out = |p| convex.half_spaces.iter().map(|h| h.signed_distance(p)).fold(f64::NEG_INFINITY, f64::max);
        // That of the planes may be far less than that of the region: samples near enough tell only one side.
        prop_assert!(convex.meets_triangle(triangle) || samples(triangle).all(|p| out(p) > 0.0));
        if convex.meets_triangle(triangle) {
            let [a, b, c] = triangle;
            let apart = (b - a).length().max((c - a).length()).max((c - b).length()) * STEP;
            prop_assert!(samples(triangle).any(|p| out(p) <= apart * 1.001 + 1e-9));
        }
    }

    /// Convex regions of a box's planes, and of a frustum's, are the box and the frustum.
    #[test]
    fn convex_regions_are_boxes_and_frusta(corners in [vector(12.0), vector(12.0), vector(12.0)], half in vector(4.0)) {
        let aabb = Aabb::new(-half.abs(), half.abs());
        let faces = DVec3::AXES.into_iter().flat_map(|n| [HalfSpace::through(aabb.max, n), HalfSpace::through(aabb.min, -n)]);
        let convex = Convex { half_spaces: faces.collect() };
        prop_assert_eq!(convex.meets_triangle(corners), aabb.meets_triangle(corners));
        let camera = Frustum::perspective(DVec3::new(0.1, 0.2, 5.0), DVec3::NEG_Z, DVec3::Y, 1.0, 1.5, 1.0, 10.0);
        let camera = camera.expect("a camera");
        let planes = Convex { half_spaces: camera.planes().to_vec() };
        prop_assert_eq!(planes.meets_triangle(corners), Region::meets_triangle(&camera, corners));
    }

    #[test]
    fn no_points_of_two_triangles_are_nearer(first in [vector(3.0), vector(3.0), vector(3.0)], second in [vector(3.0), vector(3.0), vector(3.0)]) {
        let pair = closest_between_triangles(first, second);
        let to_first = closest_between_triangles(first, [pair.first; 3]).distance();
        let to_second = closest_between_triangles([pair.second; 3], second).distance();
        prop_assert!(to_first < 1e-9 && to_second < 1e-9, "points lie on their triangles: {} {}", to_first, to_second);
        let sampled = samples(first).map(|p| crate::distance::distance_to_triangle::<f64>(second, p)).fold(f64::INFINITY, f64::min);
        let apart = (first[1] - first[0]).length().max((first[2] - first[0]).length()).max((first[2] - first[1]).length()) * STEP;
        prop_assert!(pair.distance() <= sampled + 1e-9 && sampled <= pair.distance() + apart * 1.001 + 1e-9);
    }
}

#[test]
fn what_is_not_finite_is_not_valid() {
    let nan = DVec3::new(0.0, f64::NAN, 0.0);
    assert!(
        !Sphere { center: nan, radius: 1.0 }.is_valid() && !Sphere { center: DVec3::ZERO, radius: -1.0 }.is_valid()
    );
    assert!(!Capsule { a: DVec3::ZERO, b: nan, radius: 1.0 }.is_valid());
    assert!(!Region::is_valid(&Aabb::<f64>::empty()) && !Region::is_valid(&Aabb::<f64>::infinite()));
    let turned = OrientedBox { center: DVec3::ZERO, half: DVec3::ONE, axes: DMat3::IDENTITY };
    assert!(turned.is_valid() && !OrientedBox { axes: DMat3::ZERO, ..turned }.is_valid());
    assert!(!Convex { half_spaces: vec![HalfSpace::new(nan, 0.0)] }.is_valid() && Convex::default().is_valid());
}
