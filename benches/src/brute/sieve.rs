//! Which triangles might matter to a line or a point: balls around all of them, in single precision, with more room than its
//! roundings take.

use std::ops::Range;

use glam::DVec3;

/// Triangles that are looked at for several lines or points before the next: they stay in the fastest memory.
const TILE: usize = 1024;

/// Balls that are looked at together.
const LANES: usize = 16;

/// Unit roundoff of `f32`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// Balls around triangles: centres on the triangles, seen from the middle of the mesh.
pub struct Sieve {
    middle: DVec3,
    /// No corner is farther from the middle.
    reach: f64,
    count: usize,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    radius: Vec<f32>,
    wide: bool,
}

/// A line as the tests see it.
struct Line {
    direction: [f32; 3],
    /// The line's moment: a point of it times its direction.
    moment: [f32; 3],
    /// Room for what is rounded.
    room: f32,
}

impl Sieve {
    /// Balls around all triangles.
    #[must_use]
    pub fn new(corners: &[[DVec3; 3]]) -> Self {
        let all = || corners.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = all().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        let middle = (low + high) * 0.5;
        let reach = all().fold(0.0f64, |m, p| m.max((*p - middle).length()));
        let padded = corners.len().next_multiple_of(LANES);
        let mut sieve = Self {
            middle,
            reach,
            count: corners.len(),
            x: vec![f32::INFINITY; padded],
            y: vec![f32::INFINITY; padded],
            z: vec![f32::INFINITY; padded],
            radius: vec![0.0; padded],
            wide: wide(),
        };
        for (i, [a, b, c]) in corners.iter().enumerate() {
            let centre = ((*a + *b + *c) / 3.0 - middle).as_vec3();
            let from = centre.as_dvec3() + middle;
            let radius = [a, b, c].into_iter().fold(0.0f64, |m, p| m.max((*p - from).length()));
            (sieve.x[i], sieve.y[i], sieve.z[i]) = (centre.x, centre.y, centre.z);
            sieve.radius[i] = (radius * (1.0 + 4.0 * U)) as f32;
        }
        sieve
    }

    /// For each line (a point and a direction of any length) the triangles near it, in order.
    pub fn near_lines(&self, lines: &[(DVec3, DVec3)], found: &mut Vec<Vec<u32>>) {
        found.resize(lines.len(), Vec::new());
        found.iter_mut().for_each(Vec::clear);
        let lines: Vec<Option<Line>> = lines.iter().map(|l| self.line(*l)).collect();
        for start in (0..self.x.len()).step_by(TILE) {
            let tile = start..(start + TILE).min(self.x.len());
            for (line, found) in lines.iter().zip(&mut *found) {
                if let Some(line) = line {
                    self.tile_near_line(tile.clone(), line, found);
                }
            }
        }
    }

    /// `None` if it passes the whole mesh.
    fn line(&self, (origin, direction): (DVec3, DVec3)) -> Option<Line> {
        let direction = direction.normalize();
        let from = origin - self.middle;
        // The point nearest to the middle; it is off by some roundings of f64 of where the line begins.
        let nearest = from - direction * from.dot(direction);
        let off = from.length() * 1e-14;
        if nearest.length() > self.reach * 1.000_001 + off {
            return None;
        }
        // Rounding of both and of six products and sums: less than 12 units for each coordinate.
        let room = 64.0 * U * self.reach + 4.0 * off;
        let moment = nearest.cross(direction);
        Some(Line { direction: direction.as_vec3().to_array(), moment: moment.as_vec3().to_array(), room: room as f32 })
    }

    fn tile_near_line(&self, tile: Range<usize>, line: &Line, found: &mut Vec<u32>) {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` says that the processor has AVX-512 F.
            return unsafe { wide::near_line(self, tile, line, found) };
        }
        let ([dx, dy, dz], [mx, my, mz]) = (line.direction, line.moment);
        for i in tile {
            let (x, y, z) = (self.x[i], self.y[i], self.z[i]);
            let p = y * dz - (z * dy + mx);
            let q = z * dx - (x * dz + my);
            let r = x * dy - (y * dx + mz);
            let most = self.radius[i] + line.room;
            if p * p + q * q + r * r <= most * most * SPARE {
                found.push(i as u32);
            }
        }
    }

    /// For each point the triangles that may be among the `few` nearest to it, in order.
    pub fn near_points(&self, points: &[DVec3], few: usize, found: &mut Vec<Vec<u32>>) {
        found.resize(points.len(), Vec::new());
        found.iter_mut().for_each(Vec::clear);
        let seen: Vec<[f32; 3]> = points.iter().map(|p| (*p - self.middle).as_vec3().to_array()).collect();
        // The least squared distance from a centre, which is on its triangle, of each sixteenth of each tile: as many
        // triangles are as near as that.
        let tiles = self.x.len().div_ceil(TILE);
        let mut least = vec![f32::INFINITY; points.len() * tiles * LANES];
        for (k, start) in (0..self.x.len()).step_by(TILE).enumerate() {
            let tile = start..(start + TILE).min(self.x.len());
            for (j, p) in seen.iter().enumerate() {
                let at = (j * tiles + k) * LANES;
                self.tile_least(tile.clone(), *p, &mut least[at..at + LANES]);
            }
        }
        let most: Vec<f32> = points
            .iter()
            .zip(least.chunks_mut(tiles * LANES))
            .map(|(p, least)| {
                let place = few.min(least.len()) - 1;
                let (_, kth, _) = least.select_nth_unstable_by(place, f32::total_cmp);
                // Rounding of the point, of the centre and of the squares; the centre may lie off its triangle by as much.
                let room = 32.0 * U * ((*p - self.middle).length() + self.reach);
                (f64::from(*kth).sqrt() * (1.0 + 16.0 * U) + 2.0 * room) as f32
            })
            .collect();
        for start in (0..self.x.len()).step_by(TILE) {
            let tile = start..(start + TILE).min(self.x.len());
            for ((p, most), found) in seen.iter().zip(&most).zip(&mut *found) {
                self.tile_near_point(tile.clone(), *p, *most, found);
            }
        }
        if few >= self.count {
            found.iter_mut().for_each(|f| *f = (0..self.count as u32).collect());
        }
    }

    /// For each ball (middle and radius) the triangles that may meet it, in order.
    pub fn near_balls(&self, balls: &[(DVec3, f64)], found: &mut Vec<Vec<u32>>) {
        found.resize(balls.len(), Vec::new());
        found.iter_mut().for_each(Vec::clear);
        let seen = |&(p, radius): &(DVec3, f64)| {
            let from = p - self.middle;
            let room = 32.0 * U * (from.length() + self.reach);
            (from.as_vec3().to_array(), (radius * (1.0 + 16.0 * U) + 2.0 * room) as f32)
        };
        let seen: Vec<_> = balls.iter().map(seen).collect();
        for start in (0..self.x.len()).step_by(TILE) {
            let tile = start..(start + TILE).min(self.x.len());
            for ((p, most), found) in seen.iter().zip(&mut *found) {
                self.tile_near_point(tile.clone(), *p, *most, found);
            }
        }
        // What is padded is nowhere, and near an endless ball.
        found.iter_mut().for_each(|f| f.retain(|&i| (i as usize) < self.count));
    }

    fn tile_least(&self, tile: Range<usize>, p: [f32; 3], least: &mut [f32]) {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` says that the processor has AVX-512 F.
            return unsafe { wide::least(self, tile, p, least) };
        }
        for i in tile {
            let (x, y, z) = (self.x[i] - p[0], self.y[i] - p[1], self.z[i] - p[2]);
            least[i % LANES] = least[i % LANES].min(x * x + y * y + z * z);
        }
    }

    fn tile_near_point(&self, tile: Range<usize>, p: [f32; 3], most: f32, found: &mut Vec<u32>) {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` says that the processor has AVX-512 F.
            return unsafe { wide::near_point(self, tile, p, most, found) };
        }
        for i in tile {
            let (x, y, z) = (self.x[i] - p[0], self.y[i] - p[1], self.z[i] - p[2]);
            let most = self.radius[i] + most;
            if x * x + y * y + z * z <= most * most * SPARE {
                found.push(i as u32);
            }
        }
    }
}

/// Covers the roundings of what is compared itself.
const SPARE: f32 = 1.0 + 1e-5;

fn wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx512f");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// The same, sixteen at a time.
#[cfg(target_arch = "x86_64")]
mod wide {
    use std::arch::x86_64::*;
    use std::ops::Range;

    use super::{LANES, Line, SPARE, Sieve};

    #[target_feature(enable = "avx512f")]
    fn load(from: &[f32], i: usize) -> __m512 {
        let sixteen: &[f32] = &from[i..i + LANES];
        // SAFETY: there are sixteen.
        unsafe { _mm512_loadu_ps(sixteen.as_ptr()) }
    }

    fn push(mut mask: u16, i: usize, found: &mut Vec<u32>) {
        while mask != 0 {
            found.push(i as u32 + mask.trailing_zeros());
            mask &= mask - 1;
        }
    }

    #[target_feature(enable = "avx512f")]
    pub(super) fn near_line(s: &Sieve, tile: Range<usize>, line: &Line, found: &mut Vec<u32>) {
        let [dx, dy, dz] = line.direction.map(|d| _mm512_set1_ps(d));
        let [mx, my, mz] = line.moment.map(|m| _mm512_set1_ps(m));
        let (room, spare) = (_mm512_set1_ps(line.room), _mm512_set1_ps(SPARE));
        for i in tile.step_by(LANES) {
            let (x, y, z) = (load(&s.x, i), load(&s.y, i), load(&s.z, i));
            let p = _mm512_fmsub_ps(y, dz, _mm512_fmadd_ps(z, dy, mx));
            let q = _mm512_fmsub_ps(z, dx, _mm512_fmadd_ps(x, dz, my));
            let r = _mm512_fmsub_ps(x, dy, _mm512_fmadd_ps(y, dx, mz));
            let squared = _mm512_fmadd_ps(r, r, _mm512_fmadd_ps(q, q, _mm512_mul_ps(p, p)));
            let most = _mm512_add_ps(load(&s.radius, i), room);
            let most = _mm512_mul_ps(_mm512_mul_ps(most, most), spare);
            push(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(squared, most), i, found);
        }
    }

    #[target_feature(enable = "avx512f")]
    fn squared(s: &Sieve, i: usize, [px, py, pz]: [__m512; 3]) -> __m512 {
        let x = _mm512_sub_ps(load(&s.x, i), px);
        let y = _mm512_sub_ps(load(&s.y, i), py);
        let z = _mm512_sub_ps(load(&s.z, i), pz);
        _mm512_fmadd_ps(z, z, _mm512_fmadd_ps(y, y, _mm512_mul_ps(x, x)))
    }

    #[target_feature(enable = "avx512f")]
    pub(super) fn least(s: &Sieve, tile: Range<usize>, p: [f32; 3], least: &mut [f32]) {
        let p = p.map(|x| _mm512_set1_ps(x));
        let mut all = _mm512_set1_ps(f32::INFINITY);
        for i in tile.step_by(LANES) {
            all = _mm512_min_ps(all, squared(s, i, p));
        }
        let sixteen = &mut least[..LANES];
        // SAFETY: there is room for sixteen.
        unsafe { _mm512_storeu_ps(sixteen.as_mut_ptr(), all) };
    }

    #[target_feature(enable = "avx512f")]
    pub(super) fn near_point(s: &Sieve, tile: Range<usize>, p: [f32; 3], most: f32, found: &mut Vec<u32>) {
        let p = p.map(|x| _mm512_set1_ps(x));
        let (most, spare) = (_mm512_set1_ps(most), _mm512_set1_ps(SPARE));
        for i in tile.step_by(LANES) {
            let most = _mm512_add_ps(load(&s.radius, i), most);
            let most = _mm512_mul_ps(_mm512_mul_ps(most, most), spare);
            push(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(squared(s, i, p), most), i, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brute::corners;
    use firsthit_geometry::distance::closest_on_triangle;
    use firsthit_geometry::{Ray, exact::ExactRay};
    use firsthit_measure::mesh::bumpy_sphere;
    use firsthit_measure::random::Rng;

    /// Nothing that matters is sorted out, on either way.
    #[test]
    fn the_sieve_keeps_what_matters() {
        let mesh = bumpy_sphere(3).map(|p| p + 5.0);
        let corners = corners(&mesh);
        let mut rng = Rng(5);
        for wide in [false, wide()] {
            let sieve = Sieve { wide, ..Sieve::new(&corners) };
            let mut found = Vec::new();
            let lines: Vec<_> = (0..200)
                .map(|k| {
                    let target = corners[rng.below(corners.len())][k % 3];
                    let origin = target + rng.in_cube() * [3.0, 1e3, 1e9][k % 3];
                    (origin, target - origin)
                })
                .collect();
            sieve.near_lines(&lines, &mut found);
            for ((origin, direction), found) in lines.iter().zip(&found) {
                let line = Ray::new(*origin, *direction).with_interval(f64::NEG_INFINITY, f64::INFINITY);
                let line = ExactRay::new(line).unwrap();
                let hit = |i: usize| line.hit(corners[i]).is_some();
                assert!((0..corners.len()).all(|i| !hit(i) || found.contains(&(i as u32))));
                assert!(found.len() < corners.len() / 2);
            }
            let balls: Vec<_> = (0..200).map(|_| (rng.in_cube() * 2.0 + 5.0, rng.unit())).collect();
            sieve.near_balls(&balls, &mut found);
            for ((p, radius), found) in balls.iter().zip(&found) {
                let distance = |i: usize| closest_on_triangle::<f64>(corners[i], *p).point.distance(*p);
                assert!((0..corners.len()).all(|i| distance(i) > *radius || found.contains(&(i as u32))));
            }
            let points: Vec<_> = (0..200)
                .map(|k| corners[rng.below(corners.len())][0] + rng.in_cube() * [0.0, 0.1, 3.0, 300.0][k % 4])
                .collect();
            sieve.near_points(&points, 8, &mut found);
            for (p, found) in points.iter().zip(&found) {
                let squared = |i: usize| {
                    (closest_on_triangle::<f64>(corners[i].map(|c| c - *p), DVec3::ZERO).point.length_squared(), i)
                };
                let mut all: Vec<_> = (0..corners.len()).map(squared).collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                // Whatever is as near as the last of the few belongs to them.
                let last = all[7].0;
                assert!(all.iter().filter(|a| a.0 <= last).all(|a| found.contains(&(a.1 as u32))));
            }
        }
    }
}
