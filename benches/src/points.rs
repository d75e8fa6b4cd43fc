//! Queries about points, firsthit beside the crates that have them; and what one query a call costs.
//!
//! `bvh` has the nearest of shapes that know their distance (here by [`closest_on_triangle`] in `f32`), and nothing about
//! inside and outside; parry3d's side is that of the nearest feature's pseudonormal.

use std::hint::black_box;
use std::time::Duration;

use bvh::bvh::Bvh;
use bvh::point_query::PointDistance;
use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder, Solid};
use firsthit_geometry::Ray;
use firsthit_geometry::distance::closest_on_triangle;
use firsthit_measure::mesh::Mesh;
use firsthit_measure::random::Rng;
use firsthit_measure::timing::{Paired, quantile};
use glam::{DAffine3, DVec3, Vec3};
use nalgebra::Point3;
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::{TriMesh, TriMeshFlags};
use serde::Serialize;

use crate::model::Model;
use crate::peer::flat_bvh::Triangle;

/// One engine at one kind of queries.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The model's name.
    pub scene: String,
    /// Its triangles.
    pub triangles: usize,
    /// What is asked.
    pub query: &'static str,
    /// Where: in the volume of the box, near the surface, or rays.
    pub input: &'static str,
    /// The engine.
    pub engine: &'static str,
    /// Queries in one repetition.
    pub count: usize,
    /// Microseconds of one query: in the best repetition.
    pub microseconds_best: f64,
    /// In the median one.
    pub microseconds_median: f64,
    /// Wrong answers: distances off by more than 1e-5 of the model's diagonal, or the wrong side of a surface that is farther
    /// away than a millionth of it. `None` where it was not looked at.
    pub wrong: Option<usize>,
}

impl PointDistance<f32, 3> for Triangle {
    fn distance_squared(&self, p: Point3<f32>) -> f32 {
        let p = Vec3::new(p.x, p.y, p.z);
        (closest_on_triangle::<f32>(self.corners, p).point - p).length_squared()
    }
}

/// Where answers go, as numbers: distances, negative inside where a side was asked for.
type Work<'a> = Box<dyn FnMut(&mut Vec<f64>) + 'a>;

struct Way<'a> {
    query: &'static str,
    engine: &'static str,
    count: usize,
    work: Work<'a>,
    /// Whether answers are looked at.
    judged: bool,
}

/// The engines of one model.
struct Engines {
    scene: Scene,
    solid: Solid,
    parry: Option<TriMesh>,
    tree: Bvh<f32, 3>,
    triangles: Vec<Triangle>,
}

impl Engines {
    fn new(mesh: &Mesh) -> Result<Self, String> {
        let mut builder = SceneBuilder::new(BuildOptions::default());
        let geometry = Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
        let placed = builder.add_mesh(vec![geometry]);
        builder.add_instance(placed, DAffine3::IDENTITY);
        let scene = builder.build().map_err(|e| e.to_string())?;
        let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let parry = TriMesh::with_flags(vertices, mesh.triangles.clone(), TriMeshFlags::ORIENTED).ok();
        let corner = |i: u32| mesh.positions[i as usize];
        let mut triangles: Vec<Triangle> =
            mesh.triangles.iter().map(|t| Triangle { corners: t.map(corner), node: 0 }).collect();
        let tree = Bvh::build(&mut triangles);
        Ok(Self { solid: Solid::new(&scene), scene, parry, tree, triangles })
    }

    fn of_points<'a>(&'a self, points: &'a [DVec3]) -> Vec<Way<'a>> {
        let Self { scene, solid, .. } = self;
        let count = points.len();
        let way = |query, engine, work| Way { query, engine, count, work, judged: true };
        let one = move |out: &mut Vec<f64>| {
            out.extend(points.iter().map(|p| scene.closest_point(*p).map_or(f64::INFINITY, |c| c.distance)));
        };
        let mut found = vec![None; count];
        let batch = move |out: &mut Vec<f64>| {
            scene.closest_points(points, f64::INFINITY, &mut found);
            out.extend(found.iter().map(|c| c.map_or(f64::INFINITY, |c| c.distance)));
        };
        let signed = move |out: &mut Vec<f64>| {
            out.resize(count, 0.0);
            solid.signed_distances(points, out);
        };
        let inside = move |out: &mut Vec<f64>| {
            out.extend(points.iter().map(|p| if solid.contains(*p) { -1.0 } else { 1.0 }));
        };
        let mut ways = vec![
            way("closest point", "firsthit, one a call", Box::new(one) as Work<'a>),
            way("closest point", "firsthit, all in one call", Box::new(batch)),
            way("signed distance", "firsthit", Box::new(signed)),
            way("contains", "firsthit", Box::new(inside)),
        ];
        let single: Vec<Vec3> = points.iter().map(|p| p.as_vec3()).collect();
        // What is slower gets fewer.
        let few = count / 4;
        if let Some(parry) = &self.parry {
            let points: Vec<Vector> = single[..few].iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
            let side = |p: &Vector| {
                let at = parry.project_local_point(*p, false);
                let distance = f64::from((at.point - *p).length());
                if at.is_inside { -distance } else { distance }
            };
            let of = points.clone();
            let nearest = move |out: &mut Vec<f64>| out.extend(of.iter().map(|p| side(p).abs()));
            let of = points.clone();
            let signed = move |out: &mut Vec<f64>| out.extend(of.iter().map(side));
            let inside = move |out: &mut Vec<f64>| {
                out.extend(points.iter().map(|p| if parry.contains_local_point(*p) { -1.0 } else { 1.0 }));
            };
            let way = |query, work| Way { query, engine: "parry3d", count: few, work, judged: true };
            ways.push(way("closest point", Box::new(nearest) as Work<'a>));
            ways.push(way("signed distance", Box::new(signed)));
            ways.push(way("contains", Box::new(inside)));
        }
        let of: Vec<_> = single[..few].iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
        let nearest = move |out: &mut Vec<f64>| {
            let distance = |p: &Point3<f32>| self.tree.nearest_to(*p, &self.triangles).map_or(f32::INFINITY, |n| n.1);
            out.extend(of.iter().map(|p| f64::from(distance(p))));
        };
        ways.push(Way { query: "closest point", engine: "bvh", count: few, work: Box::new(nearest), judged: true });
        ways
    }

    /// Rays one a call.
    fn of_rays<'a>(&'a self, rays: &'a [Ray<f64>]) -> Vec<Way<'a>> {
        let scene = &self.scene;
        let closest = move |out: &mut Vec<f64>| {
            out.extend(rays.iter().map(|r| scene.closest_hit(r).map_or(f64::INFINITY, |hit| hit.t)));
        };
        let any = move |out: &mut Vec<f64>| out.extend(rays.iter().map(|r| f64::from(u8::from(scene.any_hit(r)))));
        let way = |query, work| Way { query, engine: "firsthit, one a call", count: rays.len(), work, judged: false };
        vec![way("closest hit", Box::new(closest) as Work<'a>), way("any hit", Box::new(any))]
    }
}

/// Times everything in turn.
///
/// # Errors
/// When the model cannot be built.
pub fn race(model: &Model, count: usize, repetitions: usize) -> Result<Vec<Row>, String> {
    let engines = Engines::new(&model.mesh)?;
    let mut rng = Rng(7);
    let (low, high) = model.bounds();
    let (middle, half) = ((low + high).as_dvec3() * 0.5, (high - low).as_dvec3() * 0.5);
    let size = 2.0 * half.length();
    // In single precision, for all.
    let single = |p: DVec3| p.as_vec3().as_dvec3();
    let volume: Vec<DVec3> = (0..count).map(|_| single(middle + rng.in_cube() * half * 1.2)).collect();
    let near: Vec<DVec3> = (0..count)
        .map(|_| {
            let triangle = model.mesh.corners(rng.below(model.mesh.triangles.len()));
            let on = firsthit_measure::random::Aim::Face.point(triangle, &mut rng);
            single(on + rng.in_cube() * 0.002 * size)
        })
        .collect();
    let rays: Vec<Ray<f64>> = (0..count)
        .map(|_| {
            let (origin, target) = (middle + rng.direction() * size, middle + rng.in_cube() * half);
            Ray::new(single(origin), single((target - origin).normalize()))
        })
        .collect();
    // The same ray over and over: what a call costs, and no memory.
    let hits = rays.iter().find(|r| engines.scene.any_hit(r)).or(rays.first());
    let same: Vec<Ray<f64>> = vec![*hits.ok_or("no rays")?; count];

    let mut rows = Vec::new();
    let mut add = |input, ways, truth: &[f64]| rows.extend(in_turn(model, input, ways, truth, repetitions));
    for (input, points) in [("volume", &volume), ("near the surface", &near)] {
        let mut truth = vec![0.0; count];
        engines.solid.signed_distances(points, &mut truth);
        add(input, engines.of_points(points), &truth);
    }
    add("incoherent", engines.of_rays(&rays), &[]);
    add("the same ray", engines.of_rays(&same), &[]);
    Ok(rows)
}

fn in_turn(model: &Model, input: &'static str, mut ways: Vec<Way<'_>>, truth: &[f64], repetitions: usize) -> Vec<Row> {
    let mut out: Vec<Vec<f64>> = ways.iter().map(|w| Vec::with_capacity(w.count)).collect();
    let (count, times) = (ways.len(), (repetitions, repetitions));
    let work = |k: usize| {
        out[k].clear();
        (ways[k].work)(black_box(&mut out[k]));
    };
    let paired = Paired::run(count, times, Duration::MAX, work, || false);
    let size = f64::from(model.diagonal());
    let each = ways.iter().zip(paired.seconds).zip(&out);
    each.map(|((way, mut seconds), answers)| {
        seconds.sort_by(f64::total_cmp);
        let microseconds = |q: f64| quantile(&seconds, q) / way.count as f64 * 1e6;
        let off = |(got, right): (&f64, &f64)| {
            let side = right.abs() > 1e-6 * size && (*got < 0.0) != (*right < 0.0);
            match way.query {
                "closest point" => !((got - right.abs()).abs() <= 1e-5 * size),
                "contains" => side,
                _ => side || !((got.abs() - right.abs()).abs() <= 1e-5 * size),
            }
        };
        Row {
            scene: model.name.clone(),
            triangles: model.mesh.triangles.len(),
            query: way.query,
            input,
            engine: way.engine,
            count: way.count,
            microseconds_best: microseconds(0.0),
            microseconds_median: microseconds(0.5),
            wrong: way.judged.then(|| answers.iter().zip(truth).filter(|pair| off(*pair)).count()),
        }
    })
    .collect()
}

/// The rows as a Markdown table.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut out = String::from(
        "| model | query | where | engine | microseconds each, best (median) | wrong |\n|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let wrong = r.wrong.map_or("-".into(), |w| format!("{w} of {}", r.count));
        let (best, median) = (r.microseconds_best, r.microseconds_median);
        out += &format!(
            "| {} | {} | {} | {} | {best:.3} ({median:.3}) | {wrong} |\n",
            r.scene, r.query, r.input, r.engine
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::icosphere;

    #[test]
    fn all_engines_agree_on_a_ball() {
        let model = Model { name: "ball".into(), mesh: icosphere(4) };
        let rows = race(&model, 400, 2).unwrap();
        assert_eq!(rows.len(), 2 * 8 + 4);
        for row in &rows {
            assert!(row.wrong.is_none_or(|w| w == 0) && row.microseconds_best > 0.0, "{row:?}");
        }
    }
}
