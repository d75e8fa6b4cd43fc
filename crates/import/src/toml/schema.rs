//! What may stand in a scene file, as serde reads it from TOML and JSON alike. `docs/scene-files.md` is its manual.
//!
//! Only form is checked here (keys, types, finite numbers); meaning is checked where the scene is built.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, MapAccess, Visitor};

use super::values::{Color, Named, Number, Pair, Scale, Triple};
use crate::{NotAnAxis, UpAxis};

/// The whole file.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct SceneFile {
    pub(super) name: Option<String>,
    pub(super) conventions: Option<Conventions>,
    pub(super) film: Option<Film>,
    pub(super) max_depth: Option<i64>,
    pub(super) camera: Option<Camera>,
    pub(super) cameras: Vec<Camera>,
    pub(super) materials: Named<Material>,
    pub(super) objects: Vec<Object>,
    pub(super) lights: Vec<Light>,
    pub(super) env: Option<Environment>,
    pub(super) fog: Option<Fog>,
    #[serde(rename = "note")]
    _note: IgnoredAny,
    #[serde(rename = "exact")]
    _exact: IgnoredAny,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Conventions {
    Firsthit,
    Reference,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Film {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) filter: Option<String>,
    pub(super) space: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Camera {
    pub(super) name: Option<String>,
    pub(super) origin: Triple,
    pub(super) target: Triple,
    pub(super) up: Option<Triple>,
    pub(super) vfov_deg: Option<Number>,
    pub(super) orthographic_height: Option<Number>,
    pub(super) aperture: Option<Number>,
    pub(super) focus_distance: Option<Number>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Fog {
    pub(super) scattering: Option<Color>,
    pub(super) absorption: Option<Color>,
    pub(super) g: Option<Number>,
    pub(super) min: Option<Triple>,
    pub(super) max: Option<Triple>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Material {
    Diffuse {
        albedo: Color,
    },
    Emission {
        radiance: Color,
    },
    Mirror {
        #[serde(default = "white")]
        reflectance: Color,
    },
    Glass {
        #[serde(default = "glass_ior")]
        ior: Number,
    },
    RoughMirror {
        alpha: Number,
        #[serde(default = "white")]
        reflectance: Color,
    },
    RoughGlass {
        #[serde(default = "glass_ior")]
        ior: Number,
        alpha: Number,
    },
    #[serde(alias = "gltf_pbr")]
    Pbr(Box<Pbr>),
}

fn white() -> Color {
    Color::WHITE
}

fn glass_ior() -> Number {
    Number(1.5)
}

/// All fields of the physically based material; what is missing has the default that the builder gives it.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Pbr {
    pub(super) base_color: Option<Color>,
    pub(super) base_color_texture: Option<Texture>,
    pub(super) alpha: Option<Number>,
    pub(super) alpha_mode: Option<AlphaMode>,
    pub(super) alpha_cutoff: Option<Number>,
    pub(super) opacity_texture: Option<Texture>,
    pub(super) metallic: Option<Number>,
    pub(super) metallic_texture: Option<Texture>,
    pub(super) roughness: Option<Number>,
    pub(super) roughness_texture: Option<Texture>,
    pub(super) normal_texture: Option<Texture>,
    pub(super) normal_scale: Option<Number>,
    pub(super) bump_texture: Option<Texture>,
    pub(super) bump_scale: Option<Number>,
    pub(super) occlusion_texture: Option<Texture>,
    pub(super) occlusion_strength: Option<Number>,
    pub(super) emissive: Option<Color>,
    pub(super) emissive_texture: Option<Texture>,
    pub(super) double_sided: Option<bool>,
    pub(super) unlit: Option<bool>,
    pub(super) ior: Option<Number>,
    pub(super) transmission: Option<Number>,
    pub(super) transmission_texture: Option<Texture>,
    pub(super) thickness: Option<Number>,
    pub(super) thickness_texture: Option<Texture>,
    pub(super) attenuation_color: Option<Color>,
    pub(super) attenuation_distance: Option<Number>,
    pub(super) specular: Option<Number>,
    pub(super) specular_texture: Option<Texture>,
    pub(super) specular_color: Option<Color>,
    pub(super) specular_color_texture: Option<Texture>,
    pub(super) dispersion: Option<Number>,
    pub(super) clearcoat: Option<Number>,
    pub(super) clearcoat_texture: Option<Texture>,
    pub(super) clearcoat_roughness: Option<Number>,
    pub(super) clearcoat_roughness_texture: Option<Texture>,
    pub(super) clearcoat_normal_texture: Option<Texture>,
    pub(super) clearcoat_normal_scale: Option<Number>,
    pub(super) sheen_color: Option<Color>,
    pub(super) sheen_color_texture: Option<Texture>,
    pub(super) sheen_roughness: Option<Number>,
    pub(super) sheen_roughness_texture: Option<Texture>,
    pub(super) iridescence: Option<Number>,
    pub(super) iridescence_texture: Option<Texture>,
    pub(super) iridescence_ior: Option<Number>,
    pub(super) iridescence_thickness_min: Option<Number>,
    pub(super) iridescence_thickness_max: Option<Number>,
    pub(super) iridescence_thickness_texture: Option<Texture>,
    pub(super) anisotropy: Option<Number>,
    pub(super) anisotropy_rotation_deg: Option<Number>,
    pub(super) anisotropy_texture: Option<Texture>,
    pub(super) diffuse_transmission: Option<Number>,
    pub(super) diffuse_transmission_texture: Option<Texture>,
    pub(super) diffuse_transmission_color: Option<Color>,
    pub(super) diffuse_transmission_color_texture: Option<Texture>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum AlphaMode {
    Opaque,
    Mask,
    Blend,
}

/// An image file, or a table with how it is put on.
#[derive(Debug)]
pub(super) struct Texture(pub(super) TextureTable);

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TextureTable {
    pub(super) file: String,
    #[serde(default)]
    pub(super) uv_set: usize,
    pub(super) scale: Option<Pair>,
    pub(super) offset: Option<Pair>,
    pub(super) rotation_deg: Option<Number>,
    #[serde(default)]
    pub(super) wrap: Wrap,
    #[serde(default)]
    pub(super) filter: Filter,
    pub(super) channel: Option<Channel>,
}

impl<'de> Deserialize<'de> for Texture {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Textures;
        impl<'de> Visitor<'de> for Textures {
            type Value = Texture;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of an image file, or a table with `file`")
            }
            fn visit_str<E: de::Error>(self, file: &str) -> Result<Texture, E> {
                Ok(Texture(TextureTable { file: file.to_owned(), ..TextureTable::default() }))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Texture, A::Error> {
                TextureTable::deserialize(de::value::MapAccessDeserializer::new(map)).map(Texture)
            }
        }
        d.deserialize_any(Textures)
    }
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Wrap {
    #[default]
    Repeat,
    Mirror,
    Clamp,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Filter {
    #[default]
    Linear,
    Nearest,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Channel {
    Red,
    Green,
    Blue,
    Alpha,
    Luminance,
}

/// Something that can be seen. Unknown keys are found by [`Shape`], which gets all keys that are not named here.
#[derive(Debug, Deserialize)]
pub(super) struct Object {
    pub(super) name: Option<String>,
    pub(super) material: Option<String>,
    pub(super) transform: Option<Transform>,
    pub(super) moves_to: Option<Transform>,
    #[serde(flatten)]
    pub(super) shape: Shape,
}

/// `matrix`, or scaled, then turned, then moved.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Transform {
    pub(super) scale: Option<Scale>,
    pub(super) rotate_deg: Option<Triple>,
    pub(super) look_at: Option<Triple>,
    pub(super) translate: Option<Triple>,
    pub(super) matrix: Option<Vec<[Number; 4]>>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "shape", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Shape {
    /// Any file that can be opened, also another scene file.
    #[serde(alias = "obj", alias = "gltf")]
    Model(Model),
    /// Triangles given right here.
    Mesh {
        positions: Vec<Triple>,
        triangles: Vec<[u32; 3]>,
        #[serde(default)]
        normals: Vec<Triple>,
        #[serde(default)]
        uvs: Vec<Pair>,
    },
    Sphere {
        center: Triple,
        radius: Number,
    },
    Plane {
        point: Triple,
        normal: Triple,
        #[serde(default)]
        cull_back: bool,
    },
    Disk {
        center: Triple,
        normal: Triple,
        radius: Number,
        inner_radius: Option<Number>,
    },
    /// The first loop is the outline; a point is inside where an odd number of loops go round it.
    Polygon {
        loops: Vec<Vec<Triple>>,
    },
    Box {
        min: Triple,
        max: Triple,
    },
    /// `A x^2 + 2B xy + 2C xz + 2D x + E y^2 + 2F yz + 2G y + H z^2 + 2I z + J = 0`.
    Quadric {
        coefficients: [Number; 10],
        clip_min: Option<Triple>,
        clip_max: Option<Triple>,
        #[serde(default)]
        caps: bool,
    },
    Cylinder {
        from: Triple,
        to: Triple,
        radius: Number,
        #[serde(default = "yes")]
        caps: bool,
    },
    /// From the middle of the base to the apex, or to the middle of the top if that has a radius.
    Cone {
        from: Triple,
        to: Triple,
        radius: Number,
        top_radius: Option<Number>,
        #[serde(default = "yes")]
        caps: bool,
    },
    Ellipsoid {
        center: Triple,
        radii: Triple,
    },
    /// From the vertex to the middle of the rim.
    Paraboloid {
        from: Triple,
        to: Triple,
        radius: Number,
        #[serde(default = "yes")]
        caps: bool,
    },
    /// From the middle of one rim to that of the other.
    HyperboloidOne {
        from: Triple,
        to: Triple,
        waist_radius: Number,
        radius: Number,
        #[serde(default = "yes")]
        caps: bool,
    },
    /// As above; `gap` lies between the two sheets.
    HyperboloidTwo {
        from: Triple,
        to: Triple,
        gap: Number,
        radius: Number,
        #[serde(default = "yes")]
        caps: bool,
    },
}

fn yes() -> bool {
    true
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Model {
    pub(super) file: String,
    pub(super) up: Option<Up>,
    /// From names of materials in the model to names in this file.
    #[serde(default)]
    pub(super) materials: Named<String>,
}

/// An axis by its name.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "String")]
pub(super) struct Up(pub(super) UpAxis);

impl TryFrom<String> for Up {
    type Error = NotAnAxis;

    fn try_from(name: String) -> Result<Self, NotAnAxis> {
        name.parse().map(Self)
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct Light {
    pub(super) name: Option<String>,
    #[serde(flatten)]
    pub(super) kind: LightKind,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum LightKind {
    Point {
        position: Triple,
        intensity: Color,
        range: Option<Number>,
    },
    Directional {
        direction: Triple,
        irradiance: Color,
        angle_deg: Option<Number>,
    },
    Spot {
        position: Triple,
        target: Triple,
        intensity: Color,
        inner_deg: Number,
        outer_deg: Number,
        range: Option<Number>,
    },
    /// Shines towards `target`; `up` gives the direction of the height.
    Rectangle {
        center: Triple,
        target: Triple,
        up: Option<Triple>,
        width: Number,
        height: Number,
        radiance: Color,
    },
    Sphere {
        center: Triple,
        radius: Number,
        radiance: Color,
    },
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Environment {
    Constant { radiance: Color },
    Latlong { file: String, rotation_deg: Option<Number>, scale: Option<Color> },
    Studio { rotation_deg: Option<Number>, scale: Option<Color> },
}
