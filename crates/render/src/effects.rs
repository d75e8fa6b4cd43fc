//! Which effects a scene calls for: only those are simulated.

use bitflags::bitflags;

use crate::tally::Tally;
use crate::{RayCounts, RayKind};

bitflags! {
    /// A set of effects.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct EffectSet: u32 {
        /// Shadow rays.
        const SHADOWS = 1 << 0;
        /// Point, spot and directional lights.
        const PUNCTUAL_LIGHTS = 1 << 1;
        /// Glowing surfaces, sampled as lights.
        const AREA_LIGHTS = 1 << 2;
        /// Light from around the scene.
        const ENVIRONMENT = 1 << 3;
        /// Mirror and glossy reflection rays.
        const REFLECTION = 1 << 4;
        /// Refraction rays through solids.
        const REFRACTION = 1 << 5;
        /// Thin transmission.
        const TRANSMISSION = 1 << 6;
        /// Surfaces with holes by alpha.
        const ALPHA_MASK = 1 << 7;
        /// Surfaces that cover in part.
        const ALPHA_BLEND = 1 << 8;
        /// Colour and other textures.
        const TEXTURES = 1 << 9;
        /// Normal and bump maps.
        const NORMAL_MAPS = 1 << 10;
        /// Surfaces that glow.
        const EMISSION = 1 << 11;
        /// Absorption inside solids.
        const ABSORPTION = 1 << 12;
        /// Vertex colours.
        const VERTEX_COLORS = 1 << 13;
        /// Surfaces shown as they are.
        const UNLIT = 1 << 14;
        /// Ambient occlusion: of the even light in rooms that are lit from the camera, or as a picture of its own.
        const AMBIENT_OCCLUSION = 1 << 15;
        /// Section planes.
        const CLIPPING = 1 << 16;
        /// Clear coats.
        const CLEARCOAT = 1 << 20;
        /// Sheen of fibres.
        const SHEEN = 1 << 21;
        /// Hues of thin films.
        const IRIDESCENCE = 1 << 22;
        /// Brushed reflections.
        const ANISOTROPY = 1 << 23;
        /// Light that goes through diffusely.
        const DIFFUSE_TRANSMISSION = 1 << 24;
        /// Indices of refraction that differ between colours.
        const DISPERSION = 1 << 25;
        /// Blur before and behind where the camera's lens is sharp.
        const DEPTH_OF_FIELD = 1 << 18;
        /// Blur of what moves while the shutter is open.
        const MOTION = 1 << 19;
        /// Fog. Only path tracing simulates it.
        const FOG = 1 << 26;
        /// Light that surfaces send to each other. Path tracing and light tracing simulate it.
        const INDIRECT_LIGHT = 1 << 17;
    }
}

impl EffectSet {
    /// Those by which light goes through surfaces.
    pub(crate) const THROUGH: Self =
        Self::REFRACTION.union(Self::TRANSMISSION).union(Self::ABSORPTION).union(Self::DISPERSION);
    /// Those of what is laid over the base of a material.
    pub(crate) const LAYERS: Self = Self::CLEARCOAT
        .union(Self::SHEEN)
        .union(Self::IRIDESCENCE)
        .union(Self::ANISOTROPY)
        .union(Self::DIFFUSE_TRANSMISSION);

    /// Every single effect with the name that command lines and reports use, in the order of reports.
    pub const NAMES: [(Self, &'static str); 27] = [
        (Self::SHADOWS, "shadows"),
        (Self::PUNCTUAL_LIGHTS, "punctual-lights"),
        (Self::AREA_LIGHTS, "area-lights"),
        (Self::ENVIRONMENT, "environment"),
        (Self::REFLECTION, "reflection"),
        (Self::REFRACTION, "refraction"),
        (Self::TRANSMISSION, "transmission"),
        (Self::ALPHA_MASK, "alpha-mask"),
        (Self::ALPHA_BLEND, "alpha-blend"),
        (Self::TEXTURES, "textures"),
        (Self::NORMAL_MAPS, "normal-maps"),
        (Self::EMISSION, "emission"),
        (Self::ABSORPTION, "absorption"),
        (Self::VERTEX_COLORS, "vertex-colors"),
        (Self::UNLIT, "unlit"),
        (Self::AMBIENT_OCCLUSION, "ambient-occlusion"),
        (Self::CLIPPING, "clipping"),
        (Self::CLEARCOAT, "clearcoat"),
        (Self::SHEEN, "sheen"),
        (Self::IRIDESCENCE, "iridescence"),
        (Self::ANISOTROPY, "anisotropy"),
        (Self::DIFFUSE_TRANSMISSION, "diffuse-transmission"),
        (Self::DISPERSION, "dispersion"),
        (Self::DEPTH_OF_FIELD, "depth-of-field"),
        (Self::MOTION, "motion"),
        (Self::FOG, "fog"),
        (Self::INDIRECT_LIGHT, "indirect-light"),
    ];

    /// The set with one effect of this name (`ao` is short for `ambient-occlusion`).
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        let name = if name == "ao" { "ambient-occlusion" } else { name };
        Self::NAMES.iter().find(|(_, n)| *n == name).map(|(e, _)| *e)
    }
}

/// What is known about one effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectEntry {
    /// The effect: one bit.
    pub effect: EffectSet,
    /// Its name, as in [`EffectSet::NAMES`].
    pub name: &'static str,
    /// Whether something in the scene or the options calls for it.
    pub called_for: bool,
    /// What calls for it: "material 'glass'", "2 point lights", "option".
    pub by: Vec<String>,
    /// Whether it is simulated: called for, unless the caller overrides.
    pub simulated: bool,
    /// Rays cast for it; `None` before rendering, and for effects that cast none of their own.
    pub rays: Option<u64>,
    /// How often it was evaluated at a point, or a light of its kind was asked; `None` before rendering, and for effects
    /// that their rays alone tell of.
    pub samples: Option<u64>,
    /// Look-ups of images for it; `None` before rendering, and for effects that have none.
    pub look_ups: Option<u64>,
    /// Processor seconds (summed over threads) in its rays, extrapolated from a sample of timed pixels; `None` as for
    /// `rays`.
    pub seconds: Option<f64>,
}

/// For each effect: who calls for it, and whether it is simulated. After rendering: what it cost.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectPlan {
    /// One entry for each effect, in the order of [`EffectSet::NAMES`].
    pub entries: Vec<EffectEntry>,
}

impl Default for EffectPlan {
    fn default() -> Self {
        let entry = |&(effect, name): &(EffectSet, &'static str)| EffectEntry {
            effect,
            name,
            called_for: false,
            by: Vec::new(),
            simulated: false,
            rays: None,
            samples: None,
            look_ups: None,
            seconds: None,
        };
        Self { entries: EffectSet::NAMES.iter().map(entry).collect() }
    }
}

impl EffectPlan {
    /// Notes that something calls for effects.
    pub(crate) fn call(&mut self, effects: EffectSet, by: impl Into<String>) {
        let by = by.into();
        for entry in self.entries.iter_mut().filter(|e| effects.contains(e.effect)) {
            entry.called_for = true;
            if !entry.by.contains(&by) {
                entry.by.push(by.clone());
            }
        }
    }

    /// Notes that the caller asks for an effect, whatever the scene calls for.
    pub(crate) fn ask(&mut self, effect: EffectSet, by: &str) {
        self.call(effect, by);
        for entry in self.entries.iter_mut().filter(|e| effect.contains(e.effect)) {
            entry.simulated = true;
        }
    }

    /// Notes that an effect is not simulated, whatever is called for.
    pub(crate) fn leave(&mut self, effect: EffectSet) {
        for entry in self.entries.iter_mut().filter(|e| effect.contains(e.effect)) {
            entry.simulated = false;
        }
    }

    /// Decides what is simulated: what is called for, changed by the caller's wishes.
    pub(crate) fn decide(&mut self, wishes: &crate::EffectOverrides) {
        let set = (wishes.only.unwrap_or_else(|| self.called_for()) | wishes.add) - wishes.remove;
        for entry in &mut self.entries {
            entry.simulated = set.contains(entry.effect);
        }
    }

    /// What the scene calls for.
    #[must_use]
    pub fn called_for(&self) -> EffectSet {
        self.entries.iter().filter(|e| e.called_for).map(|e| e.effect).collect()
    }

    /// What is simulated.
    #[must_use]
    pub fn simulated(&self) -> EffectSet {
        self.entries.iter().filter(|e| e.simulated).map(|e| e.effect).collect()
    }

    /// The plan with what the effects cost.
    pub(crate) fn with_costs(
        &self,
        rays: &RayCounts,
        tally: &Tally,
        seconds_per_ray: impl Fn(RayKind) -> Option<f64>,
    ) -> Self {
        let mut plan = self.clone();
        for entry in &mut plan.entries {
            entry.samples = tally.samples(entry.effect);
            entry.look_ups = tally.look_ups(entry.effect);
            let kinds = kinds_of(entry.effect);
            if kinds.is_empty() {
                continue;
            }
            entry.rays = Some(kinds.iter().map(|&k| rays[k]).sum());
            entry.seconds = kinds
                .iter()
                .filter(|&&k| rays[k] > 0)
                .map(|&k| seconds_per_ray(k).map(|s| s * rays[k] as f64))
                .sum::<Option<f64>>()
                // The sum of nothing is -0.
                .map(f64::abs);
        }
        plan
    }
}

/// The kinds of rays that are cast for an effect alone.
fn kinds_of(effect: EffectSet) -> &'static [RayKind] {
    use RayKind::{
        AmbientOcclusion, Indirect, Reflection, Refraction, ShadowArea, ShadowEnvironment, ShadowPunctual,
        Transmission, Transparency,
    };
    match effect {
        EffectSet::SHADOWS => &[ShadowPunctual, ShadowArea, ShadowEnvironment],
        EffectSet::PUNCTUAL_LIGHTS => &[ShadowPunctual],
        EffectSet::AREA_LIGHTS => &[ShadowArea],
        EffectSet::ENVIRONMENT => &[ShadowEnvironment],
        EffectSet::REFLECTION => &[Reflection],
        EffectSet::INDIRECT_LIGHT => &[Indirect],
        EffectSet::REFRACTION => &[Refraction],
        EffectSet::TRANSMISSION => &[Transmission],
        EffectSet::ALPHA_BLEND => &[Transparency],
        EffectSet::AMBIENT_OCCLUSION => &[AmbientOcclusion],
        EffectSet::FOG => &[RayKind::Fog],
        _ => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EffectOverrides;

    #[test]
    fn every_effect_has_one_name() {
        let all: EffectSet = EffectSet::NAMES.iter().map(|(e, _)| *e).collect();
        assert_eq!(all, EffectSet::all());
        for (effect, name) in EffectSet::NAMES {
            assert_eq!(EffectSet::by_name(name), Some(effect));
        }
        assert_eq!(EffectSet::by_name("ao"), Some(EffectSet::AMBIENT_OCCLUSION));
        assert_eq!(EffectSet::by_name("magic"), None);
    }

    #[test]
    fn wishes_change_what_is_simulated_but_not_what_is_called_for() {
        let mut plan = EffectPlan::default();
        plan.call(EffectSet::SHADOWS | EffectSet::TEXTURES, "test");
        plan.call(EffectSet::SHADOWS, "test");
        plan.decide(&EffectOverrides { only: None, add: EffectSet::AMBIENT_OCCLUSION, remove: EffectSet::SHADOWS });
        assert_eq!(plan.called_for(), EffectSet::SHADOWS | EffectSet::TEXTURES);
        assert_eq!(plan.simulated(), EffectSet::AMBIENT_OCCLUSION | EffectSet::TEXTURES);
        assert_eq!(plan.entries[0].by, ["test"]);
    }
}
