//! Our verdict beside that of Khronos's validator, and why they differ where they do.

use super::{End, Row};

/// Our verdict beside the validator's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Both read the file, or both find fault with it.
    Agrees,
    /// We read what the validator calls broken, and why; none if nobody knows.
    Lenient(Option<&'static str>),
    /// We refuse what the validator calls valid, and why; none if nobody knows.
    Strict(Option<&'static str>),
}

/// A reason, and the files that it holds for: those with one of these first errors (none: any) and with one of these
/// parts in their path (none: any). The first that fits is taken.
struct Reason {
    why: &'static str,
    errors: &'static [&'static str],
    files: &'static [&'static str],
}

/// Why files with errors are read.
const LENIENT: &[Reason] = &[
    Reason {
        why: "a byte order mark is passed over, as RFC 8259 allows",
        errors: &["INVALID_JSON"],
        files: &["/bom.gltf", "/bom.glb"],
    },
    Reason {
        why: "animations are looked at only when one is played; what is wrong with it is an error or a warning then",
        errors: &[],
        files: &["/animation/", "/animation_data/"],
    },
    Reason {
        why: "variants are looked at only when one is asked for; an error then",
        errors: &[],
        files: &["/KHR_materials_variants/"],
    },
    Reason {
        why: "an image that cannot be read is a warning and white where it is shown",
        errors: &["IO_ERROR", "INVALID_URI"],
        files: &["/image/", "meshopt-cube-test/"],
    },
    Reason {
        why: "an image is known by its first bytes, whatever its MIME type says",
        errors: &[
            "IMAGE_MIME_TYPE_INVALID",
            "IMAGE_NON_ENABLED_MIME_TYPE",
            "INVALID_URI",
            "UNDECLARED_EXTENSION",
            "UNSATISFIED_DEPENDENCY",
        ],
        files: &["/image/", "/EXT_texture_webp/data/texture/"],
    },
    Reason {
        why: "empty lists, and elements named twice, say what is meant",
        errors: &["EMPTY_ENTITY", "DUPLICATE_ELEMENTS"],
        files: &[],
    },
    Reason {
        why: "bounds in the file are not looked at: they are computed",
        errors: &[
            "ACCESSOR_MIN_MISMATCH",
            "ACCESSOR_MAX_MISMATCH",
            "ARRAY_LENGTH_NOT_IN_LIST",
            "MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS",
        ],
        files: &[],
    },
    Reason {
        why: "a buffer or view of no bytes harms nobody while nothing is read from it",
        errors: &["VALUE_NOT_IN_RANGE"],
        files: &["/zero_bytelength.gltf", "/ZeroLengthBufferView.gltf"],
    },
    Reason {
        why: "numbers of materials out of range are taken as the nearest in it, with a warning",
        errors: &["VALUE_NOT_IN_RANGE"],
        files: &["/material/out_of_range.gltf"],
    },
    Reason {
        why: "directions and quaternions are brought to length 1; those without direction are computed anew, with a warning",
        errors: &["ACCESSOR_VECTOR3_NON_UNIT", "ROTATION_NON_UNIT"],
        files: &[],
    },
    Reason { why: "colours are brought into 0 to 1", errors: &["ACCESSOR_NON_CLAMPED"], files: &[] },
    Reason {
        why: "data may lie anywhere and at any distance: nothing here depends on its alignment, and a stride is followed",
        errors: &[
            "BUFFER_VIEW_INVALID_BYTE_STRIDE",
            "BUFFER_VIEW_TOO_BIG_BYTE_STRIDE",
            "IMAGE_BUFFER_VIEW_WITH_BYTESTRIDE",
            "SKIN_IBM_ACCESSOR_WITH_BYTESTRIDE",
            "VALUE_MULTIPLE_OF",
        ],
        files: &[],
    },
    Reason {
        why: "no mesh reads the faulty data or camera",
        errors: &[
            "ACCESSOR_INVALID_FLOAT",
            "ACCESSOR_NORMALIZED_INVALID",
            "BUFFER_DATA_URI_MIME_TYPE_INVALID",
            "BUFFER_MISSING_GLB_DATA",
            "CAMERA_XMAG_YMAG_ZERO",
            "CAMERA_ZFAR_LEQUAL_ZNEAR",
            "INVALID_URI",
            "ONE_OF_MISMATCH",
        ],
        files: &[],
    },
    Reason {
        why: "no node has this light",
        errors: &["KHR_LIGHTS_PUNCTUAL_LIGHT_SPOT_ANGLES", "UNDEFINED_PROPERTY"],
        files: &["/KHR_lights_punctual/data/light/"],
    },
    Reason {
        why: "an extension is done where it stands, whether the file lists it or not",
        errors: &["NON_REQUIRED_EXTENSION", "UNDECLARED_EXTENSION"],
        files: &[],
    },
    Reason {
        why: "an extension is passed over where it has no business",
        errors: &["UNEXPECTED_EXTENSION_OBJECT"],
        files: &[],
    },
    Reason {
        why: "what is no object belongs to extensions that are not known, which are warnings",
        errors: &["TYPE_MISMATCH"],
        files: &["/extensions_non_objects.gltf"],
    },
    Reason {
        why: "attributes, targets and weights that have no meaning here are not read",
        errors: &[
            "MESH_INVALID_WEIGHTS_COUNT",
            "MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT",
            "MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY",
            "MESH_PRIMITIVE_INVALID_ATTRIBUTE",
            "UNSATISFIED_DEPENDENCY",
        ],
        files: &[],
    },
    Reason {
        why: "missing texture coordinates are zero, missing tangents are computed",
        errors: &["MESH_PRIMITIVE_NO_TANGENT_SPACE", "MESH_PRIMITIVE_TOO_FEW_TEXCOORDS"],
        files: &[],
    },
    Reason {
        why: "only the joints' own places matter, not where they hang nor what is named as their root",
        errors: &[
            "NODE_SKIN_NO_SCENE",
            "NODE_SKIN_WITH_NON_SKINNED_MESH",
            "SKIN_NO_COMMON_ROOT",
            "SKIN_SKELETON_INVALID",
        ],
        files: &[],
    },
    Reason {
        why: "nothing with surface has this skin",
        errors: &["ACCESSOR_JOINTS_INDEX_OOB", "SKIN_IBM_INVALID_FORMAT"],
        files: &[],
    },
];

/// Why files without errors are refused.
const STRICT: &[Reason] = &[
    Reason {
        why: "the file says that it needs a reader of a later version",
        errors: &[],
        files: &["/min_version_valid.gltf", "/Compatibility_04.gltf"],
    },
    Reason { why: "the file requires an extension that is not known", errors: &[], files: &["/Compatibility_05.gltf"] },
    Reason {
        why: "a buffer has neither a URI nor a binary chunk: its data would have to come from somewhere else",
        errors: &[],
        files: &["/named_objects.gltf", "/unused_objects.gltf"],
    },
];

/// Files whose triangles are not as many as the inventory says, by how many, and why that is right.
const DIFFERENT: &[(&str, i64, &str)] =
    &[("/test-nan.obj", -2, "the corners of one quadrilateral are no numbers: it is left out, with a warning")];

/// Our verdict beside the validator's; none where there is none of either.
#[must_use]
pub fn verdict(row: &Row) -> Option<Verdict> {
    let why = |reasons: &'static [Reason]| reasons.iter().find(|r| r.fits(row)).map(|r| r.why);
    match (row.known.valid?, row.end) {
        (true, End::Loaded) | (false, End::Refused) => Some(Verdict::Agrees),
        (false, End::Loaded) => Some(Verdict::Lenient(why(LENIENT))),
        (true, End::Refused) => Some(Verdict::Strict(why(STRICT))),
        _ => None,
    }
}

/// Why a count of triangles may differ from the inventory's as it does.
#[must_use]
pub fn known_difference(row: &Row) -> Option<&'static str> {
    let difference = i64::try_from(row.triangles?).ok()? - i64::try_from(row.known.triangles?).ok()?;
    DIFFERENT.iter().find(|(end, by, _)| row.file.ends_with(end) && *by == difference).map(|(_, _, why)| *why)
}

impl Reason {
    fn fits(&self, row: &Row) -> bool {
        let error = self.errors.is_empty() || self.errors.contains(&row.known.first_error.as_str());
        error && (self.files.is_empty() || self.files.iter().any(|part| row.file.contains(part)))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::files::inventory::Known;

    pub(in crate::files) fn row(file: &str, end: End, valid: bool, first_error: &str) -> Row {
        Row {
            file: file.into(),
            known: Known { triangles: Some(12), valid: Some(valid), first_error: first_error.into() },
            end,
            error: String::new(),
            warnings: 0,
            triangles: (end == End::Loaded).then_some(12),
            bytes: 1000,
            seconds: 0.01,
            processor_seconds: 0.01,
            peak_bytes: 20 << 20,
            picture: None,
        }
    }

    #[test]
    fn what_differs_has_its_reason_or_none() {
        assert_eq!(verdict(&row("a.gltf", End::Loaded, true, "")), Some(Verdict::Agrees));
        assert_eq!(verdict(&row("a.gltf", End::Refused, false, "INVALID_JSON")), Some(Verdict::Agrees));
        assert_eq!(verdict(&row("a.gltf", End::Panicked, false, "INVALID_JSON")), None);
        let lenient = |file, error| match verdict(&row(file, End::Loaded, false, error)) {
            Some(Verdict::Lenient(why)) => why,
            other => panic!("{other:?}"),
        };
        assert!(lenient("x/bom.glb", "INVALID_JSON").unwrap().contains("RFC 8259"));
        assert_eq!(lenient("x/other.glb", "INVALID_JSON"), None);
        assert!(lenient("a.gltf", "EMPTY_ENTITY").is_some());
        assert_eq!(verdict(&row("a.gltf", End::Refused, true, "")), Some(Verdict::Strict(None)));
    }

    #[test]
    fn counts_are_wrong_unless_the_difference_is_known() {
        let mut odd = row("x/test-nan.obj", End::Loaded, true, "");
        odd.triangles = Some(10);
        assert!(!odd.is_count_wrong());
        odd.triangles = Some(11);
        assert!(odd.is_count_wrong());
        odd.triangles = None;
        assert!(!odd.is_count_wrong());
    }
}
