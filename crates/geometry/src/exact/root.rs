//! Ray parameters as exact numbers, to order hits on different surfaces.

use core::cmp::Ordering;

use super::dyadic::Dyadic;
use super::quadratic::{Side, placed};

/// The exact parameter of a hit: a real root of a polynomial of degree two or one.
///
/// Roots are ordered as the numbers they are, whatever surfaces of whatever kind they come from; the comparison takes
/// exact arithmetic, some microseconds, and is only needed where the rounded parameters are equal.
///
/// How a root of `P` compares with a root `b` of `Q` follows from the signs of `P` and its derivative at `b`. The
/// remainder of `P` divided by `Q` has the value of `P` there and is linear, so its sign is that of a comparison of `b`
/// with a rational number.
#[derive(Clone, Debug)]
pub struct Root {
    /// `A`, `B`, `C` of `A t^2 + 2 B t + C`.
    pub(super) coefficients: [Dyadic; 3],
    pub(super) side: Side,
}

impl Root {
    /// The quotient of two numbers; `d` is not 0.
    pub(super) fn quotient(n: Dyadic, d: Dyadic) -> Self {
        Self { coefficients: [Dyadic::default(), d, -n.scaled(1)], side: Side::Lower }
    }

    fn signs(&self) -> (i32, i32) {
        (self.coefficients[0].signum(), self.coefficients[1].signum())
    }

    /// The sign of `k t + c` at the root.
    fn sign_of_line(&self, k: &Dyadic, c: &Dyadic) -> i32 {
        let [a, b, f] = &self.coefficients;
        if k.signum() == 0 {
            return c.signum();
        }
        // Against -c/k, in the form times k^2 and half its derivative times k.
        let (leading, slope) = self.signs();
        let value = || (&(&(a * c) * c) - &(&(b * c) * k).scaled(1)) + &(f * k) * k;
        let derivative = || (b * k - a * c).signum() * k.signum();
        let order = placed(leading, || slope, self.side, || value().signum(), derivative);
        order as i32 * k.signum()
    }
}

/// A finite number; of others, 0.
impl From<f64> for Root {
    fn from(t: f64) -> Self {
        Self::quotient(Dyadic::new(if t.is_finite() { t } else { 0.0 }), Dyadic::new(1.0))
    }
}

impl Ord for Root {
    fn cmp(&self, o: &Self) -> Ordering {
        let ([a, b, c], [d, e, f]) = (&self.coefficients, &o.coefficients);
        let (leading, slope) = self.signs();
        let value = || match d.signum() {
            // o is -f / 2e.
            0 => {
                let twice_e = e.clone().scaled(1);
                (&(&(a * f) * f) - &(&(b * f) * &twice_e).scaled(1) + &(c * &twice_e) * &twice_e).signum()
            }
            // The remainder, times d.
            sign => sign * o.sign_of_line(&(d * b - a * e).scaled(1), &(d * c - a * f)),
        };
        placed(leading, || slope, self.side, value, || o.sign_of_line(a, b))
    }
}

impl PartialOrd for Root {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl PartialEq for Root {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o).is_eq()
    }
}

impl Eq for Root {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Equation = [i32; 3];

    /// Real roots of a form of small integers, ascending, and their values.
    fn roots([a, b, c]: Equation) -> Vec<(Root, f64)> {
        let coefficients = [a, b, c].map(|x| Dyadic::new(x.into()));
        let root = |side, value| (Root { coefficients: coefficients.clone(), side }, value);
        let d = b * b - a * c;
        let [x, y, z] = [a, b, c].map(f64::from);
        match (a, d) {
            (0, _) if b == 0 => vec![],
            (0, _) => vec![root(Side::Lower, -0.5 * z / y)],
            (_, ..0) => vec![],
            _ => {
                let s = f64::from(d).sqrt().copysign(x);
                vec![root(Side::Lower, (-y - s) / x), root(Side::Upper, (-y + s) / x)]
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Different roots of such small equations are far apart, as floats go; and common roots are common.
        #[test]
        fn roots_of_different_forms_are_ordered(
            p in prop::array::uniform3(-6..=6i32), q in prop::array::uniform3(-6..=6i32), k in 1..4i32
        ) {
            for (x, value) in roots(p) {
                for (y, other) in roots(q).into_iter().chain(roots(p.map(|c| -k * c))) {
                    let expected =
                        if (value - other).abs() < 1e-9 { Ordering::Equal } else { value.total_cmp(&other) };
                    prop_assert_eq!(x.cmp(&y), expected, "{:?} {} {:?} {}", p, value, q, other);
                    prop_assert_eq!(y.cmp(&x), expected.reverse());
                }
            }
        }
    }
}
