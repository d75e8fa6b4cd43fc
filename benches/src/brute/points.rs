//! Points to be judged.

use firsthit_measure::random::Rng;
use glam::DVec3;

use super::any_triangle;
use super::tally::Source;

/// Makes points at a mesh.
pub struct Points<'a> {
    corners: &'a [[DVec3; 3]],
    middle: DVec3,
    half: DVec3,
    rng: Rng,
    made: usize,
}

impl<'a> Points<'a> {
    /// At a mesh of these triangles.
    #[must_use]
    pub fn new(corners: &'a [[DVec3; 3]], seed: u64) -> Self {
        let all = || corners.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = all().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        Self { corners, middle: (low + high) * 0.5, half: (high - low) * 0.5, rng: Rng(seed), made: 0 }
    }

    /// The next point.
    pub fn next(&mut self, source: Source) -> DVec3 {
        self.made += 1;
        match source {
            Source::Random => self.random(),
            Source::Aimed => self.aimed(),
        }
    }

    /// In the box and around it; every fourth near the surface.
    fn random(&mut self) -> DVec3 {
        if self.made.is_multiple_of(4) {
            let [a, b, c] = self.triangle();
            let (s, t) = self.weights();
            let off = self.rng.in_cube() * self.half.length() * 0.004;
            return a + (b - a) * s + (c - a) * t + off;
        }
        self.middle + self.rng.in_cube() * self.half * 1.2
    }

    fn triangle(&mut self) -> [DVec3; 3] {
        any_triangle(self.corners, &mut self.rng)
    }

    fn weights(&mut self) -> (f64, f64) {
        let (s, t) = (self.rng.unit(), self.rng.unit());
        if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) }
    }

    fn aimed(&mut self) -> DVec3 {
        let [a, b, c] = self.triangle();
        let size = self.half.length();
        // From where nothing is left of it in f64 to a part of the mesh.
        let small = size * 10f64.powi(-1 - self.rng.below(16) as i32);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let (s, t) = self.weights();
        match self.made % 10 {
            0 => a,
            1 => (a + b) * 0.5,
            2 => a + (b - a) * s,
            3 => a + (b - a) * s + (c - a) * t,
            4 => (a + b + c) / 3.0,
            // Just off a corner, an edge, a face.
            5 => a + self.rng.direction() * small,
            6 => a + (b - a) * s + self.rng.direction() * small,
            7 => a + (b - a) * s + (c - a) * t + normal * if self.made % 20 < 10 { small } else { -small },
            // Along the normal at an edge or a corner: as near to several triangles.
            8 => {
                let from = if self.made % 20 < 10 { (a + b) * 0.5 } else { a };
                from + normal * (small * self.rng.signed())
            }
            _ => self.middle + self.rng.direction() * size * 10f64.powi(1 + (self.made / 10 % 3) as i32),
        }
    }
}
