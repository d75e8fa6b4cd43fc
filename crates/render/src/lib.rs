//! From a scene to a picture: effects, materials, lights, cameras, integrators, film and output.

mod aov;
mod effects;
mod material;
mod monitor;
mod options;
mod stats;

pub use aov::Aov;
pub use effects::{EffectEntry, EffectPlan, EffectSet};
pub use monitor::Monitor;
pub use options::{
    Background, CameraChanges, CameraChoice, Clip, Crop, EffectOverrides, EnvironmentChoice, IntegratorChoice,
    RenderOptions, StageOptions,
};
pub use stats::{RayCounts, RayKind, RenderStats};
