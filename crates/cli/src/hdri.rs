//! `--hdri FILE`: an image as light from around.

use firsthit_import::{Limits, image};
use firsthit_render::EnvironmentChoice;

use crate::error::Failure;
use crate::values::Hdri;

/// The environment that an option names; images are read here.
pub(crate) fn environment(hdri: Option<&Hdri>) -> Result<EnvironmentChoice, Failure> {
    Ok(match hdri {
        None => EnvironmentChoice::Auto,
        Some(Hdri::Studio) => EnvironmentChoice::Studio,
        Some(Hdri::White) => EnvironmentChoice::White,
        Some(Hdri::Black) => EnvironmentChoice::Black,
        Some(Hdri::File(path)) => EnvironmentChoice::Map(image::read(path, &Limits::default())?),
    })
}
