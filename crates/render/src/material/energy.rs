//! How much of the light from everywhere a lobe reflects, in tables: what single scattering loses, and what a layer
//! takes from those below.

use std::f32::consts::PI;
use std::sync::LazyLock;

use glam::Vec3;

use super::fresnel::{Fresnel, normal_incidence};
use super::lobes::{GgxReflection, GgxTransmission, Lobe, Sheen};
use super::microfacet::{Masking, g1, g2, sample_visible};
use crate::kernel::Full;

/// Points along each side of the tables that all materials share.
const FINE: usize = 32;
/// Of those that a material has for itself.
const COARSE: usize = 16;

/// A function of the cosine to the viewer and the roughness, both in 0..1, interpolated between its values on a grid.
#[derive(Debug)]
struct Table<const SIZE: usize>([[f32; SIZE]; SIZE]);

impl<const SIZE: usize> Table<SIZE> {
    /// The cosine at a row: rows are close together at grazing angles.
    fn cos(row: usize) -> f32 {
        let x = row as f32 / (SIZE - 1) as f32;
        (x * x).max(1e-3)
    }

    fn new(value: impl Fn(f32, f32) -> f32) -> Self {
        let mut table = [[0.0; SIZE]; SIZE];
        for (i, row) in table.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = value(Self::cos(i), j as f32 / (SIZE - 1) as f32);
            }
        }
        Self(table)
    }

    fn get(&self, cos: f32, roughness: f32) -> f32 {
        let last = (SIZE - 1) as f32;
        let (x, y) = (cos.clamp(0.0, 1.0).sqrt() * last, roughness.clamp(0.0, 1.0) * last);
        let (i, j) = ((x as usize).min(SIZE - 2), (y as usize).min(SIZE - 2));
        let (tx, ty) = (x - i as f32, y - j as f32);
        let along = |row: &[f32; SIZE]| row[j] + (row[j + 1] - row[j]) * ty;
        let (a, b) = (along(&self.0[i]), along(&self.0[i + 1]));
        a + (b - a) * tx
    }
}

/// Of GGX facets that reflect everything, with correlated masking: what of the light leaves after one bounce.
/// `N`, `M`: steps of the integration.
fn integrate_ggx<const N: u32, const M: u32>(cos: f32, alpha: f32) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..N * M {
        // Half of the circle, as the other half is the same; dense where facets are steep.
        let (phi, t) = (((i % M) as f32 + 0.5) / (2 * M) as f32, ((i / M) as f32 + 0.5) / N as f32);
        let h = sample_visible(wo, alpha, [phi, 1.0 - (1.0 - t) * (1.0 - t)]);
        let wi = h * (2.0 * wo.dot(h)) - wo;
        if wi.z > 0.0 {
            sum += 2.0 * (1.0 - t) * g2(wo, wi, alpha, Masking::Correlated) / g1(wo, alpha);
        }
    }
    sum / (N * M) as f32
}

/// Of white sheen.
fn integrate_sheen(cos: f32, roughness: f32) -> f32 {
    const N: u32 = 64;
    const M: u32 = 16;
    let lobe = Lobe::Sheen(Sheen::new(Vec3::ONE, roughness));
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..N {
        // Dense at the horizon.
        let t = (i as f32 + 0.5) / N as f32;
        let z = t * t;
        let r = (1.0 - z * z).sqrt();
        for j in 0..M {
            let phi = (j as f32 + 0.5) / M as f32 * PI;
            let wi = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            sum += lobe.eval::<Full>(wo, wi).x * 2.0 * t;
        }
    }
    sum * 2.0 * PI / (N * M) as f32
}

/// Of a rough boundary between media that absorbs nothing: what is reflected and goes through by one bounce.
fn integrate_boundary<const N: u32, const M: u32>(cos: f32, alpha: f32, eta: f32, f0: f32) -> f32 {
    let fresnel = Fresnel::Schlick { f0: Vec3::splat(f0), f90: 1.0, eta };
    let reflection = GgxReflection { alpha, fresnel, masking: Masking::Correlated, scale: Vec3::ONE };
    let transmission = GgxTransmission { alpha, eta, fresnel, tint: Vec3::ONE, scale: 1.0 };
    let lobes = [Lobe::GgxReflection(reflection), Lobe::GgxTransmission(transmission)];
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..N * M {
        let (phi, t) = (((i % M) as f32 + 0.5) / (2 * M) as f32, ((i / M) as f32 + 0.5) / N as f32);
        let u = [phi, 1.0 - (1.0 - t) * (1.0 - t)];
        for lobe in &lobes {
            sum += 2.0 * (1.0 - t) * lobe.sample::<Full>(wo, u).map_or(0.0, |s| s.weight.x);
        }
    }
    sum / (N * M) as f32
}

/// What a rough boundary of a solid keeps of the light by one bounce, from outside and from inside.
#[derive(Debug)]
pub(super) struct Boundary {
    outside: Table<COARSE>,
    inside: Table<COARSE>,
}

impl Boundary {
    /// For an index of refraction above 1.
    pub(super) fn new(ior: f32) -> Self {
        let f0 = normal_incidence(ior);
        let table = |eta| {
            Table::new(|cos, roughness| {
                integrate_boundary::<32, 16>(cos, (roughness * roughness).max(super::LEAST_ALPHA), eta, f0)
            })
        };
        Self { outside: table(ior), inside: table(1.0 / ior) }
    }

    /// What both lobes have to be multiplied with so that nothing is lost, as [`compensation`] for mirrors.
    pub(super) fn compensation(&self, cos: f32, roughness: f32, outside: bool) -> f32 {
        let table = if outside { &self.outside } else { &self.inside };
        1.0 / table.get(cos, roughness).max(0.1)
    }
}

static GGX: LazyLock<Table<FINE>> = LazyLock::new(|| {
    Table::new(|cos, roughness| integrate_ggx::<32, 8>(cos, (roughness * roughness).max(super::LEAST_ALPHA)))
});

static SHEEN: LazyLock<Table<FINE>> =
    LazyLock::new(|| Table::new(|cos, roughness| integrate_sheen(cos, roughness).min(1.0)));

/// What a GGX reflection has to be multiplied with so that light which bounces between facets is not lost: Turquin,
/// "Practical multiple scattering compensation for microfacet models" (2019). `f0`: reflectance along the normal.
pub(super) fn compensation(cos: f32, roughness: f32, f0: Vec3) -> Vec3 {
    let reflected = GGX.get(cos, roughness);
    Vec3::ONE + f0 * (1.0 / reflected - 1.0)
}

/// As [`compensation`], of thin sheets: what is not reflected goes through by the same facets.
pub(super) fn thin_compensation(cos: f32, roughness: f32) -> f32 {
    1.0 / GGX.get(cos, roughness)
}

/// What white sheen of this roughness reflects.
pub(super) fn sheen(cos: f32, roughness: f32) -> f32 {
    SHEEN.get(cos, roughness)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between the points of the grid, against finer integrals.
    #[test]
    fn tables_are_fine_enough() {
        for k in 0..200 {
            let (x, y) = ((k as f32 * 0.618_034).fract(), (k as f32 * 0.754_877_7).fract());
            let (cos, roughness) = (0.05 + 0.95 * x, y.max(0.05));
            let exact = integrate_ggx::<256, 64>(cos, roughness * roughness);
            let found = GGX.get(cos, roughness);
            assert!((found - exact).abs() < 5e-3, "GGX {cos} {roughness}: {found}, not {exact}");
            if roughness > 0.15 {
                let (exact, found) = (integrate_sheen(cos, roughness), sheen(cos, roughness));
                assert!((found - exact).abs() < 0.02, "sheen {cos} {roughness}: {found}, not {exact}");
            }
        }
    }

    #[test]
    fn smooth_mirrors_lose_nothing_and_rough_ones_a_known_share() {
        assert!((GGX.get(1.0, 0.05) - 1.0).abs() < 1e-3);
        // In closed form: along the normal, facets of alpha 1 reflect 1 - ln 2 by one bounce.
        let rough = GGX.get(1.0, 1.0);
        assert!((rough - (1.0 - std::f32::consts::LN_2)).abs() < 2e-3, "{rough}");
        let white = compensation(0.5, 0.8, Vec3::ONE) * GGX.get(0.5, 0.8);
        assert!((white - Vec3::ONE).abs().max_element() < 1e-5);
    }
}
