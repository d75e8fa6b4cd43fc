//! The random numbers of generated scenes and rays: PCG32 (O'Neill 2014), small and the same everywhere.

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Pcg(u64);

impl Pcg {
    /// The stream of a seed. Its first two numbers, which still show the seed, are left out.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut pcg = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1));
        pcg.bits();
        pcg.bits();
        pcg
    }

    /// Any 32 bits.
    pub fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    /// In `[0, 1)`.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    /// In `[low, high)`.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Each coordinate in `[-most, most)`.
    pub fn vector(&mut self, most: glam::Vec3) -> glam::Vec3 {
        let [x, y, z] = most.to_array().map(|m| self.within(-m, m));
        glam::Vec3::new(x, y, z)
    }
}
