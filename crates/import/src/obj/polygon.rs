//! Polygons cut into triangles, in their own plane.

use earcut::Earcut;
use glam::DVec3;

/// Polygons with more corners are not searched for ears when they are concave: that takes quadratic time at worst.
const MOST_CORNERS: usize = 4096;

/// Nor are those of more corners than this that run through the same points again and again, for which it does.
const SOME_CORNERS: usize = 32;

/// Nor are those of more corners than this, once the squares of such numbers add up to [`MOST_SEARCH`] in a file: whatever
/// they are, it takes no longer than some 20 s.
const MANY_CORNERS: usize = 256;
const MOST_SEARCH: u64 = 1 << 28;

/// Cuts polygons into triangles; keeps its buffers from one to the next.
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    plane: Vec<[f64; 2]>,
    ears: Vec<u32>,
    /// Squares of the numbers of many corners so far.
    searched: u64,
}

/// What became of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Covered by its triangles.
    Good,
    /// It has no area: its triangles have none either.
    Degenerate,
    /// Too many corners for a concave polygon, or for all of them, or the same ones too often: the triangles may overlap or reach outside.
    TooLarge,
}

impl Triangulator {
    pub(super) fn new() -> Self {
        Self { earcut: Earcut::new(), plane: Vec::new(), ears: Vec::new(), searched: 0 }
    }

    /// Appends the triangles of a polygon, as indices into `points`, with the polygon's own orientation.
    ///
    /// A fan from the first corner where that covers the polygon, for it uses every corner and so leaves no crack to
    /// the neighbours; else ears, cut in the plane of Newell's normal.
    pub(super) fn triangulate(&mut self, points: &[DVec3], out: &mut Vec<[u32; 3]>) -> Outcome {
        let n = points.len() as u32;
        if n == 3 {
            out.push([0, 1, 2]);
            let area = area_vector(points);
            return if area == DVec3::ZERO { Outcome::Degenerate } else { Outcome::Good };
        }
        let area = area_vector(points);
        let fan = |apex: u32| (1..n - 1).map(move |i| [apex, (apex + i) % n, (apex + i + 1) % n]);
        if area == DVec3::ZERO || !area.is_finite() {
            out.extend(fan(0));
            return Outcome::Degenerate;
        }
        let area2 = area.length_squared();
        let signed = |t: [u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            (b - a).cross(c - a).dot(area) / area2
        };
        // How far the worst triangle of a fan turns the wrong way.
        let worst = |apex: u32| fan(apex).map(signed).fold(f64::INFINITY, f64::min);
        // Coordinates have six or seven digits: corners on a line turn the wrong way by so much.
        let slack = -1e-6;
        let first = worst(0);
        if n == 4 {
            // The fans of the first two corners are the two ways to cut along a diagonal.
            let apex = if first >= slack || first >= worst(1) { 0 } else { 1 };
            out.extend(fan(apex));
            return Outcome::Good;
        }
        if first >= slack {
            out.extend(fan(0));
            return Outcome::Good;
        }
        if points.len() > MANY_CORNERS {
            self.searched = self.searched.saturating_add((points.len() as u64).pow(2));
        }
        if points.len() > MOST_CORNERS
            || points.len() > MANY_CORNERS && self.searched > MOST_SEARCH
            || points.len() > SOME_CORNERS && distinct(points) < points.len() / 2
        {
            out.extend(fan(0));
            return Outcome::TooLarge;
        }
        // Seen along the largest component of the normal the polygon keeps the most of its area.
        let a = area.abs();
        let (i, j) = match () {
            () if a.x >= a.y && a.x >= a.z => (1, 2),
            () if a.y >= a.z => (2, 0),
            () => (0, 1),
        };
        // From the first corner, and in units of its size: products of the coordinates may neither overflow nor vanish.
        let size = points.iter().fold(0.0, |s, p| f64::max(s, (*p - points[0]).abs().max_element()));
        self.plane.clear();
        self.plane.extend(points.iter().map(|p| (*p - points[0]) / size).map(|p| [p[i], p[j]]));
        self.earcut.earcut_slice(&self.plane, &[], &mut self.ears);
        if self.ears.is_empty() {
            out.extend(fan(0));
            return Outcome::Degenerate;
        }
        out.extend(self.ears.chunks_exact(3).map(|t| {
            let t = [t[0], t[1], t[2]];
            if signed(t) < 0.0 { [t[0], t[2], t[1]] } else { t }
        }));
        Outcome::Good
    }
}

/// How many different points there are.
fn distinct(points: &[DVec3]) -> usize {
    let mut points: Vec<[u64; 3]> = points.iter().map(|p| (*p + 0.0).to_array().map(f64::to_bits)).collect();
    points.sort_unstable();
    points.dedup();
    points.len()
}

/// Twice the area, along the normal (Newell 1972): exact for plane polygons, the mean for others.
pub(super) fn area_vector(points: &[DVec3]) -> DVec3 {
    let Some((&first, rest)) = points.split_first() else { return DVec3::ZERO };
    rest.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cut(points: &[DVec3]) -> (Vec<[u32; 3]>, Outcome) {
        let mut out = Vec::new();
        let outcome = Triangulator::new().triangulate(points, &mut out);
        (out, outcome)
    }

    fn flat(points: &[[f64; 2]]) -> Vec<DVec3> {
        points.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// Twice the signed areas, as seen from +Z.
    fn areas(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<f64> {
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| points[i as usize]);
                (b - a).cross(c - a).z
            })
            .collect()
    }

    #[test]
    fn a_concave_quadrilateral_is_cut_along_its_inner_diagonal() {
        // The corner at (0.2, 0.2) points inwards.
        let arrow = [[0.0, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]];
        for turn in 0..4 {
            let mut points = arrow;
            points.rotate_left(turn);
            let points = flat(&points);
            let (triangles, outcome) = cut(&points);
            assert_eq!((triangles.len(), outcome), (2, Outcome::Good));
            let areas = areas(&points, &triangles);
            assert!(areas.iter().all(|a| *a > 0.0), "{areas:?}");
            assert!((areas.iter().sum::<f64>() - 0.4).abs() < 1e-12, "{areas:?}");
        }
    }

    #[test]
    fn corners_on_the_edges_of_a_convex_polygon_are_all_used() {
        let points = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]]);
        let (triangles, _) = cut(&points);
        assert_eq!(triangles.len(), 5);
        for i in 0..7 {
            assert!(triangles.iter().flatten().any(|&c| c == i), "corner {i} would leave a crack");
        }
    }

    #[test]
    fn polygons_without_area_make_triangles_without_area() {
        for points in [vec![[0.0, 0.0]; 5], vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]] {
            let (triangles, outcome) = cut(&flat(&points));
            assert_eq!((triangles.len(), outcome), (points.len() - 2, Outcome::Degenerate));
        }
        assert_eq!(cut(&flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])).1, Outcome::Degenerate);
    }

    #[test]
    fn endless_outlines_are_not_searched_for_ever() {
        let star = |n: usize| {
            let corner = |k: usize| {
                let (r, angle) =
                    (if k.is_multiple_of(2) { 1.0 } else { 0.5 }, std::f64::consts::TAU * k as f64 / n as f64);
                [r * f64::cos(angle), r * f64::sin(angle)]
            };
            flat(&(0..n).map(corner).collect::<Vec<_>>())
        };
        let (mut triangulator, mut out) = (Triangulator::new(), Vec::new());
        let good = (0..).take_while(|_| triangulator.triangulate(&star(4096), &mut out) == Outcome::Good).count();
        assert_eq!(good as u64, MOST_SEARCH >> 24);
        // So are none that run around a square a hundred times, with a turn.
        let again: Vec<_> = (0..400).map(|k| [f64::from(k / 2 % 2), f64::from((k + 1) / 2 % 2)]).collect();
        assert_eq!(cut(&flat(&[again, vec![[0.4, 0.3], [2.0, 0.1]]].concat())).1, Outcome::TooLarge);
        // Smaller ones are cut as before.
        assert_eq!(triangulator.triangulate(&star(256), &mut out), Outcome::Good);
        assert_eq!(triangulator.triangulate(&star(258), &mut out), Outcome::TooLarge);
    }

    proptest! {
        /// A star around the origin, in any plane: no gap, no overlap, nothing outside, same orientation.
        #[test]
        fn concave_polygons_are_covered_once(
            radii in proptest::collection::vec(0.1..2.0_f64, 5..60),
            axis in proptest::array::uniform3(-1.0..1.0_f64),
            scale in -12..12_i32,
        ) {
            let axis = DVec3::from(axis).normalize_or(DVec3::Z);
            let turn = glam::DQuat::from_rotation_arc(DVec3::Z, axis);
            let size = 10_f64.powi(scale);
            let n = radii.len();
            let star: Vec<DVec3> = radii.iter().enumerate().map(|(i, r)| {
                let a = std::f64::consts::TAU * i as f64 / n as f64;
                r * DVec3::new(a.cos(), a.sin(), 0.0)
            }).collect();
            let placed: Vec<DVec3> = star.iter().map(|p| size * (turn * *p)).collect();
            let (triangles, outcome) = cut(&placed);
            prop_assert_eq!(outcome, Outcome::Good);
            let covered = areas(&star, &triangles);
            let total = area_vector(&star).z;
            prop_assert!(covered.iter().all(|a| *a >= -1e-5 * total), "{:?}", covered);
            // All triangles turn the same way, so equal areas mean that nothing is covered twice or left out; the slack
            // is that of the fan.
            prop_assert!((covered.iter().sum::<f64>() - total).abs() < 1e-6 * total);
        }
    }
}
