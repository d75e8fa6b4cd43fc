//! Which triangles of materials with a glowing texture do not glow: where the texture is black. Most of a model is, and
//! need not look.

use firsthit_accel::HitId;
use firsthit_import::scene::SurfaceDesc;

use crate::material::Material;
use crate::surface::World;

/// The triangles of a scene that are known not to glow, although their material does.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dark {
    /// For each mesh, each of its parts: a bit a triangle; none where nothing is known.
    bits: Vec<Vec<Vec<u64>>>,
}

impl Dark {
    /// Looks at all triangles of materials that glow by a texture.
    pub(crate) fn new(world: &World, materials: &[Material]) -> Self {
        let mut bits: Vec<Vec<Vec<u64>>> =
            world.scene.meshes.iter().map(|m| vec![Vec::new(); m.geometries.len()]).collect();
        for (i, instance) in world.instances.iter().enumerate() {
            for (g, geometry) in world.scene.meshes[instance.mesh].geometries.iter().enumerate() {
                let id = HitId { instance: i as u32, geometry: g as u32, primitive: 0 };
                let material = &materials[world.material(id)];
                let texture = material.emissive_texture().filter(|_| material.glows());
                let (Some(texture), SurfaceDesc::Triangles(mesh)) = (texture, &geometry.surface) else { continue };
                let bits = &mut bits[instance.mesh][g];
                // All instances of a mesh have its materials and coordinates.
                if !bits.is_empty() {
                    continue;
                }
                bits.resize(mesh.triangles.len().div_ceil(64), 0);
                for primitive in 0..mesh.triangles.len() {
                    let uvs = world.corner_uvs(HitId { primitive: primitive as u32, ..id }, texture.uv_set());
                    let dark = uvs.is_some_and(|uvs| texture.is_black_over(uvs));
                    bits[primitive / 64] |= u64::from(dark) << (primitive % 64);
                }
            }
        }
        Self { bits }
    }

    /// Whether a triangle is known not to glow.
    #[inline]
    pub(crate) fn is_dark(&self, world: &World, id: HitId) -> bool {
        let of_mesh = &self.bits[world.mesh_of(id)][id.geometry as usize];
        of_mesh.get(id.primitive as usize / 64).is_some_and(|word| word >> (id.primitive % 64) & 1 == 1)
    }
}
