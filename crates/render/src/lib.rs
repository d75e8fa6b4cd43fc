//! From a scene to a picture: effects, materials, lights, cameras, integrators, film and output.

mod ablate;
mod aov;
pub mod camera;
mod checkpoint;
mod dark;
pub mod distribution;
mod effects;
mod empty;
pub mod film;
pub mod filter;
mod fog;
mod forward;
pub mod framing;
mod integrator;
mod kernel;
pub mod light;
mod material;
mod monitor;
mod motion;
mod noise;
mod options;
pub mod output;
mod render;
pub mod sampler;
mod setting;
mod splat;
mod stage;
mod stats;
mod surface;
mod survey;
mod tally;
pub mod texture;
pub mod view;
pub mod warp;

pub use ablate::{AblateError, AblateOptions, Ablation, Ablations, ablate};
pub use aov::Aov;
pub use camera::{Camera, CameraError};
pub use checkpoint::{Checkpoint, CheckpointError, CheckpointReader, Sums};
pub use effects::{EffectEntry, EffectPlan, EffectSet};
pub use film::Film;
pub use kernel::KernelChoice;
pub use light::environment::Environment;
pub use monitor::Monitor;
pub use options::{
    Background, CameraChanges, CameraChoice, Clip, Crop, EffectOverrides, EnvironmentChoice, FilterChoice,
    IntegratorChoice, RenderOptions, StageOptions, TextureFilter,
};
pub use render::{RenderError, Rendered, render, render_from};
pub use stage::{Stage, StageError};
pub use stats::{Breakdown, LightPaths, RayCounts, RayKind, RenderStats};
pub use view::{View, ViewTransform};
