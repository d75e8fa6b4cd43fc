//! Which parts are near a point: `cargo run --release -p firsthit --example nearest_part -- MODEL X Y Z`

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The parts with triangles among the nearest hundred, the nearest first: name, distance, nearest point.
pub(crate) fn run(model: &str, point: DVec3) -> Result<Vec<(String, f64, DVec3)>> {
    let desc = firsthit::import::open(model, &Default::default())?.scene;
    let scene = SceneBuilder::from_desc(&desc, BuildOptions::default()).build()?;
    let mut parts: Vec<(String, f64, DVec3)> = Vec::new();
    for near in scene.nearest_k(point, 100, f64::INFINITY) {
        let instance = &desc.instances[near.id.instance as usize];
        let part = &desc.meshes[instance.mesh].geometries[near.id.geometry as usize];
        let name = format!("{} / {}", instance.name, part.name);
        if parts.iter().all(|(known, ..)| *known != name) {
            parts.push((name, near.distance, near.point));
        }
    }
    Ok(parts)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/cornell-box/CornellBox-Original.obj".into());
    let mut number = |or: f64| arguments.next().map_or(Ok(or), |x| x.parse());
    let point = DVec3::new(number(0.0)?, number(1.0)?, number(0.0)?);
    for (part, distance, at) in run(&model, point)? {
        println!("{distance:8.4}  {part}, at {at:.3}");
    }
    Ok(())
}
