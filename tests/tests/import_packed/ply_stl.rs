//! PLY and STL files that are written here and read back.

use std::fs;
use std::path::Path;

use firsthit_import::scene::{SurfaceDesc, TriangleMesh};
use firsthit_import::{Imported, Options, open};

use super::asset;

fn only_mesh(imported: &Imported) -> &TriangleMesh {
    match &imported.scene.meshes[0].geometries[0].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("no shape"),
    }
}

fn read(path: &Path) -> Imported {
    open(path, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[derive(Clone, Copy)]
enum Order {
    Text,
    Little,
    Big,
}

fn ply(mesh: &TriangleMesh, order: Order) -> Vec<u8> {
    let name = match order {
        Order::Text => "ascii",
        Order::Little => "binary_little_endian",
        Order::Big => "binary_big_endian",
    };
    let mut bytes = format!(
        "ply\nformat {name} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for p in &mesh.positions {
        match order {
            Order::Text => bytes.extend(format!("{} {} {}\n", p.x, p.y, p.z).bytes()),
            Order::Little => bytes.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes())),
            Order::Big => bytes.extend(p.to_array().iter().flat_map(|x| x.to_be_bytes())),
        }
    }
    for t in &mesh.triangles {
        match order {
            Order::Text => bytes.extend(format!("3 {} {} {}\n", t[0], t[1], t[2]).bytes()),
            Order::Little => bytes.extend([3].into_iter().chain(t.iter().flat_map(|i| i.to_le_bytes()))),
            Order::Big => bytes.extend([3].into_iter().chain(t.iter().flat_map(|i| i.to_be_bytes()))),
        }
    }
    bytes
}

fn stl(mesh: &TriangleMesh, text: bool) -> Vec<u8> {
    let mut bytes = if text { b"solid bunny\n".to_vec() } else { vec![0; 80] };
    if !text {
        bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    }
    for t in &mesh.triangles {
        let corners = t.map(|v| mesh.positions[v as usize]);
        if text {
            bytes.extend(b"facet normal 0 0 0\nouter loop\n");
            corners.iter().for_each(|p| bytes.extend(format!("vertex {} {} {}\n", p.x, p.y, p.z).bytes()));
            bytes.extend(b"endloop\nendfacet\n");
        } else {
            bytes.extend([0; 12]);
            corners.iter().for_each(|p| bytes.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes())));
            bytes.extend([0; 2]);
        }
    }
    if text {
        bytes.extend(b"endsolid bunny\n");
    }
    bytes
}

#[test]
fn the_bunny_comes_back_as_it_was() {
    let Some(path) = asset("stanford-bunny") else { return };
    let original = read(&path);
    let mesh = only_mesh(&original);
    assert_eq!(mesh.triangles.len(), 69_451);
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("text.ply", ply(mesh, Order::Text)),
        ("little.ply", ply(mesh, Order::Little)),
        ("big.ply", ply(mesh, Order::Big)),
        ("text.stl", stl(mesh, true)),
        ("binary.stl", stl(mesh, false)),
        // By their content.
        ("no extension", ply(mesh, Order::Big)),
        ("unknown.dat", stl(mesh, false)),
        ("also unknown.dat", stl(mesh, true)),
        ("in truth ply.stl", ply(mesh, Order::Little)),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let read = read(&path);
        let found = only_mesh(&read);
        assert!(read.report.warnings.iter().all(|w| w.message.contains("without area")), "{:?}", read.report.warnings);
        if name == "text.ply" {
            assert!(found == mesh, "{name}: not even the normals that are made differ");
        } else if name.contains("ply") || name == "no extension" {
            assert!(found.positions == mesh.positions && found.triangles == mesh.triangles, "{name}");
            // They are made of positions of f32 here, of the text's digits there.
            let close = found.normals.iter().zip(&mesh.normals).all(|(a, b)| a.distance(*b) < 1e-3);
            assert!(close && found.normals.len() == mesh.normals.len(), "{name}");
        }
        let corners = |m: &TriangleMesh| -> Vec<[u32; 3]> {
            let bits = |&v: &u32| m.positions[v as usize].to_array().map(f32::to_bits);
            m.triangles.as_flattened().iter().map(bits).collect()
        };
        assert!(corners(found) == corners(mesh), "{name}");
        println!("{name}: {} vertices for {}", found.positions.len(), mesh.positions.len());
    }
}

#[test]
fn compressed_files_are_read() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let text = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n";
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text).unwrap();
    let path = folder.path().join("one.ply.gz");
    fs::write(&path, encoder.finish().unwrap()).unwrap();
    let imported = read(&path);
    assert_eq!((only_mesh(&imported).triangles.len(), imported.scene.name.as_str()), (1, "one"));
}
