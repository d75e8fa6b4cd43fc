//! Pixel filters, sampled in proportion to their weight: every sample then counts the same.

use std::f64::consts::TAU;

use crate::distribution::Distribution1D;

/// The weight of light around a pixel's middle.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Even over the pixel's own square.
    Box,
    /// A window in both axes.
    Window {
        /// Where its weight ends, in pixels from the middle.
        radius: f64,
        /// Its weight by equal steps from one end to the other.
        weights: Distribution1D,
    },
}

impl Filter {
    /// How far from a pixel's middle light still counts, in pixels along each axis.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Window { radius, .. } => *radius,
        }
    }

    /// The weight along one axis at this distance from the pixel's middle, in pixels: the density of
    /// [`Filter::offset`].
    #[inline]
    #[must_use]
    pub fn density(&self, x: f64) -> f64 {
        match self {
            Self::Box => f64::from(u8::from((-0.5..0.5).contains(&x))),
            Self::Window { radius, weights } => {
                let steps = weights.cells() as f64;
                let step = (0.5 * (x / radius + 1.0) * steps).floor();
                if !(0.0..steps).contains(&step) {
                    return 0.0;
                }
                f64::from(weights.probability(step as usize)) * steps / (2.0 * radius)
            }
        }
    }

    /// The four-term Blackman-Harris window of radius 1.5 pixels: smooth, nearly free of ringing and aliasing.
    ///
    /// Harris, *On the Use of Windows for Harmonic Analysis with the Discrete Fourier Transform*, 1978.
    #[must_use]
    pub fn blackman_harris() -> Self {
        const STEPS: usize = 512;
        let weights: Vec<f32> = (0..STEPS).map(|i| blackman_harris((i as f64 + 0.5) / STEPS as f64) as f32).collect();
        // The window is positive, so the table is never refused.
        Distribution1D::new(&weights).map_or(Self::Box, |weights| Self::Window { radius: 1.5, weights })
    }

    /// Where a sample lies relative to the pixel's middle, in pixels, for a point of the unit square.
    #[inline]
    #[must_use]
    pub fn offset(&self, u: [f32; 2]) -> [f64; 2] {
        match self {
            Self::Box => u.map(|x| f64::from(x) - 0.5),
            Self::Window { radius, weights } => u.map(|x| {
                let (step, inside) = weights.sample(x);
                radius * (2.0 * (step as f64 + f64::from(inside)) / weights.cells() as f64 - 1.0)
            }),
        }
    }
}

/// The window at `t` in [0, 1].
fn blackman_harris(t: f64) -> f64 {
    const TERMS: [f64; 4] = [0.358_75, -0.488_29, 0.141_28, -0.011_68];
    TERMS.into_iter().enumerate().map(|(k, a)| a * (TAU * k as f64 * t).cos()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 1.5;

    #[test]
    fn the_box_covers_its_pixel_evenly() {
        assert_eq!(Filter::Box.offset([0.0, 0.75]), [-0.5, 0.25]);
    }

    /// What falls on a point counts once in all pixels together.
    #[test]
    fn weights_of_all_pixels_add_up_to_one() {
        for filter in [Filter::Box, Filter::blackman_harris()] {
            for i in 0..100 {
                let x = f64::from(i) / 100.0 - 0.5;
                let sum: f64 = (-3..=3).map(|k| filter.density(x - f64::from(k))).sum();
                // Of the window's terms the last is left over, and its table has steps; averaged over the pixel it does.
                let tolerance = if matches!(filter, Filter::Box) { 0.0 } else { 0.011_68 / 0.358_75 + 0.004 };
                assert!((sum - 1.0).abs() <= tolerance, "{sum} at {x}");
            }
            let n = 3000;
            let integral: f64 =
                (0..n).map(|i| filter.density((f64::from(i) + 0.5) / 1000.0 - 1.5)).sum::<f64>() / 1000.0;
            assert!((integral - 1.0).abs() < 1e-3, "{integral}");
        }
    }

    /// Moments of the sampled offsets against those of the window, by the midpoint rule.
    #[test]
    fn offsets_follow_the_window() {
        let filter = Filter::blackman_harris();
        let n = 1 << 14;
        let offsets: Vec<f64> = (0..n).map(|i| filter.offset([(i as f32 + 0.5) / n as f32, 0.5])[0]).collect();
        assert!(offsets.iter().all(|x| x.abs() <= RADIUS));
        assert!(offsets.windows(2).all(|w| w[0] <= w[1]));
        let window = |x: f64| blackman_harris(x / (2.0 * RADIUS) + 0.5);
        let grid = || (0..n).map(|i| RADIUS * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0));
        let total: f64 = grid().map(window).sum();
        for power in [1, 2, 4] {
            let expected = grid().map(|x| window(x) * x.powi(power)).sum::<f64>() / total;
            let sampled = offsets.iter().map(|x| x.powi(power)).sum::<f64>() / f64::from(n);
            assert!((expected - sampled).abs() < 1e-4, "moment {power}: {sampled} is not {expected}");
        }
    }
}
