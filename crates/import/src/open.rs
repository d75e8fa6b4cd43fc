//! One door for all formats.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::{DAffine3, DMat3, DVec3};

use crate::files::Input;
use crate::scene::SurfaceDesc;
use crate::toml::Inclusion;
use crate::{
    AnimationChoice, ErrorKind, ImageCache, ImportError, Limits, Play, Report, SceneDesc, files, gltf, obj, ply, stl,
    toml,
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
    /// Keeps decoded images (glTF's) for when the file is read again.
    pub images: Option<ImageCache>,
    /// Leave the images out that nothing but occlusion textures show, which a ray tracer has no use for: a white pixel
    /// stands for each (glTF alone).
    pub without_occlusion: bool,
    /// Limits against hostile files.
    pub limits: Limits,
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
    let path = path.as_ref();
    let file = if path.is_dir() { only_model(path)? } else { path.to_owned() };
    let format = Format::of(&file)?;
    let mut imported = read_as(format, &file, options, &Inclusion::default())?;
    if let Some(play) = options.play.as_ref().filter(|play| play.shutter > 0.0) {
        let play = Play { time: play.time + play.shutter, shutter: 0.0, ..play.clone() };
        let options = Options { play: Some(play), ..options.clone() };
        let later = read_as(format, &file, &options, &Inclusion::default())?;
        if let Some(message) = imported.scene.move_to(&later.scene) {
            imported.report.warn(&file, "", message);
        }
    }
    if let Some(up) = options.up {
        imported.scene.transform(up.to_y());
    }
    imported.finished(&file, options)
}

impl Imported {
    /// The last checks of a whole scene: for transforms, which may have been sound until they were multiplied, and for
    /// something to see.
    pub(crate) fn finished(mut self, file: &Path, options: &Options) -> Result<Self, ImportError> {
        let Self { scene, report } = &mut self;
        let warn = |_, name: &str, message| report.warn(file, format!("instance '{name}'"), message);
        scene.bake(&options.limits, warn).map_err(|kind| ImportError::new(file, "", kind))?;
        let mut surfaces = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries).map(|g| &g.surface);
        if !surfaces.any(|s| !matches!(s, SurfaceDesc::Triangles(mesh) if mesh.triangles.is_empty())) {
            report.warn(file, "", "has no surface: there is nothing to see");
        }
        Ok(self)
    }
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
) -> Result<Imported, ImportError> {
    let mut input = Input::open(file, &options.limits)?;
    // The only format that is not held as a whole: its files are long, and read from front to end.
    if format == Format::Obj && !ply::is_ply(input.start(4)?) {
        check_choices(format, file, options)?;
        return obj::read_input(input, file, options);
    }
    let bytes = input.rest()?;
    let is_gltf = format == Format::Gltf || (format == Format::Json && is_gltf_json(&bytes));
    if !is_gltf {
        check_choices(format, file, options)?;
    }
    match format {
        // Whatever it is called.
        Format::Obj | Format::Stl if ply::is_ply(&bytes) => ply::read_bytes(&bytes, file, options),
        Format::Obj => obj::read_bytes(bytes, file, options),
        Format::Ply if stl::is_ascii(&bytes) => stl::read_bytes(&bytes, file, options),
        Format::Ply => ply::read_bytes(&bytes, file, options),
        Format::Stl => stl::read_bytes(&bytes, file, options),
        Format::Gltf => gltf::read_bytes(&bytes, file, options),
        Format::Json if is_gltf => gltf::read_bytes(&bytes, file, options),
        Format::Toml | Format::Json => toml::read_bytes(&bytes, file, options, including),
    }
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
