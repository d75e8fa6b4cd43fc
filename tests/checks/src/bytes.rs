//! Bytes read as numbers: not only as bits, most of which are numbers that never meet.

use firsthit_geometry::Ray;
use glam::{DVec3, Vec3};

/// Numbers that arithmetic stumbles over, besides those of the lattice.
const SPECIAL: [f64; 24] = [
    0.0,
    -0.0,
    1.401298464324817e-45,
    -1e-40,
    f32::MIN_POSITIVE as f64,
    f32::MAX as f64,
    f32::MIN as f64,
    f32::EPSILON as f64,
    1.0 + f32::EPSILON as f64,
    1.0 - f32::EPSILON as f64 / 2.0,
    1.0 / 3.0,
    0.1,
    1e7,
    -1e7,
    16_777_217.0,
    1e-20,
    1e20,
    -1e19,
    1e-30,
    1e30,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    -1.0,
];

/// Such as only `f64` has.
const SPECIAL_DOUBLE: [f64; 8] =
    [f64::MAX, f64::MIN, f64::MIN_POSITIVE, 5e-324, -1e-310, 1e200, 1e-200, 1.0 + f64::EPSILON];

/// Which numbers a reader makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// A few small integers: hits of edges, vertices and planes that coincide.
    Lattice,
    /// Random digits of ordinary size.
    Ordinary,
    /// The lattice times a power of two.
    Scaled(i32),
    /// All of it, any bits, and neighbours of earlier numbers.
    Wild,
}

/// Reads bytes to their end, then zeros.
#[derive(Clone, Debug)]
pub(crate) struct Bytes<'a> {
    rest: &'a [u8],
    mode: Mode,
    last: f64,
}

impl<'a> Bytes<'a> {
    /// The first byte chooses which numbers there are.
    pub(crate) fn new(data: &'a [u8]) -> Self {
        let mut bytes = Self { rest: data, mode: Mode::Wild, last: 0.0 };
        let e = i32::from(bytes.byte());
        bytes.mode = match e % 4 {
            0 => Mode::Lattice,
            1 => Mode::Ordinary,
            2 => Mode::Scaled(e - 128),
            _ => Mode::Wild,
        };
        bytes
    }

    /// Whether all numbers are of ordinary size.
    pub(crate) fn ordinary(&self) -> bool {
        matches!(self.mode, Mode::Lattice | Mode::Ordinary)
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.rest.split_first() else { return 0 };
        self.rest = rest;
        *first
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.byte() % 2 == 1
    }

    fn bits(&mut self) -> u64 {
        (0..8).fold(0, |bits, _| bits << 8 | u64::from(self.byte()))
    }

    fn lattice(&mut self) -> f64 {
        f64::from(self.byte() % 9) - 4.0
    }

    /// In [-1, 1).
    pub(crate) fn fraction(&mut self) -> f64 {
        let bits = (0..4).fold(0, |bits, _| bits << 8 | u32::from(self.byte()));
        f64::from(bits) / f64::from(1u32 << 31) - 1.0
    }

    fn number(&mut self, double: bool) -> f64 {
        let x = match self.mode {
            Mode::Lattice => self.lattice(),
            Mode::Ordinary => self.fraction() * 4.0,
            Mode::Scaled(e) => self.lattice() * 2f64.powi(e),
            Mode::Wild => match self.byte() % 16 {
                0..=4 => self.lattice(),
                5 | 6 => f64::from(self.byte() as i8) / 16.0,
                7..=9 => self.fraction(),
                10 => {
                    let e = i32::from(self.byte()) - 128;
                    2f64.powi(if double { e * 8 } else { e })
                }
                11 if double => f64::from_bits(self.bits()),
                11 => f32::from_bits(self.bits() as u32).into(),
                12 if double => SPECIAL_DOUBLE[self.below(SPECIAL_DOUBLE.len())],
                12 => SPECIAL[self.below(SPECIAL.len())],
                13 if double => self.last.next_up(),
                13 => (self.last as f32).next_up().into(),
                14 => -self.last,
                _ => self.last,
            },
        };
        self.last = x;
        x
    }

    pub(crate) fn single(&mut self) -> f32 {
        self.number(false) as f32
    }

    pub(crate) fn double(&mut self) -> f64 {
        self.number(true)
    }

    /// Of `f64`, or one that fits in `f32`.
    pub(crate) fn real(&mut self, double: bool) -> f64 {
        if double { self.double() } else { self.single().into() }
    }

    /// Mostly without a sign.
    pub(crate) fn size(&mut self, double: bool) -> f64 {
        let x = self.real(double);
        if self.byte() < 250 { x.abs() } else { x }
    }

    pub(crate) fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.single(), self.single(), self.single())
    }

    pub(crate) fn vector(&mut self, double: bool) -> DVec3 {
        DVec3::new(self.real(double), self.real(double), self.real(double))
    }

    /// A ray from anywhere, every other one aimed at the point; its numbers fit in `f32` unless `double`.
    pub(crate) fn ray(&mut self, target: DVec3, double: bool) -> Ray<f64> {
        let (origin, direction) = (self.vector(double), self.vector(double));
        let direction = if self.flag() { target - origin } else { direction };
        let direction = if double { direction } else { direction.as_vec3().as_dvec3() };
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
        match self.byte() % 8 {
            0..=3 => ray,
            4 | 5 => Ray { t_min: f64::NEG_INFINITY, ..ray },
            6 => Ray { t_max: 1.0, ..ray },
            _ => Ray { t_min: self.real(double), t_max: self.real(double), ..ray },
        }
    }
}
