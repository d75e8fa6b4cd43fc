//! Meshes made by rule, closed unless they say otherwise.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::random::Rng;

/// An indexed mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Every position changed.
    #[must_use]
    pub fn map(mut self, f: impl Fn(Vec3) -> Vec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = f(*p));
        self
    }

    /// The corners of triangle `k`.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn corners(&self, k: usize) -> [DVec3; 3] {
        self.triangles[k].map(|i| self.positions[i as usize].as_dvec3())
    }
}

/// A unit sphere of `20 * 4^levels` triangles: closed, and every vertex is stored once.
#[must_use]
pub fn icosphere(levels: u32) -> Mesh {
    let phi = f32::midpoint(1.0, 5.0f32.sqrt());
    let mut positions = Vec::new();
    for a in [-1.0f32, 1.0] {
        for b in [-phi, phi] {
            positions.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
        }
    }
    // Faces of the convex hull: triples at mutual distance 2, wound outwards.
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let near = |i: usize, j: usize| (positions[i].distance(positions[j]) - 2.0).abs() < 1e-3;
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(i, k) {
                    let (a, b, c) = (positions[i], positions[j], positions[k]);
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] }.map(|x| x as u32));
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]) * 0.5);
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh { positions: positions.into_iter().map(Vec3::normalize).collect(), triangles }
}

/// A closed torus of `2 * n * m` triangles about the z axis, radii 1 and `minor`.
#[must_use]
pub fn torus(n: u32, m: u32, minor: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i as f32 / n as f32 * std::f32::consts::TAU, j as f32 / m as f32 * std::f32::consts::TAU);
            let r = 1.0 + minor * b.cos();
            mesh.positions.push(Vec3::new(r * a.cos(), r * a.sin(), minor * b.sin()));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

/// The cube `[-1, 1]^3` with each face a grid of `n * n` squares cut in two: closed, on integer-like coordinates.
#[must_use]
pub fn grid_cube(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut known: HashMap<[i32; 3], u32> = HashMap::new();
    let n = n as i32;
    for axis in 0..3 {
        for side in [-n, n] {
            for i in 0..n {
                for j in 0..n {
                    let mut vertex = |a: i32, b: i32| {
                        let mut p = [0; 3];
                        p[axis] = side;
                        p[(axis + 1) % 3] = 2 * a - n;
                        p[(axis + 2) % 3] = 2 * b - n;
                        *known.entry(p).or_insert_with(|| {
                            let [x, y, z] = p.map(|c| c as f32 / n as f32);
                            mesh.positions.push(Vec3::new(x, y, z));
                            mesh.positions.len() as u32 - 1
                        })
                    };
                    let q = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
                    let q = if side > 0 { q } else { [q[3], q[2], q[1], q[0]] };
                    mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
                }
            }
        }
    }
    mesh
}

/// An [`icosphere`] with hills and valleys and one long bulge: closed, with triangles of many sizes and slopes.
#[must_use]
pub fn bumpy_sphere(levels: u32) -> Mesh {
    icosphere(levels).map(|p| {
        let hills = (9.0 * p.x).sin() * (7.0 * p.y).sin() * (8.0 * p.z).sin();
        let bulge = (4.0 * (p.y - 1.0)).exp();
        p * (1.0 + 0.15 * hills + 0.5 * bulge)
    })
}

/// Triangles of sizes up to about 1 strewn through the cube `[-1, 1]^3`: open, and through one another.
#[must_use]
pub fn soup(rng: &mut Rng, count: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..count {
        let (center, size) = (rng.in_cube(), 0.05 + 0.5 * rng.unit());
        mesh.positions.extend((0..3).map(|_| (center + rng.in_cube() * size).as_vec3()));
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    mesh
}
