//! The power of two by which a mesh's coordinates are divided.

use firsthit_geometry::{Aabb, Precision, Primitive, Real};
use glam::Vec3;

use crate::Geometry;

/// The power of two below the largest coordinate of a mesh: divided by it, products of three coordinates stay far from
/// overflow and underflow. No digit changes, but for coordinates about 2^-126 times the largest, which lose some.
///
/// At [`Precision::Exact`] none may be lost. Where that would happen the divisor is smaller, so that the finest digit
/// just fits, as long as the largest coordinate stays below 2^101. (A mesh of coordinates that are 2^248 apart and more
/// still loses digits: nothing else fits the squares that the boxes' tests make of them.)
pub(crate) fn common_scale(geometries: &[Geometry], precision: Precision) -> f64 {
    let mut largest = 0.0f64;
    for geometry in geometries {
        match geometry {
            Geometry::Triangles { positions, .. } => {
                let m = positions.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs()));
                largest = largest.max(f64::from(m.max_element()));
            }
            Geometry::Shape(shape) => largest = largest.max(extreme(&shape.bounds())),
            Geometry::User(user) => {
                largest = (0..user.count()).map(|i| extreme(&user.bounds(i))).fold(largest, f64::max);
            }
        }
    }
    let scale = largest.power_of_two_below();
    if precision != Precision::Exact {
        return scale;
    }
    let finest = geometries
        .iter()
        .flat_map(|g| if let Geometry::Triangles { positions, .. } = g { positions.as_slice() } else { &[] })
        .flat_map(|p| p.to_array())
        .filter_map(finest_digit)
        .min();
    let needed = finest.map_or(f64::INFINITY, |digit| 2f64.powi(digit - LEAST));
    scale.min(needed).max(scale * 2f64.powi(-100))
}

/// The largest coordinate of a box; of one that has no end, 0.
fn extreme(bounds: &Aabb<f64>) -> f64 {
    if bounds.is_finite() { bounds.min.abs().max(bounds.max.abs()).max_element() } else { 0.0 }
}

/// Exponent of the least positive `f32`.
const LEAST: i32 = -149;

/// Exponent of the lowest digit that is set; none for 0.
fn finest_digit(x: f32) -> Option<i32> {
    let (exponent, fraction) = ((x.to_bits() >> 23 & 0xff) as i32, x.to_bits() & 0x7f_ffff);
    // A denormal has the exponent of the least normal, and no hidden digit.
    let digits = if exponent == 0 { fraction } else { fraction | 0x80_0000 };
    (digits != 0).then(|| exponent.max(1) - 1 + LEAST + digits.trailing_zeros() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finest_digits() {
        for (x, digit) in [(1.0, 0), (3.0, 0), (-0.75, -2), (1.0 + f32::EPSILON, -23), (f32::MAX, 104)] {
            assert_eq!(finest_digit(x), Some(digit), "{x}");
        }
        assert_eq!(finest_digit(f32::from_bits(1)), Some(-149));
        assert_eq!(finest_digit(f32::from_bits(12)), Some(-147));
        assert_eq!(finest_digit(-0.0), None);
    }

    #[test]
    fn exact_scales_lose_no_digit_and_others_are_as_ever() {
        let mesh = |x: [f32; 3]| [Geometry::Triangles { positions: vec![Vec3::from(x)], triangles: Vec::new() }];
        for x in [[1.5, 0.1, 0.0], [3e38, 1e-5, 7.0], [1e-38, 1e-45, 0.0], [1e30, 1e-30, 0.3], [0.0; 3]] {
            let scale = common_scale(&mesh(x), Precision::Exact);
            for x in x {
                let y = (f64::from(x) / scale) as f32;
                assert!(f64::from(y) * scale == f64::from(x) && y.abs() < 2f32.powi(101), "{x} {scale}");
            }
        }
        assert_eq!(common_scale(&mesh([1.5, 0.1, 0.0]), Precision::Exact), 1.0);
        assert_eq!(common_scale(&mesh([3e38, 1e-38, 0.0]), Precision::Robust), 2f64.powi(127));
    }
}
