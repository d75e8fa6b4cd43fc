//! A texture as a material uses it.

use std::sync::Arc;

use firsthit_import::scene::{Channel, Filter, TextureRef, Wrap};
use glam::{Affine2, Vec2, Vec4, Vec4Swizzles};

use super::{All, One, Texture, View};
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
    /// Of its [`Layout`] among those of all materials.
    layout: u32,
}

/// All that decides where a texture is read at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Layout {
    size: (u32, u32),
    uv_set: usize,
    transform: Affine2,
    wrap: [Wrap; 2],
    mode: Mode,
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
            layout: 0,
            texture,
        }
    }

    /// Gives it the number of its layout among others.
    pub(crate) fn numbered(mut self, layouts: &mut Vec<Layout>) -> Self {
        let TextureLookup { uv_set, transform, wrap, mode, .. } = self;
        let own = Layout { size: self.texture.size(), uv_set, transform, wrap, mode };
        let known = layouts.iter().position(|l| *l == own);
        self.layout = known.unwrap_or_else(|| {
            layouts.push(own);
            layouts.len() - 1
        }) as u32;
        self
    }

    /// Textures of one number are read at the same places, wherever they are looked up.
    #[inline]
    pub(crate) fn layout(&self) -> u32 {
        self.layout
    }

    /// Where it is read at a mesh's texture coordinates. Of two levels that are to be mixed `chance`, from 0 to 1, takes
    /// one: on average over many samples that is the same, for half of the texels. Pharr et al., "Filtering After Shading
    /// With Stochastic Texture Filtering" (2024).
    #[inline]
    pub(crate) fn view(&self, uv: Vec2, footprint: f32, chance: f32) -> View {
        let at = self.transform.transform_point2(uv);
        match self.mode {
            Mode::Nearest => self.texture.view_nearest(self.wrap, at),
            Mode::Bilinear => self.texture.view_one_of(self.wrap, at, 0.0, 0.0),
            Mode::Trilinear => self.texture.view_one_of(self.wrap, at, footprint * self.texels_per_uv, chance),
        }
    }

    /// The linear colour and alpha there.
    #[inline]
    pub(crate) fn color_at(&self, view: &View) -> Vec4 {
        self.scaled(self.texture.read(view, All))
    }

    /// The channel that the reference names there.
    #[inline]
    pub(crate) fn scalar_at(&self, view: &View) -> f32 {
        match self.number() {
            Some(channel) => self.texture.read(view, One(channel)) * self.value_scale + self.value_offset,
            None => self.pick(self.texture.read(view, All)),
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
        self.scaled(self.lookup(uv, footprint))
    }

    #[inline]
    fn scaled(&self, value: Vec4) -> Vec4 {
        (value.xyz() * self.value_scale + self.value_offset).extend(value.w)
    }

    /// The channel that the reference names, at a mesh's texture coordinates: see [`TextureLookup::color`].
    #[inline]
    #[must_use]
    pub fn scalar(&self, uv: Vec2, footprint: f32) -> f32 {
        self.pick(self.lookup(uv, footprint))
    }

    /// Of most images only one channel has to be decoded: which.
    #[inline]
    fn number(&self) -> Option<usize> {
        match self.channel {
            Channel::Red => Some(0),
            Channel::Green => Some(1),
            Channel::Blue => Some(2),
            Channel::Alpha => Some(3),
            Channel::Luminance => None,
        }
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

    /// [`TextureLookup::scalar_at`] of this and of one that [reads as](TextureLookup::reads_as) it.
    #[inline]
    pub(crate) fn scalars_at(&self, other: &Self, view: &View) -> [f32; 2] {
        let value = self.texture.read(view, All);
        [self.pick(value), other.pick(value)]
    }

    fn lookup(&self, uv: Vec2, footprint: f32) -> Vec4 {
        let uv = self.transform.transform_point2(uv);
        match self.mode {
            Mode::Nearest => self.texture.read(&self.texture.view_nearest(self.wrap, uv), All),
            Mode::Bilinear => self.texture.filtered(self.wrap, uv, 0.0, All),
            Mode::Trilinear => self.texture.filtered(self.wrap, uv, footprint * self.texels_per_uv, All),
        }
    }
}
