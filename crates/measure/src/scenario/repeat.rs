//! S13: the same bits, however they are computed.

use firsthit_accel::{BuildOptions, BuildQuality, Crossings, Hit, Layout, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use glam::{DAffine3, DQuat, DVec3};

use super::{Check, triangles};
use crate::mesh::icosphere;
use crate::random::Rng;

fn build(precision: Precision, quality: BuildQuality, layout: Layout, seed: u64) -> Option<Scene> {
    let mut builder = SceneBuilder::new(BuildOptions { precision, quality, layout, ..BuildOptions::default() });
    let mesh = builder.add_mesh(vec![triangles(&icosphere(4))]);
    let mut rng = Rng(seed);
    for _ in 0..20 {
        let turn = DQuat::from_axis_angle(rng.direction(), 1.0);
        let stretch = DVec3::ONE + rng.in_cube() * 0.5;
        builder.add_instance(mesh, DAffine3::from_scale_rotation_translation(stretch, turn, rng.in_cube() * 3.0));
    }
    builder.build().ok()
}

/// Everything about a hit, to the bit.
pub(super) type Bits = ([u32; 5], u64, [u64; 3]);

pub(super) fn bits(hit: &Option<Hit>) -> Option<Bits> {
    hit.map(|h| {
        let id = [h.id.instance, h.id.geometry, h.id.primitive, h.u.to_bits(), h.v.to_bits()];
        (id, h.t.to_bits(), h.normal().to_array().map(f64::to_bits))
    })
}

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "20 stretched icospheres: closest hit, any hit and counts by one ray at a time, by slices, on 1, 2 and 5 threads, \
         of a second build, of trees of other quality, of every layout",
    );
    let (seed, count) = (check.settings.seed, check.wanted());
    for precision in check.tiers() {
        let of = |quality, layout| build(precision, quality, layout, seed);
        let Some(scene) = of(BuildQuality::default(), Layout::default()) else {
            check.fail(1, || format!("{precision}: a good scene was refused"));
            return;
        };
        let mut rng = Rng(seed + 1);
        let rays: Vec<_> = (0..count).map(|_| Ray::new(rng.in_cube() * 5.0, rng.direction())).collect();
        let expected: Vec<_> = rays.iter().map(|r| bits(&scene.closest_hit(r))).collect();
        let counts: Vec<u32> = rays.iter().map(|r| scene.count_hits(r, Crossings::Surfaces)).collect();
        let mut hits = vec![None; rays.len()];
        scene.closest_hits(&rays, &mut hits);
        same_hits(check, &hits, &expected, &format!("{precision}, a slice"));
        let mut others: Vec<(String, Option<Scene>)> =
            vec![("a second build".into(), of(BuildQuality::default(), Layout::default()))];
        others.extend([BuildQuality::Fast, BuildQuality::High].map(|q| (format!("{q:?}"), of(q, Layout::default()))));
        others.extend(Layout::ALL.map(|l| (format!("{l:?}"), of(BuildQuality::default(), l))));
        for (name, other) in others {
            hits.fill(None);
            if let Some(other) = other {
                other.closest_hits(&rays, &mut hits);
            }
            same_hits(check, &hits, &expected, &format!("{precision}, {name}"));
        }
        for threads in [1, 2, 5] {
            let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else { continue };
            let (mut any, mut counted) = (vec![false; rays.len()], vec![0; rays.len()]);
            pool.install(|| {
                scene.par_closest_hits(&rays, &mut hits);
                scene.par_any_hits(&rays, &mut any);
                scene.par_count_hits(&rays, Crossings::Surfaces, &mut counted);
            });
            let name = format!("{precision}, {threads} threads");
            same_hits(check, &hits, &expected, &name);
            let same = any.iter().zip(&expected).all(|(a, h)| *a == h.is_some());
            check.expect(same, || format!("{name}: any hit and closest hit disagree"));
            check.expect(counted == counts, || format!("{name}: counts differ"));
        }
    }
}

fn same_hits(check: &mut Check<'_>, hits: &[Option<Hit>], expected: &[Option<Bits>], name: &str) {
    let wrong = hits.iter().zip(expected).filter(|(h, e)| bits(h) != **e).count() as u64;
    check.outcome.count += hits.len() as u64;
    if wrong > 0 {
        check.fail(wrong, || format!("{name}: {wrong} answers differ"));
    }
}
