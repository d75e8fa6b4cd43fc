//! Which mesh stands where: meshes that nodes share stay shared, what must be moved on the CPU is moved.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use gltf::json::Index;
use rayon::prelude::*;

use super::bake;
use super::instancing;
use super::material;
use super::mesh::{self, MeshReader, NormalMapping, Primitive};
use super::node::Nodes;
use super::source::Source;
use crate::bake::deform;
use crate::scene::{GeometryDesc, InstanceDesc, MeshDesc, SceneDesc, SurfaceDesc};
use crate::{ErrorKind, ImportError, Report};

/// How a node shows its mesh.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Placement {
    /// As the mesh is.
    Shared,
    /// With morph weights of its own.
    Morphed,
    /// Moved by a skin; the node's own transform does not count.
    Skinned,
}

/// Reads all meshes and places those of the shown nodes. The scene has its materials by now.
///
/// # Errors
/// If a mesh or a skin is damaged, also where no node shows it.
pub(super) fn place(
    source: &Source<'_>,
    nodes: &Nodes,
    mut reader: MeshReader<'_>,
    scene: &mut SceneDesc,
    report: &mut Report,
) -> Result<(), ImportError> {
    let mut shown_by: BTreeMap<usize, Vec<(usize, Placement)>> = BTreeMap::new();
    for &node in &nodes.drawn {
        if let Some(mesh) = source.root.nodes[node].mesh {
            shown_by.entry(mesh.value()).or_default().push((node, placement(source, node)));
        }
    }
    // By node, since instances are in the order of nodes, not of meshes.
    let mut placed: BTreeMap<usize, (usize, DAffine3)> = BTreeMap::new();
    for (i, json) in source.root.meshes.iter().enumerate() {
        let index = Index::new(i as u32);
        let name = json.name.clone().unwrap_or_else(|| format!("mesh {i}"));
        let shown = shown_by.remove(&i).unwrap_or_default();
        let primitives = reader.read(index, None, report)?;
        mesh::warn_of_missing_uvs(source, i, &primitives, &scene.materials, report);
        let mut plain = Some(primitives);
        let mut shared = None;
        for &(node, _) in shown.iter().filter(|(_, how)| *how == Placement::Shared) {
            shared = shared.or_else(|| add_mesh(scene, &name, plain.take()?));
            placed.extend(shared.map(|mesh| (node, (mesh, nodes.world[node]))));
        }
        for &(node, how) in shown.iter().filter(|(_, how)| *how != Placement::Shared) {
            let weights = source.root.nodes[node].weights.as_deref();
            let mut primitives = match plain.take_if(|_| weights.is_none()) {
                Some(primitives) => primitives,
                // Read once more; its warnings are known by now.
                None => reader.read(index, weights, &mut Report::default())?,
            };
            let transform = match how {
                Placement::Shared | Placement::Morphed => nodes.world[node],
                Placement::Skinned => skinned(source, nodes, node, &mut primitives, report)?,
            };
            placed.extend(add_mesh(scene, &name, primitives).map(|mesh| (node, (mesh, transform))));
        }
    }
    reader.warn_of_undrawn(report);
    // The node of each instance.
    let mut drawn: Vec<usize> = Vec::new();
    let mut weight = 0_u64;
    let most = source.limits.instances_of(source.bytes());
    for &node in &nodes.drawn {
        let Some(&(mesh, transform)) = placed.get(&node) else { continue };
        let name = source.root.nodes[node].name.clone().unwrap_or_else(|| format!("node {node}"));
        let instance = |transform| InstanceDesc { name: name.clone(), mesh, transform, moves_to: None };
        let Some(places) =
            instancing::transforms(source, node)?.filter(|_| placement(source, node) != Placement::Skinned)
        else {
            scene.instances.push(instance(transform));
            drawn.push(node);
            continue;
        };
        // Names are copied: a long one counts as several instances.
        weight = weight.saturating_add(places.len() as u64 * (1 + name.len() as u64 / 256));
        if weight > most {
            let cause = format!("with this node there are more instances than the limit of {most}");
            return Err(source.at(format!("/nodes/{node}"), ErrorKind::Limit(cause)));
        }
        drawn.resize(drawn.len() + places.len(), node);
        scene.instances.extend(places.into_iter().map(|place| instance(transform * place)));
    }
    let warn = |i: usize, _: &str, message| report.warn(source.file, format!("/nodes/{}", drawn[i]), message);
    scene.bake(source.limits, warn).map_err(|kind| source.at("/nodes", kind))?;
    complete(scene);
    Ok(())
}

fn placement(source: &Source<'_>, node: usize) -> Placement {
    let json = &source.root.nodes[node];
    if json.skin.is_some() {
        Placement::Skinned
    } else if json.weights.is_some() {
        Placement::Morphed
    } else {
        Placement::Shared
    }
}

/// Moves a node's mesh by its skin. Where it stands then: the first joint is the origin of its own space.
fn skinned(
    source: &Source<'_>,
    nodes: &Nodes,
    node: usize,
    primitives: &mut Vec<Primitive>,
    report: &mut Report,
) -> Result<DAffine3, ImportError> {
    let json = &source.root.nodes[node];
    let Some(skin) = json.skin else { return Ok(nodes.world[node]) };
    let joints = bake::joint_transforms(source, skin, &nodes.world)?;
    let first = source.root.skins[skin.value()].joints.first();
    let origin = first.map_or(DVec3::ZERO, |j| nodes.world[j.value()].translation);
    for p in primitives.iter_mut() {
        let mut transforms = Vec::with_capacity(p.mesh.positions.len());
        for v in 0..p.mesh.positions.len() {
            let influences: Vec<_> = p.influences.iter().map(|set| set[v]).collect();
            // A primitive without joints hangs at the node.
            let transform =
                if influences.is_empty() { Some(nodes.world[node]) } else { bake::blend(&influences, &joints) };
            transforms.push(transform.ok_or_else(|| {
                let mesh = json.mesh.map_or(0, |m| m.value());
                let place = format!("/meshes/{mesh}/primitives/{}/attributes", p.number);
                let cause =
                    format!("a vertex hangs at joints {influences:?}, but skin {} has {}", skin.value(), joints.len());
                source.invalid(place, cause)
            })?);
        }
        if !deform(&mut p.mesh, |v| transforms[v], origin) {
            report.warn(source.file, format!("/nodes/{node}/skin"), "moves vertices out of all range: left out");
            p.mesh.triangles.clear();
        }
    }
    primitives.retain(|p| !p.mesh.triangles.is_empty());
    Ok(DAffine3::from_translation(origin))
}

/// Adds a mesh to the scene; `None` if there is nothing in it.
fn add_mesh(scene: &mut SceneDesc, name: &str, primitives: Vec<Primitive>) -> Option<usize> {
    if primitives.is_empty() {
        return None;
    }
    let geometry = |p: Primitive| GeometryDesc {
        name: format!("primitive {}", p.number),
        surface: SurfaceDesc::Triangles(p.mesh),
        material: p.material,
    };
    let geometries = primitives.into_iter().map(geometry).collect();
    scene.meshes.push(MeshDesc { name: name.to_owned(), geometries });
    Some(scene.meshes.len() - 1)
}

/// Adds the tangents that normal textures need and the file does not give.
fn complete(scene: &mut SceneDesc) {
    let mappings: Vec<Option<NormalMapping>> = scene.materials.iter().map(material::normal_mapping).collect();
    let geometries = scene.meshes.par_iter_mut().flat_map(|m| m.geometries.par_iter_mut());
    geometries.for_each(|geometry| {
        if let (SurfaceDesc::Triangles(mesh), Some(material)) = (&mut geometry.surface, geometry.material) {
            mesh::complete(mesh, mappings[material]);
        }
    });
}
