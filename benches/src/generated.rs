//! Scenes made by rule, large enough to leave the caches: the same triangles on every machine with IEEE arithmetic (sines
//! may differ in the last bit).

use std::f32::consts::TAU;

use firsthit_measure::mesh::Mesh;
use glam::{Vec2, Vec3};

use crate::random::Pcg;

/// Side of the land.
const SIDE: f32 = 1000.0;

/// A random number in `[0, 1)` for a point of the integer grid.
fn lattice(x: i32, z: i32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x85eb_ca6b) ^ (z as u32).wrapping_mul(0xc2b2_ae35);
    for (shift, factor) in [(15, 0x2c1b_3c6d), (12, 0x297a_2d39)] {
        h = (h ^ (h >> shift)).wrapping_mul(factor);
    }
    h ^= h >> 15;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise in `[0, 1)`, one bump for each unit square.
fn noise(at: Vec2) -> f32 {
    let cell = at.floor();
    let part = at - cell;
    let smooth = part * part * (3.0 - 2.0 * part);
    let (x, z) = (cell.x as i32, cell.y as i32);
    let mix = |a: f32, b: f32, s: f32| a + (b - a) * s;
    let row = |z| mix(lattice(x, z), lattice(x + 1, z), smooth.x);
    mix(row(z), row(z + 1), smooth.y)
}

/// Height of the land: nine octaves of noise.
fn height(x: f32, z: f32) -> f32 {
    let at = Vec2::new(x * 0.006 + 3.1, z * 0.006 + 7.7);
    let (mut sum, mut amplitude, mut frequency) = (0.0, 0.5, 1.0);
    for _ in 0..9 {
        sum += amplitude * noise(at * frequency);
        amplitude *= 0.5;
        frequency *= 2.03;
    }
    220.0 * sum
}

/// Hilly land over `[0, 1000]^2` in x and z, of `2 n^2` triangles.
#[must_use]
pub fn terrain(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let step = SIDE / n as f32;
    for j in 0..=n {
        for i in 0..=n {
            let (x, z) = (i as f32 * step, j as f32 * step);
            mesh.positions.push(Vec3::new(x, height(x, z), z));
        }
    }
    let row = n + 1;
    for j in 0..n {
        for i in 0..n {
            let here = j * row + i;
            mesh.triangles.extend([[here, here + row, here + 1], [here + 1, here + row, here + row + 1]]);
        }
    }
    mesh
}

/// A pipe of `2 * sides` triangles from one point to another, as wide as said at each.
fn pipe(mesh: &mut Mesh, (from, wide): (Vec3, f32), (to, narrow): (Vec3, f32), sides: u32) {
    let along = (to - from).normalize();
    let up = if along.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
    let x = up.cross(along).normalize();
    let y = along.cross(x);
    let first = mesh.positions.len() as u32;
    for k in 0..sides {
        let angle = k as f32 / sides as f32 * TAU;
        let outward = x * angle.cos() + y * angle.sin();
        mesh.positions.extend([from + outward * wide, to + outward * narrow]);
    }
    for k in 0..sides {
        let (here, next) = (first + 2 * k, first + 2 * ((k + 1) % sides));
        mesh.triangles.extend([[here, next, here + 1], [here + 1, next, next + 1]]);
    }
}

/// A trunk, 60 branches and 34 leaves on each: 4,832 triangles, most of them small, thin and one through another.
fn tree(random: &mut Pcg) -> Mesh {
    const BRANCHES: u32 = 60;
    let mut mesh = Mesh::default();
    pipe(&mut mesh, (Vec3::new(0.0, -0.5, 0.0), 0.35), (Vec3::new(0.0, 9.0, 0.0), 0.05), 16);
    for branch in 0..BRANCHES {
        let h = 2.0 + 7.0 * (branch as f32 / BRANCHES as f32);
        let angle = random.within(0.0, TAU);
        let length = (9.6 - h) * 0.45 + 0.3;
        let from = Vec3::new(0.0, h, 0.0);
        let to = Vec3::new(angle.cos() * length, h + length * random.within(0.1, 0.5), angle.sin() * length);
        pipe(&mut mesh, (from, 0.06), (to, 0.015), 6);
        for _ in 0..34 {
            let on_branch = from + (to - from) * random.within(0.3, 1.05);
            let center = on_branch + random.vector(Vec3::new(0.3, 0.2, 0.3));
            let long = random.vector(Vec3::ONE).normalize() * 0.14;
            let wide = random.vector(Vec3::new(1.0, 0.3, 1.0)).normalize() * 0.09;
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([
                center - long - wide,
                center + long - wide,
                center + long + wide,
                center - long + wide,
            ]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

/// Land of 320,000 triangles and, in a square of it 130 wide, copies of one tree, turned and scaled, as one mesh.
#[must_use]
pub fn forest(trees: u32) -> Mesh {
    const CORNER: f32 = 420.0;
    let mut random = Pcg::new(77);
    let tree = tree(&mut random);
    let mut mesh = terrain(400);
    for _ in 0..trees {
        let (x, z) = (random.within(0.0, 130.0), random.within(0.0, 130.0));
        let (scale, angle) = (random.within(0.7, 1.4), random.within(0.0, TAU));
        let (cos, sin) = (angle.cos() * scale, angle.sin() * scale);
        let y = height(x + CORNER, z + CORNER);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(tree.positions.iter().map(|p| {
            Vec3::new(x + CORNER + p.x * cos - p.z * sin, y + p.y * scale, z + CORNER + p.x * sin + p.z * cos)
        }));
        mesh.triangles.extend(tree.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_that_are_stated() {
        assert_eq!(terrain(10).triangles.len(), 200);
        assert_eq!(tree(&mut Pcg::new(77)).triangles.len(), 4_832);
        let forest = forest(3);
        assert_eq!(forest.triangles.len(), 320_000 + 3 * 4_832);
        assert!(forest.positions.iter().all(|p| p.is_finite() && p.y >= 0.0 && p.y < 250.0));
        assert!(forest.triangles.iter().flatten().all(|&i| (i as usize) < forest.positions.len()));
    }
}
