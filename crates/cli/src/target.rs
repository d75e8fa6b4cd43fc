//! Where the image goes, decided before anything is loaded.

use std::path::{Path, PathBuf};

use firsthit_render::Aov;
use firsthit_render::output::{self, Format};

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
        writable(&path)?;
        Ok(Self::File(path, format))
    }

    /// Refuses if writing would replace one of the files that were read.
    pub(crate) fn spare<'a>(&self, aovs: &[Aov], read: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
        spare(&self.files(aovs)?, read)
    }

    /// The files that an image with these pictures beside it is written to.
    pub(crate) fn files(&self, aovs: &[Aov]) -> Result<Vec<PathBuf>, Failure> {
        match self {
            Self::Stdout => Ok(Vec::new()),
            Self::File(path, _) => output::files(path, aovs).map_err(Failure::usage),
        }
    }

    /// Refuses a checkpoint that would replace a file that is read, or that the image is written to.
    pub(crate) fn spare_from<'a>(
        &self,
        checkpoint: &Path,
        aovs: &[Aov],
        read: impl Iterator<Item = &'a Path>,
    ) -> Result<(), Failure> {
        let hint = "keep it in another file: --checkpoint FILE";
        let written = [checkpoint.to_owned()];
        if replaced(&written, read).is_some() {
            let failure = format_args!("{}: this file is read too", checkpoint.display());
            return Err(Failure::failed(failure).hint(hint));
        }
        let images = self.files(aovs)?;
        let same = |file: &PathBuf| std::path::absolute(file).ok() == std::path::absolute(checkpoint).ok();
        if images.iter().any(same) || replaced(&written, images.iter().map(PathBuf::as_path)).is_some() {
            let failure = format_args!("{}: the image is written to this file too", checkpoint.display());
            return Err(Failure::usage(failure).hint(hint));
        }
        Ok(())
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

/// Refuses a file that cannot be written, before any work is done for it.
pub(crate) fn writable(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|f| !f.is_dir()) {
        let failure = Failure::failed(format_args!("{}: there is no folder {}", path.display(), folder.display()));
        return Err(failure.hint(format_args!("mkdir -p {}", folder.display())));
    }
    output::try_path(path).map_err(Failure::failed)
}

/// Refuses to write a file that is one of those that are read.
pub(crate) fn spare_file<'a>(path: &Path, read: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    spare(&[path.to_owned()], read)
}

fn spare<'a>(written: &[PathBuf], read: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    match replaced(written, read) {
        Some(file) => {
            let failure = format_args!("{}: this file is read too", file.display());
            Err(Failure::failed(failure).hint("write to another file: -o FILE"))
        }
        None => Ok(()),
    }
}

/// The first of some files to be written that is one of those that are read. What does not exist yet replaces nothing.
fn replaced<'a, 'b>(written: &'b [PathBuf], read: impl Iterator<Item = &'a Path>) -> Option<&'b PathBuf> {
    let existing: Vec<_> = written.iter().filter_map(|f| Some((f, f.canonicalize().ok()?))).collect();
    let read: Vec<_> = if existing.is_empty() { Vec::new() } else { read.flat_map(Path::canonicalize).collect() };
    existing.into_iter().find(|(_, full)| read.contains(full)).map(|(file, _)| file)
}

/// `models/helmet.glb` is rendered to `helmet.png`, `scan.obj.zst` to `scan.png`, the folder `v1.2` to `v1.2.png`;
/// `scene.json` says nothing, so its folder's name is taken.
fn default_name(model: &Path) -> PathBuf {
    let name = |path: &Path| Some(path.file_name()?.to_string_lossy().into_owned());
    let stem = if model.is_dir() {
        // `.` and `..` have a name only in full.
        model.canonicalize().ok().as_deref().and_then(name)
    } else {
        match name(model) {
            Some(file) if file != "scene.json" => strip_extensions(&file),
            _ => std::path::absolute(model).ok().as_deref().and_then(Path::parent).and_then(name),
        }
    };
    PathBuf::from(format!("{}.png", stem.unwrap_or_else(|| "image".into())))
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
            ("/", "image.png"),
        ] {
            assert_eq!(default_name(Path::new(model)), Path::new(image), "{model}");
        }
    }

    #[test]
    fn the_image_of_a_folder_has_its_whole_name() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("mm.v2");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        for model in
            [folder.clone(), folder.join(""), folder.join("."), folder.join("sub/.."), folder.join("scene.json")]
        {
            assert_eq!(default_name(&model), Path::new("mm.v2.png"), "{}", model.display());
        }
    }

    #[test]
    fn what_was_read_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["cow.png", "cow.depth.exr"] {
            std::fs::write(path(name), "").unwrap();
        }
        std::fs::create_dir(path("sub")).unwrap();
        let spare = |target: &str, aovs: &[Aov], read: &str| {
            Target::new(Some(&path(target)), Path::new("m.obj"))
                .unwrap()
                .spare(aovs, [path(read).as_path()].into_iter())
        };
        let error = spare("cow.png", &[], "sub/../cow.png").unwrap_err().to_string();
        assert!(error.contains("cow.png") && error.contains("-o FILE"), "{error}");
        assert!(spare("cow.png", &[Aov::Depth], "cow.depth.exr").is_err());
        assert!(spare("cow.png", &[Aov::Normal], "cow.depth.exr").is_ok());
        assert!(spare("cow.exr", &[Aov::Depth], "cow.depth.exr").is_ok(), "an .exr holds all");
        assert!(spare("new.png", &[], "cow.png").is_ok());
    }

    #[test]
    fn a_wrong_target_is_refused_at_once() {
        for output in ["a.xyz", "a", ".png/", "no-such-folder/a.png", "/"] {
            assert!(Target::new(Some(Path::new(output)), Path::new("m.obj")).is_err(), "{output}");
        }
        assert_eq!(Target::new(Some(Path::new("-")), Path::new("m.obj")).unwrap(), Target::Stdout);
    }
}
