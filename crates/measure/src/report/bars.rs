//! Bars: one number for each engine, more is better.

use std::fmt::Write as _;

use super::text::{escape, number};

/// Width of every picture of bars, in its own units.
const WIDTH: f64 = 560.0;
/// Where names end and bars begin.
const LEFT: f64 = 152.0;
/// Where the longest bar ends; its number stands behind it.
const RIGHT: f64 = WIDTH - 62.0;
const TOP: f64 = 54.0;
const ROW: f64 = 26.0;
const BAR: f64 = 15.0;

/// A bar.
#[derive(Clone, Debug)]
pub(super) struct Bar {
    pub(super) label: String,
    /// How long it is.
    pub(super) value: f64,
    /// Up to where a thin line goes on.
    pub(super) best: f64,
    /// Colour: 0 to 3 for tiers, else grey.
    pub(super) class: Option<usize>,
    /// All numbers, line by line.
    pub(super) tip: String,
}

/// Bars from 0 below each other, as an `svg` element without style.
pub(super) fn draw(title: &str, subtitle: &str, bars: &[Bar]) -> String {
    let height = TOP + ROW * bars.len() as f64 + 8.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fh-chart\" viewBox=\"0 0 {WIDTH} {height}\" role=\"group\" \
         aria-label=\"{0}. {1}\">\n<text class=\"fh-title\" x=\"14\" y=\"22\">{0}</text>\
         <text class=\"fh-sub\" x=\"14\" y=\"40\">{1}</text>\n",
        escape(title),
        escape(subtitle)
    );
    let longest = bars.iter().map(|b| b.best.max(b.value)).filter(|v| v.is_finite()).fold(0.0, f64::max);
    for (i, bar) in bars.iter().enumerate() {
        let length = |value: f64| if longest > 0.0 { (RIGHT - LEFT) * (value / longest).clamp(0.0, 1.0) } else { 0.0 };
        let (top, middle) = (TOP + ROW * i as f64, TOP + ROW * i as f64 + 0.5 * ROW);
        let (end, best) = (length(bar.value), length(bar.best));
        let class = bar.class.map_or("fh-other".into(), |c| format!("fh-t{}", c % 4));
        let _ = writeln!(
            out,
            "<g class=\"fh-point {class}\" tabindex=\"0\" role=\"img\"><title>{}</title>\
             <rect class=\"fh-target\" x=\"0\" y=\"{top:.1}\" width=\"{WIDTH}\" height=\"{ROW}\"/>\
             <text class=\"fh-label fh-end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\
             <rect class=\"fh-mark\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{end:.1}\" height=\"{BAR}\" rx=\"2\"/>\
             <path class=\"fh-spread\" d=\"M{:.1} {middle:.1}H{:.1}\"/>\
             <text class=\"fh-tick\" x=\"{:.1}\" y=\"{:.1}\">{}</text></g>",
            escape(&bar.tip),
            LEFT - 8.0,
            middle + 4.0,
            escape(&bar.label),
            middle - 0.5 * BAR,
            LEFT + end,
            LEFT + best.max(end),
            LEFT + best.max(end) + 6.0,
            middle + 4.0,
            number(bar.value)
        );
    }
    out + "</svg>\n"
}
