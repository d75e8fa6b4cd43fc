//! How noisy a picture still is, tile by tile.

use rayon::prelude::*;

use crate::{Crop, Film};

/// Width and height of a tile, in pixels. Tiles are cut from the whole picture, not from the window that is held.
pub(crate) const TILE: u32 = 16;

/// The tiles of a window, and which of them still get samples.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    window: Crop,
    across: u32,
    active: Vec<bool>,
}

impl Tiles {
    /// All tiles of a window, active.
    pub(crate) fn new(window: Crop) -> Self {
        let count = |from: u32, size: u32| if size == 0 { 0 } else { (from + size - 1) / TILE - from / TILE + 1 };
        let (across, down) = (count(window.x, window.width), count(window.y, window.height));
        Self { window, across, active: vec![true; across as usize * down as usize] }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.active.len()
    }

    /// Which of them still get samples.
    pub(crate) fn active(&self) -> &[bool] {
        &self.active
    }

    /// Takes up what was decided before.
    pub(crate) fn set_active(&mut self, active: &[bool]) {
        self.active.copy_from_slice(active);
    }

    /// Whether the tile of a pixel (by its place in the whole picture) still gets samples.
    #[inline]
    pub(crate) fn is_active(&self, x: u32, y: u32) -> bool {
        let (column, row) = (x / TILE - self.window.x / TILE, y / TILE - self.window.y / TILE);
        self.active[(row * self.across + column) as usize]
    }

    /// Whether any tile still gets samples.
    pub(crate) fn any(&self) -> bool {
        self.active.contains(&true)
    }

    /// From here on only tiles get samples whose noise is above the threshold. Only tiles whose pixels all have exactly
    /// this many samples are judged: others have been, or will be when they have as many.
    pub(crate) fn judge(&mut self, film: &Film, threshold: f32, samples: u32) {
        let noise = self.noise(film, Some(samples));
        for (active, noise) in self.active.iter_mut().zip(noise) {
            *active &= !noise.is_some_and(|n| n <= threshold);
        }
    }

    /// The noise of the noisiest tile; `None` where it is not known of all.
    pub(crate) fn most(&self, film: &Film) -> Option<f32> {
        self.noise(film, None).into_iter().try_fold(0.0, |most: f32, n| n.map(|n| most.max(n)))
    }

    /// The estimated noise of each tile, if its pixels have this many samples: see
    /// [`crate::RenderOptions::noise_threshold`].
    fn noise(&self, film: &Film, samples: Option<u32>) -> Vec<Option<f32>> {
        let window = self.window;
        let of_tile = |i: usize| {
            let (column, row) = (i as u32 % self.across, i as u32 / self.across);
            let (left, top) = ((window.x / TILE + column) * TILE, (window.y / TILE + row) * TILE);
            let xs = left.max(window.x)..(left + TILE).min(window.x + window.width);
            let (mut sum, mut pixels) = (0.0, 0);
            for y in top.max(window.y)..(top + TILE).min(window.y + window.height) {
                for x in xs.clone() {
                    let pixel = film.of_color(x, y);
                    if samples.is_some_and(|n| n != pixel.count()) {
                        return None;
                    }
                    let (mean, variance) = (pixel.mean(), pixel.variance()?);
                    for (m, v) in mean.into_iter().zip(variance) {
                        sum += f64::from(v) / (f64::from(m) * f64::from(m) + 0.01) / 3.0;
                    }
                    pixels += 1;
                }
            }
            Some((sum / f64::from(pixels)).sqrt() as f32)
        };
        (0..self.active.len()).into_par_iter().map(of_tile).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quiet_tiles_are_left_alone() {
        let crop = Crop { x: 10, y: 3, width: 30, height: 20 };
        let mut film = Film::new(100, 100, Some(crop), &[]).unwrap();
        let mut tiles = Tiles::new(film.window());
        assert_eq!(tiles.active.len(), 6);
        assert_eq!(tiles.most(&film), None);
        for mut band in film.bands_mut(4) {
            for y in band.rows() {
                for x in band.columns() {
                    // Noisy on the right of x = 32; blocks of 16 samples differ.
                    for block in 0..4 {
                        let value = if x >= 32 && block % 2 == 0 { 0.0 } else { 1.0 };
                        (0..16).for_each(|_| band.pixel(x, y)[0].add([value, value, value, 1.0]));
                    }
                }
            }
        }
        // Values 0, 1, 0, 1: the variance of their mean is 1/12, at a mean of 1/2.
        let expected = (1.0_f32 / 12.0 / 0.26).sqrt();
        assert!((tiles.most(&film).unwrap() - expected).abs() < 1e-4);
        tiles.judge(&film, 0.1, 48);
        assert!(tiles.is_active(31, 3), "it has other samples than those it is judged by");
        tiles.judge(&film, 0.1, 64);
        assert!(tiles.any() && tiles.is_active(32, 3) && !tiles.is_active(31, 3) && !tiles.is_active(10, 22));
        tiles.judge(&film, 1.0, 64);
        assert!(!tiles.any());
    }
}
