//! What glTF's extensions lay over the base of a material, or let through it: compiled, and evaluated at a point.

use firsthit_import::scene::{self, PbrMaterial};
use glam::{Vec2, Vec3, Vec3Swizzles, Vec4Swizzles};

use super::fresnel::Fresnel;
use super::lobes::{Clearcoat, DiffuseTransmission, Lobe, Sheen};
use super::pbr;
use super::thin_film::Film;
use super::{Conventions, LEAST_ALPHA, Textures, energy};
use crate::kernel::Kernel;
use crate::surface::Surface;
use crate::texture::{ColorSpace, TextureLookup};
use crate::{EffectSet, StageError, tally};

/// Index of refraction of clear coats.
const COAT_IOR: f32 = 1.5;

/// The layers that a material calls for.
#[derive(Clone, Debug, Default)]
pub(super) struct Layers {
    coat: Option<Coat>,
    sheen: Option<Fibres>,
    film: Option<FilmOver>,
    brushed: Option<Brushed>,
    through: Option<Through>,
}

#[derive(Clone, Debug)]
struct Coat {
    factor: f32,
    texture: Option<TextureLookup>,
    roughness: f32,
    roughness_texture: Option<TextureLookup>,
    normal_texture: Option<TextureLookup>,
    normal_scale: f32,
}

#[derive(Clone, Debug)]
struct Fibres {
    color: Vec3,
    color_texture: Option<TextureLookup>,
    roughness: f32,
    roughness_texture: Option<TextureLookup>,
}

#[derive(Clone, Debug)]
struct FilmOver {
    factor: f32,
    texture: Option<TextureLookup>,
    ior: f32,
    thickness: [f32; 2],
    thickness_texture: Option<TextureLookup>,
}

#[derive(Clone, Debug)]
struct Brushed {
    strength: f32,
    /// Cosine and sine of the rotation.
    rotation: Vec2,
    texture: Option<TextureLookup>,
}

#[derive(Clone, Debug)]
struct Through {
    factor: f32,
    texture: Option<TextureLookup>,
    color: Vec3,
    color_texture: Option<TextureLookup>,
}

impl Coat {
    /// Its own normal, on the viewer's side.
    fn normal<K: Kernel>(&self, surface: &Surface<'_>, bend: bool) -> Vec3 {
        let normal = mapped::<K>(surface, self.normal_texture.as_ref(), self.normal_scale).unwrap_or(surface.smooth);
        if bend { surface.bent(normal) } else { normal }
    }
}

/// Where a reflection is rougher, and by how much.
pub(super) struct Brush {
    /// In the world, not unit.
    pub(super) direction: Vec3,
    /// 0 to 1.
    pub(super) strength: f32,
}

impl Layers {
    /// Compiles them; `None` where a material calls for none that is simulated.
    pub(super) fn new(
        desc: &PbrMaterial,
        textures: &mut Textures<'_>,
        conventions: Conventions,
    ) -> Result<Option<Box<Self>>, StageError> {
        let has = |effect| conventions.effects.contains(effect);
        let textured = has(EffectSet::TEXTURES);
        let mut get =
            |texture: &Option<_>, space, wanted: bool| textures.get(texture.as_ref().filter(|_| wanted), space);
        let mut layers = Self::default();
        if let Some(c) = desc.clearcoat.as_ref().filter(|_| has(EffectSet::CLEARCOAT)) {
            let mapped = textured && has(EffectSet::NORMAL_MAPS);
            layers.coat = Some(Coat {
                factor: c.factor,
                texture: get(&c.texture, ColorSpace::Linear, textured)?,
                roughness: c.roughness,
                roughness_texture: get(&c.roughness_texture, ColorSpace::Linear, textured)?,
                normal_texture: get(&c.normal_texture, ColorSpace::Linear, mapped)?,
                normal_scale: c.normal_scale,
            });
        }
        if let Some(s) = desc.sheen.as_ref().filter(|_| has(EffectSet::SHEEN)) {
            layers.sheen = Some(Fibres {
                color: s.color,
                color_texture: get(&s.color_texture, ColorSpace::Srgb, textured)?,
                roughness: s.roughness,
                roughness_texture: get(&s.roughness_texture, ColorSpace::Linear, textured)?,
            });
        }
        if let Some(i) = desc.iridescence.as_ref().filter(|_| has(EffectSet::IRIDESCENCE)) {
            layers.film = Some(FilmOver {
                factor: i.factor,
                texture: get(&i.texture, ColorSpace::Linear, textured)?,
                ior: i.ior.max(1.0),
                thickness: [i.thickness_min, i.thickness_max],
                thickness_texture: get(&i.thickness_texture, ColorSpace::Linear, textured)?,
            });
        }
        if let Some(a) = desc.anisotropy.as_ref().filter(|_| has(EffectSet::ANISOTROPY)) {
            layers.brushed = Some(Brushed {
                strength: a.strength,
                rotation: Vec2::from_angle(a.rotation),
                texture: get(&a.texture, ColorSpace::Linear, textured)?,
            });
        }
        if let Some(d) = desc.diffuse_transmission.as_ref().filter(|_| has(EffectSet::DIFFUSE_TRANSMISSION)) {
            layers.through = Some(Through {
                factor: d.factor,
                texture: get(&d.texture, ColorSpace::Linear, textured)?,
                color: d.color,
                color_texture: get(&d.color_texture, ColorSpace::Srgb, textured)?,
            });
        }
        let Self { coat, sheen, film, brushed, through } = &layers;
        let any = coat.is_some() || sheen.is_some() || film.is_some() || brushed.is_some() || through.is_some();
        Ok(any.then(|| Box::new(layers)))
    }

    pub(super) fn lets_light_through(&self) -> bool {
        self.through.is_some()
    }

    fn coat_weight<K: Kernel>(&self, surface: &Surface<'_>) -> Option<(&Coat, f32)> {
        let coat = self.coat.as_ref()?;
        tally::sample(EffectSet::CLEARCOAT);
        let weight = (coat.factor * scalar::<K>(EffectSet::CLEARCOAT, coat.texture.as_ref(), surface)).clamp(0.0, 1.0);
        (weight > 0.0).then_some((coat, weight))
    }

    /// What coat and sheen leave of light that passes straight through at this cosine: normal maps do not count.
    pub(super) fn passed<K: Kernel>(&self, surface: &Surface<'_>, cos: f32) -> f32 {
        let coat = self.coat_weight::<K>(surface).map_or(1.0, |(_, weight)| Clearcoat::passed(weight, cos));
        let sheen = self.sheen::<K>(surface, cos).map_or(1.0, |(_, passed)| passed);
        coat * sheen
    }

    /// The coat as a lobe about the base's normal, and what it leaves of the light below.
    pub(super) fn coat<K: Kernel>(
        &self,
        surface: &Surface<'_>,
        bend: bool,
        local: impl Fn(Vec3) -> Vec3,
    ) -> Option<(Lobe, f32)> {
        let (coat, weight) = self.coat_weight::<K>(surface)?;
        let roughness = (coat.roughness * scalar::<K>(EffectSet::CLEARCOAT, coat.roughness_texture.as_ref(), surface))
            .clamp(0.0, 1.0);
        let normal = coat.normal::<K>(surface, bend);
        let alpha = (roughness * roughness).max(LEAST_ALPHA);
        let lobe = Clearcoat { weight, alpha, normal: local(normal).try_normalize().unwrap_or(Vec3::Z) };
        Some((Lobe::Clearcoat(lobe), Clearcoat::passed(weight, normal.dot(surface.wo))))
    }

    /// What the coat leaves of light that comes from below it towards the viewer.
    pub(super) fn under_coat<K: Kernel>(&self, surface: &Surface<'_>, bend: bool) -> f32 {
        self.coat_weight::<K>(surface)
            .map_or(1.0, |(coat, weight)| Clearcoat::passed(weight, coat.normal::<K>(surface, bend).dot(surface.wo)))
    }

    pub(super) fn has_coat(&self) -> bool {
        self.coat.is_some()
    }

    /// The sheen as a lobe, and what it leaves of the light below, at this cosine to the viewer.
    pub(super) fn sheen<K: Kernel>(&self, surface: &Surface<'_>, cos: f32) -> Option<(Sheen, f32)> {
        let sheen = self.sheen.as_ref()?;
        tally::sample(EffectSet::SHEEN);
        let tint = sheen.color * color::<K>(EffectSet::SHEEN, sheen.color_texture.as_ref(), surface).xyz();
        if tint.max_element() <= 0.0 {
            return None;
        }
        let roughness = sheen.roughness * scalar::<K>(EffectSet::SHEEN, sheen.roughness_texture.as_ref(), surface);
        // Albedo scaling as the extension has it, by the viewer's angle alone.
        let passed = 1.0 - tint.max_element() * energy::sheen(cos, roughness);
        Some((Sheen::new(tint, roughness), passed.max(0.0)))
    }

    /// The base's law of reflectance under the film.
    pub(super) fn filmed<K: Kernel>(&self, surface: &Surface<'_>, base: Fresnel) -> Fresnel {
        let (Some(film), Fresnel::Schlick { f0, f90, eta }) = (&self.film, base) else { return base };
        tally::sample(EffectSet::IRIDESCENCE);
        let factor =
            (film.factor * scalar::<K>(EffectSet::IRIDESCENCE, film.texture.as_ref(), surface)).clamp(0.0, 1.0);
        if factor == 0.0 {
            return base;
        }
        let share = scalar::<K>(EffectSet::IRIDESCENCE, film.thickness_texture.as_ref(), surface);
        let thickness = film.thickness[0] + (film.thickness[1] - film.thickness[0]) * share;
        // Below a coat, that is what the film lies in.
        let coated = self.coat.as_ref().map_or(0.0, |c| c.factor);
        let outside = 1.0 + (COAT_IOR - 1.0) * coated;
        Fresnel::Film { f0, f90, eta, film: Film { factor, outside, ior: film.ior, thickness } }
    }

    /// The direction in which the surface is brushed.
    pub(super) fn brush<K: Kernel>(&self, surface: &Surface<'_>) -> Option<Brush> {
        let brushed = self.brushed.as_ref()?;
        tally::sample(EffectSet::ANISOTROPY);
        let (mut direction, mut strength, mut set) = (brushed.rotation, brushed.strength, 0);
        if let Some(t) = brushed.texture.as_ref().filter(|_| K::TEXTURES) {
            set = t.uv_set();
            tally::look_up(EffectSet::ANISOTROPY);
            let texel = surface.look_up(|| t.color_at(&surface.view(t)));
            let along = texel.xy() * 2.0 - 1.0;
            direction = brushed.rotation.rotate(along.try_normalize().unwrap_or(Vec2::X));
            strength *= texel.z;
        }
        let [tangent, bitangent] = surface.tangents(set)?;
        (strength > 0.0)
            .then(|| Brush { direction: tangent * direction.x + bitangent * direction.y, strength: strength.min(1.0) })
    }

    /// The share of diffuse light that goes through, and as which lobe.
    pub(super) fn through<K: Kernel>(
        &self,
        surface: &Surface<'_>,
        coat: Fresnel,
    ) -> Option<(DiffuseTransmission, f32)> {
        let through = self.through.as_ref()?;
        tally::sample(EffectSet::DIFFUSE_TRANSMISSION);
        let factor = (through.factor * scalar::<K>(EffectSet::DIFFUSE_TRANSMISSION, through.texture.as_ref(), surface))
            .clamp(0.0, 1.0);
        let tint =
            through.color * color::<K>(EffectSet::DIFFUSE_TRANSMISSION, through.color_texture.as_ref(), surface).xyz();
        Some((DiffuseTransmission { color: tint * factor, coat }, factor))
    }
}

/// What a layer's texture says about a point.
fn scalar<K: Kernel>(layer: EffectSet, lookup: Option<&TextureLookup>, surface: &Surface<'_>) -> f32 {
    if lookup.is_some() {
        tally::look_up(layer);
    }
    pbr::scalar::<K>(lookup, surface)
}

fn color<K: Kernel>(layer: EffectSet, lookup: Option<&TextureLookup>, surface: &Surface<'_>) -> glam::Vec4 {
    if lookup.is_some() {
        tally::look_up(layer);
    }
    pbr::color::<K>(lookup, surface)
}

/// The normal of a normal map, in the world and on the viewer's side.
pub(super) fn mapped<K: Kernel>(surface: &Surface<'_>, texture: Option<&TextureLookup>, scale: f32) -> Option<Vec3> {
    let t = texture.filter(|_| K::TEXTURES)?;
    tally::sample(EffectSet::NORMAL_MAPS);
    tally::look_up(EffectSet::NORMAL_MAPS);
    let texel = surface.look_up(|| t.color_at(&surface.view(t)));
    let n = (texel.xyz() * 2.0 - 1.0) * Vec3::new(scale, scale, 1.0);
    if n.is_finite() && n.xy() != Vec2::ZERO { surface.mapped_normal(n, t.uv_set()) } else { None }
}

/// Whether a layer of a material has a texture.
pub(crate) fn have_textures(m: &PbrMaterial) -> bool {
    let bare = PbrMaterial {
        clearcoat: None,
        sheen: None,
        iridescence: None,
        anisotropy: None,
        diffuse_transmission: None,
        ..m.clone()
    };
    m.textures().count() > bare.textures().count()
}

/// The effects of its own that each layer of a material calls for.
pub(crate) fn effects(m: &PbrMaterial) -> EffectSet {
    let mut set = EffectSet::empty();
    let there = |factor: f32| factor > 0.0;
    set.set(EffectSet::CLEARCOAT, m.clearcoat.as_ref().is_some_and(|c| there(c.factor)));
    set.set(EffectSet::SHEEN, m.sheen.as_ref().is_some_and(|s| there(s.color.max_element())));
    set.set(EffectSet::IRIDESCENCE, m.iridescence.as_ref().is_some_and(|i| there(i.factor)));
    set.set(EffectSet::ANISOTROPY, m.anisotropy.as_ref().is_some_and(|a| there(a.strength)));
    let through = |d: &scene::DiffuseTransmission| there(d.factor) && there(d.color.max_element());
    set.set(EffectSet::DIFFUSE_TRANSMISSION, m.diffuse_transmission.as_deref().is_some_and(through));
    set.set(EffectSet::DISPERSION, m.dispersion > 0.0 && m.transmission > 0.0 && m.thickness > 0.0);
    set
}
