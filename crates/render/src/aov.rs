//! Pictures beside the colour.

use std::fmt;
use std::str::FromStr;

/// A picture beside the colour ("arbitrary output variable").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Aov {
    /// Distance from the camera to the first hit, world units; infinite where there is none.
    Depth,
    /// World shading normal.
    Normal,
    /// World geometric normal.
    GeometricNormal,
    /// Base colour.
    Albedo,
    /// Texture coordinates.
    Uv,
    /// Barycentric coordinates.
    Barycentric,
    /// Instance id as a distinct colour.
    InstanceId,
    /// Material id as a distinct colour.
    MaterialId,
    /// Primitive id as a distinct colour.
    PrimitiveId,
    /// Boxes and primitives tested, as a heat map.
    Heat,
    /// How many samples a pixel got.
    Samples,
    /// Estimated variance of each colour of the picture, linear: its square root is how far it may be off. Infinite
    /// below 32 samples.
    Variance,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Depth,
        Self::Normal,
        Self::GeometricNormal,
        Self::Albedo,
        Self::Uv,
        Self::Barycentric,
        Self::InstanceId,
        Self::MaterialId,
        Self::PrimitiveId,
        Self::Heat,
        Self::Samples,
        Self::Variance,
    ];

    /// Whether each sample has a value of it; the others are known of a pixel as a whole, and are no pictures of their
    /// own.
    #[must_use]
    pub const fn is_sampled(self) -> bool {
        !matches!(self, Self::Samples | Self::Variance)
    }

    /// The name used on command lines and of layers in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::GeometricNormal => "geometric-normal",
            Self::Albedo => "albedo",
            Self::Uv => "uv",
            Self::Barycentric => "barycentric",
            Self::InstanceId => "instance-id",
            Self::MaterialId => "material-id",
            Self::PrimitiveId => "primitive-id",
            Self::Heat => "heat",
            Self::Samples => "samples",
            Self::Variance => "variance",
        }
    }
}

impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Aov {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|a| a.name() == s).ok_or_else(|| format!("unknown picture '{s}'"))
    }
}
