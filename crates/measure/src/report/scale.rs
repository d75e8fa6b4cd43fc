//! Logarithmic axes.

use super::text;

/// A logarithmic axis from values to positions in a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogScale {
    /// Decimal logarithms of the ends.
    domain: (f64, f64),
    /// Positions of the ends.
    range: (f64, f64),
}

/// A place on an axis that a number stands at.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub(super) value: f64,
    pub(super) label: String,
}

impl LogScale {
    /// An axis that holds these values with some room around; `None` where none of them is positive and finite.
    pub(super) fn around(values: impl IntoIterator<Item = f64>, range: (f64, f64)) -> Option<Self> {
        let (low, high) = extent(values)?;
        // 3 % at least, or a single time would have an axis of no length.
        let room = ((high - low) * 0.08).max(0.013);
        Some(Self { domain: (low - room, high + room), range })
    }

    /// An axis of whole decades that holds these values, and `floor` where it is lower.
    pub(super) fn decades(
        values: impl IntoIterator<Item = f64>,
        floor: Option<f64>,
        range: (f64, f64),
    ) -> Option<Self> {
        let (low, high) = extent(values.into_iter().chain(floor))?;
        // What lies on a decade shall not lie on the frame.
        let low = (low - 0.05).floor();
        Some(Self { domain: (low, (high + 0.05).ceil().max(low + 2.0)), range })
    }

    /// The position of a value; beyond the ends, the end.
    pub(super) fn place(&self, value: f64) -> f64 {
        let (low, high) = self.domain;
        let share = ((value.log10() - low) / (high - low)).clamp(0.0, 1.0);
        self.range.0 + share * (self.range.1 - self.range.0)
    }

    /// About `most` or fewer round numbers.
    pub(super) fn ticks(&self, most: usize) -> Vec<Tick> {
        let (low, high) = self.domain;
        if high - low >= 2.0 {
            let (first, last) = (low.ceil() as i32, high.floor() as i32);
            let step = ((last - first + 1) as usize).div_ceil(most.max(1)).max(1);
            return (first..=last)
                .step_by(step)
                .map(|e| Tick { value: 10_f64.powi(e), label: text::decade(e) })
                .collect();
        }
        let (from, to) = (10_f64.powf(low), 10_f64.powf(high));
        if to / from >= 4.0 {
            let decades = low.floor() as i32..=high.ceil() as i32;
            let values = decades.flat_map(|e| [1.0, 2.0, 5.0].map(|m| m * 10_f64.powi(e)));
            return values.filter(|v| (from..=to).contains(v)).map(Tick::at).collect();
        }
        // Less than a factor of 4: even steps read better.
        let rough = (to - from) / most.max(1) as f64;
        let unit = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * unit).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) = ((from / step).ceil() as u64, (to / step).floor() as u64);
        (first..=last).map(|i| Tick::at(i as f64 * step)).collect()
    }
}

impl Tick {
    fn at(value: f64) -> Self {
        Self { value, label: text::number(value) }
    }
}

/// Decimal logarithms of the least and the largest of the values that a logarithmic axis can show.
fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let shown = values.into_iter().filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
    shown.fold(None, |e, v| Some(e.map_or((v, v), |(low, high): (f64, f64)| (low.min(v), high.max(v)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &LogScale, most: usize) -> Vec<String> {
        scale.ticks(most).into_iter().map(|t| t.label).collect()
    }

    #[test]
    fn a_wide_axis_counts_decades_and_a_narrow_one_round_numbers() {
        let wide = LogScale::decades([2e-3, 4e3], None, (0.0, 100.0)).unwrap();
        assert_eq!(labels(&wide, 8), ["10⁻³", "0.01", "0.1", "1", "10", "100", "1,000", "10⁴"]);
        assert_eq!((wide.place(1e-3), wide.place(1e4)), (0.0, 100.0));
        let narrow = LogScale::around([100.0, 180.0], (0.0, 100.0)).unwrap();
        assert_eq!(labels(&narrow, 6), ["100", "120", "140", "160", "180"]);
        let middle = LogScale::around([100.0, 900.0], (0.0, 100.0)).unwrap();
        assert_eq!(labels(&middle, 6), ["100", "200", "500", "1,000"]);
    }

    #[test]
    fn what_cannot_be_shown_is_left_out() {
        let odd = [f64::NAN, f64::INFINITY, 0.0, -1.0];
        assert!(LogScale::around(odd, (0.0, 1.0)).is_none());
        let scale = LogScale::around(odd.into_iter().chain([5.0]), (0.0, 1.0)).unwrap();
        assert!((scale.place(5.0) - 0.5).abs() < 1e-12);
        assert!(!scale.ticks(6).is_empty());
    }

    #[test]
    fn every_value_has_its_place_and_ticks_are_few() {
        for exponent in -12..12 {
            for spread in [1.0, 1.001, 1.3, 3.0, 40.0, 1e5, 1e12] {
                let low = 10_f64.powi(exponent) * 1.7;
                let scale = LogScale::around([low, low * spread], (10.0, 20.0)).unwrap();
                assert!(10.0 < scale.place(low) && scale.place(low * spread) < 20.0);
                let ticks = scale.ticks(6);
                assert!((1..=8).contains(&ticks.len()), "{low} x {spread}: {ticks:?}");
                assert!(ticks.windows(2).all(|w| w[0].value < w[1].value && w[0].label != w[1].label));
            }
        }
    }
}
