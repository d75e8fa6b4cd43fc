//! Images on surfaces: decoding, wrapping, filtering.
//!
//! Values are decoded to linear before they are filtered. Smaller copies (mip levels) are averages of the linear
//! image over exactly the area each of their texels covers, whatever the size; they are kept in the image's own
//! number format, so the whole pyramid takes a third more memory than the image.

mod black;
mod level;
mod lookup;
mod wrap;

use std::sync::OnceLock;

use firsthit_import::scene::{ImageDesc, Pixels, Wrap};
use glam::{Vec2, Vec4};

use level::Level;
pub(crate) use lookup::Layout;
pub use lookup::TextureLookup;
pub(crate) use wrap::floor;
use wrap::{fold, neighbours};

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// Colours by the sRGB curve (alpha is linear).
    Srgb,
    /// As `Srgb`, with alpha as coverage: in smaller copies, colours count by their alpha, so that what is cut out does
    /// not tint its surroundings.
    SrgbCoverage,
    /// Data: normals, roughness.
    Linear,
}

/// An image that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("image '{name}' should have {width} x {height} pixels (at least one), but has {pixels}")]
pub struct TextureError {
    /// Its name.
    pub name: String,
    /// Pixels across, as stated.
    pub width: u32,
    /// Pixels down, as stated.
    pub height: u32,
    /// Pixels that there are.
    pub pixels: usize,
}

/// An image with its smaller copies.
#[derive(Clone, Debug)]
pub struct Texture {
    space: ColorSpace,
    /// For each block of the whole image whether all of it is black; made when first asked for.
    dark: OnceLock<Vec<bool>>,
    /// Whether all of it is grey; found out when first asked for.
    grey: OnceLock<bool>,
    /// From the whole image to a single texel.
    levels: Vec<Level>,
}

impl Texture {
    /// Reads an image; its full-size pixels are shared, not copied.
    ///
    /// # Errors
    /// When the image is empty or its pixels are not as many as it says.
    pub fn new(image: &ImageDesc, space: ColorSpace) -> Result<Self, TextureError> {
        let pixels = match &image.pixels {
            Pixels::Rgba8(p) => p.len(),
            Pixels::Rgba16(p) => p.len(),
            Pixels::Rgb32F(p) => p.len(),
        };
        if pixels == 0 || u64::from(image.width) * u64::from(image.height) != pixels as u64 {
            let ImageDesc { name, width, height, .. } = image;
            return Err(TextureError { name: name.clone(), width: *width, height: *height, pixels });
        }
        let mut levels = vec![Level { width: image.width, height: image.height, texels: image.pixels.clone() }];
        let space = if matches!(image.pixels, Pixels::Rgb32F(_)) { ColorSpace::Linear } else { space };
        while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            let smaller = last.halved(space);
            levels.push(smaller);
        }
        Ok(Self { space, dark: OnceLock::new(), grey: OnceLock::new(), levels })
    }

    /// Width and height of the whole image in texels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// The linear value of one texel of the whole image; the last ones where there are none.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        let level = &self.levels[0];
        level.texel(self.space, x.min(level.width - 1), y.min(level.height - 1))
    }

    /// Whether red, green and blue are the same in all of it. False also where that is not known.
    fn is_grey(&self) -> bool {
        let Pixels::Rgba8(texels) = &self.levels[0].texels else { return false };
        *self.grey.get_or_init(|| texels.iter().all(|[r, g, b, _]| r == g && g == b))
    }

    /// The texel at a point of the whole image, by itself.
    fn view_nearest(&self, wrap: [Wrap; 2], uv: Vec2) -> View {
        let level = &self.levels[0];
        let pick = |wrap, t, n| ((fold(wrap, t) * n as f32) as u32).min(n - 1);
        let (x, y) = (pick(wrap[0], uv.x, level.width), pick(wrap[1], uv.y, level.height));
        View { level: 0, x: [x; 2], y: [y; 2], mix: [0.0; 2] }
    }

    /// The texels around a point of one level. `at`: folded coordinates.
    #[inline]
    fn view_level(&self, level: usize, wrap: [Wrap; 2], at: Vec2) -> View {
        let Level { width, height, .. } = self.levels[level];
        let (x, across) = neighbours(wrap[0], at.x, width);
        let (y, down) = neighbours(wrap[1], at.y, height);
        View { level: level as u32, x, y, mix: [across, down] }
    }

    /// The two levels between which something `width` texels of the whole image wide is looked at, and how far it is
    /// from the first to the second.
    #[inline]
    fn levels_of(&self, width: f32) -> ([usize; 2], f32) {
        let last = self.levels.len() - 1;
        // NaN and all up to one texel: the whole image.
        if !(width > 1.0) {
            return ([0, 0], 0.0);
        }
        let (whole, part) = log2(width);
        if whole >= last { ([last, last], 0.0) } else { ([whole, whole + 1], part) }
    }

    /// `width`: of what is looked at, in texels of the whole image; up to one, that is all that is read.
    #[inline]
    fn filtered<R: Reading>(&self, wrap: [Wrap; 2], uv: Vec2, width: f32, reading: R) -> R::Value {
        let at = fold2(wrap, uv);
        let ([below, above], t) = self.levels_of(width);
        let value = self.read(&self.view_level(below, wrap, at), reading);
        if t > 0.0 { R::lerp(value, self.read(&self.view_level(above, wrap, at), reading), t) } else { value }
    }

    /// Of the two levels that [`Texture::filtered`] mixes one, by chance as often as it counts there.
    #[inline]
    fn view_one_of(&self, wrap: [Wrap; 2], uv: Vec2, width: f32, chance: f32) -> View {
        let ([below, above], t) = self.levels_of(width);
        self.view_level(if chance < t { above } else { below }, wrap, fold2(wrap, uv))
    }

    #[inline]
    fn read<R: Reading>(&self, view: &View, reading: R) -> R::Value {
        let [a, b, c, d] = reading.four(&self.levels[view.level as usize], self.space, view.x, view.y);
        let [across, down] = view.mix;
        R::lerp(R::lerp(a, b, across), R::lerp(c, d, across), down)
    }
}

#[inline]
fn fold2(wrap: [Wrap; 2], uv: Vec2) -> Vec2 {
    Vec2::new(fold(wrap[0], uv.x), fold(wrap[1], uv.y))
}

/// Where images of one size are read: four texels of one of their levels, and how they are mixed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    level: u32,
    /// Two columns and two rows.
    x: [u32; 2],
    y: [u32; 2],
    /// How far it is from the first to the second of them.
    mix: [f32; 2],
}

/// What is read of texels.
trait Reading: Copy {
    type Value: Copy;

    /// Of the texels at two columns of two rows.
    fn four(self, level: &Level, space: ColorSpace, x: [u32; 2], y: [u32; 2]) -> [Self::Value; 4];

    fn lerp(a: Self::Value, b: Self::Value, t: f32) -> Self::Value;
}

/// All four channels.
#[derive(Clone, Copy, Debug)]
struct All;

impl Reading for All {
    type Value = Vec4;

    #[inline]
    fn four(self, level: &Level, space: ColorSpace, x: [u32; 2], y: [u32; 2]) -> [Vec4; 4] {
        level.four(space, x, y)
    }

    #[inline]
    fn lerp(a: Vec4, b: Vec4, t: f32) -> Vec4 {
        a.lerp(b, t)
    }
}

/// One channel.
#[derive(Clone, Copy, Debug)]
struct One(usize);

impl Reading for One {
    type Value = f32;

    #[inline]
    fn four(self, level: &Level, space: ColorSpace, x: [u32; 2], y: [u32; 2]) -> [f32; 4] {
        level.four_of(space, x, y, self.0)
    }

    /// As that of vectors.
    #[inline]
    fn lerp(a: f32, b: f32, t: f32) -> f32 {
        a * (1.0 - t) + b * t
    }
}

/// The logarithm of a number of at least 1: its whole part, exact, and about the rest, in [0, 1], which grows with the
/// number. Between levels that is enough, and much faster than the library's.
#[inline]
fn log2(x: f32) -> (usize, f32) {
    const MANTISSA: u32 = f32::MANTISSA_DIGITS - 1;
    let bits = x.to_bits();
    let whole = (bits >> MANTISSA) as usize - (f32::MAX_EXP as usize - 1);
    // In [0, 1): x / 2^whole - 1. The parabola through both ends that is never off by more than 0.01.
    let m = f32::from_bits(bits & ((1 << MANTISSA) - 1) | 1.0_f32.to_bits()) - 1.0;
    (whole, m * (1.3465 - 0.3465 * m))
}

#[cfg(test)]
mod tests;
