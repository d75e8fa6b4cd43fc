//! Quadrics closed by caps.

use core::cmp::Ordering;

use super::common::padded;
use super::cuboid::{ExactEnd, exact_stay, stay};
use super::exact::visit_at;
use super::quadric::OnQuadric;
use super::{Cuboid, ExactSurfaceHit, ExactVisitor, Primitive, Quadric, ShapeError, SurfaceHit};
use crate::exact::quadratic::{Count, Quadratic, Side};
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

/// [`End`], exactly.
#[derive(Clone, Copy)]
enum ExactPlace {
    Side(Side),
    Cap(ExactEnd),
}

/// Compares and rounds the ends of pieces of a line.
struct Ends<'a> {
    equation: &'a Quadratic<OnQuadric>,
    fallback: bool,
}

impl Ends<'_> {
    fn order(&mut self, a: ExactPlace, b: ExactPlace) -> Ordering {
        match (a, b) {
            (ExactPlace::Cap(a), ExactPlace::Cap(b)) => a.at.order(b.at, &mut self.fallback),
            (ExactPlace::Side(a), ExactPlace::Cap(b)) => self.equation.order(a, b.at),
            (ExactPlace::Cap(a), ExactPlace::Side(b)) => self.equation.order(b, a.at).reverse(),
            (ExactPlace::Side(a), ExactPlace::Side(b)) if self.equation.count() == Count::Two => {
                (a == Side::Upper).cmp(&(b == Side::Upper))
            }
            (ExactPlace::Side(_), ExactPlace::Side(_)) => Ordering::Equal,
        }
    }

    fn is_in(&mut self, place: ExactPlace, ray: &Ray<f64>) -> bool {
        match place {
            ExactPlace::Side(side) => self.equation.admits(side, ray),
            ExactPlace::Cap(end) => end.at.is_in(ray, &mut self.fallback),
        }
    }

    fn nearest<R: Real>(&mut self, place: ExactPlace) -> R {
        match place {
            ExactPlace::Side(side) => self.equation.nearest(side),
            ExactPlace::Cap(end) => end.nearest(&mut self.fallback),
        }
    }
}

/// The pieces of a line on which a form is not positive, each end `None` where there is none.
fn pieces(equation: &Quadratic<OnQuadric>) -> [Option<[Option<Side>; 2]>; 2] {
    let (lower, upper) = (Some(Side::Lower), Some(Side::Upper));
    match (equation.leading(), equation.count()) {
        (1, Count::Two | Count::Double) => [Some([lower, upper]), None],
        (-1, Count::Two | Count::Double) => [Some([None, lower]), Some([upper, None])],
        (_, Count::Simple) if equation.slope() > 0 => [Some([None, lower]), None],
        (_, Count::Simple) => [Some([lower, None]), None],
        // The sign never changes.
        (1, _) => [None; 2],
        (-1, _) => [Some([None; 2]), None],
        _ => [(equation.constant() <= 0).then_some([None; 2]), None],
    }
}

impl<R: Real> Primitive<R> for Solid<R> {
    fn bounds(&self) -> Aabb<R> {
        padded(self.bounds)
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray)
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let (equation, line) = (self.surface.equation(ray), ray.to_f64());
        let mut ends = Ends { equation: &equation, fallback: false };
        let Some(stay) = exact_stay(&self.surface.clip().to_f64(), &line, &mut ends.fallback) else {
            return ends.fallback;
        };
        let (enter, exit) = (stay.enter.map(ExactPlace::Cap), stay.exit.map(ExactPlace::Cap));
        for [low, high] in pieces(&equation).into_iter().flatten() {
            let (low, high) = (low.map(ExactPlace::Side), high.map(ExactPlace::Side));
            // Where side and cap coincide, the side.
            let first = match (low, enter) {
                (Some(a), Some(b)) => Some(if ends.order(a, b).is_ge() { a } else { b }),
                (a, b) => a.or(b),
            };
            let last = match (high, exit) {
                (Some(a), Some(b)) => Some(if ends.order(a, b).is_le() { a } else { b }),
                (a, b) => a.or(b),
            };
            let order = match (first, last) {
                (Some(a), Some(b)) => ends.order(a, b),
                _ => Ordering::Less,
            };
            if order.is_gt() {
                continue;
            }
            for place in [first, last.filter(|_| order.is_lt())].into_iter().flatten() {
                if !ends.is_in(place, &line) {
                    continue;
                }
                let found = |t: R| {
                    let hit = match place {
                        ExactPlace::Side(_) => self.surface.hit(ray, t),
                        ExactPlace::Cap(end) => Cuboid::face_hit(&self.bounds, ray, t, end.axis, end.entry),
                    };
                    ExactSurfaceHit { hit, crosses: order.is_lt() }
                };
                let root = || match place {
                    ExactPlace::Side(side) => equation.root(side),
                    ExactPlace::Cap(end) => end.root(),
                };
                if visit_at(ends.nearest(place), found, &root, visit).is_break() {
                    return ends.fallback || equation.fallback();
                }
            }
        }
        ends.fallback || equation.fallback()
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
