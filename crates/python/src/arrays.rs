//! Arrays from Python: anything that NumPy takes, looked at in place where it can be.

use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::error;

/// Floats, one row after the other.
pub(crate) enum Floats<'py> {
    Narrow(PyReadonlyArrayDyn<'py, f32>),
    Wide(PyReadonlyArrayDyn<'py, f64>),
}

/// [`Floats`] while they are read.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Numbers<'a> {
    Narrow(&'a [f32]),
    Wide(&'a [f64]),
}

impl Numbers<'_> {
    #[inline(always)]
    pub(crate) fn get(self, i: usize) -> f64 {
        match self {
            Self::Narrow(numbers) => numbers[i].into(),
            Self::Wide(numbers) => numbers[i],
        }
    }
}

impl<'py> Floats<'py> {
    /// An array, or what can be made one. Only what is not of floats, or not in order, is copied.
    pub(crate) fn new(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Some(floats) = Self::in_place(object) {
            return Ok(floats);
        }
        let array = required(object, "float64")?;
        Self::in_place(&array).ok_or_else(|| error::value("this is no array of numbers"))
    }

    fn in_place(object: &Bound<'py, PyAny>) -> Option<Self> {
        if let Ok(array) = object.cast::<PyArrayDyn<f64>>() {
            return Some(Self::Wide(array.try_readonly().ok()?)).filter(Self::is_in_order);
        }
        let array = object.cast::<PyArrayDyn<f32>>().ok()?;
        Some(Self::Narrow(array.try_readonly().ok()?)).filter(Self::is_in_order)
    }

    fn is_in_order(&self) -> bool {
        match self {
            Self::Narrow(array) => array.is_aligned() && array.is_c_contiguous(),
            Self::Wide(array) => array.is_aligned() && array.is_c_contiguous(),
        }
    }

    pub(crate) fn shape(&self) -> &[usize] {
        match self {
            Self::Narrow(array) => array.shape(),
            Self::Wide(array) => array.shape(),
        }
    }

    /// The numbers. (It was made sure that they are in order.)
    pub(crate) fn numbers(&self) -> Numbers<'_> {
        match self {
            Self::Narrow(array) => Numbers::Narrow(array.as_slice().unwrap_or_default()),
            Self::Wide(array) => Numbers::Wide(array.as_slice().unwrap_or_default()),
        }
    }

    /// The same numbers, repeated until they have this shape.
    pub(crate) fn repeated(object: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Self> {
        let py = object.py();
        let repeated = module(py)?.call_method1("broadcast_to", (object, shape.to_vec()))?;
        Self::new(&repeated)
    }
}

/// Triangles from an array of integers of shape `(n, 3)`.
///
/// # Errors
/// When it is something else, or an index cannot be one.
pub(crate) fn triangles(object: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let py = object.py();
    let array = module(py)?.call_method1("asarray", (object,))?;
    let dtype = array.getattr("dtype")?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    // An empty list is of floats.
    let empty = shape.contains(&0);
    if shape != [0] && (shape.len() != 2 || shape[1] != 3) {
        return Err(error::value(format_args!("triangles: shape {shape:?}; (n, 3) is needed")));
    }
    if kind != "i" && kind != "u" && !empty {
        return Err(error::value(format_args!("triangles: {dtype} is no type of integers")));
    }
    if let Ok(indices) = array.cast::<PyArrayDyn<u32>>()
        && indices.is_c_contiguous()
        && indices.is_aligned()
        && let Ok(indices) = indices.try_readonly()
    {
        return Ok(indices.as_slice().map_err(error::value)?.as_chunks::<3>().0.to_vec());
    }
    let array = required(&array, "int64")?;
    let indices = array.cast::<PyArrayDyn<i64>>().map_err(PyErr::from)?.try_readonly().map_err(error::value)?;
    let indices = indices.as_slice().map_err(error::value)?.as_chunks::<3>().0;
    let index = |triangle: usize, index: i64| {
        u32::try_from(index)
            .map_err(|_| error::value(format_args!("triangles: triangle {triangle}: vertex {index} does not exist")))
    };
    indices.iter().enumerate().map(|(i, &[a, b, c])| Ok([index(i, a)?, index(i, b)?, index(i, c)?])).collect()
}

/// The module `numpy`.
pub(crate) fn module(py: Python<'_>) -> PyResult<&Bound<'_, PyAny>> {
    static NUMPY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    Ok(NUMPY.get_or_try_init(py, || py.import("numpy").map(|m| m.into_any().unbind()))?.bind(py))
}

/// An array in order and aligned, as fields of packed records need not be: `numpy.require(object, dtype, ["C", "A"])`.
fn required<'py>(object: &Bound<'py, PyAny>, dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    module(object.py())?.call_method1("require", (object, dtype, ["C", "A"]))
}
