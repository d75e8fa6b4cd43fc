//! A model as voxels, by signed distance: `cargo run --release -p firsthit --example voxelise -- MODEL slice.png`
//!
//! Writes the middle slice: inside warm, outside cold, with a line at every twentieth of the size.

use std::error::Error;

use firsthit::glam::DVec3;
use firsthit::{BuildOptions, SceneBuilder, Solid};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Signed distances at the middles of `n`^3 cells of the model's box, x fastest; and the volume of a cell.
pub(crate) fn run(model: &str, n: u32) -> Result<(Vec<f64>, f64)> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let solid = Solid::new(&scene);
    let (low, cell) = (scene.bounds().min, scene.bounds().extent() / f64::from(n));
    let at = |k: u32| low + cell * (DVec3::new((k % n).into(), (k / n % n).into(), (k / n / n).into()) + 0.5);
    let points: Vec<DVec3> = (0..n * n * n).map(at).collect();
    let mut distances = vec![0.0; points.len()];
    solid.par_signed_distances(&points, &mut distances);
    Ok((distances, cell.element_product()))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/spot/spot.obj".into());
    let picture = arguments.next().unwrap_or_else(|| "slice.png".into());
    let n = 192;
    let (distances, cell) = run(&model, n)?;
    let inside = distances.iter().filter(|d| **d < 0.0).count();
    println!("{inside} of {} voxels are inside: a volume of {:.6}", distances.len(), inside as f64 * cell);

    let size = cell.cbrt() * f64::from(n);
    let image = image::RgbImage::from_fn(n, n, |x, y| {
        // Seen from the side: z to the right, y up, the middle of x.
        let d = distances[((x * n + (n - 1 - y)) * n + n / 2) as usize] / size;
        let fade = (1.0 - d.abs() * 6.0).clamp(0.2, 1.0) * if (d * 20.0).fract().abs() < 0.08 { 0.75 } else { 1.0 };
        let [r, g, b] = if d < 0.0 { [1.0, 0.62, 0.25] } else { [0.35, 0.6, 0.95] };
        image::Rgb([r, g, b].map(|c| (c * fade * 255.0) as u8))
    });
    image.save(&picture)?;
    println!("{picture}: the middle slice");
    Ok(())
}
