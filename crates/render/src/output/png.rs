//! PNG, 8 or 16 bits a channel.

use std::io::{self, Write};

use glam::{Vec3, Vec4};

use super::{BitDepth, other};
use crate::film::Picture;
use crate::{View, ViewTransform};

/// Writes a picture as PNG to anything that takes bytes. Alpha is straight and only there where it is needed.
///
/// Values are rounded to the nearest, so the same picture gives the same bytes. The file says how its numbers are to be
/// read: as sRGB, or, for [`ViewTransform::None`], as linear.
///
/// # Errors
/// When `out` fails or the picture has no pixels.
pub fn write_png(out: &mut impl Write, picture: &Picture, view: &View, depth: BitDepth) -> io::Result<()> {
    let opaque = view.backdrop.is_some() || picture.pixels.iter().all(|p| p[3] >= 1.0);
    let values = picture.shown(view);
    let channels = if opaque { 3 } else { 4 };

    let mut encoder = png::Encoder::new(out, picture.width, picture.height);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    match view.transform {
        ViewTransform::None => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
        _ => encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual),
    }
    let data: Vec<u8> = match depth {
        BitDepth::Eight => {
            encoder.set_depth(png::BitDepth::Eight);
            values.flat_map(|v| v.into_iter().take(channels).map(|x| (x * 255.0 + 0.5) as u8)).collect()
        }
        BitDepth::Sixteen => {
            encoder.set_depth(png::BitDepth::Sixteen);
            let bytes = |x: f32| ((x * 65535.0 + 0.5) as u16).to_be_bytes();
            values.flat_map(|v| v.into_iter().take(channels).flat_map(bytes)).collect()
        }
    };
    let mut writer = encoder.write_header().map_err(other)?;
    writer.write_image_data(&data).map_err(other)?;
    writer.finish().map_err(other)
}

impl Picture {
    /// What a display shows, pixel by pixel from the upper left: colour and straight alpha, all in [0, 1].
    pub fn shown(&self, view: &View) -> impl Iterator<Item = [f32; 4]> {
        self.pixels.iter().map(|p| shown(Vec4::from(*p), view))
    }
}

fn shown(pixel: Vec4, view: &View) -> [f32; 4] {
    let alpha = pixel.w.clamp(0.0, 1.0);
    let color = if pixel.w > 0.0 { pixel.truncate() / pixel.w } else { Vec3::ZERO };
    let (color, alpha) = (view.apply(color), if alpha.is_nan() { 0.0 } else { alpha });
    match view.backdrop {
        Some(behind) => behind.lerp(color, alpha).extend(1.0),
        None => color.extend(alpha),
    }
    .to_array()
}
