//! S11: placed meshes.

use firsthit_accel::{BuildError, BuildOptions, Hit, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use glam::{DAffine3, DMat3, DVec3};

use super::{Check, triangles};
use crate::flat::{FlatHit, FlatScene};
use crate::mesh::{Mesh, icosphere, soup};
use crate::random::Rng;

/// Two rotations about an uneven, perhaps mirroring stretch (together also a shear), anywhere; condition at most 1e3.
fn affine(rng: &mut Rng) -> DAffine3 {
    let turn = DMat3::from_axis_angle(rng.direction(), rng.unit() * 6.0);
    let back = DMat3::from_axis_angle(rng.direction(), rng.unit() * 6.0);
    let mut factor = || 10f64.powf(1.5 * rng.signed());
    let stretch = DVec3::new(factor(), factor(), factor());
    let mirror = DVec3::new(if rng.below(2) == 0 { -1.0 } else { 1.0 }, 1.0, 1.0);
    let size = 10f64.powf(rng.signed() * 3.0);
    let linear = turn * DMat3::from_diagonal(stretch * mirror * size) * back;
    DAffine3 { matrix3: linear, translation: rng.in_cube() * size * 3.0 }
}

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "soups of 40 triangles placed by rotation, uneven and mirroring stretch and shear under a common such transform, \
         against a plain f64 ray caster on the flattened mesh wherever that is clear by 1e-4: id, t, normal; transforms \
         of condition beyond 2^20 are refused by number",
    );
    let tiers = check.tiers();
    let mut rng = Rng(check.settings.seed);
    let rounds = check.wanted().div_ceil(100);
    let mut unclear = 0u64;
    for round in 0..rounds {
        if check.stop(round as f64 / rounds as f64) {
            return;
        }
        let mut builders: Vec<SceneBuilder> = tiers
            .iter()
            .map(|&precision| SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() }))
            .collect();
        let mut flat = FlatScene::default();
        let common = affine(&mut rng);
        let mut mirrored = Vec::new();
        for i in 0..3 {
            let parts: Vec<Mesh> = (0..2).map(|_| soup(&mut rng, 20)).collect();
            // Not worse conditioned than what is accepted, whatever the two come to.
            let transform = common * affine(&mut rng);
            mirrored.push(transform.matrix3.determinant() < 0.0);
            for builder in &mut builders {
                let m = builder.add_mesh(parts.iter().map(triangles).collect());
                builder.add_instance(m, transform);
            }
            for (g, part) in parts.iter().enumerate() {
                flat.add(i, g as u32, part, transform);
            }
        }
        let scenes: Vec<Scene> = builders.into_iter().filter_map(|b| b.build().ok()).collect();
        let Some(bounds) = scenes.first().map(Scene::bounds) else { continue };
        let (center, size) = (bounds.center(), bounds.extent().max_element());
        for _ in 0..100 {
            let origin = center + rng.in_cube() * size;
            let target = flat.triangles[rng.below(flat.triangles.len())].1.iter().sum::<DVec3>() / 3.0;
            let ray = Ray::new(origin, target - origin + rng.in_cube() * size * 0.01);
            let (expected, clear) = flat.closest_hit(ray.origin, ray.direction, 1e-4);
            if !clear {
                unclear += 1;
                continue;
            }
            for scene in &scenes {
                let hit = scene.closest_hit(&ray);
                let right = same(hit.as_ref(), expected.as_ref(), &mirrored) && scene.any_hit(&ray) == hit.is_some();
                check.expect(right, || format!("{}: {ray:?}: {hit:?}, not {expected:?}", scene.options().precision));
            }
        }
    }
    check.measured(format!("{unclear} rays were too close to call"));
    refused(check);
}

fn same(hit: Option<&Hit>, expected: Option<&FlatHit>, mirrored: &[bool]) -> bool {
    match (hit, expected) {
        (None, None) => true,
        (Some(h), Some(e)) => {
            // The outside stays outside: against the flattened winding the normal turns where space is mirrored.
            let side = if mirrored[h.id.instance as usize] { -1.0 } else { 1.0 };
            [h.id.instance, h.id.geometry, h.id.primitive] == e.id
                && (h.t - e.t).abs() < 1e-9 * (1.0 + e.t) / e.cosine
                && (h.normal().length() - 1.0).abs() < 1e-12
                && (h.normal() * side - e.normal).length() < 1e-6
        }
        _ => false,
    }
}

fn refused(check: &mut Check<'_>) {
    for (linear, good) in [
        (DMat3::from_diagonal(DVec3::new(1e-3, 1.0, 1e3)), true),
        (DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e7)), false),
        (DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)), false),
        (DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z), false),
        (DMat3::from_diagonal(DVec3::new(f64::INFINITY, 1.0, 1.0)), false),
    ] {
        let mut builder = SceneBuilder::new(BuildOptions { precision: Precision::Robust, ..BuildOptions::default() });
        let m = builder.add_mesh(vec![triangles(&icosphere(1))]);
        builder.add_instance(m, DAffine3::IDENTITY);
        builder.add_instance(m, DAffine3::from_mat3(linear));
        let error = builder.build().err();
        let expected = (!good).then_some(BuildError::IllConditioned { instance: 1 });
        check.expect(error == expected, || format!("{linear}: {error:?}"));
    }
}
