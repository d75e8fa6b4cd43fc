//! `firsthit bench --render`: how fast pictures become good.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use firsthit_import::Imported;
use firsthit_measure::Subject;
use firsthit_measure::bench::{PartsRow, RenderBench, RenderBenchOptions, RenderRow, RenderSubject, run_renders};
use firsthit_render::Monitor as _;

use super::{BenchArgs, or};
use crate::console::{Console, print, print_json, short, visible};
use crate::error::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::measured;
use crate::progress::{Progress, Style};
use crate::simd;

/// Renders the scenes of the arguments.
pub(super) fn run(args: &BenchArgs, console: Console) -> Result<Exit, Failure> {
    let usual = RenderBenchOptions::default();
    let spp = if args.quick { vec![4, 16] } else { usual.spp };
    let options = RenderBenchOptions {
        spp: or(&args.spp, spp),
        threads: args.threads.map_or(usual.threads, |n| vec![n.into()]),
        size: args.resolution.map_or(usual.size, |r| (r.width, r.height)),
        seed: args.seed.unwrap_or(usual.seed),
        simd: simd::level()?,
    };
    let interrupt = Interrupt::listen(console, "printing what was measured so far");
    let mut subjects = Vec::new();
    for path in &args.models {
        subjects.push(subject(path, args, console)?);
    }
    if args.builtin || subjects.is_empty() {
        let Subject { name, desc, .. } = Subject::builtin();
        subjects.push(RenderSubject { name, scene: Arc::new(desc), reference: None });
    }
    interrupt.begin();
    let style = Style::new(args.progress, args.no_progress, args.quiet);
    let progress = Progress::new(style, "rendering", interrupt.clone());
    let bench = run_renders(&subjects, &options, &progress);
    progress.finish();
    let bench = bench.map_err(Failure::failed)?;
    if args.json {
        print_json(&bench)?;
    } else {
        print(text(&bench).as_bytes())?;
    }
    Ok(if progress.cancelled() { Exit::Interrupted } else { Exit::Done })
}

fn subject(path: &Path, args: &BenchArgs, console: Console) -> Result<RenderSubject, Failure> {
    let scene_file = path.join("scene.json");
    let file = if scene_file.is_file() { scene_file } else { path.to_owned() };
    let options = firsthit_import::Options { up: args.up, ..Default::default() };
    let Imported { scene, report } = firsthit_import::open(&file, &options)?;
    console.warnings(&report, false)?;
    Ok(RenderSubject::read(&name(path, &args.models), &file, scene)?)
}

/// Scenes that are called `scene.json` go by their folders; those that would be called the same, by their paths.
fn name(path: &Path, all: &[PathBuf]) -> String {
    let folders: Vec<PathBuf> = all.iter().map(|p| folder(p).to_owned()).collect();
    measured::name(folder(path), &folders)
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|f| path.ends_with("scene.json") && f.file_name().is_some()).unwrap_or(path)
}

/// Everything that was measured, as tables for a terminal.
fn text(bench: &RenderBench) -> String {
    let mut out = String::new();
    let mut last = "";
    for row in &bench.rows {
        if row.scene != last {
            end_scene(&mut out, bench, last);
            last = &row.scene;
            let _ = writeln!(
                out,
                "{}\n  {:>7} {:>5} {:>9} {:>8} {:>8} {:>9} {:>9} {:>10} {:>11} {:>10}",
                visible(last),
                "threads",
                "spp",
                "seconds",
                "rays",
                "Mrays/s",
                "MSE",
                "trimmed",
                "mean ratio",
                "1/(s x MSE)",
                "s x trimmed"
            );
        }
        line(&mut out, row);
    }
    end_scene(&mut out, bench, last);
    measured::end(&mut out, &bench.machine, "", bench.seed, bench.seconds, &bench.notes);
    out
}

fn line(out: &mut String, row: &RenderRow) {
    let number = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:.2e}"));
    let ratio = row.mean_ratio.map_or("-".into(), |x| format!("{x:.4}"));
    let cost = row.cost.map_or("-".into(), |x| format!("{x:.5}"));
    let efficiency = row.efficiency.map_or("-".into(), short);
    let _ = writeln!(
        out,
        "  {:7} {:5} {:9.3} {:>8} {:8.2} {:>9} {:>9} {ratio:>10} {efficiency:>11} {cost:>10}",
        row.threads,
        row.spp,
        row.seconds,
        short(row.rays as f64),
        row.mrays_per_s,
        number(row.mse),
        number(row.trimmed_rel_mse),
    );
}

/// Where the time of a scene goes.
fn end_scene(out: &mut String, bench: &RenderBench, scene: &str) {
    if let Some(p) = bench.parts.iter().find(|p| p.scene == scene) {
        let PartsRow { traversal, shading, texturing, sampling, .. } = p;
        let percent = |x: &f64| format!("{:.0} %", 100.0 * x);
        let _ = writeln!(
            out,
            "  time: traversal {}, shading {}, texturing {}, sampling {}\n",
            percent(traversal),
            percent(shading),
            percent(texturing),
            percent(sampling)
        );
    }
}
