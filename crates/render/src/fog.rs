//! Fog: a medium that is the same everywhere outside of solids, or in a box.

use firsthit_geometry::clip::ClipRegion;
use firsthit_geometry::{Aabb, Ray};
use firsthit_import::scene::FogDesc;
use glam::Vec3;

use crate::warp;

/// A homogeneous medium.
#[derive(Clone, Debug)]
pub(crate) struct Fog {
    /// Light that is scattered on a unit of its way.
    scattering: Vec3,
    /// Light that does not go on straight on a unit of its way.
    extinction: Vec3,
    g: f32,
    bounds: ClipRegion<f64>,
}

/// How far a ray goes in the fog.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Flight {
    /// It is scattered at this parameter of the ray, with this weight.
    Scattered(f64, Vec3),
    /// It gets through, with this weight.
    Through(Vec3),
}

impl Fog {
    /// `None` of what is as good as nothing.
    pub(crate) fn new(desc: &FogDesc) -> Option<Self> {
        let clean = |c: Vec3| c.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        let (scattering, absorption) = (clean(desc.scattering), clean(desc.absorption));
        let extinction = scattering + absorption;
        let bounds = desc.bounds.map(|(a, b)| Aabb::new(a.min(b), a.max(b)));
        (extinction.max_element() > 0.0).then(|| Self {
            scattering,
            extinction,
            g: desc.g.clamp(-0.99, 0.99),
            bounds: ClipRegion { bounds, half_spaces: Vec::new() },
        })
    }

    /// Whether light is scattered at all.
    pub(crate) fn scatters(&self) -> bool {
        self.scattering.max_element() > 0.0
    }

    /// The part of a ray that is in the fog, up to parameter `end`: where it begins, and its length in world units.
    fn stretch(&self, ray: &Ray<f64>, end: f64) -> Option<(f64, f64)> {
        let inside = self.bounds.clip(&ray.with_interval(0.0, end))?;
        let length = (inside.t_max - inside.t_min) * ray.direction.length();
        (length > 0.0).then_some((inside.t_min, length))
    }

    fn left_over(&self, way: f64) -> Vec3 {
        // No way is long enough for what takes nothing away.
        self.extinction.map(|e| if e > 0.0 { (-f64::from(e) * way).exp() as f32 } else { 1.0 })
    }

    /// The share of light that goes straight on up to parameter `end` of a ray.
    pub(crate) fn passed(&self, ray: &Ray<f64>, end: f64) -> Vec3 {
        self.stretch(ray, end).map_or(Vec3::ONE, |(_, way)| self.left_over(way))
    }

    /// How far light goes that sets out to parameter `end` of a ray: by one of the colours, chosen by how much there is of
    /// each, which share it by weights (Veach's balance heuristic), so that the sum of colours does not change where
    /// nothing is absorbed. Without scattering no number is asked for.
    pub(crate) fn fly(&self, ray: &Ray<f64>, end: f64, light: Vec3, u: impl FnOnce() -> [f32; 2]) -> Flight {
        let Some((begin, whole)) = self.stretch(ray, end) else { return Flight::Through(Vec3::ONE) };
        if !self.scatters() {
            return Flight::Through(self.left_over(whole));
        }
        let [choice, u] = u();
        let shares = light / light.element_sum();
        let chosen =
            self.extinction[if choice < shares.x { 0 } else { 1 + usize::from(choice >= shares.x + shares.y) }];
        let way = if chosen > 0.0 { -f64::from(-u).ln_1p() / f64::from(chosen) } else { f64::INFINITY };
        let left = self.left_over(way.min(whole));
        if way < whole {
            let density = (shares * self.extinction * left).element_sum();
            let weight = self.scattering * left / density;
            Flight::Scattered(begin + way / ray.direction.length(), weight)
        } else {
            Flight::Through(left / (shares * left).element_sum())
        }
    }

    /// Density over solid angle of the directions in which light goes on, by the cosine of the angle by which it is
    /// turned: Henyey and Greenstein, "Diffuse radiation in the galaxy" (1941).
    pub(crate) fn phase(&self, cos: f32) -> f32 {
        let g = self.g;
        let d = (1.0 + g * g - 2.0 * g * cos).max(1e-6);
        (1.0 - g * g) / (4.0 * std::f32::consts::PI * d * d.sqrt())
    }

    /// A direction in which light goes on that came along `onwards`.
    pub(crate) fn turn(&self, onwards: Vec3, u: [f32; 2]) -> Vec3 {
        let g = self.g;
        let cos = if g.abs() < 1e-3 {
            1.0 - 2.0 * u[0]
        } else {
            let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
            (1.0 + g * g - s * s) / (2.0 * g)
        };
        let cos = cos.clamp(-1.0, 1.0);
        let (x, y) = warp::frame(onwards);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (2.0 * std::f32::consts::PI * u[1]).sin_cos();
        (x * (sin * cos_phi) + y * (sin * sin_phi) + onwards * cos).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn fog(g: f32) -> Fog {
        let (scattering, absorption) = (Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.1, 0.0, 0.3));
        Fog::new(&FogDesc { scattering, absorption, g, bounds: None }).unwrap()
    }

    /// The phase function is a density whose mean cosine is g, and directions are drawn by it.
    #[test]
    fn directions_follow_the_phase_function() {
        for g in [-0.7, 0.0, 0.4, 0.9] {
            let fog = fog(g);
            let n = 1 << 14;
            let (mut whole, mut mean) = (0.0, 0.0);
            for i in 0..n {
                let cos = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
                let density = f64::from(fog.phase(cos as f32)) * 2.0 * std::f64::consts::PI * 2.0 / f64::from(n);
                whole += density;
                mean += density * cos;
            }
            assert!((whole - 1.0).abs() < 1e-3 && (mean - f64::from(g)).abs() < 1e-3, "{g}: {whole} {mean}");
            let onwards = Vec3::new(0.6, -0.8, 0.0);
            let drawn = (0..n).map(|i| {
                let u = [(i as f32 + 0.5) / n as f32, (i as f32 * 0.618).fract()];
                f64::from(fog.turn(onwards, u).dot(onwards))
            });
            let drawn = drawn.sum::<f64>() / f64::from(n);
            assert!((drawn - f64::from(g)).abs() < 1e-3, "{g}: {drawn}");
        }
    }

    /// The mean over all numbers: what gets through is what exponentials say, and what is scattered is the rest, by
    /// colour.
    #[test]
    fn flights_have_the_right_means() {
        let fog = fog(0.0);
        let ray = Ray::new(DVec3::ZERO, DVec3::X * 2.0);
        let (n, end) = (600, 0.7);
        let (mut through, mut scattered) = (Vec3::ZERO, Vec3::ZERO);
        let light = Vec3::new(0.5, 2.0, 0.7);
        for i in 0..n {
            for k in 0..n {
                let u = [(i as f32 + 0.5) / n as f32, (k as f32 + 0.5) / n as f32];
                match fog.fly(&ray, end, light, || u) {
                    Flight::Through(weight) => through += weight / (n * n) as f32,
                    Flight::Scattered(t, weight) => {
                        assert!(t > 0.0 && t < end);
                        scattered += weight / (n * n) as f32;
                    }
                }
            }
        }
        let left = fog.passed(&ray, end);
        let expected = (Vec3::ONE - left) * fog.scattering / fog.extinction;
        assert!((through - left).abs().max_element() < 2e-3, "{through} {left}");
        assert!((scattered - expected).abs().max_element() < 2e-3, "{scattered} {expected}");
        assert!((left.x - (-0.6_f32 * 1.4).exp()).abs() < 1e-6);
        assert_eq!(fog.passed(&ray, f64::INFINITY), Vec3::ZERO);
    }

    #[test]
    fn a_box_has_fog_only_inside() {
        let desc = FogDesc {
            scattering: Vec3::ZERO,
            absorption: Vec3::new(1.0, 0.0, 2.0),
            g: 0.0,
            bounds: Some((DVec3::splat(1.0), DVec3::splat(-1.0))),
        };
        let fog = Fog::new(&desc).unwrap();
        let passed = |x: f64, end| fog.passed(&Ray::new(DVec3::new(x, 0.2, 0.3), DVec3::X), end);
        let near =
            |a: Vec3, way: f32| (a - Vec3::new((-way).exp(), 1.0, (-2.0 * way).exp())).abs().max_element() < 1e-6;
        assert!(near(passed(-5.0, f64::INFINITY), 2.0) && near(passed(0.0, f64::INFINITY), 1.0));
        assert!(near(passed(-5.0, 4.5), 0.5) && near(passed(2.0, 9.0), 0.0));
        assert!(matches!(fog.fly(&Ray::new(DVec3::ZERO, DVec3::Y), 3.0, Vec3::ONE, || panic!()), Flight::Through(_)));
        let nothing = FogDesc { absorption: Vec3::ZERO, ..desc };
        assert!(Fog::new(&nothing).is_none());
    }
}
