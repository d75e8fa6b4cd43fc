//! How much a picture differs from a better one, and what a tier of precision does to a picture.

mod compare;
mod flip;
mod heat;
mod read;
mod tiers;

use firsthit_render::{View, film::Picture, view::srgb_to_linear};
use glam::{DVec3, Vec3};
use thiserror::Error;

pub use compare::{Block, Comparison, compare};
pub use flip::PIXELS_PER_DEGREE;
pub use heat::heat;
pub use read::read;
pub use tiers::{PictureOptions, measure};

/// Why pictures could not be compared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PictureError {
    /// They differ in size, or a picture has not as many pixels as its size says.
    #[error("pictures of {} x {} and {} x {} pixels cannot be compared", .0[0], .0[1], .1[0], .1[1])]
    Sizes([u32; 2], [u32; 2]),
    /// The angle of view of a pixel is no positive number.
    #[error("{0} pixels per degree: must be a positive number")]
    PixelsPerDegree(f64),
    /// The scene could not be built.
    #[error(transparent)]
    Build(#[from] firsthit_accel::BuildError),
    /// The scene could not be set up for rendering.
    #[error(transparent)]
    Stage(#[from] firsthit_render::StageError),
    /// The picture could not be rendered.
    #[error(transparent)]
    Render(#[from] firsthit_render::RenderError),
    /// Whoever watches cancelled it.
    #[error("cancelled")]
    Cancelled,
}

/// Root mean square difference of linear radiance over all pixels and red, green and blue.
///
/// Equal pixels do not differ even where they are infinite; else what is not finite makes the result so.
///
/// ```
/// use firsthit_measure::picture;
/// use firsthit_render::film::Picture;
/// let of = |x| Picture { width: 1, height: 1, pixels: vec![[x, x, x, 1.0]] };
/// assert_eq!(picture::rmse(&of(0.25), &of(0.75))?, 0.5);
/// # Ok::<(), picture::PictureError>(())
/// ```
///
/// # Errors
/// When the pictures differ in size.
pub fn rmse(reference: &Picture, test: &Picture) -> Result<f64, PictureError> {
    check_sizes(reference, test)?;
    let pairs = reference.pixels.iter().zip(&test.pixels).flat_map(|(r, t)| r[..3].iter().zip(&t[..3]));
    let difference = |r: f32, t: f32| if r.to_bits() == t.to_bits() { 0.0 } else { f64::from(r) - f64::from(t) };
    let sum: f64 = pairs.map(|(r, t)| difference(*r, *t).powi(2)).sum();
    Ok((sum / (3 * reference.pixels.len()).max(1) as f64).sqrt())
}

/// How many pixels are not the same bit for bit, alpha included.
///
/// # Errors
/// When the pictures differ in size.
pub fn different_pixels(reference: &Picture, test: &Picture) -> Result<u64, PictureError> {
    check_sizes(reference, test)?;
    let differ = |(r, t): &(&[f32; 4], &[f32; 4])| r.map(f32::to_bits) != t.map(f32::to_bits);
    Ok(reference.pixels.iter().zip(&test.pixels).filter(differ).count() as u64)
}

/// Mean LDR-FLIP of two pictures as `view` shows them, in [0, 1]: 0 for equal ones.
///
/// FLIP models what someone sees who flips between the two on a display with so many pixels per degree of visual
/// angle, by default [`PIXELS_PER_DEGREE`]: filtered contrast, colour, edges and points (Andersson et al., "FLIP: A
/// Difference Evaluator for Alternating Images", HPG 2020). Against the authors' program it agrees to about 1e-5.
///
/// ```
/// use firsthit_measure::picture::{PIXELS_PER_DEGREE, flip};
/// use firsthit_render::{View, ViewTransform, film::Picture};
/// let of = |c| Picture { width: 8, height: 8, pixels: vec![c; 64] };
/// let view = View { transform: ViewTransform::Srgb, ..View::default() };
/// let (green, blue) = (of([0.0, 1.0, 0.0, 1.0]), of([0.0, 0.0, 1.0, 1.0]));
/// assert_eq!(flip(&green, &green, &view, PIXELS_PER_DEGREE)?, 0.0);
/// // The most different colours there are.
/// assert!((flip(&green, &blue, &view, PIXELS_PER_DEGREE)? - 1.0).abs() < 1e-9);
/// # Ok::<(), firsthit_measure::picture::PictureError>(())
/// ```
///
/// # Errors
/// When the pictures differ in size, or `pixels_per_degree` is no positive number.
pub fn flip(reference: &Picture, test: &Picture, view: &View, pixels_per_degree: f64) -> Result<f64, PictureError> {
    let map = flip_map(reference, test, view, pixels_per_degree)?;
    Ok(map.iter().sum::<f64>() / map.len().max(1) as f64)
}

/// LDR-FLIP of every pixel, in [0, 1]: see [`flip()`].
///
/// # Errors
/// As for [`flip()`].
pub fn flip_map(
    reference: &Picture,
    test: &Picture,
    view: &View,
    pixels_per_degree: f64,
) -> Result<Vec<f64>, PictureError> {
    check_sizes(reference, test)?;
    // A display whose pixels are that small shows no difference at all; the filters would be larger than any picture.
    if !(pixels_per_degree > 0.0 && pixels_per_degree <= 1e4) {
        return Err(PictureError::PixelsPerDegree(pixels_per_degree));
    }
    if reference.pixels.is_empty() {
        return Ok(Vec::new());
    }
    let shown = |picture: &Picture| -> Vec<DVec3> {
        let light = |[r, g, b, _]: [f32; 4]| view.apply(Vec3::new(r, g, b)).map(srgb_to_linear).as_dvec3();
        picture.pixels.iter().map(|p| light(*p)).collect()
    };
    Ok(flip::map(reference.width as usize, &shown(reference), &shown(test), pixels_per_degree))
}

fn check_sizes(a: &Picture, b: &Picture) -> Result<(), PictureError> {
    let whole = |p: &Picture| p.pixels.len() as u64 == u64::from(p.width) * u64::from(p.height);
    let same = (a.width, a.height) == (b.width, b.height);
    if same && whole(a) && whole(b) {
        Ok(())
    } else {
        Err(PictureError::Sizes([a.width, a.height], [b.width, b.height]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, pixels: &[[f32; 4]]) -> Picture {
        Picture { width, height: pixels.len() as u32 / width, pixels: pixels.to_vec() }
    }

    #[test]
    fn rmse_is_over_pixels_and_colours_and_leaves_alpha_out() {
        let a = picture(2, &[[0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0, 1.0]]);
        let b = picture(2, &[[0.0, 0.0, 3.0, 0.5], [1.0, 2.0, 3.0, 1.0]]);
        assert_eq!(rmse(&a, &b).unwrap(), (9.0_f64 / 6.0).sqrt());
        assert_eq!(different_pixels(&a, &b).unwrap(), 1);
        let infinite = picture(1, &[[f32::INFINITY, f32::NAN, 0.0, 1.0]]);
        assert_eq!(rmse(&infinite, &infinite).unwrap(), 0.0);
        assert_eq!(rmse(&infinite, &picture(1, &[[1.0, f32::NAN, 0.0, 1.0]])).unwrap(), f64::INFINITY);
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let (a, b) = (picture(2, &[[0.0; 4]; 4]), picture(4, &[[0.0; 4]; 4]));
        let view = View::default();
        assert!(matches!(rmse(&a, &b), Err(PictureError::Sizes([2, 2], [4, 1]))));
        assert!(matches!(flip(&a, &b, &view, 67.0), Err(PictureError::Sizes(..))));
        for ppd in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(flip(&a, &a, &view, ppd), Err(PictureError::PixelsPerDegree(_))));
        }
        let empty = Picture { width: 0, height: 0, pixels: Vec::new() };
        assert_eq!((rmse(&empty, &empty).unwrap(), flip(&empty, &empty, &view, 67.0).unwrap()), (0.0, 0.0));
    }
}
