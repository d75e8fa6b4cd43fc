//! Lobes: the parts that a surface's scattering is the sum of, one file a lobe.
//!
//! Directions are in the shading frame, +z the normal on the side of `wo`; both `wo` (to the viewer) and `wi` (to the
//! light) point away from the surface. To add a lobe: a file with `eval`, `pdf` and `sample`, a variant of [`Lobe`],
//! and a line in the tests below, which hold every lobe to the same rules.

mod anisotropic;
mod clearcoat;
mod diffuse;
mod diffuse_transmission;
mod ggx;
mod rough_glass;
mod sheen;
mod specular;
mod thin;

use bitflags::bitflags;
use glam::Vec3;

use crate::kernel::Kernel;

pub(crate) use anisotropic::AnisotropicGgx;
pub(crate) use clearcoat::Clearcoat;
pub(crate) use diffuse::Lambert;
pub(crate) use diffuse_transmission::DiffuseTransmission;
pub(crate) use ggx::GgxReflection;
pub(crate) use rough_glass::GgxTransmission;
pub(crate) use sheen::Sheen;
pub(crate) use specular::{SpecularReflection, SpecularTransmission};
pub(crate) use thin::ThinTransmission;

bitflags! {
    /// What kinds of scattering a lobe does, or an integrator follows.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(crate) struct LobeKind: u8 {
        /// In all directions of one side.
        const DIFFUSE = 1;
        /// About the mirror direction.
        const REFLECTION = 2;
        /// About the direction that goes through.
        const TRANSMISSION = 4;
    }
}

/// A direction drawn from a lobe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeSample {
    /// Where the light comes from.
    pub(crate) wi: Vec3,
    /// f * |cos| / pdf; for a delta lobe the share of light that goes this way.
    pub(crate) weight: Vec3,
    /// Density over solid angle; `None` for a delta lobe.
    pub(crate) pdf: Option<f32>,
}

/// One part of a surface's scattering.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lobe {
    /// Nothing: in places that no lobe takes.
    Nothing,
    /// Even in all directions.
    Lambert(Lambert),
    /// A mirror.
    SpecularReflection(SpecularReflection),
    /// A clear boundary.
    SpecularTransmission(SpecularTransmission),
    /// A rough mirror.
    GgxReflection(GgxReflection),
    /// A rough boundary.
    GgxTransmission(GgxTransmission),
    /// A thin rough sheet.
    ThinTransmission(ThinTransmission),
    /// A brushed mirror.
    AnisotropicGgx(AnisotropicGgx),
    /// A clear coat over the others.
    Clearcoat(Clearcoat),
    /// Fibres.
    Sheen(Sheen),
    /// Even in all directions of the other side.
    DiffuseTransmission(DiffuseTransmission),
}

/// Calls a method of whichever lobe it is.
macro_rules! each {
    ($self:ident, $lobe:ident => $body:expr, else $nothing:expr) => {
        match $self {
            Lobe::Lambert($lobe) => $body,
            Lobe::SpecularReflection($lobe) => $body,
            Lobe::GgxReflection($lobe) => $body,
            Lobe::SpecularTransmission($lobe) if K::THROUGH => $body,
            Lobe::GgxTransmission($lobe) if K::THROUGH => $body,
            Lobe::ThinTransmission($lobe) if K::THROUGH => $body,
            Lobe::AnisotropicGgx($lobe) if K::LAYERS => $body,
            Lobe::Clearcoat($lobe) if K::LAYERS => $body,
            Lobe::Sheen($lobe) if K::LAYERS => $body,
            Lobe::DiffuseTransmission($lobe) if K::LAYERS => $body,
            // Nothing, and what a kernel does not meet.
            _ => $nothing,
        }
    };
}

impl Lobe {
    /// What it does.
    pub(crate) fn kind(&self) -> LobeKind {
        match self {
            Self::Nothing => LobeKind::empty(),
            Self::Lambert(_) | Self::Sheen(_) => LobeKind::DIFFUSE,
            Self::SpecularReflection(_) | Self::GgxReflection(_) | Self::AnisotropicGgx(_) | Self::Clearcoat(_) => {
                LobeKind::REFLECTION
            }
            Self::DiffuseTransmission(_) => LobeKind::DIFFUSE.union(LobeKind::TRANSMISSION),
            Self::SpecularTransmission(_) | Self::GgxTransmission(_) | Self::ThinTransmission(_) => {
                LobeKind::TRANSMISSION
            }
        }
    }

    /// Whether light goes through to the other side.
    pub(crate) fn goes_through(&self) -> bool {
        self.kind().contains(LobeKind::TRANSMISSION)
    }

    /// f(wo, wi) * |cos(wi)|; 0 for delta lobes.
    pub(crate) fn eval<K: Kernel>(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        each!(self, lobe => lobe.eval(wo, wi), else Vec3::ZERO)
    }

    /// Density of [`Lobe::sample`] over solid angle; 0 for delta lobes.
    pub(crate) fn pdf<K: Kernel>(&self, wo: Vec3, wi: Vec3) -> f32 {
        each!(self, lobe => lobe.pdf(wo, wi), else 0.0)
    }

    /// [`Lobe::eval`] and [`Lobe::pdf`], which may have much in common.
    #[inline]
    pub(crate) fn eval_and_pdf<K: Kernel>(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        match self {
            Self::GgxReflection(lobe) => lobe.eval_and_pdf(wo, wi),
            _ => (self.eval::<K>(wo, wi), self.pdf::<K>(wo, wi)),
        }
    }

    /// Draws a direction. `None`: the light of this draw is lost.
    pub(crate) fn sample<K: Kernel>(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        each!(self, lobe => lobe.sample(wo, u), else None)
    }

    /// By how much radiance changes on the way through, beside what is lost: see `SpecularTransmission::scale`.
    pub(crate) fn scale(&self) -> f32 {
        match self {
            Self::SpecularTransmission(lobe) => lobe.scale,
            Self::GgxTransmission(lobe) => lobe.scale,
            _ => 1.0,
        }
    }

    /// About how much of the light from everywhere goes to `wo`: for choosing between lobes.
    pub(crate) fn albedo<K: Kernel>(&self, wo: Vec3) -> Vec3 {
        each!(self, lobe => lobe.albedo(wo), else Vec3::ZERO)
    }
}

#[cfg(test)]
mod tests;
