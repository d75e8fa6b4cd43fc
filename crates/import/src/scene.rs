//! A scene as plain data: what the files say, in one form, checked.
//!
//! # Units and frames
//! Right-handed, +Y up, lengths in metres. World space is f64; mesh data is f32, in the mesh's own space. Colours are
//! linear RGB with Rec. 709 primaries. Angles are in radians.

mod material;

use std::sync::Arc;

use firsthit_geometry::Shape;
use glam::{Affine2, DAffine3, DVec3, Vec3};

pub use material::{
    AlphaMode, Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, MaterialDesc, MaterialModel, PbrMaterial, Sheen,
};

/// A whole scene. All indices are in range: readers check them.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// The name of the scene or file.
    pub name: String,
    /// Meshes in their own space; several instances may share one.
    pub meshes: Vec<MeshDesc>,
    /// Meshes placed in the world.
    pub instances: Vec<InstanceDesc>,
    /// Materials.
    pub materials: Vec<MaterialDesc>,
    /// Images of the textures.
    pub images: Vec<ImageDesc>,
    /// Lights other than glowing surfaces.
    pub lights: Vec<LightDesc>,
    /// Cameras of the file.
    pub cameras: Vec<CameraDesc>,
    /// What surrounds the scene; `None`: the file does not say.
    pub environment: Option<EnvironmentDesc>,
    /// What fills the space between things; `None`: nothing.
    pub fog: Option<FogDesc>,
    /// What the file says about how to render it.
    pub settings: Settings,
}

/// What a file says about how it is to be rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Width and height of the picture in pixels.
    pub resolution: Option<(u32, u32)>,
    /// Longest path, counted in edges (1: what the camera sees glowing, 2: direct light, ...; `u32::MAX`: unlimited).
    pub max_path_edges: Option<u32>,
    /// Index into [`SceneDesc::cameras`] of the camera that the file wants to be seen through (scene files say so;
    /// a model's cameras are only an offer).
    pub camera: Option<usize>,
    /// Renders by exactly the conventions of a reference `scene.json`: plain lobes, bilinear textures without
    /// mip-maps, no terminator fix, box filter, black where there is no environment.
    pub reference_conventions: bool,
}

/// One or more geometries that are placed together and share one tree.
#[derive(Clone, Debug, Default)]
pub struct MeshDesc {
    /// Name in the file.
    pub name: String,
    /// Its parts. A hit's `geometry` is the index into this.
    pub geometries: Vec<GeometryDesc>,
}

/// A part of a mesh that has one material.
#[derive(Clone, Debug)]
pub struct GeometryDesc {
    /// Name in the file.
    pub name: String,
    /// Its surface.
    pub surface: SurfaceDesc,
    /// Index into [`SceneDesc::materials`]; `None`: the default material.
    pub material: Option<usize>,
}

/// The surface of a geometry.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "one for each part of a mesh: few, beside what triangles hold")]
pub enum SurfaceDesc {
    /// Indexed triangles. A hit's `primitive` is the index of the triangle.
    Triangles(TriangleMesh),
    /// An analytic shape; `primitive` is 0.
    Shape(Shape<f64>),
}

/// Indexed triangles. All attribute arrays are empty or as long as `positions`; indices are in range; positions are
/// finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Unit vertex normals; empty: flat.
    pub normals: Vec<Vec3>,
    /// Unit tangents with the handedness (+1 or -1) of the bitangent in `w`; empty: none needed.
    pub tangents: Vec<glam::Vec4>,
    /// Texture coordinates by set, (0, 0) at the *upper* left of the image, v downwards (as in glTF).
    pub uvs: Vec<Vec<glam::Vec2>>,
    /// Linear vertex colours with alpha; empty: white.
    pub colors: Vec<glam::Vec4>,
    /// Where its vertices are when the camera's shutter closes, if they move by themselves: until then they go there
    /// evenly. Texture coordinates and colours stay.
    pub moves_to: Option<Box<Vertices>>,
}

/// What of a mesh's vertices moves. Arrays are as long as those of the mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// Their positions.
    pub positions: Vec<Vec3>,
    /// Their unit normals.
    pub normals: Vec<Vec3>,
    /// Their unit tangents with handedness.
    pub tangents: Vec<glam::Vec4>,
}

/// A mesh in the world.
#[derive(Clone, Debug)]
pub struct InstanceDesc {
    /// Name of the node.
    pub name: String,
    /// Index into [`SceneDesc::meshes`].
    pub mesh: usize,
    /// From the mesh's space to the world. May mirror; must be invertible (readers bake or skip what is not).
    pub transform: DAffine3,
    /// Where it is when the camera's shutter closes, if it moves: `transform` is where it is when the shutter opens.
    pub moves_to: Option<DAffine3>,
}

/// How an image is put on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`SceneDesc::images`].
    pub image: usize,
    /// Which set of texture coordinates; where a mesh lacks it, (0, 0).
    pub uv_set: usize,
    /// Applied to the coordinates before the image is looked up.
    pub transform: Affine2,
    /// Outside 0..1 in u.
    pub wrap_u: Wrap,
    /// Outside 0..1 in v.
    pub wrap_v: Wrap,
    /// Between texels.
    pub filter: Filter,
    /// Which channel counts where only one is asked for.
    pub channel: Channel,
    /// The looked-up value is `value * scale + offset` (OBJ's `-mm`).
    pub value_scale: f32,
    /// See `value_scale`.
    pub value_offset: f32,
}

impl TextureRef {
    /// An image as it is: set 0, repeated, filtered.
    #[must_use]
    pub fn new(image: usize) -> Self {
        Self {
            image,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            filter: Filter::Linear,
            channel: Channel::Red,
            value_scale: 1.0,
            value_offset: 0.0,
        }
    }
}

/// A channel of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Channel {
    /// R
    #[default]
    Red,
    /// G
    Green,
    /// B
    Blue,
    /// A
    Alpha,
    /// Rec. 709 luminance.
    Luminance,
}

/// What a texture shows outside its image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Again and again.
    #[default]
    Repeat,
    /// Again, mirrored every other time.
    Mirror,
    /// Its border.
    Clamp,
}

/// How a texture is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel, as the file asks.
    Nearest,
    /// Bilinear, anti-aliased where it is small.
    #[default]
    Linear,
}

/// A decoded image, row 0 at the top.
#[derive(Clone, Debug)]
pub struct ImageDesc {
    /// Name or path in the file.
    pub name: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The pixels as stored; how to read them (sRGB or linear) is said by where the texture is used.
    pub pixels: Pixels,
}

/// Pixels of an image, shared cheaply.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// Eight bits a channel, RGBA.
    Rgba8(Arc<[[u8; 4]]>),
    /// Sixteen bits a channel, RGBA.
    Rgba16(Arc<[[u16; 4]]>),
    /// Linear floating point, RGB (Radiance, OpenEXR).
    Rgb32F(Arc<[[f32; 3]]>),
}

impl Pixels {
    /// Whether they are the very same, in the same place of memory.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Rgba8(a), Self::Rgba8(b)) => Arc::ptr_eq(a, b),
            (Self::Rgba16(a), Self::Rgba16(b)) => Arc::ptr_eq(a, b),
            (Self::Rgb32F(a), Self::Rgb32F(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }

    /// Their size in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Rgba8(p) => size_of_val(&**p),
            Self::Rgba16(p) => size_of_val(&**p),
            Self::Rgb32F(p) => size_of_val(&**p),
        };
        bytes as u64
    }
}

/// A light that is not a surface of a mesh.
#[derive(Clone, Debug)]
pub struct LightDesc {
    /// Name in the file.
    pub name: String,
    /// Where it is and how it shines.
    pub kind: LightKind,
}

/// The kinds of light. Directions are unit.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// Shines everywhere from a point.
    Point {
        /// Where.
        position: DVec3,
        /// Radiant intensity, W/sr (glTF: candela).
        intensity: Vec3,
        /// Beyond this distance there is no light (glTF's `range`).
        range: Option<f32>,
    },
    /// Shines from a point within a cone.
    Spot {
        /// Where.
        position: DVec3,
        /// Axis of the cone.
        direction: DVec3,
        /// Radiant intensity on the axis, W/sr.
        intensity: Vec3,
        /// Half angle of the full intensity.
        inner: f32,
        /// Half angle where it ends.
        outer: f32,
        /// How it falls off between the two.
        ramp: SpotRamp,
        /// As for a point.
        range: Option<f32>,
    },
    /// Parallel light from infinitely far.
    Directional {
        /// Where the light travels.
        direction: DVec3,
        /// Irradiance on a plane facing it, W/m² (glTF: lux).
        irradiance: Vec3,
        /// Angle that the source's disk spans as seen from the scene; 0: sharp shadows.
        angle: f32,
    },
    /// A glowing rectangle, seen by the camera, one-sided.
    Rectangle {
        /// One corner.
        corner: DVec3,
        /// From the corner along one edge.
        edge_u: DVec3,
        /// From the corner along the other; shines towards `edge_u` x `edge_v`.
        edge_v: DVec3,
        /// Radiance, W/m²·sr.
        radiance: Vec3,
    },
    /// A glowing ball, seen by the camera.
    Sphere {
        /// The middle.
        center: DVec3,
        /// Its radius.
        radius: f64,
        /// Radiance, W/m²·sr.
        radiance: Vec3,
    },
}

/// How a spot light falls off between its two angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotRamp {
    /// Square of a ramp in the cosine: KHR_lights_punctual.
    #[default]
    Gltf,
    /// Linear in the angle: the reference scenes.
    LinearAngle,
}

/// What surrounds the scene.
#[derive(Clone, Debug)]
pub enum EnvironmentDesc {
    /// The same radiance from everywhere.
    Constant {
        /// Radiance, W/m²·sr.
        radiance: Vec3,
    },
    /// The renderer's built-in studio.
    Studio {
        /// Turns it counter-clockwise seen from +Y, radians.
        rotation: f32,
        /// Multiplies its light.
        scale: Vec3,
    },
    /// A map by longitude and latitude: row 0 at +Y; u = atan2(x, -z) / 2 pi, v = acos(y) / pi.
    LatLong {
        /// Index into [`SceneDesc::images`].
        image: usize,
        /// Turns the map counter-clockwise seen from +Y, radians.
        rotation: f32,
        /// Multiplies the image.
        scale: Vec3,
    },
}

/// A camera.
#[derive(Clone, Debug)]
pub struct CameraDesc {
    /// Name in the file.
    pub name: String,
    /// From camera to world: it looks along its -Z, +Y is up.
    pub transform: DAffine3,
    /// How it maps the scene to the picture.
    pub projection: Projection,
    /// Its lens; `None`: a pinhole, before which everything is sharp.
    pub lens: Option<LensDesc>,
    /// Where it is when its shutter closes, if it moves: `transform` is where it is when the shutter opens.
    pub moves_to: Option<DAffine3>,
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensDesc {
    /// The diameter of its opening, world units.
    pub aperture: f64,
    /// How far away, along the line of sight, things are sharp, world units; `None`: where the camera looks at.
    pub focus_distance: Option<f64>,
}

/// Fog that is the same everywhere outside of solids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FogDesc {
    /// Light that is scattered on each unit of its way, 1/world unit.
    pub scattering: Vec3,
    /// Light that is taken away on each unit of its way, 1/world unit.
    pub absorption: Vec3,
    /// The mean cosine of the angle of scattering, in (-1, 1): 0 evenly, near 1 mostly onwards (Henyey and Greenstein).
    pub g: f32,
    /// Two corners of the box that it fills; `None`: all of space, so that no light comes from infinitely far away.
    pub bounds: Option<(DVec3, DVec3)>,
}

/// How a camera maps the scene to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Lines of sight through one point.
    Perspective {
        /// Full vertical angle of view, radians.
        vertical_fov: f64,
        /// Width / height the camera was made for, if it says.
        aspect: Option<f64>,
    },
    /// Parallel lines of sight.
    Orthographic {
        /// Half the height of what is seen, world units.
        half_height: f64,
        /// Width / height the camera was made for, if it says.
        aspect: Option<f64>,
    },
}

impl SceneDesc {
    /// About how many bytes it holds in memory: meshes, images, instances.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let surfaces = self.meshes.iter().flat_map(|m| &m.geometries).map(|g| &g.surface);
        let meshes: u64 = surfaces.map(|s| if let SurfaceDesc::Triangles(mesh) = s { mesh.bytes() } else { 0 }).sum();
        let images: u64 = self.images.iter().map(|i| i.pixels.bytes()).sum();
        let names: usize = self.instances.iter().map(|i| i.name.len()).sum();
        meshes + images + (size_of_val(self.instances.as_slice()) + names) as u64
    }
}

impl TriangleMesh {
    /// How many bytes it holds in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let uvs: usize = self.uvs.iter().map(|set| size_of_val(set.as_slice())).sum();
        let rest = size_of_val(self.positions.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.normals.as_slice())
            + size_of_val(self.tangents.as_slice())
            + size_of_val(self.colors.as_slice());
        let moved = self.moves_to.as_ref().map_or(0, |to| {
            size_of_val(to.positions.as_slice())
                + size_of_val(to.normals.as_slice())
                + size_of_val(to.tangents.as_slice())
        });
        (uvs + rest + moved) as u64
    }
}

impl Default for MaterialDesc {
    /// glTF's default material.
    fn default() -> Self {
        Self { name: String::new(), model: MaterialModel::Pbr(Box::default()) }
    }
}
