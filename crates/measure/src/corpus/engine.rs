//! Engines: what answers a case.

use std::fmt;

use firsthit_accel::{BuildOptions, Geometry, Layout, Level, Scene, SceneBuilder};
use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Sphere};
use firsthit_geometry::{
    Aabb, Precision, Primitive as _, Ray, Real, Shape, ShapeError, Vector3, slab as slab_test, triangle,
};
use glam::{DAffine3, DVec3};

use super::{Case, Clip, Point, Primitive, vector};

/// What answers a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Each primitive by its own test, meshes by brute force.
    Primitives,
    /// The slab tests of the trees; they only have boxes.
    Slabs,
    /// A scene of one instance: tree, transform and primitive test together.
    Scene(Layout, Level, Form),
}

/// How a scene is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One ray.
    One,
    /// A slice of rays.
    Slice,
    /// A slice of rays on several threads.
    Parallel,
}

impl Form {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::One, Self::Slice, Self::Parallel];
}

impl Engine {
    /// All engines: scenes of each layout, by each SIMD level that this processor has, asked in each form.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut engines = vec![Self::Primitives, Self::Slabs];
        for layout in Layout::ALL {
            for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
                engines.extend(Form::ALL.map(|form| Self::Scene(layout, level, form)));
            }
        }
        engines
    }

    /// Answers a case at a tier.
    #[must_use]
    pub fn answer(self, case: &Case, precision: Precision) -> Answer {
        match self {
            Self::Primitives => match precision {
                Precision::Fast | Precision::Robust => primitive::<f32>(case, precision, &case.ray),
                Precision::Double | Precision::Exact => primitive::<f64>(case, precision, &case.ray.to_f64()),
            },
            Self::Slabs => slab(case, precision),
            Self::Scene(layout, level, form) => scene(case, precision, layout, level, form),
        }
    }

    /// The tier whose promises its answers are held to: the boxes of trees are conservative at every tier, so no box
    /// test promises more than `Double`.
    #[must_use]
    pub fn promises(self, precision: Precision) -> Precision {
        match (self, precision) {
            (Self::Slabs, Precision::Fast | Precision::Robust) => precision,
            (Self::Slabs, Precision::Double | Precision::Exact) => Precision::Double,
            _ => precision,
        }
    }
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primitives => f.write_str("primitive tests"),
            Self::Slabs => f.write_str("slab tests"),
            Self::Scene(layout, level, form) => {
                let form = match form {
                    Form::One => "one ray",
                    Form::Slice => "slice",
                    Form::Parallel => "parallel",
                };
                write!(f, "scene {layout:?}, {level}, {form}")
            }
        }
    }
}

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
    /// The engine contradicts itself.
    Inconsistent(String),
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

fn primitive<R: Real>(case: &Case, precision: Precision, ray: &Ray<R>) -> Answer {
    match &case.prim {
        Primitive::Triangle { v } => triangles::<R>(precision, &[*v], ray),
        Primitive::Mesh { verts, tris } => {
            let corners = |t: &[usize; 3]| Some([*verts.get(t[0])?, *verts.get(t[1])?, *verts.get(t[2])?]);
            match tris.iter().map(corners).collect::<Option<Vec<_>>>() {
                Some(all) => triangles(precision, &all, ray),
                None => Answer::Refused("a triangle names a vertex that is not there".into()),
            }
        }
        Primitive::Aabb { min, max } => match Cuboid::<R>::new(cast::<R>(*min), cast::<R>(*max)) {
            Ok(cuboid) => solid_box(&cuboid, precision, ray),
            Err(e) => Answer::Refused(e.to_string()),
        },
        other => match shape::<R>(other) {
            Ok(Some(shape)) => {
                let hit = match precision {
                    Precision::Fast => shape.closest_hit_fast(ray),
                    Precision::Robust | Precision::Double => shape.closest_hit(ray),
                    Precision::Exact => shape.closest_hit_exact(ray),
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
fn solid_box<R: Real>(cuboid: &Cuboid<R>, precision: Precision, ray: &Ray<R>) -> Answer {
    let (stay, surface) = match precision {
        Precision::Exact => (cuboid.overlap_exact(ray), cuboid.closest_hit_exact(ray)),
        _ => (cuboid.overlap(ray), cuboid.closest_hit(ray)),
    };
    let Some(stay) = stay else { return Answer::Miss };
    Answer::Hit(Found {
        t: surface.map(|hit| hit.t.to_f64()),
        stay: Some(stay.map(Real::to_f64)),
        normal: surface.and_then(|hit| hit.normal).map(Vector3::to_f64),
        ..Found::default()
    })
}

fn slab(case: &Case, precision: Precision) -> Answer {
    fn test<R: Real>(min: Point, max: Point, ray: &Ray<R>, padded: bool) -> Answer {
        let bounds = Aabb::<R>::new(cast::<R>(min), cast::<R>(max));
        let hit = if padded { slab_test::padded(&bounds, ray) } else { slab_test::plain(&bounds, ray) };
        hit.map_or(Answer::Miss, |_| Answer::Hit(Found::default()))
    }
    let Primitive::Aabb { min, max } = &case.prim else { return Answer::Skipped("not a box") };
    match precision {
        Precision::Fast => test::<f32>(*min, *max, &case.ray, false),
        Precision::Robust => test::<f32>(*min, *max, &case.ray, true),
        Precision::Double | Precision::Exact => test::<f64>(*min, *max, &case.ray.to_f64(), true),
    }
}

fn scene(case: &Case, precision: Precision, layout: Layout, level: Level, form: Form) -> Answer {
    let options = BuildOptions { precision, layout, simd: level, ..BuildOptions::default() };
    let scene = match build(&case.prim, options) {
        Ok(Some(scene)) => scene,
        Ok(None) => return Answer::Skipped("no such primitive"),
        Err(e) => return Answer::Refused(e),
    };
    let ray = case.ray.to_f64();
    let (hit, any) = match form {
        Form::One => (scene.closest_hit(&ray), scene.any_hit(&ray)),
        Form::Slice | Form::Parallel => {
            // Between rays of which one is not valid: neighbours must not matter.
            let rays = [Ray::new(DVec3::ZERO, DVec3::ZERO), ray, ray];
            let (mut hits, mut any) = ([None; 3], [false; 3]);
            if form == Form::Slice {
                scene.closest_hits(&rays, &mut hits);
                scene.any_hits(&rays, &mut any);
            } else {
                scene.par_closest_hits(&rays, &mut hits);
                scene.par_any_hits(&rays, &mut any);
            }
            if hits[0].is_some() || any[0] || hits[1] != hits[2] || any[1] != any[2] {
                return Answer::Inconsistent(format!("{hits:?} and {any:?} in a batch"));
            }
            (hits[1], any[1])
        }
    };
    if hit.is_some() != any {
        return Answer::Inconsistent(format!("closest hit {hit:?}, any hit {any}"));
    }
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

fn build(prim: &Primitive, options: BuildOptions) -> Result<Option<Scene>, String> {
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
    let mut builder = SceneBuilder::new(options);
    let mesh = builder.add_mesh(vec![geometry]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    builder.build().map(Some).map_err(|e| e.to_string())
}

/// The analytic shape of a case, if it is one.
///
/// # Errors
/// When no such shape can be made.
pub fn shape<R: Real>(prim: &Primitive) -> Result<Option<Shape<R>>, ShapeError> {
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
