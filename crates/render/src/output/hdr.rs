//! Radiance HDR (RGBE).

use std::io::{self, Write};

use super::other;
use crate::film::Picture;

/// Writes the colour, over black where alpha is below 1.
pub(super) fn write(out: &mut impl Write, picture: &Picture) -> io::Result<()> {
    let fine = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
    let pixels: Vec<_> = picture.pixels.iter().map(|p| image::Rgb([fine(p[0]), fine(p[1]), fine(p[2])])).collect();
    image::codecs::hdr::HdrEncoder::new(out)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(other)
}
