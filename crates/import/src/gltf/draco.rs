//! KHR_draco_mesh_compression: primitives whose attributes and indices are one compressed stream.

use std::collections::BTreeMap;
use std::fmt;
use std::panic::catch_unwind;

use draco_gltf::{
    ComponentType as Component, DecodeLimits, DracoPrimitiveContract, DracoPrimitiveExtension, JsonValue,
    PackedGeometry,
};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use rayon::prelude::*;

use super::accessor::Accessor;
use super::source::Source;
use crate::{ErrorKind, ImportError};

const NAME: &str = "KHR_draco_mesh_compression";

/// The decoded primitives of a file, by the numbers of mesh and primitive.
pub(crate) struct DracoPrimitives(BTreeMap<(usize, usize), DracoPrimitive>);

/// A decoded primitive: a list of triangles with some of its attributes, the others are stored plainly.
pub(super) struct DracoPrimitive(PackedGeometry);

/// A stream, and what the file says of it.
struct Stream<'a> {
    place: String,
    extension: DracoPrimitiveExtension,
    contract: DracoPrimitiveContract,
    data: &'a [u8],
    /// Most bytes that it may become.
    most: u64,
}

impl fmt::Debug for DracoPrimitives {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.0.keys()).finish()
    }
}

impl DracoPrimitives {
    /// Decodes all compressed primitives of a file.
    ///
    /// # Errors
    /// If one is damaged, does not give what its accessors say, or all together ask for more than the limits allow.
    pub(super) fn new(source: &Source<'_>) -> Result<Self, ImportError> {
        let mut streams = Vec::new();
        let (mut read, mut made) = (0_u64, 0_u64);
        for (i, mesh) in source.root.meshes.iter().enumerate() {
            for (k, primitive) in mesh.primitives.iter().enumerate() {
                let place = format!("/meshes/{i}/primitives/{k}/extensions/{NAME}");
                let Some(stream) = Stream::new(source, primitive, place)? else { continue };
                read = read.saturating_add(stream.data.len() as u64);
                made = made.saturating_add(stream.most);
                streams.push(((i, k), stream));
            }
        }
        // Streams may share their bytes: no more are read than the file has.
        let most = source.limits.decompressed(read.min(source.bytes()));
        if made > most {
            let cause = format!("compressed primitives become up to {made} bytes, more than the limit of {most}");
            return Err(source.at("/meshes", ErrorKind::Limit(cause)));
        }
        let decoded: Vec<_> = streams.par_iter().map(|(_, stream)| stream.decode()).collect();
        let placed = |((key, stream), decoded): (&(_, Stream<'_>), Result<_, ErrorKind>)| match decoded {
            Ok(geometry) => Ok((*key, DracoPrimitive(geometry))),
            Err(kind) => Err(source.at(stream.place.as_str(), kind)),
        };
        Ok(Self(streams.iter().zip(decoded).map(placed).collect::<Result<_, _>>()?))
    }

    pub(super) fn get(&self, mesh: usize, primitive: usize) -> Option<&DracoPrimitive> {
        self.0.get(&(mesh, primitive))
    }
}

impl<'a> Stream<'a> {
    /// The stream of a primitive, if it has one.
    fn new(source: &'a Source<'_>, primitive: &Primitive, place: String) -> Result<Option<Self>, ImportError> {
        let Some(value) = primitive.extensions.as_ref().and_then(|e| e.others.get(NAME)) else { return Ok(None) };
        let extension = JsonValue::parse(value.to_string().as_bytes()).map_err(draco_gltf::Error::Json);
        let extension = extension.and_then(|value| DracoPrimitiveExtension::from_json(&value));
        let extension = extension.map_err(|e| source.invalid(place.as_str(), e.to_string()))?;
        let (view, views) = (extension.buffer_view(), source.root.buffer_views.len());
        if view >= views {
            let cause = format!("element {view} does not exist: there are {views}");
            return Err(source.invalid(place + "/bufferView", cause));
        }
        let (Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip)), Some(indices)) =
            (primitive.mode, primitive.indices)
        else {
            return Err(source.invalid(place, "only triangles and strips of triangles with indices can be compressed"));
        };
        let accessor = |index: Index<json::Accessor>| &source.root.accessors[index.value()];
        let strip = mode == Mode::TriangleStrip;
        // A strip comes out as separate triangles.
        let corners = accessor(indices).count.0.saturating_mul(if strip { 3 } else { 1 });
        // Each corner of a triangle may become a vertex of its own, whatever the accessors say.
        let (mut vertices, mut bytes_each) = (corners, 0);
        let mut contract = DracoPrimitiveContract::new();
        for (semantic, &index) in &primitive.attributes {
            let (name, json) = (semantic_name(semantic), accessor(index));
            if extension.unique_id(&name).is_some() {
                vertices = vertices.max(json.count.0);
                // Four components of four bytes.
                bytes_each += 16;
            }
            contract = contract.with_attribute(name, json.count.0, json.normalized);
        }
        if !strip {
            contract = contract.with_indices(corners);
        }
        if vertices > source.limits.elements {
            let cause = format!("{vertices} elements are more than the limit of {}", source.limits.elements);
            return Err(source.at(place, ErrorKind::Limit(cause)));
        }
        let bytes = vertices.saturating_mul(bytes_each);
        let limits = DecodeLimits::default()
            .with_max_points(vertices)
            .with_max_faces(corners)
            .with_max_decoded_bytes(bytes.min(source.limits.file_bytes));
        let contract = contract.with_limits(limits);
        let most = bytes.saturating_add(corners.saturating_mul(4));
        let data = source.view(Index::new(view as u32))?;
        Ok(Some(Self { place, extension, contract, data, most }))
    }

    fn decode(&self) -> Result<PackedGeometry, ErrorKind> {
        // The decoder checks what it reads; but it is young, and nothing in a file may end the program.
        match catch_unwind(|| self.extension.decode(self.data, &self.contract)) {
            Ok(Ok(geometry)) => Ok(geometry),
            Ok(Err(e)) if e.is_decode_limit_exceeded() => Err(ErrorKind::Limit(e.to_string())),
            Ok(Err(e)) => Err(ErrorKind::Invalid(e.to_string())),
            Err(_) => Err(ErrorKind::Invalid("the decoder of Draco streams failed".into())),
        }
    }
}

impl DracoPrimitive {
    /// The data of an attribute, by its name in the file; `None` if it is stored plainly.
    pub(super) fn attribute(&self, name: &str) -> Option<Accessor<'_>> {
        let attribute = self.0.attributes().iter().find(|a| a.semantic() == name)?;
        let kind = match attribute.components() {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            _ => Type::Vec4,
        };
        let component = component(attribute.component_type())?;
        let normalized = attribute.normalized() && component != ComponentType::F32;
        Some(Accessor::packed(attribute.count(), kind, (component, normalized), attribute.bytes()))
    }

    /// The corners of its triangles.
    pub(super) fn indices(&self) -> Option<Accessor<'_>> {
        let indices = self.0.indices()?;
        let component = component(indices.component_type())?;
        Some(Accessor::packed(indices.count(), Type::Scalar, (component, false), indices.bytes()))
    }
}

fn semantic_name(semantic: &Checked<json::mesh::Semantic>) -> String {
    match semantic {
        Checked::Valid(semantic) => semantic.to_string(),
        Checked::Invalid => String::new(),
    }
}

fn component(component: Component) -> Option<ComponentType> {
    Some(match component {
        Component::I8 => ComponentType::I8,
        Component::U8 => ComponentType::U8,
        Component::I16 => ComponentType::I16,
        Component::U16 => ComponentType::U16,
        Component::U32 => ComponentType::U32,
        Component::F32 => ComponentType::F32,
        _ => return None,
    })
}
