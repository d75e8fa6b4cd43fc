//! S1 and S2: closed meshes have no holes.

use firsthit_accel::{BuildOptions, Crossings, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use glam::DVec3;
use rayon::prelude::*;

use super::Check;
use crate::mesh::{bumpy_sphere, grid_cube, icosphere, torus};
use crate::metric::lost_by_traversal;
use crate::random::{Aim, Rng};
use crate::subject::{Subject, desc_of};
use crate::workload::{aimed_ray, interior_points};

/// Rays that share a mesh, a tier and a stream of random numbers; a run continues at a multiple of it.
const BATCH: u64 = 1 << 15;

/// A closed model at one tier, and points inside it.
struct Body {
    name: String,
    subject: usize,
    scene: Scene,
    inside: Vec<DVec3>,
    /// Vertices lie on a grid: rays along the axes meet them exactly.
    grid: bool,
}

fn bodies(check: &mut Check<'_>, tiers: &[Precision]) -> (Vec<Subject>, Vec<Body>) {
    let subjects = if check.settings.subjects.is_empty() {
        let made = |name: &str, mesh| Subject::new(name, desc_of(&mesh));
        vec![
            made("icosphere of 20 480 triangles", icosphere(5)),
            made("torus", torus(128, 64, 0.4)),
            made("grid cube", grid_cube(32)),
            made("bumpy sphere", bumpy_sphere(6)),
        ]
    } else {
        check.settings.subjects.clone()
    };
    let mut bodies = Vec::new();
    for (index, subject) in subjects.iter().enumerate() {
        if !subject.closed {
            check.fail(1, || format!("{} is not closed", subject.name));
            continue;
        }
        let mut inside = Vec::new();
        for &precision in tiers {
            let options = BuildOptions { precision, ..BuildOptions::default() };
            match SceneBuilder::from_desc(&subject.desc, options).build() {
                Ok(scene) => {
                    if inside.is_empty() {
                        inside = interior_points(subject, &scene, 256, &mut Rng(check.settings.seed));
                    }
                    if inside.is_empty() {
                        check.fail(1, || format!("{} has no interior point", subject.name));
                        break;
                    }
                    bodies.push(Body {
                        name: format!("{}, {precision}", subject.name),
                        subject: index,
                        scene,
                        inside: inside.clone(),
                        grid: subject.name == "grid cube",
                    });
                }
                Err(e) => check.fail(1, || format!("{}: {e}", subject.name)),
            }
        }
    }
    (subjects, bodies)
}

/// A ray with direction and origin as `f32` would have them.
fn rounded(ray: Ray<f64>) -> Ray<f64> {
    Ray { direction: ray.direction.as_vec3().as_dvec3(), origin: ray.origin.as_vec3().as_dvec3(), ..ray }
}

/// Along an axis through a vertex or the middle of an edge, from inside the grid.
fn along_axis(subject: &Subject, rng: &mut Rng) -> Option<Ray<f64>> {
    let aim = Aim::ALL[rng.below(2)];
    let triangle = subject.nth(rng.bits() % subject.triangles().max(1))?.in_world();
    let target = aim.point([triangle[0], (triangle[0] + triangle[1]) * 0.5, triangle[2]], rng);
    let axis = target.abs().to_array().iter().position(|x| *x == 1.0)?;
    let mut origin = target;
    origin[axis] = 0.0;
    // On the rim the ray would run along another face.
    (origin.abs().max_element() < 1.0).then(|| Ray::new(origin, DVec3::AXES[axis] * target[axis].signum() * 0.25))
}

fn ray_from_inside(body: &Body, subject: &Subject, batch: u64, k: usize, rng: &mut Rng) -> Option<Ray<f64>> {
    if body.grid && k % 4 == 3 {
        return along_axis(subject, rng);
    }
    let ray = aimed_ray(subject, &body.inside, k, rng)?;
    Some(if batch.is_multiple_of(2) { ray } else { rounded(ray) })
}

/// What a batch of rays came to.
#[derive(Default)]
struct Batch {
    rays: u64,
    leaks: Vec<Ray<f64>>,
    disagreements: u64,
}

impl Body {
    fn ask(&self, subject: &Subject, batch: u64, seed: u64) -> Batch {
        let mut rng = Rng(seed ^ (batch + 1).wrapping_mul(0xd134_2543_de82_ef95));
        let mut result = Batch::default();
        for k in 0..BATCH as usize {
            let Some(ray) = ray_from_inside(self, subject, batch, k, &mut rng) else { continue };
            let (hit, any) = (self.scene.closest_hit(&ray), self.scene.any_hit(&ray));
            result.rays += 1;
            result.disagreements += u64::from(hit.is_some() != any);
            if hit.is_none() {
                result.leaks.push(ray);
            }
        }
        result
    }
}

/// S1.
pub(super) fn from_inside(check: &mut Check<'_>) {
    check.recipe(format!(
        "rays in batches of {BATCH}: batch b asks mesh and tier b mod (meshes x tiers); from points inside, a third each \
         at vertices, edges and faces, half of them unit; every other batch with origin and direction rounded to f32; on \
         the grid a quarter along an axis through vertices and edges; closest hit and any hit"
    ));
    let tiers = check.tiers();
    let (subjects, bodies) = bodies(check, &tiers);
    if bodies.is_empty() {
        return;
    }
    let batches = check.wanted().div_ceil(BATCH);
    let first = (check.settings.from / BATCH).min(batches);
    check.outcome.count = first * BATCH;
    let seed = check.settings.seed;
    // A few batches a thread between looks at the clock.
    let round = 4 * rayon::current_num_threads() as u64;
    let mut next = first;
    while next < batches && !check.stop(next as f64 / batches as f64) {
        let end = (next + round).min(batches);
        let results: Vec<(u64, Batch)> = (next..end)
            .into_par_iter()
            .map(|b| {
                let body = &bodies[(b % bodies.len() as u64) as usize];
                (b, body.ask(&subjects[body.subject], b, seed))
            })
            .collect();
        for (b, result) in results {
            let body = &bodies[(b % bodies.len() as u64) as usize];
            check.outcome.count += result.rays;
            if result.disagreements > 0 {
                check.fail(result.disagreements, || format!("{}: closest hit and any hit disagree", body.name));
            }
            if let Some(ray) = result.leaks.first() {
                let traversal = lost_by_traversal(&body.scene, std::slice::from_ref(ray)) > 0;
                let whose = if traversal { "the traversal" } else { "the triangle test" };
                check.fail(result.leaks.len() as u64, || format!("{}: lost by {whose}: {ray:?}", body.name));
            }
        }
        next = end;
    }
    if next < batches {
        check.measured(format!("stopped: --from {} continues", next * BATCH));
    } else if check.outcome.failures == 0 {
        check.measured(format!("rate below {:.1e} (95 %)", 3.0 / check.outcome.count as f64));
    }
    teeth(check);
}

/// The same rays leak at the fast tier, or they would show nothing.
fn teeth(check: &mut Check<'_>) {
    if check.outcome.interrupted {
        return;
    }
    let (subjects, bodies) = bodies(check, &[Precision::Fast]);
    let mut lines = Vec::new();
    for (body, batch) in bodies.iter().zip(0..) {
        let result = body.ask(&subjects[body.subject], batch, check.settings.seed);
        lines.push(format!("{}: {} of {} leak", body.name, result.leaks.len(), result.rays));
    }
    check.measured(format!("for comparison: {}", lines.join("; ")));
}

/// S2.
pub(super) fn parity(check: &mut Check<'_>) {
    check.recipe(
        "lines from outside aimed at vertices, edges and faces in thirds; crossings of surfaces are counted, and those \
         against and along the normal",
    );
    let tiers = check.tiers();
    let (subjects, bodies) = bodies(check, &tiers);
    let each = check.wanted().div_ceil(bodies.len().max(1) as u64);
    for (i, body) in bodies.iter().enumerate() {
        if check.stop(i as f64 / bodies.len() as f64) {
            return;
        }
        let subject = &subjects[body.subject];
        let bounds = body.scene.bounds();
        let mut rng = Rng(check.settings.seed + i as u64);
        for k in 0..each as usize {
            let origin = bounds.center() + rng.direction() * bounds.extent().length() * (0.6 + rng.unit());
            let Some(ray) = aimed_ray(subject, &[origin], k, &mut rng) else { continue };
            let ray = if k % 2 == 0 { ray } else { rounded(ray) };
            let hits = body.scene.all_hits(&ray, Crossings::Surfaces);
            let enter = hits.iter().filter(|h| body.scene.enters(&ray, h)).count();
            let even = hits.len().is_multiple_of(2) && 2 * enter == hits.len();
            check.expect(even, || format!("{}: {enter} of {} hits enter: {ray:?}", body.name, hits.len()));
        }
    }
}
