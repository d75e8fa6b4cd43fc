//! Rays to be judged.

use firsthit_geometry::Ray;
use firsthit_measure::random::Rng;
use glam::DVec3;

use super::any_triangle;
use super::tally::Source;

/// Makes rays at a mesh.
pub struct Rays<'a> {
    corners: &'a [[DVec3; 3]],
    low: DVec3,
    size: DVec3,
    rng: Rng,
    made: usize,
}

impl<'a> Rays<'a> {
    /// At a mesh of these triangles.
    #[must_use]
    pub fn new(corners: &'a [[DVec3; 3]], seed: u64) -> Self {
        let all = || corners.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = all().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        Self { corners, low, size: high - low, rng: Rng(seed), made: 0 }
    }

    /// The next ray.
    pub fn next(&mut self, source: Source) -> Ray<f64> {
        self.made += 1;
        match source {
            Source::Random => self.random(),
            Source::Aimed => loop {
                let ray = self.aimed();
                // Two corners may be one.
                if ray.is_valid() {
                    return ray;
                }
            },
        }
    }

    /// In the box, enlarged about its middle.
    fn around(&mut self, times: f64) -> DVec3 {
        self.low + self.size * 0.5 + self.rng.in_cube() * self.size * (0.5 * times)
    }

    /// From within the box and around it, from afar, and from one point to another.
    fn random(&mut self) -> Ray<f64> {
        let within = self.around(1.0);
        match self.made % 4 {
            0 => Ray::new(within, self.rng.direction()),
            1 => Ray::new(self.around(3.0), self.rng.direction()),
            2 => {
                let from = within + self.rng.direction() * self.size.length() * (1.0 + 9.0 * self.rng.unit());
                Ray::new(from, within - from)
            }
            _ => Ray::segment(self.around(1.5), within),
        }
    }

    fn triangle(&mut self) -> [DVec3; 3] {
        any_triangle(self.corners, &mut self.rng)
    }

    /// A small number of few digits: what it is multiplied with is not rounded.
    fn few_digits(&mut self) -> f64 {
        (self.rng.below(31) as f64 - 15.0) / 8.0
    }

    fn aimed(&mut self) -> Ray<f64> {
        let [a, b, c] = self.triangle();
        let from = match self.made % 3 {
            0 => self.around(1.0),
            1 => self.around(4.0),
            _ => self.around(60.0),
        };
        let towards = |target: DVec3| Ray::new(from, target - from);
        match (self.made / 3) % 12 {
            0 => towards(a),
            1 => towards((a + b) * 0.5),
            2 => towards(a + (b - a) * self.rng.unit()),
            // Straight along an edge.
            3 => Ray::new(a - (b - a) * (1.0 + self.rng.below(8) as f64), b - a),
            // In the plane of a triangle.
            4 => {
                let along = (b - a) * self.few_digits() + (c - a) * self.few_digits();
                let through = a + ((b - a) + (c - a)) * 0.25;
                Ray::new(through - along * (1.0 + self.rng.below(6) as f64), along)
            }
            // From a corner: anywhere, and to another corner, which it may not reach or just so.
            5 => Ray::new(a, self.rng.direction()),
            6 => {
                let [to, ..] = self.triangle();
                Ray::segment(a, to)
            }
            // From a corner and towards one, of which the ends count.
            7 => Ray::new(a, b - a).with_interval(-1.0, 1.0),
            // Along an axis, through a corner or the middle of an edge.
            8 | 9 => {
                let through = if self.made.is_multiple_of(2) { a } else { (a + b) * 0.5 };
                let mut direction = DVec3::ZERO;
                let axis = self.rng.below(3);
                direction[axis] = if self.rng.below(2) == 0 { 1.0 } else { -1.0 };
                let ray = Ray::new(through - direction * self.size.max_element() * 2.0, direction);
                // From the other side of the mesh, or from the corner itself.
                if self.rng.below(4) == 0 { Ray { origin: through, ..ray } } else { ray }
            }
            // From very far.
            10 => {
                let target = if self.made.is_multiple_of(2) { a } else { (a + b) * 0.5 };
                let origin =
                    target + self.rng.direction() * self.size.length() * 10f64.powi(2 + (self.made % 4) as i32);
                Ray::new(origin, target - origin)
            }
            // A whole line, almost in the plane of a triangle.
            _ => {
                let tilt = self.rng.direction() * self.size.length() * 1e-12;
                Ray::new(a, (b - a) * self.rng.signed() + (c - a) * self.rng.signed() + tilt)
                    .with_interval(f64::NEG_INFINITY, f64::INFINITY)
            }
        }
    }
}
