//! `--hdri FILE`: an image as light from around.

use std::path::Path;

use firsthit_import::{Limits, image, scene::Pixels};
use firsthit_render::EnvironmentChoice;

use crate::error::Failure;
use crate::values::{Hdri, srgb_to_linear};

/// The environment that an option names; images are read here.
pub(crate) fn environment(hdri: Option<&Hdri>) -> Result<EnvironmentChoice, Failure> {
    Ok(match hdri {
        None => EnvironmentChoice::Auto,
        Some(Hdri::Studio) => EnvironmentChoice::Studio,
        Some(Hdri::White) => EnvironmentChoice::White,
        Some(Hdri::Black) => EnvironmentChoice::Black,
        Some(Hdri::File(path)) => read(path)?,
    })
}

fn read(path: &Path) -> Result<EnvironmentChoice, Failure> {
    let image = image::read(path, &Limits::default())?;
    // Images of eight or sixteen bits are sRGB; their brightest white is radiance 1.
    let linear = |max: f64| move |c: f64| srgb_to_linear(c / max) as f32;
    let pixels = match image.pixels {
        Pixels::Rgb32F(pixels) => pixels,
        Pixels::Rgba8(p) => p.iter().map(|&[r, g, b, _]| [r, g, b].map(|c| linear(255.0)(c.into()))).collect(),
        Pixels::Rgba16(p) => p.iter().map(|&[r, g, b, _]| [r, g, b].map(|c| linear(65535.0)(c.into()))).collect(),
    };
    if let Some(bad) = pixels.iter().position(|p| !p.iter().all(|c| c.is_finite() && *c >= 0.0)) {
        let (x, y) = (bad % image.width as usize, bad / image.width as usize);
        let place = path.display();
        return Err(Failure::failed(format_args!("{place}: pixel ({x}, {y}): radiance is negative or not finite")));
    }
    Ok(EnvironmentChoice::Map { width: image.width, height: image.height, pixels })
}
