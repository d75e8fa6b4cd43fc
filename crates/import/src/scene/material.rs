//! How surfaces look.

use glam::Vec3;

use super::TextureRef;

/// How a surface reflects, transmits and emits.
#[derive(Clone, Debug)]
pub struct MaterialDesc {
    /// Name in the file.
    pub name: String,
    /// What it is made of.
    pub model: MaterialModel,
}

/// The kinds of material.
#[derive(Clone, Debug)]
pub enum MaterialModel {
    /// The glTF metallic-roughness model with its extensions; OBJ materials are mapped onto it.
    Pbr(Box<PbrMaterial>),
    /// Two-sided Lambert.
    Diffuse {
        /// Share of light reflected.
        albedo: Vec3,
    },
    /// Perfect mirror without Fresnel.
    Mirror {
        /// Share of light reflected.
        reflectance: Vec3,
    },
    /// Smooth dielectric: exact Fresnel, no absorption.
    Glass {
        /// Index of refraction inside; 1 outside.
        ior: f32,
    },
    /// Isotropic GGX, height-correlated Smith, constant Fresnel, single scattering.
    RoughMirror {
        /// GGX alpha.
        alpha: f32,
        /// Constant Fresnel reflectance.
        reflectance: Vec3,
    },
    /// Walter 2007 rough dielectric, GGX, uncorrelated Smith.
    RoughGlass {
        /// Index of refraction inside; 1 outside.
        ior: f32,
        /// GGX alpha.
        alpha: f32,
    },
    /// Glows on the side from which its corners run counter-clockwise (outside, for shapes); black otherwise.
    Emission {
        /// Radiance, W/m²·sr.
        radiance: Vec3,
    },
}

/// How alpha is used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Fully there or not at all, by a cutoff.
    Mask {
        /// Least alpha that is there.
        cutoff: f32,
    },
    /// Alpha is coverage.
    Blend,
}

/// glTF's metallic-roughness material with extensions. Defaults are the format's.
#[derive(Clone, Debug)]
pub struct PbrMaterial {
    /// Linear base colour and alpha; multiplies the texture (sRGB) and the vertex colour.
    pub base_color: glam::Vec4,
    /// sRGB colour with alpha.
    pub base_color_texture: Option<TextureRef>,
    /// A texture of opacity alone (OBJ's `map_d`), linear; the channel it names multiplies alpha.
    pub opacity_texture: Option<TextureRef>,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// Perceptual roughness: GGX alpha is its square.
    pub roughness: f32,
    /// Linear; the channel it names (glTF: B) multiplies `metallic`.
    pub metallic_texture: Option<TextureRef>,
    /// Linear; the channel it names (glTF: G) multiplies `roughness`.
    pub roughness_texture: Option<TextureRef>,
    /// Linear tangent-space normals.
    pub normal_texture: Option<TextureRef>,
    /// Scales the x and y of the normal texture.
    pub normal_scale: f32,
    /// A height map (OBJ's `map_bump`), linear, first channel; height = `bump_scale` * value in texture widths.
    pub bump_texture: Option<TextureRef>,
    /// Multiplies the height map.
    pub bump_scale: f32,
    /// Linear, channel R: share of ambient light. Kept for viewers; a ray tracer finds occlusion itself.
    pub occlusion_texture: Option<TextureRef>,
    /// Strength of the occlusion texture.
    pub occlusion_strength: f32,
    /// Linear emitted radiance (strength included), W/m²·sr; multiplies the texture.
    pub emissive: Vec3,
    /// sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Whether back faces are shown.
    pub double_sided: bool,
    /// Shows the base colour as it is (KHR_materials_unlit).
    pub unlit: bool,
    /// Index of refraction (KHR_materials_ior).
    pub ior: f32,
    /// Share of light that is not reflected at the surface and goes through (KHR_materials_transmission).
    pub transmission: f32,
    /// Linear, channel R multiplies `transmission`.
    pub transmission_texture: Option<TextureRef>,
    /// 0: thin walled; > 0: the boundary of a solid (KHR_materials_volume), in mesh units.
    pub thickness: f32,
    /// Linear, channel G multiplies `thickness`.
    pub thickness_texture: Option<TextureRef>,
    /// Colour that white light turns into over `attenuation_distance`.
    pub attenuation_color: Vec3,
    /// In world units; infinite: no absorption.
    pub attenuation_distance: f32,
    /// Strength of the dielectric reflection (KHR_materials_specular).
    pub specular: f32,
    /// Linear, channel A multiplies `specular`.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric reflection at normal incidence; may exceed 1.
    pub specular_color: Vec3,
    /// sRGB; multiplies `specular_color`.
    pub specular_color_texture: Option<TextureRef>,
    /// How far the index of refraction differs between colours: 20 / Abbe number (KHR_materials_dispersion). Of solids
    /// only.
    pub dispersion: f32,
    /// A clear coat over all else (KHR_materials_clearcoat).
    pub clearcoat: Option<Box<Clearcoat>>,
    /// Fibres over the surface (KHR_materials_sheen).
    pub sheen: Option<Box<Sheen>>,
    /// A thin film on the surface (KHR_materials_iridescence).
    pub iridescence: Option<Box<Iridescence>>,
    /// Brushed: rougher along one direction than across (KHR_materials_anisotropy).
    pub anisotropy: Option<Box<Anisotropy>>,
    /// Light that goes through diffusely (KHR_materials_diffuse_transmission).
    pub diffuse_transmission: Option<Box<DiffuseTransmission>>,
}

/// A clear coat with an index of refraction of 1.5.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearcoat {
    /// How much of it there is, 0 to 1.
    pub factor: f32,
    /// Linear, channel R multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Its own perceptual roughness.
    pub roughness: f32,
    /// Linear, channel G multiplies `roughness`.
    pub roughness_texture: Option<TextureRef>,
    /// Its own tangent-space normals; without, it is as smooth as the mesh.
    pub normal_texture: Option<TextureRef>,
    /// Scales the x and y of the normal texture.
    pub normal_scale: f32,
}

impl Default for Clearcoat {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            roughness: 0.0,
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
        }
    }
}

/// Fibres that stand on the surface, as of velvet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheen {
    /// Linear colour; black: none.
    pub color: Vec3,
    /// sRGB; multiplies `color`.
    pub color_texture: Option<TextureRef>,
    /// How far the fibres diverge from the normal, 0 to 1.
    pub roughness: f32,
    /// Linear, channel A multiplies `roughness`.
    pub roughness_texture: Option<TextureRef>,
}

/// A thin film in which light interferes.
#[derive(Clone, Debug, PartialEq)]
pub struct Iridescence {
    /// How much of it shows, 0 to 1.
    pub factor: f32,
    /// Linear, channel R multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Index of refraction of the film.
    pub ior: f32,
    /// Thickness in nanometres where the texture is 0.
    pub thickness_min: f32,
    /// Thickness in nanometres where the texture is 1 or there is none.
    pub thickness_max: f32,
    /// Linear, channel G.
    pub thickness_texture: Option<TextureRef>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            ior: 1.3,
            thickness_min: 100.0,
            thickness_max: 400.0,
            thickness_texture: None,
        }
    }
}

/// Reflection that is rougher along one direction of the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// 0 to 1: along its direction, alpha goes from that of the material to 1 with the square of it.
    pub strength: f32,
    /// Direction of the greater roughness: counter-clockwise from the tangent towards the bitangent, radians.
    pub rotation: f32,
    /// Linear; R and G are a direction (-1 to 1) that `rotation` turns, B multiplies `strength`.
    pub texture: Option<TextureRef>,
}

/// Light that goes through a surface in all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Share of the diffuse light that goes through instead of back.
    pub factor: f32,
    /// Linear, channel A multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// What colour it has then, in place of the base colour.
    pub color: Vec3,
    /// sRGB; multiplies `color`.
    pub color_texture: Option<TextureRef>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self { factor: 0.0, texture: None, color: Vec3::ONE, color_texture: None }
    }
}

impl Default for PbrMaterial {
    fn default() -> Self {
        Self {
            base_color: glam::Vec4::ONE,
            base_color_texture: None,
            opacity_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_texture: None,
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            bump_texture: None,
            bump_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            thickness_texture: None,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            dispersion: 0.0,
            clearcoat: None,
            sheen: None,
            iridescence: None,
            anisotropy: None,
            diffuse_transmission: None,
        }
    }
}

/// The textures of a material in a list; `$iter` and `$as` say whether they are lent or lent to be changed.
macro_rules! texture_slots {
    ($material:ident, $iter:ident, $as:ident $(, $mut:tt)?) => {{
        let m = $material;
        let mut slots = vec![
            & $($mut)? m.base_color_texture,
            & $($mut)? m.opacity_texture,
            & $($mut)? m.metallic_texture,
            & $($mut)? m.roughness_texture,
            & $($mut)? m.normal_texture,
            & $($mut)? m.bump_texture,
            & $($mut)? m.occlusion_texture,
            & $($mut)? m.emissive_texture,
            & $($mut)? m.transmission_texture,
            & $($mut)? m.thickness_texture,
            & $($mut)? m.specular_texture,
            & $($mut)? m.specular_color_texture,
        ];
        if let Some(c) = m.clearcoat.$as() {
            slots.extend([& $($mut)? c.texture, & $($mut)? c.roughness_texture, & $($mut)? c.normal_texture]);
        }
        if let Some(s) = m.sheen.$as() {
            slots.extend([& $($mut)? s.color_texture, & $($mut)? s.roughness_texture]);
        }
        if let Some(i) = m.iridescence.$as() {
            slots.extend([& $($mut)? i.texture, & $($mut)? i.thickness_texture]);
        }
        if let Some(a) = m.anisotropy.$as() {
            slots.extend([& $($mut)? a.texture]);
        }
        if let Some(d) = m.diffuse_transmission.$as() {
            slots.extend([& $($mut)? d.texture, & $($mut)? d.color_texture]);
        }
        slots.into_iter().flat_map(|slot| slot.$iter())
    }};
}

impl PbrMaterial {
    /// All textures it has, for whoever treats them alike.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        texture_slots!(self, iter, as_deref)
    }

    /// All textures it has, to be changed.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        texture_slots!(self, iter_mut, as_deref_mut, mut)
    }
}
