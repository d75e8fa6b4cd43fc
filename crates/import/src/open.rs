//! One door for all formats.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::{DAffine3, DMat3, DVec3};

use crate::{ErrorKind, ImportError, Limits, Report, SceneDesc, files, gltf, obj, toml};

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
    let mut imported = read_as(Format::of(&file, &options.limits)?, &file, options, &[])?;
    if let Some(up) = options.up {
        imported.scene.transform(up.to_y());
    }
    Ok(imported)
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Gltf,
    Scene,
}

const FORMATS: &str = "firsthit reads .obj (also .obj.zst and .obj.gz), .gltf, .glb, and scene files (.toml, .json)";

impl Format {
    /// Tells a file's format by its extension, where that is not enough by its first bytes.
    pub(crate) fn of(file: &Path, limits: &Limits) -> Result<Self, ImportError> {
        // A file that is not there is reported as that, whatever it is called.
        fs::metadata(file).map_err(|e| ImportError::io(file, e))?;
        match files::format_extension(file).as_str() {
            "obj" => Ok(Self::Obj),
            "gltf" | "glb" => Ok(Self::Gltf),
            "toml" => Ok(Self::Scene),
            "json" => Ok(if is_gltf_json(&files::read(file, limits)?) { Self::Gltf } else { Self::Scene }),
            _ if files::read(file, limits)?.starts_with(b"glTF") => Ok(Self::Gltf),
            "" => Err(ImportError::unsupported(file, "", format!("the file name has no extension; {FORMATS}"))),
            other => Err(ImportError::unsupported(file, "", format!("'.{other}' files are not read; {FORMATS}"))),
        }
    }
}

/// Reads a file of a known format. `including` are the scene files that led here, outermost first.
pub(crate) fn read_as(
    format: Format,
    file: &Path,
    options: &Options,
    including: &[PathBuf],
) -> Result<Imported, ImportError> {
    match format {
        Format::Obj => obj::read(file, options),
        Format::Gltf => gltf::read(file, options),
        Format::Scene => toml::read_included(file, options, including),
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
    let io = |e| ImportError::io(folder, e);
    let mut models = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let is_scene = path.file_name().is_some_and(|n| n == "scene.toml" || n == "scene.json");
        if is_scene && path.is_file() {
            return Ok(path);
        }
        if matches!(files::format_extension(&path).as_str(), "obj" | "gltf" | "glb" | "toml") && path.is_file() {
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
