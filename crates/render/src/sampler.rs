//! Sample points: Owen-scrambled Sobol, a pure function of what they are for.
//!
//! Every use of random numbers has its own [`Dimension`], and each dimension is its own two-dimensional Sobol
//! sequence: its order of samples is shuffled and its points are scrambled by hashes of (seed, branch, dimension). So
//! leaving out one effect never changes the numbers that another one sees, and a pixel's points do not depend on how
//! often, or in which order, numbers were asked for. Within one dimension the points of every aligned block of 2^k
//! samples keep the stratification of the (0, 2)-sequence.
//!
//! Pixels differ by a digital shift, which keeps all of that and is itself a sequence along a Morton curve whose order
//! is shuffled: in each coordinate the points of 2^j samples of an aligned square of 4^k pixels fall one into each of
//! 2^(j+2k) intervals, for every j and k. Neighbours therefore err in different directions, and the error of a picture
//! is fine-grained (blue noise) at any number of samples: the aim of Ahmed and Wonka, *Screen-Space Blue-Noise
//! Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels* (2020), without knowing that number
//! beforehand.
//!
//! From the fifth bounce on numbers are independent: nothing is gained by order there.
//!
//! Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020; the hash that scrambles is Vegdahl's variant of
//! the Laine-Karras one (*Building a Better LK Hash*, 2021). The second coordinate is computed as by Ahmed, *An
//! Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and Compact* (2024).

use std::cell::Cell;

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
    /// How far a path gets in fog.
    Fog(u32),
    /// Which colour a path follows once a surface parts them.
    Color,
    /// Where on the lens the camera ray starts.
    Lens,
    /// When, while the shutter is open.
    Time,
}

/// Where sample points come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerChoice {
    /// Owen-scrambled Sobol points, spread over the picture.
    #[default]
    Sobol,
    /// Independent random numbers, by a PCG hash: for comparison.
    Independent,
}

impl SamplerChoice {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Sobol, Self::Independent];

    /// The name used on command lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::Independent => "independent",
        }
    }
}

impl Dimension {
    /// Dimensions from here on are not ordered: bounce 4 and later.
    const INDEPENDENT: u32 = 1 + 8 * 4;

    /// Each pair of purpose and bounce has one number, forever.
    const fn index(self) -> u32 {
        const PURPOSES: u32 = 8;
        match self {
            Self::Pixel => 0,
            // Those that have no bounce take what is free in the rows.
            Self::Lens => 7,
            Self::Time => 2 * PURPOSES,
            // Of the first row, which has a bounce for no purpose but this one.
            Self::Color => PURPOSES,
            Self::LightChoice(bounce) => 1 + PURPOSES * bounce,
            Self::LightPosition(bounce) => 2 + PURPOSES * bounce,
            Self::Lobe(bounce) => 3 + PURPOSES * bounce,
            Self::Direction(bounce) => 4 + PURPOSES * bounce,
            Self::Alpha(bounce) => 5 + PURPOSES * bounce,
            Self::Roulette(bounce) => 6 + PURPOSES * bounce,
            // The first place of that row is the lens's.
            Self::Fog(bounce) => 7 + PURPOSES * (bounce + 1),
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
    /// Of the seed and the branch.
    key: u32,
    /// The sample's number with its bits reversed: the van der Corput point.
    sample: u32,
    /// The pixel's place on a Morton curve, bits reversed.
    place: u32,
    independent: bool,
}

impl PixelSampler {
    /// The `sample`-th sample of a pixel.
    #[inline]
    #[must_use]
    pub fn new(seed: u64, pixel: (u32, u32), sample: u32) -> Self {
        Self::of(SamplerChoice::Sobol, seed, pixel, sample)
    }

    /// The same from another source of points.
    #[inline]
    #[must_use]
    pub fn of(choice: SamplerChoice, seed: u64, pixel: (u32, u32), sample: u32) -> Self {
        // A Morton curve of 32 bits covers 65536 x 65536 pixels; squares of that size have keys of their own.
        let square = (pixel.0 >> 16) | (pixel.1 & 0xffff_0000);
        let key = [seed as u32, (seed >> 32) as u32, square].into_iter().fold(0x9e37_79b9, combine);
        let place = (spread(pixel.0) | spread(pixel.1) << 1).reverse_bits();
        Self { key, sample: sample.reverse_bits(), place, independent: choice == SamplerChoice::Independent }
    }

    /// The same for another sample of the pixel.
    #[inline]
    #[must_use]
    pub(crate) fn at(self, sample: u32) -> Self {
        Self { sample: sample.reverse_bits(), ..self }
    }

    /// Points for one of several branches of a path, or one of several lights: independent of all other branches'.
    #[inline]
    #[must_use]
    pub fn branch(self, branch: u32) -> Self {
        Self { key: combine(self.key ^ 0x5bd1_e995, branch), ..self }
    }

    /// A point in the unit square, each coordinate in [0, 1).
    #[inline]
    #[must_use]
    pub fn get2(&self, dimension: Dimension) -> [f32; 2] {
        let dimension = dimension.index();
        if self.is_random(dimension) { self.random(dimension) } else { self.scramble(dimension).point(self.sample) }
    }

    /// A number in [0, 1).
    #[inline]
    #[must_use]
    pub fn get1(&self, dimension: Dimension) -> f32 {
        let dimension = dimension.index();
        if self.is_random(dimension) {
            self.random(dimension)[0]
        } else {
            self.scramble(dimension).coordinate(self.sample)
        }
    }

    /// Whether numbers of this dimension are independent.
    #[inline]
    fn is_random(&self, dimension: u32) -> bool {
        self.independent || dimension >= Dimension::INDEPENDENT
    }

    /// What the points of this pixel have in common in a dimension.
    fn scramble(&self, dimension: u32) -> Scramble {
        let key = combine(self.key, dimension);
        Scramble {
            order: key,
            shifts: [self.shift(combine(key, 3)).reverse_bits(), self.shift(combine(key, 4)).reverse_bits()],
            keys: [combine(key, 1), combine(key, 2)],
        }
    }

    /// What tells this pixel's points from those of other pixels. Level r of the shift is the sum of C(r, c) m_c over
    /// the bits of the place m from the lowest: any k successive rows of the first k columns of that matrix have
    /// determinant 1, so whatever levels the samples of a pixel have filled, the next k tell 2^k pixels apart.
    #[inline]
    fn shift(&self, key: u32) -> u32 {
        pascal(laine_karras(self.place, key))
    }

    /// Independent numbers: the PCG hash of four words of Jarzynski and Olano, *Hash Functions for GPU Rendering*,
    /// JCGT 9(3), 2020.
    #[inline]
    fn random(&self, dimension: u32) -> [f32; 2] {
        let pcg = |x: u32| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let [mut x, mut y, mut z, mut w] = [self.place, self.sample, dimension, self.key].map(pcg);
        for _ in 0..2 {
            x = x.wrapping_add(y.wrapping_mul(w));
            y = y.wrapping_add(z.wrapping_mul(x));
            z = z.wrapping_add(x.wrapping_mul(y));
            w = w.wrapping_add(y.wrapping_mul(z));
            [x, y, z, w] = [x, y, z, w].map(|v| v ^ (v >> 16));
        }
        [to_unit(x), to_unit(y)]
    }
}

/// What the points of all samples of a pixel have in common in one dimension. Bits are in the order of the sample's number,
/// the lowest first: that of points reversed.
#[derive(Clone, Copy, Debug)]
struct Scramble {
    /// Of the order of samples.
    order: u32,
    /// Of the two coordinates.
    shifts: [u32; 2],
    keys: [u32; 2],
}

impl Scramble {
    /// The point of a sample, whose number is given with its bits reversed. Owen's scrambling flips each bit by a hash of
    /// the bits above it, which are those below it in this order.
    #[inline]
    fn point(&self, sample: u32) -> [f32; 2] {
        let index = laine_karras(sample, self.order).reverse_bits();
        let x = laine_karras(index ^ self.shifts[0], self.keys[0]);
        let y = laine_karras(pascal(index) ^ self.shifts[1], self.keys[1]);
        // Both at once.
        let turned = (u64::from(x) | u64::from(y) << 32).reverse_bits();
        [to_unit((turned >> 32) as u32), to_unit(turned as u32)]
    }

    /// The first coordinate of that.
    #[inline]
    fn coordinate(&self, sample: u32) -> f32 {
        let index = laine_karras(sample, self.order).reverse_bits();
        to_unit(laine_karras(index ^ self.shifts[0], self.keys[0]).reverse_bits())
    }
}

/// The points of [`PixelSampler`]s, for one thread: what samples of a pixel have in common is worked out once for those that
/// follow each other.
#[derive(Debug)]
pub(crate) struct Points {
    known: [Cell<Known>; Dimension::INDEPENDENT as usize],
}

impl Default for Points {
    fn default() -> Self {
        Self { known: [const { Cell::new(Known::NOTHING) }; Dimension::INDEPENDENT as usize] }
    }
}

/// A pixel, by what is asked of its sampler, and its scramble in one dimension.
#[derive(Clone, Copy, Debug)]
struct Known {
    pixel: Option<(u32, u32)>,
    scramble: Scramble,
}

impl Known {
    const NOTHING: Self = Self { pixel: None, scramble: Scramble { order: 0, shifts: [0; 2], keys: [0; 2] } };
}

impl Points {
    /// [`PixelSampler::get2`].
    #[inline]
    pub(crate) fn get2(&self, sampler: &PixelSampler, dimension: Dimension) -> [f32; 2] {
        let dimension = dimension.index();
        if sampler.is_random(dimension) {
            sampler.random(dimension)
        } else {
            self.scramble(sampler, dimension).point(sampler.sample)
        }
    }

    /// [`PixelSampler::get1`].
    #[inline]
    pub(crate) fn get1(&self, sampler: &PixelSampler, dimension: Dimension) -> f32 {
        let dimension = dimension.index();
        if sampler.is_random(dimension) {
            sampler.random(dimension)[0]
        } else {
            self.scramble(sampler, dimension).coordinate(sampler.sample)
        }
    }

    #[inline]
    fn scramble(&self, sampler: &PixelSampler, dimension: u32) -> Scramble {
        let place = &self.known[dimension as usize];
        let known = place.get();
        let pixel = Some((sampler.key, sampler.place));
        if known.pixel == pixel {
            return known.scramble;
        }
        let scramble = sampler.scramble(dimension);
        place.set(Known { pixel, scramble });
        scramble
    }
}

/// The lower 16 bits with gaps between them.
#[inline]
fn spread(x: u32) -> u32 {
    let mut x = x & 0xffff;
    x = (x | x << 8) & 0x00ff_00ff;
    x = (x | x << 4) & 0x0f0f_0f0f;
    x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
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

/// Every bit is flipped by a hash of the bits below it.
#[inline]
fn laine_karras(mut x: u32, key: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// Pascal's triangle modulo 2, whose entry C(c, r) is odd where the bits of r are among those of c, times the bits of a number.
/// It is the generator matrix of the second coordinate of Sobol points.
#[inline]
fn pascal(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^ (x >> 16)
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
                    Dimension::Fog(b),
                ]
            })
            .chain([Dimension::Pixel, Dimension::Color, Dimension::Lens, Dimension::Time])
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
        assert!(neighbours < -0.1, "neighbouring pixels differ more than by chance: {neighbours}");
        let distant = correlation(&|s| {
            (
                centred(PixelSampler::new(0, (s % 64, s / 64), 0), d),
                centred(PixelSampler::new(0, (s % 64 + 640, s / 64 + 1280), 0), d),
            )
        });
        assert!(distant.abs() < bound, "distant pixels: {distant}");
        let branches = correlation(&|s| {
            let p = PixelSampler::new(0, (5, 6), s);
            (centred(p.branch(0), d), centred(p.branch(1), d))
        });
        assert!(branches.abs() < bound, "branches: {branches}");
    }

    /// The definition by columns.
    fn second_by_columns(mut index: u32) -> u32 {
        let (mut column, mut point) = (1_u32 << 31, 0);
        while index != 0 {
            if index & 1 != 0 {
                point ^= column;
            }
            column ^= column >> 1;
            index >>= 1;
        }
        point
    }

    #[test]
    fn the_second_coordinate_is_that_of_the_sobol_sequence() {
        for i in (0..1000).chain([u32::MAX, 1 << 31, 0x1234_5678]) {
            assert_eq!(pascal(i).reverse_bits(), second_by_columns(i), "{i}");
        }
    }

    /// In each coordinate, the points of any 2^j first samples in any aligned square of 4^k pixels.
    #[test]
    fn squares_of_pixels_are_stratified_together() {
        for dimension in [Dimension::Pixel, Dimension::LightPosition(0), Dimension::Direction(2)] {
            for (j, k, corner) in [(0, 1, (4, 6)), (0, 3, (16, 8)), (2, 1, (0, 2)), (4, 2, (64, 128)), (6, 1, (10, 12))]
            {
                let (side, samples) = (1_u32 << k, 1_u32 << j);
                let intervals = (samples * side * side) as usize;
                let mut seen = vec![[0; 2]; intervals];
                for i in 0..side * side {
                    let pixel = (corner.0 + i % side, corner.1 + i / side);
                    for s in 0..samples {
                        let p = PixelSampler::new(3, pixel, s).get2(dimension);
                        for (c, x) in p.iter().enumerate() {
                            seen[(x * intervals as f32) as usize][c] += 1;
                        }
                    }
                }
                assert!(seen.iter().flatten().all(|n| *n == 1), "{dimension:?} {samples} samples, {side} x {side}");
            }
        }
    }

    /// Means over squares of 8 x 8 pixels of one sample each of a function of two dimensions, which no net covers: no
    /// worse than by chance; of one dimension: far better.
    #[test]
    fn the_error_of_a_picture_is_fine_grained() {
        let spread = |choice: SamplerChoice, f: &dyn Fn(PixelSampler) -> f32| {
            let mut sum = 0.0;
            for block in 0..256_u32 {
                let mean = (0..64)
                    .map(|i| {
                        let pixel = (block % 16 * 8 + i % 8, block / 16 * 8 + i / 8);
                        f64::from(f(PixelSampler::of(choice, 0, pixel, 0)))
                    })
                    .sum::<f64>()
                    / 64.0;
                sum += (mean - 0.5).powi(2) / 256.0;
            }
            sum
        };
        let one = |p: PixelSampler| p.get1(Dimension::LightPosition(0));
        let two = |p: PixelSampler| f32::from(u8::from(p.get1(Dimension::Direction(0)) < p.get1(Dimension::Lobe(0))));
        let [sobol, independent] = SamplerChoice::ALL.map(|c| spread(c, &one));
        assert!(sobol < 0.01 * independent, "{sobol} against {independent}");
        let [sobol, independent] = SamplerChoice::ALL.map(|c| spread(c, &two));
        assert!(sobol < 1.5 * independent, "{sobol} against {independent}");
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
