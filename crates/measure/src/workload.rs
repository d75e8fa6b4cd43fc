//! Ray sets: what is asked of a model.

use core::fmt;
use core::str::FromStr;

use firsthit_accel::{Crossings, Scene};
use firsthit_geometry::Ray;
use firsthit_render::framing::frame;
use glam::DVec3;

use crate::random::{Aim, Rng};
use crate::subject::Subject;

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// From the camera that `render` would choose.
    Primary,
    /// From what the camera sees to a light over its right shoulder; asks only whether something is in between.
    Shadow,
    /// From what the camera sees, as a matt surface scatters.
    Incoherent,
    /// A third each at vertices, points of edges and points of faces; from inside where the model is closed.
    Aimed,
}

impl RayKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Incoherent, Self::Aimed];

    /// The name on command lines and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Incoherent => "incoherent",
            Self::Aimed => "aimed",
        }
    }
}

impl fmt::Display for RayKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for RayKind {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let unknown = || format!("unknown rays '{s}' (primary, shadow, incoherent or aimed)");
        Self::ALL.into_iter().find(|k| k.name() == s).ok_or_else(unknown)
    }
}

/// Rays of one kind.
#[derive(Clone, Debug)]
pub struct RaySet {
    /// Their kind.
    pub kind: RayKind,
    /// The rays.
    pub rays: Vec<Ray<f64>>,
    /// So many from the front are timed; all are compared.
    pub timed: usize,
    /// Whether they start inside a closed model, so that one that hits nothing has leaked.
    pub inside: bool,
}

/// How many rays.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Width and height of the picture that primary rays make.
    pub picture: u32,
    /// Aimed rays.
    pub aimed: usize,
}

/// Makes the ray sets of a model.
///
/// `scene` is the model built at the most careful tier: what is seen from where does not depend on what is measured.
/// `coarse` is the model at the least careful tier, which says how far off a surface rays start: no tier is given rays
/// that begin within its own error. (How far each tier itself goes is measured apart, by bounces.)
#[must_use]
pub fn ray_sets(
    subject: &Subject,
    scene: &Scene,
    coarse: &Scene,
    kinds: &[RayKind],
    size: Size,
    seed: u64,
) -> Vec<RaySet> {
    let mut rng = Rng(seed);
    let camera = frame(&subject.desc, scene, 1.0).camera;
    let film = camera.on_film(size.picture, size.picture);
    let pixels = (0..size.picture).flat_map(|y| (0..size.picture).map(move |x| (x, y)));
    let primary: Vec<Ray<f64>> =
        pixels.map(|(x, y)| film.ray([f64::from(x) + rng.unit(), f64::from(y) + rng.unit()])).collect();

    // Where the camera's rays end, and the normal on the side it sees.
    let seen: Vec<(firsthit_accel::SurfacePoint, DVec3)> = primary
        .iter()
        .filter_map(|ray| {
            let hit = scene.closest_hit(ray)?;
            let facing = hit.normal_against(ray.direction);
            (facing != DVec3::ZERO).then(|| (coarse.surface_point(ray, &hit), facing))
        })
        .collect();

    let bounds = scene.bounds();
    let radius = 0.5 * bounds.extent().length();
    let light = camera.position() + (camera.right() + camera.up()) * radius;
    let mut sets = Vec::new();
    for &kind in kinds {
        // Each kind has its own stream, so that leaving one out changes no other.
        let mut rng = Rng(seed ^ (kind as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut inside = false;
        let rays: Vec<Ray<f64>> = match kind {
            RayKind::Primary => primary.clone(),
            RayKind::Shadow => {
                seen.iter().map(|(point, _)| Ray::segment(point.spawn(light - point.position), light)).collect()
            }
            RayKind::Incoherent => seen
                .iter()
                .map(|(point, facing)| {
                    let direction = *facing * (1.0 + 1e-9) + rng.direction();
                    Ray::new(point.spawn(direction), direction)
                })
                .collect(),
            RayKind::Aimed => {
                let mut origins =
                    if subject.closed { interior_points(subject, scene, 64, &mut rng) } else { Vec::new() };
                inside = !origins.is_empty();
                if !inside {
                    let around = |rng: &mut Rng| bounds.center() + rng.direction() * radius * 1.5;
                    origins.extend((0..32).map(|_| around(&mut rng)));
                    origins.extend(vec![camera.position(); 32]);
                }
                (0..size.aimed).filter_map(|k| aimed_ray(subject, &origins, k, &mut rng)).collect()
            }
        };
        let timed = rays.len().min(primary.len());
        sets.push(RaySet { kind, rays, timed, inside });
    }
    sets
}

/// Ray number `k` from one of some points at a random triangle's vertex, edge or face; half of the directions are unit,
/// the others end at the target.
pub(crate) fn aimed_ray(subject: &Subject, origins: &[DVec3], k: usize, rng: &mut Rng) -> Option<Ray<f64>> {
    let origin = *origins.get(rng.below(origins.len().max(1)))?;
    let triangle = subject.nth(rng.bits() % subject.triangles().max(1))?.in_world();
    let direction = Aim::ALL[k % 3].point(triangle, rng) - origin;
    let direction = if (k / 3) % 2 == 1 { direction.normalize_or_zero() } else { direction };
    (direction != DVec3::ZERO).then(|| Ray::new(origin, direction))
}

/// Points inside a closed model, at most `count`, well away from its surface where it has room.
///
/// Candidates lie halfway between the first two crossings of lines from outside through random triangles; of three times
/// as many as wanted those with most room are taken, and each is kept only if rays from it in eight random directions all
/// cross the surface an odd number of times.
#[must_use]
pub fn interior_points(subject: &Subject, scene: &Scene, count: usize, rng: &mut Rng) -> Vec<DVec3> {
    let bounds = scene.bounds();
    let far = 2.0 * bounds.extent().length();
    let mut candidates: Vec<(f64, DVec3)> = (0..3 * count)
        .filter_map(|_| {
            let [a, b, c] = subject.nth(rng.bits() % subject.triangles().max(1))?.in_world();
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let ray = Ray::new((a + b + c) / 3.0 + normal * far, -normal);
            let enter = scene.closest_hit(&ray)?;
            let leave = scene.closest_hit(&ray.with_interval(enter.t.next_up(), f64::INFINITY))?;
            Some((leave.t - enter.t, ray.at(0.5 * (enter.t + leave.t))))
        })
        .collect();
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let inside = |p: DVec3, rng: &mut Rng| {
        (0..8).all(|_| scene.count_hits(&Ray::new(p, rng.direction()), Crossings::Surfaces) % 2 == 1)
    };
    candidates.into_iter().map(|c| c.1).filter(|&p| inside(p, rng)).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::torus;
    use crate::subject::desc_of;
    use firsthit_accel::{BuildOptions, SceneBuilder};

    fn build(subject: &Subject) -> Scene {
        SceneBuilder::from_desc(&subject.desc, BuildOptions::default()).build().unwrap()
    }

    #[test]
    fn interior_points_of_a_torus_lie_in_its_tube() {
        let subject = Subject::new("torus", desc_of(&torus(48, 24, 0.3)));
        let points = interior_points(&subject, &build(&subject), 64, &mut Rng(3));
        assert!(points.len() > 32);
        for p in points {
            let from_ring = (p.truncate().length() - 1.0).hypot(p.z);
            assert!(from_ring < 0.3, "{p}");
        }
    }

    #[test]
    fn the_same_seed_makes_the_same_rays_whatever_else_is_asked_for() {
        let subject = Subject::builtin();
        let scene = build(&subject);
        let size = Size { picture: 16, aimed: 300 };
        let all = ray_sets(&subject, &scene, &scene, &RayKind::ALL, size, 7);
        let one = ray_sets(&subject, &scene, &scene, &[RayKind::Aimed], size, 7);
        assert_eq!(all[3].rays, one[0].rays);
        assert!(all[3].inside && one[0].rays.len() == 300);
        assert_eq!(all[0].rays.len(), 256);
        assert!(all[1].rays.len() > 50 && all[1].rays.iter().all(|r| r.t_max == 1.0));
        assert!(ray_sets(&subject, &scene, &scene, &[RayKind::Primary], size, 8)[0].rays != all[0].rays);
    }
}
