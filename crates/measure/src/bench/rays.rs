//! Ray sets of a measurement of speed.

use core::fmt;
use core::str::FromStr;

use firsthit_accel::{BuildError, BuildOptions, SceneBuilder};
use firsthit_geometry::Ray;
use firsthit_render::framing::frame;
use glam::DVec3;

use super::BenchOptions;
use crate::random::Rng;
use crate::subject::Subject;

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BenchRays {
    /// From the camera that `render` would choose: the closest hit.
    Primary,
    /// From what the camera sees to a light over its right shoulder: any hit.
    Shadow,
    /// From there as a matt surface scatters, as long as 10 % of the model's diagonal: any hit.
    Ao,
    /// The same without end: the closest hit.
    Diffuse,
    /// From anywhere in the model's box in any direction: the closest hit.
    Random,
}

impl BenchRays {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Primary, Self::Shadow, Self::Ao, Self::Diffuse, Self::Random];

    /// The name on command lines and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Ao => "ao",
            Self::Diffuse => "diffuse",
            Self::Random => "random",
        }
    }

    /// Whether only the existence of a hit is asked for.
    #[must_use]
    pub const fn any(self) -> bool {
        matches!(self, Self::Shadow | Self::Ao)
    }
}

impl fmt::Display for BenchRays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for BenchRays {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let unknown = || format!("unknown rays '{s}' (primary, shadow, ao, diffuse or random)");
        Self::ALL.into_iter().find(|k| k.name() == s).ok_or_else(unknown)
    }
}

/// Rays of one kind.
pub(super) struct Set {
    pub(super) kind: BenchRays,
    pub(super) rays: Vec<Ray<f64>>,
}

/// Rays leave surfaces by this share of the model's diagonal: so far that engines in single precision do not meet the
/// surface again.
const LEAVE: f64 = 1e-4;

/// Makes the ray sets of a model. What the camera sees is asked of a scene of default options.
pub(super) fn ray_sets(subject: &Subject, options: &BenchOptions) -> Result<Vec<Set>, BuildError> {
    let scene = SceneBuilder::from_desc(&subject.desc, BuildOptions::default()).build()?;
    let bounds = scene.bounds();
    let (center, diagonal) = (bounds.center(), bounds.extent().length());
    let camera = frame(&subject.desc, &scene, 1.0).camera;
    // A square picture of no more pixels than rays; more rays go around again.
    let side = options.count.isqrt().max(1) as u32;
    let film = camera.on_film(side, side);
    let mut rng = Rng(options.seed);
    let primary: Vec<Ray<f64>> = (0..options.count)
        .map(|k| {
            let pixel = (k % (side * side) as usize) as u32;
            film.ray([f64::from(pixel % side) + rng.unit(), f64::from(pixel / side) + rng.unit()])
        })
        .collect();
    let mut hits = vec![None; primary.len()];
    scene.par_closest_hits(&primary, &mut hits);
    let seen: Vec<(DVec3, DVec3)> = primary
        .iter()
        .zip(&hits)
        .filter_map(|(ray, hit)| {
            let hit = hit.as_ref()?;
            let facing = hit.normal_against(ray.direction);
            (facing != DVec3::ZERO).then(|| (ray.at(hit.t) + facing * (LEAVE * diagonal), facing))
        })
        .collect();
    let light = camera.position() + (camera.right() + camera.up()) * (0.5 * diagonal);

    let make = |&kind: &BenchRays| {
        // Each kind has its own stream, so that leaving one out changes no other.
        let mut rng = Rng(options.seed ^ (kind as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let around = seen.iter().cycle().take(if seen.is_empty() { 0 } else { options.count });
        let mut scatter = |facing: DVec3| (facing * (1.0 + 1e-9) + rng.direction()).normalize();
        let rays = match kind {
            BenchRays::Primary => primary.clone(),
            BenchRays::Shadow => around.map(|&(point, _)| Ray::segment(point, light)).collect(),
            BenchRays::Ao => around
                .map(|&(point, facing)| Ray::new(point, scatter(facing)).with_interval(0.0, 0.1 * diagonal))
                .collect(),
            BenchRays::Diffuse => around.map(|&(point, facing)| Ray::new(point, scatter(facing))).collect(),
            BenchRays::Random => {
                let half = bounds.extent() * 0.5;
                (0..options.count).map(|_| Ray::new(center + rng.in_cube() * half, rng.direction())).collect()
            }
        };
        Set { kind, rays }
    };
    Ok(options.rays.iter().map(make).collect())
}
