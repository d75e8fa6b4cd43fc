//! The nearest points of shapes, placed by any affine map: what point queries ask.
//!
//! Shapes are mapped forwards, relative to the point that is asked about, so that what is near it keeps its digits wherever
//! the world's origin is.

use glam::{DAffine3, DMat3, DVec3};

use super::common::tangents;
use super::ellipsoid::{Axes, on_ellipse, on_ellipsoid};
use super::{Cuboid, Disk, Plane, Polygon, Quadric, QuadricKind, Shape, Solid, Sphere, SurfaceHit};
use crate::distance::{closest_on_segment, closest_on_triangle};
use crate::transform::{largest, similarity};
use crate::{Ray, Real};

/// The nearest point of a surface, and where on it that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestOnSurface {
    /// The point itself.
    pub point: DVec3,
    /// First surface parameter, as of a [`SurfaceHit`] there.
    pub u: f64,
    /// Second surface parameter.
    pub v: f64,
    /// Normal of the surface there, in the shape's own space: as of a [`SurfaceHit`].
    pub normal: Option<DVec3>,
}

impl ClosestOnSurface {
    fn new(point: DVec3, on: SurfaceHit<f64>) -> Self {
        Self { point, u: on.u, v: on.v, normal: on.normal }
    }
}

impl Shape<f64> {
    /// The point of the surface nearest to `point`. Of a closed shape too: from inside, the point of its boundary. `None` for
    /// shapes that have no such query: boxes without an end, paraboloids, hyperboloids, general quadrics, and quadrics
    /// that are cut otherwise than at two heights.
    ///
    /// Where several points are equally near (from the centre of a sphere) it is one of them. Error: some `u` times the
    /// largest coordinate of the shape as seen from the point.
    ///
    /// ```
    /// use firsthit_geometry::{Shape, shapes::Sphere};
    /// use glam::DVec3;
    /// let ball: Shape<f64> = Sphere::new(DVec3::X * 5.0, 2.0)?.into();
    /// let nearest = ball.closest_point(DVec3::ZERO).unwrap();
    /// assert_eq!((nearest.point, nearest.normal), (DVec3::X * 3.0, Some(DVec3::NEG_X)));
    /// # Ok::<(), firsthit_geometry::ShapeError>(())
    /// ```
    #[must_use]
    pub fn closest_point(&self, point: DVec3) -> Option<ClosestOnSurface> {
        let nearest = self.closest_to_origin(&DAffine3::from_translation(-point))?;
        Some(ClosestOnSurface { point: nearest.point + point, ..nearest })
    }

    /// The point nearest to the origin of the surface as `placed` by an affine map that can be inverted; a sphere becomes an
    /// ellipsoid, a box a parallelepiped. As [`Shape::closest_point`]; cylinders and cones only by maps that keep angles.
    ///
    /// ```
    /// use firsthit_geometry::{Shape, shapes::Sphere};
    /// use glam::{DAffine3, DVec3};
    /// let ball: Shape<f64> = Sphere::new(DVec3::ZERO, 1.0)?.into();
    /// let flat = DAffine3 { translation: DVec3::Z * 7.0, ..DAffine3::from_scale(DVec3::new(5.0, 5.0, 0.5)) };
    /// assert_eq!(ball.closest_to_origin(&flat).unwrap().point, DVec3::Z * 6.5);
    /// # Ok::<(), firsthit_geometry::ShapeError>(())
    /// ```
    #[must_use]
    pub fn closest_to_origin(&self, placed: &DAffine3) -> Option<ClosestOnSurface> {
        let nearest = match self {
            Self::Sphere(sphere) => sphere.closest(placed),
            Self::Plane(plane) => plane.closest(placed),
            Self::Disk(disk) => disk.closest(placed),
            Self::Polygon(polygon) => polygon.closest(placed),
            Self::Cuboid(cuboid) => cuboid.closest(placed)?,
            Self::Quadric(quadric) => quadric.closest(placed)?,
            Self::Solid(solid) => solid.closest(placed)?,
        };
        nearest.point.is_finite().then_some(nearest)
    }
}

/// A point of the placed shape in the shape's own space, for the parameters there.
fn own(placed: &DAffine3, point: DVec3) -> DVec3 {
    let k = largest(&placed.matrix3).power_of_two_below();
    (placed.matrix3 * (1.0 / k)).inverse() * ((point - placed.translation) / k)
}

/// A ray that is at a point where it begins.
fn at(point: DVec3) -> Ray<f64> {
    Ray::new(point, DVec3::ZERO)
}

impl Sphere<f64> {
    fn closest(&self, placed: &DAffine3) -> ClosestOnSurface {
        let (point, unit) = on_ellipsoid(placed.transform_point3(self.center()), placed.matrix3 * self.radius());
        let on = self.hit(&at(self.center() + unit * self.radius()), 0.0);
        ClosestOnSurface::new(point, SurfaceHit { normal: Some(unit), ..on })
    }
}

/// A normal of a placed plane, and a point of it.
fn placed_plane(plane: &Plane<f64>, placed: &DAffine3) -> (DVec3, DVec3) {
    let (t, b) = tangents::<f64>(plane.normal());
    let k = largest(&placed.matrix3).power_of_two_below();
    let across = |v: DVec3| placed.matrix3 * v / k;
    (across(t).cross(across(b)).normalize_or_zero(), placed.transform_point3(plane.point()))
}

impl Plane<f64> {
    fn closest(&self, placed: &DAffine3) -> ClosestOnSurface {
        let (normal, through) = placed_plane(self, placed);
        let point = normal * normal.dot(through);
        ClosestOnSurface::new(point, self.hit(&at(own(placed, point)), 0.0))
    }
}

impl Disk<f64> {
    fn closest(&self, placed: &DAffine3) -> ClosestOnSurface {
        let (t, b) = tangents::<f64>(self.normal());
        let center = placed.transform_point3(self.center());
        let axes = Axes::new([placed.matrix3 * (t * self.radius()), placed.matrix3 * (b * self.radius()), DVec3::ZERO]);
        // Along the axes of the rim, from the centre; the third is the normal's.
        let [x, y, _] = axes.coordinates(-center);
        let (a, b) = (axes.lengths[0], axes.lengths[1]);
        let (hole, far) = (self.inner_radius() / self.radius(), (x / a).hypot(y / b));
        let [x, y] = if far > 1.0 {
            on_ellipse([a, b], [x, y])
        } else if far < hole {
            on_ellipse([a * hole, b * hole], [x, y])
        } else {
            [x, y]
        };
        let point = center + axes.directions[0] * x + axes.directions[1] * y;
        let l = own(placed, point) - self.center();
        ClosestOnSurface::new(point, self.hit(0.0, l))
    }
}

impl Polygon<f64> {
    fn closest(&self, placed: &DAffine3) -> ClosestOnSurface {
        let (normal, through) = placed_plane(self.plane(), placed);
        let foot = normal * normal.dot(through);
        let own_foot = own(placed, foot);
        if self.contains(own_foot) {
            return ClosestOnSurface::new(foot, self.hit(&at(own_foot), 0.0));
        }
        // In the plane, where the vertices of a file lie only nearly.
        let flat = |v: &DVec3| {
            let v = placed.transform_point3(*v);
            v - normal * normal.dot(v - through)
        };
        let mut best = (f64::INFINITY, foot);
        for vertices in self.loops() {
            let mut from = vertices.last().map_or(foot, flat);
            for to in vertices.iter().map(flat) {
                let on = closest_on_segment::<f64>(from, to, DVec3::ZERO).point;
                if on.length_squared() < best.0 {
                    best = (on.length_squared(), on);
                }
                from = to;
            }
        }
        ClosestOnSurface::new(best.1, self.hit(&at(own(placed, best.1)), 0.0))
    }
}

impl Cuboid<f64> {
    fn closest(&self, placed: &DAffine3) -> Option<ClosestOnSurface> {
        let bounds = self.corners();
        if !bounds.is_finite() {
            return None;
        }
        let mut best = (f64::INFINITY, DVec3::ZERO, 0, false);
        for axis in 0..3 {
            for upper in [false, true] {
                // Each face as two triangles.
                let corner = |i: usize, j: usize| {
                    let mut side = [false; 3];
                    (side[axis], side[(axis + 1) % 3], side[(axis + 2) % 3]) = (upper, i == 1, j == 1);
                    let pick = |k: usize| if side[k] { bounds.max[k] } else { bounds.min[k] };
                    placed.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
                };
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                for triangle in [[a, b, c], [a, c, d]] {
                    let on = closest_on_triangle::<f64>(triangle, DVec3::ZERO).point;
                    if on.length_squared() < best.0 {
                        best = (on.length_squared(), on, axis, upper);
                    }
                }
            }
        }
        let (_, point, axis, upper) = best;
        Some(ClosestOnSurface::new(point, Self::face_hit(&bounds, &at(own(placed, point)), 0.0, axis, !upper)))
    }
}

/// A surface of revolution about the y axis: its side and its caps, as segments `(distance from the axis, y)`.
struct Profile {
    side: [DVec3; 2],
    /// Heights of the caps, `false` for one that is not there.
    caps: [bool; 2],
}

impl Profile {
    /// The nearest point to `p`, and which cap it is on.
    fn closest(&self, p: DVec3) -> (DVec3, Option<usize>) {
        let radius = p.x.hypot(p.z);
        let q = DVec3::new(radius, p.y, 0.0);
        let on = |[a, b]: [DVec3; 2]| closest_on_segment::<f64>(a, b, q).point;
        let mut best = (on(self.side), None);
        for (cap, rim) in self.side.into_iter().enumerate().filter(|(cap, _)| self.caps[*cap]) {
            let there = on([DVec3::Y * rim.y, rim]);
            if (there - q).length_squared() < (best.0 - q).length_squared() {
                best = (there, Some(cap));
            }
        }
        let (on, cap) = best;
        let (cos, sin) = if radius > 0.0 { (p.x / radius, p.z / radius) } else { (1.0, 0.0) };
        (DVec3::new(on.x * cos, on.y, on.x * sin), cap)
    }
}

impl Quadric<f64> {
    /// Its three radii, if it is a whole ellipsoid about the origin.
    fn radii(&self) -> Option<DVec3> {
        let [a, _, _, _, e, _, _, h, _, _] = self.coefficients();
        let whole = self.clip() == crate::Aabb::infinite();
        (self.kind() == QuadricKind::Ellipsoid && whole).then(|| DVec3::new(a, e, h).map(|c| 1.0 / c.sqrt()))
    }

    /// Of a cylinder or cone that is cut at two heights, as seen from a height.
    fn profile(&self, y: f64, closed: bool) -> Option<Profile> {
        let (clip, [.., e, _, g, _, _, j]) = (self.clip(), self.coefficients());
        let all_around = [clip.min.x, clip.min.z, -clip.max.x, -clip.max.z].iter().all(|&c| c == f64::NEG_INFINITY);
        let (low, high) = (clip.min.y, clip.max.y);
        if !all_around {
            return None;
        }
        let side = match self.kind() {
            QuadricKind::Cylinder => {
                let radius = (-j).sqrt();
                // Where it has no end, beyond what may be nearest.
                let low = if low.is_finite() { low } else { y.min(high) - radius };
                let high = if high.is_finite() { high } else { y.max(low) + radius };
                [DVec3::new(radius, low, 0.0), DVec3::new(radius, high, 0.0)]
            }
            QuadricKind::Cone => {
                // As far as can be told from its coefficients, the apex is one of the ends.
                let apex = -g / e;
                let height = high - low;
                let near = |end: f64| (apex - end).abs() <= 1e-9 * height;
                let radius = (-e).sqrt() * height;
                match (near(low), near(high)) {
                    (true, false) => [DVec3::new(0.0, low, 0.0), DVec3::new(radius, high, 0.0)],
                    (false, true) => [DVec3::new(radius, low, 0.0), DVec3::new(0.0, high, 0.0)],
                    _ => return None,
                }
            }
            _ => return None,
        };
        Some(Profile { side, caps: [closed && low.is_finite(), closed && high.is_finite()] })
    }

    fn closest(&self, placed: &DAffine3) -> Option<ClosestOnSurface> {
        self.closest_of(placed, false)
    }

    /// Of the surface, or of the body that it is the side of.
    fn closest_of(&self, placed: &DAffine3, closed: bool) -> Option<ClosestOnSurface> {
        if let Some(radii) = self.radii() {
            let (point, unit) = on_ellipsoid(placed.translation, placed.matrix3 * DMat3::from_diagonal(radii));
            return Some(ClosestOnSurface::new(point, self.on(unit * radii)));
        }
        let scale = similarity(&placed.matrix3)?;
        let p = placed.matrix3.transpose() * (-placed.translation / scale) / scale;
        let (q, cap) = self.profile(p.y, closed)?.closest(p);
        let on = match cap {
            None => self.on(q),
            Some(cap) => Cuboid::face_hit(&self.solid_bounds(), &at(q), 0.0, 1, cap == 0),
        };
        Some(ClosestOnSurface::new(placed.transform_point3(q), on))
    }
}

impl Solid<f64> {
    fn closest(&self, placed: &DAffine3) -> Option<ClosestOnSurface> {
        self.surface().closest_of(placed, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, Primitive};
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0f64, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from)
    }

    /// Numbers from 0 to 1, ends and middle among them.
    fn part() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), Just(0.5), Just(1.0), 0.0..1.0f64]
    }

    /// A shape, and the point of it with two parameters.
    type Case = (Shape<f64>, Box<dyn Fn(f64, f64) -> DVec3>);

    fn around(angle: f64) -> (f64, f64) {
        (angle * core::f64::consts::TAU).sin_cos()
    }

    fn ball(u: f64, v: f64) -> DVec3 {
        let ((sin, cos), (y, r)) = (around(u), (core::f64::consts::PI * v).sin_cos());
        DVec3::new(cos * y, r, sin * y)
    }

    /// Side, then caps: `v` up to a third, two thirds, 1.
    fn turned([r0, r1]: [f64; 2], [y0, y1]: [f64; 2], caps: bool) -> Box<dyn Fn(f64, f64) -> DVec3> {
        Box::new(move |u, v| {
            let (sin, cos) = around(u);
            let (r, y) = match (v * 3.0, caps) {
                (v, true) if v < 1.0 => (r0 * v, y0),
                (v, true) if v > 2.0 => (r1 * (v - 2.0), y1),
                (v, true) => (r0 + (r1 - r0) * (v - 1.0), y0 + (y1 - y0) * (v - 1.0)),
                _ => (r0 + (r1 - r0) * v, y0 + (y1 - y0) * v),
            };
            DVec3::new(cos * r, y, sin * r)
        })
    }

    fn cases(c: DVec3, n: DVec3, r: f64, part: f64) -> Vec<Case> {
        let n = n.normalize_or(DVec3::Y);
        let (t, b) = tangents::<f64>(n);
        let radii = DVec3::new(r, r * part + 0.01, r * 0.5 + 0.3);
        let (low, high) = (c - radii, c + radii);
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let loops = [r, r * 0.5].map(|r| square.map(|[x, y]| c + t * (x * r) + b * (y * r)).to_vec()).to_vec();
        let frame = move |u: f64, v: f64| {
            // Around the square, from the rim of the hole out.
            let (side, along) = ((u * 4.0).floor().min(3.0), u * 4.0 - (u * 4.0).floor().min(3.0));
            let ([x0, y0], [x1, y1]) = (square[side as usize], square[(side as usize + 1) % 4]);
            let (x, y) = (x0 + (x1 - x0) * along, y0 + (y1 - y0) * along);
            let r = r * (0.5 + 0.5 * v);
            c + t * (x * r) + b * (y * r)
        };
        let cylinder = Quadric::cylinder(r, c.y, c.y + 1.0).unwrap();
        let cone = Quadric::cone(r, c.y, c.y + 1.5 - 3.0 * part.round()).unwrap();
        let (base, apex) = (c.y, c.y + 1.5 - 3.0 * part.round());
        vec![
            (Sphere::new(c, r).unwrap().into(), Box::new(move |u, v| c + ball(u, v) * r)),
            (Plane::new(c, n).unwrap().into(), Box::new(move |u, v| c + t * (9.0 * u - 4.5) + b * (9.0 * v - 4.5))),
            (
                Disk::new(c, n, r, r * part * 0.9).unwrap().into(),
                Box::new(move |u, v| {
                    let (sin, cos) = around(u);
                    c + (t * cos + b * sin) * (r * (part * 0.9 + (1.0 - part * 0.9) * v))
                }),
            ),
            (Polygon::new(loops).unwrap().into(), Box::new(frame)),
            (
                Cuboid::new(low, high).unwrap().into(),
                Box::new(move |u, v| {
                    let face = (u * 6.0).floor().min(5.0);
                    let mut p = DVec3::splat(v) * radii * 2.0 + low;
                    let axis = face as usize / 2;
                    p[(axis + 1) % 3] = low[(axis + 1) % 3] + (u * 6.0 - face) * 2.0 * radii[(axis + 1) % 3];
                    p[axis] = if (face as usize).is_multiple_of(2) { low[axis] } else { high[axis] };
                    p
                }),
            ),
            (Quadric::ellipsoid(radii).unwrap().into(), Box::new(move |u, v| ball(u, v) * radii)),
            (Solid::new(Quadric::ellipsoid(radii).unwrap()).into(), Box::new(move |u, v| ball(u, v) * radii)),
            (cylinder.into(), turned([r, r], [c.y, c.y + 1.0], false)),
            (Solid::new(cylinder).into(), turned([r, r], [c.y, c.y + 1.0], true)),
            (cone.into(), turned([r, 0.0], [base, apex], false)),
            (Solid::new(cone).into(), turned([r, 0.0], [base, apex], true)),
        ]
    }

    fn map() -> impl Strategy<Value = DMat3> {
        let stretch = prop::sample::select(vec![
            DVec3::ONE,
            DVec3::splat(-2.5),
            DVec3::new(1.0, 1.0, 0.1),
            DVec3::new(-3.0, 0.5, 1.0),
            DVec3::new(1e-4, 1.0, 1.0),
        ]);
        (stretch, vector(), -3.0..3.0f64, any::<bool>()).prop_map(|(stretch, axis, angle, sheared)| {
            let turn = DMat3::from_axis_angle(axis.normalize_or(DVec3::X), angle);
            let m = turn * DMat3::from_diagonal(stretch);
            if sheared && stretch.x != stretch.y { m * turn } else { m }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// The point is one of the surface (parameters tell it too), and no other is nearer.
        #[test]
        fn nothing_of_a_shape_is_nearer(
            (c, n, r, hole) in (vector(), vector(), 0.1..1.0f64, part()), linear in map(), (a, b) in (part(), part()),
            off in vector(), distance in prop::sample::select(vec![0.0, 1e-9, 0.01, 0.3, 1.0, 10.0, 1e6]),
        ) {
            for (shape, surface) in cases(c, n, r, hole) {
                let kind = shape.kind();
                // From a point of the surface so far on.
                let from = linear * surface(a, b) + off * distance;
                let placed = DAffine3 { matrix3: linear, translation: -from };
                let Some(nearest) = shape.closest_to_origin(&placed) else {
                    prop_assert!(["cylinder", "cone"].contains(&kind) && similarity(&linear).is_none(), "{kind}");
                    continue;
                };
                let size = 1.0 + from.length();
                let found = nearest.point.length();
                prop_assert!(found <= off.length() * distance + 1e-14 * size, "{kind}: {found}");
                for i in 0..=24 {
                    for k in 0..=24 {
                        let p = placed.transform_point3(surface(f64::from(i) / 24.0, f64::from(k) / 24.0));
                        prop_assert!(p.length() >= found - 1e-14 * size, "{kind}: {} instead of {found}", p.length());
                    }
                }
                let own = own(&placed, nearest.point);
                let (refined, error) = shape.refine(own, nearest.normal);
                let room = error + 1e-12 * (size + own.length());
                let thick = largest(&linear.inverse());
                prop_assert!((refined - own).length() <= room * thick.max(1.0), "{kind}: {own} is not on the surface");
                prop_assert!(shape.bounds().min.cmple(own + room * thick).all() && own.cmple(shape.bounds().max + room * thick).all());
                // An apex has none.
                let apex = kind == "cone" && own.x.hypot(own.z) < 1e-14 * size;
                prop_assert!(nearest.normal.map_or(apex, |n| (n.length() - 1.0).abs() < 1e-12), "{kind}: {:?} at {own}", nearest.normal);
                // Off an edge, the way there is along the normal.
                if kind == "sphere" || kind == "ellipsoid" || kind == "plane" {
                    let normal = (linear.inverse().transpose() * nearest.normal.unwrap()).normalize();
                    let along = normal.cross(nearest.point).length();
                    prop_assert!(along <= 1e-7 * (thick * size + nearest.point.length()), "{kind}: {along}");
                }
            }
        }
    }

    #[test]
    fn what_has_no_nearest_points_says_so() {
        let shapes: [Shape<f64>; 6] = [
            Cuboid::new(DVec3::NEG_INFINITY, DVec3::ZERO).unwrap().into(),
            Quadric::paraboloid(1.0, 1.0).unwrap().into(),
            Quadric::hyperboloid_one(1.0, 1.0, -1.0, 1.0).unwrap().into(),
            Quadric::hyperboloid_two(1.0, 1.0, -2.0, 2.0).unwrap().into(),
            Quadric::cylinder(1.0, 0.0, 1.0).unwrap().with_clip(Aabb::new(DVec3::ZERO, DVec3::ONE)).unwrap().into(),
            Quadric::cone(1.0, 0.0, 1.0).unwrap().with_clip(Aabb::infinite()).unwrap().into(),
        ];
        assert!(shapes.iter().all(|shape| shape.closest_point(DVec3::ONE).is_none()));
        let endless: Shape<f64> = Quadric::cylinder(1.0, f64::NEG_INFINITY, f64::INFINITY).unwrap().into();
        let nearest = endless.closest_point(DVec3::new(3.0, 1e7, 4.0)).unwrap();
        assert!((nearest.point - DVec3::new(0.6, 1e7, 0.8)).length() < 1e-8, "{nearest:?}");
    }
}
