//! Asks a model for hits: `cargo run --release -p firsthit --example query -- MODEL`
//!
//! Looks down on the model from above in a grid of rays and draws what is hit as letters, by height.

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, Ray, SceneBuilder};

fn main() -> Result<(), Box<dyn Error>> {
    let model = std::env::args().nth(1).unwrap_or_else(|| "assets/spot/spot.obj".into());
    let imported = firsthit::import::open(&model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;

    let bounds = scene.bounds();
    let size = bounds.max - bounds.min;
    for row in 0..32 {
        for column in 0..72 {
            let (u, v) = ((f64::from(column) + 0.5) / 72.0, (f64::from(row) + 0.5) / 32.0);
            let above = DVec3::new(bounds.min.x + u * size.x, bounds.max.y + 1.0, bounds.min.z + v * size.z);
            let letter = match scene.closest_hit(&Ray::new(above, DVec3::NEG_Y)) {
                None => ' ',
                Some(hit) => char::from(b"@%#*+=-:."[(((hit.t - 1.0) / size.y) * 8.99) as usize % 9]),
            };
            print!("{letter}");
        }
        println!();
    }
    Ok(())
}
