//! Eight rays side by side, one in each lane: what [`LocalRay`](crate::local::LocalRay) is for one.

use firsthit_geometry::{Ray, Real, transform::Transform};
use glam::{DMat3, DVec3, Vec3};

use super::vectors::{self, Vectors};
use crate::local::{Extent, FAR, LocalRay, TINY, U, box_t, most};
use crate::simd::{Eight, Lanes};
use crate::wide::{Boxes, SMALLEST, kept_near};

/// A number of each ray.
pub(super) type Doubles = [f64; 8];
/// The same in single precision.
pub(super) type Singles = [f32; 8];

/// Eight rays in an object's normalised space. What is the same as in a [`LocalRay`](crate::local::LocalRay) has the same
/// bits: each lane does the operations of [`LocalRay::enter`](crate::local::LocalRay::enter) in their
/// order.
///
/// All rows lie in memory: a packet has more of them than there are registers.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Group {
    pub(super) origin: [Doubles; 3],
    pub(super) direction: [Doubles; 3],
    pub(super) length_squared: Doubles,
    pub(super) t_scale: Doubles,
    pub(super) t_unscale: Doubles,
    pub(super) shift: Doubles,
    pub(super) farthest: Doubles,
    pub(super) span: Doubles,
    /// Start of the interval in the world's parameter, and in this space's.
    pub(super) t_min: Doubles,
    pub(super) local_t_min: Doubles,
    /// End of the interval in the world's parameter: where there is a hit, that of the nearest.
    pub(super) t_max: Doubles,
    /// The nearest hit's normal by winding, of any length.
    pub(super) normal: [Doubles; 3],
    pub(super) u: Singles,
    pub(super) v: Singles,
    /// The nearest hit's place in the leaves, as bits: see [`Group::place`].
    pub(super) place: Singles,
    /// Lanes with a hit.
    pub(super) hit: u32,
    /// Lanes with a ray that can hit anything.
    pub(super) valid: u32,
    /// Lanes that are being traced; the others are asleep.
    pub(super) awake: u32,
    /// Lanes whose direction is negative along each axis.
    pub(super) negative: [u32; 3],
    /// Lanes that follow an axis most: not the first but the second, and the third. See [`Group::axis`].
    second: u32,
    third: u32,
    pub(super) delta: Singles,
    pub(super) origin32: [Singles; 3],
    pub(super) direction32: [Singles; 3],
    /// For the test of boxes, see [`Boxes`](crate::wide::Boxes).
    pub(super) inverse: [Singles; 3],
    pub(super) near: [Singles; 3],
    pub(super) far: [Singles; 3],
    /// The boxes' interval; of lanes asleep it is empty.
    pub(super) start: Singles,
    pub(super) end: Singles,
    /// The origin in the order of the sheared axes, and the slopes.
    pub(super) sheared: [Singles; 3],
    pub(super) slopes: [Singles; 2],
}

/// What a group needs to know of the object that it enters.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    pub(super) transform: &'a Transform,
    pub(super) extent: &'a Extent,
    /// Boxes are met as if larger.
    pub(super) padded: bool,
}

/// The largest component by magnitude.
#[inline(always)]
fn largest<E: Eight>(v: Vectors<E>) -> E {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[inline(always)]
fn splat<E: Eight>(v: [f64; 3]) -> Vectors<E> {
    [E::splat(v[0]), E::splat(v[1]), E::splat(v[2])]
}

/// As `DMat3 * DVec3`.
#[inline(always)]
pub(super) fn transformed<E: Eight>(m: &DMat3, v: Vectors<E>) -> Vectors<E> {
    let (x, y, z) = (splat(m.x_axis.to_array()), splat(m.y_axis.to_array()), splat(m.z_axis.to_array()));
    let first = vectors::add(vectors::scaled(x, v[0]), vectors::scaled(y, v[1]));
    vectors::add(first, vectors::scaled(z, v[2]))
}

/// As [`Transform::vector_to_object`].
#[inline(always)]
fn to_object<E: Eight>(transform: &Transform, v: Vectors<E>) -> Vectors<E> {
    let inverse = transform.inverse_linear();
    if transform.is_uniform() { vectors::scaled(v, E::splat(inverse.x_axis.x)) } else { transformed(&inverse, v) }
}

/// Of the axis that is so many after the one that each ray follows most.
#[inline(always)]
fn ordered<L: Lanes>(v: [L; 3], after: usize, second: u32, third: u32) -> L {
    v[(after + 1) % 3].choose(second, v[(after + 2) % 3].choose(third, v[after % 3]))
}

/// A number of each of eight rays.
macro_rules! row {
    ($rays:ident, $($part:ident).+) => {{
        let [a, b, c, d, e, f, g, h] = $rays;
        L::Eight::load(&[
            a.$($part).+, b.$($part).+, c.$($part).+, d.$($part).+, e.$($part).+, f.$($part).+, g.$($part).+, h.$($part).+,
        ])
    }};
}

#[inline(always)]
fn store<E: Eight>(from: Vectors<E>, to: &mut [Doubles; 3]) {
    from[0].store(&mut to[0]);
    from[1].store(&mut to[1]);
    from[2].store(&mut to[2]);
}

impl Group {
    /// Lets eight rays in. Those that can't hit anything are not [`Group::valid`], and their rows mean nothing.
    #[inline(always)]
    pub(super) fn enter<L: Lanes>(&mut self, rays: &[Ray<f64>; 8], entry: &Entry<'_>) {
        let of = L::Eight::splat;
        let (center, magnitude, half) = entry.extent.parts();
        let translation = splat(entry.transform.translation().to_array());
        let origin = [row!(rays, origin.x), row!(rays, origin.y), row!(rays, origin.z)];
        let origin = to_object(entry.transform, vectors::sub(origin, translation));
        let direction = [row!(rays, direction.x), row!(rays, direction.y), row!(rays, direction.z)];
        let direction = to_object(entry.transform, direction);
        let (t_min, t_max) = (row!(rays, t_min), row!(rays, t_max));

        let length = largest(direction).exponent();
        let most = of(f64::MAX);
        let finite = origin[0].abs().le(most)
            & origin[1].abs().le(most)
            & origin[2].abs().le(most)
            & direction[0].abs().le(most)
            & direction[1].abs().le(most)
            & direction[2].abs().le(most);
        let roomy = of(2f64.powi(-511)).le(length) & length.le(of(2f64.powi(511)));
        // An interval that is not empty, even of finite numbers.
        let interval = t_min.le(t_max) & t_min.lt(of(f64::INFINITY)) & of(f64::NEG_INFINITY).lt(t_max);
        self.valid = finite & roomy & interval;

        let unit = of(1.0).div(length);
        let direction = vectors::scaled(direction, unit);
        let relative = vectors::sub(origin, splat(center));
        let (mut moved, mut shift, mut off) = (origin, of(0.0), of(0.0));
        let mut farthest = largest(relative).add(of(half));
        let far = of((FAR + 1.0) * half).lt(farthest);
        if far & self.valid != 0 {
            let nearest = vectors::dot(relative, direction).div(vectors::dot(direction, direction));
            shift = of(-(2.0 * half)).sub(nearest).select(far, shift);
            off = shift.abs().mul(of(32.0 * f64::UNIT_ROUNDOFF));
            let along = vectors::add(origin, vectors::scaled(direction, shift));
            moved = [along[0].select(far, moved[0]), along[1].select(far, moved[1]), along[2].select(far, moved[2])];
            farthest = largest(vectors::sub(moved, splat(center))).add(of(half)).select(far, farthest);
        }
        let most = farthest.mul(of(9.1 * U)).add(of(magnitude * (1.1 * U)).add(off));
        let delta = most.mul(of(8.0)).add(farthest.add(of(magnitude)).mul(of(12.0 * U))).add(of(TINY));

        store(origin, &mut self.origin);
        store(direction, &mut self.direction);
        vectors::dot(direction, direction).store(&mut self.length_squared);
        length.store(&mut self.t_scale);
        unit.store(&mut self.t_unscale);
        shift.store(&mut self.shift);
        farthest.store(&mut self.farthest);
        farthest.add(of(2.0).mul(shift.abs())).store(&mut self.span);
        t_min.store(&mut self.t_min);
        t_min.mul(length).store(&mut self.local_t_min);
        t_max.store(&mut self.t_max);
        self.hit = 0;

        let delta = if entry.padded { L::narrow(delta) } else { L::splat(0.0) };
        delta.put(&mut self.delta);
        for axis in 0..3 {
            let (origin, direction) = (L::narrow(moved[axis]), L::narrow(direction[axis]));
            let inverse = L::splat(1.0).div(direction.abs().max(L::splat(SMALLEST)).turned_by(direction));
            origin.put(&mut self.origin32[axis]);
            direction.put(&mut self.direction32[axis]);
            inverse.put(&mut self.inverse[axis]);
            // As `Boxes::new`.
            let (origin, out) = (kept_near(origin), kept_near(delta).turned_by(direction));
            origin.add(out).mul(inverse).put(&mut self.near[axis]);
            origin.sub(out).mul(inverse).put(&mut self.far[axis]);
            self.negative[axis] = direction.negative();
        }
        let [x, y, z] = &self.direction32;
        let (x, y, z) = (L::load(x).abs(), L::load(y).abs(), L::load(z).abs());
        self.second = x.le(y);
        self.third = x.max(y).le(z);
        self.box_t::<L>(t_min, -1.0).put(&mut self.start);
    }

    /// The place of a ray's nearest hit. (Places are so small that as bits of an `f32` none is a NaN.)
    #[inline(always)]
    pub(super) fn place(&self, lane: usize) -> usize {
        self.place[lane].to_bits() as usize
    }

    /// The axis that a ray follows most, as [`Shear::axis`](firsthit_geometry::triangle::Shear::axis).
    #[inline(always)]
    pub(super) fn axis(&self, lane: u32) -> usize {
        if self.third >> lane & 1 == 1 { 2 } else { (self.second >> lane & 1) as usize }
    }

    /// Lanes that go a way: into an octant, and along an axis.
    #[inline(always)]
    pub(super) fn alike(&self, negative: [bool; 3], axis: usize) -> u32 {
        let mut lanes = match axis {
            2 => self.third,
            1 => self.second & !self.third,
            _ => !(self.second | self.third),
        };
        for (mask, negative) in self.negative.iter().zip(negative) {
            lanes &= if negative { *mask } else { !mask };
        }
        lanes & 0xff
    }

    /// Wakes some lanes, which go the same way, and puts the others to sleep.
    #[inline(always)]
    pub(super) fn wake<L: Lanes>(&mut self, lanes: u32, axes: [usize; 3]) {
        self.sleep::<L>(lanes);
        let [x, y, z] = axes;
        self.sheared = [self.origin32[x], self.origin32[y], self.origin32[z]];
        let z = L::load(&self.direction32[axes[2]]);
        L::load(&self.direction32[axes[0]]).div(z).put(&mut self.slopes[0]);
        L::load(&self.direction32[axes[1]]).div(z).put(&mut self.slopes[1]);
    }

    /// Wakes all that can hit anything, each to go its own way: the sheared axes are in its own order.
    #[inline(always)]
    pub(super) fn part<L: Lanes>(&mut self) {
        self.sleep::<L>(self.valid);
        let [second, third] = [self.second & !self.third, self.third];
        let (o, d) = (&self.origin32, &self.direction32);
        let (o, d) =
            ([L::load(&o[0]), L::load(&o[1]), L::load(&o[2])], [L::load(&d[0]), L::load(&d[1]), L::load(&d[2])]);
        let (ox, oy, oz) = (ordered(o, 1, second, third), ordered(o, 2, second, third), ordered(o, 0, second, third));
        let (dx, dy, dz) = (ordered(d, 1, second, third), ordered(d, 2, second, third), ordered(d, 0, second, third));
        ox.put(&mut self.sheared[0]);
        oy.put(&mut self.sheared[1]);
        oz.put(&mut self.sheared[2]);
        dx.div(dz).put(&mut self.slopes[0]);
        dy.div(dz).put(&mut self.slopes[1]);
    }

    /// One ray among boxes.
    #[inline(always)]
    pub(super) fn boxes<L: Lanes>(&self, lane: usize) -> Boxes<L> {
        let axis =
            |k: usize| (self.inverse[k][lane], [self.near[k][lane], self.far[k][lane]], self.negative[k] >> lane & 1);
        Boxes::known([axis(0), axis(1), axis(2)])
    }

    /// One of the rays, as it is alone.
    #[inline(always)]
    pub(super) fn local(&self, lane: usize, magnitude: f64) -> LocalRay {
        let vector = |v: &[Doubles; 3]| DVec3::new(v[0][lane], v[1][lane], v[2][lane]);
        let single = |v: &[Singles; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
        let shift = self.shift[lane];
        let off = shift.abs() * (32.0 * f64::UNIT_ROUNDOFF);
        LocalRay {
            origin: vector(&self.origin),
            direction: vector(&self.direction),
            t_scale: self.t_scale[lane],
            t_unscale: self.t_unscale[lane],
            shift,
            world: [self.t_min[lane], self.t_max[lane]],
            off,
            farthest: self.farthest[lane],
            most: most(self.farthest[lane], magnitude, off),
            delta: self.delta[lane],
            t_min: self.local_t_min[lane],
            span: self.span[lane],
            length_squared: self.length_squared[lane],
            origin32: single(&self.origin32),
            direction32: single(&self.direction32),
        }
    }

    /// Puts all but some lanes to sleep.
    #[inline(always)]
    fn sleep<L: Lanes>(&mut self, awake: u32) {
        self.awake = awake;
        let end: L = self.box_t(L::Eight::load(&self.t_max), 1.0);
        end.choose(awake, L::splat(f32::NEG_INFINITY)).put(&mut self.end);
    }

    /// As `LocalRay::box_t`.
    #[inline(always)]
    pub(super) fn box_t<L: Lanes>(&self, t: L::Eight, side: f64) -> L {
        let of = L::Eight::splat;
        let shift = L::Eight::load(&self.shift);
        let t = t.mul(L::Eight::load(&self.t_scale));
        let local = t.sub(shift);
        let rounded = t.abs().add(shift.abs()).mul(of(16.0 * f64::UNIT_ROUNDOFF));
        let error = local.abs().mul(of(16.0 * U)).add(rounded);
        L::narrow(local.add(of(side).mul(error)))
    }

    /// The same for the end of one ray's interval.
    #[inline(always)]
    pub(super) fn box_t_of(&self, lane: usize) -> f32 {
        box_t(self.t_max[lane] * self.t_scale[lane], self.shift[lane], 1.0)
    }
}
