//! A small glTF whose accessors come from the bytes: the JSON is always well-formed, its numbers are not.

use super::promise::promise;
use super::rest::Rest;
use super::wrapped::container;

const TYPES: [&str; 7] = ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"];
const COMPONENTS: [u32; 6] = [5120, 5121, 5122, 5123, 5125, 5126];
/// The attributes, and what their accessors should be.
const ATTRIBUTES: [(&str, usize, usize); 9] = [
    ("POSITION", 2, 5),
    ("NORMAL", 2, 5),
    ("TANGENT", 3, 5),
    ("TEXCOORD_0", 1, 5),
    ("TEXCOORD_1", 1, 3),
    ("COLOR_0", 3, 1),
    ("JOINTS_0", 3, 1),
    ("WEIGHTS_0", 3, 5),
    ("_OTHER", 0, 5),
];

/// A number as one would find it in a file, or one that is too large for it.
fn number(bytes: &mut Rest<'_>, usual: u64) -> u64 {
    match bytes.byte() {
        0..=199 => usual,
        200..=239 => u64::from(bytes.byte()),
        240..=247 => u64::from(bytes.byte()) << bytes.below(56),
        248..=250 => u64::MAX - u64::from(bytes.byte()),
        _ => usual.wrapping_add(bytes.byte() as i8 as u64),
    }
}

/// One that is meant, or any.
fn choice(bytes: &mut Rest<'_>, usual: usize, all: usize) -> usize {
    if bytes.byte() < 230 { usual } else { bytes.below(all) }
}

/// `"key": number`, which may be left out.
fn optional(bytes: &mut Rest<'_>, key: &str, usual: u64) -> String {
    if bytes.byte() < 160 { String::new() } else { format!(r#", "{key}": {}"#, number(bytes, usual)) }
}

/// Buffer views, accessors with and without sparse parts, a mesh with morph targets and a skin that use them, nodes
/// with instances of it; the rest of the bytes is the buffer.
pub fn accessors(data: &[u8]) -> bool {
    let mut bytes = Rest(data);
    let count = u64::from(bytes.byte() % 24);
    let corners = u64::from(bytes.byte() % 48);
    let views = 1 + bytes.below(6);
    // All of the bytes are the buffer.
    let holder = data.len() as u64;
    let mut json_views = String::new();
    for k in 0..views {
        let comma = if k > 0 { ", " } else { "" };
        let offset = optional(&mut bytes, "byteOffset", 4 * k as u64);
        let length = number(&mut bytes, holder);
        let stride = optional(&mut bytes, "byteStride", 16);
        let buffer = choice(&mut bytes, 0, 3);
        json_views += &format!(r#"{comma}{{"buffer": {buffer}, "byteLength": {length}{offset}{stride}}}"#);
    }
    let mut accessors = String::new();
    let mut accessor = |bytes: &mut Rest<'_>, kind: usize, component: usize, count: u64| {
        let comma = if accessors.is_empty() { "" } else { ", " };
        let kind = TYPES[choice(bytes, kind, TYPES.len())];
        let component = COMPONENTS[choice(bytes, component, COMPONENTS.len())];
        let count = number(bytes, count);
        let view =
            if bytes.byte() < 220 { format!(r#", "bufferView": {}"#, bytes.below(views)) } else { String::new() };
        let offset = optional(bytes, "byteOffset", 4);
        let normalized = if bytes.byte() < 200 { "" } else { r#", "normalized": true"# };
        let sparse = if bytes.byte() < 200 {
            String::new()
        } else {
            let (some, index) = (number(bytes, 1), COMPONENTS[choice(bytes, 1, COMPONENTS.len())]);
            let (a, b) = (bytes.below(views), bytes.below(views));
            let (from, to) = (optional(bytes, "byteOffset", 2), optional(bytes, "byteOffset", 8));
            format!(
                r#", "sparse": {{"count": {some}, "indices": {{"bufferView": {a}, "componentType": {index}{from}}},
                "values": {{"bufferView": {b}{to}}}}}"#
            )
        };
        accessors += &format!(
            r#"{comma}{{"type": "{kind}", "componentType": {component}, "count": {count}{view}{offset}{normalized}{sparse}}}"#
        );
    };
    let mut attributes = String::new();
    for (k, (name, kind, component)) in ATTRIBUTES.into_iter().enumerate() {
        accessor(&mut bytes, kind, component, count);
        if k == 0 || bytes.flag() {
            let comma = if k > 0 { ", " } else { "" };
            attributes += &format!(r#"{comma}"{name}": {k}"#);
        }
    }
    // 9: indices, 10: a morph target, 11: matrices of the skin, 12 and 13: an animation, 14: instances.
    let index_type = [1, 3, 4][bytes.below(3)];
    let joints = u64::from(bytes.byte() % 4);
    accessor(&mut bytes, 0, index_type, corners);
    accessor(&mut bytes, 2, 5, count);
    accessor(&mut bytes, 6, 5, joints);
    accessor(&mut bytes, 0, 5, 2);
    accessor(&mut bytes, 2, 5, 2);
    accessor(&mut bytes, 2, 5, count);
    let mode = number(&mut bytes, 4) % 8;
    let indices = if bytes.flag() { r#", "indices": 9"# } else { "" };
    let targets = if bytes.flag() { r#", "targets": [{"POSITION": 10, "NORMAL": 10, "TEXCOORD_0": 3}]"# } else { "" };
    let skin = if bytes.flag() { r#", "skin": 0"# } else { "" };
    let instancing = r#", "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 14}}}"#;
    let instancing = if bytes.flag() { instancing } else { "" };
    let quantized = if bytes.flag() { r#""KHR_mesh_quantization""# } else { "" };
    let joint = ["1", "1, 2", "0", "1, 1, 1"][bytes.below(4)];
    let texture = if bytes.flag() { r#", "normalTexture": {"index": 0}"# } else { "" };
    let path = ["translation", "rotation", "scale", "weights"][choice(&mut bytes, 0, 4)];
    let length = number(&mut bytes, holder);
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": [{quantized}],
        "buffers": [{{"byteLength": {length}}}], "bufferViews": [{json_views}], "accessors": [{accessors}],
        "images": [{{"uri": "a.png"}}], "textures": [{{"source": 0}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0, "texCoord": 1}}}}{texture}}}],
        "meshes": [{{"primitives": [{{"attributes": {{{attributes}}}, "material": 0, "mode": {mode}{indices}{targets}}}],
        "weights": [0.5]}}], "skins": [{{"joints": [{joint}], "inverseBindMatrices": 11}}],
        "nodes": [{{"mesh": 0{skin}{instancing}}}, {{"children": [2], "scale": [2, 1, 1]}}, {{}}],
        "animations": [{{"channels": [{{"sampler": 0, "target": {{"node": 1, "path": "{path}"}}}}],
        "samplers": [{{"input": 12, "output": 13}}]}}]}}"#
    );
    promise(&[("m.glb", &container(&json, data))]).is_some()
}
