//! Trees that are kept in files.
//!
//! A file holds the shapes of the trees: what is below each node, and which triangle is where. Boxes and triangles are made
//! anew from the meshes, which takes a fraction of the time that building takes; so nothing that a file says can make an
//! answer wrong, as long as each triangle is in one leaf, which is checked.

mod check;
mod read;
mod write;

use std::sync::Arc;

use crate::builder::Parts;
use crate::memory;
use crate::model::Model;
use crate::{BuildError, Scene, SceneBuilder};

/// First in every file.
const MAGIC: [u8; 8] = *b"fh-trees";
/// Of the format.
const VERSION: u32 = 1;

/// Trees that are of no use.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SavedTreesError {
    /// It does not begin as such a file does.
    #[error("this is no file of saved trees")]
    Foreign,
    /// Of another version of the format.
    #[error("saved trees of version {found} (version {VERSION} is expected)")]
    Version {
        /// The version found.
        found: u32,
    },
    /// Its checksum does not fit its content, or it ends too soon.
    #[error("the saved trees are damaged: {0}")]
    Damaged(&'static str),
    /// Made of other meshes, or for another layout.
    #[error("the saved trees belong to something else: {0}")]
    Other(&'static str),
    /// The scene cannot be built, whatever the trees.
    #[error(transparent)]
    Build(#[from] BuildError),
}

impl Scene {
    /// The shapes of the scene's trees, to be kept in a file and used by [`SceneBuilder::build_with_trees`]: some six
    /// bytes a triangle of the wide layout.
    ///
    /// Shapes and primitives of the user's own are not in the hash: a tree of as many others gives the right answers too, but
    /// slower ones.
    ///
    /// Meshes of the layout [`Compact8`](crate::Layout::Compact8) are left out: they are built anew.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SavedTreesError, SceneBuilder};
    /// use glam::{DAffine3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let mut file = builder.clone().build()?.save_trees();
    ///
    /// let scene = builder.clone().build_with_trees(&file)?;
    /// file[20] ^= 1;
    /// assert!(matches!(builder.build_with_trees(&file), Err(SavedTreesError::Damaged(_))));
    /// # Ok::<(), SavedTreesError>(())
    /// ```
    #[must_use]
    pub fn save_trees(&self) -> Vec<u8> {
        write::trees(self.models())
    }
}

impl SceneBuilder {
    /// As [`SceneBuilder::build`], with trees of the shapes that [`Scene::save_trees`] has saved: the same answers, sooner.
    ///
    /// The bytes may be a map of the file (of the crate memmap2, say): they are read from front to back, and nothing of them is
    /// kept, so that the file may change or go as soon as this has returned. (While it is read it must not change; so no
    /// map is made in here.)
    ///
    /// # Errors
    /// When the file is foreign, damaged, or of other meshes or another layout: then [`SceneBuilder::build`] is what is left. And
    /// when the scene cannot be built.
    pub fn build_with_trees(self, saved: &[u8]) -> Result<Scene, SavedTreesError> {
        let trees = read::trees(saved)?;
        let Parts { options, meshes, instances, groups } = self.into_parts()?;
        if trees.len() != meshes.len() {
            return Err(SavedTreesError::Other("not as many meshes"));
        }
        // They are built one after the other.
        memory::check(&meshes, instances.len(), options)?;
        let mut models = Vec::with_capacity(meshes.len());
        for (i, (mesh, tree)) in meshes.iter().zip(trees).enumerate() {
            let Some(shape) = tree.shape else {
                models.push(Arc::new(Model::new(i, mesh, options)?));
                continue;
            };
            let model = Model::new_in_shape(i, mesh, options, shape)?;
            let Some(model) = model else { return Err(SavedTreesError::Other("another layout, or other triangles")) };
            if write::hash(&model) != tree.hash {
                return Err(SavedTreesError::Other("other triangles"));
            }
            models.push(Arc::new(model));
        }
        Ok(Scene::place(options, models, instances, u32::MAX, groups)?)
    }
}

/// What a file holds of one mesh.
pub(crate) struct SavedTree {
    /// Of its triangles.
    hash: u64,
    /// None for layouts that are built anew.
    shape: Option<TreeShape>,
}

/// What is below each node, and what is where.
pub(crate) enum TreeShape {
    Wide { root: u32, children: Vec<[u32; 8]>, numbers: Vec<u32>, depth: u32 },
    Binary { root: Option<crate::build::Child>, nodes: Vec<[crate::build::Child; 2]>, numbers: Vec<u32>, depth: u32 },
}
