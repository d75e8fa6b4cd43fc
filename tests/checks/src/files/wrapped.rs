//! Streams and images inside a `.glb` file that has nothing else in it.

use super::promise::promise;
use super::rest::Rest;

/// A `.glb` file of a JSON text and a binary chunk.
pub(super) fn container(json: &str, bin: &[u8]) -> Vec<u8> {
    let pad = |length: usize| length.next_multiple_of(4);
    let whole = 12 + 8 + pad(json.len()) + 8 + pad(bin.len());
    let mut out = Vec::with_capacity(whole);
    let mut chunk = |header: &[u8], length: usize, bytes: &[u8], filling: u8| {
        out.extend_from_slice(header);
        out.extend((pad(length) as u32).to_le_bytes());
        out.extend_from_slice(if filling == 0 { b"BIN\0" } else { b"JSON" });
        out.extend_from_slice(bytes);
        out.resize(out.len().next_multiple_of(4), filling);
    };
    let mut header = b"glTF\x02\0\0\0".to_vec();
    header.extend((whole as u32).to_le_bytes());
    chunk(&header, json.len(), json.as_bytes(), b' ');
    chunk(&[], bin.len(), bin, 0);
    out
}

/// The names of the attributes of a Draco stream here, their types and components; each has the number of its place.
const ATTRIBUTES: [(&str, &str, u32); 6] = [
    ("POSITION", "VEC3", 5126),
    ("NORMAL", "VEC3", 5126),
    ("TEXCOORD_0", "VEC2", 5126),
    ("COLOR_0", "VEC4", 5121),
    ("JOINTS_0", "VEC4", 5123),
    ("WEIGHTS_0", "VEC4", 5126),
];

/// A Draco stream. Before it: which of the [`ATTRIBUTES`] it has (a bit each; bit 6: a strip), their numbers in the
/// stream (a nibble each), and the number of vertices and of corners.
pub fn draco(data: &[u8]) -> bool {
    let mut bytes = Rest(data);
    let which = bytes.byte();
    let ids = [bytes.byte(), bytes.byte(), bytes.byte()];
    let (vertices, corners) = (bytes.word(), bytes.word());
    let data = bytes.0;
    let mut accessors = format!(r#"{{"type": "SCALAR", "componentType": 5125, "count": {corners}}}"#);
    let (mut plain, mut packed) = (String::new(), String::new());
    let mut number = 0;
    for (k, (name, kind, component)) in ATTRIBUTES.into_iter().enumerate() {
        if which >> k & 1 == 1 {
            let comma = if number > 0 { ", " } else { "" };
            number += 1;
            let id = ids[k / 2] >> (k % 2 * 4) & 15;
            plain += &format!(r#"{comma}"{name}": {number}"#);
            packed += &format!(r#"{comma}"{name}": {id}"#);
            accessors += &format!(r#", {{"type": "{kind}", "componentType": {component}, "count": {vertices}}}"#);
        }
    }
    let mode = if which >> 6 & 1 == 1 { 5 } else { 4 };
    let length = data.len();
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_draco_mesh_compression"],
        "buffers": [{{"byteLength": {length}}}], "bufferViews": [{{"buffer": 0, "byteLength": {length}}}],
        "accessors": [{accessors}], "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"mode": {mode},
        "attributes": {{{plain}}}, "indices": 0, "extensions": {{"KHR_draco_mesh_compression":
        {{"bufferView": 0, "attributes": {{{packed}}}}}}}}}]}}]}}"#
    );
    promise(&[("m.glb", &container(&json, data))]).is_some()
}

/// A meshopt stream. Before it: mode and filter, the stride in bytes, and the number of elements. They are positions,
/// or indices of the 24 vertices that stand beside.
pub fn meshopt(data: &[u8]) -> bool {
    let mut bytes = Rest(data);
    let kind = usize::from(bytes.byte());
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][kind % 3];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][kind / 3 % 5];
    let (stride, count) = (u32::from(bytes.byte()), u32::from(bytes.word()));
    let data = bytes.0;
    let (length, start) = (data.len(), data.len().next_multiple_of(4));
    let mut bin = data.to_vec();
    bin.resize(start, 0);
    for k in 0..24_u8 {
        bin.extend([k % 3, k % 5, k % 7].map(|x| f32::from(x).to_le_bytes()).as_flattened());
    }
    // The accessor of the elements, and a primitive of them.
    let (accessor, primitive) = match (mode, stride) {
        ("ATTRIBUTES", 12..) => (r#""type": "VEC3", "componentType": 5126"#, r#"{"attributes": {"POSITION": 0}}"#),
        // Too narrow for positions: only unpacked.
        ("ATTRIBUTES", _) => (r#""type": "SCALAR", "componentType": 5121"#, r#"{"attributes": {"POSITION": 1}}"#),
        (_, 2) => (r#""type": "SCALAR", "componentType": 5123"#, r#"{"attributes": {"POSITION": 1}, "indices": 0}"#),
        _ => (r#""type": "SCALAR", "componentType": 5125"#, r#"{"attributes": {"POSITION": 1}, "indices": 0}"#),
    };
    // Strides of a view are for vertices, and at least 4.
    let says = if mode == "ATTRIBUTES" && stride >= 4 { format!(r#", "byteStride": {stride}"#) } else { String::new() };
    let all = stride * count;
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["EXT_meshopt_compression"],
        "buffers": [{{"byteLength": {}}}, {{"byteLength": {all}, "extensions": {{"EXT_meshopt_compression":
        {{"fallback": true}}}}}}],
        "bufferViews": [{{"buffer": 1, "byteLength": {all}{says}, "extensions": {{"EXT_meshopt_compression":
        {{"buffer": 0, "byteLength": {length}, "byteStride": {stride}, "count": {count}, "mode": "{mode}",
        "filter": "{filter}"}}}}}}, {{"buffer": 0, "byteOffset": {start}, "byteLength": 288}}],
        "accessors": [{{"bufferView": 0, {accessor}, "count": {count}}},
        {{"bufferView": 1, "type": "VEC3", "componentType": 5126, "count": 24}}],
        "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{primitive}]}}]}}"#,
        bin.len()
    );
    promise(&[("m.glb", &container(&json, &bin))]).is_some()
}

/// An image of any kind, as the texture of a triangle; whether it is shown.
pub fn image(data: &[u8]) -> bool {
    let (length, start) = (data.len(), data.len().next_multiple_of(4));
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let mut bin = data.to_vec();
    bin.resize(start, 0);
    bin.extend(corners.as_flattened());
    let ktx2 = data.starts_with(b"\xabKTX");
    let kind = if ktx2 { "image/ktx2" } else { "image/png" };
    let texture = if ktx2 { r#""extensions": {"KHR_texture_basisu": {"source": 0}}"# } else { r#""source": 0"# };
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_texture_basisu"],
        "buffers": [{{"byteLength": {}}}], "bufferViews": [{{"buffer": 0, "byteLength": {length}}},
        {{"buffer": 0, "byteOffset": {start}, "byteLength": 36}}],
        "accessors": [{{"bufferView": 1, "type": "VEC3", "componentType": 5126, "count": 3}},
        {{"bufferView": 1, "type": "VEC2", "componentType": 5126, "count": 3}}],
        "images": [{{"bufferView": 0, "mimeType": "{kind}"}}], "textures": [{{{texture}}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "material": 0}}]}}]}}"#,
        bin.len()
    );
    promise(&[("m.glb", &container(&json, &bin))]).is_some_and(|i| i.report.warnings.is_empty())
}
