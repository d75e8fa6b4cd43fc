//! EXT_mesh_gpu_instancing: one node whose mesh stands in many places.

use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3};
use gltf::json::accessor::ComponentType::{F32, I8, I16};
use gltf::json::accessor::Type;
use gltf::json::{Index, Node, Root};
use serde::Deserialize;

use super::accessor::{Accessor, Format};
use super::json;
use super::source::Source;
use crate::{ErrorKind, ImportError};

const NAME: &str = "EXT_mesh_gpu_instancing";
const FLOAT: &[Format] = &[(F32, false)];
const UNIT: &[Format] = &[(F32, false), (I8, true), (I16, true)];

#[derive(Deserialize)]
struct Says {
    attributes: BTreeMap<String, usize>,
}

fn extension(node: &Node) -> Option<&serde_json::Value> {
    node.extensions.as_ref()?.others.get(NAME)
}

/// How often a node shows its mesh, by what the file says.
pub(super) fn count(root: &Root, node: &Node) -> u64 {
    let accessor = extension(node).and_then(|e| e.get("attributes")?.as_object()?.values().next()?.as_u64());
    let accessor = accessor.and_then(|i| root.accessors.get(usize::try_from(i).ok()?));
    accessor.map_or(1, |a| a.count.0)
}

/// Where the mesh of a node stands, in the node's space; `None` if the node has no such list. Places of the size 0,
/// by which files hide instances, are left out.
///
/// # Errors
/// If an attribute does not exist or is of a wrong kind, their lengths differ, or there are more than the limit.
pub(super) fn transforms(source: &Source<'_>, node: usize) -> Result<Option<Vec<DAffine3>>, ImportError> {
    let Some(value) = extension(&source.root.nodes[node]) else { return Ok(None) };
    let place = format!("/nodes/{node}/extensions/{NAME}");
    let Says { attributes } = json::typed(source.file, &place, value)?;
    let mut count = None;
    let mut read = |name: &str, kind: Type, formats: &[Format]| {
        let Some(&index) = attributes.get(name) else { return Ok(None) };
        let place = || format!("{place}/attributes/{name}");
        let accessors = source.root.accessors.len();
        if index >= accessors {
            return Err(source.invalid(place(), format!("element {index} does not exist: there are {accessors}")));
        }
        let wanted = source.root.accessors[index].count.0;
        let most = source.limits.instances_of(source.bytes());
        if wanted > most {
            let cause = format!("{wanted} instances are more than the limit of {most}");
            return Err(source.at(place(), ErrorKind::Limit(cause)));
        }
        let accessor = Accessor::new(source, Index::new(index as u32))?;
        if accessor.kind != kind || !formats.contains(&accessor.format) {
            let cause = format!("accessor {index} is {:?} of {:?}; expected {kind:?}", accessor.kind, accessor.format);
            return Err(source.invalid(place(), cause));
        }
        let before = *count.get_or_insert(accessor.count);
        if before != accessor.count {
            let cause = format!("{} elements; another attribute has {before}", accessor.count);
            return Err(source.invalid(place(), cause));
        }
        Ok(Some(accessor))
    };
    let translations = read("TRANSLATION", Type::Vec3, FLOAT)?.map(|a| a.floats::<3>());
    let rotations = read("ROTATION", Type::Vec4, UNIT)?.map(|a| a.floats::<4>());
    let scales = read("SCALE", Type::Vec3, FLOAT)?.map(|a| a.floats::<3>());
    let Some(count) = count else {
        return Err(source.invalid(place + "/attributes", "none of TRANSLATION, ROTATION and SCALE"));
    };
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let mut transforms = Vec::with_capacity(count);
    for i in 0..count {
        let scale = scales.as_ref().map_or(DVec3::ONE, |s| vector(s[i]));
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |r| DQuat::from_array(r[i].map(f64::from)));
        let length = rotation.length();
        if !(length > 1e-6 && length.is_finite()) {
            let cause = format!("quaternion {i} has the length {length}; expected 1");
            return Err(source.invalid(place + "/attributes/ROTATION", cause));
        }
        if scale == DVec3::ZERO {
            continue;
        }
        let translation = translations.as_ref().map_or(DVec3::ZERO, |t| vector(t[i]));
        transforms.push(DAffine3::from_scale_rotation_translation(scale, rotation / length, translation));
    }
    Ok(Some(transforms))
}
