//! Rays, boxes, triangles and analytic shapes, with the error of every computed quantity stated.
//!
//! No file, no tree, no thread: this crate answers "where does this ray meet this primitive?" and the questions
//! around it (bounds, clipping, closest point, leaving a surface). Everything is generic over [`Real`] (`f32` and
//! `f64`) where that serves, and speaks glam's vector types.
//!
//! # Conventions
//! * A ray is `origin + t * direction`. The direction need not be unit; `t` counts lengths of the direction.
//! * Parameter intervals and primitives are closed: `t_min <= t <= t_max`; edges, vertices, rims and tangent points
//!   belong to the primitive. A ray that lies in the plane of a flat primitive misses it.
//! * The reported hit is the smallest root *inside the interval*.
//! * Invalid input (NaN or infinite origin or direction, zero direction, an empty or NaN interval) never hits.
//! * Normals are geometric, unit, and never flipped to face the ray.
#![forbid(unsafe_code)]

mod aabb;
pub mod clip;
pub mod distance;
pub mod error;
pub mod exact;
pub mod frustum;
pub mod mesh;
pub mod offset;
pub mod overlap;
mod precision;
pub mod quadratic;
mod ray;
mod real;
pub mod shapes;
pub mod slab;
pub mod sweep;
pub mod transform;
pub mod triangle;
pub mod triangle_pair;

pub use aabb::Aabb;
pub use precision::Precision;
pub use ray::Ray;
pub use real::{Real, Vector3};
pub use shapes::{ExactSurfaceHit, Primitive, Shape, ShapeError, SurfaceHit};
