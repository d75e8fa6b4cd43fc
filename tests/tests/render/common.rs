//! Small scenes and looks at single points of them.

use std::sync::Arc;

use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_geometry::{Shape, shapes::Sphere};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{
    GeometryDesc, InstanceDesc, MaterialDesc, MaterialModel, MeshDesc, SurfaceDesc, TriangleMesh,
};
use firsthit_render::{
    Clip, EnvironmentChoice, IntegratorChoice, RenderOptions, Rendered, Stage, StageOptions, render,
};
use glam::{DAffine3, DVec3};

/// A scene of these materials and nothing else yet.
pub(crate) fn scene_of(materials: &[MaterialModel]) -> SceneDesc {
    let materials =
        materials.iter().enumerate().map(|(i, m)| MaterialDesc { name: format!("m{i}"), model: m.clone() }).collect();
    SceneDesc { materials, ..SceneDesc::default() }
}

pub(crate) fn add(scene: &mut SceneDesc, surface: SurfaceDesc, material: usize) {
    let geometry = GeometryDesc { name: String::new(), surface, material: Some(material) };
    scene.meshes.push(MeshDesc { name: String::new(), geometries: vec![geometry] });
    scene.instances.push(InstanceDesc {
        name: String::new(),
        mesh: scene.meshes.len() - 1,
        transform: DAffine3::IDENTITY,
        moves_to: None,
    });
}

/// Adds a parallelogram whose outside is on the side of `u` x `v`.
pub(crate) fn quad(scene: &mut SceneDesc, corner: DVec3, u: DVec3, v: DVec3, material: usize) {
    let mesh = TriangleMesh {
        positions: [corner, corner + u, corner + u + v, corner + v].map(DVec3::as_vec3).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    add(scene, SurfaceDesc::Triangles(mesh), material);
}

/// Adds a parallelogram with texture coordinates (0 to 1 along `u`, along -`v` downwards) and no tangents.
pub(crate) fn mapped_quad(scene: &mut SceneDesc, corner: DVec3, u: DVec3, v: DVec3, material: usize) {
    let mesh = TriangleMesh {
        positions: [corner, corner + u, corner + u + v, corner + v].map(DVec3::as_vec3).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(glam::Vec2::from).to_vec()],
        ..TriangleMesh::default()
    };
    add(scene, SurfaceDesc::Triangles(mesh), material);
}

/// Adds a sphere.
pub(crate) fn ball(scene: &mut SceneDesc, center: DVec3, radius: f64, material: usize) {
    add(scene, SurfaceDesc::Shape(Shape::Sphere(Sphere::new(center, radius).unwrap())), material);
}

pub(crate) fn accel(scene: &SceneDesc) -> firsthit_accel::Scene {
    SceneBuilder::from_desc(scene, BuildOptions::default()).build().unwrap()
}

/// A stage without the built-in studio: what the scene does not bring is black.
pub(crate) fn stage(scene: &Arc<SceneDesc>, options: &StageOptions) -> Stage {
    let mut options = options.clone();
    if scene.environment.is_none() && matches!(options.environment, EnvironmentChoice::Auto) {
        options.environment = EnvironmentChoice::Black;
    }
    Stage::new(scene.clone(), accel(scene), &options).unwrap()
}

pub(crate) fn render_scene(scene: &SceneDesc, stage_options: &StageOptions, options: &RenderOptions) -> Rendered {
    render(&stage(&Arc::new(scene.clone()), stage_options), options, &()).unwrap()
}

/// Looks at one point of a scene through a very narrow camera, by Whitted's method if nothing else is asked for.
pub(crate) struct Probe<'a> {
    scene: &'a SceneDesc,
    eye: DVec3,
    stage: StageOptions,
    options: RenderOptions,
}

impl<'a> Probe<'a> {
    pub(crate) fn new(scene: &'a SceneDesc) -> Self {
        let integrator = IntegratorChoice::Whitted;
        let options =
            RenderOptions { width: 1, height: 1, spp: 64, max_depth: 8, integrator, ..RenderOptions::default() };
        Self { scene, eye: DVec3::ZERO, stage: StageOptions::default(), options }
    }

    pub(crate) fn from(mut self, eye: DVec3) -> Self {
        self.eye = eye;
        self
    }

    pub(crate) fn spp(mut self, spp: u32) -> Self {
        self.options.spp = spp;
        self
    }

    pub(crate) fn depth(mut self, bounces: u32) -> Self {
        self.options.max_depth = bounces;
        self
    }

    pub(crate) fn clip(mut self, clip: Clip) -> Self {
        self.options.clip = clip;
        self
    }

    pub(crate) fn integrator(mut self, integrator: IntegratorChoice) -> Self {
        self.options.integrator = integrator;
        self
    }

    pub(crate) fn stage(mut self, stage: StageOptions) -> Self {
        self.stage = stage;
        self
    }

    /// The radiance that comes from there.
    pub(crate) fn look(mut self, at: DVec3) -> DVec3 {
        let changes = &mut self.stage.camera_changes;
        (changes.position, changes.focal_point) = (Some(self.eye), Some(at));
        changes.view_angle = Some(1e-5);
        // Any direction but the line of sight.
        changes.view_up = Some((at - self.eye).any_orthonormal_vector());
        let p = render_scene(self.scene, &self.stage, &self.options).film.color().pixels[0];
        DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
    }
}
