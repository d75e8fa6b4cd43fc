//! What scenes are asked about points.

use std::sync::{Arc, PoisonError};

use firsthit_accel::{SignMethod, Solid};
use glam::DVec3;
use numpy::Element;
use pyo3::prelude::*;

use crate::error;
use crate::hits::{ClosestPoints, Found, Values};
use crate::pool::pool;
use crate::rays::{End, Points};
use crate::scene::{CHUNK, Scene, each, in_chunks};

/// How inside is told from outside, by name; `None`: by what is right for the meshes.
fn method(name: &str) -> PyResult<Option<SignMethod>> {
    Ok(Some(match name {
        "auto" => return Ok(None),
        "winding" => SignMethod::Winding,
        "fast_winding" => SignMethod::FastWinding { accuracy: 2.0 },
        "parity" => SignMethod::Parity { votes: 1 },
        "pseudonormal" => SignMethod::Pseudonormal,
        "exact" => SignMethod::Exact,
        other => {
            let names = "auto, winding, fast_winding, parity, pseudonormal or exact";
            return Err(error::value(format_args!("unknown sign '{other}' ({names})")));
        }
    }))
}

/// The surface of a body; made when it is first asked for.
pub(crate) fn solid(scene: &Scene, py: Python<'_>, sign: &str, threads: usize) -> PyResult<Arc<Solid>> {
    let method = method(sign)?;
    // It is locked only for a look, never while Python may be let go.
    let known = || {
        let solids = scene.solids.lock().unwrap_or_else(PoisonError::into_inner);
        solids.iter().find(|(m, _)| *m == method).map(|(_, solid)| solid.clone())
    };
    if let Some(solid) = known() {
        return Ok(solid);
    }
    let pool = pool(threads)?;
    let trees = scene.trees();
    let solid = py.detach(|| {
        pool.install(|| match method {
            Some(method) => Solid::with_method(trees, method),
            None => Solid::new(trees),
        })
    });
    let solid = Arc::new(solid);
    scene.solids.lock().unwrap_or_else(PoisonError::into_inner).push((method, solid.clone()));
    Ok(solid)
}

pub(crate) fn closest(
    scene: &Scene,
    py: Python<'_>,
    points: &Bound<'_, PyAny>,
    radius: Option<&Bound<'_, PyAny>>,
    threads: usize,
) -> PyResult<ClosestPoints> {
    let points = Points::new(points)?;
    let radius = End::new(radius, f64::INFINITY, &points.shape)?;
    let part = points.part();
    let radii = radius.part(part);
    let mut found = Found::zeroed(points.count);
    let mut places = Values::all([0.0; 3], points.count);
    if points.count == 1 {
        let near = scene.trees().closest_point_within(part.vector(0), radii.number(0, 0));
        found.slots().set_nearest(0, near.as_ref(), &mut places[0]);
        return Ok(ClosestPoints::new(points.shape, found, places));
    }
    let parts = found.slots().chunks(CHUNK).into_iter().zip(places.chunks_mut(CHUNK)).collect();
    let item = |i| (part.vector(i), radii.number(i, 0));
    in_chunks(py, (points.count, item), threads, parts, |asked, (mut slots, places)| {
        // Those with one radius are asked together: one that is near the last is answered sooner.
        let mut done = 0;
        for same in asked.chunk_by(|a, b| a.1 == b.1) {
            let points: Vec<DVec3> = same.iter().map(|asked| asked.0).collect();
            let mut nearest = vec![None; points.len()];
            scene.trees().closest_points(&points, same[0].1, &mut nearest);
            for near in &nearest {
                slots.set_nearest(done, near.as_ref(), &mut places[done]);
                done += 1;
            }
        }
    })?;
    Ok(ClosestPoints::new(points.shape, found, places))
}

pub(crate) fn furthest(
    scene: &Scene,
    py: Python<'_>,
    points: &Bound<'_, PyAny>,
    threads: usize,
) -> PyResult<ClosestPoints> {
    let points = Points::new(points)?;
    let part = points.part();
    let mut found = Found::zeroed(points.count);
    let mut places = Values::all([0.0; 3], points.count);
    let parts = found.slots().chunks(CHUNK).into_iter().zip(places.chunks_mut(CHUNK)).collect();
    in_chunks(py, (points.count, |i| part.vector(i)), threads, parts, |points, (mut slots, places)| {
        let mut furthest = vec![None; points.len()];
        scene.trees().furthest_points(points, &mut furthest);
        for (i, (far, place)) in furthest.iter().zip(places).enumerate() {
            slots.set_nearest(i, far.as_ref(), place);
        }
    })?;
    Ok(ClosestPoints::new(points.shape, found, places))
}

pub(crate) fn distance<'py>(
    scene: &Scene,
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let points = Points::new(points)?;
    let part = points.part();
    let answer = |points: &[DVec3], distances: &mut [f64]| scene.trees().distances(points, distances);
    each(py, &points.shape, |i| part.vector(i), threads, answer)
}

pub(crate) fn signed_distance<'py>(
    scene: &Scene,
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    sign: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    of_solid(scene, py, points, sign, threads, Solid::signed_distances)
}

pub(crate) fn contains<'py>(
    scene: &Scene,
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    sign: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    of_solid(scene, py, points, sign, threads, Solid::contains_each)
}

pub(crate) fn winding_number<'py>(
    scene: &Scene,
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    sign: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    of_solid(scene, py, points, sign, threads, |solid: &Solid, points: &[DVec3], numbers: &mut [f64]| {
        points.iter().zip(numbers).for_each(|(point, number)| *number = solid.winding_number(*point));
    })
}

/// What the body answers for each point.
fn of_solid<'py, T: Element + Copy + Default + Send>(
    scene: &Scene,
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    sign: &str,
    threads: usize,
    answer: impl Fn(&Solid, &[DVec3], &mut [T]) + Sync,
) -> PyResult<Bound<'py, PyAny>> {
    let points = Points::new(points)?;
    let solid = solid(scene, py, sign, threads)?;
    let part = points.part();
    each(
        py,
        &points.shape,
        |i| part.vector(i),
        threads,
        |points: &[DVec3], answers: &mut [T]| {
            answer(&solid, points, answers);
        },
    )
}
