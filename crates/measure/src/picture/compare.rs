//! How far a picture is from a better one, as numbers.

use firsthit_render::{View, ViewTransform, film::Picture};
use serde::Serialize;

use super::{PIXELS_PER_DEGREE, PictureError, check_sizes, flip_map};

/// What is added to the square of the reference in relative errors, so that black pixels do not count for everything.
const FLOOR: f64 = 0.01;
/// Of so many pixels, the worst one is left out of the trimmed error.
const TRIMMED: usize = 1000;
/// Side of the blocks of [`Block`], pixels.
const BLOCK: u32 = 8;

/// How a picture differs from a reference. Sums run over all pixels and red, green and blue; alpha is left out.
///
/// Of equal pictures `psnr` is infinite; where the reference is black `mean_ratio` is not a number. JSON has neither:
/// both are `null` there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean of (x - r)^2, linear radiance.
    pub mse: f64,
    /// Mean of (x - r)^2 / (r^2 + 0.01).
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of the pixels: edges of lights, fireflies.
    pub trimmed_rel_mse: f64,
    /// Mean of the picture over mean of the reference.
    pub mean_ratio: f64,
    /// Peak signal to noise ratio in decibels of what a display shows: clipped to 1, sRGB curve.
    pub psnr: f64,
    /// Mean LDR-FLIP of what a display shows: see [`super::flip`].
    pub flip: f64,
    /// The block of 8 x 8 pixels whose mean is off most.
    pub worst_block: Block,
    /// Pixels that are not finite in one of the pictures; they count nowhere else but in `flip`, as black.
    pub not_finite: u64,
}

/// A block of 8 x 8 pixels (fewer at the right and lower edge), compared by its mean: noise hardly counts, what is
/// wrong does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Block {
    /// Its left column of pixels.
    pub x: u32,
    /// Its upper row.
    pub y: u32,
    /// Mean of the reference: red, green, blue.
    pub reference: [f64; 3],
    /// Mean of the picture.
    pub picture: [f64; 3],
    /// |mean of picture - mean of reference| / sqrt(r^2 + 0.01), of the channel where it is largest.
    pub difference: f64,
}

/// Compares a picture with a reference of the same size.
///
/// ```
/// use firsthit_measure::picture::compare;
/// use firsthit_render::film::Picture;
/// let of = |x| Picture { width: 8, height: 8, pixels: vec![[x, x, x, 1.0]; 64] };
/// let c = compare(&of(0.5), &of(0.75))?;
/// assert_eq!((c.mse, c.mean_ratio), (0.0625, 1.5));
/// assert!((c.rel_mse - 0.0625 / 0.26).abs() < 1e-12);
/// # Ok::<(), firsthit_measure::picture::PictureError>(())
/// ```
///
/// # Errors
/// When the pictures differ in size.
pub fn compare(reference: &Picture, picture: &Picture) -> Result<Comparison, PictureError> {
    check_sizes(reference, picture)?;
    let view = View { transform: ViewTransform::Srgb, ..View::default() };
    let flip = flip_map(reference, picture, &view, PIXELS_PER_DEGREE)?;
    let mut sums = Sums::default();
    // Relative error of each pixel, mean of its channels.
    let mut relative = Vec::with_capacity(reference.pixels.len());
    for (r, x) in reference.pixels.iter().zip(&picture.pixels) {
        let (Some(r), Some(x)) = (finite(r), finite(x)) else {
            sums.not_finite += 1;
            continue;
        };
        relative.push(sums.add(r, x, &view));
    }
    let channels = (3 * relative.len()).max(1) as f64;
    let rel_mse = relative.iter().sum::<f64>() / relative.len().max(1) as f64;
    let kept = relative.len() - relative.len() / TRIMMED;
    if kept < relative.len() {
        relative.select_nth_unstable_by(kept, f64::total_cmp);
    }
    Ok(Comparison {
        mse: sums.square / channels,
        rel_mse,
        trimmed_rel_mse: relative[..kept].iter().sum::<f64>() / kept.max(1) as f64,
        mean_ratio: sums.picture / sums.reference,
        psnr: -10.0 * (sums.shown / channels).log10(),
        flip: flip.iter().sum::<f64>() / flip.len().max(1) as f64,
        worst_block: worst_block(reference, picture),
        not_finite: sums.not_finite,
    })
}

#[derive(Default)]
struct Sums {
    square: f64,
    shown: f64,
    reference: f64,
    picture: f64,
    not_finite: u64,
}

impl Sums {
    /// Adds a pixel; its relative error.
    fn add(&mut self, r: [f32; 3], x: [f32; 3], view: &View) -> f64 {
        let (shown_r, shown_x) = (view.apply(r.into()), view.apply(x.into()));
        let mut relative = 0.0;
        for c in 0..3 {
            let (a, b) = (f64::from(r[c]), f64::from(x[c]));
            let square = (b - a).powi(2);
            self.square += square;
            self.shown += f64::from(shown_x[c] - shown_r[c]).powi(2);
            self.reference += a;
            self.picture += b;
            relative += square / (a * a + FLOOR) / 3.0;
        }
        relative
    }
}

fn finite(pixel: &[f32; 4]) -> Option<[f32; 3]> {
    let [r, g, b, _] = *pixel;
    [r, g, b].iter().all(|v| v.is_finite()).then_some([r, g, b])
}

fn worst_block(reference: &Picture, picture: &Picture) -> Block {
    let (width, height) = (reference.width, reference.height);
    let mut worst = Block::default();
    for y in (0..height).step_by(BLOCK as usize) {
        for x in (0..width).step_by(BLOCK as usize) {
            let mut block = Block { x, y, ..Block::default() };
            let mut count = 0.0;
            for row in y..height.min(y + BLOCK) {
                for column in x..width.min(x + BLOCK) {
                    let i = row as usize * width as usize + column as usize;
                    let (Some(r), Some(p)) = (finite(&reference.pixels[i]), finite(&picture.pixels[i])) else {
                        continue;
                    };
                    count += 1.0;
                    for c in 0..3 {
                        block.reference[c] += f64::from(r[c]);
                        block.picture[c] += f64::from(p[c]);
                    }
                }
            }
            if count == 0.0 {
                continue;
            }
            for c in 0..3 {
                block.reference[c] /= count;
                block.picture[c] /= count;
                let (r, p) = (block.reference[c], block.picture[c]);
                block.difference = block.difference.max((p - r).abs() / (r * r + FLOOR).sqrt());
            }
            if block.difference > worst.difference || (x, y) == (0, 0) {
                worst = block;
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, of: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
        let pixels = (0..width * height).map(|i| {
            let [r, g, b] = of(i % width, i / width);
            [r, g, b, 1.0]
        });
        Picture { width, height, pixels: pixels.collect() }
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let a = picture(20, 11, |x, y| [x as f32, y as f32, 0.5]);
        let c = compare(&a, &a).unwrap();
        assert_eq!((c.mse, c.rel_mse, c.trimmed_rel_mse, c.mean_ratio, c.flip), (0.0, 0.0, 0.0, 1.0, 0.0));
        assert_eq!((c.psnr, c.worst_block.difference, c.not_finite), (f64::INFINITY, 0.0, 0));
    }

    #[test]
    fn a_firefly_is_trimmed_and_found_in_its_block() {
        let a = picture(64, 48, |_, _| [0.5; 3]);
        let b = picture(64, 48, |x, y| if (x, y) == (42, 17) { [0.5, 100.5, 0.5] } else { [0.5; 3] });
        let c = compare(&a, &b).unwrap();
        let pixels = 64.0 * 48.0;
        assert!((c.mse - 1e4 / (3.0 * pixels)).abs() < 1e-9);
        assert!((c.rel_mse - 1e4 / 0.26 / (3.0 * pixels)).abs() < 1e-9);
        assert_eq!(c.trimmed_rel_mse, 0.0);
        assert_eq!((c.worst_block.x, c.worst_block.y), (40, 16));
        assert!((c.worst_block.difference - 100.0 / 64.0 / 0.26f64.sqrt()).abs() < 1e-9);
        assert_eq!(c.worst_block.picture[0], 0.5);
    }

    #[test]
    fn the_signal_to_noise_ratio_is_that_of_the_display() {
        // Both are white on a display, so that only half of the pixels differ: by all there is.
        let a = picture(16, 16, |x, _| [if x < 8 { 3.0 } else { 1.0 }; 3]);
        let b = picture(16, 16, |x, _| [if x < 8 { 7.0 } else { 0.0 }; 3]);
        let c = compare(&a, &b).unwrap();
        assert!((c.psnr - 10.0 * 2f64.log10()).abs() < 1e-9, "{}", c.psnr);
    }

    #[test]
    fn what_is_not_finite_is_counted_and_left_out() {
        let a = picture(16, 8, |_, _| [1.0; 3]);
        let b = picture(16, 8, |x, y| if (x, y) == (3, 3) { [f32::NAN, 1.0, 1.0] } else { [2.0; 3] });
        let c = compare(&a, &b).unwrap();
        assert_eq!((c.not_finite, c.mse, c.mean_ratio), (1, 1.0, 2.0));
        assert!(c.flip.is_finite());
    }

    #[test]
    fn pictures_without_light_or_pixels_are_no_panic() {
        let black = picture(4, 4, |_, _| [0.0; 3]);
        assert!(compare(&black, &black).unwrap().mean_ratio.is_nan());
        let empty = Picture { width: 0, height: 0, pixels: Vec::new() };
        assert_eq!(compare(&empty, &empty).unwrap().mse, 0.0);
        assert!(matches!(compare(&black, &empty), Err(PictureError::Sizes(..))));
    }
}
