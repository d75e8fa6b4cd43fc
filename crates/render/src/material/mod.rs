//! Materials: compiled from the scene's descriptions, evaluated at a hit into the lobes that scatter there.

mod fresnel;
#[allow(dead_code, reason = "the integrators that call it follow")]
mod lobes;
#[allow(dead_code, reason = "the integrators that call it follow")]
mod microfacet;
