//! Pictures as arrays.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_render::{
    Aov, Background, CameraChoice, IntegratorChoice, RenderOptions, Stage, StageOptions, View, ViewTransform,
};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error;
use crate::pool::pool;
use crate::scene::{Scene, Source};

fn integrator(name: &str) -> PyResult<IntegratorChoice> {
    Ok(match name {
        "auto" => IntegratorChoice::Auto,
        "path" => IntegratorChoice::Path,
        "light" => IntegratorChoice::Light,
        "whitted" => IntegratorChoice::Whitted,
        "direct" => IntegratorChoice::Direct,
        "ao" => IntegratorChoice::AmbientOcclusion,
        other => match other.parse::<Aov>() {
            Ok(aov) if aov.is_sampled() => IntegratorChoice::Aov(aov),
            _ => return Err(error::value(format_args!("unknown integrator '{other}'"))),
        },
    })
}

/// Renders a scene or a model; see `_firsthit.pyi`.
#[pyfunction]
#[pyo3(signature = (scene, *, width=1280, height=720, samples=16, noise_threshold=None, time_limit=None, seed=0,
    integrator="auto", camera=None, position=None, focal_point=None, view_up=None, view_angle=None,
    orthographic=false, transparent=false, exposure=0.0, tone_mapping="pbr-neutral", linear=false, threads=0))]
pub fn render<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    width: u32,
    height: u32,
    samples: u32,
    noise_threshold: Option<f32>,
    time_limit: Option<f64>,
    seed: u64,
    integrator: &str,
    camera: Option<String>,
    position: Option<[f64; 3]>,
    focal_point: Option<[f64; 3]>,
    view_up: Option<[f64; 3]>,
    view_angle: Option<f64>,
    orthographic: bool,
    transparent: bool,
    exposure: f32,
    tone_mapping: &str,
    linear: bool,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (source, mask, precision) = match scene.cast::<Scene>() {
        Ok(scene) => (scene.get().source.clone(), scene.get().mask, scene.get().options().precision),
        Err(_) => match scene.extract::<PathBuf>() {
            Ok(path) => (Source::File { path, up: None, variant: None }, u32::MAX, Precision::default()),
            Err(_) => return Err(PyTypeError::new_err("a Scene or the path of a model is needed")),
        },
    };
    let transform: ViewTransform = tone_mapping.parse().map_err(error::value)?;
    let time_limit = time_limit.map(Duration::try_from_secs_f64).transpose().map_err(error::value)?;
    let options = RenderOptions {
        width,
        height,
        spp: samples,
        noise_threshold,
        time_limit,
        seed,
        integrator: self::integrator(integrator)?,
        ..RenderOptions::default()
    };
    options.check().map_err(error::value)?;
    let mut stage_options = StageOptions {
        background: if transparent { Background::Transparent } else { Background::Auto },
        camera: camera.map_or(CameraChoice::Auto, CameraChoice::Named),
        aspect: f64::from(width) / f64::from(height),
        ..StageOptions::default()
    };
    let changes = &mut stage_options.camera_changes;
    changes.position = position.map(DVec3::from);
    changes.focal_point = focal_point.map(DVec3::from);
    changes.view_up = view_up.map(DVec3::from);
    changes.view_angle = view_angle.map(f64::to_radians);
    changes.orthographic = orthographic;

    let pool = pool(threads)?;
    let work = || {
        let (desc, _) = source.read(mask)?;
        let build = BuildOptions { precision, ..BuildOptions::default() };
        let trees = SceneBuilder::from_desc(&desc, build).build().map_err(error::value)?;
        let stage = Stage::new(Arc::new(desc), trees, &stage_options).map_err(error::value)?;
        PyResult::Ok(stage)
    };
    let stop = AtomicBool::new(false);
    let rendered = py.detach(|| {
        std::thread::scope(|scope| {
            let rendering = scope.spawn(|| {
                pool.install(|| {
                    let stage = work()?;
                    firsthit_render::render(&stage, &options, &stop).map_err(error::value)
                })
            });
            // Ctrl-C is seen here, and ends the render.
            let mut signal = Ok(());
            while !rendering.is_finished() {
                std::thread::sleep(Duration::from_millis(5));
                if signal.is_ok() {
                    signal = Python::attach(|py| py.check_signals());
                    stop.store(signal.is_err(), Ordering::Relaxed);
                }
            }
            let rendered = rendering.join();
            signal?;
            rendered.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    })?;

    let picture = rendered.film.color();
    let shape = [picture.height as usize, picture.width as usize, 4];
    if linear {
        return Ok(PyArray1::from_vec(py, picture.pixels.into_flattened()).reshape(shape)?.into_any());
    }
    let view = View { transform, exposure, backdrop: None };
    let bytes: Vec<u8> = picture.shown(&view).flatten().map(|x| (x * 255.0 + 0.5) as u8).collect();
    Ok(PyArray1::from_vec(py, bytes).reshape(shape)?.into_any())
}
