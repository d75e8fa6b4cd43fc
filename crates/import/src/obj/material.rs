//! MTL materials mapped onto the physically based one. The mapping is described in [`super`].

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;

use super::mtl::{Entry, find_file};
use super::texture::Texture;
use crate::files::{self, Folder};
use crate::image::{Encoded, check_memory, decode_timed};
use crate::scene::{
    AlphaMode, Anisotropy, Channel, Clearcoat, ImageDesc, MaterialDesc, MaterialModel, PbrMaterial, Pixels, Sheen,
    TextureRef,
};
use crate::timing::{Stage, timed};
use crate::{ImportError, Options, Report};

/// How high the full range of a height map is with `-bm 1`, in widths of the texture: OBJ does not say.
const BUMP_HEIGHT: f32 = 0.01;

/// Roughness of sheen, of which MTL says nothing: that of Blender.
const SHEEN_ROUGHNESS: f32 = 0.5;

/// The colour of surfaces of which nothing is said.
const NEUTRAL: Vec3 = Vec3::splat(0.8);

/// A material for surfaces that have none: matt plastic.
///
/// White with vertex colours, which then show as they are; else grey.
pub(crate) fn neutral(name: &str, has_colors: bool) -> MaterialDesc {
    let pbr = PbrMaterial {
        base_color: if has_colors { Vec3::ONE } else { NEUTRAL }.extend(1.0),
        metallic: 0.0,
        roughness: 0.5,
        double_sided: true,
        ..PbrMaterial::default()
    };
    MaterialDesc { name: name.to_owned(), model: MaterialModel::Pbr(Box::new(pbr)) }
}

/// Maps materials, and reads the images that those named in `shown` name. What cannot be read is a warning, and left out.
pub(super) fn map(
    entries: &[Entry],
    folder: &Folder,
    options: &Options,
    shown: &HashSet<&str>,
    report: &mut Report,
) -> Result<(Vec<MaterialDesc>, Vec<ImageDesc>), ImportError> {
    let mut files = ImageFiles::default();
    let find = |e: &Entry| match shown.contains(e.material.name.as_str()) {
        true => Maps::find(e, folder, &mut files, report),
        false => Maps::default(),
    };
    let maps: Vec<Maps> = entries.iter().map(find).collect();
    let mut images = files.read(options, report)?;
    let materials = entries
        .iter()
        .zip(&maps)
        .map(|(entry, maps)| {
            warn_of_unsupported(entry, report);
            let pbr = Mapping { m: &entry.material, maps, images: &mut images }.pbr();
            MaterialDesc { name: entry.material.name.clone(), model: MaterialModel::Pbr(Box::new(pbr)) }
        })
        .collect();
    Ok((materials, images.descs))
}

fn warn_of_unsupported(entry: &Entry, report: &mut Report) {
    let unset = |value: &str| value.parse() == Ok(0.0_f32);
    const KEYS: [&str; 6] = ["map_aniso", "map_anisor", "map_Tr", "disp", "decal", "refl"];
    let params = &entry.material.unknown_param;
    let found: Vec<_> = KEYS.into_iter().filter(|&k| params.get(k).is_some_and(|v| !unset(v))).collect();
    if !found.is_empty() {
        let message = format!("material '{}': {} not rendered", entry.material.name, found.join(", "));
        report.warn(&entry.file, "", message);
    }
}

/// The image files that materials name, each once.
#[derive(Default)]
struct ImageFiles {
    paths: Vec<PathBuf>,
    index: HashMap<PathBuf, usize>,
}

/// The images that could be read.
struct Images {
    descs: Vec<ImageDesc>,
    /// By the index in [`ImageFiles`].
    index: Vec<Option<usize>>,
}

impl ImageFiles {
    fn add(&mut self, path: PathBuf) -> usize {
        *self.index.entry(path).or_insert_with_key(|path| {
            self.paths.push(path.clone());
            self.paths.len() - 1
        })
    }

    fn read(&self, options: &Options, report: &mut Report) -> Result<Images, ImportError> {
        let (limits, stages) = (&options.limits, options.stages.as_ref());
        self.paths.iter().for_each(|path| report.reads(path));
        let mut left = *limits;
        let read = |path: &PathBuf| {
            let bytes = files::read(path, &left)?;
            // Encoded images are held all at once.
            left.file_bytes -= bytes.len() as u64;
            Ok::<_, ImportError>(bytes)
        };
        let bytes: Vec<_> = timed(stages, Stage::Read, || self.paths.iter().map(read).collect());
        let names: Vec<String> = self.paths.iter().map(|p| p.to_string_lossy().into_owned()).collect();
        let sources: Vec<_> =
            names.iter().zip(&bytes).filter_map(|(name, b)| Some(Encoded { name, bytes: b.as_ref().ok()? })).collect();
        let held = self
            .paths
            .first()
            .map_or(Ok(()), |path| check_memory(&sources, limits, 0).map_err(|kind| ImportError::new(path, "", kind)));
        held?;
        let mut decoded = decode_timed(&sources, limits, stages).into_iter();
        let mut images = Images { descs: Vec::new(), index: Vec::new() };
        for (path, bytes) in self.paths.iter().zip(bytes) {
            let image = match bytes {
                Ok(_) => decoded.next().transpose(),
                Err(e) => Err(e.kind),
            };
            let index = match image {
                Ok(image) => image.map(|image| {
                    images.descs.push(image);
                    images.descs.len() - 1
                }),
                Err(e) => {
                    report.warn(path, "", format!("{e}; shown without this texture"));
                    None
                }
            };
            images.index.push(index);
        }
        Ok(images)
    }
}

/// A texture and the index of its file in [`ImageFiles`].
type Map = Option<(Texture, usize)>;

/// The textures of a material.
#[derive(Default)]
struct Maps {
    base: Map,
    specular: Map,
    emissive: Map,
    shininess: Map,
    opacity: Map,
    bump: Map,
    normal: Map,
    roughness: Map,
    metallic: Map,
    coat: Map,
    coat_roughness: Map,
    sheen: Map,
}

impl Maps {
    fn find(entry: &Entry, folder: &Folder, files: &mut ImageFiles, report: &mut Report) -> Self {
        let m = &entry.material;
        let mut find = |key: &str, statement: Option<&String>| -> Map {
            let texture = Texture::parse(statement?);
            let mut warn = |message: String| report.warn(&entry.file, "", format!("material '{}': {message}", m.name));
            let ignored: BTreeSet<_> = texture.ignored.iter().collect();
            for option in ignored {
                warn(format!("{key}: option {option} passed over"));
            }
            // Names are relative to the library by the format, to the model by habit.
            match find_file(&texture.name, &[&entry.folder, folder]) {
                Ok(found) => {
                    if found.by_base_name {
                        warn(format!("{key}: '{}' taken from {}", texture.name, found.path.display()));
                    }
                    Some((texture, files.add(found.path)))
                }
                Err(e) => {
                    warn(format!("{key}: '{}': {e}; shown without this texture", texture.name));
                    None
                }
            }
        };
        let other = |key: &str| m.unknown_param.get(key);
        Self {
            base: find("map_Kd", m.diffuse_texture.as_ref()),
            specular: find("map_Ks", m.specular_texture.as_ref()),
            emissive: find("map_Ke", other("map_Ke")),
            shininess: find("map_Ns", m.shininess_texture.as_ref()),
            opacity: find("map_d", m.dissolve_texture.as_ref()),
            bump: find("map_bump", m.normal_texture.as_ref()),
            normal: find("norm", other("norm")),
            roughness: find("map_Pr", other("map_Pr")),
            metallic: find("map_Pm", other("map_Pm")),
            coat: find("map_Pc", other("map_Pc")),
            coat_roughness: find("map_Pcr", other("map_Pcr")),
            sheen: find("map_Ps", other("map_Ps")),
        }
    }
}

/// The mapping of one material.
struct Mapping<'a> {
    m: &'a tobj::Material,
    maps: &'a Maps,
    images: &'a mut Images,
}

impl Mapping<'_> {
    fn pbr(mut self) -> PbrMaterial {
        let m = self.m;
        let maps = self.maps;
        let mut pbr = PbrMaterial {
            base_color_texture: self.reference(&maps.base),
            emissive_texture: self.reference(&maps.emissive),
            metallic: 0.0,
            double_sided: true,
            ..PbrMaterial::default()
        };
        let color = |c: [f32; 3]| Vec3::from(c).clamp(Vec3::ZERO, Vec3::ONE);
        let kd = match m.diffuse.map(color).unwrap_or(NEUTRAL) {
            // The black that stands beside a texture, without the texture.
            Vec3::ZERO if m.diffuse_texture.is_some() && pbr.base_color_texture.is_none() => NEUTRAL,
            kd => with_map(kd, &pbr.base_color_texture),
        };
        let ks = m.specular.map(color);
        pbr.base_color = kd.extend(1.0);
        pbr.emissive = with_map(Vec3::from(m.emissive.unwrap_or_default()).max(Vec3::ZERO), &pbr.emissive_texture);

        let opacity = m.dissolve.or_else(|| self.number("Tr").map(|tr| 1.0 - tr)).map(|d| d.clamp(0.0, 1.0));
        let roughness = self.number("Pr").map(|r| r.clamp(0.0, 1.0));
        let metallic = self.number("Pm").map(|m| m.clamp(0.0, 1.0));
        let physical = roughness.is_some() || metallic.is_some() || maps.roughness.is_some() || maps.metallic.is_some();
        let illum = m.illumination_model.unwrap_or(2);
        match illum {
            // With a texture of opacity, 4 and 9 are leaves and fences rather than glass.
            4 | 6 | 7 | 9 if matches!(illum, 6 | 7) || maps.opacity.is_none() => {
                pbr.metallic = metallic.unwrap_or(0.0);
                pbr.roughness = roughness.unwrap_or(0.0);
                pbr.ior = m.optical_density.unwrap_or(1.5).max(1.0);
                // Light passes two surfaces of a body.
                let filter = self.filter().powf(0.5);
                if matches!(illum, 6 | 7) {
                    pbr.transmission = 1.0;
                    pbr.thickness = 1.0;
                    pbr.base_color = filter.extend(1.0);
                } else {
                    pbr.transmission = opacity.map_or(1.0, |d| 1.0 - d);
                    if opacity.is_none() {
                        pbr.base_color = filter.extend(1.0);
                    }
                }
                self.set_physical_textures(&mut pbr, roughness, metallic);
                if maps.opacity.is_some() {
                    self.set_opacity(&mut pbr, None);
                }
            }
            3 | 5 if metallic.is_none() && maps.metallic.is_none() => {
                let ks = ks.unwrap_or(kd);
                let (diffuse, mirrored) = (kd.element_sum(), ks.element_sum());
                pbr.base_color = (kd + ks).min(Vec3::ONE).extend(1.0);
                pbr.metallic = if mirrored > 0.0 { mirrored / (diffuse + mirrored) } else { 0.0 };
                pbr.roughness = roughness.unwrap_or(0.0);
                self.set_physical_textures(&mut pbr, roughness, metallic);
                self.set_opacity(&mut pbr, opacity);
            }
            _ => {
                pbr.metallic = metallic.unwrap_or(0.0);
                pbr.roughness = match roughness {
                    Some(r) => r,
                    None if physical => 0.5,
                    None => roughness_of(m.shininess.unwrap_or(0.0)),
                };
                pbr.specular_color_texture = self.reference(&maps.specular);
                match ks {
                    _ if illum < 2 && !physical => pbr.specular = 0.0,
                    None if physical => {}
                    ks => {
                        let ks = with_map(ks.unwrap_or_default(), &pbr.specular_color_texture);
                        set_specular(&mut pbr, ks);
                    }
                }
                self.set_physical_textures(&mut pbr, roughness, metallic);
                if roughness.is_none() && pbr.roughness_texture.is_none() {
                    self.set_shininess_texture(&mut pbr);
                }
                self.set_opacity(&mut pbr, opacity);
            }
        }
        self.set_relief(&mut pbr);
        self.set_layers(&mut pbr);
        pbr
    }

    /// A number that tobj keeps as text.
    fn number(&self, key: &str) -> Option<f32> {
        self.m.unknown_param.get(key)?.parse().ok()
    }

    fn image(&self, map: &Map) -> Option<(usize, &ImageDesc)> {
        let (_, file) = map.as_ref()?;
        let index = self.images.index[*file]?;
        Some((index, &self.images.descs[index]))
    }

    fn reference(&self, map: &Map) -> Option<TextureRef> {
        let (texture, _) = map.as_ref()?;
        Some(texture.reference(self.image(map)?.0))
    }

    /// A texture of numbers: of luminance, if it does not name a channel.
    fn scalar_reference(&self, map: &Map) -> Option<TextureRef> {
        let (texture, _) = map.as_ref()?;
        let channel = texture.channel.unwrap_or(Channel::Luminance);
        Some(TextureRef { channel, ..self.reference(map)? })
    }

    /// The colour of `Tf`; its brightness is left out, since exporters do not agree on it.
    fn filter(&self) -> Vec3 {
        let tf =
            self.m.unknown_param.get("Tf").map(|v| v.split(' ').filter_map(|x| x.parse().ok()).collect::<Vec<f32>>());
        let tf = match tf.as_deref() {
            Some(&[r, g, b]) => Vec3::new(r, g, b).max(Vec3::ZERO),
            _ => return Vec3::ONE,
        };
        let brightest = tf.max_element();
        if brightest > 0.0 { tf / brightest } else { Vec3::ONE }
    }

    /// The textures of `Pr` and `Pm`.
    fn set_physical_textures(&self, pbr: &mut PbrMaterial, roughness: Option<f32>, metallic: Option<f32>) {
        if let Some(texture) = self.scalar_reference(&self.maps.metallic) {
            pbr.metallic_texture = Some(texture);
            pbr.metallic = metallic.filter(|&m| m > 0.0).unwrap_or(1.0);
        }
        if let Some(texture) = self.scalar_reference(&self.maps.roughness) {
            pbr.roughness_texture = Some(texture);
            pbr.roughness = roughness.filter(|&r| r > 0.0).unwrap_or(1.0);
        }
    }

    /// Coat, sheen and brushing, of the physically based keywords. With a texture, a missing factor or one of 0 is 1.
    fn set_layers(&self, pbr: &mut PbrMaterial) {
        let factor = |key: &str, map: &Option<TextureRef>| {
            let number = self.number(key).map_or(0.0, |x| x.clamp(0.0, 1.0));
            if map.is_some() && number == 0.0 { 1.0 } else { number }
        };
        let (texture, roughness_texture) =
            (self.scalar_reference(&self.maps.coat), self.scalar_reference(&self.maps.coat_roughness));
        let coat = factor("Pc", &texture);
        if coat > 0.0 {
            pbr.clearcoat = Some(Box::new(Clearcoat {
                factor: coat,
                texture,
                roughness: factor("Pcr", &roughness_texture),
                roughness_texture,
                ..Clearcoat::default()
            }));
        }
        let color_texture = self.reference(&self.maps.sheen);
        let sheen = factor("Ps", &color_texture);
        if sheen > 0.0 {
            let color = Vec3::splat(sheen);
            pbr.sheen =
                Some(Box::new(Sheen { color, color_texture, roughness: SHEEN_ROUGHNESS, roughness_texture: None }));
        }
        let strength = factor("aniso", &None);
        if strength > 0.0 {
            let turn = self.number("anisor").filter(|x| x.is_finite()).unwrap_or(0.0);
            let rotation = std::f32::consts::TAU * turn;
            pbr.anisotropy = Some(Box::new(Anisotropy { strength, rotation, texture: None }));
        }
    }

    /// A share of Ns has no factor of roughness that would do, so the roughness itself becomes the texture.
    fn set_shininess_texture(&mut self, pbr: &mut PbrMaterial) {
        let Some(texture) = self.scalar_reference(&self.maps.shininess) else { return };
        let shininess = self.m.shininess.filter(|&ns| ns > 0.0).unwrap_or(1000.0);
        let shares = &self.images.descs[texture.image];
        let image = roughness_image(
            shares,
            |share| roughness_of(shininess * (texture.value_offset + texture.value_scale * share)),
            texture.channel,
        );
        self.images.descs.push(image);
        let image = self.images.descs.len() - 1;
        pbr.roughness = 1.0;
        pbr.roughness_texture =
            Some(TextureRef { image, channel: Channel::Red, value_scale: 1.0, value_offset: 0.0, ..texture });
    }

    fn set_opacity(&self, pbr: &mut PbrMaterial, opacity: Option<f32>) {
        let opacity = opacity.unwrap_or(1.0);
        pbr.base_color.w = opacity;
        if opacity < 1.0 {
            pbr.alpha_mode = AlphaMode::Blend;
        }
        let Some(mut texture) = self.reference(&self.maps.opacity) else { return };
        pbr.alpha_mode = AlphaMode::Blend;
        let named = self.maps.opacity.as_ref().and_then(|(t, _)| t.channel);
        let has_alpha = has_alpha(&self.images.descs[texture.image]);
        texture.channel = named.unwrap_or(if has_alpha { Channel::Alpha } else { Channel::Luminance });
        // The alpha of the colour's own image counts already.
        let counted = texture.channel == Channel::Alpha
            && pbr.base_color_texture.as_ref().is_some_and(|base| base.image == texture.image);
        pbr.opacity_texture = (!counted).then_some(texture);
    }

    /// `norm`, or else `bump`: of normals if it is as blue as those are, of heights if not.
    fn set_relief(&self, pbr: &mut PbrMaterial) {
        let strength = |map: &Map| map.as_ref().map_or(1.0, |(t, _)| t.strength);
        if let Some(normal) = self.reference(&self.maps.normal) {
            pbr.normal_texture = Some(normal);
            pbr.normal_scale = strength(&self.maps.normal);
            return;
        }
        let Some(texture) = self.scalar_reference(&self.maps.bump) else { return };
        if is_normal_map(&self.images.descs[texture.image]) {
            pbr.normal_texture = Some(texture);
            pbr.normal_scale = strength(&self.maps.bump);
        } else {
            pbr.bump_texture = Some(texture);
            pbr.bump_scale = strength(&self.maps.bump) * BUMP_HEIGHT;
        }
    }
}

/// Exporters write black beside a texture that is meant to show as it is.
fn with_map(factor: Vec3, map: &Option<TextureRef>) -> Vec3 {
    if map.is_some() && factor == Vec3::ZERO { Vec3::ONE } else { factor }
}

/// Reflectance at normal incidence is 0.08 Ks: the usual 0.5 then is 0.04, glass and plastic. None at all, not even at
/// grazing incidence, where Ks is 0.
fn set_specular(pbr: &mut PbrMaterial, ks: Vec3) {
    let strength = 2.0 * ks.max_element();
    pbr.specular = strength.min(1.0);
    pbr.specular_color = if pbr.specular > 0.0 { 2.0 * ks / pbr.specular } else { Vec3::ONE };
}

/// Roughness of a Blinn-Phong exponent: alpha = sqrt(2 / (Ns + 2)) (Walter et al. 2007), the square of roughness.
fn roughness_of(shininess: f32) -> f32 {
    (2.0 / (shininess.max(0.0) + 2.0)).sqrt().sqrt()
}

/// RGBA in 0..1, or above it in images of floats.
fn pixel(image: &ImageDesc, i: usize) -> [f32; 4] {
    match &image.pixels {
        Pixels::Rgba8(p) => p[i].map(|c| f32::from(c) / 255.0),
        Pixels::Rgba16(p) => p[i].map(|c| f32::from(c) / 65535.0),
        Pixels::Rgb32F(p) => [p[i][0], p[i][1], p[i][2], 1.0],
    }
}

fn pixel_count(image: &ImageDesc) -> usize {
    image.width as usize * image.height as usize
}

fn has_alpha(image: &ImageDesc) -> bool {
    match &image.pixels {
        Pixels::Rgba8(p) => p.iter().any(|p| p[3] != u8::MAX),
        Pixels::Rgba16(p) => p.iter().any(|p| p[3] != u16::MAX),
        Pixels::Rgb32F(_) => false,
    }
}

/// Whether the mean of some thousand pixels is near (0.5, 0.5, 1). Height maps are grey.
fn is_normal_map(image: &ImageDesc) -> bool {
    let count = pixel_count(image);
    // An odd step does not keep to one column.
    let step = (count / 4096) | 1;
    let samples = (0..count).step_by(step);
    let sum: Vec3 = samples.clone().map(|i| pixel(image, i)).map(|p| Vec3::new(p[0], p[1], p[2])).sum();
    let mean = sum / samples.len().max(1) as f32;
    (mean - Vec3::new(0.5, 0.5, 1.0)).abs().max_element() < 0.25
}

/// An image of `f` of a channel, in all channels.
fn roughness_image(image: &ImageDesc, f: impl Fn(f32) -> f32, channel: Channel) -> ImageDesc {
    let value = |p: [f32; 4]| match channel {
        Channel::Red => p[0],
        Channel::Green => p[1],
        Channel::Blue => p[2],
        Channel::Alpha => p[3],
        Channel::Luminance => 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2],
    };
    let pixels: Arc<[[u8; 4]]> = (0..pixel_count(image))
        .map(|i| {
            let byte = (f(value(pixel(image, i))) * 255.0).round() as u8;
            [byte, byte, byte, 255]
        })
        .collect();
    let name = format!("{} as roughness", image.name);
    ImageDesc { name, width: image.width, height: image.height, pixels: Pixels::Rgba8(pixels) }
}
