//! One chart: error against time, both on logarithmic axes, as SVG.

use std::fmt::Write as _;

use super::{
    label::{Placer, Rect},
    scale::LogScale,
    text::escape,
};

/// Size of every chart, in its own units.
pub(super) const WIDTH: f64 = 560.0;
/// Height of every chart.
pub(super) const HEIGHT: f64 = 380.0;

const LEFT: f64 = 58.0;
const RIGHT: f64 = WIDTH - 18.0;
const TOP: f64 = 58.0;
const BOTTOM: f64 = HEIGHT - 46.0;
/// Between two points of the band that stand one over the other.
const ROW: f64 = 17.0;
/// Height of the band's own words.
const BAND_TITLE: f64 = 19.0;

/// What a point is drawn with: its place in the list of marks says shape and colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// A tier or a form, from the fastest to the most careful: 0 to 3.
    Tier(usize),
    /// A guard, by its place in the key: a, b, c, ...
    Guard(usize),
    /// Something else than firsthit, shown beside it.
    Other,
}

impl Mark {
    /// The key's letter for a guard.
    pub(super) fn letter(index: usize) -> String {
        let letter = (b'a' + (index % 26) as u8) as char;
        if index < 26 { letter.to_string() } else { format!("{letter}{}", index / 26) }
    }
}

/// One measurement in a chart.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) mark: Mark,
    /// Beside the point.
    pub(super) label: String,
    /// Time: lower quartile, median, upper quartile. Quartiles that are no numbers are left out.
    pub(super) time: [f64; 3],
    /// The error; exactly 0 goes into the band. `NaN` or infinite: the point is named as not shown.
    pub(super) error: f64,
    /// The largest error, where `error` is a percentile.
    pub(super) worst: Option<f64>,
    /// All numbers, line by line.
    pub(super) tip: String,
}

impl Point {
    fn is_shown(&self) -> bool {
        self.time[1] > 0.0 && self.time[1].is_finite() && self.error >= 0.0 && self.error.is_finite()
    }
}

/// A chart to be drawn.
#[derive(Clone, Debug, Default)]
pub(super) struct Chart {
    /// A few words that name a file or an element.
    pub(super) slug: String,
    pub(super) title: String,
    pub(super) subtitle: String,
    pub(super) time_axis: String,
    /// What a zero means: stands in the band of the points that have none.
    pub(super) band: String,
    /// The least error that could have been seen, so that the band is below whatever can be counted.
    pub(super) floor: Option<f64>,
    /// Whether the upward axis shows no more than there is, instead of whole decades.
    pub(super) close: bool,
    pub(super) points: Vec<Point>,
}

/// A point with its place.
struct Placed<'a> {
    point: &'a Point,
    x: f64,
    y: f64,
}

impl Chart {
    /// Whether there is anything to see.
    pub(super) fn is_empty(&self) -> bool {
        !self.points.iter().any(Point::is_shown)
    }

    /// Whether its points differ in their errors.
    pub(super) fn tells_apart(&self) -> bool {
        self.points.windows(2).any(|p| (p[0].error, p[0].worst) != (p[1].error, p[1].worst))
    }

    /// The chart as an `svg` element without style; `attributes` go into its tag.
    pub(super) fn draw(&self, attributes: &str) -> String {
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fh-chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             role=\"group\" aria-label=\"{}\" {attributes}>\n",
            escape(&format!("{}. {}", self.title, self.subtitle))
        );
        line(&mut out, "fh-title", (LEFT, 22.0), &self.title);
        line(&mut out, "fh-sub", (LEFT, 40.0), &self.subtitle);
        let shown: Vec<_> = self.points.iter().filter(|p| p.is_shown()).collect();
        let times = shown.iter().flat_map(|p| p.time);
        if let Some(x) = LogScale::around(times, (LEFT + 8.0, RIGHT - 8.0)) {
            self.draw_plot(&mut out, &shown, &x);
        }
        let absent: Vec<_> = self.points.iter().filter(|p| !p.is_shown()).map(|p| p.label.as_str()).collect();
        if !absent.is_empty() {
            let words = format!("no number: {}", absent.join(", "));
            let _ = writeln!(
                out,
                "<text class=\"fh-sub fh-end\" x=\"{RIGHT}\" y=\"{:.0}\">{}</text>",
                HEIGHT - 10.0,
                escape(&words)
            );
        }
        out.push_str("</svg>\n");
        out
    }

    fn draw_plot(&self, out: &mut String, shown: &[&Point], x: &LogScale) {
        let zeros = band_rows(shown, x);
        let rows = zeros.iter().flatten().max().map_or(0, |r| r + 1);
        let band = if rows > 0 { rows as f64 * ROW + BAND_TITLE } else { 0.0 };
        let plot_bottom = BOTTOM - band;
        let errors = shown.iter().flat_map(|p| [p.error, p.worst.unwrap_or(p.error)]);
        let y = match self.close {
            true => LogScale::around(errors, (plot_bottom - 8.0, TOP + 8.0)),
            false => LogScale::decades(errors, self.floor, (plot_bottom, TOP)),
        };

        self.draw_axes(out, x, y.as_ref(), plot_bottom);
        if band > 0.0 {
            let (width, middle) = (RIGHT - LEFT, 0.5 * (plot_bottom + BOTTOM));
            let _ = writeln!(
                out,
                "<rect class=\"fh-band\" x=\"{LEFT}\" y=\"{plot_bottom:.1}\" width=\"{width}\" height=\"{band:.1}\"/>\
                 <text class=\"fh-tick fh-end\" x=\"{:.1}\" y=\"{:.1}\">0</text>",
                LEFT - 7.0,
                middle + 4.0
            );
            line(out, "fh-bandtext", (LEFT + 8.0, plot_bottom + 14.0), &self.band);
        }

        let placed: Vec<_> = shown
            .iter()
            .zip(&zeros)
            .map(|(&point, zero)| {
                let in_band = |row: &usize| plot_bottom + BAND_TITLE + (*row as f64 + 0.4) * ROW;
                let on_axis = || y.map_or(plot_bottom, |y| y.place(point.error));
                Placed { point, x: x.place(point.time[1]), y: zero.as_ref().map_or_else(on_axis, in_band) }
            })
            .collect();
        draw_front(out, &placed);
        let labels = place_labels(&placed, plot_bottom, band);
        // The small marks of guards last: they must not lie hidden under those of tiers.
        let order = |p: &Placed<'_>| matches!(p.point.mark, Mark::Guard(_));
        let mut both: Vec<_> = placed.iter().zip(labels).collect();
        both.sort_by_key(|(p, _)| order(p));
        for (placed, label) in both {
            draw_point(out, placed, &label, x, y.as_ref());
        }
    }

    fn draw_axes(&self, out: &mut String, x: &LogScale, y: Option<&LogScale>, plot_bottom: f64) {
        for tick in x.ticks(6) {
            let at = x.place(tick.value);
            let _ = writeln!(
                out,
                "<line class=\"fh-grid\" x1=\"{at:.1}\" y1=\"{TOP}\" x2=\"{at:.1}\" y2=\"{BOTTOM}\"/>\
                 <text class=\"fh-tick fh-middle\" x=\"{at:.1}\" y=\"{:.1}\">{}</text>",
                BOTTOM + 16.0,
                tick.label
            );
        }
        for tick in y.map_or_else(Vec::new, |y| y.ticks(9)) {
            let at = y.map_or(0.0, |y| y.place(tick.value));
            if at > plot_bottom - 6.0 && plot_bottom < BOTTOM {
                continue;
            }
            let _ = writeln!(
                out,
                "<line class=\"fh-grid\" x1=\"{LEFT}\" y1=\"{at:.1}\" x2=\"{RIGHT}\" y2=\"{at:.1}\"/>\
                 <text class=\"fh-tick fh-end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                LEFT - 7.0,
                at + 4.0,
                tick.label
            );
        }
        let _ = writeln!(
            out,
            "<path class=\"fh-axis\" d=\"M{LEFT} {TOP}V{BOTTOM}H{RIGHT}\"/>\
             <text class=\"fh-sub\" x=\"{LEFT}\" y=\"{:.1}\">{}</text>",
            HEIGHT - 10.0,
            escape(&self.time_axis)
        );
    }
}

/// Draws the front: what no other point beats in both time and error.
fn draw_front(out: &mut String, placed: &[Placed<'_>]) {
    let mut by_time: Vec<_> = placed.iter().collect();
    by_time.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.point.error.total_cmp(&b.point.error)));
    let mut path = String::new();
    let mut least = f64::INFINITY;
    for p in by_time {
        if p.point.error < least {
            least = p.point.error;
            let _ = if path.is_empty() {
                write!(path, "M{:.1} {:.1}", p.x, p.y)
            } else {
                write!(path, "H{:.1}V{:.1}", p.x, p.y)
            };
        }
    }
    if path.contains('H') {
        let _ = writeln!(out, "<path class=\"fh-front\" d=\"{path}\"/>");
    }
}

/// For each point without error its row in the band, so that points of equal time do not hide each other.
fn band_rows(shown: &[&Point], x: &LogScale) -> Vec<Option<usize>> {
    // A label needs room beside its point.
    const APART: f64 = 30.0;
    let mut order: Vec<_> = (0..shown.len()).filter(|i| shown[*i].error == 0.0).collect();
    order.sort_by(|a, b| shown[*a].time[1].total_cmp(&shown[*b].time[1]));
    let mut ends: Vec<f64> = Vec::new();
    let mut rows = vec![None; shown.len()];
    for i in order {
        let at = x.place(shown[i].time[1]);
        let row = ends.iter().position(|end| *end <= at).unwrap_or(ends.len());
        let end = at + APART + label_width(shown[i]);
        if row == ends.len() {
            ends.push(end);
        } else {
            ends[row] = end;
        }
        rows[i] = Some(row);
    }
    rows
}

/// About as wide as a label is in a wide font, and apart from the next.
fn label_width(point: &Point) -> f64 {
    let bold = matches!(point.mark, Mark::Tier(_));
    3.0 + (if bold { 7.6 } else { 6.6 }) * point.label.chars().count() as f64
}

/// Places of the labels, in the order of the points.
fn place_labels(placed: &[Placed<'_>], plot_bottom: f64, band: f64) -> Vec<Rect> {
    let mut taken: Vec<_> = placed.iter().map(|p| Rect::around(p.x, p.y, 6.0)).collect();
    if band > 0.0 {
        taken.push(Rect { x: LEFT, y: plot_bottom, width: RIGHT - LEFT, height: BAND_TITLE - 2.0 });
    }
    let frame = Rect { x: LEFT, y: TOP, width: RIGHT - LEFT, height: BOTTOM - TOP };
    let mut placer = Placer::new(frame, taken);
    let mut labels = vec![Rect { x: 0.0, y: 0.0, width: 0.0, height: 0.0 }; placed.len()];
    // The long names of tiers choose first.
    let tiers = |i: &usize| matches!(placed[*i].point.mark, Mark::Tier(_));
    let (first, then): (Vec<usize>, Vec<usize>) = (0..placed.len()).partition(tiers);
    for i in first.into_iter().chain(then) {
        labels[i] = placer.place((placed[i].x, placed[i].y), label_width(placed[i].point), 12.0);
    }
    labels
}

fn draw_point(out: &mut String, placed: &Placed<'_>, label: &Rect, x: &LogScale, y: Option<&LogScale>) {
    let &Placed { point, x: px, y: py } = placed;
    let class = match point.mark {
        Mark::Tier(i) => format!("fh-t{}", i % 4),
        Mark::Guard(_) => "fh-guard".into(),
        Mark::Other => "fh-other".into(),
    };
    let tip = escape(&point.tip);
    let _ = write!(out, "<g class=\"fh-point {class}\" tabindex=\"0\" role=\"img\"><title>{tip}</title>");
    let [low, _, high] = point.time;
    if low > 0.0 && high >= low && high.is_finite() {
        let (x1, x2) = (x.place(low), x.place(high));
        let _ = write!(out, "<line class=\"fh-spread\" x1=\"{x1:.1}\" y1=\"{py:.1}\" x2=\"{x2:.1}\" y2=\"{py:.1}\"/>");
    }
    if let (Some(worst), Some(y)) = (point.worst.filter(|w| *w > point.error), y) {
        let top = y.place(worst);
        let (left, right) = (px - 3.5, px + 3.5);
        // Without end: an arrow instead of a cap.
        let cap = if worst.is_finite() {
            format!("M{left:.1} {top:.1}H{right:.1}")
        } else {
            format!("M{left:.1} {:.1}L{px:.1} {top:.1}L{right:.1} {:.1}", top + 5.0, top + 5.0)
        };
        let _ = write!(out, "<path class=\"fh-spread\" d=\"M{px:.1} {py:.1}V{top:.1}{cap}\"/>");
    }
    // Where guards crowd, each must still be pointed at.
    let reach = if matches!(point.mark, Mark::Guard(_)) { 7 } else { 12 };
    // At the side that faces the point, whatever the width of the reader's font.
    let (lx, anchor) = match () {
        () if label.x > px => (label.x, " fh-start"),
        () if label.x + label.width < px => (label.x + label.width, " fh-end"),
        () => (label.x + 0.5 * label.width, ""),
    };
    let ly = label.y + 0.5 * label.height;
    let ex = px.clamp(label.x, label.x + label.width);
    let ey = py.clamp(label.y, label.y + label.height);
    if (ex - px).hypot(ey - py) > 11.0 {
        let _ = write!(out, "<line class=\"fh-leader\" x1=\"{px:.1}\" y1=\"{py:.1}\" x2=\"{ex:.1}\" y2=\"{ey:.1}\"/>");
    }
    let _ = writeln!(
        out,
        "<circle class=\"fh-target\" cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"{reach}\"/>{}\
         <text class=\"fh-label{anchor}\" x=\"{lx:.1}\" y=\"{:.1}\">{}</text></g>",
        mark(point.mark, px, py),
        ly + 4.0,
        escape(&point.label)
    );
}

/// The mark itself: shape and colour both tell tiers apart.
pub(super) fn mark(mark: Mark, x: f64, y: f64) -> String {
    match mark {
        Mark::Guard(_) => format!("<circle class=\"fh-mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\"/>"),
        Mark::Other => format!("<circle class=\"fh-mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>"),
        Mark::Tier(i) => match i % 4 {
            0 => format!("<circle class=\"fh-mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\"/>"),
            1 => format!(
                "<rect class=\"fh-mark\" x=\"{:.1}\" y=\"{:.1}\" width=\"11\" height=\"11\" rx=\"1\"/>",
                x - 5.5,
                y - 5.5
            ),
            2 => format!("<path class=\"fh-mark\" d=\"M{x:.1} {:.1}l7 7l-7 7l-7-7z\"/>", y - 7.0),
            _ => format!("<path class=\"fh-mark\" d=\"M{x:.1} {:.1}l7 12h-14z\"/>", y - 7.5),
        },
    }
}

fn line(out: &mut String, class: &str, (x, y): (f64, f64), words: &str) {
    let _ = writeln!(out, "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escape(words));
}
