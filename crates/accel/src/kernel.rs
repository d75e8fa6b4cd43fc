//! Triangle tests by tier, in an object's normalised space.

use firsthit_geometry::{
    Ray,
    exact::ExactRay,
    triangle::{self, Shear},
};
use glam::{DVec3, Vec3};

use crate::local::LocalRay;
use crate::simd::Lanes;
use crate::wide::{Either, Filter, Margin, Plain, Sheared};

// Written out: `map` on arrays is not always inlined.

#[inline(always)]
fn relative(v: &[Vec3; 3], origin: Vec3) -> [Vec3; 3] {
    [v[0] - origin, v[1] - origin, v[2] - origin]
}

/// The vertices in double precision, exactly.
#[inline(always)]
pub(crate) fn double(v: &[Vec3; 3]) -> [DVec3; 3] {
    [v[0].as_dvec3(), v[1].as_dvec3(), v[2].as_dvec3()]
}

/// What a triangle test finds. `t` is local and counted from the ray's true origin; any `t`.
pub(crate) struct Found {
    pub(crate) t: f64,
    pub(crate) u: f32,
    pub(crate) v: f32,
    /// `f64` could not decide.
    pub(crate) fallback: bool,
}

impl Found {
    #[inline(always)]
    fn new(t: f64, u: f32, v: f32) -> Self {
        Self { t, u, v, fallback: false }
    }
}

/// How a tier meets boxes and triangles.
pub(crate) trait Kernel {
    /// Boxes are met as if larger by all that is rounded, so that none with a hit is missed.
    const PADDED: bool;
    /// Hits are kept within their primitive's box: see [`LocalRay::within_box`].
    const CLAMPED: bool;
    /// What is prepared once per ray and instance.
    type Setup;
    /// Picks from eight triangles those that are worth a test.
    type Filter<L: Lanes>: Filter<L>;
    fn setup(ray: &LocalRay) -> Self::Setup;
    fn filter<L: Lanes>(setup: &Self::Setup, ray: &LocalRay) -> Self::Filter<L>;
    /// The hit, if there is one; beyond `t_max` it is not wanted, but may be given.
    fn test(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found>;
    /// The same if the triangle answers for the crossing, see [`crate::Crossings::Surfaces`].
    #[inline(always)]
    fn crosses(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        Self::test(setup, ray, vertices, t_max)
    }
}

/// Tier `Fast`: Moeller-Trumbore in `f32`.
pub(crate) struct Fast;

impl Kernel for Fast {
    const PADDED: bool = false;
    const CLAMPED: bool = false;
    type Setup = ();
    type Filter<L: Lanes> = Plain<L>;

    #[inline(always)]
    fn setup(_: &LocalRay) {}

    #[inline(always)]
    fn filter<L: Lanes>((): &(), ray: &LocalRay) -> Plain<L> {
        Plain::new(ray.origin32, ray.direction32)
    }

    #[inline(always)]
    fn test((): &(), ray: &LocalRay, vertices: &[Vec3; 3], _: f64) -> Option<Found> {
        let hit = triangle::moeller_trumbore::<f32>(*vertices, ray.origin32, ray.direction32)?;
        Some(Found::new(f64::from(hit.t) + ray.shift, hit.u, hit.v))
    }
}

/// Tier `Robust` with its guards, see [`crate::Guards`]: all on, it is the watertight test in `f32`, and `t` from the
/// plane and the unrounded ray in `f64`.
pub(crate) struct Robust<const PADDING: bool, const WATERTIGHT: bool, const FALLBACK: bool, const PLANE_T: bool>;

impl<const PADDING: bool, const WATERTIGHT: bool, const FALLBACK: bool, const PLANE_T: bool> Kernel
    for Robust<PADDING, WATERTIGHT, FALLBACK, PLANE_T>
{
    const PADDED: bool = PADDING;
    const CLAMPED: bool = PADDING;
    type Setup = Shear<f32>;
    type Filter<L: Lanes> = Either<L, WATERTIGHT>;

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Shear<f32> {
        Shear::new(ray.direction32)
    }

    #[inline(always)]
    fn filter<L: Lanes>(shear: &Shear<f32>, ray: &LocalRay) -> Either<L, WATERTIGHT> {
        Either {
            plain: Plain::new(ray.origin32, ray.direction32),
            sheared: Sheared::new(ray.origin32, ray.direction32, shear, 0.0, slack(ray)),
        }
    }

    #[inline(always)]
    fn test(shear: &Shear<f32>, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        if !WATERTIGHT {
            let hit = Fast::test(&(), ray, vertices, t_max)?;
            return Some(if PLANE_T { Found { t: plane(vertices, ray)?, ..hit } } else { hit });
        }
        let relative = relative(vertices, ray.origin32);
        let w = if FALLBACK { shear.weights(relative) } else { shear.weights_unguarded(relative) }?;
        let t = if PLANE_T {
            plane(vertices, ray)?
        } else {
            // The depth of the weighted point along the axis that the ray follows most.
            let axis = shear.axis();
            let [a, b, c] = relative.map(|p| p[axis]);
            let t = ((1.0 - w.u - w.v) * a + w.u * b + w.v * c) / ray.direction32[axis];
            f64::from(t) + ray.shift
        };
        Some(Found::new(t, w.u, w.v))
    }

    #[inline(always)]
    fn crosses(shear: &Shear<f32>, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        if !WATERTIGHT {
            return Self::test(shear, ray, vertices, t_max);
        }
        let w = shear.crosses(relative(vertices, ray.origin32))?;
        Some(Found::new(crossing(vertices, ray, f64::from(w.u), f64::from(w.v)), w.u, w.v))
    }
}

#[inline(always)]
fn plane(vertices: &[Vec3; 3], ray: &LocalRay) -> Option<f64> {
    triangle::plane_parameter(double(vertices), ray.origin, ray.direction)
}

/// Where the ray crosses a triangle with these weights. No crossing may be lost, so where the plane does not tell (the
/// ray lies in it, but for rounding) the depth of the vertices does.
#[inline(never)]
fn crossing(vertices: &[Vec3; 3], ray: &LocalRay, u: f64, v: f64) -> f64 {
    plane(vertices, ray).unwrap_or_else(|| {
        let [a, b, c] = double(vertices);
        let point = a * (1.0 - u - v) + b * u + c * v;
        (point - ray.origin).dot(ray.direction) / ray.direction.dot(ray.direction)
    })
}

/// What the unrounded ray may meet, by the ray as rounded to `f32`.
#[inline(always)]
fn margin<L: Lanes>(ray: &LocalRay) -> Margin<L> {
    // A sheared coordinate takes in the errors of two axes; the rest is for the rounding of this line.
    let off = (ray.reach().max_element() * 2.1) as f32;
    Margin(Sheared::new(ray.origin32, ray.direction32, &Shear::new(ray.direction32), off, slack(ray)))
}

/// How far outside its own depths a triangle may be hit: it is kept within its box, which is met as if larger, and seen
/// with rounded vertices.
#[inline(always)]
fn slack(ray: &LocalRay) -> f32 {
    2.0 * ray.delta().max_element()
}

/// Tier `Double`: the same in `f64`, with the unrounded ray.
pub(crate) struct Double;

impl Kernel for Double {
    const PADDED: bool = true;
    const CLAMPED: bool = true;
    type Setup = Shear<f64>;
    type Filter<L: Lanes> = Margin<L>;

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Shear<f64> {
        Shear::new(ray.direction)
    }

    #[inline(always)]
    fn filter<L: Lanes>(_: &Shear<f64>, ray: &LocalRay) -> Margin<L> {
        margin(ray)
    }

    #[inline(always)]
    fn test(setup: &Shear<f64>, ray: &LocalRay, vertices: &[Vec3; 3], _: f64) -> Option<Found> {
        let [a, b, c] = double(vertices);
        let w = setup.weights([a - ray.origin, b - ray.origin, c - ray.origin])?;
        Some(Found::new(plane(vertices, ray)?, w.u as f32, w.v as f32))
    }

    #[inline(always)]
    fn crosses(setup: &Shear<f64>, ray: &LocalRay, vertices: &[Vec3; 3], _: f64) -> Option<Found> {
        let [a, b, c] = double(vertices);
        let w = setup.crosses([a - ray.origin, b - ray.origin, c - ray.origin])?;
        Some(Found::new(crossing(vertices, ray, w.u, w.v), w.u as f32, w.v as f32))
    }
}

/// Tier `Exact`: exact decisions for the unrounded ray in the instance's own space.
///
/// Boxes are padded as for the other tiers, hits are not kept within them: `t` stays correctly rounded. No box is missed
/// all the same. An exact hit is a point of the exact line in the triangle's `f32` box, which is exact; the ray of the
/// box test is off that line by less than the boxes are widened ([`LocalRay::slabs`]), and the ends of its interval
/// leave room for the rounding of `t` ([`LocalRay::box_t_max`]).
pub(crate) struct Exact;

impl Kernel for Exact {
    const PADDED: bool = true;
    const CLAMPED: bool = false;
    type Setup = Option<ExactRay>;
    type Filter<L: Lanes> = Margin<L>;

    #[inline(always)]
    fn filter<L: Lanes>(_: &Option<ExactRay>, ray: &LocalRay) -> Margin<L> {
        margin(ray)
    }

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Option<ExactRay> {
        let [t_min, t_max] = ray.interval;
        let exact = ExactRay::new(Ray { origin: ray.origin, direction: ray.direction, t_min, t_max })?;
        Some(if ray.shift == 0.0 { exact } else { exact.near(ray.shift) })
    }

    #[inline(always)]
    fn test(setup: &Option<ExactRay>, _: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        let hit = setup.as_ref()?.hit_before(double(vertices), t_max)?;
        Some(Found { t: hit.t, u: hit.u as f32, v: hit.v as f32, fallback: hit.fallback })
    }

    #[inline(always)]
    fn crosses(setup: &Option<ExactRay>, _: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        let hit = setup.as_ref()?.hit_before(double(vertices), t_max).filter(|h| h.crosses)?;
        Some(Found { t: hit.t, u: hit.u as f32, v: hit.v as f32, fallback: hit.fallback })
    }
}
