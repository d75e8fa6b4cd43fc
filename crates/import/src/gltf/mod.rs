//! glTF 2.0: `.gltf` with its files or data URIs, and `.glb`.
//!
//! The JSON is parsed into the `gltf` crate's typed model. Everything behind it is read here: the container, buffers,
//! accessors, hierarchy and textures are checked before they are used, so that a damaged file is an error that names
//! the JSON pointer, the value found and what was expected.
//!
//! - The file's default scene is shown, else its first, else all of its root nodes.
//! - Transforms are multiplied out in f64. Meshes that several nodes share stay shared.
//! - Animations are counted but not played: skins and morph targets are shown as the nodes and weights of the file
//!   have them. A mesh whose node has a transform without an inverse is moved in f64 once and for all where a surface
//!   is left of it.
//! - Missing normals are flat, missing tangents are computed by MikkTSpace where a normal texture needs them.
//! - What is done with each extension: [`EXTENSIONS`].
//!
//! ```no_run
//! let read = firsthit_import::gltf::read("model.glb".as_ref(), &Default::default())?;
//! println!("{} instances, {} warnings", read.scene.instances.len(), read.report.warnings.len());
//! # Ok::<(), firsthit_import::ImportError>(())
//! ```

mod accessor;
mod bake;
mod camera_light;
mod extensions;
mod glb;
mod json;
mod material;
mod mesh;
mod node;
mod source;
mod tangent;
mod texture;
mod uri;

use std::collections::BTreeMap;
use std::path::Path;

use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root};
use glam::{DAffine3, DVec3};

use accessor::Layout;
use mesh::{MeshReader, NormalMapping, Primitive};
use node::Nodes;
use source::Source;
use texture::Textures;

use crate::scene::{GeometryDesc, InstanceDesc, MeshDesc, SceneDesc, SurfaceDesc};
use crate::{ImportError, Imported, Options, Report, files};

pub use extensions::{EXTENSIONS, Extension, find as find_extension};

/// Reads a glTF 2.0 file: `.gltf` or `.glb`, told apart by its first bytes.
///
/// The options' upward axis is not looked at here: glTF is +Y up.
///
/// # Errors
/// If the file or one of its buffers cannot be read, breaks the format, exceeds the limits, or requires an extension
/// that is not supported. Images that cannot be read are warnings.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let bytes = files::read(path, &options.limits)?;
    let (text, bin) = if glb::is_glb(&bytes) {
        match glb::version(&bytes) {
            Some(1) => return Err(json::too_old(path, "1.0 (binary)")),
            Some(2) | None => {}
            Some(other) => {
                let cause = format!("version {other} of the binary container is not supported, only 2");
                return Err(ImportError::unsupported(path, "", cause));
            }
        }
        let glb = glb::split(&bytes).map_err(|cause| ImportError::invalid(path, "", cause))?;
        (glb.json, glb.bin)
    } else {
        (&bytes[..], None)
    };
    let json::Document { root, value, animations } = json::parse(path, text)?;
    let mut report = Report { animations, ..Report::default() };
    extensions::check(path, &root, &mut report)?;
    json::check_references(path, &root)?;
    let source = Source::new(path, &root, bin, &options.limits)?;
    check_accessors(&source)?;
    let nodes = Nodes::new(&source, &value, &mut report)?;
    report.triangles_all_scenes = triangles_all_scenes(&root);

    let name = root.scene.and_then(|s| root.scenes[s.value()].name.clone());
    let name = name.or_else(|| path.file_stem().map(|s| s.to_string_lossy().into_owned())).unwrap_or_default();
    let mut scene = SceneDesc { name, ..SceneDesc::default() };
    let mut textures = Textures::new(&source);
    scene.materials = material::read(&source, &mut textures, &mut report)?;
    place_meshes(&source, &nodes, &mut scene, &mut report)?;
    for &node in &nodes.shown {
        let world = &nodes.world[node];
        scene.cameras.extend(camera_light::camera(&source, node, world, &mut report)?);
        scene.lights.extend(camera_light::light(&source, node, world, &mut report)?);
    }
    scene.images = textures.decode(&mut report);
    Ok(Imported { scene, report })
}

/// Checks that all buffer views and accessors lie inside their buffers, also those that nothing here reads.
fn check_accessors(source: &Source<'_>) -> Result<(), ImportError> {
    for i in 0..source.root.buffer_views.len() as u32 {
        source.check_view(Index::new(i))?;
    }
    for (i, accessor) in source.root.accessors.iter().enumerate() {
        // A type of later versions is no fault while nothing uses it.
        if matches!(accessor.type_, Checked::Valid(_)) {
            Layout::new(source, Index::new(i as u32))?;
        }
    }
    Ok(())
}

fn triangles_all_scenes(root: &Root) -> u64 {
    let of_mesh = |m: &::gltf::json::Mesh| {
        m.primitives.iter().fold(0, |sum: u64, p| sum.saturating_add(mesh::triangle_count(root, p)))
    };
    let counts: Vec<u64> = root.meshes.iter().map(of_mesh).collect();
    root.nodes.iter().filter_map(|n| n.mesh).fold(0, |sum, m| sum.saturating_add(counts[m.value()]))
}

/// How a node shows its mesh.
enum Placement {
    /// As the mesh is.
    Instance,
    /// With morph weights of its own.
    Morphed,
    /// Moved by a skin; the node's own transform does not count.
    Skinned,
    /// By a transform without an inverse.
    Baked,
}

/// Reads all meshes and places those of the shown nodes.
fn place_meshes(
    source: &Source<'_>,
    nodes: &Nodes,
    scene: &mut SceneDesc,
    report: &mut Report,
) -> Result<(), ImportError> {
    let mappings: Vec<Option<NormalMapping>> = scene.materials.iter().map(material::normal_mapping).collect();
    let mut shown_by: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &node in &nodes.shown {
        if let Some(mesh) = source.root.nodes[node].mesh {
            shown_by.entry(mesh.value()).or_default().push(node);
        }
    }
    let mut reader = MeshReader::new(source);
    let mut placed: BTreeMap<usize, (usize, DAffine3)> = BTreeMap::new();
    for (i, json) in source.root.meshes.iter().enumerate() {
        let index = Index::new(i as u32);
        // Also where no node shows it: a damaged file is told of.
        let mut as_it_is = Some(reader.read(index, None, report)?);
        let mut shared = None;
        let name = json.name.clone().unwrap_or_else(|| format!("mesh {i}"));
        let shown = shown_by.remove(&i).unwrap_or_default();
        // Instances come last, since the mesh itself goes to them.
        let (instances, special): (Vec<_>, Vec<_>) = shown
            .into_iter()
            .map(|n| (n, placement(source, nodes, n)))
            .partition(|(_, p)| matches!(p, Placement::Instance));
        for (node, how) in special {
            let weights = source.root.nodes[node].weights.as_deref();
            let mut primitives = reader.read(index, weights, &mut Report::default())?;
            let place = match how {
                Placement::Instance | Placement::Morphed => nodes.world[node],
                Placement::Skinned => skinned(source, nodes, node, &mut primitives, report)?,
                Placement::Baked => baked(source, nodes, node, &mut primitives, report),
            };
            if let Some(mesh) = add_mesh(scene, &name, primitives, &mappings) {
                placed.insert(node, (mesh, place));
            }
        }
        for (node, _) in instances {
            if let Some(primitives) = as_it_is.take() {
                shared = add_mesh(scene, &name, primitives, &mappings);
            }
            if let Some(mesh) = shared {
                placed.insert(node, (mesh, nodes.world[node]));
            }
        }
    }
    reader.finish(report);
    for &node in &nodes.shown {
        if let Some(&(mesh, transform)) = placed.get(&node) {
            let name = source.root.nodes[node].name.clone().unwrap_or_else(|| format!("node {node}"));
            scene.instances.push(InstanceDesc { name, mesh, transform });
        }
    }
    Ok(())
}

fn placement(source: &Source<'_>, nodes: &Nodes, node: usize) -> Placement {
    let json = &source.root.nodes[node];
    if json.skin.is_some() {
        Placement::Skinned
    } else if bake::is_singular(&nodes.world[node]) {
        Placement::Baked
    } else if json.weights.is_some() {
        Placement::Morphed
    } else {
        Placement::Instance
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
        if !bake::deform(&mut p.mesh, |v| transforms[v], origin) {
            report.warn(source.file, format!("/nodes/{node}/skin"), "moves vertices out of all range: left out");
            p.mesh.triangles.clear();
        }
    }
    primitives.retain(|p| !p.mesh.triangles.is_empty());
    Ok(DAffine3::from_translation(origin))
}

/// Moves a mesh by its node's transform; drops it, with a warning, where no surface is left.
fn baked(
    source: &Source<'_>,
    nodes: &Nodes,
    node: usize,
    primitives: &mut Vec<Primitive>,
    report: &mut Report,
) -> DAffine3 {
    let world = nodes.world[node];
    let origin = if world.translation.is_finite() { world.translation } else { DVec3::ZERO };
    let before = primitives.len();
    primitives.retain_mut(|p| bake::deform(&mut p.mesh, |_| world, origin) && !bake::is_degenerate(&p.mesh));
    if primitives.len() < before {
        let message = "its transform leaves no surface of its mesh: not drawn";
        report.warn(source.file, format!("/nodes/{node}"), message);
    }
    DAffine3::from_translation(origin)
}

/// Adds a mesh to the scene; `None` if there is nothing in it.
fn add_mesh(
    scene: &mut SceneDesc,
    name: &str,
    primitives: Vec<Primitive>,
    mappings: &[Option<NormalMapping>],
) -> Option<usize> {
    if primitives.is_empty() {
        return None;
    }
    let geometry = |mut p: Primitive| {
        mesh::complete(&mut p.mesh, p.material.and_then(|m| mappings[m]));
        GeometryDesc {
            name: format!("primitive {}", p.number),
            surface: SurfaceDesc::Triangles(p.mesh),
            material: p.material,
        }
    };
    let geometries = primitives.into_iter().map(geometry).collect();
    scene.meshes.push(MeshDesc { name: name.to_owned(), geometries });
    Some(scene.meshes.len() - 1)
}
