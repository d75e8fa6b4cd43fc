//! `firsthit query`: rays from a file, answers to a file.

mod args;
mod npy;
mod sink;
mod source;
mod table;
mod text;

use std::path::{Path, PathBuf};
use std::time::Instant;

use firsthit_accel::{BuildOptions, Crossings, Hit, Scene, SceneBuilder};
use firsthit_geometry::Ray;
use firsthit_import::Imported;
use glam::DVec3;
use rayon::prelude::*;

pub(crate) use args::QueryArgs;

use self::args::{Counted, Question};
use self::sink::{Place, Sink};
use self::source::{Columns, Source};
use self::table::{Cell, Rows, Table};
use crate::console::{Console, count, short};
use crate::error::{Exit, Failure};
use crate::simd;

/// What rays are given as.
const RAYS: Columns<8> = Columns {
    noun: "ray",
    names: ["ox", "oy", "oz", "dx", "dy", "dz", "t_min", "t_max"],
    least: 6,
    defaults: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY],
};

/// What hits are told as, after the index of their ray.
const HITS: [&str; 11] = ["ray", "hit", "t", "instance", "geometry", "primitive", "u", "v", "nx", "ny", "nz"];

/// Rays that are read at once. Memory is bounded by it, and by the hits of so many rays.
const BLOCK: usize = 1 << 16;

/// The same where each ray may have many hits.
const SMALL_BLOCK: usize = 1 << 12;

/// Rays that one task answers.
const CHUNK: usize = 512;

/// Answers all rays.
pub(crate) fn run(args: &QueryArgs) -> Result<Exit, Failure> {
    if args.crossings.is_some() && !args.question.counts() {
        return Err(Failure::usage("--crossings: only `all` and `count` count crossings"));
    }
    let (place, format) = Place::new(&args.output, args.format)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(threads.into());
    }
    let pool = pool.build().map_err(|e| Failure::failed(format_args!("threads: {e}")))?;
    let columns = match args.question {
        Question::Closest => &HITS[1..],
        Question::All => &HITS,
        Question::Any => &["hit"],
        Question::Count => &["count"],
    };
    pool.install(|| ask(args, &place, Table { columns, format }))
}

fn ask(args: &QueryArgs, place: &Place, table: Table) -> Result<Exit, Failure> {
    let console = Console::new(args.quiet, false);
    let started = Instant::now();
    // Looked at first: a wrong name or format should not wait for a large model.
    let mut source = Source::open(&args.rays, &RAYS)?;
    let options = firsthit_import::Options { up: args.up, without_occlusion: true, ..Default::default() };
    let Imported { scene, report } = firsthit_import::open(&args.model, &options)?;
    console.warnings(&report, args.strict)?;
    let read = report.files.iter().map(PathBuf::as_path);
    place.spare(read.chain([args.rays.as_path()].into_iter().filter(|r| *r != Path::new("-"))))?;
    let build = BuildOptions { precision: args.precision, simd: simd::level()?, ..Default::default() };
    let scene = SceneBuilder::from_desc(&scene, build).build();
    let scene = scene.map_err(|e| Failure::failed(format_args!("{}: {e}", args.model.display())))?;
    let prepared = started.elapsed().as_secs_f64();

    let started = Instant::now();
    let asked = Asked {
        scene: &scene,
        question: args.question,
        crossings: args.crossings.unwrap_or(Counted::Triangles).into(),
        table,
    };
    let known = source.rows().filter(|_| args.question != Question::All);
    let mut sink = Sink::open(place, table, known)?;
    let block = if args.question == Question::All { SMALL_BLOCK } else { BLOCK };
    let (mut rows, mut rays, mut done) = (Vec::new(), Vec::new(), 0);
    loop {
        source.read(block, &mut rows)?;
        if rows.is_empty() {
            break;
        }
        rays.clear();
        rays.extend(rows.iter().map(ray));
        for answers in asked.answer(&rays, done) {
            if !sink.push(&answers)? {
                return Ok(Exit::Done);
            }
        }
        done += rays.len() as u64;
    }
    let written = sink.finish()?;
    let seconds = started.elapsed().as_secs_f64();
    console.say(format_args!(
        "done: {}, {}; load and build {prepared:.2} s, answers {seconds:.2} s ({} rays/s); wrote {}",
        count(done, "ray"),
        count(written, "row"),
        short(done as f64 / seconds),
        place.name(),
    ));
    Ok(Exit::Done)
}

fn ray(row: &[f64; 8]) -> Ray<f64> {
    let &[ox, oy, oz, dx, dy, dz, t_min, t_max] = row;
    Ray::new(DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz)).with_interval(t_min, t_max)
}

/// What is asked, and of what.
struct Asked<'a> {
    scene: &'a Scene,
    question: Question,
    crossings: Crossings,
    table: Table,
}

impl Asked<'_> {
    /// The answers to rays, of which the first has this index, in their order.
    fn answer(&self, rays: &[Ray<f64>], first: u64) -> Vec<Rows> {
        let starts = (first..).step_by(CHUNK);
        let chunks: Vec<_> = rays.chunks(CHUNK).zip(starts).collect();
        chunks.into_par_iter().map(|(rays, first)| self.answer_chunk(rays, first)).collect()
    }

    fn answer_chunk(&self, rays: &[Ray<f64>], first: u64) -> Rows {
        let mut rows = Rows::default();
        let mut push = |cells: &[Cell]| self.table.push(cells, &mut rows);
        match self.question {
            Question::Closest => {
                let mut hits = vec![None; rays.len()];
                self.scene.closest_hits(rays, &mut hits);
                hits.iter().for_each(|hit| push(&cells(0, hit.as_ref())[1..]));
            }
            Question::Any => {
                let mut hits = vec![false; rays.len()];
                self.scene.any_hits(rays, &mut hits);
                hits.iter().for_each(|hit| push(&[Cell::Flag(*hit)]));
            }
            Question::Count => {
                let mut counts = vec![0; rays.len()];
                self.scene.count_hits_each(rays, self.crossings, &mut counts);
                counts.iter().for_each(|n| push(&[Cell::Whole((*n).into())]));
            }
            Question::All => {
                let lists = self.scene.all_hits_each(rays, self.crossings);
                for (index, hits) in (first..).zip(lists.iter()) {
                    hits.iter().for_each(|hit| push(&cells(index, Some(hit))));
                }
            }
        }
        rows
    }
}

/// A hit, or none, of ray `index` as a row of all columns.
fn cells(index: u64, hit: Option<&Hit>) -> [Cell; 11] {
    use Cell::{Flag, Real, Whole};
    let index = Whole(index as i64);
    let Some(hit) = hit else {
        let [none, zero] = [Whole(-1), Real(0.0)];
        return [index, Flag(false), Real(f64::INFINITY), none, none, none, zero, zero, zero, zero, zero];
    };
    let id = hit.id;
    let [instance, geometry, primitive] = [id.instance, id.geometry, id.primitive].map(|id| Whole(id.into()));
    let [u, v] = [hit.u, hit.v].map(|x| Real(x.into()));
    let [x, y, z] = hit.normal().to_array().map(Real);
    [index, Flag(true), Real(hit.t), instance, geometry, primitive, u, v, x, y, z]
}
