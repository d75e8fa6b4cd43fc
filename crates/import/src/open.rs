//! One door for all formats.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use crate::files::Input;
use crate::scene::SurfaceDesc;
use crate::timing::{Stage, timed};
use crate::toml::Inclusion;
use crate::{
    AnimationChoice, ErrorKind, ImageCache, ImportError, Limits, Play, Report, SceneDesc, Stages, files, gltf, obj,
    ply, stl, toml,
};

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +X
    PosX,
    /// -X
    NegX,
    /// +Y: what glTF says, and most OBJ files mean.
    #[default]
    PosY,
    /// -Y
    NegY,
    /// +Z: CAD and scans.
    PosZ,
    /// -Z
    NegZ,
}

impl UpAxis {
    /// The rotation that takes this axis to +Y. What faced +Z still does, or else faces where +Y or -Y pointed.
    #[must_use]
    pub fn to_y(self) -> DAffine3 {
        // Columns: where x, y and z go.
        let [x, y, z] = match self {
            Self::PosX => [DVec3::Y, DVec3::NEG_X, DVec3::Z],
            Self::NegX => [DVec3::NEG_Y, DVec3::X, DVec3::Z],
            Self::PosY => [DVec3::X, DVec3::Y, DVec3::Z],
            Self::NegY => [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z],
            Self::PosZ => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
            Self::NegZ => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        };
        DAffine3::from_mat3(DMat3::from_cols(x, y, z))
    }
}

/// A word that names no axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected +X, -X, +Y, -Y, +Z or -Z")]
pub struct NotAnAxis;

impl FromStr for UpAxis {
    type Err = NotAnAxis;

    /// Reads `+X`, also written `X`, `x` or `+x`; likewise the others.
    fn from_str(name: &str) -> Result<Self, NotAnAxis> {
        Ok(match name.to_ascii_uppercase().as_str() {
            "+X" | "X" => Self::PosX,
            "-X" => Self::NegX,
            "+Y" | "Y" => Self::PosY,
            "-Y" => Self::NegY,
            "+Z" | "Z" => Self::PosZ,
            "-Z" => Self::NegZ,
            _ => return Err(NotAnAxis),
        })
    }
}

/// What a reader should do with a file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The file's upward axis; the scene is turned so that it becomes +Y. `None`: as the format says (+Y).
    pub up: Option<UpAxis>,
    /// The variant of materials to show, by name or number (glTF's KHR_materials_variants). `None`: the file's default.
    pub variant: Option<String>,
    /// The scene of the file to show, by name or number (glTF's `scenes`). `None`: the file's default.
    pub scene: Option<String>,
    /// The moment of the file's animations to show. `None`: everything is where the file has it, and nothing is played.
    pub play: Option<Play>,
    /// How thick points and lines are drawn (glTF's; OBJ has none that are read).
    pub strokes: gltf::Strokes,
    /// Keeps the bytes of files but for OBJ, and of glTF files the JSON and the decoded images, for when they are read
    /// again.
    pub images: Option<ImageCache>,
    /// Which images are decoded.
    pub decode: Decode,
    /// Only the parts of these names, in which `*` stands for any characters: objects and groups (OBJ), solids (STL),
    /// nodes with all below them and meshes (glTF), objects (scene files). Empty: everything. Materials, cameras, lights
    /// and places stay as they are; indices count what is kept.
    pub only: Vec<String>,
    /// Measures where the time goes.
    pub stages: Option<Stages>,
    /// Limits against hostile files.
    pub limits: Limits,
}

/// Which images of a file are decoded; a white pixel stands for each of the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decode {
    /// All that materials name.
    #[default]
    All,
    /// Those that rays can see: not those of occlusion textures (a ray tracer has no use for them), nor of materials that
    /// nothing which is shown has.
    Seen,
    /// None: for questions about shapes.
    Nothing,
}

/// A file's content.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The scene.
    pub scene: SceneDesc,
    /// What could be read only in part.
    pub report: Report,
}

/// Reads a model or scene file, or the only one in a folder.
///
/// The format is told by the extension; a `.json` file with an `asset` is glTF, any other a scene file. A folder stands
/// for its `scene.toml` or `scene.json`, or else for the only model in it.
///
/// ```
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("ball.toml");
/// std::fs::write(&path, r#"
///     [[objects]]
///     shape = "sphere"
///     center = [0, 1, 0]
///     radius = 1
/// "#)?;
/// let imported = firsthit_import::open(&path, &Default::default())?;
/// assert_eq!(imported.scene.instances.len(), 1);
/// assert!(imported.report.warnings.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ImportError`] says which file, where in it and why.
pub fn open(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    open_with(path, options, |_| ()).map(|(imported, ())| imported)
}

/// As [`open`], with something to do as soon as all shapes are there and while images are still being decoded, such as
/// building trees. The scene that it gets is whole but for its images and, of OBJ, its materials.
///
/// # Errors
/// As for [`open`].
pub fn open_with<T: Send>(
    path: impl AsRef<Path>,
    options: &Options,
    meanwhile: impl FnOnce(&SceneDesc) -> T + Send,
) -> Result<(Imported, T), ImportError> {
    let path = path.as_ref();
    let file = if path.is_dir() { only_model(path)? } else { path.to_owned() };
    let format = Format::of(&file)?;
    let (mut meanwhile, mut result) = (Some(meanwhile), None);
    let mut then = |scene: &mut SceneDesc, report: &mut Report| {
        if let Some(play) = options.play.as_ref().filter(|play| play.shutter > 0.0) {
            let play = Play { time: play.time + play.shutter, shutter: 0.0, ..play.clone() };
            let options = Options { play: Some(play), decode: Decode::Nothing, ..options.clone() };
            let later = read_as(format, &file, &options, &Inclusion::default(), &mut |_, _| Ok(()))?;
            if let Some(message) = scene.move_to(later.scene) {
                report.warn(&file, "", message);
            }
        }
        if let Some(up) = options.up {
            scene.transform(up.to_y());
        }
        finish(scene, report, &file, options)?;
        result = meanwhile.take().map(|work| work(scene));
        Ok(())
    };
    let imported = read_as(format, &file, options, &Inclusion::default(), &mut then)?;
    check_memory(&imported.scene, &imported.report, &file, options)?;
    let done = result.or_else(|| meanwhile.take().map(|work| work(&imported.scene)));
    match done {
        Some(done) => Ok((imported, done)),
        None => Err(ImportError::unsupported(path, "", "nothing was read")),
    }
}

/// What is done with a scene as soon as its shapes are there, perhaps before its images are.
pub(crate) type Then<'a> = dyn FnMut(&mut SceneDesc, &mut Report) -> Result<(), ImportError> + Send + 'a;

/// The last checks of a whole scene: for transforms, which may have been sound until they were multiplied, for memory,
/// and for something to see.
pub(crate) fn finish(
    scene: &mut SceneDesc,
    report: &mut Report,
    file: &Path,
    options: &Options,
) -> Result<(), ImportError> {
    let warn = |_, name: &str, message| report.warn(file, format!("instance '{name}'"), message);
    scene.bake(&options.limits, warn).map_err(|kind| ImportError::new(file, "", kind))?;
    check_memory(scene, report, file, options)?;
    let mut surfaces = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries).map(|g| &g.surface);
    if !surfaces.any(|s| !matches!(s, SurfaceDesc::Triangles(mesh) if mesh.triangles.is_empty())) {
        report.warn(file, "", "has no surface: there is nothing to see");
    }
    Ok(())
}

/// Checks what a scene holds against the files that it was made of.
fn check_memory(scene: &SceneDesc, report: &Report, file: &Path, options: &Options) -> Result<(), ImportError> {
    // As far as they are files; bytes at hand may become what any file may.
    let read = report.files.iter().filter_map(|file| fs::metadata(file).ok()).map(|meta| meta.len()).sum();
    let memory = options.limits.check_memory("its meshes and images", scene.bytes(), read);
    memory.map_err(|kind| ImportError::new(file, "", kind))
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Gltf,
    Ply,
    Stl,
    Toml,
    /// glTF or a scene file.
    Json,
}

const FORMATS: &str =
    "firsthit reads .obj, .ply, .stl, .gltf, .glb, scene files (.toml, .json), and all of these with .zst or .gz";

impl Format {
    /// Tells a file's format by its extension, where that is not enough by its first bytes.
    pub(crate) fn of(file: &Path) -> Result<Self, ImportError> {
        let io = |e| ImportError::io(file, e);
        // A file that is not there is reported as that, whatever it is called.
        let meta = fs::metadata(file).map_err(io)?;
        match files::format_extension(file).as_str() {
            "obj" => Ok(Self::Obj),
            "gltf" | "glb" => Ok(Self::Gltf),
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            "toml" => Ok(Self::Toml),
            "json" => Ok(Self::Json),
            other => {
                let mut start = Vec::new();
                if meta.is_file() {
                    File::open(file).and_then(|f| f.take(84).read_to_end(&mut start)).map_err(io)?;
                }
                match other {
                    _ if start.starts_with(b"glTF") => Ok(Self::Gltf),
                    _ if ply::is_ply(&start) => Ok(Self::Ply),
                    _ if stl::is_ascii(&start) || stl::is_binary_of(&start, meta.len()) => Ok(Self::Stl),
                    "" => Err(ImportError::unsupported(file, "", format!("the file name has no extension; {FORMATS}"))),
                    _ => Err(ImportError::unsupported(file, "", format!("'.{other}' files are not read; {FORMATS}"))),
                }
            }
        }
    }
}

/// Reads a file of a known format, which the scene files of `including` led to.
pub(crate) fn read_as(
    format: Format,
    file: &Path,
    options: &Options,
    including: &Inclusion,
    then: &mut Then<'_>,
) -> Result<Imported, ImportError> {
    let stages = options.stages.as_ref();
    let mut input = Input::open(file, &options.limits)?;
    if format == Format::Obj && !ply::is_ply(input.start(4)?) {
        // The only format that is not held as a whole: its files are long, and read from front to end.
        check_choices(format, file, options)?;
        return obj::read_input(input, file, options, then);
    }
    let read = || timed(stages, Stage::Read, || input.rest());
    let bytes = match &options.images {
        Some(cache) => cache.bytes(file, read)?,
        None => Arc::new(read()?),
    };
    if format == Format::Gltf || (format == Format::Json && is_gltf_json(&bytes)) {
        return gltf::read_bytes(&bytes, file, options, then);
    }
    check_choices(format, file, options)?;
    let mut imported = match format {
        // Whatever it is called.
        Format::Obj | Format::Stl if ply::is_ply(&bytes) => ply::read_bytes(&bytes, file, options),
        Format::Ply if stl::is_ascii(&bytes) => stl::read_bytes(&bytes, file, options),
        Format::Ply => timed(stages, Stage::Parse, || ply::read_bytes(&bytes, file, options)),
        Format::Toml | Format::Json => toml::read_bytes(&bytes, file, options, including),
        Format::Stl | Format::Obj | Format::Gltf => {
            timed(stages, Stage::Parse, || stl::read_bytes(&bytes, file, options))
        }
    }?;
    imported.scene.keep_only(&options.only, file)?;
    then(&mut imported.scene, &mut imported.report)?;
    Ok(imported)
}

/// What only glTF files have is not asked of other ones; scene files pass it on to the models in them.
fn check_choices(format: Format, file: &Path, options: &Options) -> Result<(), ImportError> {
    let variant = options.variant.as_ref().map(|v| ("variant", v));
    let scene = options.scene.as_ref().map(|s| ("scene", s));
    let animation = match options.play.as_ref().map(|play| &play.animation) {
        Some(AnimationChoice::Named(name)) if !matches!(format, Format::Toml | Format::Json) => {
            Some(("animation", name))
        }
        _ => None,
    };
    match variant.or(scene).or(animation) {
        Some((what, name)) => {
            let cause = format!("there is no {what} '{name}': only glTF files have {what}s");
            Err(ImportError::unsupported(file, "", cause))
        }
        None => Ok(()),
    }
}

fn is_gltf_json(bytes: &[u8]) -> bool {
    #[derive(serde::Deserialize)]
    struct Probe {
        asset: Option<serde::de::IgnoredAny>,
    }
    serde_json::from_slice::<Probe>(bytes).is_ok_and(|p| p.asset.is_some())
}

/// The file that a folder stands for.
fn only_model(folder: &Path) -> Result<PathBuf, ImportError> {
    for scene in ["scene.toml", "scene.json"].map(|name| folder.join(name)) {
        if scene.is_file() {
            return Ok(scene);
        }
    }
    let io = |e| ImportError::io(folder, e);
    let mut models = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        // Not .toml: other programs have files of that name beside their models.
        if matches!(files::format_extension(&path).as_str(), "obj" | "gltf" | "glb" | "ply" | "stl") && path.is_file() {
            models.push(path);
        }
    }
    models.sort();
    let problem = match models.len() {
        1 => return Ok(models.swap_remove(0)),
        0 => format!("is a folder with no model in it; {FORMATS}"),
        n => {
            const SHOWN: usize = 8;
            let names = models.iter().take(SHOWN).filter_map(|p| p.file_name()).map(|n| n.to_string_lossy());
            let more = if n > SHOWN { ", ..." } else { "" };
            format!("is a folder with several models; name one of them: {}{more}", names.collect::<Vec<_>>().join(", "))
        }
    };
    Err(ImportError::new(folder, "", ErrorKind::Unsupported(problem)))
}
