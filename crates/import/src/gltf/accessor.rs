//! Accessors: typed arrays in buffers, of any component type, normalised, strided, sparse
//! (glTF 2.0 specification, sections 3.6.2 and 3.11).

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

use super::source::Source;
use crate::{ErrorKind, ImportError, Limits};

/// How components are stored: the type, and whether integers stand for fractions.
pub(super) type Format = (ComponentType, bool);

/// What an accessor says, checked: all its elements lie inside their buffer views.
pub(super) struct Layout {
    count: u64,
    kind: Type,
    format: Format,
    data: Option<Elements>,
    sparse: Option<SparseLayout>,
}

struct SparseLayout {
    place: String,
    component: ComponentType,
    indices: Elements,
    values: Elements,
}

/// Elements in a buffer view.
struct Elements {
    view: Index<json::buffer::View>,
    offset: u64,
    stride: u64,
    count: u64,
}

/// An accessor with its data.
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub(super) count: usize,
    /// Shape of an element.
    pub(super) kind: Type,
    /// Storage of a component.
    pub(super) format: Format,
    /// `None`: all zeros.
    data: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

#[derive(Clone, Copy)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Elements that differ from `data`.
struct Sparse<'a> {
    places: Vec<u32>,
    values: Strided<'a>,
}

/// More zeros than any accessor of a small file has a use for: they cost the file nothing, but the reader memory.
const MOST_ZEROS: u64 = 1 << 20;

/// Most bytes of zeros that all accessors together may be read as.
const MOST_ZERO_BYTES: u64 = 1 << 28;

/// What may still be read of accessors that have no data.
pub(super) struct ZeroBudget(AtomicU64);

impl ZeroBudget {
    pub(super) fn new(limits: &Limits) -> Self {
        Self(AtomicU64::new(limits.file_bytes.min(limits.memory.unwrap_or(MOST_ZERO_BYTES))))
    }
}

impl Layout {
    /// Checks an accessor without looking at its data.
    ///
    /// # Errors
    /// If an element lies outside its buffer view, or the accessor says something that makes no sense.
    pub(super) fn new(source: &Source<'_>, index: Index<json::Accessor>) -> Result<Self, ImportError> {
        let i = index.value();
        let place = format!("/accessors/{i}");
        let json = &source.root.accessors[i];
        let Checked::Valid(kind) = json.type_ else {
            return Err(source.invalid(place + "/type", "is none of SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3, MAT4"));
        };
        let Checked::Valid(component) = json.component_type else {
            let cause = "is none of 5120, 5121, 5122, 5123, 5125, 5126";
            return Err(source.invalid(place + "/componentType", cause));
        };
        let component = component.0;
        let count = json.count.0;
        check_count(source, index, source.limits.elements)?;
        let (size, pitch) = element_size(kind, component);
        let data = match json.buffer_view {
            Some(view) => {
                let stride = stride(source, view, pitch)?;
                let offset = json.byte_offset.map_or(0, |o| o.0);
                Some(Elements { view, offset, stride, count }.checked(source, &place, size)?)
            }
            None => None,
        };
        let sparse = json.sparse.as_ref().map(|s| SparseLayout::new(source, place + "/sparse", s, count, size, pitch));
        // Floats are never normalised, whatever the file says.
        let normalized = json.normalized && component != ComponentType::F32;
        Ok(Self { count, kind, format: (component, normalized), data, sparse: sparse.transpose()? })
    }
}

impl SparseLayout {
    fn new(
        source: &Source<'_>,
        place: String,
        json: &json::accessor::sparse::Sparse,
        elements: u64,
        size: u64,
        pitch: u64,
    ) -> Result<Self, ImportError> {
        let count = json.count.0;
        if count > elements {
            let cause = format!("{count} elements are replaced, but there are {elements}");
            return Err(source.invalid(place + "/count", cause));
        }
        let Checked::Valid(component) = json.indices.component_type else {
            return Err(source.invalid(place + "/indices/componentType", "indices are of type 5121, 5123 or 5125"));
        };
        let (component, width) = (component.0, component.0.size() as u64);
        let (view, offset) = (json.indices.buffer_view, json.indices.byte_offset.0);
        let indices = Elements { view, offset, stride: width, count };
        let indices = indices.checked(source, &format!("{place}/indices"), width)?;
        let (view, offset) = (json.values.buffer_view, json.values.byte_offset.0);
        let values = Elements { view, offset, stride: pitch, count };
        let values = values.checked(source, &format!("{place}/values"), size)?;
        Ok(Self { place, component, indices, values })
    }
}

impl Elements {
    /// Checks that elements of `size` bytes lie inside the buffer view.
    fn checked(self, source: &Source<'_>, place: &str, size: u64) -> Result<Self, ImportError> {
        let available = source.check_view(self.view)?.len() as u64;
        let Self { view, offset, stride, count } = self;
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(steps) => steps.checked_mul(stride).and_then(|n| n.checked_add(size)),
        };
        if needed.and_then(|n| n.checked_add(offset)).is_none_or(|end| end > available) {
            let cause = format!(
                "{count} elements of {size} bytes, {stride} apart, from byte {offset} leave buffer view {}, which has \
                 {available}",
                view.value()
            );
            return Err(source.invalid(place, cause));
        }
        Ok(self)
    }

    fn data<'a>(&self, source: &'a Source<'_>) -> Result<Strided<'a>, ImportError> {
        // An empty accessor may have its offset at the very end.
        Ok(Strided { bytes: &source.view(self.view)?[self.offset as usize..], stride: self.stride as usize })
    }
}

impl<'a> Accessor<'a> {
    /// Checks an accessor and finds its data.
    ///
    /// # Errors
    /// As [`Layout::new`], and if its buffer has no data.
    pub(super) fn new(source: &'a Source<'_>, index: Index<json::Accessor>) -> Result<Self, ImportError> {
        let Layout { count, kind, format, data, sparse } = Layout::new(source, index)?;
        if data.is_none() {
            check_count(source, index, MOST_ZEROS.saturating_add(source.bytes()))?;
            let bytes = count.saturating_mul(element_size(kind, ComponentType::F32).1);
            let Some(left) = source.zeros.0.load(Relaxed).checked_sub(bytes) else {
                let cause = "accessors without data are read so often that their zeros would take too much memory";
                return Err(source.at(format!("/accessors/{}", index.value()), ErrorKind::Limit(cause.into())));
            };
            source.zeros.0.store(left, Relaxed);
        }
        let data = data.map(|d| d.data(source)).transpose()?;
        let sparse = sparse.map(|s| Sparse::new(source, &s, count)).transpose()?;
        Ok(Self { count: count as usize, kind, format, data, sparse })
    }

    /// Elements one after the other; `bytes` must have so many.
    pub(super) fn packed(count: usize, kind: Type, format: Format, bytes: &'a [u8]) -> Self {
        let stride = kind.multiplicity() * format.0.size();
        Self { count, kind, format, data: Some(Strided { bytes, stride }), sparse: None }
    }

    /// Vectors of `N` floats, normalised integers unpacked as the specification's section 3.11 says.
    ///
    /// `N` must be the number of components of the accessor's type.
    pub(super) fn floats<const N: usize>(&self) -> Vec<[f32; N]> {
        use ComponentType::{F32, I8, I16, U8, U16, U32};
        match self.format {
            (F32, _) => self.collect(|b: [u8; 4]| f32::from_le_bytes(b)),
            (I8, true) => self.collect(|[b]| (f32::from(b as i8) / 127.0).max(-1.0)),
            (I8, false) => self.collect(|[b]| f32::from(b as i8)),
            (U8, true) => self.collect(|[b]| f32::from(b) / 255.0),
            (U8, false) => self.collect(|[b]| f32::from(b)),
            (I16, true) => self.collect(|b| (f32::from(i16::from_le_bytes(b)) / 32767.0).max(-1.0)),
            (I16, false) => self.collect(|b| f32::from(i16::from_le_bytes(b))),
            (U16, true) => self.collect(|b| f32::from(u16::from_le_bytes(b)) / 65535.0),
            (U16, false) => self.collect(|b| f32::from(u16::from_le_bytes(b))),
            (U32, true) => self.collect(|b| (f64::from(u32::from_le_bytes(b)) / f64::from(u32::MAX)) as f32),
            (U32, false) => self.collect(|b| u32::from_le_bytes(b) as f32),
        }
    }

    /// Vectors of `N` unsigned integers; other component types give zeros.
    ///
    /// `N` must be the number of components of the accessor's type.
    pub(super) fn integers<const N: usize>(&self) -> Vec<[u32; N]> {
        use ComponentType::{F32, I8, I16, U8, U16, U32};
        match self.format.0 {
            U8 => self.collect(|[b]| u32::from(b)),
            U16 => self.collect(|b| u32::from(u16::from_le_bytes(b))),
            U32 => self.collect(u32::from_le_bytes),
            I8 | I16 | F32 => vec![[0; N]; self.count],
        }
    }

    fn collect<T: Copy + Default, const S: usize, const N: usize>(
        &self,
        component: impl Fn([u8; S]) -> T,
    ) -> Vec<[T; N]> {
        let element = |bytes: &[u8]| {
            let (parts, _) = bytes.as_chunks::<S>();
            std::array::from_fn(|k| parts.get(k).map_or_else(T::default, |&p| component(p)))
        };
        let mut all: Vec<[T; N]> = match self.data {
            Some(data) => (0..self.count).map(|i| element(&data.bytes[i * data.stride..])).collect(),
            None => vec![[T::default(); N]; self.count],
        };
        if let Some(Sparse { places, values }) = &self.sparse {
            for (k, &place) in places.iter().enumerate() {
                all[place as usize] = element(&values.bytes[k * values.stride..]);
            }
        }
        all
    }
}

impl<'a> Sparse<'a> {
    fn new(source: &'a Source<'_>, layout: &SparseLayout, elements: u64) -> Result<Self, ImportError> {
        let indices = Accessor {
            count: layout.indices.count as usize,
            kind: Type::Scalar,
            format: (layout.component, false),
            data: Some(layout.indices.data(source)?),
            sparse: None,
        };
        let places = indices.integers::<1>().as_flattened().to_vec();
        let invalid = |cause| Err(source.invalid(format!("{}/indices", layout.place), cause));
        if let Some(k) = (1..places.len()).find(|&k| places[k] <= places[k - 1]) {
            return invalid(format!("index {} after {} (number {k}) does not increase", places[k], places[k - 1]));
        }
        if let Some(&last) = places.last().filter(|&&last| u64::from(last) >= elements) {
            return invalid(format!("index {last} is out of range: there are {elements} elements"));
        }
        Ok(Self { places, values: layout.values.data(source)? })
    }
}

fn check_count(source: &Source<'_>, index: Index<json::Accessor>, limit: u64) -> Result<(), ImportError> {
    let count = source.root.accessors[index.value()].count.0;
    if count > limit {
        let cause = format!("{count} elements are more than the limit of {limit}");
        return Err(source.at(format!("/accessors/{}/count", index.value()), ErrorKind::Limit(cause)));
    }
    Ok(())
}

/// Bytes from one element to the next.
fn stride(source: &Source<'_>, view: Index<json::buffer::View>, pitch: u64) -> Result<u64, ImportError> {
    let Some(stride) = source.root.buffer_views[view.value()].byte_stride else { return Ok(pitch) };
    let stride = stride.0 as u64;
    if stride < pitch || stride > json::buffer::MAX_BYTE_STRIDE as u64 {
        let place = format!("/bufferViews/{}/byteStride", view.value());
        let cause = format!("{stride} is not in {pitch}..=252, where {pitch} is the size of an element");
        return Err(source.invalid(place, cause));
    }
    Ok(stride)
}

/// Bytes of an element, without and with what fills it up: columns of matrices begin at multiples of four bytes.
fn element_size(kind: Type, component: ComponentType) -> (u64, u64) {
    let (rows, columns) = match kind {
        Type::Scalar => (1, 1),
        Type::Vec2 => (2, 1),
        Type::Vec3 => (3, 1),
        Type::Vec4 => (4, 1),
        Type::Mat2 => (2, 2),
        Type::Mat3 => (3, 3),
        Type::Mat4 => (4, 4),
    };
    let column = rows * component.size() as u64;
    let pitch = if columns == 1 { column } else { column.next_multiple_of(4) };
    ((columns - 1) * pitch + column, columns * pitch)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use gltf::json::Root;
    use proptest::prelude::*;

    use super::*;
    use crate::{Options, Report};

    /// Reads accessor 0 of a file whose only buffer is `bin`.
    fn with<T>(json: &str, bin: &[u8], f: impl FnOnce(Accessor<'_>) -> T) -> Result<T, String> {
        let (options, file) = (Options::default(), Path::new("a.gltf"));
        let text =
            format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": {}}}], {json}}}"#, bin.len());
        let root = Root::from_str(&text).map_err(|e| e.to_string())?;
        let source =
            Source::new(file, &root, Some(bin), &options, &mut Report::default()).map_err(|e| e.to_string())?;
        Accessor::new(&source, Index::new(0)).map(f).map_err(|e| e.to_string())
    }

    fn one(accessor: &str, stride: Option<usize>, bin: &[u8]) -> Result<Vec<[f32; 2]>, String> {
        let stride = stride.map_or(String::new(), |s| format!(r#", "byteStride": {s}"#));
        let view = format!(r#"{{"buffer": 0, "byteLength": {}{stride}}}"#, bin.len());
        with(&format!(r#""bufferViews": [{view}], "accessors": [{{"bufferView": 0, {accessor}}}]"#), bin, |a| {
            a.floats()
        })
    }

    #[test]
    fn integers_are_unpacked_as_the_specification_says() {
        let bytes = [0x00, 0x80, 0x7f, 0xff];
        let read = |kind: u32, normalized: bool| {
            let count = if kind < 5122 { 2 } else { 1 };
            one(
                &format!(r#""type": "VEC2", "componentType": {kind}, "normalized": {normalized}, "count": {count}"#),
                None,
                &bytes,
            )
            .unwrap()
        };
        assert_eq!(read(5120, true), [[0.0, -1.0], [1.0, -1.0 / 127.0]]);
        assert_eq!(read(5120, false), [[0.0, -128.0], [127.0, -1.0]]);
        assert_eq!(read(5121, true), [[0.0, 128.0 / 255.0], [127.0 / 255.0, 1.0]]);
        assert_eq!(read(5122, true), [[-1.0, -129.0 / 32767.0]]);
        assert_eq!(read(5123, true), [[32768.0 / 65535.0, 65407.0 / 65535.0]]);
        assert_eq!(read(5123, false), [[32768.0, 65407.0]]);
    }

    #[test]
    fn the_last_element_needs_no_full_stride() {
        let bytes: Vec<u8> = [1.0_f32, 2.0, 9.0, 3.0, 4.0].iter().flat_map(|f| f.to_le_bytes()).collect();
        let accessor = r#""type": "VEC2", "componentType": 5126, "count": 2"#;
        assert_eq!(one(accessor, Some(12), &bytes).unwrap(), [[1.0, 2.0], [3.0, 4.0]]);
        let error = one(accessor, Some(16), &bytes).unwrap_err();
        assert!(error.contains("/accessors/0: 2 elements of 8 bytes, 16 apart, from byte 0 leave"), "{error}");
        assert!(one(accessor, Some(4), &bytes).unwrap_err().contains("/bufferViews/0/byteStride: 4 is not in 8..=252"));
    }

    #[test]
    fn counts_and_offsets_do_not_overflow() {
        for (count, offset) in [(u64::MAX, 0), (1 << 30, u64::MAX), (2, u64::MAX - 3), (1, 9), (0, 17)] {
            let a = format!(r#""type": "VEC2", "componentType": 5126, "count": {count}, "byteOffset": {offset}"#);
            assert!(one(&a, None, &[0; 16]).is_err(), "{count} {offset}");
        }
        let zeros = r#""accessors": [{"type": "VEC2", "componentType": 5126, "count": 1000000000}]"#;
        assert!(with(zeros, &[], |_| ()).unwrap_err().contains("more than the limit of 1048576"));
    }

    #[test]
    fn sparse_elements_replace_zeros_and_data() {
        let mut bin: Vec<u8> = [1.0_f32, 2.0, 3.0, 4.0].iter().flat_map(|f| f.to_le_bytes()).collect();
        bin.extend([1, 2]);
        let accessors = |base: &str, indices: &str| {
            format!(
                r#""bufferViews": [{{"buffer": 0, "byteLength": 16}}, {{"buffer": 0, "byteOffset": 16, "byteLength": 2}}],
                   "accessors": [{{{base} "type": "VEC2", "componentType": 5126, "count": 3, "sparse": {{"count": 1,
                     "indices": {{"bufferView": 1, {indices} "componentType": 5121}}, "values": {{"bufferView": 0}}}}}}]"#
            )
        };
        let floats = |a: Accessor<'_>| a.floats::<2>();
        assert_eq!(with(&accessors("", ""), &bin, floats).unwrap(), [[0.0; 2], [1.0, 2.0], [0.0; 2]]);
        let last = r#""byteOffset": 1,"#;
        assert_eq!(with(&accessors("", last), &bin, floats).unwrap(), [[0.0; 2], [0.0; 2], [1.0, 2.0]]);
        bin[16] = 3;
        assert!(with(&accessors("", ""), &bin, floats).unwrap_err().contains("index 3 is out of range"));
    }

    proptest! {
        /// Whatever an accessor says, it is read or refused.
        #[test]
        fn any_accessor_is_read_or_refused(
            kind in prop::sample::select(vec!["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]),
            component in prop::sample::select(vec![5120, 5121, 5122, 5123, 5125, 5126]),
            count in 0_u64..40, offset in 0_u64..40, view in (0_u64..100, 0_u64..300), stride in 1_u64..300,
        ) {
            let json = format!(
                r#""bufferViews": [{{"buffer": 0, "byteOffset": {}, "byteLength": {}, "byteStride": {stride}}}],
                   "accessors": [{{"bufferView": 0, "type": "{kind}", "componentType": {component}, "count": {count},
                   "byteOffset": {offset}}}]"#, view.0, view.1
            );
            if let Ok(read) = with(&json, &[7; 256], |a| (a.floats::<4>(), a.integers::<1>())) {
                prop_assert_eq!((read.0.len(), read.1.len()), (count as usize, count as usize));
            }
        }
    }
}
