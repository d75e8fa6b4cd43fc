//! Rays and triangles of any numbers.

use firsthit_geometry::exact::{ExactHit, ExactRay};
use firsthit_geometry::{Precision, Ray, Real, Vector3, triangle};
use glam::DVec3;

use crate::bytes::Bytes;
use crate::exact::{self, Exact};

/// A tetrahedron and a ray. Each face: no panic, no NaN; a hit lies in the interval and on the triangle; the exact test
/// is right to the last bit, and the others where their arithmetic leaves a margin. All of it: crossed an even number of
/// times by the line.
pub fn triangle(data: &[u8]) -> bool {
    let mut bytes = Bytes::new(data);
    let double = bytes.flag();
    let p = [(); 4].map(|()| bytes.vector(double));
    let weights = [bytes.double(), bytes.double()];
    let target = p[0] + (p[1] - p[0]) * weights[0] + (p[2] - p[0]) * weights[1];
    let target = [p[0], p[0].midpoint(p[1]), target][bytes.below(3)];
    let ray = bytes.ray(target, double);

    let faces = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]].map(|f| f.map(|i: usize| p[i]));
    for face in faces {
        let context = || format!("{face:?} {ray:?}");
        tiers::<f64>(face, &ray, &context);
        let single = ray.direction.as_vec3().as_dvec3() == ray.direction;
        if !double && single {
            tiers::<f32>(face, &ray, &context);
        }
    }
    let finite = ray.is_valid() && p.iter().all(|p| p.is_finite());
    if finite {
        faces_exactly(faces, &ray, bytes.double());
        let crossed = faces.iter().filter(|f| exact::line_triangle(&ray, **f).is_some_and(|h| h.crosses)).count();
        assert_eq!(crossed % 2, 0, "{p:?} {ray:?}");
    }
    finite && faces.iter().any(|f| exact::ray_triangle(&ray, *f).is_some())
}

fn tiers<R: Real>(face: [DVec3; 3], ray: &Ray<f64>, context: &dyn Fn() -> String) {
    let v = face.map(R::Vec3::from_f64);
    let cast = Ray::<R> {
        origin: R::Vec3::from_f64(ray.origin),
        direction: R::Vec3::from_f64(ray.direction),
        t_min: R::from_f64(ray.t_min),
        t_max: R::from_f64(ray.t_max),
    };
    for precision in Precision::ALL {
        let Some(hit) = triangle::intersect(precision, v, &cast) else { continue };
        let say = || format!("{precision} {hit:?} {}", context());
        assert!(cast.is_valid(), "{}", say());
        assert!(hit.t.is_finite() && cast.contains(hit.t), "{}", say());
        assert!([hit.u, hit.v].iter().all(|&w| w >= R::ZERO && w <= R::ONE), "{}", say());
        assert!(hit.u.to_f64() + hit.v.to_f64() <= 1.0 + 4.0 * R::UNIT_ROUNDOFF.to_f64(), "{}", say());
    }
    // Anything at all along the line: then the interval is out of the question.
    if !cast.is_valid() || !face.iter().all(|p| p.is_finite()) {
        return;
    }
    let line = cast.with_interval(-R::INFINITY, R::INFINITY);
    let truth = exact::line_triangle(ray, face);
    for precision in Precision::ALL.into_iter().filter(|p| *p != Precision::Fast) {
        let digits = if precision == Precision::Robust && R::UNIT_ROUNDOFF.to_f64() > 1e-10 { 24 } else { 53 };
        if let Some(inside) = clear(face, ray, digits)
            && truth.as_ref().is_none_or(|h| h.t.cmp_float(1e30).is_lt() && h.t.cmp_float(-1e30).is_gt())
        {
            let hit = triangle::intersect(precision, v, &line);
            assert_eq!(hit.is_some(), inside, "{precision} {digits} {}", context());
            assert_eq!(truth.is_some(), inside, "{}", context());
        }
    }
}

/// Whether the line goes through the triangle, if arithmetic of so many digits leaves no doubt: each edge function
/// differs from 0 by 64 times what a rounding of its two vertices is worth. `None` in doubt.
fn clear(face: [DVec3; 3], ray: &Ray<f64>, digits: i32) -> Option<bool> {
    let (o, d) = (exact::vector(ray.origin), exact::vector(ray.direction));
    let v = face.map(|p| exact::minus(&exact::vector(p), &o));
    // Products of what lies far below the largest number underflow.
    let floor = &v.iter().map(exact::size).max()? * &Exact::power_of_two(if digits == 24 { -100 } else { -450 });
    let sizes = [0, 1, 2].map(|i| exact::size(&v[i]).max(floor.clone()));
    let mut signs = [0; 3];
    for (i, sign) in signs.iter_mut().enumerate() {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let edge = exact::dot(&d, &exact::cross(&v[j], &v[k]));
        let unit = &(&(&sizes[j] * &sizes[k]) * &exact::size(&d)) * &Exact::power_of_two(6 - digits);
        if edge.abs() > unit {
            *sign = edge.signum();
        }
    }
    if signs.contains(&1) && signs.contains(&-1) {
        return Some(false);
    }
    (!signs.contains(&0)).then_some(true)
}

/// The exact test of each face against exact numbers, also seen from nearer; the order of the hits; the parity.
fn faces_exactly(faces: [[DVec3; 3]; 4], ray: &Ray<f64>, near: f64) {
    let Some(plain) = ExactRay::new(*ray) else { panic!("{ray:?} is valid") };
    for exact_ray in [Some(plain), near.is_finite().then(|| plain.near(near))].into_iter().flatten() {
        let mut hits: Vec<(ExactHit, exact::Crossed)> = Vec::new();
        for face in faces {
            let say = || format!("{face:?} {ray:?} near {near:?}");
            let truth = exact::ray_triangle(ray, face);
            let hit = exact_ray.hit(face);
            let (hit, truth) = match (hit, truth) {
                (Some(hit), Some(truth)) => (hit, truth),
                (None, None) => continue,
                // Beyond the largest number.
                (None, Some(truth)) if truth.t.cmp_float(f64::MAX).is_gt() || truth.t.cmp_float(f64::MIN).is_lt() => {
                    continue;
                }
                (hit, truth) => panic!("{hit:?} where {truth:?} is right: {}", say()),
            };
            assert!(exact::is_nearest(hit.t, |x| truth.t.cmp_exact(x)), "{hit:?} {}", say());
            let t = exact_ray.t_f32(&hit);
            assert!(t.is_infinite() || exact::is_nearest_f32(t, |x| truth.t.cmp_exact(x)), "{t} {hit:?} {}", say());
            assert_eq!(hit.crosses, truth.crosses, "{hit:?} {}", say());
            let unit = 0.0..=1.0;
            assert!(unit.contains(&hit.u) && unit.contains(&hit.v), "{hit:?} {}", say());
            assert!(exact_ray.hit_before(face, hit.t).is_some(), "{hit:?} {}", say());
            for (other, t) in &hits {
                assert_eq!(exact_ray.order(&hit, other), truth.t.compare(&t.t), "{hit:?} {other:?} {}", say());
            }
            hits.push((hit, truth));
        }
    }
}
