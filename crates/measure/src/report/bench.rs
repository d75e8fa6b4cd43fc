//! The page of a measurement of speed.

use std::fmt::Write as _;

use super::{
    bars::{self, Bar},
    chart::{Chart, Mark, Point},
    html::{facts_section, page, tabbed},
    panel::{capital, distinct},
    table::{Cell, Column, table},
    text::{count, counted, escape, number},
};
use crate::bench::{Bench, BenchModel, BuildRow, SpeedRow};

/// What the page says of its numbers.
const METHOD: &str = "<div class=\"prose\"><p>All engines were asked the same rays in turn, over and over, so that what \
disturbs the machine disturbs all alike. A <b>bar</b> is the median of the repetitions, the line behind it goes on to the \
best. <b>Primary</b> rays come from the camera that <code>firsthit render</code> would choose, <b>shadow</b> rays go from \
what it sees to a light, <b>ao</b> and <b>diffuse</b> rays leave from there as a matt surface scatters, those of ao no \
longer than a tenth of the model; <b>random</b> rays start anywhere in the model's box. Shadow and ao rays ask only whether \
there is a hit. <b>Bytes</b> are those of trees and primitives. obvhs's own traversals are those of its crate, in single \
precision and without padding: they may leak.</p></div>\n";

/// The page: speeds as bars, memory against speed, builds, tables, machine and method.
///
/// It is one file that needs nothing but itself, as that of [`html`](super::html()).
///
/// ```
/// use firsthit_measure::{report, bench::{Bench, BenchModel}};
/// let model = BenchModel { name: "<ball>.obj".into(), triangles: 3 };
/// let page = report::bench_html(&Bench { models: vec![model], ..Bench::default() });
/// assert!(page.contains("&lt;ball&gt;.obj"));
/// ```
#[must_use]
pub fn bench_html(bench: &Bench) -> String {
    let mut body = String::from("<header>\n<p class=\"brand\">firsthit bench</p>\n<h1>How fast rays are</h1>\n");
    for model in &bench.models {
        let _ = writeln!(
            body,
            "<section class=\"verdict\"><h2>{} <small>{}</small></h2><p>{}</p></section>",
            escape(&model.name),
            counted(model.triangles, "triangle"),
            escape(&verdict(bench, model))
        );
    }
    body += "</header>\n<main>\n";
    for (i, model) in bench.models.iter().enumerate() {
        model_section(&mut body, bench, model, i);
    }
    let facts = [
        (
            "Noise of timings",
            format!("{} % (interquartile range over median of the same work)", number(100.0 * bench.machine.noise)),
        ),
        ("Threads", bench.threads.to_string()),
        ("Seed of all rays", bench.seed.to_string()),
        ("Time in all", format!("{} s", number(bench.seconds))),
        ("Version", format!("firsthit {}", bench.version)),
    ];
    facts_section(&mut body, &bench.machine, &facts, &bench.notes);
    body += METHOD;
    body += "</section>\n</main>\n";
    let names: Vec<&str> = bench.models.iter().map(|m| m.name.as_str()).collect();
    page(&format!("How fast rays are: {}", names.join(", ")), &body)
}

/// A plain sentence: which engine is fastest, by the geometric mean over all kinds of rays.
fn verdict(bench: &Bench, model: &BenchModel) -> String {
    let of_model = || bench.rows.iter().filter(|r| r.model == model.name);
    let mean = |engine: &str| {
        let logs: Vec<f64> = of_model().filter(|r| r.engine == engine).map(|r| r.mrays_per_s_median.ln()).collect();
        (logs.iter().sum::<f64>() / logs.len() as f64).exp()
    };
    let mut means: Vec<(f64, &str)> =
        distinct(of_model().map(|r| r.engine.as_str())).into_iter().map(|e| (mean(e), e)).collect();
    means.sort_by(|a, b| b.0.total_cmp(&a.0));
    match means.as_slice() {
        [] => "Nothing was measured.".into(),
        [(speed, engine)] => format!("{engine}: {} million rays a second over all kinds of rays.", number(*speed)),
        [(speed, first), .., (_, last)] => format!(
            "Fastest over all kinds of rays is {first}, with {} million rays a second: {} times the speed of {last}.",
            number(*speed),
            number(speed / means[means.len() - 1].0)
        ),
    }
}

fn model_section(out: &mut String, bench: &Bench, model: &BenchModel, index: usize) {
    let builds: Vec<&BuildRow> = bench.builds.iter().filter(|b| b.model == model.name).collect();
    let rows: Vec<&SpeedRow> = bench.rows.iter().filter(|r| r.model == model.name).collect();
    if builds.is_empty() {
        return;
    }
    let _ = writeln!(out, "<section id=\"model-{index}\"><h2>{}</h2>", escape(&model.name));
    let kinds = distinct(rows.iter().map(|r| r.rays.as_str()));
    let tabs = kinds.iter().map(|kind| {
        let of_kind: Vec<&SpeedRow> = rows.iter().copied().filter(|r| r.rays == *kind).collect();
        let title = format!("{} rays", capital(kind));
        let figures = [speeds(&title, &of_kind), memory(&model.name, &title, &of_kind, &builds).draw("")];
        let figures = figures.map(|f| format!("<figure>{}</figure>\n", f.trim_end())).concat();
        let numbers = table(&format!("{}: {kind} rays", model.name), SPEEDS, &of_kind, |_| false);
        (title, format!("<div class=\"charts\">\n{figures}</div>\n{numbers}"))
    });
    out.push_str(&tabbed(&format!("m{index}"), "Kind of rays", tabs));
    let _ = writeln!(
        out,
        "<h3>Builds</h3>\n{}</section>",
        table(&format!("{}: builds", model.name), BUILDS, &builds, |_| false)
    );
}

fn speeds(title: &str, rows: &[&SpeedRow]) -> String {
    let bar = |r: &&SpeedRow| Bar {
        label: r.engine.clone(),
        value: r.mrays_per_s_median,
        best: r.mrays_per_s_best,
        class: tier(&r.engine),
        tip: tip(r),
    };
    let bars: Vec<Bar> = rows.iter().map(bar).collect();
    bars::draw(title, "million rays a second, more is better: median, line to the best", &bars)
}

fn memory(model: &str, title: &str, rows: &[&SpeedRow], builds: &[&BuildRow]) -> Chart {
    let point = |r: &&SpeedRow| {
        let build = builds.iter().find(|b| b.engine == r.engine)?;
        let ns = |speed: f64| 1e3 / speed;
        Some(Point {
            mark: tier(&r.engine).map_or(Mark::Other, Mark::Tier),
            label: r.engine.clone(),
            time: [ns(r.mrays_per_s_best), ns(r.mrays_per_s_median), ns(r.mrays_per_s_median)],
            error: build.bytes_per_triangle,
            worst: None,
            tip: format!("{}\n{} bytes a triangle", tip(r), number(build.bytes_per_triangle)),
        })
    };
    Chart {
        slug: super::text::slug(&format!("{model} {title} memory")),
        title: "Memory and speed".into(),
        subtitle: "bytes a triangle, less is better".into(),
        time_axis: "ns per ray, less is better; lines begin at the best".into(),
        close: true,
        points: rows.iter().filter_map(point).collect(),
        ..Chart::default()
    }
}

fn tip(r: &SpeedRow) -> String {
    format!(
        "{}, {} rays\n{} million rays a second, {} in the best of {}\n{} of {} rays hit",
        r.engine,
        r.rays,
        number(r.mrays_per_s_median),
        number(r.mrays_per_s_best),
        counted(r.repetitions, "repetition"),
        count(r.hits),
        count(r.count)
    )
}

/// The tier that an engine's name begins with.
fn tier(engine: &str) -> Option<usize> {
    ["fast ", "robust ", "double ", "exact "].iter().position(|t| engine.starts_with(t))
}

const SPEEDS: &[Column<SpeedRow>] = &[
    Column { head: "Engine", meaning: "Tier and layout, or obvhs's own tree", cell: |r| Cell::words(&r.engine) },
    Column {
        head: "Mrays/s",
        meaning: "Million rays a second: median of the repetitions",
        cell: |r| Cell::number(r.mrays_per_s_median).hint(counted(r.repetitions, "repetition")),
    },
    Column {
        head: "best",
        meaning: "Million rays a second in the best repetition",
        cell: |r| Cell::number(r.mrays_per_s_best),
    },
    Column { head: "ns/ray", meaning: "Median time of a ray", cell: |r| Cell::number(1e3 / r.mrays_per_s_median) },
    Column {
        head: "Boxes/ray",
        meaning: "Boxes tested for a ray; a wide node has eight",
        cell: |r| Cell::number(r.boxes_per_ray.unwrap_or(f64::NAN)),
    },
    Column {
        head: "Primitives/ray",
        meaning: "Triangles and shapes tested for a ray",
        cell: |r| Cell::number(r.primitives_per_ray.unwrap_or(f64::NAN)),
    },
    Column {
        head: "Hits, %",
        meaning: "Share of rays that hit something",
        cell: |r| {
            Cell::number(100.0 * r.hits as f64 / r.count as f64).hint(format!(
                "{} of {}",
                count(r.hits),
                count(r.count)
            ))
        },
    },
];

const BUILDS: &[Column<BuildRow>] = &[
    Column { head: "Engine", meaning: "Tier and layout, or obvhs's own tree", cell: |b| Cell::words(&b.engine) },
    Column { head: "Build, s", meaning: "Seconds to build, once", cell: |b| Cell::number(b.seconds) },
    Column {
        head: "SAH cost",
        meaning: "Cost of the tree by the surface-area heuristic",
        cell: |b| Cell::number(b.sah_cost.unwrap_or(f64::NAN)),
    },
    Column {
        head: "Depth",
        meaning: "Nodes from the root to the deepest leaf",
        cell: |b| Cell::number(b.depth.map_or(f64::NAN, f64::from)),
    },
    Column {
        head: "Bytes/triangle",
        meaning: "Trees and primitives, for each stored triangle",
        cell: |b| Cell::number(b.bytes_per_triangle),
    },
];
