//! A map of numbers as colours.

use firsthit_render::film::Picture;
use firsthit_render::view::srgb_to_linear;

/// Black, violet, red, orange, pale yellow: grows in lightness all the way, so that it also reads in grey. sRGB, 8 bits.
const COLORS: [[f32; 3]; 5] =
    [[0.0, 0.0, 4.0], [81.0, 18.0, 124.0], [183.0, 55.0, 121.0], [252.0, 137.0, 97.0], [252.0, 253.0, 191.0]];

/// A picture of numbers from 0 (black) to 1 (pale yellow), linear; what lies outside counts as the end, NaN as 1.
///
/// ```
/// use firsthit_measure::picture::heat;
/// let picture = heat(2, &[0.0, 1.0]);
/// assert!(picture.pixels[1][0] > picture.pixels[0][0]);
/// ```
#[must_use]
pub fn heat(width: u32, values: &[f64]) -> Picture {
    let color = |value: &f64| {
        let x = if value.is_nan() { 1.0 } else { value.clamp(0.0, 1.0) as f32 } * (COLORS.len() - 1) as f32;
        let below = (x as usize).min(COLORS.len() - 2);
        let t = x - below as f32;
        let channel = |c: usize| {
            let (a, b) = (COLORS[below][c], COLORS[below + 1][c]);
            srgb_to_linear((a + (b - a) * t) / 255.0)
        };
        [channel(0), channel(1), channel(2), 1.0]
    };
    let height = (values.len() / width.max(1) as usize) as u32;
    Picture { width, height, pixels: values.iter().map(color).collect() }
}
