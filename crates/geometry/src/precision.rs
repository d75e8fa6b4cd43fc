//! The named tiers of precision.

use core::{fmt, str::FromStr};

/// How carefully an intersection is decided: accuracy has a price in time, and the user chooses.
///
/// | tier | arithmetic | promise |
/// |---|---|---|
/// | `Fast` | f32, shortest formulas (Moeller-Trumbore, algebraic quadratic) | no panic, no NaN; may leak at shared edges and vertices |
/// | `Robust` | f32 in stable forms, f64 where an edge function is zero, padded boxes | no leak through a closed mesh; right wherever f32 leaves 64 units of margin |
/// | `Double` | f64 | right wherever f64 leaves that margin |
/// | `Exact` | f64 with a proven bound, exact numbers where it cannot tell | hit or miss, order and parity exact; `t` correctly rounded |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Shortest f32 formulas.
    Fast,
    /// Watertight f32: the default.
    #[default]
    Robust,
    /// f64 at the primitives.
    Double,
    /// Exact decisions for the input as it is.
    Exact,
}

impl Precision {
    /// All tiers, from the cheapest to the most careful.
    pub const ALL: [Self; 4] = [Self::Fast, Self::Robust, Self::Double, Self::Exact];

    /// The name used on command lines and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Robust => "robust",
            Self::Double => "double",
            Self::Exact => "exact",
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Precision {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|p| p.name() == s)
            .ok_or_else(|| format!("unknown precision '{s}' (fast, robust, double or exact)"))
    }
}
