//! Wavefront OBJ with its material libraries (MTL), plain or compressed (`.obj.zst`, `.obj.gz`).
//!
//! Sources: Wavefront, "Advanced Visualizer Manual", appendix B1 (OBJ) and "MTL material format" (both kept at
//! paulbourke.net/dataformats), and the physically based keywords of Clara.io (exocortex.com/blog/extending_wavefront_mtl_to_support_pbr).
//!
//! # What becomes of a file
//! One mesh, with one geometry for each object, group and material that occur together; triangles keep the order of
//! the faces. Its instance is placed by the identity, except for a model that lies more than 16 times its size away
//! from its origin: that one is moved there in f64, so that f32 vertices keep its detail.
//!
//! | in the file | here |
//! |---|---|
//! | `v x y z`, indices from 1 or counted back by negative ones | as they are; an index out of range is an error with its line |
//! | `v x y z r g b` | vertex colours, sRGB as Blender takes them; 0 to 255 if one exceeds 2, else clamped to 1 |
//! | `v x y z w` | w is for rational surfaces and ignored |
//! | `vt u v`, also `vt u` | v counted from the top instead; further dimensions are ignored |
//! | `f` | any number of corners; concave ones are cut by ears in their plane |
//! | a face with an infinite or undefined vertex, or of two corners | left out, warning |
//! | `vn` or `vt` missing for some corners, out of range or undefined | flat, or (0, 0); warning unless just missing |
//! | `s n` without normals | smooth over the group; `s off`, and faces outside of groups: flat |
//! | neither `s` nor `vn` anywhere | smooth across edges of less than 40 degrees, also between vertices that are equal: a scan looks round, a box keeps its edges |
//! | `l`, `p`, curves and free-form surfaces, unknown statements | passed over, warning |
//! | `mtllib` or `usemtl` that lead nowhere | matt grey, warning |
//!
//! # Materials
//! MTL describes the shading of 1990. It is mapped onto [`PbrMaterial`](crate::scene::PbrMaterial) like this:
//!
//! | MTL | here |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour: factors are linear, images sRGB. Black beside a texture means white, as exporters use it |
//! | `Ns` | roughness = (2 / (Ns + 2))^(1/4), which gives GGX the width of that Blinn-Phong lobe (Walter et al. 2007); `map_Ns` scales Ns |
//! | `Ks`, `map_Ks` | reflectance 0.08 Ks at normal incidence, as Blender maps it: 0.5 is plastic. None for `illum` 0 and 1 |
//! | `illum` 3, 5 | mirror: base colour Kd + Ks, metallic with the share of Ks in it, roughness 0 |
//! | `illum` 6, 7 | solid glass of index `Ni`, roughness 0, tinted by `Tf` |
//! | `illum` 4, 9 | thin glass, of transmission 1 - d if there is a `d`; with a `map_d` it is no glass, but what is cut out by it |
//! | `Tf` | only its hue: some exporters write the share of light that passes, some the opposite |
//! | `d`, or 1 - `Tr`; `map_d` | alpha, blended; of the image's alpha channel if it has one, else of its luminance |
//! | `Ke`, `map_Ke` | emitted radiance |
//! | `norm` | tangent-space normals, scaled by `-bm` |
//! | `map_bump`, `bump` | the same if the image looks like normals; else heights, of a hundredth of the texture's width |
//! | `Pr`, `Pm` with maps | roughness, metallic; they win over what Ns and illum say |
//! | `-s`, `-o`, `-clamp`, `-mm`, `-bm`, `-imfchan` | honoured; `-blendu`, `-boost`, `-texres`, `-colorspace` change nothing here; `-t`, `-type`: warning |
//! | `Ka`, `sharpness` | nothing: ambient light is traced |
//! | `Pc`, `Pcr` with maps | a clear coat and its roughness |
//! | `Ps` with map | sheen: white, of roughness 0.5 |
//! | `aniso`, `anisor` | anisotropy and its rotation, 1 being a full turn from the direction of u |
//! | `map_aniso`, `map_anisor`, `map_Tr`, `disp`, `decal`, `refl` | not rendered, warning |
//!
//! All surfaces are seen from both sides, as OBJ knows no other. A texture is looked for beside its library, then
//! beside the model; if its path leads nowhere or out of the model's folder, its bare name is tried.
//!
//! # Why there is an own reader beside tobj
//! tobj parses the materials (see `mtl`). The statements of OBJ itself are read here, since tobj 4.0 drops
//! smoothing groups and the names of missing materials, stops at line continuations, one-component `vt` and incomplete
//! colours, and reports an error without its line; preparing the text for it would be a reader already. The tests
//! hold the two against each other where tobj can read a file.

mod material;
pub(crate) mod mesh;
pub(crate) mod model;
mod mtl;
mod normals;
mod parse;
mod polygon;
mod text;
mod texture;

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DAffine3;

pub(crate) use self::material::neutral;
use self::model::Part;
pub(crate) use self::text::number;
use crate::files::{self, Folder, Input};
use crate::only::Choice;
use crate::open::Then;
use crate::scene::{GeometryDesc, ImageDesc, InstanceDesc, MaterialDesc, MeshDesc, SurfaceDesc};
use crate::timing::{Stage, timed};
use crate::{Decode, ImportError, Imported, Options, Report, SceneDesc};

/// Reads an OBJ file and the material libraries and images it names.
///
/// ```
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("square.obj");
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")?;
/// let imported = firsthit_import::obj::read(&path, &Default::default())?;
/// assert_eq!(imported.report.triangles_all_scenes, 2);
/// assert_eq!(imported.scene.name, "square");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ImportError`] with the line and what is wrong there. Libraries and images that cannot be read are only warnings.
pub fn read(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    read_input(Input::open(path, &options.limits)?, path, options, &mut |_, _| Ok(()))
}

/// As [`read`], of bytes at hand, not compressed. The files they name are looked for beside `path`, which need not
/// exist itself.
///
/// # Errors
/// As for [`read`].
pub fn read_bytes(bytes: Vec<u8>, path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    read_input(Input::of_bytes(&bytes, path), path, options, &mut |_, _| Ok(()))
}

/// As [`read`], of a file that is open; its images are decoded while its meshes are made and `then` is done with them.
pub(crate) fn read_input(
    input: Input<'_>,
    path: &Path,
    options: &Options,
    then: &mut Then<'_>,
) -> Result<Imported, ImportError> {
    let mut report = Report::default();
    report.reads(path);
    let stages = options.stages.as_ref();
    let mut model = parse::parse(input, path, options, &mut report)?;
    let mut wanted = vec![true; model.parts.len()];
    if let Some(mut choice) = Choice::new(&options.only) {
        wanted = model.parts.iter().map(|part| choice.takes(names(part))).collect();
        choice.finish(path)?;
    }
    let parts = model.parts.iter().zip(&wanted).filter(|(_, wanted)| **wanted).map(|(part, _)| part.clone());
    let words = Words {
        parts: parts.collect(),
        libraries: std::mem::take(&mut model.libraries),
        materials: std::mem::take(&mut model.materials),
        has_colors: !model.colors.is_empty(),
    };
    let mut scene = SceneDesc { name: files::stem(path), ..SceneDesc::default() };
    let mut of_materials = Report::default();
    let (materials, done) = rayon::join(
        || Materials::load(&words, path, options, &mut of_materials),
        || {
            let mut meshes = timed(stages, Stage::Meshes, || mesh::build(&mut model, path, "line", &mut report));
            let mut wanted = wanted.iter();
            meshes.parts.retain(|_| wanted.next() == Some(&true));
            report.triangles_all_scenes = meshes.parts.iter().map(|m| m.triangles.len() as u64).sum();
            place(&mut scene, &words.parts, meshes);
            then(&mut scene, &mut report)
        },
    );
    done?;
    let materials = materials?;
    for geometry in scene.meshes.iter_mut().flat_map(|m| &mut m.geometries) {
        let named = geometry.material.and_then(|part| words.parts[part].material);
        geometry.material = named.map_or(materials.none, |m| Some(materials.of_name[m as usize]));
    }
    (scene.materials, scene.images) = (materials.materials, materials.images);
    report.absorb(of_materials);
    Ok(Imported { scene, report })
}

/// Puts the meshes into the scene. Until there are materials, the number of the part stands for each.
fn place(scene: &mut SceneDesc, parts: &[Part], meshes: mesh::Meshes) {
    let geometries = parts.iter().zip(meshes.parts).enumerate().map(|(number, (part, mesh))| {
        let name = match (part.object.as_str(), part.group.as_str()) {
            (object, "") => object.to_owned(),
            ("", group) => group.to_owned(),
            (object, group) => format!("{object}/{group}"),
        };
        GeometryDesc { name, surface: SurfaceDesc::Triangles(mesh), material: Some(number) }
    });
    let name = scene.name.clone();
    scene.meshes.push(MeshDesc { name: name.clone(), geometries: geometries.collect() });
    let transform = DAffine3::from_translation(meshes.origin);
    scene.instances.push(InstanceDesc { name, mesh: 0, transform, moves_to: None });
}

/// What a model says about its materials.
struct Words {
    /// The parts that are wanted.
    parts: Vec<Part>,
    libraries: Vec<(u32, String)>,
    materials: Vec<(u32, String)>,
    has_colors: bool,
}

/// What a part may be asked for by: its object, its groups, both of them.
fn names(part: &Part) -> impl Iterator<Item = &str> {
    [part.object.as_str(), part.group.as_str()].into_iter().chain(part.group.split_ascii_whitespace())
}

/// The materials of a model.
struct Materials {
    materials: Vec<MaterialDesc>,
    images: Vec<ImageDesc>,
    /// For each name that `usemtl` gives, the index of its material.
    of_name: Vec<usize>,
    /// The material of faces before any `usemtl`, if there are such.
    none: Option<usize>,
}

impl Materials {
    fn load(model: &Words, path: &Path, options: &Options, report: &mut Report) -> Result<Self, ImportError> {
        let limits = &options.limits;
        let (mut materials, images, found) = match Folder::of(path, limits) {
            Ok(folder) => {
                let entries = mtl::load(&model.libraries, path, &folder, limits, report);
                let shown: HashSet<&str> = match options.decode {
                    Decode::All => entries.iter().map(|e| e.material.name.as_str()).collect(),
                    Decode::Seen => {
                        let names = model.parts.iter().filter_map(|part| part.material);
                        names.map(|m| mtl::key(&model.materials[m as usize].1)).collect()
                    }
                    Decode::Nothing => HashSet::new(),
                };
                let (materials, images) = material::map(&entries, &folder, options, &shown, report)?;
                let found = entries.into_iter().enumerate().map(|(i, e)| (e.material.name, i)).collect();
                (materials, images, found)
            }
            // Bytes without a file: nothing lies beside them.
            Err(e) => {
                for (line, name) in &model.libraries {
                    report.warn(path, parse::place(*line), format!("material library '{name}': {}", e.kind));
                }
                (Vec::new(), Vec::new(), HashMap::new())
            }
        };
        let has_colors = model.has_colors;
        let mut missing = Vec::new();
        let of_name = model.materials.iter().map(|(line, name)| {
            found.get(mtl::key(name)).copied().unwrap_or_else(|| {
                missing.push((*line, name));
                materials.push(neutral(name, has_colors));
                materials.len() - 1
            })
        });
        let of_name = of_name.collect();
        if let Some((line, name)) = missing.first() {
            let reason = if model.libraries.is_empty() { " (the file names no material library)" } else { "" };
            let more = if missing.len() > 1 { format!(" and {} more", missing.len() - 1) } else { String::new() };
            let message = format!("no material '{name}'{more}{reason}; shown grey");
            report.warn(path, parse::place(*line), message);
        }
        let none = model.parts.iter().any(|p| p.material.is_none()).then(|| {
            materials.push(neutral("", has_colors));
            materials.len() - 1
        });
        Ok(Self { materials, images, of_name, none })
    }
}

#[cfg(test)]
mod tests;
