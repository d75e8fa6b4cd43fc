use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};
use proptest::prelude::*;

use super::*;
use crate::scene::{AlphaMode, Channel, MaterialModel, PbrMaterial, TriangleMesh, Wrap};
use crate::{ErrorKind, Limits};

fn read_text(text: &str) -> Result<Imported, ImportError> {
    read_bytes(text.as_bytes().to_vec(), "nowhere/test.obj", &Options::default())
}

fn good(text: &str) -> Imported {
    read_text(text).unwrap_or_else(|e| panic!("{e}"))
}

fn mesh(imported: &Imported, geometry: usize) -> &TriangleMesh {
    match &imported.scene.meshes[0].geometries[geometry].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("OBJ has no shapes"),
    }
}

fn warnings(imported: &Imported) -> Vec<String> {
    imported.report.warnings.iter().map(ToString::to_string).collect()
}

const CUBE: &str = "
    v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A sphere of triangles and quadrilaterals.
fn sphere(rows: usize, columns: usize) -> String {
    let mut text = String::new();
    for i in 0..=rows {
        // Exact at the poles, so that each is one point.
        let (sin, cos) = match i {
            0 => (0.0, 1.0),
            i if i == rows => (0.0, -1.0),
            i => (std::f64::consts::PI * i as f64 / rows as f64).sin_cos(),
        };
        for j in 0..columns {
            let phi = std::f64::consts::TAU * j as f64 / columns as f64;
            let (x, y, z) = (sin * phi.cos(), cos, sin * phi.sin());
            text += &format!("v {x} {y} {z}\n");
        }
    }
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: usize, j: usize| i * columns + j % columns + 1;
            text += &format!("f {} {} {} {}\n", at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
        }
    }
    text
}

#[test]
fn a_cube_of_quadrilaterals_keeps_its_vertices_and_edges() {
    let imported = good(CUBE);
    let m = mesh(&imported, 0);
    assert_eq!((m.positions.len(), m.triangles.len()), (8, 12));
    assert!(m.normals.is_empty(), "its faces meet at right angles: flat");
    assert_eq!(imported.scene.instances[0].transform, DAffine3::IDENTITY);
    assert_eq!(warnings(&imported), [""; 0]);
    // Six times the volume, by the divergence theorem: also shows that no triangle is turned round.
    let p = |i: u32| m.positions[i as usize];
    let volume: f32 = m.triangles.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c)))).sum();
    assert_eq!(volume, 6.0);
}

#[test]
fn round_things_without_normals_look_round() {
    let imported = good(&sphere(16, 32));
    let m = mesh(&imported, 0);
    assert_eq!(m.normals.len(), m.positions.len());
    for (p, n) in m.positions.iter().zip(&m.normals) {
        // Faces are 11 degrees wide; the mean of those around a vertex is far nearer to the sphere's normal.
        assert!(n.dot(*p) > 2.0_f32.to_radians().cos(), "{p} {n}");
    }
    let flat = good(&format!("s off\n{}", sphere(16, 32)));
    assert!(mesh(&flat, 0).normals.is_empty(), "the file says so");
}

#[test]
fn a_smoothing_group_is_smooth_however_its_faces_are_cut() {
    // Weights by angle do not depend on how a square is cut into triangles.
    let cut = CUBE.replace("f 1 4 3 2", "f 1 4 3\nf 1 3 2").replace("f 5 6 7 8", "f 5 6 8\nf 6 7 8");
    for text in [CUBE, &cut] {
        let imported = good(&text.replacen("f ", "s 1\nf ", 1));
        let m = mesh(&imported, 0);
        assert_eq!(m.positions.len(), 8);
        for (p, n) in m.positions.iter().zip(&m.normals) {
            let diagonal = (*p - Vec3::splat(0.5)).normalize();
            // Unit vectors rounded to f32, and the sines and cosines behind them.
            assert!((*n - diagonal).length() < 1e-6, "{p} {n}");
        }
    }
}

#[test]
fn groups_do_not_smooth_over_their_borders() {
    let roof = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 0 2 0\nv 1 2 0\n";
    let two = good(&format!("{roof}s 1\nf 1 2 3 4\ns 2\nf 4 3 6 5\n"));
    assert!(mesh(&two, 0).normals.is_empty(), "each group is one plane");
    let one = good(&format!("{roof}s 1\nf 1 2 3 4\nf 4 3 6 5\n"));
    assert_eq!(mesh(&one, 0).positions.len(), 6);
    // On the ridge the two slopes balance.
    assert!(mesh(&one, 0).normals.iter().any(|n| (*n - Vec3::Z).length() < 1e-6));
}

#[test]
fn faces_with_and_without_normals_share_a_mesh() {
    let imported = good("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0.6 0 0.8\nf 1//1 2//1 3//1\nf 1 2 3\n");
    let m = mesh(&imported, 0);
    assert_eq!((m.positions.len(), m.triangles.len()), (6, 2));
    assert_eq!(m.normals[0], Vec3::new(0.6, 0.0, 0.8));
    assert_eq!(m.normals[3], Vec3::Z, "flat: its own normal");
}

#[test]
fn texture_coordinates_are_counted_from_the_top() {
    let imported = good("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.125\nvt 0.5\nvt 0 0 7\nf 1/1 2/2 3\n");
    let m = mesh(&imported, 0);
    assert_eq!(m.uvs, [vec![Vec2::new(0.25, 0.875), Vec2::new(0.5, 1.0), Vec2::ZERO]]);
}

#[test]
fn indices_count_back_and_forward() {
    let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let expected = good(&format!("{v}f 1 2 3\n"));
    for text in [format!("{v}f -3 -2 -1\n"), format!("f 1 2 3\n{v}"), format!("{v}f +1 2/ \\\n  3//\nv 9 9 9\n")] {
        assert_eq!(mesh(&good(&text), 0), mesh(&expected, 0), "{text}");
    }
}

#[test]
fn vertex_colors_are_srgb() {
    let v = "v 0 0 0 1 0.5 0\nv 1 0 0\nv 0 1 0 0 0 0.04\nf 1 2 3\n";
    let imported = good(v);
    let colors = &mesh(&imported, 0).colors;
    // IEC 61966-2-1: 0.5 is 0.214041; below 0.04045 it is a division by 12.92.
    assert!((colors[0] - Vec4::new(1.0, 0.214_041, 0.0, 1.0)).abs().max_element() < 1e-6, "{colors:?}");
    assert_eq!(colors[1], Vec4::ONE);
    assert!((colors[2].z - 0.04 / 12.92).abs() < 1e-8);
    let bytes = good("v 0 0 0 255 127.5 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert!((mesh(&bytes, 0).colors[0] - colors[0]).abs().max_element() < 1e-6);
    assert_eq!(warnings(&bytes).len(), 1);
    // One channel a little above 1 makes no other one dark.
    let bright = good("v 0 0 0 1 0.5 0\nv 1 0 0 1.25 1 1\nv 0 1 0\nf 1 2 3\n");
    assert_eq!((mesh(&bright, 0).colors[0], mesh(&bright, 0).colors[1]), (colors[0], Vec4::ONE));
}

#[test]
fn geometries_are_objects_groups_and_materials() {
    let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let imported = good(&format!(
        "{v}o car\ng wheel\nusemtl black\nf 1 2 3\ng\nusemtl red\nf 1 2 3\ng wheel\nusemtl black\nf 1 2 3\nf 3 2 1\n"
    ));
    let names: Vec<_> = imported.scene.meshes[0].geometries.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["car/wheel", "car"], "one part again is one geometry");
    assert_eq!((mesh(&imported, 0).triangles.len(), mesh(&imported, 1).triangles.len()), (3, 1));
    let materials: Vec<_> = imported.scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(materials, ["black", "red"], "names are kept though there is no library");
    assert_eq!(warnings(&imported).len(), 1, "{:?}", warnings(&imported));
}

#[test]
fn a_model_far_away_keeps_its_detail() {
    let at = DVec3::new(4_500_000.25, 30.0, -5_100_000.75);
    let corners = [DVec3::ZERO, DVec3::new(0.001, 0.0, 0.0), DVec3::new(0.0, 0.002, 1.0)];
    let mut text = String::new();
    for c in corners {
        let p = at + c;
        text += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    let imported = good(&(text + "f 1 2 3\n"));
    let transform = imported.scene.instances[0].transform;
    for (p, c) in mesh(&imported, 0).positions.iter().zip(corners) {
        let world = transform.transform_point3(p.as_dvec3());
        // Half a unit in the last place of f32 numbers up to 1, where f32 alone would miss by 0.25.
        assert!((world - (at + c)).abs().max_element() < 1e-7, "{world}");
    }
}

#[test]
fn errors_name_the_line_and_the_value() {
    let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        (format!("{v}f 1 2 4\n"), "line 4: vertex 4 does not exist; the file has 3"),
        (format!("{v}f 1 2 -4\n"), "line 4: vertex -4 does not exist; the file has 3 so far"),
        (format!("{v}f 0 1 2\n"), "line 4: vertex 0 does not exist"),
        (format!("{v}f 1 2 99999999999999999999999\n"), "line 4: vertex 9223372036854775807 does not exist"),
        (format!("{v}f 1 2 4294967296\n"), "line 4: vertex 4294967296 does not exist"),
        (format!("{v}f 1 2 x\n"), "line 4: 'x' is not a corner of a face"),
        (format!("{v}f 1 2 3/1/1/1\n"), "line 4: '3/1/1/1' is not a corner"),
        (format!("{v}f 1 2 /1\n"), "line 4: '/1' is not a corner"),
        ("v 0 0\n".to_owned(), "line 1: a vertex needs 3 coordinates, here are 2"),
        ("#\n\nv 0 0 zero\n".to_owned(), "line 3: 'zero' is not a number"),
        ("vn 1 0\n".to_owned(), "line 1: a normal needs 3 numbers"),
        ("vt\n".to_owned(), "line 1: a texture coordinate needs"),
        (String::new(), "no OBJ statement"),
        ("solid cube\nfacet normal 0 0 1\n".to_owned(), "no OBJ statement"),
    ];
    for (text, expected) in cases {
        let error = read_text(&text).expect_err(&text).to_string();
        assert!(error.starts_with("nowhere/test.obj: ") && error.contains(expected), "{text}: {error}");
    }
}

#[test]
fn what_is_left_out_is_a_warning() {
    let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 0 1e300 0\n";
    let cases = [
        ("f 1 2 4\nf 1 2 5\n", 1, "line 7: 2 faces left out, because a vertex of theirs is infinite"),
        ("f 1 2\n", 1, "line 7: 1 faces with less than 3 corners"),
        ("f 1 1 1\n", 2, "line 7: 1 faces without area"),
        ("f 1/9 2/0 3/-1\n", 2, "line 7: 3 texture coordinates or normals do not exist"),
        ("l 1 2 3\np 1\n", 1, "line 7: lines and points are not rendered (2 of them)"),
        ("cstype bezier\ncurv 0 1 1 2\nend\n", 1, "line 7: curves and free-form surfaces"),
        ("foo\nbar\n", 1, "line 7: unknown statement 'foo' passed over; 2 lines are unknown"),
        ("mtllib none.mtl\n", 1, "line 7: material library 'none.mtl'"),
        ("usemtl none\nf 1 2 3\n", 2, "line 7: no material 'none'"),
    ];
    for (text, triangles, expected) in cases {
        let imported = good(&format!("{v}f 1 2 3\n{text}"));
        let w = warnings(&imported);
        assert!(w.len() == 1 && w[0].contains(expected), "{text}: {w:?}");
        assert_eq!(imported.report.triangles_all_scenes, triangles, "{text}");
    }
    assert_eq!(warnings(&good(&format!("{v}f 1 2 3\n"))), [""; 0], "bad vertices do no harm unused");
}

#[test]
fn counts_are_limited() {
    let limits = Limits { elements: 7, ..Limits::default() };
    let result = read_bytes(CUBE.as_bytes().to_vec(), "cube.obj", &Options { limits, ..Options::default() });
    let error = result.expect_err("8 vertices");
    assert!(matches!(&error.kind, ErrorKind::Limit(_)), "{error}");
    assert_eq!(error.place, "line 9");
}

#[test]
fn a_polygon_of_a_million_corners_is_read() {
    // A comb: concave at every second corner.
    let n = 1_000_000;
    let mut text = String::from("v 0 -1 0\nv 1 -1 0\n");
    for i in (0..n).rev() {
        text += &format!("v {} {} 0\n", f64::from(i) / f64::from(n), i % 2);
    }
    text += "f";
    for i in 1..=n + 2 {
        text += &format!(" {i}");
    }
    let imported = good(&text);
    assert_eq!(imported.report.triangles_all_scenes, n as u64);
    assert_eq!(warnings(&imported).len(), 1, "it is too large to be cut well, and that is said");
}

// Materials.

/// A material library beside a model that uses its first material; images are PNG files of one colour.
fn with_library(mtl: &str, images: &[(&str, [u8; 4])]) -> (Imported, Vec<PbrMaterial>) {
    let dir = tempfile::tempdir().expect("temporary folder");
    for (name, rgba) in images {
        let image = ::image::RgbaImage::from_pixel(2, 2, ::image::Rgba(*rgba));
        image.save(dir.path().join(name)).expect("a PNG file");
    }
    std::fs::write(dir.path().join("m.mtl"), mtl).expect("file");
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let imported = read_bytes(obj.into(), dir.path().join("m.obj"), &Options::default()).expect("readable");
    let materials = imported.scene.materials.iter().map(|m| match &m.model {
        MaterialModel::Pbr(pbr) => (**pbr).clone(),
        other => panic!("{other:?}"),
    });
    let materials = materials.collect();
    (imported, materials)
}

fn material(mtl: &str) -> PbrMaterial {
    let (imported, mut materials) = with_library(&format!("newmtl a\n{mtl}"), &[]);
    assert_eq!(warnings(&imported), [""; 0]);
    materials.swap_remove(0)
}

#[test]
fn a_matt_wall_does_not_shine() {
    let m = material("Ns 10\nNi 1.5\nillum 2\nKa 1 1 1\nKd 0.63 0.065 0.05 # Red\nKs 0 0 0\nKe 17 12 4\n");
    assert_eq!(m.base_color, Vec4::new(0.63, 0.065, 0.05, 1.0));
    assert_eq!((m.metallic, m.specular, m.transmission), (0.0, 0.0, 0.0));
    assert_eq!(m.emissive, Vec3::new(17.0, 12.0, 4.0));
    assert_eq!(m.alpha_mode, AlphaMode::Opaque);
    assert!(m.double_sided);
    // alpha = roughness^2 = sqrt(2 / (10 + 2)).
    assert!((m.roughness * m.roughness - (2.0_f32 / 12.0).sqrt()).abs() < 1e-6);
    let glossy = material("Ks 0.5 0.5 0.5\nillum 2\n");
    assert_eq!((glossy.specular, glossy.specular_color), (1.0, Vec3::ONE), "plastic");
    assert_eq!(material("Ks 0.5 0.5 0.5\nillum 1\n").specular, 0.0, "no highlight asked for");
    let faint = material("Ks 0.1 0.05 0\n");
    let product = faint.specular * faint.specular_color;
    assert!((product - Vec3::new(0.2, 0.1, 0.0)).abs().max_element() < 1e-6, "{product}");
}

#[test]
fn mirrors_and_glass_are_told_by_illum() {
    let mirror = material("Kd 0.01 0.01 0.01\nKs 0.95 0.95 0.95\nNs 1000\nillum 5\n");
    assert_eq!(mirror.roughness, 0.0);
    assert!((mirror.metallic - 0.95 / 0.96).abs() < 1e-6);
    assert!((mirror.base_color.x - 0.96).abs() < 1e-6);
    let glass = material("Kd 0.01 0.01 0.01\nKs 0.3 0.3 0.3\nTf 0.1 0.1 0.1\nNs 200\nNi 2.5\nillum 7\n");
    assert_eq!((glass.transmission, glass.roughness, glass.ior), (1.0, 0.0, 2.5));
    assert!(glass.thickness > 0.0, "a solid, which bends light");
    assert_eq!(glass.base_color, Vec4::ONE, "Tf has no hue");
    let green = material("Tf 0.25 1 0.25\nillum 6\n").base_color;
    assert_eq!(green, Vec4::new(0.5, 1.0, 0.5, 1.0), "by two surfaces: 0.25");
    let pane = material("Kd 0.2 0.4 0.6\nd 0.25\nillum 4\n");
    assert_eq!((pane.transmission, pane.thickness), (0.75, 0.0));
    assert_eq!(pane.base_color, Vec4::new(0.2, 0.4, 0.6, 1.0));
}

#[test]
fn opacity_is_d_and_else_what_tr_leaves() {
    for (text, alpha) in [("d 0.25", 0.25), ("Tr 0.25", 0.75), ("d 0.25\nTr 0.25", 0.25), ("d -halo 0.5", 0.5)] {
        let m = material(text);
        assert_eq!((m.base_color.w, m.alpha_mode), (alpha, AlphaMode::Blend), "{text}");
    }
    assert_eq!(material("d 1.0\nTr 0.0").alpha_mode, AlphaMode::Opaque);
}

#[test]
fn physical_keywords_win() {
    let m = material("Kd 0.5 0.5 0.5\nPr 0.25\nPm 0.75\nNs 10\nillum 3\n");
    assert_eq!((m.roughness, m.metallic, m.specular), (0.25, 0.75, 1.0));
}

#[test]
fn textures_are_placed_as_their_options_say() {
    let mtl = "newmtl a\nKd 0 0 0\nmap_Kd -s 2 3 -o 0.5 0.25 -clamp on Wood one.png\nmap_Ke wood ONE.png\n";
    let (imported, m) = with_library(mtl, &[("Wood one.png", [10, 20, 30, 255])]);
    assert_eq!(warnings(&imported), [""; 0]);
    assert_eq!(imported.scene.images.len(), 1, "one file is one image");
    let t = m[0].base_color_texture.as_ref().expect("the texture");
    assert_eq!(m[0].base_color.truncate(), Vec3::ONE, "black beside a texture means white");
    assert_eq!(m[0].emissive, Vec3::ONE);
    assert_eq!((t.wrap_u, t.wrap_v), (Wrap::Clamp, Wrap::Clamp));
    // The lower left corner (0, 0) of OBJ looks up (0.5, 0.25) from the lower left.
    assert_eq!(t.transform.transform_point2(Vec2::new(0.0, 1.0)), Vec2::new(0.5, 0.75));
}

#[test]
fn bump_maps_are_heights_or_normals() {
    let images = [("grey.png", [90, 90, 90, 255]), ("blue.png", [128, 127, 255, 255])];
    let mtl = "newmtl a\nbump -bm 2 grey.png\nnewmtl b\nmap_bump -bm 0.5 blue.png\nnewmtl c\nnorm blue.png\n";
    let (imported, m) = with_library(mtl, &images);
    assert_eq!(warnings(&imported), [""; 0]);
    assert!(m[0].bump_texture.is_some() && m[0].normal_texture.is_none());
    assert!((m[0].bump_scale - 0.02).abs() < 1e-6);
    assert!(m[1].bump_texture.is_none() && m[1].normal_texture.is_some());
    assert_eq!(m[1].normal_scale, 0.5);
    assert!(m[2].normal_texture.is_some());
}

#[test]
fn opacity_maps_are_alpha_or_luminance() {
    let images = [("cut.png", [9, 9, 9, 100]), ("grey.png", [90, 90, 90, 255])];
    let mtl = "newmtl a\nmap_d cut.png\nnewmtl b\nmap_d grey.png\nnewmtl c\nmap_Kd cut.png\nmap_d cut.png\n";
    let (_, m) = with_library(mtl, &images);
    let channel = |i: usize| m[i].opacity_texture.as_ref().map(|t| t.channel);
    assert_eq!((channel(0), channel(1)), (Some(Channel::Alpha), Some(Channel::Luminance)));
    assert_eq!(channel(2), None, "the alpha of the colour image counts once");
    assert!(m.iter().all(|m| m.alpha_mode == AlphaMode::Blend));
}

#[test]
fn glass_keeps_its_textures() {
    let images = [("cut.png", [9, 9, 9, 100]), ("grey.png", [90, 90, 90, 255])];
    for illum in [4, 9] {
        let (_, m) = with_library(&format!("newmtl a\nillum {illum}\nmap_d cut.png\nmap_Pr grey.png\nPm 1\n"), &images);
        assert_eq!((m[0].alpha_mode, m[0].transmission), (AlphaMode::Blend, 0.0), "a leaf, {illum}");
        assert!(m[0].opacity_texture.is_some() && m[0].roughness_texture.is_some());
        assert_eq!(m[0].metallic, 1.0);
        let (_, m) = with_library(&format!("newmtl a\nillum {illum}\nmap_Pr grey.png\nmap_Pm grey.png\n"), &images);
        assert_eq!((m[0].alpha_mode, m[0].transmission), (AlphaMode::Opaque, 1.0), "a pane, {illum}");
        assert!(m[0].roughness_texture.is_some() && m[0].metallic_texture.is_some());
    }
    for illum in [6, 7] {
        let (_, m) =
            with_library(&format!("newmtl a\nillum {illum}\nmap_d cut.png\nmap_Pr grey.png\nPm 0.5\n"), &images);
        assert_eq!((m[0].transmission, m[0].metallic, m[0].roughness), (1.0, 0.5, 1.0));
        assert!(m[0].opacity_texture.is_some() && m[0].roughness_texture.is_some());
    }
    let (_, m) = with_library("newmtl a\nillum 3\nmap_Pr grey.png\nnewmtl b\nillum 3\nmap_Pm grey.png\n", &images);
    assert!(m[0].roughness_texture.is_some() && m[1].metallic_texture.is_some(), "mirrors as well");
}

#[test]
fn what_is_not_rendered_is_said_once_a_material() {
    let mtl = "newmtl a\nmap_Tr a.png\nmap_aniso a.png\ndisp a.png\n";
    let (imported, _) = with_library(mtl, &[]);
    let warnings = warnings(&imported);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].ends_with("material 'a': map_aniso, map_Tr, disp not rendered"), "{warnings:?}");
}

#[test]
fn coat_sheen_and_brushing_are_layers() {
    let m = material("Pc 0.5\nPcr 0.25\nPs 0.75\naniso 0.5\nanisor 0.25\n");
    let coat = m.clearcoat.expect("a coat");
    assert_eq!((coat.factor, coat.roughness), (0.5, 0.25));
    assert_eq!(m.sheen.expect("sheen").color, Vec3::splat(0.75));
    let brushed = m.anisotropy.expect("anisotropy");
    assert_eq!((brushed.strength, brushed.rotation), (0.5, std::f32::consts::FRAC_PI_2));
    let plain = material("Pc 0\nPcr 0.5\naniso 0\n");
    assert!(plain.clearcoat.is_none() && plain.sheen.is_none() && plain.anisotropy.is_none());
    let (_, m) = with_library("newmtl a\nmap_Pc grey.png\nmap_Pcr grey.png\n", &[("grey.png", [128, 128, 128, 255])]);
    let coat = m[0].clearcoat.as_ref().expect("a coat");
    assert_eq!((coat.factor, coat.roughness), (1.0, 1.0), "the textures alone");
    assert!(coat.texture.is_some() && coat.roughness_texture.is_some());
}

#[test]
fn a_map_of_shininess_becomes_one_of_roughness() {
    let (imported, m) =
        with_library("newmtl a\nKs 1 1 1\nNs 100\nmap_Ns half.png\n", &[("half.png", [51, 51, 51, 255])]);
    let t = m[0].roughness_texture.as_ref().expect("a texture");
    let crate::scene::Pixels::Rgba8(pixels) = &imported.scene.images[t.image].pixels else { panic!("bytes") };
    // A fifth of 100: (2 / (20 + 2))^(1/4) = 0.5491, to a byte.
    assert_eq!(pixels[0][0], 140);
    assert_eq!(m[0].roughness, 1.0);
}

#[test]
fn paths_of_other_machines_are_found_by_their_bare_name() {
    let mtl = "newmtl a\nmap_Kd C:\\Users\\me\\My Models\\Wood.PNG\nmap_Ks /home/me/none.png\n";
    let (imported, m) = with_library(mtl, &[("wood.png", [1, 2, 3, 255])]);
    assert!(m[0].base_color_texture.is_some());
    let w = warnings(&imported);
    assert_eq!(w.len(), 2, "{w:?}");
    assert!(w[0].contains("map_Kd: 'C:\\Users\\me\\My Models\\Wood.PNG' taken from"), "{w:?}");
    assert!(w[1].contains("refused to read '/home/me/none.png'"), "{w:?}");
}

#[test]
fn a_texture_that_cannot_be_read_is_left_out() {
    let dir = tempfile::tempdir().expect("temporary folder");
    std::fs::write(dir.path().join("bad.png"), "no PNG").expect("file");
    std::fs::write(dir.path().join("m.mtl"), "newmtl a\nKd 0 0 0\nmap_Kd bad.png\n").expect("file");
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let imported = read_bytes(obj.into(), dir.path().join("m.obj"), &Options::default()).expect("readable");
    let w = warnings(&imported);
    assert!(w.len() == 1 && w[0].contains("bad.png") && w[0].contains("shown without"), "{w:?}");
    let MaterialModel::Pbr(pbr) = &imported.scene.materials[0].model else { panic!("physical") };
    assert!(pbr.base_color_texture.is_none());
    assert!(pbr.base_color.x > 0.5, "not black");
}

// Hostile input.

/// What a scene promises of its meshes.
fn check(imported: &Imported) {
    for g in &imported.scene.meshes[0].geometries {
        let SurfaceDesc::Triangles(m) = &g.surface else { continue };
        let n = m.positions.len();
        assert!(m.triangles.iter().flatten().all(|&i| (i as usize) < n));
        assert!(m.positions.iter().all(|p| p.is_finite()));
        assert!(m.normals.iter().all(|n| n.is_normalized()));
        assert!(m.uvs.iter().flatten().all(|uv| uv.is_finite()));
        assert!([0, n].contains(&m.normals.len()) && m.uvs.iter().all(|u| u.len() == n));
        assert!(g.material.is_some_and(|i| i < imported.scene.materials.len()));
    }
}

/// Lines that are nearly OBJ.
fn statements() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        (-3..4_i32).prop_map(|x| x.to_string()),
        any::<f32>().prop_map(|x| x.to_string()),
        Just("1e39".to_owned()),
        Just("nan".to_owned()),
    ];
    let index = prop_oneof![
        (-9..12_i64).prop_map(|x| x.to_string()),
        Just(String::new()),
        any::<i64>().prop_map(|x| x.to_string())
    ];
    let corner = proptest::collection::vec(index, 1..4).prop_map(|c| c.join("/"));
    let line = prop_oneof![
        4 => proptest::collection::vec(number.clone(), 3..7).prop_map(|n| format!("v {}", n.join(" "))),
        1 => proptest::collection::vec(number.clone(), 1..4).prop_map(|n| format!("vt {}", n.join(" "))),
        1 => proptest::collection::vec(number, 3..4).prop_map(|n| format!("vn {}", n.join(" "))),
        1 => proptest::collection::vec(corner, 1..9).prop_map(|c| format!("f {}", c.join(" "))),
        4 => proptest::collection::vec(1..5_u32, 3..9).prop_map(|c| {
            format!("f {}", c.iter().map(u32::to_string).collect::<Vec<_>>().join(" "))
        }),
        1 => Just("s 1".to_owned()),
        1 => Just("usemtl a\\".to_owned()),
        1 => Just("g".to_owned()),
    ];
    proptest::collection::vec(line, 0..40).prop_map(|l| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n{}", l.join("\n")))
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        if let Ok(imported) = read_bytes(bytes, Path::new("nowhere/any.obj"), &Options::default()) {
            check(&imported);
        }
    }

    #[test]
    fn anything_like_obj_is_read_or_refused(text in statements()) {
        if let Ok(imported) = read_text(&text) {
            check(&imported);
        }
    }

    #[test]
    fn any_library_is_read_with_warnings(lines in proptest::collection::vec("(newmtl|K[adse]|Tf|N[si]|d|Tr|illum|map_K[ds]|bump|norm|P[rm])( -(s|o|bm|mm|clamp|imfchan))?( [-0-9.a-z]{1,5}){0,4}", 0..20)) {
        let (_, materials) = with_library(&format!("newmtl a\n{}", lines.join("\n")), &[]);
        for m in materials {
            prop_assert!((0.0..=1.0).contains(&m.roughness) && (0.0..=1.0).contains(&m.metallic));
            prop_assert!(m.base_color.cmpge(Vec4::ZERO).all() && m.base_color.cmple(Vec4::ONE).all());
            prop_assert!(m.emissive.is_finite() && m.emissive.cmpge(Vec3::ZERO).all());
            prop_assert!((0.0..=1.0).contains(&m.transmission) && m.ior >= 1.0);
        }
    }
}
