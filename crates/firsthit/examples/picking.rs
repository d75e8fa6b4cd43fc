//! What is under the mouse: `cargo run --release -p firsthit --example picking -- MODEL 640 360`
//!
//! The camera is the one that `firsthit render` would choose for a picture of 1280 x 720.

use std::error::Error;
use std::sync::Arc;

use firsthit::render::{Stage, StageOptions};
use firsthit::{BuildOptions, Hit, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What is at a pixel, with the names of the object and its part.
pub(crate) fn run(model: &str, pixel: [f64; 2]) -> Result<Option<(Hit, String, String)>> {
    let desc = Arc::new(firsthit::import::open(model, &Default::default())?.scene);
    let scene = SceneBuilder::from_desc(&desc, BuildOptions::default()).build()?;
    let stage = Stage::new(desc.clone(), scene.clone(), &StageOptions::default())?;
    let ray = stage.camera().on_film(1280, 720).ray(pixel);
    Ok(scene.closest_hit(&ray).map(|hit| {
        let instance = &desc.instances[hit.id.instance as usize];
        let part = &desc.meshes[instance.mesh].geometries[hit.id.geometry as usize];
        (hit, instance.name.clone(), part.name.clone())
    }))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/spot/spot.obj".into());
    let mut number = |or: f64| arguments.next().map_or(Ok(or), |x| x.parse());
    match run(&model, [number(640.0)?, number(360.0)?])? {
        None => println!("nothing"),
        Some((hit, object, part)) => {
            println!("'{object}', part '{part}', triangle {} at distance {:.3}", hit.id.primitive, hit.t)
        }
    }
    Ok(())
}
