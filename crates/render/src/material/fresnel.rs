//! How much of the light is reflected at a boundary, by angle.

use glam::Vec3;

use super::thin_film::Film;

/// Unpolarised Fresnel reflectance of a boundary between dielectrics, 1 at total internal reflection.
///
/// `cos` is that of the angle on this side, in 0..1; `eta` is the index of the other side over that of this side.
pub(crate) fn dielectric(cos: f32, eta: f32) -> f32 {
    let Some(cos_t) = refracted_cos(cos, eta) else { return 1.0 };
    let parallel = (eta * cos - cos_t) / (eta * cos + cos_t);
    let perpendicular = (cos - eta * cos_t) / (cos + eta * cos_t);
    let f = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    if f <= 1.0 { f } else { 1.0 }
}

/// Cosine of the refracted angle by Snell's law; `None` at total internal reflection.
pub(crate) fn refracted_cos(cos: f32, eta: f32) -> Option<f32> {
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    (sin2 < 1.0).then(|| (1.0 - sin2).sqrt())
}

/// Reflectance of a dielectric at normal incidence.
pub(crate) fn normal_incidence(ior: f32) -> f32 {
    // An infinite index, by which glTF says that all is reflected, is no quotient of infinities.
    let r = if ior.is_infinite() { 1.0 } else { (ior - 1.0) / (ior + 1.0) };
    r * r
}

/// A law of reflectance.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fresnel {
    /// The same at all angles.
    Constant(Vec3),
    /// Schlick's approximation, as glTF has it.
    Schlick {
        /// Reflectance along the normal.
        f0: Vec3,
        /// Reflectance along the surface.
        f90: f32,
        /// Index of the other side over that of this side where the surface is the boundary of a solid, else 1. Only
        /// matters below 1: then the refracted angle counts, and there is total internal reflection.
        eta: f32,
    },
    /// A thin film over what Schlick's law would give.
    Film {
        /// Reflectance along the normal without the film.
        f0: Vec3,
        /// Reflectance along the surface without the film.
        f90: f32,
        /// As for `Schlick`: a stack that absorbs nothing reflects as much from either side, at angles that belong
        /// together.
        eta: f32,
        /// The film.
        film: Film,
    },
    /// The exact law for dielectrics: see [`dielectric`].
    Dielectric {
        /// Index of the other side over that of this side.
        eta: f32,
    },
}

impl Fresnel {
    /// Reflectance at an angle of this cosine, on this side.
    pub(crate) fn reflectance(&self, cos: f32) -> Vec3 {
        match *self {
            Self::Constant(f) => f,
            Self::Schlick { f0, f90, eta } => {
                let cos = if eta < 1.0 { refracted_cos(cos, eta) } else { Some(cos) };
                match cos {
                    Some(cos) => {
                        let x = (1.0 - cos).clamp(0.0, 1.0);
                        f0 + (Vec3::splat(f90) - f0) * (x * x * x * x * x)
                    }
                    None => Vec3::ONE,
                }
            }
            Self::Film { f0, f90, eta, film } => {
                let cos = if eta < 1.0 { refracted_cos(cos, eta) } else { Some(cos) };
                let Some(cos) = cos else { return Vec3::ONE };
                let x = (1.0 - cos).clamp(0.0, 1.0);
                let bare = f0 + (Vec3::splat(f90) - f0) * (x * x * x * x * x);
                bare.lerp(film.reflectance(f0, cos) * f90, film.factor)
            }
            Self::Dielectric { eta } => Vec3::splat(dielectric(cos, eta)),
        }
    }

    /// The law by which a diffuse base loses what is reflected above it: where reflection has a colour of its own
    /// (KHR_materials_specular), by the largest channel, so that the base does not take on the opposite colour.
    pub(crate) fn over_diffuse(self, colored: bool) -> Self {
        match self {
            Self::Schlick { f0, f90, eta } if colored => Self::Schlick { f0: Vec3::splat(f0.max_element()), f90, eta },
            _ => self,
        }
    }

    /// What is not reflected. Below a film, whose hues are not those of an absorption, it has no colour.
    pub(crate) fn passed(&self, cos: f32) -> Vec3 {
        let reflected = self.reflectance(cos);
        match self {
            Self::Film { .. } => Vec3::splat((1.0 - reflected.max_element()).max(0.0)),
            _ => (Vec3::ONE - reflected).max(Vec3::ZERO),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_infinite_index_reflects_everything() {
        assert_eq!(normal_incidence(f32::INFINITY), 1.0);
        assert_eq!(normal_incidence(1.0), 0.0);
        assert!((normal_incidence(1.5) - 0.04).abs() < 1e-7);
    }

    /// The textbook form by angles, in f64.
    fn by_angles(theta: f64, eta: f64) -> f64 {
        let s = theta.sin() / eta;
        if s >= 1.0 {
            return 1.0;
        }
        let t = s.asin();
        let rs = (theta - t).sin() / (theta + t).sin();
        let rp = (theta - t).tan() / (theta + t).tan();
        0.5 * (rs * rs + rp * rp)
    }

    #[test]
    fn agrees_with_fresnels_formulas() {
        for eta in [1.5f64, 1.0 / 1.5, 1.33, 2.4, 0.9] {
            for k in 1..90 {
                let theta = f64::from(k).to_radians();
                let expected = by_angles(theta, eta);
                let got = f64::from(dielectric(theta.cos() as f32, eta as f32));
                assert!((got - expected).abs() < 2e-4, "eta {eta}, {k} degrees: {got} instead of {expected}");
            }
        }
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-7);
        assert!((normal_incidence(1.5) - 0.04).abs() < 1e-8);
    }

    #[test]
    fn brewsters_angle_reflects_no_parallel_light() {
        let brewster = 1.5f64.atan();
        let s = by_angles(brewster, 1.5) * 2.0;
        let t = (brewster.sin() / 1.5).asin();
        assert!((s - ((brewster - t).sin() / (brewster + t).sin()).powi(2)).abs() < 1e-12);
        assert!((f64::from(dielectric(brewster.cos() as f32, 1.5)) - 0.5 * s).abs() < 1e-6);
    }

    #[test]
    fn total_internal_reflection_begins_at_the_critical_angle() {
        let critical = (1.0f64 / 1.5).asin();
        assert!(dielectric((critical - 1e-3).cos() as f32, 1.0 / 1.5) < 1.0);
        assert_eq!(dielectric((critical + 1e-3).cos() as f32, 1.0 / 1.5), 1.0);
        let inside = Fresnel::Schlick { f0: Vec3::splat(0.04), f90: 1.0, eta: 1.0 / 1.5 };
        assert_eq!(inside.reflectance((critical + 1e-3).cos() as f32), Vec3::ONE);
        assert!((inside.reflectance(1.0).x - 0.04).abs() < 1e-6);
    }
}
