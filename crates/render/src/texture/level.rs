//! One size of an image: its texels, and how the next smaller one is made of them.

use std::sync::{Arc, LazyLock};

use firsthit_import::scene::Pixels;
use glam::{Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::ColorSpace;
use crate::view::{linear_to_srgb, srgb_to_linear};

/// Texels, row by row.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) texels: Pixels,
}

/// All 8-bit values as shares.
static LINEAR_8: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| i as f32 / 255.0));
/// The sRGB curve for all 8-bit values.
pub(super) static SRGB_8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0)));

impl Level {
    /// The texels at two columns of two rows.
    #[inline]
    pub(super) fn four(&self, space: ColorSpace, x: [u32; 2], y: [u32; 2]) -> [Vec4; 4] {
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
    pub(super) fn four_of(&self, space: ColorSpace, x: [u32; 2], y: [u32; 2], channel: usize) -> [f32; 4] {
        let Pixels::Rgba8(p) = &self.texels else { return self.four(space, x, y).map(|v| v[channel]) };
        let curve = if space == ColorSpace::Linear || channel == 3 { &*LINEAR_8 } else { &*SRGB_8 };
        let (upper, lower) = (y[0] as usize * self.width as usize, y[1] as usize * self.width as usize);
        let (left, right) = (x[0] as usize, x[1] as usize);
        [upper + left, upper + right, lower + left, lower + right].map(|i| curve[usize::from(p[i][channel])])
    }

    pub(super) fn texel(&self, space: ColorSpace, x: u32, y: u32) -> Vec4 {
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
    pub(super) fn halved(&self, space: ColorSpace) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        if let Pixels::Rgba8(texels) = &self.texels
            && (self.width, self.height) == (2 * width, 2 * height)
            && space != ColorSpace::SrgbCoverage
        {
            return Self { width, height, texels: Pixels::Rgba8(halved_bytes(texels, width as usize, space)) };
        }
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

/// The means of two by two texels, of an image that is twice as wide and high: the common case of [`Level::halved`].
fn halved_bytes(texels: &[[u8; 4]], width: usize, space: ColorSpace) -> Arc<[[u8; 4]]> {
    let mut means = vec![[0; 4]; texels.len() / 4];
    let curve = &*SRGB_8;
    means.par_chunks_mut(width).zip(texels.par_chunks(4 * width)).for_each(|(means, rows)| {
        let (upper, lower) = rows.split_at(2 * width);
        for ((mean, a), b) in means.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
            let four = [a[0], a[1], b[0], b[1]];
            let share = |c: usize| ((four.iter().map(|texel| u16::from(texel[c])).sum::<u16>() + 2) / 4) as u8;
            let color = |c: usize| srgb_byte(0.25 * four.iter().map(|texel| curve[usize::from(texel[c])]).sum::<f32>());
            *mean = match space {
                ColorSpace::Linear => [share(0), share(1), share(2), share(3)],
                _ => [color(0), color(1), color(2), share(3)],
            };
        }
    });
    means.into()
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

/// Cells of equal width between 0 and 1, and the byte at which each begins.
static SRGB_CELLS: LazyLock<[u8; CELLS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|i| SRGB_STEPS.partition_point(|step| *step <= i as f32 / CELLS as f32) as u8)
});
const CELLS: usize = 4096;

/// A linear value as a byte of the sRGB curve, rounded.
pub(super) fn srgb_byte(x: f32) -> u8 {
    // The cell is at most a byte too low: the curve is nowhere steeper than a byte a cell.
    let mut byte = SRGB_CELLS[((x * CELLS as f32) as usize).min(CELLS)];
    while byte < u8::MAX && SRGB_STEPS[usize::from(byte)] <= x {
        byte += 1;
    }
    byte
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
