//! Rays from arrays of any leading shape.

use firsthit_geometry::Ray;
use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use crate::arrays::{Floats, Numbers};
use crate::error;

/// What the caller gave, in order.
pub(crate) struct Rays<'py> {
    /// The shape of the answers.
    pub(crate) shape: Vec<usize>,
    /// How many rays there are.
    pub(crate) count: usize,
    places: Places<'py>,
    t_min: End<'py>,
    t_max: End<'py>,
}

enum Places<'py> {
    /// Rows of 6 or 8 numbers.
    Together(Floats<'py>, usize),
    Apart(Floats<'py>, Floats<'py>),
}

/// A number of each ray or point: an end of the interval, a radius.
pub(crate) enum End<'py> {
    Same(f64),
    Each(Floats<'py>),
    /// A column of the rays.
    Column(usize),
}

/// [`Rays`] while they are read, from any thread.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    origin: Part<'a>,
    direction: Part<'a>,
    t_min: Part<'a>,
    t_max: Part<'a>,
}

/// Some numbers of each ray or point.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a> {
    numbers: Numbers<'a>,
    start: usize,
    /// 0 where all rays have the same.
    step: usize,
}

impl Part<'_> {
    #[inline(always)]
    pub(crate) fn number(&self, ray: usize, k: usize) -> f64 {
        self.numbers.get(self.start + ray * self.step + k)
    }

    #[inline(always)]
    pub(crate) fn vector(&self, ray: usize) -> DVec3 {
        DVec3::new(self.number(ray, 0), self.number(ray, 1), self.number(ray, 2))
    }
}

impl View<'_> {
    #[inline(always)]
    pub(crate) fn ray(&self, i: usize) -> Ray<f64> {
        Ray::new(self.origin.vector(i), self.direction.vector(i))
            .with_interval(self.t_min.number(i, 0), self.t_max.number(i, 0))
    }
}

impl<'py> Rays<'py> {
    /// From `rays` of shape `(..., 6)` or `(..., 8)`, or from origins and directions of shape `(..., 3)`, which are
    /// repeated as NumPy does.
    pub(crate) fn new(
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let first = Floats::new(rays)?;
        let (places, shape, own_interval) = match directions {
            None => {
                let Some((width @ (6 | 8), lead)) = split(first.shape()) else {
                    let shape = first.shape();
                    return Err(error::value(format_args!(
                        "rays: shape {shape:?}; (..., 6) or (..., 8) is needed, or origins and directions of (..., 3)"
                    )));
                };
                let lead = lead.to_vec();
                (Places::Together(first, width), lead, width == 8)
            }
            Some(directions) => {
                let second = Floats::new(directions)?;
                let (Some((3, a)), Some((3, b))) = (split(first.shape()), split(second.shape())) else {
                    let (a, b) = (first.shape(), second.shape());
                    return Err(error::value(format_args!(
                        "origins {a:?} and directions {b:?}: shapes (..., 3) are needed"
                    )));
                };
                // One of them may stand for all.
                if a == b || a.is_empty() || b.is_empty() {
                    let lead = if a.is_empty() { b } else { a }.to_vec();
                    (Places::Apart(first, second), lead, false)
                } else {
                    let lead = repeated(a, b)?;
                    let whole = [&lead[..], &[3]].concat();
                    let (first, second) = (Floats::repeated(rays, &whole)?, Floats::repeated(directions, &whole)?);
                    (Places::Apart(first, second), lead, false)
                }
            }
        };
        if own_interval && (t_min.is_some() || t_max.is_some()) {
            return Err(error::value("rays of shape (..., 8) have a t_min and t_max of their own"));
        }
        let [t_min, t_max] = if own_interval {
            [End::Column(6), End::Column(7)]
        } else {
            [End::new(t_min, 0.0, &shape)?, End::new(t_max, f64::INFINITY, &shape)?]
        };
        let count = shape.iter().product();
        Ok(Self { shape, count, places, t_min, t_max })
    }

    /// The rays, to be read.
    pub(crate) fn view(&self) -> View<'_> {
        let [origin, direction] = match &self.places {
            Places::Together(rays, width) => {
                let part = |start| Part { numbers: rays.numbers(), start, step: *width };
                [part(0), part(3)]
            }
            Places::Apart(origins, directions) => [origins, directions].map(|floats| {
                let step = if floats.shape().len() > 1 || self.shape.is_empty() { 3 } else { 0 };
                Part { numbers: floats.numbers(), start: 0, step }
            }),
        };
        View { origin, direction, t_min: self.t_min.part(origin), t_max: self.t_max.part(origin) }
    }
}

impl<'py> End<'py> {
    /// `rays`: the part that rays of all their numbers begin with.
    pub(crate) fn part<'a>(&'a self, rays: Part<'a>) -> Part<'a> {
        match self {
            Self::Same(t) => Part { numbers: Numbers::Wide(std::slice::from_ref(t)), start: 0, step: 0 },
            Self::Each(floats) => Part { numbers: floats.numbers(), start: 0, step: 1 },
            Self::Column(start) => Part { start: *start, ..rays },
        }
    }

    pub(crate) fn new(given: Option<&Bound<'py, PyAny>>, default: f64, shape: &[usize]) -> PyResult<Self> {
        let Some(given) = given else { return Ok(Self::Same(default)) };
        if let Ok(number) = given.cast::<PyFloat>() {
            return Ok(Self::Same(number.extract()?));
        }
        let floats = Floats::new(given)?;
        if floats.shape().is_empty() {
            return Ok(Self::Same(floats.numbers().get(0)));
        }
        if floats.shape() == shape { Ok(Self::Each(floats)) } else { Floats::repeated(given, shape).map(Self::Each) }
    }
}

/// Points of shape `(..., 3)`.
pub(crate) struct Points<'py> {
    /// The shape of the answers.
    pub(crate) shape: Vec<usize>,
    /// How many points there are.
    pub(crate) count: usize,
    floats: Floats<'py>,
}

impl<'py> Points<'py> {
    pub(crate) fn new(points: &Bound<'py, PyAny>) -> PyResult<Self> {
        let floats = Floats::new(points)?;
        match split(floats.shape()) {
            Some((3, lead)) => Ok(Self { shape: lead.to_vec(), count: lead.iter().product(), floats }),
            _ => Err(error::value(format_args!("points: shape {:?}; (..., 3) is needed", floats.shape()))),
        }
    }

    /// The points, to be read.
    pub(crate) fn part(&self) -> Part<'_> {
        Part { numbers: self.floats.numbers(), start: 0, step: 3 }
    }
}

/// The last dimension, and those before it.
fn split(shape: &[usize]) -> Option<(usize, &[usize])> {
    shape.split_last().map(|(last, lead)| (*last, lead))
}

/// The shape that two are repeated to, as NumPy does.
fn repeated(a: &[usize], b: &[usize]) -> PyResult<Vec<usize>> {
    let dimensions = a.len().max(b.len());
    let at = |shape: &[usize], i: usize| (i + shape.len()).checked_sub(dimensions).map_or(1, |k| shape[k]);
    (0..dimensions)
        .map(|i| match (at(a, i), at(b, i)) {
            (x, y) if x == y || y == 1 => Ok(x),
            (1, y) => Ok(y),
            _ => Err(error::value(format_args!("origins {a:?} and directions {b:?}: the shapes do not fit together"))),
        })
        .collect()
}
