//! Materials: metallic-roughness with its extensions (glTF 2.0 specification, section 3.9).

use glam::{Affine2, Vec3, Vec4};
use gltf::json::extensions::material as ext;
use gltf::json::material::AlphaMode as JsonAlphaMode;
use gltf::json::texture;
use gltf::json::validation::Checked;

use super::mesh::NormalMapping;
use super::source::Source;
use super::texture::{Info, Textures};
use crate::scene::{AlphaMode, Channel, MaterialDesc, MaterialModel, PbrMaterial, TextureRef};
use crate::{ImportError, Report};

/// Reads all materials, with the images of those that are `seen`, and of occlusion textures or without.
///
/// # Errors
/// If one refers to a texture that does not exist.
pub(super) fn read<'a>(
    source: &'a Source<'a>,
    textures: &mut Textures<'a>,
    report: &mut Report,
    occlusion: bool,
    seen: &[bool],
) -> Result<Vec<MaterialDesc>, ImportError> {
    let materials = source.root.materials.iter().enumerate();
    materials
        .map(|(i, json)| {
            let mut reader = Reader {
                source,
                textures: &mut *textures,
                report: &mut *report,
                occlusion,
                seen: seen[i],
                place: format!("/materials/{i}"),
            };
            let model = MaterialModel::Pbr(Box::new(reader.material(json)?));
            Ok(MaterialDesc { name: json.name.clone().unwrap_or_else(|| format!("material {i}")), model })
        })
        .collect()
}

/// The texture coordinates that the tangents of a material follow, if it needs any: those of its normal texture, or
/// else of what is directed by tangents as well.
pub(super) fn normal_mapping(material: &MaterialDesc) -> Option<NormalMapping> {
    let MaterialModel::Pbr(pbr) = &material.model else { return None };
    let coat = pbr.clearcoat.as_ref().and_then(|c| c.normal_texture.as_ref());
    let brushed = pbr.anisotropy.as_ref();
    match pbr.normal_texture.as_ref().or(coat).or(brushed.and_then(|a| a.texture.as_ref())) {
        Some(texture) => Some(NormalMapping { uv_set: texture.uv_set, transform: texture.transform }),
        None => brushed.map(|_| NormalMapping { uv_set: 0, transform: Affine2::IDENTITY }),
    }
}

/// Reads one material.
pub(super) struct Reader<'a, 'b> {
    pub(super) source: &'a Source<'b>,
    textures: &'a mut Textures<'b>,
    report: &'a mut Report,
    /// Occlusion textures are to be decoded.
    occlusion: bool,
    /// So are all of its textures.
    seen: bool,
    pub(super) place: String,
}

impl Reader<'_, '_> {
    fn material(&mut self, json: &gltf::json::Material) -> Result<PbrMaterial, ImportError> {
        use Channel::{Blue, Green, Red};
        let pbr = &json.pbr_metallic_roughness;
        let base = Vec4::from(pbr.base_color_factor.0);
        let both = &pbr.metallic_roughness_texture;
        let mut m = PbrMaterial {
            base_color: self.within("pbrMetallicRoughness/baseColorFactor", base),
            base_color_texture: self.texture("pbrMetallicRoughness/baseColorTexture", &pbr.base_color_texture, Red)?,
            metallic: self.unit("pbrMetallicRoughness/metallicFactor", pbr.metallic_factor.0),
            roughness: self.unit("pbrMetallicRoughness/roughnessFactor", pbr.roughness_factor.0),
            metallic_texture: self.texture("pbrMetallicRoughness/metallicRoughnessTexture", both, Blue)?,
            roughness_texture: self.texture("pbrMetallicRoughness/metallicRoughnessTexture", both, Green)?,
            emissive: self.positive("emissiveFactor", Vec3::from(json.emissive_factor.0)),
            emissive_texture: self.texture("emissiveTexture", &json.emissive_texture, Red)?,
            double_sided: json.double_sided,
            ..PbrMaterial::default()
        };
        m.alpha_mode = match json.alpha_mode {
            Checked::Valid(JsonAlphaMode::Opaque) => AlphaMode::Opaque,
            Checked::Valid(JsonAlphaMode::Blend) => AlphaMode::Blend,
            Checked::Valid(JsonAlphaMode::Mask) => AlphaMode::Mask { cutoff: json.alpha_cutoff.map_or(0.5, |c| c.0) },
            Checked::Invalid => {
                let place = format!("{}/alphaMode", self.place);
                return Err(self.source.invalid(place, "expected \"OPAQUE\", \"MASK\" or \"BLEND\""));
            }
        };
        if let Some(t) = &json.normal_texture {
            let others = t.extensions.as_ref().map(|e| &e.others);
            let info = Info { index: t.index, tex_coord: t.tex_coord, transform: None, others };
            m.normal_texture = Some(self.info("normalTexture", info, Red)?);
            m.normal_scale = t.scale;
        }
        if let Some(t) = &json.occlusion_texture {
            let others = t.extensions.as_ref().map(|e| &e.others);
            let info = Info { index: t.index, tex_coord: t.tex_coord, transform: None, others };
            m.occlusion_texture = Some(self.info("occlusionTexture", info, Red)?);
            m.occlusion_strength = self.unit("occlusionTexture/strength", t.strength.0);
        }
        if let Some(extensions) = &json.extensions {
            self.extensions(&mut m, extensions)?;
        }
        Ok(m)
    }

    fn extensions(&mut self, m: &mut PbrMaterial, extensions: &ext::Material) -> Result<(), ImportError> {
        use Channel::{Alpha, Green, Red};
        if let Some(e) = &extensions.pbr_specular_glossiness {
            self.specular_glossiness(m, e)?;
        }
        m.unlit = extensions.unlit.is_some();
        if let Some(e) = &extensions.emissive_strength {
            let place = "extensions/KHR_materials_emissive_strength/emissiveStrength";
            m.emissive *= self.positive(place, Vec3::splat(e.emissive_strength.0)).x;
        }
        if let Some(e) = &extensions.ior {
            // 0 is the extension's mark for "reflects all": an endless index of refraction.
            m.ior = if e.ior.0 == 0.0 { f32::INFINITY } else { e.ior.0 };
            if !(m.ior >= 1.0) {
                self.warn("extensions/KHR_materials_ior/ior", format!("{} is below 1: taken as 1", m.ior));
                m.ior = 1.0;
            }
        }
        if let Some(e) = &extensions.transmission {
            let place = "extensions/KHR_materials_transmission";
            m.transmission = self.unit(&format!("{place}/transmissionFactor"), e.transmission_factor.0);
            m.transmission_texture =
                self.texture(&format!("{place}/transmissionTexture"), &e.transmission_texture, Red)?;
        }
        if let Some(e) = &extensions.volume {
            let place = "extensions/KHR_materials_volume";
            m.thickness = self.positive(&format!("{place}/thicknessFactor"), Vec3::splat(e.thickness_factor.0)).x;
            m.thickness_texture = self.texture(&format!("{place}/thicknessTexture"), &e.thickness_texture, Green)?;
            m.attenuation_color = self
                .within(&format!("{place}/attenuationColor"), Vec3::from(e.attenuation_color.0).extend(1.0))
                .truncate();
            m.attenuation_distance = e.attenuation_distance.0;
            if !(m.attenuation_distance > 0.0) {
                let message = format!("{} is not above 0: nothing is absorbed", m.attenuation_distance);
                self.warn(&format!("{place}/attenuationDistance"), message);
                m.attenuation_distance = f32::INFINITY;
            }
        }
        if let Some(e) = &extensions.specular {
            let place = "extensions/KHR_materials_specular";
            m.specular = self.unit(&format!("{place}/specularFactor"), e.specular_factor.0);
            m.specular_texture = self.texture(&format!("{place}/specularTexture"), &e.specular_texture, Alpha)?;
            m.specular_color =
                self.positive(&format!("{place}/specularColorFactor"), Vec3::from(e.specular_color_factor.0));
            m.specular_color_texture =
                self.texture(&format!("{place}/specularColorTexture"), &e.specular_color_texture, Red)?;
        }
        self.layers(m, extensions)
    }

    /// KHR_materials_pbrSpecularGlossiness, which replaces metallic-roughness: the same is a dielectric whose
    /// reflection at normal incidence, 0.04 at an index of 1.5, is scaled to the specular colour.
    fn specular_glossiness(&mut self, m: &mut PbrMaterial, e: &ext::PbrSpecularGlossiness) -> Result<(), ImportError> {
        let place = "extensions/KHR_materials_pbrSpecularGlossiness";
        let both = &e.specular_glossiness_texture;
        let glossiness = self.unit(&format!("{place}/glossinessFactor"), e.glossiness_factor.0);
        m.base_color = self.within(&format!("{place}/diffuseFactor"), Vec4::from(e.diffuse_factor.0));
        m.base_color_texture = self.texture(&format!("{place}/diffuseTexture"), &e.diffuse_texture, Channel::Red)?;
        m.metallic = 0.0;
        m.metallic_texture = None;
        m.specular_color = self.positive(&format!("{place}/specularFactor"), Vec3::from(e.specular_factor.0)) / 0.04;
        m.specular_color_texture = self.texture(&format!("{place}/specularGlossinessTexture"), both, Channel::Red)?;
        m.roughness_texture = self.texture(&format!("{place}/specularGlossinessTexture"), both, Channel::Alpha)?;
        // Roughness is what glossiness leaves to 1.
        m.roughness = if m.roughness_texture.is_some() { 1.0 } else { 1.0 - glossiness };
        if let Some(t) = &mut m.roughness_texture {
            (t.value_scale, t.value_offset) = (-glossiness, 1.0);
        }
        Ok(())
    }

    pub(super) fn texture(
        &mut self,
        key: &str,
        info: &Option<texture::Info>,
        channel: Channel,
    ) -> Result<Option<TextureRef>, ImportError> {
        info.as_ref().map(|info| self.info(key, info.into(), channel)).transpose()
    }

    pub(super) fn info(&mut self, key: &str, info: Info<'_>, channel: Channel) -> Result<TextureRef, ImportError> {
        let wanted = self.seen && (key != "occlusionTexture" || self.occlusion);
        self.textures.reference(info, channel, wanted, &format!("{}/{key}", self.place))
    }

    /// A factor from 0 to 1.
    pub(super) fn unit(&mut self, key: &str, value: f32) -> f32 {
        self.within(key, Vec4::splat(value)).x
    }

    /// Factors from 0 to 1.
    pub(super) fn within(&mut self, key: &str, value: Vec4) -> Vec4 {
        let clamped = value.clamp(Vec4::ZERO, Vec4::ONE);
        if clamped != value {
            self.warn(key, format!("{value} is not within 0 to 1: taken as {clamped}"));
        }
        clamped
    }

    /// Finite factors from 0.
    pub(super) fn positive(&mut self, key: &str, value: Vec3) -> Vec3 {
        let clamped = value.clamp(Vec3::ZERO, Vec3::MAX);
        if clamped != value {
            self.warn(key, format!("{value} is not from 0 upwards: taken as {clamped}"));
        }
        clamped
    }

    pub(super) fn warn(&mut self, key: &str, message: String) {
        self.report.warn(self.source.file, format!("{}/{key}", self.place), message);
    }
}
