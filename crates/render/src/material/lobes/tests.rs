//! The rules that every lobe keeps: its samples follow its density, its weights are value over density, it makes no
//! light, and reflection is the same both ways.

use std::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::{
    AnisotropicGgx, Clearcoat, DiffuseTransmission, GgxReflection, GgxTransmission, Lambert, Lobe, Sheen,
    ThinTransmission,
};
use crate::kernel::Full;
use crate::material::fresnel::Fresnel;
use crate::material::microfacet::Masking;
use crate::material::thin_film::Film;

fn schlick() -> Fresnel {
    Fresnel::Schlick { f0: Vec3::new(0.04, 0.3, 0.9), f90: 1.0, eta: 1.0 }
}

fn filmed() -> Fresnel {
    let film = Film { factor: 0.8, outside: 1.0, ior: 1.3, thickness: 400.0 };
    Fresnel::Film { f0: Vec3::new(0.04, 0.3, 0.9), f90: 1.0, eta: 1.0, film }
}

/// All lobes that are not delta functions, with their names.
fn lobes() -> Vec<(String, Lobe)> {
    let mut all: Vec<(String, Lobe)> = vec![
        ("Lambert".into(), Lobe::Lambert(Lambert { albedo: Vec3::new(0.2, 0.8, 1.0), coat: None })),
        ("coated Lambert".into(), Lobe::Lambert(Lambert { albedo: Vec3::ONE, coat: Some(schlick()) })),
    ];
    for alpha in [0.1f32, 0.3, 1.0] {
        for masking in [Masking::Correlated, Masking::Separate] {
            let lobe = GgxReflection { alpha, fresnel: schlick(), masking, scale: Vec3::ONE };
            all.push((format!("GGX {alpha} {masking:?}"), Lobe::GgxReflection(lobe)));
        }
        for eta in [1.5f32, 1.0 / 1.5] {
            let fresnel = Fresnel::Dielectric { eta };
            let lobe = GgxTransmission { alpha, eta, fresnel, tint: Vec3::ONE, scale: 1.0 };
            all.push((format!("rough glass {alpha} {eta}"), Lobe::GgxTransmission(lobe)));
        }
        let lobe = ThinTransmission { alpha, fresnel: schlick(), tint: Vec3::new(1.0, 0.5, 0.2) };
        all.push((format!("thin {alpha}"), Lobe::ThinTransmission(lobe)));
        let lobe = GgxReflection { alpha, fresnel: filmed(), masking: Masking::Correlated, scale: Vec3::ONE };
        all.push((format!("iridescent {alpha}"), Lobe::GgxReflection(lobe)));
        let coat = Clearcoat { weight: 0.7, alpha, normal: Vec3::Z };
        all.push((format!("coat {alpha}"), Lobe::Clearcoat(coat)));
        let tilted = Clearcoat { weight: 1.0, alpha, normal: Vec3::new(0.2, 0.1, 0.9).normalize() };
        all.push((format!("tilted coat {alpha}"), Lobe::Clearcoat(tilted)));
        let brushed = AnisotropicGgx { alpha: Vec2::new(0.8, alpha), fresnel: schlick(), scale: Vec3::ONE };
        all.push((format!("brushed {alpha}"), Lobe::AnisotropicGgx(brushed)));
        let sheen = Sheen::new(Vec3::new(1.0, 0.5, 0.1), alpha.sqrt());
        all.push((format!("sheen {alpha}"), Lobe::Sheen(sheen)));
    }
    let through = DiffuseTransmission { color: Vec3::new(1.0, 0.5, 0.1), coat: schlick() };
    all.push(("diffuse transmission".into(), Lobe::DiffuseTransmission(through)));
    all
}

fn views() -> [Vec3; 3] {
    [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.48, 0.36, 0.8), Vec3::new(0.2, -0.95, 0.24).normalize()]
}

/// A small generator for tests: PCG (O'Neill 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        let x = x.rotate_right((self.0 >> 59) as u32);
        (x >> 8) as f32 / 16_777_216.0
    }
}

fn direction(cos: f64, phi: f64) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32)
}

const CELLS_Z: usize = 40;
const CELLS_PHI: usize = 40;

fn cell(w: Vec3) -> usize {
    let z = (f64::from(w.z).clamp(-1.0, 1.0).acos() / PI * CELLS_Z as f64) as usize;
    let phi = (f64::from(w.y).atan2(f64::from(w.x)).rem_euclid(TAU) / TAU * CELLS_PHI as f64) as usize;
    z.min(CELLS_Z - 1) * CELLS_PHI + phi.min(CELLS_PHI - 1)
}

/// Pearson's chi-squared statistic stays within five standard deviations (2 sqrt(2k)) of its mean.
#[test]
fn samples_follow_the_density() {
    const N: usize = 200_000;
    const SUB: usize = 16;
    for (name, lobe) in lobes() {
        for wo in views() {
            let mut expected = vec![0.0f64; CELLS_Z * CELLS_PHI];
            for iz in 0..CELLS_Z * SUB {
                for ip in 0..CELLS_PHI * SUB {
                    let theta = (iz as f64 + 0.5) / (CELLS_Z * SUB) as f64 * PI;
                    let phi = (ip as f64 + 0.5) / (CELLS_PHI * SUB) as f64 * TAU;
                    let solid_angle = theta.sin() * PI * TAU / (CELLS_Z * SUB * CELLS_PHI * SUB) as f64;
                    expected[(iz / SUB) * CELLS_PHI + ip / SUB] +=
                        f64::from(lobe.pdf::<Full>(wo, direction(theta.cos(), phi))) * solid_angle * N as f64;
                }
            }
            let mut found = vec![0.0f64; CELLS_Z * CELLS_PHI];
            let mut random = Random(7);
            for _ in 0..N {
                if let Some(s) = lobe.sample::<Full>(wo, [random.next(), random.next()]) {
                    found[cell(s.wi)] += 1.0;
                }
            }
            // Cells with few expected samples are joined.
            let (mut chi2, mut k) = (0.0, 0);
            let (mut few_expected, mut few_found) = (0.0, 0.0);
            for (e, f) in expected.iter().zip(&found) {
                if *e < 20.0 {
                    few_expected += e;
                    few_found += f;
                } else {
                    // The midpoint rule is not exact: half a per cent is granted.
                    let d = ((e - f).abs() - 0.005 * e).max(0.0);
                    chi2 += d * d / e;
                    k += 1;
                }
            }
            assert!(
                (few_found - few_expected).abs() < 5.0 * few_expected.max(20.0).sqrt() + 0.02 * few_expected + 20.0,
                "{name}: {few_found} stray samples instead of {few_expected}"
            );
            let limit = f64::from(k) + 5.0 * (2.0 * f64::from(k)).sqrt();
            assert!(chi2 < limit, "{name}, wo {wo}: chi-squared {chi2} of {k} cells");
        }
    }
}

#[test]
fn weight_is_value_over_density() {
    for (name, lobe) in lobes() {
        for wo in views() {
            let mut random = Random(3);
            for _ in 0..2000 {
                let Some(s) = lobe.sample::<Full>(wo, [random.next(), random.next()]) else { continue };
                let pdf = s.pdf.unwrap();
                let again = lobe.pdf::<Full>(wo, s.wi);
                // At grazing angles the half vector is found again with a few roundings less exact.
                assert!((pdf - again).abs() <= 2e-2 * pdf.max(again), "{name}: pdf {pdf}, again {again}");
                let value = lobe.eval::<Full>(wo, s.wi);
                let from_weight = s.weight * pdf;
                assert!(
                    (value - from_weight).abs().max_element() <= 2e-2 * from_weight.max_element() + 1e-6,
                    "{name}: {value} instead of {from_weight}"
                );
            }
        }
    }
}

/// In a white furnace no lobe reflects more than it gets, and sampling finds the same as integration.
#[test]
fn makes_no_light() {
    for (name, lobe) in lobes() {
        for wo in views() {
            let mut random = Random(11);
            let n = 20_000;
            let mut sampled = Vec3::ZERO;
            for _ in 0..n {
                if let Some(s) = lobe.sample::<Full>(wo, [random.next(), random.next()]) {
                    sampled += s.weight / n as f32;
                }
            }
            assert!(sampled.max_element() < 1.005, "{name}: {sampled}");
            let steps = 600;
            let mut integrated = [0.0f64; 3];
            for iz in 0..steps {
                for ip in 0..steps {
                    let theta = (f64::from(iz) + 0.5) / f64::from(steps) * PI;
                    let phi = (f64::from(ip) + 0.5) / f64::from(steps) * TAU;
                    let f = lobe.eval::<Full>(wo, direction(theta.cos(), phi));
                    for c in 0..3 {
                        integrated[c] += f64::from(f[c]) * theta.sin() * PI * TAU / f64::from(steps * steps);
                    }
                }
            }
            for c in 0..3 {
                assert!(
                    (integrated[c] - f64::from(sampled[c])).abs() < 0.012,
                    "{name}, wo {wo}: {integrated:?} against {sampled}"
                );
            }
        }
    }
}

#[test]
fn reflection_and_thin_transmission_are_reciprocal() {
    let mut random = Random(5);
    for (name, lobe) in lobes() {
        // As every normal map, a coat with a normal of its own is reciprocal about that one only.
        if matches!(lobe, Lobe::GgxTransmission(_)) || matches!(lobe, Lobe::Clearcoat(c) if c.normal != Vec3::Z) {
            continue;
        }
        let thin = lobe.goes_through();
        for _ in 0..500 {
            let a = direction(f64::from(random.next()), f64::from(random.next()) * TAU);
            let b = direction(f64::from(random.next()), f64::from(random.next()) * TAU);
            if a.z < 0.05 || b.z < 0.05 {
                continue;
            }
            let flip = |w: Vec3| if thin { Vec3::new(w.x, w.y, -w.z) } else { w };
            let ab = lobe.eval::<Full>(a, flip(b)) / b.z;
            let ba = lobe.eval::<Full>(b, flip(a)) / a.z;
            assert!((ab - ba).abs().max_element() <= 1e-3 * ab.max_element() + 1e-6, "{name}: {ab}, {ba}");
        }
    }
}

/// With refraction f(wo, wi) eta_i^2 = f(wi, wo) eta_o^2 in radiance units; firsthit keeps the scaling apart, so here
/// both are simply equal after the change of sides.
#[test]
fn refraction_is_reciprocal_up_to_the_scaling_of_radiance() {
    let (eta, alpha) = (1.5f32, 0.3);
    let enter = Lobe::GgxTransmission(GgxTransmission {
        alpha,
        eta,
        fresnel: Fresnel::Dielectric { eta },
        tint: Vec3::ONE,
        scale: 1.0,
    });
    let leave = Lobe::GgxTransmission(GgxTransmission {
        alpha,
        eta: 1.0 / eta,
        fresnel: Fresnel::Dielectric { eta: 1.0 / eta },
        tint: Vec3::ONE,
        scale: 1.0,
    });
    let mut random = Random(9);
    let mut compared = 0;
    for _ in 0..2000 {
        let wo = direction(f64::from(random.next()) * 0.9 + 0.1, f64::from(random.next()) * TAU);
        let Some(s) = enter.sample::<Full>(wo, [random.next(), random.next()]) else { continue };
        if s.wi.z > -0.05 {
            continue;
        }
        // Per projected solid angle.
        let there = enter.eval::<Full>(wo, s.wi).x / s.wi.z.abs();
        let back = leave.eval::<Full>(-s.wi, -wo).x / wo.z;
        // The measure of solid angles differs by eta^2 between the sides.
        assert!((there - back * eta * eta).abs() <= 1e-2 * there + 1e-6, "{there} {back}");
        compared += 1;
    }
    assert!(compared > 500);
}
