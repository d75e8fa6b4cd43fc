//! S9, S10 and S14: input that is not as it should be.

use std::hint::black_box;
use std::time::Duration;

use firsthit_accel::{BuildError, SceneBuilder};
use firsthit_geometry::Ray;
use glam::{DAffine3, DVec3};

use super::{Check, scene_of, triangles};
use crate::mesh::{Mesh, icosphere};
use crate::random::Rng;
use crate::timing::Paired;

/// Builds a mesh as the second of two geometries of the second mesh.
fn refusal(good: &Mesh, bad: &Mesh) -> Option<BuildError> {
    let mut builder = SceneBuilder::default();
    builder.add_mesh(vec![triangles(good)]);
    builder.add_mesh(vec![triangles(good), triangles(bad)]);
    builder.build().err()
}

/// S9.
pub(super) fn bad_meshes(check: &mut Check<'_>) {
    check.recipe(
        "icospheres with NaN, infinite and huge vertices at random (1 in 100) and indices out of range: an error names the \
         first that is wrong; huge but finite numbers are numbers like any other",
    );
    let good = icosphere(2);
    let mut rng = Rng(check.settings.seed);
    let count = check.wanted();
    for _ in 0..count {
        let mut mesh = good.clone();
        let mut first = None;
        for (k, p) in mesh.positions.iter_mut().enumerate() {
            if rng.below(100) == 0 {
                let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38][rng.below(4)];
                p[rng.below(3)] = value;
                if !value.is_finite() {
                    first = first.or(Some(k));
                }
            }
        }
        let expected = first.map(|vertex| BuildError::NotFinite { mesh: 1, geometry: 1, vertex });
        let error = refusal(&good, &mesh);
        check.expect(error == expected, || format!("{error:?}, not {expected:?}"));

        let mut mesh = good.clone();
        let (triangle, corner) = (rng.below(mesh.triangles.len()), rng.below(3));
        let index = [mesh.positions.len() as u32, 1 << 31, u32::MAX][rng.below(3)];
        mesh.triangles[triangle][corner] = index;
        let count = mesh.positions.len();
        let expected = Some(BuildError::IndexOutOfRange { mesh: 1, geometry: 1, triangle, index, count });
        let error = refusal(&good, &mesh);
        check.expect(error == expected, || format!("{error:?}, not {expected:?}"));
    }
    for precision in check.tiers() {
        let huge = good.clone().map(|p| p * 3e38);
        let Some(scene) = scene_of(check, &huge, DAffine3::IDENTITY, precision) else { return };
        let d = DVec3::new(0.1, 0.2, 0.3) * 1e38;
        let hit = scene.closest_hit(&Ray::new(DVec3::ZERO, d));
        // The sphere is faceted: its radius varies by a few percent.
        let right = hit.is_some_and(|h| (h.t * d.length() / 3e38 - 1.0).abs() < 0.05);
        check.expect(right, || format!("{precision}, coordinates of 3e38: {hit:?}"));
    }
}

/// S10: what can be shown without 2^31 triangles in memory; limits of counts are held by a test of the tree's own.
pub(super) fn huge_indices(check: &mut Check<'_>) {
    check.recipe("indices of 2^31, 2^32 - 1 and just past the end, instances of meshes that are not there");
    let good = icosphere(1);
    for index in [1 << 31, u32::MAX, good.positions.len() as u32] {
        let mut mesh = good.clone();
        mesh.triangles[7][2] = index;
        let error = refusal(&good, &mesh);
        let named = matches!(error, Some(BuildError::IndexOutOfRange { triangle: 7, index: i, .. }) if i == index);
        check.expect(named, || format!("{index}: {error:?}"));
    }
    let mut builder = SceneBuilder::default();
    builder.add_instance(3, DAffine3::IDENTITY);
    let error = builder.build().err();
    let expected = Some(BuildError::NoSuchMesh { instance: 0, mesh: 3, count: 0 });
    check.expect(error == expected, || format!("{error:?}"));
}

/// A ray made invalid in one of eight ways.
fn spoiled(k: usize, mut ray: Ray<f64>) -> Ray<f64> {
    match k % 8 {
        0 => ray.origin.x = f64::NAN,
        1 => ray.origin.y = f64::INFINITY,
        2 => ray.direction = DVec3::ZERO,
        3 => ray.direction.z = f64::NAN,
        4 => ray.direction.x = f64::NEG_INFINITY,
        5 => (ray.t_min, ray.t_max) = (1.0, 0.0),
        6 => ray.t_min = f64::NAN,
        _ => ray.t_max = f64::NAN,
    }
    ray
}

/// S14.
pub(super) fn bad_rays(check: &mut Check<'_>) {
    check.recipe("one ray in three invalid, in one of eight ways, in a batch on an icosphere; and their time");
    for precision in check.tiers() {
        let Some(scene) = scene_of(check, &icosphere(4), DAffine3::IDENTITY, precision) else { return };
        let mut rng = Rng(check.settings.seed);
        let good: Vec<_> = (0..check.wanted()).map(|_| Ray::new(rng.in_cube() * 2.0, rng.direction())).collect();
        let spoil = |(k, &ray): (usize, &Ray<f64>)| if k % 3 == 0 { spoiled(k / 3, ray) } else { ray };
        let mixed: Vec<_> = good.iter().enumerate().map(spoil).collect();
        let (mut expected, mut got) = (vec![None; good.len()], vec![None; good.len()]);
        scene.closest_hits(&good, &mut expected);
        scene.par_closest_hits(&mixed, &mut got);
        for (k, (e, g)) in expected.iter().zip(&got).enumerate() {
            let right = if k % 3 == 0 { g.is_none() && !scene.any_hit(&mixed[k]) } else { e == g };
            check.expect(right, || format!("{precision}, ray {k}: {:?}: {g:?}", mixed[k]));
        }
        let bad: Vec<_> = good.iter().enumerate().map(|(k, &ray)| spoiled(k, ray)).collect();
        let sets = [&good, &bad];
        let work = |way: usize| scene.closest_hits(black_box(sets[way]), &mut got);
        let timed = Paired::run(2, (5, 5), Duration::ZERO, work, || false);
        let ratio = timed.ratio(1, 0);
        check.measured(format!("{precision}: an invalid ray takes {ratio:.2} times the time of a valid one"));
        check.expect(ratio <= 2.5, || format!("{precision}: invalid rays take {ratio} times as long"));
    }
}
