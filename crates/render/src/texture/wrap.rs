//! Coordinates beyond the borders of an image.

use firsthit_import::scene::Wrap;

/// The largest whole number that is not above it, of a finite one. What every processor has comes without an instruction
/// for it.
#[inline]
pub(crate) fn floor(t: f32) -> f32 {
    /// From here on all numbers are whole.
    const WHOLE: f32 = (1 << (f32::MANTISSA_DIGITS - 1)) as f32;
    if t.abs() < WHOLE {
        let cut = t as i32 as f32;
        if cut > t { cut - 1.0 } else { cut }
    } else {
        t
    }
}

/// A coordinate brought into [0, 1]. NaN and infinities give 0.
#[inline]
pub(super) fn fold(wrap: Wrap, t: f32) -> f32 {
    if !t.is_finite() {
        return 0.0;
    }
    match wrap {
        Wrap::Repeat => t - floor(t),
        Wrap::Mirror => {
            let t = t - 2.0 * floor(t / 2.0);
            if t > 1.0 { 2.0 - t } else { t }
        }
        Wrap::Clamp => t.clamp(0.0, 1.0),
    }
}

/// The two texels beside a folded coordinate, and how far it lies from the first to the second.
#[inline]
pub(super) fn neighbours(wrap: Wrap, t: f32, size: u32) -> ([u32; 2], f32) {
    let x = t * size as f32 - 0.5;
    let first = floor(x);
    // Sides of images are far below 2^31.
    let (n, i) = (size as i32, first as i32);
    // From one before the first to one after the last. Mirrored, the border's neighbour is the border itself, as when
    // clamped.
    let (before, after) = if wrap == Wrap::Repeat { (n - 1, 0) } else { (0, n - 1) };
    let index = |i: i32| {
        if i < 0 {
            before
        } else if i >= n {
            after
        } else {
            i
        }
    };
    ([index(i) as u32, index(i + 1) as u32], x - first)
}
