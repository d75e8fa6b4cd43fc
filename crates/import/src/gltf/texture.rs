//! Textures: images, samplers and transforms of coordinates (glTF 2.0 specification, section 3.8).

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use glam::{Affine2, Mat2, Vec2};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Index, Texture};
use serde_json::{Map, Value};

use super::json;
use super::source::Source;
use crate::cache::Shown;
use crate::image::{self, Encoded};
use crate::scene::{Channel, Filter, ImageDesc, TextureRef, Wrap};
use crate::{ImportError, Limits, Report};

/// Textures as materials call for them; images are numbered in the order of their first use.
pub(super) struct Textures<'a> {
    source: &'a Source<'a>,
    /// For each image the first of the same data.
    same: Vec<usize>,
    numbers: BTreeMap<Shown, usize>,
    used: Vec<Shown>,
    /// For each of them whether it has to be decoded.
    wanted: Vec<bool>,
}

/// The bytes of an image, and its place among those that are used.
pub(super) type Numbered<'a> = (usize, Cow<'a, [u8]>);

/// What the different kinds of texture references of a material have in common.
pub(super) struct Info<'a> {
    pub(super) index: Index<Texture>,
    pub(super) tex_coord: u32,
    /// KHR_texture_transform, where the JSON model has a type for it...
    pub(super) transform: Option<TextureTransform>,
    /// ...and where it has not.
    pub(super) others: Option<&'a Map<String, Value>>,
}

impl<'a> From<&'a gltf::json::texture::Info> for Info<'a> {
    fn from(info: &'a gltf::json::texture::Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Self { index: info.index, tex_coord: info.tex_coord, transform, others: None }
    }
}

impl<'a> Textures<'a> {
    pub(super) fn new(source: &'a Source<'a>) -> Self {
        let mut first = HashMap::new();
        let images = source.root.images.iter().enumerate();
        let same = images
            .map(|(i, image)| *first.entry((image.uri.as_deref(), image.buffer_view.map(|v| v.value()))).or_insert(i));
        Self { source, same: same.collect(), numbers: BTreeMap::new(), used: Vec::new(), wanted: Vec::new() }
    }

    /// The reference to a texture; `place` is that of the reference in the file. What is `wanted` nowhere is not decoded.
    ///
    /// # Errors
    /// If the texture does not exist or its transform is no such thing.
    pub(super) fn reference(
        &mut self,
        info: Info<'_>,
        channel: Channel,
        wanted: bool,
        place: &str,
    ) -> Result<TextureRef, ImportError> {
        let root = self.source.root;
        let Some(texture) = root.textures.get(info.index.value()) else {
            let cause = format!("element {} does not exist: there are {}", info.index.value(), root.textures.len());
            return Err(self.source.invalid(format!("{place}/index"), cause));
        };
        let better = json::IMAGE_EXTENSIONS.iter().find_map(|name| json::extension_source(texture, name));
        let shown = match (better, texture.source.value()) {
            (Some(better), _) => Shown::Image(self.same[better as usize]),
            // The JSON model's mark for "no source".
            (None, source) if source == u32::MAX as usize => Shown::Nothing { texture: info.index.value() },
            (None, source) => Shown::Image(self.same[source]),
        };
        let next = self.used.len();
        let image = *self.numbers.entry(shown).or_insert_with(|| {
            self.used.push(shown);
            self.wanted.push(false);
            next
        });
        self.wanted[image] |= wanted;
        let transform = match (info.transform, info.others.and_then(|o| o.get("KHR_texture_transform"))) {
            (None, Some(value)) => {
                let place = format!("{place}/extensions/KHR_texture_transform");
                Some(json::typed(self.source.file, &place, value)?)
            }
            (typed, _) => typed,
        };
        let sampler = texture.sampler.map(|s| &root.samplers[s.value()]);
        Ok(TextureRef {
            uv_set: transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(info.tex_coord) as usize,
            transform: transform.map_or(Affine2::IDENTITY, |t| affine(&t)),
            wrap_u: sampler.map_or(Wrap::Repeat, |s| wrap(s.wrap_s)),
            wrap_v: sampler.map_or(Wrap::Repeat, |s| wrap(s.wrap_t)),
            filter: sampler.map_or(Filter::Linear, filter),
            channel,
            ..TextureRef::new(image)
        })
    }

    /// What is used, and whether it has to be decoded.
    pub(super) fn decoded(&self) -> Vec<(Shown, bool)> {
        self.used.iter().copied().zip(self.wanted.iter().copied()).collect()
    }

    /// The images that are to be decoded, by their places among those that are used. One that cannot be read is missing,
    /// with a warning.
    ///
    /// # Errors
    /// If all together would take too much memory.
    pub(super) fn encoded(&self, report: &mut Report) -> Result<Vec<Numbered<'a>>, ImportError> {
        let mut encoded = Vec::new();
        // Encoded images are held all at once.
        let mut left = *self.source.limits;
        for (k, &shown) in self.used.iter().enumerate().filter(|(k, _)| self.wanted[*k]) {
            let bytes = match shown {
                Shown::Image(index) => image_bytes(self.source, index, &left, report),
                Shown::Nothing { texture } => {
                    Err(self.source.invalid(format!("/textures/{texture}"), "has no image that can be read"))
                }
            };
            match bytes {
                Ok(bytes) => {
                    if let Cow::Owned(bytes) = &bytes {
                        left.file_bytes = left.file_bytes.saturating_sub(bytes.len() as u64);
                    }
                    encoded.push((k, bytes));
                }
                Err(e) => report.warn(e.file, e.place, format!("{}: white is shown instead", e.kind)),
            }
        }
        let sources: Vec<_> = encoded.iter().map(|(_, bytes)| Encoded { name: "", bytes }).collect();
        // Those in buffers count once.
        let owned = |bytes: &Cow<'_, [u8]>| if let Cow::Owned(bytes) = bytes { bytes.len() as u64 } else { 0 };
        let twice: u64 = encoded.iter().map(|(_, bytes)| bytes.len() as u64 - owned(bytes)).sum();
        let more = self.source.bytes().saturating_sub(twice);
        image::check_memory(&sources, self.source.limits, more).map_err(|kind| self.source.at("/images", kind))?;
        Ok(encoded)
    }

    /// Decodes images in parallel; white stands for the others that are used. One that cannot be decoded is replaced as
    /// well, with a warning.
    pub(super) fn decode(&self, encoded: &[Numbered<'_>], report: &mut Report) -> Vec<ImageDesc> {
        let names: Vec<String> = self.used.iter().map(|&i| self.name(i)).collect();
        let sources: Vec<_> = encoded.iter().map(|(k, bytes)| Encoded { name: &names[*k], bytes }).collect();
        let (limits, stages) = (self.source.limits, self.source.stages);
        let mut images: Vec<ImageDesc> = names.iter().map(|n| image::placeholder(n)).collect();
        for (&(k, _), decoded) in encoded.iter().zip(image::decode_timed(&sources, limits, stages)) {
            match decoded {
                Ok(image) => images[k] = image,
                Err(cause) => {
                    let place = match self.used[k] {
                        Shown::Image(index) => format!("/images/{index}"),
                        Shown::Nothing { texture } => format!("/textures/{texture}"),
                    };
                    report.warn(self.source.file, place, format!("{}: {cause}: white is shown instead", names[k]));
                }
            }
        }
        images
    }

    /// The image's name, else its file's, else its number.
    fn name(&self, shown: Shown) -> String {
        let Shown::Image(index) = shown else { return "no image".into() };
        let image = &self.source.root.images[index];
        let file = image.uri.as_ref().filter(|u| !u.starts_with("data:"));
        image.name.clone().or_else(|| file.cloned()).unwrap_or_else(|| format!("image {index}"))
    }
}

/// The encoded bytes of an image.
///
/// # Errors
/// If they cannot be read.
pub(super) fn image_bytes<'a>(
    source: &'a Source<'_>,
    index: usize,
    limits: &Limits,
    report: &mut Report,
) -> Result<Cow<'a, [u8]>, ImportError> {
    let image = &source.root.images[index];
    let place = format!("/images/{index}");
    match (&image.uri, image.buffer_view) {
        (Some(uri), _) => source.resource(uri, &(place + "/uri"), limits, report).map(Cow::Owned),
        (None, Some(view)) => source.view(view).map(Cow::Borrowed),
        (None, None) => Err(source.invalid(place, "has neither a URI nor a buffer view")),
    }
}

/// The matrix of KHR_texture_transform: scale, then rotation, then offset.
///
/// The rotation is counter-clockwise as one sees the image, that is, with v running down: the extension's text and
/// Khronos's test model say so, against its GLSL snippet, which turns the other way.
fn affine(t: &TextureTransform) -> Affine2 {
    let (sin, cos) = t.rotation.0.sin_cos();
    let scale = Vec2::from(t.scale.0);
    let rotation = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
    Affine2::from_mat2_translation(rotation * Mat2::from_diagonal(scale), Vec2::from(t.offset.0))
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// Nearest where the file asks for it when magnified, or only when minified and without mip-maps.
fn filter(sampler: &Sampler) -> Filter {
    match (sampler.mag_filter, sampler.min_filter) {
        (Some(Checked::Valid(MagFilter::Nearest)), _) | (None, Some(Checked::Valid(MinFilter::Nearest))) => {
            Filter::Nearest
        }
        _ => Filter::Linear,
    }
}

#[cfg(test)]
mod tests {
    use gltf::json::extensions::texture::{TextureTransformOffset, TextureTransformRotation, TextureTransformScale};

    use super::*;

    #[test]
    fn rotation_turns_as_in_khronos_test_model() {
        // TextureTransformTest: the arrow's tip, on the diagonal of the image, must show at the green marker, which
        // stands at (0.42095, 1.01627) in the coordinates of the quad that is turned by 22.5 degrees.
        let t = TextureTransform {
            rotation: TextureTransformRotation(std::f32::consts::FRAC_PI_8),
            ..TextureTransform::default()
        };
        let at = affine(&t).transform_point2(Vec2::new(0.420_951_8, 1.016_267_5));
        assert!((at.x - at.y).abs() < 1e-5, "{at}");
    }

    #[test]
    fn scale_comes_before_rotation_and_offset_last() {
        let t = TextureTransform {
            offset: TextureTransformOffset([10.0, 20.0]),
            rotation: TextureTransformRotation(std::f32::consts::FRAC_PI_2),
            scale: TextureTransformScale([2.0, 3.0]),
            ..TextureTransform::default()
        };
        let at = affine(&t).transform_point2(Vec2::ONE);
        assert!((at - Vec2::new(13.0, 18.0)).length() < 1e-5, "{at}");
    }
}
