//! glTF 2.0: `.gltf` with its files or data URIs, and `.glb`.
//!
//! The JSON is parsed into the `gltf` crate's typed model. Everything behind it is read here: the container, buffers,
//! accessors, hierarchy and textures are checked before they are used, so that a damaged file is an error that names
//! the JSON pointer, the value found and what was expected.
//!
//! - The file's default scene is shown, else its first, else all of its root nodes, unless another one is asked for.
//! - Transforms are multiplied out in f64. Meshes that several nodes share stay shared.
//! - Skins and morph targets are shown as the nodes and weights have them: those of the file, or those of its
//!   animations at the time that is asked for. What animations can change: [`ANIMATED_PROPERTIES`]. A mesh whose node has a transform without an inverse is moved in f64 once and for all where a surface
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
mod animation;
mod attribute;
mod bake;
mod camera_light;
mod draco;
mod environment;
mod extensions;
mod glb;
mod instance;
mod instancing;
mod json;
mod layers;
mod material;
mod mesh;
mod meshopt;
mod node;
mod source;
mod stroke;
mod tangent;
#[cfg(test)]
mod tests;
mod texture;
mod typed;
mod uri;
mod variant;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root};

use accessor::Layout;
use mesh::MeshReader;
use node::Nodes;
use source::Source;
use texture::{Numbered, Textures};

use crate::cache::{Kept, Key};
use crate::open::Then;
use crate::scene::{ImageDesc, SceneDesc};
use crate::timing::{Stage, timed};
use crate::{Decode, ImportError, Imported, Options, Report, files};

pub use animation::{AnimatedProperty, Kind as AnimatedKind, PROPERTIES as ANIMATED_PROPERTIES};
pub(crate) use draco::DracoPrimitives;
pub use extensions::{EXTENSIONS, Extension, find as find_extension};
pub(crate) use json::Document;
pub use stroke::Strokes;

/// Reads a glTF 2.0 file: `.gltf` or `.glb`, told apart by its first bytes.
///
/// The options' upward axis is not looked at here: glTF is +Y up.
///
/// # Errors
/// If the file or one of its buffers cannot be read, breaks the format, exceeds the limits, or requires an extension
/// that is not supported. Images that cannot be read are warnings.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    read_bytes(&files::read(path, &options.limits)?, path, options, &mut |_, _| Ok(()))
}

/// As [`read`], of the bytes of the file; images are decoded while its meshes are read and `then` is done with them.
pub(crate) fn read_bytes(
    bytes: &[u8],
    path: &Path,
    options: &Options,
    then: &mut Then<'_>,
) -> Result<Imported, ImportError> {
    let stages = options.stages.as_ref();
    let (text, bin) = if glb::is_glb(bytes) {
        match glb::version(bytes) {
            Some(1) => return Err(json::too_old(path, "1.0 (binary)")),
            Some(2) | None => {}
            Some(other) => {
                let cause = format!("version {other} of the binary container is not supported, only 2");
                return Err(ImportError::unsupported(path, "byte 4", cause));
            }
        }
        let glb = glb::split(bytes).map_err(|(at, cause)| ImportError::invalid(path, format!("byte {at}"), cause))?;
        (glb.json, glb.bin)
    } else {
        if let (true, Some(found)) = (files::format_extension(path) == "glb", glb::wrong_magic(bytes)) {
            return Err(ImportError::invalid(path, "byte 0", format!("begins with '{found}', expected 'glTF'")));
        }
        (bytes, None)
    };
    let parse = || timed(stages, Stage::Parse, || json::parse(path, text, &options.limits));
    let document = match &options.images {
        Some(cache) => cache.document(path, parse)?,
        None => Arc::new(parse()?),
    };
    let Document { root, value, animations } = &*document;
    let mut report =
        Report { animations: animation::list(animations, root), scenes: scene_names(root), ..Report::default() };
    report.reads(path);
    extensions::check(path, root, &mut report)?;
    json::check_references(path, root)?;
    let source = Source::new(path, root, bin, options, &mut report)?;
    report.variants = variant::names(root);
    let variant = variant::choose(&source, options.variant.as_deref(), &report)?;
    check_accessors(&source)?;
    let shown = match &options.scene {
        Some(wanted) => Some(json::by_name(path, "scene", wanted, report.scenes.clone().iter().map(String::as_str))?),
        None => root.scene.map(|s| s.value()).or((!root.scenes.is_empty()).then_some(0)),
    };
    let posed = match &options.play {
        Some(play) => {
            let mut value = value.clone();
            Some((animation::pose(&source, animations, play, &mut value, &mut report)?, value))
        }
        None => None,
    };
    let (source, value) = match &posed {
        Some((root, value)) => (source.with_root(root), value),
        None => (source, value),
    };
    let nodes = Nodes::new(&source, value, shown, &options.only, &mut report)?;
    report.triangles_all_scenes = triangles_all_scenes(root);

    let chosen = shown.filter(|_| root.scene.is_some() || options.scene.is_some());
    let name = chosen.and_then(|s| root.scenes[s].name.clone());
    let name = name.or_else(|| path.file_stem().map(|s| s.to_string_lossy().into_owned())).unwrap_or_default();
    let mut scene = SceneDesc { name, ..SceneDesc::default() };
    let mut textures = Textures::new(&source);
    let seen = seen(&source, &nodes, variant, options.decode);
    let occlusion = options.decode == Decode::All;
    scene.materials = material::read(&source, &mut textures, &mut report, occlusion, &seen)?;
    let mut of_images = Report::default();
    let encoded = textures.encoded(&mut of_images)?;
    let shapes = |scene: &mut SceneDesc, report: &mut Report| {
        timed(stages, Stage::Meshes, || {
            let reader = MeshReader::new(&source, value, variant, options.strokes)?;
            instance::place(&source, &nodes, reader, scene, report)
        })?;
        for &node in &nodes.shown {
            let world = &nodes.world[node];
            scene.cameras.extend(camera_light::camera(&source, node, world, report)?);
            scene.lights.extend(camera_light::light(&source, node, world, report)?);
        }
        Ok(())
    };
    if environment::is_there(&source, shown) {
        // It is made of images, and turned with all the rest.
        shapes(&mut scene, &mut report)?;
        scene.images = images(&source, &textures, &encoded, options, &mut of_images);
        report.absorb(of_images);
        if let Some((around, image)) = environment::read(&source, shown, &scene.images, &mut report)? {
            scene.environment = Some(around);
            scene.images.push(image);
        }
        then(&mut scene, &mut report)?;
        return Ok(Imported { scene, report });
    }
    let (decoded, done) = rayon::join(
        || images(&source, &textures, &encoded, options, &mut of_images),
        || shapes(&mut scene, &mut report).and_then(|()| then(&mut scene, &mut report)),
    );
    done?;
    scene.images = decoded;
    report.absorb(of_images);
    Ok(Imported { scene, report })
}

/// The materials whose images are decoded.
fn seen(source: &Source<'_>, nodes: &Nodes, variant: Option<u32>, decode: Decode) -> Vec<bool> {
    let mut seen = vec![decode == Decode::All; source.root.materials.len()];
    if decode == Decode::Seen {
        let meshes = nodes.drawn.iter().filter_map(|&node| source.root.nodes[node].mesh);
        let meshes: BTreeSet<usize> = meshes.map(|mesh| mesh.value()).collect();
        for primitive in meshes.iter().flat_map(|&mesh| &source.root.meshes[mesh].primitives) {
            // What is wrong with it is said when the mesh is read.
            if let Ok(Some(material)) = variant::material(source, primitive, variant, "") {
                seen[material] = true;
            }
        }
    }
    seen
}

/// The decoded images: those that were kept, if there are any.
fn images(
    source: &Source<'_>,
    textures: &Textures<'_>,
    encoded: &[Numbered<'_>],
    options: &Options,
    report: &mut Report,
) -> Vec<ImageDesc> {
    let Some(cache) = options.images.as_ref().filter(|_| options.decode != Decode::Nothing) else {
        return textures.decode(encoded, report);
    };
    let key = Key { limits: *source.limits, images: textures.decoded() };
    let kept = cache.get(source.file, &key).unwrap_or_else(|| {
        let mut said = Report::default();
        let kept = Kept { key, images: textures.decode(encoded, &mut said), report: said };
        cache.keep(source.file, kept.clone());
        kept
    });
    report.absorb(kept.report);
    kept.images
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

fn scene_names(root: &Root) -> Vec<String> {
    let name = |(i, s): (usize, &::gltf::json::Scene)| s.name.clone().unwrap_or_else(|| format!("scene {i}"));
    root.scenes.iter().enumerate().map(name).collect()
}

fn triangles_all_scenes(root: &Root) -> u64 {
    let of_mesh = |m: &::gltf::json::Mesh| {
        m.primitives.iter().fold(0, |sum: u64, p| sum.saturating_add(mesh::triangle_count(root, p)))
    };
    let counts: Vec<u64> = root.meshes.iter().map(of_mesh).collect();
    let of_node =
        |n: &::gltf::json::Node| n.mesh.map_or(0, |m| counts[m.value()].saturating_mul(instancing::count(root, n)));
    root.nodes.iter().map(of_node).fold(0, u64::saturating_add)
}
