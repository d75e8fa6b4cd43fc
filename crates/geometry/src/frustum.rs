//! The view frustum against points, boxes and triangles.

use glam::{DMat4, DVec3, DVec4};

use crate::Aabb;
use crate::clip::HalfSpace;

/// How a body lies to a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Containment {
    /// No point in common.
    Outside,
    /// Some points in common, or too close to tell.
    Intersecting,
    /// Wholly in the region.
    Inside,
}

/// What a camera sees: a convex body of six planes and eight corners, in double precision. Finite: an infinite far
/// plane must be replaced by one beyond the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    /// Left, right, bottom, top, near, far; unit normals point outward.
    planes: [HalfSpace<f64>; 6],
    /// Bit 0, 1, 2 of the index picks right, top, far.
    corners: [DVec3; 8],
}

/// The four corners of each plane of [`Frustum`], the first three of which span it.
const FACES: [[usize; 4]; 6] = [[0, 2, 4, 6], [1, 3, 5, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]];

/// The ends of the edges of [`Frustum`].
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

impl Frustum {
    /// From its corners: bit 0, 1, 2 of the index picks right, top, far. The six faces must be flat. `None` when a
    /// corner is not finite or the body has no volume.
    #[must_use]
    pub fn from_corners(corners: [DVec3; 8]) -> Option<Self> {
        let middle = corners.iter().sum::<DVec3>() / 8.0;
        let mut planes = [HalfSpace::new(DVec3::ZERO, 0.0); 6];
        for (plane, face) in planes.iter_mut().zip(FACES) {
            let [a, b, c, d] = face.map(|i| corners[i]);
            // By the diagonals: right even where a side of the face has shrunk to a point.
            let n = (d - a).cross(c - b).try_normalize()?;
            let n = if n.dot(middle - a) > 0.0 { -n } else { n };
            // Through the outermost corner, so that rounding loses none of them.
            *plane = HalfSpace::new(n, [a, b, c, d].into_iter().map(|p| n.dot(p)).fold(f64::NEG_INFINITY, f64::max));
        }
        let solid = planes.iter().all(|p| p.signed_distance(middle) < 0.0);
        solid.then_some(Self { planes, corners })
    }

    /// The frustum of a perspective camera at `eye`, looking along `forward` with `up` about upwards.
    ///
    /// `vertical_angle` is the full angle of view in radians, `aspect` width over height, `near` and `far` distances
    /// along `forward`. `None` where these span no body (`0 < near < far` and an angle below a half turn are needed).
    #[must_use]
    pub fn perspective(
        eye: DVec3,
        forward: DVec3,
        up: DVec3,
        vertical_angle: f64,
        aspect: f64,
        near: f64,
        far: f64,
    ) -> Option<Self> {
        let slope = (vertical_angle / 2.0).tan();
        let sane = near > 0.0 && slope > 0.0 && vertical_angle < core::f64::consts::PI;
        sane.then(|| Self::from_view(eye, forward, up, aspect, [(near, near * slope), (far, far * slope)])).flatten()
    }

    /// The box that an orthographic camera sees; `height` is that of the picture in world units.
    #[must_use]
    pub fn orthographic(
        eye: DVec3,
        forward: DVec3,
        up: DVec3,
        height: f64,
        aspect: f64,
        near: f64,
        far: f64,
    ) -> Option<Self> {
        Self::from_view(eye, forward, up, aspect, [(near, height / 2.0), (far, height / 2.0)])
    }

    /// From a near and a far rectangle, each by its distance and half height.
    fn from_view(eye: DVec3, forward: DVec3, up: DVec3, aspect: f64, ends: [(f64, f64); 2]) -> Option<Self> {
        if !(ends[0].0 < ends[1].0 && aspect > 0.0) {
            return None;
        }
        let forward = forward.try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let up = right.cross(forward);
        Self::from_corners(core::array::from_fn(|i| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let (distance, half) = ends[i >> 2];
            eye + forward * distance + right * (sign(0) * half * aspect) + up * (sign(1) * half)
        }))
    }

    /// The body that a projection-times-view matrix maps to `-1 <= x, y <= 1` and depth `0..1` (`-1..1` with
    /// `symmetric_depth`, as in OpenGL). `None` for a singular matrix or an infinite far plane.
    #[must_use]
    pub fn from_matrix(matrix: DMat4, symmetric_depth: bool) -> Option<Self> {
        let inverse = matrix.inverse();
        let near = if symmetric_depth { -1.0 } else { 0.0 };
        let corners = core::array::from_fn(|i| {
            let side = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let p = inverse * DVec4::new(side(0), side(1), if i >> 2 == 1 { 1.0 } else { near }, 1.0);
            p.truncate() / p.w
        });
        Self::from_corners(corners)
    }

    /// Left, right, bottom, top, near, far; unit normals point outward.
    #[must_use]
    pub fn planes(&self) -> &[HalfSpace<f64>; 6] {
        &self.planes
    }

    /// The corners: bit 0, 1, 2 of the index picks right, top, far.
    #[must_use]
    pub fn corners(&self) -> &[DVec3; 8] {
        &self.corners
    }

    /// Whether a point is in the closed frustum.
    #[must_use]
    pub fn contains(&self, p: DVec3) -> bool {
        self.planes.iter().all(|h| h.contains(p))
    }

    /// How a box lies to the frustum. Exact but for rounding: all separating axes are tried, also those that the usual
    /// test of six planes leaves out (it keeps large boxes beside an edge). Empty boxes are outside.
    #[must_use]
    pub fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        if bounds.is_empty() {
            return Containment::Outside;
        }
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        self.classify(&bounds.corners(), &axes, &axes)
    }

    /// How a triangle lies to the frustum. Exact but for rounding; a triangle without area may be called intersecting
    /// when it is outside.
    #[must_use]
    pub fn classify_triangle(&self, v: [DVec3; 3]) -> Containment {
        let edges = [v[1] - v[0], v[2] - v[1], v[0] - v[2]];
        self.classify(&v, &[edges[0].cross(edges[1])], &edges)
    }

    /// By the separating axis theorem: two convex polytopes are apart iff they are along a face normal of either or a
    /// cross product of two edges. NaN separates nothing, so broken input is kept.
    fn classify(&self, points: &[DVec3], normals: &[DVec3], edges: &[DVec3]) -> Containment {
        if points.iter().all(|&p| self.contains(p)) {
            return Containment::Inside;
        }
        let beyond = |h: &HalfSpace<f64>| points.iter().all(|&p| h.signed_distance(p) > 0.0);
        if self.planes.iter().any(beyond) {
            return Containment::Outside;
        }
        let own_edges = EDGES.map(|[a, b]| self.corners[b] - self.corners[a]);
        let crossed = own_edges.iter().flat_map(|a| edges.iter().map(|b| a.cross(*b)));
        let apart = normals.iter().copied().chain(crossed).any(|axis| separates(axis, points, &self.corners));
        if apart { Containment::Outside } else { Containment::Intersecting }
    }
}

/// Whether two point sets have disjoint shadows on an axis, by more than the rounding of the shadows.
fn separates(axis: DVec3, a: &[DVec3], b: &[DVec3]) -> bool {
    let shadow = |points: &[DVec3]| {
        points.iter().map(|p| axis.dot(*p)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    let size = a.iter().chain(b).map(|p| p.abs().dot(axis.abs())).fold(0.0, f64::max);
    let ((a_low, a_high), (b_low, b_high)) = (shadow(a), shadow(b));
    let gap = (a_low - b_high).max(b_low - a_high);
    gap > 8.0 * f64::EPSILON * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera() -> Frustum {
        Frustum::perspective(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 90_f64.to_radians(), 2.0, 1.0, 10.0).unwrap()
    }

    #[test]
    fn points() {
        let f = camera();
        assert!(f.contains(DVec3::new(0.0, 0.0, -5.0)));
        assert!(f.contains(DVec3::new(9.99, 4.99, -5.0)));
        assert!(!f.contains(DVec3::new(10.01, 0.0, -5.0)));
        assert!(!f.contains(DVec3::new(0.0, 5.01, -5.0)));
        assert!(!f.contains(DVec3::new(0.0, 0.0, -0.99)));
        assert!(!f.contains(DVec3::new(0.0, 0.0, -10.01)));
        assert!(!f.contains(DVec3::NAN));
    }

    #[test]
    fn boxes() {
        let f = camera();
        let cube = |c: DVec3, h: f64| f.classify_box(&Aabb::new(c - DVec3::splat(h), c + DVec3::splat(h)));
        assert_eq!(cube(DVec3::new(0.0, 0.0, -5.0), 1.0), Containment::Inside);
        assert_eq!(cube(DVec3::new(0.0, 0.0, -5.0), 100.0), Containment::Intersecting);
        assert_eq!(cube(DVec3::new(0.0, 0.0, 5.0), 1.0), Containment::Outside);
        assert_eq!(f.classify_box(&Aabb::empty()), Containment::Outside);
        // Behind the eye and across several planes: the six-plane test alone would keep it.
        let slab = Aabb::new(DVec3::new(-50.0, 20.0, -30.0), DVec3::new(50.0, 60.0, 3.0));
        assert_eq!(f.classify_box(&slab), Containment::Outside);
    }

    #[test]
    fn triangles() {
        let f = camera();
        let at = |z: f64, s: f64| [DVec3::new(-s, -s, z), DVec3::new(s, -s, z), DVec3::new(0.0, s, z)];
        assert_eq!(f.classify_triangle(at(-5.0, 1.0)), Containment::Inside);
        assert_eq!(f.classify_triangle(at(-5.0, 1e4)), Containment::Intersecting);
        assert_eq!(f.classify_triangle(at(-0.5, 1.0)), Containment::Outside);
    }

    #[test]
    fn matrix_and_camera_agree() {
        let (eye, target) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.0, 1.0));
        let (f, up) = ((target - eye).normalize(), DVec3::Y);
        let right = f.cross(up).normalize();
        let world = DMat4::from_cols(right.extend(0.0), right.cross(f).extend(0.0), -f.extend(0.0), eye.extend(1.0));
        let view = world.inverse();
        let from_camera = |ortho: bool| {
            if ortho {
                Frustum::orthographic(eye, target - eye, DVec3::Y, 4.0, 1.5, 0.5, 20.0)
            } else {
                Frustum::perspective(eye, target - eye, DVec3::Y, 0.8, 1.5, 0.5, 20.0)
            }
        };
        // As in the specifications of Vulkan and OpenGL, for depth n..f.
        let (n, f, h) = (0.5, 20.0, 1.0 / 0.4_f64.tan());
        let perspective = |zz, wz| {
            let rows = [[h / 1.5, 0.0, 0.0, 0.0], [0.0, h, 0.0, 0.0], [0.0, 0.0, zz, wz], [0.0, 0.0, -1.0, 0.0]];
            DMat4::from_cols_array_2d(&rows).transpose()
        };
        let rows = [
            [1.0 / 3.0, 0.0, 0.0, 0.0],
            [0.0, 0.5, 0.0, 0.0],
            [0.0, 0.0, -1.0 / (f - n), -n / (f - n)],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let projections = [
            (perspective(-f / (f - n), -n * f / (f - n)), false, false),
            (perspective(-(f + n) / (f - n), -2.0 * n * f / (f - n)), true, false),
            (DMat4::from_cols_array_2d(&rows).transpose(), false, true),
        ];
        for (projection, symmetric, ortho) in projections {
            let a = Frustum::from_matrix(projection * view, symmetric).unwrap();
            let b = from_camera(ortho).unwrap();
            for (p, q) in a.corners().iter().zip(b.corners()) {
                assert!(p.distance(*q) < 1e-11, "{p} {q}");
            }
        }
    }

    #[test]
    fn no_body_is_no_frustum() {
        let make = |angle, near, far| Frustum::perspective(DVec3::ZERO, DVec3::X, DVec3::Y, angle, 1.0, near, far);
        assert!(make(1.0, 0.0, 1.0).is_none());
        assert!(make(1.0, 2.0, 1.0).is_none());
        assert!(make(4.0, 1.0, 2.0).is_none());
        assert!(make(f64::NAN, 1.0, 2.0).is_none());
        assert!(Frustum::perspective(DVec3::ZERO, DVec3::Y, DVec3::Y, 1.0, 1.0, 1.0, 2.0).is_none());
        assert!(Frustum::from_matrix(DMat4::ZERO, false).is_none());
    }

    fn vector(range: f64) -> impl Strategy<Value = DVec3> {
        (-range..range, -range..range, -range..range).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    /// Whether two convex bodies of support points meet, by Frank-Wolfe on the distance of their hulls: an independent
    /// (and slow) answer. `None` where the distance is too small to tell.
    fn meet(a: &[DVec3], b: &[DVec3]) -> Option<bool> {
        let farthest =
            |points: &[DVec3], n: DVec3| points.iter().copied().max_by(|p, q| p.dot(n).total_cmp(&q.dot(n))).unwrap();
        let mut p = a[0] - b[0];
        for k in 0..20_000 {
            let s = farthest(a, -p) - farthest(b, p);
            // The plane through s with normal p separates the origin from the difference body.
            if p.dot(s) > 0.0 {
                return Some(false);
            }
            let step = p - s;
            let t = (p.dot(step) / step.length_squared()).clamp(0.0, 1.0);
            p -= step * t;
            if p.length() < 1e-3 && k > 100 {
                return None;
            }
        }
        None
    }

    proptest! {
        /// A point of the body in the frustum proves that they meet; a separating direction that they do not.
        #[test]
        fn classification_is_sound(c in vector(12.0), h in vector(4.0), seed in vector(1.0)) {
            let f = camera();
            let (lo, hi) = (c - h.abs(), c + h.abs());
            let bounds = Aabb::new(lo, hi);
            let class = f.classify_box(&bounds);
            let inner = (0..200).map(|i| {
                let s = (seed * f64::from(i + 1) * 17.13).map(|x| x.fract().abs());
                lo + (hi - lo) * s
            });
            let mut all = true;
            for p in inner {
                let inside = f.contains(p);
                prop_assert!(!(inside && class == Containment::Outside), "{p} is in both");
                all &= inside;
            }
            prop_assert!(all || class != Containment::Inside);
            if meet(&bounds.corners(), f.corners()) == Some(false) {
                prop_assert_eq!(class, Containment::Outside);
            }
        }

        #[test]
        fn triangles_apart_are_outside(v in [vector(15.0), vector(15.0), vector(15.0)]) {
            let f = camera();
            let class = f.classify_triangle(v);
            if meet(&v, f.corners()) == Some(false) {
                prop_assert_eq!(class, Containment::Outside);
            }
            for i in 0..20 {
                for j in 0..20 - i {
                    let (a, b) = (f64::from(i) / 19.0, f64::from(j) / 19.0);
                    let p = v[0] + (v[1] - v[0]) * a + (v[2] - v[0]) * b;
                    prop_assert!(!(f.contains(p) && class == Containment::Outside));
                }
            }
        }
    }
}
