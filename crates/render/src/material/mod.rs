//! Materials: compiled from the scene's descriptions, evaluated at a hit into the lobes that scatter there.

mod bsdf;
pub(crate) mod dispersion;
mod energy;
pub(crate) mod fresnel;
pub(crate) mod layers;
pub(crate) mod lobes;
mod microfacet;
mod pbr;
mod thin_film;

use std::sync::Arc;

use firsthit_import::scene::{ImageDesc, MaterialDesc, MaterialModel, TextureRef};
use glam::Vec3;

pub(crate) use bsdf::Bsdf;
pub(crate) use dispersion::Colors;
use fresnel::Fresnel;
use lobes::{GgxReflection, GgxTransmission, Lambert, Lobe, SpecularReflection, SpecularTransmission};
use microfacet::Masking;
use pbr::Pbr;

use crate::kernel::Kernel;
use crate::surface::Surface;
use crate::texture::{ColorSpace, Layout, Texture, TextureLookup};
use crate::{EffectSet, StageError, tally};

/// Smoothest surface that is treated as rough: below it, a delta function is nearer to the truth than f32.
const LEAST_ALPHA: f32 = 1e-3;

/// What is decided once for all materials.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conventions {
    /// As the reference scenes have it: see `Settings::reference_conventions`.
    pub(crate) reference: bool,
    /// Effects that are left out are not compiled into the materials.
    pub(crate) effects: EffectSet,
    /// Light that bounces between the facets of rough glTF materials is not lost.
    pub(crate) energy_compensation: bool,
}

/// A material, ready to be evaluated.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    model: Model,
    conventions: Conventions,
    /// Light that is taken away inside, per unit of length.
    pub(crate) absorption: Vec3,
    /// Boundary of a solid through which light goes.
    pub(crate) solid: bool,
    /// Index of refraction of the solid.
    pub(crate) ior: f32,
    /// Light of different colours goes through in different directions.
    pub(crate) parts_colors: bool,
}

#[derive(Clone, Debug)]
enum Model {
    Pbr(Box<Pbr>),
    /// With layers over its base: shaded by code of its own, so that plain materials pay nothing for it.
    Layered(Box<Pbr>),
    Diffuse(Vec3),
    Mirror(Vec3),
    Glass,
    RoughMirror {
        alpha: f32,
        reflectance: Vec3,
    },
    RoughGlass {
        alpha: f32,
    },
    Emission(Vec3),
}

/// What a surface does with light at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shading<K: Kernel> {
    /// How it scatters.
    pub(crate) bsdf: Bsdf<K>,
    /// What it sends to the viewer by itself.
    pub(crate) emission: Vec3,
    /// Its colour, for the picture of that name.
    pub(crate) base_color: Vec3,
}

/// Textures of a scene, decoded when a material first asks for them.
pub(crate) struct Textures<'a> {
    images: &'a [ImageDesc],
    mips: bool,
    made: Made,
    /// All ways in which textures are laid out.
    layouts: Vec<Layout>,
}

/// For each image what was made of it: as data, and as colours.
pub(crate) type Made = Vec<[Option<Arc<Texture>>; 2]>;

impl<'a> Textures<'a> {
    pub(crate) fn new(images: &'a [ImageDesc], mips: bool) -> Self {
        Self { images, mips, made: vec![[None, None]; images.len()], layouts: Vec::new() }
    }

    /// Takes over what was made of images whose pixels are the very same.
    pub(crate) fn take_over(&mut self, images: &[ImageDesc], made: &Made) {
        for (k, (old, made)) in images.iter().zip(made).enumerate() {
            if self.images.get(k).is_some_and(|new| new.pixels.is_same(&old.pixels)) {
                self.made[k].clone_from(made);
            }
        }
    }

    pub(crate) fn made(self) -> Made {
        self.made
    }

    fn get(&mut self, reference: Option<&TextureRef>, space: ColorSpace) -> Result<Option<TextureLookup>, StageError> {
        let Some(reference) = reference else { return Ok(None) };
        let slot = self
            .made
            .get_mut(reference.image)
            .map(|slots| &mut slots[usize::from(space == ColorSpace::Srgb)])
            .ok_or(StageError::NoSuchImage(reference.image))?;
        let texture = match slot {
            Some(texture) => texture.clone(),
            None => slot.insert(Arc::new(Texture::new(&self.images[reference.image], space)?)).clone(),
        };
        Ok(Some(TextureLookup::new(texture, reference, self.mips).numbered(&mut self.layouts)))
    }
}

impl Material {
    pub(crate) fn new(
        desc: &MaterialDesc,
        textures: &mut Textures<'_>,
        conventions: Conventions,
    ) -> Result<Self, StageError> {
        let mut material = Self {
            model: Model::Glass,
            conventions,
            absorption: Vec3::ZERO,
            solid: false,
            ior: 1.0,
            parts_colors: false,
        };
        material.model = match &desc.model {
            MaterialModel::Pbr(desc) => {
                let pbr = Pbr::new(desc, textures, conventions)?;
                if pbr.is_solid() {
                    material.solid = true;
                    material.ior = desc.ior;
                    material.absorption = pbr::absorption(desc, conventions);
                    material.parts_colors = pbr.parts_colors();
                }
                if pbr.is_layered() { Model::Layered(Box::new(pbr)) } else { Model::Pbr(Box::new(pbr)) }
            }
            MaterialModel::Diffuse { albedo } => Model::Diffuse(*albedo),
            MaterialModel::Mirror { reflectance } => Model::Mirror(*reflectance),
            MaterialModel::Glass { ior } => {
                (material.solid, material.ior) = (true, *ior);
                Model::Glass
            }
            MaterialModel::RoughMirror { alpha, reflectance } => {
                Model::RoughMirror { alpha: alpha.max(LEAST_ALPHA), reflectance: *reflectance }
            }
            MaterialModel::RoughGlass { ior, alpha } => {
                (material.solid, material.ior) = (true, *ior);
                Model::RoughGlass { alpha: alpha.max(LEAST_ALPHA) }
            }
            MaterialModel::Emission { radiance } => {
                let glows = conventions.effects.contains(EffectSet::EMISSION);
                Model::Emission(if glows { *radiance } else { Vec3::ZERO })
            }
        };
        Ok(material)
    }

    fn pbr(&self) -> Option<&Pbr> {
        if let Model::Pbr(pbr) | Model::Layered(pbr) = &self.model { Some(pbr) } else { None }
    }

    /// Whether its back faces are not there, as glTF says of single-sided materials. That holds for shadow rays too:
    /// what is seen through a hidden back face is lit through it.
    pub(crate) fn culls(&self) -> bool {
        !self.solid && self.pbr().is_some_and(|p| !p.double_sided)
    }

    /// Whether it has holes, is partly there, or lets light straight through: shadow rays have to ask.
    pub(crate) fn lets_through(&self) -> bool {
        self.has_alpha() || self.is_clear()
    }

    /// Whether a kernel has to know of light that goes through it.
    pub(crate) fn goes_through(&self) -> bool {
        self.solid || self.is_clear()
    }

    /// Whether a kernel has to know of layers.
    pub(crate) fn is_layered(&self) -> bool {
        matches!(self.model, Model::Layered(_))
    }

    /// Whether it looks textures up. Of layers it is taken for granted.
    pub(crate) fn is_textured(&self) -> bool {
        self.pbr().is_some_and(Pbr::is_textured)
    }

    /// Whether its alpha counts.
    pub(crate) fn has_alpha(&self) -> bool {
        self.pbr().is_some_and(Pbr::has_alpha)
    }

    /// Whether shadow rays may pass it with a change of colour.
    pub(crate) fn is_clear(&self) -> bool {
        !self.conventions.reference
            && match &self.model {
                Model::Glass | Model::RoughGlass { .. } => true,
                Model::Pbr(pbr) | Model::Layered(pbr) => pbr.is_clear(),
                _ => false,
            }
    }

    /// Whether light that goes through the boundary is not scattered there.
    pub(crate) fn is_smooth<K: Kernel>(&self, surface: &Surface<'_>) -> bool {
        match &self.model {
            Model::RoughGlass { .. } => false,
            Model::Pbr(pbr) | Model::Layered(pbr) => pbr.is_smooth::<K>(surface),
            _ => true,
        }
    }

    /// How much of the surface is there: 1 all, 0 nothing.
    pub(crate) fn coverage<K: Kernel>(&self, surface: &Surface<'_>) -> f32 {
        self.pbr().map_or(1.0, |p| p.coverage::<K>(surface))
    }

    /// What light keeps that passes straight through the surface at this cosine, where it is there.
    pub(crate) fn straight_through<K: Kernel>(&self, surface: &Surface<'_>, cos: f32) -> Vec3 {
        if self.conventions.reference {
            return Vec3::ZERO;
        }
        match &self.model {
            Model::Glass | Model::RoughGlass { .. } => {
                // From either side the angle outside counts; the ray is taken as not bent.
                Vec3::splat(1.0 - fresnel::dielectric(cos, self.ior.max(1.0)))
            }
            Model::Pbr(pbr) | Model::Layered(pbr) => pbr.straight_through::<K>(surface, cos),
            _ => Vec3::ZERO,
        }
    }

    /// Whether the surface glows.
    pub(crate) fn glows(&self) -> bool {
        match &self.model {
            Model::Pbr(pbr) | Model::Layered(pbr) => pbr.glows(),
            Model::Emission(radiance) => radiance.max_element() > 0.0,
            _ => false,
        }
    }

    /// Radiance of its glow where that is brightest, by its brightest colour, if no texture shows more than white.
    pub(crate) fn brightest_glow(&self) -> f32 {
        match &self.model {
            Model::Pbr(pbr) | Model::Layered(pbr) => pbr.brightest_glow(),
            Model::Emission(radiance) => radiance.max_element(),
            _ => 0.0,
        }
    }

    /// What its glow is multiplied with.
    pub(crate) fn emissive_texture(&self) -> Option<&TextureLookup> {
        self.pbr().and_then(Pbr::emissive_texture)
    }

    /// Whether it glows on both sides.
    pub(crate) fn glows_on_both_sides(&self) -> bool {
        self.pbr().is_some_and(|p| p.double_sided)
    }

    /// Whether it glows the same everywhere.
    pub(crate) fn glows_evenly(&self) -> bool {
        self.pbr().is_none_or(Pbr::glows_evenly)
    }

    /// Whether it does not glow the same in all directions.
    pub(crate) fn glow_depends_on_view(&self) -> bool {
        self.pbr().is_some_and(Pbr::glow_depends_on_view)
    }

    /// Radiance sent to the viewer by the surface itself.
    pub(crate) fn emission<K: Kernel>(&self, surface: &Surface<'_>) -> Vec3 {
        match &self.model {
            Model::Pbr(pbr) | Model::Layered(pbr) if surface.front || pbr.double_sided => {
                pbr.emission::<K>(surface, self.conventions)
            }
            Model::Emission(radiance) if surface.front => {
                tally::sample(EffectSet::EMISSION);
                *radiance
            }
            _ => Vec3::ZERO,
        }
    }

    /// Radiance that the surface sends to a light's sample there: alpha lets through what it does not cover.
    pub(crate) fn glow<K: Kernel>(&self, surface: &Surface<'_>) -> Vec3 {
        self.emission::<K>(surface) * self.coverage::<K>(surface)
    }

    /// Everything about the surface at one point.
    pub(crate) fn shade<K: Kernel>(&self, surface: &Surface<'_>) -> Shading<K> {
        let emission = self.emission::<K>(surface);
        let normal = match &self.model {
            Model::Pbr(pbr) => return pbr.shade::<K, false>(surface, self.conventions, emission),
            Model::Layered(pbr) if K::LAYERS => return pbr.shade::<K, true>(surface, self.conventions, emission),
            Model::Diffuse(_) | Model::Emission(_) | Model::Layered(_) => surface.smooth,
            _ => self.bent(surface),
        };
        let mut shading = Shading { bsdf: Bsdf::new(normal), emission, base_color: Vec3::ZERO };
        let Shading { bsdf, base_color, .. } = &mut shading;
        match &self.model {
            Model::Diffuse(albedo) => {
                *base_color = *albedo;
                bsdf.add(Lobe::Lambert(Lambert { albedo: *albedo, coat: None }));
            }
            Model::Mirror(reflectance) => {
                *base_color = *reflectance;
                bsdf.add(Lobe::SpecularReflection(SpecularReflection { fresnel: Fresnel::Constant(*reflectance) }));
            }
            Model::Glass if K::THROUGH => {
                *base_color = Vec3::ONE;
                let eta = self.eta(surface);
                let fresnel = Fresnel::Dielectric { eta };
                bsdf.add(Lobe::SpecularReflection(SpecularReflection { fresnel }));
                let (tint, scale) = (Vec3::ONE, self.scaling(eta));
                bsdf.add(Lobe::SpecularTransmission(SpecularTransmission { eta, fresnel, tint, scale }));
            }
            Model::RoughMirror { alpha, reflectance } => {
                *base_color = *reflectance;
                let (alpha, fresnel) = (*alpha, Fresnel::Constant(*reflectance));
                let lobe = GgxReflection { alpha, fresnel, masking: Masking::Correlated, scale: Vec3::ONE };
                bsdf.add(Lobe::GgxReflection(lobe));
            }
            Model::RoughGlass { alpha } if K::THROUGH => {
                *base_color = Vec3::ONE;
                let eta = self.eta(surface);
                let (alpha, fresnel) = (*alpha, Fresnel::Dielectric { eta });
                let reflection = GgxReflection { alpha, fresnel, masking: Masking::Separate, scale: Vec3::ONE };
                bsdf.add(Lobe::GgxReflection(reflection));
                let (tint, scale) = (Vec3::ONE, self.scaling(eta));
                bsdf.add(Lobe::GgxTransmission(GgxTransmission { alpha, eta, fresnel, tint, scale }));
            }
            // All but what glows is met by kernels that can do it alone.
            Model::Emission(_) | Model::Pbr(_) | Model::Layered(_) | Model::Glass | Model::RoughGlass { .. } => {}
        }
        shading
    }

    fn bent(&self, surface: &Surface<'_>) -> Vec3 {
        if self.conventions.reference { surface.smooth } else { surface.bent(surface.smooth) }
    }

    /// Index of the other side over that of the viewer's side.
    fn eta(&self, surface: &Surface<'_>) -> f32 {
        if surface.front { self.ior } else { 1.0 / self.ior }
    }

    /// Radiance changes with the square of the index. Between things that light enters and leaves again this cancels.
    /// Where shadow rays pass solids unbent, and therefore unscaled, it has to be left out for both.
    fn scaling(&self, eta: f32) -> f32 {
        if self.conventions.reference { 1.0 / (eta * eta) } else { 1.0 }
    }
}
