//! Values that change with time: keys and what lies between them (glTF 2.0 specification, section 3.11 and appendix C).

use glam::DQuat;
use serde::Deserialize;

/// How values between two keys are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Interpolation {
    /// That of the key before.
    Step,
    /// On a straight line; rotations turn evenly along the shorter way.
    #[default]
    Linear,
    /// Cubic Hermite splines, with the tangents of the file.
    CubicSpline,
}

impl Interpolation {
    /// How many elements a key has: its value, for splines between the tangent that goes in and the one that goes out.
    pub(super) fn elements(self) -> usize {
        if self == Self::CubicSpline { 3 } else { 1 }
    }
}

/// One property over time.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// At least one, in order; where two are equal the later key counts.
    pub(super) times: Vec<f64>,
    /// The numbers of all keys one after the other: `width * interpolation.elements()` for each.
    pub(super) values: Vec<f64>,
    /// How many numbers the property has.
    pub(super) width: usize,
    pub(super) interpolation: Interpolation,
    /// The property is a unit quaternion.
    pub(super) rotation: bool,
}

impl Curve {
    /// The property at a time: before the first key as there, after the last key as there.
    pub(super) fn at(&self, time: f64) -> Vec<f64> {
        let next = self.times.partition_point(|&t| t <= time);
        let before = next.saturating_sub(1);
        if next == 0 || next == self.times.len() || self.interpolation == Interpolation::Step {
            return self.value(before).to_vec();
        }
        let span = self.times[next] - self.times[before];
        let u = (time - self.times[before]) / span;
        let (a, b) = (self.value(before), self.value(next));
        match self.interpolation {
            Interpolation::CubicSpline => {
                let (out, into) = (self.element(before, 2), self.element(next, 0));
                let spline = (0..self.width).map(|k| hermite(u, span, [a[k], out[k], b[k], into[k]])).collect();
                if self.rotation { unit(spline).unwrap_or_else(|| a.to_vec()) } else { spline }
            }
            _ if self.rotation => quaternion(a).slerp(quaternion(b), u).to_array().to_vec(),
            _ => a.iter().zip(b).map(|(a, b)| a + (b - a) * u).collect(),
        }
    }

    /// The value of a key.
    fn value(&self, key: usize) -> &[f64] {
        self.element(key, usize::from(self.interpolation == Interpolation::CubicSpline))
    }

    fn element(&self, key: usize, element: usize) -> &[f64] {
        let start = (key * self.interpolation.elements() + element) * self.width;
        &self.values[start..start + self.width]
    }

    /// Makes the quaternions of the keys unit.
    ///
    /// # Errors
    /// With the key whose quaternion has no direction.
    pub(super) fn normalize(&mut self) -> Result<(), usize> {
        let (elements, width) = (self.interpolation.elements(), self.width);
        for (key, numbers) in self.values.chunks_exact_mut(elements * width).enumerate() {
            // Tangents are no rotations.
            let value = &mut numbers[(elements / 2) * width..][..width];
            let turned = unit(value.to_vec()).ok_or(key)?;
            value.copy_from_slice(&turned);
        }
        Ok(())
    }
}

/// The cubic that has the values `a` and `b` at 0 and 1, and slopes there that are given for each second of `span`.
fn hermite(u: f64, span: f64, [a, out, b, into]: [f64; 4]) -> f64 {
    let (u2, u3) = (u * u, u * u * u);
    (2.0 * u3 - 3.0 * u2 + 1.0) * a
        + span * (u3 - 2.0 * u2 + u) * out
        + (3.0 * u2 - 2.0 * u3) * b
        + span * (u3 - u2) * into
}

fn quaternion(numbers: &[f64]) -> DQuat {
    DQuat::from_xyzw(numbers[0], numbers[1], numbers[2], numbers[3])
}

fn unit(mut numbers: Vec<f64>) -> Option<Vec<f64>> {
    let length = numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    numbers.iter_mut().for_each(|x| *x /= length);
    (length > 1e-6 && length.is_finite()).then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(interpolation: Interpolation, times: &[f64], values: &[f64], width: usize) -> Curve {
        Curve { times: times.to_vec(), values: values.to_vec(), width, interpolation, rotation: false }
    }

    #[test]
    fn steps_hold_and_lines_are_straight() {
        let keys = (&[1.0, 2.0, 4.0][..], &[10.0, 20.0, 0.0][..]);
        let step = curve(Interpolation::Step, keys.0, keys.1, 1);
        let line = curve(Interpolation::Linear, keys.0, keys.1, 1);
        let at = |c: &Curve, t| c.at(t)[0];
        for (time, held, even) in
            [(0.0, 10.0, 10.0), (1.0, 10.0, 10.0), (1.75, 10.0, 17.5), (2.0, 20.0, 20.0), (3.0, 20.0, 10.0)]
        {
            assert_eq!((at(&step, time), at(&line, time)), (held, even), "{time}");
        }
        assert_eq!((at(&step, 4.0), at(&line, 9.0)), (0.0, 0.0));
    }

    #[test]
    fn of_two_keys_at_one_time_the_later_counts() {
        let jump = curve(Interpolation::Linear, &[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 5.0, 6.0], 1);
        assert_eq!([0.5, 1.0, 1.5].map(|t| jump.at(t)[0]), [0.5, 5.0, 5.5]);
    }

    #[test]
    fn splines_are_hermite() {
        // x^3 from 0 to 2 has the slopes 0 and 12.
        let cubic = curve(Interpolation::CubicSpline, &[0.0, 2.0], &[9.0, 0.0, 0.0, 12.0, 8.0, 9.0], 1);
        for t in [0.0, 0.3, 1.0, 1.9, 2.0] {
            assert!((cubic.at(t)[0] - t * t * t).abs() < 1e-14, "{t}");
        }
    }

    #[test]
    fn rotations_turn_evenly_along_the_shorter_way() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // A quarter about X, written as the opposite quaternion and too long.
        let mut turn = curve(Interpolation::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, -7.0, 0.0, 0.0, -7.0], 4);
        turn.rotation = true;
        turn.normalize().expect("rotations");
        let third = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_6);
        let at = quaternion(&turn.at(1.0 / 3.0));
        assert!((at.dot(third).abs() - 1.0).abs() < 1e-15, "{at}");
        assert!((turn.at(1.0)[0] + half).abs() < 1e-15);
        turn.values[5] = 0.0;
        turn.values[4] = 0.0;
        turn.values[7] = 0.0;
        assert_eq!(turn.normalize(), Err(1));
    }
}
