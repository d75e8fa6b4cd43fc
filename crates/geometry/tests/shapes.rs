//! Properties that every analytic shape must have, whatever it is.
//!
//! A new shape needs a line in [`shape`] and in [`off_surface`].

use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Aabb, Primitive, Ray, Real, Shape, SurfaceHit, Vector3, offset};
use glam::{DQuat, DVec3, Vec3};
use proptest::prelude::*;

fn vector(range: f64) -> impl Strategy<Value = DVec3> {
    (-range..range, -range..range, -range..range).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn direction() -> impl Strategy<Value = DVec3> {
    vector(1.0).prop_filter("not zero", |v| v.length() > 1e-2).prop_map(DVec3::normalize)
}

fn length() -> impl Strategy<Value = f64> {
    0.1..3.0_f64
}

/// Coefficients of a rotated and moved ellipsoid or hyperboloid: all ten are in use.
fn general_quadric() -> impl Strategy<Value = [f64; 10]> {
    let signed = || prop_oneof![3 => 0.2..2.0_f64, 1 => -2.0..-0.2_f64];
    ([signed(), signed(), signed()], direction(), 0.0..3.0_f64, vector(2.0)).prop_map(|(d, axis, angle, center)| {
        let q = DQuat::from_axis_angle(axis, angle);
        let axes = [q * DVec3::X, q * DVec3::Y, q * DVec3::Z];
        let entry = |i: usize, j: usize| -> f64 { (0..3).map(|k| d[k] * axes[k][i] * axes[k][j]).sum() };
        let row = |i: usize| DVec3::new(entry(i, 0), entry(i, 1), entry(i, 2));
        let g = -DVec3::new(row(0).dot(center), row(1).dot(center), row(2).dot(center));
        let j = -g.dot(center) - 1.0;
        let (a, b, c, e, f, h) = (entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2));
        [a, b, c, g.x, e, f, g.y, h, g.z, j]
    })
}

fn quadric() -> impl Strategy<Value = Quadric<f32>> {
    let heights = || (-2.0..-0.2_f32, 0.2..2.0_f32);
    let radius = || 0.2..2.0_f32;
    prop_oneof![
        (radius(), heights()).prop_map(|(r, (a, b))| Quadric::cylinder(r, a, b)),
        (radius(), heights()).prop_map(|(r, (a, b))| Quadric::cone(r, a, b)),
        (radius(), radius(), radius()).prop_map(|(a, b, c)| Quadric::ellipsoid(Vec3::new(a, b, c))),
        (radius(), radius()).prop_map(|(r, h)| Quadric::paraboloid(r, h)),
        (radius(), radius(), heights()).prop_map(|(r, e, (a, b))| Quadric::hyperboloid_one(r, e, a, b)),
        (radius(), 0.1..1.0_f32, heights()).prop_map(|(r, e, (a, b))| Quadric::hyperboloid_two(r, e, a, b)),
        general_quadric().prop_map(|q| {
            let clip = Aabb::new(Vec3::splat(-3.0), Vec3::new(3.0, 2.0, f32::INFINITY));
            Quadric::new(q.map(Real::to_f32)).and_then(|q| q.with_clip(clip))
        }),
    ]
    .prop_map(|q| q.expect("valid parameters"))
}

/// A star-shaped polygon with a hole, in a tilted plane.
fn polygon() -> impl Strategy<Value = Polygon<f32>> {
    (direction(), vector(2.0), proptest::collection::vec(0.3..1.5_f64, 3..9)).prop_map(|(n, center, radii)| {
        let x = n.any_orthonormal_vector();
        let y = n.cross(x);
        let corner = |i: usize, r: f64| {
            let (sin, cos) = (i as f64 / radii.len() as f64 * core::f64::consts::TAU).sin_cos();
            (center + (x * cos + y * sin) * r).as_vec3()
        };
        let outer = radii.iter().enumerate().map(|(i, &r)| corner(i, r)).collect();
        let hole = (0..radii.len()).map(|i| corner(i, 0.1)).collect();
        Polygon::new(vec![outer, hole]).expect("flat")
    })
}

fn shape() -> impl Strategy<Value = Shape<f32>> {
    let round = |v: DVec3| v.as_vec3();
    prop_oneof![
        1 => (vector(2.0), length()).prop_map(move |(c, r)| Sphere::new(round(c), r as f32).unwrap().into()),
        1 => (vector(2.0), direction()).prop_map(move |(p, n)| Plane::new(round(p), round(n)).unwrap().into()),
        1 => (vector(2.0), direction(), length(), 0.0..1.0_f32)
            .prop_map(move |(c, n, r, i)| Disk::new(round(c), round(n), r as f32, i * r as f32).unwrap().into()),
        1 => polygon().prop_map(Shape::from),
        1 => (vector(2.0), length(), length(), length()).prop_map(move |(c, x, y, z)| {
            let half = DVec3::new(x, y, z);
            Cuboid::new(round(c - half), round(c + half)).unwrap().into()
        }),
        4 => quadric().prop_map(Shape::from),
        4 => quadric().prop_map(|q| Solid::new(q).into()),
    ]
}

/// A ray aimed near the origin, from near and far, with a direction of any length.
fn ray() -> impl Strategy<Value = Ray<f32>> {
    (direction(), prop_oneof![0.0..5.0_f64, 10.0..300.0_f64], vector(2.0), -10..10_i32).prop_map(
        |(from, distance, target, exponent)| {
            let origin = (from * distance).as_vec3();
            let d = (target.as_vec3() - origin) * 1.7_f32.powi(exponent);
            Ray::new(origin, d)
        },
    )
}

fn polynomial(q: &Quadric<f64>, p: DVec3) -> (f64, DVec3) {
    let [a, b, c, d, e, f, g, h, i, j] = q.coefficients();
    let half =
        DVec3::new(a * p.x + b * p.y + c * p.z + d, b * p.x + e * p.y + f * p.z + g, c * p.x + f * p.y + h * p.z + i);
    (p.dot(half) + DVec3::new(d, g, i).dot(p) + j, half * 2.0)
}

/// How far a point is from a quadric, to first order. `None` near singular points.
fn off_quadric(q: &Quadric<f64>, p: DVec3) -> Option<f64> {
    let (value, gradient) = polynomial(q, p);
    (gradient.length() > 1e-2).then(|| value.abs() / gradient.length())
}

fn off_box(bounds: Aabb<f64>, p: DVec3) -> f64 {
    let faces = (p - bounds.min).abs().min((p - bounds.max).abs());
    faces.min_element()
}

/// How far a point is from the surface of a shape (of its plane, where it is flat).
fn off_surface(shape: &Shape<f64>, p: DVec3) -> Option<f64> {
    match shape {
        Shape::Sphere(s) => Some((p.distance(s.center()) - s.radius()).abs()),
        Shape::Plane(s) => Some((p - s.point()).dot(s.normal()).abs()),
        Shape::Disk(s) => Some((p - s.center()).dot(s.normal()).abs()),
        // Its vertices themselves lie off the plane by as much as f32 rounds them.
        Shape::Polygon(s) => Some(((p - s.loops()[0][0]).dot(s.normal()?).abs() - 1e-6).max(0.0)),
        Shape::Cuboid(s) => Some(off_box(s.corners(), p)),
        Shape::Quadric(s) => off_quadric(s, p),
        Shape::Solid(s) => Some(off_quadric(s.surface(), p)?.min(off_box(s.surface().clip(), p))),
        _ => None,
    }
}

/// Rounding of a point on the way from the ray's origin to the hit.
fn rounding<R: Real>(ray: &Ray<R>, t: f64) -> f64 {
    let (o, d) = (ray.origin.to_f64(), ray.direction.to_f64());
    R::UNIT_ROUNDOFF.to_f64() * (o.length() + t.abs() * d.length() + 3.0)
}

fn refined<R: Real>(shape: &Shape<R>, ray: &Ray<R>, hit: &SurfaceHit<R>) -> (R::Vec3, R) {
    shape.refine(ray.at(hit.t), hit.normal)
}

/// The properties that hold in either arithmetic. `truth` is the same shape in f64.
fn check_hit<R: Real>(shape: &Shape<R>, truth: &Shape<f64>, ray: &Ray<R>) -> Result<(), TestCaseError> {
    for hit in [shape.closest_hit(ray), shape.closest_hit_fast(ray)].into_iter().flatten() {
        prop_assert!(ray.contains(hit.t) && hit.t.is_finite());
        if let Some(n) = hit.normal {
            prop_assert!((n.length().to_f64() - 1.0).abs() <= 4.0 * R::UNIT_ROUNDOFF.to_f64());
        }
        if !matches!(shape, Shape::Plane(_)) {
            prop_assert!((0.0..=1.0).contains(&hit.u.to_f64()), "u = {}", hit.u);
        }
    }
    let hit = shape.closest_hit(ray);
    prop_assert_eq!(hit.is_some(), shape.any_hit(ray));
    check_exact(shape, ray)?;
    let Some(hit) = hit else { return Ok(()) };

    // The interval is closed: cut down to the hit itself it still holds the hit.
    prop_assert_eq!(shape.closest_hit(&ray.with_interval(hit.t, hit.t)), Some(hit));

    let (point, error) = refined(shape, ray, &hit);
    prop_assert!(shape.bounds().contains(point), "{point:?} outside {:?}", shape.bounds());
    if let Some(off) = off_surface(truth, point.to_f64()) {
        prop_assert!(off <= error.to_f64(), "off by {off:e}, bound {error:?}");
        // The bound is no excuse: some units of the coordinates.
        let scale = point.abs().max_element().to_f64() + 3.0;
        prop_assert!(error.to_f64() <= 1e4 * R::UNIT_ROUNDOFF.to_f64() * scale, "bound {error:?}");
    }
    Ok(())
}

/// What the exact form finds is in the interval and in the bounds, and near what the stable form finds in f64.
fn check_exact<R: Real>(shape: &Shape<R>, ray: &Ray<R>) -> Result<(), TestCaseError> {
    let exact = shape.closest_hit_exact(ray);
    if let Some(hit) = exact {
        prop_assert!(ray.contains(hit.t) && hit.t.is_finite());
        prop_assert!(hit.normal.is_none_or(|n| (n.length().to_f64() - 1.0).abs() <= 4.0 * R::UNIT_ROUNDOFF.to_f64()));
        let (point, _) = refined(shape, ray, &hit);
        prop_assert!(shape.bounds().contains(point), "{point:?} outside {:?}", shape.bounds());
    }
    if R::MAX.to_f64() == f64::MAX {
        let stable = shape.closest_hit(ray);
        prop_assert_eq!(exact.is_some(), stable.is_some(), "{:?} {:?}", exact, stable);
        if let (Some(a), Some(b)) = (exact, stable) {
            let (off, size) = ((a.t - b.t).to_f64().abs(), a.t.to_f64().abs());
            // A tangent ray has half the digits.
            prop_assert!(off <= 1e-6 * size, "{} {}", a.t, b.t);
        }
    }
    Ok(())
}

/// A ray that leaves the surface by the bound hits the same piece again only if the exact shape is really hit there.
fn check_leaving<R: Real>(
    shape: &Shape<R>,
    truth: &Shape<f64>,
    ray: &Ray<R>,
    away: DVec3,
) -> Result<(), TestCaseError> {
    check_leaving_by(|r| shape.closest_hit(r), shape, truth, ray, away)?;
    check_leaving_by(|r| shape.closest_hit_exact(r), shape, truth, ray, away)
}

fn check_leaving_by<R: Real>(
    closest_hit: impl Fn(&Ray<R>) -> Option<SurfaceHit<R>>,
    shape: &Shape<R>,
    truth: &Shape<f64>,
    ray: &Ray<R>,
    away: DVec3,
) -> Result<(), TestCaseError> {
    let Some(hit) = closest_hit(ray) else { return Ok(()) };
    let Some(normal) = hit.normal else { return Ok(()) };
    let (point, error) = refined(shape, ray, &hit);
    for away in [away, -away] {
        let direction = R::Vec3::from_f64(away);
        let start = offset::leave::<R>(point, R::Vec3::splat(error), normal, direction);
        let leaving = Ray::<R>::new(start, direction);
        let Some(again) = closest_hit(&leaving) else { continue };
        // Which side of a plane a ray within rounding of it leaves to cannot be told: hence `is_flat`.
        let in_plane = normal.to_f64().dot(away).abs() < 1e-6;
        prop_assert!(!shape.is_flat() || in_plane, "a flat shape is hit again at {}", again.t);
        // Near the start, a hit is real only if f64 sees it too.
        if !shape.is_flat() && again.t.to_f64() < 1e-3 {
            let real = truth.closest_hit(&leaving.to_f64());
            let near = real.is_some_and(|r| (r.t - again.t.to_f64()).abs() <= 0.5 * r.t + 16.0 * error.to_f64());
            prop_assert!(near, "left at {start:?}, hit again at {} ({real:?})", again.t);
        }
    }
    Ok(())
}

/// The first change between inside and outside along a ray, by sampling: an obvious twin of the solvers.
fn first_crossing(inside: impl Fn(DVec3) -> bool, ray: &Ray<f64>, t_max: f64) -> Option<f64> {
    const STEPS: i32 = 4000;
    let at = |i: i32| t_max * f64::from(i) / f64::from(STEPS);
    let step = (0..STEPS).find(|&i| inside(ray.at(at(i))) != inside(ray.at(at(i + 1))))?;
    let (mut low, mut high) = (at(step), at(step + 1));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if inside(ray.at(middle)) == inside(ray.at(low)) { low = middle } else { high = middle }
    }
    Some(high)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn hits_are_in_bounds_on_the_surface_and_in_the_interval(shape in shape(), ray in ray()) {
        let truth = shape.cast::<f64>().unwrap();
        check_hit(&shape, &truth, &ray)?;
        check_hit(&truth, &truth, &ray.to_f64())?;
    }

    #[test]
    fn leaving_rays_do_not_hit_where_they_start(shape in shape(), ray in ray(), away in direction()) {
        let truth = shape.cast::<f64>().unwrap();
        check_leaving(&shape, &truth, &ray, away)?;
        check_leaving(&truth, &truth, &ray.to_f64(), away)?;
    }

    /// Rays that graze the surface they leave.
    #[test]
    fn grazing_rays_do_not_hit_where_they_start(shape in shape(), ray in ray(), turn in direction(), tilt in -1e-6..1e-6_f64) {
        let truth = shape.cast::<f64>().unwrap();
        if let Some(n) = truth.closest_hit(&ray.to_f64()).and_then(|hit| hit.normal) {
            let along = n.cross(turn).normalize_or_zero() + n * tilt;
            check_leaving(&shape, &truth, &ray, along)?;
            check_leaving(&truth, &truth, &ray.to_f64(), along)?;
        }
    }

    /// f32 decides as f64 does wherever moving the ray by 64 units of rounding changes nothing, and its `t` is within
    /// the reach of that motion.
    #[test]
    fn single_precision_agrees_with_double(shape in shape(), ray in ray()) {
        let truth = shape.cast::<f64>().unwrap();
        let exact = ray.to_f64();
        let reach = 64.0 * rounding(&ray, truth.closest_hit(&exact).map_or(0.0, |h| h.t));
        let moved = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]).map(|axis| {
            truth.closest_hit(&Ray::new(exact.origin + axis * reach, exact.direction)).map(|h| h.t)
        });
        let around: Vec<Option<f64>> = moved.chain([truth.closest_hit(&exact).map(|h| h.t)]).collect();
        let single = shape.closest_hit(&ray).map(|h| f64::from(h.t));
        if around.iter().all(Option::is_none) {
            prop_assert_eq!(single, None);
        } else if around.iter().all(Option::is_some) {
            let all = || around.iter().flatten().copied();
            let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
            let slack = 4.0 * f64::from(f32::EPSILON) * high + reach / exact.direction.length();
            prop_assert!(
                single.is_some_and(|t| low - slack <= t && t <= high + slack),
                "{single:?} not in {low} .. {high}"
            );
        }
    }

    /// Scaling the world by a power of two scales `t` exactly; scaling the direction divides it exactly.
    #[test]
    fn powers_of_two_change_nothing_else(shape in shape(), ray in ray(), e in -20..20_i32) {
        let s = 2.0_f32.powi(e);
        let (ray, factor) = (ray.to_f64(), f64::from(s));
        let shape = shape.cast::<f64>().unwrap();
        let (shape, larger) = (scaled(&shape, 1.0), scaled(&shape, factor));
        let expected = shape.closest_hit(&ray).map(|h| h.t * factor);
        let moved = Ray::<f64>::new(ray.origin * factor, ray.direction);
        prop_assert_eq!(larger.closest_hit(&moved).map(|h| h.t), expected);
        let faster = Ray::<f64>::new(moved.origin, ray.direction * factor);
        prop_assert_eq!(larger.closest_hit(&faster).map(|h| h.t), shape.closest_hit(&ray).map(|h| h.t));
    }

    #[test]
    fn solids_agree_with_sampling(quadric in quadric(), ray in ray()) {
        let surface = quadric.cast::<f64>().unwrap();
        let solid = Solid::new(surface);
        let ray = ray.to_f64();
        let t_max = 2.0 + 8.0 / ray.direction.length();
        let inside = |p: DVec3| polynomial(&surface, p).0 <= 0.0 && surface.clip().contains(p);
        let sampled = first_crossing(inside, &ray, t_max);
        let found = solid.closest_hit(&ray.with_interval(0.0, t_max)).map(|h| h.t);
        match (found, sampled) {
            (None, Some(t)) => prop_assert!(false, "missed the crossing at {t}"),
            (Some(t), Some(s)) => prop_assert!(t <= s + 1e-9 * t_max, "{t} behind {s}"),
            _ => {}
        }
        // Samples may step over a corner, but a hit must be a change of inside.
        if let Some(t) = found {
            let step = t_max * 1e-7;
            let reach = 1e-4 + 10.0 * step * ray.direction.length();
            let (before, after) = (inside(ray.at(t - step)), inside(ray.at(t + step)));
            let near_edge = (0..3).any(|i| {
                let p = ray.at(t)[i];
                (p - surface.clip().min[i]).abs() < reach || (p - surface.clip().max[i]).abs() < reach
            });
            let n = solid.closest_hit(&ray).and_then(|h| h.normal);
            let grazing = n.is_none_or(|n| n.dot(ray.direction.normalize()).abs() < 1e-3);
            prop_assert!(before != after || near_edge || grazing, "no crossing at {t}");
        }
    }

    /// An open quadric is its solid without the caps.
    #[test]
    fn quadrics_are_solids_without_caps(quadric in quadric(), ray in ray()) {
        let surface = quadric.cast::<f64>().unwrap();
        let ray = ray.to_f64();
        let open = surface.closest_hit(&ray);
        let closed = Solid::new(surface).closest_hit(&ray);
        if let Some(open) = open {
            prop_assert!(closed.is_some_and(|c| c.t <= open.t * (1.0 + 1e-12)));
        }
        if let Some(closed) = closed.filter(|c| off_box(surface.clip(), ray.at(c.t)) > 1e-6) {
            prop_assert_eq!(open.map(|h| h.t), Some(closed.t));
        }
    }

    /// Both solutions of the sphere find the same roots.
    #[test]
    fn algebraic_and_geometric_sphere_agree(c in vector(2.0), r in length(), ray in ray()) {
        let sphere = Sphere::new(c, r).unwrap();
        let ray = ray.to_f64();
        let (a, g) = (sphere.roots_algebraic(&ray), sphere.roots_geometric(&ray));
        let l = ray.origin - c;
        let foot = l - ray.direction * (l.dot(ray.direction) / ray.direction.length_squared());
        prop_assume!((foot.length() - r).abs() > 1e-6);
        prop_assert_eq!(a.is_some(), g.is_some());
        if let (Some(a), Some(g)) = (a, g) {
            let size = (l.length() + r) / ray.direction.length();
            for (a, g) in a.into_iter().zip(g) {
                prop_assert!((a - g).abs() <= 1e-6 * size, "{a} {g}");
            }
        }
    }
}

/// Any number at all: of ordinary size, or any bit pattern.
fn any_number() -> impl Strategy<Value = f32> {
    let special = [0.0, -0.0, f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-45, 1.0];
    prop_oneof![-10.0..10.0_f32, any::<u32>().prop_map(f32::from_bits), prop::sample::select(special.to_vec())]
}

/// What the constructors make of any numbers.
fn any_shapes(x: &[f32; 12]) -> Vec<Shape<f32>> {
    let v = |i: usize| Vec3::from_slice(&x[i..i + 3]);
    let q = [x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9]];
    let quadrics = [
        Quadric::new(q),
        Quadric::new(q).and_then(|q| q.with_clip(Aabb::new(v(9), v(6)))),
        Quadric::cylinder(x[0], x[1], x[2]),
        Quadric::cone(x[0], x[1], x[2]),
        Quadric::ellipsoid(v(0)),
        Quadric::paraboloid(x[0], x[1]),
        Quadric::hyperboloid_one(x[0], x[1], x[2], x[3]),
        Quadric::hyperboloid_two(x[0], x[1], x[2], x[3]),
    ];
    let shapes = [
        Sphere::new(v(0), x[3]).map(Shape::from),
        Plane::new(v(0), v(3)).map(Shape::from),
        Disk::new(v(0), v(3), x[6], x[7]).map(Shape::from),
        Polygon::new(vec![vec![v(0), v(3), v(6)]]).map(Shape::from),
        Cuboid::new(v(0), v(3)).map(Shape::from),
    ];
    let solids = quadrics.iter().flatten().map(|q| Solid::new(*q).into()).collect::<Vec<_>>();
    quadrics.iter().flatten().map(|q| Shape::from(*q)).chain(shapes.into_iter().flatten()).chain(solids).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// No numbers make a panic or a hit that is no number.
    #[test]
    fn any_numbers_give_an_answer(x in prop::array::uniform12(any_number()), y in prop::array::uniform8(any_number())) {
        let ray = Ray::<f32>::new(Vec3::new(y[0], y[1], y[2]), Vec3::new(y[3], y[4], y[5])).with_interval(y[6], y[7]);
        for ray in [ray, ray.with_interval(0.0, f32::INFINITY)] {
            for shape in any_shapes(&x) {
                for hit in [shape.closest_hit(&ray), shape.closest_hit_fast(&ray)].into_iter().flatten() {
                    prop_assert!(hit.t.is_finite() && ray.contains(hit.t), "{shape:?} {ray:?} {hit:?}");
                    prop_assert!(hit.normal.is_none_or(|n| n.is_finite()), "{shape:?} {ray:?} {hit:?}");
                    prop_assert!(hit.u.is_finite() && hit.v.is_finite(), "{shape:?} {ray:?} {hit:?}");
                    let _ = shape.refine(ray.at(hit.t), hit.normal);
                }
                prop_assert_eq!(shape.any_hit(&ray), shape.closest_hit(&ray).is_some());
                if let Ok(double) = shape.cast::<f64>() {
                    let hit = double.closest_hit(&ray.to_f64());
                    prop_assert!(hit.is_none_or(|h| h.t.is_finite()), "{double:?} {ray:?} {hit:?}");
                }
                let bounds = shape.bounds();
                prop_assert!((0..3).all(|i| !bounds.min[i].is_nan() && !bounds.max[i].is_nan()), "{shape:?} {bounds:?}");
            }
        }
    }
}

/// The shape `s` times as large, about the origin.
fn scaled(shape: &Shape<f64>, s: f64) -> Shape<f64> {
    let quadric = |q: &Quadric<f64>| {
        let [a, b, c, d, e, f, g, h, i, j] = q.coefficients();
        let larger = Quadric::new([a, b, c, d * s, e, f, g * s, h, i * s, j * s * s]).unwrap();
        larger.with_clip(Aabb::new(q.clip().min * s, q.clip().max * s)).unwrap()
    };
    match shape {
        Shape::Sphere(x) => Sphere::new(x.center() * s, x.radius() * s).unwrap().into(),
        Shape::Plane(x) => Plane::new(x.point() * s, x.normal()).unwrap().into(),
        Shape::Disk(x) => Disk::new(x.center() * s, x.normal(), x.radius() * s, x.inner_radius() * s).unwrap().into(),
        Shape::Polygon(x) => {
            let loops = x.loops().iter().map(|l| l.iter().map(|&v| v * s).collect()).collect();
            Polygon::new(loops).unwrap().into()
        }
        Shape::Cuboid(x) => Cuboid::new(x.corners().min * s, x.corners().max * s).unwrap().into(),
        Shape::Quadric(x) => quadric(x).into(),
        Shape::Solid(x) => Solid::new(quadric(x.surface())).into(),
        other => other.clone(),
    }
}

/// Found by random bytes: a point less than the largest number times smaller than the radius from the centre.
#[test]
fn a_sphere_refines_any_point() {
    let sphere = Sphere::new(Vec3::new(0.0, 5.421011e-20, 0.0), 7.5617144e28_f32).unwrap();
    for point in [Vec3::ZERO, sphere.center(), Vec3::new(1e-40, -1e-30, 0.0), Vec3::splat(1e30)] {
        let (on, error) = sphere.refine(point, None);
        assert!(on.is_finite() && error >= 0.0, "{point} {on} {error}");
        let radius = (on - sphere.center()).as_dvec3().length();
        assert!((radius - f64::from(sphere.radius())).abs() <= f64::from(error), "{point} {on} {error}");
    }
}
