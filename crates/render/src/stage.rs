//! The stage: a scene with everything that rendering needs, compiled once.

use std::sync::Arc;

use firsthit_accel::{Geometry, Hit, HitId, Moments, SurfacePoint};
use firsthit_import::SceneDesc;
use firsthit_import::scene::MaterialDesc;
use glam::{DAffine3, DVec3, Vec3};

use crate::camera::{Camera, CameraError};
use crate::dark::Dark;
use crate::fog::Fog;
use crate::kernel::{Full, Kernel};
use crate::light::Lights;
use crate::light::area::{AreaLights, Glow, ShapeLight};
use crate::light::choice::LightChoice;
use crate::light::environment::{Environment, EnvironmentError};
use crate::light::punctual::PunctualLight;
use crate::material::{Conventions, Made, Material, Textures};
use crate::setting::{self, Setting};
use crate::surface::World;
use crate::texture::TextureError;
use crate::{
    Background, CameraChoice, EffectPlan, EffectSet, KernelChoice, StageOptions, TextureFilter, framing, motion, survey,
};

/// A scene that cannot be staged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// The camera that was asked for is not there.
    #[error("there is no camera '{wanted}' ({})", available(.cameras))]
    NoSuchCamera {
        /// Name or index asked for.
        wanted: String,
        /// Names of the cameras that there are.
        cameras: Vec<String>,
    },
    /// The camera is unusable.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A texture is unusable.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// A material names an image that the scene does not have.
    #[error("image {0} does not exist")]
    NoSuchImage(usize),
    /// What moves cannot be placed at some moment.
    #[error("something that moves cannot be placed on its way: {0}")]
    Motion(String),
    /// The environment map is unusable.
    #[error("{image}: {cause}")]
    Environment {
        /// The name of its image.
        image: String,
        /// What is wrong with it.
        #[source]
        cause: EnvironmentError,
    },
}

fn available(cameras: &[String]) -> String {
    if cameras.is_empty() {
        return "the scene has none; 'auto' frames the model".into();
    }
    let list: Vec<String> = cameras.iter().enumerate().map(|(i, name)| format!("{i} '{name}'")).collect();
    format!("there are: {}", list.join(", "))
}

/// A scene ready to be rendered: trees, compiled materials, lights, a camera, and the effects that are simulated.
#[derive(Clone, Debug)]
pub struct Stage {
    pub(crate) world: World,
    pub(crate) accel: firsthit_accel::Scene,
    /// One for each material of the scene, then the default material.
    pub(crate) materials: Arc<[Material]>,
    pub(crate) flags: Arc<[Flags]>,
    /// What does not glow although its material does.
    dark: Arc<Dark>,
    pub(crate) lights: Lights,
    pub(crate) camera: Camera,
    pub(crate) background: Backdrop,
    pub(crate) reference: bool,
    /// Shadow rays of smooth meshes start on the curved surface that is meant.
    pub(crate) terminator: bool,
    kernel: KernelChoice,
    pub(crate) fog: Option<Fog>,
    /// The same at each step of the time that the shutter is open, if anything moves.
    moments: Vec<Stage>,
    plan: EffectPlan,
    explain: Vec<String>,
    /// The images with their smaller copies, for the next frame.
    textures: Arc<Made>,
}

/// What rays have to ask a material before they take a hit for one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Flags {
    /// Back faces are not there.
    pub(crate) culls: bool,
    /// Alpha counts.
    pub(crate) alpha: bool,
    /// It glows as a texture says.
    pub(crate) glows: bool,
    /// Shadow rays may pass.
    pub(crate) lets_through: bool,
    /// It looks textures up.
    pub(crate) textured: bool,
    /// Rays that pass it look up its textures, always sharp.
    pub(crate) sharp: bool,
}

impl Flags {
    /// Whether any has to be asked.
    fn asks(self) -> bool {
        self.culls || self.alpha || self.lets_through
    }
}

/// What the camera sees where there is nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Backdrop {
    /// The environment.
    Environment,
    /// The studio's plain backdrop, so bright.
    Studio(f32),
    /// One colour.
    Color(Vec3),
    /// Nothing, with alpha 0.
    Transparent,
}

impl Stage {
    /// Compiles a scene; `accel` must have been built from it.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use firsthit_accel::{BuildOptions, SceneBuilder};
    /// use firsthit_import::SceneDesc;
    /// use firsthit_render::{RenderOptions, Stage, StageOptions, render};
    ///
    /// let scene = Arc::new(SceneDesc::default());
    /// let accel = SceneBuilder::from_desc(&scene, BuildOptions::default()).build()?;
    /// let stage = Stage::new(scene, accel, &StageOptions::default())?;
    /// let options = RenderOptions { width: 8, height: 8, spp: 1, ..RenderOptions::default() };
    /// let rendered = render(&stage, &options, &())?;
    /// assert_eq!(rendered.stats.samples, 64);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When the camera asked for is missing or unusable, or a texture is: see [`StageError`].
    pub fn new(
        scene: Arc<SceneDesc>,
        accel: firsthit_accel::Scene,
        options: &StageOptions,
    ) -> Result<Self, StageError> {
        Self::make(scene, accel, options, None)
    }

    /// The stage of another frame of the same animation, as [`Stage::new`] makes it; what was worked out for images that
    /// both have is shared.
    ///
    /// # Errors
    /// As [`Stage::new`].
    pub fn next_frame(
        &self,
        scene: Arc<SceneDesc>,
        accel: firsthit_accel::Scene,
        options: &StageOptions,
    ) -> Result<Self, StageError> {
        Self::make(scene, accel, options, Some(self))
    }

    fn make(
        scene: Arc<SceneDesc>,
        accel: firsthit_accel::Scene,
        options: &StageOptions,
        before: Option<&Self>,
    ) -> Result<Self, StageError> {
        let reference = scene.settings.reference_conventions;
        let mut explain = Vec::new();
        let own = file_camera(&scene, options)?;
        let mut camera = choose_camera(&scene, &accel, options, own, &mut explain)?;
        let moving_camera = own.map(|i| &scene.cameras[i]).filter(|c| c.moves_to.is_some()).cloned();
        let Setting { environment, background, words, dim, studio } = setting::choose(&scene, options)?;
        explain.extend(words);

        // What the scene calls for decides what is compiled.
        let mut plan = EffectPlan::default();
        let used = survey::used_materials(&scene);
        survey::call_for_materials(&mut plan, &scene, &used);
        survey::call_for_lights(&mut plan, &scene, environment.as_ref(), &explain_environment(dim));
        let fog = scene.fog.as_ref().and_then(Fog::new);
        if let Some(fog) = &fog {
            plan.call(EffectSet::FOG, "the fog");
            if fog.scatters() {
                plan.call(EffectSet::INDIRECT_LIGHT, "the fog");
            }
        }
        match motion::count(&scene) {
            0 => {}
            1 => plan.call(EffectSet::MOTION, "1 object that moves"),
            n => plan.call(EffectSet::MOTION, format!("{n} objects that move")),
        }
        if moving_camera.is_some() {
            plan.call(EffectSet::MOTION, "a camera that moves");
        }
        if camera.has_lens() {
            plan.call(EffectSet::DEPTH_OF_FIELD, "the camera's lens");
        }
        let lit = setting::has_lights(&scene);
        let view = if reference { None } else { survey::view(&accel, &camera, options.aspect) };
        let headlight = view
            .filter(|v| v.indoors && !lit && environment.is_some())
            .map(|v| survey::Headlight { position: camera.position(), distance: v.distance });
        // A studio that hardly reaches a room would only be noise there.
        let sample_environment = !(studio && headlight.is_some());
        if headlight.is_some() {
            let effects = EffectSet::SHADOWS | EffectSet::PUNCTUAL_LIGHTS | EffectSet::AMBIENT_OCCLUSION;
            plan.call(effects, "light at the camera");
            explain.push(
                "light: a light at the camera and a little even light were added, since there are no lights and the \
                 surroundings hardly reach what is seen"
                    .into(),
            );
        } else if dim && view.is_some() {
            plan.call(EffectSet::AMBIENT_OCCLUSION, "even light");
            explain.push("light: a little even light was added for what surfaces send to each other".into());
        }
        plan.decide(&options.effects);
        if cfg!(feature = "without-layers") {
            plan.leave(EffectSet::LAYERS);
        }
        let effects = plan.simulated();
        if !effects.contains(EffectSet::DEPTH_OF_FIELD) {
            camera = camera.without_lens();
        }

        let energy_compensation = options.energy_compensation && !reference;
        let conventions = Conventions { reference, effects, energy_compensation };
        let mips = !reference && options.texture_filter == TextureFilter::Trilinear;
        let mut textures = Textures::new(&scene.images, mips);
        if let Some(before) = before {
            textures.take_over(&before.scene().images, &before.textures);
        }
        let default = MaterialDesc::default();
        let materials = scene
            .materials
            .iter()
            .chain([&default])
            .map(|m| Material::new(m, &mut textures, conventions))
            .collect::<Result<Arc<[_]>, _>>()?;
        let textures = Arc::new(textures.made());
        let flags = materials.iter().map(|m| Flags {
            culls: !reference && m.culls(),
            alpha: m.has_alpha(),
            glows: m.glows() && m.emissive_texture().is_some(),
            lets_through: m.lets_through(),
            textured: m.is_textured(),
            sharp: !mips || m.lets_through(),
        });
        let flags: Arc<[Flags]> = flags.collect();
        // What no surface has keeps no kernel from being small.
        let of_used = |is: &dyn Fn(usize) -> bool| (0..used.len()).any(|i| used[i] && is(i));
        let kernel = KernelChoice::new(
            effects.contains(EffectSet::TEXTURES),
            effects.intersects(EffectSet::ALPHA_MASK | EffectSet::ALPHA_BLEND) || of_used(&|i| flags[i].asks()),
            effects.intersects(EffectSet::THROUGH) || of_used(&|i| materials[i].goes_through()),
            effects.intersects(EffectSet::LAYERS) || of_used(&|i| materials[i].is_layered()),
            effects.intersects(EffectSet::FOG | EffectSet::MOTION | EffectSet::DEPTH_OF_FIELD),
        );
        let places: Vec<DAffine3> = scene.instances.iter().map(|i| i.transform).collect();
        let world = World::new(scene, places);

        let mut punctual = Vec::new();
        if effects.contains(EffectSet::PUNCTUAL_LIGHTS) {
            punctual.extend(world.scene.lights.iter().filter_map(|l| PunctualLight::new(&l.kind)));
            punctual.extend(headlight.as_ref().map(survey::Headlight::light));
        }
        let dark = Arc::new(Dark::new(&world, &materials));
        let area = glowing(&world, &materials, &dark, effects);
        if area.unsampled > 0 {
            explain.push(format!(
                "light: {} glowing shapes other than plain balls are seen and mirrored, but light nothing else",
                area.unsampled
            ));
        }
        let environment = environment.filter(|e| effects.contains(EffectSet::ENVIRONMENT) && !e.is_black());
        let lights = Lights {
            choice: LightChoice::new(&punctual, &area, environment.as_ref(), studio, is_followed(effects)),
            punctual,
            area,
            environment,
            sample_environment,
            ambient: if headlight.is_some() { survey::AMBIENT } else { Vec3::ZERO },
            ambient_reach: view.map_or(0.0, |v| 0.5 * v.distance),
        };
        let terminator = options.shadow_terminator && !reference;
        let mut stage = Self {
            world,
            accel,
            materials,
            flags,
            dark,
            lights,
            camera,
            background,
            reference,
            terminator,
            kernel,
            fog: fog.filter(|_| effects.contains(EffectSet::FOG)),
            moments: Vec::new(),
            plan,
            explain,
            textures,
        };
        if let Some(view) = view.filter(|_| dim) {
            stage.lights.ambient = survey::even_light(&stage, &view, options.aspect);
        }
        if let (Some(view), Some(_)) = (view, headlight) {
            let enough = survey::share_of_headlight(&stage, &view, options.aspect);
            for light in &mut stage.lights.punctual {
                if let PunctualLight::Headlight { share, .. } = light {
                    *share = enough;
                }
            }
        }
        if effects.contains(EffectSet::MOTION) && (moving_camera.is_some() || motion::count(stage.scene()) > 0) {
            let mut worlds = Vec::new();
            let moments = Moments::new(&stage.accel, options.motion_steps as usize, |time, update| {
                let (places, bent) = (motion::transforms(stage.scene(), time), motion::bent(stage.scene(), time));
                places.iter().enumerate().for_each(|(i, place)| _ = update.set_transform(i, *place));
                bent.iter().for_each(|(i, mesh)| _ = update.move_vertices(*i, Geometry::from_desc(mesh)));
                worlds.push((time, World::bent(Arc::clone(stage.scene()), places, bent)));
            });
            let moments = moments.map_err(|e| StageError::Motion(e.to_string()))?;
            let moment = |((time, world), accel): ((f64, World), &firsthit_accel::Scene)| {
                let mut moment = stage.at(world, accel.clone(), studio);
                if let Some(camera) = moving_camera.as_ref().and_then(|camera| motion::camera(camera, time)) {
                    let camera = as_asked(Camera::from_desc(&camera, &stage.accel.bounds())?, options)?;
                    moment.camera = if stage.camera.has_lens() { camera } else { camera.without_lens() };
                }
                Ok::<_, StageError>(moment)
            };
            stage.moments = worlds.into_iter().zip(moments.scenes()).map(moment).collect::<Result<_, _>>()?;
        }
        Ok(stage)
    }

    /// The same at another moment.
    fn at(&self, world: World, accel: firsthit_accel::Scene, studio: bool) -> Self {
        let area = glowing(&world, &self.materials, &self.dark, self.plan.simulated());
        let followed = is_followed(self.plan.simulated());
        let choice = LightChoice::new(&self.lights.punctual, &area, self.lights.environment.as_ref(), studio, followed);
        Self { world, accel, lights: Lights { area, choice, ..self.lights.clone() }, ..self.clone() }
    }

    /// What comes from a hit on a glowing triangle to one who looks there along a unit direction.
    #[inline]
    pub(crate) fn glow<K: Kernel>(&self, hit: &Hit, looking: Vec3) -> Vec3 {
        let material = &self.materials[self.world.material(hit.id)];
        if K::LAYERS && material.glow_depends_on_view() {
            let point = SurfacePoint { position: DVec3::ZERO, normal: hit.normal(), error: 0.0 };
            return material.glow::<K>(&self.world.surface(hit, point, -looking, 0.0));
        }
        material.glow::<K>(&self.world.attributes(hit, true))
    }

    /// Whether a hit is known not to glow.
    #[inline]
    pub(crate) fn is_dark(&self, id: HitId, material: usize) -> bool {
        self.flags[material].glows && self.dark.is_dark(&self.world, id)
    }

    /// Whether what is behind all looks the same everywhere in the picture.
    pub(crate) fn background_is_even(&self) -> bool {
        match self.background {
            Backdrop::Color(_) | Backdrop::Transparent => true,
            Backdrop::Environment => self.lights.environment.as_ref().is_none_or(Environment::is_constant),
            Backdrop::Studio(_) => false,
        }
    }

    /// Whether anything moves.
    pub(crate) fn moves(&self) -> bool {
        !self.moments.is_empty()
    }

    /// What is seen at the moment that a number in [0, 1) chooses; and which of the moments it is.
    #[inline]
    pub(crate) fn moment(&self, u: f32) -> (usize, &Self) {
        let moments = self.moments();
        let k = ((u * moments.len() as f32) as usize).min(moments.len() - 1);
        (k, &moments[k])
    }

    /// The stage at each moment that is looked at.
    pub(crate) fn moments(&self) -> &[Self] {
        if self.moments.is_empty() { std::slice::from_ref(self) } else { &self.moments }
    }

    /// Which effects the scene calls for, by what, and which are simulated.
    #[must_use]
    pub fn plan(&self) -> &EffectPlan {
        &self.plan
    }

    /// What was chosen (camera, surroundings, lights) and why: one line each.
    #[must_use]
    pub fn explain(&self) -> &[String] {
        &self.explain
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<SceneDesc> {
        &self.world.scene
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The kernel that renders it: the smallest one that simulates all effects that are to be, and that can do with the
    /// materials as they are compiled.
    #[must_use]
    pub fn kernel(&self) -> KernelChoice {
        self.kernel
    }
}

/// Whether paths meet what glows and what is around by chance.
fn is_followed(effects: EffectSet) -> bool {
    effects.contains(EffectSet::INDIRECT_LIGHT)
}

/// The glowing surfaces of a scene.
fn glowing(world: &World, materials: &[Material], dark: &Dark, effects: EffectSet) -> AreaLights {
    if !effects.contains(EffectSet::AREA_LIGHTS) {
        return AreaLights::default();
    }
    let lights = world.scene.lights.iter().filter_map(|l| ShapeLight::new(&l.kind));
    let of = |id: HitId| &materials[world.material(id)];
    AreaLights::new(
        lights,
        world,
        |id| {
            let glow = |m: &Material| Glow {
                both_sides: m.glows_on_both_sides(),
                even: m.glows_evenly(),
                by_view: m.glow_depends_on_view(),
                most: m.brightest_glow(),
            };
            Some(of(id)).filter(|m| m.glows()).map(glow)
        },
        |id| dark.is_dark(world, id),
        |id, u, v| {
            let hit = Hit { id, t: 0.0, u, v, normal_direction: DVec3::Z };
            let (material, at) = (of(id), world.attributes(&hit, true));
            // How much is there of a mesh is looked up where it is asked.
            if world.is_shape(id) { material.glow::<Full>(&at) } else { material.emission::<Full>(&at) }
        },
    )
}

fn explain_environment(dim: bool) -> String {
    if dim { "dim studio".into() } else { "surroundings".into() }
}

/// Which of the file's cameras is asked for, if any.
fn file_camera(scene: &SceneDesc, options: &StageOptions) -> Result<Option<usize>, StageError> {
    match &options.camera {
        CameraChoice::Framed(_) => Ok(None),
        CameraChoice::Auto => Ok(scene.settings.camera.filter(|i| *i < scene.cameras.len())),
        CameraChoice::Named(wanted) => {
            let by_name = scene.cameras.iter().position(|c| c.name == *wanted);
            let by_index = || wanted.parse().ok().filter(|i| *i < scene.cameras.len());
            by_name.or_else(by_index).map(Some).ok_or_else(|| {
                let cameras = scene.cameras.iter().map(|c| c.name.clone()).collect();
                StageError::NoSuchCamera { wanted: wanted.clone(), cameras }
            })
        }
    }
}

fn choose_camera(
    scene: &SceneDesc,
    accel: &firsthit_accel::Scene,
    options: &StageOptions,
    own: Option<usize>,
    explain: &mut Vec<String>,
) -> Result<Camera, StageError> {
    let camera = match own {
        Some(i) => {
            explain.push(format!("camera: '{}' of the file", scene.cameras[i].name));
            Camera::from_desc(&scene.cameras[i], &accel.bounds())?
        }
        None => {
            let framing = match &options.camera {
                CameraChoice::Framed(framing) => (**framing).clone(),
                _ => framing::frame(scene, accel, options.aspect),
            };
            explain.push(format!("camera: {}", framing.reason));
            framing.camera
        }
    };
    if options.camera_changes != crate::CameraChanges::default() {
        explain.push("camera: changed as asked".into());
    }
    as_asked(camera, options)
}

fn as_asked(camera: Camera, options: &StageOptions) -> Result<Camera, StageError> {
    let asked = options.camera_changes != crate::CameraChanges::default();
    Ok(if asked { camera.changed(&options.camera_changes)? } else { camera })
}

/// Kept beside [`Background`] so that a picture's background is decided in one place.
impl Backdrop {
    pub(crate) fn new(wish: Background, studio: Option<f32>) -> Self {
        match (wish, studio) {
            (Background::Color(c), _) => Self::Color(c),
            (Background::Transparent, _) => Self::Transparent,
            (Background::Auto, Some(brightness)) => Self::Studio(brightness),
            (Background::Auto, None) => Self::Environment,
        }
    }
}
