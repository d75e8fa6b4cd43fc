//! Repeatable random numbers, and points that are hard to hit.

use glam::DVec3;

/// A small repeatable stream of random numbers (splitmix64).
#[derive(Clone, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// Any 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }
    /// Less than `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// In [-1, 1).
    pub fn signed(&mut self) -> f64 {
        self.unit() * 2.0 - 1.0
    }
    /// In the cube `[-1, 1)^3`.
    pub fn in_cube(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }
    /// On the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.in_cube();
            if (1e-3..1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }
}

/// What of a triangle a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// One of its vertices.
    Vertex,
    /// A point of an edge.
    Edge,
    /// A point inside.
    Face,
}

impl Aim {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Vertex, Self::Edge, Self::Face];

    /// A random such point of a triangle.
    pub fn point(self, v: [DVec3; 3], rng: &mut Rng) -> DVec3 {
        let k = rng.below(3);
        let (a, b, c) = (v[k], v[(k + 1) % 3], v[(k + 2) % 3]);
        match self {
            Self::Vertex => a,
            Self::Edge => {
                // The middle, often: there both neighbours round alike.
                let s = if rng.below(2) == 0 { 0.5 } else { rng.unit() };
                a + (b - a) * s
            }
            Self::Face => {
                let (s, t) = (rng.unit(), rng.unit());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                a + (b - a) * s + (c - a) * t
            }
        }
    }
}
