//! A spinning scanner in the middle of a scene: `cargo run --release -p firsthit --example lidar -- MODEL cloud.xyz ranges.png`

use std::error::Error;
use std::fmt::Write;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, Hit, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Beams one above the other, from -45 to 45 degrees.
pub(crate) const BEAMS: u32 = 128;
/// Directions of one turn.
pub(crate) const TURN: u32 = 720;

/// The rays, beam by beam.
type Rays = Vec<Ray<f64>>;

/// The rays and what they hit.
pub(crate) fn run(model: &str) -> Result<(Rays, Vec<Option<Hit>>)> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let origin = scene.bounds().center();
    let direction = |k: u32| {
        let up = (f64::from(k / TURN) / f64::from(BEAMS - 1) - 0.5) * std::f64::consts::FRAC_PI_2;
        let turn = f64::from(k % TURN) / f64::from(TURN) * std::f64::consts::TAU;
        DVec3::new(up.cos() * turn.cos(), up.sin(), up.cos() * turn.sin())
    };
    let rays: Vec<Ray<f64>> = (0..BEAMS * TURN).map(|k| Ray::new(origin, direction(k))).collect();
    let mut hits = vec![None; rays.len()];
    scene.par_closest_hits(&rays, &mut hits);
    Ok((rays, hits))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/cornell-box/CornellBox-Original.obj".into());
    let cloud = arguments.next().unwrap_or_else(|| "cloud.xyz".into());
    let picture = arguments.next().unwrap_or_else(|| "ranges.png".into());
    let (rays, hits) = run(&model)?;
    let mut text = String::new();
    for (ray, hit) in rays.iter().zip(&hits) {
        if let Some(hit) = hit {
            let p = ray.at(hit.t);
            writeln!(text, "{:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
        }
    }
    std::fs::write(&cloud, text)?;
    let farthest = hits.iter().flatten().map(|hit| hit.t).fold(0.0, f64::max);
    image::GrayImage::from_fn(TURN, BEAMS, |x, y| {
        let hit = hits[((BEAMS - 1 - y) * TURN + x) as usize];
        image::Luma([hit.map_or(0, |hit| (255.0 - 205.0 * hit.t / farthest) as u8)])
    })
    .save(&picture)?;
    println!("{cloud}: {} points of {} rays; {picture}: near is bright", hits.iter().flatten().count(), rays.len());
    Ok(())
}
