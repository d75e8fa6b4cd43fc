//! Counting what is done for each effect, apart from rays: deep inside materials and lights, by thread.
//!
//! One addition to memory of the thread's own is little beside a look-up of a texture or a sample of a light, so that it
//! is always counted: that an effect which nothing calls for costs nothing is then seen in every render.

use std::cell::Cell;
use std::ops::AddAssign;

use crate::EffectSet;

/// One place for each bit of an [`EffectSet`].
const PLACES: usize = EffectSet::all().bits().ilog2() as usize + 1;

thread_local! {
    static SAMPLES: [Cell<u64>; PLACES] = const { [const { Cell::new(0) }; PLACES] };
    static LOOK_UPS: [Cell<u64>; PLACES] = const { [const { Cell::new(0) }; PLACES] };
}

/// What was done for each effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tally {
    samples: [u64; PLACES],
    look_ups: [u64; PLACES],
}

impl Tally {
    /// What this thread did since it was last asked.
    pub(crate) fn take() -> Self {
        let take = |counts: &[Cell<u64>; PLACES]| counts.each_ref().map(Cell::take);
        Self { samples: SAMPLES.with(take), look_ups: LOOK_UPS.with(take) }
    }

    /// Samples of an effect; `None` if it is counted by its rays alone.
    pub(crate) fn samples(&self, effect: EffectSet) -> Option<u64> {
        SAMPLED.contains(effect).then(|| self.samples[place(effect)])
    }

    /// Look-ups of images for an effect; `None` if it has none.
    pub(crate) fn look_ups(&self, effect: EffectSet) -> Option<u64> {
        LOOKED_UP.contains(effect).then(|| self.look_ups[place(effect)])
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        for (a, b) in self.samples.iter_mut().zip(other.samples) {
            *a += b;
        }
        for (a, b) in self.look_ups.iter_mut().zip(other.look_ups) {
            *a += b;
        }
    }
}

/// Effects that are counted where they are evaluated; the others by their rays.
const SAMPLED: EffectSet = EffectSet::PUNCTUAL_LIGHTS
    .union(EffectSet::AREA_LIGHTS)
    .union(EffectSet::ENVIRONMENT)
    .union(EffectSet::ALPHA_MASK)
    .union(EffectSet::ALPHA_BLEND)
    .union(EffectSet::NORMAL_MAPS)
    .union(EffectSet::EMISSION)
    .union(EffectSet::ABSORPTION)
    .union(EffectSet::VERTEX_COLORS)
    .union(EffectSet::UNLIT)
    .union(EffectSet::CLIPPING)
    .union(EffectSet::DISPERSION)
    .union(EffectSet::DEPTH_OF_FIELD)
    .union(EffectSet::MOTION)
    .union(EffectSet::FOG)
    .union(EffectSet::LAYERS);

/// Effects that look images up.
const LOOKED_UP: EffectSet = EffectSet::TEXTURES
    .union(EffectSet::NORMAL_MAPS)
    .union(EffectSet::ALPHA_MASK)
    .union(EffectSet::ALPHA_BLEND)
    .union(EffectSet::ENVIRONMENT)
    .union(EffectSet::LAYERS);

fn place(effect: EffectSet) -> usize {
    effect.bits().trailing_zeros() as usize
}

/// Notes that an effect was evaluated at a point, or a light of its kind was asked.
#[inline(always)]
pub(crate) fn sample(effect: EffectSet) {
    SAMPLES.with(|counts| {
        let count = &counts[place(effect)];
        count.set(count.get() + 1);
    });
}

/// Notes that an image was looked up for an effect.
#[inline(always)]
pub(crate) fn look_up(effect: EffectSet) {
    LOOK_UPS.with(|counts| {
        let count = &counts[place(effect)];
        count.set(count.get() + 1);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_of_one_thread_and_taken_once() {
        let _ = Tally::take();
        sample(EffectSet::SHEEN);
        look_up(EffectSet::TEXTURES);
        std::thread::spawn(|| sample(EffectSet::SHEEN)).join().unwrap();
        let mut tally = Tally::take();
        assert_eq!((tally.samples(EffectSet::SHEEN), tally.samples(EffectSet::CLEARCOAT)), (Some(1), Some(0)));
        assert_eq!((tally.look_ups(EffectSet::TEXTURES), tally.look_ups(EffectSet::SHADOWS)), (Some(1), None));
        tally += tally;
        assert_eq!(tally.samples(EffectSet::SHEEN), Some(2));
        assert_eq!(Tally::take(), Tally::default());
    }
}
