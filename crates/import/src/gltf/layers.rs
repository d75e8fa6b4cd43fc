//! The extensions of materials that the JSON model has no types for: layers over the base, and what goes through it.

use glam::{Vec3, Vec4};
use gltf::json::extensions::material as ext;
use gltf::json::material::NormalTexture;
use gltf::json::texture;
use serde::Deserialize;

use super::json;
use super::material::Reader;
use super::texture::Info;
use crate::ImportError;
use crate::scene::{Anisotropy, Channel, Clearcoat, DiffuseTransmission, Iridescence, PbrMaterial, Sheen};

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct JsonClearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<texture::Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<texture::Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct JsonSheen {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<texture::Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<texture::Info>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct JsonIridescence {
    iridescence_factor: f32,
    iridescence_texture: Option<texture::Info>,
    iridescence_ior: Option<f32>,
    iridescence_thickness_minimum: Option<f32>,
    iridescence_thickness_maximum: Option<f32>,
    iridescence_thickness_texture: Option<texture::Info>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct JsonAnisotropy {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<texture::Info>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct JsonDiffuseTransmission {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<texture::Info>,
    diffuse_transmission_color_factor: Option<[f32; 3]>,
    diffuse_transmission_color_texture: Option<texture::Info>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonDispersion {
    dispersion: f32,
}

impl Reader<'_, '_> {
    /// Reads them all into a material.
    pub(super) fn layers(&mut self, m: &mut PbrMaterial, extensions: &ext::Material) -> Result<(), ImportError> {
        m.clearcoat = self.clearcoat(extensions)?;
        m.sheen = self.sheen(extensions)?;
        m.iridescence = self.iridescence(extensions)?;
        m.anisotropy = self.anisotropy(extensions)?;
        m.diffuse_transmission = self.diffuse_transmission(extensions)?;
        const DISPERSION: &str = "KHR_materials_dispersion";
        if let Some(e) = self.extension::<JsonDispersion>(extensions, DISPERSION)? {
            m.dispersion = self.not_negative(&place(DISPERSION, "dispersion"), e.dispersion);
        }
        Ok(())
    }

    fn clearcoat(&mut self, extensions: &ext::Material) -> Result<Option<Box<Clearcoat>>, ImportError> {
        const NAME: &str = "KHR_materials_clearcoat";
        let at = |key| place(NAME, key);
        let Some(e) = self.extension::<JsonClearcoat>(extensions, NAME)? else { return Ok(None) };
        let mut coat = Clearcoat {
            factor: self.unit(&at("clearcoatFactor"), e.clearcoat_factor),
            texture: self.texture(&at("clearcoatTexture"), &e.clearcoat_texture, Channel::Red)?,
            roughness: self.unit(&at("clearcoatRoughnessFactor"), e.clearcoat_roughness_factor),
            roughness_texture: self.texture(
                &at("clearcoatRoughnessTexture"),
                &e.clearcoat_roughness_texture,
                Channel::Green,
            )?,
            ..Clearcoat::default()
        };
        if let Some(t) = &e.clearcoat_normal_texture {
            let others = t.extensions.as_ref().map(|e| &e.others);
            let info = Info { index: t.index, tex_coord: t.tex_coord, transform: None, others };
            coat.normal_texture = Some(self.info(&at("clearcoatNormalTexture"), info, Channel::Red)?);
            coat.normal_scale = t.scale;
        }
        Ok((coat.factor > 0.0).then(|| Box::new(coat)))
    }

    fn sheen(&mut self, extensions: &ext::Material) -> Result<Option<Box<Sheen>>, ImportError> {
        const NAME: &str = "KHR_materials_sheen";
        let at = |key| place(NAME, key);
        let Some(e) = self.extension::<JsonSheen>(extensions, NAME)? else { return Ok(None) };
        let color = Vec3::from(e.sheen_color_factor).extend(1.0);
        let sheen = Sheen {
            color: self.within(&at("sheenColorFactor"), color).truncate(),
            color_texture: self.texture(&at("sheenColorTexture"), &e.sheen_color_texture, Channel::Red)?,
            roughness: self.unit(&at("sheenRoughnessFactor"), e.sheen_roughness_factor),
            roughness_texture: self.texture(
                &at("sheenRoughnessTexture"),
                &e.sheen_roughness_texture,
                Channel::Alpha,
            )?,
        };
        Ok((sheen.color != Vec3::ZERO).then(|| Box::new(sheen)))
    }

    fn iridescence(&mut self, extensions: &ext::Material) -> Result<Option<Box<Iridescence>>, ImportError> {
        const NAME: &str = "KHR_materials_iridescence";
        let at = |key| place(NAME, key);
        let Some(e) = self.extension::<JsonIridescence>(extensions, NAME)? else { return Ok(None) };
        let d = Iridescence::default();
        let (least, most) = (e.iridescence_thickness_minimum, e.iridescence_thickness_maximum);
        let mut film = Iridescence {
            factor: self.unit(&at("iridescenceFactor"), e.iridescence_factor),
            texture: self.texture(&at("iridescenceTexture"), &e.iridescence_texture, Channel::Red)?,
            ior: e.iridescence_ior.unwrap_or(d.ior),
            thickness_min: self.not_negative(&at("iridescenceThicknessMinimum"), least.unwrap_or(d.thickness_min)),
            thickness_max: self.not_negative(&at("iridescenceThicknessMaximum"), most.unwrap_or(d.thickness_max)),
            thickness_texture: self.texture(
                &at("iridescenceThicknessTexture"),
                &e.iridescence_thickness_texture,
                Channel::Green,
            )?,
        };
        if !(film.ior >= 1.0 && film.ior.is_finite()) {
            self.warn(&at("iridescenceIor"), format!("{} is below 1: taken as 1", film.ior));
            film.ior = 1.0;
        }
        Ok((film.factor > 0.0).then(|| Box::new(film)))
    }

    fn anisotropy(&mut self, extensions: &ext::Material) -> Result<Option<Box<Anisotropy>>, ImportError> {
        const NAME: &str = "KHR_materials_anisotropy";
        let at = |key| place(NAME, key);
        let Some(e) = self.extension::<JsonAnisotropy>(extensions, NAME)? else { return Ok(None) };
        let anisotropy = Anisotropy {
            strength: self.unit(&at("anisotropyStrength"), e.anisotropy_strength),
            rotation: if e.anisotropy_rotation.is_finite() { e.anisotropy_rotation } else { 0.0 },
            texture: self.texture(&at("anisotropyTexture"), &e.anisotropy_texture, Channel::Blue)?,
        };
        Ok((anisotropy.strength > 0.0).then(|| Box::new(anisotropy)))
    }

    fn diffuse_transmission(
        &mut self,
        extensions: &ext::Material,
    ) -> Result<Option<Box<DiffuseTransmission>>, ImportError> {
        const NAME: &str = "KHR_materials_diffuse_transmission";
        let at = |key| place(NAME, key);
        let Some(e) = self.extension::<JsonDiffuseTransmission>(extensions, NAME)? else { return Ok(None) };
        let color: Vec4 = Vec3::from(e.diffuse_transmission_color_factor.unwrap_or([1.0; 3])).extend(1.0);
        let through = DiffuseTransmission {
            factor: self.unit(&at("diffuseTransmissionFactor"), e.diffuse_transmission_factor),
            texture: self.texture(
                &at("diffuseTransmissionTexture"),
                &e.diffuse_transmission_texture,
                Channel::Alpha,
            )?,
            color: self.within(&at("diffuseTransmissionColorFactor"), color).truncate(),
            color_texture: self.texture(
                &at("diffuseTransmissionColorTexture"),
                &e.diffuse_transmission_color_texture,
                Channel::Red,
            )?,
        };
        Ok((through.factor > 0.0).then(|| Box::new(through)))
    }

    /// The JSON of an extension as a type.
    fn extension<T: for<'de> Deserialize<'de>>(
        &self,
        extensions: &ext::Material,
        name: &str,
    ) -> Result<Option<T>, ImportError> {
        let Some(value) = extensions.others.get(name) else { return Ok(None) };
        json::typed(self.source.file, &format!("{}/extensions/{name}", self.place), value).map(Some)
    }

    fn not_negative(&mut self, key: &str, value: f32) -> f32 {
        self.positive(key, Vec3::splat(value)).x
    }
}

fn place(extension: &str, key: &str) -> String {
    format!("extensions/{extension}/{key}")
}
