//! Single rays take a shorter way at the tiers that are asked most: the same bits as the way of all queries.

use firsthit_accel::{BuildOptions, Crossings, Geometry, Layout, Level, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray, Shape, shapes::Sphere};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

use crate::bits;

pub(super) fn vector() -> impl Strategy<Value = DVec3> {
    [-1.0..1.0f64, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from)
}

/// Triangles of any size, slivers among them, some twice; all of one scale.
pub(super) fn mesh() -> impl Strategy<Value = (Vec<Vec3>, Vec<[u32; 3]>)> {
    let triangle = (vector(), vector(), vector(), prop::sample::select(vec![1.0, 0.1, 1e-3, 1e-6]), 0..4, 0.0..1.0f64);
    let scale = prop::sample::select(vec![1.0f32, 1e-6, 1e6, 1e-20, 3e10]);
    (prop::collection::vec(triangle, 1..60), scale, prop::bool::ANY).prop_map(|(corners, scale, twice)| {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (a, along, off, size, sliver, part) in corners {
            let b = a + along * size;
            let c = if sliver == 0 { a.lerp(b, part) + off * (size * 1e-6) } else { a + off * size };
            let first = positions.len() as u32;
            positions.extend([a, b, c].map(|p| p.as_vec3() * scale));
            triangles.push([first, first + 1, first + 2]);
            if twice {
                triangles.push([first, first + 1, first + 2]);
            }
        }
        (positions, triangles)
    })
}

/// None, even, mirrored, and of all kinds.
pub(super) fn place() -> impl Strategy<Value = DAffine3> {
    let size = prop::sample::select(vec![
        (DVec3::ONE, false),
        (DVec3::splat(0.37), false),
        (DVec3::splat(-2.5), false),
        (DVec3::new(-1.0, 2.0, 0.1), true),
    ]);
    (size, vector(), -3.0..3.0f64, prop::sample::select(vec![0.0, 1.0, 1e5])).prop_map(
        |((size, turned), axis, angle, far)| {
            let turn =
                if turned { DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle) } else { DQuat::IDENTITY };
            DAffine3::from_scale_rotation_translation(size, turn, axis * far)
        },
    )
}

/// How a ray is aimed: at which triangle, where on it, from where and how far, and what else is odd about it.
type Aim = (prop::sample::Index, (f64, f64), DVec3, f64, f64, u8, (f64, f64));

fn aim() -> impl Strategy<Value = Aim> {
    let distance = prop::sample::select(vec![0.0, 0.3, 3.0, 20.0, 1e3, 1e7, 1e12]);
    let length = prop::sample::select(vec![1.0, 1.0, 1.0, 1e-5, 1e30, 1e-150, 1e-160, 1e150, 3e153]);
    let (least, most) = (f64::NEG_INFINITY, f64::INFINITY);
    let interval = prop::sample::select(vec![
        (0.0, most),
        (0.0, most),
        (0.0, most),
        (least, most),
        (least, 0.0),
        (0.0, -0.0),
        (-0.0, f64::MAX),
        (most, most),
        (f64::NAN, 1.0),
        (f64::MIN, -1e-310),
        (0.0, 1.0),
        (1e-3, 1.5),
    ]);
    let weight = prop_oneof![Just(0.0), Just(0.5), 0.0..0.5f64];
    (any::<prop::sample::Index>(), (weight.clone(), weight), vector(), distance, length, 0u8..24, interval)
}

fn ray(
    (which, (v, w), from, distance, length, odd, (t_min, t_max)): Aim,
    corners: &[[DVec3; 3]],
    size: f64,
) -> Ray<f64> {
    let [a, b, c] = corners[which.index(corners.len())];
    let target = a * (1.0 - v - w) + b * v + c * w;
    let (mut origin, mut direction) = (target + from * (size * distance), -from);
    match odd {
        0..=2 => {
            direction = DVec3::AXES[usize::from(odd)];
            direction[(usize::from(odd) + 1) % 3] = -0.0;
            origin = target - direction * size;
        }
        3 => (origin, direction) = (a + (a - b) * 3.0, b - a),
        4 => direction.x = 1e-30,
        5 => direction.y = -1e-310,
        6 => direction.z = 0.0,
        7 => origin.x = f64::NAN,
        8 => direction.y = f64::INFINITY,
        9 => origin = DVec3::splat(1.7e308),
        10 => direction = DVec3::ZERO,
        _ => {}
    }
    Ray { origin, direction: direction * length, t_min, t_max }
}

fn same(scene: &Scene, ray: &Ray<f64>) -> Result<(), TestCaseError> {
    let (single, general) = (scene.closest_hit(ray), scene.closest_hit_counted(ray).0);
    prop_assert_eq!(bits(&single), bits(&general), "{:?} {:?}", scene.options(), ray);
    prop_assert_eq!(scene.any_hit(ray), general.is_some(), "{:?} {:?}", scene.options(), ray);
    let (mut hits, mut any) = ([None; 8], [false; 8]);
    scene.closest_hits(&[*ray; 8], &mut hits);
    scene.any_hits(&[*ray; 8], &mut any);
    // Of `Fast`, what lies at the very edge of a box may differ.
    if scene.options().precision == Precision::Robust {
        prop_assert_eq!(hits.map(|h| bits(&h)), [bits(&single); 8], "{:?} {:?}", scene.options(), ray);
        prop_assert_eq!(any, [single.is_some(); 8], "{:?} {:?}", scene.options(), ray);
    }
    for crossings in [Crossings::Triangles, Crossings::Surfaces] {
        let (count, all) = (scene.count_hits(ray, crossings), scene.all_hits(ray, crossings));
        prop_assert_eq!(count as usize, all.len(), "{:?} {:?} {:?}", scene.options(), ray, crossings);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn single_rays_find_what_all_queries_find(
        (positions, triangles) in mesh(), place in place(), aims in prop::collection::vec(aim(), 40), shrunk: bool,
    ) {
        let corners: Vec<[DVec3; 3]> =
            triangles.iter().map(|t| t.map(|i| place.transform_point3(positions[i as usize].as_dvec3()))).collect();
        let size = corners.iter().flatten().fold(0.0f64, |m, p| m.max((*p - corners[0][0]).abs().max_element()));
        for precision in [Precision::Fast, Precision::Robust] {
            for (layout, simd) in Level::ALL.iter().flat_map(|&l| [(Layout::Wide8, l), (Layout::Compact8, l)]) {
                let mut builder = SceneBuilder::new(BuildOptions { precision, layout, simd, ..BuildOptions::default() });
                let geometry = |positions: &[Vec3]| {
                    Geometry::Triangles { positions: positions.to_vec(), triangles: triangles.clone() }
                };
                let mesh = builder.add_mesh(vec![geometry(&positions)]);
                builder.add_instance(mesh, place);
                let mut scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?;
                if shrunk {
                    // Every third triangle becomes a point.
                    let mut moved = positions.clone();
                    for t in triangles.iter().step_by(3) {
                        let [a, b, c] = t.map(|i| i as usize);
                        (moved[b], moved[c]) = (moved[a], moved[a]);
                    }
                    scene = scene.refit(0, &[geometry(&moved)]).map_err(|e| TestCaseError::fail(e.to_string()))?;
                }
                for aim in &aims {
                    let ray = ray(*aim, &corners, size);
                    same(&scene, &ray)?;
                    if let Some(hit) = scene.closest_hit(&ray) {
                        for (t_min, t_max) in [(ray.t_min, hit.t), (hit.t, ray.t_max), (ray.t_min, hit.t.next_down())] {
                            same(&scene, &Ray { t_min, t_max, ..ray })?;
                        }
                    }
                }
            }
        }
    }

    /// Meshes placed several times (apart, on top of each other, far away), one hidden, with a shape among them: closest and any hit
    /// by the tree above in single precision, and as all queries find them.
    #[test]
    fn several_instances_are_asked_as_all_queries_ask_them(
        (positions, triangles) in mesh(), places in prop::collection::vec(place(), 2..7), aims in prop::collection::vec(aim(), 40),
        (shape, hidden, twice) in (0u8..3, 0usize..6, prop::bool::ANY), spread in prop::sample::select(vec![0.0, 1.0, 1e4, 1e20]),
    ) {
        let size = positions.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let apart = |k: usize| DVec3::new(k as f64, 0.5 * k as f64, -0.3) * (spread * f64::from(size));
        let mut places: Vec<_> =
            places.iter().enumerate().map(|(k, p)| DAffine3::from_translation(apart(k)) * *p).collect();
        if twice {
            places.push(places[0]);
        }
        for simd in Level::ALL {
            let precision = Precision::Robust;
            let mut builder = SceneBuilder::new(BuildOptions { precision, simd, ..BuildOptions::default() });
            let mesh = builder.add_mesh(vec![Geometry::Triangles { positions: positions.clone(), triangles: triangles.clone() }]);
            for place in &places {
                builder.add_instance(mesh, *place);
            }
            if hidden < places.len() {
                builder.set_mask(hidden, 2);
            }
            if shape > 0 {
                let at = if shape == 1 { apart(1) } else { DVec3::ZERO };
                let ball = Sphere::new(at, f64::from(size)).map_err(|e| TestCaseError::fail(e.to_string()))?;
                let ball = builder.add_mesh(vec![Geometry::Shape(Shape::Sphere(ball))]);
                builder.add_instance(ball, DAffine3::IDENTITY);
            }
            let scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?.seen_by(1);
            for (k, aim) in aims.iter().enumerate() {
                let place = places[k % places.len()];
                let corners: Vec<[DVec3; 3]> =
                    triangles.iter().map(|t| t.map(|i| place.transform_point3(positions[i as usize].as_dvec3()))).collect();
                let ray = ray(*aim, &corners, f64::from(size));
                same(&scene, &ray)?;
                if let Some(hit) = scene.closest_hit(&ray) {
                    for (t_min, t_max) in [(ray.t_min, hit.t), (hit.t, ray.t_max), (ray.t_min, hit.t.next_down())] {
                        same(&scene, &Ray { t_min, t_max, ..ray })?;
                    }
                    // From a surface the triangle that is left may be left out.
                    let point = scene.surface_point(&ray, &hit);
                    let direction = ray.direction.cross(hit.normal()).normalize_or(DVec3::X) + hit.normal();
                    if direction.is_finite() && point.error.is_finite() {
                        let away = Ray::new(point.spawn(direction), direction);
                        let next = scene.closest_hit(&away);
                        prop_assert_eq!(bits(&next), bits(&scene.closest_hit_from(&away, hit.id)));
                        prop_assert_eq!(next.is_some(), scene.any_hit_from(&away, hit.id));
                    }
                }
            }
        }
    }
}
