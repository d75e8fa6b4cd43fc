//! Vertex attributes and indices of one primitive, in the formats that the specification allows
//! (glTF 2.0, sections 3.7.2.1 and 3.7.2.2; KHR_mesh_quantization).

use glam::{Vec2, Vec3, Vec4};
use gltf::json::accessor::ComponentType::{F32, I8, I16, U8, U16, U32};
use gltf::json::accessor::Type;
use gltf::json::{self, Index};

use super::accessor::{Accessor, Format};
use super::bake::Influence;
use super::draco::DracoPrimitive;
use super::source::Source;
use crate::{ImportError, Report};

const FLOAT: &[Format] = &[(F32, false)];
/// Fractions: floats or normalised unsigned integers.
const FRACTIONS: &[Format] = &[(F32, false), (U8, true), (U16, true)];
/// Changes of texture coordinates and colours: floats or normalised integers.
const DELTAS: &[Format] = &[(F32, false), (I8, true), (U8, true), (I16, true), (U16, true)];
const INDICES: &[Format] = &[(U8, false), (U16, false), (U32, false)];
const JOINTS: &[Format] = &[(U8, false), (U16, false)];
/// Positions and texture coordinates by KHR_mesh_quantization.
const QUANTIZED: &[Format] = &[
    (F32, false),
    (I8, false),
    (I8, true),
    (U8, false),
    (U8, true),
    (I16, false),
    (I16, true),
    (U16, false),
    (U16, true),
];
/// Normals and tangents by KHR_mesh_quantization.
const QUANTIZED_UNIT: &[Format] = &[(F32, false), (I8, true), (I16, true)];

type Values<T> = Result<Vec<T>, ImportError>;

/// Reads the attributes of one primitive; `at` says where below the primitive an accessor is named.
pub(super) struct Attributes<'a> {
    pub(super) source: &'a Source<'a>,
    /// The primitive's place in the file.
    pub(super) place: &'a str,
    pub(super) report: &'a mut Report,
    /// Whether the file uses KHR_mesh_quantization.
    pub(super) quantized: bool,
    /// How many vertices there are, once that is known.
    pub(super) count: Option<usize>,
    /// What is not in the accessors, but in a compressed stream.
    pub(super) draco: Option<&'a DracoPrimitive>,
}

impl Attributes<'_> {
    pub(super) fn positions(&self, index: Index<json::Accessor>, at: &str) -> Values<Vec3> {
        let formats = if self.quantized { QUANTIZED } else { FLOAT };
        let values = self.accessor(index, at, &[Type::Vec3], formats)?.floats();
        Ok(values.into_iter().map(Vec3::from).collect())
    }

    /// Normals, and the changes that morph targets make to normals and tangents.
    pub(super) fn normals(&self, index: Index<json::Accessor>, at: &str) -> Values<Vec3> {
        let values = self.accessor(index, at, &[Type::Vec3], self.unit_formats())?.floats();
        Ok(values.into_iter().map(Vec3::from).collect())
    }

    pub(super) fn tangents(&self, index: Index<json::Accessor>, at: &str) -> Values<Vec4> {
        let values = self.accessor(index, at, &[Type::Vec4], self.unit_formats())?.floats();
        Ok(values.into_iter().map(Vec4::from).collect())
    }

    pub(super) fn uvs(&mut self, index: Index<json::Accessor>, at: &str) -> Values<Vec2> {
        let formats = if self.quantized { QUANTIZED } else { FRACTIONS };
        let values = self.accessor(index, at, &[Type::Vec2], formats)?.floats();
        Ok(self.clean(values, at).into_iter().map(Vec2::from).collect())
    }

    /// Colours from 0 to 1; alpha is 1 where there is none.
    pub(super) fn colors(&mut self, index: Index<json::Accessor>, at: &str) -> Values<Vec4> {
        let accessor = self.accessor(index, at, &[Type::Vec3, Type::Vec4], FRACTIONS)?;
        let values = if accessor.kind == Type::Vec3 {
            accessor.floats().into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
        } else {
            accessor.floats()
        };
        let values = self.clean(values, at);
        Ok(values.into_iter().map(|c| Vec4::from(c).clamp(Vec4::ZERO, Vec4::ONE)).collect())
    }

    /// The changes that morph targets make to texture coordinates.
    pub(super) fn uv_deltas(&mut self, index: Index<json::Accessor>, at: &str) -> Values<Vec2> {
        let values = self.accessor(index, at, &[Type::Vec2], DELTAS)?.floats();
        Ok(self.clean(values, at).into_iter().map(Vec2::from).collect())
    }

    /// The changes that morph targets make to colours.
    pub(super) fn color_deltas(&mut self, index: Index<json::Accessor>, at: &str) -> Values<Vec4> {
        let accessor = self.accessor(index, at, &[Type::Vec3, Type::Vec4], DELTAS)?;
        let values = if accessor.kind == Type::Vec3 {
            accessor.floats().into_iter().map(|[r, g, b]| [r, g, b, 0.0]).collect()
        } else {
            accessor.floats()
        };
        Ok(self.clean(values, at).into_iter().map(Vec4::from).collect())
    }

    /// One set of joints and weights.
    pub(super) fn influences(
        &self,
        set: u32,
        joints: Index<json::Accessor>,
        weights: Index<json::Accessor>,
    ) -> Values<Influence> {
        let joints = self.accessor(joints, &format!("attributes/JOINTS_{set}"), &[Type::Vec4], JOINTS)?;
        let weights = self.accessor(weights, &format!("attributes/WEIGHTS_{set}"), &[Type::Vec4], FRACTIONS)?;
        Ok(joints.integers().into_iter().zip(weights.floats()).collect())
    }

    /// Indices of vertices, in range. The largest number of the type, which would restart a primitive, is an error.
    pub(super) fn indices(&self, index: Index<json::Accessor>, vertices: usize) -> Values<u32> {
        let accessor = match self.draco.and_then(|d| d.indices()) {
            Some(unpacked) => unpacked,
            None => Accessor::new(self.source, index)?,
        };
        let place = format!("{}/indices", self.place);
        if accessor.kind != Type::Scalar || !INDICES.contains(&accessor.format) {
            return Err(self.source.invalid(place, mismatch(index, &accessor, &[Type::Scalar], INDICES)));
        }
        let restart = match accessor.format.0 {
            U8 => 0xff,
            U16 => 0xffff,
            _ => u32::MAX,
        };
        let indices = accessor.integers::<1>().as_flattened().to_vec();
        if let Some(k) = indices.iter().position(|&i| i as usize >= vertices || i == restart) {
            let cause = if indices[k] == restart {
                format!("index {restart} (number {k}) would restart the primitive, which glTF does not allow")
            } else {
                format!("index {} (number {k}) is out of range: there are {vertices} vertices", indices[k])
            };
            return Err(self.source.invalid(place, cause));
        }
        Ok(indices)
    }

    fn accessor(
        &self,
        index: Index<json::Accessor>,
        at: &str,
        kinds: &[Type],
        formats: &[Format],
    ) -> Result<Accessor<'_>, ImportError> {
        let name = at.strip_prefix("attributes/");
        let accessor = match name.and_then(|name| self.draco?.attribute(name)) {
            Some(unpacked) => unpacked,
            None => Accessor::new(self.source, index)?,
        };
        let place = || format!("{}/{at}", self.place);
        if !kinds.contains(&accessor.kind) || !formats.contains(&accessor.format) {
            return Err(self.source.invalid(place(), mismatch(index, &accessor, kinds, formats)));
        }
        if let Some(count) = self.count.filter(|&c| c != accessor.count) {
            let cause = format!("accessor {} has {} elements for {count} vertices", index.value(), accessor.count);
            return Err(self.source.invalid(place(), cause));
        }
        Ok(accessor)
    }

    fn unit_formats(&self) -> &'static [Format] {
        if self.quantized { QUANTIZED_UNIT } else { FLOAT }
    }

    /// Puts zeros where numbers are not finite, with a warning.
    fn clean<const N: usize>(&mut self, mut values: Vec<[f32; N]>, at: &str) -> Vec<[f32; N]> {
        let mut bad = 0_u64;
        for x in values.as_flattened_mut().iter_mut().filter(|x| !x.is_finite()) {
            *x = 0.0;
            bad += 1;
        }
        if bad > 0 {
            self.warn(at, format!("{bad} numbers that are not finite are taken as 0"));
        }
        values
    }

    pub(super) fn warn(&mut self, at: &str, message: String) {
        self.report.warn(self.source.file, format!("{}/{at}", self.place), message);
    }
}

/// What an accessor is, and what it should be.
fn mismatch(index: Index<json::Accessor>, accessor: &Accessor<'_>, kinds: &[Type], formats: &[Format]) -> String {
    let kinds: Vec<String> = kinds.iter().map(kind_name).collect();
    format!(
        "accessor {} is {} of {}, expected {} of {}",
        index.value(),
        kind_name(&accessor.kind),
        names(&[accessor.format]),
        kinds.join(" or "),
        names(formats)
    )
}

/// The format's name of a type.
fn kind_name(kind: &Type) -> String {
    format!("{kind:?}").to_uppercase()
}

/// The names of component types, which the file has as numbers.
fn names(formats: &[Format]) -> String {
    let name = |&(component, normalized): &Format| {
        let name = match component {
            I8 => "BYTE",
            U8 => "UNSIGNED_BYTE",
            I16 => "SHORT",
            U16 => "UNSIGNED_SHORT",
            U32 => "UNSIGNED_INT",
            F32 => "FLOAT",
        };
        format!("{name} ({}{})", component.as_gl_enum(), if normalized { ", normalized" } else { "" })
    };
    formats.iter().map(name).collect::<Vec<_>>().join(", ")
}
