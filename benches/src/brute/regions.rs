//! Regions, and spheres that move, to be judged.

use firsthit_geometry::clip::HalfSpace;
use firsthit_geometry::frustum::Frustum;
use firsthit_geometry::overlap::{Capsule, Convex, OrientedBox, Sphere};
use firsthit_geometry::{Aabb, Ray};
use firsthit_measure::random::Rng;
use glam::{DMat3, DVec3};

use super::any_triangle;
use super::tally::Source;

/// A region of any kind.
#[allow(clippy::large_enum_variant, reason = "a few hundred at a time")]
#[derive(Clone, Debug)]
pub enum Asked {
    /// Along the axes.
    Box(Aabb<f64>),
    /// A ball.
    Ball(Sphere),
    /// A box that is turned.
    Oriented(OrientedBox),
    /// What is near a segment.
    Capsule(Capsule),
    /// What a camera sees.
    Frustum(Frustum),
    /// Between planes.
    Convex(Convex),
}

/// How many kinds there are.
pub const KINDS: usize = 6;

impl Asked {
    /// The query's name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Box(_) => "overlapping, box",
            Self::Ball(_) => "overlapping, sphere",
            Self::Oriented(_) => "overlapping, oriented box",
            Self::Capsule(_) => "overlapping, capsule",
            Self::Frustum(_) => "overlapping, frustum",
            Self::Convex(_) => "overlapping, convex",
        }
    }

    /// The same, all lengths times a power of two.
    #[must_use]
    pub fn scaled(&self, exponent: i32) -> Self {
        let s = 2f64.powi(exponent);
        match self {
            Self::Box(b) => Self::Box(Aabb::new(b.min * s, b.max * s)),
            Self::Ball(b) => Self::Ball(Sphere { center: b.center * s, radius: b.radius * s }),
            Self::Oriented(b) => Self::Oriented(OrientedBox { center: b.center * s, half: b.half * s, axes: b.axes }),
            Self::Capsule(c) => Self::Capsule(Capsule { a: c.a * s, b: c.b * s, radius: c.radius * s }),
            Self::Frustum(f) => {
                let corners = f.corners().map(|c| c * s);
                Frustum::from_corners(corners).map_or_else(|| self.clone(), Self::Frustum)
            }
            Self::Convex(c) => {
                let moved = |h: &HalfSpace<f64>| HalfSpace::new(h.normal, h.offset * s);
                Self::Convex(Convex { half_spaces: c.half_spaces.iter().map(moved).collect() })
            }
        }
    }
}

/// A region with a ball that it lies in.
#[derive(Clone, Debug)]
pub struct Placed {
    /// The region.
    pub region: Asked,
    /// The ball's middle.
    pub middle: DVec3,
    /// Its radius.
    pub reach: f64,
}

/// A sphere that moves.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    /// The way of its middle: a segment.
    pub way: Ray<f64>,
    /// Its radius.
    pub radius: f64,
}

/// Makes regions at a mesh.
pub struct Regions<'a> {
    corners: &'a [[DVec3; 3]],
    middle: DVec3,
    half: DVec3,
    rng: Rng,
}

impl<'a> Regions<'a> {
    /// At a mesh of these triangles.
    #[must_use]
    pub fn new(corners: &'a [[DVec3; 3]], seed: u64) -> Self {
        let all = || corners.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = all().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        Self { corners, middle: (low + high) * 0.5, half: (high - low) * 0.5, rng: Rng(seed) }
    }

    /// The next region of a kind, by its number.
    pub fn next(&mut self, kind: usize, source: Source) -> Placed {
        loop {
            let size = self.size();
            let made = match source {
                Source::Random => {
                    let middle = self.place();
                    self.random(kind, middle, size)
                }
                Source::Aimed => self.aimed(kind, size),
            };
            // Directions may be parallel, and corners one.
            if let Some(placed) = made {
                return placed;
            }
        }
    }

    /// The next sphere that moves: somewhere, or aimed at a corner or along an edge, to touch in passing.
    pub fn moving(&mut self, source: Source) -> Moving {
        let (from, size) = (self.place(), self.size());
        match source {
            Source::Random => Moving { way: Ray::segment(from, from + self.rng.in_cube() * self.half), radius: size },
            Source::Aimed => {
                let [a, b, c] = self.triangle();
                let across = self.rng.direction();
                let along = self.rng.direction().cross(across).normalize_or(DVec3::X) * self.half.length() * 0.3;
                let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
                match self.rng.below(5) {
                    // It passes a corner and touches it, or does not by a rounding.
                    0 => {
                        Moving { way: Ray::segment(a + across * size - along, a + across * size + along), radius: size }
                    }
                    // Along the triangle's plane, as high as its radius.
                    1 => {
                        let at = a + normal * size;
                        let edge = (b - a).normalize_or(DVec3::X) * self.half.length() * 0.2;
                        Moving { way: Ray::segment(at - edge, at + edge), radius: size }
                    }
                    // A point that moves, at a corner.
                    2 => Moving { way: Ray::segment(from, a), radius: 0.0 },
                    // It touches where it starts.
                    3 => Moving { way: Ray::segment(a + across * size, from), radius: size },
                    // Straight at an edge.
                    _ => Moving { way: Ray::segment(from, (a + b) * 0.5), radius: size },
                }
            }
        }
    }

    /// From a four thousandth to a sixteenth of the mesh.
    fn size(&mut self) -> f64 {
        self.half.length() * 2f64.powf(-11.0 + 8.0 * self.rng.unit())
    }

    /// In the box and around it; every other time near the surface.
    fn place(&mut self) -> DVec3 {
        if self.rng.below(2) == 0 {
            let [a, b, c] = self.triangle();
            let (s, t) = (self.rng.unit() * 0.5, self.rng.unit() * 0.5);
            return a + (b - a) * s + (c - a) * t + self.rng.in_cube() * self.half.length() * 0.02;
        }
        self.middle + self.rng.in_cube() * self.half * 1.1
    }

    fn triangle(&mut self) -> [DVec3; 3] {
        any_triangle(self.corners, &mut self.rng)
    }

    fn frame(&mut self) -> DMat3 {
        let x = self.rng.direction();
        let y = x.any_orthonormal_vector();
        DMat3::from_cols(x, y, x.cross(y))
    }

    fn random(&mut self, kind: usize, middle: DVec3, size: f64) -> Option<Placed> {
        let half = (self.rng.in_cube().abs() + 0.01) * size;
        let (region, reach) = match kind {
            0 => (Asked::Box(Aabb::new(middle - half, middle + half)), half.length()),
            1 => (Asked::Ball(Sphere { center: middle, radius: size }), size),
            2 => (Asked::Oriented(OrientedBox { center: middle, half, axes: self.frame() }), half.length()),
            3 => {
                let way = self.rng.direction() * size;
                let radius = size * self.rng.unit();
                (Asked::Capsule(Capsule { a: middle - way, b: middle + way, radius }), size + radius)
            }
            4 => {
                let (forward, up) = (self.rng.direction(), self.rng.direction());
                let angle = 0.2 + 1.5 * self.rng.unit();
                let (near, far) = (size * 0.1, size * (0.2 + self.rng.unit()));
                let aspect = 0.5 + self.rng.unit();
                let frustum = if self.rng.below(4) == 0 {
                    Frustum::orthographic(middle, forward, up, size, aspect, near, far)?
                } else {
                    Frustum::perspective(middle, forward, up, angle, aspect, near, far)?
                };
                return Some(around(frustum));
            }
            _ => {
                let faces = 4 + self.rng.below(5);
                let mut half_spaces: Vec<HalfSpace<f64>> = (0..faces)
                    .map(|_| {
                        let normal = self.rng.direction() * (0.5 + self.rng.unit());
                        HalfSpace::new(normal, normal.dot(middle) + normal.length() * size * self.rng.unit())
                    })
                    .collect();
                // So that it ends.
                for axis in DVec3::AXES {
                    half_spaces.push(HalfSpace::new(axis, axis.dot(middle) + size));
                    half_spaces.push(HalfSpace::new(-axis, size - axis.dot(middle)));
                }
                (Asked::Convex(Convex { half_spaces }), size * 2.0)
            }
        };
        Some(Placed { region, middle, reach })
    }

    /// What touches a corner, an edge or a face, or lies in it, or is but a point of it.
    fn aimed(&mut self, kind: usize, size: f64) -> Option<Placed> {
        let [a, b, c] = self.triangle();
        let at = match self.rng.below(3) {
            0 => a,
            1 => (a + b) * 0.5,
            _ => a + (b - a) * 0.25 + (c - a) * 0.5,
        };
        let normal = (b - a).cross(c - a).try_normalize()?;
        let edge = (b - a).try_normalize()?;
        let side = normal.cross(edge);
        let away = if self.rng.below(2) == 0 { normal } else { self.rng.direction() };
        let half = (self.rng.in_cube().abs() + 0.01) * size;
        let (region, middle, reach) = match kind {
            0 => {
                // A corner, an edge or a face of the box at the point; or a box that is flat, or but a point.
                let which = self.rng.below(4);
                let signs = self.rng.in_cube().signum();
                let far = at + signs * half * [DVec3::ONE, DVec3::new(1.0, 1.0, 0.0), DVec3::X, DVec3::ZERO][which];
                let bounds = Aabb::from_points([at, far]);
                (Asked::Box(bounds), bounds.center(), bounds.extent().length())
            }
            1 => {
                let center = at + away * size;
                let radius = if self.rng.below(4) == 0 { 0.0 } else { (center - at).length() };
                let center = if radius == 0.0 { at } else { center };
                (Asked::Ball(Sphere { center, radius }), center, radius)
            }
            2 => {
                // With a face in the triangle's plane, or flat in it.
                let half = half * if self.rng.below(3) == 0 { DVec3::new(1.0, 1.0, 0.0) } else { DVec3::ONE };
                let axes = DMat3::from_cols(edge, side, normal);
                let center = at + normal * half.z + edge * half.x * f64::from(self.rng.below(2) as u32);
                (Asked::Oriented(OrientedBox { center, half, axes }), center, half.length())
            }
            3 => match self.rng.below(3) {
                // An edge; what lies beside it; what touches at its end.
                0 => (Asked::Capsule(Capsule { a, b, radius: 0.0 }), (a + b) * 0.5, (b - a).length()),
                1 => {
                    let (p, q) = (a + normal * size, b + normal * size);
                    (Asked::Capsule(Capsule { a: p, b: q, radius: size }), a, 2.0 * size + (b - a).length())
                }
                _ => {
                    let (p, q) = (at + away * size, at + away * size * 2.0);
                    let radius = (p - at).length();
                    (Asked::Capsule(Capsule { a: p, b: q, radius }), at, 4.0 * size)
                }
            },
            4 => {
                // The near plane through the point, or a side of the view along the triangle.
                let (forward, up) = if self.rng.below(2) == 0 { (away, edge) } else { (edge, normal) };
                let eye = at - forward * size * 0.25;
                let frustum = Frustum::perspective(eye, forward, up, 1.0, 1.0, size * 0.25, size)?;
                return Some(around(frustum));
            }
            _ => {
                let mut half_spaces = vec![
                    HalfSpace::new(-away, -away.dot(at)),
                    HalfSpace::new(away, away.dot(at) + size),
                    HalfSpace::new(side, side.dot(at)),
                ];
                for axis in DVec3::AXES {
                    half_spaces.push(HalfSpace::new(axis, axis.dot(at) + size));
                    half_spaces.push(HalfSpace::new(-axis, size - axis.dot(at)));
                }
                (Asked::Convex(Convex { half_spaces }), at, size * 2.0)
            }
        };
        Some(Placed { region, middle, reach })
    }
}

/// With a ball about its corners.
fn around(frustum: Frustum) -> Placed {
    let corners = *frustum.corners();
    let middle = corners.iter().sum::<DVec3>() / 8.0;
    let reach = corners.iter().fold(0.0, |m: f64, c| m.max((*c - middle).length()));
    Placed { region: Asked::Frustum(frustum), middle, reach }
}
