//! The part of a render that starts at the lights: for each sample of a picture as many light paths as it has pixels.

use std::collections::TryReserveError;

use firsthit_geometry::clip::ClipRegion;
use rayon::prelude::*;

use crate::camera::{Cone, FilmCamera};
use crate::filter::Filter;
use crate::integrator::forward::Scene;
use crate::integrator::whitted::Limits;
use crate::integrator::{Timing, Tracer};
use crate::kernel::Kernel;
use crate::light::emitters::{Emitters, Endless};
use crate::sampler::{Dimension, PixelSampler};
use crate::splat::{Contribution, Reach, Splats};
use crate::tally::Tally;
use crate::{Crop, LightPaths, RayCounts, RenderOptions, Stage};

/// Paths that one thread follows at a time.
const TASK: u64 = 256;
/// Most contributions that are kept at a time: 20 MB of them.
const ROOM: u64 = 1 << 20;
/// Of so many paths one is timed.
const TIMED: u64 = 61;
/// Branch of the samplers of light paths: their numbers are not those of camera paths.
const LIGHT: u32 = 0x500_0000;

/// Light paths of a picture.
pub(crate) struct Forward {
    /// At each moment that is looked at; empty: nothing ever shines.
    emitters: Vec<Option<Emitters>>,
    splats: Splats,
    reach: Reach,
    /// As many as the whole picture has pixels, whatever part of it is rendered.
    paths: u64,
}

/// What the light paths of one sample did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Done {
    pub(crate) rays: RayCounts,
    pub(crate) timing: Timing,
    pub(crate) light: LightPaths,
    pub(crate) tally: Tally,
    /// Whether paths were left out: the splats are then of no use.
    pub(crate) stopped: bool,
}

impl Done {
    fn and(mut self, other: &Self) -> Self {
        self.rays += other.rays;
        self.timing.add(&other.timing);
        self.light += other.light;
        self.tally += other.tally;
        self.stopped |= other.stopped;
        self
    }
}

/// Why light paths cannot be followed.
pub(crate) enum Refusal {
    Endless,
    Memory,
}

impl From<Endless> for Refusal {
    fn from(_: Endless) -> Self {
        Self::Endless
    }
}

impl From<TryReserveError> for Refusal {
    fn from(_: TryReserveError) -> Self {
        Self::Memory
    }
}

/// Where light starts at each moment.
fn emitters(stage: &Stage) -> Result<Vec<Option<Emitters>>, Endless> {
    let all = stage.moments().iter().map(Emitters::new).collect::<Result<Vec<_>, _>>()?;
    Ok(if all.iter().any(Option::is_some) { all } else { Vec::new() })
}

impl Forward {
    pub(crate) fn new(stage: &Stage, options: &RenderOptions, window: Crop, filter: &Filter) -> Result<Self, Refusal> {
        Ok(Self {
            emitters: emitters(stage)?,
            splats: Splats::new(window)?,
            reach: Reach::new(window, filter.radius()),
            paths: u64::from(options.width) * u64::from(options.height),
        })
    }

    /// Follows the light paths of one sample; what they bring is then in the splats. Between batches of paths it asks
    /// whether to go on.
    pub(crate) fn sample<K: Kernel>(
        &mut self,
        stage: &Stage,
        options: &RenderOptions,
        sample: u32,
        limits: Limits,
        (cameras, cone): (&[FilmCamera], Cone),
        filter: &Filter,
        clip: &ClipRegion<f64>,
        goes_on: &dyn Fn() -> bool,
    ) -> Done {
        self.splats.clear();
        if self.emitters.is_empty() {
            return Done::default();
        }
        // A path contributes at most once at each bounce.
        let at_once = (ROOM / u64::from(limits.bounces.max(1))).max(TASK) / TASK;
        let tasks = self.paths.div_ceil(TASK);
        let mut done = Done::default();
        for first in (0..tasks).step_by(at_once as usize) {
            if first > 0 && !goes_on() {
                done.stopped = true;
                return done;
            }
            let follow = |task: u64| {
                // What this thread counted before belongs to other work.
                let _ = Tally::take();
                let mut tracer = Tracer::<K>::new(stage, clip);
                let mut found: Vec<Contribution> = Vec::new();
                let mut light = LightPaths::default();
                for path in task * TASK..((task + 1) * TASK).min(self.paths) {
                    tracer.timed = path % TIMED == 0;
                    let place = ((path >> 32) as u32, 0);
                    let sampler = PixelSampler::of(options.sampler, options.seed, place, path as u32);
                    let sampler = sampler.branch(LIGHT).branch(sample);
                    let time = if stage.moves() { sampler.get1(Dimension::Time) } else { 0.0 };
                    let (k, moment) = stage.moment(time);
                    let Some(emitters) = &self.emitters[k] else { continue };
                    tracer.stage = moment;
                    let scene = Scene { emitters, camera: &cameras[k], cone, reach: self.reach, limits };
                    light += tracer.light_path(&scene, sampler, &mut found);
                }
                let (rays, timing) = (tracer.counts, tracer.timing);
                (found, Done { rays, timing, light, tally: Tally::take(), stopped: false })
            };
            let (lists, counts): (Vec<_>, Vec<_>) =
                (first..(first + at_once).min(tasks)).into_par_iter().map(follow).unzip();
            done = counts.iter().fold(done, Done::and);
            self.splats.add(&lists, filter, (1.0 / self.paths as f64) as f32);
        }
        done
    }

    /// What they brought.
    pub(crate) fn splats(&self) -> &Splats {
        &self.splats
    }
}
