//! Engines: what answers a case.

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Sphere};
use firsthit_geometry::{
    Aabb, Precision, Primitive as _, Ray, Real, Shape, ShapeError, Vector3, slab as slab_test, triangle,
};
use glam::{DAffine3, DVec3};

use super::{Case, Clip, Point, Primitive, vector};

/// Answers a case at a tier.
pub type Engine = fn(&Case, Precision) -> Answer;

/// What an engine makes of a case.
#[derive(Clone, Debug)]
pub enum Answer {
    /// The nearest hit.
    Hit(Found),
    /// No hit.
    Miss,
    /// The input was refused, with this message.
    Refused(String),
    /// The engine has no such question, for this reason.
    Skipped(&'static str),
}

/// A hit. What the engine does not tell is not checked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// Ray parameter of the nearest surface point.
    pub t: Option<f64>,
    /// The interval in a solid box.
    pub stay: Option<[f64; 2]>,
    /// Which triangle of a mesh.
    pub id: Option<usize>,
    /// Unit normal.
    pub normal: Option<DVec3>,
}

/// Each primitive by its own test, meshes by brute force.
#[must_use]
pub fn primitives(case: &Case, precision: Precision) -> Answer {
    match precision {
        Precision::Double => primitive::<f64>(case, precision, &case.ray.to_f64()),
        _ => primitive::<f32>(case, precision, &case.ray),
    }
}

fn primitive<R: Real>(case: &Case, precision: Precision, ray: &Ray<R>) -> Answer {
    match &case.prim {
        Primitive::Triangle { v } => triangles::<R>(precision, &[*v], ray),
        Primitive::Mesh { verts, tris } => {
            triangles(precision, &tris.iter().map(|t| t.map(|i| verts[i])).collect::<Vec<_>>(), ray)
        }
        Primitive::Aabb { min, max } => match Cuboid::<R>::new(cast::<R>(*min), cast::<R>(*max)) {
            Ok(cuboid) => solid_box(&cuboid, ray),
            Err(e) => Answer::Refused(e.to_string()),
        },
        other => match shape::<R>(other) {
            Ok(Some(shape)) => {
                let hit = match precision {
                    Precision::Fast => shape.closest_hit_fast(ray),
                    _ => shape.closest_hit(ray),
                };
                hit.map_or(Answer::Miss, |hit| {
                    let normal = hit.normal.map(Vector3::to_f64);
                    Answer::Hit(Found { t: Some(hit.t.to_f64()), normal, ..Found::default() })
                })
            }
            Ok(None) => Answer::Skipped("no such primitive"),
            Err(e) => Answer::Refused(e.to_string()),
        },
    }
}

fn triangles<R: Real>(precision: Precision, triangles: &[[Point; 3]], ray: &Ray<R>) -> Answer {
    let vertices = |t: &[Point; 3]| t.map(cast::<R>);
    let hits = triangles.iter().enumerate().filter_map(|(id, t)| {
        let hit = triangle::intersect::<R>(precision, vertices(t), ray)?;
        Some((id, hit.t.to_f64()))
    });
    let nearest = hits.min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map_or(Answer::Miss, |(id, t)| {
        let normal = triangle::normal(triangles[id].map(|p| vector(p).as_dvec3()));
        Answer::Hit(Found { t: Some(t), id: Some(id), normal, ..Found::default() })
    })
}

/// A box is hit when the ray is in it anywhere; its surface only when the ray also enters or leaves.
fn solid_box<R: Real>(cuboid: &Cuboid<R>, ray: &Ray<R>) -> Answer {
    let Some(stay) = cuboid.overlap(ray) else { return Answer::Miss };
    let surface = cuboid.closest_hit(ray);
    Answer::Hit(Found {
        t: surface.map(|hit| hit.t.to_f64()),
        stay: Some(stay.map(Real::to_f64)),
        normal: surface.and_then(|hit| hit.normal).map(Vector3::to_f64),
        ..Found::default()
    })
}

/// The slab tests of the trees; they only have boxes.
#[must_use]
pub fn slab(case: &Case, precision: Precision) -> Answer {
    fn test<R: Real>(min: Point, max: Point, ray: &Ray<R>, padded: bool) -> Answer {
        let bounds = Aabb::<R>::new(cast::<R>(min), cast::<R>(max));
        let hit = if padded { slab_test::padded(&bounds, ray) } else { slab_test::plain(&bounds, ray) };
        hit.map_or(Answer::Miss, |_| Answer::Hit(Found::default()))
    }
    let Primitive::Aabb { min, max } = &case.prim else { return Answer::Skipped("not a box") };
    match precision {
        Precision::Fast => test::<f32>(*min, *max, &case.ray, false),
        Precision::Robust => test::<f32>(*min, *max, &case.ray, true),
        Precision::Double => test::<f64>(*min, *max, &case.ray.to_f64(), true),
    }
}

/// Through a scene of one instance: tree, transform and primitive test together.
#[must_use]
pub fn scene(case: &Case, precision: Precision) -> Answer {
    match build(&case.prim, precision) {
        Ok(Some(scene)) => {
            let ray = case.ray.to_f64();
            let hit = scene.closest_hit(&ray);
            assert_eq!(hit.is_some(), scene.any_hit(&ray), "{}: any hit and closest hit disagree", case.id);
            match hit {
                Some(hit) => {
                    let id = matches!(case.prim, Primitive::Mesh { .. }).then_some(hit.id.primitive as usize);
                    Answer::Hit(Found { t: Some(hit.t), id, ..Found::default() })
                }
                None if case.expect.t_enter.is_some() && case.expect.t.is_none() => {
                    Answer::Skipped("the ray stays inside the box: no surface is crossed")
                }
                None => Answer::Miss,
            }
        }
        Ok(None) => Answer::Skipped("no such primitive"),
        Err(e) => Answer::Refused(e),
    }
}

fn build(prim: &Primitive, precision: Precision) -> Result<Option<Scene>, String> {
    let geometry = match prim {
        Primitive::Triangle { v } => {
            Geometry::Triangles { positions: v.iter().map(|p| vector(*p)).collect(), triangles: vec![[0, 1, 2]] }
        }
        Primitive::Mesh { verts, tris } => {
            let index = |i: usize| u32::try_from(i).map_err(|e| e.to_string());
            let triangles = tris.iter().map(|t| Ok([index(t[0])?, index(t[1])?, index(t[2])?]));
            Geometry::Triangles {
                positions: verts.iter().map(|p| vector(*p)).collect(),
                triangles: triangles.collect::<Result<_, String>>()?,
            }
        }
        other => match shape::<f64>(other).map_err(|e| e.to_string())? {
            Some(shape) => Geometry::Shape(shape),
            None => return Ok(None),
        },
    };
    let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
    let mesh = builder.add_mesh(vec![geometry]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    builder.build().map(Some).map_err(|e| e.to_string())
}

/// The analytic shape of a case, if it is one.
fn shape<R: Real>(prim: &Primitive) -> Result<Option<Shape<R>>, ShapeError> {
    let number = |b: super::Bits| R::from_f32(b.0);
    Ok(Some(match prim {
        Primitive::Sphere { c, r } => Sphere::new(cast::<R>(*c), number(*r))?.into(),
        Primitive::Plane { p, n } => Plane::new(cast::<R>(*p), cast::<R>(*n))?.into(),
        Primitive::Disk { c, n, r, inner } => {
            Disk::new(cast::<R>(*c), cast::<R>(*n), number(*r), number(*inner))?.into()
        }
        Primitive::Aabb { min, max } => Cuboid::new(cast::<R>(*min), cast::<R>(*max))?.into(),
        Primitive::Quadric { q, clip } => {
            let quadric = Quadric::new(q.map(number))?;
            match *clip {
                Some(Clip { axis, min, max }) => {
                    let all = Aabb::<R>::infinite();
                    let (min, max) = (all.min.with_axis(axis, number(min)), all.max.with_axis(axis, number(max)));
                    quadric.with_clip(Aabb::new(min, max))?.into()
                }
                None => quadric.into(),
            }
        }
        Primitive::Polygon { loops } => {
            Polygon::new(loops.iter().map(|l| l.iter().map(|p| cast::<R>(*p)).collect()).collect())?.into()
        }
        Primitive::Triangle { .. } | Primitive::Mesh { .. } => return Ok(None),
    }))
}

fn cast<R: Real>(p: Point) -> R::Vec3 {
    R::Vec3::from_f64(vector(p).as_dvec3())
}
