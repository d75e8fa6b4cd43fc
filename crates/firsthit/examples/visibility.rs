//! Which parts are seen: `cargo run --release -p firsthit --example visibility -- MODEL`
//!
//! Rays through all pixels of a small picture, by the camera that `firsthit render` would choose; what they hit first is seen.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;

use firsthit::render::{Stage, StageOptions};
use firsthit::{BuildOptions, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Name of each part that is seen, and how many pixels show it; and the number of pixels.
pub(crate) fn run(model: &str, width: u32, height: u32) -> Result<(BTreeMap<String, u32>, u32)> {
    let desc = Arc::new(firsthit::import::open(model, &Default::default())?.scene);
    let scene = SceneBuilder::from_desc(&desc, BuildOptions::default()).build()?;
    let stage = Stage::new(desc.clone(), scene.clone(), &StageOptions::default())?;
    let camera = stage.camera().on_film(width, height);
    let middle = |k: u32| [f64::from(k % width) + 0.5, f64::from(k / width) + 0.5];
    let rays: Vec<Ray<f64>> = (0..width * height).map(|k| camera.ray(middle(k))).collect();
    let mut hits = vec![None; rays.len()];
    scene.par_closest_hits(&rays, &mut hits);
    let mut seen = BTreeMap::new();
    for hit in hits.into_iter().flatten() {
        let instance = &desc.instances[hit.id.instance as usize];
        let part = &desc.meshes[instance.mesh].geometries[hit.id.geometry as usize];
        *seen.entry(format!("{} / {}", instance.name, part.name)).or_insert(0) += 1;
    }
    Ok((seen, width * height))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let model = std::env::args().nth(1).unwrap_or_else(|| "assets/flight-helmet/FlightHelmet.gltf".into());
    let (seen, pixels) = run(&model, 640, 360)?;
    let mut seen: Vec<_> = seen.into_iter().collect();
    seen.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    for (part, count) in seen {
        println!("{:6.2} %  {part}", f64::from(count) / f64::from(pixels) * 100.0);
    }
    Ok(())
}
