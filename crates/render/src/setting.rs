//! What surrounds the scene: chosen from the file, the caller's wish, or the built-in studio.

use firsthit_import::SceneDesc;
use firsthit_import::scene::{EnvironmentDesc, ImageDesc, MaterialModel, Pixels};
use glam::Vec3;

use crate::stage::{Backdrop, StageError};
use crate::view::srgb_to_linear;
use crate::{Environment, EnvironmentChoice, StageOptions};

/// How bright the studio is where the file brings lights of its own: their shadows are not black then.
const FILL: f32 = 0.15;

/// What was chosen.
pub(crate) struct Setting {
    pub(crate) environment: Option<Environment>,
    pub(crate) background: Backdrop,
    /// Why.
    pub(crate) words: Vec<String>,
    /// The studio only fills up the file's own lights.
    pub(crate) dim: bool,
    /// It is the built-in studio, for want of anything else.
    pub(crate) studio: bool,
}

/// Chooses what surrounds the scene.
pub(crate) fn choose(scene: &SceneDesc, options: &StageOptions) -> Result<Setting, StageError> {
    let rotation = options.environment_rotation;
    let mut studio = None;
    let (environment, words) = match &options.environment {
        EnvironmentChoice::Auto => match &scene.environment {
            Some(EnvironmentDesc::Studio { rotation: own, scale }) => {
                studio = Some(scale.max_element());
                (Some(Environment::studio(own + rotation, *scale)), "the studio, as the file asks")
            }
            Some(desc) => (from_desc(scene, desc, rotation)?, "the file's own"),
            None if scene.settings.reference_conventions => (None, "none (a reference scene)"),
            None if has_lights(scene) && scene.settings.camera.is_some() => {
                (None, "none, since the scene file has lights and no environment")
            }
            None if has_lights(scene) => {
                studio = Some(FILL);
                let dim = Environment::studio(rotation, Vec3::splat(FILL));
                (Some(dim), "a dim studio, since the file has lights of its own")
            }
            None => {
                studio = Some(1.0);
                (Some(Environment::studio(rotation, Vec3::ONE)), "the built-in studio, since the file has no lights")
            }
        },
        EnvironmentChoice::Studio => {
            studio = Some(1.0);
            (Some(Environment::studio(rotation, Vec3::ONE)), "the built-in studio, as asked")
        }
        EnvironmentChoice::White => (Some(Environment::constant(Vec3::ONE)), "white, as asked"),
        EnvironmentChoice::Black => (None, "black, as asked"),
        EnvironmentChoice::Map(image) => (Some(map(image, rotation, Vec3::ONE)?), "the map given"),
    };
    Ok(Setting {
        background: Backdrop::new(options.background, studio),
        dim: matches!(options.environment, EnvironmentChoice::Auto) && studio == Some(FILL),
        studio: matches!(options.environment, EnvironmentChoice::Auto) && scene.environment.is_none(),
        environment,
        words: vec![format!("surroundings: {words}")],
    })
}

/// Whether something in the file is there to light the scene. Glow with a texture does not count: it is decoration.
pub(crate) fn has_lights(scene: &SceneDesc) -> bool {
    const LAMP: f32 = 3.0;
    let lamp = |model: &MaterialModel| match model {
        MaterialModel::Emission { radiance } => radiance.max_element() > 0.0,
        MaterialModel::Pbr(p) => p.emissive_texture.is_none() && !p.unlit && p.emissive.max_element() >= LAMP,
        _ => false,
    };
    let mut used = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries);
    !scene.lights.is_empty() || used.any(|g| g.material.is_some_and(|m| lamp(&scene.materials[m].model)))
}

fn from_desc(scene: &SceneDesc, desc: &EnvironmentDesc, turn: f32) -> Result<Option<Environment>, StageError> {
    Ok(match *desc {
        EnvironmentDesc::Constant { radiance } => Some(Environment::constant(radiance)),
        EnvironmentDesc::LatLong { image, rotation, scale } => {
            let image = scene.images.get(image).ok_or(StageError::NoSuchImage(image))?;
            Some(map(image, rotation + turn, scale)?)
        }
        EnvironmentDesc::Studio { rotation, scale } => Some(Environment::studio(rotation + turn, scale)),
    })
}

fn map(image: &ImageDesc, rotation: f32, scale: Vec3) -> Result<Environment, StageError> {
    Environment::latlong(image.width, image.height, linear_pixels(&image.pixels), rotation, scale)
        .map_err(|cause| StageError::Environment { image: image.name.clone(), cause })
}

/// Linear RGB; 8- and 16-bit images are taken as sRGB.
fn linear_pixels(pixels: &Pixels) -> std::sync::Arc<[[f32; 3]]> {
    match pixels {
        Pixels::Rgb32F(p) => p.clone(),
        Pixels::Rgba8(p) => {
            p.iter().map(|p| [p[0], p[1], p[2]].map(|x| srgb_to_linear(f32::from(x) / 255.0))).collect()
        }
        Pixels::Rgba16(p) => {
            p.iter().map(|p| [p[0], p[1], p[2]].map(|x| srgb_to_linear(f32::from(x) / 65535.0))).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn image(pixels: Pixels) -> ImageDesc {
        ImageDesc { name: "sky.exr".into(), width: 2, height: 1, pixels }
    }

    fn of_scene(image: ImageDesc) -> SceneDesc {
        let environment = EnvironmentDesc::LatLong { image: 0, rotation: 0.0, scale: Vec3::ONE };
        SceneDesc { images: vec![image], environment: Some(environment), ..SceneDesc::default() }
    }

    fn as_option(image: ImageDesc) -> StageOptions {
        StageOptions { environment: EnvironmentChoice::Map(image), ..StageOptions::default() }
    }

    #[test]
    fn a_map_that_is_no_light_is_an_error_from_the_file_as_from_the_options() {
        let bad = image(Pixels::Rgb32F(Arc::new([[1.0; 3], [0.5, f32::NAN, 0.5]])));
        let of_file = choose(&of_scene(bad.clone()), &StageOptions::default());
        for result in [of_file, choose(&SceneDesc::default(), &as_option(bad))] {
            let error = result.err().unwrap().to_string();
            assert!(error.starts_with("sky.exr: pixel (1, 0)"), "{error}");
        }
    }

    #[test]
    fn images_of_eight_and_sixteen_bits_are_srgb() {
        let eight = image(Pixels::Rgba8(Arc::new([[128; 4]; 2])));
        let sixteen = image(Pixels::Rgba16(Arc::new([[128 * 257; 4]; 2])));
        for image in [eight, sixteen] {
            let setting = choose(&SceneDesc::default(), &as_option(image)).unwrap();
            let radiance = setting.environment.unwrap().radiance(Vec3::X);
            assert!((radiance - Vec3::splat(0.215_861)).length() < 1e-5, "{radiance}");
        }
    }
}
