//! PLY files of all encodings, and broken ones.

use std::path::Path;

use glam::{Vec2, Vec3};
use proptest::prelude::*;

use crate::scene::{SurfaceDesc, TriangleMesh};
use crate::{ErrorKind, Imported, Limits, Options, srgb};

fn read(bytes: &[u8]) -> Result<Imported, String> {
    super::read_bytes(bytes, Path::new("a.ply"), &Options::default()).map_err(|e| e.to_string())
}

fn mesh(imported: &Imported) -> &TriangleMesh {
    match &imported.scene.meshes[0].geometries[0].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("no shape"),
    }
}

/// A square with normals, colours, coordinates, a material index that nothing reads, and an element that is unknown.
const HEADER: &str = "comment made by hand\nelement vertex 4\nproperty double x\nproperty float y\nproperty float z\n\
    property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty ushort green\n\
    property float blue\nproperty float s\nproperty float t\nelement edge 1\nproperty int a\n\
    property list uchar short weights\nelement face 1\nproperty list uint8 int32 vertex_indices\nproperty char m\n\
    end_header\n";

const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

fn ascii() -> Vec<u8> {
    let mut text = format!("ply\nformat ascii 1.0\n{HEADER}");
    for [x, y] in CORNERS {
        text += &format!("{x} {y} 0 0 0 2 255 65535 0.5 {x} {y}\n");
    }
    text += "7 2 1 -1\n4 0 1 2 3 -5\n";
    text.into_bytes()
}

fn binary(big: bool) -> Vec<u8> {
    let name = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = format!("ply\nformat {name} 1.0\n{HEADER}").into_bytes();
    let mut put = |number: &[u8]| {
        // As on this machine or the other way round.
        let little: Vec<u8> = number.to_vec();
        if big { bytes.extend(little.iter().rev()) } else { bytes.extend(little) }
    };
    for [x, y] in CORNERS {
        put(&x.to_le_bytes());
        for f in [y as f32, 0.0, 0.0, 0.0, 2.0] {
            put(&f.to_le_bytes());
        }
        put(&[255]);
        put(&65535_u16.to_le_bytes());
        for f in [0.5, x as f32, y as f32] {
            put(&f.to_le_bytes());
        }
    }
    put(&7_i32.to_le_bytes());
    put(&[2]);
    put(&1_i16.to_le_bytes());
    put(&(-1_i16).to_le_bytes());
    put(&[4]);
    (0..4_i32).for_each(|i| put(&i.to_le_bytes()));
    put(&[251]);
    bytes
}

#[test]
fn all_encodings_say_the_same() {
    let dos = |text: Vec<u8>| String::from_utf8(text).unwrap().replace('\n', "\r\n").into_bytes();
    for (name, bytes) in
        [("ascii", ascii()), ("of Windows", dos(ascii())), ("little", binary(false)), ("big", binary(true))]
    {
        let imported = read(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(imported.report.warnings.is_empty(), "{name}: {:?}", imported.report.warnings);
        let mesh = mesh(&imported);
        assert_eq!(mesh.positions, CORNERS.map(|[x, y]| Vec3::new(x as f32, y as f32, 0.0)), "{name}");
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{name}");
        // All are those of the face: it is flat.
        assert!(mesh.normals.is_empty(), "{name}");
        let color = mesh.colors[2];
        assert!((color.z - srgb::to_linear(0.5) as f32).abs() < 1e-6 && color.x == 1.0 && color.y == 1.0, "{name}");
        assert_eq!(mesh.uvs[0][2], Vec2::new(1.0, 0.0), "{name}: v is counted from the top");
    }
}

const TRIANGLES: &str = "element vertex 5\nproperty float x\nproperty float y\nproperty float z\n";

fn body(rest: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{TRIANGLES}{rest}").into_bytes()
}

const VERTICES: &str = "end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n";

#[test]
fn strips_and_polygons_are_cut() {
    let strips =
        body(&format!("element tristrips 1\nproperty list int int vertex_indices\n{VERTICES}9 0 1 2 3 4 -1 0 1 3\n"));
    assert_eq!(mesh(&read(&strips).unwrap()).triangles, [[0, 1, 2], [1, 3, 2], [2, 3, 4], [0, 1, 3]]);
    // A concave polygon: the fan from its first corner would cover too much.
    let arrow = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list int int vertex_index\nend_header\n0 2 0 -2 -2 0 0 -1 0 2 -2 0 1 0 0 5 0 1 2 3 4";
    let imported = read(arrow.as_bytes()).unwrap();
    let mesh = mesh(&imported);
    let area: f32 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            0.5 * (b - a).cross(c - a).z
        })
        .sum();
    assert!((area - 6.0).abs() < 1e-6, "{area}");
}

#[test]
fn points_alone_are_no_surface() {
    let imported = read(&body(VERTICES)).unwrap();
    assert!(imported.scene.meshes[0].geometries.is_empty());
    let few = body(&format!("element face 2\nproperty list int int vertex_index\n{VERTICES}2 0 1\n3 0 1 2\n"));
    let imported = read(&few).unwrap();
    assert_eq!(mesh(&imported).triangles.len(), 1);
    assert_eq!(imported.report.warnings[0].message, "1 faces with less than 3 corners left out");
}

#[test]
fn errors_name_the_line_and_what_was_expected() {
    let face = |text: &str| body(&format!("element face 1\nproperty list int int vertex_index\n{VERTICES}{text}"));
    for (bytes, wanted) in [
        (face("3 0 1 5\n"), "a.ply: line 15: vertex 5 does not exist: there are 5"),
        (face("3 0 1 -2\n"), "a.ply: line 15: face 0: -2 is no index of a vertex"),
        (face("3 0 1.5 2\n"), "a.ply: line 15: face 0: 1.5 is no index of a vertex"),
        (face("3 0 one 2\n"), "a.ply: line 15: face 0: expected an int for 'vertex_index', found 'one'"),
        (face("3 0\n1"), "a.ply: line 16: face 0: expected an int for 'vertex_index', found the end of the file"),
        (face("-3 0 1 2\n"), "a.ply: line 15: face 0: a list 'vertex_index' of -3"),
        (face("1e9 0 1 2\n"), "a.ply: line 15: face 0: a list 'vertex_index' of 1000000000"),
        (body("property flaot w\nend_header\n"), "a.ply: line 7: 'flaot' is no type of PLY"),
        (body("property list float int w\nend_header\n"), "a.ply: line 7: the length of the list 'w' is a float"),
        (body("elemnt face 1\nend_header\n"), "a.ply: line 7: expected format, element, property, comment or"),
        (body("element face many\nend_header\n"), "a.ply: line 7: expected how many 'face' there are, found 'many'"),
        (body("end_heade\n"), "a.ply: line 7: expected format"),
        (body(""), "a.ply: line 7: the header has no 'end_header'"),
        (b"ply\nformat ascii 2.0\nend_header\n".to_vec(), "a.ply: line 2: version 2.0 of PLY is not read, only 1.0"),
        (b"ply\nformat text 1.0\nend_header\n".to_vec(), "a.ply: line 2: the format 'text' is none of"),
        (b"ply\nend_header\n".to_vec(), "a.ply: line 2: the header says no format"),
        (b"v 0 0 0\n".to_vec(), "a.ply: no PLY file"),
        (b"ply\nformat ascii 1.0\nproperty int x\n".to_vec(), "a.ply: line 3: a property before any element"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nend_header\n0 0\n".to_vec(),
            "a.ply: line 7: the element 'vertex' has no property 'z'",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 0\nproperty int x\nproperty int y\nproperty int z\nelement face 9\n\
              property int a\nend_header\n0 0 0 0 0 0 0 0 0\n"
                .to_vec(),
            "a.ply: line 10: the element 'face' has no list 'vertex_indices'",
        ),
    ] {
        let error = read(&bytes).expect_err(wanted);
        assert!(error.starts_with(wanted), "{error}\n{wanted}");
    }
    let cut = binary(false);
    let error = read(&cut[..cut.len() - 3]).expect_err("cut");
    let place = format!("a.ply: byte {}: face 0: expected an int", cut.len() - 5);
    assert!(error.starts_with(&place), "{error}\n{place}");
}

#[test]
fn declared_counts_are_checked_before_anything_is_allocated() {
    for (count, wanted) in [("1000000000", "are declared, but"), ("9999999999999", "more than the limit of")] {
        let bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property float z\nend_header\n"
        );
        let error = read(bytes.as_bytes()).expect_err("too many");
        assert!(error.contains(wanted), "{error}");
    }
    let few = Options { limits: Limits { elements: 3, ..Limits::default() }, ..Options::default() };
    let error = super::read_bytes(&ascii(), Path::new("a.ply"), &few).expect_err("four vertices");
    assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
}

#[test]
fn corners_and_triangles_are_limited_while_they_are_read() {
    let read = |element: &str, list: &str, elements: u64| {
        let text = format!("element {element} 1\nproperty list int char vertex_index\n{VERTICES}{list}\n");
        let options = Options { limits: Limits { elements, ..Limits::default() }, ..Options::default() };
        super::read_bytes(&body(&text), Path::new("a.ply"), &options).map_err(|e| (e.place, e.kind.to_string()))
    };
    // Nine numbers are seven triangles of three corners.
    let strip = "9 0 1 2 3 4 0 1 2 3";
    assert_eq!(mesh(&read("tristrips", strip, 21).unwrap()).triangles.len(), 7);
    for (element, list, limit) in [("tristrips", strip, 20), ("tristrips", strip, 8), ("face", "6 0 1 3 4 2 0", 5)] {
        let wanted = ("line 15".to_owned(), format!("more than {limit} corners of faces"));
        assert_eq!(read(element, list, limit).unwrap_err(), wanted);
    }
}

#[test]
fn infinite_vertices_cost_only_their_faces() {
    let faces = "element face 2\nproperty list int int vertex_index\nend_header\n";
    let bytes = body(&format!("{faces}nan 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n3 0 1 2\n3 1 3 2\n"));
    let imported = read(&bytes).unwrap();
    assert_eq!(mesh(&imported).triangles.len(), 1);
    let warning = &imported.report.warnings[0];
    assert_eq!(warning.place, "line 15");
    assert!(warning.message.starts_with("1 faces left out"), "{warning}");
}

proptest! {
    #[test]
    fn damaged_files_do_no_harm(
        which in 0_usize..3, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(), cut in any::<bool>(),
    ) {
        let mut bytes = vec![ascii(), binary(false), binary(true)].swap_remove(which);
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
