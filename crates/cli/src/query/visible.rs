//! Which parts of a model the renderer's camera sees.

use std::sync::Arc;

use firsthit_accel::Scene;
use firsthit_geometry::Ray;
use firsthit_import::SceneDesc;
use firsthit_render::{Stage, StageOptions};
use rayon::prelude::*;

use super::args::QueryArgs;
use super::open_model;
use super::sink::{Place, Sink};
use super::table::{Cell, Format, Rows, Table};
use crate::console::{Console, count};
use crate::error::{Exit, Failure};
use crate::render::view_changes;
use crate::values::Resolution;

/// What is told of each part.
pub(super) const COLUMNS: [&str; 6] = ["instance", "geometry", "name", "material", "pixels", "share"];

/// Counts the pixels of each part.
pub(super) fn run(args: &QueryArgs, place: &Place, table: Table) -> Result<Exit, Failure> {
    if table.format == Format::Npy {
        return Err(
            Failure::usage("a NumPy array has no room for the names of `visible`").hint("--format csv or jsonl")
        );
    }
    let Resolution { width, height } = args.resolution.unwrap_or(Resolution { width: 1280, height: 720 });
    let (desc, trees) = open_model(args, place, None)?;
    let desc = Arc::new(desc);
    let options = StageOptions {
        camera: args.view.camera.clone(),
        camera_changes: view_changes(&args.view),
        aspect: f64::from(width) / f64::from(height),
        ..StageOptions::default()
    };
    let stage = Stage::new(desc.clone(), trees.clone(), &options);
    let stage = stage.map_err(|e| Failure::failed(format_args!("{}: {e}", args.model.display())))?;
    let film = stage.camera().on_film(width, height);

    let starts = starts(&desc);
    let pixels = pixels(&trees, |at| film.ray(at), [width, height], &starts);
    let mut parts: Vec<(usize, usize, u64)> = starts
        .windows(2)
        .enumerate()
        .flat_map(|(i, ends)| (ends[0]..ends[1]).map(move |part| (i, part - ends[0], part)))
        .map(|(instance, geometry, part)| (instance, geometry, pixels[part]))
        .collect();
    parts.sort_by_key(|&(instance, geometry, pixels)| (std::cmp::Reverse(pixels), instance, geometry));

    let all = u64::from(width) * u64::from(height);
    let mut rows = Rows::default();
    for &(instance, geometry, pixels) in &parts {
        table.push(&cells(&desc, instance, geometry, pixels, all), &mut rows);
    }
    let mut sink = Sink::open(place, table, Some(rows.count))?;
    if sink.push(&rows)? {
        sink.finish()?;
        let seen = parts.iter().filter(|part| part.2 > 0).count() as u64;
        let name = place.name();
        let words = format_args!("done: {seen} of {} seen; wrote {name}", count(parts.len() as u64, "part"));
        Console::new(args.quiet, false).say(words);
    }
    Ok(Exit::Done)
}

/// The number of each instance's first part, and of all parts.
fn starts(desc: &SceneDesc) -> Vec<usize> {
    let counts = desc.instances.iter().map(|i| desc.meshes.get(i.mesh).map_or(0, |mesh| mesh.geometries.len()));
    let mut end = 0;
    let ends = counts.map(|count| {
        end += count;
        end
    });
    std::iter::once(0).chain(ends).collect()
}

/// In how many pixels each part is what a ray through the middle meets first.
fn pixels(
    scene: &Scene,
    ray: impl Fn([f64; 2]) -> Ray<f64> + Sync,
    [width, height]: [u32; 2],
    starts: &[usize],
) -> Vec<u64> {
    let parts = starts.last().copied().unwrap_or(0);
    let row = |mut counts: Vec<u64>, y: u32| {
        let rays: Vec<_> = (0..width).map(|x| ray([f64::from(x) + 0.5, f64::from(y) + 0.5])).collect();
        let mut hits = vec![None; rays.len()];
        scene.closest_hits(&rays, &mut hits);
        for hit in hits.iter().flatten() {
            let start = starts.get(hit.id.instance as usize).copied().unwrap_or(parts);
            if let Some(count) = counts.get_mut(start + hit.id.geometry as usize) {
                *count += 1;
            }
        }
        counts
    };
    let sum = |mut a: Vec<u64>, b: Vec<u64>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    };
    (0..height).into_par_iter().fold(|| vec![0; parts], row).reduce(|| vec![0; parts], sum)
}

fn cells(desc: &SceneDesc, instance: usize, geometry: usize, pixels: u64, all: u64) -> [Cell; 6] {
    let placed = &desc.instances[instance];
    let mesh = &desc.meshes[placed.mesh];
    let part = &mesh.geometries[geometry];
    let names = [&placed.name, &mesh.name, &part.name];
    let name = names.into_iter().find(|name| !name.is_empty()).cloned().unwrap_or_default();
    let material = part.material.and_then(|m| desc.materials.get(m)).map(|m| m.name.clone()).unwrap_or_default();
    [
        Cell::Whole(instance as i64),
        Cell::Whole(geometry as i64),
        Cell::Text(name),
        Cell::Text(material),
        Cell::Whole(pixels as i64),
        Cell::Real(pixels as f64 / all as f64),
    ]
}
