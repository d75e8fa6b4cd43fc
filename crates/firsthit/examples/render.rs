//! A model to a picture: `cargo run --release -p firsthit --example render -- MODEL picture.png`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use firsthit::import::open;
use firsthit::render::output::{WriteOptions, write_film};
use firsthit::render::{RenderOptions, Stage, StageOptions, render};
use firsthit::{BuildOptions, SceneBuilder};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/scenes/shapes.toml".into());
    let picture = arguments.next().unwrap_or_else(|| "picture.png".into());

    let scene = Arc::new(open(&model, &Default::default())?.scene);
    let accel = SceneBuilder::from_desc(&scene, BuildOptions::default()).build()?;
    let stage = Stage::new(scene, accel, &StageOptions::default())?;
    let options = RenderOptions { width: 960, height: 540, ..RenderOptions::default() };
    let rendered = render(&stage, &options, &())?;
    write_film(Path::new(&picture), &rendered.film, &WriteOptions::default())?;

    for line in stage.explain() {
        println!("{line}");
    }
    println!("{picture}: {} samples in {:.1} s", rendered.stats.samples, rendered.stats.seconds);
    Ok(())
}
