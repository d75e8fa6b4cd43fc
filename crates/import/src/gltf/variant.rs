//! KHR_materials_variants: the same shapes in other materials.

use gltf::json::{Root, mesh::Primitive};

use super::json;
use super::source::Source;
use crate::{ImportError, Report};

/// The names of a file's variants.
pub(super) fn names(root: &Root) -> Vec<String> {
    let variants = root.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
    variants.map_or_else(Vec::new, |v| v.variants.iter().map(|v| v.name.clone()).collect())
}

/// The variant that is asked for, by name or else by number.
///
/// # Errors
/// If the file has no such variant; the error names those that it has.
pub(super) fn choose(source: &Source<'_>, wanted: Option<&str>, report: &Report) -> Result<Option<u32>, ImportError> {
    let Some(wanted) = wanted else { return Ok(None) };
    let names = report.variants.iter().map(String::as_str);
    json::by_name(source.file, "variant", wanted, names).map(|i| Some(i as u32))
}

/// The material of a primitive in a variant; its own where the variant does not say.
///
/// # Errors
/// If the material does not exist.
pub(super) fn material(
    source: &Source<'_>,
    primitive: &Primitive,
    variant: Option<u32>,
    place: &str,
) -> Result<Option<usize>, ImportError> {
    let own = primitive.material.map(|m| m.value());
    let mappings = primitive.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
    let (Some(variant), Some(mappings)) = (variant, mappings) else { return Ok(own) };
    let Some((i, mapping)) = mappings.mappings.iter().enumerate().find(|(_, m)| m.variants.contains(&variant)) else {
        return Ok(own);
    };
    let count = source.root.materials.len();
    if mapping.material as usize >= count {
        let place = format!("{place}/extensions/KHR_materials_variants/mappings/{i}/material");
        let cause = format!("element {} does not exist: there are {count}", mapping.material);
        return Err(source.invalid(place, cause));
    }
    Ok(Some(mapping.material as usize))
}
