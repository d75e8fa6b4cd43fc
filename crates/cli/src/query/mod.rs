//! `firsthit query`: rays or points from a file, answers to a file.

mod args;
mod npy;
mod sink;
mod source;
mod table;
mod text;
mod visible;

use std::path::{Path, PathBuf};
use std::time::Instant;

use firsthit_accel::{BuildOptions, ClosestPoint, Crossings, Hit, HitId, Scene, SceneBuilder, Solid};
use firsthit_geometry::Ray;
use firsthit_import::{Decode, Imported, Options, SceneDesc};
use glam::DVec3;
use rayon::prelude::*;

pub(crate) use args::QueryArgs;

use self::args::{Counted, Question, Sign};
use self::sink::{Place, Sink};
use self::source::{Columns, Source};
use self::table::{Cell, Rows, Table};
use crate::args::ViewArgs;
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

/// What points are given as.
const POINTS: Columns<3> = Columns { noun: "point", names: ["x", "y", "z"], least: 3, defaults: [0.0; 3] };

/// What nearest points are told as.
const NEAREST: [&str; 12] =
    ["distance", "x", "y", "z", "instance", "geometry", "primitive", "u", "v", "nx", "ny", "nz"];

/// What hits are told as, after the index of their ray.
const HITS: [&str; 11] = ["ray", "hit", "t", "instance", "geometry", "primitive", "u", "v", "nx", "ny", "nz"];

/// Rows that are read at once. Memory is bounded by it, and by the hits of so many rays.
const BLOCK: usize = 1 << 16;

/// The same where each ray may have many hits.
const SMALL_BLOCK: usize = 1 << 12;

/// Rows that one task answers.
const CHUNK: usize = 512;

/// Answers all rays or points.
pub(crate) fn run(args: &QueryArgs) -> Result<Exit, Failure> {
    check(args)?;
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
        Question::Visible => &visible::COLUMNS,
        Question::ClosestPoint => &NEAREST,
        Question::Distance | Question::SignedDistance => &["distance"],
        Question::Contains => &["inside"],
        Question::WindingNumber => &["winding"],
    };
    let table = Table { columns, format };
    pool.install(|| match args.question {
        Question::Visible => visible::run(args, &place, table),
        question if question.has_rays() => ask(args, &place, table, &RAYS, args.rays.as_deref(), Asked::of_rays),
        _ => ask(args, &place, table, &POINTS, args.points.as_deref(), Asked::of_points),
    })
}

/// Refuses options that mean nothing for the question.
fn check(args: &QueryArgs) -> Result<(), Failure> {
    let question = args.question;
    let refuse = |asked: bool, words: &str| if asked { Err(Failure::usage(words)) } else { Ok(()) };
    refuse(args.crossings.is_some() && !question.counts(), "--crossings: only `all` and `count` count crossings")?;
    refuse(
        question != Question::Visible && (args.resolution.is_some() || args.view != ViewArgs::default()),
        "--resolution and the camera's options: only `visible` has a camera",
    )?;
    refuse(args.rays.is_some() && !question.has_rays(), "--rays: this question is not asked of rays")?;
    let has_points = !question.has_rays() && question != Question::Visible;
    refuse(args.points.is_some() && !has_points, "--points: this question is not asked of points")?;
    let sides = "--sign: only `signed-distance`, `contains` and `winding-number` tell inside from outside";
    refuse(args.sign.is_some() && !question.has_sides(), sides)
}

/// Reads the model, sparing the files that are read, and builds its trees.
fn open_model(args: &QueryArgs, place: &Place, rows: Option<&Path>) -> Result<(SceneDesc, Scene), Failure> {
    let options = Options { up: args.up, decode: Decode::Nothing, ..args.load.options() };
    let Imported { scene, report } = firsthit_import::open(&args.model, &options)?;
    Console::new(args.quiet, false).warnings(&report, args.strict)?;
    place.spare(report.files.iter().map(PathBuf::as_path).chain(rows))?;
    let build = BuildOptions { precision: args.precision, simd: simd::level()?, ..Default::default() };
    let trees = SceneBuilder::from_desc(&scene, build).build();
    let trees = trees.map_err(|e| Failure::failed(format_args!("{}: {e}", args.model.display())))?;
    Ok((scene, trees))
}

/// Reads rows from `path`, and writes what `answer` makes of them and the index of their first.
fn ask<const N: usize>(
    args: &QueryArgs,
    place: &Place,
    table: Table,
    columns: &'static Columns<N>,
    path: Option<&Path>,
    answer: fn(&Asked, &[[f64; N]], u64) -> Rows,
) -> Result<Exit, Failure> {
    let started = Instant::now();
    let stdin = Path::new("-");
    let path = path.unwrap_or(stdin);
    // Looked at first: a wrong name or format should not wait for a large model.
    let mut source = Source::open(path, columns)?;
    let (_, scene) = open_model(args, place, Some(path).filter(|path| *path != stdin))?;
    let solid = args.question.has_sides().then(|| match args.sign.and_then(Sign::method) {
        Some(method) => Solid::with_method(&scene, method),
        None => Solid::new(&scene),
    });
    let prepared = started.elapsed().as_secs_f64();

    let started = Instant::now();
    let crossings = args.crossings.unwrap_or(Counted::Triangles).into();
    let asked = Asked { scene, solid, question: args.question, crossings, table };
    let known = source.rows().filter(|_| args.question != Question::All);
    let mut sink = Sink::open(place, table, known)?;
    let block = if args.question == Question::All { SMALL_BLOCK } else { BLOCK };
    let (mut rows, mut done) = (Vec::new(), 0);
    loop {
        source.read(block, &mut rows)?;
        if rows.is_empty() {
            break;
        }
        let chunks: Vec<_> = rows.chunks(CHUNK).zip((done..).step_by(CHUNK)).collect();
        let answers: Vec<Rows> = chunks.into_par_iter().map(|(rows, first)| answer(&asked, rows, first)).collect();
        for answers in &answers {
            if !sink.push(answers)? {
                return Ok(Exit::Done);
            }
        }
        done += rows.len() as u64;
    }
    let written = sink.finish()?;
    let seconds = started.elapsed().as_secs_f64();
    Console::new(args.quiet, false).say(format_args!(
        "done: {}, {}; load and build {prepared:.2} s, answers {seconds:.2} s ({} {}s/s); wrote {}",
        count(done, columns.noun),
        count(written, "row"),
        short(done as f64 / seconds),
        columns.noun,
        place.name(),
    ));
    Ok(Exit::Done)
}

/// What is asked, and of what.
struct Asked {
    scene: Scene,
    /// Where inside and outside matter.
    solid: Option<Solid>,
    question: Question,
    crossings: Crossings,
    table: Table,
}

impl Asked {
    /// The answers to rays, of which the first has this index, in their order.
    fn of_rays(&self, rows: &[[f64; 8]], first: u64) -> Rows {
        let rays: Vec<Ray<f64>> = rows
            .iter()
            .map(|&[ox, oy, oz, dx, dy, dz, t_min, t_max]| {
                Ray::new(DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz)).with_interval(t_min, t_max)
            })
            .collect();
        let mut rows = Rows::default();
        let mut push = |cells: &[Cell]| self.table.push(cells, &mut rows);
        match self.question {
            Question::Any => {
                let mut hits = vec![false; rays.len()];
                self.scene.any_hits(&rays, &mut hits);
                hits.iter().for_each(|hit| push(&[Cell::Flag(*hit)]));
            }
            Question::Count => {
                let mut counts = vec![0; rays.len()];
                self.scene.count_hits_each(&rays, self.crossings, &mut counts);
                counts.iter().for_each(|n| push(&[Cell::Whole((*n).into())]));
            }
            Question::All => {
                let lists = self.scene.all_hits_each(&rays, self.crossings);
                for (index, hits) in (first..).zip(lists.iter()) {
                    hits.iter().for_each(|hit| push(&hit_cells(index, Some(hit))));
                }
            }
            _ => {
                let mut hits = vec![None; rays.len()];
                self.scene.closest_hits(&rays, &mut hits);
                hits.iter().for_each(|hit| push(&hit_cells(0, hit.as_ref())[1..]));
            }
        }
        rows
    }

    /// The answers to points, in their order.
    fn of_points(&self, rows: &[[f64; 3]], _: u64) -> Rows {
        let points: Vec<DVec3> = rows.iter().copied().map(DVec3::from).collect();
        let mut rows = Rows::default();
        let mut push = |cells: &[Cell]| self.table.push(cells, &mut rows);
        match (self.question, &self.solid) {
            (Question::SignedDistance, Some(solid)) => {
                let mut distances = vec![0.0; points.len()];
                solid.signed_distances(&points, &mut distances);
                distances.iter().for_each(|d| push(&[Cell::Real(*d)]));
            }
            (Question::Contains, Some(solid)) => {
                let mut inside = vec![false; points.len()];
                solid.contains_each(&points, &mut inside);
                inside.iter().for_each(|flag| push(&[Cell::Flag(*flag)]));
            }
            (_, Some(solid)) => points.iter().for_each(|p| push(&[Cell::Real(solid.winding_number(*p))])),
            (Question::Distance, None) => {
                let mut distances = vec![0.0; points.len()];
                self.scene.distances(&points, &mut distances);
                distances.iter().for_each(|d| push(&[Cell::Real(*d)]));
            }
            (_, None) => {
                let mut nearest = vec![None; points.len()];
                self.scene.closest_points(&points, f64::INFINITY, &mut nearest);
                nearest.iter().for_each(|near| push(&nearest_cells(near.as_ref())));
            }
        }
        rows
    }
}

/// A hit, or none, of ray `index` as a row of all columns.
fn hit_cells(index: u64, hit: Option<&Hit>) -> [Cell; 11] {
    use Cell::{Flag, Real, Whole};
    let index = Whole(index as i64);
    let Some(hit) = hit else {
        let [a, b, c] = [-1; 3].map(Whole);
        let [u, v, x, y, z] = [0.0; 5].map(Real);
        return [index, Flag(false), Real(f64::INFINITY), a, b, c, u, v, x, y, z];
    };
    let [a, b, c] = ids(hit.id);
    let [u, v] = [hit.u, hit.v].map(|x| Real(x.into()));
    let [x, y, z] = hit.normal().to_array().map(Real);
    [index, Flag(true), Real(hit.t), a, b, c, u, v, x, y, z]
}

/// The surface's nearest point as a row; there is none where there is no surface, and for a NaN.
fn nearest_cells(near: Option<&ClosestPoint>) -> [Cell; 12] {
    use Cell::{Real, Whole};
    let Some(near) = near else {
        let [a, b, c] = [-1; 3].map(Whole);
        let [px, py, pz] = [f64::NAN; 3].map(Real);
        let [u, v, x, y, z] = [0.0; 5].map(Real);
        return [Real(f64::INFINITY), px, py, pz, a, b, c, u, v, x, y, z];
    };
    let [px, py, pz] = near.point.to_array().map(Real);
    let [a, b, c] = ids(near.id);
    let [u, v] = [near.u, near.v].map(|x| Real(x.into()));
    let [x, y, z] = near.normal().to_array().map(Real);
    [Real(near.distance), px, py, pz, a, b, c, u, v, x, y, z]
}

fn ids(id: HitId) -> [Cell; 3] {
    [id.instance, id.geometry, id.primitive].map(|id| Cell::Whole(id.into()))
}
