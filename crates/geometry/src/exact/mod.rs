//! Exact decisions about `f32` input: hit or miss, order along the ray, correctly rounded parameter.
//!
//! A decision is first tried in `f64` with a proven bound on its error; only where that cannot tell, integers of fixed
//! size decide. Most rays never leave `f64`.

mod int;
mod triangle;

pub use triangle::{ExactHit, ExactRay};
