//! What moves, at several moments at once, so that one camera fits them all.

use std::collections::HashSet;

use firsthit_import::SceneDesc;
use firsthit_import::scene::InstanceDesc;

/// A scene with everything that is somewhere in one of the poses of a scene: what stands still is in it once. Materials,
/// lights and all else are those of the first pose.
#[must_use]
pub fn all_poses(poses: impl IntoIterator<Item = SceneDesc>) -> SceneDesc {
    let mut poses = poses.into_iter();
    let Some(mut all) = poses.next() else { return SceneDesc::default() };
    // What each mesh of the pose before is in the scene: most stay as they are.
    let mut known: Vec<usize> = (0..all.meshes.len()).collect();
    let mut there: HashSet<_> = all.instances.iter().map(key).collect();
    for pose in poses {
        let mut now = Vec::with_capacity(pose.meshes.len());
        for (i, mesh) in pose.meshes.into_iter().enumerate() {
            match known.get(i) {
                Some(&k) if all.meshes[k].same_shape(&mesh) => now.push(k),
                _ => {
                    now.push(all.meshes.len());
                    all.meshes.push(mesh);
                }
            }
        }
        for mut instance in pose.instances {
            instance.mesh = now[instance.mesh];
            if there.insert(key(&instance)) {
                all.instances.push(instance);
            }
        }
        known = now;
    }
    all
}

/// What is equal for instances that look the same: the mesh and the bits of the transform.
fn key(instance: &InstanceDesc) -> (usize, [u64; 12]) {
    // -0 and 0 are one number.
    (instance.mesh, instance.transform.to_cols_array().map(|x| (x + 0.0).to_bits()))
}

#[cfg(test)]
mod tests {
    use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;

    fn pose(height: f32, x: f64) -> SceneDesc {
        let mesh = |height| {
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y + Vec3::Z * height];
            let mesh = TriangleMesh { positions, triangles: vec![[0, 1, 2]], ..TriangleMesh::default() };
            let surface = SurfaceDesc::Triangles(mesh);
            let geometries = vec![GeometryDesc { name: String::new(), surface, material: None }];
            MeshDesc { name: String::new(), geometries }
        };
        let instance = |mesh, x| InstanceDesc {
            name: String::new(),
            mesh,
            transform: DAffine3::from_translation(DVec3::X * x),
            moves_to: None,
        };
        SceneDesc {
            meshes: vec![mesh(0.0), mesh(height)],
            instances: vec![instance(0, 0.0), instance(1, x)],
            ..SceneDesc::default()
        }
    }

    #[test]
    fn what_stands_still_is_there_once() {
        let all = all_poses([pose(1.0, 0.0), pose(1.0, 2.0), pose(3.0, 2.0), pose(3.0, 2.0)]);
        let places: Vec<_> = all.instances.iter().map(|i| (i.mesh, i.transform.translation.x)).collect();
        assert_eq!(places, [(0, 0.0), (1, 0.0), (1, 2.0), (2, 2.0)]);
        assert_eq!(all.meshes.len(), 3);
    }

    #[test]
    fn many_instances_are_compared_once() {
        // 80,000 in each of two poses, of which one moves. Each against all others would be billions of comparisons.
        let count = 80_000;
        let many = |x: f64| {
            let mut pose = pose(1.0, x);
            let still = pose.instances[0].clone();
            pose.instances.extend((0..count).map(|k| InstanceDesc {
                transform: DAffine3::from_translation(DVec3::Y * f64::from(k + 1)),
                ..still.clone()
            }));
            pose
        };
        let all = all_poses([many(0.0), many(-0.0), many(2.0)]);
        assert_eq!(all.instances.len(), count as usize + 3);
    }
}
