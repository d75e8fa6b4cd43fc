//! Images of textures and environments: PNG, JPEG, WebP, KTX2 (Basis Universal), Radiance HDR and OpenEXR, told by
//! their first bytes.
//!
//! Size is checked from the header before a pixel is decoded. A damaged image does not stop a load: readers warn and
//! go on without it.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use exr::prelude::{ReadChannels, ReadLayers};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use rayon::prelude::*;

use crate::scene::{ImageDesc, Pixels};
use crate::timing::{Stage, timed};
use crate::{ErrorKind, ImportError, Limits, Stages, files, ktx2};

/// An image that is still encoded.
#[derive(Clone, Copy, Debug)]
pub struct Encoded<'a> {
    /// Name or path in the file.
    pub name: &'a str,
    /// The whole file.
    pub bytes: &'a [u8],
}

/// Reads an image file.
///
/// # Errors
/// What is wrong with the file.
pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<ImageDesc, ImportError> {
    let path = path.as_ref();
    let bytes = files::read(path, limits)?;
    decode(&bytes, &path.to_string_lossy(), limits).map_err(|kind| ImportError::new(path, "", kind))
}

/// Decodes one image.
///
/// Eight-bit images give RGBA8, sixteen-bit ones RGBA16 (grey is spread, alpha 1 where there is none), Radiance and
/// OpenEXR linear RGB. Colour profiles and orientation tags are not applied, as glTF asks.
///
/// # Errors
/// [`ErrorKind::Unsupported`], [`ErrorKind::Limit`] or [`ErrorKind::Invalid`].
pub fn decode(bytes: &[u8], name: &str, limits: &Limits) -> Result<ImageDesc, ErrorKind> {
    let size = Size::of(bytes, limits)?;
    size.check(limits.image_bytes.min(limits.made_of(bytes.len() as u64)))?;
    let (width, height, pixels) = if is_exr(bytes) {
        decode_exr(bytes)?
    } else if ktx2::is_ktx2(bytes) {
        ktx2::decode(bytes)?
    } else {
        decode_common(bytes, limits)?
    };
    Ok(ImageDesc { name: name.to_owned(), width, height, pixels })
}

/// Decodes images in parallel; the results are in the order of the sources.
///
/// [`Limits::image_bytes`] counts for all of them together: an image that no longer fits is [`ErrorKind::Limit`].
#[must_use]
pub fn decode_all(sources: &[Encoded<'_>], limits: &Limits) -> Vec<Result<ImageDesc, ErrorKind>> {
    decode_each(sources, limits, None)
}

fn decode_each(sources: &[Encoded<'_>], limits: &Limits, stages: Option<&Stages>) -> Vec<Result<ImageDesc, ErrorKind>> {
    let mut left = limits.image_bytes;
    let fits: Vec<Result<(), ErrorKind>> = sources
        .iter()
        .map(|s| {
            let size = Size::of(s.bytes, limits)?;
            size.check(left)?;
            left -= size.bytes();
            Ok(())
        })
        .collect();
    let one = |(s, fits): (&Encoded<'_>, Result<(), ErrorKind>)| {
        fits.and_then(|()| timed(stages, Stage::ImagesInAll, || decode(s.bytes, s.name, limits)))
    };
    // One by one, for a few large images are to be shared out evenly.
    sources.par_iter().zip(fits).with_max_len(1).map(one).collect()
}

/// As [`decode_all`], with a look at the clock.
pub(crate) fn decode_timed(
    sources: &[Encoded<'_>],
    limits: &Limits,
    stages: Option<&Stages>,
) -> Vec<Result<ImageDesc, ErrorKind>> {
    if let Some(stages) = stages {
        stages.keep(sources);
    }
    timed(stages, Stage::Images, || decode_each(sources, limits, stages))
}

/// Checks the images of a file against what the limits allow to be made of their bytes and of `more`.
///
/// # Errors
/// If all together take too much memory. What cannot be decoded takes none.
pub(crate) fn check_memory(sources: &[Encoded<'_>], limits: &Limits, more: u64) -> Result<(), ErrorKind> {
    let read = sources.iter().fold(more, |sum, s| sum.saturating_add(s.bytes.len() as u64));
    let sizes = sources.iter().filter_map(|s| Size::of(s.bytes, limits).ok());
    let held = sizes.fold(0_u64, |sum, size| sum.saturating_add(size.bytes()));
    limits.check_memory("its images", held, read)
}

/// How wide and high an image is, from its header alone.
pub(crate) fn size(bytes: &[u8], limits: &Limits) -> Result<[u32; 2], ErrorKind> {
    Size::of(bytes, limits).map(|size| [size.width, size.height])
}

/// A white pixel, in place of an image that cannot be read: the factors of the material show instead.
#[must_use]
pub fn placeholder(name: &str) -> ImageDesc {
    ImageDesc { name: name.to_owned(), width: 1, height: 1, pixels: Pixels::Rgba8(Arc::new([[255; 4]])) }
}

/// What an image needs when decoded.
#[derive(Clone, Copy)]
struct Size {
    width: u32,
    height: u32,
    /// As decoded for a scene.
    bytes_per_pixel: u64,
}

impl Size {
    fn new(width: usize, height: usize, bytes_per_pixel: u64) -> Self {
        let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
        Self { width: side(width), height: side(height), bytes_per_pixel }
    }

    /// From the header alone.
    fn of(bytes: &[u8], limits: &Limits) -> Result<Self, ErrorKind> {
        let size = if is_exr(bytes) {
            let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(invalid)?;
            // The largest layer bounds what the reader may allocate for any of them.
            let sizes = meta.headers.iter().map(|h| h.layer_size);
            Self::new(
                sizes.clone().map(|s| s.width()).max().unwrap_or(0),
                sizes.map(|s| s.height()).max().unwrap_or(0),
                12,
            )
        } else if ktx2::is_ktx2(bytes) {
            let (width, height) = ktx2::size(bytes)?;
            Self { width, height, bytes_per_pixel: 4 }
        } else {
            let decoder = decoder(bytes, limits)?;
            let (width, height) = decoder.dimensions();
            let color = decoder.color_type();
            let channel = u64::from(color.bytes_per_pixel() / color.channel_count().max(1));
            Self { width, height, bytes_per_pixel: if channel == 4 { 12 } else { 4 * channel } }
        };
        if size.width == 0 || size.height == 0 {
            return Err(ErrorKind::Invalid("the image has no pixel".to_owned()));
        }
        if size.width.max(size.height) > limits.image_side {
            return Err(ErrorKind::Limit(format!(
                "the image has {} x {} pixels, more than {} along a side",
                size.width, size.height, limits.image_side
            )));
        }
        Ok(size)
    }

    fn bytes(self) -> u64 {
        (u64::from(self.width) * u64::from(self.height)).saturating_mul(self.bytes_per_pixel)
    }

    fn check(self, available: u64) -> Result<(), ErrorKind> {
        if self.bytes() <= available {
            return Ok(());
        }
        let (w, h) = (self.width, self.height);
        Err(ErrorKind::Limit(format!(
            "an image of {w} x {h} pixels needs {} bytes; {available} are left of the limit",
            self.bytes()
        )))
    }
}

fn invalid(e: impl std::fmt::Display) -> ErrorKind {
    ErrorKind::Invalid(e.to_string())
}

fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

fn decoder<'a>(bytes: &'a [u8], limits: &Limits) -> Result<impl ImageDecoder + 'a, ErrorKind> {
    let unsupported = |what: &str| {
        ErrorKind::Unsupported(format!("{what}; PNG, JPEG, WebP, KTX2, Radiance HDR and OpenEXR are read"))
    };
    let format = image::guess_format(bytes).map_err(|_| unsupported("not an image of a known format"))?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP | ImageFormat::Hdr) {
        return Err(unsupported(&format!("{} images are not read", format!("{format:?}").to_uppercase())));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut cap = image::Limits::no_limits();
    cap.max_image_width = Some(limits.image_side);
    cap.max_image_height = Some(limits.image_side);
    // Half of it again for what a decoder needs besides the picture.
    cap.max_alloc = Some(limits.image_bytes.saturating_add(limits.image_bytes / 2));
    reader.limits(cap);
    reader.into_decoder().map_err(|e| match e {
        image::ImageError::Limits(e) => ErrorKind::Limit(e.to_string()),
        e => invalid(e),
    })
}

fn decode_common(bytes: &[u8], limits: &Limits) -> Result<(u32, u32, Pixels), ErrorKind> {
    let image = DynamicImage::from_decoder(decoder(bytes, limits)?).map_err(invalid)?;
    let (width, height) = (image.width(), image.height());
    let pixels = match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Pixels::Rgb32F(bytemuck::cast_slice(&image.into_rgb32f()).into())
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => Pixels::Rgba16(bytemuck::cast_slice(&image.into_rgba16()).into()),
        // What most images are, without a copy between.
        DynamicImage::ImageRgb8(image) => {
            Pixels::Rgba8(image.as_raw().chunks_exact(3).map(|p| [p[0], p[1], p[2], u8::MAX]).collect())
        }
        DynamicImage::ImageLuma8(image) => {
            Pixels::Rgba8(image.as_raw().iter().map(|&grey| [grey, grey, grey, u8::MAX]).collect())
        }
        _ => Pixels::Rgba8(bytemuck::cast_slice(&image.into_rgba8()).into()),
    };
    Ok((width, height, pixels))
}

/// The first layer that has channels R, G and B.
fn decode_exr(bytes: &[u8]) -> Result<(u32, u32, Pixels), ErrorKind> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0_f32; 3]; size.area()]),
            |(width, pixels), at, (r, g, b): (f32, f32, f32)| pixels[at.y() * *width + at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(invalid)?;
    let size = Size::new(image.layer_data.size.width(), image.layer_data.size.height(), 12);
    let (_, pixels) = image.layer_data.channel_data.pixels;
    Ok((size.width, size.height, Pixels::Rgb32F(pixels.into())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        image.write_to(&mut out, format).expect("in memory");
        out.into_inner()
    }

    fn decoded(bytes: &[u8]) -> ImageDesc {
        decode(bytes, "test", &Limits::default()).expect("a good image")
    }

    #[test]
    fn eight_and_sixteen_bits_keep_their_values() {
        let rgb = DynamicImage::ImageRgb8(image::RgbImage::from_raw(2, 1, vec![1, 2, 3, 4, 5, 6]).expect("size"));
        let d = decoded(&encoded(&rgb, ImageFormat::Png));
        assert_eq!((d.width, d.height), (2, 1));
        assert!(matches!(&d.pixels, Pixels::Rgba8(p) if **p == [[1, 2, 3, 255], [4, 5, 6, 255]]));

        let grey = image::ImageBuffer::from_raw(1, 2, vec![300_u16, 65535]).expect("size");
        let d = decoded(&encoded(&DynamicImage::ImageLuma16(grey), ImageFormat::Png));
        assert_eq!((d.width, d.height), (1, 2));
        assert!(matches!(&d.pixels, Pixels::Rgba16(p) if **p == [[300, 300, 300, 65535], [65535; 4]]));
    }

    #[test]
    fn jpeg_and_webp_are_read() {
        let rgb = DynamicImage::ImageRgb8(image::RgbImage::from_pixel(9, 5, image::Rgb([200, 100, 50])));
        for format in [ImageFormat::Jpeg, ImageFormat::WebP] {
            let d = decoded(&encoded(&rgb, format));
            let Pixels::Rgba8(p) = &d.pixels else { panic!("eight bits") };
            assert_eq!((d.width, d.height, p.len()), (9, 5, 45));
            // JPEG loses a little: by its quantisation, a few levels.
            assert!(p.iter().all(|p| p[0].abs_diff(200) < 8 && p[1].abs_diff(100) < 8 && p[2].abs_diff(50) < 8));
        }
    }

    #[test]
    fn radiance_and_openexr_give_linear_floats() {
        let value = [4.0_f32, 0.5, 0.125];
        let rgb = DynamicImage::ImageRgb32F(image::Rgb32FImage::from_pixel(3, 2, image::Rgb(value)));
        let d = decoded(&encoded(&rgb, ImageFormat::Hdr));
        let Pixels::Rgb32F(p) = &d.pixels else { panic!("floats") };
        assert_eq!((d.width, d.height, p.len()), (3, 2, 6));
        // RGBE: eight bits for the largest channel, powers of two are exact.
        assert!(p.iter().all(|p| *p == value), "{p:?}");

        use exr::prelude::WritableImage;
        let pixel = |at: exr::math::Vec2<usize>| (at.x() as f32, at.y() as f32, 1e4_f32);
        let mut bytes = Cursor::new(Vec::new());
        exr::prelude::Image::from_channels((3, 2), exr::prelude::SpecificChannels::rgb(pixel))
            .write()
            .to_buffered(&mut bytes)
            .expect("in memory");
        let d = decoded(&bytes.into_inner());
        let Pixels::Rgb32F(p) = &d.pixels else { panic!("floats") };
        assert_eq!((d.width, d.height), (3, 2));
        assert_eq!(p[5], [2.0, 1.0, 1e4], "row 0 is at the top");
    }

    #[test]
    fn size_is_checked_before_decoding() {
        let mut png = encoded(&DynamicImage::new_rgb8(4, 4), ImageFormat::Png);
        let small = Limits { image_side: 3, ..Limits::default() };
        assert!(matches!(decode(&png, "", &small), Err(ErrorKind::Limit(_))));
        let few = Limits { image_bytes: 63, ..Limits::default() };
        assert!(matches!(decode(&png, "", &few), Err(ErrorKind::Limit(_))));
        // A header that claims 2^31 - 1 pixels along each side.
        png[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
        assert!(decode(&png, "", &Limits::default()).is_err());
    }

    #[test]
    fn the_limit_on_bytes_counts_for_all_together() {
        let png = encoded(&DynamicImage::new_rgb8(4, 4), ImageFormat::Png);
        let sources = [
            Encoded { name: "a", bytes: &png },
            Encoded { name: "b", bytes: b"no image" },
            Encoded { name: "c", bytes: &png },
        ];
        let all = decode_all(&sources, &Limits::default());
        assert!(all[0].is_ok() && all[2].is_ok());
        assert!(matches!(all[1], Err(ErrorKind::Unsupported(_))));
        let tight = decode_all(&sources, &Limits { image_bytes: 127, ..Limits::default() });
        assert!(tight[0].is_ok());
        assert!(matches!(tight[2], Err(ErrorKind::Limit(_))));
    }

    #[test]
    fn damaged_images_are_errors() {
        let mut all = vec![b"\x76\x2f\x31\x01 is no OpenEXR".to_vec(), b"GIF89a......".to_vec(), Vec::new()];
        for format in [ImageFormat::Png, ImageFormat::Hdr, ImageFormat::WebP] {
            let image = DynamicImage::ImageRgb32F(image::Rgb32FImage::new(16, 16));
            let image = if format == ImageFormat::Hdr { image } else { DynamicImage::ImageRgb8(image.into_rgb8()) };
            let whole = encoded(&image, format);
            all.push(whole[..whole.len() / 2].to_vec());
        }
        for bytes in &all {
            assert!(decode(bytes, "", &Limits::default()).is_err());
        }
    }
}
