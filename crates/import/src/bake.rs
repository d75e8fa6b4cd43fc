//! Vertices moved once and for all: by skins, and by transforms that rays cannot go back through.

use firsthit_geometry::transform::Transform;
use glam::{DAffine3, DMat3, DVec3, Vec4};

use crate::scene::{InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use crate::{ErrorKind, Limits, SceneDesc, unit};

impl SceneDesc {
    /// Leaves only instances with a transform that is usable: one for which there is a [`Transform`].
    ///
    /// For any other, what is left of its triangles is moved in f64; shapes, and meshes of which no surface is left,
    /// are not drawn, which `warn` is told with the index of the instance.
    ///
    /// # Errors
    /// [`ErrorKind::Limit`] if that makes more elements than a scene may have.
    pub(crate) fn bake(&mut self, limits: &Limits, mut warn: impl FnMut(usize, &str, String)) -> Result<(), ErrorKind> {
        let mut users = vec![0_usize; self.meshes.len()];
        self.instances.iter().for_each(|i| users[i.mesh] += 1);
        let mut elements: u64 = 0;
        let mut drawn = vec![true; self.instances.len()];
        for (i, instance) in self.instances.iter_mut().enumerate() {
            let Err(fault) = Transform::new(instance.transform) else { continue };
            let InstanceDesc { name, mesh, transform, moves_to } = instance;
            // It stays where it was when the shutter opened.
            *moves_to = None;
            let shared = users[*mesh] > 1;
            users[*mesh] -= 1;
            let whole = &mut self.meshes[*mesh];
            // Also for what vanishes: the work is done.
            elements += whole.elements();
            if elements > limits.elements {
                let cause = format!("moving meshes by transforms that cannot be undone makes {elements} elements");
                return Err(ErrorKind::Limit(format!("{cause}, more than the limit of {}", limits.elements)));
            }
            let mut moved = if shared { whole.clone() } else { std::mem::take(whole) };
            let parts = moved.geometries.len();
            let by = *transform;
            let origin = if by.translation.is_finite() { by.translation } else { DVec3::ZERO };
            moved.geometries.retain_mut(|g| match &mut g.surface {
                SurfaceDesc::Triangles(mesh) => deform(mesh, |_| by, origin) && !is_degenerate(mesh),
                SurfaceDesc::Shape(_) => false,
            });
            let left = moved.geometries.len();
            if left < parts {
                let which = if left == 0 { "not drawn" } else { "drawn only in part" };
                warn(i, name, format!("{fault}: {which}"));
            }
            drawn[i] = left > 0;
            if left > 0 {
                *transform = DAffine3::from_translation(origin);
                if shared {
                    *mesh = self.meshes.len();
                    self.meshes.push(moved);
                } else {
                    *whole = moved;
                }
            }
        }
        if drawn.contains(&false) {
            let mut drawn = drawn.into_iter();
            self.instances.retain(|_| drawn.next().unwrap_or(true));
            self.drop_unused_meshes();
        }
        Ok(())
    }
}

impl MeshDesc {
    /// Vertices or triangles, whichever are more.
    fn elements(&self) -> u64 {
        let of = |surface: &SurfaceDesc| match surface {
            SurfaceDesc::Triangles(mesh) => mesh.positions.len().max(mesh.triangles.len()) as u64,
            SurfaceDesc::Shape(_) => 0,
        };
        self.geometries.iter().map(|g| of(&g.surface)).sum()
    }
}

/// Moves every vertex `v` by `transform(v)` and returns to `origin`, so that f32 is fine enough.
///
/// Normals go by the matrix of cofactors, which serves singular matrices as well; where nothing of one is left, all
/// are dropped (flat). Where the transform mirrors, triangles are turned round, so that their outside stays outside.
/// Where the vertices would have moved to is forgotten. `false` if a position is no longer finite.
pub(crate) fn deform(mesh: &mut TriangleMesh, transform: impl Fn(usize) -> DAffine3, origin: DVec3) -> bool {
    mesh.moves_to = None;
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
            let moved = unit::double(cofactors * normal.as_dvec3() * side);
            flat |= moved.is_none();
            *normal = moved.unwrap_or(DVec3::Z).as_vec3();
        }
        if let Some(tangent) = mesh.tangents.get_mut(v) {
            let moved = unit::double(a * tangent.truncate().as_dvec3());
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

/// Whether no triangle of a mesh has an area.
fn is_degenerate(mesh: &TriangleMesh) -> bool {
    mesh.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
        (b - a).cross(c - a) == DVec3::ZERO
    })
}

fn largest(a: DMat3) -> f64 {
    a.to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::GeometryDesc;

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

    fn scene(transforms: &[DAffine3]) -> SceneDesc {
        let geometry = |surface| GeometryDesc { name: String::new(), surface, material: None };
        let instance = |&transform| InstanceDesc { name: String::new(), mesh: 0, transform, moves_to: None };
        SceneDesc {
            meshes: vec![MeshDesc {
                geometries: vec![geometry(SurfaceDesc::Triangles(triangle()))],
                ..MeshDesc::default()
            }],
            instances: transforms.iter().map(instance).collect(),
            ..SceneDesc::default()
        }
    }

    #[test]
    fn only_usable_transforms_are_left() {
        let scale = |x, y, z| DAffine3::from_scale(DVec3::new(x, y, z));
        let far = DAffine3::from_translation(DVec3::X / 0.0);
        let mut all = scene(&[
            scale(1.0, 1.0, 0.0),
            scale(0.0, 0.0, 0.0),
            scale(1.0, 1.0, 1e-7),
            scale(f64::NAN, 1.0, 1.0),
            far,
            scale(1e-30, 1e-30, -1e-30),
            scale(1.0, 100.0, 1e-3),
        ]);
        let mut warned = Vec::new();
        all.bake(&Limits::default(), |i, _, message| warned.push((i, message))).expect("within the limits");
        let left: Vec<usize> = warned.iter().map(|w| w.0).collect();
        assert_eq!(left, [1, 3, 4], "{warned:?}");
        assert_eq!(warned[0].1, "the transform is singular: not drawn");
        assert!(all.instances.iter().all(|i| Transform::new(i.transform).is_ok()));
        assert_eq!(all.instances.iter().map(|i| i.mesh).collect::<Vec<_>>(), [1, 2, 0, 0], "sound ones still share");

        let mut alone = scene(&[scale(1.0, 0.0, 0.0)]);
        alone.bake(&Limits::default(), |_, _, _| ()).expect("within the limits");
        assert!(alone.instances.is_empty() && alone.meshes.is_empty());
    }

    #[test]
    fn what_is_moved_is_limited() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let limits = Limits { elements: 6, ..Limits::default() };
        assert!(scene(&[flat; 2]).bake(&limits, |_, _, _| ()).is_ok());
        assert!(matches!(scene(&[flat; 3]).bake(&limits, |_, _, _| ()), Err(ErrorKind::Limit(_))));
    }
}
