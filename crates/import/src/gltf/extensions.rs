//! What is done with each extension of glTF: one table, read by the loader, by reports and by the documentation.

use std::collections::HashSet;
use std::path::Path;

use gltf::json::Root;

use crate::{ExtensionUse, ImportError, Report, Support};

/// An extension that firsthit knows of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extension {
    /// Its name, as files write it.
    pub name: &'static str,
    /// How far it is honoured. A file that requires an [`Support::Unsupported`] one is refused.
    pub support: Support,
    /// What is done with it, in one line.
    pub note: &'static str,
}

const fn entry(name: &'static str, support: Support, note: &'static str) -> Extension {
    Extension { name, support, note }
}

use Support::{Full, Ignored, Partial, Unsupported};

const BASISU: Extension = if cfg!(feature = "ktx2") {
    entry("KHR_texture_basisu", Full, "")
} else {
    entry("KHR_texture_basisu", Unsupported, "the PNG or JPEG fallback is used where the file has one")
};

/// The extensions, by name.
pub const EXTENSIONS: &[Extension] = &[
    entry("AGI_articulations", Ignored, "the rest pose is shown"),
    entry("CESIUM_primitive_outline", Ignored, "outlines are not drawn"),
    entry("EXT_lights_ies", Unsupported, "these lights are left out"),
    entry(
        "EXT_lights_image_based",
        Partial,
        "the finest images surround the scene; blurred ones and irradiance are not read: their light is traced",
    ),
    entry("EXT_mesh_features", Ignored, "identifiers without effect on the picture"),
    entry("EXT_mesh_gpu_instancing", Full, "instances share their mesh; skins are drawn once"),
    entry("EXT_mesh_manifold", Ignored, "the triangles are the same"),
    entry("EXT_meshopt_compression", Full, ""),
    entry("EXT_structural_metadata", Ignored, "data without effect on the picture"),
    entry("EXT_texture_avif", Unsupported, "the PNG or JPEG fallback is used where the file has one"),
    entry("EXT_texture_webp", Full, ""),
    entry("FB_ngon_encoding", Ignored, "the triangles are the same"),
    entry("GODOT_single_root", Ignored, "a hint for editors"),
    entry("KHR_animation_pointer", Partial, "docs/animation.md lists what it can change"),
    entry("KHR_draco_mesh_compression", Full, ""),
    entry("KHR_interactivity", Ignored, "nothing is pressed or pointed at"),
    entry("KHR_lights_punctual", Full, ""),
    entry("KHR_materials_anisotropy", Full, ""),
    entry("KHR_materials_clearcoat", Full, ""),
    entry("KHR_materials_diffuse_transmission", Full, ""),
    entry("KHR_materials_dispersion", Full, "three indices of refraction: red, green, blue"),
    entry("KHR_materials_emissive_strength", Full, ""),
    entry("KHR_materials_ior", Full, ""),
    entry("KHR_materials_iridescence", Full, ""),
    entry("KHR_materials_pbrSpecularGlossiness", Full, "turned into the same dielectric with a coloured reflection"),
    entry("KHR_materials_sheen", Full, ""),
    entry("KHR_materials_specular", Full, ""),
    entry("KHR_materials_transmission", Full, ""),
    entry("KHR_materials_unlit", Full, ""),
    entry("KHR_materials_variants", Full, "the default, or the one that `--variant` names"),
    entry("KHR_materials_volume", Full, ""),
    entry("KHR_mesh_quantization", Full, ""),
    entry("KHR_meshopt_compression", Full, ""),
    entry("KHR_node_hoverability", Ignored, "nothing is pointed at"),
    entry("KHR_node_selectability", Ignored, "nothing is pointed at"),
    entry("KHR_node_visibility", Full, ""),
    BASISU,
    entry("KHR_texture_transform", Full, ""),
    entry("KHR_xmp", Ignored, "data without effect on the picture"),
    entry("KHR_xmp_json_ld", Ignored, "data without effect on the picture"),
    entry("MSFT_lod", Ignored, "the finest level is shown"),
    entry("MSFT_texture_dds", Unsupported, "the PNG or JPEG fallback is used where the file has one"),
];

/// The entry of an extension.
#[must_use]
pub fn find(name: &str) -> Option<&'static Extension> {
    EXTENSIONS.binary_search_by(|e| e.name.cmp(name)).ok().and_then(|i| EXTENSIONS.get(i))
}

/// Notes the extensions that a file names; warns of those that would matter.
///
/// # Errors
/// If the file requires one that is unknown or not supported.
pub(super) fn check(file: &Path, root: &Root, report: &mut Report) -> Result<(), ImportError> {
    for (i, name) in root.extensions_required.iter().enumerate() {
        let cause = match find(name) {
            None => "which firsthit does not know",
            Some(e) if e.support == Unsupported => "which firsthit does not support",
            Some(_) => continue,
        };
        let place = format!("/extensionsRequired/{i}");
        return Err(ImportError::unsupported(file, place, format!("the file requires {name}, {cause}")));
    }
    let required: HashSet<&String> = root.extensions_required.iter().collect();
    let mut seen = HashSet::new();
    for (i, name) in root.extensions_used.iter().enumerate() {
        if !seen.insert(name) {
            continue;
        }
        let known = find(name);
        let (support, note) = known.map_or((Unsupported, "not known"), |e| (e.support, e.note));
        if support == Unsupported {
            report.warn(file, format!("/extensionsUsed/{i}"), format!("{name} is not supported: {note}"));
        }
        let required = required.contains(name);
        report.extensions.push(ExtensionUse { name: name.clone(), required, support, note });
    }
    for name in &root.extensions_required {
        if seen.insert(name)
            && let Some(e) = find(name)
        {
            report.extensions.push(ExtensionUse {
                name: name.clone(),
                required: true,
                support: e.support,
                note: e.note,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_every_entry_is_found() {
        assert!(EXTENSIONS.windows(2).all(|w| w[0].name < w[1].name));
        assert!(EXTENSIONS.iter().all(|e| find(e.name) == Some(e)));
        assert_eq!(find("KHR_"), None);
    }

    #[test]
    fn what_is_not_honoured_says_what_happens_instead() {
        assert!(EXTENSIONS.iter().all(|e| e.support == Full || !e.note.is_empty()));
    }
}
