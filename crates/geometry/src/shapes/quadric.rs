//! Quadric surfaces: one equation for cylinder, cone, ellipsoid, paraboloid and hyperboloids.

use super::common::{cast, finite_number, longitude, padded, positive, unit};
use super::exact::{in_box, visit_roots};
use super::quadric_bounds::{region_bounds, surface_bounds};
use super::{ExactVisitor, Primitive, ShapeError, SurfaceHit};
use crate::exact::number::{Number, dot, vector};
use crate::exact::quadratic::{Equation, Quadratic};
use crate::quadratic::{first_admitted, roots};
use crate::{Aabb, Ray, Real, Vector3};

/// Which surface a quadric was made as; decides nothing but its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum QuadricKind {
    /// Given by its coefficients.
    #[default]
    General,
    /// [`Quadric::cylinder`]
    Cylinder,
    /// [`Quadric::cone`]
    Cone,
    /// [`Quadric::ellipsoid`]
    Ellipsoid,
    /// [`Quadric::paraboloid`]
    Paraboloid,
    /// [`Quadric::hyperboloid_one`]
    HyperboloidOne,
    /// [`Quadric::hyperboloid_two`]
    HyperboloidTwo,
}

impl QuadricKind {
    /// The name, as scene files spell it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::General => "quadric",
            Self::Cylinder => "cylinder",
            Self::Cone => "cone",
            Self::Ellipsoid => "ellipsoid",
            Self::Paraboloid => "paraboloid",
            Self::HyperboloidOne => "hyperboloid-one",
            Self::HyperboloidTwo => "hyperboloid-two",
        }
    }
}

/// The surface `p^T Q p = 0`, `p = (x, y, z, 1)`, cut to a closed clip box (all of space at first).
///
/// The symmetric 4x4 matrix `Q` is given by its upper triangle `A..J`:
///
/// ```text
/// A x^2 + 2B xy + 2C xz + 2D x + E y^2 + 2F yz + 2G y + H z^2 + 2I z + J = 0
/// ```
///
/// so `B, C, D, F, G, I` are *half* the mixed and linear coefficients of the polynomial. The normal is the unit
/// gradient: it points out of a closed surface whose inside makes the polynomial negative, as the constructors here do,
/// and does not exist at an apex. `u` is the longitude about the +Y axis through the origin (0..1, counter-clockwise
/// from +X seen from +Y); `v` is y, from 0 to 1 across the bounds where those are finite. A line in the surface (a
/// generator of a cone) misses it. To close the surface by caps see [`Solid`](super::Solid).
///
/// Error of `t`: `16 kappa u` relative, `kappa` the condition of the root. The equation is solved from the point of the
/// ray where its terms are smallest, in units of the surface's size, or the constant term would lose its digits far away.
/// Exactly, the surface is that of the coefficients as they are stored; the named constructors round those once or twice.
///
/// ```
/// use firsthit_geometry::{Primitive, Ray, shapes::Quadric};
/// use glam::DVec3;
/// let tube = Quadric::cylinder(1.0, -2.0, 2.0)?;
/// assert!(tube.any_hit(&Ray::new(DVec3::new(5.0, 1.0, 0.0), DVec3::NEG_X)));
/// assert!(!tube.any_hit(&Ray::new(DVec3::new(5.0, 3.0, 0.0), DVec3::NEG_X)));
/// # Ok::<(), firsthit_geometry::ShapeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadric<R: Real> {
    kind: QuadricKind,
    coefficients: [R; 10],
    clip: Aabb<R>,
    bounds: Aabb<R>,
    /// About the size of the surface, a power of two.
    size: R,
    /// The form in units of `size`, scaled by a power of two so that its largest coefficient is about 1.
    form: Form<R>,
}

/// The quadratic form `p.Mp + 2 g.p + j`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Form<R: Real> {
    rows: [R::Vec3; 3],
    g: R::Vec3,
    j: R,
    /// How strongly each coordinate enters: the absolute row sums of `M`, and `g`.
    weights: R::Vec3,
}

impl<R: Real> Form<R> {
    fn new([a, b, c, d, e, f, g, h, i, j]: [R; 10]) -> Self {
        let rows = [R::Vec3::new(a, b, c), R::Vec3::new(b, e, f), R::Vec3::new(c, f, h)];
        let row_sums = rows.map(|r| r.abs().dot(R::Vec3::splat(R::ONE)));
        let g = R::Vec3::new(d, g, i);
        let weights = R::Vec3::new(row_sums[0], row_sums[1], row_sums[2]) + g.abs();
        Self { rows, g, j, weights }
    }

    fn linear(&self, v: R::Vec3) -> R::Vec3 {
        R::Vec3::new(self.rows[0].dot(v), self.rows[1].dot(v), self.rows[2].dot(v))
    }

    /// Half the gradient at `p`.
    fn half_gradient(&self, p: R::Vec3) -> R::Vec3 {
        self.linear(p) + self.g
    }

    fn value(&self, p: R::Vec3) -> R {
        p.dot(self.linear(p) + self.g * R::TWO) + self.j
    }

    /// The sum of the absolute values of the terms of [`Self::value`].
    fn magnitude(&self, p: R::Vec3) -> R {
        Self { rows: self.rows.map(R::Vec3::abs), g: self.g.abs(), j: self.j.abs(), ..*self }.value(p.abs())
    }

    /// The parameter of the point of a line where the terms of the form are about smallest: nearest to the origin, with
    /// each coordinate weighed by its part in the form. (By plain distance a flat surface - an ellipsoid with one small
    /// radius - would lose digits: the point nearest the origin may lie many thicknesses off.)
    fn calmest(&self, origin: R::Vec3, direction: R::Vec3) -> R {
        let (w, d) = (self.weights, direction);
        let weighted = R::Vec3::new(w.x() * d.x(), w.y() * d.y(), w.z() * d.z());
        let t = -(origin.dot(weighted) / direction.dot(weighted));
        // Where no coordinate that changes along the line enters at all, any point is as good.
        if t.is_finite() { t } else { R::ZERO }
    }

    /// `a`, `b`, `c` of the restriction `a t^2 + 2 b t + c` to a line.
    fn along(&self, origin: R::Vec3, direction: R::Vec3) -> [R; 3] {
        let gradient = self.half_gradient(origin);
        let c = origin.dot(gradient + self.g) + self.j;
        [direction.dot(self.linear(direction)), direction.dot(gradient), c]
    }
}

/// A ray in the units of the form: started where its terms are small and with a direction of about unit length.
pub(super) struct LocalLine<R: Real> {
    origin: R::Vec3,
    direction: R::Vec3,
    /// The ray's parameter is `(shift + t) * scale`.
    shift: R,
    scale: R,
}

impl<R: Real> Quadric<R> {
    /// The unclipped surface from the coefficients `A..J` (see the type).
    ///
    /// # Errors
    /// When a number is not finite or all of `A..I` are zero.
    pub fn new(coefficients: [R; 10]) -> Result<Self, ShapeError> {
        for c in coefficients {
            finite_number("quadric coefficient", c)?;
        }
        if coefficients[..9].iter().all(|&c| c == R::ZERO) {
            return Err(ShapeError::Degenerate("all coefficients of the quadric are zero"));
        }
        let (size, scaled) = normalized(coefficients.map(R::to_f64));
        let clip = Aabb::<R>::infinite();
        Ok(Self {
            kind: QuadricKind::General,
            coefficients,
            clip,
            bounds: surface_bounds(coefficients, clip),
            size: R::from_f64(size),
            form: Form::new(scaled.map(R::from_f64)),
        })
    }

    /// The same surface cut to a closed box; bounds may be infinite. Replaces an earlier clip.
    ///
    /// # Errors
    /// When a bound is NaN or the box is empty.
    pub fn with_clip(self, clip: Aabb<R>) -> Result<Self, ShapeError> {
        for v in [clip.min, clip.max] {
            if (0..3).any(|i| v.axis(i).is_nan()) {
                return Err(ShapeError::NotFinite { what: "clip bound", value: f64::NAN });
            }
        }
        if clip.is_empty() {
            return Err(ShapeError::Degenerate("the clip box is empty"));
        }
        Ok(Self { clip, bounds: surface_bounds(self.coefficients, clip), ..self })
    }

    fn named(self, kind: QuadricKind) -> Self {
        Self { kind, ..self }
    }

    /// Cut at two heights.
    fn between(self, y_min: R, y_max: R) -> Result<Self, ShapeError> {
        let clip = Aabb::<R>::infinite();
        self.with_clip(Aabb::new(clip.min.with_axis(1, y_min), clip.max.with_axis(1, y_max)))
    }

    /// From the coefficients of `x^2`, `y^2`, `z^2`, `2 y` and 1.
    fn upright([a, e, h, g, j]: [R; 5]) -> Result<Self, ShapeError> {
        let o = R::ZERO;
        Self::new([a, o, o, o, e, o, g, h, o, j])
    }

    /// An open cylinder about the y axis.
    ///
    /// # Errors
    /// When a number is not finite (the heights may be infinite), the radius is not positive or `y_min > y_max`.
    pub fn cylinder(radius: R, y_min: R, y_max: R) -> Result<Self, ShapeError> {
        let r = positive("radius", radius)?;
        Ok(Self::upright([R::ONE, R::ZERO, R::ONE, R::ZERO, -(r * r)])?
            .between(y_min, y_max)?
            .named(QuadricKind::Cylinder))
    }

    /// An open cone about the y axis: `radius` at height `y_base`, apex at `y_apex` (above or below).
    ///
    /// # Errors
    /// When a number is not finite, the radius is not positive or base and apex coincide.
    pub fn cone(radius: R, y_base: R, y_apex: R) -> Result<Self, ShapeError> {
        let r = positive("radius", radius)?;
        let height = finite_number("height of the cone", y_apex - y_base)?;
        if height == R::ZERO {
            return Err(ShapeError::Degenerate("base and apex of the cone coincide"));
        }
        let k = (r / height) * (r / height);
        let cone = Self::upright([R::ONE, -k, R::ONE, k * y_apex, -(k * y_apex * y_apex)])?;
        Ok(cone.between(y_base.min(y_apex), y_base.max(y_apex))?.named(QuadricKind::Cone))
    }

    /// An ellipsoid about the origin.
    ///
    /// # Errors
    /// When a radius is not finite or not positive.
    pub fn ellipsoid(radii: R::Vec3) -> Result<Self, ShapeError> {
        let mut inverse_squares = [R::ZERO; 3];
        for (axis, c) in inverse_squares.iter_mut().enumerate() {
            let r = positive("radius", radii.axis(axis))?;
            *c = R::ONE / (r * r);
        }
        let [a, e, h] = inverse_squares;
        Ok(Self::upright([a, e, h, R::ZERO, -R::ONE])?.named(QuadricKind::Ellipsoid))
    }

    /// An open paraboloid of revolution: vertex at the origin, `radius` at height `height` (may be negative).
    ///
    /// # Errors
    /// When a number is not finite, the radius is not positive or the height is zero.
    pub fn paraboloid(radius: R, height: R) -> Result<Self, ShapeError> {
        let r = positive("radius", radius)?;
        if finite_number("height", height)? == R::ZERO {
            return Err(ShapeError::Degenerate("the height of the paraboloid is zero"));
        }
        let bowl = Self::upright([R::ONE, R::ZERO, R::ONE, -(r * r / height) * R::HALF, R::ZERO])?;
        Ok(bowl.between(height.min(R::ZERO), height.max(R::ZERO))?.named(QuadricKind::Paraboloid))
    }

    /// An open hyperboloid of one sheet (a cooling tower): `(x^2 + z^2) / radius^2 - y^2 / rise^2 = 1`, so `radius` is
    /// that of the waist at y = 0, and at `y = rise` it has grown by the factor sqrt(2).
    ///
    /// # Errors
    /// When a number is not finite (the heights may be infinite) or not positive, or `y_min > y_max`.
    pub fn hyperboloid_one(radius: R, rise: R, y_min: R, y_max: R) -> Result<Self, ShapeError> {
        let (a, e) = (positive("radius", radius)?, positive("rise", rise)?);
        let k = (a / e) * (a / e);
        let tower = Self::upright([R::ONE, -k, R::ONE, R::ZERO, -(a * a)])?;
        Ok(tower.between(y_min, y_max)?.named(QuadricKind::HyperboloidOne))
    }

    /// An open hyperboloid of two sheets (two bowls): `y^2 / rise^2 - (x^2 + z^2) / radius^2 = 1`, with vertices at
    /// `y = -rise` and `y = rise`; far off it nears the cone of that slope.
    ///
    /// # Errors
    /// When a number is not finite (the heights may be infinite) or not positive, or `y_min > y_max`.
    pub fn hyperboloid_two(radius: R, rise: R, y_min: R, y_max: R) -> Result<Self, ShapeError> {
        let (a, e) = (positive("radius", radius)?, positive("rise", rise)?);
        let k = (a / e) * (a / e);
        let bowls = Self::upright([R::ONE, -k, R::ONE, R::ZERO, a * a])?;
        Ok(bowls.between(y_min, y_max)?.named(QuadricKind::HyperboloidTwo))
    }

    /// The coefficients `A..J`.
    #[must_use]
    pub fn coefficients(&self) -> [R; 10] {
        self.coefficients
    }

    /// The clip box, infinite where the surface is not cut.
    #[must_use]
    pub fn clip(&self) -> Aabb<R> {
        self.clip
    }

    /// What it was made as.
    #[must_use]
    pub fn kind(&self) -> QuadricKind {
        self.kind
    }

    /// The same surface in another arithmetic.
    ///
    /// # Errors
    /// When a coefficient leaves the range of `S`.
    pub fn cast<S: Real>(&self) -> Result<Quadric<S>, ShapeError> {
        let surface = Quadric::new(self.coefficients.map(|c| S::from_f64(c.to_f64())))?;
        let clip = Aabb::new(cast::<R, S>(self.clip.min), cast::<R, S>(self.clip.max));
        Ok(surface.with_clip(clip)?.named(self.kind))
    }

    /// Where the whole line meets the unclipped surface, ascending, by the shortest formula.
    ///
    /// The constant term carries an error of `u` times the sum of its terms, which grow with the square of the distance
    /// from the origin.
    #[inline]
    #[must_use]
    pub fn roots_fast(&self, ray: &Ray<R>) -> Option<[R; 2]> {
        let [a, b, c] = Form::new(self.coefficients).along(ray.origin, ray.direction);
        roots(a, b, c)
    }

    /// The ray as the stable solution sees it.
    #[inline]
    pub(super) fn local(&self, ray: &Ray<R>) -> LocalLine<R> {
        let speed = ray.direction.abs().max_element().power_of_two_below();
        let direction = ray.direction * (R::ONE / speed);
        let origin = ray.origin * (R::ONE / self.size);
        let shift = self.form.calmest(origin, direction);
        LocalLine { origin: origin + direction * shift, direction, shift, scale: self.size / speed }
    }

    /// `a`, `b`, `c` of the equation `a t^2 + 2 b t + c = 0` along the local line.
    #[inline]
    pub(super) fn local_equation(&self, line: &LocalLine<R>) -> [R; 3] {
        self.form.along(line.origin, line.direction)
    }

    /// The ray's parameter of a local one.
    #[inline]
    pub(super) fn parameter(line: &LocalLine<R>, t: R) -> R {
        (line.shift + t) * line.scale
    }

    /// The point at a local parameter, in units of `size`.
    #[inline]
    fn local_point(line: &LocalLine<R>, t: R) -> R::Vec3 {
        line.origin + line.direction * t
    }

    /// `t` and the hit point in units of `size`.
    fn nearest(&self, ray: &Ray<R>) -> Option<(R, R::Vec3)> {
        if !ray.is_valid() {
            return None;
        }
        let line = self.local(ray);
        let [a, b, c] = self.local_equation(&line);
        roots(a, b, c)?.into_iter().find_map(|t| {
            let p = Self::local_point(&line, t);
            let t = Self::parameter(&line, t);
            (ray.contains(t) && t.is_finite() && self.clip.contains(p * self.size)).then_some((t, p))
        })
    }

    /// The box around the part of the clip box where the form is negative.
    pub(super) fn solid_bounds(&self) -> Aabb<R> {
        let b = region_bounds(self.coefficients.map(R::to_f64), self.clip.to_f64());
        Aabb::new(R::Vec3::from_f64(b.min), R::Vec3::from_f64(b.max))
    }

    /// The hit at a local point.
    fn surface_hit(&self, t: R, local_point: R::Vec3) -> SurfaceHit<R> {
        let normal = unit::<R>(self.form.half_gradient(local_point));
        let p = local_point * self.size;
        let (low, height) = (self.bounds.min.y(), self.bounds.max.y() - self.bounds.min.y());
        let v = if height.is_finite() && height > R::ZERO { (p.y() - low) / height } else { p.y() };
        SurfaceHit::new(t, longitude::<R>(p), v, normal)
    }

    /// What a hit at a point of the surface says of it.
    pub(super) fn on(&self, point: R::Vec3) -> SurfaceHit<R> {
        self.surface_hit(R::ZERO, point * (R::ONE / self.size))
    }

    /// The hit at a parameter of the local line.
    pub(super) fn hit_at(&self, line: &LocalLine<R>, t: R, local_t: R) -> SurfaceHit<R> {
        self.surface_hit(t, Self::local_point(line, local_t))
    }
}

/// The form along a line, from the coefficients and the origin as they are given.
pub(super) struct OnQuadric {
    pub(super) ray: Ray<f64>,
    coefficients: [f64; 10],
}

impl Equation for OnQuadric {
    fn coefficients<N: Number>(&self) -> [N; 3] {
        let [a, b, c, d, e, f, g, h, i, j] = self.coefficients.map(N::new);
        let (origin, direction) = (vector(self.ray.origin), vector(self.ray.direction));
        let rows = [[a, b.clone(), c.clone()], [b, e, f.clone()], [c, f, h]];
        let linear = |v: &[N; 3]| [dot(&rows[0], v), dot(&rows[1], v), dot(&rows[2], v)];
        let g = [d, g, i];
        let [x, y, z] = linear(&origin);
        let half_gradient = [x.plus(&g[0]), y.plus(&g[1]), z.plus(&g[2])];
        let constant = dot(&origin, &half_gradient).plus(&dot(&origin, &g)).plus(&j);
        [dot(&direction, &linear(&direction)), dot(&direction, &half_gradient), constant]
    }
}

impl<R: Real> Quadric<R> {
    /// The exact equation along a ray.
    pub(super) fn equation(&self, ray: &Ray<R>) -> Quadratic<OnQuadric> {
        Quadratic::new(OnQuadric { ray: ray.to_f64(), coefficients: self.coefficients.map(R::to_f64) })
    }

    /// The hit at a known parameter.
    pub(super) fn hit(&self, ray: &Ray<R>, t: R) -> SurfaceHit<R> {
        // Along the line that starts where the terms are small, so that the point has its digits.
        let line = self.local(ray);
        self.surface_hit(t, Self::local_point(&line, t / line.scale - line.shift))
    }
}

/// The size of a surface (a power of two) and its coefficients in that unit, scaled to about 1. All exact.
fn normalized(q: [f64; 10]) -> (f64, [f64; 10]) {
    let largest = |indices: &[usize]| indices.iter().fold(0.0, |m: f64, &i| m.max(q[i].abs()));
    let (quadratic, linear, constant) = (largest(&[0, 1, 2, 4, 5, 7]), largest(&[3, 6, 8]), q[9].abs());
    // The largest root of `quadratic x^2 = linear x + constant`, but for a small factor.
    let size =
        if quadratic > 0.0 { (linear / quadratic).max((constant / quadratic).sqrt()) } else { constant / linear };
    // Within f32's range, with room for products.
    let size = size.clamp(2e-10, 4e9).power_of_two_below();
    let size = if linear == 0.0 && constant == 0.0 { 1.0 } else { size };
    let power = [size * size, size, 1.0];
    let degree = [0, 0, 0, 1, 0, 0, 1, 0, 1, 2];
    let scaled: [f64; 10] = core::array::from_fn(|i| q[i] * power[degree[i]]);
    let unit = scaled.iter().fold(0.0, |m: f64, c| m.max(c.abs())).power_of_two_below();
    (size, scaled.map(|c| c / unit))
}

impl<R: Real> Primitive<R> for Quadric<R> {
    fn bounds(&self) -> Aabb<R> {
        padded(self.bounds)
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray).map(|(t, p)| self.surface_hit(t, p))
    }

    fn closest_hit_fast(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        let roots = ray.is_valid().then(|| self.roots_fast(ray)).flatten()?;
        let inside = |t: &R| self.clip.contains(ray.at(*t));
        let t = roots.into_iter().filter(inside).find(|&t| first_admitted(ray, [t; 2]).is_some())?;
        Some(self.surface_hit(t, ray.at(t) * (R::ONE / self.size)))
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let (equation, clip) = (self.equation(ray), self.clip.to_f64());
        let inside = |side| in_box(&equation, side, &equation.equation().ray, &clip);
        visit_roots(&equation, ray, inside, |t| self.hit(ray, t), visit)
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// One Newton step along the gradient. The bound is the root of the quadratic along the gradient from there, with
    /// the rounding of its constant term: `2 |F| / |grad F|` away from singular points, and of the order of
    /// `sqrt(u)` times the coordinates at an apex.
    fn refine(&self, point: R::Vec3, _: Option<R::Vec3>) -> (R::Vec3, R) {
        let unit_size = R::ONE / self.size;
        let p = point * unit_size;
        let g = self.form.half_gradient(p);
        let step = self.form.value(p) / (g.dot(g) * R::TWO);
        let stepped = p - g * step;
        // Far from the surface or near a singular point the step may lead astray: then the point stays.
        let better = self.form.value(stepped).abs() <= self.form.value(p).abs();
        let p = if better { stepped } else { p };

        let slope = R::TWO * self.form.half_gradient(p).length();
        let value = self.form.value(p).abs() + R::gamma(24) * self.form.magnitude(p);
        // The root s of `slope s - curvature s^2 = value`, or where that has none its order of magnitude.
        let curvature = self.form.weights.max_element();
        let reach = (slope * slope - R::TWO * R::TWO * curvature * value).max(R::ZERO).sqrt();
        let left = R::TWO * value / (slope + reach).max((curvature * value).sqrt());
        let left = if left.is_finite() { left } else { R::ZERO };
        let p = p * self.size;
        (p, left * self.size + R::gamma(4) * p.abs().max_element())
    }
}
