//! From linear radiance to what a display shows.

use firsthit_import::srgb;
use glam::{Mat3, Vec3};

/// How linear colours are brought into the range of a display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ViewTransform {
    /// Khronos PBR Neutral: base colours come out as they are, highlights roll off.
    #[default]
    PbrNeutral,
    /// AgX (Troy Sobotka): film-like, bright colours turn pale.
    Agx,
    /// Clipped, then the sRGB curve.
    Srgb,
    /// Clipped: the linear numbers themselves, with no curve.
    None,
}

impl ViewTransform {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::PbrNeutral, Self::Agx, Self::Srgb, Self::None];

    /// The name used on command lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PbrNeutral => "pbr-neutral",
            Self::Agx => "agx",
            Self::Srgb => "srgb",
            Self::None => "none",
        }
    }
}

impl std::fmt::Display for ViewTransform {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ViewTransform {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|v| v.name() == s)
            .ok_or_else(|| format!("unknown tone mapping '{s}' (pbr-neutral, agx, srgb or none)"))
    }
}

/// A view transform at an exposure.
///
/// ```
/// use firsthit_render::{View, ViewTransform};
/// use glam::Vec3;
/// let view = View { transform: ViewTransform::Srgb, exposure: 1.0, ..View::default() };
/// assert_eq!(view.apply(Vec3::splat(0.5)), Vec3::ONE);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// Which transform.
    pub transform: ViewTransform,
    /// Stops: radiance is multiplied by 2 to this before anything else.
    pub exposure: f32,
    /// The display's values in [0, 1] of what lies behind a transparent picture. It is no part of the scene: neither
    /// exposure nor transform change it. `None`: transparent stays transparent.
    pub backdrop: Option<Vec3>,
}

impl View {
    /// The display's values in [0, 1] of a linear colour. NaN and negative components count as 0.
    #[must_use]
    pub fn apply(&self, radiance: Vec3) -> Vec3 {
        // Infinity becomes the largest number, so that no difference of infinities arises.
        let c = (radiance * self.exposure.exp2()).map(|x| within(x, f32::MAX));
        let display = match self.transform {
            ViewTransform::PbrNeutral => pbr_neutral(c).map(linear_to_srgb),
            ViewTransform::Agx => agx(c),
            ViewTransform::Srgb => c.map(linear_to_srgb),
            ViewTransform::None => c,
        };
        display.map(|x| within(x, 1.0))
    }
}

/// `x` cut to [0, `most`]; 0 for NaN.
fn within(x: f32, most: f32) -> f32 {
    if x > 0.0 { x.min(most) } else { 0.0 }
}

/// The sRGB curve, IEC 61966-2-1: linear [0, 1] to encoded [0, 1]; clipped outside.
///
/// In f64 inside, so that the answer is the nearest f32, and that of 1 is 1.
#[must_use]
pub fn linear_to_srgb(x: f32) -> f32 {
    let x = f64::from(x.clamp(0.0, 1.0));
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    encoded as f32
}

/// The inverse of [`linear_to_srgb`].
#[must_use]
pub fn srgb_to_linear(x: f32) -> f32 {
    srgb::to_linear(x.clamp(0.0, 1.0).into()) as f32
}

/// Khronos PBR Neutral Tone Mapper, specification of 2024, with its constants: linear to linear.
fn pbr_neutral(c: Vec3) -> Vec3 {
    /// Fresnel reflection of a common dielectric: what a base colour looks brighter by.
    const F90: f32 = 0.04;
    const COMPRESSION_START: f32 = 0.8 - F90;
    const DESATURATION: f32 = 0.15;

    let least = c.min_element();
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let c = c - offset;
    let peak = c.max_element();
    if peak <= COMPRESSION_START {
        return c;
    }
    let d = 1.0 - COMPRESSION_START;
    let new_peak = 1.0 - d * d / (peak + d - COMPRESSION_START);
    let keep = 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    Vec3::splat(new_peak).lerp(c / peak * new_peak, keep)
}

/// AgX in its base look: linear to display-encoded.
///
/// Troy Sobotka's configuration (<https://github.com/sobotka/AgX>): colours are drawn together ("inset"), taken to
/// log2 from 10 stops below to 6.5 stops above middle grey, bent by a sigmoid through its pivot with slope 2, and
/// spread again.
fn agx(c: Vec3) -> Vec3 {
    const BELOW: f32 = -10.0;
    const ABOVE: f32 = 6.5;
    const MIDDLE_GREY: f32 = 0.18;
    let inset = Mat3::from_cols(
        Vec3::new(0.842_401_07, 0.042_401_07, 0.042_401_07),
        Vec3::new(0.078_436_5, 0.878_436_5, 0.078_436_5),
        Vec3::new(0.079_162_43, 0.079_162_43, 0.879_162_43),
    );
    let log = (inset * c).map(|x| ((x / MIDDLE_GREY).log2().clamp(BELOW, ABOVE) - BELOW) / (ABOVE - BELOW));
    let pivot = -BELOW / (ABOVE - BELOW);
    let bent = log.map(|x| {
        if x < pivot {
            0.5 - sigmoid_arm(pivot - x, pivot, 3.0)
        } else {
            0.5 + sigmoid_arm(x - pivot, 1.0 - pivot, 3.25)
        }
    });
    inset.inverse() * bent
}

/// One arm of the AgX sigmoid: starts with slope 2 and reaches 1/2 at `end`, the more bent the higher `power`.
fn sigmoid_arm(x: f32, end: f32, power: f32) -> f32 {
    const SLOPE: f32 = 2.0;
    let bend = ((SLOPE * end / 0.5).powf(power) - 1.0) / end.powf(power);
    SLOPE * x * (1.0 + bend * x.powf(power)).powf(-1.0 / power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(transform: ViewTransform, exposure: f32) -> View {
        View { transform, exposure, backdrop: None }
    }

    #[test]
    fn the_srgb_curve_has_its_published_values_and_inverts() {
        // IEC 61966-2-1: 8-bit codes and their linear values.
        for (code, linear) in
            [(0, 0.0), (10, 0.003_035_3), (55, 0.038_204_4), (118, 0.181_164), (188, 0.502_886), (255, 1.0)]
        {
            let encoded = code as f32 / 255.0;
            assert!((srgb_to_linear(encoded) - linear).abs() < 2e-6, "{code}");
            assert!((linear_to_srgb(linear) - encoded).abs() < 2e-5, "{code}");
        }
        for i in 0..=1000 {
            let x = i as f32 / 1000.0;
            assert!((srgb_to_linear(linear_to_srgb(x)) - x).abs() < 1e-6);
        }
    }

    /// The equations of the Khronos specification, evaluated in f64 by their cases.
    #[test]
    fn pbr_neutral_follows_its_specification() {
        let expected = |c: [f64; 3]| -> [f64; 3] {
            let x = c.iter().copied().fold(f64::INFINITY, f64::min);
            let f = if x <= 0.08 { x - x * x / 0.16 } else { 0.04 };
            let p = c.iter().copied().fold(0.0, f64::max) - f;
            let ks: f64 = 0.8 - 0.04;
            let pn = 1.0 - (1.0 - ks).powi(2) / (p + 1.0 - 2.0 * ks);
            let g = 1.0 / (0.15 * (p - pn) + 1.0);
            c.map(|c| if p <= ks { c - f } else { (c - f) * pn / p * g + pn * (1.0 - g) })
        };
        for c in
            [[0.0, 0.0, 0.0], [0.5, 0.3, 0.2], [0.05, 0.8, 0.3], [1.0, 1.0, 1.0], [8.0, 0.5, 0.01], [900.0, 2.0, 0.0]]
        {
            let got = pbr_neutral(Vec3::from(c.map(|x| x as f32)));
            for (g, e) in got.to_array().into_iter().zip(expected(c)) {
                assert!((f64::from(g) - e).abs() < 2e-6, "{c:?}: {got}");
            }
        }
        // Its promise: a base colour seen with 4 % of white reflection comes out as it is.
        let base = Vec3::new(0.1, 0.5, 0.7);
        assert!((pbr_neutral(base + 0.04) - base).length() < 1e-6);
    }

    #[test]
    fn agx_puts_middle_grey_in_the_middle_and_the_ends_at_the_ends() {
        // The matrices keep greys, and the curve's pivot is at one half.
        let grey = |x: f32| agx(Vec3::splat(x));
        assert!((grey(0.18) - 0.5).abs().max_element() < 1e-4, "{}", grey(0.18));
        assert!(grey(0.18 * 2_f32.powi(-10)).abs().max_element() < 1e-4);
        assert!((grey(0.18 * 2_f32.powf(6.5)) - 1.0).abs().max_element() < 1e-4);
        assert!(view(ViewTransform::Agx, 0.0).apply(Vec3::ZERO).max_element() < 1e-6);
        // Slope 2 at the pivot, in log2 units of 16.5 stops.
        let step = 0.1_f32;
        let slope = (grey(0.18 * step.exp2()).x - grey(0.18 * (-step).exp2()).x) / (2.0 * step / 16.5);
        assert!((slope - 2.0).abs() < 0.01, "{slope}");
    }

    #[test]
    fn every_transform_keeps_order_and_range() {
        for transform in ViewTransform::ALL {
            let v = view(transform, 0.0);
            let mut last = -1.0;
            for i in 0..400 {
                let c = v.apply(Vec3::splat(1e-4 * 1.04_f32.powi(i)));
                assert!(c.min_element() >= 0.0 && c.max_element() <= 1.0);
                assert!(c.x >= last, "{transform}: brighter must not come out darker");
                last = c.x;
            }
            for broken in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX] {
                let c = v.apply(Vec3::new(broken, 0.5, broken));
                assert!(c.to_array().iter().all(|x| (0.0..=1.0).contains(x)), "{transform} of {broken}: {c}");
            }
        }
    }

    #[test]
    fn exposure_counts_stops() {
        for transform in ViewTransform::ALL {
            let c = Vec3::new(0.1, 0.05, 0.2);
            assert_eq!(view(transform, 2.0).apply(c), view(transform, 0.0).apply(4.0 * c));
        }
        assert_eq!(view(ViewTransform::None, -1.0).apply(Vec3::splat(0.5)), Vec3::splat(0.25));
    }

    #[test]
    fn names_are_read_back() {
        for transform in ViewTransform::ALL {
            assert_eq!(transform.name().parse(), Ok(transform));
        }
        assert!("filmic".parse::<ViewTransform>().is_err());
    }
}
