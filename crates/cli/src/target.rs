//! Where the image goes, decided before anything is loaded.

use std::path::{Path, PathBuf};

use firsthit_render::output::Format;

use crate::error::Failure;

/// Where the image goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// PNG on standard output.
    Stdout,
    /// A file of the format that its name says.
    File(PathBuf, Format),
}

impl Target {
    /// From `--output`, else from the model's name, in the current folder.
    pub(crate) fn new(output: Option<&Path>, model: &Path) -> Result<Self, Failure> {
        if output == Some(Path::new("-")) {
            return Ok(Self::Stdout);
        }
        let path = output.map_or_else(|| default_name(model), Path::to_owned);
        let format = Format::from_path(&path).map_err(Failure::usage)?;
        if path.is_dir() {
            return Err(Failure::failed(format_args!("{}: this is a folder, not a file", path.display())));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|f| !f.is_dir()) {
            let failure = Failure::failed(format_args!("{}: there is no folder {}", path.display(), folder.display()));
            return Err(failure.hint(format_args!("mkdir -p {}", folder.display())));
        }
        Ok(Self::File(path, format))
    }

    /// Whether it shows what a display shows, instead of radiance.
    pub(crate) fn is_png(&self) -> bool {
        matches!(self, Self::Stdout | Self::File(_, Format::Png))
    }

    /// As it is named in messages and reports.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Stdout => "-".into(),
            Self::File(path, _) => path.display().to_string(),
        }
    }
}

/// `models/helmet.glb` is rendered to `helmet.png`, `scan.obj.zst` to `scan.png`; `scene.json` says nothing, so its
/// folder's name is taken.
fn default_name(model: &Path) -> PathBuf {
    let file = model.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let stem = if file == "scene.json" || file.is_empty() { None } else { strip_extensions(&file) };
    let folder = || {
        let full = std::path::absolute(model).ok()?;
        let folder = if file.is_empty() { full.as_path() } else { full.parent()? };
        Some(folder.file_name()?.to_string_lossy().into_owned())
    };
    let stem = stem.or_else(folder).unwrap_or_else(|| "image".into());
    PathBuf::from(format!("{stem}.png"))
}

/// The name without its extension, nor that of a compressed file inside it.
fn strip_extensions(file: &str) -> Option<String> {
    let inner = file.strip_suffix(".zst").or_else(|| file.strip_suffix(".gz")).unwrap_or(file);
    let stem = Path::new(inner).file_stem()?.to_string_lossy().into_owned();
    (!stem.is_empty()).then_some(stem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_is_named_after_the_model() {
        for (model, image) in [
            ("helmet.glb", "helmet.png"),
            ("a/b/helmet.gltf", "helmet.png"),
            ("a/scan.obj.zst", "scan.png"),
            ("a/v1.2/part.v3.obj", "part.v3.png"),
            ("a/cornell/scene.json", "cornell.png"),
            ("a/cornell/", "cornell.png"),
            ("/", "image.png"),
        ] {
            assert_eq!(default_name(Path::new(model)), Path::new(image), "{model}");
        }
    }

    #[test]
    fn a_wrong_target_is_refused_at_once() {
        for output in ["a.xyz", "a", ".png/", "no-such-folder/a.png", "/"] {
            assert!(Target::new(Some(Path::new(output)), Path::new("m.obj")).is_err(), "{output}");
        }
        assert_eq!(Target::new(Some(Path::new("-")), Path::new("m.obj")).unwrap(), Target::Stdout);
    }
}
