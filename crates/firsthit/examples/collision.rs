//! A ball falls onto a model: `cargo run --release -p firsthit --example collision -- MODEL`
//!
//! It can fall as far as the nearest point of the surface is away without touching anything: so a few distances are enough to
//! find where it touches, and no step is ever too long, however thin the surface.

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, ClosestPoint, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Where the middle of a ball comes to rest that falls from above the middle of the model's box, shifted by a part of its size;
/// and what it touches there. `None` if it falls past the model.
pub(crate) fn run(model: &str, shift: [f64; 2], radius: f64) -> Result<Option<(DVec3, ClosestPoint, u32)>> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let (bounds, size) = (scene.bounds(), scene.bounds().extent());
    let radius = radius * size.max_element();
    let mut ball = bounds.center() + DVec3::new(shift[0] * size.x, size.y + radius, shift[1] * size.z);
    let mut steps = 0;
    while ball.y > bounds.min.y - radius {
        let nearest = scene.closest_point(ball).ok_or("there are no triangles")?;
        let free = nearest.distance - radius;
        if free < 1e-9 * size.max_element() {
            return Ok(Some((ball, nearest, steps)));
        }
        ball.y -= free;
        steps += 1;
    }
    Ok(None)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let model = std::env::args().nth(1).unwrap_or_else(|| "assets/spot/spot.obj".into());
    for shift in [[0.0, 0.0], [0.1, -0.3], [0.0, 0.4], [0.45, 0.45]] {
        match run(&model, shift, 0.05)? {
            None => println!("{shift:?}: it falls past"),
            Some((ball, at, steps)) => {
                println!(
                    "{shift:?}: it touches triangle {} at {:.3} and rests at {ball:.3}, {steps} steps",
                    at.id.primitive, at.point
                );
            }
        }
    }
    Ok(())
}
