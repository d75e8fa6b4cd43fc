//! Pixel filters, sampled in proportion to their weight: every sample then counts the same.

use std::f64::consts::TAU;

/// The weight of light around a pixel's middle.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Even over the pixel's own square.
    Box,
    /// Blackman-Harris window of radius 1.5 pixels in both axes: smooth, nearly free of ringing and aliasing.
    BlackmanHarris(Box<BlackmanHarris>),
}

impl Filter {
    /// The Blackman-Harris filter, with its table.
    #[must_use]
    pub fn blackman_harris() -> Self {
        Self::BlackmanHarris(Box::new(BlackmanHarris::new()))
    }

    /// Where a sample lies relative to the pixel's middle, in pixels, for a point of the unit square.
    #[inline]
    #[must_use]
    pub fn offset(&self, u: [f32; 2]) -> [f64; 2] {
        match self {
            Self::Box => u.map(|x| f64::from(x) - 0.5),
            Self::BlackmanHarris(table) => u.map(|x| table.offset(x)),
        }
    }
}

/// The inverse of the window's sum, tabulated.
#[derive(Clone, Debug)]
pub struct BlackmanHarris {
    inverse: [f64; CELLS + 1],
}

const CELLS: usize = 512;
const RADIUS: f64 = 1.5;
/// The four-term window: Harris, *On the Use of Windows for Harmonic Analysis with the DFT*, 1978.
const TERMS: [f64; 4] = [0.358_75, -0.488_29, 0.141_28, -0.011_68];

impl BlackmanHarris {
    fn new() -> Self {
        let mut inverse = [0.0; CELLS + 1];
        for (i, value) in inverse.iter_mut().enumerate() {
            // Bisection down to the last bit: the sum is monotonic.
            let target = i as f64 / CELLS as f64;
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if window_sum(middle) < target { low = middle } else { high = middle }
            }
            *value = (0.5 * (low + high) - 0.5) * 2.0 * RADIUS;
        }
        Self { inverse }
    }

    fn offset(&self, u: f32) -> f64 {
        let x = f64::from(u) * CELLS as f64;
        let cell = (x as usize).min(CELLS - 1);
        let (a, b) = (self.inverse[cell], self.inverse[cell + 1]);
        a + (b - a) * (x - cell as f64)
    }
}

/// The share of the window before `t` in [0, 1].
fn window_sum(t: f64) -> f64 {
    let waves = (1..4).map(|k| TERMS[k] * (TAU * k as f64 * t).sin() / (TAU * k as f64)).sum::<f64>();
    t + waves / TERMS[0]
}
