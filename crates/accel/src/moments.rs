//! Scenes in motion: as they are at some moments.

use crate::{BuildError, Scene, SceneUpdate};

/// A scene while things in it move: as it is in the middle of each of so many equal steps of time. A ray with a time of its own asks
/// the scene of that moment.
///
/// So a ray needs no time, and every query knows motion, of any kind: turning, bending, appearing. What does not move is there
/// once. What moves farther than the width of what is asked between two moments shows as that many separate pictures: more steps
/// mend that.
///
/// ```
/// use firsthit_accel::{Geometry, Moments, SceneBuilder};
/// use firsthit_geometry::Ray;
/// use glam::{DAffine3, DVec3, Vec3};
///
/// let mut builder = SceneBuilder::default();
/// let mesh = builder.add_mesh(vec![Geometry::Triangles {
///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
///     triangles: vec![[0, 1, 2]],
/// }]);
/// let rising = builder.add_instance(mesh, DAffine3::IDENTITY);
/// let scene = builder.build()?;
///
/// let moments = Moments::new(&scene, 8, |time, update| {
///     update.set_transform(rising, DAffine3::from_translation(DVec3::Z * time));
/// })?;
/// let ray = Ray::new(DVec3::new(0.2, 0.2, 5.0), DVec3::NEG_Z);
/// let t = |time| moments.at(time).closest_hit(&ray).map(|hit| hit.t);
/// assert_eq!([t(0.0), t(0.5), t(1.0)], [Some(4.9375), Some(4.4375), Some(4.0625)]);
/// # Ok::<(), firsthit_accel::BuildError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Moments {
    scenes: Vec<Scene>,
}

impl Moments {
    /// The scene with the changes that `change` makes for each moment, at a time from 0 to 1: each begins with `scene` as it is.
    /// With no steps there is one.
    ///
    /// # Errors
    /// As of [`SceneUpdate::finish`], at the first moment that cannot be.
    pub fn new(scene: &Scene, steps: usize, mut change: impl FnMut(f64, &mut SceneUpdate)) -> Result<Self, BuildError> {
        let steps = steps.max(1);
        let moment = |step| {
            let mut update = scene.update();
            change(Self::middle(step, steps), &mut update);
            update.finish().map(|(scene, _)| scene)
        };
        Ok(Self { scenes: (0..steps).map(moment).collect::<Result<_, _>>()? })
    }

    /// The time in the middle of one of so many steps.
    #[must_use]
    pub fn middle(step: usize, steps: usize) -> f64 {
        (step as f64 + 0.5) / steps as f64
    }

    /// The index of the moment that a time falls to. Times before 0 and what is not a number fall to the first, times from 1 on
    /// to the last.
    #[inline]
    #[must_use]
    pub fn step(&self, time: f64) -> usize {
        ((time * self.scenes.len() as f64) as usize).min(self.scenes.len() - 1)
    }

    /// The scene at a time.
    #[inline]
    #[must_use]
    pub fn at(&self, time: f64) -> &Scene {
        &self.scenes[self.step(time)]
    }

    /// The scenes of all moments, in the order of time. There is at least one.
    #[must_use]
    pub fn scenes(&self) -> &[Scene] {
        &self.scenes
    }
}
