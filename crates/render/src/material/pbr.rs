//! glTF's physically based material.
//!
//! The core is appendix B of the glTF 2.0 specification as its sample implementation has it; the extensions ior,
//! specular, transmission, volume, emissive_strength and unlit follow their own texts, with two liberties that a ray
//! tracer wants: solids (volume) refract and absorb along the real way through the mesh instead of `thickness`, and
//! seen from inside, Schlick's formula takes the refracted angle, so that total internal reflection is right. What other
//! extensions lay over the base or let through it is in [`super::layers`].
//!
//! From the top: clear coat, sheen, then the base, of which a film, if there is one, is the reflectance. A layer leaves
//! to those below what it does not reflect itself towards the viewer.

use std::sync::Arc;

use firsthit_import::scene::{AlphaMode, PbrMaterial};
use glam::{Vec3, Vec4Swizzles};

use super::energy::{self, Boundary};
use super::fresnel::{Fresnel, normal_incidence};
use super::layers::{self, Layers};
use super::lobes::{
    AnisotropicGgx, GgxReflection, GgxTransmission, Lambert, Lobe, SpecularTransmission, ThinTransmission,
};
use super::microfacet::Masking;
use super::{Bsdf, Conventions, LEAST_ALPHA, Shading, Textures};
use crate::kernel::Kernel;
use crate::surface::Surface;
use crate::texture::{ColorSpace, TextureLookup};
use crate::{EffectSet, StageError, tally};

/// A compiled [`PbrMaterial`].
#[derive(Clone, Debug)]
pub(super) struct Pbr {
    base_color: glam::Vec4,
    base_color_texture: Option<TextureLookup>,
    opacity_texture: Option<TextureLookup>,
    metallic: f32,
    metallic_texture: Option<TextureLookup>,
    roughness: f32,
    roughness_texture: Option<TextureLookup>,
    normal_texture: Option<TextureLookup>,
    normal_scale: f32,
    bump_texture: Option<TextureLookup>,
    bump_scale: f32,
    emissive: Vec3,
    emissive_texture: Option<TextureLookup>,
    alpha: AlphaMode,
    pub(super) double_sided: bool,
    unlit: bool,
    vertex_colors: bool,
    ior: f32,
    transmission: f32,
    transmission_texture: Option<TextureLookup>,
    solid: bool,
    specular: f32,
    specular_texture: Option<TextureLookup>,
    specular_color: Vec3,
    specular_color_texture: Option<TextureLookup>,
    /// 20 / Abbe number.
    dispersion: f32,
    /// What it calls for beside its base.
    layers: Option<Box<Layers>>,
    /// What its rough boundary loses, if it is the boundary of a solid and that is made up for.
    boundary: Option<Arc<Boundary>>,
    /// One look-up finds both metallic and roughness.
    one_lookup: bool,
}

/// What is taken away per unit of length, so that white turns into the attenuation colour over its distance.
pub(super) fn absorption(desc: &PbrMaterial, conventions: Conventions) -> Vec3 {
    let wanted = conventions.effects.contains(EffectSet::ABSORPTION);
    if wanted && desc.attenuation_distance.is_finite() && desc.attenuation_distance > 0.0 {
        // A channel of 0 would be infinite absorption; e^-20 is as black.
        desc.attenuation_color.map(|c| -c.clamp(2e-9, 1.0).ln() / desc.attenuation_distance)
    } else {
        Vec3::ZERO
    }
}

/// The share of the colour texture, scalar textures and vertex colour of a point: 1 where there is none.
pub(super) fn scalar<K: Kernel>(lookup: Option<&TextureLookup>, surface: &Surface<'_>) -> f32 {
    match lookup {
        Some(t) if K::TEXTURES => surface.look_up(|| t.scalar_at(&surface.view(t))),
        _ => 1.0,
    }
}

pub(super) fn color<K: Kernel>(lookup: Option<&TextureLookup>, surface: &Surface<'_>) -> glam::Vec4 {
    match lookup {
        Some(t) if K::TEXTURES => surface.look_up(|| t.color_at(&surface.view(t))),
        _ => glam::Vec4::ONE,
    }
}

impl Pbr {
    pub(super) fn new(
        desc: &PbrMaterial,
        textures: &mut Textures<'_>,
        conventions: Conventions,
    ) -> Result<Self, StageError> {
        let has = |effect| conventions.effects.contains(effect);
        let textured = has(EffectSet::TEXTURES);
        let layers = Layers::new(desc, textures, conventions)?;
        let mut get =
            |texture: &Option<_>, space, wanted: bool| textures.get(texture.as_ref().filter(|_| wanted), space);
        let through = if desc.thickness > 0.0 { EffectSet::REFRACTION } else { EffectSet::TRANSMISSION };
        let transmission = if has(through) { desc.transmission } else { 0.0 };
        let rough = desc.roughness_texture.is_some() || desc.roughness * desc.roughness > LEAST_ALPHA;
        let bends = (desc.ior - 1.0).abs() > 1e-3 && desc.ior.is_finite();
        let solid = desc.thickness > 0.0 && transmission > 0.0;
        let rough_solid = conventions.energy_compensation && solid && rough && bends && !desc.unlit;
        let mut pbr = Self {
            base_color: desc.base_color,
            base_color_texture: get(&desc.base_color_texture, ColorSpace::Srgb, textured)?,
            opacity_texture: get(&desc.opacity_texture, ColorSpace::Linear, textured)?,
            metallic: desc.metallic,
            metallic_texture: get(&desc.metallic_texture, ColorSpace::Linear, textured)?,
            roughness: desc.roughness,
            roughness_texture: get(&desc.roughness_texture, ColorSpace::Linear, textured)?,
            normal_texture: get(&desc.normal_texture, ColorSpace::Linear, textured && has(EffectSet::NORMAL_MAPS))?,
            normal_scale: desc.normal_scale,
            bump_texture: get(&desc.bump_texture, ColorSpace::Linear, textured && has(EffectSet::NORMAL_MAPS))?,
            bump_scale: desc.bump_scale,
            emissive: if has(EffectSet::EMISSION) { desc.emissive } else { Vec3::ZERO },
            emissive_texture: get(&desc.emissive_texture, ColorSpace::Srgb, textured)?,
            alpha: match desc.alpha_mode {
                AlphaMode::Mask { .. } if !has(EffectSet::ALPHA_MASK) => AlphaMode::Opaque,
                AlphaMode::Blend if !has(EffectSet::ALPHA_BLEND) => AlphaMode::Opaque,
                mode => mode,
            },
            double_sided: desc.double_sided,
            unlit: desc.unlit && has(EffectSet::UNLIT),
            vertex_colors: has(EffectSet::VERTEX_COLORS),
            ior: desc.ior,
            transmission,
            transmission_texture: get(&desc.transmission_texture, ColorSpace::Linear, textured)?,
            solid: desc.thickness > 0.0,
            specular: desc.specular,
            specular_texture: get(&desc.specular_texture, ColorSpace::Linear, textured)?,
            specular_color: desc.specular_color,
            specular_color_texture: get(&desc.specular_color_texture, ColorSpace::Srgb, textured)?,
            dispersion: if has(EffectSet::DISPERSION) { desc.dispersion } else { 0.0 },
            layers,
            boundary: rough_solid.then(|| Arc::new(Boundary::new(desc.ior))),
            one_lookup: false,
        };
        let (metallic, roughness) = (pbr.metallic_texture.as_ref(), pbr.roughness_texture.as_ref());
        pbr.one_lookup = metallic.zip(roughness).is_some_and(|(m, r)| m.reads_as(r));
        Ok(pbr)
    }

    pub(super) fn is_solid(&self) -> bool {
        let open = self.transmission > 0.0 || self.layers.as_ref().is_some_and(|l| l.lets_light_through());
        self.solid && open && !self.unlit
    }

    /// Whether light of different colours goes on in different directions.
    pub(super) fn parts_colors(&self) -> bool {
        self.dispersion > 0.0 && self.solid && self.transmission > 0.0 && !self.unlit
    }

    /// Whether it has anything beside its base.
    pub(super) fn is_layered(&self) -> bool {
        self.layers.is_some() && !self.unlit
    }

    pub(super) fn is_textured(&self) -> bool {
        let own = [
            &self.base_color_texture,
            &self.opacity_texture,
            &self.metallic_texture,
            &self.roughness_texture,
            &self.normal_texture,
            &self.bump_texture,
            &self.emissive_texture,
            &self.transmission_texture,
            &self.specular_texture,
            &self.specular_color_texture,
        ];
        self.layers.is_some() || own.into_iter().any(Option::is_some)
    }

    pub(super) fn has_alpha(&self) -> bool {
        self.alpha != AlphaMode::Opaque
    }

    pub(super) fn is_clear(&self) -> bool {
        self.transmission > 0.0 && !self.unlit
    }

    pub(super) fn glows(&self) -> bool {
        self.brightest_glow() > 0.0
    }

    pub(super) fn brightest_glow(&self) -> f32 {
        if self.unlit { 0.0 } else { self.emissive.max_element() }
    }

    pub(super) fn emissive_texture(&self) -> Option<&TextureLookup> {
        self.emissive_texture.as_ref()
    }

    pub(super) fn glows_evenly(&self) -> bool {
        self.emissive_texture.is_none() && !self.has_alpha() && !self.glow_depends_on_view()
    }

    /// Whether its glow is not the same in all directions.
    pub(super) fn glow_depends_on_view(&self) -> bool {
        self.layers.as_ref().is_some_and(|l| l.has_coat())
    }

    fn base<K: Kernel>(&self, surface: &Surface<'_>) -> glam::Vec4 {
        let base = self.base_color * color::<K>(self.base_color_texture.as_ref(), surface);
        if self.vertex_colors { base * surface.color() } else { base }
    }

    pub(super) fn coverage<K: Kernel>(&self, surface: &Surface<'_>) -> f32 {
        let effect = match self.alpha {
            AlphaMode::Opaque => return 1.0,
            AlphaMode::Mask { .. } => EffectSet::ALPHA_MASK,
            AlphaMode::Blend => EffectSet::ALPHA_BLEND,
        };
        tally::sample(effect);
        for _ in [&self.base_color_texture, &self.opacity_texture].into_iter().flatten() {
            tally::look_up(effect);
        }
        let alpha = self.base::<K>(surface).w * scalar::<K>(self.opacity_texture.as_ref(), surface);
        match self.alpha {
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
            _ => alpha.clamp(0.0, 1.0),
        }
    }

    pub(super) fn straight_through<K: Kernel>(&self, surface: &Surface<'_>, cos: f32) -> Vec3 {
        if !self.is_clear() {
            return Vec3::ZERO;
        }
        let base = self.base::<K>(surface).xyz();
        let metallic = (self.metallic * scalar::<K>(self.metallic_texture.as_ref(), surface)).clamp(0.0, 1.0);
        let transmission =
            (self.transmission * scalar::<K>(self.transmission_texture.as_ref(), surface)).clamp(0.0, 1.0);
        let mut fresnel = self.fresnel::<K>(surface, base, metallic, 1.0);
        let mut below = 1.0;
        if let Some(layers) = self.layers.as_deref() {
            fresnel = layers.filmed::<K>(surface, fresnel);
            below = layers.passed::<K>(surface, cos);
        }
        base * (transmission * (1.0 - metallic) * below) * fresnel.passed(cos)
    }

    pub(super) fn is_smooth<K: Kernel>(&self, surface: &Surface<'_>) -> bool {
        let roughness = self.roughness * scalar::<K>(self.roughness_texture.as_ref(), surface);
        let blurring = roughness * self.blur();
        blurring * blurring <= LEAST_ALPHA
    }

    /// The share of its roughness that blurs what is seen through it. Facets of an index of 1 bend nothing, so those of a
    /// solid blur nothing either; of a sheet they blur by how far its index is from 1, up to that of glass.
    fn blur(&self) -> f32 {
        if !self.is_solid() {
            (2.0 * (self.ior - 1.0).abs()).min(1.0)
        } else if self.bends() {
            1.0
        } else {
            0.0
        }
    }

    /// Whether its index of refraction is another than that of air.
    fn bends(&self) -> bool {
        (self.ior - 1.0).abs() > 1e-3
    }

    /// What it sends to the viewer by itself: of what glows below a coat, what that lets out.
    pub(super) fn emission<K: Kernel>(&self, surface: &Surface<'_>, conventions: Conventions) -> Vec3 {
        if self.unlit {
            tally::sample(EffectSet::UNLIT);
            return self.base::<K>(surface).xyz();
        }
        if self.emissive == Vec3::ZERO || surface.dark {
            return Vec3::ZERO;
        }
        tally::sample(EffectSet::EMISSION);
        let mut emission = self.emissive;
        if let Some(t) = self.emissive_texture.as_ref().filter(|_| K::TEXTURES) {
            emission *= surface.look_up(|| t.color_at(&surface.sharp_view(t))).xyz();
        }
        match self.layers.as_deref().filter(|_| K::LAYERS) {
            Some(layers) => emission * layers.under_coat::<K>(surface, !conventions.reference),
            None => emission,
        }
    }

    /// glTF keeps both in one image, which is then looked up once.
    fn metallic_and_roughness<K: Kernel>(&self, surface: &Surface<'_>) -> [f32; 2] {
        let (metallic, roughness) = (self.metallic_texture.as_ref(), self.roughness_texture.as_ref());
        let shares = match (metallic, roughness) {
            (Some(m), Some(r)) if K::TEXTURES && self.one_lookup => {
                surface.look_up(|| m.scalars_at(r, &surface.view(m)))
            }
            _ => [scalar::<K>(metallic, surface), scalar::<K>(roughness, surface)],
        };
        [(self.metallic * shares[0]).clamp(0.0, 1.0), (self.roughness * shares[1]).clamp(0.0, 1.0)]
    }

    fn fresnel<K: Kernel>(&self, surface: &Surface<'_>, base: Vec3, metallic: f32, eta: f32) -> Fresnel {
        let specular = self.specular * scalar::<K>(self.specular_texture.as_ref(), surface);
        let tint = self.specular_color * color::<K>(self.specular_color_texture.as_ref(), surface).xyz();
        let f0 = (tint * normal_incidence(self.ior)).min(Vec3::ONE) * specular;
        // Between the same on both sides there is no boundary, which Schlick's formula does not know.
        let grazing = if K::THROUGH && self.is_solid() && !self.bends() { 0.0 } else { specular };
        Fresnel::Schlick { f0: f0.lerp(base, metallic), f90: grazing + (1.0 - grazing) * metallic, eta }
    }

    /// `LAYERS`: whether what is laid over the base is looked at. Materials that have nothing there are shaded by code
    /// that knows of nothing.
    pub(super) fn shade<K: Kernel, const LAYERS: bool>(
        &self,
        surface: &Surface<'_>,
        conventions: Conventions,
        emission: Vec3,
    ) -> Shading<K> {
        let base = self.base::<K>(surface).xyz();
        if self.unlit {
            return Shading { bsdf: Bsdf::new(surface.smooth), emission, base_color: base };
        }
        let layers = self.layers.as_deref().filter(|_| LAYERS);
        let mut normal = self.normal::<K>(surface);
        if !conventions.reference {
            normal = surface.bent(normal);
        }
        let [metallic, roughness] = self.metallic_and_roughness::<K>(surface);
        let transmission = match K::THROUGH {
            true => (self.transmission * scalar::<K>(self.transmission_texture.as_ref(), surface)).clamp(0.0, 1.0),
            false => 0.0,
        };
        let alpha = (roughness * roughness).max(LEAST_ALPHA);
        let blurring = if K::THROUGH { roughness * self.blur() } else { roughness };
        let (eta, parted) = if K::THROUGH { self.boundary(surface) } else { (1.0, Vec3::ONE) };
        let cos = normal.dot(surface.wo);

        let bare = self.fresnel::<K>(surface, base, metallic, eta);
        let fresnel = layers.map_or(bare, |l| l.filmed::<K>(surface, bare));
        let coat = fresnel.over_diffuse(self.specular_color != Vec3::ONE || self.specular_color_texture.is_some());
        let mut compensation = Vec3::ONE;
        let mut compensation_through = 1.0;
        if let (true, Fresnel::Schlick { f0, .. }) = (conventions.energy_compensation, bare) {
            compensation = energy::compensation(cos, roughness, f0);
            if K::THROUGH && transmission > 0.0 {
                let reflected;
                (reflected, compensation_through) = match &self.boundary {
                    Some(boundary) => {
                        let both = boundary.compensation(cos, roughness, surface.front);
                        (both, both)
                    }
                    None => (energy::thin_compensation(cos, roughness), energy::thin_compensation(cos, blurring)),
                };
                compensation = compensation.lerp(Vec3::splat(reflected), transmission * (1.0 - metallic));
            }
        }
        let brush = layers.and_then(|l| l.brush::<K>(surface));
        let mut bsdf = match &brush {
            Some(brush) => Bsdf::along(normal, brush.direction),
            None => Bsdf::new(normal),
        };
        // Layers on top, and what they leave of the light below.
        let mut below = 1.0;
        let (mut over, mut fibres) = (None, None);
        if let Some(layers) = layers {
            if let Some((lobe, passed)) = layers.coat::<K>(surface, !conventions.reference, |w| bsdf.local(w)) {
                (over, below) = (Some(lobe), passed);
            }
            if let Some((mut sheen, passed)) = layers.sheen::<K>(surface, cos) {
                sheen.color *= below;
                below *= passed;
                fibres = Some(Lobe::Sheen(sheen));
            }
        }

        let mut diffuse = base * ((1.0 - metallic) * (1.0 - transmission) * below);
        let mut through = None;
        if let Some((mut lobe, share)) = layers.and_then(|l| l.through::<K>(surface, coat)) {
            diffuse *= 1.0 - share;
            lobe.color *= (1.0 - metallic) * (1.0 - transmission) * below;
            through = Some(lobe).filter(|l| l.color.max_element() > 0.0).map(Lobe::DiffuseTransmission);
        }
        if diffuse.max_element() > 0.0 {
            bsdf.add(Lobe::Lambert(Lambert { albedo: diffuse, coat: Some(coat) }));
        }
        if fresnel.reflectance(0.0).max_element() > 0.0 || fresnel.reflectance(1.0).max_element() > 0.0 {
            let scale = compensation * below;
            bsdf.add(match &brush {
                Some(brush) => {
                    let along = alpha + (1.0 - alpha) * brush.strength * brush.strength;
                    Lobe::AnisotropicGgx(AnisotropicGgx { alpha: glam::Vec2::new(along, alpha), fresnel, scale })
                }
                None => Lobe::GgxReflection(GgxReflection { alpha, fresnel, masking: Masking::Correlated, scale }),
            });
        }
        let mut tint = base * ((1.0 - metallic) * transmission * below) * parted;
        if K::THROUGH && tint.max_element() > 0.0 {
            let blurring = (blurring * blurring).max(LEAST_ALPHA);
            let smooth = blurring <= LEAST_ALPHA;
            if !smooth {
                tint *= compensation_through;
            }
            bsdf.add(if (eta - 1.0).abs() > 1e-3 {
                if smooth {
                    Lobe::SpecularTransmission(SpecularTransmission { eta, fresnel, tint, scale: 1.0 })
                } else {
                    Lobe::GgxTransmission(GgxTransmission { alpha, eta, fresnel, tint, scale: 1.0 })
                }
            } else if smooth {
                Lobe::SpecularTransmission(SpecularTransmission { eta: 1.0, fresnel, tint, scale: 1.0 })
            } else {
                Lobe::ThinTransmission(ThinTransmission { alpha: blurring, fresnel, tint })
            });
        }
        for lobe in [through, fibres, over].into_iter().flatten() {
            bsdf.add(lobe);
        }
        Shading { bsdf, emission, base_color: base }
    }

    /// Index of the other side over that of the viewer's, of solids; and what light that goes through keeps there by
    /// being parted into colours.
    fn boundary(&self, surface: &Surface<'_>) -> (f32, Vec3) {
        if !self.is_solid() {
            return (1.0, Vec3::ONE);
        }
        let mut ior = if self.ior > 0.0 { self.ior } else { 1.0 };
        let mut share = Vec3::ONE;
        if self.dispersion > 0.0 {
            (ior, share) = (surface.colors.ior(ior, self.dispersion), surface.colors.share());
        }
        (if surface.front { ior } else { 1.0 / ior }, share)
    }

    /// The shading normal with normal and bump maps, on the viewer's side.
    fn normal<K: Kernel>(&self, surface: &Surface<'_>) -> Vec3 {
        if !K::TEXTURES || (self.normal_texture.is_none() && self.bump_texture.is_none()) {
            return surface.smooth;
        }
        let mut normal = layers::mapped::<K>(surface, self.normal_texture.as_ref(), self.normal_scale);
        if let Some(t) = &self.bump_texture {
            tally::sample(EffectSet::NORMAL_MAPS);
            let step = t.texel_step().max(surface.footprint(t.uv_set()));
            let height = |du, dv| {
                tally::look_up(EffectSet::NORMAL_MAPS);
                surface.look_up(|| t.scalar_at(&surface.view_beside(t, glam::Vec2::new(du, dv))))
            };
            let half = 0.5 * step;
            let slope = glam::Vec2::new(height(half, 0.0) - height(-half, 0.0), height(0.0, half) - height(0.0, -half))
                * (self.bump_scale / step);
            if slope.is_finite() && slope != glam::Vec2::ZERO {
                normal = surface.tilted(normal.unwrap_or(surface.smooth), slope, t.uv_set());
            }
        }
        normal.unwrap_or(surface.smooth)
    }
}
