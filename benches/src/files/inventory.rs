//! What is known of the files: the two inventories that lie beside them.

use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use serde::Serialize;

/// What an inventory says of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Known {
    /// Triangles, every instance of every scene counted; polygons as fans.
    pub triangles: Option<u64>,
    /// Whether Khronos's validator finds no error.
    pub valid: Option<bool>,
    /// The validator's code of the first error.
    pub first_error: String,
}

/// The files of a folder by their path below it, with what is known of them: those that are there, and those that an
/// inventory lists.
///
/// # Errors
/// If the folder cannot be read, or an inventory in it has no column of a name that is looked for.
pub fn of(folder: &Path) -> io::Result<BTreeMap<String, Known>> {
    let mut files = BTreeMap::new();
    walk(folder, "", &mut files)?;
    for (name, triangles) in [("gltf-inventory.csv", "triangles_instanced"), ("obj-inventory.csv", "triangles_fan")] {
        match fs::read_to_string(folder.join(name)) {
            Ok(text) => files.extend(table(&text, triangles)?),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(e),
        }
    }
    Ok(files)
}

fn walk(folder: &Path, below: &str, files: &mut BTreeMap<String, Known>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{below}{}", entry.file_name().to_string_lossy());
        // Links are not followed: they could lead round in a circle.
        if entry.file_type()?.is_dir() {
            walk(&entry.path(), &(name + "/"), files)?;
        } else if is_model(&name) {
            files.insert(name, Known::default());
        }
    }
    Ok(())
}

fn is_model(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let plain = name.trim_end_matches(".zst").trim_end_matches(".gz");
    [".gltf", ".glb", ".obj", ".ply", ".stl"].iter().any(|end| plain.ends_with(end))
}

/// The rows of an inventory.
fn table(text: &str, triangles: &str) -> io::Result<Vec<(String, Known)>> {
    let mut lines = text.lines().map(firsthit_tests::csv_fields);
    let head = lines.next().unwrap_or_default();
    let column = |name: &str| head.iter().position(|h| h == name);
    let missing = || io::Error::other("an inventory lacks a column");
    let (file, count) = (column("file").ok_or_else(missing)?, column(triangles).ok_or_else(missing)?);
    let (valid, error) = (column("valid"), column("first_error"));
    let rows = lines.map(|row| {
        let cell = |at: usize| row.get(at).cloned().unwrap_or_default();
        let known = Known {
            triangles: cell(count).parse().ok(),
            valid: valid.map(|at| cell(at) == "yes"),
            first_error: error.map(cell).unwrap_or_default(),
        };
        (cell(file), known)
    });
    Ok(rows.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_both_inventories_are_read() {
        let gltf = "file,valid,first_error,triangles_instanced\na.gltf,no,\"B, \"\"C\"\"\",7\nd.glb,yes,,\n";
        let rows = table(gltf, "triangles_instanced").unwrap();
        let known = Known { triangles: Some(7), valid: Some(false), first_error: "B, \"C\"".into() };
        assert_eq!(rows[0], ("a.gltf".into(), known));
        assert_eq!(rows[1], ("d.glb".into(), Known { valid: Some(true), ..Known::default() }));
        let rows = table("file,triangles_fan\na.obj,3\n", "triangles_fan").unwrap();
        assert_eq!(rows[0].1, Known { triangles: Some(3), ..Known::default() });
        assert!(table("file\na.obj\n", "triangles_fan").is_err());
    }

    #[test]
    fn models_are_told_by_their_names() {
        assert!(["a.glb", "b.OBJ", "c.obj.zst", "d.ply.gz", "e.stl"].into_iter().all(is_model));
        assert!(!["a.png", "b.mtl", "c.gltf.report.json", "glb"].into_iter().any(is_model));
    }
}
