//! Sample points: Owen-scrambled Sobol, a pure function of what they are for.
//!
//! Every use of random numbers has its own [`Dimension`], and each dimension is its own two-dimensional Sobol
//! sequence: its order of samples is shuffled and its points are scrambled by hashes of (seed, pixel, branch,
//! dimension). So leaving out one effect never changes the numbers that another one sees, and a pixel's points do not
//! depend on how often, or in which order, numbers were asked for. Within one dimension the points of every aligned
//! block of 2^k samples keep the stratification of the (0, 2)-sequence.
//!
//! Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020; the hash that scrambles is Vegdahl's variant of
//! the Laine-Karras one (*Building a Better LK Hash*, 2021).

/// What a sample is for. The number is the bounce: 0 at the camera's first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// Where in the pixel's filter the camera ray passes.
    Pixel,
    /// Which light is asked.
    LightChoice(u32),
    /// Where on the light, or in which direction of the environment.
    LightPosition(u32),
    /// Which lobe of the material goes on.
    Lobe(u32),
    /// In which direction it goes on.
    Direction(u32),
    /// Whether a partly covering surface is there.
    Alpha(u32),
    /// Whether the path goes on.
    Roulette(u32),
    /// Which colour a path follows once a surface parts them.
    Color,
}

impl Dimension {
    /// Each pair of purpose and bounce has one number, forever.
    const fn index(self) -> u32 {
        const PURPOSES: u32 = 8;
        match self {
            Self::Pixel => 0,
            // Of the first row, which has a bounce for no purpose but this one.
            Self::Color => PURPOSES,
            Self::LightChoice(bounce) => 1 + PURPOSES * bounce,
            Self::LightPosition(bounce) => 2 + PURPOSES * bounce,
            Self::Lobe(bounce) => 3 + PURPOSES * bounce,
            Self::Direction(bounce) => 4 + PURPOSES * bounce,
            Self::Alpha(bounce) => 5 + PURPOSES * bounce,
            Self::Roulette(bounce) => 6 + PURPOSES * bounce,
        }
    }
}

/// The sample points of one sample of one pixel.
///
/// ```
/// use firsthit_render::sampler::{Dimension, PixelSampler};
/// let sampler = PixelSampler::new(7, (3, 4), 0);
/// let [x, y] = sampler.get2(Dimension::Pixel);
/// assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
/// assert_eq!([x, y], sampler.get2(Dimension::Pixel), "asking twice changes nothing");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelSampler {
    key: u32,
    sample: u32,
}

impl PixelSampler {
    /// The `sample`-th sample of a pixel.
    #[inline]
    #[must_use]
    pub fn new(seed: u64, pixel: (u32, u32), sample: u32) -> Self {
        let key = [seed as u32, (seed >> 32) as u32, pixel.0, pixel.1].into_iter().fold(0x9e37_79b9, combine);
        Self { key, sample }
    }

    /// Points for one of several branches of a path, or one of several lights: independent of all other branches'.
    #[inline]
    #[must_use]
    pub fn branch(self, branch: u32) -> Self {
        Self { key: combine(self.key ^ 0x5bd1_e995, branch), sample: self.sample }
    }

    /// A point in the unit square, each coordinate in [0, 1).
    #[inline]
    #[must_use]
    pub fn get2(&self, dimension: Dimension) -> [f32; 2] {
        let key = combine(self.key, dimension.index());
        let index = owen_scramble(self.sample, key);
        [
            to_unit(owen_scramble(index.reverse_bits(), combine(key, 1))),
            to_unit(owen_scramble(sobol_second(index), combine(key, 2))),
        ]
    }

    /// A number in [0, 1).
    #[inline]
    #[must_use]
    pub fn get1(&self, dimension: Dimension) -> f32 {
        let key = combine(self.key, dimension.index());
        let index = owen_scramble(self.sample, key);
        to_unit(owen_scramble(index.reverse_bits(), combine(key, 1)))
    }
}

/// A hash with full avalanche (Chris Wellons, *Prospecting for Hash Functions*: `lowbias32`).
#[inline]
fn hash(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of a pair.
#[inline]
fn combine(key: u32, value: u32) -> u32 {
    hash(key.rotate_left(5) ^ hash(value.wrapping_add(0x9e37_79b9)))
}

/// Nested uniform (Owen) scrambling in base 2: every bit is flipped by a hash of the bits above it.
#[inline]
fn owen_scramble(x: u32, key: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The second dimension of the Sobol sequence: its generator matrix is Pascal's triangle modulo 2.
#[inline]
fn sobol_second(index: u32) -> u32 {
    let (mut index, mut column, mut point) = (index, 1 << 31, 0);
    while index != 0 {
        if index & 1 != 0 {
            point ^= column;
        }
        column ^= column >> 1;
        index >>= 1;
    }
    point
}

/// The upper 24 bits as a number in [0, 1): all of them are exact in f32.
#[inline]
fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIMENSIONS: [Dimension; 8] = [
        Dimension::Pixel,
        Dimension::LightChoice(0),
        Dimension::LightPosition(0),
        Dimension::Lobe(0),
        Dimension::Direction(0),
        Dimension::Alpha(0),
        Dimension::Roulette(0),
        Dimension::Direction(3),
    ];

    #[test]
    fn dimensions_never_share_a_number() {
        let mut numbers: Vec<u32> = (0..64)
            .flat_map(|b| {
                [
                    Dimension::LightChoice(b),
                    Dimension::LightPosition(b),
                    Dimension::Lobe(b),
                    Dimension::Direction(b),
                    Dimension::Alpha(b),
                    Dimension::Roulette(b),
                ]
            })
            .chain([Dimension::Pixel, Dimension::Color])
            .map(Dimension::index)
            .collect();
        let count = numbers.len();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), count);
    }

    /// Every elementary interval of area 2^-k holds exactly one of 2^k points: the (0, 2)-sequence property, for the
    /// first block and for later aligned ones.
    #[test]
    fn aligned_blocks_are_stratified_in_every_elementary_interval() {
        for dimension in DIMENSIONS {
            for (pixel, block) in [((0, 0), 0_u32), ((17, 3), 1), ((640, 359), 5)] {
                for k in [0_u32, 1, 2, 4, 6, 8] {
                    let n = 1_u32 << k;
                    let points: Vec<[f32; 2]> =
                        (0..n).map(|i| PixelSampler::new(1, pixel, block * n + i).get2(dimension)).collect();
                    for across in 0..=k {
                        let (nx, ny) = (1_u32 << across, 1_u32 << (k - across));
                        let mut seen = vec![0; n as usize];
                        for [x, y] in &points {
                            seen[((x * nx as f32) as u32 + nx * (y * ny as f32) as u32) as usize] += 1;
                        }
                        assert!(seen.iter().all(|c| *c == 1), "{dimension:?} {pixel:?} block {block} {nx}x{ny}");
                    }
                }
            }
        }
    }

    /// The mean over n points of f(x) g(y) between two dimensions goes to the product of the means: no correlation
    /// between purposes, pixels or branches.
    #[test]
    fn dimensions_pixels_and_branches_are_not_correlated() {
        const N: u32 = 4096;
        let centred = |s: PixelSampler, d| f64::from(s.get1(d)) - 0.5;
        let correlation =
            |f: &dyn Fn(u32) -> (f64, f64)| (0..N).map(f).map(|(a, b)| a * b).sum::<f64>() / f64::from(N) * 12.0;
        // The standard deviation for independent numbers is 1/sqrt(N) = 1/64; 5 sigma.
        let bound = 5.0 / 64.0;
        for (i, a) in DIMENSIONS.into_iter().enumerate() {
            for b in DIMENSIONS.into_iter().skip(i + 1) {
                let c = correlation(&|s| {
                    let p = PixelSampler::new(0, (5, 6), s);
                    (centred(p, a), centred(p, b))
                });
                assert!(c.abs() < bound, "{a:?} {b:?}: {c}");
            }
        }
        let d = Dimension::LightPosition(0);
        let neighbours = correlation(&|s| {
            (
                centred(PixelSampler::new(0, (s % 64, s / 64), 0), d),
                centred(PixelSampler::new(0, (s % 64 + 1, s / 64), 0), d),
            )
        });
        assert!(neighbours.abs() < bound, "neighbouring pixels: {neighbours}");
        let branches = correlation(&|s| {
            let p = PixelSampler::new(0, (5, 6), s);
            (centred(p.branch(0), d), centred(p.branch(1), d))
        });
        assert!(branches.abs() < bound, "branches: {branches}");
    }

    #[test]
    fn seeds_pixels_and_branches_differ() {
        let p = |seed, pixel, branch| PixelSampler::new(seed, pixel, 0).branch(branch).get2(Dimension::Pixel);
        let base = p(0, (1, 2), 0);
        for other in [p(1, (1, 2), 0), p(1 << 32, (1, 2), 0), p(0, (2, 1), 0), p(0, (1, 3), 0), p(0, (1, 2), 1)] {
            assert_ne!(base, other);
        }
    }

    /// Stratified points integrate a smooth function far better than random ones (error ~ 1/sqrt(n)).
    #[test]
    fn a_smooth_function_is_integrated_better_than_by_random_points() {
        let n = 256;
        let mut square_error = 0.0;
        for pixel in 0..64 {
            let mean = (0..n)
                .map(|i| PixelSampler::new(3, (pixel, 0), i).get2(Dimension::LightPosition(0)))
                .map(|[x, y]| f64::from(x * y))
                .sum::<f64>()
                / f64::from(n);
            square_error += (mean - 0.25).powi(2) / 64.0;
        }
        // Random points: the variance of x y is 7/144.
        let random = (7.0_f64 / 144.0 / f64::from(n)).sqrt();
        assert!(square_error.sqrt() < random / 10.0, "{} against {random}", square_error.sqrt());
    }
}
