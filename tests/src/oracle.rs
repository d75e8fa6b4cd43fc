//! Independent answers: meshes, random numbers, and a ray caster that shares no code with the library.

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DVec3, Vec3};

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

/// Positions and fanned faces of an OBJ file, nothing else of it; `None` where it cannot be read.
#[must_use]
pub fn read_obj(path: &Path) -> Option<Mesh> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let v: Vec<f32> = words.take(3).filter_map(|w| w.parse().ok()).collect();
                mesh.positions.push(Vec3::from_slice(v.get(..3)?));
            }
            Some("f") => {
                let f: Vec<u32> = words.filter_map(|w| w.split('/').next()?.parse().ok()).map(|i: u32| i - 1).collect();
                mesh.triangles.extend((2..f.len()).map(|k| [f[0], f[k - 1], f[k]]));
            }
            _ => {}
        }
    }
    Some(mesh)
}

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

/// A scene flattened into world-space triangles, each with the ids it must be reported by.
#[derive(Clone, Debug, Default)]
pub struct FlatScene {
    /// Instance, geometry, primitive; and the corners in the world.
    pub triangles: Vec<([u32; 3], [DVec3; 3])>,
}

/// What a flat scene answers.
#[derive(Clone, Copy, Debug)]
pub struct FlatHit {
    /// Instance, geometry, primitive.
    pub id: [u32; 3],
    /// Ray parameter.
    pub t: f64,
    /// Weights of the second and third vertex.
    pub uv: (f64, f64),
    /// Unit normal by the winding in the world.
    pub normal: DVec3,
    /// |n.d| / |d|: 1 head-on, 0 grazing.
    pub cosine: f64,
}

impl FlatScene {
    /// Adds one geometry of an instance.
    pub fn add(&mut self, instance: u32, geometry: u32, mesh: &Mesh, transform: DAffine3) {
        for k in 0..mesh.triangles.len() {
            let v = mesh.corners(k).map(|p| transform.transform_point3(p));
            self.triangles.push(([instance, geometry, k as u32], v));
        }
    }

    /// The nearest hit at `t >= 0` by Cramer's rule in double precision. The second answer is false when it is not
    /// clear, within `margin`, whether or which triangle comes first.
    #[must_use]
    pub fn closest_hit(&self, o: DVec3, d: DVec3, margin: f64) -> (Option<FlatHit>, bool) {
        let det = |x: DVec3, y: DVec3, z: DVec3| x.dot(y.cross(z));
        let mut best: Option<FlatHit> = None;
        let mut doubts = Vec::new();
        for &(id, [a, b, c]) in &self.triangles {
            let (e1, e2, s) = (b - a, c - a, o - a);
            let m = det(-d, e1, e2);
            if m == 0.0 {
                continue;
            }
            let (t, u, v) = (det(s, e1, e2) / m, det(-d, s, e2) / m, det(-d, e1, s) / m);
            let least = u.min(v).min(1.0 - u - v);
            // Thin or grazing triangles make the weights uncertain.
            let cosine = m.abs() / (e1.cross(e2).length() * d.length());
            if least.abs() < margin / cosine || (t.abs() < margin && least > -margin) {
                doubts.push(t);
            }
            if least >= 0.0 && t >= 0.0 {
                if best.is_some_and(|h| (h.t - t).abs() < margin) {
                    doubts.push(t.min(best.map_or(t, |h| h.t)));
                }
                if best.is_none_or(|h| t < h.t) {
                    let normal = e1.cross(e2).normalize();
                    best = Some(FlatHit { id, t, uv: (u, v), normal, cosine });
                }
            }
        }
        let end = best.map_or(f64::INFINITY, |h| h.t);
        let clear = !doubts.iter().any(|&t| t > -margin && t <= end + margin);
        (best, clear)
    }
}
