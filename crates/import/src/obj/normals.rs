//! Vertex normals where the file has none.

use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};

use glam::DVec3;

use super::model::{Corner, Model, NONE};
use super::polygon::area_vector;
use crate::unit;

/// Faces that meet at less than this angle look round in files that say nothing about shading.
const CREASE_DEGREES: f64 = 40.0;

/// At the tip of a larger fan the crease rule is not tried: its work is the square of the number of faces.
const MOST_FACES_AT_CREASE: u32 = 256;

/// Gives corners without a normal one of their smoothing group, or of their crease-bounded patch. Corners that stay
/// without are flat.
///
/// - In a smoothing group (`s`) the normal at a vertex is the mean over the group's faces, weighted by their angles
///   there (Thuermer and Wuethrich, "Computing vertex normals from polygonal facets", 1998).
/// - Faces outside of groups are flat, *unless* the file has neither `s` nor any normal: then it is a scan or the
///   output of a simple program, and neighbours that meet at less than 40 degrees are smoothed, so that round things
///   look round and boxes keep their edges.
pub(super) fn complete(model: &mut Model) {
    let missing = model.vertices.iter().any(|v| v.normal == NONE);
    if missing && model.says_smoothing {
        by_groups(model);
    } else if missing && model.normals.is_empty() {
        by_creases(model);
    }
}

/// The unit normal of a face; zero without area.
pub(super) fn of_face(model: &Model, face: usize, places: &mut Vec<DVec3>) -> DVec3 {
    area_of_face(model, face, places).normalize_or_zero()
}

/// Twice the area of a face, along its normal.
#[inline]
fn area_of_face(model: &Model, face: usize, places: &mut Vec<DVec3>) -> DVec3 {
    match model.corners_of(face) {
        &[a, b, c] => {
            let [a, b, c] = [a, b, c].map(|corner| model.place(corner));
            (b - a).cross(c - a)
        }
        _ => {
            model.places(face, places);
            area_vector(places)
        }
    }
}

/// A face as it counts for the normals of its corners.
#[derive(Default)]
struct Weighted {
    places: Vec<DVec3>,
    /// Unit, or zero without area.
    normal: DVec3,
    /// At each corner.
    angles: Vec<f64>,
}

impl Weighted {
    fn set(&mut self, model: &Model, face: usize) {
        self.angles.clear();
        model.places(face, &mut self.places);
        if let &[a, b, c] = self.places.as_slice() {
            let (ab, bc, ca) = (b - a, c - b, a - c);
            let vector = ab.cross(c - a);
            self.normal = vector.normalize_or_zero();
            if self.normal == DVec3::ZERO {
                self.angles.resize(3, 0.0);
                return;
            }
            let area = vector.length();
            let (at_a, at_b) = (f64::atan2(area, -ab.dot(ca)), f64::atan2(area, -bc.dot(ab)));
            // What the other two leave of half a turn.
            self.angles.extend([at_a, at_b, (std::f64::consts::PI - at_a - at_b).max(0.0)]);
        } else {
            self.normal = area_vector(&self.places).normalize_or_zero();
            for k in 0..self.places.len() {
                self.angles.push(angle(&self.places, k));
            }
        }
    }
}

/// Angle of a polygon at its k-th corner, seen past corners at the same place.
fn angle(places: &[DVec3], k: usize) -> f64 {
    let n = places.len();
    let edge = |step: usize| (1..n).map(|d| places[(k + step * d) % n] - places[k]).find(|e| *e != DVec3::ZERO);
    match (edge(1), edge(n - 1)) {
        (Some(next), Some(last)) => f64::atan2(next.cross(last).length(), next.dot(last)),
        _ => 0.0,
    }
}

fn by_groups(model: &mut Model) {
    let mut groups: HashMap<u32, Vec<std::ops::Range<usize>>> = HashMap::new();
    let mut order = Vec::new();
    for (faces, _, group) in model.faces.runs().filter(|run| run.2 != 0) {
        let runs = groups.entry(group).or_default();
        if runs.is_empty() {
            order.push(group);
        }
        runs.push(faces);
    }
    let mut weighted = Weighted::default();
    // Of the positions and vertices that a group has.
    let mut number_of = vec![NONE; model.positions.len()];
    let mut smooth_of = vec![NONE; model.vertices.len()];
    let (mut sums, mut touched): (Vec<DVec3>, Vec<u32>) = (Vec::new(), Vec::new());
    for group in order {
        sums.clear();
        for face in groups[&group].iter().cloned().flatten() {
            weighted.set(model, face);
            for (&corner, angle) in model.corners_of(face).iter().zip(&weighted.angles) {
                let number = &mut number_of[model.vertices[corner as usize].position as usize];
                if *number == NONE {
                    *number = sums.len() as u32;
                    sums.push(DVec3::ZERO);
                }
                sums[*number as usize] += weighted.normal * *angle;
            }
        }
        let first = model.normals.len() as u32;
        for corner in groups[&group].iter().cloned().flatten().flat_map(|face| model.faces.range(face)) {
            let old = model.corners[corner];
            let vertex = model.vertices[old as usize];
            let number = number_of[vertex.position as usize];
            // Where a group folds back on itself there is no mean direction.
            if vertex.normal != NONE || sums[number as usize].try_normalize().is_none() {
                continue;
            }
            let smooth = &mut smooth_of[old as usize];
            if *smooth == NONE {
                *smooth = model.vertices.len() as u32;
                model.vertices.push(Corner { normal: first + number, ..vertex });
                touched.push(old);
            }
            model.corners[corner] = *smooth;
        }
        model.normals.extend(sums.iter().map(|&n| unit::double(n).unwrap_or(DVec3::Z).as_vec3().to_array()));
        touched.drain(..).for_each(|vertex| smooth_of[vertex as usize] = NONE);
        for face in groups[&group].iter().cloned().flatten() {
            for &corner in model.corners_of(face) {
                number_of[model.vertices[corner as usize].position as usize] = NONE;
            }
        }
    }
}

/// For each position the first one that is equal to it: simple programs write the corners of every triangle anew.
fn welded(positions: &[[f64; 3]]) -> Vec<u32> {
    // Indices alone, in a table with open addresses: a map with the positions as keys would be as large as the mesh.
    let slots = (2 * positions.len()).next_power_of_two();
    let mut table = vec![NONE; slots];
    // Nobody can write a file whose positions all fall together.
    let seeds: [u64; 3] = [0, 1, 2].map(|k: u64| RandomState::new().hash_one(k));
    let mix = |a: u64, b: u64| {
        let product = u128::from(a) * u128::from(b | 1);
        (product >> 64) as u64 ^ product as u64
    };
    // Adding zero makes -0 and 0 equal.
    let bits = |p: [f64; 3]| p.map(|x| (x + 0.0).to_bits());
    let mut welded = Vec::with_capacity(positions.len());
    for (i, &position) in positions.iter().enumerate() {
        let key @ [x, y, z] = bits(position);
        let mut slot = mix(mix(x ^ seeds[0], y ^ seeds[1]) ^ z, seeds[2]) as usize & (slots - 1);
        let same = loop {
            match table[slot] {
                NONE => {
                    table[slot] = i as u32;
                    break i as u32;
                }
                other if bits(positions[other as usize]) == key => break other,
                _ => slot = (slot + 1) & (slots - 1),
            }
        };
        welded.push(same);
    }
    welded
}

fn by_creases(model: &mut Model) {
    let welded = welded(&model.positions);
    let at = |model: &Model, corner: u32| welded[model.vertices[corner as usize].position as usize] as usize;
    let mut count = vec![0_u32; model.positions.len()];
    let mut means = vec![DVec3::ZERO; model.positions.len()];
    let mut weighted = Weighted::default();
    for face in 0..model.faces.len() {
        weighted.set(model, face);
        for (&corner, angle) in model.corners_of(face).iter().zip(&weighted.angles) {
            let p = at(model, corner);
            count[p] += 1;
            means[p] += weighted.normal * *angle;
        }
    }
    means.iter_mut().for_each(|mean| *mean = mean.normalize_or_zero());

    // Faces within half the angle of their mean are one patch, for any two of them are within the angle. That is most of
    // a scan; where it does not hold the faces are looked at one by one.
    let least = (0.5 * CREASE_DEGREES).to_radians().cos() + 1e-9;
    let mut creased = vec![false; model.positions.len()];
    for face in 0..model.faces.len() {
        let normal = area_of_face(model, face, &mut weighted.places);
        let longest = least * normal.length();
        for &corner in model.corners_of(face) {
            let p = at(model, corner);
            if !(normal.dot(means[p]) > longest) {
                creased[p] = true;
            }
        }
    }
    let mut normal_of = vec![NONE; model.positions.len()];
    for (p, mean) in means.iter().enumerate() {
        if !creased[p] && (1..=MOST_FACES_AT_CREASE).contains(&count[p]) {
            normal_of[p] = model.normals.len() as u32;
            model.normals.push(mean.as_vec3().to_array());
        }
    }
    drop(means);
    for vertex in &mut model.vertices {
        vertex.normal = normal_of[welded[vertex.position as usize] as usize];
    }
    drop(normal_of);
    for p in 0..creased.len() {
        creased[p] &= count[p] <= MOST_FACES_AT_CREASE;
    }
    at_creases(model, &welded, &creased, &count);
}

/// The patches at the positions that are creased: each corner gets the mean of the faces within the angle of its own.
/// `count` says how many corners each position has.
fn at_creases(model: &mut Model, welded: &[u32], creased: &[bool], count: &[u32]) {
    // The corners at each of the positions, in the order of the file: `around[start[p]..start[p + 1]]`.
    let mut start = Vec::with_capacity(count.len() + 1);
    let mut total = 0;
    for (creased, count) in creased.iter().zip(count) {
        start.push(total);
        total += if *creased { *count } else { 0 };
    }
    start.push(total);
    if total == 0 {
        return;
    }
    let mut around = vec![0_u32; total as usize];
    let mut next = start.clone();
    for (c, &corner) in model.corners.iter().enumerate() {
        let p = welded[model.vertices[corner as usize].position as usize] as usize;
        if creased[p] {
            around[next[p] as usize] = c as u32;
            next[p] += 1;
        }
    }
    drop(next);

    let least = CREASE_DEGREES.to_radians().cos();
    let (mut places, mut weighted) = (Vec::new(), Vec::new());
    // The vertices that come of one: its index, the normal, the new index.
    let mut made: Vec<(u32, u32, u32)> = Vec::new();
    for p in 0..creased.len() {
        let around = &around[start[p] as usize..start[p + 1] as usize];
        weighted.clear();
        made.clear();
        for &c in around {
            let face = model.faces.of_corner(c as usize);
            model.places(face, &mut places);
            let normal = area_vector(&places).normalize_or_zero();
            weighted.push((normal, normal * angle(&places, c as usize - model.faces.range(face).start)));
        }
        // The same faces give the same sum, bit by bit, which is then stored once.
        let first = model.normals.len();
        for (&c, &(own, _)) in around.iter().zip(&weighted) {
            let patch = weighted.iter().filter(|(n, _)| n.dot(own) > least);
            let normal = match unit::double(patch.map(|(_, w)| w).sum::<DVec3>()) {
                None => NONE,
                Some(normal) => {
                    let normal = normal.as_vec3().to_array();
                    let known = model.normals[first..].iter().position(|n| *n == normal);
                    let index = first + known.unwrap_or(model.normals.len() - first);
                    if known.is_none() {
                        model.normals.push(normal);
                    }
                    index as u32
                }
            };
            let old = model.corners[c as usize];
            let known = made.iter().find(|(vertex, n, _)| (*vertex, *n) == (old, normal));
            let new = match known {
                Some(&(_, _, new)) => new,
                // The first takes the place of the vertex.
                None if made.iter().all(|(vertex, _, _)| *vertex != old) => old,
                None => {
                    let corner = model.vertices[old as usize];
                    model.vertices.push(corner);
                    (model.vertices.len() - 1) as u32
                }
            };
            if known.is_none() {
                model.vertices[new as usize].normal = normal;
                made.push((old, normal, new));
            }
            model.corners[c as usize] = new;
        }
    }
}
