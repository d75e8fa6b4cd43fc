//! Where light comes from.

pub(crate) mod area;
pub(crate) mod choice;
pub(crate) mod emitters;
pub mod environment;
pub(crate) mod punctual;
pub mod studio;
pub(crate) mod tree;

use firsthit_accel::HitId;
use glam::{DVec3, Vec3};

/// Where a shadow ray ends.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LightEnd {
    /// At a point of the world.
    At(DVec3),
    /// Nowhere.
    Infinity,
}

/// A way from a point to a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Towards the light, unit.
    pub(crate) direction: Vec3,
    /// Radiance over density; of lights without extent the irradiance on a surface that faces the light.
    pub(crate) radiance: Vec3,
    /// Density over solid angle; `None` for lights without extent.
    pub(crate) pdf: Option<f32>,
    /// Where the shadow ray ends.
    pub(crate) end: LightEnd,
    /// The primitive that the light is, which does not shadow itself.
    pub(crate) target: Option<HitId>,
}

impl LightSample {
    /// The same for a light that was chosen among others.
    pub(crate) fn chosen_with(self, probability: f32) -> Self {
        Self { radiance: self.radiance / probability, pdf: self.pdf.map(|p| p * probability), ..self }
    }
}

/// Everything that shines.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) punctual: Vec<punctual::PunctualLight>,
    pub(crate) area: area::AreaLights,
    /// Light from around; `None`: black.
    pub(crate) environment: Option<environment::Environment>,
    /// Whether direct light comes from it (else it is only seen and mirrored).
    pub(crate) sample_environment: bool,
    /// Which light a point asks that asks but one.
    pub(crate) choice: choice::LightChoice,
    /// Even light, in place of what surfaces send to each other: radiance.
    pub(crate) ambient: Vec3,
    /// How near things must be to take that light away.
    pub(crate) ambient_reach: f64,
}

/// Weight of one of two ways to find the same light: Veach's power heuristic with exponent 2.
pub(crate) fn power_heuristic(this: f32, other: f32) -> f32 {
    // Over the larger one, so that squares do not overflow.
    let ratio = other / this;
    if ratio.is_finite() { 1.0 / (1.0 + ratio * ratio) } else { 0.0 }
}
