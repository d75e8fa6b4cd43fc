//! S3: scale and place.

use firsthit_accel::Hit;
use firsthit_geometry::{Precision, Ray};
use glam::{DAffine3, DVec3};

use super::{Check, scene_of};
use crate::mesh::icosphere;
use crate::metric::{Truth, compare};
use crate::random::{Aim, Rng};
use crate::subject::{Subject, desc_of};
use crate::workload::{RayKind, RaySet};

/// From inside, at vertices, edges and faces.
fn rays(mesh: &crate::mesh::Mesh, center: DVec3, size: f64, count: u64, seed: u64) -> Vec<Ray<f64>> {
    let mut rng = Rng(seed);
    let ray = |k: u64| {
        let origin = center + rng.in_cube() * 0.4 * size;
        let corners = mesh.corners(rng.below(mesh.triangles.len()));
        Ray::new(origin, Aim::ALL[(k % 3) as usize].point(corners, &mut rng) - origin)
    };
    (0..count).map(ray).collect()
}

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "an icosphere of 5120 triangles, from inside, at vertices, edges and faces in thirds: scaled with its rays by \
         powers of two (no bit may change but t's scale); then scaled and moved with its vertices rounded again, against \
         the most careful tier (no leak, no wrong hit or miss off the margin)",
    );
    let mesh = icosphere(4);
    let (count, seed) = (check.wanted(), check.settings.seed);
    for precision in check.tiers() {
        powers_of_two(check, &mesh, precision, count, seed);
        let placed = [(1e-6, 0.0), (1e-3, 0.0), (1e3, 0.0), (1e6, 0.0), (1.0, 1e5), (1.0, 1e6), (1.0, 1e7)];
        for (i, (scale, offset)) in placed.into_iter().enumerate() {
            if check.stop(i as f64 / placed.len() as f64) {
                return;
            }
            rounded_again(check, precision, scale, offset, count);
        }
    }
}

fn powers_of_two(check: &mut Check<'_>, mesh: &crate::mesh::Mesh, precision: Precision, count: u64, seed: u64) {
    let Some(plain) = scene_of(check, mesh, DAffine3::IDENTITY, precision) else { return };
    let rays = rays(mesh, DVec3::ZERO, 1.0, count / 8, seed);
    for exponent in [-60, -20, -1, 1, 20, 60] {
        let s = 2f64.powi(exponent);
        let scaled = mesh.clone().map(|p| p * s as f32);
        let Some(scene) = scene_of(check, &scaled, DAffine3::IDENTITY, precision) else { return };
        for ray in &rays {
            let expected = plain.closest_hit(ray);
            let both = scene.closest_hit(&Ray::new(ray.origin * s, ray.direction * s));
            let kept = scene.closest_hit(&Ray::new(ray.origin * s, ray.direction));
            let stretched = expected.map(|h| Hit { t: h.t * s, ..h });
            check.expect(both == expected && kept == stretched, || format!("{precision}, 2^{exponent}: {ray:?}"));
        }
    }
}

fn rounded_again(check: &mut Check<'_>, precision: Precision, scale: f32, offset: f32, count: u64) {
    let mesh = icosphere(4).map(|p| p * scale + offset);
    // Far away, rounding may have flattened the mesh: then it encloses nothing that could leak.
    let subject = Subject::new("icosphere", desc_of(&mesh));
    let (Some(scene), Some(best)) = (
        scene_of(check, &mesh, DAffine3::IDENTITY, precision),
        scene_of(check, &mesh, DAffine3::IDENTITY, Precision::ALL[Precision::ALL.len() - 1]),
    ) else {
        return;
    };
    let rays = rays(&mesh, DVec3::splat(offset.into()), scale.into(), count, check.settings.seed);
    let hits: Vec<Option<Hit>> = rays.iter().map(|r| best.closest_hit(r)).collect();
    let set = RaySet { kind: RayKind::Aimed, timed: 0, inside: true, rays };
    let errors = compare(&subject, &scene, Truth { scene: &best, hits: &hits }, &set, 0, &|| false);
    let levels = if precision == Precision::Robust { 1 } else { 2 };
    let wrong = |by_level: [u64; 3]| by_level[..levels].iter().sum::<u64>();
    let failures = errors.leaked.len() as u64 + wrong(errors.false_hits) + wrong(errors.false_misses);
    check.outcome.count += errors.compared;
    if failures > 0 {
        check.fail(failures, || {
            let (leaks, hits, misses) = (errors.leaked.len(), errors.false_hits, errors.false_misses);
            format!("{precision}, scale {scale}, offset {offset}: {leaks} leaks, hits {hits:?}, misses {misses:?}")
        });
    }
}
