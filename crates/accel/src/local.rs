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
//! more where moving the origin was rounded). The hit is where that ray meets the triangle's plane: within eight times
//! this of the triangle, unless the ray grazes it; then it is moved into the triangle's box
//! ([`Line::within_box`]). Boxes are met as if they were larger by a little more ([`LocalRay::delta`]), so they
//! contain every hit: the answer is that of testing all triangles, whatever the tree.
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
pub(crate) const U: f64 = f32::UNIT_ROUNDOFF as f64;

/// How far outside a ray may be moved nearer, and where to: multiples of the object's half size.
pub(crate) const FAR: f64 = 8.0;

/// Half the difference between an object's box and the box that is put into the tree over instances, in each axis: more
/// than eight times any [`LocalRay::reach`].
pub(crate) fn instance_padding(bounds: &Aabb<f64>) -> DVec3 {
    // R <= (FAR + 1) half sizes; |o| <= |center| + FAR half sizes; 8 (8 uR + u|o|) <= 640 u half + 8u|center|.
    DVec3::splat(half_size(bounds) * 720.0 * U) + bounds.center().abs() * (10.0 * U) + TINY
}

/// In units of a normalised object, of size near 1: covers directions so small that their rounding to `f32` is not
/// relative.
pub(crate) const TINY: f64 = 1.0 / (1u64 << 40) as f64;

/// The largest component by magnitude; where one is NaN, some.
#[inline(always)]
fn largest(v: DVec3) -> f64 {
    let [x, y, z] = v.abs().to_array();
    let xy = if x > y { x } else { y };
    if xy > z { xy } else { z }
}

/// The bits of an `f64`'s exponent.
const EXPONENT: u64 = 0x7ff << 52;

fn half_size(bounds: &Aabb<f64>) -> f64 {
    bounds.extent().max_element() * 0.5
}

/// Where an object is and how large: a cube around its box.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Extent {
    center: DVec3,
    /// Largest coordinate of the centre.
    magnitude: f64,
    /// Half the longest side of the box.
    half: f64,
    /// By how much boxes are met as if larger by rays that start in the cube or just beside it, and by all that are not moved.
    deltas: [f32; 2],
}

/// Rays start just beside a cube up to so many of its half sizes from the middle, in each axis.
const BESIDE: f64 = 1.0625;

impl Extent {
    /// A point at the origin for an object without a box.
    pub(crate) fn new(bounds: &Aabb<f64>) -> Self {
        if bounds.is_empty() {
            return Self::default();
        }
        let (center, half) = (bounds.center(), half_size(bounds));
        let magnitude = largest(center);
        let deltas = [BESIDE, FAR].map(|far| delta((far + 1.0) * half, magnitude, 0.0).to_f32());
        Self { center, magnitude, half, deltas }
    }

    /// Its centre, the largest coordinate of that, and half the longest side.
    #[inline(always)]
    pub(crate) fn parts(&self) -> ([f64; 3], f64, f64) {
        (self.center.to_array(), self.magnitude, self.half)
    }

    /// How far from the centre rays start, in each axis, that are surely not moved, and those just beside the cube; each with what is not
    /// below their [`LocalRay::delta`].
    #[inline(always)]
    pub(crate) fn bounds_of_rays(&self) -> [(f64, f32); 2] {
        // A little less, since the sum with the half size is rounded.
        const LESS: f64 = 1.0 - 4.0 * f64::UNIT_ROUNDOFF;
        [(FAR * LESS * self.half, self.deltas[1]), (BESIDE * LESS * self.half, self.deltas[0])]
    }
}

/// The power of two at or below a direction's largest component, and its reciprocal: numbers by which nothing is rounded.
/// `None` where that component has no room for products, or is no number.
#[inline(always)]
pub(crate) fn scales(largest: f64) -> Option<(f64, f64)> {
    // The exponent alone, which is not that of 0, of a denormal, of infinity or of what is not a number.
    let exponent = largest.to_bits() & EXPONENT;
    if exponent.wrapping_sub(512 << 52) > 1022 << 52 {
        return None;
    }
    // Exact: the biased exponents of the two add up to twice the bias.
    Some((f64::from_bits(exponent), f64::from_bits((2046 << 52) - exponent)))
}

/// [`LocalRay::shift`] and [`LocalRay::off`] of a ray that is far from its object; the origin is given relative to the centre.
#[cold]
#[inline(never)]
pub(crate) fn far(relative: DVec3, direction: DVec3, half: f64) -> (f64, f64) {
    // From the point nearest to the centre back by the size of the box, which is more than half its diagonal.
    let shift = -relative.dot(direction) / direction.dot(direction) - 2.0 * half;
    // Components of the direction are below 2. The f64 tests see the object from the true origin, with some more
    // roundings of the same size.
    (shift, shift.abs() * (32.0 * f64::UNIT_ROUNDOFF))
}

/// See [`LocalRay::most`].
#[inline(always)]
pub(crate) fn most(farthest: f64, magnitude: f64, off: f64) -> f64 {
    // The moved origin is no larger than its distance and the centre.
    farthest * (9.1 * U) + (magnitude * (1.1 * U) + off)
}

/// See [`LocalRay::delta`].
#[inline(always)]
pub(crate) fn delta(farthest: f64, magnitude: f64, off: f64) -> f64 {
    // Four more u|o|: for rounding the origin, adding this to it, multiplying it with the reciprocal (where the
    // test does so), and to spare. And four uR for the two roundings of the wide tree's test, which are relative to
    // the distance.
    most(farthest, magnitude, off) * 8.0 + (farthest + magnitude) * (12.0 * U) + TINY
}

/// `t` (local, counted from the true origin) as an end of the box tests' interval, on the side where no box is missed.
#[inline(always)]
pub(crate) fn box_t(t: f64, shift: f64, side: f32) -> f32 {
    let local = (t - shift).to_f32();
    local + side * (local.abs() * OFF + slack(shift))
}

/// How far an end of the boxes' interval may be off, relative: entry into a box has four roundings in f32, and some more are made
/// of the end.
pub(crate) const OFF: f32 = 24.0 * f32::UNIT_ROUNDOFF;

/// The same of an origin that was moved, absolute: `t` is counted from the true one, with a few roundings in f64.
#[inline(always)]
pub(crate) fn slack(shift: f64) -> f32 {
    (shift.abs() * (64.0 * f64::UNIT_ROUNDOFF)).to_f32()
}

/// A ray in an object's normalised space. Its parameter is `world t * t_scale`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    /// The ray's own origin.
    pub(crate) origin: DVec3,
    /// Direction, largest component in [1, 2).
    pub(crate) direction: DVec3,
    /// A power of two.
    pub(crate) t_scale: f64,
    /// Its reciprocal.
    pub(crate) t_unscale: f64,
    /// The moved origin is `origin + shift * direction`, and its parameter counts from there.
    pub(crate) shift: f64,
    /// The world ray's interval.
    pub(crate) world: [f64; 2],
    /// How far moving may have rounded the origin off the line, in each axis.
    pub(crate) off: f64,
    /// Largest coordinate difference between the moved origin and the object.
    pub(crate) farthest: f64,
    /// Not below [`LocalRay::reach`] in any axis.
    pub(crate) most: f64,
    /// By how much, in each axis, boxes are met as if larger: more than eight times [`LocalRay::reach`], since so far
    /// from its triangle a hit may lie (that of a ray which does not graze the plane).
    pub(crate) delta: f32,
    /// Start of the ray's interval in this space's parameter.
    pub(crate) t_min: f64,
    /// No vertex is farther from the true origin, in each axis and in units of the parameter.
    pub(crate) span: f64,
    /// Of the direction.
    pub(crate) length_squared: f64,
    /// The moved origin in single precision.
    pub(crate) origin32: Vec3,
    /// The direction in single precision.
    pub(crate) direction32: Vec3,
}

/// The line of a ray in an object's normalised space, and what is known of its rounding: what the plane of a triangle is met
/// by. All as of [`LocalRay`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) length_squared: f64,
    pub(crate) span: f64,
    pub(crate) shift: f64,
    pub(crate) farthest: f64,
    pub(crate) off: f64,
}

impl Line {
    /// The moved origin.
    #[inline]
    fn moved(&self) -> DVec3 {
        self.origin + self.direction * self.shift
    }

    /// See [`LocalRay::reach`].
    #[inline]
    fn reach(&self) -> DVec3 {
        self.moved().abs() * U + (8.0 * U * self.farthest + self.off)
    }

    /// Raises `t` (local, counted from the true origin) to where the ray enters the primitive's own box, and lowers it
    /// to where it leaves: the rule by which a hit never lies before a box that holds it, so that skipping boxes cannot
    /// change the answer. The box is widened by [`LocalRay::reach`]; `None` when the ray misses even that.
    #[inline(never)]
    pub(crate) fn within_box(&self, t: f64, aabb: &Aabb<f64>) -> Option<f64> {
        let reach = self.reach();
        let wide = Aabb::new(aabb.min - reach, aabb.max + reach);
        let slabs = Slabs::new(self.moved(), self.direction);
        let (enter, leave) = slabs.padded(&wide, f64::NEG_INFINITY, f64::INFINITY);
        (enter <= leave).then(|| t.min(leave + self.shift).max(enter + self.shift))
    }
}

impl LocalRay {
    /// Its line.
    #[inline(always)]
    pub(crate) fn line(&self) -> Line {
        let Self { origin, direction, length_squared, span, shift, farthest, off, .. } = *self;
        Line { origin, direction, length_squared, span, shift, farthest, off }
    }

    /// Enters the object. `None` where the ray is not finite there, or its direction shorter or longer than about
    /// 2^-511 or 2^511: numbers that have no room for products.
    #[inline(always)]
    pub(crate) fn enter(ray: &Ray<f64>, transform: &Transform, object: &Extent) -> Option<Self> {
        let Extent { center, magnitude, half, .. } = *object;
        let origin = transform.point_to_object(ray.origin);
        let direction = transform.vector_to_object(ray.direction);
        let (length, unit) = scales(largest(direction))?;
        // Times 0, what is not finite is not a number.
        let nothing = (origin * 0.0 + direction * 0.0).dot(DVec3::ONE);
        if nothing.is_nan() {
            return None;
        }
        let direction = direction * unit;
        let relative = origin - center;
        let (mut moved, mut shift, mut off) = (origin, 0.0, 0.0);
        let mut farthest = largest(relative) + half;
        if farthest > (FAR + 1.0) * half {
            (shift, off) = far(relative, direction, half);
            moved = origin + direction * shift;
            farthest = largest(moved - center) + half;
        }
        Some(Self {
            origin,
            direction,
            t_scale: length,
            t_unscale: unit,
            shift,
            world: [ray.t_min, ray.t_max],
            off,
            farthest,
            most: most(farthest, magnitude, off),
            delta: delta(farthest, magnitude, off).to_f32(),
            t_min: ray.t_min * length,
            span: farthest + 2.0 * shift.abs(),
            length_squared: direction.length_squared(),
            origin32: moved.as_vec3(),
            direction32: direction.as_vec3(),
        })
    }

    /// The ray's interval in this space's parameter.
    #[inline]
    pub(crate) fn interval(&self) -> [f64; 2] {
        [self.world[0] * self.t_scale, self.world[1] * self.t_scale]
    }

    /// How far from the ray, in each axis, a primitive may lie that the tests accept.
    #[inline]
    pub(crate) fn reach(&self) -> DVec3 {
        self.line().reach()
    }

    /// Not below [`LocalRay::reach`] in any axis, at less cost.
    #[inline(always)]
    pub(crate) fn most_reach(&self) -> f64 {
        self.most
    }

    /// Setup of the box test: plain, or `PADDED` so that boxes are met as if larger by [`LocalRay::delta`].
    #[inline(always)]
    pub(crate) fn slabs<const PADDED: bool>(&self) -> Slabs<f32> {
        let slabs = Slabs::new(self.origin32, self.direction32);
        if !PADDED {
            return slabs;
        }
        slabs.widened(Vec3::splat(self.delta))
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
    fn box_t(&self, t: f64, side: f32) -> f32 {
        box_t(t * self.t_scale, self.shift, side)
    }

    /// Whether an edge function of the triangle is so small that what the tier rounds may have decided its sign.
    pub(crate) fn near_edge(&self, vertices: [DVec3; 3], precision: Precision) -> bool {
        // By how much vertices are off, seen from the ray.
        let (origin, off) = match precision {
            // Moeller and Trumbore's test rounds otherwise, but no less.
            Precision::Fast | Precision::Robust => (self.line().moved(), self.reach().max_element()),
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
}
