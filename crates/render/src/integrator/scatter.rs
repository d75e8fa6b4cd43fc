//! A surface's lobes as one: drawn from by chance, weighed together.

use glam::Vec3;

use crate::kernel::{Kernel, MAX_LOBES};
use crate::material::Bsdf;
use crate::material::lobes::{Lobe, LobeKind};

/// A way on from a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scattered {
    /// Where the light comes from, in the frame of the lobes.
    pub(super) wi: Vec3,
    /// f |cos| / density of all lobes together; of a delta lobe the share of light over its chance.
    pub(super) weight: Vec3,
    /// Density of all followed lobes together; `None` for a delta lobe.
    pub(super) pdf: Option<f32>,
    /// Which lobe it was drawn from.
    pub(super) lobe: usize,
}

/// How much is scattered from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Towards {
    /// f |cos| of the lobes that are followed.
    pub(super) followed: Vec3,
    /// That of the others, whose light is found by asking alone.
    pub(super) others: Vec3,
    /// Density of all followed lobes together.
    pub(super) pdf: f32,
}

/// How a surface scatters towards one viewer.
pub(super) struct Scatter<'a, K: Kernel> {
    bsdf: &'a Bsdf<K>,
    wo: Vec3,
    /// How often each lobe is followed.
    chances: [f32; MAX_LOBES],
    /// Whether light from a chosen direction is scattered at all: not all lobes are delta functions.
    pub(super) spreads: bool,
}

/// Whether it scatters in one direction alone.
pub(super) fn is_delta(lobe: &Lobe) -> bool {
    matches!(lobe, Lobe::SpecularReflection(_) | Lobe::SpecularTransmission(_))
}

/// What following a lobe is: mirroring, going through, or (diffuse, or a coat so rough that it is as good as diffuse)
/// gathering the light between surfaces.
pub(super) fn family(lobe: &Lobe) -> LobeKind {
    let even = match lobe {
        Lobe::GgxReflection(ggx) => is_even(ggx.alpha, || ggx.fresnel.reflectance(1.0)),
        Lobe::AnisotropicGgx(ggx) => is_even(ggx.alpha.min_element(), || ggx.fresnel.reflectance(1.0)),
        Lobe::Clearcoat(coat) => coat.alpha > super::ROUGHEST_FOLLOWED,
        _ => false,
    };
    if even { LobeKind::DIFFUSE } else { lobe.kind() }
}

fn is_even(alpha: f32, reflectance: impl FnOnce() -> Vec3) -> bool {
    alpha > super::ROUGHEST_FOLLOWED && reflectance().max_element() < 0.2
}

impl<'a, K: Kernel> Scatter<'a, K> {
    /// `throughput` is that of the path up to here: lobes are chosen by what they add to it.
    #[inline]
    pub(super) fn new(bsdf: &'a Bsdf<K>, viewer: Vec3, throughput: Vec3, follow: LobeKind) -> Self {
        let wo = bsdf.local(viewer);
        let mut chances = [0.0; MAX_LOBES];
        if let [lobe] = bsdf.lobes() {
            chances[0] = f32::from(u8::from(follow.contains(family(lobe))));
            return Self { bsdf, wo, chances, spreads: !is_delta(lobe) };
        }
        let (mut spreads, mut sum) = (false, 0.0);
        for (chance, lobe) in chances.iter_mut().zip(bsdf.lobes()) {
            spreads |= !is_delta(lobe);
            if follow.contains(family(lobe)) {
                *chance = (throughput * lobe.albedo::<K>(wo)).max_element().max(0.0);
                sum += *chance;
            }
        }
        let scale = if sum > 0.0 && sum.is_finite() { 1.0 / sum } else { 0.0 };
        for chance in &mut chances {
            *chance *= scale;
        }
        Self { bsdf, wo, chances, spreads }
    }

    /// Leaves only what goes on in one direction.
    pub(super) fn keep_mirrors(&mut self) {
        let mut sum = 0.0;
        for (chance, lobe) in self.chances.iter_mut().zip(self.bsdf.lobes()) {
            *chance *= f32::from(u8::from(is_delta(lobe)));
            sum += *chance;
        }
        for chance in self.chances.iter_mut().filter(|c| **c > 0.0) {
            *chance /= sum;
        }
        self.spreads = false;
    }

    /// f |cos| towards a direction of the lobes' frame, and the density with which following would have found it.
    #[inline]
    pub(super) fn towards(&self, wi: Vec3) -> Towards {
        let mut towards = Towards { followed: Vec3::ZERO, others: Vec3::ZERO, pdf: 0.0 };
        for (lobe, chance) in self.bsdf.lobes().iter().zip(self.chances) {
            if chance > 0.0 {
                let (f, pdf) = lobe.eval_and_pdf::<K>(self.wo, wi);
                towards.followed += f;
                towards.pdf += chance * pdf;
            } else {
                towards.others += lobe.eval::<K>(self.wo, wi);
            }
        }
        towards
    }

    /// Draws a lobe by the first number and a direction by the others.
    #[inline]
    pub(super) fn sample(&self, choice: impl FnOnce() -> f32, u: [f32; 2]) -> Option<Scattered> {
        let lobes = self.bsdf.lobes();
        let mut index = self.chances.iter().position(|c| *c > 0.0)?;
        if self.chances[index] < 1.0 {
            let mut left = choice();
            for (i, chance) in self.chances.iter().enumerate().filter(|(_, c)| **c > 0.0) {
                index = i;
                left -= chance;
                if left < 0.0 {
                    break;
                }
            }
        }
        let (lobe, chance) = (lobes.get(index)?, self.chances[index]);
        let sample = lobe.sample::<K>(self.wo, u)?;
        let Some(own) = sample.pdf else {
            return Some(Scattered { wi: sample.wi, weight: sample.weight / chance, pdf: None, lobe: index });
        };
        if lobes.len() == 1 {
            return Some(Scattered { wi: sample.wi, weight: sample.weight, pdf: Some(own), lobe: index });
        }
        // What was drawn is known without asking the lobe again.
        let (mut f, mut pdf) = (sample.weight * own, chance * own);
        for (i, (other, chance)) in lobes.iter().zip(self.chances).enumerate() {
            if i != index && chance > 0.0 {
                let (other, density) = other.eval_and_pdf::<K>(self.wo, sample.wi);
                f += other;
                pdf += chance * density;
            }
        }
        let weight = f / pdf;
        (pdf > 0.0 && weight.is_finite()).then_some(Scattered { wi: sample.wi, weight, pdf: Some(pdf), lobe: index })
    }
}
