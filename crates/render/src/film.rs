//! The film: sums of samples, pixel by pixel.

use std::collections::TryReserveError;

use rayon::prelude::*;

use crate::{Aov, Crop};

/// Samples whose f32 sum is kept before it goes into the f64 total.
const BLOCK: u32 = 16;

/// Bytes of an [`Accumulator`] in a file.
pub(crate) const RECORD: usize = 76;

/// The samples of one pixel in one picture, summed in a way that does not depend on pauses.
///
/// Each aligned block of 16 samples is summed in f32, the blocks in f64, both in order: rendering in several passes,
/// wherever they are cut, gives the same bits as rendering at once. The f64 sum of f32 numbers is exact as long as it is
/// below 2^29 times the smallest of them, so blocks rendered elsewhere can be added in any order as well; beyond, the
/// last bit of an f64 may differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accumulator {
    total: [f64; 4],
    /// Sums of the squares (rounded to f32) of whole blocks' sums.
    squares: [f64; 3],
    block: [f32; 4],
    count: u32,
}

impl Accumulator {
    /// Adds a sample: three values, already multiplied by the fourth, which is coverage.
    #[inline]
    pub fn add(&mut self, value: [f32; 4]) {
        for (sum, x) in self.block.iter_mut().zip(value) {
            *sum += x;
        }
        self.count += 1;
        if self.count.is_multiple_of(BLOCK) {
            self.total = self.sum();
            for (square, x) in self.squares.iter_mut().zip(self.block) {
                *square += f64::from((x * x).min(f32::MAX));
            }
            self.block = [0.0; 4];
        }
    }

    /// [`Accumulator::add`] so many times.
    #[inline]
    pub(crate) fn add_times(&mut self, value: [f32; 4], times: u32) {
        for _ in 0..times {
            self.add(value);
        }
    }

    /// An estimate of the variance of the mean of each colour: how far it is off, squared. It comes from how much
    /// whole blocks of 16 samples differ, so it knows what samples gain by their order within a block, but not what
    /// blocks gain by theirs. `None` before there are two blocks.
    #[must_use]
    pub fn variance(&self) -> Option<[f32; 3]> {
        let blocks = self.count / BLOCK;
        if blocks < 2 {
            return None;
        }
        let n = f64::from(blocks);
        let block = f64::from(BLOCK);
        Some(std::array::from_fn(|c| {
            let mean = self.total[c] / n;
            let spread = (self.squares[c] / n - mean * mean).max(0.0);
            // Of a block's mean, by the number of blocks but one; of the mean of all blocks.
            (spread / (block * block) / (n - 1.0)) as f32
        }))
    }

    /// Adds all samples of another, which follow these: both hold whole blocks.
    pub(crate) fn join(&mut self, next: &Self) {
        self.total = std::array::from_fn(|i| self.total[i] + next.total[i]);
        self.squares = std::array::from_fn(|i| self.squares[i] + next.squares[i]);
        self.block = next.block;
        self.count += next.count;
    }

    /// For files.
    pub(crate) fn to_bytes(self) -> [u8; RECORD] {
        let doubles = self.total.iter().chain(&self.squares).flat_map(|x| x.to_le_bytes());
        let floats = self.block.iter().flat_map(|x| x.to_le_bytes());
        let mut bytes = [0; RECORD];
        for (to, from) in bytes.iter_mut().zip(doubles.chain(floats).chain(self.count.to_le_bytes())) {
            *to = from;
        }
        bytes
    }

    /// From files.
    pub(crate) fn from_bytes(bytes: &[u8; RECORD]) -> Self {
        let double = |i: usize| f64::from_le_bytes(std::array::from_fn(|k| bytes[8 * i + k]));
        let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[56 + 4 * i + k]));
        Self {
            total: std::array::from_fn(double),
            squares: std::array::from_fn(|i| double(4 + i)),
            block: std::array::from_fn(|i| f32::from_bits(word(i))),
            count: word(4),
        }
    }

    /// Whether samples can have added up to this. Light is never negative; other values may be.
    pub(crate) fn is_sound(&self, light: bool) -> bool {
        let most = f64::from(self.count) * f64::from(f32::MAX);
        let least = if light { 0.0 } else { -most };
        let sums = self.total.into_iter().chain(self.block.map(f64::from));
        // No comparison with NaN holds.
        sums.into_iter().all(|x| x >= least && x <= most)
            && self.squares.iter().all(|x| *x >= 0.0 && *x <= most)
            && self.total[3] >= 0.0
            && self.block[3] >= 0.0
            && self.sum()[3] <= f64::from(self.count)
            && (!self.count.is_multiple_of(BLOCK) || self.block == [0.0; 4])
    }

    /// How many samples there are.
    #[inline]
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// The mean of the samples; 0 where there are none.
    #[must_use]
    pub fn mean(&self) -> [f32; 4] {
        let n = f64::from(self.count.max(1));
        self.sum().map(|x| (x / n) as f32)
    }

    fn sum(&self) -> [f64; 4] {
        std::array::from_fn(|i| self.total[i] + f64::from(self.block[i]))
    }
}

/// What has been rendered: the colour picture and those beside it, in linear f32.
///
/// ```
/// use firsthit_render::Film;
/// let mut film = Film::new(2, 1, None, &[])?;
/// let mut band = film.bands_mut(8).next().unwrap();
/// band.pixel(1, 0)[0].add([0.5, 0.25, 0.0, 1.0]);
/// assert_eq!(film.color().pixels, [[0.0; 4], [0.5, 0.25, 0.0, 1.0]]);
/// # Ok::<(), std::collections::TryReserveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    size: (u32, u32),
    window: Crop,
    aovs: Vec<Aov>,
    /// Pictures that samples add to.
    layers: usize,
    /// Row by row, pixel by pixel: the colour, then the AOVs in their order.
    pixels: Vec<Accumulator>,
}

/// How a film is cut into bands.
#[derive(Clone, Copy)]
struct Cut {
    window: Crop,
    layers: usize,
    rows: u32,
}

impl Cut {
    fn new(film: &Film, rows: u32) -> Self {
        Self { window: film.window, layers: film.layers, rows: rows.max(1) }
    }

    /// Pixels of a band, in all layers; at least 1.
    fn size(&self) -> usize {
        (self.window.width as usize * self.layers * self.rows as usize).max(1)
    }

    fn band<'a>(&self, i: usize, pixels: &'a mut [Accumulator]) -> Band<'a> {
        Band { window: self.window, first_row: self.window.y + i as u32 * self.rows, layers: self.layers, pixels }
    }
}

/// Some rows of a film, for one thread.
#[derive(Debug)]
pub struct Band<'a> {
    window: Crop,
    first_row: u32,
    layers: usize,
    pixels: &'a mut [Accumulator],
}

/// A finished picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Rows from the top. Colours are linear, multiplied by alpha.
    pub pixels: Vec<[f32; 4]>,
}

impl Film {
    /// An empty film for a picture of `width` x `height` pixels. A crop window is cut to the picture.
    ///
    /// # Errors
    /// When there is not enough memory, see [`Film::bytes`].
    pub fn new(width: u32, height: u32, crop: Option<Crop>, aovs: &[Aov]) -> Result<Self, TryReserveError> {
        let window = held(width, height, crop);
        let aovs = each_once(aovs);
        let layers = 1 + each_once(&aovs).iter().filter(|a| a.is_sampled()).count();
        let count = (window.width as usize).saturating_mul(window.height as usize).saturating_mul(layers);
        let mut pixels = Vec::new();
        pixels.try_reserve_exact(count)?;
        pixels.resize(count, Accumulator::default());
        Ok(Self { size: (width, height), window, aovs, layers, pixels })
    }

    /// The memory that [`Film::new`] would take with the same arguments, in bytes.
    #[must_use]
    pub fn bytes(width: u32, height: u32, crop: Option<Crop>, aovs: &[Aov]) -> u64 {
        let window = held(width, height, crop);
        let layer =
            (u64::from(window.width) * u64::from(window.height)).saturating_mul(size_of::<Accumulator>() as u64);
        layer.saturating_mul(1 + each_once(aovs).iter().filter(|a| a.is_sampled()).count() as u64)
    }

    /// The pictures beside the colour that samples add to, in the order of [`Band::pixel`].
    pub(crate) fn sampled(&self) -> impl Iterator<Item = Aov> {
        self.aovs.iter().copied().filter(|a| a.is_sampled())
    }

    /// As [`Film::new`], with pixels from elsewhere: all layers of the first, then those of the next. Memory is taken
    /// as they come, whatever the size that is claimed.
    pub(crate) fn from_records<E: From<TryReserveError>>(
        (width, height): (u32, u32),
        window: Crop,
        aovs: &[Aov],
        mut next: impl FnMut(usize) -> Result<Accumulator, E>,
    ) -> Result<Self, E> {
        const AT_FIRST: usize = 1 << 12;
        let mut film = Self::new(width, height, Some(Crop { width: 0, height: 0, ..window }), aovs)?;
        film.window = window;
        let count = (window.width as usize).saturating_mul(window.height as usize).saturating_mul(film.layers);
        for i in 0..count {
            if i == film.pixels.capacity() {
                film.pixels.try_reserve_exact(i.max(AT_FIRST).min(count - i))?;
            }
            film.pixels.push(next(i % film.layers)?);
        }
        Ok(film)
    }

    /// The mean number of samples of a pixel.
    #[must_use]
    pub fn samples_per_pixel(&self) -> f64 {
        let colour = self.pixels.iter().step_by(self.layers);
        let sum: u64 = colour.clone().map(|p| u64::from(p.count())).sum();
        sum as f64 / colour.len().max(1) as f64
    }

    /// All pixels of all layers.
    pub(crate) fn records(&self) -> impl Iterator<Item = &Accumulator> {
        self.pixels.iter()
    }

    pub(crate) fn records_mut(&mut self) -> impl Iterator<Item = &mut Accumulator> {
        self.pixels.iter_mut()
    }

    /// The colour of a pixel by its place in the whole picture.
    pub(crate) fn of_color(&self, x: u32, y: u32) -> &Accumulator {
        let i = (y - self.window.y) as usize * self.window.width as usize + (x - self.window.x) as usize;
        &self.pixels[i * self.layers]
    }

    /// Width and height of the whole picture, of which [`Film::window`] is held.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// The part of the picture that is held.
    #[must_use]
    pub fn window(&self) -> Crop {
        self.window
    }

    /// The pictures beside the colour, each once.
    #[must_use]
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }

    /// The film cut into bands of so many rows, each of which may be filled by another thread. Every pixel belongs to
    /// one band, so nothing depends on the order in which they are filled.
    pub fn par_bands_mut(&mut self, rows: u32) -> impl IndexedParallelIterator<Item = Band<'_>> {
        let cut = Cut::new(self, rows);
        self.pixels.par_chunks_mut(cut.size()).enumerate().map(move |(i, pixels)| cut.band(i, pixels))
    }

    /// As [`Film::par_bands_mut`], one after another.
    pub fn bands_mut(&mut self, rows: u32) -> impl Iterator<Item = Band<'_>> {
        let cut = Cut::new(self, rows);
        self.pixels.chunks_mut(cut.size()).enumerate().map(move |(i, pixels)| cut.band(i, pixels))
    }

    /// The colour, multiplied by alpha.
    #[must_use]
    pub fn color(&self) -> Picture {
        self.picture(0, Accumulator::mean)
    }

    /// One of the other pictures: the mean over the samples that hit something, with their share as alpha (not
    /// multiplied). Where there are none, 0, and for depth infinity.
    #[must_use]
    pub fn aov(&self, aov: Aov) -> Option<Picture> {
        if !self.aovs.contains(&aov) {
            return None;
        }
        match aov {
            Aov::Samples => return Some(self.picture(0, |pixel| spread_out([pixel.count() as f32; 3]))),
            Aov::Variance => return Some(self.picture(0, |p| spread_out(p.variance().unwrap_or([f32::INFINITY; 3])))),
            _ => {}
        }
        let layer = 1 + self.sampled().position(|a| a == aov)?;
        let nothing = if aov == Aov::Depth { f32::INFINITY } else { 0.0 };
        Some(self.picture(layer, |pixel| {
            let [x, y, z, covered] = pixel.mean();
            if covered > 0.0 {
                [x / covered, y / covered, z / covered, covered]
            } else {
                [nothing, nothing, nothing, 0.0]
            }
        }))
    }

    fn picture(&self, layer: usize, value: impl Fn(&Accumulator) -> [f32; 4]) -> Picture {
        let pixels = self.pixels.iter().skip(layer).step_by(self.layers).map(value).collect();
        Picture { width: self.window.width, height: self.window.height, pixels }
    }
}

impl Band<'_> {
    /// The rows it holds, counted in the whole picture.
    #[must_use]
    pub fn rows(&self) -> std::ops::Range<u32> {
        let row = (self.window.width as usize * self.layers).max(1);
        self.first_row..self.first_row + (self.pixels.len() / row) as u32
    }

    /// The columns it holds, counted in the whole picture.
    #[must_use]
    pub fn columns(&self) -> std::ops::Range<u32> {
        self.window.x..self.window.x + self.window.width
    }

    /// A pixel by its place in the whole picture: the colour, then the AOVs in their order.
    ///
    /// # Panics
    /// When it is not in this band.
    #[inline]
    #[must_use]
    pub fn pixel(&mut self, x: u32, y: u32) -> &mut [Accumulator] {
        assert!(self.columns().contains(&x) && self.rows().contains(&y), "pixel ({x}, {y}) is in another band");
        let i = (y - self.first_row) as usize * self.window.width as usize + (x - self.window.x) as usize;
        &mut self.pixels[i * self.layers..][..self.layers]
    }
}

/// Values of a whole pixel.
fn spread_out([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 1.0]
}

/// A crop window cut to the picture; without one, the whole picture.
fn held(width: u32, height: u32, crop: Option<Crop>) -> Crop {
    let crop = crop.unwrap_or(Crop { x: 0, y: 0, width, height });
    let (x, y) = (crop.x.min(width), crop.y.min(height));
    Crop { x, y, width: crop.width.min(width - x), height: crop.height.min(height - y) }
}

fn each_once(aovs: &[Aov]) -> Vec<Aov> {
    let mut unique = Vec::new();
    for aov in aovs {
        if !unique.contains(aov) {
            unique.push(*aov);
        }
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(i: u32) -> [f32; 4] {
        let x = (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        [x, 1e-3 * x, 1e3 * x, 1.0]
    }

    /// One run of 100 samples, and the same in passes cut anywhere: the same bits.
    #[test]
    fn passes_give_the_bits_of_one_run() {
        let mut whole = Accumulator::default();
        (0..100).for_each(|i| whole.add(sample(i)));
        for cuts in [vec![16, 32], vec![1, 2, 3], vec![50], vec![15, 17, 99]] {
            let mut state = Accumulator::default();
            let mut done = 0;
            for end in cuts.into_iter().chain([100]) {
                let mut resumed = state;
                (done..end).for_each(|i| resumed.add(sample(i)));
                (state, done) = (resumed, end);
            }
            assert_eq!(state, whole);
        }
        let exact: f64 = (0..100).map(|i| f64::from(sample(i)[0])).sum::<f64>() / 100.0;
        assert!((f64::from(whole.mean()[0]) - exact).abs() < 1e-6);
        assert_eq!((whole.count(), Accumulator::default().mean()), (100, [0.0; 4]));
    }

    /// Shares that are joined have the bits of one run, variance and all, also where squares need more bits than an f32.
    #[test]
    fn shares_give_the_bits_of_one_run() {
        let run = |samples: std::ops::Range<u32>| {
            let mut a = Accumulator::default();
            samples.for_each(|i| a.add(sample(i)));
            a
        };
        for cut in (16..1024).step_by(48) {
            let mut joined = run(0..cut);
            joined.join(&run(cut..1024));
            assert_eq!(joined, run(0..1024), "cut at {cut}");
        }
    }

    /// A million samples of the same value: the mean is that value, where an f32 sum would have stalled.
    #[test]
    fn many_samples_do_not_drift() {
        let mut a = Accumulator::default();
        (0..1 << 20).for_each(|_| a.add([0.1, 1e-8, 1e8, 1.0]));
        for (m, v) in a.mean().into_iter().zip([0.1, 1e-8, 1e8, 1.0]) {
            assert!((m / v - 1.0_f32).abs() < 1e-6);
        }
    }

    #[test]
    fn bands_cover_every_pixel_of_the_window_once() {
        for (crop, rows) in [(None, 4), (Some(Crop { x: 3, y: 5, width: 6, height: 100 }), 3), (None, 100)] {
            let mut film = Film::new(10, 12, crop, &[Aov::Normal]).unwrap();
            film.par_bands_mut(rows).for_each(|mut band| {
                for y in band.rows() {
                    for x in band.columns() {
                        let pixel = band.pixel(x, y);
                        assert_eq!(pixel.len(), 2);
                        pixel[0].add([x as f32, y as f32, 0.0, 1.0]);
                    }
                }
            });
            let window = film.window();
            assert!(film.pixels.iter().step_by(2).all(|a| a.count() == 1));
            let picture = film.color();
            assert_eq!((picture.width, picture.height), (window.width, window.height));
            assert_eq!(picture.pixels[0], [window.x as f32, window.y as f32, 0.0, 1.0]);
            let last = [(window.x + window.width - 1) as f32, (window.y + window.height - 1) as f32, 0.0, 1.0];
            assert_eq!(picture.pixels.last(), Some(&last));
        }
    }

    #[test]
    fn other_pictures_are_means_over_what_was_hit() {
        let mut film = Film::new(2, 1, None, &[Aov::Depth, Aov::Normal, Aov::Depth]).unwrap();
        assert_eq!(film.aovs(), [Aov::Depth, Aov::Normal]);
        let mut band = film.bands_mut(1).next().unwrap();
        band.pixel(0, 0)[1].add([3.0, 3.0, 3.0, 1.0]);
        band.pixel(0, 0)[1].add([0.0, 0.0, 0.0, 0.0]);
        let depth = film.aov(Aov::Depth).unwrap();
        assert_eq!(depth.pixels[0], [3.0, 3.0, 3.0, 0.5]);
        assert_eq!(depth.pixels[1], [f32::INFINITY, f32::INFINITY, f32::INFINITY, 0.0]);
        assert_eq!(film.aov(Aov::Normal).unwrap().pixels[0], [0.0; 4]);
        assert!(film.aov(Aov::Uv).is_none());
    }

    /// The mean of many estimates of the variance of a mean is that variance.
    #[test]
    fn the_variance_is_that_of_the_mean() {
        let (blocks, pixels) = (4, 4000_u32);
        let (mut estimate, mut square) = (0.0, 0.0);
        for p in 0..pixels {
            let mut a = Accumulator::default();
            for i in 0..blocks * 16 {
                assert_eq!(a.variance().is_some(), a.count() >= 32);
                let mut x = (p * 64 + i).wrapping_mul(0x9e37_79b9);
                x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
                x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
                let x = (x ^ (x >> 16)) as f32 / 4_294_967_296.0;
                a.add([x, 2.0 * x, 1.0, 1.0]);
            }
            let variance = a.variance().unwrap();
            assert!((variance[1] - 4.0 * variance[0]).abs() < 1e-5 && variance[2] < 1e-9);
            estimate += f64::from(variance[0]) / f64::from(pixels);
            square += (f64::from(a.mean()[0]) - 0.5).powi(2) / f64::from(pixels);
        }
        let exact = 1.0 / 12.0 / 64.0;
        assert!((estimate / exact - 1.0).abs() < 0.05, "{estimate} instead of {exact}");
        assert!((square / exact - 1.0).abs() < 0.1, "{square} instead of {exact}");
    }

    #[test]
    fn what_is_known_of_the_samples_takes_no_layer_of_its_own() {
        let mut film = Film::new(2, 1, None, &[Aov::Samples, Aov::Normal, Aov::Variance]).unwrap();
        assert_eq!(Film::bytes(2, 1, None, film.aovs()), Film::bytes(2, 1, None, &[Aov::Normal]));
        let mut band = film.bands_mut(1).next().unwrap();
        assert_eq!(band.pixel(0, 0).len(), 2);
        (0..32).for_each(|_| band.pixel(1, 0)[0].add([1.0, 1.0, 1.0, 1.0]));
        let samples = film.aov(Aov::Samples).unwrap();
        assert_eq!([samples.pixels[0][0], samples.pixels[1][0]], [0.0, 32.0]);
        let variance = film.aov(Aov::Variance).unwrap();
        assert_eq!([variance.pixels[0][0], variance.pixels[1][0]], [f32::INFINITY, 0.0]);
    }

    #[test]
    fn more_than_memory_holds_is_an_error() {
        let all = Film::new(u32::MAX, u32::MAX, None, &Aov::ALL);
        assert!(all.is_err());
        assert_eq!(Film::bytes(u32::MAX, u32::MAX, None, &Aov::ALL), u64::MAX, "nothing wraps around");
    }

    #[test]
    fn only_what_is_held_takes_memory() {
        let film = Film::new(100, 100, Some(Crop { x: 95, y: 0, width: 10, height: 3 }), &[Aov::Uv, Aov::Uv]).unwrap();
        let bytes = Film::bytes(100, 100, Some(Crop { x: 95, y: 0, width: 10, height: 3 }), &[Aov::Uv, Aov::Uv]);
        assert_eq!(bytes, size_of_val(film.pixels.as_slice()) as u64);
        assert_eq!(bytes, 5 * 3 * 2 * size_of::<Accumulator>() as u64);
    }

    #[test]
    fn a_window_outside_the_picture_is_empty() {
        let film = Film::new(4, 4, Some(Crop { x: 9, y: 0, width: 5, height: 5 }), &[]).unwrap();
        assert_eq!((film.window().width, film.color().pixels.len()), (0, 0));
        assert_eq!(Film::new(0, 0, None, &[]).unwrap().bands_mut(8).count(), 0);
    }
}
