//! Quadrics closed by caps.

use super::common::padded;
use super::cuboid::stay;
use super::{Cuboid, Primitive, Quadric, ShapeError, SurfaceHit};
use crate::quadratic::roots;
use crate::{Aabb, Ray, Real, Vector3};

/// The boundary of the part of a quadric's clip box where the quadric is negative: the surface with the openings that
/// its clip planes cut closed by flat caps.
///
/// Solved as an intersection of intervals - the ray's stay inside the quadric with its stay in the clip box - rather
/// than as separate surface and disks, so that no ray slips through between a cap and the side. On the side `normal`,
/// `u` and `v` are those of the quadric, on a cap those of the clip box's face (see [`Cuboid`]).
///
/// ```
/// use firsthit_geometry::{Primitive, Ray, shapes::{Quadric, Solid}};
/// use glam::DVec3;
/// let can = Solid::new(Quadric::cylinder(1.0, 0.0, 2.0)?);
/// let hit = can.closest_hit(&Ray::new(DVec3::new(0.5, 5.0, 0.0), DVec3::NEG_Y)).unwrap();
/// assert_eq!((hit.t, hit.normal), (3.0, Some(DVec3::Y)));
/// # Ok::<(), firsthit_geometry::ShapeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid<R: Real> {
    surface: Quadric<R>,
    bounds: Aabb<R>,
}

/// An end of an interval of the ray inside the solid.
#[derive(Clone, Copy)]
enum End<R> {
    /// On the quadric, at this parameter of the local line.
    Side(R),
    /// On a face of the clip box across this axis.
    Cap { axis: usize, entry: bool },
}

impl<R: Real> Solid<R> {
    /// Closes a surface by the faces of its clip box. The inside is where the polynomial is negative, as it is for all
    /// of [`Quadric`]'s named constructors.
    #[must_use]
    pub fn new(surface: Quadric<R>) -> Self {
        Self { surface, bounds: surface.solid_bounds() }
    }

    /// The open surface.
    #[must_use]
    pub fn surface(&self) -> &Quadric<R> {
        &self.surface
    }

    /// The same solid in another arithmetic.
    ///
    /// # Errors
    /// When a coefficient leaves the range of `S`.
    pub fn cast<S: Real>(&self) -> Result<Solid<S>, ShapeError> {
        Ok(Solid::new(self.surface.cast()?))
    }

    fn nearest(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        if !ray.is_valid() {
            return None;
        }
        let clip = self.surface.clip();
        let inside_box = stay(&clip, ray.origin, ray.direction)?;
        let line = self.surface.local(ray);
        let [a, b, c] = self.surface.local_equation(&line);
        let infinity = R::INFINITY;
        // The pieces of the line inside the quadric, in local parameters. Without roots the sign never changes.
        let pieces = match roots(a, b, c) {
            Some([t0, t1]) if a > R::ZERO => [Some((t0, t1)), None],
            Some([t0, t1]) if a < R::ZERO => [Some((-infinity, t0)), Some((t1, infinity))],
            Some([t, _]) if b > R::ZERO => [Some((-infinity, t)), None],
            Some([t, _]) => [Some((t, infinity)), None],
            None => [(c <= R::ZERO).then_some((-infinity, infinity)), None],
        };
        for (low, high) in pieces.into_iter().flatten() {
            let mut first = (Quadric::parameter(&line, low), End::Side(low));
            let mut last = (Quadric::parameter(&line, high), End::Side(high));
            if !(first.0 >= inside_box.enter) {
                first = (inside_box.enter, End::Cap { axis: inside_box.enter_axis, entry: true });
            }
            if !(last.0 <= inside_box.exit) {
                last = (inside_box.exit, End::Cap { axis: inside_box.exit_axis, entry: false });
            }
            if !(first.0 <= last.0) {
                continue;
            }
            let found = [first, last].into_iter().find(|(t, _)| ray.contains(*t) && t.is_finite());
            if let Some((t, end)) = found {
                return Some(match end {
                    End::Side(local) => self.surface.hit_at(&line, t, local),
                    End::Cap { axis, entry } => Cuboid::face_hit(&self.bounds, ray, t, axis, entry),
                });
            }
        }
        None
    }
}

impl<R: Real> Primitive<R> for Solid<R> {
    fn bounds(&self) -> Aabb<R> {
        padded(self.bounds)
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray)
    }

    /// On a cap sets the coordinate of its plane, on the side as for the quadric.
    fn refine(&self, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R) {
        let (clip, (on_side, error)) = (self.surface.clip(), self.surface.refine(point, normal));
        // A cap's normal is an axis, but so can be the side's: the nearer of the two was hit.
        let steep = R::ONE - R::UNIT_ROUNDOFF.sqrt();
        let cap = normal.and_then(|n| (0..3).find(|&i| n.axis(i).abs() >= steep).map(|i| (i, n.axis(i) > R::ZERO)));
        if let Some((axis, upper)) = cap {
            let face = if upper { clip.max.axis(axis) } else { clip.min.axis(axis) };
            if (point.axis(axis) - face).abs() <= (point - on_side).length() + error {
                return Cuboid::project(&clip, point, normal);
            }
        }
        (on_side, error)
    }
}
