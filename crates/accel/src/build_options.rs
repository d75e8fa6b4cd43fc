//! How a scene is built.

use firsthit_geometry::Precision;

use crate::{Guards, Level};

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
    /// Binary tree: simple and portable. It also stands in for meshes that others cannot hold: those with shapes.
    Bvh2,
    /// Eight children a node and eight triangles a block, tested eight at a time.
    #[default]
    Wide8,
    /// The same in less memory: boxes on a grid of eight bits, vertices shared within a leaf. A little slower where all
    /// fits into the caches; a refit builds it anew.
    Compact8,
}

impl Layout {
    /// All layouts: tests and benches loop over them.
    pub const ALL: [Self; 3] = [Self::Bvh2, Self::Wide8, Self::Compact8];

    /// The name used on command lines and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bvh2 => "bvh2",
            Self::Wide8 => "wide8",
            Self::Compact8 => "compact8",
        }
    }
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
    /// The most demanding instructions that queries may use, if the processor has them.
    pub simd: Level,
    /// Which guards the robust tier has: all, but in measurements.
    pub guards: Guards,
    /// Bytes of memory that a build may take at most: trees, and what it needs beside while it makes them. A build that
    /// would need more is refused by [`BuildError::OutOfMemory`](crate::BuildError::OutOfMemory) before it allocates
    /// anything; where the meshes fit one after the other but not all at once, they are built one after the other. `None`:
    /// as many as it takes.
    ///
    /// What is needed is estimated from the numbers of vertices, primitives and instances alone, and is not too little:
    /// of large meshes 1.1 to 1.5 times what is taken (`tests/checks/tests/build_memory.rs`). What the caller holds is not
    /// counted: the geometries, and the scene that is updated. What was taken in the end is told by
    /// [`Scene::stats`](crate::Scene::stats).
    pub memory_limit: Option<u64>,
}
