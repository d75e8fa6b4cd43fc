//! Flat polygons with holes.

use glam::DVec3;

use super::common::{cast, finite, padded, unit};
use super::{Plane, Primitive, ShapeError, SurfaceHit};
use crate::{Aabb, Ray, Real, Vector3};

/// A flat polygon given by vertex loops; the last vertex of a loop joins the first.
///
/// A point is inside when a half-line from it crosses the loops an odd number of times (the even-odd rule): a loop
/// inside another is a hole, and loops may touch and cross. On the boundary a hit and a miss are both right, but
/// polygons that tile a plane leave no gap there and do not overlap.
///
/// The normal follows the right-hand rule on the first loop (Newell's method); it is `None` where that loop has no
/// orientation, as in a figure of eight. `u` and `v` run from 0 to 1 across the bounds of the two coordinates kept
/// when the one with the largest normal component is dropped, in the order x, y, z.
///
/// Error of `t`: that of [`Plane`].
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon<R: Real> {
    loops: Vec<Vec<R::Vec3>>,
    plane: Plane<R>,
    normal: Option<R::Vec3>,
    bounds: Aabb<R>,
    /// The two axes that are kept.
    kept: [usize; 2],
    /// Units of the edges: a power of two, so that their products stay in range.
    scale: R,
    edges: Vec<Edge<R>>,
}

/// An edge in the kept axes, its lower end first: both polygons at an edge see the same numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge<R> {
    low: [R; 2],
    high: [R; 2],
}

impl<R: Real> Edge<R> {
    /// `None` for an edge parallel to the scan line: the half-open rule never counts it.
    fn new(a: [R; 2], b: [R; 2]) -> Option<Self> {
        match (a[1] < b[1], b[1] < a[1]) {
            (true, _) => Some(Self { low: a, high: b }),
            (_, true) => Some(Self { low: b, high: a }),
            _ => None,
        }
    }

    /// Whether the scan line from `p` towards +x crosses the edge. Of the two ends the lower belongs to the edge, so
    /// that a line through a vertex counts right. The side is the sign of an orientation, not a computed crossing:
    /// a difference of two rounded products never has the wrong sign.
    fn crosses(&self, [x, y]: [R; 2]) -> bool {
        let ([ax, ay], [bx, by]) = (self.low, self.high);
        ay <= y && y < by && (bx - ax) * (y - ay) > (x - ax) * (by - ay)
    }
}

impl<R: Real> Polygon<R> {
    /// How far a vertex may lie off the plane, relative to the largest coordinate: 8 units of f32 in either
    /// arithmetic, since vertices come from f32 files or 7-digit decimals.
    pub const FLATNESS: f64 = 8.0 / (1_u32 << 24) as f64;

    /// A polygon from its loops; the first loop gives the normal.
    ///
    /// # Errors
    /// When a coordinate is not finite, a loop has fewer than 3 vertices, all vertices lie on a line, or a vertex lies
    /// off the common plane by more than [`Self::FLATNESS`].
    pub fn new(loops: Vec<Vec<R::Vec3>>) -> Result<Self, ShapeError> {
        if loops.is_empty() || loops.iter().any(|l| l.len() < 3) {
            return Err(ShapeError::Degenerate("a polygon loop needs at least 3 vertices"));
        }
        for &v in loops.iter().flatten() {
            finite::<R>("polygon vertex", v)?;
        }
        let bounds = Aabb::<R>::from_points(loops.iter().flatten().copied());
        let size = bounds.min.abs().max(bounds.max.abs()).max_element();

        // In f64, scaled so that nothing overflows.
        let unit_size = size.to_f64().power_of_two_below();
        let exact = |v: R::Vec3| v.to_f64() / unit_size;
        let origin = exact(loops[0][0]);
        let (newell, terms) = newell::<R>(&loops[0], exact);
        let oriented = newell.length() > 1e-10 * terms;
        let direction = if oriented { newell } else { widest::<R>(&loops, exact) };
        let direction = unit::<f64>(direction).ok_or(ShapeError::Degenerate("all vertices lie on a line"))?;

        let off = |v: &R::Vec3| (exact(*v) - origin).dot(direction).abs() * unit_size;
        let distance = loops.iter().flatten().map(off).fold(0.0, f64::max);
        let tolerance = Self::FLATNESS * size.to_f64();
        if !(distance <= tolerance) {
            return Err(ShapeError::NotPlanar { distance, tolerance });
        }

        let plane = Plane::new(loops[0][0], R::Vec3::from_f64(direction))?;
        let steepness = direction.abs();
        let kept = if steepness.x >= steepness.max_element() {
            [1, 2]
        } else if steepness.y >= steepness.max_element() {
            [0, 2]
        } else {
            [0, 1]
        };
        let scale = R::ONE / size.power_of_two_below();
        let flat = |v: R::Vec3| kept.map(|axis| v.axis(axis) * scale);
        let closed =
            |l: &Vec<R::Vec3>| l.iter().zip(l.iter().cycle().skip(1)).map(|(&a, &b)| (a, b)).collect::<Vec<_>>();
        let edges = loops.iter().flat_map(closed).filter_map(|(a, b)| Edge::new(flat(a), flat(b))).collect();
        let normal = oriented.then(|| plane.normal());
        Ok(Self { loops, plane, normal, bounds, kept, scale, edges })
    }

    /// The vertex loops as given.
    #[must_use]
    pub fn loops(&self) -> &[Vec<R::Vec3>] {
        &self.loops
    }

    /// The unit normal, if the first loop has an orientation.
    #[must_use]
    pub fn normal(&self) -> Option<R::Vec3> {
        self.normal
    }

    /// The same polygon in another arithmetic.
    ///
    /// # Errors
    /// When a vertex leaves the range of `S` or all fall onto a line.
    pub fn cast<S: Real>(&self) -> Result<Polygon<S>, ShapeError> {
        Polygon::new(self.loops.iter().map(|l| l.iter().map(|&v| cast::<R, S>(v)).collect()).collect())
    }

    /// Whether a point of the plane is inside, by the parity of the crossings of a half-line from it.
    #[must_use]
    pub fn contains(&self, point: R::Vec3) -> bool {
        let p = self.kept.map(|axis| point.axis(axis) * self.scale);
        self.edges.iter().fold(false, |inside, edge| inside != edge.crosses(p))
    }

    fn nearest(&self, ray: &Ray<R>) -> Option<R> {
        self.plane.nearest(ray).filter(|&t| self.contains(ray.at(t)))
    }
}

/// Newell's normal: twice the vector area of a loop, and the size of its terms. Exact zero terms of collinear
/// vertices do no harm, unlike the cross product of two chosen edges.
fn newell<R: Real>(vertices: &[R::Vec3], exact: impl Fn(R::Vec3) -> DVec3) -> (DVec3, f64) {
    let origin = exact(vertices[0]);
    let next = vertices.iter().cycle().skip(1);
    vertices.iter().zip(next).fold((DVec3::ZERO, 0.0), |(sum, terms), (&a, &b)| {
        let (a, b) = (exact(a) - origin, exact(b) - origin);
        (sum + a.cross(b), terms + a.length() * b.length())
    })
}

/// A normal of the plane of loops whose first has no area: from the vertex farthest from the first one and the vertex
/// farthest from the line through both. Zero when all lie on a line.
fn widest<R: Real>(loops: &[Vec<R::Vec3>], exact: impl Fn(R::Vec3) -> DVec3) -> DVec3 {
    let origin = exact(loops[0][0]);
    let arms = || loops.iter().flatten().map(|&v| exact(v) - origin);
    let longest = |a: DVec3, b: DVec3| if b.length_squared() > a.length_squared() { b } else { a };
    let axis = arms().fold(DVec3::ZERO, longest);
    let normal = arms().map(|v| axis.cross(v)).fold(DVec3::ZERO, longest);
    if normal.length() > 1e-10 * axis.length_squared() { normal } else { DVec3::ZERO }
}

impl<R: Real> Primitive<R> for Polygon<R> {
    fn bounds(&self) -> Aabb<R> {
        let pad = R::Vec3::splat(R::gamma(16) * (R::ONE / self.scale));
        padded(Aabb::new(self.bounds.min - pad, self.bounds.max + pad))
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        let t = self.nearest(ray)?;
        let p = ray.at(t);
        let [u, v] = self.kept.map(|axis| {
            let (low, high) = (self.bounds.min.axis(axis), self.bounds.max.axis(axis));
            ((p.axis(axis) - low) / (high - low)).max(R::ZERO).min(R::ONE)
        });
        Some(SurfaceHit::new(t, u, v, self.normal))
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Projects along the normal, as for a plane.
    fn refine(&self, point: R::Vec3, _: Option<R::Vec3>) -> (R::Vec3, R) {
        self.plane.project(point)
    }

    fn is_flat(&self) -> bool {
        true
    }
}
