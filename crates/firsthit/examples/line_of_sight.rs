//! Who sees whom: `cargo run --release -p firsthit --example line_of_sight -- MODEL`
//!
//! Posts stand in a ring around the model; a cross marks the pairs between which it does not stand.

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// For each post, which others it sees.
pub(crate) fn run(model: &str, posts: u32) -> Result<Vec<Vec<bool>>> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let (center, radius) = (scene.bounds().center(), scene.bounds().extent().length() * 0.6);
    let at = |k: u32| {
        let angle = f64::from(k) / f64::from(posts) * std::f64::consts::TAU;
        center + DVec3::new(angle.cos(), 0.0, angle.sin()) * radius
    };
    let rays: Vec<Ray<f64>> = (0..posts * posts).map(|k| Ray::segment(at(k / posts), at(k % posts))).collect();
    // All at once, on all cores. A segment from a post to itself has no length, and meets nothing.
    let mut blocked = vec![false; rays.len()];
    scene.par_any_hits(&rays, &mut blocked);
    Ok(blocked.chunks(posts as usize).map(|row| row.iter().map(|b| !b).collect()).collect())
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let model = std::env::args().nth(1).unwrap_or_else(|| "assets/spot/spot.obj".into());
    for row in run(&model, 24)? {
        println!("{}", row.iter().map(|sees| if *sees { " x" } else { " ." }).collect::<String>());
    }
    Ok(())
}
