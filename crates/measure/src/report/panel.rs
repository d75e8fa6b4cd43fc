//! From what was measured to charts: which points, in what units, with which words.

use super::{
    chart::{Chart, Mark, Point},
    text::{count, number, seen, slug},
};
use crate::result::{Accuracy, Model, PictureRow, ShapeRow, TierRow};

/// Charts that share their points: one model and one kind of rays, one kind of rays on all shapes, or one model's
/// pictures.
#[derive(Clone, Debug)]
pub(super) struct Panel<'a> {
    /// What it shows: `dragon.obj: aimed rays`.
    pub(super) title: String,
    /// Charts that have something to show.
    pub(super) charts: Vec<Chart>,
    /// What the letters of guards stand for.
    pub(super) guards: Vec<&'a str>,
}

/// What was measured with one kind of rays on one model.
pub(super) struct Rays<'a> {
    pub(super) kind: &'a str,
    pub(super) tiers: Panel<'a>,
    /// The guards of the robust tier between the tiers that have none and all: they lie too close together to be told
    /// apart in the charts that reach as far as the exact tier.
    pub(super) guards: Option<Panel<'a>>,
    pub(super) rows: Vec<&'a TierRow>,
}

/// What was measured on a model, by the kind of rays.
pub(super) fn rays_of<'a>(accuracy: &'a Accuracy, model: &Model) -> Vec<Rays<'a>> {
    let of_model: Vec<_> = accuracy.tiers.iter().filter(|r| r.model == model.name).collect();
    let guards = distinct(of_model.iter().map(|r| r.guard.as_str()).filter(|g| !g.is_empty()));
    let measured = |kind| {
        let rows: Vec<_> = of_model.iter().copied().filter(|r| r.rays == kind).collect();
        let panel = |what: &str, rows: &[&TierRow], guards: &[&'a str]| {
            let title = format!("{}: {kind} rays{what}", model.name);
            let charts = Metric::ALL.iter().map(|m| m.chart(&title, rows, guards)).collect();
            Panel { title, charts, guards: guards.to_vec() }
        };
        let (whole, parts): (Vec<_>, Vec<_>) = rows.iter().partition(|r| r.guard.is_empty());
        let mut tiers = panel("", &whole, &[]);
        tiers.charts.retain(|c| !c.is_empty());
        let ends = whole.iter().filter(|w| w.tier == "fast" || parts.iter().any(|p| p.tier == w.tier)).copied();
        let mut by_guard = panel(", guard by guard", &ends.chain(parts.iter().copied()).collect::<Vec<_>>(), &guards);
        by_guard.charts.retain(|c| !c.is_empty() && c.tells_apart());
        let guards = Some(by_guard).filter(|g| !parts.is_empty() && !g.charts.is_empty());
        Rays { kind, tiers, guards, rows }
    };
    distinct(of_model.iter().map(|r| r.rays.as_str())).into_iter().map(measured).collect()
}

/// What is drawn over time for tiers.
#[derive(Clone, Copy, Debug)]
enum Metric {
    Leaks,
    Decisions,
    T,
    Surface,
    SelfHits,
    Normal,
}

/// The error of a row by a metric; `None` where it was not measured.
struct Error {
    error: f64,
    worst: Option<f64>,
    /// Number of trials, for rates.
    trials: Option<u64>,
    words: String,
}

impl Error {
    fn rate(what: &str, hits: u64, trials: u64) -> Option<Self> {
        let error = 1e6 * hits as f64 / trials as f64;
        let words = format!("{what}: {}", seen(hits, trials));
        (trials > 0).then_some(Self { error, worst: None, trials: Some(trials), words })
    }

    fn spread(what: &str, unit: &str, p99: f64, worst: f64, compared: u64) -> Option<Self> {
        let words = format!("{what}: 99 % within {} {unit}, largest {} {unit}", number(p99), number(worst));
        (compared > 0).then_some(Self { error: p99, worst: Some(worst), trials: None, words })
    }
}

impl Metric {
    const ALL: [Self; 6] = [Self::Leaks, Self::Decisions, Self::T, Self::Surface, Self::SelfHits, Self::Normal];

    /// Name of files, title, unit.
    fn names(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Leaks => ("leaks", "Leaks", "per million rays from inside that must hit"),
            Self::Decisions => ("false-hits-and-misses", "False hits and misses", "per million rays"),
            Self::T => ("t-error", "Error of t", "f32 ulps of the exact t: 99 %, line to the largest"),
            Self::Surface => (
                "surface-distance",
                "Hit point off the surface",
                "f32 ulps of its coordinates: 99 %, line to the largest",
            ),
            Self::SelfHits => ("self-hits", "Self-hits", "per million bounced rays"),
            Self::Normal => ("normal-error", "Error of the normal", "radians: 99 %, line to the largest"),
        }
    }

    fn of(self, r: &TierRow) -> Option<Error> {
        match self {
            Self::Leaks => r.leaks.and_then(|n| Error::rate("leaks", n, r.aimed_rays)),
            Self::Decisions => {
                let both = r.false_hits + r.false_misses;
                let mut error = Error::rate("wrong decisions", both, r.compared)?;
                if both > 0 {
                    error.words +=
                        &format!("\nfalse hits {}, false misses {}", count(r.false_hits), count(r.false_misses));
                }
                Some(error)
            }
            Self::T => {
                let mut error = Error::spread("t", "ulp", r.t_ulp_p99, r.t_ulp_max, r.compared)?;
                error.words += &format!("\nlargest divided by its condition: {} ulp", number(r.t_ulp_kappa_max));
                Some(error)
            }
            Self::Surface => Error::spread("off the surface", "ulp", r.surface_ulp_p99, r.surface_ulp_max, r.compared),
            Self::SelfHits => Error::rate("self-hits", r.self_hits, r.bounces),
            Self::Normal => Error::spread("normal", "rad", r.normal_p99, r.normal_max, r.compared),
        }
    }

    fn chart(self, panel: &str, rows: &[&TierRow], guards: &[&str]) -> Chart {
        let (name, title, unit) = self.names();
        let mut points = Vec::new();
        let mut trials = Vec::new();
        for r in rows {
            let Some(error) = self.of(r) else { continue };
            trials.extend(error.trials);
            points.push(Point {
                mark: mark(r, guards),
                label: label(r, guards),
                time: [r.ns_low, r.ns_per_ray, r.ns_high],
                error: error.error,
                worst: error.worst,
                tip: format!("{}, {} rays\n{}\n{}", full_name(r), r.rays, time_words(r), error.words),
            });
        }
        let (fewest, most) = (trials.iter().min(), trials.iter().max());
        let band = match fewest {
            Some(&n) => format!("none seen in {}: < {} per million", count(n), number(3e6 / n as f64)),
            None => "no error in 99 % of the rays".into(),
        };
        Chart {
            slug: slug(&format!("{panel} {name}")),
            title: title.into(),
            subtitle: unit.into(),
            time_axis: "ns per ray, less is better; lines join the quartiles".into(),
            band,
            floor: most.map(|n| 1e6 / *n as f64),
            close: false,
            points,
        }
    }
}

fn mark(row: &TierRow, guards: &[&str]) -> Mark {
    match guards.iter().position(|g| *g == row.guard) {
        Some(i) => Mark::Guard(i),
        None => Mark::Tier(tier(&row.tier)),
    }
}

/// The place of a tier among all, for its mark.
fn tier(name: &str) -> usize {
    ["fast", "robust", "double", "exact"].iter().position(|t| *t == name).unwrap_or(0)
}

fn label(row: &TierRow, guards: &[&str]) -> String {
    guards.iter().position(|g| *g == row.guard).map_or_else(|| row.tier.clone(), Mark::letter)
}

/// The name of a tier with its guards.
pub(super) fn full_name(row: &TierRow) -> String {
    if row.guard.is_empty() { row.tier.clone() } else { format!("{}, {}", row.tier, row.guard) }
}

fn time_words(row: &TierRow) -> String {
    format!(
        "{} ns per ray ({} to {}), {} × fast",
        number(row.ns_per_ray),
        number(row.ns_low),
        number(row.ns_high),
        number(row.ratio_to_fast)
    )
}

/// The charts of analytic shapes: one panel for each kind of rays, hard ones first.
pub(super) fn shape_panels(accuracy: &Accuracy) -> Vec<(Panel<'_>, &str, Vec<&ShapeRow>)> {
    let mut kinds = distinct(accuracy.shapes.iter().map(|r| r.rays.as_str()));
    kinds.sort_by_key(|k| *k != "hard");
    let forms = distinct(accuracy.shapes.iter().map(|r| r.form.as_str()));
    let panel = |rays| {
        let rows: Vec<_> = accuracy.shapes.iter().filter(|r| r.rays == rays).collect();
        let charts = distinct(rows.iter().map(|r| r.shape.as_str())).into_iter().map(|shape| Chart {
            slug: slug(&format!("shapes {rays} rays {shape} t-error")),
            title: capital(shape),
            subtitle: "error of t, f32 ulps: 99 %, line to the largest".into(),
            time_axis: "ns per test, less is better".into(),
            band: "no error in 99 % of the rays".into(),
            floor: None,
            close: false,
            points: rows.iter().filter(|r| r.shape == shape).map(|r| shape_point(r, &forms)).collect(),
        });
        let charts = charts.filter(|c| !c.is_empty()).collect();
        (Panel { title: format!("Shapes: {rays} rays"), charts, guards: Vec::new() }, rays, rows)
    };
    kinds.into_iter().map(panel).collect()
}

fn shape_point(row: &ShapeRow, forms: &[&str]) -> Point {
    let time = row.ns_per_ray;
    let tip = format!(
        "{}: {}, {} rays\n{} ns per test\nt: 99 % within {} ulp, largest {} ulp\nfalse hits: {}\nfalse misses: {}",
        row.shape,
        row.form,
        row.rays,
        number(time),
        number(row.t_ulp_p99),
        number(row.t_ulp_max),
        seen(row.false_hits, row.count),
        seen(row.false_misses, row.count)
    );
    Point {
        mark: Mark::Tier(forms.iter().position(|f| *f == row.form).unwrap_or(0)),
        label: row.form.clone(),
        time: [f64::NAN, time, f64::NAN],
        error: row.t_ulp_p99,
        worst: Some(row.t_ulp_max),
        tip,
    }
}

/// The charts of a model's pictures, with the rows behind them; `None` where none were made.
pub(super) fn picture_panel<'a>(accuracy: &'a Accuracy, model: &Model) -> Option<(Panel<'a>, Vec<&'a PictureRow>)> {
    let rows: Vec<_> = accuracy.pictures.iter().filter(|r| r.model == model.name).collect();
    let chart = |name: &str, title: &str, subtitle: &str, error: fn(&PictureRow) -> f64| Chart {
        slug: slug(&format!("{} pictures {name}", model.name)),
        title: title.into(),
        subtitle: subtitle.into(),
        time_axis: "seconds for the picture, less is better".into(),
        band: "no difference".into(),
        floor: None,
        close: false,
        points: rows
            .iter()
            .map(|r| Point {
                mark: Mark::Tier(tier(&r.tier)),
                label: r.tier.clone(),
                time: [f64::NAN, r.seconds, f64::NAN],
                error: error(r),
                worst: None,
                tip: format!(
                    "{}\n{} s, {} × fast\nRMSE {}, FLIP {}\n{}",
                    r.tier,
                    number(r.seconds),
                    number(r.ratio_to_fast),
                    number(r.rmse),
                    number(r.flip),
                    different(r)
                ),
            })
            .collect(),
    };
    let charts = vec![
        chart("rmse", "Picture: RMSE", "root mean square of differences in linear radiance", |r| r.rmse),
        chart("flip", "Picture: FLIP", "mean visible difference, 0 to 1", |r| r.flip),
    ];
    let charts: Vec<_> = charts.into_iter().filter(|c| !c.is_empty()).collect();
    let title = format!("{}: pictures", model.name);
    (!charts.is_empty()).then(|| (Panel { title, charts, guards: Vec::new() }, rows))
}

/// How many pixels differ, in words.
pub(super) fn different(row: &PictureRow) -> String {
    let total = count(row.pixels);
    match row.different_pixels {
        0 => format!("no pixel of {total} differs"),
        1 => format!("1 pixel of {total} differs"),
        n => format!("{} pixels of {total} differ", count(n)),
    }
}

/// Each once, in the order of their first appearance.
pub(super) fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut out = Vec::new();
    for name in names {
        if !out.contains(&name) {
            out.push(name);
        }
    }
    out
}

/// With a capital at its start.
pub(super) fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
