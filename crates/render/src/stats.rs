//! What rendering did: rays by kind, samples, seconds.

use std::ops::{AddAssign, Index, IndexMut};

/// Why a ray is cast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RayKind {
    /// From the camera.
    Camera,
    /// Towards a point, spot or directional light.
    ShadowPunctual,
    /// Towards a glowing surface.
    ShadowArea,
    /// Towards the environment.
    ShadowEnvironment,
    /// Mirrored or glossy.
    Reflection,
    /// From a surface that scatters evenly, to find the light that surfaces send to each other.
    Indirect,
    /// Into or out of a solid.
    Refraction,
    /// Through a thin transmissive surface.
    Transmission,
    /// On through a surface that covers in part.
    Transparency,
    /// For ambient occlusion.
    AmbientOcclusion,
    /// On from where fog scattered a path.
    Fog,
    /// From a light.
    Light,
    /// From what light has met towards the camera.
    ToCamera,
}

impl RayKind {
    /// All kinds, in the order of reports.
    pub const ALL: [Self; 13] = [
        Self::Camera,
        Self::ShadowPunctual,
        Self::ShadowArea,
        Self::ShadowEnvironment,
        Self::Reflection,
        Self::Indirect,
        Self::Refraction,
        Self::Transmission,
        Self::Transparency,
        Self::AmbientOcclusion,
        Self::Fog,
        Self::Light,
        Self::ToCamera,
    ];

    /// The name used in reports; the three kinds of shadow ray share one.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::ShadowPunctual | Self::ShadowArea | Self::ShadowEnvironment => "shadow",
            Self::Reflection => "reflection",
            Self::Indirect => "indirect",
            Self::Refraction => "refraction",
            Self::Transmission => "transmission",
            Self::Transparency => "transparency",
            Self::AmbientOcclusion => "ambient-occlusion",
            Self::Fog => "fog",
            Self::Light => "light",
            Self::ToCamera => "to-camera",
        }
    }
}

/// How many rays of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts([u64; RayKind::ALL.len()]);

impl RayCounts {
    /// Rays of all kinds together.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }

    /// Shadow rays towards all kinds of light.
    #[must_use]
    pub fn shadow(&self) -> u64 {
        self[RayKind::ShadowPunctual] + self[RayKind::ShadowArea] + self[RayKind::ShadowEnvironment]
    }

    /// Name and number of each kind by [`RayKind::name`], in the order of reports.
    #[must_use]
    pub fn by_name(&self) -> Vec<(&'static str, u64)> {
        let mut list: Vec<(&'static str, u64)> = Vec::new();
        for kind in RayKind::ALL {
            match list.iter_mut().find(|(name, _)| *name == kind.name()) {
                Some((_, n)) => *n += self[kind],
                None => list.push((kind.name(), self[kind])),
            }
        }
        list
    }
}

impl Index<RayKind> for RayCounts {
    type Output = u64;
    fn index(&self, kind: RayKind) -> &u64 {
        &self.0[kind as usize]
    }
}

impl IndexMut<RayKind> for RayCounts {
    fn index_mut(&mut self, kind: RayKind) -> &mut u64 {
        &mut self.0[kind as usize]
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += b;
        }
    }
}

/// Shares of the time of samples, as measured on some pixels: in [0, 1], together at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Breakdown {
    /// Rays on their way, with what hits are asked before they count (alpha, culling).
    pub traversal: f64,
    /// Look-ups of textures where paths scatter.
    pub texturing: f64,
    /// Sample points.
    pub sampling: f64,
}

impl Breakdown {
    /// The rest: camera, surfaces, materials, lights, sums.
    #[must_use]
    pub fn shading(&self) -> f64 {
        1.0 - (self.traversal + self.texturing + self.sampling)
    }
}

/// What paths from the lights did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightPaths {
    /// Paths that were begun.
    pub paths: u64,
    /// Points where light met a surface that spreads it.
    pub vertices: u64,
    /// Those of them that the camera saw.
    pub seen: u64,
}

impl LightPaths {
    /// The share of points that the camera saw; `None` where there are none.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.vertices > 0).then(|| self.seen as f64 / self.vertices as f64)
    }
}

impl AddAssign for LightPaths {
    fn add_assign(&mut self, other: Self) {
        self.paths += other.paths;
        self.vertices += other.vertices;
        self.seen += other.seen;
    }
}

/// What a render did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderStats {
    /// Rays by kind.
    pub rays: RayCounts,
    /// Samples taken.
    pub samples: u64,
    /// Samples whose radiance was not finite or negative, and was dropped to black. Always 0 unless something is
    /// wrong with the scene's numbers.
    pub bad_samples: u64,
    /// The estimated noise of the noisiest tile, as of
    /// [`RenderOptions::noise_threshold`](crate::RenderOptions::noise_threshold); `None` below 32 samples.
    pub noise: Option<f32>,
    /// What paths from the lights did: nothing, but for the integrator `light`.
    pub light: LightPaths,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Where the time went, by path tracing, if [`RenderOptions::profile`](crate::RenderOptions::profile) asks for it.
    pub breakdown: Option<Breakdown>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadow_rays_are_reported_as_one_kind() {
        let mut counts = RayCounts::default();
        counts[RayKind::ShadowArea] += 2;
        counts[RayKind::ShadowPunctual] += 3;
        counts += counts;
        assert_eq!(counts.shadow(), 10);
        assert_eq!(counts.by_name()[1], ("shadow", 10));
        assert_eq!(counts.by_name().len(), 11);
        assert_eq!(counts.total(), 10);
    }
}
