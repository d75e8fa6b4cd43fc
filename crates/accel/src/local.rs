//! A ray inside an instance: where double precision ends and `f32` begins.
//!
//! The world's ray is carried into the object's space in `f64`, its direction scaled by a power of two so that the
//! largest component is in [1, 2), and its origin moved along it to near the object. Only then is it rounded to `f32`,
//! once: the distance to the object costs no digit.
//!
//! # Why no box is missed
//! With u = 2^-24, R the largest coordinate difference between the moved origin o and the object, and d the direction:
//! * rounding o and d moves the ray by at most u|o| + uR in each axis within the object;
//! * the watertight test decides for a triangle whose vertices are off by at most 6 uR: rounding of `v - o` (u|v - o|
//!   in two axes), of the shear (u), of its product (u) and of the difference (u(|x| + |z|)).
//!
//! So a triangle that the `f32` test accepts lies within `u|o| + 8uR` of the exact ray ([`LocalRay::reach`]; a little
//! more where moving the origin was rounded), and boxes that are met as if they were larger by a little more than that contain every hit: the answer is that of testing all
//! triangles, whatever the tree.
//!
//! Setups that not every tier needs (of the box test, of a triangle test) are made by those who need them.

use core::cmp::Ordering;

use firsthit_geometry::{
    Aabb, Precision, Ray, Real,
    slab::Slabs,
    transform::Transform,
    triangle::{self, Shear},
};
use glam::{DVec3, Vec3};

/// Unit roundoff of `f32`.
const U: f64 = f32::UNIT_ROUNDOFF as f64;

/// How far outside a ray may be moved nearer, and where to: multiples of the object's half size.
const FAR: f64 = 8.0;

/// Half the difference between an object's box and the box that is put into the tree over instances, in each axis: more
/// than any [`LocalRay::reach`].
pub(crate) fn instance_padding(bounds: &Aabb<f64>) -> DVec3 {
    // R <= (FAR + 1) half sizes; |o| <= |center| + FAR half sizes; 10 uR + 5u|o| <= 130 u half + 5u|center|.
    DVec3::splat(half_size(bounds) * 144.0 * U) + bounds.center().abs() * (6.0 * U) + TINY
}

/// In units of a normalised object, of size near 1: covers directions so small that their rounding to `f32` is not
/// relative.
const TINY: f64 = 1.0 / (1u64 << 40) as f64;

fn half_size(bounds: &Aabb<f64>) -> f64 {
    bounds.extent().max_element() * 0.5
}

/// Where an object is and how large: a cube around its box.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Extent {
    center: DVec3,
    /// Half the longest side of the box.
    half: f64,
}

impl Extent {
    /// A point at the origin for an object without a box.
    pub(crate) fn new(bounds: &Aabb<f64>) -> Self {
        if bounds.is_empty() { Self::default() } else { Self { center: bounds.center(), half: half_size(bounds) } }
    }
}

/// A ray in an object's normalised space. Its parameter is `world t * t_scale`.
#[derive(Clone, Debug)]
pub(crate) struct LocalRay {
    /// The ray's own origin.
    pub(crate) origin: DVec3,
    /// Direction, largest component in [1, 2).
    pub(crate) direction: DVec3,
    /// A power of two.
    pub(crate) t_scale: f64,
    /// The moved origin is `origin + shift * direction`, and its parameter counts from there.
    pub(crate) shift: f64,
    /// The ray's interval in this space's parameter.
    pub(crate) interval: [f64; 2],
    moved: DVec3,
    /// How far moving may have rounded the origin off the line, in each axis.
    off: f64,
    /// Largest coordinate difference between the moved origin and the object.
    farthest: f64,
    /// The moved origin in single precision.
    pub(crate) origin32: Vec3,
    /// The direction in single precision.
    pub(crate) direction32: Vec3,
}

impl LocalRay {
    /// Enters the object. `None` where the ray is not finite there, or its direction shorter or longer than about
    /// 2^-511 or 2^511: numbers that have no room for products.
    #[inline(always)]
    pub(crate) fn enter(ray: &Ray<f64>, transform: &Transform, object: &Extent) -> Option<Self> {
        let Extent { center, half } = *object;
        let origin = transform.point_to_object(ray.origin);
        let direction = transform.vector_to_object(ray.direction);
        let length = direction.abs().max_element().power_of_two_below();
        let direction = direction * (1.0 / length);
        if !(origin.is_finite() && direction.is_finite() && (1.0..2.0).contains(&direction.abs().max_element())) {
            return None;
        }
        let relative = origin - center;
        let (mut shift, mut off) = (0.0, 0.0);
        if relative.abs().max_element() > FAR * half {
            // From the point nearest to the centre back by the size of the box, which is more than half its diagonal.
            shift = -relative.dot(direction) / direction.dot(direction) - 2.0 * half;
            // Components of the direction are below 2. The f64 tests see the object from the true origin, with some more
            // roundings of the same size.
            off = shift.abs() * (32.0 * f64::UNIT_ROUNDOFF);
        }
        let moved = origin + direction * shift;
        let interval = [ray.t_min * length, ray.t_max * length];
        let farthest = (moved - center).abs().max_element() + half;
        let (origin32, direction32) = (moved.as_vec3(), direction.as_vec3());
        Some(Self { origin, direction, t_scale: length, shift, interval, moved, off, farthest, origin32, direction32 })
    }

    /// How far from the ray, in each axis, a primitive may lie that the tests accept.
    #[inline]
    pub(crate) fn reach(&self) -> DVec3 {
        self.moved.abs() * U + (8.0 * U * self.farthest + self.off)
    }

    /// Setup of the box test: plain, or `PADDED` so that boxes are met as if larger by more than [`LocalRay::reach`].
    #[inline(always)]
    pub(crate) fn slabs<const PADDED: bool>(&self) -> Slabs<f32> {
        let slabs = Slabs::new(self.origin32, self.direction32);
        if !PADDED {
            return slabs;
        }
        slabs.widened(self.delta())
    }

    /// By how much, in each axis, boxes are met as if larger: more than [`LocalRay::reach`].
    #[inline(always)]
    pub(crate) fn delta(&self) -> Vec3 {
        // Four more u|o|: for rounding the origin, adding this to it, multiplying it with the reciprocal (where the
        // test does so), and to spare; 2uR to be above `reach` whatever rounds.
        (self.moved.abs() * (5.0 * U) + (10.0 * U * self.farthest + self.off + TINY)).as_vec3()
    }

    /// A parameter of the world's ray as the start of the box tests' interval: not above it.
    #[inline]
    pub(crate) fn box_t_min(&self, t: f64) -> f32 {
        self.box_t(t, -1.0)
    }

    /// A parameter of the world's ray as the end of the box tests' interval: so far above it that a box which begins
    /// beyond holds no hit at or before `t`.
    #[inline]
    pub(crate) fn box_t_max(&self, t: f64) -> f32 {
        self.box_t(t, 1.0)
    }

    #[inline(always)]
    fn box_t(&self, t: f64, side: f64) -> f32 {
        let t = t * self.t_scale;
        let local = t - self.shift;
        // Entry into a box has four roundings in f32 (and one more is made here), `local` and `t` have a few in f64.
        let error = local.abs() * (16.0 * U) + (t.abs() + self.shift.abs()) * (16.0 * f64::UNIT_ROUNDOFF);
        (local + side * error).to_f32()
    }

    /// Whether an edge function of the triangle is so small that what the tier rounds may have decided its sign.
    pub(crate) fn near_edge(&self, vertices: [DVec3; 3], precision: Precision) -> bool {
        // By how much vertices are off, seen from the ray.
        let (origin, off) = match precision {
            // Moeller and Trumbore's test rounds otherwise, but no less.
            Precision::Fast | Precision::Robust => (self.moved, self.reach().max_element()),
            Precision::Double => {
                let farthest = vertices.iter().fold(0.0f64, |m, v| m.max((*v - self.origin).abs().max_element()));
                (self.origin, 8.0 * f64::UNIT_ROUNDOFF * farthest)
            }
            Precision::Exact => return false,
        };
        // The shear adds one coordinate to another.
        let off = 2.0 * off;
        let shear = Shear::<f64>::new(self.direction);
        let p = vertices.map(|v| shear.apply(v - origin));
        [(0, 1), (1, 2), (2, 0)].into_iter().any(|(i, j)| {
            let ((ax, ay), (bx, by)) = (p[i], p[j]);
            let size = ax.abs() + ay.abs() + bx.abs() + by.abs();
            !((bx * ay - by * ax).abs() > off * (size + 2.0 * off))
        })
    }

    /// Sign of the ray's direction along the triangle's normal, as the tier's test sees it.
    pub(crate) fn side(&self, vertices: [DVec3; 3], precision: Precision) -> Ordering {
        let (side, along) = match precision {
            Precision::Fast => (0.0.partial_cmp(&-triangle::area_vector(vertices).dot(self.direction)), 1.0),
            Precision::Robust => {
                let shear = Shear::<f32>::new(self.direction32);
                let side = shear.side(vertices.map(|v| v.as_vec3() - self.origin32));
                (Some(side), self.direction[shear.axis()])
            }
            Precision::Double | Precision::Exact => {
                let shear = Shear::<f64>::new(self.direction);
                (Some(shear.side(vertices.map(|v| v - self.origin))), self.direction[shear.axis()])
            }
        };
        let side = side.unwrap_or(Ordering::Equal);
        if along < 0.0 { side.reverse() } else { side }
    }

    /// Raises `t` (local, counted from the true origin) to where the ray enters the primitive's own box, and lowers it
    /// to where it leaves: the rule by which a hit never lies before a box that holds it, so that skipping boxes cannot
    /// change the answer. The box is widened by [`LocalRay::reach`]; `None` when the ray misses even that.
    #[inline(always)]
    pub(crate) fn within_box(&self, t: f64, aabb: &Aabb<f64>) -> Option<f64> {
        let reach = self.reach();
        let wide = Aabb::new(aabb.min - reach, aabb.max + reach);
        let slabs = Slabs::new(self.moved, self.direction);
        let (enter, leave) = slabs.padded(&wide, f64::NEG_INFINITY, f64::INFINITY);
        (enter <= leave).then(|| t.min(leave + self.shift).max(enter + self.shift))
    }
}
