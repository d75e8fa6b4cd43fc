//! Putting scenes into scenes: merging with indices kept right, and moving.

use glam::{DAffine3, DMat3, DVec3};

use crate::SceneDesc;
use crate::scene::{
    CameraDesc, EnvironmentDesc, InstanceDesc, LensDesc, LightDesc, LightKind, MaterialModel, Projection,
};

/// What of a scene has a place in the world. Indices are those of the scene it was adopted by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Placeable {
    pub(crate) instances: Vec<InstanceDesc>,
    pub(crate) lights: Vec<LightDesc>,
    pub(crate) cameras: Vec<CameraDesc>,
}

impl SceneDesc {
    /// Adds another scene's content, moved by `transform`. The indices of what is already here stay as they are.
    ///
    /// The name and the settings of `self` stay; environment and fog of `other` are taken over, unmoved, where `self` has
    /// none. Spheres of light and orthographic cameras grow by the cube root of the transform's determinant.
    ///
    /// ```
    /// use firsthit_import::{SceneDesc, scene::*};
    /// use glam::{DAffine3, DVec3};
    ///
    /// let part = SceneDesc {
    ///     meshes: vec![MeshDesc::default()],
    ///     instances: vec![InstanceDesc { name: "part".into(), mesh: 0, transform: DAffine3::IDENTITY, moves_to: None }],
    ///     ..SceneDesc::default()
    /// };
    /// let mut scene = part.clone();
    /// scene.append(part, DAffine3::from_translation(DVec3::X));
    /// assert_eq!(scene.instances[1].mesh, 1);
    /// assert_eq!(scene.instances[1].transform.translation, DVec3::X);
    /// ```
    pub fn append(&mut self, other: Self, transform: DAffine3) {
        let parts = self.adopt(other);
        self.place(parts, transform);
    }

    /// Takes over the data of another scene; what has a place is handed back, to be placed any number of times.
    pub(crate) fn adopt(&mut self, mut other: Self) -> Placeable {
        let (mesh, material, image) = (self.meshes.len(), self.materials.len(), self.images.len());
        for geometry in other.meshes.iter_mut().flat_map(|m| &mut m.geometries) {
            if let Some(index) = &mut geometry.material {
                *index += material;
            }
        }
        for m in &mut other.materials {
            if let MaterialModel::Pbr(pbr) = &mut m.model {
                pbr.textures_mut().for_each(|t| t.image += image);
            }
        }
        if self.environment.is_none() {
            if let Some(EnvironmentDesc::LatLong { image: index, .. }) = &mut other.environment {
                *index += image;
            }
            self.environment = other.environment;
        }
        self.fog = self.fog.or(other.fog);
        other.instances.iter_mut().for_each(|i| i.mesh += mesh);
        self.meshes.append(&mut other.meshes);
        self.materials.append(&mut other.materials);
        self.images.append(&mut other.images);
        Placeable { instances: other.instances, lights: other.lights, cameras: other.cameras }
    }

    /// Places what was adopted.
    pub(crate) fn place(&mut self, parts: Placeable, transform: DAffine3) {
        self.instances.extend(parts.instances.into_iter().map(|i| i.moved(transform)));
        self.lights.extend(parts.lights.into_iter().map(|l| l.moved(transform)));
        self.cameras.extend(parts.cameras.into_iter().map(|c| c.moved(transform)));
    }

    /// Leaves out the meshes that no instance places.
    pub(crate) fn drop_unused_meshes(&mut self) {
        let mut used = vec![false; self.meshes.len()];
        self.instances.iter().for_each(|i| used[i.mesh] = true);
        let new_index = keep(&mut self.meshes, &used);
        self.instances.iter_mut().for_each(|i| i.mesh = new_index[i.mesh]);
    }

    /// Leaves out the materials that no geometry has: those that were replaced, or that a file only lists.
    pub(crate) fn drop_unused_materials(&mut self) {
        let mut slots: Vec<&mut usize> =
            self.meshes.iter_mut().flat_map(|m| &mut m.geometries).filter_map(|g| g.material.as_mut()).collect();
        let mut used = vec![false; self.materials.len()];
        slots.iter().for_each(|m| used[**m] = true);
        let new_index = keep(&mut self.materials, &used);
        slots.iter_mut().for_each(|m| **m = new_index[**m]);
    }

    /// Leaves out the images that neither a material nor the environment shows.
    pub(crate) fn drop_unused_images(&mut self) {
        let textures = self.materials.iter_mut().filter_map(|m| match &mut m.model {
            MaterialModel::Pbr(pbr) => Some(pbr),
            _ => None,
        });
        let mut slots: Vec<&mut usize> = textures.flat_map(|pbr| pbr.textures_mut()).map(|t| &mut t.image).collect();
        if let Some(EnvironmentDesc::LatLong { image, .. }) = &mut self.environment {
            slots.push(image);
        }
        let mut used = vec![false; self.images.len()];
        slots.iter().for_each(|i| used[**i] = true);
        let new_index = keep(&mut self.images, &used);
        slots.iter_mut().for_each(|i| **i = new_index[**i]);
    }

    /// Moves everything that has a place: instances, lights, cameras. The environment stays.
    pub fn transform(&mut self, by: DAffine3) {
        let parts = Placeable {
            instances: std::mem::take(&mut self.instances),
            lights: std::mem::take(&mut self.lights),
            cameras: std::mem::take(&mut self.cameras),
        };
        self.place(parts, by);
    }
}

/// Leaves out the items that are not used; gives the new index of each that is.
fn keep<T>(items: &mut Vec<T>, used: &[bool]) -> Vec<usize> {
    let mut kept = 0;
    let new_index = used.iter().map(|&u| (kept, kept += usize::from(u)).0).collect();
    let mut used = used.iter();
    items.retain(|_| used.next() == Some(&true));
    new_index
}

impl Placeable {
    /// What it counts against [`Limits::instances`](crate::Limits::instances). Names are copied with what they name,
    /// so that a long one counts as several.
    pub(crate) fn count(&self) -> u64 {
        let names = self.instances.iter().map(|i| &i.name).chain(self.lights.iter().map(|l| &l.name));
        names.chain(self.cameras.iter().map(|c| &c.name)).map(|name| 1 + name.len() as u64 / 256).sum()
    }
}

impl InstanceDesc {
    fn moved(self, by: DAffine3) -> Self {
        Self { transform: by * self.transform, moves_to: self.moves_to.map(|m| by * m), ..self }
    }
}

impl LightDesc {
    fn moved(self, by: DAffine3) -> Self {
        use LightKind::{Directional, Point, Rectangle, Sphere, Spot};
        let turn = |d: DVec3| by.transform_vector3(d).try_normalize().unwrap_or(d);
        let kind = match self.kind {
            Point { position, intensity, range } => Point { position: by.transform_point3(position), intensity, range },
            Spot { position, direction, intensity, inner, outer, ramp, range } => Spot {
                position: by.transform_point3(position),
                direction: turn(direction),
                intensity,
                inner,
                outer,
                ramp,
                range,
            },
            Directional { direction, irradiance, angle } => {
                Directional { direction: turn(direction), irradiance, angle }
            }
            Rectangle { corner, edge_u, edge_v, radiance } => {
                let (u, v) = (by.transform_vector3(edge_u), by.transform_vector3(edge_v));
                // A mirror image shines to the mirrored side: the order of the edges says which.
                let (edge_u, edge_v) = if by.matrix3.determinant() < 0.0 { (v, u) } else { (u, v) };
                Rectangle { corner: by.transform_point3(corner), edge_u, edge_v, radiance }
            }
            Sphere { center, radius, radiance } => {
                Sphere { center: by.transform_point3(center), radius: radius * mean_scale(by), radiance }
            }
        };
        Self { name: self.name, kind }
    }
}

impl CameraDesc {
    /// A camera keeps its right angles whatever it stands on: it looks along the moved axis, as upright as before.
    fn moved(self, by: DAffine3) -> Self {
        let projection = match self.projection {
            Projection::Orthographic { half_height, aspect } => {
                Projection::Orthographic { half_height: half_height * mean_scale(by), aspect }
            }
            perspective @ Projection::Perspective { .. } => perspective,
        };
        let lens = self.lens.map(|lens| LensDesc {
            aperture: lens.aperture * mean_scale(by),
            focus_distance: lens.focus_distance.map(|d| d * mean_scale(by)),
        });
        let (transform, moves_to) = (upright(by, self.transform), self.moves_to.map(|to| upright(by, to)));
        Self { name: self.name, transform, projection, lens, moves_to }
    }
}

fn upright(by: DAffine3, camera: DAffine3) -> DAffine3 {
    let moved = by * camera;
    let back = moved.matrix3.z_axis.try_normalize();
    let right = moved.matrix3.y_axis.cross(moved.matrix3.z_axis).try_normalize();
    let matrix3 = match (back, right) {
        (Some(back), Some(right)) => DMat3::from_cols(right, back.cross(right), back),
        _ => camera.matrix3,
    };
    DAffine3 { matrix3, translation: moved.translation }
}

fn mean_scale(by: DAffine3) -> f64 {
    by.matrix3.determinant().abs().cbrt()
}
