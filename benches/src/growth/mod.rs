//! How the time of a ray grows with the mesh: one mesh of ever more triangles, not copies of one.
//!
//! Up to the size of the cache the time should grow with the depth of the tree, the logarithm of the number of triangles:
//! a line is fitted to that part, and what lies beyond is compared with it.

mod chart;

use std::fmt::Write;
use std::fs;
use std::hint::black_box;
use std::time::Duration;

use firsthit_accel::{BuildError, BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::{Mesh, torus};
use firsthit_measure::timing::{Paired, quantile};
use glam::{DAffine3, Vec3};
use serde::Serialize;

use crate::generated::terrain;
use crate::model::Model;
use crate::random::Pcg;
use crate::rays;
use crate::reference::double;

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A closed ring with bumps, seen from outside.
    Ring,
    /// Hilly land.
    Terrain,
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 2] = [Self::Ring, Self::Terrain];

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ring => "ring",
            Self::Terrain => "terrain",
        }
    }

    /// The mesh of about so many triangles, with its name: bumps and hills stay, their surface becomes finer.
    #[must_use]
    pub fn model(self, triangles: usize) -> Model {
        let mesh = match self {
            Self::Ring => {
                let around = ((triangles as f32 / 4.0).sqrt() as u32).max(3);
                bumpy(torus(2 * around, around, 0.4))
            }
            Self::Terrain => terrain(((triangles as f32 / 2.0).sqrt() as u32).max(1)),
        };
        Model { name: self.name().into(), mesh }
    }
}

/// Moves vertices by up to 4 % of the ring's size, smoothly.
fn bumpy(mesh: Mesh) -> Mesh {
    mesh.map(|p| {
        let wave = (p * 9.0 + Vec3::new(0.3, 1.1, 2.0)).to_array().map(f32::sin);
        p * (1.0 + 0.04 * (wave[0] + wave[1] * wave[2]))
    })
}

/// What is measured.
#[derive(Clone, Debug)]
pub struct Course {
    /// Numbers of triangles, about.
    pub sizes: Vec<usize>,
    /// Tiers.
    pub precisions: Vec<Precision>,
    /// Rays of each kind.
    pub rays: usize,
    /// Times that they are asked.
    pub repetitions: usize,
    /// Trees of so many bytes fit into the cache.
    pub cache: u64,
}

/// One mesh, tier and kind of rays.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The mesh.
    pub mesh: &'static str,
    /// The tier.
    pub precision: String,
    /// `primary` or `diffuse`, of which the closest hit is asked.
    pub rays: &'static str,
    /// Triangles.
    pub triangles: usize,
    /// Bytes of the tree with its triangles.
    pub bytes: u64,
    /// Seconds to build it.
    pub build_s: f64,
    /// Time of a ray in the best repetition.
    pub ns_per_ray: f64,
    /// Nodes visited by a ray, on average.
    pub nodes_per_ray: f64,
    /// Leaves.
    pub leaves_per_ray: f64,
}

/// The line `ns = at_1 + per_doubling * log2(triangles)` through what fits into the cache, and how far above it the
/// largest mesh is.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    /// As in [`Row`].
    pub mesh: &'static str,
    /// As in [`Row`].
    pub precision: String,
    /// As in [`Row`].
    pub rays: &'static str,
    /// Meshes that the line goes through.
    pub points: usize,
    /// ns a ray of a mesh of one triangle, by the line.
    pub at_1: f64,
    /// ns a ray more for each doubling.
    pub per_doubling: f64,
    /// Largest difference of one of these meshes from the line, relative.
    pub worst: f64,
    /// Time of the largest mesh over that of the line.
    pub beyond: f64,
}

/// Everything.
#[derive(Clone, Debug, Serialize)]
pub struct Growth {
    /// Trees of so many bytes fit into the cache.
    pub cache: u64,
    /// Rays of each kind.
    pub rays: usize,
    /// All rows.
    pub rows: Vec<Row>,
    /// A line for each mesh, tier and kind of rays.
    pub fits: Vec<Fit>,
}

/// Bytes of the processor's largest cache, where the system tells.
#[must_use]
pub fn cache_size() -> Option<u64> {
    let sizes =
        (0..8).filter_map(|k| fs::read_to_string(format!("/sys/devices/system/cpu/cpu0/cache/index{k}/size")).ok());
    sizes.filter_map(|s| Some(s.trim().strip_suffix('K')?.parse::<u64>().ok()? * 1024)).max()
}

/// Measures it. `say` is told what is going on.
///
/// # Errors
/// When a mesh cannot be built, which does not happen.
pub fn run(course: &Course, say: &dyn Fn(String)) -> Result<Growth, BuildError> {
    let mut rows = Vec::new();
    for shape in Shape::ALL {
        for &size in &course.sizes {
            let model = shape.model(size);
            for &precision in &course.precisions {
                say(format!("{}, {} triangles, {precision}", model.name, model.mesh.triangles.len()));
                rows.extend(one(shape, &model, precision, course)?);
            }
        }
    }
    let fits = fits(&rows, course.cache);
    Ok(Growth { cache: course.cache, rays: course.rays, rows, fits })
}

fn one(shape: Shape, model: &Model, precision: Precision, course: &Course) -> Result<[Row; 2], BuildError> {
    let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
    let Mesh { positions, triangles } = model.mesh.clone();
    let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles }]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    let start = std::time::Instant::now();
    let scene = builder.build()?;
    let build_s = start.elapsed().as_secs_f64();

    let [primary, diffuse] = rays_of(model, &scene, course.rays);
    let kinds = [("primary", primary), ("diffuse", diffuse)];
    // One by one: a batch of camera rays would go in packets.
    let ask = |way: usize| {
        let hits = kinds[way].1.iter().filter(|ray| scene.closest_hit(ray).is_some());
        black_box(hits.count());
    };
    let times = (course.repetitions, course.repetitions);
    let paired = Paired::run(2, times, Duration::MAX, ask, || false);
    Ok([0, 1].map(|k| {
        let (rays, of) = (kinds[k].0, &kinds[k].1);
        let mut seconds = paired.seconds[k].clone();
        seconds.sort_by(f64::total_cmp);
        let (mut nodes, mut leaves) = (0u64, 0u64);
        for ray in of {
            let counts = scene.closest_hit_counted(ray).1;
            nodes += u64::from(counts.boxes) / 8;
            leaves += u64::from(counts.leaves);
        }
        let per_ray = |n: f64| n / of.len().max(1) as f64;
        Row {
            mesh: shape.name(),
            precision: precision.to_string(),
            rays,
            triangles: model.mesh.triangles.len(),
            bytes: scene.stats().bytes,
            build_s,
            ns_per_ray: per_ray(quantile(&seconds, 0.0) * 1e9),
            nodes_per_ray: per_ray(nodes as f64),
            leaves_per_ray: per_ray(leaves as f64),
        }
    }))
}

/// A camera's rays, and rays from what it sees over the hemisphere.
fn rays_of(model: &Model, scene: &Scene, count: usize) -> [Vec<Ray<f64>>; 2] {
    let mut random = Pcg::new(1);
    let primary: Vec<Ray<f64>> = rays::primary(model, count, &mut random).iter().map(double).collect();
    let off = f64::from(model.diagonal()) * 1e-4;
    let seen: Vec<_> = primary
        .iter()
        .filter_map(|ray| {
            let hit = scene.closest_hit(ray)?;
            let normal = hit.normal_against(ray.direction);
            Some((ray.at(hit.t) + normal * off, normal))
        })
        .collect();
    let around = seen.iter().cycle().take(if seen.is_empty() { 0 } else { count });
    let diffuse = around.map(|(p, n)| Ray::new(*p, rays::scatter(n.as_vec3(), &mut random).as_dvec3())).collect();
    [primary, diffuse]
}

fn fits(rows: &[Row], cache: u64) -> Vec<Fit> {
    let mut fits: Vec<Fit> = Vec::new();
    for first in rows {
        let same = |r: &&Row| (r.mesh, &r.precision, r.rays) == (first.mesh, &first.precision, first.rays);
        if fits.iter().any(|f| (f.mesh, &f.precision, f.rays) == (first.mesh, &first.precision, first.rays)) {
            continue;
        }
        let point = |r: &Row| ((r.triangles as f64).log2(), r.ns_per_ray);
        let within: Vec<(f64, f64)> = rows.iter().filter(same).filter(|r| r.bytes <= cache).map(point).collect();
        let Some(last) = rows.iter().filter(same).map(point).next_back() else { continue };
        let Some((at_1, per_doubling)) = line(&within) else { continue };
        let at = |x: f64| at_1 + per_doubling * x;
        fits.push(Fit {
            mesh: first.mesh,
            precision: first.precision.clone(),
            rays: first.rays,
            points: within.len(),
            at_1,
            per_doubling,
            worst: within.iter().map(|&(x, y)| (y / at(x) - 1.0).abs()).fold(0.0, f64::max),
            beyond: last.1 / at(last.0),
        });
    }
    fits
}

/// Constant and slope of the line of least squares; none for fewer than two different places.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let (sx, sy) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0, y + p.1));
    let (mx, my) = (sx / n, sy / n);
    let (xx, xy) = points.iter().fold((0.0, 0.0), |(xx, xy), p| {
        let x = p.0 - mx;
        (xx + x * x, xy + x * (p.1 - my))
    });
    let slope = xy / xx;
    slope.is_finite().then_some((my - slope * mx, slope))
}

impl Growth {
    /// Tables in Markdown: what was measured, and the lines.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut out = String::from(
            "| mesh | triangles | tier | rays | ns a ray | nodes | leaves | bytes a triangle | tree, MB |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for r in &self.rows {
            let each = r.bytes as f64 / r.triangles as f64;
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {:.0} | {:.2} | {:.2} | {each:.1} | {:.2} |",
                r.mesh,
                r.triangles,
                r.precision,
                r.rays,
                r.ns_per_ray,
                r.nodes_per_ray,
                r.leaves_per_ray,
                r.bytes as f64 * 1e-6
            );
        }
        let _ = write!(
            out,
            "\nns a ray = a + b log2(triangles), through the meshes whose trees fit into the cache of {} MiB:\n\n\
             | mesh | tier | rays | a | b | meshes | farthest from the line | largest mesh / line |\n\
             |---|---|---|---|---|---|---|---|\n",
            self.cache >> 20
        );
        for f in &self.fits {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {:.1} | {:.2} | {} | {:.0} % | {:.2} |",
                f.mesh,
                f.precision,
                f.rays,
                f.at_1,
                f.per_doubling,
                f.points,
                f.worst * 100.0,
                f.beyond
            );
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_run_is_whole() {
        let course = Course {
            sizes: vec![100, 400, 1600],
            precisions: vec![Precision::Robust, Precision::Fast],
            rays: 1024,
            repetitions: 1,
            cache: 1 << 30,
        };
        let growth = run(&course, &|_| {}).unwrap();
        assert_eq!((growth.rows.len(), growth.fits.len()), (2 * 3 * 2 * 2, 2 * 2 * 2));
        for r in &growth.rows {
            assert!(r.ns_per_ray > 0.0 && r.nodes_per_ray >= 0.3 && r.leaves_per_ray > 0.0, "{r:?}");
        }
        for shape in Shape::ALL {
            let grown = shape.model(1000).mesh.triangles.len();
            assert!((850..=1000).contains(&grown), "{grown}");
        }
        assert!(growth.fits.iter().all(|f| f.points == 3 && f.beyond > 0.0));
        assert_eq!(growth.markdown().lines().count(), 2 + 24 + 5 + 8);
        let svg = growth.svg();
        assert!(svg.matches("<polyline").count() == 8 && svg.matches("<circle").count() == 24 && !svg.contains("NaN"));
    }

    #[test]
    fn a_line_is_found() {
        let (a, b) = line(&[(1.0, 5.0), (2.0, 7.0), (4.0, 11.0)]).unwrap();
        assert!((a - 3.0).abs() < 1e-12 && (b - 2.0).abs() < 1e-12);
        assert!(line(&[(1.0, 2.0)]).is_none() && line(&[]).is_none());
    }
}
