//! Tables of all numbers.

use std::fmt::Write as _;

use super::{
    panel::full_name,
    text::{count, escape, number, seen},
};
use crate::result::{PictureRow, ShapeRow, TierRow};

/// A column: what stands above it, what that means, and the cell of a row.
pub(super) struct Column<R> {
    pub(super) head: &'static str,
    pub(super) meaning: &'static str,
    pub(super) cell: fn(&R) -> Cell,
}

/// What stands in a table.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    text: String,
    /// What it is sorted by; `None`: by its text.
    value: Option<f64>,
    /// Said when pointed at.
    hint: String,
}

impl Cell {
    pub(super) fn words(text: &str) -> Self {
        Self { text: text.into(), value: None, hint: String::new() }
    }

    pub(super) fn number(value: f64) -> Self {
        Self { text: number(value), value: Some(value), hint: String::new() }
    }

    /// What points at it is told this.
    pub(super) fn hint(self, hint: String) -> Self {
        Self { hint, ..self }
    }

    /// A count; a zero is said to be less than 3 in N.
    fn rate(hits: u64, trials: u64) -> Self {
        let text = match (hits, trials) {
            (_, 0) => "–".into(),
            (0, n) => format!("<\u{a0}3/{}", count(n)),
            (hits, _) => count(hits),
        };
        let value = if trials == 0 { f64::NAN } else { hits as f64 / trials as f64 };
        Self { text, value: Some(value), hint: seen(hits, trials) }
    }

    fn if_any(self, trials: u64) -> Self {
        if trials > 0 { self } else { Self { value: Some(f64::NAN), ..Self::words("–") } }
    }

    /// By levels: where 64 roundings of f32, of f64, or none excuse it.
    fn levels(self, [f32_level, f64_level, exact]: [u64; 3]) -> Self {
        let hint = format!(
            "{}\nbeyond 64 roundings of f32: {}\nbeyond 64 roundings of f64: {}\nbelow: {}",
            self.hint,
            count(f32_level),
            count(f64_level),
            count(exact)
        );
        Self { hint, ..self }
    }
}

/// The columns of tiers.
pub(super) const TIERS: &[Column<TierRow>] = &[
    Column { head: "Tier", meaning: "Tier, or which guards of it are on", cell: |r| Cell::words(&full_name(r)) },
    Column {
        head: "ns/ray",
        meaning: "Nanoseconds for a ray: median of the repetitions",
        cell: |r| Cell {
            hint: format!("quartiles {} and {}; {} rays", number(r.ns_low), number(r.ns_high), count(r.count)),
            ..Cell::number(r.ns_per_ray)
        },
    },
    Column {
        head: "× fast",
        meaning: "Median of the ratios to the fast tier in the same repetition",
        cell: |r| Cell::number(r.ratio_to_fast),
    },
    Column {
        head: "Leaks",
        meaning: "Rays from inside a closed mesh that hit nothing",
        cell: |r| Cell::rate(r.leaks.unwrap_or(0), if r.leaks.is_some() { r.aimed_rays } else { 0 }),
    },
    Column {
        head: "False hits",
        meaning: "Hits where exactly there is none",
        cell: |r| Cell::rate(r.false_hits, r.compared).levels(r.false_hits_by_level),
    },
    Column {
        head: "False misses",
        meaning: "No hit where exactly there is one",
        cell: |r| Cell::rate(r.false_misses, r.compared).levels(r.false_misses_by_level),
    },
    Column {
        head: "Wrong ids",
        meaning: "Another triangle than any of the exactly nearest",
        cell: |r| Cell::rate(r.wrong_ids, r.compared),
    },
    Column {
        head: "t p50",
        meaning: "Error of t in f32 ulps: median",
        cell: |r| Cell::number(r.t_ulp_p50).if_any(r.compared),
    },
    Column {
        head: "t p99",
        meaning: "Error of t in f32 ulps: 99th percentile",
        cell: |r| Cell::number(r.t_ulp_p99).if_any(r.compared),
    },
    Column {
        head: "t max",
        meaning: "Error of t in f32 ulps: largest",
        cell: |r| Cell::number(r.t_ulp_max).if_any(r.compared),
    },
    Column {
        head: "t max/κ",
        meaning: "Largest error of t in ulps, each divided by the condition of its t",
        cell: |r| Cell::number(r.t_ulp_kappa_max).if_any(r.compared),
    },
    Column {
        head: "Surface p99",
        meaning: "Distance of the hit point from the surface in f32 ulps of its largest coordinate: 99th percentile",
        cell: |r| Cell::number(r.surface_ulp_p99).if_any(r.compared),
    },
    Column {
        head: "Surface max",
        meaning: "Distance of the hit point from the surface in f32 ulps of its largest coordinate: largest",
        cell: |r| Cell::number(r.surface_ulp_max).if_any(r.compared),
    },
    Column {
        head: "Self-hits",
        meaning: "Bounced rays that hit the triangle they left",
        cell: |r| Cell::rate(r.self_hits, r.bounces),
    },
    Column {
        head: "Normal p99",
        meaning: "Error of the geometric normal in radians: 99th percentile",
        cell: |r| Cell::number(r.normal_p99).if_any(r.compared),
    },
    Column {
        head: "Normal max",
        meaning: "Error of the geometric normal in radians: largest",
        cell: |r| Cell::number(r.normal_max).if_any(r.compared),
    },
    Column {
        head: "Fallback",
        meaning: "Share of rays for which the exact tier needed more than f64",
        cell: |r| Cell::number(r.fallback_rate.unwrap_or(f64::NAN)),
    },
];

/// The columns of shapes.
pub(super) const SHAPES: &[Column<ShapeRow>] = &[
    Column { head: "Shape", meaning: "Analytic shape", cell: |r| Cell::words(&r.shape) },
    Column { head: "Form", meaning: "Formula and arithmetic", cell: |r| Cell::words(&r.form) },
    Column {
        head: "ns/test",
        meaning: "Nanoseconds for a test: median",
        cell: |r| Cell { hint: format!("{} rays", count(r.count)), ..Cell::number(r.ns_per_ray) },
    },
    Column {
        head: "False hits",
        meaning: "Hits where exactly there is none",
        cell: |r| Cell::rate(r.false_hits, r.count),
    },
    Column {
        head: "False misses",
        meaning: "No hit where exactly there is one",
        cell: |r| Cell::rate(r.false_misses, r.count),
    },
    Column { head: "t p50", meaning: "Error of t in f32 ulps: median", cell: |r| Cell::number(r.t_ulp_p50) },
    Column { head: "t p99", meaning: "Error of t in f32 ulps: 99th percentile", cell: |r| Cell::number(r.t_ulp_p99) },
    Column { head: "t max", meaning: "Error of t in f32 ulps: largest", cell: |r| Cell::number(r.t_ulp_max) },
];

/// The columns of pictures.
pub(super) const PICTURES: &[Column<PictureRow>] = &[
    Column { head: "Tier", meaning: "Tier of the whole picture", cell: |r| Cell::words(&r.tier) },
    Column { head: "Seconds", meaning: "Time to render: median", cell: |r| Cell::number(r.seconds) },
    Column { head: "× fast", meaning: "Ratio to the fast tier's time", cell: |r| Cell::number(r.ratio_to_fast) },
    Column {
        head: "RMSE",
        meaning: "Root mean square difference from the exact tier's picture, in linear radiance",
        cell: |r| Cell::number(r.rmse),
    },
    Column {
        head: "FLIP",
        meaning: "Mean visible difference from the exact tier's picture, 0 to 1",
        cell: |r| Cell::number(r.flip),
    },
    Column {
        head: "Different pixels",
        meaning: "Pixels that are not the same bit for bit",
        cell: |r| Cell {
            hint: super::panel::different(r),
            ..Cell { text: count(r.different_pixels), value: Some(r.different_pixels as f64), hint: String::new() }
        },
    },
];

/// A table of these rows. Cells hold the number that they are sorted by.
pub(super) fn table<R>(caption: &str, columns: &[Column<R>], rows: &[&R], is_part: impl Fn(&R) -> bool) -> String {
    let mut out = format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{0}\"><table><caption>{0}</caption>\n<thead><tr>",
        escape(caption)
    );
    for column in columns {
        let _ = write!(out, "<th scope=\"col\" title=\"{}\">{}</th>", escape(column.meaning), escape(column.head));
    }
    out += "</tr></thead>\n<tbody>\n";
    for row in rows {
        out += if is_part(row) { "<tr class=\"part\">" } else { "<tr>" };
        for (i, column) in columns.iter().enumerate() {
            let cell = (column.cell)(row);
            let tag = if i == 0 { "th scope=\"row\"" } else { "td" };
            let _ = write!(out, "<{tag}");
            match cell.value {
                Some(v) if v.is_finite() => drop(write!(out, " data-v=\"{v}\"")),
                Some(_) => out += " data-v=\"\"",
                None => {}
            }
            if !cell.hint.is_empty() {
                let _ = write!(out, " title=\"{}\"", escape(&cell.hint));
            }
            let _ = write!(out, ">{}</{}>", escape(&cell.text), if i == 0 { "th" } else { "td" });
        }
        out += "</tr>\n";
    }
    out + "</tbody></table></div>\n"
}
