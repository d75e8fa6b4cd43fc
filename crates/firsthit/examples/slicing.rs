//! A model cut into layers, as for a printer: `cargo run --release -p firsthit --example slicing -- MODEL 0.5 layer.png`
//!
//! Rays run through the layer row by row; between each odd crossing of the surface and the next there is material. Each crossing
//! counts once, also through edges and vertices, so no row ever runs over.

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, Crossings, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Spans of material along x in each of `rows` rows of the layer at a part of the height, and their area in world units.
pub(crate) fn run(model: &str, height: f64, rows: u32) -> Result<(Vec<Vec<[f64; 2]>>, f64)> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let (low, size) = (scene.bounds().min, scene.bounds().extent());
    let step = size.z / f64::from(rows);
    let row = |k: u32| {
        let z = low.z + (f64::from(k) + 0.5) * step;
        Ray::new(DVec3::new(low.x - size.x, low.y + height * size.y, z), DVec3::X)
    };
    let rays: Vec<Ray<f64>> = (0..rows).map(row).collect();
    let lists = scene.par_all_hits(&rays, Crossings::Surfaces);
    let spans =
        |hits: &[firsthit::Hit]| hits.chunks_exact(2).map(|pair| [pair[0].t, pair[1].t].map(|t| t - size.x)).collect();
    let layers: Vec<Vec<[f64; 2]>> = lists.iter().map(spans).collect();
    let area = layers.iter().flatten().map(|[from, to]| (to - from) * step).sum();
    Ok((layers, area))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/spot/spot.obj".into());
    let height: f64 = arguments.next().map_or(Ok(0.5), |x| x.parse())?;
    let picture = arguments.next().unwrap_or_else(|| "layer.png".into());
    let rows = 400;
    let (layers, area) = run(&model, height, rows)?;
    let widest = layers.iter().flatten().map(|span| span[1]).fold(0.0, f64::max);
    image::GrayImage::from_fn(rows, rows, |x, y| {
        let at = (f64::from(x) + 0.5) / f64::from(rows) * widest;
        let inside = layers[y as usize].iter().any(|[from, to]| (*from..*to).contains(&at));
        image::Luma([if inside { 40 } else { 230 }])
    })
    .save(&picture)?;
    println!("{picture}: the layer at {height} of the height has an area of {area:.6}");
    Ok(())
}
