//! Directions of vectors of any length, also where the square of the length is not to be had.

use glam::{DVec3, Vec3};

/// The vector of length 1 in the same direction; `None` if there is none.
pub(crate) fn single(v: Vec3) -> Option<Vec3> {
    let unit = v.try_normalize().filter(|u| u.is_normalized());
    unit.or_else(|| v.as_dvec3().try_normalize().map(|u| u.as_vec3()))
}

/// As [`single`].
pub(crate) fn double(v: DVec3) -> Option<DVec3> {
    let unit = v.try_normalize().filter(|u| u.is_normalized());
    unit.or_else(|| (v / v.abs().max_element()).try_normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiny_and_huge_vectors_have_a_direction() {
        for size in [1e-45_f32, 3e-42, 1e-38, 1e-22, 1.0, 1e20, 3e38] {
            let unit = single(Vec3::new(0.0, size, -size)).expect("a direction");
            assert!((unit - Vec3::new(0.0, 0.5, -0.5) * 2_f32.sqrt()).length() < 1e-6, "{size}: {unit}");
        }
        for size in [5e-324, 1e-310, 1e-162, 1.0, 1e160, 1e308] {
            let unit = double(DVec3::new(0.0, size, -size)).expect("a direction");
            assert!((unit - DVec3::new(0.0, 0.5, -0.5) * 2_f64.sqrt()).length() < 1e-15, "{size}: {unit}");
        }
        let none = [Vec3::ZERO, Vec3::new(f32::NAN, 1.0, 0.0), Vec3::new(f32::INFINITY, 1.0, 0.0)];
        assert_eq!(none.map(single), [None; 3]);
        assert_eq!(none.map(|v| double(v.as_dvec3())), [None; 3]);
    }
}
