//! What light paths add to a picture: anywhere in it, so that they cannot add to its pixels as they go.

use std::collections::TryReserveError;

use glam::Vec3;
use rayon::prelude::*;

use crate::Crop;
use crate::filter::Filter;

/// Some light at a point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contribution {
    /// Where, in pixels of the whole picture.
    pub(crate) at: [f32; 2],
    pub(crate) light: Vec3,
}

/// Where in the picture light counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reach {
    low: [f64; 2],
    high: [f64; 2],
}

impl Reach {
    /// Wherever a filter of this radius has a pixel of the window.
    pub(crate) fn new(window: Crop, radius: f64) -> Self {
        let [x, y] = [window.x, window.y].map(f64::from);
        // From the outermost pixels' middles.
        let margin = radius - 0.5;
        Self {
            low: [x - margin, y - margin],
            high: [x + f64::from(window.width) + margin, y + f64::from(window.height) + margin],
        }
    }

    #[inline]
    pub(crate) fn contains(&self, at: [f64; 2]) -> bool {
        (0..2).all(|i| self.low[i] <= at[i] && at[i] <= self.high[i])
    }
}

/// The light of one sample of all pixels of a window.
#[derive(Debug)]
pub(crate) struct Splats {
    window: Crop,
    pixels: Vec<Vec3>,
}

impl Splats {
    /// Black.
    pub(crate) fn new(window: Crop) -> Result<Self, TryReserveError> {
        let count = (window.width as usize).saturating_mul(window.height as usize);
        let mut pixels = Vec::new();
        pixels.try_reserve_exact(count)?;
        pixels.resize(count, Vec3::ZERO);
        Ok(Self { window, pixels })
    }

    pub(crate) fn clear(&mut self) {
        self.pixels.fill(Vec3::ZERO);
    }

    /// Adds contributions in their order, each times `scale` by the filter's weights. Every thread adds up rows of its
    /// own, so the sums do not depend on how many there are.
    pub(crate) fn add(&mut self, lists: &[Vec<Contribution>], filter: &Filter, scale: f32) {
        let width = self.window.width as usize;
        let rows = (self.window.height as usize).div_ceil(rayon::current_num_threads()).max(1);
        let (radius, left, top) = (filter.radius(), i64::from(self.window.x), i64::from(self.window.y));
        self.pixels.par_chunks_mut((rows * width).max(1)).enumerate().for_each(|(i, pixels)| {
            let first = top + (i * rows) as i64;
            let last = first + (pixels.len() / width) as i64;
            for c in lists.iter().flatten() {
                let [x, y] = c.at.map(f64::from);
                let (from, to) = covered(y, radius);
                for row in from.max(first)..to.min(last) {
                    let across = filter.density(y - (row as f64 + 0.5));
                    if across == 0.0 {
                        continue;
                    }
                    let row = &mut pixels[(row - first) as usize * width..][..width];
                    let (from, to) = covered(x, radius);
                    for column in from.max(left)..to.min(left + width as i64) {
                        let weight = across * filter.density(x - (column as f64 + 0.5));
                        row[(column - left) as usize] += c.light * (weight as f32 * scale);
                    }
                }
            }
        });
    }

    /// The light of a pixel by its place in the whole picture.
    pub(crate) fn at(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[(y - self.window.y) as usize * self.window.width as usize + (x - self.window.x) as usize]
    }
}

/// The pixels (first, one after the last) whose middles are no further than this.
fn covered(x: f64, radius: f64) -> (i64, i64) {
    ((x - radius - 0.5).floor() as i64, (x + radius - 0.5).floor() as i64 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(splats: &Splats) -> Vec3 {
        splats.pixels.iter().sum()
    }

    #[test]
    fn light_falls_on_the_pixels_that_see_it() {
        let window = Crop { x: 10, y: 20, width: 8, height: 6 };
        let light = Vec3::new(1.0, 2.0, 4.0);
        let mut splats = Splats::new(window).unwrap();
        splats.add(&[vec![Contribution { at: [12.0, 23.99], light }]], &Filter::Box, 0.5);
        assert_eq!(splats.at(12, 23), light * 0.5);
        assert_eq!(sum(&splats), light * 0.5);
        splats.clear();
        splats.add(&[vec![], vec![Contribution { at: [13.3, 22.6], light }]], &Filter::blackman_harris(), 1.0);
        // Weights add up to one within 3.6 per cent along each axis.
        assert!((sum(&splats) / light - 1.0).abs().max_element() < 0.075);
        assert!(splats.at(13, 22).x > splats.at(12, 22).x && splats.at(12, 22).x > 0.0);
    }

    /// Light beside the window reaches its pixels, as camera rays of theirs go there; no thread count changes a bit.
    #[test]
    fn margins_count_and_threads_do_not() {
        let window = Crop { x: 2, y: 3, width: 9, height: 7 };
        let filter = Filter::blackman_harris();
        let reach = Reach::new(window, filter.radius());
        let list: Vec<Contribution> = (0..500_u32)
            .map(|i| {
                let at = [(i as f32 * 0.618).fract() * 16.0 - 1.0, (i as f32 * 0.755).fract() * 14.0];
                Contribution { at, light: Vec3::splat(1.0 + (i as f32 * 0.57).fract()) }
            })
            .collect();
        let with = |threads, list: &[Contribution]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut splats = Splats::new(window).unwrap();
            pool.install(|| splats.add(&[list.to_vec()], &filter, 1.0));
            splats.pixels
        };
        assert_eq!(with(1, &list), with(3, &list));
        let inside: Vec<Contribution> = list.iter().copied().filter(|c| reach.contains(c.at.map(f64::from))).collect();
        assert!(inside.len() < list.len());
        assert_eq!(with(1, &list), with(2, &inside), "nothing beyond the reach counts");
    }
}
