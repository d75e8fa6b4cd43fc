//! EXT_lights_image_based: what surrounds a scene, as the six faces of a cube.
//!
//! The finest images become a map by longitude and latitude. The blurred ones and the irradiance that the extension
//! also has are of no use here: reflections and diffuse light are traced.

use glam::{DMat3, DQuat, DVec3, Vec3};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

use super::json;
use super::source::Source;
use super::texture;
use crate::image::{self, Encoded};
use crate::scene::{EnvironmentDesc, ImageDesc, Pixels};
use crate::{ErrorKind, ImportError, Limits, Report, srgb};

const NAME: &str = "EXT_lights_image_based";

#[derive(Deserialize)]
struct Reference {
    light: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Light {
    #[serde(default = "unturned")]
    rotation: [f64; 4],
    #[serde(default = "one")]
    intensity: f32,
    specular_images: Vec<[usize; 6]>,
}

fn unturned() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn one() -> f32 {
    1.0
}

/// Whether a scene of the file has a map around it.
pub(super) fn is_there(source: &Source<'_>, scene: Option<usize>) -> bool {
    let others = scene.and_then(|s| source.root.scenes[s].extensions.as_ref()).map(|e| &e.others);
    others.is_some_and(|others| others.contains_key(NAME))
}

/// The map around a scene of the file, and its image, which is to stand after the others; `None` if the scene has no
/// such light or, with a warning, if its images cannot be read.
///
/// # Errors
/// If the light or an image does not exist.
pub(super) fn read(
    source: &Source<'_>,
    scene: Option<usize>,
    images: &[ImageDesc],
    report: &mut Report,
) -> Result<Option<(EnvironmentDesc, ImageDesc)>, ImportError> {
    let others = scene.and_then(|s| source.root.scenes[s].extensions.as_ref()).map(|e| &e.others);
    let (Some(scene), Some(value)) = (scene, others.and_then(|o| o.get(NAME))) else { return Ok(None) };
    let place = format!("/scenes/{scene}/extensions/{NAME}");
    let Reference { light } = json::typed(source.file, &place, value)?;
    let lights = source.root.extensions.as_ref().and_then(|e| e.others.get(NAME)?.get("lights"));
    let lights = lights.and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let Some(value) = lights.get(light) else {
        let cause = format!("element {light} does not exist: there are {}", lights.len());
        return Err(source.invalid(place + "/light", cause));
    };
    let place = format!("/extensions/{NAME}/lights/{light}");
    let Light { rotation, intensity, specular_images } = json::typed(source.file, &place, value)?;
    let turn = DQuat::from_array(rotation);
    if !(turn.length() > 1e-6 && turn.length().is_finite() && intensity.is_finite() && intensity >= 0.0) {
        return Err(source.invalid(place, "its rotation is no quaternion, or its intensity is negative"));
    }
    let Some(&faces) = specular_images.first() else {
        return Err(source.invalid(place + "/specularImages", "has no images"));
    };
    let count = source.root.images.len();
    if let Some(bad) = faces.iter().find(|&&i| i >= count) {
        let cause = format!("element {bad} does not exist: there are {count}");
        return Err(source.invalid(place + "/specularImages/0", cause));
    }
    let mut limits = *source.limits;
    let used: u64 = images.iter().map(|i| i.pixels.bytes()).sum();
    limits.image_bytes = limits.image_bytes.saturating_sub(used);
    match Cube::read(source, faces, &limits, report) {
        Ok(cube) => {
            let image = cube.unfolded(DMat3::from_quat(turn.normalize()));
            let scale = Vec3::splat(intensity);
            Ok(Some((EnvironmentDesc::LatLong { image: images.len(), rotation: 0.0, scale }, image)))
        }
        Err(e) => {
            report.warn(e.file, e.place, format!("{}: the environment is left out", e.kind));
            Ok(None)
        }
    }
}

/// What the map needs for each pixel of a face, more than the radiances of all six: it has four by two of a face's
/// sides, and twelve bytes a pixel.
const MAP_BYTES: u64 = 4 * 2 * 12;

/// Six square faces of radiances, in the order +X, -X, +Y, -Y, +Z, -Z; row 0 at the top.
struct Cube {
    side: usize,
    faces: Vec<Vec<Vec3>>,
}

impl Cube {
    fn read(
        source: &Source<'_>,
        numbers: [usize; 6],
        limits: &Limits,
        report: &mut Report,
    ) -> Result<Self, ImportError> {
        let mut bytes = Vec::new();
        let mut left = *limits;
        for index in numbers {
            let read = texture::image_bytes(source, index, &left, report)?;
            left.file_bytes = left.file_bytes.saturating_sub(read.len() as u64);
            let side = image::size(&read, limits).map_err(|kind| source.at(format!("/images/{index}"), kind))?;
            let needed = MAP_BYTES * u64::from(side[0]) * u64::from(side[1]);
            if needed > limits.image_bytes {
                let cause =
                    format!("the environment needs {needed} bytes; {} are left of the limit", limits.image_bytes);
                return Err(source.at(format!("/images/{index}"), ErrorKind::Limit(cause)));
            }
            bytes.push(read);
        }
        let encoded: Vec<Encoded<'_>> = bytes.iter().map(|bytes| Encoded { name: "", bytes }).collect();
        let mut faces = Vec::new();
        let mut side = None;
        for (index, decoded) in numbers.into_iter().zip(image::decode_all(&encoded, limits)) {
            let place = || format!("/images/{index}");
            let image = decoded.map_err(|kind| source.at(place(), kind))?;
            if image.width != image.height || *side.get_or_insert(image.width) != image.width {
                let cause = format!("{} x {} pixels: faces of a cube are equal squares", image.width, image.height);
                return Err(source.invalid(place(), cause));
            }
            faces.push(radiances(&image.pixels));
        }
        Ok(Self { side: side.unwrap_or(1) as usize, faces })
    }

    /// The map by longitude and latitude of the cube turned by a rotation.
    fn unfolded(&self, turn: DMat3) -> ImageDesc {
        let (width, height) = (4 * self.side, 2 * self.side);
        let back = turn.transpose();
        let row = |y: usize| {
            let (sin, cos) = (std::f64::consts::PI * (y as f64 + 0.5) / height as f64).sin_cos();
            (0..width).map(move |x| {
                let (across, ahead) = (std::f64::consts::TAU * (x as f64 + 0.5) / width as f64).sin_cos();
                self.radiance(back * DVec3::new(sin * across, cos, -sin * ahead)).to_array()
            })
        };
        let pixels: Vec<[f32; 3]> = (0..height).into_par_iter().flat_map_iter(row).collect();
        let (width, height) = (width as u32, height as u32);
        ImageDesc { name: "environment".into(), width, height, pixels: Pixels::Rgb32F(pixels.into()) }
    }

    /// From a direction, linear between the middles of pixels of one face.
    fn radiance(&self, d: DVec3) -> Vec3 {
        let a = d.abs();
        // Which face, and how far to the right and down on it (OpenGL 4.6, table 8.19).
        let (face, s, t, depth) = match () {
            () if a.x >= a.y && a.x >= a.z => (usize::from(d.x < 0.0), -d.z * d.x.signum(), -d.y, a.x),
            () if a.y >= a.z => (2 + usize::from(d.y < 0.0), d.x, d.z * d.y.signum(), a.y),
            () => (4 + usize::from(d.z < 0.0), d.x * d.z.signum(), -d.y, a.z),
        };
        let last = self.side - 1;
        let pixel = |x: f64| ((0.5 * (x / depth) + 0.5) * self.side as f64 - 0.5).clamp(0.0, last as f64);
        let (x, y) = (pixel(s), pixel(t));
        let (i, j) = (x as usize, y as usize);
        let at = |i: usize, j: usize| self.faces[face][j.min(last) * self.side + i.min(last)];
        let (u, v) = ((x - i as f64) as f32, (y - j as f64) as f32);
        at(i, j).lerp(at(i + 1, j), u).lerp(at(i, j + 1).lerp(at(i + 1, j + 1), u), v)
    }
}

/// Colours are sRGB, and divided by alpha (RGBD): without alpha that is 1.
fn radiances(pixels: &Pixels) -> Vec<Vec3> {
    let decode = |[r, g, b, d]: [f64; 4]| {
        let d = d.max(1.0 / 255.0);
        Vec3::from([r, g, b].map(|c| (srgb::to_linear(c) / d) as f32))
    };
    match pixels {
        Pixels::Rgba8(p) => p.iter().map(|p| decode(p.map(|c| f64::from(c) / 255.0))).collect(),
        Pixels::Rgba16(p) => p.iter().map(|p| decode(p.map(|c| f64::from(c) / 65535.0))).collect(),
        Pixels::Rgb32F(p) => p.iter().map(|&p| Vec3::from(p)).collect(),
    }
}
