//! Input and answers that are independent of the library: meshes, random numbers, a plain ray caster, a reader of bare
//! OBJ files.

use std::path::Path;

use glam::Vec3;

pub use firsthit_measure::flat::{FlatHit, FlatScene};
pub use firsthit_measure::mesh::{Mesh, grid_cube, icosphere, soup, torus};
pub use firsthit_measure::random::{Aim, Rng};

/// Positions and fanned faces of an OBJ file, nothing else of it; `None` where it cannot be read.
#[must_use]
pub fn read_obj(path: &Path) -> Option<Mesh> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let v: Vec<f32> = words.take(3).filter_map(|w| w.parse().ok()).collect();
                mesh.positions.push(Vec3::from_slice(v.get(..3)?));
            }
            Some("f") => {
                let f: Vec<u32> = words.filter_map(|w| w.split('/').next()?.parse().ok()).map(|i: u32| i - 1).collect();
                mesh.triangles.extend((2..f.len()).map(|k| [f[0], f[k - 1], f[k]]));
            }
            _ => {}
        }
    }
    Some(mesh)
}
