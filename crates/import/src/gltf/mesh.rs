//! Primitives of meshes: vertex attributes, indices, topologies, morph targets
//! (glTF 2.0 specification, section 3.7.2).

use std::sync::Arc;

use glam::{Affine2, DVec3, Vec3, Vec4};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use serde_json::Value;

use super::attribute::Attributes;
use super::bake::Influence;
use super::draco::DracoPrimitives;
use super::source::Source;
use super::stroke::{self, Strokes};
use super::tangent;
use super::variant;
use crate::scene::{MaterialDesc, MaterialModel, TriangleMesh};
use crate::{ErrorKind, ImportError, Report, unit};

/// Triangles as the file has them: morph targets applied, normals and tangents only where they are given.
pub(super) struct Primitive {
    /// Its number in the mesh.
    pub(super) number: usize,
    pub(super) material: Option<usize>,
    pub(super) mesh: TriangleMesh,
    /// Sets of joints and weights; empty or as long as the positions.
    pub(super) influences: Vec<Vec<Influence>>,
}

/// The coordinates of a normal texture: tangents must fit them.
#[derive(Clone, Copy)]
pub(super) struct NormalMapping {
    pub(super) uv_set: usize,
    pub(super) transform: Affine2,
}

/// Reads meshes, within the limits of a scene.
pub(super) struct MeshReader<'a> {
    source: &'a Source<'a>,
    /// The file's JSON: the typed model does not have all that morph targets change.
    value: &'a Value,
    strokes: Strokes,
    /// Points and ends of lines so far for which no radius is given.
    thin: u64,
    quantized: bool,
    draco: Arc<DracoPrimitives>,
    variant: Option<u32>,
    /// Vertices read, those of shared arrays each time.
    read: u64,
    vertices: u64,
    triangles: u64,
    /// What the meshes take in memory.
    bytes: u64,
}

fn makes_triangles(mode: Mode) -> bool {
    matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
}

/// How often vertices may be read on average, against small files that make endless work.
const MOST_SHARING: u64 = 4;

/// Sets of texture coordinates that are kept.
const MOST_SETS: u32 = 8;

impl<'a> MeshReader<'a> {
    /// `value` is the JSON of the source. Materials are those of a variant, if one is given.
    ///
    /// # Errors
    /// If a compressed primitive cannot be decoded.
    pub(super) fn new(
        source: &'a Source<'a>,
        value: &'a Value,
        variant: Option<u32>,
        strokes: Strokes,
    ) -> Result<Self, ImportError> {
        let quantized = source.uses("KHR_mesh_quantization");
        let decode = || DracoPrimitives::new(source);
        let draco = match source.cache {
            Some(cache) => cache.draco(source.file, decode)?,
            None => Arc::new(decode()?),
        };
        let (read, vertices, triangles, bytes, thin) = (0, 0, 0, 0, 0);
        Ok(Self { source, value, strokes, thin, quantized, draco, variant, read, vertices, triangles, bytes })
    }

    /// Warns, once for a file, of primitives of points and lines that are not drawn.
    pub(super) fn warn_of_undrawn(&self, report: &mut Report) {
        if self.strokes.thin {
            return;
        }
        let mut count = 0_u64;
        let mut first = None;
        for (i, mesh) in self.source.root.meshes.iter().enumerate() {
            for (number, primitive) in mesh.primitives.iter().enumerate() {
                let has_positions = primitive.attributes.contains_key(&Checked::Valid(Semantic::Positions));
                let Checked::Valid(mode) = primitive.mode else { continue };
                if has_positions && !makes_triangles(mode) && self.strokes.radius(mode).is_none() {
                    count += 1;
                    first.get_or_insert((i, number));
                }
            }
        }
        if let Some((i, number)) = first {
            let message = format!("{count} primitives of points or lines are not drawn");
            report.warn(self.source.file, format!("/meshes/{i}/primitives/{number}"), message);
        }
    }

    /// Reads the primitives of a mesh that make triangles, with its morph targets by `weights` (the mesh's own where
    /// there are none).
    ///
    /// # Errors
    /// If an attribute has a wrong format or length, or an index is out of range.
    pub(super) fn read(
        &mut self,
        mesh: Index<json::Mesh>,
        weights: Option<&[f32]>,
        report: &mut Report,
    ) -> Result<Vec<Primitive>, ImportError> {
        let json = &self.source.root.meshes[mesh.value()];
        let weights = weights.or(json.weights.as_deref()).unwrap_or_default();
        let mut primitives = Vec::new();
        for (number, primitive) in json.primitives.iter().enumerate() {
            primitives.extend(self.primitive(mesh.value(), number, primitive, weights, report)?);
        }
        Ok(primitives)
    }

    fn primitive(
        &mut self,
        mesh: usize,
        number: usize,
        json: &json::mesh::Primitive,
        weights: &[f32],
        report: &mut Report,
    ) -> Result<Option<Primitive>, ImportError> {
        use Semantic::{Colors, Joints, Normals, Positions, Tangents, TexCoords, Weights};
        let source = self.source;
        let place = format!("/meshes/{mesh}/primitives/{number}");
        let draco = self.draco.get(mesh, number);
        let mode = match json.mode {
            // What is compressed comes out as separate triangles, also if it was a strip.
            Checked::Valid(_) if draco.is_some() => Mode::Triangles,
            Checked::Valid(mode) => mode,
            Checked::Invalid => return Err(source.invalid(place + "/mode", "is no topology of glTF (0 to 6)")),
        };
        let Some(&positions) = json.attributes.get(&Checked::Valid(Positions)) else {
            report.warn(source.file, place, "has no POSITION: nothing to draw");
            return Ok(None);
        };
        self.check_memory(positions, json.indices, &place)?;
        let quantized = self.quantized;
        let mut attributes = Attributes { source, place: &place, report, quantized, count: None, draco };
        let positions = attributes.positions(positions, "attributes/POSITION")?;
        let count = positions.len();
        attributes.count = Some(count);
        self.read = self.read.saturating_add(count as u64);
        if self.read > source.limits.elements.saturating_mul(MOST_SHARING) {
            let cause = "primitives share arrays so often that reading them would take too long";
            return Err(source.at(place, ErrorKind::Limit(cause.into())));
        }

        let mut mesh = TriangleMesh { positions, ..TriangleMesh::default() };
        let mut influences: Vec<Vec<Influence>> = Vec::new();
        for (semantic, &index) in &json.attributes {
            let Checked::Valid(semantic) = semantic else { continue };
            let at = format!("attributes/{}", semantic.to_string());
            match semantic {
                Normals => mesh.normals = attributes.normals(index, &at)?,
                Tangents => mesh.tangents = attributes.tangents(index, &at)?,
                Colors(0) => mesh.colors = attributes.colors(index, &at)?,
                TexCoords(set) if *set >= MOST_SETS => {
                    attributes.warn(&at, format!("only {MOST_SETS} sets are read: left out"));
                }
                TexCoords(set) => {
                    let set = *set as usize;
                    mesh.uvs.resize(mesh.uvs.len().max(set + 1), Vec::new());
                    mesh.uvs[set] = attributes.uvs(index, &at)?;
                }
                Joints(set) => {
                    let Some(&weights) = json.attributes.get(&Checked::Valid(Weights(*set))) else {
                        return Err(source.invalid(format!("{place}/{at}"), "has no weights beside it"));
                    };
                    influences.push(attributes.influences(*set, index, weights)?);
                }
                // Further colours and the application's own attributes mean nothing here.
                Colors(_) | Weights(_) | Positions | Semantic::Extras(_) => {}
            }
        }
        for (j, target) in json.targets.iter().flatten().enumerate() {
            let weight = weights.get(j).copied().unwrap_or(0.0);
            let at = |name| format!("targets/{j}/{name}");
            // Read also where the weight is zero: a damaged file is told of.
            let weighted = |d: Vec3| if weight == 0.0 { Vec3::ZERO } else { d * weight };
            if let Some(index) = target.positions {
                let deltas = attributes.positions(index, &at("POSITION"))?;
                mesh.positions.iter_mut().zip(deltas).for_each(|(p, d)| *p += weighted(d));
            }
            if let Some(index) = target.normals {
                let deltas = attributes.normals(index, &at("NORMAL"))?;
                mesh.normals.iter_mut().zip(deltas).for_each(|(n, d)| *n += weighted(d));
            }
            if let Some(index) = target.tangents {
                let deltas = attributes.normals(index, &at("TANGENT"))?;
                mesh.tangents.iter_mut().zip(deltas).for_each(|(t, d)| *t += weighted(d).extend(0.0));
            }
            let more = self.value.pointer(&format!("{place}/targets/{j}")).and_then(Value::as_object);
            more_deltas(&mut attributes, more.into_iter().flatten(), j, weight, &mut mesh)?;
        }
        mesh.colors.iter_mut().for_each(|c| *c = c.clamp(Vec4::ZERO, Vec4::ONE));
        let indices = match json.indices {
            Some(index) => attributes.indices(index, count)?,
            None => (0..count as u32).collect(),
        };
        let radius = match self.strokes.radius(mode) {
            None if self.strokes.thin && !makes_triangles(mode) => {
                self.thin_radius(&mesh.positions, indices.len(), &place, report)
            }
            given => given,
        };
        if let Some(radius) = radius {
            let most = (indices.len() as u64).saturating_mul(stroke::MOST_ELEMENTS);
            if most > source.limits.elements {
                let cause = format!("{} points or lines to be drawn would take too many triangles", indices.len());
                return Err(source.at(place, ErrorKind::Limit(cause)));
            }
            (mesh, influences) = stroke::bodies(&mesh, &influences, mode, &indices, radius);
        } else if !makes_triangles(mode) {
            return Ok(None);
        }
        if mode == Mode::Triangles && !indices.len().is_multiple_of(3) {
            let message = format!("{} vertices make no whole triangles: the last are left out", indices.len());
            report.warn(source.file, place.as_str(), message);
        }
        if makes_triangles(mode) {
            mesh.triangles = triangles(mode, &indices);
        }
        let material = variant::material(source, json, self.variant, &place)?;
        let mut primitive = Primitive { number, material, mesh, influences };
        compact(&mut primitive);
        self.budget(&primitive.mesh, &place)?;
        let mesh = &mut primitive.mesh;
        if let Some(v) = mesh.positions.iter().position(|p| !p.is_finite()) {
            let cause = format!("a position is not finite: {}", mesh.positions[v]);
            return Err(source.invalid(place + "/attributes/POSITION", cause));
        }
        tidy(mesh, |what| report.warn(source.file, place.as_str(), what));
        if mesh.triangles.is_empty() {
            report.warn(source.file, place.as_str(), "has no triangles: nothing to draw");
            return Ok(None);
        }
        Ok(Some(primitive))
    }

    /// The radius of points or lines for which none is given; `None` where they are not drawn.
    fn thin_radius(&mut self, positions: &[Vec3], ends: usize, place: &str, report: &mut Report) -> Option<f32> {
        self.thin = self.thin.saturating_add(ends as u64);
        if self.thin > stroke::MOST_THIN {
            let message = format!("{ends} points or ends of lines are too many to be drawn unless a radius is given");
            report.warn(self.source.file, place, message);
            return None;
        }
        stroke::thin_radius(positions)
    }

    /// Checks, before they are read, that there is room for the positions and triangles that a primitive says it has.
    fn check_memory(
        &self,
        positions: Index<json::Accessor>,
        indices: Option<Index<json::Accessor>>,
        place: &str,
    ) -> Result<(), ImportError> {
        let count = |accessor: Index<json::Accessor>| self.source.root.accessors[accessor.value()].count.0;
        let (positions, indices) = (count(positions), count(indices.unwrap_or(positions)));
        // A position of 12 bytes; an index of 4, and as many of the triangles that it becomes.
        let bytes = positions.saturating_mul(12).saturating_add(indices.saturating_mul(8));
        self.check_bytes(self.bytes.saturating_add(bytes), place)
    }

    fn check_bytes(&self, bytes: u64, place: &str) -> Result<(), ImportError> {
        let memory = self.source.limits.check_memory("the meshes with this primitive", bytes, self.source.bytes());
        memory.map_err(|kind| self.source.at(place, kind))
    }

    fn budget(&mut self, mesh: &TriangleMesh, place: &str) -> Result<(), ImportError> {
        self.vertices += mesh.positions.len() as u64;
        self.triangles += mesh.triangles.len() as u64;
        self.bytes += mesh.bytes();
        self.check_bytes(self.bytes, place)?;
        let (most, limit) = (self.vertices.max(self.triangles), self.source.limits.elements);
        if most > limit {
            let cause = format!("with this primitive the scene has {most} elements, more than the limit of {limit}");
            return Err(self.source.at(place, ErrorKind::Limit(cause)));
        }
        Ok(())
    }
}

/// Warns of textures that are read by texture coordinates which a primitive does not have.
pub(super) fn warn_of_missing_uvs(
    source: &Source<'_>,
    mesh: usize,
    primitives: &[Primitive],
    materials: &[MaterialDesc],
    report: &mut Report,
) {
    for primitive in primitives {
        let Some(MaterialModel::Pbr(pbr)) = primitive.material.map(|m| &materials[m].model) else { continue };
        let lacking = |set: &usize| primitive.mesh.uvs.get(*set).is_none_or(Vec::is_empty);
        if let Some(set) = pbr.textures().map(|t| t.uv_set).find(lacking) {
            let place = format!("/meshes/{mesh}/primitives/{}/attributes", primitive.number);
            let message = format!("there is no TEXCOORD_{set}, by which the material reads a texture: (0, 0) is taken");
            report.warn(source.file, place, message);
        }
    }
}

/// Adds what a morph target changes of texture coordinates and colours.
fn more_deltas<'v>(
    attributes: &mut Attributes<'_>,
    target: impl Iterator<Item = (&'v String, &'v Value)>,
    number: usize,
    weight: f32,
    mesh: &mut TriangleMesh,
) -> Result<(), ImportError> {
    for (semantic, index) in target {
        let at = format!("targets/{number}/{semantic}");
        let set = semantic.strip_prefix("TEXCOORD_").and_then(|s| s.parse::<usize>().ok());
        if semantic != "COLOR_0" && set.is_none() {
            continue;
        }
        let accessors = attributes.source.root.accessors.len();
        let Some(index) = index.as_u64().filter(|i| *i < accessors as u64) else {
            let place = format!("{}/{at}", attributes.place);
            return Err(attributes.source.invalid(place, format!("no such accessor: there are {accessors}")));
        };
        let index = Index::new(index as u32);
        match set {
            Some(set) => {
                let deltas = attributes.uv_deltas(index, &at)?;
                let uvs = mesh.uvs.get_mut(set).into_iter().flatten();
                uvs.zip(deltas).for_each(|(uv, d)| *uv += d * weight);
            }
            None => {
                let deltas = attributes.color_deltas(index, &at)?;
                mesh.colors.iter_mut().zip(deltas).for_each(|(c, d)| *c += d * weight);
            }
        }
    }
    Ok(())
}

/// Triangles of a primitive, wound as the specification's section 3.7.2.1 says.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let wound = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            indices.windows(3).enumerate().map(wound).collect()
        }
        Mode::TriangleFan => {
            let Some((&hub, rim)) = indices.split_first() else { return Vec::new() };
            rim.windows(2).map(|w| [w[0], w[1], hub]).collect()
        }
        Mode::Triangles => indices.as_chunks().0.to_vec(),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    }
}

/// How many triangles a primitive makes, by what its accessors say.
pub(super) fn triangle_count(root: &json::Root, primitive: &json::mesh::Primitive) -> u64 {
    let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
    let Some(&accessor) = primitive.indices.as_ref().or(positions) else { return 0 };
    let count = root.accessors[accessor.value()].count.0;
    match primitive.mode {
        Checked::Valid(Mode::Triangles) => count / 3,
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => count.saturating_sub(2),
        _ => 0,
    }
}

/// Drops vertices that no triangle uses: many primitives may share one long array.
fn compact(primitive: &mut Primitive) {
    fn gather<T: Copy>(values: &mut Vec<T>, kept: &[u32]) {
        if !values.is_empty() {
            *values = kept.iter().map(|&v| values[v as usize]).collect();
        }
    }
    let mesh = &mut primitive.mesh;
    let mut new = vec![u32::MAX; mesh.positions.len()];
    for &v in mesh.triangles.as_flattened() {
        new[v as usize] = 0;
    }
    let kept: Vec<u32> = (0..new.len() as u32).filter(|&v| new[v as usize] == 0).collect();
    if kept.len() == new.len() {
        return;
    }
    for (n, &v) in kept.iter().enumerate() {
        new[v as usize] = n as u32;
    }
    mesh.triangles.as_flattened_mut().iter_mut().for_each(|v| *v = new[*v as usize]);
    gather(&mut mesh.positions, &kept);
    gather(&mut mesh.normals, &kept);
    gather(&mut mesh.tangents, &kept);
    gather(&mut mesh.colors, &kept);
    mesh.uvs.iter_mut().for_each(|set| gather(set, &kept));
    primitive.influences.iter_mut().for_each(|set| gather(set, &kept));
}

/// Makes normals and tangents unit. Normals that have no direction get that of the triangles around; tangents go
/// with the normals, as the specification says, or all together if one has no direction.
fn tidy(mesh: &mut TriangleMesh, mut warn: impl FnMut(String)) {
    let mut bad = Vec::new();
    for (v, n) in mesh.normals.iter_mut().enumerate() {
        match unit::single(*n) {
            Some(unit) => *n = unit,
            None => bad.push(v),
        }
    }
    if !bad.is_empty() {
        warn(format!("{} normals have no direction: those of the triangles around are taken", bad.len()));
        let mut around = vec![DVec3::ZERO; mesh.positions.len()];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
            t.iter().for_each(|&v| around[v as usize] += (b - a).cross(c - a));
        }
        bad.into_iter().for_each(|v| mesh.normals[v] = unit::double(around[v]).unwrap_or(DVec3::Z).as_vec3());
    }
    if mesh.normals.is_empty() {
        mesh.tangents.clear();
    }
    let mut lost = false;
    for t in &mut mesh.tangents {
        match unit::single(t.truncate()) {
            Some(unit) => *t = unit.extend(if t.w < 0.0 { -1.0 } else { 1.0 }),
            None => lost = true,
        }
    }
    if lost {
        warn("a tangent has no direction: all are computed anew where they are needed".into());
        mesh.tangents.clear();
    }
}

/// Adds tangents where a normal texture needs them and the file gives none.
pub(super) fn complete(mesh: &mut TriangleMesh, mapping: Option<NormalMapping>) {
    if let Some(NormalMapping { uv_set, transform }) = mapping
        && mesh.tangents.is_empty()
    {
        tangent::generate(mesh, uv_set, transform);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        let indices = [10, 11, 12, 13, 14];
        assert_eq!(triangles(Mode::TriangleStrip, &indices), [[10, 11, 12], [11, 13, 12], [12, 13, 14]]);
        assert_eq!(triangles(Mode::TriangleFan, &indices), [[11, 12, 10], [12, 13, 10], [13, 14, 10]]);
        assert_eq!(triangles(Mode::Triangles, &indices), [[10, 11, 12]]);
        for mode in [Mode::TriangleStrip, Mode::TriangleFan, Mode::Triangles] {
            (0..3).for_each(|n| assert!(triangles(mode, &indices[..n]).is_empty()));
        }
    }

    #[test]
    fn vertices_that_nothing_uses_are_dropped() {
        let positions: Vec<Vec3> = (0..5).map(|i| Vec3::splat(i as f32)).collect();
        let mesh = TriangleMesh { positions, triangles: vec![[4, 1, 3]], ..Default::default() };
        let mut p = Primitive { number: 0, material: None, mesh, influences: Vec::new() };
        compact(&mut p);
        assert_eq!(p.mesh.positions, [Vec3::splat(1.0), Vec3::splat(3.0), Vec3::splat(4.0)]);
        assert_eq!(p.mesh.triangles, [[2, 0, 1]]);
    }

    #[test]
    fn normals_without_direction_come_from_the_triangles() {
        let mut mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            normals: vec![Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::NAN],
            tangents: vec![Vec4::new(3.0, 0.0, 0.0, -2.0); 3],
            ..Default::default()
        };
        let mut warnings = Vec::new();
        tidy(&mut mesh, |w| warnings.push(w));
        assert_eq!(mesh.normals, [Vec3::Z; 3]);
        assert_eq!(mesh.tangents, [Vec4::new(1.0, 0.0, 0.0, -1.0); 3]);
        assert_eq!(warnings.len(), 1);
    }
}
