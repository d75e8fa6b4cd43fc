//! Materials and their textures.

use glam::{Affine2, Vec2, Vec3};

use super::build::Builder;
use super::schema::{self, Channel, Material, Pbr, Texture};
use super::values::{Color, Number, not_negative, within};
use crate::ImportError;
use crate::scene::{
    self, AlphaMode, Anisotropy, Clearcoat, DiffuseTransmission, Filter, Iridescence, MaterialDesc, MaterialModel,
    PbrMaterial, Sheen, TextureRef, Wrap,
};

impl Builder<'_> {
    /// Adds a material.
    pub(super) fn material(&mut self, name: &str, material: &Material) -> Result<usize, ImportError> {
        let place = format!("materials.{name}");
        let model = match material {
            Material::Pbr(pbr) => MaterialModel::Pbr(Box::new(self.pbr(&place, pbr)?)),
            plain => plain_model(plain).map_err(|e| self.invalid(&place, e))?,
        };
        self.scene.materials.push(MaterialDesc { name: name.to_owned(), model });
        Ok(self.scene.materials.len() - 1)
    }

    fn pbr(&mut self, place: &str, p: &Pbr) -> Result<PbrMaterial, ImportError> {
        let factors = pbr_factors(p).map_err(|e| self.invalid(place, e))?;
        let mut texture = |t: &Option<Texture>, channel| match t {
            Some(t) => self.texture(place, t, channel).map(Some),
            None => Ok(None),
        };
        // Where the file does not name a channel, it is the one of glTF's packed textures.
        use scene::Channel::{Alpha, Blue, Green, Red};
        let d = factors;
        let layers = PbrMaterial {
            clearcoat: match d.clearcoat {
                Some(c) => Some(Box::new(Clearcoat {
                    texture: texture(&p.clearcoat_texture, Red)?,
                    roughness_texture: texture(&p.clearcoat_roughness_texture, Green)?,
                    normal_texture: texture(&p.clearcoat_normal_texture, Red)?,
                    ..*c
                })),
                None => None,
            },
            sheen: match d.sheen {
                Some(s) => Some(Box::new(Sheen {
                    color_texture: texture(&p.sheen_color_texture, Red)?,
                    roughness_texture: texture(&p.sheen_roughness_texture, Alpha)?,
                    ..*s
                })),
                None => None,
            },
            iridescence: match d.iridescence {
                Some(i) => Some(Box::new(Iridescence {
                    texture: texture(&p.iridescence_texture, Red)?,
                    thickness_texture: texture(&p.iridescence_thickness_texture, Green)?,
                    ..*i
                })),
                None => None,
            },
            anisotropy: match d.anisotropy {
                Some(a) => Some(Box::new(Anisotropy { texture: texture(&p.anisotropy_texture, Red)?, ..*a })),
                None => None,
            },
            diffuse_transmission: match d.diffuse_transmission {
                Some(t) => Some(Box::new(DiffuseTransmission {
                    texture: texture(&p.diffuse_transmission_texture, Alpha)?,
                    color_texture: texture(&p.diffuse_transmission_color_texture, Red)?,
                    ..*t
                })),
                None => None,
            },
            ..d
        };
        Ok(PbrMaterial {
            base_color_texture: texture(&p.base_color_texture, Red)?,
            opacity_texture: texture(&p.opacity_texture, Red)?,
            metallic_texture: texture(&p.metallic_texture, Blue)?,
            roughness_texture: texture(&p.roughness_texture, Green)?,
            normal_texture: texture(&p.normal_texture, Red)?,
            bump_texture: texture(&p.bump_texture, Red)?,
            occlusion_texture: texture(&p.occlusion_texture, Red)?,
            emissive_texture: texture(&p.emissive_texture, Red)?,
            transmission_texture: texture(&p.transmission_texture, Red)?,
            thickness_texture: texture(&p.thickness_texture, Green)?,
            specular_texture: texture(&p.specular_texture, Alpha)?,
            specular_color_texture: texture(&p.specular_color_texture, Red)?,
            ..layers
        })
    }

    fn texture(&mut self, place: &str, t: &Texture, channel: scene::Channel) -> Result<TextureRef, ImportError> {
        let t = &t.0;
        let pair = |p: Option<super::values::Pair>, default| p.map_or(default, |p| p.0.as_vec2());
        // KHR_texture_transform: offset * rotation * scale, where a positive angle turns u towards -v.
        let angle = -t.rotation_deg.map_or(0.0, |d| d.0.to_radians() as f32);
        let transform =
            Affine2::from_scale_angle_translation(pair(t.scale, Vec2::ONE), angle, pair(t.offset, Vec2::ZERO));
        let wrap = match t.wrap {
            schema::Wrap::Repeat => Wrap::Repeat,
            schema::Wrap::Mirror => Wrap::Mirror,
            schema::Wrap::Clamp => Wrap::Clamp,
        };
        Ok(TextureRef {
            uv_set: t.uv_set,
            transform,
            wrap_u: wrap,
            wrap_v: wrap,
            filter: match t.filter {
                schema::Filter::Linear => Filter::Linear,
                schema::Filter::Nearest => Filter::Nearest,
            },
            channel: match t.channel {
                None => channel,
                Some(Channel::Red) => scene::Channel::Red,
                Some(Channel::Green) => scene::Channel::Green,
                Some(Channel::Blue) => scene::Channel::Blue,
                Some(Channel::Alpha) => scene::Channel::Alpha,
                Some(Channel::Luminance) => scene::Channel::Luminance,
            },
            ..TextureRef::new(self.image(place, &t.file)?)
        })
    }
}

fn plain_model(material: &Material) -> Result<MaterialModel, String> {
    let alpha = |a: Number| within("alpha", Some(a), 1.0, 0.0, 1.0);
    Ok(match *material {
        Material::Diffuse { albedo } => MaterialModel::Diffuse { albedo: share("albedo", albedo)? },
        Material::Emission { radiance } => MaterialModel::Emission { radiance: radiance.0 },
        Material::Mirror { reflectance } => MaterialModel::Mirror { reflectance: share("reflectance", reflectance)? },
        Material::Glass { ior } => MaterialModel::Glass { ior: index_of_refraction(ior)? },
        Material::RoughMirror { alpha: a, reflectance } => {
            MaterialModel::RoughMirror { alpha: alpha(a)?, reflectance: share("reflectance", reflectance)? }
        }
        Material::RoughGlass { ior, alpha: a } => {
            MaterialModel::RoughGlass { ior: index_of_refraction(ior)?, alpha: alpha(a)? }
        }
        Material::Pbr(ref pbr) => MaterialModel::Pbr(Box::new(pbr_factors(pbr)?)),
    })
}

/// All but the textures. The defaults are those of plain light grey plastic, seen from both sides.
fn pbr_factors(p: &Pbr) -> Result<PbrMaterial, String> {
    let unit = |what, x, default| within(what, x, default, 0.0, 1.0);
    let d = PbrMaterial::default();
    let textured = p.base_color_texture.is_some();
    let base = match p.base_color {
        Some(c) => share("base_color", c)?,
        None => Vec3::splat(if textured { 1.0 } else { 0.8 }),
    };
    let alpha = unit("alpha", p.alpha, 1.0)?;
    let cutoff = unit("alpha_cutoff", p.alpha_cutoff, 0.5)?;
    let see_through = alpha < 1.0 || p.opacity_texture.is_some();
    let emissive_default = if p.emissive_texture.is_some() { Vec3::ONE } else { Vec3::ZERO };
    Ok(PbrMaterial {
        base_color: base.extend(alpha),
        metallic: unit("metallic", p.metallic, if p.metallic_texture.is_some() { 1.0 } else { 0.0 })?,
        roughness: unit("roughness", p.roughness, if p.roughness_texture.is_some() { 1.0 } else { 0.5 })?,
        normal_scale: p.normal_scale.map_or(d.normal_scale, |x| x.0 as f32),
        bump_scale: p.bump_scale.map_or(d.bump_scale, |x| x.0 as f32),
        occlusion_strength: unit("occlusion_strength", p.occlusion_strength, 1.0)?,
        emissive: p.emissive.map_or(emissive_default, |c| c.0),
        alpha_mode: match p.alpha_mode {
            Some(schema::AlphaMode::Opaque) => AlphaMode::Opaque,
            Some(schema::AlphaMode::Mask) => AlphaMode::Mask { cutoff },
            Some(schema::AlphaMode::Blend) => AlphaMode::Blend,
            None if p.alpha_cutoff.is_some() => AlphaMode::Mask { cutoff },
            None if see_through => AlphaMode::Blend,
            None => AlphaMode::Opaque,
        },
        double_sided: p.double_sided.unwrap_or(true),
        unlit: p.unlit.unwrap_or(false),
        ior: p.ior.map_or(Ok(d.ior), index_of_refraction)?,
        transmission: unit("transmission", p.transmission, if p.transmission_texture.is_some() { 1.0 } else { 0.0 })?,
        thickness: not_negative("thickness", p.thickness, 0.0)?,
        attenuation_color: p.attenuation_color.map_or(Ok(Vec3::ONE), |c| share("attenuation_color", c))?,
        attenuation_distance: match p.attenuation_distance {
            Some(Number(x)) if x > 0.0 => x as f32,
            Some(Number(x)) => return Err(format!("'attenuation_distance' must be above 0, but is {x}")),
            None => f32::INFINITY,
        },
        specular: unit("specular", p.specular, 1.0)?,
        specular_color: p.specular_color.map_or(Vec3::ONE, |c| c.0),
        dispersion: not_negative("dispersion", p.dispersion, 0.0)?,
        clearcoat: clearcoat(p)?,
        sheen: sheen(p)?,
        iridescence: iridescence(p)?,
        anisotropy: anisotropy(p)?,
        diffuse_transmission: diffuse_transmission(p)?,
        ..d
    })
}

/// A layer is there if its strength or a texture of it is given; with a texture of its strength, the strength is 1.
fn strength(what: &str, factor: Option<Number>, texture: Option<&Texture>) -> Result<Option<f32>, String> {
    match (factor, texture) {
        (None, None) => Ok(None),
        _ => within(what, factor, 1.0, 0.0, 1.0).map(Some),
    }
}

fn clearcoat(p: &Pbr) -> Result<Option<Box<Clearcoat>>, String> {
    let Some(factor) = strength("clearcoat", p.clearcoat, p.clearcoat_texture.as_ref())? else { return Ok(None) };
    let default = if p.clearcoat_roughness_texture.is_some() { 1.0 } else { 0.0 };
    Ok(Some(Box::new(Clearcoat {
        factor,
        roughness: within("clearcoat_roughness", p.clearcoat_roughness, default, 0.0, 1.0)?,
        normal_scale: p.clearcoat_normal_scale.map_or(1.0, |x| x.0 as f32),
        ..Clearcoat::default()
    })))
}

fn sheen(p: &Pbr) -> Result<Option<Box<Sheen>>, String> {
    let color = match (p.sheen_color, &p.sheen_color_texture) {
        (None, None) => return Ok(None),
        (color, _) => share("sheen_color", color.unwrap_or(Color::WHITE))?,
    };
    let default = if p.sheen_roughness_texture.is_some() { 1.0 } else { 0.5 };
    let roughness = within("sheen_roughness", p.sheen_roughness, default, 0.0, 1.0)?;
    Ok(Some(Box::new(Sheen { color, roughness, ..Sheen::default() })))
}

fn iridescence(p: &Pbr) -> Result<Option<Box<Iridescence>>, String> {
    let Some(factor) = strength("iridescence", p.iridescence, p.iridescence_texture.as_ref())? else {
        return Ok(None);
    };
    let d = Iridescence::default();
    Ok(Some(Box::new(Iridescence {
        factor,
        ior: within("iridescence_ior", p.iridescence_ior, d.ior, 1.0, 10.0)?,
        thickness_min: not_negative("iridescence_thickness_min", p.iridescence_thickness_min, d.thickness_min)?,
        thickness_max: not_negative("iridescence_thickness_max", p.iridescence_thickness_max, d.thickness_max)?,
        ..d
    })))
}

fn anisotropy(p: &Pbr) -> Result<Option<Box<Anisotropy>>, String> {
    let Some(strength) = strength("anisotropy", p.anisotropy, p.anisotropy_texture.as_ref())? else { return Ok(None) };
    let rotation = p.anisotropy_rotation_deg.map_or(0.0, |d| d.0.to_radians() as f32);
    Ok(Some(Box::new(Anisotropy { strength, rotation, texture: None })))
}

fn diffuse_transmission(p: &Pbr) -> Result<Option<Box<DiffuseTransmission>>, String> {
    let texture = p.diffuse_transmission_texture.as_ref();
    let Some(factor) = strength("diffuse_transmission", p.diffuse_transmission, texture)? else { return Ok(None) };
    let color = share("diffuse_transmission_color", p.diffuse_transmission_color.unwrap_or(Color::WHITE))?;
    Ok(Some(Box::new(DiffuseTransmission { factor, color, ..DiffuseTransmission::default() })))
}

/// A share of light: at most all of it.
fn share(what: &str, color: Color) -> Result<Vec3, String> {
    if color.0.max_element() <= 1.0 {
        Ok(color.0)
    } else {
        Err(format!("'{what}' must be between 0 and 1 in every channel, but is {}", color.0))
    }
}

/// From 1 (nothing) to beyond diamond (2.4) and germanium (4).
fn index_of_refraction(ior: Number) -> Result<f32, String> {
    within("ior", Some(ior), 1.5, 1.0, 10.0)
}

/// An OBJ material as the conventions of the reference scenes have it: what has `Ke` glows and is black otherwise, all
/// else is Lambert.
pub(super) fn as_reference(material: &mut MaterialDesc) {
    if let MaterialModel::Pbr(pbr) = &material.model {
        material.model = if pbr.emissive.max_element() > 0.0 {
            MaterialModel::Emission { radiance: pbr.emissive }
        } else {
            MaterialModel::Diffuse { albedo: pbr.base_color.truncate() }
        };
    }
}
