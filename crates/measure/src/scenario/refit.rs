//! S12: what moves answers as if it were built anew.

use firsthit_accel::{BuildError, BuildOptions, Crossings, Layout, Scene, SceneBuilder};
use firsthit_geometry::Ray;
use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::repeat::bits;
use super::{Check, triangles};
use crate::mesh::{Mesh, icosphere};
use crate::random::Rng;

/// What becomes of a vertex.
type Motion = (&'static str, fn(Vec3, &mut Rng) -> Vec3);

/// Each is applied to the mesh as it was built, and also to what the one before made of it.
const MOTIONS: [Motion; 9] = [
    ("small motion", |p, rng| p + rng.in_cube().as_vec3() * 0.02),
    ("large motion", |p, rng| p + rng.in_cube().as_vec3() * 2.0),
    ("mirrored", |p, _| p * Vec3::new(-1.0, 1.0, 1.0)),
    ("a thousandth", |p, _| p * 1e-3),
    ("a thousand times", |p, _| p * 1e3),
    ("moved away", |p, _| p + Vec3::splat(1e4)),
    ("flat", |p, _| p * Vec3::new(1.0, 0.0, 1.0)),
    ("half of it collapsed", |p, _| if p.x > 0.0 { Vec3::new(0.5, p.y, 0.0) } else { p }),
    ("a point", |_, _| Vec3::ONE),
];

fn placed(seed: u64) -> Vec<DAffine3> {
    let mut rng = Rng(seed);
    let mut place = || {
        let turn = DQuat::from_axis_angle(rng.direction(), 1.0);
        let stretch = DVec3::ONE + rng.in_cube() * 0.5;
        DAffine3::from_scale_rotation_translation(stretch, turn, rng.in_cube() * 3.0)
    };
    (0..3).map(|_| place()).collect()
}

/// A mesh that is not changed beside the one that is, so that both kinds of models are there.
fn build(options: BuildOptions, mesh: &Mesh, places: &[DAffine3]) -> Result<Scene, BuildError> {
    let mut builder = SceneBuilder::new(options);
    let moving = builder.add_mesh(vec![triangles(mesh)]);
    let still = builder.add_mesh(vec![triangles(&icosphere(1))]);
    for (i, place) in places.iter().enumerate() {
        builder.add_instance(if i == 0 { still } else { moving }, *place);
    }
    builder.build()
}

fn moved(mesh: &Mesh, by: fn(Vec3, &mut Rng) -> Vec3, rng: &mut Rng) -> Mesh {
    Mesh { positions: mesh.positions.iter().map(|p| by(*p, rng)).collect(), ..mesh.clone() }
}

pub(super) fn run(check: &mut Check<'_>) {
    check.recipe(
        "an icosphere in two instances, moved a little and a lot, mirrored, scaled, flattened and collapsed, and back; \
         other transforms; in every layout: closest hits (ids and bits of t, u, v, normal), any hits and counts as of a \
         scene built anew; a NaN frame and other counts are refused, and the old scene answers as before",
    );
    let rest = icosphere(3);
    let count = check.wanted() / (2 * Layout::ALL.len() * MOTIONS.len()) as u64;
    let mut hits = 0;
    for precision in check.tiers() {
        for layout in Layout::ALL {
            let options = BuildOptions { precision, layout, ..BuildOptions::default() };
            match case(check, options, &rest, count) {
                Ok(n) => hits += n,
                Err(e) => check.fail(1, || format!("{precision}, {layout:?}: a good scene was refused: {e}")),
            }
            if check.stop(0.5) {
                return;
            }
        }
    }
    check.measured(format!("{hits} rays hit something"));
}

/// How many rays hit something.
fn case(check: &mut Check<'_>, options: BuildOptions, rest: &Mesh, count: u64) -> Result<u64, BuildError> {
    let mut hits = 0;
    let seed = check.settings.seed;
    let mut rng = Rng(seed);
    let places = placed(seed);
    let first = build(options, rest, &places)?;
    let name = |what: &str| format!("{}, {:?}, {what}", options.precision, options.layout);
    let mut last = first.clone();
    for (what, motion) in MOTIONS {
        let mesh = moved(rest, motion, &mut rng);
        let anew = build(options, &mesh, &places)?;
        for old in [first.clone(), last.clone()] {
            let refit = old.refit(0, &[triangles(&mesh)])?;
            hits += same(check, &refit, &anew, &mesh, &mut rng, count, &name(what));
            let (a, b) = (refit.stats(), anew.stats());
            let stats = a.degenerate_triangles == b.degenerate_triangles && refit.bounds() == anew.bounds();
            check.expect(stats, || name(&format!("{what}: {a:?}, anew {b:?}")));
            last = refit;
        }
    }
    // From a point, whose triangles have no place in a tree.
    let back = last.refit(0, &[triangles(rest)])?;
    hits += same(check, &back, &first, rest, &mut rng, count, &name("back from a point"));
    let others: Vec<DAffine3> = placed(seed + 1);
    hits += same(
        check,
        &first.with_transforms(&others)?,
        &build(options, rest, &others)?,
        rest,
        &mut rng,
        count,
        &name("placed"),
    );

    // Frames that are refused leave the old scene as it was.
    let with = |change: fn(&mut Mesh)| {
        let mut mesh = rest.clone();
        change(&mut mesh);
        triangles(&mesh)
    };
    let refused = [
        first.refit(0, &[with(|m| m.positions[7].y = f32::NAN)]),
        first.refit(0, &[with(|m| m.positions[7].y = f32::INFINITY)]),
        first.refit(0, &[with(|m| m.triangles[7][1] = u32::MAX)]),
        first.refit(0, &[with(|m| m.triangles.truncate(7))]),
        first.refit(0, &[]),
        first.refit(2, &[triangles(rest)]),
        first.with_transforms(&places[1..]),
        first.with_transforms(&[DAffine3::IDENTITY, DAffine3::ZERO, DAffine3::IDENTITY]),
    ];
    for (i, result) in refused.into_iter().enumerate() {
        check.expect(result.is_err(), || name(&format!("bad frame {i} was taken")));
    }
    hits += same(check, &first, &build(options, rest, &places)?, rest, &mut rng, count, &name("after bad frames"));
    Ok(hits)
}

/// Rays at the mesh and at random, of which both scenes must say the same to the bit. Tells how many hit something.
fn same(check: &mut Check<'_>, a: &Scene, b: &Scene, mesh: &Mesh, rng: &mut Rng, count: u64, name: &str) -> u64 {
    let instances = placed(check.settings.seed);
    let mut hits = 0;
    let reach = b.bounds().extent().max_element().max(1.0);
    for k in 0..count {
        let origin = b.bounds().center() + rng.in_cube() * reach;
        let direction = if k % 2 == 0 {
            let corners = mesh.corners(rng.below(mesh.triangles.len()));
            // Sometimes exactly at a vertex.
            let at = if k % 4 == 0 { corners[0] } else { (corners[0] + corners[1] + corners[2]) / 3.0 };
            instances[1].transform_point3(at) - origin
        } else {
            rng.direction()
        };
        let ray = Ray::new(origin, direction);
        let (x, y) = (a.closest_hit(&ray), b.closest_hit(&ray));
        check.expect(bits(&x) == bits(&y), || format!("{name}: {x:?}, anew {y:?}, {ray:?}"));
        hits += u64::from(y.is_some());
        let counted = [a, b].map(|s| (s.any_hit(&ray), s.count_hits(&ray, Crossings::Surfaces)));
        check.expect(counted[0] == counted[1], || format!("{name}: any hit and count {counted:?}, {ray:?}"));
    }
    hits
}
