//! Triangle tests by tier, in an object's normalised space.

use firsthit_geometry::triangle::{self, Shear};
use glam::{DVec3, Vec3};

use crate::local::LocalRay;

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

/// How a tier meets boxes and triangles. `t` is local and counted from the ray's true origin.
pub(crate) trait Kernel {
    /// Boxes are met as if larger by all that is rounded, so that none with a hit is missed.
    const PADDED: bool;
    /// Hits are kept within their primitive's box: see [`LocalRay::within_box`].
    const CLAMPED: bool;
    /// What is prepared once per ray and instance.
    type Setup;
    fn setup(ray: &LocalRay) -> Self::Setup;
    /// `t`, `u`, `v`; any `t`.
    fn test(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)>;
    /// The same if the triangle answers for the crossing, see [`crate::Crossings::Surfaces`].
    #[inline(always)]
    fn crosses(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        Self::test(setup, ray, vertices)
    }
}

/// Tier `Fast`: Moeller-Trumbore in `f32`.
pub(crate) struct Fast;

impl Kernel for Fast {
    const PADDED: bool = false;
    const CLAMPED: bool = false;
    type Setup = ();

    #[inline(always)]
    fn setup(_: &LocalRay) {}

    #[inline(always)]
    fn test((): &(), ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        let hit = triangle::moeller_trumbore::<f32>(*vertices, ray.origin32, ray.direction32)?;
        Some((f64::from(hit.t) + ray.shift, hit.u, hit.v))
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

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Shear<f32> {
        Shear::new(ray.direction32)
    }

    #[inline(always)]
    fn test(shear: &Shear<f32>, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        if !WATERTIGHT {
            let (t, u, v) = Fast::test(&(), ray, vertices)?;
            return Some((if PLANE_T { plane(vertices, ray)? } else { t }, u, v));
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
        Some((t, w.u, w.v))
    }

    #[inline(always)]
    fn crosses(shear: &Shear<f32>, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        if !WATERTIGHT {
            return Self::test(shear, ray, vertices);
        }
        let w = shear.crosses(relative(vertices, ray.origin32))?;
        Some((crossing(vertices, ray, f64::from(w.u), f64::from(w.v)), w.u, w.v))
    }
}

/// Apart from the loop, since few triangles come so far.
#[inline(never)]
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

/// Tier `Double`: the same in `f64`, with the unrounded ray.
pub(crate) struct Double;

impl Kernel for Double {
    const PADDED: bool = true;
    const CLAMPED: bool = true;
    type Setup = Shear<f64>;

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Shear<f64> {
        Shear::new(ray.direction)
    }

    #[inline(always)]
    fn test(setup: &Shear<f64>, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        let [a, b, c] = double(vertices);
        let w = setup.weights([a - ray.origin, b - ray.origin, c - ray.origin])?;
        Some((plane(vertices, ray)?, w.u as f32, w.v as f32))
    }

    #[inline(always)]
    fn crosses(setup: &Shear<f64>, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        let [a, b, c] = double(vertices);
        let w = setup.crosses([a - ray.origin, b - ray.origin, c - ray.origin])?;
        Some((crossing(vertices, ray, w.u, w.v), w.u as f32, w.v as f32))
    }
}
