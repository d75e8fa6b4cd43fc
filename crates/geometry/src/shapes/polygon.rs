//! Flat polygons with holes.

use glam::DVec3;

use super::common::{cast, finite, padded, unit};
use super::exact::{Coordinate, visit_roots};
use super::{ExactVisitor, Plane, Primitive, ShapeError, SurfaceHit};
use crate::exact::dyadic::Dyadic;
use crate::exact::number::{Ball, Number, cross, differences, dot, vector};
use crate::exact::quadratic::{Equation, Formula, Quadratic};
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
/// Error of `t`: that of [`Plane`]. At tier `Exact` the plane is the one in which all vertices lie exactly; if there is
/// none, that through the first vertex with the rounded normal, as at the other tiers.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon<R: Real> {
    loops: Vec<Vec<R::Vec3>>,
    plane: Plane<R>,
    /// Three vertices that span the plane, if all lie in it exactly.
    span: Option<[R::Vec3; 3]>,
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
        let (span, across) = widest::<R>(&loops, exact);
        let spanned = Spanned { corners: span.map(Vector3::to_f64) };
        let span = loops.iter().flatten().all(|v| spanned.contains(v.to_f64())).then_some(span);
        let direction = if oriented { newell } else { across };
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
        Ok(Self { loops, plane, span, normal, bounds, kept, scale, edges })
    }

    /// The vertex loops as given.
    #[must_use]
    pub fn loops(&self) -> &[Vec<R::Vec3>] {
        &self.loops
    }

    pub(super) fn plane(&self) -> &Plane<R> {
        &self.plane
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

    pub(super) fn hit(&self, ray: &Ray<R>, t: R) -> SurfaceHit<R> {
        let p = ray.at(t);
        let [u, v] = self.kept.map(|axis| {
            let (low, high) = (self.bounds.min.axis(axis), self.bounds.max.axis(axis));
            ((p.axis(axis) - low) / (high - low)).max(R::ZERO).min(R::ONE)
        });
        SurfaceHit::new(t, u, v, self.normal)
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

/// Three vertices far apart: the first, the farthest from it, and the farthest from the line through both; and a normal
/// of their plane, zero when all vertices lie on a line.
fn widest<R: Real>(loops: &[Vec<R::Vec3>], exact: impl Fn(R::Vec3) -> DVec3) -> ([R::Vec3; 3], DVec3) {
    let first = loops[0][0];
    let arm = |v: R::Vec3| exact(v) - exact(first);
    let largest = |measure: &dyn Fn(DVec3) -> DVec3| {
        let size = |v: R::Vec3| measure(arm(v)).length_squared();
        loops.iter().flatten().fold(first, |best, &v| if size(v) > size(best) { v } else { best })
    };
    let second = largest(&|v| v);
    let axis = arm(second);
    let third = largest(&|v| axis.cross(v));
    let normal = axis.cross(arm(third));
    let flat = normal.length() > 1e-10 * axis.length_squared();
    ([first, second, third], if flat { normal } else { DVec3::ZERO })
}

/// The plane of three points.
struct Spanned {
    corners: [DVec3; 3],
}

impl Spanned {
    fn normal<N: Number>(&self) -> [N; 3] {
        let [a, b, c] = self.corners;
        cross(&differences(b, a), &differences(c, a))
    }

    /// Whether a point lies in it, exactly.
    fn contains(&self, point: DVec3) -> bool {
        fn sign<N: Number>(plane: &Spanned, point: DVec3) -> Option<i32> {
            dot(&plane.normal::<N>(), &differences(point, plane.corners[0])).sign()
        }
        sign::<Ball>(self, point).or_else(|| sign::<Dyadic>(self, point)) == Some(0)
    }
}

/// The exact plane along a ray.
struct Along {
    ray: Ray<f64>,
    plane: ExactPlane,
}

enum ExactPlane {
    Spanned(Spanned),
    Given { point: DVec3, normal: DVec3 },
}

impl Equation for Along {
    fn coefficients<N: Number>(&self) -> [N; 3] {
        let (point, n) = match &self.plane {
            ExactPlane::Spanned(spanned) => (spanned.corners[0], spanned.normal::<N>()),
            ExactPlane::Given { point, normal } => (*point, vector(*normal)),
        };
        let offset = dot(&n, &differences(self.ray.origin, point));
        [N::new(0.0), dot(&n, &vector(self.ray.direction)), offset.twice()]
    }
}

/// On which side of an edge the hit point is: `(b - a) x (p - a)`, times `2 B`. The coordinates are those of the point.
struct Turn {
    from: [f64; 2],
    to: [f64; 2],
    coordinates: [Coordinate; 2],
}

impl Formula for Turn {
    fn value<N: Number>(&self, equation: &[N; 3]) -> N {
        let [x, y] = [0, 1].map(|i| self.coordinates[i].value(equation));
        let [dx, dy] = [0, 1].map(|i| N::difference(self.to[i], self.from[i]));
        dx.times(&y).minus(&x.times(&dy))
    }
}

impl<R: Real> Polygon<R> {
    /// [`Self::contains`] for the exact hit point.
    fn contains_hit(&self, equation: &Quadratic<Along>) -> bool {
        let ray = equation.equation().ray;
        let coordinate = |i: usize, from: f64| Coordinate {
            origin: ray.origin[self.kept[i]],
            direction: ray.direction[self.kept[i]],
            from,
        };
        let flip = equation.slope();
        let lies_below = |v: [f64; 2]| equation.sign(&coordinate(1, v[1])) * flip < 0;
        let flat = |v: &R::Vec3| self.kept.map(|axis| v.axis(axis).to_f64());
        let mut inside = false;
        for vertices in &self.loops {
            let mut a = flat(&vertices[vertices.len() - 1]);
            let mut a_above = lies_below(a);
            for v in vertices {
                let b = flat(v);
                let b_above = lies_below(b);
                if a_above != b_above {
                    // From the lower end, as the half-open rule has it, to the higher one.
                    let (from, to) = if b_above { (a, b) } else { (b, a) };
                    let coordinates = [coordinate(0, from[0]), coordinate(1, from[1])];
                    inside ^= equation.sign(&Turn { from, to, coordinates }) * flip > 0;
                }
                (a, a_above) = (b, b_above);
            }
        }
        inside
    }
}

impl<R: Real> Primitive<R> for Polygon<R> {
    fn bounds(&self) -> Aabb<R> {
        let pad = R::Vec3::splat(R::gamma(16) * (R::ONE / self.scale));
        padded(Aabb::new(self.bounds.min - pad, self.bounds.max + pad))
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray).map(|t| self.hit(ray, t))
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let plane = match self.span {
            Some(span) => ExactPlane::Spanned(Spanned { corners: span.map(Vector3::to_f64) }),
            None => ExactPlane::Given { point: self.plane.point().to_f64(), normal: self.plane.given().to_f64() },
        };
        let equation = Quadratic::new(Along { ray: ray.to_f64(), plane });
        visit_roots(&equation, ray, |_| self.contains_hit(&equation), |t| self.hit(ray, t), visit)
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
