//! Vertices moved on the CPU: skins in their rest pose, and nodes whose transform has no inverse.

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::{Index, Skin};

use super::accessor::Accessor;
use super::source::Source;
use crate::ImportError;
use crate::scene::TriangleMesh;

/// Up to four joints that move a vertex, and how much each does.
pub(super) type Influence = ([u32; 4], [f32; 4]);

/// From the space of a skinned mesh to the world, for each joint: the joint's own transform after the inverse of the
/// one it had when it was bound.
///
/// # Errors
/// If the inverse bind matrices are no 4x4 matrices of floats, or too few.
pub(super) fn joint_transforms(
    source: &Source<'_>,
    skin: Index<Skin>,
    world: &[DAffine3],
) -> Result<Vec<DAffine3>, ImportError> {
    let json = &source.root.skins[skin.value()];
    let mut transforms: Vec<DAffine3> = json.joints.iter().map(|j| world[j.value()]).collect();
    if let Some(index) = json.inverse_bind_matrices {
        let place = || format!("/skins/{}/inverseBindMatrices", skin.value());
        let accessor = Accessor::new(source, index)?;
        if accessor.kind != Type::Mat4 || accessor.format.0 != ComponentType::F32 {
            return Err(source.invalid(place(), "expected MAT4 of floats (5126)"));
        }
        if accessor.count < transforms.len() {
            let cause = format!("{} matrices for {} joints", accessor.count, transforms.len());
            return Err(source.invalid(place(), cause));
        }
        for (transform, m) in transforms.iter_mut().zip(accessor.floats::<16>()) {
            if m.iter().any(|x| !x.is_finite()) {
                return Err(source.invalid(place(), "a matrix is not finite"));
            }
            let column = |k: usize| Vec3::new(m[k], m[k + 1], m[k + 2]).as_dvec3();
            let matrix = DMat3::from_cols(column(0), column(4), column(8));
            *transform *= DAffine3::from_mat3_translation(matrix, column(12));
        }
    }
    Ok(transforms)
}

/// The transform of a vertex: the joints' by weight (linear blend skinning). A vertex without weight follows its
/// first joint. `None` if a joint does not exist.
pub(super) fn blend(influences: &[Influence], joints: &[DAffine3]) -> Option<DAffine3> {
    let mut sum = DAffine3::ZERO;
    let mut total = 0.0;
    for (indices, weights) in influences {
        for (&joint, &weight) in indices.iter().zip(weights) {
            if weight != 0.0 && weight.is_finite() {
                let (joint, weight) = (joints.get(joint as usize)?, f64::from(weight));
                sum = add(sum, *joint, weight);
                total += weight;
            }
        }
    }
    if total > 0.0 {
        return Some(add(DAffine3::ZERO, sum, 1.0 / total));
    }
    let first = influences.first().map_or(0, |(indices, _)| indices[0]);
    joints.get(first as usize).copied()
}

fn add(a: DAffine3, b: DAffine3, weight: f64) -> DAffine3 {
    DAffine3 { matrix3: a.matrix3 + b.matrix3 * weight, translation: a.translation + b.translation * weight }
}

/// Moves every vertex `v` by `transform(v)` and returns to `origin`, so that f32 is fine enough.
///
/// Normals go by the matrix of cofactors, which serves singular matrices as well; where nothing of one is left, all
/// are dropped (flat). Where the transform mirrors, triangles are turned round, so that their outside stays outside.
/// `false` if a position is no longer finite.
pub(super) fn deform(mesh: &mut TriangleMesh, transform: impl Fn(usize) -> DAffine3, origin: DVec3) -> bool {
    let mut mirrored = 0_usize;
    let mut flat = false;
    for v in 0..mesh.positions.len() {
        let m = transform(v);
        let a: DMat3 = m.matrix3;
        let side = if a.determinant() < 0.0 { -1.0 } else { 1.0 };
        mirrored += usize::from(side < 0.0);
        let p = (m.transform_point3(mesh.positions[v].as_dvec3()) - origin).as_vec3();
        if !p.is_finite() {
            return false;
        }
        mesh.positions[v] = p;
        if let Some(normal) = mesh.normals.get_mut(v) {
            // Scaled to the length 1 first: cofactors of tiny matrices would underflow.
            let b = a * (1.0 / largest(a));
            let cofactors =
                DMat3::from_cols(b.y_axis.cross(b.z_axis), b.z_axis.cross(b.x_axis), b.x_axis.cross(b.y_axis));
            let moved = (cofactors * normal.as_dvec3() * side).try_normalize();
            flat |= moved.is_none();
            *normal = moved.unwrap_or(DVec3::Z).as_vec3();
        }
        if let Some(tangent) = mesh.tangents.get_mut(v) {
            let moved = (a * tangent.truncate().as_dvec3()).try_normalize();
            *tangent = moved.map_or(Vec4::ZERO, |t| t.as_vec3().extend(tangent.w * side as f32));
        }
    }
    if flat {
        mesh.normals.clear();
    }
    if flat || mesh.tangents.contains(&Vec4::ZERO) {
        mesh.tangents.clear();
    }
    if 2 * mirrored > mesh.positions.len() {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    true
}

/// Whether a transform is so far from having an inverse that meshes are better moved once and for all: its condition
/// number (bounded by norms) exceeds 2^20, which leaves f32 less than four bits.
pub(super) fn is_singular(transform: &DAffine3) -> bool {
    let a: DMat3 = transform.matrix3;
    let scale = largest(a);
    if !(scale > 0.0 && scale.is_finite()) {
        return true;
    }
    let a = a * (1.0 / scale);
    let condition = frobenius(a) * frobenius(a.inverse());
    !(condition <= f64::from(1 << 20))
}

/// Whether no triangle of a mesh has an area.
pub(super) fn is_degenerate(mesh: &TriangleMesh) -> bool {
    mesh.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
        (b - a).cross(c - a) == DVec3::ZERO
    })
}

fn largest(a: DMat3) -> f64 {
    a.to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most))
}

fn frobenius(a: DMat3) -> f64 {
    a.to_cols_array().into_iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            normals: vec![Vec3::Z; 3],
            tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 3],
            ..TriangleMesh::default()
        }
    }

    fn face_normal(mesh: &TriangleMesh) -> Vec3 {
        let [a, b, c] = mesh.triangles[0].map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).normalize()
    }

    #[test]
    fn only_hopeless_transforms_are_singular() {
        let scale = |x, y, z| is_singular(&DAffine3::from_scale(DVec3::new(x, y, z)));
        assert!(scale(1.0, 1.0, 0.0) && scale(0.0, 0.0, 0.0) && scale(1.0, 1.0, 1e-7) && scale(f64::NAN, 1.0, 1.0));
        assert!(!scale(1e-30, 1e-30, -1e-30) && !scale(1.0, 100.0, 1e-3));
    }

    #[test]
    fn a_flattened_mesh_keeps_its_plane() {
        let mut mesh = triangle();
        assert!(deform(&mut mesh, |_| DAffine3::from_scale(DVec3::new(2.0, 2.0, 0.0)), DVec3::ZERO));
        assert_eq!(mesh.positions[1], 2.0 * Vec3::X);
        assert_eq!(mesh.normals, [Vec3::Z; 3]);
        assert!(!is_degenerate(&mesh));
        deform(&mut mesh, |_| DAffine3::from_scale(DVec3::new(0.0, 1.0, 1.0)), DVec3::ZERO);
        assert!(is_degenerate(&mesh) && mesh.normals.is_empty());
    }

    #[test]
    fn a_mirrored_mesh_keeps_its_outside() {
        let mut mesh = triangle();
        deform(&mut mesh, |_| DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), DVec3::ZERO);
        assert_eq!((face_normal(&mesh), mesh.normals[0]), (Vec3::Z, Vec3::Z));
        // The bitangent is that of the mirrored texture: still +Y.
        let t = mesh.tangents[0];
        assert_eq!(mesh.normals[0].cross(t.truncate()) * t.w, Vec3::Y);
    }

    #[test]
    fn joints_blend_by_weight_and_must_exist() {
        let joints = [DAffine3::from_translation(DVec3::X), DAffine3::from_translation(DVec3::Y)];
        let moved = |influence| blend(&[influence], &joints).map(|m| m.translation);
        assert_eq!(moved(([0, 1, 0, 0], [0.25, 0.75, 0.0, 0.0])), Some(DVec3::new(0.25, 0.75, 0.0)));
        // Weights that do not add up to one are taken as shares.
        assert_eq!(moved(([0, 1, 0, 0], [1.0, 3.0, 0.0, 0.0])), Some(DVec3::new(0.25, 0.75, 0.0)));
        assert_eq!(moved(([1, 0, 0, 0], [0.0; 4])), Some(DVec3::Y));
        // Joints that weigh nothing are not looked at.
        assert_eq!(moved(([0, 9, 9, 9], [1.0, 0.0, 0.0, 0.0])), Some(DVec3::X));
        assert_eq!(moved(([2, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])), None);
    }
}
