//! A texture as a material uses it.

use std::sync::Arc;

use firsthit_import::scene::{Channel, Filter, TextureRef, Wrap};
use glam::{Affine2, Vec2, Vec4, Vec4Swizzles};

use super::{All, One, Texture};
use crate::light::environment::luminance;

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
            uv_set: reference.uv_set,
            transform: reference.transform,
            texels_per_uv: area.sqrt(),
            wrap: [reference.wrap_u, reference.wrap_v],
            mode,
            // Of grey each channel is the luminance, and one is read faster than three.
            channel: match reference.channel {
                Channel::Luminance if texture.is_grey() => Channel::Red,
                channel => channel,
            },
            value_scale: reference.value_scale,
            value_offset: reference.value_offset,
            texture,
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
            Mode::Bilinear => self.texture.filtered(self.wrap, at, 0.0, One(channel)),
            Mode::Trilinear => self.texture.filtered(self.wrap, at, footprint * self.texels_per_uv, One(channel)),
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
            Mode::Bilinear => self.texture.filtered(self.wrap, uv, 0.0, All),
            Mode::Trilinear => self.texture.filtered(self.wrap, uv, footprint * self.texels_per_uv, All),
        }
    }
}
