//! Light from all around, infinitely far away.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::Vec3;

use super::studio;
use crate::distribution::Distribution2D;
use crate::warp;

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
#[error("the environment map should have {width} x {height} pixels (at least one), but has {pixels}")]
pub struct EnvironmentError {
    /// Pixels across, as stated.
    pub width: u32,
    /// Pixels down, as stated.
    pub height: u32,
    /// Pixels that there are.
    pub pixels: usize,
}

impl Environment {
    /// The same radiance from everywhere.
    #[must_use]
    pub fn constant(radiance: Vec3) -> Self {
        Self { source: Source::Constant, turn: 0.0, scale: radiance }
    }

    /// A map by longitude and latitude, linear radiance, turned counter-clockwise seen from +Y by `rotation` radians
    /// and multiplied by `scale`. NaN and negative pixels count as black.
    ///
    /// # Errors
    /// When `pixels` is empty or not `width` x `height` pixels.
    pub fn latlong(
        width: u32,
        height: u32,
        pixels: Arc<[[f32; 3]]>,
        rotation: f32,
        scale: Vec3,
    ) -> Result<Self, EnvironmentError> {
        if pixels.is_empty() || u64::from(width) * u64::from(height) != pixels.len() as u64 {
            return Err(EnvironmentError { width, height, pixels: pixels.len() });
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
            Source::Map(map) => self.scale * map.bilinear(self.to_map(direction)),
        }
    }

    /// Chooses a direction, in proportion to luminance; `None` where there is no light.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: [f32; 2]) -> Option<EnvironmentSample> {
        if self.scale.max_element() <= 0.0 {
            return None;
        }
        match &self.source {
            Source::Constant => {
                Some(EnvironmentSample { direction: warp::sphere(u), radiance: self.scale, pdf: 1.0 / (4.0 * PI) })
            }
            Source::Map(map) => {
                let (uv, pdf) = map.sample(u)?;
                let direction = from_map([uv[0] - self.turn, uv[1]]);
                Some(EnvironmentSample { direction, radiance: self.scale * map.bilinear(uv), pdf })
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
            Source::Map(map) => map.pdf(self.to_map(direction)),
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
        [u, d.x.hypot(d.z).atan2(d.y) / PI]
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
    /// Over the texels, by the light that comes through each; `None`: all black.
    distribution: Option<Distribution2D>,
    mean: Vec3,
}

impl Map {
    fn new(width: usize, height: usize, pixels: Arc<[[f32; 3]]>) -> Self {
        let pixels = sanitised(pixels);
        let mut map = Self { width, height, pixels, distribution: None, mean: Vec3::ZERO };
        let mut weights = Vec::with_capacity(width * height);
        let mut sum = glam::DVec3::ZERO;
        for row in 0..height {
            let solid_angle = map.solid_angle(row);
            for column in 0..width {
                let mean = map.cell_mean(column, row);
                weights.push(luminance(mean) * solid_angle);
                sum += (mean * solid_angle).as_dvec3();
            }
        }
        map.mean = (sum / (4.0 * std::f64::consts::PI)).as_vec3();
        map.distribution = Distribution2D::new(&weights, width);
        map
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
        [row, row + 1].map(|edge| (std::f64::consts::PI * edge as f64 / self.height as f64).cos() as f32)
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
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let columns = [0, 1].map(|i| (x0 as i64 + i).rem_euclid(self.width as i64) as usize);
        let rows = [0, 1].map(|i| (y0 as i64 + i).clamp(0, self.height as i64 - 1) as usize);
        let along = |row| self.texel(columns[0], row).lerp(self.texel(columns[1], row), fx);
        along(rows[0]).lerp(along(rows[1]), fy)
    }

    /// A point of the map and its density by solid angle: uniform in the solid angle of the chosen texel, so that the
    /// density is constant in each texel and has no pole.
    fn sample(&self, u: [f32; 2]) -> Option<([f32; 2], f32)> {
        let distribution = self.distribution.as_ref()?;
        let ((column, row), [x, y]) = distribution.sample(u);
        let [top, bottom] = self.row_cosines(row);
        let v = (top + (bottom - top) * y).clamp(-1.0, 1.0).acos() / PI;
        let pdf = distribution.probability((column, row)) / self.solid_angle(row);
        Some(([(column as f32 + x) / self.width as f32, v], pdf))
    }

    fn pdf(&self, [u, v]: [f32; 2]) -> f32 {
        let Some(distribution) = &self.distribution else { return 0.0 };
        let column = ((u - u.floor()) * self.width as f32) as usize;
        let row = (v * self.height as f32) as usize;
        let cell = (column.min(self.width - 1), row.min(self.height - 1));
        distribution.probability(cell) / self.solid_angle(cell.1)
    }
}

/// Radiance that can be summed: NaN and negative become 0, and nothing is brighter than the sun seen from Earth,
/// about 1e9 in relative units.
fn sanitised(pixels: Arc<[[f32; 3]]>) -> Arc<[[f32; 3]]> {
    const BRIGHTEST: f32 = 1e10;
    let fine = |x: &f32| (0.0..=BRIGHTEST).contains(x);
    if pixels.iter().flatten().all(fine) {
        return pixels;
    }
    // `max` answers 0 for NaN.
    pixels.iter().map(|p| p.map(|x| x.max(0.0).min(BRIGHTEST))).collect()
}
