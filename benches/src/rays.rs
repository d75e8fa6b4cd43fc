//! The rays that engines race on: one recipe for every model, all in single precision, directions of length 1.

use std::fmt;
use std::str::FromStr;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::model::Model;
use crate::peer::Ray32;
use crate::random::Pcg;
use crate::reference::{Reference, Truth};

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A camera's rays, jittered within pixels, in Morton order; the closest hit is asked for.
    Primary,
    /// From what the camera sees to a light of 1 % of the model's size; any hit.
    Shadow,
    /// From there over the hemisphere (by the cosine), as long as 10 % of the model's diagonal; any hit.
    Ao,
    /// The same without end; the closest hit.
    Diffuse,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Ao, Self::Diffuse];

    /// The name on the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Ao => "ao",
            Self::Diffuse => "diffuse",
        }
    }

    /// Whether only the existence of a hit is asked for.
    #[must_use]
    pub const fn any(self) -> bool {
        matches!(self, Self::Shadow | Self::Ao)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Kind {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let unknown = || format!("unknown rays '{s}' (primary, shadow, ao or diffuse)");
        Self::ALL.into_iter().find(|k| k.name() == s).ok_or_else(unknown)
    }
}

/// Rays with what is right.
pub struct RaySet {
    /// Their kind.
    pub kind: Kind,
    /// The rays.
    pub rays: Vec<Ray32>,
    /// For each its closest hit, or any where that is what is asked for.
    pub truth: Vec<Option<Truth>>,
}

/// Rays of the camera's width and height; the square is how many rays a set has, unless told otherwise.
pub const PICTURE: usize = 1024;

/// Makes `count` rays of each kind.
///
/// # Errors
/// When the camera sees nothing of the model.
pub fn ray_sets(model: &Model, reference: &Reference<'_>, kinds: &[Kind], count: usize) -> Result<Vec<RaySet>, String> {
    let mut random = Pcg::new(1);
    let (light, diagonal) = (model.view().light, model.diagonal());
    let primary = primary(model, count, &mut random);
    let truth = answers(reference, &primary, Kind::Primary);
    let seen: Vec<(Vec3, Vec3)> =
        primary.iter().zip(&truth).filter_map(|(ray, hit)| hit.map(|hit| leave(model, diagonal, ray, &hit))).collect();
    if seen.is_empty() {
        return Err(format!("{}: the camera sees nothing of it", model.name));
    }
    let mut sets = vec![RaySet { kind: Kind::Primary, rays: primary, truth }];
    for kind in [Kind::Shadow, Kind::Ao, Kind::Diffuse] {
        // Made even if it is not wanted, so that the others do not depend on it.
        let rays: Vec<Ray32> = (0..count)
            .map(|k| {
                let (origin, normal) = seen[k % seen.len()];
                let ray = |direction, t_max| Ray32 { origin, t_min: 0.0, direction, t_max };
                match kind {
                    Kind::Shadow => {
                        let to = light + random.vector(Vec3::splat(0.01 * diagonal)) - origin;
                        let length = to.length();
                        ray(to * (1.0 / length), length * 0.9999)
                    }
                    Kind::Ao => ray(scatter(normal, &mut random), 0.1 * diagonal),
                    Kind::Primary | Kind::Diffuse => ray(scatter(normal, &mut random), f32::INFINITY),
                }
            })
            .collect();
        if kinds.contains(&kind) {
            let truth = answers(reference, &rays, kind);
            sets.push(RaySet { kind, rays, truth });
        }
    }
    sets.retain(|s| kinds.contains(&s.kind));
    Ok(sets)
}

/// A pinhole camera's rays; neighbours in the list are neighbours in the picture. More rays than the picture has pixels go
/// around again.
pub(crate) fn primary(model: &Model, count: usize, random: &mut Pcg) -> Vec<Ray32> {
    let view = model.view();
    let forward = (view.at - view.eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let scale = (view.angle.to_radians() * 0.5).tan();
    let side = (1 << count.isqrt().max(1).ilog2()).min(PICTURE);
    let ray = |k: usize| {
        let pixel = Vec2::new(every_other(k) as f32, every_other(k >> 1) as f32);
        let [x, y] = pixel.to_array().map(|p| (p + random.unit()) / side as f32 * 2.0);
        let direction = (forward + (right * ((x - 1.0) * scale) + up * ((1.0 - y) * scale))).normalize();
        Ray32::new(view.eye, direction)
    };
    (0..count).map(|k| k % (side * side)).map(ray).collect()
}

/// Bits 0, 2, 4, ... of a Morton code.
fn every_other(code: usize) -> usize {
    (0..16).fold(0, |x, bit| x | ((code >> (2 * bit)) & 1) << bit)
}

/// A point just off the surface on the side that was seen, and the normal there.
fn leave(model: &Model, diagonal: f32, ray: &Ray32, hit: &Truth) -> (Vec3, Vec3) {
    let [a, b, c] = model.mesh.triangles[hit.triangle as usize].map(|i| model.mesh.positions[i as usize]);
    let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
    let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
    (ray.origin + ray.direction * hit.t as f32 + normal * (1e-4 * diagonal), normal)
}

/// A direction of the hemisphere, by the cosine.
pub(crate) fn scatter(normal: Vec3, random: &mut Pcg) -> Vec3 {
    let (a, b) = (random.unit(), random.unit());
    let (radius, angle) = (a.sqrt(), b * std::f32::consts::TAU);
    let aside = if normal.x.abs() > 0.8 { Vec3::Y } else { Vec3::X };
    let x = aside.cross(normal).normalize();
    let y = normal.cross(x);
    let flat = x * (radius * angle.cos()) + y * (radius * angle.sin());
    (flat + normal * (1.0 - a).max(0.0).sqrt()).normalize()
}

fn answers(reference: &Reference<'_>, rays: &[Ray32], kind: Kind) -> Vec<Option<Truth>> {
    rays.par_iter().map(|r| if kind.any() { reference.any(r) } else { reference.closest(r) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::icosphere;

    #[test]
    fn rays_do_not_depend_on_which_are_wanted() {
        let model = Model { name: "ball".into(), mesh: icosphere(3) };
        let reference = Reference::new(&model.mesh);
        let all = ray_sets(&model, &reference, &Kind::ALL, 4096).unwrap();
        let one = ray_sets(&model, &reference, &[Kind::Diffuse], 4096).unwrap();
        assert_eq!(all.len(), 4);
        assert!(all[3].rays == one[0].rays && one[0].kind == Kind::Diffuse);
        let share = |set: &RaySet| set.truth.iter().flatten().count() as f64 / 4096.0;
        assert!(share(&all[0]) > 0.3 && share(&all[0]) < 0.9, "{}", share(&all[0]));
        assert_eq!(share(&all[3]), 0.0, "nothing is above a ball");
        assert!(all.iter().flat_map(|s| &s.rays).all(|r| (r.direction.length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn morton_codes_are_taken_apart() {
        assert_eq!((every_other(0b1101), every_other(0b1101 >> 1)), (0b11, 0b10));
    }
}
