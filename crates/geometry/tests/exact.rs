//! The exact forms of the shapes against oracles in integers, and against the double forms.

use core::ops::ControlFlow;

use firsthit_geometry::exact::ExactRay;
use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Aabb, ExactSurfaceHit, Primitive, Ray, Real, Shape};
use glam::DVec3;
use proptest::prelude::*;

type P = [i32; 3];

fn point(size: i32) -> impl Strategy<Value = P> {
    [-size..=size, -size..=size, -size..=size]
}

fn direction(size: i32) -> impl Strategy<Value = P> {
    point(size).prop_filter("a direction", |d| *d != [0; 3])
}

fn vec(p: P) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// A whole line.
fn line(o: P, d: P) -> Ray<f64> {
    Ray::<f64>::new(vec(o), vec(d)).with_interval(f64::NEG_INFINITY, f64::INFINITY)
}

fn wide(p: P) -> [i128; 3] {
    p.map(i128::from)
}

fn minus(a: P, b: P) -> P {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn all<R: Real>(shape: &impl Primitive<R>, ray: &Ray<R>) -> Vec<ExactSurfaceHit<R>> {
    let mut hits = Vec::new();
    shape.visit_exact(ray, &mut |hit, _| {
        hits.push(hit);
        ControlFlow::Continue(())
    });
    hits
}

fn single(ray: &Ray<f64>) -> Ray<f32> {
    Ray::<f32>::new(ray.origin.as_vec3(), ray.direction.as_vec3()).with_interval(ray.t_min as f32, ray.t_max as f32)
}

/// A root of an equation in integers.
#[derive(Clone, Copy, Debug)]
struct Root {
    /// Within 2^-38 of it, relative.
    about: f64,
    /// The very root, rounded to nearest, where it is rational.
    rounded: Option<f64>,
    /// Its own double.
    double: bool,
}

/// The real roots of `a t^2 + 2 b t + c`, ascending.
fn roots([a, b, c]: [i128; 3]) -> Vec<Root> {
    let rational = |n: i128, m: i128, double| {
        let t = n as f64 / m as f64;
        Root { about: t, rounded: Some(t), double }
    };
    if a == 0 {
        return if b == 0 { vec![] } else { vec![rational(-c, 2 * b, false)] };
    }
    let d = b * b - a * c;
    if d <= 0 {
        return if d == 0 { vec![rational(-b, a, true)] } else { vec![] };
    }
    let root = d.isqrt();
    assert!(d < 1 << 25, "the oracle's digits suffice");
    let s = (d << 100).isqrt();
    let of = |sign: i128| {
        if root * root == d {
            rational(-b + sign * root, a, false)
        } else {
            let about = ((-b << 50) + sign * s) as f64 / a as f64 / 2f64.powi(50);
            Root { about, rounded: None, double: false }
        }
    };
    let (r, s) = (of(-1), of(1));
    if r.about <= s.about { vec![r, s] } else { vec![s, r] }
}

/// The hits are the roots, rounded right as far as the oracle knows.
fn check(shape: Shape<f64>, ray: &Ray<f64>, expected: &[Root]) -> Result<(), TestCaseError> {
    let hits = all(&shape, ray);
    prop_assert_eq!(hits.len(), expected.len(), "{:?} {:?}", hits, expected);
    let singles = all(&shape.cast::<f32>().unwrap(), &single(ray));
    prop_assert_eq!(singles.len(), expected.len());
    for ((hit, single), root) in hits.iter().zip(&singles).zip(expected) {
        prop_assert_eq!(hit.crosses, !root.double);
        if let Some(t) = root.rounded {
            // A quotient of small integers is on a tie of f32 only if it is exact.
            prop_assert_eq!((hit.hit.t, single.hit.t), (t, t as f32));
        } else {
            let [low, high] = [-1.0, 1.0].map(|s| root.about * (1.0 + s * 2f64.powi(-38)));
            prop_assert!((hit.hit.t - root.about).abs() <= (high - low).abs());
            if low as f32 == high as f32 {
                prop_assert_eq!(single.hit.t, low as f32);
            }
        }
    }
    Ok(())
}

/// Every hit is in a closed interval that ends at it, if it is the very number, and not in one that ends beside it.
fn check_interval(shape: &Shape<f64>, line: &Ray<f64>, root: Root) -> Result<(), TestCaseError> {
    let hit = |low, high| shape.closest_hit_exact(&line.with_interval(low, high)).is_some();
    if let Some(t) = root.rounded {
        prop_assert!(hit(t.next_down(), t.next_up()));
        // Denominators here are below 2^12: the quotient is exact if one of these powers of two clears it.
        let exact = (0..12).any(|k| (t * f64::from(1 << k)).fract() == 0.0);
        prop_assert_eq!(hit(t, t), exact);
    }
    Ok(())
}

/// The coefficients along a line of `q`, a quadric of small integers.
fn along([a, b, c, d, e, f, g, h, i, j]: [i32; 10], origin: P, direction: P) -> [i128; 3] {
    let (o, v) = (wide(origin), wide(direction));
    let rows = [wide([a, b, c]), wide([b, e, f]), wide([c, f, h])];
    let m = |v| rows.map(|r| dot(r, v));
    let half_gradient: [i128; 3] = core::array::from_fn(|k| m(o)[k] + wide([d, g, i])[k]);
    [dot(v, m(v)), dot(v, half_gradient), dot(o, half_gradient) + dot(o, wide([d, g, i])) + i128::from(j)]
}

fn coefficients() -> impl Strategy<Value = [i32; 10]> {
    prop_oneof![
        prop::array::uniform10(-3..=3),
        // Cylinders, cones and planes: many zeros.
        prop::array::uniform10(prop_oneof![3 => Just(0), 1 => -2..=2]),
    ]
    .prop_filter("a surface", |q| q[..9].iter().any(|c| *c != 0))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A coarse grid makes tangents, rays from the surface and rational roots common.
    #[test]
    fn spheres_are_those_of_integers(c in point(4), r in 1..6i32, o in point(8), d in direction(3)) {
        let l = wide(minus(o, c));
        let equation = [dot(wide(d), wide(d)), dot(l, wide(d)), dot(l, l) - i128::from(r * r)];
        let sphere = Shape::from(Sphere::new(vec(c), r.into()).unwrap());
        let expected = roots(equation);
        check(sphere.clone(), &line(o, d), &expected)?;
        for root in expected {
            check_interval(&sphere, &line(o, d), root)?;
        }
    }

    #[test]
    fn quadrics_are_those_of_integers(q in coefficients(), o in point(4), d in direction(2)) {
        let quadric = Shape::from(Quadric::new(q.map(f64::from)).unwrap());
        let expected = roots(along(q, o, d));
        check(quadric.clone(), &line(o, d), &expected)?;
        for root in expected {
            check_interval(&quadric, &line(o, d), root)?;
        }
    }

    /// A root counts if the clip box has its point: by Sturm, if the equation changes sign in between.
    #[test]
    fn clips_are_exact(q in coefficients(), o in point(4), d in direction(2), low in -3..3i32, size in 0..4i32) {
        let (axis, high) = (1, low + size);
        // Not along the clip's planes. (A fifth of the directions would be: too many to be thrown away.)
        let mut d = d;
        if d[axis] == 0 {
            d[axis] = 1;
        }
        let bounds = Aabb::<f64>::infinite();
        let clip = Aabb::new(
            DVec3::new(bounds.min.x, low.into(), bounds.min.z), DVec3::new(bounds.max.x, high.into(), bounds.max.z)
        );
        let quadric = Quadric::new(q.map(f64::from)).unwrap();
        let clipped = quadric.with_clip(clip).unwrap();
        // The same as an interval of an infinite surface, where the ends are exact: d is a power of two.
        let ends = [low, high].map(|y| f64::from(y - o[axis]) / f64::from(d[axis]));
        let part = line(o, d).with_interval(ends[0].min(ends[1]), ends[0].max(ends[1]));
        let ts = |hits: Vec<ExactSurfaceHit<f64>>| hits.iter().map(|h| h.hit.t).collect::<Vec<_>>();
        prop_assert_eq!(ts(all(&clipped, &line(o, d))), ts(all(&quadric, &part)));
    }

    #[test]
    fn disks_are_those_of_integers(
        c in point(4), n in direction(3), r in 1..6i32, inner in 0..5i32, o in point(6), d in direction(3)
    ) {
        let (inner, l) = (inner.min(r), wide(minus(o, c)));
        let (slope, offset) = (dot(wide(n), wide(d)), dot(wide(n), l));
        // p - c = (l slope - d offset) / slope
        let p: [i128; 3] = core::array::from_fn(|i| l[i] * slope - wide(d)[i] * offset);
        let (distance, unit) = (dot(p, p), slope * slope);
        let inside = slope != 0 && distance <= i128::from(r * r) * unit && i128::from(inner * inner) * unit <= distance;
        let root = roots([0, slope, 2 * offset]);
        let disk = Disk::new(vec(c), vec(n), r.into(), inner.into()).unwrap();
        check(disk.into(), &line(o, d), if inside { &root } else { &[] })?;
        check(Plane::new(vec(c), vec(n)).unwrap().into(), &line(o, d), &root)?;
    }

    /// Entry and exit are the largest and smallest of six quotients, compared in integers.
    #[test]
    fn boxes_are_those_of_integers(min in point(3), size in [0..4, 0..4, 0..4i32], o in point(6), d in direction(3)) {
        let max: P = core::array::from_fn(|i| min[i] + size[i]);
        let cuboid = Cuboid::new(vec(min), vec(max)).unwrap();
        let beside = (0..3).any(|i| d[i] == 0 && !(min[i] <= o[i] && o[i] <= max[i]));
        // Over the common denominator 6, all quotients are integers.
        let end = |i: usize, upper: bool| (if upper { max } else { min }[i] - o[i]) * 6 / d[i];
        let axes = || (0..3).filter(|&i| d[i] != 0);
        let enter = axes().map(|i| end(i, d[i] < 0)).max().unwrap();
        let exit = axes().map(|i| end(i, d[i] > 0)).min().unwrap();
        let root = |x: i32| Root { about: f64::from(x) / 6.0, rounded: Some(f64::from(x) / 6.0), double: enter == exit };
        let expected = match enter.cmp(&exit) {
            _ if beside => vec![],
            core::cmp::Ordering::Less => vec![root(enter), root(exit)],
            core::cmp::Ordering::Equal => vec![root(enter)],
            core::cmp::Ordering::Greater => vec![],
        };
        check(cuboid.into(), &line(o, d), &expected)?;
        prop_assert_eq!(cuboid.overlap_exact(&line(o, d)).is_some(), !expected.is_empty());
    }

    /// In a plane through lattice points, inside or out is decided in the plane's own integer coordinates.
    #[test]
    fn polygons_are_those_of_integers(
        at in point(3), u in direction(2), v in direction(2),
        corners in proptest::collection::vec([-3..=3i32, -3..=3i32], 3..8), o in point(6), d in direction(3),
    ) {
        let vertex = |[x, y]: [i32; 2]| vec(core::array::from_fn(|i| at[i] + x * u[i] + y * v[i]));
        let Ok(polygon) = Polygon::new(vec![corners.iter().map(|c| vertex(*c)).collect()]) else { return Ok(()) };
        let cross = |a: [i128; 3], b: [i128; 3]| [1, 2, 0].map(|i: usize| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            a[j] * b[k] - a[k] * b[j]
        });
        let n = { let [y, z, x] = cross(wide(u), wide(v)); [x, y, z] };
        prop_assume!(n != [0; 3]);
        let (slope, l) = (dot(n, wide(d)), wide(minus(o, at)));
        let offset = dot(n, l);
        // p = (l slope - d offset) / slope = x u + y v, with x = ((p x v).n) / n.n
        let p: [i128; 3] = core::array::from_fn(|i| l[i] * slope - wide(d)[i] * offset);
        let order = |[y, z, x]: [i128; 3]| [x, y, z];
        let (x, y) = (dot(order(cross(p, wide(v))), n), dot(order(cross(wide(u), p)), n));
        let unit = dot(n, n) * slope;
        let (x, y, unit) = if unit < 0 { (-x, -y, -unit) } else { (x, y, unit) };
        let (mut inside, mut boundary) = (false, false);
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            let [ax, ay, bx, by] = [a[0], a[1], b[0], b[1]].map(|c| i128::from(c) * unit);
            let turn = (bx - ax) * (y - ay) - (x - ax) * (by - ay);
            let within = |p, a: i128, b: i128| a.min(b) <= p && p <= a.max(b);
            boundary |= turn == 0 && within(x, ax, bx) && within(y, ay, by);
            inside ^= (ay > y) != (by > y) && (turn > 0) == (by > ay) && turn != 0;
        }
        if slope == 0 || !boundary {
            let root = roots([0, slope, 2 * offset]);
            check(polygon.into(), &line(o, d), if inside && slope != 0 { &root } else { &[] })?;
        }
    }

    /// Every line crosses the boundary of a solid an even number of times, and its crossings ascend.
    #[test]
    fn solids_are_crossed_an_even_number_of_times(
        q in coefficients(), low in point(3), size in [0..5, 0..5, 0..5i32], o in point(6), d in direction(3)
    ) {
        let clip = Aabb::new(vec(low), vec(core::array::from_fn(|i| low[i] + size[i])));
        let solid = Solid::new(Quadric::new(q.map(f64::from)).unwrap().with_clip(clip).unwrap());
        let hits = all(&solid, &line(o, d));
        prop_assert_eq!(hits.iter().filter(|h| h.crosses).count() % 2, 0, "{:?}", hits);
        prop_assert!(hits.is_sorted_by(|a, b| a.hit.t <= b.hit.t));
        prop_assert!(hits.len() <= 4);
        // Halfway between a crossing in and one out the form is not positive and the point is in the box.
        for pair in hits.chunks_exact(2).filter(|p| p[0].crosses && p[1].crosses) {
            let p = vec(o) + vec(d) * (0.5 * (pair[0].hit.t + pair[1].hit.t));
            prop_assert!((clip.min - 1e-9).cmple(p).all() && p.cmple(clip.max + 1e-9).all());
            let [a, b, c, d, e, f, g, h, i, j] = q.map(f64::from);
            let half = DVec3::new(a * p.x + b * p.y + c * p.z, b * p.x + e * p.y + f * p.z, c * p.x + f * p.y + h * p.z);
            prop_assert!(p.dot(half) + 2.0 * p.dot(DVec3::new(d, g, i)) + j <= 1e-9);
        }
    }

    /// A power of two changes nothing but the scale of t, however small or large.
    #[test]
    fn scale_changes_nothing(
        c in point(4), r in 1..6i32, o in point(8), d in direction(3), e in prop_oneof![-900..900i32, -40..40i32]
    ) {
        let s = 2f64.powi(e);
        let near = Sphere::new(vec(c), r.into()).unwrap();
        let far = Sphere::new(vec(c) * s, f64::from(r) * s).unwrap();
        let ray = line(o, d);
        let scaled = Ray::<f64> { origin: ray.origin * s, ..ray };
        let ts = |hits: Vec<ExactSurfaceHit<f64>>, s: f64| hits.iter().map(|h| h.hit.t * s).collect::<Vec<_>>();
        prop_assert_eq!(ts(all(&near, &ray), s), ts(all(&far, &scaled), 1.0));
        let longer = Ray::<f64> { direction: scaled.direction * s, ..scaled };
        prop_assert_eq!(ts(all(&near, &ray), 1.0), ts(all(&far, &longer), 1.0));
    }

    /// The double form is within 16 kappa u of the exact root.
    #[test]
    fn doubles_are_near(
        x in prop::array::uniform9(-1.0..1.0f64), r in 0.2..2.0f64, far in 0.0..4.0f64, q in prop::array::uniform10(-1.0..1.0f64)
    ) {
        let at = |i: usize| DVec3::new(x[i], x[i + 1], x[i + 2]);
        let origin = at(0) * 10f64.powf(far);
        let ray = Ray::<f64>::new(origin, at(3) - origin);
        let moved = |p: DVec3| [1.0, 0.0, 0.0, -p.x, 1.0, 0.0, -p.y, 1.0, -p.z, p.length_squared() - r * r];
        let sphere = Sphere::new(at(6), r).unwrap();
        for (shape, q, center) in [
            (Shape::from(sphere), moved(DVec3::ZERO), at(6)),
            (Quadric::new(q).unwrap().into(), q, DVec3::ZERO),
        ] {
            let (exact, double) = (shape.closest_hit_exact(&ray), shape.closest_hit(&ray));
            prop_assert_eq!(exact.is_some(), double.is_some());
            let (Some(exact), Some(double)) = (exact, double) else { continue };
            let form = |[a, b, c, d, e, f, g, h, i, j]: [f64; 10], p: DVec3| {
                let m = DVec3::new(a * p.x + b * p.y + c * p.z, b * p.x + e * p.y + f * p.z, c * p.x + f * p.y + h * p.z);
                let half = m + DVec3::new(d, g, i);
                (p.dot(half) + p.dot(DVec3::new(d, g, i)) + j, half * 2.0)
            };
            let (o, way) = (ray.origin - center, ray.direction * exact.t);
            let slope = form(q, o + way).1.dot(ray.direction).abs();
            let kappa = form(q.map(f64::abs), o.abs() + way.abs()).0 / (exact.t.abs() * slope);
            prop_assert!((exact.t - double.t).abs() <= 16.0 * kappa * f64::UNIT_ROUNDOFF * exact.t.abs());
        }
    }

    /// Exact parameters of hits on different shapes, and on triangles, compare as the quotients and roots they are.
    #[test]
    fn hits_on_different_surfaces_are_ordered(
        c in point(4), r in 1..6i32, n in direction(3), v in [point(4), point(4), point(4)], o in point(8), d in direction(3)
    ) {
        let ray = line(o, d);
        let shapes = [
            Shape::from(Sphere::new(vec(c), r.into()).unwrap()),
            Plane::new(vec(c), vec(n)).unwrap().into(),
            Cuboid::new(vec(c), vec(c) + f64::from(r)).unwrap().into(),
            Solid::new(Quadric::cylinder(f64::from(r), -2.0, 2.0).unwrap()).into(),
        ];
        let mut found = Vec::new();
        for shape in &shapes {
            for hit in all(shape, &ray) {
                found.push((hit.hit.t, shape.exact_root(&ray, hit.hit.t).unwrap()));
            }
        }
        let exact = ExactRay::new(ray).unwrap();
        found.extend(exact.hit(v.map(vec)).map(|hit| (hit.t, exact.root(&hit))));
        for (t, x) in &found {
            for (s, y) in &found {
                // Rounding is monotone, and different roots of such small equations do not round to one.
                prop_assert_eq!(Some(x.cmp(y)), t.partial_cmp(s), "{} {}", t, s);
            }
        }
    }

    /// Any finite input: no panic, and what is visited is in the interval and ascends.
    #[test]
    fn any_finite_input(bits in prop::array::uniform20(any::<u64>()), narrow in any::<bool>()) {
        let x = bits.map(|b| if narrow { f32::from_bits(b as u32).into() } else { f64::from_bits(b) });
        prop_assume!(x.iter().all(|x: &f64| x.is_finite()));
        let at = |i: usize| DVec3::new(x[i], x[i + 1], x[i + 2]);
        let ray = Ray::<f64>::new(at(0), at(3)).with_interval(x[6].min(x[7]), x[6].max(x[7]));
        let (low, high) = (at(8).min(at(11)), at(8).max(at(11)));
        let q: [f64; 10] = core::array::from_fn(|i| x[10 + i]);
        let quadric = Quadric::new(q).and_then(|q| q.with_clip(Aabb::new(low, high)));
        let shapes = [
            Sphere::new(at(8), x[11].abs()).map(Shape::from),
            Disk::new(at(8), at(11), x[14].abs(), 0.0).map(Shape::from),
            Cuboid::new(low, high).map(Shape::from),
            Polygon::new(vec![vec![at(8), at(11), at(14)]]).map(Shape::from),
            quadric.clone().map(Shape::from),
            quadric.map(|q| Solid::new(q).into()),
        ];
        for shape in shapes.into_iter().flatten() {
            let hits = all(&shape, &ray);
            prop_assert!(hits.iter().all(|h| ray.contains(h.hit.t)));
            prop_assert!(hits.is_sorted_by(|a, b| a.hit.t <= b.hit.t));
        }
    }
}
