//! The nearest point is that of the slow twin, to the bit, whatever the tree, the instructions and the place.

use firsthit_accel::{BuildOptions, ClosestPoint, Geometry, Layout, Level, Scene, SceneBuilder, reference};
use firsthit_geometry::Precision;
use firsthit_tests::oracle::read_obj;
use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::single::{mesh, place, vector};
use crate::{careful, triangles};

/// Of the same triangle and to the bit, but for the normal, which the twin has of another length.
pub(super) fn same(got: &Option<ClosestPoint>, expected: &Option<ClosestPoint>) -> Result<(), TestCaseError> {
    let bits = |c: &ClosestPoint| {
        let numbers = [c.point.x, c.point.y, c.point.z, c.distance, c.u.into(), c.v.into()];
        (c.id, c.feature, numbers.map(f64::to_bits))
    };
    prop_assert_eq!(got.as_ref().map(bits), expected.as_ref().map(bits));
    Ok(())
}

/// Where to ask from: near a corner, an edge or a face of a triangle, on it, or far away.
type Aim = (prop::sample::Index, (f64, f64), DVec3, f64, u8);

fn aim() -> impl Strategy<Value = Aim> {
    let distance = prop::sample::select(vec![0.0, 1e-9, 1e-3, 0.3, 0.3, 3.0, 20.0, 1e4, 1e8, 1e12]);
    let weight = prop_oneof![Just(0.0), Just(0.5), 0.0..0.5f64];
    (any::<prop::sample::Index>(), (weight.clone(), weight), vector(), distance, 0u8..24)
}

fn point((which, (v, w), from, distance, odd): Aim, corners: &[[DVec3; 3]], size: f64) -> DVec3 {
    let [a, b, c] = corners[which.index(corners.len())];
    let on = a * (1.0 - v - w) + b * v + c * w;
    match odd {
        0 => DVec3::new(f64::NAN, 0.0, 0.0),
        1 => DVec3::new(0.0, f64::NEG_INFINITY, 0.0),
        2 => DVec3::splat(1e300),
        3 => a,
        4 => a + (a - b),
        _ => on + from * (size * distance),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn the_nearest_point_is_that_of_the_slow_twin(
        (positions, indices) in mesh(), places in prop::collection::vec(place(), 1..12),
        aims in prop::collection::vec(aim(), 12), radius in prop::sample::select(vec![0.0, 1e-3, 0.5, 10.0]), count in 0usize..9,
    ) {
        let placed = |place: &DAffine3| -> Vec<[DVec3; 3]> {
            indices.iter().map(|t| t.map(|i| place.transform_point3(positions[i as usize].as_dvec3()))).collect()
        };
        let corners: Vec<[DVec3; 3]> = places.iter().flat_map(placed).collect();
        let size = corners.iter().take(indices.len()).flatten().fold(0.0f64, |m, p| m.max((*p - corners[0][0]).abs().max_element()));
        for (layout, simd) in Level::ALL.iter().flat_map(|&l| Layout::ALL.map(|layout| (layout, l))) {
            let mut builder = SceneBuilder::new(BuildOptions { layout, simd, ..BuildOptions::default() });
            let mesh = builder.add_mesh(vec![Geometry::Triangles { positions: positions.clone(), triangles: indices.clone() }]);
            for place in &places {
                builder.add_instance(mesh, *place);
            }
            let scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?;
            let points: Vec<DVec3> = aims.iter().map(|aim| point(*aim, &corners, size)).collect();
            let radius = radius * size;
            let (mut batch, mut within) = (vec![None; points.len()], vec![None; points.len()]);
            scene.closest_points(&points, f64::INFINITY, &mut batch);
            scene.par_closest_points(&points, radius, &mut within);
            for ((p, batch), within) in points.iter().zip(batch).zip(within) {
                let expected = reference::closest_point(&scene, *p);
                same(&scene.closest_point(*p), &expected)?;
                same(&batch, &expected)?;
                let distance = expected.map_or(f64::INFINITY, |e| e.distance);
                // The ball is closed.
                same(&scene.closest_point_within(*p, distance), &expected)?;
                prop_assert!(scene.distance(*p) == distance || !p.is_finite() && scene.distance(*p).is_nan());
                // Of the same arithmetic for what is in the ball and what is not.
                let near = reference::nearest_k(&scene, *p, count, radius);
                same(&within, &reference::nearest_k(&scene, *p, 1, radius).first().copied())?;
                let got = scene.nearest_k(*p, count, radius);
                prop_assert_eq!(got.len(), near.len());
                for (got, expected) in got.iter().zip(&near) {
                    same(&Some(*got), &Some(*expected))?;
                    prop_assert!(got.normal().dot(expected.normal()) >= 0.0 || got.normal() == DVec3::ZERO || mirrored(&scene, &places, got));
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn the_furthest_point_is_that_of_the_slow_twin(
        (positions, indices) in mesh(), places in prop::collection::vec(place(), 1..12), aims in prop::collection::vec(aim(), 12),
    ) {
        let at = |i: u32| places[0].transform_point3(positions[i as usize].as_dvec3());
        let corners: Vec<[DVec3; 3]> = indices.iter().map(|t| t.map(at)).collect();
        let size = corners.iter().flatten().fold(0.0f64, |m, p| m.max((*p - corners[0][0]).abs().max_element()));
        let points: Vec<DVec3> = aims.iter().map(|aim| point(*aim, &corners, size)).collect();
        for layout in Layout::ALL {
            let mut builder = SceneBuilder::new(BuildOptions { layout, ..BuildOptions::default() });
            let mesh = builder.add_mesh(vec![Geometry::Triangles { positions: positions.clone(), triangles: indices.clone() }]);
            places.iter().for_each(|place| _ = builder.add_instance(mesh, *place));
            let scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?;
            let (mut batch, mut parallel) = (vec![None; points.len()], vec![None; points.len()]);
            scene.furthest_points(&points, &mut batch);
            scene.par_furthest_points(&points, &mut parallel);
            for ((p, batch), parallel) in points.iter().zip(batch).zip(parallel) {
                let expected = reference::furthest_point(&scene, *p);
                prop_assert_eq!(expected.is_some(), reference::closest_point(&scene, *p).is_some());
                let got = scene.furthest_point(*p);
                for got in [&got, &batch, &parallel] {
                    same(got, &expected)?;
                }
                // What is nearest is no farther.
                prop_assert!(got.is_none_or(|got| scene.distance(*p) <= got.distance));
            }
        }
    }
}

/// There the outside stays, which the twin does not know.
fn mirrored(_: &Scene, places: &[DAffine3], got: &ClosestPoint) -> bool {
    places[got.id.instance as usize].matrix3.determinant() < 0.0
}

#[test]
fn a_scene_without_triangles_has_no_nearest_point() {
    let scene = SceneBuilder::default().build().expect("an empty scene");
    assert!(scene.closest_point(DVec3::ZERO).is_none() && scene.nearest_k(DVec3::ZERO, 3, 1.0).is_empty());
    assert!(scene.furthest_point(DVec3::ZERO).is_none());
    assert_eq!(scene.distance(DVec3::ZERO), f64::INFINITY);
    let mut builder = SceneBuilder::default();
    let flat = Geometry::Triangles { positions: vec![Vec3::ONE], triangles: vec![[0, 0, 0]] };
    let mesh = builder.add_mesh(vec![flat]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    assert!(builder.build().expect("a mesh").closest_point(DVec3::ZERO).is_none());
}

/// Scaling everything by a power of two scales the answers, and nothing else.
#[test]
fn scale_changes_nothing_on_a_real_mesh() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let bunny = read_obj(&shared.join("assets/stanford-bunny/stanford-bunny.obj")).expect("the bunny");
    let scenes = [0, -60, 60].map(|e: i32| {
        let mut scaled = bunny.clone();
        scaled.positions.iter_mut().for_each(|p| *p *= 2f32.powi(e));
        let mut builder = SceneBuilder::default();
        let mesh = builder.add_mesh(vec![triangles(&scaled)]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        (builder.build().expect("a mesh"), 2f64.powi(e))
    });
    let bounds = scenes[0].0.bounds();
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut checked = 0;
    for _ in 0..2000 {
        let p = bounds.center() + bounds.extent() * (DVec3::new(random(), random(), random()) - 0.5) * 1.4;
        let [first, others @ ..] = &scenes;
        let nearest = first.0.closest_point(p).expect("a point");
        for (scene, scale) in others {
            let scaled = scene.closest_point(p * *scale).expect("a point");
            assert_eq!(
                (scaled.id, scaled.distance, scaled.point),
                (nearest.id, nearest.distance * scale, nearest.point * *scale)
            );
        }
        if checked < 50 {
            let expected = reference::closest_point(&first.0, p).expect("a point");
            assert_eq!((nearest.id, nearest.distance), (expected.id, expected.distance));
            checked += 1;
        }
    }
    firsthit_tests::summary("nearest points of the bunny: 2000 at three scales, 50 against all triangles");
}

#[test]
fn all_tiers_answer_alike() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let scene = |precision| {
        let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
        let mesh = builder.add_mesh(vec![Geometry::Triangles {
            positions: corners.clone(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        builder.build().expect("a mesh")
    };
    let fast = scene(Precision::Fast);
    for precision in careful() {
        for p in [DVec3::splat(0.2), DVec3::new(-1.0, 0.3, 0.2), DVec3::splat(4.0)] {
            assert_eq!(scene(precision).closest_point(p), fast.closest_point(p));
        }
    }
}

/// Points that follow each other, on a mesh far from its own origin: the batch has the bits of single queries.
#[test]
fn neighbours_far_from_the_meshs_origin() {
    let c = 4e6f32;
    let mut builder = SceneBuilder::default();
    let positions = vec![Vec3::splat(c), Vec3::new(c + 1.0, c, c), Vec3::new(c, c + 1.0, c)];
    let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    builder.add_instance(mesh, DAffine3::from_translation(DVec3::splat(-4e6)));
    let scene = builder.build().expect("a triangle");
    let points: Vec<DVec3> =
        (0..1000).map(f64::from).map(|i| DVec3::new(-0.3 - 0.001 * i, -0.2 - 0.0007 * i, 0.1 + 0.0003 * i)).collect();
    let mut found = vec![None; points.len()];
    scene.closest_points(&points, f64::INFINITY, &mut found);
    assert!(points.iter().zip(&found).all(|(p, found)| found.is_some() && *found == scene.closest_point(*p)));
}

/// Coordinates of all sizes, at the tier that keeps every digit.
#[test]
fn exact_meshes_of_all_sizes_have_nearest_points() {
    let huge = 2f32.powi(90);
    let mut builder = SceneBuilder::new(BuildOptions { precision: Precision::Exact, ..BuildOptions::default() });
    let positions: Vec<Vec3> = (0..192)
        .map(|i| Vec3::new(huge * (1.0 + (i / 3) as f32), (i % 3) as f32 * huge, (i % 2) as f32 * 2f32.powi(-149)))
        .collect();
    let triangles = (0..64).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let mut positions = positions;
    positions.iter_mut().skip(1).step_by(3).for_each(|p| p.z = huge);
    let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles }]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    let scene = builder.build().expect("a mesh");
    let (got, expected) = (scene.closest_point(DVec3::ZERO), reference::closest_point(&scene, DVec3::ZERO));
    assert!(got.is_some());
    assert_eq!(got.map(|c| (c.id, c.distance)), expected.map(|c| (c.id, c.distance)));
}
