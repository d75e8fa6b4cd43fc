//! Lights without extent: points, spots, and light from one direction.

use std::f32::consts::PI;

use firsthit_import::scene::{LightKind, SpotRamp};
use glam::{DVec3, Vec3};

use super::environment::luminance;
use super::tree::LightBounds;
use super::{LightEnd, LightSample};
use crate::{EffectSet, tally, warp};

/// A light that a ray cannot hit.
#[derive(Clone, Debug)]
pub(crate) enum PunctualLight {
    /// From a point, perhaps within a cone.
    Point { position: DVec3, intensity: Vec3, range: Option<f32>, cone: Option<Cone> },
    /// From a direction.
    Directional { towards: Vec3, irradiance: Vec3, one_minus_cos: f32 },
    /// At the camera: falls off more gently than a real light, so that near and far are both seen.
    /// Where the light that surfaces send to each other is followed, only a `share` is sent.
    Headlight { position: DVec3, irradiance: f32, distance: f64, share: f32 },
}

/// Where a spot light shines.
#[derive(Clone, Debug)]
pub(crate) struct Cone {
    axis: Vec3,
    inner: f32,
    outer: f32,
    ramp: SpotRamp,
}

impl Cone {
    /// Share of the intensity in a direction from the light.
    fn factor(&self, direction: Vec3) -> f32 {
        let cos = self.axis.dot(direction).clamp(-1.0, 1.0);
        match self.ramp {
            // KHR_lights_punctual, "Inner and outer cone angles".
            SpotRamp::Gltf => {
                let scale = 1.0 / (self.inner.cos() - self.outer.cos()).max(0.001);
                let t = ((cos - self.outer.cos()) * scale).clamp(0.0, 1.0);
                t * t
            }
            SpotRamp::LinearAngle => {
                let angle = cos.acos();
                if angle <= self.inner {
                    1.0
                } else if angle >= self.outer {
                    0.0
                } else {
                    (self.outer - angle) / (self.outer - self.inner)
                }
            }
        }
    }
}

impl PunctualLight {
    /// `None` for lights that are surfaces.
    pub(crate) fn new(kind: &LightKind) -> Option<Self> {
        match *kind {
            LightKind::Point { position, intensity, range } => {
                Some(Self::Point { position, intensity, range, cone: None })
            }
            LightKind::Spot { position, direction, intensity, inner, outer, ramp, range } => Some(Self::Point {
                position,
                intensity,
                range,
                cone: Some(Cone { axis: direction.as_vec3().normalize_or(Vec3::NEG_Z), inner, outer, ramp }),
            }),
            LightKind::Directional { direction, irradiance, angle } => Some(Self::Directional {
                towards: -direction.as_vec3().normalize_or(Vec3::NEG_Y),
                irradiance,
                // 1 - cos without cancellation.
                one_minus_cos: 2.0 * (0.25 * angle).sin().powi(2),
            }),
            LightKind::Rectangle { .. } | LightKind::Sphere { .. } => None,
        }
    }

    /// Where it is and shines, if it has a place.
    pub(crate) fn bounds(&self) -> Option<LightBounds> {
        let Self::Point { position, intensity, cone, .. } = self else { return None };
        let (axis, cos_facing, cos_shining) = match cone {
            None => (Vec3::Z, -1.0, 0.0),
            // As bright as in the middle up to the inner angle, then less and less.
            Some(c) => (c.axis, c.inner.cos(), (c.outer - c.inner).max(1e-3).cos()),
        };
        let strength = luminance(*intensity);
        Some(LightBounds {
            min: *position,
            max: *position,
            strength: if strength.is_finite() { strength } else { 0.0 },
            axis,
            cos_facing,
            cos_shining,
            both_sides: false,
        })
    }

    /// Of lights without a place: the direction towards it, the irradiance on what faces it, and the sine of half the
    /// angle under which it is seen.
    pub(crate) fn afar(&self, point: DVec3) -> Option<(Vec3, f32, f32)> {
        let spread = match self {
            Self::Point { .. } => return None,
            Self::Directional { one_minus_cos, .. } => (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt(),
            Self::Headlight { .. } => 0.0,
        };
        // The middle of its disk.
        let sample = self.sample(point, [0.0; 2])?;
        Some((sample.direction, luminance(sample.radiance), spread))
    }

    /// About the light that it sends in all directions, where the whole scene is a ball of this radius.
    pub(crate) fn power(&self, radius: f64) -> f32 {
        let power = match self {
            Self::Point { intensity, .. } => luminance(*intensity) * 2.0 * PI * self.one_minus_cos(),
            Self::Directional { irradiance, .. } => luminance(*irradiance) * PI * (radius * radius) as f32,
            Self::Headlight { irradiance, distance, .. } => irradiance * 4.0 * PI * (distance * distance) as f32,
        };
        if power.is_finite() { power } else { 0.0 }
    }

    /// Where it has a place: that, and the direction of some light from there, evenly over all that it lights, which
    /// is [`PunctualLight::solid_angle`].
    pub(crate) fn leaving(&self, u: [f32; 2]) -> Option<(DVec3, Vec3)> {
        match self {
            Self::Point { position, cone, .. } => {
                let axis = cone.as_ref().map_or(Vec3::Z, |c| c.axis);
                let (x, y) = warp::frame(axis);
                let w = warp::cone(u, self.one_minus_cos());
                Some((*position, x * w.x + y * w.y + axis * w.z))
            }
            Self::Headlight { position, .. } => Some((*position, warp::sphere(u))),
            Self::Directional { .. } => None,
        }
    }

    /// Of the directions in which it shines.
    pub(crate) fn solid_angle(&self) -> f32 {
        2.0 * PI * self.one_minus_cos()
    }

    /// 1 - cos of the angle up to which it shines.
    fn one_minus_cos(&self) -> f32 {
        match self {
            // Without cancellation.
            Self::Point { cone: Some(cone), .. } => 2.0 * (0.5 * cone.outer.clamp(1e-4, PI)).sin().powi(2),
            _ => 2.0,
        }
    }

    /// As [`PunctualLight::sample`], where the light that surfaces send to each other is followed.
    pub(crate) fn sample_followed(&self, point: DVec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.sample(point, u)?;
        match self {
            Self::Headlight { share, .. } => Some(LightSample { radiance: sample.radiance * *share, ..sample }),
            Self::Point { .. } | Self::Directional { .. } => Some(sample),
        }
    }

    /// Light that arrives at a point. `radiance` is the irradiance on a surface that faces the light.
    pub(crate) fn sample(&self, point: DVec3, u: [f32; 2]) -> Option<LightSample> {
        tally::sample(EffectSet::PUNCTUAL_LIGHTS);
        let (direction, radiance, end) = match self {
            Self::Point { position, intensity, range, cone } => {
                let to = *position - point;
                let distance = to.length();
                let direction = (to / distance).as_vec3();
                let mut value = *intensity * (1.0 / (distance * distance)) as f32;
                if let Some(range) = range {
                    // KHR_lights_punctual, "Range property".
                    let x = (distance / f64::from(*range)).powi(4);
                    value *= (1.0 - x).clamp(0.0, 1.0) as f32;
                }
                if let Some(cone) = cone {
                    value *= cone.factor(-direction);
                }
                (direction, value, LightEnd::At(*position))
            }
            Self::Directional { towards, irradiance, one_minus_cos } => {
                let direction = if *one_minus_cos > 0.0 {
                    let (x, y) = warp::frame(*towards);
                    let w = warp::cone(u, *one_minus_cos);
                    x * w.x + y * w.y + *towards * w.z
                } else {
                    *towards
                };
                (direction, *irradiance, LightEnd::Infinity)
            }
            Self::Headlight { position, irradiance, distance, .. } => {
                let to = *position - point;
                let d = to.length();
                let x = d / distance;
                let value = Vec3::splat(irradiance * (2.0 / (1.0 + x)) as f32);
                ((to / d).as_vec3(), value, LightEnd::At(*position))
            }
        };
        let usable = direction.is_finite() && radiance.is_finite() && radiance.max_element() > 0.0;
        usable.then_some(LightSample { direction, radiance, pdf: None, end, target: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(ramp: SpotRamp) -> PunctualLight {
        PunctualLight::new(&LightKind::Spot {
            position: DVec3::new(0.0, 2.0, 0.0),
            direction: DVec3::NEG_Y,
            intensity: Vec3::splat(4.0),
            inner: 0.2,
            outer: 0.4,
            ramp,
            range: None,
        })
        .unwrap()
    }

    fn at(light: &PunctualLight, point: DVec3) -> f32 {
        light.sample(point, [0.5; 2]).map_or(0.0, |s| s.radiance.x)
    }

    #[test]
    fn falls_off_with_the_square_of_the_distance() {
        let light = PunctualLight::Point {
            position: DVec3::new(1e7, 0.0, 3.0),
            intensity: Vec3::splat(18.0),
            range: None,
            cone: None,
        };
        assert!((at(&light, DVec3::new(1e7, 0.0, 0.0)) - 2.0).abs() < 1e-6);
    }

    #[test]
    fn range_cuts_the_light_off() {
        let light = |range| PunctualLight::Point {
            position: DVec3::ZERO,
            intensity: Vec3::ONE,
            range: Some(range),
            cone: None,
        };
        assert!((at(&light(2.0), DVec3::X) - 15.0 / 16.0).abs() < 1e-6);
        assert_eq!(at(&light(1.0), DVec3::X), 0.0);
    }

    #[test]
    fn a_spot_is_full_inside_and_ramps_to_nothing() {
        for ramp in [SpotRamp::Gltf, SpotRamp::LinearAngle] {
            let light = spot(ramp);
            assert!((at(&light, DVec3::ZERO) - 1.0).abs() < 1e-6);
            let off_axis = |angle: f64| DVec3::new(2.0 * angle.tan(), 0.0, 0.0);
            assert!(at(&light, off_axis(0.41)) == 0.0);
            let distance2 = 4.0 + off_axis(0.3).length_squared() as f32;
            let factor = at(&light, off_axis(0.3)) * distance2 / 4.0;
            let expected = match ramp {
                SpotRamp::LinearAngle => 0.5,
                SpotRamp::Gltf => {
                    let t = (0.3f32.cos() - 0.4f32.cos()) / (0.2f32.cos() - 0.4f32.cos());
                    t * t
                }
            };
            assert!((factor - expected).abs() < 1e-4, "{ramp:?}: {factor} instead of {expected}");
        }
    }

    #[test]
    fn a_sun_with_an_angle_stays_within_its_disk() {
        let light =
            PunctualLight::new(&LightKind::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::ONE, angle: 0.1 })
                .unwrap();
        for k in 0..100 {
            let u = [k as f32 / 100.0, (k * 37 % 100) as f32 / 100.0];
            let s = light.sample(DVec3::ZERO, u).unwrap();
            assert!(s.direction.y.clamp(-1.0, 1.0).acos() <= 0.05 + 1e-3);
        }
    }
}
