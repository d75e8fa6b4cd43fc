//! Scenes that move: new scenes of old ones, with trees of the same shape.

use std::sync::Arc;

use glam::DAffine3;

use crate::instance::Placed;
use crate::memory;
use crate::{BuildError, Geometry, Scene};

impl Scene {
    /// This scene with other vertices (or shapes) in one mesh: the tree of the mesh keeps its shape and gets new boxes,
    /// which is quicker than building. This scene stays as it is, and shares all other meshes with the new one.
    ///
    /// Answers are those of a scene built anew; only the time they take may differ: the more the mesh differs from the
    /// one that was built, the more boxes overlap. Meshes of the layout [`Compact8`](crate::Layout::Compact8) are built
    /// anew. Where triangles without area or unbounded shapes are left out of a
    /// tree and now belong there, the mesh is built anew. The tree over the instances always is.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let at = |z: f32| Geometry::Triangles {
    ///     positions: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * z).to_vec(),
    ///     triangles: vec![[0, 1, 2]],
    /// };
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![at(0.0)]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let before = builder.build()?;
    /// let after = before.refit(mesh, &[at(1.0)])?;
    ///
    /// let ray = Ray::new(DVec3::new(0.2, 0.2, 5.0), DVec3::NEG_Z);
    /// assert_eq!(before.closest_hit(&ray).unwrap().t, 5.0);
    /// assert_eq!(after.closest_hit(&ray).unwrap().t, 4.0);
    /// assert!(after.refit(mesh, &[at(f32::NAN)]).is_err());
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When there is no such mesh, it has not as many geometries of the same kind with as many triangles as before,
    /// a vertex or index is unusable, or the memory is limited: see [`BuildError`].
    pub fn refit(&self, mesh: usize, geometries: &[Geometry]) -> Result<Self, BuildError> {
        let mut models = self.models().to_vec();
        let count = models.len();
        let model = models.get_mut(mesh).ok_or(BuildError::UnknownMesh { mesh, count })?;
        memory::check([geometries], self.placed().len(), self.options())?;
        *model = Arc::new(model.refit(mesh, geometries, self.options())?);
        Self::place(self.options(), models, self.placed().to_vec(), self.mask(), Arc::clone(self.groups()))
    }

    /// This scene with other transforms, one for each instance. The new scene shares all meshes with this one; only the
    /// tree over the instances is built anew.
    ///
    /// # Errors
    /// When there are more or fewer transforms than instances, or one is unusable: see [`BuildError`].
    pub fn with_transforms(&self, transforms: &[DAffine3]) -> Result<Self, BuildError> {
        let instances = self.placed().len();
        if instances != transforms.len() {
            return Err(BuildError::TransformsChanged { instances, transforms: transforms.len() });
        }
        let placed = self.placed().iter().zip(transforms).map(|(p, m)| Placed { transform: *m, ..*p }).collect();
        Self::place(self.options(), self.models().to_vec(), placed, self.mask(), Arc::clone(self.groups()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Layout, SceneBuilder};
    use firsthit_geometry::shapes::{Plane, Sphere};
    use firsthit_geometry::{Precision, Ray};
    use glam::{DVec3, Vec3};

    const DOWN: Ray<f64> =
        Ray { origin: DVec3::new(0.2, 0.2, 9.0), direction: DVec3::NEG_Z, t_min: 0.0, t_max: f64::INFINITY };

    fn mesh(corners: &[[Vec3; 3]]) -> Geometry {
        let triangles = (0..corners.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Geometry::Triangles { positions: corners.as_flattened().to_vec(), triangles }
    }

    fn at(z: f32) -> [Vec3; 3] {
        [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * z)
    }

    fn scene(options: BuildOptions, geometries: &[Geometry]) -> Scene {
        let mut builder = SceneBuilder::new(options);
        let mesh = builder.add_mesh(geometries.to_vec());
        builder.add_instance(mesh, DAffine3::IDENTITY);
        builder.build().unwrap()
    }

    fn every_option() -> impl Iterator<Item = BuildOptions> {
        Precision::ALL
            .into_iter()
            .flat_map(|precision| Layout::ALL.map(|layout| BuildOptions { precision, layout, ..Default::default() }))
    }

    #[test]
    fn triangles_lose_their_area_and_get_it_back() {
        let rows = [3.0, 1.0, 2.0, 0.0, 5.0];
        for options in every_option() {
            let full = scene(options, &[mesh(&rows.map(at))]);
            assert_eq!(full.closest_hit(&DOWN).map(|h| h.id.primitive), Some(4));
            let mut corners = rows.map(at);
            corners[4] = [Vec3::ONE; 3];
            corners[0] = [corners[0][0], corners[0][1], corners[0][0]];
            let less = full.refit(0, &[mesh(&corners)]).unwrap();
            assert_eq!(less.closest_hit(&DOWN).map(|h| (h.id.primitive, h.t)), Some((2, 7.0)));
            assert_eq!(less.stats().degenerate_triangles, 2);
            assert_eq!(less.bounds(), scene(options, &[mesh(&corners)]).bounds());

            let nothing = less.refit(0, &[mesh(&[[Vec3::ONE; 3]; 5])]).unwrap();
            assert!(nothing.closest_hit(&DOWN).is_none() && nothing.bounds().is_empty());
            for scene in [&less, &nothing] {
                let back = scene.refit(0, &[mesh(&rows.map(at))]).unwrap();
                assert_eq!(back.closest_hit(&DOWN), full.closest_hit(&DOWN));
            }
        }
    }

    #[test]
    fn shapes_move_and_may_lose_their_bounds() {
        let sphere = |z: f64| Geometry::Shape(Sphere::new(DVec3::Z * z, 0.5).unwrap().into());
        let plane = |z: f64| Geometry::Shape(Plane::new(DVec3::Z * z, DVec3::Z).unwrap().into());
        for options in every_option() {
            let first = scene(options, &[sphere(0.0), mesh(&[at(-1.0)]), plane(-2.0)]);
            for other in [
                [sphere(3.0), mesh(&[at(-1.0)]), plane(-2.0)],
                [plane(-3.0), mesh(&[at(1.0)]), sphere(2.0)],
                [plane(-3.0), mesh(&[at(1.0)]), plane(4.0)],
            ] {
                let refit = first.refit(0, &other).unwrap();
                let hit = refit.closest_hit(&DOWN);
                assert!(hit.is_some() && hit == scene(options, &other).closest_hit(&DOWN), "{hit:?}");
                assert!(refit.refit(0, &[sphere(0.0), mesh(&[at(-1.0)]), plane(-2.0)]).is_ok());
            }
        }
    }

    #[test]
    fn what_must_stay_is_named() {
        let first = scene(BuildOptions::default(), &[mesh(&[at(0.0), at(1.0)])]);
        let sphere = Geometry::Shape(Sphere::new(DVec3::ZERO, 0.5).unwrap().into());
        let refused = |mesh, geometries: &[Geometry]| first.refit(mesh, geometries).unwrap_err();
        assert_eq!(refused(1, &[]), BuildError::UnknownMesh { mesh: 1, count: 1 });
        assert_eq!(refused(0, &[]), BuildError::GeometriesChanged { mesh: 0, before: 1, now: 0 });
        let fewer = BuildError::TrianglesChanged { mesh: 0, geometry: 0, before: 2, now: 1 };
        assert_eq!(refused(0, &[mesh(&[at(0.0)])]), fewer);
        assert_eq!(refused(0, &[sphere]), BuildError::KindChanged { mesh: 0, geometry: 0 });
        let nan = BuildError::NotFinite { mesh: 0, geometry: 0, vertex: 3 };
        assert_eq!(refused(0, &[mesh(&[at(0.0), at(f32::NAN)])]), nan);
        let transforms = |list: &[DAffine3]| first.with_transforms(list).unwrap_err();
        assert_eq!(transforms(&[]), BuildError::TransformsChanged { instances: 1, transforms: 0 });
        assert_eq!(transforms(&[DAffine3::ZERO]), BuildError::IllConditioned { instance: 0 });
        assert_eq!(first.closest_hit(&DOWN).unwrap().t, 8.0);
    }

    #[test]
    fn what_does_not_move_is_shared() {
        let mut builder = SceneBuilder::default();
        for z in [0.0, 1.0] {
            let mesh = builder.add_mesh(vec![mesh(&[at(z)])]);
            builder.add_instance(mesh, DAffine3::IDENTITY);
        }
        let first = builder.build().unwrap();
        let refit = first.refit(0, &[mesh(&[at(2.0)])]).unwrap();
        assert!(Arc::ptr_eq(&first.models()[1], &refit.models()[1]));
        assert!(!Arc::ptr_eq(&first.models()[0], &refit.models()[0]));
        let moved = refit.with_transforms(&[DAffine3::IDENTITY, DAffine3::from_translation(DVec3::Z * 3.0)]).unwrap();
        assert!((0..2).all(|i| Arc::ptr_eq(&moved.models()[i], &refit.models()[i])));
        let hits = [&first, &refit, &moved].map(|s| s.closest_hit(&DOWN).map(|h| (h.id.instance, h.t)));
        assert_eq!(hits, [Some((1, 8.0)), Some((0, 7.0)), Some((1, 5.0))]);
    }
}
