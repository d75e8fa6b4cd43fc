//! What shading knows about the point that a ray meets: normals, texture coordinates, colours.

use std::cell::Cell;
use std::sync::Arc;

use firsthit_accel::{Hit, HitId, SurfacePoint};
use firsthit_geometry::{Primitive, Ray};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec2, Vec3, Vec4};

use crate::integrator::clock::Clock;
use crate::material::Colors;
use crate::texture::{TextureLookup, View};
use crate::{EffectSet, tally};

/// The scene's geometry with what shading needs beside the trees.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) scene: Arc<SceneDesc>,
    /// Meshes whose vertices are elsewhere at this moment: they count on from those of the scene.
    bent: Vec<MeshDesc>,
    pub(crate) instances: Vec<Instance>,
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    /// Index of its mesh in the scene.
    pub(crate) mesh: usize,
    /// See [`World::mesh`].
    shape: usize,
    pub(crate) transform: DAffine3,
    /// From world directions to the mesh's.
    inverse: DMat3,
    /// From the mesh's vectors to the world's.
    vectors: Mat3,
    /// From the mesh's normals to the world's (not unit).
    normals: Mat3,
    /// -1 where left and right are exchanged, else 1.
    mirrored: f32,
}

impl World {
    /// The scene with its instances at these places.
    pub(crate) fn new(scene: Arc<SceneDesc>, transforms: impl IntoIterator<Item = DAffine3>) -> Self {
        Self::bent(scene, transforms, Vec::new())
    }

    /// The same with other vertices of some of its meshes, which are told by their indices.
    pub(crate) fn bent(
        scene: Arc<SceneDesc>,
        transforms: impl IntoIterator<Item = DAffine3>,
        bent: Vec<(usize, MeshDesc)>,
    ) -> Self {
        let mut shapes: Vec<usize> = (0..scene.meshes.len()).collect();
        bent.iter().enumerate().for_each(|(k, (mesh, _))| shapes[*mesh] = scene.meshes.len() + k);
        let instances = scene
            .instances
            .iter()
            .zip(transforms)
            .map(|(i, transform)| {
                let inverse = transform.matrix3.inverse();
                Instance {
                    mesh: i.mesh,
                    shape: shapes[i.mesh],
                    transform,
                    inverse,
                    vectors: transform.matrix3.as_mat3(),
                    normals: inverse.transpose().as_mat3(),
                    mirrored: transform.matrix3.as_mat3().determinant().signum(),
                }
            })
            .collect();
        Self { scene, bent: bent.into_iter().map(|(_, mesh)| mesh).collect(), instances }
    }

    /// The mesh of an instance as it is at this moment.
    #[inline]
    pub(crate) fn mesh(&self, instance: &Instance) -> &MeshDesc {
        let meshes = &self.scene.meshes;
        // Most are those of the scene; what is looked for elsewhere is past their end.
        meshes.get(instance.shape).unwrap_or_else(|| &self.bent[instance.shape - meshes.len()])
    }

    /// Index of the material of a geometry; `materials` (one past the last) is the default material.
    #[inline]
    pub(crate) fn material(&self, id: HitId) -> usize {
        let mesh = self.instances[id.instance as usize].mesh;
        let default = self.scene.materials.len();
        self.scene.meshes[mesh].geometries[id.geometry as usize].material.unwrap_or(default)
    }

    #[inline]
    fn part(&self, id: HitId, u: f32, v: f32) -> Part<'_> {
        let instance = &self.instances[id.instance as usize];
        match &self.mesh(instance).geometries[id.geometry as usize].surface {
            SurfaceDesc::Triangles(mesh) => {
                let corners = mesh.triangles[id.primitive as usize].map(|i| i as usize);
                Part::Triangle { mesh, corners, weights: [1.0 - u - v, u, v] }
            }
            SurfaceDesc::Shape(shape) => {
                let size = shape.bounds().extent().max_element() as f32;
                // Shapes count v upwards, images downwards.
                Part::Shape {
                    uv: Vec2::new(u, 1.0 - v),
                    uv_per_length: if size.is_finite() { 1.0 / size } else { 1.0 },
                }
            }
        }
    }

    /// The mesh that an instance places.
    #[inline]
    pub(crate) fn mesh_of(&self, id: HitId) -> usize {
        self.instances[id.instance as usize].mesh
    }

    /// Texture coordinates of a triangle's corners; `None` where there are none.
    pub(crate) fn corner_uvs(&self, id: HitId, set: usize) -> Option<[Vec2; 3]> {
        let Part::Triangle { mesh, corners, .. } = self.part(id, 0.0, 0.0) else { return None };
        let uvs = mesh.uvs.get(set).filter(|uvs| !uvs.is_empty())?;
        Some(corners.map(|i| uvs[i]))
    }

    /// Whether it is a shape, not a triangle.
    pub(crate) fn is_shape(&self, id: HitId) -> bool {
        let instance = &self.instances[id.instance as usize];
        let geometry = &self.scene.meshes[instance.mesh].geometries[id.geometry as usize];
        matches!(geometry.surface, SurfaceDesc::Shape(_))
    }

    /// Whether a ray in this direction meets the outer side of a triangle or not; shapes always count as outside.
    pub(crate) fn faces(&self, id: HitId, direction: DVec3) -> bool {
        let instance = &self.instances[id.instance as usize];
        match &self.mesh(instance).geometries[id.geometry as usize].surface {
            SurfaceDesc::Triangles(mesh) => {
                let [a, b, c] = mesh.triangles[id.primitive as usize].map(|i| mesh.positions[i as usize].as_dvec3());
                (b - a).cross(c - a).dot(instance.inverse * direction) < 0.0
            }
            SurfaceDesc::Shape(_) => true,
        }
    }

    /// The surface at a hit for questions about its textures alone: normals are not filled in.
    pub(crate) fn attributes(&self, hit: &Hit, front: bool) -> Surface<'_> {
        Surface {
            id: hit.id,
            instance: &self.instances[hit.id.instance as usize],
            part: self.part(hit.id, hit.u, hit.v),
            point: SurfacePoint { position: DVec3::ZERO, normal: DVec3::ZERO, error: 0.0 },
            front,
            wo: Vec3::Z,
            geometric: Vec3::Z,
            smooth: Vec3::Z,
            curved: false,
            turned: false,
            cone: 0.0,
            width: 0.0,
            colors: Colors::All(1),
            seen: None,
            chance: 0.0,
            view: Cell::new(None),
            dark: false,
            clock: None,
        }
    }

    /// The surface at a hit, seen from `wo` by a cone that is `width` wide there.
    pub(crate) fn surface(&self, hit: &Hit, point: SurfacePoint, wo: Vec3, width: f32) -> Surface<'_> {
        let mut outward = point.normal.as_vec3();
        if outward == Vec3::ZERO {
            // The apex of a cone and the like.
            outward = wo;
        }
        let front = outward.dot(wo) >= 0.0;
        let geometric = if front { outward } else { -outward };
        let instance = &self.instances[hit.id.instance as usize];
        let part = self.part(hit.id, hit.u, hit.v);
        let (mut smooth, mut curved, mut turned) = (geometric, false, false);
        if let Some(n) = part.vertex_normal() {
            let n = instance.normals * n;
            // Vertex normals that disagree with the winding are turned with it.
            turned = n.dot(geometric) < 0.0;
            smooth = (if turned { -n } else { n }).try_normalize().unwrap_or(geometric);
            curved = true;
        }
        Surface {
            id: hit.id,
            instance,
            part,
            point,
            front,
            wo,
            geometric,
            smooth,
            curved,
            turned,
            cone: width,
            width,
            colors: Colors::All(1),
            seen: None,
            chance: chance(hit),
            view: Cell::new(None),
            dark: false,
            clock: None,
        }
    }
}

/// The primitive that was hit.
#[derive(Clone, Copy, Debug)]
enum Part<'a> {
    Triangle { mesh: &'a TriangleMesh, corners: [usize; 3], weights: [f32; 3] },
    Shape { uv: Vec2, uv_per_length: f32 },
}

impl Part<'_> {
    /// Interpolated vertex normal in the mesh's space, not unit.
    #[inline]
    fn vertex_normal(&self) -> Option<Vec3> {
        match self {
            Part::Triangle { mesh, corners, weights } if !mesh.normals.is_empty() => {
                Some((0..3).map(|i| mesh.normals[corners[i]] * weights[i]).sum())
            }
            _ => None,
        }
    }
}

/// How textures are looked at.
#[derive(Clone, Copy, Debug)]
struct Look {
    uv: Vec2,
    footprint: f32,
    /// The same for what is always seen sharp.
    sharp: f32,
}

/// A point of a surface as shading sees it. All directions are unit and in the world.
#[derive(Clone, Debug)]
pub(crate) struct Surface<'a> {
    pub(crate) id: HitId,
    instance: &'a Instance,
    part: Part<'a>,
    /// Where it is.
    pub(crate) point: SurfacePoint,
    /// Whether the viewer is on the outer side.
    pub(crate) front: bool,
    /// Towards the viewer.
    pub(crate) wo: Vec3,
    /// Geometric normal on the viewer's side.
    pub(crate) geometric: Vec3,
    /// Interpolated normal on the viewer's side.
    pub(crate) smooth: Vec3,
    /// Whether there are vertex normals.
    curved: bool,
    /// Whether these look to the other side.
    turned: bool,
    /// Width of the camera's view here, world units.
    cone: f32,
    /// Width of what is seen here as one: of that, or of all that a scattered path stands for.
    width: f32,
    /// Which colours the path is about that came here.
    pub(crate) colors: Colors,
    /// What textures of the first set are asked for, once that is known.
    seen: Option<Look>,
    /// A number from 0 to 1 by which one of two levels of textures is chosen.
    chance: f32,
    /// The view of a texture that was asked for last, with its layout and footprint.
    view: Cell<Option<(u32, f32, View)>>,
    /// It is known not to glow.
    pub(crate) dark: bool,
    /// Times the look-ups of textures here.
    pub(crate) clock: Option<&'a Clock>,
}

impl Surface<'_> {
    /// A look-up of a texture here, counted, and timed if that is asked for.
    #[inline]
    pub(crate) fn look_up<R>(&self, look_up: impl FnOnce() -> R) -> R {
        tally::look_up(EffectSet::TEXTURES);
        self.timed(look_up)
    }

    /// Work for textures, timed if that is asked for.
    #[inline]
    fn timed<R>(&self, work: impl FnOnce() -> R) -> R {
        match self.clock {
            None => work(),
            Some(clock) => clock.texturing(work),
        }
    }

    /// Barycentric weights of the second and third corner, or the shape's own parameters.
    pub(crate) fn parameters(&self) -> Vec2 {
        match self.part {
            Part::Triangle { weights, .. } => Vec2::new(weights[1], weights[2]),
            Part::Shape { uv, .. } => uv,
        }
    }

    /// Works out once what every texture of the first set asks for, with a cone of view that is at least this wide.
    pub(crate) fn look(&mut self, width: f32) {
        self.width = self.cone.max(width);
        self.seen = Some(self.timed(|| {
            let scale = self.uv_per_length(0);
            Look { uv: self.uv(0), footprint: finite(self.width * scale), sharp: finite(self.cone * scale) }
        }));
    }

    /// Where a texture is read here.
    #[inline]
    pub(crate) fn view(&self, texture: &TextureLookup) -> View {
        self.view_within(texture, self.footprint(texture.uv_set()))
    }

    /// The same seen as sharply as by the camera.
    #[inline]
    pub(crate) fn sharp_view(&self, texture: &TextureLookup) -> View {
        self.view_within(texture, self.sharp_footprint(texture.uv_set()))
    }

    /// The same this far away in texture coordinates.
    #[inline]
    pub(crate) fn view_beside(&self, texture: &TextureLookup, way: Vec2) -> View {
        let set = texture.uv_set();
        texture.view(self.uv(set) + way, self.footprint(set), self.chance)
    }

    /// Most materials have several textures that are laid out alike: they are read at the same places.
    #[inline]
    fn view_within(&self, texture: &TextureLookup, footprint: f32) -> View {
        let layout = texture.layout();
        match self.view.get() {
            Some((known, width, view)) if known == layout && width == footprint => view,
            _ => {
                let view = texture.view(self.uv(texture.uv_set()), footprint, self.chance);
                self.view.set(Some((layout, footprint, view)));
                view
            }
        }
    }

    /// Texture coordinates; (0, 0) where the mesh lacks the set.
    #[inline]
    pub(crate) fn uv(&self, set: usize) -> Vec2 {
        if let (Some(look), 0) = (self.seen, set) {
            return look.uv;
        }
        match self.part {
            Part::Triangle { mesh, corners, weights } => match mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) {
                Some(uvs) => (0..3).map(|i| uvs[corners[i]] * weights[i]).sum(),
                None => Vec2::ZERO,
            },
            Part::Shape { uv, .. } => uv,
        }
    }

    /// Vertex colour; white where there is none.
    pub(crate) fn color(&self) -> Vec4 {
        match self.part {
            Part::Triangle { mesh, corners, weights } if !mesh.colors.is_empty() => {
                tally::sample(EffectSet::VERTEX_COLORS);
                (0..3).map(|i| mesh.colors[corners[i]] * weights[i]).sum()
            }
            _ => Vec4::ONE,
        }
    }

    /// The corners of the triangle relative to its first one, in the world: second, third.
    fn edges(mesh: &TriangleMesh, corners: [usize; 3]) -> [Vec3; 2] {
        let a = mesh.positions[corners[0]];
        [mesh.positions[corners[1]] - a, mesh.positions[corners[2]] - a]
    }

    /// How wide what is seen as one is in texture coordinates.
    #[inline]
    pub(crate) fn footprint(&self, set: usize) -> f32 {
        match (self.seen, set) {
            (Some(look), 0) => look.footprint,
            _ if self.width <= 0.0 => 0.0,
            _ => finite(self.width * self.uv_per_length(set)),
        }
    }

    /// How wide the camera's view is in texture coordinates: of what light asks for as well as sight, which must be the
    /// same to both.
    #[inline]
    pub(crate) fn sharp_footprint(&self, set: usize) -> f32 {
        match (self.seen, set) {
            (Some(look), 0) => look.sharp,
            _ if self.cone <= 0.0 => 0.0,
            _ => finite(self.cone * self.uv_per_length(set)),
        }
    }

    /// How much of texture coordinates a unit of a view's width spans. Where the surface is seen at an angle, between the
    /// width across and the one along: its area is right.
    fn uv_per_length(&self, set: usize) -> f32 {
        let slant = self.wo.dot(self.geometric).abs().max(0.01);
        match self.part {
            Part::Triangle { mesh, corners, .. } => {
                let Some(uvs) = mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) else { return 0.0 };
                let [e1, e2] = Self::edges(mesh, corners).map(|e| self.instance.vectors * e);
                let area = e1.cross(e2).length();
                let uv_area = (uvs[corners[1]] - uvs[corners[0]]).perp_dot(uvs[corners[2]] - uvs[corners[0]]).abs();
                (uv_area / (area * slant)).sqrt()
            }
            Part::Shape { uv_per_length, .. } => uv_per_length / slant.sqrt(),
        }
    }

    /// Seen from the light, a coarse mesh with smooth normals shadows itself along its edges. Shadow rays therefore
    /// start on the curved surface that the normals mean: Hanika, "Hacking the Shadow Terminator" (Ray Tracing Gems
    /// II, chapter 4). This is the way from the point to there.
    pub(crate) fn lift(&self) -> DVec3 {
        let Part::Triangle { mesh, corners, weights } = self.part else { return DVec3::ZERO };
        if !self.curved {
            return DVec3::ZERO;
        }
        let point: Vec3 = (0..3).map(|i| mesh.positions[corners[i]] * weights[i]).sum();
        let outward = self.instance.normals * (0..3).map(|i| mesh.normals[corners[i]] * weights[i]).sum::<Vec3>();
        let side = if outward.dot(self.smooth) < 0.0 { -1.0 } else { 1.0 };
        let lift: Vec3 = (0..3)
            .map(|i| {
                let n = mesh.normals[corners[i]] * side;
                n * (-(point - mesh.positions[corners[i]]).dot(n).min(0.0) * weights[i])
            })
            .sum();
        let lift = self.instance.vectors * lift;
        if lift.is_finite() { lift.as_dvec3() } else { DVec3::ZERO }
    }

    /// How the position changes with the texture coordinates, in the mesh's space.
    fn position_by_uv(&self, set: usize) -> Option<[Vec3; 2]> {
        let Part::Triangle { mesh, corners, .. } = self.part else { return None };
        let uvs = mesh.uvs.get(set).filter(|uvs| !uvs.is_empty())?;
        let [e1, e2] = Self::edges(mesh, corners);
        let (d1, d2) = (uvs[corners[1]] - uvs[corners[0]], uvs[corners[2]] - uvs[corners[0]]);
        let inverse = d1.perp_dot(d2).recip();
        let (by_u, by_v) = ((e1 * d2.y - e2 * d1.y) * inverse, (e2 * d1.x - e1 * d2.x) * inverse);
        (by_u.is_finite() && by_v.is_finite()).then_some([by_u, by_v])
    }

    /// Unit directions in the world along growing u and v, as far as is known.
    fn along_uv(&self, set: usize) -> Option<[Vec3; 2]> {
        match self.part {
            Part::Triangle { .. } => {
                let [u, v] = self.position_by_uv(set)?.map(|d| self.instance.vectors * d);
                Some([u.try_normalize()?, v.try_normalize()?])
            }
            Part::Shape { .. } => {
                // Longitude runs about the shape's +Y axis.
                let axis = (self.instance.vectors * Vec3::Y).try_normalize()?;
                let outward = if self.front { self.smooth } else { -self.smooth };
                let u = axis.cross(outward).try_normalize()?;
                Some([u, u.cross(outward)])
            }
        }
    }

    /// Tangent and bitangent in the world: those of the mesh, else along the texture coordinates.
    pub(crate) fn tangents(&self, set: usize) -> Option<[Vec3; 2]> {
        let outward = if self.front { self.smooth } else { -self.smooth };
        match self.part {
            Part::Triangle { mesh, corners, weights } if !mesh.tangents.is_empty() => {
                let t: Vec4 = (0..3).map(|i| mesh.tangents[corners[i]] * weights[i]).sum();
                let tangent = (self.instance.vectors * t.truncate()).try_normalize()?;
                // The vertex normal, not turned to the winding: that is what the tangents were made with.
                let normal = match self.curved {
                    true if self.turned => -self.smooth,
                    true => self.smooth,
                    false => outward,
                };
                Some([tangent, normal.cross(tangent) * (t.w.signum() * self.instance.mirrored)])
            }
            // An image's v runs downwards, a normal map's y upwards.
            _ => self.along_uv(set).map(|[u, v]| [u, -v]),
        }
    }

    /// A normal from a normal map, in the world and on the viewer's side.
    pub(crate) fn mapped_normal(&self, n: Vec3, set: usize) -> Option<Vec3> {
        let outward = if self.front { self.smooth } else { -self.smooth };
        let [tangent, bitangent] = self.tangents(set)?;
        let n = (tangent * n.x + bitangent * n.y + outward * n.z).try_normalize()?;
        Some(if self.front { n } else { -n })
    }

    /// A normal tilted by the slope of a height map (rise per run along u and v).
    pub(crate) fn tilted(&self, normal: Vec3, slope: Vec2, set: usize) -> Option<Vec3> {
        let [u, v] = self.along_uv(set)?;
        let side = if self.front { 1.0 } else { -1.0 };
        let tilted = normal - (u * slope.x + v * slope.y) * side;
        tilted.try_normalize()
    }

    /// The normal, bent towards the geometric one as far as needed that the viewer sees its front and that mirror
    /// directions leave the surface. Without this, silhouettes of smooth or normal-mapped meshes get black fringes.
    pub(crate) fn bent(&self, normal: Vec3) -> Vec3 {
        let least = (0.9 * self.wo.dot(self.geometric)).min(0.01);
        let good = |n: Vec3| {
            let cos = self.wo.dot(n);
            cos >= least && (n * (2.0 * cos) - self.wo).dot(self.geometric) >= least
        };
        if good(normal) {
            return normal;
        }
        let blend = |t: f32| normal.lerp(self.geometric, t).try_normalize().unwrap_or(self.geometric);
        let (mut bad, mut fine) = (0.0, 1.0);
        for _ in 0..10 {
            let middle = 0.5 * (bad + fine);
            if good(blend(middle)) { fine = middle } else { bad = middle }
        }
        blend(fine)
    }
}

/// A number in [0, 1) that looks random from hit to hit: of where on its primitive it is.
#[inline]
fn chance(hit: &Hit) -> f32 {
    let mixed = (hit.u.to_bits() ^ hit.v.to_bits().rotate_left(16)).wrapping_mul(0x9e37_79b9);
    ((mixed ^ (mixed >> 15)).wrapping_mul(0x846c_a68b) >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// A width, if it is one.
fn finite(width: f32) -> f32 {
    if width.is_finite() { width } else { 0.0 }
}

/// How a straight ray crosses a primitive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// Outward unit normal in the world.
    pub(crate) normal: DVec3,
    /// Where it leaves a shape that it entered here; of triangles every crossing is a hit of its own.
    pub(crate) exit: Option<f64>,
}

impl World {
    /// The crossing at a candidate hit of a filter, whose normal is not filled in.
    pub(crate) fn crossing(&self, hit: &Hit, ray: &Ray<f64>) -> Crossing {
        let instance = &self.instances[hit.id.instance as usize];
        let geometry = &self.mesh(instance).geometries[hit.id.geometry as usize];
        let outward = |n: DVec3| (instance.inverse.transpose() * n).normalize_or_zero();
        match &geometry.surface {
            SurfaceDesc::Triangles(mesh) => {
                let [a, b, c] = mesh.triangles[hit.id.primitive as usize].map(|i| mesh.positions[i as usize]);
                let n = (b - a).as_dvec3().cross((c - a).as_dvec3());
                Crossing { normal: outward(n), exit: None }
            }
            SurfaceDesc::Shape(shape) => {
                let local = Ray {
                    origin: instance.inverse * (ray.origin - instance.transform.translation),
                    direction: instance.inverse * ray.direction,
                    ..*ray
                };
                let here = shape.closest_hit(&local);
                let normal = here.and_then(|h| h.normal).map_or(DVec3::ZERO, outward);
                let entered = normal.dot(ray.direction) < 0.0;
                let behind = local.with_interval(hit.t.next_up(), local.t_max);
                let exit = here.filter(|_| entered).and_then(|_| shape.closest_hit(&behind)).map(|h| h.t);
                Crossing { normal, exit }
            }
        }
    }
}
