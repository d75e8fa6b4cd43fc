//! Cameras, lights, and what surrounds the scene.

use glam::{DVec3, Vec3};

use super::build::Builder;
use super::place;
use super::schema::{self, Camera, Environment, Fog, Light};
use super::values::{Color, Number, positive, within};
use crate::ImportError;
use crate::scene::{CameraDesc, EnvironmentDesc, FogDesc, LensDesc, LightDesc, LightKind, Projection, SpotRamp};

/// A camera as the file describes it.
pub(super) fn camera(c: &Camera) -> Result<CameraDesc, String> {
    let transform = place::camera(c.origin.0, c.target.0, c.up.map(|up| up.0))?;
    let projection = match (c.vfov_deg, c.orthographic_height) {
        (Some(_), Some(_)) => return Err("give 'vfov_deg' or 'orthographic_height', not both".to_owned()),
        (None, Some(height)) => {
            Projection::Orthographic { half_height: positive("orthographic_height", height)? / 2.0, aspect: None }
        }
        (angle, None) => {
            let degrees = angle.map_or(40.0, |a| a.0);
            if !(degrees > 0.0 && degrees < 180.0) {
                return Err(format!("'vfov_deg' must be between 0 and 180, but is {degrees}"));
            }
            Projection::Perspective { vertical_fov: degrees.to_radians(), aspect: None }
        }
    };
    let lens = match (c.aperture, c.focus_distance) {
        (None, None) => None,
        (aperture, focus) => Some(LensDesc {
            aperture: match aperture.map_or(0.0, |a| a.0) {
                aperture if aperture >= 0.0 => aperture,
                negative => return Err(format!("'aperture' must not be negative, but is {negative}")),
            },
            focus_distance: Some(match focus {
                Some(distance) => positive("focus_distance", distance)?,
                None => (c.target.0 - c.origin.0).length(),
            }),
        }),
    };
    Ok(CameraDesc { name: c.name.clone().unwrap_or_default(), transform, projection, lens, moves_to: None })
}

/// Fog as the file describes it.
pub(super) fn fog(f: &Fog) -> Result<FogDesc, String> {
    let g = f.g.map_or(0.0, |g| g.0);
    if !(-0.99..=0.99).contains(&g) {
        return Err(format!("'g' must be between -0.99 and 0.99, but is {g}"));
    }
    let of = |c: Option<Color>| c.map_or(Vec3::ZERO, |c| c.0);
    let bounds = match (f.min, f.max) {
        (None, None) => None,
        (Some(min), Some(max)) if min.0.cmplt(max.0).all() => Some((min.0, max.0)),
        (Some(_), Some(_)) => return Err("each number of 'min' must be below that of 'max'".to_owned()),
        _ => return Err("give both 'min' and 'max', or neither".to_owned()),
    };
    Ok(FogDesc { scattering: of(f.scattering), absorption: of(f.absorption), g: g as f32, bounds })
}

/// A light as the file describes it.
pub(super) fn light(l: &Light, reference: bool) -> Result<LightDesc, String> {
    let range = |r: Option<Number>| r.map(|r| positive("range", r).map(|r| r as f32)).transpose();
    let kind = match l.kind {
        schema::LightKind::Point { position, intensity, range: r } => {
            LightKind::Point { position: position.0, intensity: intensity.0, range: range(r)? }
        }
        schema::LightKind::Directional { direction, irradiance, angle_deg } => LightKind::Directional {
            direction: place::unit(direction.0).ok_or("'direction' must not be zero")?,
            irradiance: irradiance.0,
            angle: within("angle_deg", angle_deg, 0.0, 0.0, 180.0)?.to_radians(),
        },
        schema::LightKind::Spot { position, target, intensity, inner_deg, outer_deg, range: r } => {
            let inner = within("inner_deg", Some(inner_deg), 0.0, 0.0, 180.0)?.to_radians();
            let outer = within("outer_deg", Some(outer_deg), 0.0, 0.0, 180.0)?.to_radians();
            if inner > outer {
                return Err("'inner_deg' must not be larger than 'outer_deg'".to_owned());
            }
            LightKind::Spot {
                position: position.0,
                direction: towards(position.0, target.0, "position")?,
                intensity: intensity.0,
                inner,
                outer,
                ramp: if reference { SpotRamp::LinearAngle } else { SpotRamp::Gltf },
                range: range(r)?,
            }
        }
        schema::LightKind::Rectangle { center, target, up, width, height, radiance } => {
            let direction = towards(center.0, target.0, "center")?;
            let turn =
                place::facing(direction, up.map(|up| up.0)).ok_or("'up' must not be zero nor point along the light")?;
            let edge_u = turn.x_axis * positive("width", width)?;
            let edge_v = turn.y_axis * positive("height", height)?;
            LightKind::Rectangle { corner: center.0 - (edge_u + edge_v) / 2.0, edge_u, edge_v, radiance: radiance.0 }
        }
        schema::LightKind::Sphere { center, radius, radiance } => {
            LightKind::Sphere { center: center.0, radius: positive("radius", radius)?, radiance: radiance.0 }
        }
    };
    Ok(LightDesc { name: l.name.clone().unwrap_or_default(), kind })
}

fn towards(from: DVec3, target: DVec3, what: &str) -> Result<DVec3, String> {
    place::unit(target - from)
        .ok_or_else(|| format!("'{what}' and 'target' must be different points at a finite distance"))
}

impl Builder<'_> {
    /// What surrounds the scene.
    pub(super) fn environment(&mut self, env: &Environment) -> Result<EnvironmentDesc, ImportError> {
        let radians = |degrees: &Option<Number>| degrees.map_or(0.0, |d| d.0.to_radians() as f32);
        Ok(match env {
            Environment::Constant { radiance } => EnvironmentDesc::Constant { radiance: radiance.0 },
            Environment::Latlong { file, rotation_deg, scale } => EnvironmentDesc::LatLong {
                image: self.image("env", file)?,
                rotation: radians(rotation_deg),
                scale: scale.map_or(Vec3::ONE, |s| s.0),
            },
            Environment::Studio { rotation_deg, scale } => {
                EnvironmentDesc::Studio { rotation: radians(rotation_deg), scale: scale.map_or(Vec3::ONE, |s| s.0) }
            }
        })
    }
}
