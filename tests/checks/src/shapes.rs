//! Rays and analytic shapes of any numbers.

use core::ops::ControlFlow;

use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Aabb, Primitive, Ray, Real, Shape, ShapeError, SurfaceHit, Vector3};
use glam::DVec3;

use crate::bytes::Bytes;
use crate::exact::{self, Exact, Root};

/// No ray meets a shape more often.
const MOST: usize = 16;

/// A shape and a ray: no panic, no NaN; a hit lies in the interval; any hit is closest hit; the exact hits ascend, begin
/// with the exact closest one, and are those of exact numbers where the shape has one equation; the stable forms agree
/// with the exact ones where a slightly different ray makes no difference.
pub fn shapes(data: &[u8]) -> bool {
    let mut bytes = Bytes::new(data);
    let double = bytes.flag();
    let Ok(shape) = shape(&mut bytes, double) else { return false };
    let bounds = shape.bounds();
    let target = if bounds.is_finite() && bytes.byte() < 200 {
        let reach = DVec3::new(bytes.fraction(), bytes.fraction(), bytes.fraction());
        bounds.center() + bounds.extent() * 0.55 * reach
    } else {
        bytes.vector(double)
    };
    let ray = bytes.ray(target, double);
    check(&shape, &ray);
    if bytes.ordinary() {
        agree(&shape, &ray);
    }
    if let Ok(single) = shape.cast::<f32>() {
        let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
        check(&single, &Ray { origin, direction, t_min: ray.t_min as f32, t_max: ray.t_max as f32 });
    }
    shape.any_hit(&ray)
}

/// A shape from bytes, with a constructor's error where they describe none.
fn shape(bytes: &mut Bytes<'_>, double: bool) -> Result<Shape<f64>, ShapeError> {
    let kind = bytes.below(12);
    let closed = bytes.flag();
    let quadric = match kind {
        0 => return Ok(Sphere::new(bytes.vector(double), bytes.size(double))?.into()),
        1 => return Ok(Plane::new(bytes.vector(double), bytes.vector(double))?.with_culling(closed).into()),
        2 => {
            let (center, normal) = (bytes.vector(double), bytes.vector(double));
            return Ok(Disk::new(center, normal, bytes.size(double), bytes.size(double))?.into());
        }
        3 => {
            let [origin, x, y] = [(); 3].map(|()| bytes.vector(double));
            let mut corner = || origin + x * f64::from(bytes.byte() % 5) + y * f64::from(bytes.byte() % 5);
            let [outline, hole] = [5, 3].map(|count| (0..count).map(|_| corner()).collect());
            return Ok(Polygon::new(if closed { vec![outline, hole] } else { vec![outline] })?.into());
        }
        4 => {
            let (a, b) = (bytes.vector(double), bytes.vector(double));
            return Ok(if closed { Cuboid::new(a, b) } else { Cuboid::new(a.min(b), a.max(b)) }?.into());
        }
        5 => Quadric::cylinder(bytes.size(double), bytes.real(double), bytes.real(double)),
        6 => Quadric::cone(bytes.size(double), bytes.real(double), bytes.real(double)),
        7 => Quadric::ellipsoid(bytes.vector(double).abs()),
        8 => Quadric::paraboloid(bytes.size(double), bytes.real(double)),
        9 => {
            let (radius, rise) = (bytes.size(double), bytes.size(double));
            Quadric::hyperboloid_one(radius, rise, bytes.real(double), bytes.real(double))
        }
        10 => {
            let (radius, rise) = (bytes.size(double), bytes.size(double));
            Quadric::hyperboloid_two(radius, rise, bytes.real(double), bytes.real(double))
        }
        _ => {
            let quadric = Quadric::new([(); 10].map(|()| bytes.real(double)))?;
            if bytes.flag() {
                Ok(quadric)
            } else {
                let (a, b) = (bytes.vector(double), bytes.vector(double));
                quadric.with_clip(Aabb::new(a.min(b), a.max(b)))
            }
        }
    }?;
    Ok(if closed { Solid::new(quadric).into() } else { quadric.into() })
}

fn check<R: Real>(shape: &Shape<R>, ray: &Ray<R>) {
    let say = || format!("{shape:?} {ray:?}");
    let good = |hit: &SurfaceHit<R>| {
        assert!(ray.is_valid(), "{hit:?} {}", say());
        assert!(hit.t.is_finite() && ray.contains(hit.t), "{hit:?} {}", say());
        assert!(hit.u.is_finite() && hit.v.is_finite(), "{hit:?} {}", say());
        if let Some(n) = hit.normal {
            let length = n.to_f64().length();
            assert!((length - 1.0).abs() < 16.0 * R::UNIT_ROUNDOFF.to_f64(), "{hit:?} {length} {}", say());
        }
        let point = ray.at(hit.t);
        if point.is_finite() {
            let (_, error) = shape.refine(point, hit.normal);
            assert!(!error.is_nan() && error >= R::ZERO, "{hit:?} {} {}", error.to_f64(), say());
        }
    };
    let closest = shape.closest_hit(ray);
    assert_eq!(closest.is_some(), shape.any_hit(ray), "{}", say());
    closest.iter().for_each(good);
    shape.closest_hit_fast(ray).iter().for_each(good);

    let mut hits = Vec::new();
    shape.visit_exact(ray, &mut |found, _| {
        hits.push(found);
        if hits.len() > MOST { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(hits.len() <= MOST && hits.is_sorted_by(|a, b| a.hit.t <= b.hit.t), "{hits:?} {}", say());
    hits.iter().for_each(|h| good(&h.hit));
    assert_eq!(shape.closest_hit_exact(ray), hits.first().map(|h| h.hit), "{}", say());
    let bounds = shape.bounds();
    assert!((0..3).all(|i| !bounds.min.axis(i).is_nan() && !bounds.max.axis(i).is_nan()), "{bounds:?} {}", say());

    if let Some(equation) = equation(shape, ray).filter(|_| ray.is_valid()) {
        let double = R::UNIT_ROUNDOFF.to_f64() < 1e-10;
        let end = exact::end(double);
        let inside = |r: &Root<'_>| {
            r.cmp_float(ray.t_min.to_f64()).is_ge()
                && r.cmp_float(ray.t_max.to_f64()).is_le()
                && r.compare(&end).is_lt()
                && r.compare(&-&end).is_gt()
        };
        let roots: Vec<Root<'_>> = Root::of(&equation).into_iter().filter(inside).collect();
        assert_eq!(roots.len(), hits.len(), "{hits:?} {}", say());
        for (root, h) in roots.iter().zip(&hits) {
            let near = if double {
                exact::is_nearest(h.hit.t.to_f64(), |x| root.compare(x))
            } else {
                exact::is_nearest_f32(h.hit.t.to_f32(), |x| root.compare(x))
            };
            assert!(near, "{h:?} {}", say());
        }
    }
}

/// The equation `a t^2 + 2 b t + c = 0` of a shape that is nothing but one.
fn equation<R: Real>(shape: &Shape<R>, ray: &Ray<R>) -> Option<[Exact; 3]> {
    if !ray.is_valid() {
        return None;
    }
    let (o, d) = (exact::vector(ray.origin.to_f64()), exact::vector(ray.direction.to_f64()));
    match shape {
        Shape::Sphere(s) => {
            let l = exact::minus(&o, &exact::vector(s.center().to_f64()));
            let r = Exact::new(s.radius().to_f64());
            Some([exact::dot(&d, &d), exact::dot(&l, &d), &exact::dot(&l, &l) - &(&r * &r)])
        }
        Shape::Quadric(q) if q.clip() == Aabb::<R>::infinite() => {
            let [a, b, c, d0, e, f, g, h, i, j] = q.coefficients().map(|x| Exact::new(x.to_f64()));
            let rows = [[&a, &b, &c], [&b, &e, &f], [&c, &f, &h]].map(|row| row.map(Clone::clone));
            let linear = [d0, g, i];
            let times = |v: &exact::Vector| rows.each_ref().map(|row| exact::dot(row, v));
            let (at_o, at_d) = (times(&o), times(&d));
            let two = Exact::new(2.0);
            let constant = &(&exact::dot(&o, &at_o) + &(&two * &exact::dot(&linear, &o))) + &j;
            Some([exact::dot(&d, &at_d), &exact::dot(&o, &at_d) + &exact::dot(&linear, &d), constant])
        }
        _ => None,
    }
}

/// Whether the surface is a line or a point, which rays that differ by a little all miss.
fn thin(shape: &Shape<f64>) -> bool {
    let narrow = |b: Aabb<f64>, most: usize| b.extent().to_array().iter().filter(|e| **e < 1e-3).count() > most;
    match shape {
        Shape::Disk(d) => d.radius() - d.inner_radius() < 1e-3,
        Shape::Quadric(q) => narrow(q.clip(), 0) || narrow(q.bounds(), 1),
        Shape::Solid(s) => narrow(s.surface().clip(), 0) || narrow(s.bounds(), 1),
        other => narrow(other.bounds(), 1),
    }
}

/// Where rays that differ by a little all do the same, exactly, the stable form does it too.
fn agree(shape: &Shape<f64>, ray: &Ray<f64>) {
    const LITTLE: f64 = 1e-6;
    let unclear = ray.direction.length() < 1e-2;
    if !ray.is_valid() || unclear || thin(shape) {
        return;
    }
    let Some(first) = clear(shape, ray) else { return };
    let same = |ray: Ray<f64>| match (first, clear(shape, &ray)) {
        (None, Some(None)) => true,
        (Some(a), Some(Some(b))) => (a - b).abs() < 1e-3 * (1.0 + a.abs()),
        _ => false,
    };
    // An end of the interval, too, may be where the surface is.
    let longer = ray.with_interval(ray.t_min - LITTLE, ray.t_max + LITTLE);
    let shorter = ray.with_interval(ray.t_min + LITTLE, ray.t_max - LITTLE);
    if !same(shorter) {
        return;
    }
    for step in neighbours() {
        let moved = Ray { origin: ray.origin + step * LITTLE, ..longer };
        let turned = Ray { direction: ray.direction + step * LITTLE, ..longer };
        if !same(moved) || !same(turned) {
            return;
        }
    }
    let stable = shape.closest_hit(ray).map(|h| h.t);
    if [first, stable].into_iter().flatten().any(|t| at_rim(shape, ray.at(t))) {
        return;
    }
    let same = match (first, stable) {
        (None, None) => true,
        (Some(a), Some(b)) => (a - b).abs() < 1e-6 * (1.0 + a.abs()),
        _ => false,
    };
    assert!(same, "exactly {first:?}, stable {stable:?}: {shape:?} {ray:?}");
}

/// Whether a point of the shape is at an end of its surface that no ray nearby may tell: where a face of the clip box
/// cuts a quadric, or touches it at a vertex; on an edge of a polygon, of which two may enclose nothing.
fn at_rim(shape: &Shape<f64>, point: DVec3) -> bool {
    let to_surface = |q: &Quadric<f64>| (q.refine(point, None).0 - point).length();
    let to_clip = |b: Aabb<f64>| (point - b.min).abs().min((point - b.max).abs()).min_element();
    let away = match shape {
        Shape::Quadric(q) => to_clip(q.clip()),
        Shape::Solid(s) => to_clip(s.surface().clip()).max(to_surface(s.surface())),
        Shape::Polygon(p) => {
            let edges = p.loops().iter().flat_map(|l| l.iter().zip(l.iter().cycle().skip(1)));
            edges.map(|(a, b)| to_segment(point, *a, *b)).fold(f64::INFINITY, f64::min)
        }
        _ => f64::INFINITY,
    };
    away < 1e-6
}

/// The distance of a point from a line segment.
fn to_segment(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    let nearest = if along.is_nan() { a } else { a + (b - a) * along };
    (point - nearest).length()
}

/// Nowhere, and to the 26 neighbours in a grid: along axes alone, a ray from a corner of a clip box stays in its faces.
fn neighbours() -> impl Iterator<Item = DVec3> {
    (0..27).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) - 1.0)
}

/// The first exact hit, if any; nothing where the ray only touches, or meets two sides at nearly the same place.
fn clear(shape: &Shape<f64>, ray: &Ray<f64>) -> Option<Option<f64>> {
    let mut hits = Vec::new();
    shape.visit_exact(ray, &mut |found, _| {
        hits.push((found.hit.t, found.crosses));
        if hits.len() < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    match hits[..] {
        [] => Some(None),
        [(t, true)] => Some(Some(t)),
        [(a, true), (b, _)] if b - a > 1e-3 * (1.0 + a.abs()) => Some(Some(a)),
        _ => None,
    }
}
