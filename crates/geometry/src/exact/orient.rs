//! On which side a point lies: of a plane, of a line.

use glam::DVec3;

use super::dyadic::Dyadic;
use super::number::{Ball, Number, Wide, cross, differences, dot};

/// On which side of the plane through `a`, `b` and `c` the point `d` lies: the sign of `(b - a) x (c - a) . (d - a)`, exactly.
/// 0 if the four lie in a plane. All must be finite.
///
/// ```
/// use firsthit_geometry::exact::orient3d;
/// use glam::DVec3;
/// let d = DVec3::new(0.1, 0.2, -1e-300);
/// assert_eq!(orient3d(DVec3::ZERO, DVec3::X, DVec3::Y, d), -1);
/// ```
#[must_use]
pub fn orient3d(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i32 {
    fn formula<N: Number>([a, b, c, d]: [DVec3; 4]) -> N {
        dot(&cross(&differences(b, a), &differences(c, a)), &differences(d, a))
    }
    let points = [a, b, c, d];
    let sign = formula::<Ball>(points).sign().or_else(|| formula::<Wide>(points).sign());
    sign.unwrap_or_else(|| formula::<Dyadic>(points).signum())
}

/// On which side of the line from `a` to `b` the point `c` lies: 1 to the left, -1 to the right, 0 on it, exactly. All must be
/// finite.
#[must_use]
pub fn orient2d(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> i32 {
    fn formula<N: Number>([a, b, c]: [[f64; 2]; 3]) -> N {
        let [bx, by] = [0, 1].map(|k| N::difference(b[k], a[k]));
        let [cx, cy] = [0, 1].map(|k| N::difference(c[k], a[k]));
        bx.times(&cy).minus(&by.times(&cx))
    }
    let points = [a, b, c];
    let sign = formula::<Ball>(points).sign().or_else(|| formula::<Wide>(points).sign());
    sign.unwrap_or_else(|| formula::<Dyadic>(points).signum())
}
