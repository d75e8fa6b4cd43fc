//! From a scene to a picture: effects, materials, lights, cameras, integrators, film and output.

mod aov;
mod effects;
mod options;

pub use aov::Aov;
pub use effects::EffectSet;
pub use options::{
    Background, CameraChanges, CameraChoice, Clip, Crop, EffectOverrides, EnvironmentChoice, IntegratorChoice,
    RenderOptions, StageOptions,
};
