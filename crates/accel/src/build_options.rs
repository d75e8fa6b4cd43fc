//! How a scene is built.

use firsthit_geometry::Precision;

use crate::Guards;

/// How much time a build may take for a better tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BuildQuality {
    /// Quickest build.
    Fast,
    /// The default.
    #[default]
    Balanced,
    /// Best tree.
    High,
}

/// How nodes and primitives lie in memory. Answers do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layout {
    /// Binary tree: simple and portable.
    #[default]
    Bvh2,
}

impl Layout {
    /// All layouts: tests and benches loop over them.
    pub const ALL: [Self; 1] = [Self::Bvh2];
}

/// How a scene is built. The default is what most users want.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// Tier of precision of every query.
    pub precision: Precision,
    /// Time against quality of the trees.
    pub quality: BuildQuality,
    /// Memory layout.
    pub layout: Layout,
    /// Which guards the robust tier has: all, but in measurements.
    pub guards: Guards,
}
