//! What each effect buys and costs: a stage rendered small with all of its effects, and without each of them in turn.

use std::sync::Arc;

use crate::render::{planned, render};
use crate::{
    EffectOverrides, EffectSet, Film, IntegratorChoice, Monitor, RenderError, RenderOptions, Stage, StageError,
    StageOptions,
};

/// How ablations are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AblateOptions {
    /// Width of the pictures: the height follows from the picture that is asked for. Never larger than that one.
    pub width: u32,
    /// Samples of a pixel.
    pub spp: u32,
    /// How often each picture without an effect is timed, and the whole one beside it; the median counts. At least 1.
    pub repetitions: u32,
}

impl Default for AblateOptions {
    fn default() -> Self {
        Self { width: 160, spp: 32, repetitions: 3 }
    }
}

/// One effect, taken away.
#[derive(Clone, Debug, PartialEq)]
pub struct Ablation {
    /// The effect: one bit.
    pub effect: EffectSet,
    /// Its name, as in [`EffectSet::NAMES`].
    pub name: &'static str,
    /// How much the picture changes: the root of the mean squared difference of linear red, green and blue.
    pub rmse: f64,
    /// `rmse` over the root mean square of the whole picture; NaN for a black one.
    pub relative: f64,
    /// Wall-clock seconds of the render without it: median.
    pub seconds: f64,
    /// Seconds of the render with all effects less those without this one, each taken just before it: median.
    pub saved: f64,
    /// The picture without it.
    pub film: Film,
}

/// A stage without each of its effects.
#[derive(Clone, Debug, PartialEq)]
pub struct Ablations {
    /// Width of the pictures.
    pub width: u32,
    /// Height of the pictures.
    pub height: u32,
    /// Samples of a pixel.
    pub spp: u32,
    /// How often each picture without an effect was timed.
    pub repetitions: u32,
    /// Wall-clock seconds with all effects: median.
    pub seconds: f64,
    /// How much the whole picture changes by nothing but other random numbers, as [`Ablation::rmse`]. Less than about
    /// this may be noise; an effect that changes nothing at all gives 0, since all pictures take the same numbers.
    pub noise: f64,
    /// The effects that are simulated, in the order of [`EffectSet::NAMES`].
    pub effects: Vec<Ablation>,
    /// The whole picture.
    pub film: Film,
}

/// Why there are no ablations.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AblateError {
    /// A stage cannot be made.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The options describe no picture.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The monitor cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// Renders a stage with all of its effects and without each, in turn, on the caller's rayon pool.
///
/// `options` is the picture that is asked for: its camera's shape, depth, seed, integrator and section count; how fine it
/// is, `how` says. `setup` is what the stage was made with. Before each picture without an effect the whole one is rendered
/// again, so that what disturbs the machine disturbs both alike.
///
/// # Errors
/// When a picture cannot be made, or the monitor cancels.
pub fn ablate<M: Monitor + ?Sized>(
    stage: &Stage,
    setup: &StageOptions,
    options: &RenderOptions,
    how: &AblateOptions,
    monitor: &M,
) -> Result<Ablations, AblateError> {
    options.check()?;
    let options = small(options, how);
    let simulated = removable(stage, &options);
    let ways: Vec<_> = EffectSet::NAMES.into_iter().filter(|(effect, _)| simulated.contains(*effect)).collect();
    // Cutting is no matter of the stage.
    let cut = |effect| match effect {
        EffectSet::CLIPPING => RenderOptions { clip: crate::Clip::default(), ..options.clone() },
        _ => options.clone(),
    };
    let repetitions = how.repetitions.max(1);
    let total = 2 * u64::from(repetitions) * ways.len() as u64 + 2;
    let mut done = 0;
    let mut timed = |stage: &Stage, options: &RenderOptions| {
        if monitor.cancelled() {
            return Err(AblateError::Cancelled);
        }
        let rendered = render(stage, options, &Cancels(monitor))?;
        if rendered.interrupted {
            return Err(AblateError::Cancelled);
        }
        done += 1;
        monitor.progress(done, total, rendered.stats.rays.total());
        Ok((rendered.stats.seconds, rendered.film))
    };
    // Other numbers, unmeasured: caches are warm afterwards.
    let (_, other) = timed(stage, &RenderOptions { seed: options.seed.wrapping_add(1), ..options.clone() })?;
    let (first, film) = timed(stage, &options)?;
    let mut whole = vec![first];
    let size = root_mean_square(&film, None);
    let mut effects = Vec::new();
    for (effect, name) in ways {
        if monitor.cancelled() {
            return Err(AblateError::Cancelled);
        }
        // One at a time: each has images and lights of its own.
        let other = without(stage, setup, effect)?;
        let (mut seconds, mut saved, mut last) = (Vec::new(), Vec::new(), None);
        for _ in 0..repetitions {
            let (with, _) = timed(stage, &options)?;
            let (without, film) = timed(&other, &cut(effect))?;
            whole.push(with);
            seconds.push(without);
            saved.push(with - without);
            last = Some(film);
        }
        let Some(without) = last else { continue };
        let rmse = root_mean_square(&film, Some(&without));
        effects.push(Ablation {
            effect,
            name,
            rmse,
            relative: rmse / size,
            seconds: median(seconds),
            saved: median(saved),
            film: without,
        });
    }
    Ok(Ablations {
        width: options.width,
        height: options.height,
        spp: options.spp,
        repetitions,
        effects,
        seconds: median(whole),
        noise: root_mean_square(&film, Some(&other)),
        film,
    })
}

/// The same picture, small and with a fixed number of samples.
fn small(options: &RenderOptions, how: &AblateOptions) -> RenderOptions {
    let width = how.width.clamp(1, options.width);
    let height = f64::from(options.height) * f64::from(width) / f64::from(options.width);
    RenderOptions {
        width,
        height: (height.round() as u32).max(1),
        spp: how.spp.max(1),
        first_sample: 0,
        noise_threshold: None,
        time_limit: None,
        crop: None,
        aovs: Vec::new(),
        ..options.clone()
    }
}

/// What a render of the stage simulates, but for what it is a picture of.
fn removable(stage: &Stage, options: &RenderOptions) -> EffectSet {
    let mut effects = planned(stage, options).simulated();
    if options.integrator == IntegratorChoice::AmbientOcclusion {
        effects.remove(EffectSet::AMBIENT_OCCLUSION);
    }
    effects
}

/// The same stage without an effect.
fn without(stage: &Stage, setup: &StageOptions, effect: EffectSet) -> Result<Stage, StageError> {
    let effects = EffectOverrides { remove: setup.effects.remove | effect, ..setup.effects };
    Stage::new(Arc::clone(stage.scene()), stage.accel.clone(), &StageOptions { effects, ..setup.clone() })
}

/// Asks one monitor whether to go on, and tells it nothing.
struct Cancels<'a, M: ?Sized>(&'a M);

impl<M: Monitor + ?Sized> Monitor for Cancels<'_, M> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Of the difference of two pictures, or of one.
fn root_mean_square(a: &Film, b: Option<&Film>) -> f64 {
    let (a, b) = (a.color(), b.map(Film::color));
    let mut sum = 0.0;
    for (i, p) in a.pixels.iter().enumerate() {
        let other = b.as_ref().map_or([0.0; 4], |b| b.pixels[i]);
        for (x, y) in p.iter().zip(other).take(3) {
            let d = f64::from(*x) - f64::from(y);
            sum += d * d;
        }
    }
    (sum / (3 * a.pixels.len()) as f64).sqrt()
}

fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    let middle = seconds.len() / 2;
    match seconds.len() % 2 {
        0 => seconds[middle.saturating_sub(1)..=middle].iter().sum::<f64>() / 2.0,
        _ => seconds[middle],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_few() {
        assert_eq!(median(vec![3.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0]), 2.5);
        assert_eq!(median(vec![9.0, 1.0, 2.0]), 2.0);
    }

    #[test]
    fn pictures_keep_their_shape() {
        let wanted = RenderOptions { width: 1280, height: 720, ..RenderOptions::default() };
        let of = |width| small(&wanted, &AblateOptions { width, ..AblateOptions::default() });
        assert_eq!((of(160).width, of(160).height), (160, 90));
        assert_eq!((of(5000).width, of(5000).height), (1280, 720));
        assert_eq!((of(0).width, of(0).height), (1, 1));
    }
}
