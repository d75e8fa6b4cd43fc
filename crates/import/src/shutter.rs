//! What moves while the camera's shutter is open, from the scene at two times.

use firsthit_geometry::transform::Transform;

use crate::SceneDesc;
use crate::scene::{CameraDesc, MeshDesc, SurfaceDesc, TriangleMesh, Vertices};

impl SceneDesc {
    /// Lets what is elsewhere in `later`, the same scene when the shutter closes, move there: instances, vertices and
    /// cameras. The answer says what stands still although it differs: meshes of other triangles, cameras that see
    /// otherwise, and lights.
    pub(crate) fn move_to(&mut self, later: Self) -> Option<String> {
        if self.instances.len() != later.instances.len() || self.meshes.len() != later.meshes.len() {
            return Some("other things are there when the shutter closes: nothing is blurred".into());
        }
        let mut left = Vec::new();
        if format!("{:?}", self.lights) != format!("{:?}", later.lights) {
            left.push("lights".to_owned());
        }
        let goes_on: Vec<bool> = self.meshes.iter_mut().zip(later.meshes).map(|(a, b)| a.move_to(b)).collect();
        for (instance, after) in self.instances.iter_mut().zip(&later.instances) {
            let same = instance.mesh == after.mesh && goes_on[instance.mesh];
            if same && instance.transform != after.transform && Transform::new(after.transform).is_ok() {
                instance.moves_to = Some(after.transform);
            }
        }
        let others = goes_on.iter().filter(|goes_on| !**goes_on).count();
        if others > 0 {
            left.insert(0, format!("{others} meshes, which have other triangles when it closes"));
        }
        let sees = |c: &CameraDesc| (c.name.clone(), c.projection);
        if self.cameras.iter().map(sees).eq(later.cameras.iter().map(sees)) {
            for (camera, after) in self.cameras.iter_mut().zip(&later.cameras) {
                camera.moves_to = Some(after.transform).filter(|to| *to != camera.transform);
            }
        } else {
            left.push("cameras".to_owned());
        }
        (!left.is_empty()).then(|| format!("as when the shutter opens, not blurred: {}", left.join(", ")))
    }
}

impl MeshDesc {
    /// Lets the vertices move to where they are in `later`; `false`, and nothing moves, if that is another mesh.
    fn move_to(&mut self, later: Self) -> bool {
        let pairs = || self.geometries.iter().zip(&later.geometries).map(|(a, b)| (&a.surface, &b.surface));
        let same = |(a, b): (&SurfaceDesc, &SurfaceDesc)| match (a, b) {
            (SurfaceDesc::Triangles(a), SurfaceDesc::Triangles(b)) => {
                let lengths = |m: &TriangleMesh| (m.positions.len(), m.normals.len(), m.tangents.len());
                a.triangles == b.triangles && lengths(a) == lengths(b)
            }
            (SurfaceDesc::Shape(a), SurfaceDesc::Shape(b)) => a == b,
            _ => false,
        };
        if self.geometries.len() != later.geometries.len() || !pairs().all(same) {
            return false;
        }
        for (a, b) in self.geometries.iter_mut().zip(later.geometries) {
            if let (SurfaceDesc::Triangles(a), SurfaceDesc::Triangles(b)) = (&mut a.surface, b.surface)
                && a.positions != b.positions
            {
                let TriangleMesh { positions, normals, tangents, .. } = b;
                a.moves_to = Some(Box::new(Vertices { positions, normals, tangents }));
            }
        }
        true
    }

    /// Whether two meshes have the same vertices, triangles and shapes.
    #[must_use]
    pub fn same_shape(&self, other: &Self) -> bool {
        let same = |a: &SurfaceDesc, b: &SurfaceDesc| match (a, b) {
            (SurfaceDesc::Triangles(a), SurfaceDesc::Triangles(b)) => {
                a.positions == b.positions && a.triangles == b.triangles
            }
            (SurfaceDesc::Shape(a), SurfaceDesc::Shape(b)) => a == b,
            _ => false,
        };
        let pairs = || self.geometries.iter().zip(&other.geometries);
        self.geometries.len() == other.geometries.len() && pairs().all(|(a, b)| same(&a.surface, &b.surface))
    }
}

#[cfg(test)]
mod tests {
    use firsthit_geometry::shapes::Sphere;
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::scene::{GeometryDesc, InstanceDesc, Projection};

    fn scene(surface: SurfaceDesc, at: [f64; 2]) -> SceneDesc {
        let geometries = vec![GeometryDesc { name: String::new(), surface, material: None }];
        let instance = |x| InstanceDesc {
            name: String::new(),
            mesh: 0,
            transform: DAffine3::from_translation(DVec3::X * x),
            moves_to: None,
        };
        SceneDesc {
            meshes: vec![MeshDesc { name: String::new(), geometries }],
            instances: at.map(instance).into(),
            ..SceneDesc::default()
        }
    }

    fn ball(radius: f64, at: [f64; 2]) -> SceneDesc {
        scene(SurfaceDesc::Shape(Sphere::new(DVec3::ZERO, radius).expect("sphere").into()), at)
    }

    fn triangle(height: f32, triangles: Vec<[u32; 3]>) -> SceneDesc {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y * height];
        let mesh = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
        scene(SurfaceDesc::Triangles(mesh), [0.0; 2])
    }

    #[test]
    fn what_moves_is_found_and_what_cannot_is_told() {
        let mut moving = ball(1.0, [0.0, 5.0]);
        assert_eq!(moving.move_to(ball(1.0, [2.0, 5.0])), None);
        let to: Vec<_> = moving.instances.iter().map(|i| i.moves_to.map(|m| m.translation.x)).collect();
        assert_eq!(to, [Some(2.0), None]);
        let said = ball(1.0, [0.0, 5.0]).move_to(ball(2.0, [2.0, 5.0]));
        let words = "as when the shutter opens, not blurred: 1 meshes, which have other triangles when it closes";
        assert_eq!(said.as_deref(), Some(words));
        assert!(ball(1.0, [0.0; 2]).move_to(SceneDesc::default()).is_some());
    }

    #[test]
    fn vertices_move_where_triangles_stay() {
        let mut moving = triangle(1.0, vec![[0, 1, 2]]);
        assert_eq!(moving.move_to(triangle(3.0, vec![[0, 1, 2]])), None);
        let SurfaceDesc::Triangles(mesh) = &moving.meshes[0].geometries[0].surface else { unreachable!() };
        assert_eq!(mesh.moves_to.as_ref().map(|to| to.positions[2]), Some(Vec3::Y * 3.0));
        assert!(triangle(1.0, vec![[0, 1, 2]]).move_to(triangle(3.0, vec![[0, 2, 1]])).is_some());
    }

    #[test]
    fn cameras_move_if_they_see_as_before() {
        let with_camera = |x: f64, half_height| {
            let mut scene = ball(1.0, [0.0; 2]);
            scene.cameras.push(CameraDesc {
                name: String::new(),
                transform: DAffine3::from_translation(DVec3::X * x),
                projection: Projection::Orthographic { half_height, aspect: None },
                lens: None,
                moves_to: None,
            });
            scene
        };
        let mut moving = with_camera(0.0, 1.0);
        assert_eq!(moving.move_to(with_camera(1.0, 1.0)), None);
        assert_eq!(moving.cameras[0].moves_to.map(|m| m.translation.x), Some(1.0));
        assert!(with_camera(0.0, 1.0).move_to(with_camera(1.0, 2.0)).is_some());
    }
}
