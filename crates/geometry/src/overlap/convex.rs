//! What lies in all of some half-spaces.

use glam::DVec3;

use super::Region;
use crate::Aabb;
use crate::clip::HalfSpace;
use crate::frustum::Containment;

/// Corners of what is left of a triangle.
type Polygon = smallvec::SmallVec<[DVec3; 16]>;

/// The points in all of some half-spaces: a convex region, which may be unbounded. Of no half-spaces, all of space.
///
/// What meets it is found by clipping, so for triangles the answer is exact but for rounding. (That for boxes is not: a large
/// box beside an edge may be called intersecting.)
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Convex {
    /// All of these.
    pub half_spaces: Vec<HalfSpace<f64>>,
}

impl Convex {
    /// Room for rounding: what is not farther beyond a plane is in it.
    fn room(h: &HalfSpace<f64>, size: f64) -> f64 {
        32.0 * f64::EPSILON * (h.normal.abs().element_sum() * size + h.offset.abs())
    }
}

impl Convex {
    /// The polygon that is left of a triangle (Sutherland and Hodgman, *CACM* 17(1), 1974): each plane may add a corner. What is
    /// not farther beyond a plane than some roundings is left too.
    pub(crate) fn clipped(&self, corners: [DVec3; 3]) -> Polygon {
        let size = corners.iter().fold(self.size(), |m, p| m.max(p.abs().max_element()));
        let mut polygon = Polygon::from_slice(&corners);
        for h in &self.half_spaces {
            let room = Self::room(h, size);
            let out = |p: DVec3| h.signed_distance(p) - room;
            let before = core::mem::take(&mut polygon);
            let Some(&last) = before.last() else { break };
            let mut from = (last, out(last));
            for &p in &before {
                let to = (p, out(p));
                if (from.1 <= 0.0) != (to.1 <= 0.0) {
                    polygon.push(from.0.lerp(to.0, from.1 / (from.1 - to.1)));
                }
                if to.1 <= 0.0 {
                    polygon.push(p);
                }
                from = to;
            }
        }
        polygon
    }
}

impl Region for Convex {
    fn is_valid(&self) -> bool {
        self.half_spaces.iter().all(|h| h.normal.is_finite() && h.offset.is_finite())
    }
    fn size(&self) -> f64 {
        let far = |h: &HalfSpace<f64>| h.offset.abs() / h.normal.abs().max_element();
        self.half_spaces.iter().map(far).filter(|d| d.is_finite()).fold(0.0, f64::max)
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        let mut inside = true;
        for h in &self.half_spaces {
            let upper = h.normal.cmpgt(DVec3::ZERO);
            // The corners that lie deepest and farthest out.
            let deepest = DVec3::select(upper, bounds.min, bounds.max);
            let farthest = DVec3::select(upper, bounds.max, bounds.min);
            if h.signed_distance(deepest) > 0.0 {
                return Containment::Outside;
            }
            inside &= h.contains(farthest);
        }
        if inside { Containment::Inside } else { Containment::Intersecting }
    }
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        !self.clipped(corners).is_empty()
    }
}
