//! Small files that ask for much: they are read or refused in little memory and time.

use std::io::Write;

use firsthit_checks::files::{Counting, promise};

#[global_allocator]
static COUNTING: Counting = Counting;

/// A black PNG image, one bit for a pixel.
fn png(side: u32) -> Vec<u8> {
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    let row = vec![0; 1 + side as usize / 8];
    (0..side).for_each(|_| packed.write_all(&row).expect("in memory"));
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        out.extend((data.len() as u32).to_be_bytes());
        let mut sum = flate2::Crc::new();
        for part in [&kind[..], data] {
            sum.update(part);
            out.extend_from_slice(part);
        }
        out.extend(sum.sum().to_be_bytes());
    };
    let mut header = [side.to_be_bytes(), side.to_be_bytes()].concat();
    header.extend([1, 0, 0, 0, 0]);
    chunk(b"IHDR", &header);
    chunk(b"IDAT", &packed.finish().expect("in memory"));
    chunk(b"IEND", &[]);
    out
}

/// A glTF file of these members, with a buffer of 36 bytes that are the corners of a triangle.
fn gltf(members: &str) -> Vec<u8> {
    let triangle =
        r#""buffers": [{"byteLength": 36, "uri": "m.bin"}], "bufferViews": [{"buffer": 0, "byteLength": 36}]"#;
    format!(r#"{{"asset": {{"version": "2.0"}}, {triangle}, {members}}}"#).into_bytes()
}

fn corners() -> Vec<u8> {
    [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).as_flattened().to_vec()
}

const POSITIONS: &str = r#"{"bufferView": 0, "type": "VEC3", "componentType": 5126, "count": 3}"#;

/// The same, again and again.
fn many(count: usize, part: &str) -> String {
    vec![part; count].join(",")
}

/// Whether a glTF file of these members is read.
fn is_read(members: &str) -> bool {
    promise(&[("m.gltf", &gltf(members)), ("m.bin", &corners())]).is_some()
}

#[test]
fn images_grow_with_their_files() {
    let wide = png(16384);
    let material = r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "normalTexture": {"index": 1}}"#;
    let members = format!(
        r#""accessors": [{POSITIONS}], "images": [{{"uri": "b.png"}}, {{"uri": "./b.png"}}],
        "textures": [{{"source": 0}}, {{"source": 1}}], "materials": [{material}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}]"#
    );
    let model = promise(&[("m.gltf", &gltf(&members)), ("m.bin", &corners()), ("b.png", &wide)]);
    assert!(model.is_none());
    assert!(promise(&[("m.toml", b"env = { type = 'latlong', file = 'b.png' }"), ("b.png", &wide)]).is_none());
    // The largest that so small a file may have.
    let most = png(5792);
    assert!(promise(&[("m.toml", b"env = { type = 'latlong', file = 'b.png' }"), ("b.png", &most)]).is_some());
}

#[test]
fn zeros_and_instances_that_no_byte_stands_for_are_limited() {
    let zeros = |count: u32| format!(r#"{{"type": "VEC3", "componentType": 5126, "count": {count}}}"#);
    let mesh = r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0}}]}]"#;
    let shown = |count| is_read(&format!(r#""accessors": [{}], "nodes": [{{"mesh": 0}}], {mesh}"#, zeros(count)));
    assert!(shown(1_000_000) && !shown(16_000_000));
    let placed = |count| {
        let list = r#"{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}}}"#;
        is_read(&format!(r#""accessors": [{POSITIONS}, {}], "nodes": [{list}], {mesh}"#, zeros(count)))
    };
    assert!(placed(200_000) && !placed(4_000_000));
}

#[test]
fn lists_of_nothing_are_limited() {
    for (list, count, read) in [
        ("nodes", 200_000, true),
        ("nodes", 1_000_000, false),
        ("materials", 20_000, true),
        ("materials", 200_000, false),
        ("scenes", 1_000_000, false),
    ] {
        assert_eq!(is_read(&format!(r#""{list}": [{}]"#, many(count, "{}"))), read, "{count} {list}");
    }
    let primitives = many(100_000, r#"{"attributes":{"POSITION":0}}"#);
    is_read(&format!(r#""accessors": [{POSITIONS}], "meshes": [{{"primitives": [{primitives}]}}]"#));
}

#[test]
fn a_file_that_many_buffers_name_is_counted_each_time() {
    let data = vec![1; 1_200_000];
    let buffers = many(5_000, r#"{"byteLength":1,"uri":"m.bin"}"#);
    let json = format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{buffers}]}}"#);
    assert!(promise(&[("m.gltf", json.as_bytes()), ("m.bin", &data)]).is_none());
}

/// Seven files, each of which places the next ten times.
#[test]
fn files_that_include_each_other_make_no_millions() {
    let names: Vec<String> = (0..7).map(|k| format!("l{k}.toml")).collect();
    let ten = |file| format!("objects = [{}]", many(10, &format!("{{ shape = 'model', file = '{file}' }}")));
    let mut texts: Vec<String> = names[1..].iter().map(ten).collect();
    texts.push("objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1 }]".into());
    let files: Vec<(&str, &[u8])> = names.iter().zip(&texts).map(|(n, t)| (n.as_str(), t.as_bytes())).collect();
    assert!(promise(&files).is_none());
    assert!(promise(&files[2..]).is_some());
}

#[test]
fn names_are_not_compared_each_with_each() {
    let names: Vec<String> = (0..100_000).map(|k| format!(r#""{k}""#)).collect();
    assert!(is_read(&format!(r#""extensionsUsed": [{}]"#, names.join(","))));
}

#[test]
fn hierarchies_may_be_deep_or_wrong() {
    let chain = |depth: usize| {
        let nodes: Vec<String> = (1..depth).map(|k| format!(r#"{{"children":[{k}]}}"#)).collect();
        format!(r#""nodes": [{},{{}}]"#, nodes.join(","))
    };
    assert!(is_read(&chain(4000)));
    assert!(!is_read(&chain(100_000)));
    assert!(!is_read(r#""nodes": [{"children": [1]}, {"children": [0]}]"#), "a ring");
    assert!(!is_read(r#""nodes": [{"children": [0]}]"#), "its own child");
    assert!(!is_read(r#""nodes": [{"children": [1, 2]}, {"children": [2]}, {}]"#), "two parents");
    let skinned = |skin: &str| {
        format!(
            r#""accessors": [{POSITIONS}], "nodes": [{{"mesh": 0, "skin": 0}}], "skins": [{skin}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}]"#
        )
    };
    assert!(is_read(&skinned(r#"{"joints": [0], "skeleton": 0}"#)), "a joint that shows what it moves");
    assert!(!is_read(&skinned(r#"{"joints": [1]}"#)), "no such joint");
}
