//! A measurement of speed as tables for a terminal.

use std::fmt::Write as _;

use firsthit_measure::bench::{Bench, BuildRow, SpeedRow};

use crate::console::{grouped, visible};
use crate::measured;

/// Everything that was measured.
pub(crate) fn text(bench: &Bench) -> String {
    let mut out = String::new();
    for model in &bench.models {
        let _ = writeln!(out, "{}: {} triangles", visible(&model.name), grouped(model.triangles));
        builds(&mut out, bench.builds.iter().filter(|b| b.model == model.name));
        let rows: Vec<&SpeedRow> = bench.rows.iter().filter(|r| r.model == model.name).collect();
        speeds(&mut out, &rows);
        out.push('\n');
    }
    let threads = format!(" threads: {};", bench.threads);
    measured::end(&mut out, &bench.machine, &threads, bench.seed, bench.seconds, &bench.notes);
    out
}

fn builds<'a>(out: &mut String, rows: impl Iterator<Item = &'a BuildRow>) {
    let _ =
        writeln!(out, "  {:24} {:>9} {:>9} {:>6} {:>15}", "engine", "build, s", "SAH cost", "depth", "bytes/triangle");
    for r in rows {
        let cost = r.sah_cost.map_or("-".into(), |c| format!("{c:.1}"));
        let depth = r.depth.map_or("-".into(), |d| d.to_string());
        let _ = writeln!(out, "  {:24} {:9.3} {cost:>9} {depth:>6} {:15.1}", r.engine, r.seconds, r.bytes_per_triangle);
    }
}

fn speeds(out: &mut String, rows: &[&SpeedRow]) {
    let mut last = "";
    for r in rows {
        if last.is_empty() {
            let _ = writeln!(
                out,
                "  {:8} {:24} {:>9} {:>9} {:>9} {:>10} {:>14} {:>7}",
                "rays", "engine", "Mrays/s", "best", "ns/ray", "boxes/ray", "primitives/ray", "hits"
            );
        }
        let rays = if last == r.rays { "" } else { &r.rays };
        last = &r.rays;
        let mean = |n: Option<f64>| n.map_or("-".into(), |n| format!("{n:.1}"));
        let _ = writeln!(
            out,
            "  {rays:8} {:24} {:9.2} {:9.2} {:9.1} {:>10} {:>14} {:5.1} %",
            r.engine,
            r.mrays_per_s_median,
            r.mrays_per_s_best,
            1e3 / r.mrays_per_s_median,
            mean(r.boxes_per_ray),
            mean(r.primitives_per_ray),
            100.0 * r.hits as f64 / r.count as f64
        );
    }
}
