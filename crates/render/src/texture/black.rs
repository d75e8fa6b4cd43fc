//! Which parts of an image are black.

use firsthit_import::scene::{Pixels, Wrap};

use super::Texture;

/// Side of the blocks that are known to be black or not, in texels.
const DARK_BLOCK: u32 = 8;

impl Texture {
    /// Whether the whole image is black between two of its texels, which may lie beyond its borders. False also where
    /// that is not known.
    pub(super) fn is_black(&self, wrap: [Wrap; 2], low: [i64; 2], high: [i64; 2]) -> bool {
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
