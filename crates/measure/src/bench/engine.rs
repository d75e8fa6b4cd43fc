//! What is timed: firsthit's scenes, and obvhs's own trees.

use std::hint::black_box;
use std::time::{Duration, Instant};

use firsthit_accel::{BuildError, BuildOptions, BuildQuality, Hit, Level, Scene, SceneBuilder};
use firsthit_geometry::Ray;
use glam::Vec3A;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::{BvhBuildParams, triangle::Triangle};
use rayon::prelude::*;

use super::rays::Set;
use super::result::BuildRow;
use super::{BenchOptions, BenchRays};
use crate::subject::Subject;

/// obvhs has no instances: with more triangles than this it is left out.
const MOST_FLAT: u64 = 20_000_000;

/// Rays that one task takes.
const CHUNK: usize = 1024;

/// What is to be built.
#[derive(Clone, Debug)]
pub(super) struct Spec {
    name: String,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Firsthit(BuildOptions),
    ObvhsBvh2,
    ObvhsCwbvh,
}

impl Spec {
    /// Every combination, with a name that says no more than tells it apart.
    pub(super) fn all(options: &BenchOptions) -> Vec<Self> {
        let mut specs = Vec::new();
        for &precision in &options.precisions {
            for &layout in &options.layouts {
                for &simd in &options.levels {
                    for &quality in &options.builds {
                        let mut name = format!("{precision} {}", layout.name());
                        if options.levels.len() > 1 || simd != usual_level() {
                            name = format!("{name} {simd}");
                        }
                        if options.builds.len() > 1 || quality != BuildQuality::default() {
                            name = format!("{name} {}", build_name(quality));
                        }
                        let build = BuildOptions { precision, layout, simd, quality, ..BuildOptions::default() };
                        specs.push(Self { name, kind: Kind::Firsthit(build) });
                    }
                }
            }
        }
        if options.peers {
            specs.push(Self { name: "obvhs bvh2".into(), kind: Kind::ObvhsBvh2 });
            specs.push(Self { name: "obvhs cwbvh".into(), kind: Kind::ObvhsCwbvh });
        }
        specs
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }
}

/// The level that scenes use by themselves.
pub(super) fn usual_level() -> Level {
    let best = || Level::ALL.into_iter().rev().find(|l| l.is_available());
    Some(Level::default()).filter(|l| l.is_available()).or_else(best).unwrap_or_default()
}

/// The name of a preset on command lines and in reports.
fn build_name(quality: BuildQuality) -> &'static str {
    match quality {
        BuildQuality::Fast => "fast",
        BuildQuality::Balanced => "balanced",
        BuildQuality::High => "high",
    }
}

/// A tree with what it took.
pub(super) struct Engine {
    name: String,
    seconds: f64,
    tree: Tree,
}

enum Tree {
    Firsthit(Scene),
    ObvhsBvh2(Flat<Bvh2>),
    ObvhsCwbvh(Flat<CwBvh>),
}

/// A tree of obvhs over all triangles in the world, which lie in the order of its leaves.
struct Flat<T> {
    tree: T,
    triangles: Vec<RtTriangle>,
    bytes: usize,
    /// Unknown of the wide tree.
    depth: Option<u32>,
}

impl Engine {
    /// Builds it; `None` where it cannot hold so many triangles.
    pub(super) fn build(spec: &Spec, subject: &Subject) -> Result<Option<Self>, BuildError> {
        if !matches!(spec.kind, Kind::Firsthit(_)) && subject.triangles() > MOST_FLAT {
            return Ok(None);
        }
        let flat = || -> Vec<Triangle> {
            let placed = (0..subject.triangles()).filter_map(|k| subject.nth(k));
            placed.map(|t| t.in_world().map(|p| p.as_vec3a())).map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect()
        };
        let medium = BvhBuildParams::medium_build();
        let (seconds, tree) = match spec.kind {
            Kind::Firsthit(options) => {
                let builder = SceneBuilder::from_desc(&subject.desc, options);
                let start = Instant::now();
                let scene = builder.build()?;
                (start.elapsed(), Tree::Firsthit(scene))
            }
            Kind::ObvhsBvh2 => {
                let triangles = flat();
                let start = Instant::now();
                let tree = build_bvh2_from_tris(&triangles, medium, &mut Duration::default());
                let triangles = reordered(&triangles, &tree.primitive_indices);
                let seconds = start.elapsed();
                let bytes = size_of_val(tree.nodes.as_slice());
                let depth = Some(tree.depth(0) as u32);
                (seconds, Tree::ObvhsBvh2(Flat { bytes, depth, tree, triangles }))
            }
            Kind::ObvhsCwbvh => {
                let triangles = flat();
                let start = Instant::now();
                let tree = build_cwbvh_from_tris(&triangles, medium, &mut Duration::default());
                let triangles = reordered(&triangles, &tree.primitive_indices);
                let seconds = start.elapsed();
                let bytes = size_of_val(tree.nodes.as_slice());
                (seconds, Tree::ObvhsCwbvh(Flat { bytes, depth: None, tree, triangles }))
            }
        };
        Ok(Some(Self { name: spec.name.clone(), seconds: seconds.as_secs_f64(), tree }))
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn row(&self, subject: &Subject) -> BuildRow {
        /// Beside its nodes: a triangle and its place in the mesh.
        const EACH: usize = size_of::<RtTriangle>() + size_of::<u32>();
        let flat = |bytes: usize, triangles: usize| (bytes + EACH * triangles) as f64 / triangles.max(1) as f64;
        let (sah_cost, depth, bytes_per_triangle) = match &self.tree {
            Tree::Firsthit(scene) => {
                let s = scene.stats();
                (Some(s.sah_cost), Some(s.depth), s.bytes as f64 / s.stored_triangles.max(1) as f64)
            }
            Tree::ObvhsBvh2(t) => (None, t.depth, flat(t.bytes, t.triangles.len())),
            Tree::ObvhsCwbvh(t) => (None, t.depth, flat(t.bytes, t.triangles.len())),
        };
        BuildRow {
            model: subject.name.clone(),
            engine: self.name.clone(),
            seconds: self.seconds,
            sah_cost,
            depth,
            bytes_per_triangle,
        }
    }

    /// Boxes and primitives tested for a ray, on average; `None` where nobody counts.
    pub(super) fn counts(&self, set: &Set) -> Option<(f64, f64)> {
        let Tree::Firsthit(scene) = &self.tree else { return None };
        if set.kind.any() {
            return None;
        }
        let add = |a: (u64, u64), b: (u64, u64)| (a.0 + b.0, a.1 + b.1);
        let counts = set.rays.par_iter().map(|ray| {
            let counts = scene.closest_hit_counted(ray).1;
            (u64::from(counts.boxes), u64::from(counts.primitives))
        });
        let (boxes, primitives) = counts.reduce(|| (0, 0), add);
        let each = |n: u64| n as f64 / set.rays.len() as f64;
        Some((each(boxes), each(primitives)))
    }

    /// The rays in the engine's own form, with room for answers.
    pub(super) fn asked<'a>(&'a self, set: &'a Set) -> Asked<'a> {
        let answers = match (&self.tree, set.kind.any()) {
            (Tree::Firsthit(_), true) => Answers::Any(vec![false; set.rays.len()]),
            (Tree::Firsthit(_), false) => Answers::Closest(vec![None; set.rays.len()]),
            _ => {
                let rays = set.rays.iter().map(|r| Ray32 {
                    origin: r.origin.as_vec3a(),
                    direction: r.direction.as_vec3a(),
                    t_min: r.t_min as f32,
                    t_max: r.t_max as f32,
                });
                Answers::Flat { rays: rays.collect(), t: vec![f32::INFINITY; set.rays.len()] }
            }
        };
        Asked { engine: self, set, answers }
    }
}

fn reordered(triangles: &[Triangle], order: &[u32]) -> Vec<RtTriangle> {
    order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect()
}

/// A ray in single precision.
struct Ray32 {
    origin: Vec3A,
    direction: Vec3A,
    t_min: f32,
    t_max: f32,
}

/// Rays put to an engine.
pub(super) struct Asked<'a> {
    engine: &'a Engine,
    set: &'a Set,
    answers: Answers,
}

enum Answers {
    Closest(Vec<Option<Hit>>),
    Any(Vec<bool>),
    /// Where the hit is, or infinity; of any hit: 0.
    Flat {
        rays: Vec<Ray32>,
        t: Vec<f32>,
    },
}

impl Asked<'_> {
    /// Asks them all.
    pub(super) fn ask(&mut self, parallel: bool) {
        let rays: &[Ray<f64>] = black_box(&self.set.rays);
        match (&self.engine.tree, &mut self.answers) {
            (Tree::Firsthit(scene), Answers::Closest(hits)) => match parallel {
                true => scene.par_closest_hits(rays, hits),
                false => scene.closest_hits(rays, hits),
            },
            (Tree::Firsthit(scene), Answers::Any(hits)) => match parallel {
                true => scene.par_any_hits(rays, hits),
                false => scene.any_hits(rays, hits),
            },
            (Tree::ObvhsBvh2(flat), Answers::Flat { rays, t }) => flat.ask(rays, t, self.set.kind, parallel),
            (Tree::ObvhsCwbvh(flat), Answers::Flat { rays, t }) => flat.ask(rays, t, self.set.kind, parallel),
            // `asked` pairs trees with their answers.
            _ => {}
        }
    }

    /// Rays that hit something.
    pub(super) fn hits(&self) -> u64 {
        let hits = match &self.answers {
            Answers::Closest(hits) => hits.iter().flatten().count(),
            Answers::Any(hits) => hits.iter().filter(|h| **h).count(),
            Answers::Flat { t, .. } => t.iter().filter(|t| t.is_finite()).count(),
        };
        hits as u64
    }
}

/// The two queries of a tree of obvhs: its own traversal and its own triangles.
trait Traverse: Sync {
    /// Infinity where there is no hit.
    fn closest(&self, ray: &Ray32) -> f32;
    fn any(&self, ray: &Ray32) -> bool;

    fn ask(&self, rays: &[Ray32], t: &mut [f32], kind: BenchRays, parallel: bool) {
        let some = |(rays, t): (&[Ray32], &mut [f32])| {
            for (ray, t) in rays.iter().zip(t) {
                *t = match kind.any() {
                    true if self.any(ray) => 0.0,
                    true => f32::INFINITY,
                    false => self.closest(ray),
                };
            }
        };
        match parallel {
            true => rays.par_chunks(CHUNK).zip(t.par_chunks_mut(CHUNK)).for_each(some),
            false => some((rays, t)),
        }
    }
}

macro_rules! traverse {
    ($tree:ty) => {
        impl Traverse for Flat<$tree> {
            #[inline(always)]
            fn closest(&self, r: &Ray32) -> f32 {
                let ray = obvhs::ray::Ray::new(r.origin, r.direction, r.t_min, r.t_max);
                let mut hit = RayHit::none();
                self.tree.ray_traverse(ray, &mut hit, |ray, at| self.triangles[at].intersect(ray));
                if hit.primitive_id == u32::MAX { f32::INFINITY } else { hit.t }
            }

            #[inline(always)]
            fn any(&self, r: &Ray32) -> bool {
                let ray = obvhs::ray::Ray::new(r.origin, r.direction, r.t_min, r.t_max);
                !self.tree.ray_traverse_miss(ray, |ray, at| self.triangles[at].intersect(ray))
            }
        }
    };
}

traverse!(Bvh2);
traverse!(CwBvh);
