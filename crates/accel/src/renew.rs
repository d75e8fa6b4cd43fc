//! The tree of a mesh that has changed: refitted where that is good enough.

use std::fmt;
use std::sync::Arc;

use crate::model::Model;
use crate::{BuildError, BuildOptions, Geometry};

/// What was done with the meshes of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// Meshes that are as before: their trees are shared.
    pub kept: usize,
    /// Meshes whose tree kept its shape and got new boxes.
    pub refitted: usize,
    /// Meshes whose tree was built anew.
    pub built: usize,
}

impl fmt::Display for Followed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kept, refitted, built } = self;
        write!(f, "trees: {kept} kept, {refitted} refitted, {built} built")
    }
}

impl Followed {
    pub(crate) fn of(steps: impl Iterator<Item = Step>) -> Self {
        let mut followed = Self::default();
        for step in steps {
            match step {
                Step::Kept => followed.kept += 1,
                Step::Refitted => followed.refitted += 1,
                Step::Built => followed.built += 1,
            }
        }
        followed
    }
}

/// What was done with one mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    Kept,
    Refitted,
    Built,
}

/// A refitted tree that costs so many times what it did when it was built is built anew.
const MOST_GROWTH: f64 = 1.5;

/// A mesh whose vertices have moved: its tree is refitted, unless that makes it too costly.
pub(crate) fn moved(
    old: &Model,
    mesh: usize,
    parts: &[Geometry],
    options: BuildOptions,
) -> Result<(Arc<Model>, Step), BuildError> {
    let refit = old.refit(mesh, parts, options)?;
    // Where it had to be built anew by itself, nothing has grown.
    if refit.growth() <= MOST_GROWTH {
        return Ok((Arc::new(refit), Step::Refitted));
    }
    drop(refit);
    Ok((Arc::new(Model::new(mesh, parts, options)?), Step::Built))
}
