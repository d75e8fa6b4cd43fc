//! Polygons cut into triangles, in their own plane.

use earcut::Earcut;
use glam::DVec3;

/// Polygons with more corners are not searched for ears when they are concave: that takes quadratic time at worst.
const MOST_CORNERS: usize = 8192;

/// Cuts polygons into triangles; keeps its buffers from one to the next.
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    plane: Vec<[f64; 2]>,
    ears: Vec<u32>,
}

/// What became of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Covered by its triangles.
    Good,
    /// It has no area: its triangles have none either.
    Degenerate,
    /// Too many corners for a concave polygon: the triangles may overlap or reach outside.
    TooLarge,
}

impl Triangulator {
    pub(super) fn new() -> Self {
        Self { earcut: Earcut::new(), plane: Vec::new(), ears: Vec::new() }
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
        if points.len() > MOST_CORNERS {
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

/// Twice the area, along the normal (Newell 1972): exact for plane polygons, the mean for others.
pub(super) fn area_vector(points: &[DVec3]) -> DVec3 {
    let Some((&first, rest)) = points.split_first() else { return DVec3::ZERO };
    rest.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum()
}
