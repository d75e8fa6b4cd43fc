//! Vertex normals where the file has none.

use std::collections::HashMap;

use glam::DVec3;

use super::parse::{Model, NONE};
use super::polygon::area_vector;

/// Faces that meet at less than this angle look round in files that say nothing about shading.
const CREASE_DEGREES: f64 = 40.0;

/// At the tip of a larger fan the crease rule is not tried: its work is the square of the number of faces.
const MOST_FACES_AT_CREASE: usize = 256;

/// Gives corners without a normal one of their smoothing group, or of their crease-bounded patch, and returns the
/// unit normal of every face (zero without area). Corners that stay without are flat.
///
/// - In a smoothing group (`s`) the normal at a vertex is the mean over the group's faces, weighted by their angles
///   there (Thuermer and Wuethrich, "Computing vertex normals from polygonal facets", 1998).
/// - Faces outside of groups are flat, *unless* the file has neither `s` nor any normal: then it is a scan or the
///   output of a simple program, and neighbours that meet at less than 40 degrees are smoothed, so that round things
///   look round and boxes keep their edges.
pub(super) fn complete(model: &mut Model) -> Vec<DVec3> {
    let mut points = Vec::new();
    let faces: Vec<DVec3> = model
        .faces
        .iter()
        .map(|f| {
            points.clear();
            points.extend(model.corners[f.range()].iter().map(|c| position(model, c.position)));
            area_vector(&points).normalize_or_zero()
        })
        .collect();
    let missing = model.faces.iter().any(|f| model.corners[f.range()].iter().any(|c| c.normal == NONE));
    if missing && model.says_smoothing {
        by_groups(model, &faces);
    } else if missing && model.normals.is_empty() {
        by_creases(model, &faces);
    }
    faces
}

fn position(model: &Model, index: u32) -> DVec3 {
    model.positions[index as usize].into()
}

/// Angle of a face at its k-th corner, seen past corners at the same place.
fn angle(model: &Model, face: usize, k: usize) -> f64 {
    let corners = &model.corners[model.faces[face].range()];
    let n = corners.len();
    let at = |k: usize| position(model, corners[k % n].position);
    let edge = |step: usize| (1..n).map(|d| at(k + step * d) - at(k)).find(|e| *e != DVec3::ZERO);
    match (edge(1), edge(n - 1)) {
        (Some(next), Some(last)) => f64::atan2(next.cross(last).length(), next.dot(last)),
        _ => 0.0,
    }
}

fn by_groups(model: &mut Model, normals: &[DVec3]) {
    let mut sums: Vec<DVec3> = Vec::new();
    let mut index: HashMap<(u32, u32), u32> = HashMap::new();
    for (f, face) in model.faces.iter().enumerate().filter(|(_, f)| f.smoothing != 0) {
        for k in 0..face.len as usize {
            let key = (model.corners[face.start as usize + k].position, face.smoothing);
            let i = *index.entry(key).or_insert_with(|| {
                sums.push(DVec3::ZERO);
                sums.len() as u32 - 1
            });
            sums[i as usize] += normals[f] * angle(model, f, k);
        }
    }
    let first = model.normals.len() as u32;
    for face in model.faces.iter().filter(|f| f.smoothing != 0) {
        for corner in &mut model.corners[face.range()] {
            let i = index[&(corner.position, face.smoothing)];
            // Where a group folds back on itself there is no mean direction.
            if corner.normal == NONE && sums[i as usize].try_normalize().is_some() {
                corner.normal = first + i;
            }
        }
    }
    model.normals.extend(sums.iter().map(|n| n.normalize_or(DVec3::Z).as_vec3().to_array()));
}

/// For each position the first one that is equal to it: simple programs write the corners of every triangle anew.
fn welded(model: &Model) -> Vec<u32> {
    let mut first = HashMap::with_capacity(model.positions.len());
    let same = model.positions.iter().enumerate().map(|(i, p)| {
        // Adding zero makes -0 and 0 equal.
        *first.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(i as u32)
    });
    same.collect()
}

fn by_creases(model: &mut Model, normals: &[DVec3]) {
    let welded = welded(model);
    // The corners at each position, in the order of the file: `around[start[p]..start[p + 1]]`, as (face, k).
    let mut start = vec![0_u32; model.positions.len() + 1];
    for face in &model.faces {
        for c in &model.corners[face.range()] {
            start[welded[c.position as usize] as usize + 1] += 1;
        }
    }
    for p in 1..start.len() {
        start[p] += start[p - 1];
    }
    let mut next = start.clone();
    let mut around = vec![(0_u32, 0_u32); start.last().map_or(0, |&n| n as usize)];
    for (f, face) in model.faces.iter().enumerate() {
        for (k, c) in model.corners[face.range()].iter().enumerate() {
            let slot = &mut next[welded[c.position as usize] as usize];
            around[*slot as usize] = (f as u32, k as u32);
            *slot += 1;
        }
    }

    let least = CREASE_DEGREES.to_radians().cos();
    let mut weighted = Vec::new();
    for p in 0..model.positions.len() {
        let around = &around[start[p] as usize..start[p + 1] as usize];
        if around.len() > MOST_FACES_AT_CREASE {
            continue;
        }
        weighted.clear();
        weighted.extend(around.iter().map(|&(f, k)| {
            let n = normals[f as usize];
            (n, n * angle(model, f as usize, k as usize))
        }));
        // The same faces give the same sum, bit by bit, which is then stored once.
        let first = model.normals.len();
        for (&(f, k), &(own, _)) in around.iter().zip(&weighted) {
            let patch = weighted.iter().filter(|(n, _)| n.dot(own) > least);
            let Some(normal) = patch.map(|(_, w)| w).sum::<DVec3>().try_normalize() else { continue };
            let normal = normal.as_vec3().to_array();
            let known = model.normals[first..].iter().position(|n| *n == normal);
            let index = first + known.unwrap_or(model.normals.len() - first);
            if known.is_none() {
                model.normals.push(normal);
            }
            model.corners[model.faces[f as usize].start as usize + k as usize].normal = index as u32;
        }
    }
}
