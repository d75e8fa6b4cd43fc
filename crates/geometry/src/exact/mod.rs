//! Exact decisions: hit or miss, order along the ray, parity, correctly rounded parameter.
//!
//! A decision is first tried in `f64` with a proven bound on its error; only where that cannot tell, exact arithmetic
//! decides. Most rays never leave `f64`. Input is taken as what its floats are, `f32` or `f64`.

pub(crate) mod dyadic;
pub(crate) mod number;
mod orient;
pub(crate) mod quadratic;
mod root;
mod triangle;
mod twofold;

pub use orient::{orient2d, orient3d};
pub use root::Root;
pub use triangle::{ExactHit, ExactRay};
