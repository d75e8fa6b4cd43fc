//! The JSON part: parsing with places, the version, and references between elements.

use std::fmt;
use std::path::Path;

use gltf::json::{Index, Root};
use serde_json::Value;

use super::typed;
pub(super) use super::typed::typed;
use crate::{ErrorKind, ImportError, Limits};

/// A file's JSON.
#[derive(Debug)]
pub(crate) struct Document {
    /// The typed model, without animations: in one that is not played nothing can be wrong.
    pub(super) root: Root,
    /// The tree of values, which keeps numbers in f64.
    pub(super) value: Value,
    /// The animations, which are not in the tree.
    pub(super) animations: Vec<Value>,
}

/// Reads the JSON text.
///
/// # Errors
/// If it is no JSON, no glTF 2, or a value has the wrong type.
pub(super) fn parse(file: &Path, text: &[u8], limits: &Limits) -> Result<Document, ImportError> {
    // Some editors put a byte order mark in front, which JSON readers may pass over (RFC 8259). Some exporters fill
    // the chunk of a GLB up with zeros.
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let end = text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    let mut value = typed::parse(file, &text[..end])?;
    check_version(file, &value)?;
    check_counts(file, &value, limits.made_of(text.len() as u64))?;
    let mut animations = match value.get_mut("animations").map(Value::take) {
        Some(Value::Array(animations)) => animations,
        _ => Vec::new(),
    };
    animations.iter_mut().for_each(whole_numbers);
    if let Some(object) = value.as_object_mut() {
        object.remove("animations");
    }
    // The model wants this list, though the format lets it be left out.
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    whole_numbers(&mut value);
    typed::check_objects(file, &value)?;
    let root = typed(file, "", &value)?;
    Ok(Document { root, value, animations })
}

/// Makes integers of floats that are whole: `1.0` is an integer to the format, but not to the model. The tree is at
/// most 128 deep, which is the JSON parser's own limit.
fn whole_numbers(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(whole_numbers),
        Value::Object(values) => values.values_mut().for_each(whole_numbers),
        Value::Number(number) if number.is_f64() => {
            let x = number.as_f64().unwrap_or(0.5);
            // To 2^53, f64 holds every integer.
            if x.fract() == 0.0 && (0.0..=9_007_199_254_740_992.0).contains(&x) {
                *number = (x as u64).into();
            }
        }
        _ => {}
    }
}

/// About how many bytes of memory an element takes, in all that is made of it. Some are only `{}` in the file.
const COSTS: [(&str, u64); 4] = [("materials", 3400), ("meshes", 1000), ("nodes", 500), ("scenes", 900)];
/// That of a primitive of a mesh.
const COST_OF_PRIMITIVE: u64 = 2600;

/// Counts what takes more memory than its text lets expect.
fn check_counts(file: &Path, value: &Value, most: u64) -> Result<(), ImportError> {
    let list = |value: &'_ Value, key: &str| value.get(key).and_then(Value::as_array).map_or(0, Vec::len) as u64;
    let meshes = value.get("meshes").and_then(Value::as_array);
    let primitives: u64 = meshes.into_iter().flatten().map(|mesh| list(mesh, "primitives")).sum();
    let counted = COSTS.map(|(key, cost)| (key, list(value, key), cost)).into_iter();
    let mut bytes = 0_u64;
    for (key, count, cost) in counted.chain([("meshes", primitives, COST_OF_PRIMITIVE)]) {
        bytes += count * cost;
        if bytes > most {
            let cause = format!("{count} of them would take more memory than the limit of {most} bytes");
            return Err(ImportError::new(file, format!("/{key}"), ErrorKind::Limit(cause)));
        }
    }
    Ok(())
}

fn check_version(file: &Path, value: &Value) -> Result<(), ImportError> {
    let invalid = |place: &str, cause: String| Err(ImportError::invalid(file, place, cause));
    if !value.is_object() {
        return invalid("", format!("not glTF: the JSON is {}, expected an object", kind(value)));
    }
    let Some(asset) = value.get("asset") else {
        return invalid(
            "/asset",
            "is missing; expected an object with glTF's version, as {\"version\": \"2.0\"}".into(),
        );
    };
    let version = match asset.get("version") {
        Some(Value::String(version)) => version,
        // glTF 1.0 files may say it as a number or leave it out.
        None if value.get("accessors").is_some_and(Value::is_object) => return Err(too_old(file, "1.0")),
        Some(Value::Number(number)) if number.as_f64() == Some(1.0) => return Err(too_old(file, "1.0")),
        Some(other) => return invalid("/asset/version", format!("is {}, expected text like \"2.0\"", kind(other))),
        None => return invalid("/asset/version", "is missing; expected text like \"2.0\"".into()),
    };
    match numbers(version) {
        Some((2, _)) => {}
        Some((0 | 1, _)) => return Err(too_old(file, version)),
        Some(_) => {
            let cause = format!("glTF {version} is not supported, only glTF 2");
            return Err(ImportError::unsupported(file, "/asset/version", cause));
        }
        None => return invalid("/asset/version", format!("'{version}' is no version like \"2.0\"")),
    }
    // Nothing above 2.0 is known; a later 2.x that needs no more than 2.0 says so by leaving this out.
    match asset.get("minVersion").and_then(Value::as_str) {
        Some(least) if numbers(least).is_none_or(|v| v > (2, 0)) => {
            let cause = format!("the file needs a reader of glTF {least}; this one reads 2.0");
            Err(ImportError::unsupported(file, "/asset/minVersion", cause))
        }
        _ => Ok(()),
    }
}

/// What a value is, and its number or text if that is short.
fn kind(value: &Value) -> String {
    match value {
        Value::Null => "null".into(),
        Value::Bool(_) | Value::Number(_) => value.to_string(),
        Value::String(text) if text.len() <= 32 => value.to_string(),
        Value::String(_) => "a text".into(),
        Value::Array(_) => "an array".into(),
        Value::Object(_) => "an object".into(),
    }
}

/// The error for glTF 1.0.
pub(super) fn too_old(file: &Path, version: &str) -> ImportError {
    let cause = format!(
        "glTF {version} is not supported, only glTF 2; tools such as gltf-pipeline turn the one into the other"
    );
    ImportError::unsupported(file, "/asset/version", cause)
}

fn numbers(version: &str) -> Option<(u32, u32)> {
    let (major, minor) = version.split_once('.')?;
    let digits = |s: &str| if s.bytes().all(|b| b.is_ascii_digit()) { s.parse().ok() } else { None };
    // "1.0.1" was written by some.
    Some((digits(major)?, digits(minor.split('.').next()?)?))
}

/// Checks every reference between elements, so that what follows may index without fear.
///
/// # Errors
/// The first reference that leads nowhere.
pub(super) fn check_references(file: &Path, root: &Root) -> Result<(), ImportError> {
    let check = References { file };
    let (nodes, accessors, views) = (root.nodes.len(), root.accessors.len(), root.buffer_views.len());
    let textures = root.textures.len();
    for (i, view) in root.buffer_views.iter().enumerate() {
        check.one(Some(view.buffer), root.buffers.len(), format_args!("/bufferViews/{i}/buffer"))?;
    }
    for (i, a) in root.accessors.iter().enumerate() {
        check.one(a.buffer_view, views, format_args!("/accessors/{i}/bufferView"))?;
        if let Some(s) = &a.sparse {
            check.one(Some(s.indices.buffer_view), views, format_args!("/accessors/{i}/sparse/indices/bufferView"))?;
            check.one(Some(s.values.buffer_view), views, format_args!("/accessors/{i}/sparse/values/bufferView"))?;
        }
    }
    for (i, image) in root.images.iter().enumerate() {
        check.one(image.buffer_view, views, format_args!("/images/{i}/bufferView"))?;
    }
    for (i, t) in root.textures.iter().enumerate() {
        check.one(t.sampler, root.samplers.len(), format_args!("/textures/{i}/sampler"))?;
        // The model's mark for "no source".
        if t.source.value() != u32::MAX as usize {
            check.one(Some(t.source), root.images.len(), format_args!("/textures/{i}/source"))?;
        }
        for name in IMAGE_EXTENSIONS {
            let source = extension_source(t, name).map(Index::<gltf::json::Image>::new);
            check.one(source, root.images.len(), format_args!("/textures/{i}/extensions/{name}/source"))?;
        }
    }
    for (i, m) in root.materials.iter().enumerate() {
        let pbr = &m.pbr_metallic_roughness;
        let of = |t: &Option<gltf::json::texture::Info>| t.as_ref().map(|t| t.index);
        for (name, texture) in [
            ("pbrMetallicRoughness/baseColorTexture", of(&pbr.base_color_texture)),
            ("pbrMetallicRoughness/metallicRoughnessTexture", of(&pbr.metallic_roughness_texture)),
            ("normalTexture", m.normal_texture.as_ref().map(|t| t.index)),
            ("occlusionTexture", m.occlusion_texture.as_ref().map(|t| t.index)),
            ("emissiveTexture", of(&m.emissive_texture)),
        ] {
            check.one(texture, textures, format_args!("/materials/{i}/{name}/index"))?;
        }
    }
    for (i, mesh) in root.meshes.iter().enumerate() {
        for (k, p) in mesh.primitives.iter().enumerate() {
            let at = format!("/meshes/{i}/primitives/{k}");
            check.one(p.indices, accessors, format_args!("{at}/indices"))?;
            check.one(p.material, root.materials.len(), format_args!("{at}/material"))?;
            for (semantic, &accessor) in &p.attributes {
                check.one(Some(accessor), accessors, format_args!("{at}/attributes/{}", semantic.to_string()))?;
            }
            for (j, target) in p.targets.iter().flatten().enumerate() {
                for (name, a) in
                    [("POSITION", target.positions), ("NORMAL", target.normals), ("TANGENT", target.tangents)]
                {
                    check.one(a, accessors, format_args!("{at}/targets/{j}/{name}"))?;
                }
            }
        }
    }
    for (i, node) in root.nodes.iter().enumerate() {
        check.one(node.mesh, root.meshes.len(), format_args!("/nodes/{i}/mesh"))?;
        check.one(node.camera, root.cameras.len(), format_args!("/nodes/{i}/camera"))?;
        check.one(node.skin, root.skins.len(), format_args!("/nodes/{i}/skin"))?;
        check.all(node.children.as_deref().unwrap_or_default(), nodes, format_args!("/nodes/{i}/children"))?;
        let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let lights = root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let count = lights.map_or(0, |l| l.lights.len());
        check.one(light.map(|l| l.light), count, format_args!("/nodes/{i}/extensions/KHR_lights_punctual/light"))?;
    }
    for (i, skin) in root.skins.iter().enumerate() {
        check.one(skin.inverse_bind_matrices, accessors, format_args!("/skins/{i}/inverseBindMatrices"))?;
        check.one(skin.skeleton, nodes, format_args!("/skins/{i}/skeleton"))?;
        check.all(&skin.joints, nodes, format_args!("/skins/{i}/joints"))?;
    }
    for (i, scene) in root.scenes.iter().enumerate() {
        check.all(&scene.nodes, nodes, format_args!("/scenes/{i}/nodes"))?;
    }
    check.one(root.scene, root.scenes.len(), format_args!("/scene"))
}

/// The extensions that offer other images for a texture, the preferred one first.
pub(super) const IMAGE_EXTENSIONS: &[&str] =
    if cfg!(feature = "ktx2") { &["KHR_texture_basisu", "EXT_texture_webp"] } else { &["EXT_texture_webp"] };

/// The image that an extension offers for a texture; a number that is none leads nowhere.
pub(super) fn extension_source(texture: &gltf::json::Texture, name: &str) -> Option<u32> {
    let source = texture.extensions.as_ref()?.others.get(name)?.get("source")?;
    Some(source.as_u64().and_then(|i| u32::try_from(i).ok()).unwrap_or(u32::MAX))
}

/// The number of an element that is asked for by name, or else by number.
///
/// # Errors
/// If there is none; the error names those that there are.
pub(super) fn by_name<'a>(
    file: &Path,
    what: &str,
    wanted: &str,
    names: impl Iterator<Item = &'a str> + Clone,
) -> Result<usize, ImportError> {
    let count = names.clone().count();
    let number = || wanted.parse().ok().filter(|i| *i < count);
    names.clone().position(|name| name == wanted).or_else(number).ok_or_else(|| {
        let list: Vec<String> = names.enumerate().map(|(i, name)| format!("{i} '{name}'")).collect();
        let there = if count == 0 { "the file has none".to_owned() } else { format!("there are {}", list.join(", ")) };
        ImportError::invalid(file, "", format!("there is no {what} '{wanted}': {there}"))
    })
}

struct References<'a> {
    file: &'a Path,
}

impl References<'_> {
    fn one<T>(&self, index: Option<Index<T>>, count: usize, place: fmt::Arguments<'_>) -> Result<(), ImportError> {
        match index {
            Some(i) if i.value() >= count => {
                let cause = format!("element {} does not exist: there are {count}", i.value());
                Err(ImportError::invalid(self.file, place.to_string(), cause))
            }
            _ => Ok(()),
        }
    }

    fn all<T>(&self, indices: &[Index<T>], count: usize, place: fmt::Arguments<'_>) -> Result<(), ImportError> {
        for (k, &i) in indices.iter().enumerate() {
            self.one(Some(i), count, format_args!("{place}/{k}"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        let file = Path::new("a.gltf");
        parse(file, text.as_bytes(), &Limits::default())
            .and_then(|d| check_references(file, &d.root))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn old_and_new_versions_are_refused_by_name() {
        for old in [
            r#"{"asset": {"version": "1.0"}}"#,
            r#"{"asset": {"version": 1.0}}"#,
            r#"{"asset": {"version": "1.0.1"}}"#,
            r#"{"asset": {}, "accessors": {}}"#,
        ] {
            assert!(error(old).contains("only glTF 2"), "{old}: {}", error(old));
        }
        assert!(error(r#"{"asset": {"version": "3.0"}}"#).contains("glTF 3.0 is not supported"));
        assert!(
            error(r#"{"asset": {"version": "2.0", "minVersion": "2.1"}}"#).starts_with("a.gltf: /asset/minVersion")
        );
        assert!(parse(Path::new(""), br#"{"asset": {"version": "2.1"}}"#, &Limits::default()).is_ok());
    }

    #[test]
    fn values_of_the_wrong_type_are_placed() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{}, {"children": [0, "x"]}]}"#;
        assert!(error(text).starts_with("a.gltf: /nodes/1/children/1: invalid type: string"), "{}", error(text));
    }

    #[test]
    fn references_that_lead_nowhere_are_placed() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 7}], "meshes": []}"#;
        assert_eq!(error(text), "a.gltf: /nodes/0/mesh: element 7 does not exist: there are 0");
    }

    #[test]
    fn whole_floats_are_integers() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 1.0, "translation": [2.0, 0.5, -0.0]}]}"#;
        let document = parse(Path::new(""), text.as_bytes(), &Limits::default()).unwrap();
        assert_eq!(document.root.nodes[0].mesh.unwrap().value(), 1);
        assert_eq!(document.root.nodes[0].translation, Some([2.0, 0.5, 0.0]));
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 1.5}]}"#;
        assert!(error(text).starts_with("a.gltf: /nodes/0/mesh: invalid type: floating point"));
    }

    #[test]
    fn animations_are_set_aside() {
        let text = r#"{"asset": {"version": "2.0"}, "animations": [{"channels": "none"}, 7]}"#;
        assert_eq!(parse(Path::new(""), text.as_bytes(), &Limits::default()).unwrap().animations.len(), 2);
    }

    #[test]
    fn a_scene_may_be_empty() {
        assert!(parse(Path::new(""), br#"{"asset": {"version": "2.0"}, "scenes": [{}]}"#, &Limits::default()).is_ok());
    }
}
