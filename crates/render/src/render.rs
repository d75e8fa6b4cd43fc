//! The driver: a stage, options, and a picture as the answer.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use firsthit_accel::{Hit, TraversalCounts};
use firsthit_geometry::clip::{ClipRegion, HalfSpace};
use firsthit_geometry::{Aabb, Precision, Ray};
use glam::Vec3;
use rayon::iter::{IndexedParallelIterator, ParallelIterator};

use crate::camera::{Cone, FilmCamera};
use crate::checkpoint::Rest;
use crate::empty::Empty;
use crate::film::{Accumulator, Band};
use crate::filter::Filter;
use crate::forward::{Forward, Refusal};
use crate::integrator::clock::{self, Clock};
use crate::integrator::whitted::{Limits, Seen};
use crate::integrator::{Timing, Tracer};
use crate::kernel::{Clear, Filtered, Full, Kernel, Plain, Textured, TexturedFiltered};
use crate::material::lobes::LobeKind;
use crate::noise::Tiles;
use crate::sampler::{Dimension, PixelSampler};
use crate::splat::Splats;
use crate::tally::Tally;
use crate::{
    Aov, Checkpoint, Clip, EffectPlan, EffectSet, Film, FilterChoice, IntegratorChoice, KernelChoice, LightPaths,
    Monitor, RayCounts, RenderOptions, RenderStats, Stage, Sums, tally, warp,
};

/// Options that no picture can be made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No pixels.
    #[error("the picture cannot be {width} x {height} pixels")]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
    },
    /// No samples.
    #[error("at least one sample per pixel is needed")]
    NoSamples,
    /// The samples asked for do not begin at a block's, or there are none.
    #[error("samples {first} to {end}: a share begins at a multiple of 16 and has at least one")]
    Share {
        /// The first sample asked for.
        first: u32,
        /// The one after the last.
        end: u32,
    },
    /// More samples than [`RenderOptions::MOST_SAMPLES`].
    #[error("{spp} samples per pixel are too many: at most {} are taken", RenderOptions::MOST_SAMPLES)]
    TooManySamples {
        /// How many were asked for.
        spp: u32,
    },
    /// What is to be gone on with is of another picture.
    #[error("the checkpoint is of a picture of another size, window or first sample, or with other pictures beside it")]
    OtherPicture,
    /// Light from infinitely far away is to be followed into a scene that has no end.
    #[error("paths cannot start at a sky or sun where the scene has no end: the integrator 'path' can do it")]
    Endless,
    /// The crop window has no pixel in the picture.
    #[error("the crop window lies outside the picture")]
    EmptyCrop,
    /// The film would take more than [`RenderOptions::MOST_FILM_BYTES`], or more than there is.
    #[error("the picture is too large: it takes {} MiB of memory", bytes.div_ceil(1 << 20))]
    Memory {
        /// What it would take.
        bytes: u64,
    },
}

impl RenderOptions {
    /// Most bytes of a film with all its pictures: some 130 million pixels of colour alone.
    pub const MOST_FILM_BYTES: u64 = 10 << 30;

    /// Most samples of a pixel: what may be asked for as [`RenderOptions::spp`].
    pub const MOST_SAMPLES: u32 = 1 << 24;

    /// Whether they describe a picture. [`render`] checks it too; this is for asking before a scene is prepared.
    ///
    /// # Errors
    /// When they do not: see [`RenderError`].
    pub fn check(&self) -> Result<(), RenderError> {
        let (width, height) = (self.width, self.height);
        if width == 0 || height == 0 {
            return Err(RenderError::Size { width, height });
        }
        if self.spp == 0 {
            return Err(RenderError::NoSamples);
        }
        if self.spp > Self::MOST_SAMPLES {
            return Err(RenderError::TooManySamples { spp: self.spp });
        }
        if !self.first_sample.is_multiple_of(16) || self.first_sample >= self.spp {
            return Err(RenderError::Share { first: self.first_sample, end: self.spp });
        }
        match Film::bytes(width, height, self.crop, &self.aovs) {
            0 => Err(RenderError::EmptyCrop),
            bytes if bytes > Self::MOST_FILM_BYTES => Err(RenderError::Memory { bytes }),
            _ => Ok(()),
        }
    }
}

/// A finished render, or as much of it as was done when it was cancelled.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture and those beside it.
    pub film: Film,
    /// What was done.
    pub stats: RenderStats,
    /// The stage's plan with what each effect cost.
    pub effects: EffectPlan,
    /// Whether it was cancelled: the film then has fewer samples, but all of the picture if one pass was finished.
    pub interrupted: bool,
    /// Whether the time was up before all samples were taken, or all tiles were as good as wanted.
    pub out_of_time: bool,
    rest: Rest,
}

impl Rendered {
    /// All that has been summed, and where the render would go on.
    #[must_use]
    pub fn sums(&self) -> Sums<'_> {
        Sums { film: &self.film, rest: &self.rest }
    }
}

/// No path has more bounces, whatever is asked for: between perfect mirrors it would never end.
const MOST_BOUNCES: u32 = 1024;
/// Rows of a band, the unit of work of a thread.
const BAND: u32 = 4;
/// Columns of a band between two looks at the clock and at what the monitor wants: fewer pixels than a row has.
const STRIP: u32 = 8;
/// Of so many pixels one is timed; with [`RenderOptions::profile`] more.
const TIMED: u32 = 61;
const PROFILED: u32 = 7;
/// Textures are averaged over this share of a pixel: the samples of a pixel average the rest.
const FOOTPRINT: f64 = 0.5;

/// Renders a stage, in parallel on the caller's rayon pool.
///
/// The same stage, options and seed give the same bits for any number of threads: every sample is a pure function of
/// seed, pixel and sample number, and each pixel adds up its own. Samples are taken in passes over the whole picture
/// (1, 3, 12, then 16 each), so that a cancelled render is a picture with fewer samples. With a noise threshold, tiles
/// are judged between passes; a crop window that cuts tiles judges their parts. Only a time limit makes the number of
/// samples depend on the machine.
///
/// # Errors
/// When the options describe no picture: see [`RenderError`].
pub fn render<M: Monitor + ?Sized>(
    stage: &Stage,
    options: &RenderOptions,
    monitor: &M,
) -> Result<Rendered, RenderError> {
    render_from(stage, options, None, monitor)
}

/// Goes on with a render that was put aside, with the same stage and options but for how many samples are taken: in the
/// end the bits are those of a render without a pause. A smaller noise threshold takes up all tiles again.
///
/// # Errors
/// When the options describe no picture, or the checkpoint is of another one.
pub fn render_from<M: Monitor + ?Sized>(
    stage: &Stage,
    options: &RenderOptions,
    start: Option<Checkpoint>,
    monitor: &M,
) -> Result<Rendered, RenderError> {
    // So that the kernels are compiled here, and once.
    render_watched(stage, options, start, &Watched(monitor))
}

fn render_watched(
    stage: &Stage,
    options: &RenderOptions,
    start: Option<Checkpoint>,
    monitor: &dyn Monitor,
) -> Result<Rendered, RenderError> {
    options.check()?;
    let RenderOptions { width, height, crop, ref aovs, .. } = *options;
    let mut film = Film::new(width, height, crop, aovs)
        .map_err(|_| RenderError::Memory { bytes: Film::bytes(width, height, crop, aovs) })?;
    let mut tiles = Tiles::new(film.window());
    let mut rest = Rest { first: options.first_sample, pass: options.first_sample, ..Rest::default() };
    if let Some(start) = start {
        let same = start.film.size() == film.size() && start.film.window() == film.window();
        if !same || start.film.aovs() != film.aovs() || start.rest.first != options.first_sample {
            return Err(RenderError::OtherPicture);
        }
        film = start.film;
        if start.rest.threshold == options.noise_threshold {
            tiles.set_active(&start.rest.active);
            rest.pass = start.rest.pass;
        } else {
            // The tile with the fewest samples says where.
            let least = film.records().map(Accumulator::count).min().unwrap_or(0);
            rest.pass = last_pass(options.first_sample + least);
            judge(&mut tiles, &film, options, rest.pass);
        }
    }
    rest.threshold = options.noise_threshold;
    let start = Instant::now();
    // Chosen once: the rest is compiled for what the scene calls for.
    let job = Job::new(stage, options, &film);
    let mut forward = match job.method {
        Method::Forward(_) => Some(Forward::new(stage, options, film.window(), &job.filter).map_err(|e| match e {
            Refusal::Endless => RenderError::Endless,
            Refusal::Memory => RenderError::Memory { bytes: Film::bytes(width, height, crop, aovs) },
        })?),
        _ => None,
    };
    let run = match stage.kernel() {
        KernelChoice::Plain => Job::run::<Plain>,
        KernelChoice::Textured => Job::run::<Textured>,
        KernelChoice::Filtered => Job::run::<Filtered>,
        KernelChoice::TexturedFiltered => Job::run::<TexturedFiltered>,
        KernelChoice::Clear => Job::run::<Clear>,
        KernelChoice::Full => Job::run::<Full>,
    };
    let (done, end) = run(&job, &mut film, &mut tiles, &mut rest, forward.as_mut(), monitor);
    let effects = planned(stage, options).with_costs(&done.rays, &done.tally, |kind| done.timing.seconds_per_ray(kind));
    let stats = RenderStats {
        rays: done.rays,
        samples: done.samples,
        bad_samples: done.bad,
        light: done.light,
        noise: tiles.most(&film),
        seconds: start.elapsed().as_secs_f64(),
        breakdown: done.timing.parts.breakdown(done.timing.traversal(), clock::look()),
    };
    let (interrupted, out_of_time) = (end == End::Cancelled, end == End::OutOfTime);
    Ok(Rendered { film, stats, effects, interrupted, out_of_time, rest })
}

/// The stage's plan as a render with these options follows it: not every integrator simulates all effects, and some are
/// asked for here.
pub(crate) fn planned(stage: &Stage, options: &RenderOptions) -> EffectPlan {
    let mut plan = stage.plan().clone();
    match options.integrator {
        IntegratorChoice::Auto | IntegratorChoice::Path => {}
        IntegratorChoice::Light => plan.leave(EffectSet::FOG),
        IntegratorChoice::Whitted
        | IntegratorChoice::Direct
        | IntegratorChoice::AmbientOcclusion
        | IntegratorChoice::Aov(_) => plan.leave(EffectSet::FOG | EffectSet::INDIRECT_LIGHT),
    }
    if !region(&options.clip).is_all() {
        plan.ask(EffectSet::CLIPPING, "the section asked for");
    }
    if options.integrator == IntegratorChoice::AmbientOcclusion {
        plan.ask(EffectSet::AMBIENT_OCCLUSION, "the integrator");
    }
    plan
}

/// A monitor of whatever kind.
struct Watched<'a, M: ?Sized>(&'a M);

impl<M: Monitor + ?Sized> Monitor for Watched<'_, M> {
    fn progress(&self, done: u64, total: u64, rays: u64) {
        self.0.progress(done, total, rays);
    }

    fn wants_checkpoint(&self) -> bool {
        self.0.wants_checkpoint()
    }

    fn checkpoint(&self, sums: &Sums<'_>) {
        self.0.checkpoint(sums);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Why a render ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Done,
    Cancelled,
    OutOfTime,
}

/// What was done, by a band or by all.
#[derive(Clone, Copy, Debug, Default)]
struct Done {
    rays: RayCounts,
    tally: Tally,
    timing: Timing,
    samples: u64,
    bad: u64,
    light: LightPaths,
    /// Whether something was left out because time was up.
    late: bool,
    /// Whether something was left for later, so that a checkpoint can be made.
    paused: bool,
}

impl Done {
    fn and(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.tally += other.tally;
        self.timing.add(&other.timing);
        self.samples += other.samples;
        self.bad += other.bad;
        self.light += other.light;
        self.late |= other.late;
        self.paused |= other.paused;
        self
    }
}

/// How a camera ray is answered.
#[derive(Clone, Copy, Debug)]
enum Method {
    /// All light by paths that follow these lobes.
    Path(LobeKind),
    /// All light by paths from the lights; the camera's follow these lobes where it sees mirrors.
    Forward(LobeKind),
    /// Light by Whitted's method, following these lobes.
    Light(LobeKind),
    /// Ambient occlusion within a distance.
    Occlusion(f64),
    /// A picture of values; depths are compared with a distance.
    Values(Aov, f32),
}

/// A sample that was begun.
struct Shot {
    pixel: (u32, u32),
    sampler: PixelSampler,
    /// Where in the picture, 0 to 1 from the upper left.
    screen: [f32; 2],
    /// Whether its rays are timed.
    timed: bool,
    /// How long it took to begin it, if all of it is timed.
    begun: Option<Duration>,
}

/// Samples that were begun and have the same way to go at first.
#[derive(Default)]
struct Shots {
    list: Vec<Shot>,
    rays: Vec<Ray<f64>>,
    /// What the rays meet.
    hits: Vec<Option<Hit>>,
}

impl Shots {
    fn push(&mut self, shot: Shot, ray: Ray<f64>) {
        self.list.push(shot);
        self.rays.push(ray);
    }

    /// Some packets of rays, and few enough to stay in the nearest cache.
    fn are_many(&self) -> bool {
        self.list.len() >= 64
    }
}

/// Everything that all samples of a render share.
struct Job<'a> {
    stage: &'a Stage,
    options: &'a RenderOptions,
    aovs: Vec<Aov>,
    camera: FilmCamera,
    /// The same at each moment that is looked at.
    cameras: Vec<FilmCamera>,
    cone: Cone,
    filter: Filter,
    clip: ClipRegion<f64>,
    method: Method,
    /// Where the camera meets nothing, if that is known.
    empty: Option<Empty>,
    /// All that it sees there is the same.
    even: bool,
    /// When time is up.
    deadline: Option<Instant>,
}

impl<'a> Job<'a> {
    fn new(stage: &'a Stage, options: &'a RenderOptions, film: &Film) -> Self {
        let camera = stage.camera().on_film(options.width, options.height);
        let cameras = stage.moments().iter().map(|m| m.camera.on_film(options.width, options.height)).collect();
        let cone = camera.cone();
        let simulated = stage.plan().simulated();
        let extent = stage.accel.bounds().extent();
        let size = if extent.is_finite() && extent.max_element() > 0.0 { extent.length() } else { 1.0 };
        let mut follow = LobeKind::empty();
        follow.set(LobeKind::REFLECTION, simulated.contains(EffectSet::REFLECTION));
        let through = EffectSet::REFRACTION | EffectSet::TRANSMISSION | EffectSet::DIFFUSE_TRANSMISSION;
        follow.set(LobeKind::TRANSMISSION, simulated.intersects(through));
        let method = match options.integrator {
            IntegratorChoice::Auto | IntegratorChoice::Path => {
                follow.set(LobeKind::DIFFUSE, simulated.contains(EffectSet::INDIRECT_LIGHT));
                Method::Path(follow)
            }
            IntegratorChoice::Light => {
                follow.set(LobeKind::DIFFUSE, simulated.contains(EffectSet::INDIRECT_LIGHT));
                Method::Forward(follow)
            }
            IntegratorChoice::Whitted => Method::Light(follow),
            IntegratorChoice::Direct => Method::Light(LobeKind::empty()),
            IntegratorChoice::AmbientOcclusion => Method::Occlusion(0.25 * size),
            IntegratorChoice::Aov(aov) => {
                let focus = (stage.camera().focal_point() - stage.camera().position()).length();
                Method::Values(aov, if focus > 0.0 { focus as f32 } else { size as f32 })
            }
        };
        let filter = match options.filter {
            FilterChoice::Auto if stage.reference => Filter::Box,
            FilterChoice::Box => Filter::Box,
            FilterChoice::Auto | FilterChoice::BlackmanHarris => Filter::blackman_harris(),
        };
        let aovs: Vec<Aov> = film.sampled().collect();
        let paths = matches!(method, Method::Path(_) | Method::Forward(_));
        // `Fast` is to show what it takes for hits.
        let strict = stage.accel.options().precision != Precision::Fast;
        let empty = (paths && strict && !stage.moves() && !aovs.contains(&Aov::Heat))
            .then(|| Empty::new(&stage.world, &camera, film.size(), filter.radius()))
            .flatten();
        let even = stage.fog.is_none() && !stage.lights.area.has_own() && stage.background_is_even();
        Self {
            stage,
            options,
            aovs,
            camera,
            cameras,
            cone: Cone { width: cone.width * FOOTPRINT, spread: cone.spread * FOOTPRINT },
            filter,
            empty,
            even,
            clip: region(&options.clip),
            method,
            // A limit beyond all time is none.
            deadline: options.time_limit.and_then(|limit| Instant::now().checked_add(limit)),
        }
    }

    /// Renders in passes until done, good enough, cancelled or out of time.
    fn run<K: Kernel>(
        &self,
        film: &mut Film,
        tiles: &mut Tiles,
        rest: &mut Rest,
        mut forward: Option<&mut Forward>,
        monitor: &dyn Monitor,
    ) -> (Done, End) {
        let window = film.window();
        let bands = u64::from(window.height.div_ceil(BAND));
        let total = bands * u64::from(self.options.spp.saturating_sub(rest.pass));
        let (finished, rays) = (AtomicU64::new(0), AtomicU64::new(0));
        let mut done = Done::default();
        rest.active = tiles.active().to_vec();
        while rest.pass < self.options.spp && tiles.any() {
            let first = rest.pass;
            let mut last = next_pass(first).min(self.options.spp);
            if let Some(forward) = &mut forward {
                if self.is_late(first) {
                    return (done, End::OutOfTime);
                }
                // Light paths are followed for one sample of all pixels at a time.
                last = first + 1;
                let of_camera = (self.cameras.as_slice(), self.cone);
                let limits = self.limits();
                // Until the light paths are all followed, nothing of this sample is in the film.
                let sums = Sums { film, rest };
                let goes_on = || {
                    if monitor.cancelled() || self.is_late(first) {
                        return false;
                    }
                    if monitor.wants_checkpoint() {
                        monitor.checkpoint(&sums);
                    }
                    true
                };
                let paths = forward.sample::<K>(
                    self.stage,
                    self.options,
                    first,
                    limits,
                    of_camera,
                    &self.filter,
                    &self.clip,
                    &goes_on,
                );
                done = done.and(Done {
                    rays: paths.rays,
                    timing: paths.timing,
                    light: paths.light,
                    tally: paths.tally,
                    ..Done::default()
                });
                if monitor.cancelled() {
                    return (done, End::Cancelled);
                }
                if paths.stopped {
                    return (done, End::OutOfTime);
                }
            }
            let splats = forward.as_deref().map(Forward::splats);
            let mut whole = true;
            let complete: Vec<AtomicBool> = (0..bands).map(|_| AtomicBool::new(false)).collect();
            // Once, or with pauses for checkpoints.
            loop {
                let part = film
                    .par_bands_mut(BAND)
                    .zip(&complete)
                    .filter(|(_, complete)| !complete.load(Ordering::Relaxed))
                    .map(|(mut band, complete)| {
                        let clock = Clock::default();
                        let mut tracer = Tracer::<K>::new(self.stage, &self.clip);
                        tracer.wants_first = !self.aovs.is_empty();
                        if matches!(self.method, Method::Path(_)) {
                            tracer.fog = self.stage.fog.as_ref();
                        }
                        let band_done = self.band(&mut tracer, &clock, &mut band, first..last, tiles, splats, monitor);
                        complete.store(!band_done.paused, Ordering::Relaxed);
                        let new = if band_done.paused { 0 } else { u64::from(last - first) };
                        let finished = finished.fetch_add(new, Ordering::Relaxed) + new;
                        let rays = rays.fetch_add(band_done.rays.total(), Ordering::Relaxed) + band_done.rays.total();
                        monitor.progress(finished, total, rays);
                        band_done
                    })
                    .reduce(Done::default, Done::and);
                whole &= !part.late;
                let paused = part.paused;
                done = done.and(Done { paused: false, ..part });
                if monitor.cancelled() {
                    return (done, End::Cancelled);
                }
                if monitor.wants_checkpoint() {
                    monitor.checkpoint(&Sums { film, rest });
                }
                if !paused {
                    break;
                }
            }
            if !whole {
                return (done, End::OutOfTime);
            }
            rest.pass = last;
            judge(tiles, film, self.options, last);
            rest.active = tiles.active().to_vec();
            if self.is_late(last) && last < self.options.spp && tiles.any() {
                return (done, End::OutOfTime);
            }
        }
        (done, End::Done)
    }

    /// How far and along what paths are followed.
    fn limits(&self) -> Limits {
        let follow = match self.method {
            Method::Path(follow) | Method::Forward(follow) | Method::Light(follow) => follow,
            Method::Occlusion(_) | Method::Values(..) => LobeKind::empty(),
        };
        let mirrors = matches!(self.method, Method::Forward(_));
        Limits { bounces: self.options.max_depth.min(MOST_BOUNCES), follow, mirrors }
    }

    /// Whether time is up for samples from this one on; every pixel gets the first.
    fn is_late(&self, first: u32) -> bool {
        first > self.options.first_sample && self.deadline.is_some_and(|end| Instant::now() >= end)
    }

    fn band<'b, K: Kernel>(
        &'b self,
        tracer: &mut Tracer<'b, K>,
        clock: &'b Clock,
        band: &mut Band<'_>,
        samples: std::ops::Range<u32>,
        tiles: &Tiles,
        splats: Option<&Splats>,
        monitor: &dyn Monitor,
    ) -> Done {
        let mut done = Done::default();
        let (mut shots, mut sky) = (Shots::default(), None);
        // What was done before on this thread is of others.
        let _ = Tally::take();
        // Pixels beside and below each other go together: they see the same part of the tree and the same texels.
        let (columns, rows) = (band.columns(), band.rows());
        for left in columns.clone().step_by(STRIP as usize) {
            done.late = self.is_late(samples.start);
            // A strip at least is done between two checkpoints, however often they are wanted.
            done.paused = done.samples > 0 && monitor.wants_checkpoint();
            if done.late || done.paused || monitor.cancelled() {
                break;
            }
            for x in left..left.saturating_add(STRIP).min(columns.end) {
                for y in rows.clone() {
                    if !tiles.is_active(x, y) {
                        continue;
                    }
                    // What a pixel has it need not get again.
                    let from = self.options.first_sample + band.pixel(x, y)[0].count();
                    let samples = samples.start.max(from)..samples.end;
                    if self.empty.as_ref().is_some_and(|empty| empty.at(x, y)) {
                        done.samples += u64::from(samples.end.saturating_sub(samples.start));
                        done.bad += self.behind(tracer, band.pixel(x, y), (x, y), samples, splats, &mut sky);
                        continue;
                    }
                    let profiled = self.options.profile && matches!(self.method, Method::Path(_));
                    let place = x.wrapping_mul(31).wrapping_add(y.wrapping_mul(17));
                    let timed = place.is_multiple_of(if profiled { PROFILED } else { TIMED });
                    tracer.clock = Some(clock).filter(|_| profiled && timed);
                    let sampler = self.sampler((x, y));
                    for sample in samples {
                        let started = tracer.clock.map(|_| Instant::now());
                        let (mut shot, ray) = self.shot(tracer, (x, y), sampler.at(sample), timed);
                        shot.begun = started.map(|s| s.elapsed());
                        shots.push(shot, ray);
                        if shots.are_many() {
                            done.bad += self.shoot(tracer, clock, band, &mut shots, splats);
                        }
                        done.samples += 1;
                    }
                }
            }
        }
        done.bad += self.shoot(tracer, clock, band, &mut shots, splats);
        done.rays = tracer.counts;
        done.tally = Tally::take();
        done.timing = tracer.timing;
        done.timing.parts.add(&clock.parts());
        done
    }

    /// The sample points of a pixel, for its first sample.
    #[inline]
    fn sampler(&self, pixel: (u32, u32)) -> PixelSampler {
        PixelSampler::of(self.options.sampler, self.options.seed, pixel, 0)
    }

    /// Begins a sample: its ray.
    #[inline]
    fn shot<K: Kernel>(
        &self,
        tracer: &Tracer<'_, K>,
        (x, y): (u32, u32),
        sampler: PixelSampler,
        timed: bool,
    ) -> (Shot, Ray<f64>) {
        let [dx, dy] = self.filter.offset(tracer.draw2(&sampler, Dimension::Pixel));
        let at = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
        let mut camera = &self.camera;
        if K::RARE && self.stage.moves() {
            camera = &self.cameras[self.stage.moment(tracer.draw1(&sampler, Dimension::Time)).0];
        }
        let ray = if K::RARE && camera.has_lens() {
            tally::sample(EffectSet::DEPTH_OF_FIELD);
            let on_lens = warp::disk(tracer.draw2(&sampler, Dimension::Lens));
            camera.ray_through_lens(at, on_lens.as_dvec2().to_array())
        } else {
            camera.ray(at)
        };
        let screen = [(at[0] / f64::from(self.options.width)) as f32, (at[1] / f64::from(self.options.height)) as f32];
        (Shot { pixel: (x, y), sampler, screen, timed, begun: None }, ray)
    }

    /// Takes the samples that were begun, in their order; the answer: how many of them were no light.
    fn shoot<'b, K: Kernel>(
        &'b self,
        tracer: &mut Tracer<'b, K>,
        clock: &'b Clock,
        band: &mut Band<'_>,
        shots: &mut Shots,
        splats: Option<&Splats>,
    ) -> u64 {
        let mut bad = 0;
        let mut each = Duration::ZERO;
        shots.hits.clear();
        shots.hits.resize(shots.list.len(), None);
        let (moves, paths) =
            (K::RARE && self.stage.moves(), matches!(self.method, Method::Path(_) | Method::Forward(_)));
        if paths && !moves {
            // Camera rays go the same way: together.
            let timed = shots.list.iter().filter(|s| s.timed).count() as u64;
            each = tracer.camera_hits(&shots.rays, &mut shots.hits, timed);
        }
        for ((shot, ray), hit) in shots.list.iter().zip(&shots.rays).zip(&shots.hits) {
            tracer.timed = shot.timed;
            tracer.clock = shot.begun.map(|_| clock);
            let started = shot.begun.map(|begun| (begun + each, Instant::now()));
            let mut hit = *hit;
            if moves {
                tally::sample(EffectSet::MOTION);
                tracer.stage = self.stage.moment(tracer.draw1(&shot.sampler, Dimension::Time)).1;
                hit = if paths { tracer.closest(crate::RayKind::Camera, ray, None) } else { None };
            }
            let (x, y) = shot.pixel;
            bad += u64::from(!self.sample(tracer, band.pixel(x, y), shot, *ray, hit, splats));
            if let Some((before, started)) = started {
                tracer.timing.parts.whole.note(before + started.elapsed());
            }
        }
        shots.list.clear();
        shots.rays.clear();
        bad
    }

    /// Takes samples of a pixel where there is nothing but what is behind all; the answer: how many were no light. What
    /// looks the same everywhere is looked at once, for `sky`.
    fn behind<K: Kernel>(
        &self,
        tracer: &mut Tracer<'_, K>,
        pixel: &mut [Accumulator],
        at: (u32, u32),
        samples: std::ops::Range<u32>,
        splats: Option<&Splats>,
        sky: &mut Option<Seen>,
    ) -> u64 {
        tracer.timed = false;
        tracer.clock = None;
        let first = self.sampler(at);
        let mut look = |sample| {
            let (shot, ray) = self.shot(tracer, at, first.at(sample), false);
            let mut seen = self.look(tracer, &shot, ray, None);
            add_splats(&mut seen, splats, at);
            seen
        };
        let mut bad = 0;
        if self.even && splats.is_none() {
            let count = samples.len() as u32;
            let seen = sky.get_or_insert_with(|| look(samples.start));
            return u64::from(self.keep(pixel, seen, TraversalCounts::default(), count));
        }
        for sample in samples {
            bad += u64::from(self.keep(pixel, &look(sample), TraversalCounts::default(), 1));
        }
        bad
    }

    /// Takes one sample; false if its numbers were no light.
    fn sample<K: Kernel>(
        &self,
        tracer: &mut Tracer<'_, K>,
        pixel: &mut [Accumulator],
        shot: &Shot,
        ray: Ray<f64>,
        hit: Option<Hit>,
        splats: Option<&Splats>,
    ) -> bool {
        let mut seen = self.look(tracer, shot, ray, hit);
        add_splats(&mut seen, splats, shot.pixel);
        let heat = self.aovs.contains(&Aov::Heat) || matches!(self.method, Method::Values(Aov::Heat, _));
        let cost = if heat { tracer.stage.accel.closest_hit_counted(&ray).1 } else { TraversalCounts::default() };
        if let (Method::Values(aov, far), Some(first)) = (self.method, &seen.first) {
            seen.color = first.shown(aov, cost, far);
        }
        self.keep(pixel, &seen, cost, 1) == 0
    }

    /// What a sample sees.
    #[inline]
    fn look<K: Kernel>(
        &self,
        tracer: &mut Tracer<'_, K>,
        &Shot { sampler, screen, .. }: &Shot,
        ray: Ray<f64>,
        hit: Option<Hit>,
    ) -> Seen {
        match self.method {
            Method::Path(_) | Method::Forward(_) => tracer.path(ray, hit, self.cone, screen, sampler, self.limits()),
            Method::Light(_) => tracer.radiance(ray, self.cone, screen, sampler, self.limits()),
            Method::Occlusion(reach) => tracer.ambient_occlusion(ray, reach, sampler),
            Method::Values(..) => tracer.values(ray, self.cone),
        }
    }

    /// Adds what some samples saw, all the same, to their pixel; the answer: how many of them were no light.
    #[inline]
    fn keep(&self, pixel: &mut [Accumulator], seen: &Seen, cost: TraversalCounts, times: u32) -> u32 {
        let good = is_light(seen);
        let (color, alpha) = if good { (seen.color, seen.alpha) } else { (Vec3::ZERO, 1.0) };
        pixel[0].add_times([color.x, color.y, color.z, alpha.clamp(0.0, 1.0)], times);
        for (i, aov) in self.aovs.iter().enumerate() {
            let value = seen.first.as_ref().map_or([0.0; 4], |first| first.value(*aov, cost).extend(1.0).to_array());
            pixel[1 + i].add_times(if value.iter().all(|v| v.is_finite()) { value } else { [0.0; 4] }, times);
        }
        if good { 0 } else { times }
    }
}

/// Leaves tiles alone that are good enough once all samples before this one are taken. Only whole blocks are judged, as
/// they are in a render that has no pause here.
fn judge(tiles: &mut Tiles, film: &Film, options: &RenderOptions, samples: u32) {
    if let Some(threshold) = options.noise_threshold.filter(|_| samples.is_multiple_of(16)) {
        tiles.judge(film, threshold, samples.saturating_sub(options.first_sample));
    }
}

/// The sample after the last of the pass that begins with this one.
fn next_pass(first: u32) -> u32 {
    match first {
        0 => 1,
        1..4 => 4,
        n => (n / 16 + 1).saturating_mul(16),
    }
}

/// The first sample of the pass that this one is in.
fn last_pass(sample: u32) -> u32 {
    match sample {
        0 => 0,
        1..4 => 1,
        4..16 => 4,
        n => n / 16 * 16,
    }
}

/// What the lights' own paths bring to a pixel.
fn add_splats(seen: &mut Seen, splats: Option<&Splats>, (x, y): (u32, u32)) {
    if let Some(splats) = splats {
        seen.color += splats.at(x, y);
    }
}

/// Whether a sample is light: finite and not negative.
fn is_light(seen: &Seen) -> bool {
    seen.color.is_finite() && seen.color.cmpge(Vec3::ZERO).all() && seen.alpha.is_finite()
}

/// The part of space that is shown.
fn region(clip: &Clip) -> ClipRegion<f64> {
    ClipRegion {
        bounds: clip.bounds.map(|(a, b)| Aabb::new(a.min(b), a.max(b))),
        half_spaces: clip.planes.iter().map(|(normal, offset)| HalfSpace::new(*normal, *offset)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Crop;

    #[test]
    fn samples_are_limited() {
        let check = |first_sample, spp| RenderOptions { first_sample, spp, ..Default::default() }.check();
        assert_eq!(check(0, RenderOptions::MOST_SAMPLES), Ok(()));
        let spp = u32::MAX;
        assert_eq!(check(u32::MAX - 15, spp), Err(RenderError::TooManySamples { spp }));
        assert!(next_pass(u32::MAX) == u32::MAX && next_pass(u32::MAX - 15) == u32::MAX);
    }

    #[test]
    fn memory_is_limited_for_all_pictures_together() {
        let check = |aovs: &[Aov], crop| {
            RenderOptions { width: 1 << 14, height: 1 << 13, crop, aovs: aovs.to_vec(), ..Default::default() }.check()
        };
        assert_eq!(check(&[], None), Ok(()));
        assert!(matches!(check(&[Aov::Depth], None), Err(RenderError::Memory { bytes }) if bytes > 8 << 30));
        // A poster may be rendered in parts.
        assert_eq!(check(&Aov::ALL, Some(Crop { x: 0, y: 0, width: 1 << 14, height: 64 })), Ok(()));
    }
}
