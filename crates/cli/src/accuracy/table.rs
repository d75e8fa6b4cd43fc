//! A measurement as tables for a terminal.

use std::fmt::Write as _;

use firsthit_measure::result::{Accuracy, Model, ShapeRow, TierRow};
use firsthit_measure::verdict::rate;

use crate::console::{grouped, visible};
use crate::measured;

/// Everything that was measured.
pub(crate) fn text(accuracy: &Accuracy) -> String {
    let mut out = String::new();
    for model in &accuracy.models {
        let rows: Vec<&TierRow> = accuracy.tiers.iter().filter(|r| r.model == model.name).collect();
        head(&mut out, model);
        tiers(&mut out, rows.iter().copied().filter(|r| r.guard.is_empty()));
        guards(&mut out, &rows);
        pictures(&mut out, accuracy, model);
        let _ = writeln!(out, "\n{}\n", visible(&model.verdict));
    }
    shapes(&mut out, &accuracy.shapes);
    measured::end(&mut out, &accuracy.machine, "", accuracy.seed, accuracy.seconds, &accuracy.notes);
    out
}

fn head(out: &mut String, model: &Model) {
    let closed = if model.closed { "closed" } else { "not closed" };
    let _ = writeln!(out, "{}: {} triangles, {closed}", visible(&model.name), grouped(model.triangles));
}

/// A count of failures in `n`: none is a bound of the rate.
fn failures(count: u64, n: u64) -> String {
    match (count, n) {
        (_, 0) => "-".into(),
        (0, _) => format!("< {}", rate(0, n)),
        _ => grouped(count),
    }
}

fn number(x: f64) -> String {
    match x {
        x if x.is_nan() => "-".into(),
        0.0 => "0".into(),
        x if (0.01..1000.0).contains(&x.abs()) => format!("{x:.2}"),
        x => format!("{x:.0e}"),
    }
}

fn tiers<'a>(out: &mut String, rows: impl Iterator<Item = &'a TierRow>) {
    let mut last = "";
    for r in rows {
        if last.is_empty() {
            let _ = writeln!(
                out,
                "  {:10} {:7} {:>8} {:>7} {:>7} {:>10} {:>10} {:>10} {:>10} {:>10}  t error in ulp: 50 %, 99 %, max",
                "rays", "tier", "ns/ray", "+-", "x fast", "leaks", "slipped", "false hit", "false miss", "self-hits"
            );
        }
        let rays = if last == r.rays { "" } else { &r.rays };
        last = &r.rays;
        let spread = 50.0 * (r.ns_high - r.ns_low) / r.ns_per_ray;
        let leaks = r.leaks.map_or("-".into(), |n| failures(n, r.aimed_rays));
        let _ = writeln!(
            out,
            "  {rays:10} {:7} {:8.1} {spread:5.1} % {:7.2} {leaks:>10} {:>10} {:>10} {:>10} {:>10}  {}, {}, {}{}",
            r.tier,
            r.ns_per_ray,
            r.ratio_to_fast,
            failures(r.slipped, r.compared),
            failures(r.false_hits, r.compared),
            failures(r.false_misses, r.compared),
            failures(r.self_hits, r.bounces),
            number(r.t_ulp_p50),
            number(r.t_ulp_p99),
            number(r.t_ulp_max),
            r.fallback_rate.map_or(String::new(), |f| format!("; beyond f64: {:.2} %", f * 100.0))
        );
    }
}

/// What each guard of the robust tier does: a line each, a column for each kind of rays.
fn guards(out: &mut String, rows: &[&TierRow]) {
    let mut names: Vec<&str> = Vec::new();
    let mut kinds: Vec<&str> = Vec::new();
    for r in rows.iter().filter(|r| !r.guard.is_empty()) {
        if !names.contains(&r.guard.as_str()) {
            names.push(&r.guard);
        }
        if !kinds.contains(&r.rays.as_str()) {
            kinds.push(&r.rays);
        }
    }
    if names.is_empty() {
        return;
    }
    let _ = write!(out, "  {:18}", "robust, guards");
    for kind in &kinds {
        let _ = write!(out, " {kind:>10}");
    }
    let _ = writeln!(
        out,
        "  {:>10} {:>10} {:>10} {:>10} {:>10}",
        "leaks", "slipped", "false hit", "false miss", "self-hits"
    );
    let whole = rows.iter().any(|r| r.guard.is_empty() && r.tier == "robust");
    for name in names.into_iter().chain(whole.then_some("")) {
        let of: Vec<&&TierRow> = rows.iter().filter(|r| r.guard == name && r.tier == "robust").collect();
        let _ = write!(out, "  {:18}", if name.is_empty() { "all" } else { name });
        for kind in &kinds {
            let ratio = of.iter().find(|r| r.rays == *kind).map_or(f64::NAN, |r| r.ratio_to_fast);
            let _ = write!(out, " {:>10}", number(ratio));
        }
        let sum = |f: fn(&TierRow) -> u64| of.iter().map(|r| f(r)).sum::<u64>();
        let _ = writeln!(
            out,
            "  {:>10} {:>10} {:>10} {:>10} {:>10}",
            failures(sum(|r| r.leaks.unwrap_or(0)), sum(|r| r.aimed_rays)),
            failures(sum(|r| r.slipped), sum(|r| r.compared)),
            failures(sum(|r| r.false_hits), sum(|r| r.compared)),
            failures(sum(|r| r.false_misses), sum(|r| r.compared)),
            failures(sum(|r| r.self_hits), sum(|r| r.bounces))
        );
    }
}

fn pictures(out: &mut String, accuracy: &Accuracy, model: &Model) {
    let mut rows = accuracy.pictures.iter().filter(|r| r.model == model.name).peekable();
    if rows.peek().is_some() {
        let _ = writeln!(
            out,
            "  {:10} {:7} {:>8} {:>15} {:>10} {:>10} {:>18}",
            "picture", "tier", "s", "x fast", "RMSE", "FLIP", "pixels that differ"
        );
    }
    for r in rows {
        let _ = writeln!(
            out,
            "  {:10} {:7} {:8.3} {:15.2} {:>10} {:>10} {:>18}",
            "",
            r.tier,
            r.seconds,
            r.ratio_to_fast,
            number(r.rmse),
            number(r.flip),
            format!("{} of {}", grouped(r.different_pixels), grouped(r.pixels))
        );
    }
}

fn shapes(out: &mut String, rows: &[ShapeRow]) {
    let mut last = ("", "");
    for r in rows {
        if last.0.is_empty() {
            let _ = writeln!(
                out,
                "{:9} {:5} {:14} {:>8} {:>10} {:>10}  t error in ulp: 50 %, 99 %, max",
                "shape", "rays", "form", "ns/ray", "false hit", "false miss"
            );
        }
        let here = (r.shape.as_str(), r.rays.as_str());
        let _ = writeln!(
            out,
            "{:9} {:5} {:14} {:8.1} {:>10} {:>10}  {}, {}, {}",
            if last.0 == here.0 { "" } else { here.0 },
            if last == here { "" } else { here.1 },
            r.form,
            r.ns_per_ray,
            failures(r.false_hits, r.count),
            failures(r.false_misses, r.count),
            number(r.t_ulp_p50),
            number(r.t_ulp_p99),
            number(r.t_ulp_max)
        );
        last = here;
    }
    if !rows.is_empty() {
        out.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_is_a_bound() {
        assert_eq!(failures(0, 30_000), "< 1.0e-4");
        assert_eq!([failures(0, 0), failures(1234, 30_000)], ["-", "1 234"]);
    }
}
