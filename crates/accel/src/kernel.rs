//! Triangle tests by tier, in an object's normalised space.

use core::marker::PhantomData;

use firsthit_geometry::{
    Ray,
    exact::{ExactHit, ExactRay},
    triangle::{self, Shear, Weights},
};
use glam::{DVec3, Vec3};

use crate::Guards;
use crate::guards::{AllGuards, GuardSet};
use crate::local::{Line, LocalRay};
use crate::simd::Lanes;
use crate::wide::{Either, Filter, Margin, Plain, Sheared, in_lanes};

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
    /// By winding, of any length.
    pub(crate) normal: DVec3,
    /// The hit may lie outside the triangle's box as the boxes' test sees it: see [`Line::within_box`].
    pub(crate) grazing: bool,
    /// `f64` could not decide.
    pub(crate) fallback: bool,
}

/// Where the ray meets the plane of a triangle.
pub(crate) struct Plane {
    pub(crate) t: f64,
    pub(crate) normal: DVec3,
    grazing: bool,
}

impl Plane {
    #[inline(always)]
    pub(crate) fn at(self, u: f32, v: f32) -> Found {
        Found { t: self.t, u, v, normal: self.normal, grazing: self.grazing, fallback: false }
    }

    /// For a test that accepts triangles at any distance from the ray: whatever the angle, the box has to tell.
    #[inline(always)]
    fn kept(self) -> Self {
        Self { grazing: true, ..self }
    }
}

/// The ray meets a plane more steeply if the cosine between it and the normal is larger than 1/4. Then a point of the
/// plane on the ray is no farther than `1 + sqrt(3) * 4`, less than 8, times [`LocalRay::reach`] from the triangle that
/// the test has accepted, and [`LocalRay::delta`] covers that.
pub(crate) const STEEP: f64 = 1.0 / 16.0;

/// Triangles of a smaller sine (squared) between their edges are never met the shortest way.
pub(crate) const SLIVER: f64 = 1.0 / (1u64 << 40) as f64;

/// 28 digits of `t` are left, some more than `f32` has: see [`plane`].
pub(crate) const MOST: f64 = 4.0 / (1u64 << 20) as f64;

/// Few digits are lost.
const LEAST: f64 = 1.0 / 32.0;

/// [`triangle::plane_parameter`] and [`triangle::area_vector`] by the shortest way where no more than `loss` is lost, as
/// nearly always. Nothing for a `t` that lies before `from` for certain.
///
/// The differences to the first vertex are off by roundings of what [`LocalRay::span`] says. And the plain cross product
/// tilts the plane, about that vertex, by a few roundings over the sine between the edges: `t` is off by that times the
/// triangle's length. So no more is lost if `t` times the sine is larger than the span times `loss`.
#[inline(always)]
pub(crate) fn plane(vertices: &[Vec3; 3], line: &Line, loss: f64, from: f64) -> Option<Plane> {
    match short_plane(vertices, line, loss, from) {
        Short::Met(plane) => Some(plane),
        Short::Before => None,
        Short::Grazed => careful_plane(*vertices, *line, true),
        Short::Lost => careful_plane(*vertices, *line, false),
    }
}

/// What the shortest way to a triangle's plane leads to.
pub(crate) enum Short {
    /// No more is lost than is allowed.
    Met(Plane),
    /// `t` lies before the interval for certain.
    Before,
    /// The ray grazes the plane, or the triangle is a sliver.
    Grazed,
    /// Too many digits are lost.
    Lost,
}

/// See [`plane`].
#[inline(always)]
pub(crate) fn short_plane(vertices: &[Vec3; 3], line: &Line, loss: f64, from: f64) -> Short {
    let [a, b, c] = double(vertices);
    let (e1, e2, r) = (b - a, c - a, a - line.origin);
    let normal = e1.cross(e2);
    let along = normal.dot(line.direction);
    let t = normal.dot(r) / along;
    let (nn, dd) = (normal.length_squared(), line.length_squared);
    let edges = e1.length_squared() * e2.length_squared();
    if !(nn > SLIVER * edges && along * along > STEEP * (nn * dd)) {
        return Short::Grazed;
    }
    let least = loss * line.span;
    if nn * (t * t) > edges * (least * least) {
        return Short::Met(Plane { t, normal, grazing: false });
    }
    // Nearly every ray that starts on a surface meets the triangle that it comes from here. What lies before
    // the interval by more than any of this may be off (2^-27 of the span, by the thinnest triangle) is not wanted.
    if t < from - line.span * (1.0 / (1u64 << 26) as f64) { Short::Before } else { Short::Lost }
}

/// The same with all digits. By value: what is passed by reference has to be kept in memory by the caller, always.
#[inline(never)]
pub(crate) fn careful_plane(vertices: [Vec3; 3], line: Line, grazing: bool) -> Option<Plane> {
    let vertices = double(&vertices);
    let t = triangle::plane_parameter(vertices, line.origin, line.direction)?;
    Some(Plane { t, normal: triangle::area_vector(vertices), grazing })
}

/// How a tier meets boxes and triangles.
pub(crate) trait Kernel {
    /// Boxes of instances are met as if larger by all that is rounded.
    const PADDED_ABOVE: bool = true;
    /// What is prepared once per ray and instance.
    type Setup;
    /// Picks from eight triangles those that are worth a test.
    type Filter<L: Lanes>: Filter<L>;
    fn setup(ray: &LocalRay, guards: Guards) -> Self::Setup;
    /// Boxes are met as if larger by all that is rounded, so that none with a hit is missed.
    #[inline(always)]
    fn padded(_: &Self::Setup) -> bool {
        true
    }
    /// Hits are kept within their primitive's box: see [`Line::within_box`].
    #[inline(always)]
    fn clamped(_: &Self::Setup) -> bool {
        true
    }
    fn filter<L: Lanes>(setup: &Self::Setup, ray: &LocalRay) -> Self::Filter<L>;
    /// The hit, if there is one; beyond `t_max` it is not wanted, but may be given.
    fn test(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found>;
    /// The same if the triangle answers for the crossing, see [`crate::Crossings::Surfaces`].
    #[inline(always)]
    fn crosses(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        Self::test(setup, ray, vertices, t_max)
    }
    /// Whether [`Kernel::test`] finds a hit in the ray's interval, of tiers that tell sooner than where.
    #[inline(always)]
    fn is_hit(_: &Self::Setup, _vertices: &[Vec3; 3], _t_max: f64) -> Option<bool> {
        None
    }
    /// [`Kernel::test`] of a triangle that passed the filter, with what that knows of it.
    #[inline(always)]
    fn test_known(
        setup: &Self::Setup,
        ray: &LocalRay,
        vertices: &[Vec3; 3],
        _known: [f32; 3],
        t_max: f64,
    ) -> Option<Found> {
        Self::test(setup, ray, vertices, t_max)
    }
}

/// Tier `Fast`: Moeller-Trumbore in `f32`.
pub(crate) struct Fast;

impl Kernel for Fast {
    const PADDED_ABOVE: bool = false;
    type Setup = ();
    type Filter<L: Lanes> = Plain<L>;

    #[inline(always)]
    fn setup(_: &LocalRay, _: Guards) {}

    #[inline(always)]
    fn padded((): &()) -> bool {
        false
    }

    #[inline(always)]
    fn clamped((): &()) -> bool {
        false
    }

    #[inline(always)]
    fn filter<L: Lanes>((): &(), ray: &LocalRay) -> Plain<L> {
        Plain::new(ray.origin32, ray.direction32)
    }

    #[inline(always)]
    fn test((): &(), ray: &LocalRay, vertices: &[Vec3; 3], _: f64) -> Option<Found> {
        let hit = triangle::moeller_trumbore::<f32>(*vertices, ray.origin32, ray.direction32)?;
        Some(Self::found([hit.t, hit.u, hit.v], ray, vertices))
    }

    #[inline(always)]
    fn test_known((): &(), ray: &LocalRay, vertices: &[Vec3; 3], known: [f32; 3], _: f64) -> Option<Found> {
        Some(Self::found(known, ray, vertices))
    }
}

impl Fast {
    #[inline(always)]
    pub(crate) fn found([t, u, v]: [f32; 3], ray: &LocalRay, vertices: &[Vec3; 3]) -> Found {
        let [a, b, c] = double(vertices);
        let normal = (b - a).cross(c - a);
        Found { t: f64::from(t) + ray.shift, u, v, normal, grazing: true, fallback: false }
    }
}

/// Tier `Robust` with its guards, see [`crate::Guards`]: all on, it is the watertight test in `f32`, and `t` from the
/// plane and the unrounded ray in `f64`.
pub(crate) struct RobustBy<G>(PhantomData<G>);

/// With all guards.
pub(crate) type Robust = RobustBy<AllGuards>;

/// With some, as is known at run time only.
pub(crate) type Guarded = RobustBy<Guards>;

impl<G: GuardSet> Kernel for RobustBy<G> {
    type Setup = (Shear<f32>, G);
    type Filter<L: Lanes> = Either<L, G>;

    #[inline(always)]
    fn setup(ray: &LocalRay, guards: Guards) -> Self::Setup {
        (Shear::new(ray.direction32), G::new(guards))
    }

    #[inline(always)]
    fn padded((_, guards): &Self::Setup) -> bool {
        guards.has(Guards::PADDING)
    }

    #[inline(always)]
    fn clamped((_, guards): &Self::Setup) -> bool {
        guards.has(Guards::PADDING)
    }

    #[inline(always)]
    fn filter<L: Lanes>((_, guards): &Self::Setup, ray: &LocalRay) -> Either<L, G> {
        Either {
            guards: *guards,
            plain: Plain::new(ray.origin32, ray.direction32),
            sheared: Sheared::new(in_lanes(ray.origin32), in_lanes(ray.direction32), 0.0, slack(ray)),
        }
    }

    #[inline(always)]
    fn test((shear, guards): &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        if !guards.has(Guards::WATERTIGHT) {
            let hit = Fast::test(&(), ray, vertices, t_max)?;
            if !guards.has(Guards::PLANE_T) {
                return Some(hit);
            }
            return Some(plane(vertices, &ray.line(), MOST, f64::NEG_INFINITY)?.kept().at(hit.u, hit.v));
        }
        let relative = relative(vertices, ray.origin32);
        let w = if guards.has(Guards::FALLBACK) { shear.weights(relative) } else { shear.weights_unguarded(relative) }?;
        if guards.has(Guards::PLANE_T | Guards::FALLBACK) {
            return Some(plane(vertices, &ray.line(), MOST, ray.t_min)?.at(w.u, w.v));
        }
        if guards.has(Guards::PLANE_T) {
            return Some(plane(vertices, &ray.line(), MOST, f64::NEG_INFINITY)?.kept().at(w.u, w.v));
        }
        let t = {
            // The depth of the weighted point along the axis that the ray follows most.
            let axis = shear.axis();
            let [a, b, c] = relative.map(|p| p[axis]);
            let t = ((1.0 - w.u - w.v) * a + w.u * b + w.v * c) / ray.direction32[axis];
            f64::from(t) + ray.shift
        };
        let normal = triangle::area_vector(double(vertices));
        Some(Found { t, u: w.u, v: w.v, normal, grazing: true, fallback: false })
    }

    #[inline(always)]
    fn test_known(
        setup: &Self::Setup,
        ray: &LocalRay,
        vertices: &[Vec3; 3],
        known: [f32; 3],
        t_max: f64,
    ) -> Option<Found> {
        // Where there is no fallback, that of this test must not be used.
        if setup.1.has(Guards::WATERTIGHT | Guards::FALLBACK | Guards::PLANE_T)
            && let Some(w) = Weights::told::<true>(known)
        {
            return Some(plane(vertices, &ray.line(), MOST, ray.t_min)?.at(w.u, w.v));
        }
        Self::test(setup, ray, vertices, t_max)
    }

    #[inline(always)]
    fn crosses(setup: &Self::Setup, ray: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        if !setup.1.has(Guards::WATERTIGHT) {
            return Self::test(setup, ray, vertices, t_max);
        }
        let w = setup.0.crosses(relative(vertices, ray.origin32))?;
        Some(
            crossing(
                plane(vertices, &ray.line(), MOST, f64::NEG_INFINITY),
                vertices,
                ray,
                f64::from(w.u),
                f64::from(w.v),
            )
            .at(w.u, w.v),
        )
    }
}

/// Where the ray crosses a triangle with these weights. No crossing may be lost, so where the plane does not tell (the
/// ray lies in it, but for rounding) the depth of the vertices does.
#[inline(always)]
fn crossing(plane: Option<Plane>, vertices: &[Vec3; 3], ray: &LocalRay, u: f64, v: f64) -> Plane {
    plane.unwrap_or_else(|| {
        let [a, b, c] = double(vertices);
        let point = a * (1.0 - u - v) + b * u + c * v;
        let t = (point - ray.origin).dot(ray.direction) / ray.direction.dot(ray.direction);
        Plane { t, normal: triangle::area_vector([a, b, c]), grazing: true }
    })
}

/// What the unrounded ray may meet, by the ray as rounded to `f32`.
#[inline(always)]
fn margin<L: Lanes>(ray: &LocalRay) -> Margin<L> {
    // A sheared coordinate takes in the errors of two axes; the rest is for the rounding of this line.
    let off = (ray.most_reach() * 2.1) as f32;
    Margin(Sheared::new(in_lanes(ray.origin32), in_lanes(ray.direction32), off, slack(ray)))
}

/// How far outside its own depths a triangle may be hit: no farther than boxes are met as if larger, and it is seen with
/// rounded vertices.
#[inline(always)]
fn slack(ray: &LocalRay) -> f32 {
    2.0 * ray.delta
}

/// Tier `Double`: the same in `f64`, with the unrounded ray.
pub(crate) struct Double;

impl Kernel for Double {
    type Setup = Shear<f64>;
    type Filter<L: Lanes> = Margin<L>;

    #[inline(always)]
    fn setup(ray: &LocalRay, _: Guards) -> Shear<f64> {
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
        Some(plane(vertices, &ray.line(), LEAST, ray.t_min)?.at(w.u as f32, w.v as f32))
    }

    #[inline(always)]
    fn crosses(setup: &Shear<f64>, ray: &LocalRay, vertices: &[Vec3; 3], _: f64) -> Option<Found> {
        let [a, b, c] = double(vertices);
        let w = setup.crosses([a - ray.origin, b - ray.origin, c - ray.origin])?;
        let plane = crossing(plane(vertices, &ray.line(), LEAST, f64::NEG_INFINITY), vertices, ray, w.u, w.v);
        Some(plane.at(w.u as f32, w.v as f32))
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
    type Setup = Option<ExactRay>;
    type Filter<L: Lanes> = Margin<L>;

    #[inline(always)]
    fn clamped(_: &Option<ExactRay>) -> bool {
        false
    }

    #[inline(always)]
    fn filter<L: Lanes>(_: &Option<ExactRay>, ray: &LocalRay) -> Margin<L> {
        margin(ray)
    }

    #[inline(always)]
    fn setup(ray: &LocalRay, _: Guards) -> Option<ExactRay> {
        let [t_min, t_max] = ray.interval();
        let exact = ExactRay::new(Ray { origin: ray.origin, direction: ray.direction, t_min, t_max })?;
        Some(if ray.shift == 0.0 { exact } else { exact.near(ray.shift) })
    }

    #[inline(always)]
    fn test(setup: &Option<ExactRay>, _: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        let hit = setup.as_ref()?.hit_before(double(vertices), t_max)?;
        Some(Self::found(&hit, vertices))
    }

    #[inline(always)]
    fn is_hit(setup: &Option<ExactRay>, vertices: &[Vec3; 3], t_max: f64) -> Option<bool> {
        Some(setup.as_ref().is_some_and(|ray| ray.is_hit_before(double(vertices), t_max)))
    }

    #[inline(always)]
    fn crosses(setup: &Option<ExactRay>, _: &LocalRay, vertices: &[Vec3; 3], t_max: f64) -> Option<Found> {
        let hit = setup.as_ref()?.hit_before(double(vertices), t_max).filter(|h| h.crosses)?;
        Some(Self::found(&hit, vertices))
    }
}

impl Exact {
    #[inline(always)]
    fn found(hit: &ExactHit, vertices: &[Vec3; 3]) -> Found {
        let normal = triangle::area_vector(double(vertices));
        Found { t: hit.t, u: hit.u as f32, v: hit.v as f32, normal, grazing: true, fallback: hit.fallback }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::Extent;
    use firsthit_geometry::{Aabb, transform::Transform};
    use glam::DAffine3;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0f64, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Slivers of any sine, met from any distance: where the short way is taken, it has the digits it claims.
        #[test]
        fn the_short_way_has_28_digits(
            a in vector(), along in vector(), off in vector(), part in 0.0..1.0f64, sine in -24.0..0.0f64,
            (u, v) in (0.0..1.0f64, 0.0..1.0f64), direction in vector(), distance in -24.0..24.0f64, turn in 0usize..3,
        ) {
            let mut corners = [a, a + along, a + along * part + off * sine.exp2()].map(|p| p.as_vec3());
            corners.rotate_left(turn);
            let [p, q, r] = double(&corners);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let origin = p + (q - p) * u + (r - p) * v - direction * distance.exp2();
            let line = Ray { origin, direction, t_min: f64::NEG_INFINITY, t_max: f64::INFINITY };
            let object = Extent::new(&Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0)));
            let local = Transform::new(DAffine3::IDENTITY).ok().and_then(|m| LocalRay::enter(&line, &m, &object));
            let exact = ExactRay::new(line).and_then(|ray| ray.hit([p, q, r]));
            if let (Some(local), Some(exact)) = (local, exact)
                && let Some(found) = plane(&corners, &local.line(), MOST, f64::NEG_INFINITY)
                && careful_plane(corners, local.line(), true).is_none_or(|p| p.t != found.t)
            {
                let error = (found.t * local.t_unscale / exact.t - 1.0).abs();
                prop_assert!(error < 2f64.powi(-28), "2^{}", error.log2());
            }
        }
    }
}
