//! The frames of an animation: the trees of one frame from those of the frame before.

use std::sync::Arc;

use firsthit_import::SceneDesc;
use firsthit_import::scene::{MeshDesc, SurfaceDesc};
use rayon::prelude::*;

use crate::instance::Placed;
use crate::model::Model;
use crate::renew::{self, Followed, Step};
use crate::{BuildError, Geometry, Scene};

impl Scene {
    /// The trees of `after`, made of these ones, which are those of `before`: meshes that are the same share theirs,
    /// what only moved is refitted, and all else is built anew, as is what refitting has made too costly (half as much
    /// again as when it was built). Answers are those of a scene built anew. Instances keep their masks, by their indices.
    ///
    /// ```
    /// use firsthit_accel::SceneBuilder;
    /// use firsthit_import::{SceneDesc, scene::*};
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let frame = |height: f32| {
    ///     let mesh = TriangleMesh {
    ///         positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y + height * Vec3::Z],
    ///         triangles: vec![[0, 1, 2]],
    ///         ..TriangleMesh::default()
    ///     };
    ///     let surface = SurfaceDesc::Triangles(mesh);
    ///     let geometries = vec![GeometryDesc { name: String::new(), surface, material: None }];
    ///     let instance = InstanceDesc { name: String::new(), mesh: 0, transform: DAffine3::IDENTITY, moves_to: None };
    ///     SceneDesc {
    ///         meshes: vec![MeshDesc { name: String::new(), geometries }],
    ///         instances: vec![instance],
    ///         ..SceneDesc::default()
    ///     }
    /// };
    /// let (first, second) = (frame(0.0), frame(1.0));
    /// let trees = SceneBuilder::from_desc(&first, Default::default()).build()?;
    /// let (trees, done) = trees.follow(&first, &second)?;
    /// assert_eq!(trees.bounds().max, DVec3::ONE);
    /// assert_eq!(done.refitted, 1);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When a vertex, index or transform is unusable: see [`BuildError`].
    pub fn follow(&self, before: &SceneDesc, after: &SceneDesc) -> Result<(Self, Followed), BuildError> {
        let options = self.options();
        let known = |i: usize| Some((self.models().get(i)?, before.meshes.get(i)?));
        let model = |(i, mesh): (usize, &MeshDesc)| match known(i) {
            Some((old, was)) if was.same_shape(mesh) => Ok((Arc::clone(old), Step::Kept)),
            Some((old, was)) if same_triangles(was, mesh) => renew::moved(old, i, &Geometry::from_desc(mesh), options),
            _ => Ok((Arc::new(Model::new(i, &Geometry::from_desc(mesh), options)?), Step::Built)),
        };
        let made: Vec<(Arc<Model>, Step)> =
            after.meshes.par_iter().enumerate().map(model).collect::<Result<_, BuildError>>()?;
        let followed = Followed::of(made.iter().map(|(_, step)| *step));
        let models = made.into_iter().map(|(model, _)| model).collect();
        let mut placed: Vec<Placed> = after.instances.iter().map(|i| Placed::new(i.mesh, i.transform)).collect();
        placed.iter_mut().zip(self.placed()).for_each(|(new, old)| new.mask = old.mask);
        // Who belongs together is known by the indices.
        let same = placed.len() == self.placed().len();
        let groups = if same { Arc::clone(self.groups()) } else { Arc::default() };
        Ok((Self::place(options, models, placed, self.mask(), groups)?, followed))
    }
}

/// Whether two meshes differ in the places of vertices alone.
fn same_triangles(a: &MeshDesc, b: &MeshDesc) -> bool {
    let same = |a: &SurfaceDesc, b: &SurfaceDesc| match (a, b) {
        (SurfaceDesc::Triangles(a), SurfaceDesc::Triangles(b)) => {
            a.positions.len() == b.positions.len() && a.triangles == b.triangles
        }
        _ => false,
    };
    a.geometries.len() == b.geometries.len()
        && a.geometries.iter().zip(&b.geometries).all(|(a, b)| same(&a.surface, &b.surface))
}

#[cfg(test)]
mod tests {
    use firsthit_geometry::Ray;
    use firsthit_import::scene::{GeometryDesc, InstanceDesc, TriangleMesh};
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::SceneBuilder;

    /// A sheet of triangles, each of which lies where `at` has it.
    fn mesh(at: impl Fn(u32) -> Vec3) -> MeshDesc {
        let corner = |k: u32| [Vec3::ZERO, Vec3::X, Vec3::Y][k as usize % 3] * 0.9 + at(k / 3);
        let triangles = TriangleMesh {
            positions: (0..300).map(corner).collect(),
            triangles: (0..100).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
            ..TriangleMesh::default()
        };
        let surface = SurfaceDesc::Triangles(triangles);
        MeshDesc {
            name: String::new(),
            geometries: vec![GeometryDesc { name: String::new(), surface, material: None }],
        }
    }

    fn sheet(k: u32) -> Vec3 {
        Vec3::new((k % 10) as f32, (k / 10) as f32, 0.0)
    }

    fn scene(moving: MeshDesc, x: f64) -> SceneDesc {
        let instance = |mesh, x| InstanceDesc {
            name: String::new(),
            mesh,
            transform: DAffine3::from_translation(DVec3::X * x),
            moves_to: None,
        };
        SceneDesc {
            meshes: vec![mesh(sheet), moving],
            instances: vec![instance(0, x), instance(1, 20.0)],
            ..SceneDesc::default()
        }
    }

    #[test]
    fn frames_answer_as_if_built_anew() {
        let lifted = |k: u32| sheet(k) + Vec3::Z * 0.1;
        // Neighbours go far apart: boxes of the old tree would hold everything.
        let shuffled = |k: u32| sheet(k * 37 % 100);
        let mut before = scene(mesh(sheet), 0.0);
        let mut trees = SceneBuilder::from_desc(&before, Default::default()).build().unwrap();
        for (after, expected) in [
            (scene(mesh(sheet), 1.0), Followed { kept: 2, refitted: 0, built: 0 }),
            (scene(mesh(lifted), 1.0), Followed { kept: 1, refitted: 1, built: 0 }),
            (scene(mesh(shuffled), 2.0), Followed { kept: 1, refitted: 0, built: 1 }),
            (scene(MeshDesc::default(), 2.0), Followed { kept: 1, refitted: 0, built: 1 }),
        ] {
            let (next, followed) = trees.follow(&before, &after).unwrap();
            assert_eq!(followed, expected);
            let anew = SceneBuilder::from_desc(&after, Default::default()).build().unwrap();
            for k in 0..2000 {
                let origin = DVec3::new(f64::from(k % 61) * 0.51, f64::from(k / 61) * 0.31, 9.0);
                let ray = Ray::new(origin, DVec3::new(0.01, -0.02, -1.0));
                assert_eq!(next.closest_hit(&ray), anew.closest_hit(&ray));
            }
            (trees, before) = (next, after);
        }
    }
}
