//! LDR-FLIP: how different two pictures look when one flips between them.
//!
//! Pontus Andersson, Jim Nilsson, Tomas Akenine-Möller, Magnus Oskarsson, Kalle Åström and Mark D. Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", Proceedings of the ACM on Computer Graphics and Interactive
//! Techniques 3(2) (HPG 2020), article 15. Constants are those of the paper, its sections in the comments.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Pixels per degree of visual angle by default: 0.7 m before a 0.7 m wide display of 3840 pixels (section 2).
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Exponent of the colour difference (4.1).
const Q_COLOUR: f64 = 0.7;
/// The colour difference from which on differences are compressed, as a share of the largest (4.1).
const P_COLOUR: f64 = 0.4;
/// What that difference becomes (4.1).
const P_TARGET: f64 = 0.95;
/// Width of the features looked for, in degrees (4.2).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference (4.2).
const Q_FEATURE: f64 = 0.5;

/// Contrast sensitivity of the three channels: sums of two Gaussians as (weight, width) (4.1, table 1).
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];

/// Linear RGB of sRGB's primaries to CIE XYZ; the paper's numbers, exact for the primaries' chromaticities.
const XYZ_OF_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

/// FLIP of every pixel, in [0, 1]. `width` pixels a row; colours are linear, in [0, 1], of equal number.
pub(super) fn map(width: usize, reference: &[DVec3], test: &[DVec3], pixels_per_degree: f64) -> Vec<f64> {
    let colour = colour_difference(width, reference, test, pixels_per_degree);
    let feature = feature_difference(width, reference, test, pixels_per_degree);
    // Differences of features make differences of colours stand out (4.3).
    colour.into_iter().zip(feature).map(|(c, f)| c.powf(1.0 - f)).collect()
}

/// The colour pipeline (4.1).
fn colour_difference(width: usize, reference: &[DVec3], test: &[DVec3], ppd: f64) -> Vec<f64> {
    let seen = |picture: &[DVec3]| -> Vec<DVec3> {
        let opponent: Vec<_> = picture.iter().map(|c| opponent(*c)).collect();
        let filtered = filter_sensitivity(width, &opponent, ppd);
        filtered.into_iter().map(|c| hunt(lab(rgb_of_opponent(c).clamp(DVec3::ZERO, DVec3::ONE)))).collect()
    };
    let most = hyab(hunt(lab(DVec3::Y)), hunt(lab(DVec3::Z))).powf(Q_COLOUR);
    let knee = P_COLOUR * most;
    let redistributed = |difference: f64| {
        let d = difference.powf(Q_COLOUR);
        if d < knee { d * P_TARGET / knee } else { P_TARGET + (d - knee) / (most - knee) * (1.0 - P_TARGET) }
    };
    seen(reference).into_iter().zip(seen(test)).map(|(r, t)| redistributed(hyab(r, t)).min(1.0)).collect()
}

/// The feature pipeline (4.2): edges and points of the achromatic channel.
fn feature_difference(width: usize, reference: &[DVec3], test: &[DVec3], ppd: f64) -> Vec<f64> {
    let sigma = 0.5 * FEATURE_WIDTH * ppd;
    let radius = (3.0 * sigma).ceil() as i64;
    let gauss = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let smooth = normalised(taps(radius, gauss));
    // Derivatives: positive weights sum to 1, negative ones to -1. As a filter is a product, each factor by itself.
    let edge = balanced(taps(radius, |x| -x * gauss(x)));
    let point = balanced(taps(radius, |x| (x * x / (sigma * sigma) - 1.0) * gauss(x)));
    let features = |picture: &[DVec3]| -> Vec<(f64, f64)> {
        let grey: Vec<_> = picture.iter().map(|c| (XYZ_OF_RGB * *c).y).collect();
        let size = |along: &[f64]| -> Vec<f64> {
            let x = convolve(width, &grey, along, &smooth);
            let y = convolve(width, &grey, &smooth, along);
            x.into_iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
        };
        size(&edge).into_iter().zip(size(&point)).collect()
    };
    let difference = |((er, pr), (et, pt)): ((f64, f64), (f64, f64))| {
        let most = (er - et).abs().max((pr - pt).abs());
        (most * std::f64::consts::FRAC_1_SQRT_2).powf(Q_FEATURE).clamp(0.0, 1.0)
    };
    features(reference).into_iter().zip(features(test)).map(difference).collect()
}

/// XYZ relative to the white of (1, 1, 1).
fn relative_xyz(rgb: DVec3) -> DVec3 {
    XYZ_OF_RGB * rgb / (XYZ_OF_RGB * DVec3::ONE)
}

/// YCxCz: CIELAB without its curve, so that sums of light stay sums.
fn opponent(rgb: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = relative_xyz(rgb);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

fn rgb_of_opponent(c: DVec3) -> DVec3 {
    let y = (c.x + 16.0) / 116.0;
    let relative = DVec3::new(y + c.y / 500.0, y, y - c.z / 200.0);
    XYZ_OF_RGB.inverse() * (relative * (XYZ_OF_RGB * DVec3::ONE))
}

/// CIELAB.
fn lab(rgb: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let DVec3 { x, y, z } = relative_xyz(rgb).map(f);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Brighter colours look more colourful (Hunt).
fn hunt(lab: DVec3) -> DVec3 {
    let s = 0.01 * lab.x;
    DVec3::new(lab.x, s * lab.y, s * lab.z)
}

/// The distance for large differences of colour: lightness by amount, chroma by Euclid.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// Takes away what an eye at that distance does not see.
fn filter_sensitivity(width: usize, picture: &[DVec3], ppd: f64) -> Vec<DVec3> {
    let widest = SENSITIVITY.iter().flatten().map(|g| g.1).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * std::f64::consts::PI.powi(2))).sqrt() * ppd).ceil() as i64;
    let mut out = vec![DVec3::ZERO; picture.len()];
    for (channel, gaussians) in SENSITIVITY.iter().enumerate() {
        let values: Vec<_> = picture.iter().map(|c| c[channel]).collect();
        let mut total = 0.0;
        // A Gaussian of two dimensions is a product of two of one, but a sum of two is not: one after the other.
        for (weight, b) in gaussians.iter().filter(|g| g.0 > 0.0) {
            let taps = taps(radius, |x| (-(std::f64::consts::PI * x / ppd).powi(2) / b).exp());
            let weight = weight * (std::f64::consts::PI / b).sqrt();
            total += weight * taps.iter().sum::<f64>().powi(2);
            for (o, v) in out.iter_mut().zip(convolve(width, &values, &taps, &taps)) {
                o[channel] += weight * v;
            }
        }
        for o in &mut out {
            o[channel] /= total;
        }
    }
    out
}

fn taps(radius: i64, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|i| weight(i as f64)).collect()
}

fn normalised(taps: Vec<f64>) -> Vec<f64> {
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|t| t / sum).collect()
}

fn balanced(taps: Vec<f64>) -> Vec<f64> {
    let positive: f64 = taps.iter().filter(|t| **t > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|t| **t < 0.0).sum::<f64>();
    taps.into_iter().map(|t| t / if t > 0.0 { positive } else { negative }).collect()
}

/// Correlates rows with `across`, then columns with `down`; pixels at the rim go on for ever.
fn convolve(width: usize, picture: &[f64], across: &[f64], down: &[f64]) -> Vec<f64> {
    let height = picture.len() / width;
    pass(&pass(picture, across, width, 1), down, height, width)
}

/// Correlates along one axis: `length` pixels, each `stride` after the one before.
fn pass(source: &[f64], taps: &[f64], length: usize, stride: usize) -> Vec<f64> {
    let radius = (taps.len() / 2) as i64;
    let at = |i: usize| {
        let along = ((i / stride) % length) as i64;
        let value = |offset: i64| {
            let from = (along + offset).clamp(0, length as i64 - 1) - along;
            source[(i as i64 + from * stride as i64) as usize]
        };
        (-radius..).zip(taps).map(|(offset, tap)| tap * value(offset)).sum()
    };
    (0..source.len()).into_par_iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: i64 = 48;
    const HEIGHT: i64 = 32;
    /// The pixels that are compared.
    const PROBES: [(i64, i64); 4] = [(0, 0), (20, 12), (28, 16), (47, 31)];

    /// A picture by its rule for 8-bit sRGB.
    fn picture(rule: impl Fn(i64, i64) -> [i64; 3]) -> Vec<DVec3> {
        let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| DVec3::from(rule(x, y).map(|v| firsthit_import::srgb::to_linear(v as f64 / 255.0))))
            .collect()
    }

    fn ramp(x: i64, y: i64) -> [i64; 3] {
        [5 * x, 8 * y, (x * x + 3 * y) % 256]
    }

    fn noisy_ramp(x: i64, y: i64) -> [i64; 3] {
        let h = (x * 7919 + y * 104_729) % 65_521;
        let h = (h * h) % 65_521;
        let [r, g, b] = ramp(x, y);
        [r + (h % 32) - 16, g + ((h >> 4) % 32) - 16, b + ((h >> 8) % 32) - 16].map(|v| v.clamp(0, 255))
    }

    fn disc(centre: i64) -> impl Fn(i64, i64) -> [i64; 3] {
        move |x, y| if (x - centre).pow(2) + (y - 16).pow(2) < 80 { [230, 60, 30] } else { [40, 90, 160] }
    }

    fn dot(x: i64, y: i64) -> [i64; 3] {
        if (x, y) == (20, 12) { [255; 3] } else { [64; 3] }
    }

    /// Values of the authors' own program, `flip-evaluator` 1.7 of PyPI, on the same pictures: mean and four pixels.
    ///
    /// It computes in f32: on black and white its edge filters do not sum to zero, which makes 1.2e-5; all else agrees
    /// within 4e-6.
    #[test]
    fn it_agrees_with_the_authors_program() {
        let solid = |c: [i64; 3]| picture(move |_, _| c);
        let pairs = [
            ("black and white", solid([0; 3]), solid([255; 3])),
            ("green and blue", solid([0, 255, 0]), solid([0, 0, 255])),
            ("noise", picture(ramp), picture(noisy_ramp)),
            ("moved disc", picture(disc(20)), picture(disc(23))),
            ("dot", solid([64; 3]), picture(dot)),
        ];
        let theirs = [
            (0, 67.0, 0.967_391_8, [0.967_391_8; 4]),
            (0, 20.0, 0.967_391_3, [0.967_391_3; 4]),
            (1, 67.0, 1.0, [1.0; 4]),
            (1, 20.0, 1.0, [1.0; 4]),
            (2, 67.0, 0.072_120_3, [0.034_570_3, 0.028_020_9, 0.119_400_2, 0.121_813]),
            (2, 20.0, 0.205_534_0, [0.001_616_6, 0.145_879_4, 0.289_236_1, 0.224_678_6]),
            (3, 67.0, 0.131_027_6, [0.0, 0.193_788_2, 0.569_101_9, 0.0]),
            (3, 20.0, 0.097_547_7, [0.0, 0.000_200_1, 0.581_763_6, 0.0]),
            (4, 67.0, 0.005_139_1, [0.0, 0.603_387_9, 0.0, 0.0]),
            (4, 20.0, 0.001_431_0, [0.0, 0.986_013_4, 0.0, 0.0]),
        ];
        for (pair, ppd, mean, probes) in theirs {
            let (name, reference, test) = &pairs[pair];
            let map = map(WIDTH as usize, reference, test, ppd);
            let ours = map.iter().sum::<f64>() / map.len() as f64;
            assert!((ours - mean).abs() < 2e-5, "{name} at {ppd}: {ours}, theirs {mean}");
            for ((x, y), expected) in PROBES.into_iter().zip(probes) {
                let pixel = map[(y * WIDTH + x) as usize];
                assert!((pixel - expected).abs() < 2e-5, "{name} at {ppd}: {pixel} at {x}, {y}, theirs {expected}");
            }
        }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_order_does_not_matter() {
        let (a, b) = (picture(ramp), picture(noisy_ramp));
        assert!(map(WIDTH as usize, &a, &a, 67.0).iter().all(|e| *e == 0.0));
        assert_eq!(map(WIDTH as usize, &a, &b, 67.0), map(WIDTH as usize, &b, &a, 67.0));
    }

    #[test]
    fn colours_come_back_from_the_opponent_space() {
        for c in [DVec3::ZERO, DVec3::ONE, DVec3::new(0.2, 0.9, 0.01)] {
            assert!((rgb_of_opponent(opponent(c)) - c).length() < 1e-12);
        }
        // White is white: L 100, no chroma.
        assert!((lab(DVec3::ONE) - DVec3::new(100.0, 0.0, 0.0)).length() < 1e-9);
        assert!((opponent(DVec3::ONE) - DVec3::new(100.0, 0.0, 0.0)).length() < 1e-9);
    }
}
