//! Where the time of a render goes, on pixels that are timed.

use std::cell::Cell;
use std::time::{Duration, Instant};

use crate::Breakdown;

/// Time spent in one part of the work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spent {
    pub(crate) seconds: f64,
    /// How often it was begun.
    pub(crate) spans: u64,
}

impl Spent {
    pub(crate) fn add(&mut self, other: Self) {
        self.seconds += other.seconds;
        self.spans += other.spans;
    }

    pub(crate) fn note(&mut self, time: Duration) {
        self.add(Self { seconds: time.as_secs_f64(), spans: 1 });
    }
}

/// Times the parts of the work that are asked for deep inside, where nothing may be changed.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    texturing: Cell<Spent>,
    sampling: Cell<Spent>,
}

impl Clock {
    fn time<R>(part: &Cell<Spent>, work: impl FnOnce() -> R) -> R {
        let start = Instant::now();
        let answer = work();
        let mut spent = part.get();
        spent.note(start.elapsed());
        part.set(spent);
        answer
    }

    /// A look-up of a texture.
    #[cold]
    pub(crate) fn texturing<R>(&self, work: impl FnOnce() -> R) -> R {
        Self::time(&self.texturing, work)
    }

    /// Sample points.
    #[cold]
    pub(crate) fn sampling<R>(&self, work: impl FnOnce() -> R) -> R {
        Self::time(&self.sampling, work)
    }

    pub(crate) fn parts(&self) -> Parts {
        Parts { texturing: self.texturing.get(), sampling: self.sampling.get(), ..Parts::default() }
    }
}

/// The parts of the work.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Parts {
    /// Whole samples.
    pub(crate) whole: Spent,
    pub(crate) texturing: Spent,
    pub(crate) sampling: Spent,
}

impl Parts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.whole.add(other.whole);
        self.texturing.add(other.texturing);
        self.sampling.add(other.sampling);
    }

    /// Shares of the whole, once what looking at the clock takes is left out: `look` seconds a span, of which the span
    /// itself sees about half.
    pub(crate) fn breakdown(&self, traversal: Spent, look: f64) -> Option<Breakdown> {
        let own = |part: Spent| (part.seconds - 0.5 * look * part.spans as f64).max(0.0);
        let inside = [traversal, self.texturing, self.sampling];
        let looks: u64 = inside.iter().map(|part| part.spans).sum();
        let [traversal, texturing, sampling] = inside.map(own);
        let whole = (own(self.whole) - look * looks as f64).max(traversal + texturing + sampling);
        (self.whole.spans > 0 && whole > 0.0).then(|| Breakdown {
            traversal: traversal / whole,
            texturing: texturing / whole,
            sampling: sampling / whole,
        })
    }
}

/// Seconds that looking at the clock before and after a span takes: the median of a few.
pub(crate) fn look() -> f64 {
    const TIMES: usize = 51;
    let mut seconds = [0.0; TIMES];
    for s in &mut seconds {
        let start = Instant::now();
        std::hint::black_box(Instant::now().elapsed());
        *s = start.elapsed().as_secs_f64();
    }
    seconds.sort_by(f64::total_cmp);
    // Four looks, of which the span itself sees three.
    seconds[TIMES / 2] * 2.0 / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_the_whole_without_the_clock() {
        let spent = |seconds, spans| Spent { seconds, spans };
        let parts = Parts { whole: spent(10.0, 1), texturing: spent(2.0, 4), sampling: spent(1.0, 0) };
        let shares = parts.breakdown(spent(3.0, 2), 0.5).unwrap();
        // 10 - 0.25 - 6 x 0.5 are left of the whole, and 2.5, 1 and 1 of the parts.
        let whole = 6.75;
        assert_eq!((shares.traversal, shares.texturing, shares.sampling), (2.5 / whole, 1.0 / whole, 1.0 / whole));
        assert!((shares.shading() - 2.25 / whole).abs() < 1e-12);
        assert_eq!(Parts::default().breakdown(Spent::default(), 0.1), None);
        // A clock that is slower than the work never makes shares of more than all.
        let tight = Parts { whole: spent(1.0, 1), ..parts }.breakdown(spent(3.0, 2), 0.5).unwrap();
        assert!((tight.traversal + tight.texturing + tight.sampling - 1.0).abs() < 1e-12 && tight.shading() < 1e-12);
    }
}
