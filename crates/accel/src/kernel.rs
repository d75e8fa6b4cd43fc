//! Triangle tests by tier, in an object's normalised space.

use firsthit_geometry::{
    Ray,
    triangle::{self, Shear},
};
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

/// A triangle test. `t` is local and counted from the ray's true origin.
pub(crate) trait Kernel {
    /// What is prepared once per ray and instance.
    type Setup;
    fn setup(ray: &LocalRay) -> Self::Setup;
    /// `t`, `u`, `v`; any `t`.
    fn test(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)>;
}

/// Tier `Fast`: Moeller-Trumbore in `f32`.
pub(crate) struct Fast;

impl Kernel for Fast {
    type Setup = Ray<f32>;

    #[inline(always)]
    fn setup(ray: &LocalRay) -> Ray<f32> {
        Ray::new(ray.origin32, ray.direction32).with_interval(f32::NEG_INFINITY, f32::INFINITY)
    }

    #[inline(always)]
    fn test(setup: &Ray<f32>, ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        let hit = triangle::moeller_trumbore(*vertices, setup.origin, setup.direction)?;
        Some((f64::from(hit.t) + ray.shift, hit.u, hit.v))
    }
}

/// Tier `Robust`: the watertight test in `f32`; `t` from the plane and the unrounded ray in `f64`.
pub(crate) struct Robust;

impl Kernel for Robust {
    type Setup = ();

    #[inline(always)]
    fn setup(_: &LocalRay) {}

    #[inline(always)]
    fn test((): &(), ray: &LocalRay, vertices: &[Vec3; 3]) -> Option<(f64, f32, f32)> {
        let w = ray.shear.weights(relative(vertices, ray.origin32))?;
        Some((plane(vertices, ray)?, w.u, w.v))
    }
}

/// Apart from the loop, since few triangles come so far.
#[inline(never)]
fn plane(vertices: &[Vec3; 3], ray: &LocalRay) -> Option<f64> {
    triangle::plane_parameter(double(vertices), ray.origin, ray.direction)
}

/// Tier `Double`: the same in `f64`, with the unrounded ray.
pub(crate) struct Double;

impl Kernel for Double {
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
}
