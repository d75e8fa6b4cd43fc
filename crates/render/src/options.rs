//! What the caller wants of a picture.

use std::time::Duration;

use firsthit_import::scene::ImageDesc;
use glam::{DVec3, Vec3};

use crate::framing::Framing;
use crate::sampler::SamplerChoice;
use crate::{Aov, EffectSet};

/// Everything about how a stage is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Samples per pixel, from 1 to [`RenderOptions::MOST_SAMPLES`]; with a noise threshold or a time limit the most of them.
    pub spp: u32,
    /// The first sample, for a share of a render that is joined with others later: a multiple of 16, below `spp`.
    pub first_sample: u32,
    /// Tiles of 16 x 16 pixels get no more samples once their noise is estimated to be below this: the root of the
    /// mean of variance / (value^2 + 0.01). 0.03 looks clean. At least 32 samples are taken, if `spp` allows.
    pub noise_threshold: Option<f32>,
    /// No more samples are taken after this time, but every pixel gets one.
    pub time_limit: Option<Duration>,
    /// Where sample points come from.
    pub sampler: SamplerChoice,
    /// How samples of a pixel weigh by their place.
    pub filter: FilterChoice,
    /// Most bounces: path edges - 1. 0: only what the camera sees glowing; 1: direct light.
    pub max_depth: u32,
    /// Same seed, same bits.
    pub seed: u64,
    /// How light is computed.
    pub integrator: IntegratorChoice,
    /// Pixels outside this window are left out.
    pub crop: Option<Crop>,
    /// Pictures beside the colour.
    pub aovs: Vec<Aov>,
    /// Parts of space whose surfaces are cut away (section views).
    pub clip: Clip,
    /// Times the parts of the work, on one pixel of seven, for [`RenderStats::breakdown`](crate::RenderStats): it
    /// changes no picture, but takes time.
    pub profile: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            spp: 16,
            first_sample: 0,
            noise_threshold: None,
            time_limit: None,
            sampler: SamplerChoice::Sobol,
            filter: FilterChoice::Auto,
            max_depth: 16,
            seed: 0,
            integrator: IntegratorChoice::Auto,
            crop: None,
            aovs: Vec::new(),
            clip: Clip::default(),
            profile: false,
        }
    }
}

/// How light is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum IntegratorChoice {
    /// `Path`.
    #[default]
    Auto,
    /// All ways that light takes, by path tracing.
    Path,
    /// The same light by paths that start at the lights: good at caustics.
    Light,
    /// Direct light, mirror reflection, refraction, transparency.
    Whitted,
    /// Direct light alone.
    Direct,
    /// Ambient occlusion: the share of the hemisphere that is free.
    AmbientOcclusion,
    /// One of the pictures beside the colour as the main one.
    Aov(Aov),
}

/// How samples of a pixel weigh by their place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FilterChoice {
    /// Even in reference scenes, else smooth.
    #[default]
    Auto,
    /// Even over the pixel's own square.
    Box,
    /// The Blackman-Harris window of radius 1.5 pixels.
    BlackmanHarris,
}

/// A window of the picture, in pixels from the upper left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Left edge.
    pub x: u32,
    /// Upper edge.
    pub y: u32,
    /// Width, > 0.
    pub width: u32,
    /// Height, > 0.
    pub height: u32,
}

/// Where surfaces are shown. Rays are clipped, so a cut shows the inside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    /// Only inside this box (world), if given: lower and upper corner.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Only where `normal . p <= offset` for every plane.
    pub planes: Vec<(DVec3, f64)>,
}

/// What a stage is set up with beside the scene.
#[derive(Clone, Debug)]
pub struct StageOptions {
    /// Light from around.
    pub environment: EnvironmentChoice,
    /// Turns the environment counter-clockwise seen from +Y, radians.
    pub environment_rotation: f32,
    /// What the camera sees where there is nothing.
    pub background: Background,
    /// Changes to the effects that the scene calls for.
    pub effects: EffectOverrides,
    /// Which camera.
    pub camera: CameraChoice,
    /// Changes to the camera.
    pub camera_changes: CameraChanges,
    /// Width / height of the picture, for framing.
    pub aspect: f64,
    /// Light that bounces between the facets of rough glTF materials is added to what one bounce reflects. glTF's own
    /// formulas, and the conventions of reference scenes, are without.
    pub energy_compensation: bool,
    /// Shadow rays of coarse meshes with smooth normals start on the curved surface that the normals mean. Reference
    /// scenes are without.
    pub shadow_terminator: bool,
    /// How textures are anti-aliased.
    pub texture_filter: TextureFilter,
    /// Into how many steps the time is cut while the shutter is open, where something moves; at least 1.
    pub motion_steps: u32,
}

/// How textures are anti-aliased where the file asks for smooth ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFilter {
    /// Bilinear in and between smaller copies, by how much of the surface a pixel sees.
    #[default]
    Trilinear,
    /// Bilinear in the image itself, as in reference scenes: the samples of a pixel do the rest.
    Bilinear,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            environment: EnvironmentChoice::Auto,
            environment_rotation: 0.0,
            background: Background::Auto,
            effects: EffectOverrides::default(),
            camera: CameraChoice::Auto,
            camera_changes: CameraChanges::default(),
            aspect: 16.0 / 9.0,
            energy_compensation: true,
            shadow_terminator: true,
            texture_filter: TextureFilter::default(),
            motion_steps: 16,
        }
    }
}

/// Light from around the scene.
#[derive(Clone, Debug, Default)]
pub enum EnvironmentChoice {
    /// The scene's own; else, where the scene has no lights, the studio.
    #[default]
    Auto,
    /// The built-in studio.
    Studio,
    /// Radiance 1 from everywhere.
    White,
    /// None.
    Black,
    /// A map by longitude and latitude, row 0 at +Y. Floats are radiance; 8 and 16 bits are taken as sRGB, their white
    /// as radiance 1.
    Map(ImageDesc),
}

/// What the camera sees where there is nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Background {
    /// The scene's own environment or the map given; with the studio, a plain light backdrop.
    #[default]
    Auto,
    /// One linear colour.
    Color(Vec3),
    /// Nothing: alpha 0.
    Transparent,
}

/// Changes to the effects that the scene calls for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectOverrides {
    /// Only these, instead of what the scene calls for.
    pub only: Option<EffectSet>,
    /// These too.
    pub add: EffectSet,
    /// Not these.
    pub remove: EffectSet,
}

/// Which camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum CameraChoice {
    /// The scene's first camera if it has one and says it is for viewing (scene files), else a framed view.
    #[default]
    Auto,
    /// The file's camera of this name, or else of this index.
    Named(String),
    /// One that was found before, as for all frames of an animation.
    Framed(Box<Framing>),
}

/// Changes to the chosen camera; the names are F3D's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraChanges {
    /// World position.
    pub position: Option<DVec3>,
    /// World point looked at.
    pub focal_point: Option<DVec3>,
    /// Up direction.
    pub view_up: Option<DVec3>,
    /// Full vertical angle of view, radians.
    pub view_angle: Option<f64>,
    /// Turn around the focal point about the up direction, radians, counter-clockwise seen from above.
    pub azimuth: f64,
    /// Turn around the focal point upwards, radians.
    pub elevation: f64,
    /// > 1: closer.
    pub zoom: Option<f64>,
    /// Parallel projection.
    pub orthographic: bool,
    /// Diameter of its lens, world units; 0: a pinhole, before which everything is sharp.
    pub aperture: Option<f64>,
    /// How far away along its line of sight things are sharp, world units.
    pub focus_distance: Option<f64>,
}
