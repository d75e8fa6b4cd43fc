//! Rays that get lost through closed meshes: firsthit by tier beside its peers, on the same single-precision rays.
//!
//! `cargo run --release -p firsthit-benches --bin leaks -- [--rays N] [--seed S] [OBJ X,Y,Z]...`
//!
//! An icosphere of 81,920 triangles, a torus and a cube on an integer grid, as they are and moved by 1e4 in every axis;
//! and any closed OBJ file with a point inside. Recipe: origins spread over a small cube inside; targets a third each
//! vertices, points of edges, points of faces, of triangles picked evenly; every second direction normalised; all in
//! f32. Every ray must hit.

use std::path::PathBuf;
use std::process::ExitCode;

use firsthit_benches::peer::{self, Ray32};
use firsthit_measure::mesh::{Mesh, grid_cube, icosphere, torus};
use firsthit_measure::random::{Aim, Rng};
use firsthit_tests::oracle::read_obj;
use glam::DVec3;
use rayon::prelude::*;

/// A closed mesh, and a cube inside it: centre and half size.
struct Closed {
    name: String,
    mesh: Mesh,
    inside: (DVec3, f64),
}

fn main() -> ExitCode {
    match parse(std::env::args().skip(1)) {
        Ok((rays, seed, meshes)) => {
            run(rays, seed, &meshes);
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}\nusage: leaks [--rays N] [--seed S] [OBJ X,Y,Z]...");
            ExitCode::from(2)
        }
    }
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Result<(usize, u64, Vec<Closed>), String> {
    let (mut rays, mut seed) = (300_000, 1);
    let mut meshes = builtin();
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or(format!("{argument}: a value is missing"))?;
        match argument.as_str() {
            "--rays" => rays = value.parse().map_err(|e| format!("--rays {value}: {e}"))?,
            "--seed" => seed = value.parse().map_err(|e| format!("--seed {value}: {e}"))?,
            file => {
                let path = PathBuf::from(file);
                let mesh = read_obj(&path).ok_or(format!("{file}: cannot be read"))?;
                let point: Vec<f64> = value.split(',').map_while(|x| x.parse().ok()).collect();
                let [x, y, z] = point[..] else { return Err(format!("{value}: not a point X,Y,Z")) };
                let size = mesh.positions.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                meshes.push(Closed { name, mesh, inside: (DVec3::new(x, y, z), 0.02 * f64::from(size)) });
            }
        }
    }
    Ok((rays, seed, meshes))
}

fn builtin() -> Vec<Closed> {
    let closed = |name: &str, mesh, centre, half| Closed { name: name.into(), mesh, inside: (centre, half) };
    let mut meshes = vec![
        closed("icosphere", icosphere(6), DVec3::ZERO, 0.4),
        closed("torus", torus(192, 96, 0.4), DVec3::X, 0.1),
        closed("grid", grid_cube(64), DVec3::ZERO, 0.4),
    ];
    let moved = |c: &Closed| Closed {
        name: format!("{} at 1e4", c.name),
        mesh: c.mesh.clone().map(|p| p + 1e4),
        inside: (c.inside.0 + 1e4, c.inside.1),
    };
    meshes.extend(meshes.iter().map(moved).collect::<Vec<_>>());
    meshes
}

fn run(count: usize, seed: u64, meshes: &[Closed]) {
    println!("{count} rays for each mesh and engine, seed {seed}; lost: aimed at vertices, edges, faces");
    for Closed { name, mesh, inside } in meshes {
        println!("\n{name}, {} triangles", mesh.triangles.len());
        for (engine, peer) in peer::all(mesh) {
            let lost = Aim::ALL.map(|aim| {
                let chunk = 1 << 16;
                let third = count / 3;
                let lost = |start: usize| {
                    let n = chunk.min(third - start);
                    let rays = aimed(mesh, *inside, aim, n, seed ^ (start as u64) << 8);
                    n - peer.count_hits(&rays)
                };
                (0..third).step_by(chunk).collect::<Vec<_>>().into_par_iter().map(lost).sum::<usize>()
            });
            let all: usize = lost.iter().sum();
            let rate = if all == 0 {
                format!("< {:.0e}", 3.0 / count as f64)
            } else {
                format!("{:.1e}", all as f64 / count as f64)
            };
            println!("  {engine:16} {:8} {:8} {:8}   rate {rate}", lost[0], lost[1], lost[2]);
        }
    }
}

fn aimed(mesh: &Mesh, (centre, half): (DVec3, f64), aim: Aim, count: usize, seed: u64) -> Vec<Ray32> {
    let mut rng = Rng(seed);
    (0..count)
        .map(|k| {
            let origin = (centre + rng.in_cube() * half).as_vec3();
            let target = aim.point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng).as_vec3();
            let direction = target - origin;
            Ray32::new(origin, if k % 2 == 1 { direction.normalize() } else { direction })
        })
        .collect()
}
