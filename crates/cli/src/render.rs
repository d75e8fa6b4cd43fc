//! `firsthit render`: from a model to an image.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use firsthit_import::scene::Settings;
use firsthit_import::{Imported, Report};
use firsthit_render::{
    AblateError, AblateOptions, Aov, Background, CameraChanges, Clip, EnvironmentChoice, IntegratorChoice,
    RenderOptions, Rendered, Stage, StageOptions, View, ViewTransform, ablate,
    output::{BitDepth, WriteOptions, write_checkpoint, write_film, write_png},
};

use crate::args::{CameraArgs, QualityArgs, RenderArgs, ViewArgs};
use crate::console::{Console, message, print, print_json};
use crate::error::{Exit, Failure};
use crate::hdri;
use crate::interrupt::Interrupt;
use crate::merge;
use crate::progress::{Keep, Progress, Style, duration};
use crate::report::{
    Ablation, Counts, Paths, RenderReport, Seconds, effects, explain_effects, rays_in_words, warnings,
};
use crate::sequence::Sequence;
use crate::shot::Shot;
use crate::target::{Target, writable};
use crate::values::{Explain, Hdri, Resolution, Switch};

/// Renders a model as the arguments say.
pub(crate) fn run(args: &RenderArgs, config: Option<&Path>) -> Result<Exit, Failure> {
    let console = Console::new(args.run.quiet, args.run.verbose);
    let sequence = Sequence::new(args)?;
    let output = args.output.output.as_deref();
    let target = match &sequence {
        Some(sequence) => sequence.target(sequence.first(), &args.model)?,
        None => Target::new(output, &args.model)?,
    };
    if target == Target::Stdout && args.run.json {
        let failure = Failure::usage("`-o -` and `--json` both want the standard output");
        return Err(failure.hint("write the image to a file: -o FILE"));
    }
    if target == Target::Stdout && args.output.aov.is_some() {
        let failure = Failure::usage("`-o -` has no room for `--aov`");
        return Err(failure.hint("write to a file: -o FILE.exr holds them all"));
    }
    if let Some(path) = &args.quality.checkpoint {
        writable(path)?;
    }
    if let Some(path) = config {
        console.say(format_args!("options from {}", path.display()));
    }
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.run.threads {
        pool = pool.num_threads(threads.into());
    }
    let pool = pool.build().map_err(|e| Failure::failed(format_args!("threads: {e}")))?;
    let then = if sequence.is_some() { "the frame at hand is not written" } else { "writing the image so far" };
    let interrupt = Interrupt::listen(console, then);
    let shot = Shot::new(args);
    let mut job = Job { args, config, console, target, interrupt, shot, in_sequence: sequence.is_some() };
    pool.install(|| match &sequence {
        Some(sequence) => sequence.run(&mut job),
        None => job.run(),
    })
}

/// One render, or one after the other.
pub(crate) struct Job<'a> {
    pub(crate) args: &'a RenderArgs,
    /// The configuration file that was read.
    config: Option<&'a Path>,
    pub(crate) console: Console,
    pub(crate) target: Target,
    pub(crate) interrupt: Interrupt,
    pub(crate) shot: Shot,
    /// It is one of several frames: only whole ones are written.
    in_sequence: bool,
}

impl Job<'_> {
    /// Renders what the shot has before the camera, and writes it.
    pub(crate) fn run(&mut self) -> Result<Exit, Failure> {
        let mut seconds = Seconds::default();
        let args = self.args;

        let started = Instant::now();
        self.console.detail(format_args!("reading {}", args.model.display()));
        let Imported { scene, report } = self.shot.read(args)?;
        if self.shot.is_first() || args.run.strict {
            self.console.warnings(&report, args.run.strict)?;
        }
        if self.shot.is_first() && self.shot.play.is_some() && report.animations.is_empty() {
            self.console.say(format_args!("{}: has no animation: it stands still", args.model.display()));
        }
        self.spare_what_was_read(&report)?;
        let options = render_options(args, &scene.settings)?;
        options.check().map_err(|e| self.at_model(&e))?;
        let mut stage_options = stage_options(args, &options, &self.target)?;
        self.shot.place_camera(args, &scene, &report, &mut stage_options)?;
        seconds.load = started.elapsed().as_secs_f64();

        let asked = args.quality.checkpoint.is_some() || args.quality.resume.is_some();
        let picture = if asked { self.words(&report, &options, &stage_options)? } else { String::new() };
        let start = match &args.quality.resume {
            Some(path) => {
                let start = merge::open(path)?;
                if start.picture() != picture {
                    let words = format_args!("{}: it is of another model or of other options", path.display());
                    return Err(Failure::failed(words).hint("repeat the options of the render that was put aside"));
                }
                Some(merge::read(start, path)?)
            }
            None => None,
        };
        let started = Instant::now();
        self.console.detail("building trees");
        let counts = Counts::new(&scene);
        let (stage, followed) = self.shot.stage(args, scene, &stage_options)?;
        seconds.build = started.elapsed().as_secs_f64();
        if args.run.explain >= Explain::Costs {
            stage.explain().iter().for_each(message);
        } else {
            stage.explain().iter().for_each(|line| self.console.detail(line));
        }

        if Effort::new(&args.quality).announce
            && self.shot.is_first()
            && let (Some(noise), Some(limit)) = (options.noise_threshold, options.time_limit)
        {
            self.console.say(format_args!(
                "rendering until the noise is below {noise}, with at most {} samples per pixel and for at most {} \
                 (--noise-threshold, --spp, --time-limit)",
                options.spp,
                duration(limit.as_secs_f64()),
            ));
        }
        let started = Instant::now();
        self.interrupt.begin();
        let style = Style::new(args.run.progress, args.run.no_progress, args.run.quiet);
        let keep = args.quality.checkpoint.clone().map(|path| Keep::new(path, picture.clone()));
        let progress = Progress::keeping(style, "rendering", self.interrupt.clone(), keep);
        let rendered = firsthit_render::render_from(&stage, &options, start, &progress);
        progress.finish();
        let rendered = rendered.map_err(|e| self.at_model(&e))?;
        seconds.render = started.elapsed().as_secs_f64();
        if self.in_sequence && rendered.interrupted {
            self.console.say("interrupted: this frame is not written");
            return Ok(Exit::Interrupted);
        }

        let started = Instant::now();
        let files = self.write(&rendered)?;
        // Told of at the end: the picture is there.
        let kept = match &args.quality.checkpoint {
            Some(path) => write_checkpoint(path, &rendered.sums(), &picture).map_err(Failure::failed),
            None => Ok(()),
        };
        seconds.write = started.elapsed().as_secs_f64();

        let ablation = match args.run.explain {
            Explain::Ablations if !rendered.interrupted => self.ablate(&stage, &stage_options, &options)?,
            _ => None,
        };
        if args.run.explain >= Explain::Costs {
            let processor = rendered.stats.seconds * rayon::current_num_threads() as f64;
            explain_effects(&rendered.effects, stage.kernel().name(), processor).iter().for_each(message);
            ablation.iter().flat_map(Ablation::lines).for_each(message);
            Paths::new(&rendered.stats.light).iter().map(Paths::in_words).for_each(|words| message(&words));
        }
        let followed = followed.map_or(String::new(), |followed| format!("; {followed}"));
        self.console.say(self.summary(&rendered, counts, seconds) + &followed);
        if args.run.json {
            let picture = rendered.film.window();
            print_json(&RenderReport {
                output: self.target.name(),
                aov_files: files.iter().skip(1).map(|f| f.display().to_string()).collect(),
                model: args.model.display().to_string(),
                width: picture.width,
                height: picture.height,
                spp: options.spp,
                max_depth: options.max_depth,
                seed: options.seed,
                threads: rayon::current_num_threads(),
                precision: args.quality.precision.name(),
                triangles: counts.triangles,
                shapes: counts.shapes,
                instances: counts.instances,
                seconds,
                rays: rendered.stats.rays.by_name().into_iter().collect(),
                samples: rendered.stats.samples,
                light_paths: Paths::new(&rendered.stats.light),
                noise: rendered.stats.noise,
                out_of_time: rendered.out_of_time,
                bad_samples: rendered.stats.bad_samples,
                interrupted: rendered.interrupted,
                effects: effects(&rendered.effects),
                kernel: stage.kernel().name(),
                ablation,
                choices: stage.explain(),
                warnings: warnings(&report),
                more_warnings: report.more_warnings,
            })?;
        }
        kept?;
        // The picture is there to be looked at, whatever is said about it.
        self.console.bad_samples(rendered.stats.bad_samples, args.run.strict)?;
        self.shot.keep(stage);
        Ok(if rendered.interrupted { Exit::Interrupted } else { Exit::Done })
    }

    /// Renders small pictures without each effect. `None` if the user has enough of it: the image is there already.
    fn ablate(
        &self,
        stage: &Stage,
        setup: &StageOptions,
        options: &RenderOptions,
    ) -> Result<Option<Ablation>, Failure> {
        let run = &self.args.run;
        let style = Style::new(run.progress, run.no_progress, run.quiet);
        let progress = Progress::new(style, "ablating", self.interrupt.clone());
        let ablations = ablate(stage, setup, options, &AblateOptions::default(), &progress);
        progress.finish();
        match ablations {
            Ok(ablations) => Ok(Some(Ablation::from(&ablations))),
            Err(AblateError::Cancelled) => Ok(None),
            Err(error) => Err(self.at_model(&error)),
        }
    }

    /// What decides the samples of a picture, in words: the program, the files by name and content, and the options but
    /// for how many samples are taken.
    fn words(&self, report: &Report, options: &RenderOptions, stage: &StageOptions) -> Result<String, Failure> {
        let mut files = Vec::new();
        for path in report.files.iter().map(PathBuf::as_path).chain(self.hdri()) {
            files.push(fingerprint(path).map_err(|e| Failure::failed(format_args!("{}: {e}", path.display())))?);
        }
        files.sort();
        let mut options = options.clone();
        (options.spp, options.first_sample, options.noise_threshold, options.time_limit) = (16, 0, None, None);
        if options.integrator == IntegratorChoice::Auto {
            options.integrator = IntegratorChoice::Path;
        }
        let mut stage = stage.clone();
        if let EnvironmentChoice::Map(_) = &stage.environment {
            // Its file is among the others.
            stage.environment = EnvironmentChoice::Auto;
        }
        let (scene, precision) = (&self.args.scene, self.args.quality.precision);
        Ok(format!(
            "firsthit {}\n{}\n{options:?}\n{stage:?}\n{precision:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {}",
            env!("CARGO_PKG_VERSION"),
            files.join("\n"),
            scene.up,
            scene.variant,
            scene.scene,
            scene.points,
            scene.lines,
            self.args.load.only,
            self.args.animation.play(),
            // Which of the files it is.
            self.hdri().and_then(Path::file_name).unwrap_or_default().to_string_lossy(),
        ))
    }

    /// The image that gives light.
    fn hdri(&self) -> Option<&Path> {
        match &self.args.scene.hdri {
            Some(Hdri::File(path)) => Some(path),
            _ => None,
        }
    }

    /// Refuses to write over a file that this render was made from.
    fn spare_what_was_read(&self, report: &Report) -> Result<(), Failure> {
        let aovs = self.args.output.aov.as_ref().map_or(&[][..], |list| &list.0);
        let read = report.files.iter().map(PathBuf::as_path);
        let read: Vec<_> = read.chain(self.hdri()).chain(self.config).collect();
        let quality = &self.args.quality;
        self.target.spare(aovs, read.iter().copied().chain(quality.resume.as_deref()))?;
        match &quality.checkpoint {
            // It may go on in the file that it was resumed from.
            Some(path) => self.target.spare_from(path, aovs, read.into_iter()),
            None => Ok(()),
        }
    }

    /// Writes the image and what belongs to it; the answer: the files, the image first.
    fn write(&self, rendered: &Rendered) -> Result<Vec<PathBuf>, Failure> {
        let output = &self.args.output;
        let transform = output.tone_mapping.unwrap_or_else(|| usual_transform(self.args.quality.integrator));
        let view = View {
            transform,
            exposure: output.exposure as f32,
            backdrop: self.args.scene.background_color.map(|color| match transform {
                ViewTransform::None => color.linear(),
                _ => color.0,
            }),
        };
        let bit_depth = if output.bit_depth == 16 { BitDepth::Sixteen } else { BitDepth::Eight };
        match &self.target {
            Target::File(path, _) => {
                write_film(path, &rendered.film, &WriteOptions { view, bit_depth }).map_err(Failure::failed)
            }
            Target::Stdout => {
                let mut png = Vec::new();
                write_png(&mut png, &rendered.film.color(), &view, bit_depth).map_err(Failure::failed)?;
                print(&png)?;
                Ok(Vec::new())
            }
        }
    }

    /// What was done, in one line.
    fn summary(&self, rendered: &Rendered, counts: Counts, seconds: Seconds) -> String {
        let done = match (rendered.interrupted, rendered.out_of_time) {
            (true, _) => "interrupted, image so far",
            (false, true) => "time is up",
            (false, false) => "done",
        };
        let noise = rendered.stats.noise.map_or(String::new(), |n| format!(", noise at most {n:.3}"));
        let share = rendered.stats.light.share();
        let seen = share.map_or(String::new(), |s| format!(", {:.1} % of the points that light met seen", 100.0 * s));
        format!(
            "{done}: {counts}, {:.0} samples per pixel{noise}, {}{seen}; load {:.2} s, build {:.2} s, render {:.2} s; wrote {}",
            rendered.film.samples_per_pixel(),
            rays_in_words(&rendered.stats.rays),
            seconds.load,
            seconds.build,
            seconds.render,
            self.target.name(),
        )
    }

    fn at_model(&self, error: &dyn std::error::Error) -> Failure {
        at_model(self.args, error)
    }
}

pub(crate) fn at_model(args: &RenderArgs, error: &dyn std::error::Error) -> Failure {
    Failure::failed(format_args!("{}: {error}", args.model.display()))
}

/// A file by its name, length and content (FNV-1a of 64 bits: against mix-ups, not against forgery).
fn fingerprint(path: &Path) -> io::Result<String> {
    let mut file = BufReader::new(File::open(path)?);
    let (mut hash, mut length) = (0xcbf2_9ce4_8422_2325_u64, 0);
    loop {
        let bytes = file.fill_buf()?;
        if bytes.is_empty() {
            break;
        }
        for byte in bytes {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
        let count = bytes.len();
        length += count;
        file.consume(count);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(format!("{name} {length} {hash:016x}"))
}

/// How many samples are taken.
struct Effort {
    spp: u32,
    noise_threshold: Option<f32>,
    time_limit: Option<Duration>,
    /// The time limit is nobody's wish: it is said beforehand.
    announce: bool,
}

impl Effort {
    fn new(args: &QualityArgs) -> Self {
        let asked = args.noise_threshold.map(|e| e as f32);
        let adaptive =
            matches!(args.integrator, IntegratorChoice::Auto | IntegratorChoice::Path | IntegratorChoice::Light);
        if let Some((_, end)) = args.samples_range {
            return Self { spp: end, noise_threshold: None, time_limit: args.time_limit, announce: false };
        }
        let (spp, noise_threshold, time_limit) = match (args.spp, asked, args.time_limit) {
            (Some(spp), asked, limit) => (spp, asked, limit),
            (None, None, limit) if adaptive => (1024, Some(0.03), Some(limit.unwrap_or(Duration::from_secs(60)))),
            (None, None, None) => (16, None, None),
            (None, asked, limit) => (1024, asked, limit),
        };
        let announce = time_limit.is_some() && args.time_limit.is_none();
        Self { spp, noise_threshold, time_limit, announce }
    }
}

/// How to render: the options, where they are silent the scene file, else the defaults.
fn render_options(args: &RenderArgs, settings: &Settings) -> Result<RenderOptions, Failure> {
    let defaults = RenderOptions::default();
    let Resolution { width, height } = match (args.output.resolution, settings.resolution) {
        (Some(resolution), _) => resolution,
        (None, Some((width, height))) => Resolution { width, height },
        (None, None) => Resolution { width: defaults.width, height: defaults.height },
    };
    if let Some(crop) = args.output.crop {
        let inside = |start: u32, size: u32, end: u32| start.checked_add(size).is_some_and(|sum| sum <= end);
        if !inside(crop.x, crop.width, width) || !inside(crop.y, crop.height, height) {
            return Err(Failure::usage(format_args!("--crop: the window leaves the image of {width}x{height}")));
        }
    }
    let file_depth = settings.max_path_edges.map(|edges| edges.saturating_sub(1));
    let effort = Effort::new(&args.quality);
    Ok(RenderOptions {
        width,
        height,
        spp: effort.spp,
        first_sample: args.quality.samples_range.map_or(0, |(first, _)| first),
        noise_threshold: effort.noise_threshold,
        time_limit: effort.time_limit,
        sampler: args.quality.sampler,
        filter: args.quality.filter,
        max_depth: args.quality.max_depth.or(file_depth).unwrap_or(defaults.max_depth),
        seed: args.quality.seed,
        integrator: args.quality.integrator,
        crop: args.output.crop,
        aovs: args.output.aov.as_ref().map_or_else(Vec::new, |list| list.0.clone()),
        clip: Clip {
            bounds: args.scene.clip_box,
            planes: args.scene.clip_plane.iter().map(|p| (p.normal, p.offset)).collect(),
        },
        profile: false,
    })
}

/// What the scene is set up with.
fn stage_options(args: &RenderArgs, render: &RenderOptions, target: &Target) -> Result<StageOptions, Failure> {
    let scene = &args.scene;
    Ok(StageOptions {
        environment: hdri::environment(scene.hdri.as_ref())?,
        environment_rotation: scene.hdri_rotation.to_radians() as f32,
        background: match scene.background_color {
            // A PNG gets the colour as it was asked for: it is put behind the image after tone mapping.
            Some(_) if target.is_png() => Background::Transparent,
            Some(color) => Background::Color(color.linear()),
            None if scene.no_background => Background::Transparent,
            None => Background::Auto,
        },
        effects: args.quality.effects,
        camera: args.camera.view.camera.clone(),
        camera_changes: camera_changes(&args.camera),
        aspect: f64::from(render.width) / f64::from(render.height),
        energy_compensation: args.quality.energy_compensation == Switch::On,
        shadow_terminator: args.quality.shadow_terminator == Switch::On,
        texture_filter: args.quality.texture_filter,
        motion_steps: args.camera.motion_steps,
    })
}

fn camera_changes(args: &CameraArgs) -> CameraChanges {
    CameraChanges { aperture: args.aperture, focus_distance: args.focus_distance, ..view_changes(&args.view) }
}

/// What the options of the camera, but for its lens, change.
pub(crate) fn view_changes(args: &ViewArgs) -> CameraChanges {
    CameraChanges {
        position: args.camera_position,
        focal_point: args.camera_focal_point,
        view_up: args.camera_view_up,
        view_angle: args.camera_view_angle.map(f64::to_radians),
        azimuth: args.camera_azimuth_angle.to_radians(),
        elevation: args.camera_elevation_angle.to_radians(),
        zoom: args.camera_zoom_factor,
        orthographic: args.camera_orthographic,
        ..CameraChanges::default()
    }
}

/// Light is made to look as on a photograph; shares of light keep their value, and other values their number.
fn usual_transform(integrator: IntegratorChoice) -> ViewTransform {
    match integrator {
        IntegratorChoice::AmbientOcclusion | IntegratorChoice::Aov(Aov::Albedo) => ViewTransform::Srgb,
        IntegratorChoice::Aov(_) => ViewTransform::None,
        _ => ViewTransform::PbrNeutral,
    }
}
