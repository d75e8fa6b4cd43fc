//! What moves while the camera's shutter is open, from the scene at two times.

use firsthit_geometry::transform::Transform;

use crate::SceneDesc;
use crate::scene::{CameraDesc, SurfaceDesc};

impl SceneDesc {
    /// Lets what is elsewhere in `later`, the same scene when the shutter closes, move there. The answer says what
    /// stands still although it differs: meshes that change their shape, cameras and lights.
    pub(crate) fn move_to(&mut self, later: &Self) -> Option<String> {
        if self.instances.len() != later.instances.len() || self.meshes.len() != later.meshes.len() {
            return Some("other things are there when the shutter closes: nothing is blurred".into());
        }
        let same: Vec<bool> = self.meshes.iter().zip(&later.meshes).map(|(a, b)| a.same_shape(b)).collect();
        for (instance, after) in self.instances.iter_mut().zip(&later.instances) {
            let still = instance.mesh == after.mesh && same[instance.mesh];
            if still && instance.transform != after.transform && Transform::new(after.transform).is_ok() {
                instance.moves_to = Some(after.transform);
            }
        }
        let place = |c: &CameraDesc| (c.transform, c.projection);
        let cameras = self.cameras.iter().map(place).ne(later.cameras.iter().map(place));
        let lights = format!("{:?}", self.lights) != format!("{:?}", later.lights);
        let deformed = same.iter().filter(|same| !**same).count();
        let mut left = Vec::new();
        if deformed > 0 {
            left.push(format!("the shape of {deformed} meshes"));
        }
        left.extend(cameras.then(|| "cameras".to_owned()));
        left.extend(lights.then(|| "lights".to_owned()));
        (!left.is_empty()).then(|| format!("{}: as when the shutter opens, not blurred", left.join(", ")))
    }
}

impl crate::scene::MeshDesc {
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
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::scene::{GeometryDesc, InstanceDesc, MeshDesc};

    fn scene(radius: f64, at: [f64; 2]) -> SceneDesc {
        let surface = SurfaceDesc::Shape(Sphere::new(DVec3::ZERO, radius).expect("sphere").into());
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

    #[test]
    fn what_moves_is_found_and_what_cannot_is_told() {
        let mut moving = scene(1.0, [0.0, 5.0]);
        assert_eq!(moving.move_to(&scene(1.0, [2.0, 5.0])), None);
        let to: Vec<_> = moving.instances.iter().map(|i| i.moves_to.map(|m| m.translation.x)).collect();
        assert_eq!(to, [Some(2.0), None]);
        let said = scene(1.0, [0.0, 5.0]).move_to(&scene(2.0, [2.0, 5.0]));
        assert_eq!(said.as_deref(), Some("the shape of 1 meshes: as when the shutter opens, not blurred"));
        assert!(scene(1.0, [0.0; 2]).move_to(&SceneDesc::default()).is_some());
    }
}
