//! What is before the camera: the model at one moment of its animations, and what the next moment can take over of it.

use std::sync::Arc;

use firsthit_accel::{BuildError, BuildOptions, Followed, Scene, SceneBuilder};
use firsthit_import::{AnimationChoice, Decode, ImageCache, Imported, Options, Play, Report, SceneDesc, gltf};
use firsthit_render::framing::{self, Framing};
use firsthit_render::{CameraChoice, Stage, StageOptions};

use crate::args::RenderArgs;
use crate::error::Failure;
use crate::render::at_model;
use crate::simd;

/// A model at a moment.
pub(crate) struct Shot {
    /// The moment, if anything is played.
    pub(crate) play: Option<Play>,
    images: ImageCache,
    /// The camera that fits the whole animation, once it is found.
    framing: Option<Box<Framing>>,
    /// The frame before, and its trees.
    before: Option<(Stage, Scene)>,
    /// Those of the frame at hand.
    trees: Option<Scene>,
    /// Those that were built while the images of the first frame were decoded.
    built: Option<Result<Scene, BuildError>>,
}

/// At how many moments of an animation the camera is fitted to the model.
const FRAMED: u32 = 9;

impl Shot {
    /// At the moment that the arguments ask for.
    pub(crate) fn new(args: &RenderArgs) -> Self {
        let play = args.animation.play();
        Self { play, images: ImageCache::default(), framing: None, before: None, trees: None, built: None }
    }

    /// Whether no frame was rendered yet.
    pub(crate) fn is_first(&self) -> bool {
        self.before.is_none()
    }

    /// Reads the model. The trees of the first frame are built at the same time.
    pub(crate) fn read(&mut self, args: &RenderArgs) -> Result<Imported, Failure> {
        let options = self.options(args, self.play.clone());
        if self.before.is_some() {
            return Ok(firsthit_import::open(&args.model, &options)?);
        }
        let settings = build(args)?;
        let trees = |scene: &SceneDesc| SceneBuilder::from_desc(scene, settings).build();
        let (imported, trees) = firsthit_import::open_with(&args.model, &options, trees)?;
        self.built = Some(trees);
        Ok(imported)
    }

    fn options(&self, args: &RenderArgs, play: Option<Play>) -> Options {
        let scene = &args.scene;
        let radius = |r: Option<f64>| r.map(|r| r as f32);
        Options {
            up: scene.up,
            variant: scene.variant.clone(),
            scene: scene.scene.clone(),
            play,
            strokes: gltf::Strokes { points: radius(scene.points), lines: radius(scene.lines), thin: true },
            images: self.play.is_some().then(|| self.images.clone()),
            decode: Decode::Seen,
            ..args.load.options()
        }
    }

    /// Where the camera is to be chosen, and something is played, one is found that fits all of it: the same for every
    /// frame, alone or in a sequence.
    pub(crate) fn place_camera(
        &mut self,
        args: &RenderArgs,
        scene: &SceneDesc,
        report: &Report,
        options: &mut StageOptions,
    ) -> Result<(), Failure> {
        let Some(play) = &self.play else { return Ok(()) };
        if options.camera != CameraChoice::Auto || scene.settings.camera.is_some() || report.animations.is_empty() {
            return Ok(());
        }
        if self.framing.is_none() {
            let seconds = seconds(play, report);
            let mut poses = Vec::new();
            for k in 0..FRAMED {
                let time = seconds * f64::from(k) / f64::from(FRAMED - 1);
                let play = Play { time, shutter: 0.0, ..play.clone() };
                let options = Options { decode: Decode::Nothing, ..self.options(args, Some(play)) };
                let pose = firsthit_import::open(&args.model, &options)?.scene;
                poses.push(SceneDesc { images: scene.images.clone(), ..pose });
            }
            let all = framing::all_poses(poses);
            let trees = SceneBuilder::from_desc(&all, build(args)?).build().map_err(|e| at_model(args, &e))?;
            let mut framing = framing::frame(&all, &trees, options.aspect);
            framing.reason += " at all times";
            self.framing = Some(Box::new(framing));
        }
        if let Some(framing) = &self.framing {
            options.camera = CameraChoice::Framed(framing.clone());
        }
        Ok(())
    }

    /// Builds the trees, or makes them of those of the frame before; and what is to be rendered.
    pub(crate) fn stage(
        &mut self,
        args: &RenderArgs,
        scene: SceneDesc,
        options: &StageOptions,
    ) -> Result<(Stage, Option<Followed>), Failure> {
        let scene = Arc::new(scene);
        let (trees, followed) = match &self.before {
            Some((before, trees)) => {
                let (trees, followed) = trees.follow(before.scene(), &scene).map_err(|e| at_model(args, &e))?;
                (trees, Some(followed))
            }
            None => {
                let built = match self.built.take() {
                    Some(built) => built,
                    None => SceneBuilder::from_desc(&scene, build(args)?).build(),
                };
                (built.map_err(|e| at_model(args, &e))?, None)
            }
        };
        self.trees = Some(trees.clone());
        let stage = match &self.before {
            Some((before, _)) => before.next_frame(scene, trees, options),
            None => Stage::new(scene, trees, options),
        };
        Ok((stage.map_err(|e| at_model(args, &e))?, followed))
    }

    /// Keeps a frame for the next one.
    pub(crate) fn keep(&mut self, stage: Stage) {
        self.before = self.trees.take().map(|trees| (stage, trees));
    }
}

fn build(args: &RenderArgs) -> Result<BuildOptions, Failure> {
    Ok(BuildOptions { precision: args.quality.precision, simd: simd::level()?, ..Default::default() })
}

/// How long what is played takes.
fn seconds(play: &Play, report: &Report) -> f64 {
    let list = &report.animations;
    let chosen = match &play.animation {
        AnimationChoice::First => list.first(),
        AnimationChoice::Named(name) => {
            list.iter().find(|a| a.name == *name).or_else(|| name.parse().ok().and_then(|i: usize| list.get(i)))
        }
        AnimationChoice::All => None,
    };
    chosen.map_or_else(|| list.iter().fold(0.0, |most, a| a.seconds.max(most)), |a| a.seconds)
}
