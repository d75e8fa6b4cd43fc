//! Cameras and the lights of KHR_lights_punctual, put into the world.

use std::f32::consts::FRAC_PI_2;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type as LightType};
use gltf::json::validation::Checked;

use super::source::Source;
use crate::scene::{CameraDesc, LightDesc, LightKind, Projection, SpotRamp};
use crate::{ImportError, Report};

/// The camera of a node; `None`, with a warning, if its numbers make no picture.
///
/// # Errors
/// If the camera does not have the lens that it says.
pub(super) fn camera(
    source: &Source<'_>,
    node: usize,
    world: &DAffine3,
    report: &mut Report,
) -> Result<Option<CameraDesc>, ImportError> {
    let json = &source.root.nodes[node];
    let Some(index) = json.camera.map(|c| c.value()) else { return Ok(None) };
    let camera = &source.root.cameras[index];
    let place = format!("/cameras/{index}");
    let positive = |x: f64| x > 0.0 && x.is_finite();
    let projection = match (camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(lens), _) => {
            let aspect = lens.aspect_ratio.map(f64::from).filter(|&a| positive(a));
            let vertical_fov = f64::from(lens.yfov);
            (positive(vertical_fov) && vertical_fov < std::f64::consts::PI)
                .then_some(Projection::Perspective { vertical_fov, aspect })
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(lens)) => {
            // A negative magnification would flip the picture; exporters that write one do not mean it.
            let (x, y) = (f64::from(lens.xmag).abs(), f64::from(lens.ymag).abs());
            let aspect = Some(x / y).filter(|&a| positive(a));
            positive(y).then_some(Projection::Orthographic { half_height: y, aspect })
        }
        (Checked::Invalid, _, _) => {
            return Err(source.invalid(place + "/type", "expected \"perspective\" or \"orthographic\""));
        }
        _ => return Err(source.invalid(place, "has no property named like its type")),
    };
    let name = json.name.clone().or_else(|| camera.name.clone()).unwrap_or_else(|| format!("camera {index}"));
    match (projection, upright(world)) {
        (Some(projection), Some(transform)) => {
            Ok(Some(CameraDesc { name, transform, projection, lens: None, moves_to: None }))
        }
        _ => {
            report.warn(source.file, place, "its lens or its node's transform makes no picture: left out");
            Ok(None)
        }
    }
}

/// The place and direction of a node without its scale: a camera looks along -Z with +Y up.
fn upright(world: &DAffine3) -> Option<DAffine3> {
    let matrix: DMat3 = world.matrix3;
    let z = matrix.z_axis.try_normalize()?;
    let x = matrix.y_axis.cross(z).try_normalize()?;
    let rotation = DMat3::from_cols(x, z.cross(x), z);
    world.translation.is_finite().then(|| DAffine3::from_mat3_translation(rotation, world.translation))
}

/// The light of a node.
///
/// Candela and lux are taken as W/sr and W/m² one to one: a picture is exposed by its own measure anyway.
///
/// # Errors
/// If the light is of no known type.
pub(super) fn light(
    source: &Source<'_>,
    node: usize,
    world: &DAffine3,
    report: &mut Report,
) -> Result<Option<LightDesc>, ImportError> {
    let json = &source.root.nodes[node];
    let extension = json.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let lights = source.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let (Some(extension), Some(lights)) = (extension, lights) else { return Ok(None) };
    let index = extension.light.value();
    let light = &lights.lights[index];
    let place = format!("/extensions/KHR_lights_punctual/lights/{index}");

    let mut warn = |key: &str, message: String| report.warn(source.file, format!("{place}/{key}"), message);
    let color = Vec3::from(light.color).clamp(Vec3::ZERO, Vec3::MAX);
    let mut intensity = light.intensity;
    if !(intensity >= 0.0 && intensity.is_finite()) {
        warn("intensity", format!("{intensity} is not from 0 upwards: taken as 0"));
        intensity = 0.0;
    }
    let intensity = color * intensity;
    let position = world.translation;
    // A node without a direction of its own is taken as unturned.
    let matrix: DMat3 = world.matrix3;
    let direction = (-matrix.z_axis).try_normalize().unwrap_or(DVec3::NEG_Z);
    let range = light.range.filter(|r| r.is_finite()).filter(|&r| {
        let sensible = r > 0.0;
        if !sensible {
            warn("range", format!("{r} is not above 0: taken as endless"));
        }
        sensible
    });
    let Checked::Valid(kind) = light.type_ else {
        return Err(source.invalid(place + "/type", "expected \"directional\", \"point\" or \"spot\""));
    };
    let kind = match kind {
        LightType::Directional => LightKind::Directional { direction, irradiance: intensity, angle: 0.0 },
        LightType::Point => LightKind::Point { position, intensity, range },
        LightType::Spot => {
            let Some((inner, outer)) = cone(light, &mut warn) else {
                return Err(source.invalid(place + "/spot", "a spot light must have this"));
            };
            LightKind::Spot { position, direction, intensity, inner, outer, ramp: SpotRamp::Gltf, range }
        }
    };
    let name = json.name.clone().or_else(|| light.name.clone()).unwrap_or_else(|| format!("light {index}"));
    Ok(Some(LightDesc { name, kind }))
}

/// Half angles of a spot light, within 0 <= inner < outer <= pi/2.
fn cone(light: &Light, warn: &mut impl FnMut(&str, String)) -> Option<(f32, f32)> {
    let spot = light.spot.as_ref()?;
    let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
    if inner >= 0.0 && inner < outer && outer <= FRAC_PI_2 {
        return Some((inner, outer));
    }
    let wider = if outer > 0.0 { outer.min(FRAC_PI_2) } else { std::f32::consts::FRAC_PI_4 };
    let narrower = if inner >= 0.0 { inner.min(wider * 0.999) } else { 0.0 };
    warn(
        "spot",
        format!("angles {inner} and {outer} are taken as {narrower} and {wider}: expected 0 <= inner < outer <= pi/2"),
    );
    Some((narrower, wider))
}
