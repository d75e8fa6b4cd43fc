//! What animations can change: paths into the file's JSON (KHR_animation_pointer and the glTF 2.0 object model).

use serde_json::{Map, Value};

/// What a property is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// So many numbers.
    Numbers(usize),
    /// A unit quaternion.
    Rotation,
    /// A number for each morph target.
    Weights,
    /// True or false.
    Switch,
}

/// A property that animations can change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Property {
    /// Where it is in the file: `{}` stands for a number, `{texture}` for the way to any texture of a material or of an
    /// extension of it.
    pub path: &'static str,
    /// What it is.
    pub kind: Kind,
}

const fn numbers(path: &'static str, count: usize) -> Property {
    Property { path, kind: Kind::Numbers(count) }
}

/// The properties that animations can change. Those of cameras' depths are allowed and change nothing in a picture.
pub const PROPERTIES: &[Property] = &[
    numbers("/nodes/{}/translation", 3),
    Property { path: "/nodes/{}/rotation", kind: Kind::Rotation },
    numbers("/nodes/{}/scale", 3),
    Property { path: "/nodes/{}/weights", kind: Kind::Weights },
    numbers("/nodes/{}/weights/{}", 1),
    Property { path: "/nodes/{}/extensions/KHR_node_visibility/visible", kind: Kind::Switch },
    Property { path: "/meshes/{}/weights", kind: Kind::Weights },
    numbers("/meshes/{}/weights/{}", 1),
    numbers("/cameras/{}/perspective/aspectRatio", 1),
    numbers("/cameras/{}/perspective/yfov", 1),
    numbers("/cameras/{}/perspective/zfar", 1),
    numbers("/cameras/{}/perspective/znear", 1),
    numbers("/cameras/{}/orthographic/xmag", 1),
    numbers("/cameras/{}/orthographic/ymag", 1),
    numbers("/cameras/{}/orthographic/zfar", 1),
    numbers("/cameras/{}/orthographic/znear", 1),
    numbers("/extensions/KHR_lights_punctual/lights/{}/color", 3),
    numbers("/extensions/KHR_lights_punctual/lights/{}/intensity", 1),
    numbers("/extensions/KHR_lights_punctual/lights/{}/range", 1),
    numbers("/extensions/KHR_lights_punctual/lights/{}/spot/innerConeAngle", 1),
    numbers("/extensions/KHR_lights_punctual/lights/{}/spot/outerConeAngle", 1),
    numbers("/materials/{}/alphaCutoff", 1),
    numbers("/materials/{}/emissiveFactor", 3),
    numbers("/materials/{}/normalTexture/scale", 1),
    numbers("/materials/{}/occlusionTexture/strength", 1),
    numbers("/materials/{}/pbrMetallicRoughness/baseColorFactor", 4),
    numbers("/materials/{}/pbrMetallicRoughness/metallicFactor", 1),
    numbers("/materials/{}/pbrMetallicRoughness/roughnessFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_anisotropy/anisotropyRotation", 1),
    numbers("/materials/{}/extensions/KHR_materials_anisotropy/anisotropyStrength", 1),
    numbers("/materials/{}/extensions/KHR_materials_clearcoat/clearcoatFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_clearcoat/clearcoatNormalTexture/scale", 1),
    numbers("/materials/{}/extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorFactor", 3),
    numbers("/materials/{}/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_dispersion/dispersion", 1),
    numbers("/materials/{}/extensions/KHR_materials_emissive_strength/emissiveStrength", 1),
    numbers("/materials/{}/extensions/KHR_materials_ior/ior", 1),
    numbers("/materials/{}/extensions/KHR_materials_iridescence/iridescenceFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_iridescence/iridescenceIor", 1),
    numbers("/materials/{}/extensions/KHR_materials_iridescence/iridescenceThicknessMaximum", 1),
    numbers("/materials/{}/extensions/KHR_materials_iridescence/iridescenceThicknessMinimum", 1),
    numbers("/materials/{}/extensions/KHR_materials_sheen/sheenColorFactor", 3),
    numbers("/materials/{}/extensions/KHR_materials_sheen/sheenRoughnessFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_specular/specularColorFactor", 3),
    numbers("/materials/{}/extensions/KHR_materials_specular/specularFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_transmission/transmissionFactor", 1),
    numbers("/materials/{}/extensions/KHR_materials_volume/attenuationColor", 3),
    numbers("/materials/{}/extensions/KHR_materials_volume/attenuationDistance", 1),
    numbers("/materials/{}/extensions/KHR_materials_volume/thicknessFactor", 1),
    numbers("/materials/{}/{texture}/extensions/KHR_texture_transform/offset", 2),
    numbers("/materials/{}/{texture}/extensions/KHR_texture_transform/rotation", 1),
    numbers("/materials/{}/{texture}/extensions/KHR_texture_transform/scale", 2),
];

/// No property has more segments, the empty one before the first slash included.
const MOST_SEGMENTS: usize = 9;

/// The property that a pointer names, if it is one that can be changed.
pub(super) fn find(pointer: &str) -> Option<&'static Property> {
    // A file may write millions of segments.
    let path: Vec<&str> = pointer.split('/').take(MOST_SEGMENTS + 1).collect();
    let fits = |p: &&Property| matches(&p.path.split('/').collect::<Vec<_>>(), &path);
    PROPERTIES.iter().find(fits).filter(|_| path.len() <= MOST_SEGMENTS)
}

fn matches(pattern: &[&str], path: &[&str]) -> bool {
    match (pattern.split_first(), path.split_first()) {
        (None, None) => true,
        (Some((&"{texture}", pattern)), Some(_)) => after_texture(path).is_some_and(|rest| matches(pattern, rest)),
        (Some((expected, pattern)), Some((found, path))) => {
            let fits = if *expected == "{}" { index(found).is_some() } else { expected == found };
            fits && matches(pattern, path)
        }
        _ => false,
    }
}

/// What follows the way to a texture, which begins in the material or in one of its extensions.
fn after_texture<'a, 'b>(path: &'a [&'b str]) -> Option<&'a [&'b str]> {
    let path = match path {
        ["pbrMetallicRoughness", rest @ ..] => rest,
        ["extensions", name, rest @ ..] if name.starts_with("KHR_materials_") => rest,
        _ => path,
    };
    path.split_first().filter(|(name, _)| name.ends_with("Texture")).map(|(_, rest)| rest)
}

/// A number of an element, as pointers write it.
pub(super) fn index(segment: &str) -> Option<usize> {
    let plain = segment == "0" || !segment.starts_with('0');
    (plain && segment.bytes().all(|b| b.is_ascii_digit())).then(|| segment.parse().ok()).flatten()
}

/// What is not made where a file leaves it out.
const MEANINGLESS_ALONE: [&str; 8] =
    ["perspective", "orthographic", "spot", "lights", "nodes", "meshes", "cameras", "materials"];

/// Puts a value in the place of another one, or where the default held. What a file may leave out is made, but for
/// textures, lenses, cones and elements of lists, which mean nothing by themselves. `false`: there is no such place, and
/// nothing is changed.
pub(super) fn write(json: &mut Value, pointer: &str, new: Value) -> bool {
    if !can_write(json, pointer) {
        return false;
    }
    let mut place = json;
    for segment in pointer.split('/').skip(1) {
        if place.is_null() {
            // Made a moment ago.
            *place = Value::Object(Map::new());
        }
        place = match place {
            Value::Array(list) => match index(segment).and_then(|i| list.get_mut(i)) {
                Some(element) => element,
                None => return false,
            },
            Value::Object(object) => object.entry(segment).or_insert(Value::Null),
            _ => return false,
        };
    }
    *place = new;
    true
}

/// Whether there is such a place, or what it lacks may be made.
fn can_write(json: &Value, pointer: &str) -> bool {
    let mut place = Some(json);
    for segment in pointer.split('/').skip(1) {
        place = match place {
            Some(Value::Array(list)) => match index(segment).and_then(|i| list.get(i)) {
                Some(element) => Some(element),
                None => return false,
            },
            Some(Value::Object(object)) => object.get(segment),
            Some(Value::Null) | None => None,
            Some(_) => return false,
        };
        let alone = segment.ends_with("Texture") || MEANINGLESS_ALONE.contains(&segment);
        if alone && place.is_none_or(Value::is_null) {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn pointers_find_their_properties() {
        let kind = |pointer| find(pointer).map(|p| p.kind);
        assert_eq!(kind("/nodes/12/rotation"), Some(Kind::Rotation));
        assert_eq!(kind("/nodes/0/weights/3"), Some(Kind::Numbers(1)));
        assert_eq!(kind("/nodes/0/extensions/KHR_node_visibility/visible"), Some(Kind::Switch));
        for texture in ["normalTexture", "pbrMetallicRoughness/baseColorTexture"] {
            let pointer = format!("/materials/3/{texture}/extensions/KHR_texture_transform/offset");
            assert_eq!(find(&pointer).map(|p| p.kind), Some(Kind::Numbers(2)));
        }
        let coat = "/materials/3/extensions/KHR_materials_clearcoat/clearcoatTexture/extensions/KHR_texture_transform";
        assert_eq!(find(&format!("{coat}/rotation")).map(|p| p.kind), Some(Kind::Numbers(1)));
        for none in ["", "/", "/nodes/x/rotation", "/nodes/01/rotation", "/nodes//rotation", "/nodes/0/matrix"] {
            assert_eq!(find(none), None, "{none}");
        }
        assert_eq!(find("/materials/5/normalTexture/offset"), None);
        let long =
            format!("/materials/0/{}baseColorTexture/extensions/KHR_texture_transform/offset", "a/".repeat(400_000));
        for none in [long.as_str(), "/materials/0/a/normalTexture/extensions/KHR_texture_transform/offset"] {
            assert_eq!(find(none), None);
        }
        let longest = PROPERTIES.iter().map(|p| p.path.replace("{texture}", "extensions/X/Y").split('/').count()).max();
        assert_eq!(longest, Some(MOST_SEGMENTS));
    }

    #[test]
    fn values_are_put_where_they_belong() {
        let mut file = json!({"materials": [{"normalTexture": {"index": 0}}], "cameras": [{"perspective": {}}]});
        let before = file.clone();
        assert!(!write(&mut file, &format!("/materials/0/{}normalTexture/scale", "a/".repeat(100_000)), json!(1.0)));
        assert!(!write(&mut file, "/materials/0/extensions/KHR_materials_sheen/sheenColorTexture/x", json!(1.0)));
        assert_eq!(file, before, "what fails changes nothing");
        let mut put = |pointer: &str| write(&mut file, pointer, json!([1.0, 2.0]));
        assert!(put("/materials/0/normalTexture/extensions/KHR_texture_transform/offset"));
        assert!(put("/materials/0/pbrMetallicRoughness/baseColorFactor"));
        assert!(!put("/materials/0/occlusionTexture/strength"));
        assert!(!put("/materials/1/emissiveFactor"));
        assert!(!put("/cameras/0/orthographic/xmag"));
        assert!(!put("/nodes/0/translation"));
        assert_eq!(file["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], json!([1.0, 2.0]));
        let transform = &file["materials"][0]["normalTexture"]["extensions"]["KHR_texture_transform"];
        assert_eq!(transform["offset"], json!([1.0, 2.0]));
    }
}
