//! Paired timing: the same work by several ways in turn, over and over, so that what disturbs the machine disturbs all
//! alike.

use std::time::{Duration, Instant};

/// Median and quartiles of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Lower quartile.
    pub low: f64,
    /// Median.
    pub median: f64,
    /// Upper quartile.
    pub high: f64,
}

impl Spread {
    /// By linear interpolation; NaN for no numbers.
    #[must_use]
    pub fn new(numbers: &[f64]) -> Self {
        let mut sorted = numbers.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |q: f64| quantile(&sorted, q);
        Self { low: at(0.25), median: at(0.5), high: at(0.75) }
    }

    /// Interquartile range over the median.
    #[must_use]
    pub fn relative(&self) -> f64 {
        (self.high - self.low) / self.median
    }
}

/// Quantile `q` of ascending numbers, by linear interpolation; NaN for none.
#[must_use]
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q * last as f64;
    let (i, part) = (at as usize, at.fract());
    let next = sorted[(i + 1).min(last)];
    if part == 0.0 || sorted[i] == next { sorted[i] } else { sorted[i] + (next - sorted[i]) * part }
}

/// Seconds of each repetition of each way.
#[derive(Clone, Debug)]
pub struct Paired {
    /// One list for each way; equally long.
    pub seconds: Vec<Vec<f64>>,
}

impl Paired {
    /// Times `ways` in turn: once unmeasured, then at least `least` times, and further, up to `most` times, until
    /// `budget` is spent. `work` does the work of one way; it is asked between repetitions whether to stop by `stop`.
    pub fn run(
        ways: usize,
        (least, most): (usize, usize),
        budget: Duration,
        mut work: impl FnMut(usize),
        stop: impl Fn() -> bool,
    ) -> Self {
        let mut seconds = vec![Vec::new(); ways];
        let started = Instant::now();
        (0..ways).for_each(&mut work);
        for round in 0..most {
            if stop() || (round >= least && started.elapsed() >= budget) {
                break;
            }
            for k in 0..ways {
                // Each way comes after each other one equally often.
                let way = (k + round) % ways;
                let start = Instant::now();
                work(way);
                seconds[way].push(start.elapsed().as_secs_f64());
            }
        }
        Self { seconds }
    }

    /// Time of a way.
    #[must_use]
    pub fn spread(&self, way: usize) -> Spread {
        Spread::new(&self.seconds[way])
    }

    /// Median ratio of a way's time to another's in the same repetition.
    #[must_use]
    pub fn ratio(&self, way: usize, to: usize) -> f64 {
        let ratios: Vec<f64> = self.seconds[way].iter().zip(&self.seconds[to]).map(|(a, b)| a / b).collect();
        Spread::new(&ratios).median
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_interpolate() {
        let s = Spread::new(&[4.0, 1.0, 3.0, 2.0]);
        assert_eq!((s.low, s.median, s.high), (1.75, 2.5, 3.25));
        assert_eq!(Spread::new(&[5.0]).median, 5.0);
        assert!(Spread::new(&[]).median.is_nan());
        assert_eq!(quantile(&[1.0, f64::INFINITY], 1.0), f64::INFINITY);
    }

    #[test]
    fn ways_are_timed_in_turn_and_equally_often() {
        let mut order = Vec::new();
        let paired = Paired::run(2, (3, 3), Duration::ZERO, |way| order.push(way), || false);
        assert_eq!(order, [0, 1, 0, 1, 1, 0, 0, 1]);
        assert!(paired.seconds.iter().all(|s| s.len() == 3));
        let stopped = Paired::run(2, (3, 3), Duration::ZERO, |_| (), || true);
        assert!(stopped.seconds.iter().all(Vec::is_empty));
    }

    #[test]
    fn a_ratio_is_taken_within_a_repetition() {
        // The machine slows down by 100, the ratio stays.
        let paired = Paired { seconds: vec![vec![1.0, 100.0, 1.0], vec![2.0, 200.0, 2.0]] };
        assert_eq!(paired.ratio(1, 0), 2.0);
    }
}
