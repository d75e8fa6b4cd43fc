//! Two trees at once: which triangles of one meet those of the other, and how far they are apart.

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use firsthit_geometry::distance::{ClosestPair, closest_between_triangles};
use firsthit_geometry::triangle_pair::{common_segment, meet, meet_otherwise};
use glam::DVec3;

use super::VisitedTriangle;
use super::cursor::Cursor;
use crate::scene::Inner;
use crate::{HitId, Scene};

/// A piece of the line where two triangles meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveSegment {
    /// Its ends in the world; one point twice where the triangles touch in a point.
    pub ends: [DVec3; 2],
    /// Which triangles meet.
    pub ids: [HitId; 2],
}

/// How far two scenes are from each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// In world units; 0 where they meet.
    pub distance: f64,
    /// The nearest points, of either scene.
    pub points: [DVec3; 2],
    /// On which triangles they lie.
    pub ids: [HitId; 2],
}

/// What is done with pairs of boxes and of triangles.
trait Pairs {
    /// Whether anything in two boxes is wanted; if so, a number by which pairs are ordered, smaller ones first.
    fn near(&self, a: &Aabb<f64>, b: &Aabb<f64>) -> Option<f64>;
    fn triangles(&mut self, a: &VisitedTriangle, b: &VisitedTriangle) -> ControlFlow<()>;
}

/// Tells of the pairs whose boxes meet.
struct Touching<F>(F);

impl<F: FnMut(&VisitedTriangle, &VisitedTriangle) -> ControlFlow<()>> Pairs for Touching<F> {
    fn near(&self, a: &Aabb<f64>, b: &Aabb<f64>) -> Option<f64> {
        (!a.intersection(*b).is_empty()).then_some(0.0)
    }
    fn triangles(&mut self, a: &VisitedTriangle, b: &VisitedTriangle) -> ControlFlow<()> {
        (self.0)(a, b)
    }
}

/// Keeps the nearest pair.
struct Nearest(Option<Separation>);

impl Pairs for Nearest {
    fn near(&self, a: &Aabb<f64>, b: &Aabb<f64>) -> Option<f64> {
        let apart = (a.min - b.max).max(b.min - a.max).max(DVec3::ZERO).length();
        let size = [a.min, a.max, b.min, b.max].iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
        // Less than anything that is rounded makes of it.
        let apart = apart - size * 2f64.powi(-40);
        self.0.is_none_or(|best| apart <= best.distance).then_some(apart)
    }
    fn triangles(&mut self, a: &VisitedTriangle, b: &VisitedTriangle) -> ControlFlow<()> {
        let new = separation(a, b);
        if self.0.is_none_or(|best| (new.distance, new.ids) < (best.distance, best.ids)) {
            self.0 = Some(new);
        }
        ControlFlow::Continue(())
    }
}

/// How far two triangles are apart: exactly 0 where they meet exactly.
pub(crate) fn separation(a: &VisitedTriangle, b: &VisitedTriangle) -> Separation {
    let pair = closest_between_triangles(a.corners, b.corners);
    let ids = [a.id, b.id];
    let size = a.corners.iter().chain(&b.corners).fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
    if pair.distance() <= size * 2f64.powi(-30) && meet(a.corners, b.corners) {
        return Separation { distance: 0.0, points: [pair.first; 2], ids };
    }
    let ClosestPair { first, second } = pair;
    Separation { distance: pair.distance(), points: [first, second], ids }
}

/// A mesh, or many, against another.
///
/// Triangles meet if they have a point in common; that is decided exactly, for their corners in the world as rounded to `f64`.
/// So touching and coplanar triangles do meet, and those of no area (there) do not. Surfaces meet, not what they enclose: a
/// mesh deep in a solid does not. Analytic shapes have no such queries yet.
impl Scene {
    /// Whether any triangle of this scene meets one of the other.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, Scene, SceneBuilder};
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let scene = |positions: Vec<Vec3>, at: DVec3| -> Result<Scene, firsthit_accel::BuildError> {
    ///     let mut builder = SceneBuilder::default();
    ///     let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    ///     builder.add_instance(mesh, DAffine3::from_translation(at));
    ///     builder.build()
    /// };
    /// let floor = scene(vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0], DVec3::ZERO)?;
    /// let wall = vec![Vec3::new(1.0, 0.5, -1.0), Vec3::new(1.0, 1.5, -1.0), Vec3::new(1.0, 1.0, 1.0)];
    /// let through = scene(wall.clone(), DVec3::ZERO)?;
    /// let above = scene(wall, DVec3::Z * 3.0)?;
    ///
    /// assert!(floor.intersects(&through) && !floor.intersects(&above));
    /// let curve = floor.intersection_curve(&through);
    /// assert_eq!(curve[0].ends[0].distance(curve[0].ends[1]), 0.5);
    /// assert_eq!(floor.distance_between(&above).unwrap().distance, 2.0);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn intersects(&self, other: &Self) -> bool {
        self.meeting(other, |_, _| ControlFlow::Break(())).is_break()
    }

    /// All pairs of triangles that meet, one of this scene and one of the other: by id. See [`Scene::intersects`].
    #[must_use]
    pub fn intersecting_pairs(&self, other: &Self) -> Vec<[HitId; 2]> {
        let mut pairs = Vec::new();
        let _ = self.meeting(other, |a, b| {
            pairs.push([a.id, b.id]);
            ControlFlow::Continue(())
        });
        pairs.sort_unstable();
        pairs
    }

    /// The lines along which the surfaces cut each other, piece by piece: one for each pair that meets and does not lie in one
    /// plane, by id. Which pieces there are is exact, their ends are rounded. See [`Scene::intersects`].
    #[must_use]
    pub fn intersection_curve(&self, other: &Self) -> Vec<CurveSegment> {
        let mut curve = Vec::new();
        let _ = self.meeting(other, |a, b| {
            if let Some(ends) = common_segment(a.corners, b.corners) {
                curve.push(CurveSegment { ends, ids: [a.id, b.id] });
            }
            ControlFlow::Continue(())
        });
        curve.sort_unstable_by_key(|c| c.ids);
        curve
    }

    /// Pairs of triangles of this scene that meet otherwise than in common corners and edges: by id, the smaller first.
    ///
    /// Corners are common if they are the same point of the world: neighbours of a mesh need not share vertices. Two triangles
    /// in the same place are a pair; so are an edge and a corner that lies on it (a T-junction). See [`Scene::intersects`].
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use glam::{DAffine3, Vec3};
    ///
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.2, 0.2, 0.0)];
    /// let mut builder = SceneBuilder::default();
    /// // Two halves of a square, and a third triangle that is folded onto the first.
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2], [1, 3, 2], [0, 1, 4]] }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let pairs = builder.build()?.self_intersections();
    /// assert_eq!(pairs.iter().map(|p| p.map(|id| id.primitive)).collect::<Vec<_>>(), [[0, 2]]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn self_intersections(&self) -> Vec<[HitId; 2]> {
        let mut found = Vec::new();
        let mut pairs = Touching(|a: &VisitedTriangle, b: &VisitedTriangle| {
            if meet_otherwise(a.corners, b.corners) {
                found.push([a.id.min(b.id), a.id.max(b.id)]);
            }
            ControlFlow::Continue(())
        });
        if let Some(cursor) = self.inner().cursor() {
            let _ = self.inner().pairs_in(&cursor, &mut pairs);
        }
        found.sort_unstable();
        found
    }

    /// The points of two scenes that are nearest to each other; of several pairs of triangles that are equally near, the
    /// smallest. `None` if either has no triangles.
    #[must_use]
    pub fn distance_between(&self, other: &Self) -> Option<Separation> {
        let mut nearest = Nearest(None);
        let _ = self.pairs(other, &mut nearest);
        nearest.0
    }

    fn meeting(
        &self,
        other: &Self,
        mut f: impl FnMut(&VisitedTriangle, &VisitedTriangle) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut pairs = Touching(
            |a: &VisitedTriangle, b: &VisitedTriangle| {
                if meet(a.corners, b.corners) { f(a, b) } else { ControlFlow::Continue(()) }
            },
        );
        self.pairs(other, &mut pairs)
    }

    fn pairs(&self, other: &Self, pairs: &mut dyn Pairs) -> ControlFlow<()> {
        match (self.inner().cursor(), other.inner().cursor()) {
            (Some(a), Some(b)) => self.inner().pairs(&a, other.inner(), &b, pairs),
            _ => ControlFlow::Continue(()),
        }
    }
}

impl Inner {
    /// What is below `a`, against what is below `b` of another scene: the larger box is entered first. No deeper than both
    /// trees together.
    fn pairs(&self, a: &Cursor, other: &Self, b: &Cursor, pairs: &mut dyn Pairs) -> ControlFlow<()> {
        if pairs.near(&a.bounds, &b.bounds).is_none() {
            return ControlFlow::Continue(());
        }
        let size = |c: &Cursor| c.bounds.extent().max_element();
        let (first, second) = if size(a) >= size(b) { (self.below(a), None) } else { (None, other.below(b)) };
        let (first, second) = match (first, second) {
            (None, None) if size(a) >= size(b) => (None, other.below(b)),
            (None, None) => (self.below(a), None),
            some => some,
        };
        let key = |a: &Cursor, b: &Cursor| pairs.near(&a.bounds, &b.bounds).unwrap_or(f64::INFINITY);
        if let Some(mut below) = first {
            below.sort_by_key(|child| key(child, b));
            return below.iter().try_for_each(|child| self.pairs(child, other, b, pairs));
        }
        if let Some(mut below) = second {
            below.sort_by_key(|child| key(a, child));
            return below.iter().try_for_each(|child| self.pairs(a, other, child, pairs));
        }
        self.leaf(a, false, &mut |x| {
            let bounds = Aabb::from_points(x.corners);
            if pairs.near(&bounds, &b.bounds).is_none() {
                return ControlFlow::Continue(());
            }
            other.leaf(b, false, &mut |y| match pairs.near(&bounds, &Aabb::from_points(y.corners)) {
                Some(_) => pairs.triangles(x, y),
                None => ControlFlow::Continue(()),
            })
        })
    }

    /// What is below a place, each pair once.
    fn pairs_in(&self, cursor: &Cursor, pairs: &mut dyn Pairs) -> ControlFlow<()> {
        let Some(below) = self.below(cursor) else {
            return self.leaf(cursor, false, &mut |x| {
                let bounds = Aabb::from_points(x.corners);
                self.leaf(cursor, false, &mut |y| {
                    let wanted = x.id < y.id && pairs.near(&bounds, &Aabb::from_points(y.corners)).is_some();
                    if wanted { pairs.triangles(x, y) } else { ControlFlow::Continue(()) }
                })
            });
        };
        for (i, a) in below.iter().enumerate() {
            self.pairs_in(a, pairs)?;
            for b in below.iter().skip(i + 1) {
                self.pairs(a, self, b, pairs)?;
            }
        }
        ControlFlow::Continue(())
    }
}
