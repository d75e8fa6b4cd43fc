//! S15: overlapping faces in one plane.

use firsthit_accel::{Crossings, reference};
use firsthit_geometry::Ray;
use glam::{DAffine3, DVec3, Vec3};

use super::{Check, scene_of};
use crate::mesh::Mesh;
use crate::random::Rng;

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "60 triangles on a coarse grid in five planes, many of them equal: all hits of axis-parallel and oblique rays \
         through grid points and between are the brute force's, sorted by t and id, each once; a ray that starts again at \
         a hit's t finds its ties",
    );
    let mut rng = Rng(check.settings.seed);
    let mut grid = |n: usize| rng.below(n) as f32 - (n / 2) as f32;
    let mut mesh = Mesh::default();
    for k in 0..60u32 {
        let z = grid(5);
        mesh.positions.extend((0..3).map(|_| Vec3::new(grid(9), grid(9), z)));
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    let count = check.wanted();
    for precision in check.tiers() {
        let Some(scene) = scene_of(check, &mesh, DAffine3::IDENTITY, precision) else { return };
        let mut rng = Rng(check.settings.seed + 1);
        for k in 0..count {
            let half = |rng: &mut Rng| (rng.below(17) as f64 - 8.0) * 0.5;
            let origin = DVec3::new(half(&mut rng), half(&mut rng), 8.0);
            // Oblique by quarters: t is a number without rounding, and so is the point.
            let direction = if k % 2 == 0 { DVec3::NEG_Z } else { DVec3::new(0.25, -0.5, -1.0) };
            let ray = Ray::new(origin, direction);
            let hits = scene.all_hits(&ray, Crossings::Triangles);
            let key = |h: &firsthit_accel::Hit| (h.t.to_bits(), h.id);
            let expected: Vec<_> = reference::all_hits(&scene, &ray).iter().map(key).collect();
            let got: Vec<_> = hits.iter().map(key).collect();
            check.expect(got == expected, || format!("{precision}: {ray:?}: {got:?}, not {expected:?}"));
            check.expect(scene.closest_hit(&ray).map(|h| h.id) == hits.first().map(|h| h.id), || {
                format!("{precision}: {ray:?}: the closest hit is not the first")
            });
            if let Some(hit) = hits.get(hits.len() / 2) {
                let again = scene.all_hits(&ray.with_interval(hit.t, hit.t), Crossings::Triangles);
                let ties: Vec<_> = hits.iter().filter(|h| h.t == hit.t).map(key).collect();
                let found: Vec<_> = again.iter().map(key).collect();
                check.expect(found == ties, || format!("{precision}: {ray:?} at {}: {found:?}, not {ties:?}", hit.t));
            }
        }
    }
}
