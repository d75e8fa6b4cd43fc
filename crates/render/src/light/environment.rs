//! Light from all around, infinitely far away.

use std::f32::consts::{PI, TAU};
use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::studio;
use crate::distribution::Distribution2D;
use crate::texture::floor;
use crate::{EffectSet, tally, warp};

/// Light from all around: its radiance by direction, and how to choose directions in proportion to it.
///
/// A map covers the sphere by longitude and latitude: row 0 is at +Y, `u = atan2(x, -z) / 2 pi` (0 at -Z, 1/4 at +X),
/// `v = acos(y) / pi`. Between the middles of its texels it is interpolated, round the seam as well.
///
/// ```
/// use firsthit_render::Environment;
/// use glam::Vec3;
/// let sky = Environment::constant(Vec3::new(0.2, 0.4, 0.8));
/// let sample = sky.sample([0.3, 0.7]).unwrap();
/// assert_eq!(sample.radiance, sky.radiance(sample.direction));
/// assert_eq!(sample.pdf, sky.pdf(sample.direction));
/// ```
#[derive(Clone, Debug)]
pub struct Environment {
    source: Source,
    /// Added to a direction's `u` to look it up: turning the map counter-clockwise.
    turn: f32,
    scale: Vec3,
}

#[derive(Clone, Debug)]
enum Source {
    Constant,
    Map(Arc<Map>),
}

/// A direction chosen in proportion to the light that comes from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentSample {
    /// Unit vector towards the light, in the world.
    pub direction: Vec3,
    /// What comes from there, W/m²·sr.
    pub radiance: Vec3,
    /// Density with which the direction was chosen, 1/sr; > 0.
    pub pdf: f32,
}

/// A map that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The size is not that of the pixels.
    #[error("the environment map should have {width} x {height} pixels (at least one), but has {pixels}")]
    Size {
        /// Pixels across, as stated.
        width: u32,
        /// Pixels down, as stated.
        height: u32,
        /// Pixels that there are.
        pixels: usize,
    },
    /// A pixel is not light.
    #[error("pixel ({x}, {y}) of the environment map: radiance is negative or not finite")]
    Radiance {
        /// Its column, from the left.
        x: usize,
        /// Its row, from the top.
        y: usize,
    },
}

impl Environment {
    /// The same radiance from everywhere.
    #[must_use]
    pub fn constant(radiance: Vec3) -> Self {
        Self { source: Source::Constant, turn: 0.0, scale: radiance }
    }

    /// A map by longitude and latitude, linear radiance, turned counter-clockwise seen from +Y by `rotation` radians
    /// and multiplied by `scale`.
    ///
    /// # Errors
    /// When `pixels` is empty or not `width` x `height` pixels, or one of them is negative or not finite.
    pub fn latlong(
        width: u32,
        height: u32,
        pixels: Arc<[[f32; 3]]>,
        rotation: f32,
        scale: Vec3,
    ) -> Result<Self, EnvironmentError> {
        if pixels.is_empty() || u64::from(width) * u64::from(height) != pixels.len() as u64 {
            return Err(EnvironmentError::Size { width, height, pixels: pixels.len() });
        }
        if let Some(bad) = pixels.iter().position(|p| !p.iter().all(|c| c.is_finite() && *c >= 0.0)) {
            let width = width as usize;
            return Err(EnvironmentError::Radiance { x: bad % width, y: bad / width });
        }
        let map = Map::new(width as usize, height as usize, pixels);
        Ok(Self { source: Source::Map(Arc::new(map)), turn: turn(rotation), scale })
    }

    /// The built-in photo studio, turned counter-clockwise seen from +Y by `rotation` radians and multiplied by `scale`.
    #[must_use]
    pub fn studio(rotation: f32, scale: Vec3) -> Self {
        let (width, height, pixels) = studio::bake();
        let map = Map::new(width, height, pixels);
        Self { source: Source::Map(Arc::new(map)), turn: turn(rotation), scale }
    }

    /// Whether the same comes from everywhere.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        matches!(self.source, Source::Constant)
    }

    /// Whether no light comes from anywhere.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.scale.max_element() <= 0.0 || matches!(&self.source, Source::Map(map) if map.distribution.is_none())
    }

    /// The radiance from a unit direction (towards the light), W/m²·sr.
    #[inline]
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.source {
            Source::Constant => self.scale,
            Source::Map(map) => {
                tally::look_up(EffectSet::ENVIRONMENT);
                self.scale * map.bilinear(self.to_map(direction))
            }
        }
    }

    /// Chooses a direction, in proportion to luminance; `None` where there is no light.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: [f32; 2]) -> Option<EnvironmentSample> {
        if self.scale.max_element() <= 0.0 {
            return None;
        }
        tally::sample(EffectSet::ENVIRONMENT);
        match &self.source {
            Source::Constant => {
                Some(EnvironmentSample { direction: warp::sphere(u), radiance: self.scale, pdf: 1.0 / (4.0 * PI) })
            }
            Source::Map(map) => Some(self.sample_map(map, map.distribution.as_ref()?, u)),
        }
    }

    fn sample_map(&self, map: &Map, distribution: &Distribution2D, u: [f32; 2]) -> EnvironmentSample {
        let (uv, pdf) = map.sample(distribution, u);
        tally::look_up(EffectSet::ENVIRONMENT);
        let direction = from_map([uv[0] - self.turn, uv[1]]);
        EnvironmentSample { direction, radiance: self.scale * map.bilinear(uv), pdf }
    }

    /// Chooses a direction in proportion to by how much its luminance is above the mean: for those who find the rest
    /// by following surfaces, and share with this by weights. `None` where nothing stands out.
    ///
    /// Karlik et al., "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling" (2019).
    #[inline]
    pub(crate) fn sample_bright(&self, u: [f32; 2]) -> Option<EnvironmentSample> {
        match &self.source {
            Source::Constant => None,
            Source::Map(map) => {
                let bright = map.bright()?;
                tally::sample(EffectSet::ENVIRONMENT);
                Some(self.sample_map(map, bright, u))
            }
        }
    }

    /// [`Environment::radiance`] of a unit direction, and the density, 1/sr, with which [`Environment::sample_bright`]
    /// chooses it.
    #[inline]
    pub(crate) fn radiance_and_pdf_bright(&self, direction: Vec3) -> (Vec3, f32) {
        match &self.source {
            Source::Constant => (self.scale, 0.0),
            Source::Map(map) => {
                tally::look_up(EffectSet::ENVIRONMENT);
                let uv = self.to_map(direction);
                (self.scale * map.bilinear(uv), map.pdf(map.bright(), uv))
            }
        }
    }

    /// The density, 1/sr, with which [`Environment::sample`] chooses a unit direction.
    #[inline]
    #[must_use]
    pub fn pdf(&self, direction: Vec3) -> f32 {
        if self.scale.max_element() <= 0.0 {
            return 0.0;
        }
        match &self.source {
            Source::Constant => 1.0 / (4.0 * PI),
            Source::Map(map) => map.pdf(map.distribution.as_ref(), self.to_map(direction)),
        }
    }

    /// The mean radiance over all directions: pi times it is the irradiance if it came evenly from everywhere.
    #[must_use]
    pub fn mean_radiance(&self) -> Vec3 {
        match &self.source {
            Source::Constant => self.scale,
            Source::Map(map) => self.scale * map.mean,
        }
    }

    fn to_map(&self, d: Vec3) -> [f32; 2] {
        let u = d.x.atan2(-d.z) / TAU + self.turn;
        // By atan2, since acos loses half of its digits near the poles.
        [u, (d.x * d.x + d.z * d.z).sqrt().atan2(d.y) / PI]
    }
}

/// A rotation in turns, in [0, 1]; 0 for what is not finite.
fn turn(rotation: f32) -> f32 {
    if rotation.is_finite() { (rotation / TAU).rem_euclid(1.0) } else { 0.0 }
}

/// The unit direction of a point of the map.
pub(super) fn from_map([u, v]: [f32; 2]) -> Vec3 {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let (sin_theta, cos_theta) = (PI * v).sin_cos();
    Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

/// Rec. 709 luminance.
pub(crate) fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[derive(Debug)]
struct Map {
    width: usize,
    height: usize,
    pixels: Arc<[[f32; 3]]>,
    /// The y of the directions at the rows' edges, from the top.
    edges: Vec<f32>,
    /// Over the texels, by the light that comes through each; `None`: all black.
    distribution: Option<Distribution2D>,
    /// The same for what is brighter than the mean: see [`Environment::sample_bright`]. Made when first asked for.
    bright: OnceLock<Option<Distribution2D>>,
    mean: Vec3,
}

impl Map {
    fn new(width: usize, height: usize, pixels: Arc<[[f32; 3]]>) -> Self {
        let pixels = summable(pixels);
        let bright = OnceLock::new();
        let edge = |i: usize| (std::f64::consts::PI * i as f64 / height as f64).cos() as f32;
        let edges = (0..=height).map(edge).collect();
        let mut map = Self { width, height, pixels, edges, distribution: None, bright, mean: Vec3::ZERO };
        let mut sum = glam::DVec3::ZERO;
        map.distribution = map.distribution(|mean, solid_angle| {
            sum += (mean * solid_angle).as_dvec3();
            luminance(mean)
        });
        map.mean = (sum / (4.0 * std::f64::consts::PI)).as_vec3();
        map
    }

    /// Over the texels, by this function of a texel's mean and of its solid angle, times the solid angle.
    fn distribution(&self, mut weight: impl FnMut(Vec3, f32) -> f32) -> Option<Distribution2D> {
        let mut weights = Vec::with_capacity(self.width * self.height);
        for row in 0..self.height {
            let solid_angle = self.solid_angle(row);
            for column in 0..self.width {
                weights.push(weight(self.cell_mean(column, row), solid_angle) * solid_angle);
            }
        }
        Distribution2D::new(&weights, self.width)
    }

    /// What is brighter than the mean; of a map without contrast, nothing.
    fn bright(&self) -> Option<&Distribution2D> {
        let make = || {
            let mean = luminance(self.mean);
            self.distribution(|texel, _| (luminance(texel) - mean).max(0.0))
        };
        self.bright.get_or_init(make).as_ref()
    }

    fn texel(&self, column: usize, row: usize) -> Vec3 {
        Vec3::from(self.pixels[row * self.width + column])
    }

    /// The solid angle of each cell of a row.
    fn solid_angle(&self, row: usize) -> f32 {
        let [top, bottom] = self.row_cosines(row);
        TAU / self.width as f32 * (top - bottom)
    }

    /// The y of the directions at a row's upper and lower edge.
    fn row_cosines(&self, row: usize) -> [f32; 2] {
        [self.edges[row], self.edges[row + 1]]
    }

    /// The mean of the interpolated map over a texel: along each axis the texel weighs 3/4 and both neighbours 1/8.
    /// It is positive wherever the interpolated radiance is, so that no light is out of reach of sampling.
    fn cell_mean(&self, column: usize, row: usize) -> Vec3 {
        let columns = [(column + self.width - 1) % self.width, column, (column + 1) % self.width];
        let rows = [row.saturating_sub(1), row, (row + 1).min(self.height - 1)];
        const WEIGHTS: [f32; 3] = [0.125, 0.75, 0.125];
        let mut sum = Vec3::ZERO;
        for (r, wr) in rows.into_iter().zip(WEIGHTS) {
            for (c, wc) in columns.into_iter().zip(WEIGHTS) {
                sum += wr * wc * self.texel(c, r);
            }
        }
        sum
    }

    fn bilinear(&self, [u, v]: [f32; 2]) -> Vec3 {
        let (x, y) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (x0, y0) = (floor(x), floor(y));
        let (fx, fy) = (x - x0, y - y0);
        let (width, first) = (self.width as i64, x0 as i64);
        // Most often it is in the map; a turned map, or a seam, may be looked up beside it.
        let column = |i: i64| (if (0..width).contains(&i) { i } else { i.rem_euclid(width) }) as usize;
        let columns = [column(first), column(first + 1)];
        let rows = [0, 1].map(|i| (y0 as i64 + i).clamp(0, self.height as i64 - 1) as usize);
        let along = |row| self.texel(columns[0], row).lerp(self.texel(columns[1], row), fx);
        along(rows[0]).lerp(along(rows[1]), fy)
    }

    /// A point of the map and its density by solid angle: uniform in the solid angle of the chosen texel, so that the
    /// density is constant in each texel and has no pole.
    fn sample(&self, distribution: &Distribution2D, u: [f32; 2]) -> ([f32; 2], f32) {
        let ((column, row), [x, y]) = distribution.sample(u);
        let [top, bottom] = self.row_cosines(row);
        let v = (top + (bottom - top) * y).clamp(-1.0, 1.0).acos() / PI;
        let pdf = distribution.probability((column, row)) / self.solid_angle(row);
        ([(column as f32 + x) / self.width as f32, v], pdf)
    }

    fn pdf(&self, distribution: Option<&Distribution2D>, [u, v]: [f32; 2]) -> f32 {
        let Some(distribution) = distribution else { return 0.0 };
        let column = ((u - floor(u)) * self.width as f32) as usize;
        let row = (v * self.height as f32) as usize;
        let cell = (column.min(self.width - 1), row.min(self.height - 1));
        distribution.probability(cell) / self.solid_angle(cell.1)
    }
}

/// Radiance that can be summed: nothing is brighter than the sun seen from Earth, about 1e9 in relative units.
fn summable(pixels: Arc<[[f32; 3]]>) -> Arc<[[f32; 3]]> {
    const BRIGHTEST: f32 = 1e10;
    if pixels.iter().flatten().all(|x| *x <= BRIGHTEST) {
        return pixels;
    }
    pixels.iter().map(|p| p.map(|x| x.min(BRIGHTEST))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dim map with one bright texel, a dark half, a black one, and structure at the poles and the seam.
    fn lamp() -> Environment {
        let (width, height) = (16, 8);
        let pixels = (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let base = if x < 8 { 0.0 } else { 0.1 + 0.05 * y as f32 };
                let lamp = if (x, y) == (3, 2) { 50.0 } else { 0.0 };
                let pole = if y == 0 && x % 3 == 0 { 2.0 } else { 0.0 };
                [base + lamp, base + 0.5 * lamp + pole, base]
            })
            .collect();
        Environment::latlong(width, height, pixels, 0.7, Vec3::new(1.0, 0.5, 2.0)).unwrap()
    }

    /// The integral over the sphere by a fine grid, midpoint rule in u and in cos(theta).
    fn integral(f: impl Fn(Vec3) -> f64) -> f64 {
        let (n, m) = (720_u32, 720_u32);
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..m {
                let y = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(m);
                let (s, c) = (std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(n)).sin_cos();
                let r = (1.0 - y * y).sqrt();
                sum += f(Vec3::new((r * s) as f32, y as f32, (r * c) as f32));
            }
        }
        sum * 4.0 * std::f64::consts::PI / f64::from(n * m)
    }

    fn environments() -> [(&'static str, Environment); 3] {
        [
            ("constant", Environment::constant(Vec3::new(0.5, 1.0, 0.25))),
            ("map", lamp()),
            ("studio", Environment::studio(1.0, Vec3::ONE)),
        ]
    }

    #[test]
    fn densities_integrate_to_one() {
        for (name, e) in environments() {
            let total = integral(|d| f64::from(e.pdf(d)));
            assert!((total - 1.0).abs() < 5e-3, "{name}: {total}");
        }
    }

    /// Wherever there is light, there is density: every light can be found by sampling.
    #[test]
    fn nothing_that_shines_is_out_of_reach() {
        for (name, e) in environments() {
            let dark = integral(|d| f64::from(u8::from(luminance(e.radiance(d)) > 0.0 && e.pdf(d) <= 0.0)));
            assert_eq!(dark, 0.0, "{name}");
        }
    }

    #[test]
    fn samples_report_the_radiance_and_density_of_their_direction() {
        for (name, e) in environments() {
            // From 1: the first point is right at the pole, which has no longitude.
            for i in 1..4096_u32 {
                let u = [(i as f32 * 0.618_034).fract(), (i as f32 * 0.754_878).fract()];
                let s = e.sample(u).unwrap();
                assert!((s.direction.length() - 1.0).abs() < 1e-5);
                let difference = (s.radiance - e.radiance(s.direction)).length();
                assert!(difference <= 1e-3 * s.radiance.length() + 1e-3, "{name}: {s:?} {}", e.radiance(s.direction));
                // Right at the border of two texels, rounding may take the neighbour's.
                let near = [-1.0, 0.0, 1.0].iter().any(|k| {
                    let d = (s.direction + Vec3::splat(*k * 1e-5)).normalize();
                    (e.pdf(d) - s.pdf).abs() <= 1e-4 * s.pdf
                });
                assert!(near, "{name}: {} is not {}", s.pdf, e.pdf(s.direction));
            }
        }
    }

    /// The estimate radiance / pdf of the total light agrees with the sum over a grid and with `mean_radiance`.
    #[test]
    fn sampling_finds_all_the_light() {
        for (name, e) in environments() {
            let n = 1 << 16;
            let mut sum = Vec3::ZERO;
            for i in 0..n {
                let u = [(i as f32 + 0.5) / n as f32, (i as u32).reverse_bits() as f32 / 4_294_967_296.0];
                let s = e.sample(u).unwrap();
                sum += s.radiance / s.pdf / n as f32;
            }
            for c in 0..3 {
                let grid = integral(|d| f64::from(e.radiance(d)[c]));
                let sampled = f64::from(sum[c]);
                assert!((sampled - grid).abs() < 0.01 * grid, "{name} channel {c}: {sampled} is not {grid}");
                let mean = f64::from(e.mean_radiance()[c]) * 4.0 * std::f64::consts::PI;
                assert!((mean - grid).abs() < 0.01 * grid, "{name} channel {c}: mean {mean} is not {grid}");
            }
        }
    }

    /// Counts of samples over cells of the sphere against what the density says: chi-squared.
    #[test]
    fn samples_are_distributed_as_the_density_says() {
        let (columns, rows) = (20_usize, 10_usize);
        for (name, e) in environments() {
            let cell = |d: Vec3| {
                let column = (d.x.atan2(-d.z) / TAU).rem_euclid(1.0) * columns as f32;
                let row = (1.0 - d.y) * 0.5 * rows as f32;
                (column as usize).min(columns - 1) + columns * (row as usize).min(rows - 1)
            };
            let mut expected = vec![0.0; columns * rows];
            let fine = 1440_u32;
            for i in 0..fine * fine {
                let y = 1.0 - 2.0 * (f64::from(i / fine) + 0.5) / f64::from(fine);
                let (s, c) = (std::f64::consts::TAU * (f64::from(i % fine) + 0.5) / f64::from(fine)).sin_cos();
                let r = (1.0 - y * y).sqrt();
                let d = Vec3::new((r * s) as f32, y as f32, (r * c) as f32);
                expected[cell(d)] += f64::from(e.pdf(d)) * 4.0 * std::f64::consts::PI / f64::from(fine * fine);
            }
            let n = 40_000_u32;
            let mut counts = vec![0.0; columns * rows];
            let mut state = 12345_u64;
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f32 / (1 << 24) as f32
            };
            for _ in 0..n {
                counts[cell(e.sample([random(), random()]).unwrap().direction)] += 1.0;
            }
            let (mut chi, mut cells, mut pooled) = (0.0, 0.0, (0.0, 0.0));
            for (count, share) in counts.iter().zip(&expected) {
                let share = share * f64::from(n);
                if share < 5.0 {
                    pooled = (pooled.0 + count, pooled.1 + share);
                } else {
                    chi += (count - share).powi(2) / share;
                    cells += 1.0;
                }
            }
            if pooled.1 > 5.0 {
                chi += (pooled.0 - pooled.1).powi(2) / pooled.1;
                cells += 1.0;
            }
            // Chi-squared has this mean and standard deviation; 5 sigma.
            let freedom: f64 = cells - 1.0;
            assert!(chi < freedom + 5.0 * (2.0 * freedom).sqrt(), "{name}: {chi} for {freedom} degrees of freedom");
        }
    }

    /// A map whose columns and rows are numbered, so that it can be read where something is.
    fn numbered(rotation: f32) -> Environment {
        let (width, height) = (360, 180);
        let pixels = (0..width * height).map(|i| [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5, 0.0]).collect();
        Environment::latlong(width, height, pixels, rotation, Vec3::ONE).unwrap()
    }

    #[test]
    fn directions_are_looked_up_by_the_stated_convention() {
        let e = numbered(0.0);
        let close = |d: Vec3, u: f32, v: f32| {
            let r = e.radiance(d.normalize());
            assert!((r.x - u).abs() < 0.01 && (r.y - v).abs() < 0.01, "{d}: {r}");
        };
        close(Vec3::X, 90.0, 90.0);
        close(Vec3::Z, 180.0, 90.0);
        close(Vec3::NEG_X, 270.0, 90.0);
        close(Vec3::new(1.0, 1.0, -1.0).normalize(), 45.0, 54.7356);
        // Round the seam it is the mean of the first and the last column.
        assert!((e.radiance(Vec3::NEG_Z).x - 180.0).abs() < 0.01);
        assert_eq!(e.radiance(Vec3::Y).y, 0.5);
        assert_eq!(e.radiance(Vec3::NEG_Y).y, 179.5);
    }

    #[test]
    fn rotation_is_counter_clockwise_seen_from_above() {
        let angle = 0.8_f32;
        let (still, turned) = (numbered(0.0), numbered(angle));
        for d in [Vec3::new(0.3, 0.2, 0.9), Vec3::new(-0.8, -0.3, 0.1), Vec3::new(0.5, 0.5, -0.4)] {
            let d = d.normalize();
            let r = glam::Quat::from_rotation_y(angle) * d;
            assert!((still.radiance(d) - turned.radiance(r)).length() < 0.05);
        }
        let s = turned.sample([0.3, 0.6]).unwrap();
        assert!((s.radiance - turned.radiance(s.direction)).length() < 0.05);
    }

    #[test]
    fn black_has_no_samples() {
        assert_eq!(Environment::constant(Vec3::ZERO).sample([0.5, 0.5]), None);
        let e = Environment::latlong(4, 2, Arc::new([[0.0; 3]; 8]), f32::NAN, Vec3::ONE).unwrap();
        assert!(e.is_black());
        assert_eq!(e.sample([0.5, 0.5]), None);
        assert_eq!((e.radiance(Vec3::X), e.pdf(Vec3::X)), (Vec3::ZERO, 0.0));
    }

    #[test]
    fn what_is_no_map_of_light_is_an_error() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0] {
            let mut pixels = [[1.0; 3]; 8];
            pixels[6][1] = bad;
            let error = Environment::latlong(4, 2, Arc::new(pixels), 0.0, Vec3::ONE).unwrap_err();
            assert_eq!(error, EnvironmentError::Radiance { x: 2, y: 1 }, "{bad}");
        }
        assert!(Environment::latlong(4, 2, Arc::new([[f32::MAX; 3]; 8]), 0.0, Vec3::ONE).is_ok());
        assert!(Environment::latlong(4, 2, Arc::new([[1.0; 3]; 7]), 0.0, Vec3::ONE).is_err());
        assert!(Environment::latlong(0, 0, Arc::new([]), 0.0, Vec3::ONE).is_err());
    }

    /// The studio is what it says: neutral, never black, and a white wall facing any way is neither dark nor burnt.
    #[test]
    fn the_studio_exposes_a_white_ball_well() {
        let e = Environment::studio(0.0, Vec3::ONE);
        let irradiance = |n: Vec3| integral(|d| f64::from(e.radiance(d).x * d.dot(n).max(0.0))) / std::f64::consts::PI;
        for d in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            let r = e.radiance(d);
            assert!(r.x == r.y && r.y == r.z && r.x > 0.05, "{d}: {r}");
        }
        let key = irradiance(Vec3::new(-0.55, 0.67, 0.5).normalize());
        let front = irradiance(Vec3::Z);
        let below = irradiance(Vec3::NEG_Y);
        assert!((0.9..1.6).contains(&key), "towards the key light: {key}");
        assert!((0.6..1.2).contains(&front), "facing the viewer: {front}");
        assert!((0.15..0.6).contains(&below), "facing the floor: {below}");
    }
}
