//! Skins in their rest pose: which transform moves which vertex.

use glam::{DAffine3, DMat3, Vec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::{Index, Skin};

use super::accessor::Accessor;
use super::source::Source;
use crate::ImportError;

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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

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
