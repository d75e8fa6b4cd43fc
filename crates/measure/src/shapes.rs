//! Analytic shapes: what each form of their intersection costs, and how far off it is.

use std::hint::black_box;
use std::time::Duration;

use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{Precision, Primitive, Ray, Shape, ShapeError, Vector3, triangle};
use firsthit_render::Monitor;
use glam::{DVec3, Vec3};

use crate::metric::ulp;
use crate::random::Rng;
use crate::result::ShapeRow;
use crate::timing::{Paired, quantile};

/// A way to intersect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Textbook,
    Stable32,
    Stable64,
    Exact,
}

impl Form {
    /// The last is the reference.
    const ALL: [Self; 4] = [Self::Textbook, Self::Stable32, Self::Stable64, Self::Exact];

    fn name(self) -> &'static str {
        match self {
            Self::Textbook => "textbook f32",
            Self::Stable32 => "stable f32",
            Self::Stable64 => "stable f64",
            Self::Exact => "exact",
        }
    }
}

/// What is intersected: a shape in both precisions, or a triangle.
#[allow(clippy::large_enum_variant, reason = "there are eight")]
enum Subject {
    Shape { name: &'static str, single: Shape<f32>, double: Shape<f64> },
    Triangle([Vec3; 3]),
}

impl Subject {
    fn new(name: &'static str, single: Result<Shape<f32>, ShapeError>) -> Option<Self> {
        let single = single.ok()?;
        // Of the same numbers: those of the f32 shape, exactly.
        let double = single.cast().ok()?;
        Some(Self::Shape { name, single, double })
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Shape { name, .. } => name,
            Self::Triangle(_) => "triangle",
        }
    }

    fn t(&self, form: Form, ray: &Ray<f32>) -> Option<f64> {
        match self {
            Self::Shape { single, double, .. } => match form {
                Form::Textbook => single.closest_hit_fast(ray).map(|h| h.t.into()),
                Form::Stable32 => single.closest_hit(ray).map(|h| h.t.into()),
                Form::Stable64 => double.closest_hit(&ray.to_f64()).map(|h| h.t),
                Form::Exact => double.closest_hit_exact(&ray.to_f64()).map(|h| h.t),
            },
            Self::Triangle(v) => {
                let (v64, ray64) = (v.map(Vector3::to_f64), ray.to_f64());
                match form {
                    Form::Textbook => triangle::intersect(Precision::Fast, *v, ray).map(|h| h.t.into()),
                    Form::Stable32 => triangle::intersect(Precision::Robust, *v, ray).map(|h| h.t.into()),
                    Form::Stable64 => triangle::intersect::<f64>(Precision::Double, v64, &ray64).map(|h| h.t),
                    Form::Exact => triangle::intersect::<f64>(Precision::Exact, v64, &ray64).map(|h| h.t),
                }
            }
        }
    }
}

/// One of each kind, of about unit size around the origin.
fn subjects() -> Vec<Subject> {
    let ring = |r: f32, z: f32| [(r, r), (-r, r), (-r, -r), (r, -r)].map(|(x, y)| Vec3::new(x, y, z)).to_vec();
    let shapes = [
        Subject::new("sphere", Sphere::new(Vec3::new(0.1, 0.0, -0.2), 1.0).map(Shape::from)),
        Subject::new("plane", Plane::new(Vec3::ZERO, Vec3::new(0.1, 1.0, 0.2)).map(Shape::from)),
        Subject::new("disk", Disk::new(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.1), 1.0, 0.25).map(Shape::from)),
        Subject::new("box", Cuboid::new(Vec3::new(-1.0, -0.7, -0.4), Vec3::new(0.8, 0.9, 0.6)).map(Shape::from)),
        Subject::new("polygon", Polygon::new(vec![ring(1.0, 0.0), ring(0.3, 0.0)]).map(Shape::from)),
        Subject::new("quadric", Quadric::ellipsoid(Vec3::new(1.0, 0.6, 0.8)).map(Shape::from)),
        Subject::new("solid", Quadric::cone(0.8, -0.5, 0.7).map(|q| Solid::new(q).into())),
    ];
    let corners = [Vec3::new(-1.0, -0.8, 0.1), Vec3::new(0.9, -0.7, -0.2), Vec3::new(0.1, 1.0, 0.3)];
    shapes.into_iter().flatten().chain([Subject::Triangle(corners)]).collect()
}

/// From a few sizes away into the middle of things.
fn easy(rng: &mut Rng) -> Ray<f32> {
    let origin = rng.direction() * (2.0 + 2.0 * rng.unit());
    Ray::new(origin.as_vec3(), (rng.in_cube() * 0.5 - origin).as_vec3())
}

/// From far away, grazing, or at the rim: in turn.
fn hard(k: usize, rng: &mut Rng) -> Ray<f32> {
    let around = rng.direction();
    match k % 3 {
        0 => {
            let origin = around * 10f64.powf(2.0 + 3.0 * rng.unit());
            Ray::new(origin.as_vec3(), (rng.in_cube() - origin).as_vec3())
        }
        1 => {
            // Nearly in a plane through the middle.
            let origin = DVec3::new(around.x, around.y * 1e-4, around.z) * 3.0;
            let target = DVec3::new(rng.signed(), rng.signed() * 1e-5, rng.signed());
            Ray::new(origin.as_vec3(), (target - origin).as_vec3())
        }
        _ => {
            // Past the unit sphere as a tangent, give or take.
            let side = around.any_orthonormal_vector();
            let touch = around * (1.0 + 1e-6 * rng.signed());
            let origin = touch - side * (1.0 + 20.0 * rng.unit());
            Ray::new(origin.as_vec3(), side.as_vec3())
        }
    }
}

/// Times every form on `count` easy and hard rays and compares them with the last form.
#[must_use]
pub(crate) fn measure(count: usize, repetitions: usize, seed: u64, monitor: &dyn Monitor) -> Vec<ShapeRow> {
    let mut rows = Vec::new();
    for subject in subjects() {
        for kind in ["easy", "hard"] {
            let mut rng = Rng(seed);
            let rays: Vec<Ray<f32>> =
                (0..count).map(|k| if kind == "easy" { easy(&mut rng) } else { hard(k, &mut rng) }).collect();
            let work = |way: usize| {
                let form = Form::ALL[way];
                for ray in &rays {
                    black_box(subject.t(form, black_box(ray)));
                }
            };
            let cancelled = || monitor.cancelled();
            let timed = Paired::run(Form::ALL.len(), (repetitions, repetitions), Duration::ZERO, work, cancelled);
            if monitor.cancelled() {
                return rows;
            }
            let truth: Vec<Option<f64>> = rays.iter().map(|r| subject.t(Form::ALL[Form::ALL.len() - 1], r)).collect();
            for (way, form) in Form::ALL.into_iter().enumerate() {
                let mut row = ShapeRow {
                    shape: subject.name().into(),
                    form: form.name().into(),
                    rays: kind.into(),
                    count: count as u64,
                    ns_per_ray: timed.spread(way).median * 1e9 / count as f64,
                    ..ShapeRow::default()
                };
                let mut off = Vec::new();
                for (ray, truth) in rays.iter().zip(&truth) {
                    match (subject.t(form, ray), *truth) {
                        (Some(_), None) => row.false_hits += 1,
                        (None, Some(_)) => row.false_misses += 1,
                        (Some(t), Some(exact)) => off.push((t - exact).abs() / ulp(exact)),
                        (None, None) => {}
                    }
                }
                off.sort_by(f64::total_cmp);
                (row.t_ulp_p50, row.t_ulp_p99, row.t_ulp_max) =
                    (quantile(&off, 0.5), quantile(&off, 0.99), quantile(&off, 1.0));
                rows.push(row);
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stable_forms_are_better_on_hard_rays() {
        let rows = measure(600, 1, 1, &());
        let find = |shape: &str, form: &str, rays: &str| {
            rows.iter().find(|r| r.shape == shape && r.form == form && r.rays == rays).unwrap()
        };
        assert_eq!(rows.len(), 8 * 2 * Form::ALL.len());
        let (textbook, stable) = (find("sphere", "textbook f32", "hard"), find("sphere", "stable f32", "hard"));
        let wrong = |r: &ShapeRow| r.false_hits + r.false_misses;
        assert!(wrong(textbook) > 2 * wrong(stable), "{textbook:?} {stable:?}");
        for shape in ["sphere", "plane", "disk", "box", "polygon", "quadric", "solid", "triangle"] {
            let easy = find(shape, "stable f32", "easy");
            assert!(easy.ns_per_ray > 0.0 && easy.t_ulp_p50 < 2.0, "{easy:?}");
        }
    }
}
