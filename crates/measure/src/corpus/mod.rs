//! The hard cases: exact expected answers for intersection routines, and what each tier must make of them.
//!
//! This module reads any folder of the JSON Lines format that `tests/corpus/README.md` describes; it knows the format,
//! not the list of files or categories.

mod engine;
mod judge;
mod read;
mod run;

use firsthit_geometry::Ray;
use glam::Vec3;
use serde::{Deserialize, Deserializer, de};

pub use engine::{Answer, Engine, Form, Found, shape};
pub use judge::{Verdict, judge, required};
pub use read::{CorpusError, read};
pub use run::{Complaint, Report, Row, run};

/// One case.
#[derive(Clone, Debug, Deserialize)]
pub struct Case {
    /// Unique name.
    pub id: String,
    /// What it is about, e.g. `sphere`.
    pub group: String,
    /// What makes it hard, e.g. `near-tangent`.
    pub category: String,
    /// The primitive.
    pub prim: Primitive,
    /// The ray.
    #[serde(deserialize_with = "ray")]
    pub ray: Ray<f32>,
    /// The right answer.
    pub expect: Expect,
}

/// A primitive as the cases write it.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Primitive {
    /// One triangle.
    Triangle {
        /// Vertices.
        v: [Point; 3],
    },
    /// An indexed mesh.
    Mesh {
        /// Vertices.
        verts: Vec<Point>,
        /// Vertex indices.
        tris: Vec<[usize; 3]>,
    },
    /// A sphere.
    Sphere {
        /// Centre.
        c: Point,
        /// Radius.
        r: Bits,
    },
    /// A plane.
    Plane {
        /// A point of it.
        p: Point,
        /// Normal, any length.
        n: Point,
    },
    /// A disk or annulus.
    Disk {
        /// Centre.
        c: Point,
        /// Normal, any length.
        n: Point,
        /// Outer radius.
        r: Bits,
        /// Inner radius.
        inner: Bits,
    },
    /// A box, maybe infinite or inverted.
    Aabb {
        /// Lower corner.
        min: Point,
        /// Upper corner.
        max: Point,
    },
    /// A quadric.
    Quadric {
        /// Coefficients `A..J`.
        q: [Bits; 10],
        /// Closed bounds along one axis.
        clip: Option<Clip>,
    },
    /// A polygon, even-odd over all loops.
    Polygon {
        /// Vertex loops.
        loops: Vec<Vec<Point>>,
    },
}

/// Clip bounds of a quadric.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Clip {
    /// 0, 1 or 2 for x, y, z.
    #[serde(deserialize_with = "axis")]
    pub axis: usize,
    /// Lower bound, included.
    pub min: Bits,
    /// Upper bound, included.
    pub max: Bits,
}

/// The right answer.
#[derive(Clone, Debug, Deserialize)]
pub struct Expect {
    /// Hit, miss, or what else.
    pub result: Outcome,
    /// The nearest hit.
    #[serde(default, deserialize_with = "decimal")]
    pub t: Option<f64>,
    /// The same, rounded to the nearest `f32`.
    #[serde(default)]
    pub t_f32: Option<Bits>,
    /// Where the ray is first in a box.
    #[serde(default, deserialize_with = "decimal")]
    pub t_enter: Option<f64>,
    /// Where the ray is last in a box.
    #[serde(default, deserialize_with = "decimal")]
    pub t_exit: Option<f64>,
    /// The faces of a box that may be named, e.g. `-x`.
    #[serde(default)]
    pub faces: Vec<String>,
    /// The unit normal.
    #[serde(default)]
    pub n: Option<[String; 3]>,
    /// Condition of `t`; none where it is unbounded (and for boxes).
    #[serde(default)]
    pub kappa: Option<f64>,
    /// The lowest precision that must decide this case right.
    #[serde(default)]
    pub level: Option<Level>,
    /// Triangles that attain the smallest `t`.
    #[serde(default)]
    pub ids: Vec<usize>,
}

/// Kinds of right answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A hit.
    Hit,
    /// A miss.
    Miss,
    /// On a boundary: of a mesh, one of several triangles; of a polygon, hit or miss.
    Either,
    /// Invalid input: no hit, or an error.
    NoHitOrError,
}

/// The lowest precision whose rounding cannot change the answer, given a stable formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Single.
    F32,
    /// Double.
    F64,
    /// None: touching, tangent, on the bound.
    Exact,
}

/// An `f32` written as the 8 hexadecimal digits of its bits.
#[derive(Clone, Copy, Debug)]
pub struct Bits(pub f32);

/// Three of them.
pub type Point = [Bits; 3];

/// The vector of a point.
#[must_use]
pub fn vector(p: Point) -> Vec3 {
    Vec3::from_array(p.map(|b| b.0))
}

impl<'de> Deserialize<'de> for Bits {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let digits = String::deserialize(d)?;
        let wrong = || de::Error::custom(format!("'{digits}' is not the 8 hexadecimal digits of an f32"));
        if digits.len() != 8 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        u32::from_str_radix(&digits, 16).map(|b| Self(f32::from_bits(b))).map_err(|_| wrong())
    }
}

fn ray<'de, D: Deserializer<'de>>(d: D) -> Result<Ray<f32>, D::Error> {
    #[derive(Deserialize)]
    struct Written {
        o: Point,
        d: Point,
        tmin: Bits,
        tmax: Bits,
    }
    let w = Written::deserialize(d)?;
    Ok(Ray::new(vector(w.o), vector(w.d)).with_interval(w.tmin.0, w.tmax.0))
}

fn decimal<'de, D: Deserializer<'de>>(d: D) -> Result<Option<f64>, D::Error> {
    let text = Option::<String>::deserialize(d)?;
    text.map(|t| t.parse().map_err(|_| de::Error::custom(format!("'{t}' is not a decimal number")))).transpose()
}

/// An axis by number or letter.
fn axis<'de, D: Deserializer<'de>>(d: D) -> Result<usize, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Axis {
        Number(usize),
        Letter(char),
    }
    match Axis::deserialize(d)? {
        Axis::Number(n @ 0..=2) => Ok(n),
        Axis::Letter(c @ 'x'..='z') => Ok(c as usize - 'x' as usize),
        _ => Err(de::Error::custom("axis must be 0, 1, 2 or x, y, z")),
    }
}
