//! Writes the built-in studio as a picture by longitude and latitude: `cargo run --release -p firsthit-render
//! --example studio -- studio.png`.

use firsthit_render::film::Picture;
use firsthit_render::output::{BitDepth, write_png};
use firsthit_render::{Environment, View};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "studio.png".into());
    let studio = Environment::studio(0.0, Vec3::ONE);
    let (width, height) = (1024, 512);
    let pixels = (0..width * height)
        .map(|i| {
            // -Z at both ends, +Z (towards the viewer of a front view) in the middle.
            let phi = TAU * ((i % width) as f32 + 0.5) / width as f32;
            let theta = PI * ((i / width) as f32 + 0.5) / height as f32;
            let direction = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
            studio.radiance(direction).extend(1.0).to_array()
        })
        .collect();
    let mut file = std::fs::File::create(path)?;
    write_png(&mut file, &Picture { width, height, pixels }, &View::default(), BitDepth::Eight)?;
    Ok(())
}
