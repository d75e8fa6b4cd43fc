//! Integrators: from a camera ray to what it sees.
//!
//! | module | answers |
//! |---|---|
//! | [`path`] | all light: of lights, and by any number of surfaces |
//! | [`forward`] | the same light, from the lights to the camera |
//! | [`whitted`] | light of all lights, mirrored, refracted and let through; with nothing followed, direct light alone |
//! | [`direct`] | the light that reaches one point from all lights |
//! | [`ao`] | how much of the hemisphere over a point is free |
//! | [`aov`] | what is there: depth, normals, ids |
//! | [`clock`] | where the time goes, on pixels that are timed |
//!
//! All cast their rays through a [`Tracer`], which applies section planes, alpha and culling, and counts. It is
//! specialised by what the scene calls for; a sample is a pure function of (seed, pixel, sample number), and its
//! numbers are assigned by purpose, so that a specialised tracer gives the very bits of the full one.

pub(crate) mod ao;
pub(crate) mod aov;
pub(crate) mod clock;
mod direct;
pub(crate) mod forward;
pub(crate) mod path;
mod scatter;
mod tracer;
pub(crate) mod whitted;

pub(crate) use tracer::{Timing, Tracer};

/// Glossy lobes rougher than this GGX alpha are lit by lights and surroundings, but no rays follow them, unless they
/// are metals: what they would see of other surfaces is about as even as diffuse light, which is not followed either.
pub(crate) const ROUGHEST_FOLLOWED: f32 = 0.25;
