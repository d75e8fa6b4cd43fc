//! STL files of both kinds, and broken ones.

use std::path::Path;

use glam::Vec3;
use proptest::prelude::*;

use crate::scene::{SurfaceDesc, TriangleMesh};
use crate::{ErrorKind, Imported, Limits, Options};

fn read(bytes: &[u8]) -> Result<Imported, String> {
    super::read_bytes(bytes, Path::new("a.stl"), &Options::default()).map_err(|e| e.to_string())
}

fn mesh(imported: &Imported, geometry: usize) -> &TriangleMesh {
    match &imported.scene.meshes[0].geometries[geometry].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("no shape"),
    }
}

/// Two triangles of a square.
const SQUARE: [[[f32; 3]; 3]; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[-0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];

fn ascii(name: &str) -> String {
    let mut text = format!("solid {name}\n");
    for triangle in SQUARE {
        text += "  facet normal 0 0 1\n    outer loop\n";
        for [x, y, z] in triangle {
            text += &format!("      vertex {x} {y} {z:e}\n");
        }
        text += "    endloop\n  endfacet\n";
    }
    text + &format!("endsolid {name}\n")
}

fn binary(comment: &[u8]) -> Vec<u8> {
    let mut bytes = comment.to_vec();
    bytes.resize(80, 0);
    bytes.extend(2_u32.to_le_bytes());
    for triangle in SQUARE {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([7, 7]);
    }
    bytes
}

#[test]
fn both_kinds_say_the_same_and_equal_corners_are_one_vertex() {
    let text = ascii("square");
    for (name, bytes) in [
        ("ascii", text.clone().into_bytes()),
        ("of Windows", text.replace('\n', "\r\n").into_bytes()),
        ("in capitals, with blank lines", text.to_uppercase().replace("SOLID", "solid").replace('\n', "\n\n").into()),
        ("binary", binary(b"made by hand")),
        ("binary that begins as the other", binary(b"solid square\n")),
    ] {
        let imported = read(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(imported.report.warnings.is_empty(), "{name}: {:?}", imported.report.warnings);
        let mesh = mesh(&imported, 0);
        assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y], "{name}");
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{name}");
        assert_eq!(imported.scene.name, "a");
    }
}

#[test]
fn solids_are_geometries() {
    let imported = read(format!("{}{}", ascii("one part"), ascii("other")).as_bytes()).unwrap();
    let names: Vec<&str> = imported.scene.meshes[0].geometries.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["one part", "other"]);
    assert_eq!((mesh(&imported, 0).triangles.len(), mesh(&imported, 1).triangles.len()), (2, 2));
}

#[test]
fn errors_name_the_line_or_byte() {
    let text = ascii("square");
    for (from, to, wanted) in [
        ("vertex 1 0 0e0", "vertx 1 0 0", "a.stl: line 5: expected solid, facet, outer loop, vertex X Y Z, endloop"),
        ("vertex 1 0 0e0", "vertex 1 zero 0", "a.stl: line 5: expected three numbers, found 'vertex 1 zero 0'"),
        ("vertex 1 0 0e0", "vertex 1 0", "a.stl: line 5: expected solid"),
        ("vertex 1 0 0e0", "", "a.stl: line 7: a loop of 2 vertices; expected 3"),
        ("endloop", "endloop\nendloop", "a.stl: line 8: 'endloop' outside of a loop; expected 'outer loop' before it"),
        ("endloop\n", "\n", "a.stl: line 8: expected vertex X Y Z or endloop, found 'endfacet' in a loop"),
        ("outer loop", "", "a.stl: line 4: 'vertex' outside of a loop; expected 'outer loop' before it"),
        ("outer loop", "outer loop\nouter loop", "a.stl: line 4: expected vertex X Y Z or endloop, found 'outer' in a"),
    ] {
        let error = read(text.replacen(from, to, 1).as_bytes()).expect_err(wanted);
        assert!(error.starts_with(wanted), "{error}\n{wanted}");
    }
    let error = read(&text.as_bytes()[..text.rfind("endloop").unwrap()]).expect_err("no end");
    assert_eq!(error, "a.stl: the file ends in a loop without 'endloop'");
    let bytes = binary(b"");
    let error = read(&bytes[..bytes.len() - 1]).expect_err("cut");
    assert_eq!(error, "a.stl: byte 134: 2 triangles are declared, but the file ends in number 1");
    let error = read(&bytes[..20]).expect_err("cut");
    assert!(error.starts_with("a.stl: 20 bytes are neither a binary STL file, nor"), "{error}");
    let more = [&bytes[..], b"tail"].concat();
    assert_eq!(read(&more).unwrap().report.warnings[0].message, "4 bytes after the last triangle passed over");
    let few = Options { limits: Limits { elements: 1, ..Limits::default() }, ..Options::default() };
    for bytes in [text.as_bytes(), &bytes] {
        let error = super::read_bytes(bytes, Path::new("a.stl"), &few).expect_err("two triangles");
        assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
    }
}

#[test]
fn the_triangles_of_polygons_are_counted() {
    // One loop of a hundred vertices: 98 triangles.
    let corners: String = (0..100_i32).map(|k| format!("vertex {k} {} 0\n", k * k)).collect();
    let text = format!("solid\nfacet\nouter loop\n{corners}endloop\nendfacet\nendsolid\n");
    let read = |elements: u64| {
        let options = Options { limits: Limits { elements, ..Limits::default() }, ..Options::default() };
        super::read_bytes(text.as_bytes(), Path::new("a.stl"), &options)
    };
    assert_eq!(read(98).unwrap().report.triangles_all_scenes, 98);
    assert!(matches!(read(97).unwrap_err().kind, ErrorKind::Limit(_)));
}

proptest! {
    #[test]
    fn damaged_files_do_no_harm(
        is_binary in any::<bool>(), changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(), cut in any::<bool>(),
    ) {
        let mut bytes = if is_binary { binary(b"") } else { ascii("square").into_bytes() };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        if let Ok(imported) = read(&bytes) {
            for geometry in &imported.scene.meshes[0].geometries {
                let SurfaceDesc::Triangles(mesh) = &geometry.surface else { panic!("no shape") };
                prop_assert!(mesh.triangles.as_flattened().iter().all(|&v| (v as usize) < mesh.positions.len()));
                prop_assert!(mesh.positions.iter().all(|p| p.is_finite()));
            }
        }
    }
}
