//! Images on surfaces: decoding, wrapping, filtering.
//!
//! Values are decoded to linear before they are filtered. Smaller copies (mip levels) are averages of the linear
//! image over exactly the area each of their texels covers, whatever the size; they are kept in the image's own
//! number format, so the whole pyramid takes a third more memory than the image.

use std::sync::{Arc, LazyLock, OnceLock};

use firsthit_import::scene::{Channel, Filter, ImageDesc, Pixels, TextureRef, Wrap};
use glam::{Affine2, Vec2, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use crate::light::environment::luminance;
use crate::view::{linear_to_srgb, srgb_to_linear};

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

/// Side of the blocks that are known to be black or not, in texels.
const DARK_BLOCK: u32 = 8;

/// An image with its smaller copies.
#[derive(Clone, Debug)]
pub struct Texture {
    space: ColorSpace,
    /// For each block of the whole image whether all of it is black; made when first asked for.
    dark: OnceLock<Vec<bool>>,
    /// From the whole image to a single texel.
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Pixels,
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
        Ok(Self { space, dark: OnceLock::new(), levels })
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

    fn nearest(&self, wrap: [Wrap; 2], uv: Vec2) -> Vec4 {
        let level = &self.levels[0];
        let pick = |wrap, t, n| (fold(wrap, t) * n as f32) as u32;
        self.texel(pick(wrap[0], uv.x, level.width), pick(wrap[1], uv.y, level.height))
    }

    fn bilinear(&self, level: usize, wrap: [Wrap; 2], uv: Vec2) -> Vec4 {
        let level = &self.levels[level];
        let (x, fx) = neighbours(wrap[0], uv.x, level.width);
        let (y, fy) = neighbours(wrap[1], uv.y, level.height);
        let [a, b, c, d] = level.four(self.space, x, y);
        a.lerp(b, fx).lerp(c.lerp(d, fx), fy)
    }

    /// One channel of [`Texture::bilinear`].
    fn bilinear_of(&self, level: usize, wrap: [Wrap; 2], uv: Vec2, channel: usize) -> f32 {
        let level = &self.levels[level];
        let (x, fx) = neighbours(wrap[0], uv.x, level.width);
        let (y, fy) = neighbours(wrap[1], uv.y, level.height);
        let [a, b, c, d] = level.four_of(self.space, x, y, channel);
        lerp(lerp(a, b, fx), lerp(c, d, fx), fy)
    }

    /// The two levels between which something `width` texels of the whole image wide is looked at, and how far it is
    /// from the first to the second.
    fn levels_of(&self, width: f32) -> ([usize; 2], f32) {
        let last = self.levels.len() - 1;
        // NaN and all up to one texel: the whole image.
        let level = if width > 1.0 { width.log2().min(last as f32) } else { 0.0 };
        let below = level as usize;
        ([below, (below + 1).min(last)], level.fract())
    }

    /// `width`: of what is looked at, in texels of the whole image.
    fn trilinear(&self, wrap: [Wrap; 2], uv: Vec2, width: f32) -> Vec4 {
        let ([below, above], t) = self.levels_of(width);
        let value = self.bilinear(below, wrap, uv);
        if t > 0.0 { value.lerp(self.bilinear(above, wrap, uv), t) } else { value }
    }

    /// One channel of [`Texture::trilinear`].
    fn trilinear_of(&self, wrap: [Wrap; 2], uv: Vec2, width: f32, channel: usize) -> f32 {
        let ([below, above], t) = self.levels_of(width);
        let value = self.bilinear_of(below, wrap, uv, channel);
        if t > 0.0 { lerp(value, self.bilinear_of(above, wrap, uv, channel), t) } else { value }
    }

    /// Whether the whole image is black between two of its texels, which may lie beyond its borders. False also where
    /// that is not known.
    fn is_black(&self, wrap: [Wrap; 2], low: [i64; 2], high: [i64; 2]) -> bool {
        /// More blocks than these are not looked at.
        const MOST: i64 = 4096;
        let level = &self.levels[0];
        let Pixels::Rgba8(texels) = &level.texels else { return false };
        let (width, height) = (i64::from(level.width), i64::from(level.height));
        let across = level.width.div_ceil(DARK_BLOCK) as usize;
        let dark = self.dark.get_or_init(|| {
            let mut dark = vec![true; across * level.height.div_ceil(DARK_BLOCK) as usize];
            for (row, y) in texels.chunks_exact(level.width as usize).zip(0..) {
                for (texel, x) in row.iter().zip(0..) {
                    dark[(y / DARK_BLOCK as usize) * across + x / DARK_BLOCK as usize] &= texel[..3] == [0; 3];
                }
            }
            dark
        });
        let step = i64::from(DARK_BLOCK);
        // Steps of a block meet every block, unless one is cut by the border and the image goes on behind it.
        let cut = |k: usize, n: i64| wrap[k] != Wrap::Clamp && n % step != 0;
        let count = |k: usize| (high[k] - low[k]) / step + 2;
        if low[0] > high[0] || low[1] > high[1] || cut(0, width) || cut(1, height) {
            return false;
        }
        if count(0).saturating_mul(count(1)) > MOST {
            return false;
        }
        let wrapped = |wrap: Wrap, i: i64, n: i64| match wrap {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * n);
                i.min(2 * n - 1 - i)
            }
            Wrap::Clamp => i.clamp(0, n - 1),
        };
        let steps = |k: usize| (0..count(k)).map(move |i| (low[k] + i * step).min(high[k]));
        steps(1).all(|y| {
            let row = wrapped(wrap[1], y, height) as usize / DARK_BLOCK as usize;
            steps(0).all(|x| dark[row * across + wrapped(wrap[0], x, width) as usize / DARK_BLOCK as usize])
        })
    }
}

/// A texture as a material uses it: how to look it up, and what to take from it.
#[derive(Clone, Debug)]
pub struct TextureLookup {
    texture: Arc<Texture>,
    uv_set: usize,
    transform: Affine2,
    /// How many texels of the whole image a unit of uv length spans, on average over directions.
    texels_per_uv: f32,
    wrap: [Wrap; 2],
    mode: Mode,
    channel: Channel,
    value_scale: f32,
    value_offset: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Nearest,
    Bilinear,
    Trilinear,
}

impl TextureLookup {
    /// A reference to a texture, ready for use. Without `mips`, footprints are ignored and the whole image is looked
    /// up bilinearly.
    #[must_use]
    pub fn new(texture: Arc<Texture>, reference: &TextureRef, mips: bool) -> Self {
        let (width, height) = texture.size();
        let area = reference.transform.matrix2.determinant().abs() * width as f32 * height as f32;
        let mode = match reference.filter {
            Filter::Nearest => Mode::Nearest,
            Filter::Linear if mips => Mode::Trilinear,
            Filter::Linear => Mode::Bilinear,
        };
        Self {
            texture,
            uv_set: reference.uv_set,
            transform: reference.transform,
            texels_per_uv: area.sqrt(),
            wrap: [reference.wrap_u, reference.wrap_v],
            mode,
            channel: reference.channel,
            value_scale: reference.value_scale,
            value_offset: reference.value_offset,
        }
    }

    /// Which set of texture coordinates to look it up by.
    #[inline]
    #[must_use]
    pub fn uv_set(&self) -> usize {
        self.uv_set
    }

    /// The linear colour and alpha at a mesh's texture coordinates, averaged over about `footprint` (a width in those
    /// coordinates; 0: a point). Any coordinates are taken: NaN and infinite ones as 0.
    #[inline]
    #[must_use]
    pub fn color(&self, uv: Vec2, footprint: f32) -> Vec4 {
        let value = self.lookup(uv, footprint);
        (value.xyz() * self.value_scale + self.value_offset).extend(value.w)
    }

    /// The channel that the reference names, at a mesh's texture coordinates: see [`TextureLookup::color`].
    #[inline]
    #[must_use]
    pub fn scalar(&self, uv: Vec2, footprint: f32) -> f32 {
        let channel = match self.channel {
            Channel::Red => 0,
            Channel::Green => 1,
            Channel::Blue => 2,
            Channel::Alpha => 3,
            Channel::Luminance => return self.pick(self.lookup(uv, footprint)),
        };
        // Of most images only this channel has to be decoded.
        let at = self.transform.transform_point2(uv);
        let value = match self.mode {
            Mode::Nearest => return self.pick(self.lookup(uv, footprint)),
            Mode::Bilinear => self.texture.bilinear_of(0, self.wrap, at, channel),
            Mode::Trilinear => self.texture.trilinear_of(self.wrap, at, footprint * self.texels_per_uv, channel),
        };
        value * self.value_scale + self.value_offset
    }

    #[inline]
    fn pick(&self, value: Vec4) -> f32 {
        let value = match self.channel {
            Channel::Red => value.x,
            Channel::Green => value.y,
            Channel::Blue => value.z,
            Channel::Alpha => value.w,
            Channel::Luminance => luminance(value.xyz()),
        };
        value * self.value_scale + self.value_offset
    }

    /// One texel's step in the mesh's texture coordinates: what a height map's slope is taken over.
    #[must_use]
    pub fn texel_step(&self) -> f32 {
        if self.texels_per_uv > 0.0 { 1.0 / self.texels_per_uv } else { 1.0 }
    }

    /// Whether nothing but black is found anywhere in a triangle of the mesh's texture coordinates, at no footprint.
    /// False also where that is not known.
    pub(crate) fn is_black_over(&self, uv: [Vec2; 3]) -> bool {
        /// Coordinates beyond these may be rounded by a texel.
        const FAR: f32 = 1e4;
        let at = uv.map(|uv| self.transform.transform_point2(uv));
        let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
        if self.value_offset != 0.0 || !(low.abs().max(high.abs()).max_element() < FAR) {
            return false;
        }
        let (width, height) = self.texture.size();
        let size = Vec2::new(width as f32, height as f32);
        // Two texels more to each side than are mixed.
        let (low, high) = (low * size - 3.0, high * size + 3.0);
        let whole = |v: Vec2| [v.x.floor() as i64, v.y.floor() as i64];
        self.texture.is_black(self.wrap, whole(low), whole(high))
    }

    /// Whether both read the same texels, of which they may take different channels.
    pub(crate) fn reads_as(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.texture, &other.texture)
            && (self.uv_set, self.transform, self.wrap, self.mode)
                == (other.uv_set, other.transform, other.wrap, other.mode)
    }

    /// [`TextureLookup::scalar`] of this and of one that [reads as](TextureLookup::reads_as) it.
    #[inline]
    pub(crate) fn scalars(&self, other: &Self, uv: Vec2, footprint: f32) -> [f32; 2] {
        let value = self.lookup(uv, footprint);
        [self.pick(value), other.pick(value)]
    }

    fn lookup(&self, uv: Vec2, footprint: f32) -> Vec4 {
        let uv = self.transform.transform_point2(uv);
        match self.mode {
            Mode::Nearest => self.texture.nearest(self.wrap, uv),
            Mode::Bilinear => self.texture.bilinear(0, self.wrap, uv),
            Mode::Trilinear => self.texture.trilinear(self.wrap, uv, footprint * self.texels_per_uv),
        }
    }
}

/// The largest whole number that is not above it, of a finite one. What every processor has comes without an instruction
/// for it.
#[inline]
pub(crate) fn floor(t: f32) -> f32 {
    /// From here on all numbers are whole.
    const WHOLE: f32 = (1 << (f32::MANTISSA_DIGITS - 1)) as f32;
    if t.abs() < WHOLE {
        let cut = t as i32 as f32;
        if cut > t { cut - 1.0 } else { cut }
    } else {
        t
    }
}

/// A coordinate brought into [0, 1]. NaN and infinities give 0.
fn fold(wrap: Wrap, t: f32) -> f32 {
    if !t.is_finite() {
        return 0.0;
    }
    match wrap {
        Wrap::Repeat => t - floor(t),
        Wrap::Mirror => {
            let t = t - 2.0 * floor(t / 2.0);
            if t > 1.0 { 2.0 - t } else { t }
        }
        Wrap::Clamp => t.clamp(0.0, 1.0),
    }
}

/// As that of vectors.
#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// The two texels beside a coordinate, and how far it lies from the first to the second.
#[inline]
fn neighbours(wrap: Wrap, t: f32, size: u32) -> ([u32; 2], f32) {
    let x = fold(wrap, t) * size as f32 - 0.5;
    let first = floor(x);
    let (n, i) = (i64::from(size), first as i64);
    // From one before the first to one after the last. Mirrored, the border's neighbour is the border itself, as when
    // clamped.
    let index = |i: i64| match wrap {
        Wrap::Repeat if i < 0 => i + n,
        Wrap::Repeat if i >= n => i - n,
        _ => i.clamp(0, n - 1),
    };
    ([index(i) as u32, index(i + 1) as u32], x - first)
}

/// All 8-bit values as shares.
static LINEAR_8: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| i as f32 / 255.0));
/// The sRGB curve for all 8-bit values.
static SRGB_8: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0)));

impl Level {
    /// The texels at two columns of two rows.
    #[inline]
    fn four(&self, space: ColorSpace, x: [u32; 2], y: [u32; 2]) -> [Vec4; 4] {
        let Pixels::Rgba8(p) = &self.texels else {
            return [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| self.texel(space, x[i], y[j]));
        };
        // Most images are of bytes: decoded by one table.
        let (alpha, curve) = (&*LINEAR_8, if space == ColorSpace::Linear { &*LINEAR_8 } else { &*SRGB_8 });
        let (upper, lower) = (y[0] as usize * self.width as usize, y[1] as usize * self.width as usize);
        let at = |i: usize| {
            let [r, g, b, a] = p[i];
            Vec4::new(curve[usize::from(r)], curve[usize::from(g)], curve[usize::from(b)], alpha[usize::from(a)])
        };
        let (left, right) = (x[0] as usize, x[1] as usize);
        [at(upper + left), at(upper + right), at(lower + left), at(lower + right)]
    }

    /// One channel of [`Level::four`].
    #[inline]
    fn four_of(&self, space: ColorSpace, x: [u32; 2], y: [u32; 2], channel: usize) -> [f32; 4] {
        let Pixels::Rgba8(p) = &self.texels else { return self.four(space, x, y).map(|v| v[channel]) };
        let curve = if space == ColorSpace::Linear || channel == 3 { &*LINEAR_8 } else { &*SRGB_8 };
        let (upper, lower) = (y[0] as usize * self.width as usize, y[1] as usize * self.width as usize);
        let (left, right) = (x[0] as usize, x[1] as usize);
        [upper + left, upper + right, lower + left, lower + right].map(|i| curve[usize::from(p[i][channel])])
    }

    fn texel(&self, space: ColorSpace, x: u32, y: u32) -> Vec4 {
        let i = y as usize * self.width as usize + x as usize;
        match &self.texels {
            Pixels::Rgba8(p) => {
                let [r, g, b, a] = p[i];
                let alpha = f32::from(a) / 255.0;
                if space == ColorSpace::Linear {
                    Vec3::new(f32::from(r), f32::from(g), f32::from(b)).extend(f32::from(a)) / 255.0
                } else {
                    let curve = &*SRGB_8;
                    Vec4::new(curve[usize::from(r)], curve[usize::from(g)], curve[usize::from(b)], alpha)
                }
            }
            Pixels::Rgba16(p) => {
                let v = Vec4::from(p[i].map(f32::from)) / 65535.0;
                if space == ColorSpace::Linear { v } else { v.xyz().map(srgb_to_linear).extend(v.w) }
            }
            Pixels::Rgb32F(p) => {
                // A stray NaN or infinity in a file must not spread.
                Vec3::from(p[i].map(|x| if x.is_finite() { x } else { 0.0 })).extend(1.0)
            }
        }
    }

    /// The image at half the size (rounded down, at least 1).
    fn halved(&self, space: ColorSpace) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let weigh = |v: Vec4| if space == ColorSpace::SrgbCoverage { (v.xyz() * v.w).extend(v.w) } else { v };
        let columns: Vec<_> = (0..width).map(|x| cover(x, width, self.width)).collect();
        let mean = |rows: &[(u32, f32)], columns: &[(u32, f32)]| {
            let (mut sum, mut plain) = (Vec4::ZERO, Vec4::ZERO);
            for (sy, wy) in rows {
                for (sx, wx) in columns {
                    let v = self.texel(space, *sx, *sy);
                    sum += wx * wy * weigh(v);
                    plain += wx * wy * v;
                }
            }
            match space {
                ColorSpace::SrgbCoverage if sum.w > 0.0 => (sum.xyz() / sum.w).extend(sum.w),
                _ => plain,
            }
        };
        let texels = match &self.texels {
            Pixels::Rgba8(_) => {
                let share = |x: f32| (x * 255.0 + 0.5) as u8;
                let color = |x: f32| if space == ColorSpace::Linear { share(x) } else { srgb_byte(x) };
                let encode = |v: Vec4| [color(v.x), color(v.y), color(v.z), share(v.w)];
                Pixels::Rgba8(self.each(height, &columns, |r, c| encode(mean(r, c))))
            }
            Pixels::Rgba16(_) => {
                let encode = |v: Vec4| match space {
                    ColorSpace::Linear => v.to_array(),
                    _ => v.xyz().map(linear_to_srgb).extend(v.w).to_array(),
                };
                let words = |v: Vec4| encode(v).map(|x| (x * 65535.0 + 0.5) as u16);
                Pixels::Rgba16(self.each(height, &columns, |r, c| words(mean(r, c))))
            }
            Pixels::Rgb32F(_) => Pixels::Rgb32F(self.each(height, &columns, |r, c| mean(r, c).xyz().to_array())),
        };
        Self { width, height, texels }
    }

    /// The texels of a smaller image, row by row, each by the rows and columns that it covers here.
    fn each<T: Copy + Default + Send + Sync>(
        &self,
        height: u32,
        columns: &[Vec<(u32, f32)>],
        texel: impl Fn(&[(u32, f32)], &[(u32, f32)]) -> T + Sync,
    ) -> Arc<[T]> {
        let mut texels = vec![T::default(); columns.len() * height as usize];
        texels.par_chunks_mut(columns.len()).enumerate().for_each(|(y, row)| {
            let rows = cover(y as u32, height, self.height);
            for (to, columns) in row.iter_mut().zip(columns) {
                *to = texel(&rows, columns);
            }
        });
        texels.into()
    }
}

/// Where the bytes of the sRGB curve begin: the least linear value of each from 1 on.
static SRGB_STEPS: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let (mut below, mut from) = (0, 1.0f32.to_bits());
        while from - below > 1 {
            let middle = below.midpoint(from);
            let byte = (linear_to_srgb(f32::from_bits(middle)) * 255.0 + 0.5) as usize;
            if byte > i { from = middle } else { below = middle }
        }
        f32::from_bits(from)
    })
});

/// A linear value as a byte of the sRGB curve, rounded.
fn srgb_byte(x: f32) -> u8 {
    SRGB_STEPS.partition_point(|step| *step <= x) as u8
}

/// The texels of a row of `from` that the `i`-th of `to` covers, with the shares of it that they fill.
fn cover(i: u32, to: u32, from: u32) -> Vec<(u32, f32)> {
    let scale = f64::from(from) / f64::from(to);
    let (start, end) = (f64::from(i) * scale, f64::from(i + 1) * scale);
    (start as u32..(end.ceil() as u32).min(from))
        .map(|k| {
            let part = (f64::from(k) + 1.0).min(end) - f64::from(k).max(start);
            (k, (part / scale) as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn image(width: u32, height: u32, pixels: Pixels) -> ImageDesc {
        ImageDesc { name: "test".into(), width, height, pixels }
    }

    fn rgba8(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> ImageDesc {
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        image(width, height, Pixels::Rgba8(pixels))
    }

    fn lookup(image: &ImageDesc, space: ColorSpace, change: impl Fn(&mut TextureRef)) -> TextureLookup {
        let mut reference = TextureRef::new(0);
        change(&mut reference);
        TextureLookup::new(Arc::new(Texture::new(image, space).unwrap()), &reference, true)
    }

    /// Texel (x, y) of this image has the value 10 x + y.
    fn numbered() -> ImageDesc {
        rgba8(4, 2, |x, y| [(10 * x + y) as u8, 0, 0, 255])
    }

    fn value(l: &TextureLookup, u: f32, v: f32) -> f32 {
        l.scalar(Vec2::new(u, v), 0.0) * 255.0
    }

    #[test]
    fn texel_middles_are_exact_and_row_0_is_at_v_0() {
        let l = lookup(&numbered(), ColorSpace::Linear, |_| {});
        for x in 0..4_u8 {
            for y in 0..2_u8 {
                let (u, v) = ((f32::from(x) + 0.5) / 4.0, (f32::from(y) + 0.5) / 2.0);
                assert!((value(&l, u, v) - f32::from(10 * x + y)).abs() < 1e-4);
            }
        }
        // Half way between two middles.
        assert!((value(&l, 0.25, 0.25) - 5.0).abs() < 1e-4);
        assert!((value(&l, 0.125, 0.5) - 0.5).abs() < 1e-4);
    }

    #[test]
    fn wrap_modes_continue_the_image_as_they_say() {
        let with = |wrap| lookup(&numbered(), ColorSpace::Linear, |r| (r.wrap_u, r.wrap_v) = (wrap, wrap));
        let (repeat, mirror, clamp) = (with(Wrap::Repeat), with(Wrap::Mirror), with(Wrap::Clamp));
        let v = 0.25;
        for k in [-3.0, -1.0, 2.0] {
            for x in 0..4 {
                let u = (x as f32 + 0.5) / 4.0;
                assert!((value(&repeat, u + k, v) - value(&repeat, u, v)).abs() < 1e-3);
                let mirrored = if k == 2.0 { u } else { 1.0 - u };
                assert!((value(&mirror, u + k, v) - value(&mirror, mirrored, v)).abs() < 1e-3);
                assert_eq!(value(&clamp, u + k, v), if k < 0.0 { 0.0 } else { 30.0 });
            }
        }
        // At the border: half of each side, only the own side, only the own side.
        assert!((value(&repeat, 0.0, v) - 15.0).abs() < 1e-3);
        assert!(value(&mirror, 0.0, v).abs() < 1e-3 && (value(&mirror, 1.0, v) - 30.0).abs() < 1e-3);
        assert!(value(&clamp, 0.0, v).abs() < 1e-3);
    }

    #[test]
    fn nearest_takes_whole_texels() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let l = lookup(&numbered(), ColorSpace::Linear, |r| {
                r.filter = Filter::Nearest;
                (r.wrap_u, r.wrap_v) = (wrap, wrap);
            });
            for (u, expected) in [(0.0, 0.0), (0.249, 0.0), (0.251, 10.0), (0.999, 30.0)] {
                assert!((value(&l, u, 0.1) - expected).abs() < 1e-4, "{wrap:?} {u}");
            }
        }
    }

    #[test]
    fn srgb_is_decoded_before_filtering() {
        let l = lookup(&rgba8(2, 1, |x, _| [255 * x as u8, 0, 0, 255]), ColorSpace::Srgb, |r| r.wrap_u = Wrap::Clamp);
        assert!((l.scalar(Vec2::new(0.5, 0.5), 0.0) - 0.5).abs() < 1e-6);
        let grey = lookup(&rgba8(1, 1, |_, _| [128, 128, 128, 128]), ColorSpace::Srgb, |_| {});
        let c = grey.color(Vec2::ZERO, 0.0);
        assert!((c.x - 0.215_861).abs() < 1e-5 && (c.w - 128.0 / 255.0).abs() < 1e-6);
    }

    /// Every level, of whatever size, has the mean of the whole image in linear, but for rounding to its bits.
    #[test]
    fn one_channel_is_that_of_all() {
        let image = rgba8(8, 4, |x, y| [x as u8 * 30, y as u8 * 60, 200 - x as u8 * 20, 255 - y as u8 * 50]);
        for space in [ColorSpace::Linear, ColorSpace::Srgb] {
            for (i, channel) in [Channel::Red, Channel::Green, Channel::Blue, Channel::Alpha].into_iter().enumerate() {
                let l = lookup(&image, space, |r| r.channel = channel);
                for (u, v, footprint) in [(0.1, 0.2, 0.0), (0.93, -0.4, 0.3), (7.5, 0.01, 0.11), (0.5, 0.5, 2.0)] {
                    let uv = Vec2::new(u, v);
                    assert_eq!(l.scalar(uv, footprint), l.color(uv, footprint)[i], "{channel:?} {uv}");
                }
            }
        }
    }

    #[test]
    fn what_is_black_over_a_triangle_never_shows_light() {
        // Light in one texel of 64 x 32.
        let image = rgba8(64, 32, |x, y| if (x, y) == (40, 20) { [0, 9, 0, 255] } else { [0, 0, 0, 255] });
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let l = lookup(&image, ColorSpace::Srgb, |r| (r.wrap_u, r.wrap_v) = (wrap, wrap));
            let mut black = 0;
            for k in 0..4000 {
                let number =
                    |i: u32| crate::sampler::PixelSampler::new(k, (0, 0), i).get2(crate::sampler::Dimension::Pixel);
                let corner = Vec2::from(number(0)) * 4.0 - 2.0;
                let [a, b, c] = [0, 1, 2].map(|i| corner + Vec2::from(number(1 + i)) * 0.3);
                if l.is_black_over([a, b, c]) {
                    black += 1;
                    for i in 0..64 {
                        let (x, y) = ((i % 8) as f32 / 7.0, (i / 8) as f32 / 7.0);
                        let uv = a + (b - a) * (x * (1.0 - y)) + (c - a) * y;
                        assert_eq!(l.color(uv, 0.0).xyz(), Vec3::ZERO, "{wrap:?} {uv}");
                    }
                }
            }
            assert!((500..4000).contains(&black), "{wrap:?}: {black}");
            assert!(!l.is_black_over([Vec2::new(0.6, 0.6), Vec2::new(0.65, 0.6), Vec2::new(0.6, 0.7)]));
        }
    }

    #[test]
    fn bytes_of_the_srgb_curve_are_rounded() {
        for i in 0..=4096 {
            let x = i as f32 / 4096.0;
            assert_eq!(srgb_byte(x), (linear_to_srgb(x) * 255.0 + 0.5) as u8, "{x}");
        }
        for byte in 0..=255 {
            assert_eq!(srgb_byte(SRGB_8[usize::from(byte)]), byte);
        }
    }

    #[test]
    fn whole_numbers_below_are_those_of_the_library() {
        for t in [0.0, -0.0, 0.5, -0.5, -1.0, 1.0, 7.99, -7.01, 8_388_607.5, -8_388_607.5, 1e9, -3e12, f32::MAX] {
            assert_eq!(floor(t), t.floor(), "{t}");
        }
    }

    #[test]
    fn smaller_copies_keep_the_mean() {
        for (width, height) in [(8, 8), (7, 5), (13, 1), (1, 9), (6, 3)] {
            let noise = |x: u32, y: u32| ((x * 7919 + y * 104_729 + x * y * 31) % 256) as u8;
            let pixels: Vec<[u16; 4]> = (0..width * height)
                .map(|i| [noise(i % width, i / width), 0, 0, 255].map(|v| u16::from(v) * 257))
                .collect();
            let image = image(width, height, Pixels::Rgba16(pixels.into()));
            for space in [ColorSpace::Linear, ColorSpace::Srgb] {
                let texture = Texture::new(&image, space).unwrap();
                let mean = |level: &Level| {
                    let texels = (0..level.width * level.height)
                        .map(|i| f64::from(level.texel(space, i % level.width, i / level.width).x));
                    texels.sum::<f64>() / f64::from(level.width * level.height)
                };
                let whole = mean(&texture.levels[0]);
                for level in &texture.levels {
                    assert!((mean(level) - whole).abs() < 1e-4, "{width}x{height} {space:?} {}", level.width);
                }
                let last = texture.levels.last().unwrap();
                assert_eq!((last.width, last.height), (1, 1));
            }
        }
    }

    #[test]
    fn wide_footprints_see_the_mean_and_narrow_ones_the_texel() {
        let checker = rgba8(64, 64, |x, y| [255 * ((x + y) % 2) as u8, 0, 0, 255]);
        let l = lookup(&checker, ColorSpace::Linear, |_| {});
        let uv = Vec2::new(0.5 / 64.0, 0.5 / 64.0);
        assert_eq!(l.scalar(uv, 0.0), 0.0);
        assert_eq!(l.scalar(uv, 1.0 / 64.0), 0.0);
        for footprint in [2.0 / 64.0, 0.5, 1.0, 1e6, f32::INFINITY] {
            assert!((l.scalar(uv, footprint) - 0.5).abs() < 3e-3, "{footprint}");
        }
        // A texture repeated twice as often shows twice as many texels in the same footprint.
        let twice = lookup(&checker, ColorSpace::Linear, |r| r.transform = Affine2::from_scale(Vec2::splat(2.0)));
        assert!((twice.scalar(uv * 0.5, 1.0 / 64.0) - 0.5).abs() < 3e-3);
        let reference = TextureRef::new(0);
        let plain =
            TextureLookup::new(Arc::new(Texture::new(&checker, ColorSpace::Linear).unwrap()), &reference, false);
        assert_eq!(plain.scalar(uv, 1.0), 0.0, "without mips there is only the whole image");
    }

    #[test]
    fn what_is_cut_out_does_not_tint_smaller_copies() {
        let leaf = rgba8(2, 2, |x, _| if x == 0 { [0, 255, 0, 255] } else { [255, 0, 255, 0] });
        let coverage = lookup(&leaf, ColorSpace::SrgbCoverage, |_| {}).color(Vec2::splat(0.5), 10.0);
        assert_eq!((coverage.xyz(), coverage.w), (Vec3::Y, 128.0 / 255.0));
        let plain = lookup(&leaf, ColorSpace::Srgb, |_| {}).color(Vec2::splat(0.5), 10.0);
        assert!((plain.xyz() - Vec3::splat(0.5)).length() < 0.01);
    }

    #[test]
    fn scale_offset_and_channel_are_applied() {
        let image = rgba8(1, 1, |_, _| [51, 102, 153, 204]);
        for (channel, expected) in [
            (Channel::Red, 0.2),
            (Channel::Green, 0.4),
            (Channel::Blue, 0.6),
            (Channel::Alpha, 0.8),
            (Channel::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6),
        ] {
            let l = lookup(&image, ColorSpace::Linear, |r| {
                (r.channel, r.value_scale, r.value_offset) = (channel, 2.0, 0.5);
            });
            assert!((l.scalar(Vec2::ZERO, 0.0) - (2.0 * expected + 0.5)).abs() < 1e-6, "{channel:?}");
            let c = l.color(Vec2::ZERO, 0.0);
            assert!((c - Vec4::new(0.9, 1.3, 1.7, 0.8)).length() < 1e-6);
        }
    }

    #[test]
    fn an_image_without_its_pixels_is_refused() {
        let error = Texture::new(&image(2, 2, Pixels::Rgba8(Arc::new([[0; 4]; 3]))), ColorSpace::Srgb).unwrap_err();
        assert_eq!(error.to_string(), "image 'test' should have 2 x 2 pixels (at least one), but has 3");
        assert!(Texture::new(&image(0, 0, Pixels::Rgb32F(Arc::new([]))), ColorSpace::Linear).is_err());
    }

    proptest! {
        /// Any coordinates and footprints at all: no panic, and a value between the image's least and greatest.
        #[test]
        fn any_coordinates_give_a_value_of_the_image(
            u in any::<f32>(), v in any::<f32>(), footprint in any::<f32>(),
            wrap in prop::sample::select(vec![Wrap::Repeat, Wrap::Mirror, Wrap::Clamp]),
            filter in prop::sample::select(vec![Filter::Nearest, Filter::Linear]),
            width in 1_u32..9, height in 1_u32..9,
        ) {
            let image = rgba8(width, height, |x, y| [(20 + 20 * x + y) as u8, 0, 0, 255]);
            let l = lookup(&image, ColorSpace::Linear, |r| {
                (r.wrap_u, r.wrap_v, r.filter) = (wrap, wrap, filter);
            });
            let value = l.scalar(Vec2::new(u, v), footprint) * 255.0;
            prop_assert!((19.9..=190.0).contains(&value), "{value}");
        }
    }
}
