//! `firsthit inspect`: what is in a model, without rendering it.

mod text;

use std::sync::Arc;
use std::time::Instant;

use firsthit_accel::{BuildOptions, Scene, SceneBuilder};
use firsthit_geometry::mesh::MeshReport;
use firsthit_import::scene::{AlphaMode, LightKind, MaterialModel, MeshDesc, PbrMaterial, Projection, SurfaceDesc};
use firsthit_import::{Decode, Imported, Options, Report, SceneDesc, Stage as LoadStage, Stages};
use firsthit_render::{EffectPlan, Stage, StageOptions};
use serde::Serialize;

use crate::args::InspectArgs;
use crate::console::{Console, print, print_json};
use crate::error::Failure;
use crate::report::{Counts, Effect, effects, warnings};
use crate::simd;

/// Looks at a model and prints what is in it.
pub(crate) fn run(args: &InspectArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let stages = args.timing.then(Stages::default);
    let decode = if args.timing { Decode::Seen } else { Decode::All };
    let options = Options { up: args.up, decode, stages: stages.clone(), ..args.load.options() };
    let settings = BuildOptions { precision: args.precision, simd: simd::level()?, ..Default::default() };
    let build = |scene: &SceneDesc| {
        let started = Instant::now();
        let trees = SceneBuilder::from_desc(scene, settings).build();
        (trees, started.elapsed().as_secs_f64())
    };
    let (Imported { scene, report }, (trees, build)) = firsthit_import::open_with(&args.model, &options, build)?;
    // Warnings are part of the result; here they only decide whether there is one.
    Console::Quiet.warnings(&report, args.strict)?;
    let trees = trees.map_err(|e| at_model(args, &e))?;
    let whole = started.elapsed().as_secs_f64();
    let load = whole - build;
    let timing = stages.map(|stages| Timing::new(&stages, build, whole));

    let scene = Arc::new(scene);
    let stage = Stage::new(scene.clone(), trees.clone(), &StageOptions::default()).map_err(|e| at_model(args, &e))?;
    let model = args.model.display().to_string();
    let seconds = Seconds { load, build };
    let inspection = Inspection::new(model, &scene, &report, &trees, stage.plan(), stage.explain(), seconds);
    let inspection = Inspection { timing, ..inspection };
    if args.json { print_json(&inspection) } else { print(inspection.to_string().as_bytes()) }
}

fn at_model(args: &InspectArgs, error: &dyn std::error::Error) -> Failure {
    Failure::failed(format_args!("{}: {error}", args.model.display()))
}

/// The JSON of `inspect --json`. What is named like a count is a number; the lists stand beside it.
#[derive(Serialize)]
struct Inspection<'a> {
    model: String,
    /// The files that were read: the model and all that it led to.
    files: Vec<String>,
    /// Of the scene that is rendered: each instance counted.
    triangles: u64,
    /// Of every node of every scene in the file.
    triangles_all_scenes: u64,
    /// Each mesh counted once.
    stored_triangles: u64,
    /// Triangles without area, each mesh counted once.
    degenerate_triangles: u64,
    /// Analytic shapes, each instance counted.
    shapes: u64,
    meshes: usize,
    instances: usize,
    materials: usize,
    textures: usize,
    lights: usize,
    cameras: usize,
    animations: usize,
    scenes: usize,
    /// Names of the file's variants of materials.
    variants: &'a [String],
    /// Of what has an end, in world units.
    bounds: Option<Bounds>,
    mesh_list: Vec<Mesh<'a>>,
    material_list: Vec<Material<'a>>,
    texture_list: Vec<Texture<'a>>,
    light_list: Vec<Named<'a>>,
    camera_list: Vec<Named<'a>>,
    animation_list: Vec<Animation<'a>>,
    /// Names of the scenes of the file.
    scene_list: &'a [String],
    extensions: Vec<Extension<'a>>,
    bvh: Bvh,
    effects: Vec<Effect<'a>>,
    /// Which camera and light a render without options would choose, and why.
    choices: &'a [String],
    warnings: Vec<String>,
    /// Warnings beyond those listed.
    more_warnings: u64,
    seconds: Seconds,
    #[serde(skip_serializing_if = "Option::is_none")]
    timing: Option<Timing>,
}

#[derive(Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Serialize)]
struct Mesh<'a> {
    name: &'a str,
    geometries: usize,
    /// How often it is placed.
    instances: u64,
    triangles: u64,
    vertices: u64,
    shapes: u64,
    /// Triangles without area.
    degenerate: u64,
    /// Whether its triangles, all geometries together, enclose space: every edge has two sides. Absent without any.
    closed: Option<bool>,
    /// Edges with an odd number of triangles.
    boundary_edges: u64,
    /// Whether no edge has more than two triangles.
    manifold: Option<bool>,
    /// Whether neighbours agree about what is outside.
    oriented: Option<bool>,
}

#[derive(Serialize)]
struct Material<'a> {
    name: &'a str,
    kind: &'static str,
    textures: usize,
    double_sided: bool,
    alpha: &'static str,
}

#[derive(Serialize)]
struct Texture<'a> {
    name: &'a str,
    width: u32,
    height: u32,
}

/// A light or camera: its kind beside its name.
#[derive(Serialize)]
struct Named<'a> {
    name: &'a str,
    kind: &'static str,
}

#[derive(Serialize)]
struct Animation<'a> {
    name: &'a str,
    /// When its last key is.
    seconds: f64,
    /// Properties that it changes.
    channels: u64,
}

#[derive(Serialize)]
struct Extension<'a> {
    name: &'a str,
    required: bool,
    /// `full`, `partial`, `ignored` or `unsupported`.
    support: &'static str,
    note: &'a str,
}

/// Quality of the trees.
#[derive(Serialize)]
struct Bvh {
    sah_cost: f64,
    depth: u32,
    bytes: u64,
}

#[derive(Serialize)]
struct Seconds {
    /// The whole without the trees.
    load: f64,
    build: f64,
}

/// Seconds of each stage. They overlap: images are decoded while meshes are read and trees are built.
#[derive(Serialize)]
struct Timing {
    /// Bytes from the disk, decompressed.
    read: f64,
    parse: f64,
    meshes: f64,
    /// How many were decoded.
    images_decoded: usize,
    /// From the first to the last of them.
    images: f64,
    /// Summed over threads.
    images_in_all: f64,
    trees: f64,
    whole: f64,
    /// Decoding the images once more and nothing else, from the first to the last.
    images_alone: f64,
    /// `whole` over `images_alone`; absent without images.
    ratio: Option<f64>,
    threads: usize,
}

impl Timing {
    fn new(stages: &Stages, trees: f64, whole: f64) -> Self {
        let seconds = |stage| stages.get(stage).as_secs_f64();
        let images_alone = stages.decode_again().as_secs_f64();
        let images_decoded = stages.images();
        Self {
            read: seconds(LoadStage::Read),
            parse: seconds(LoadStage::Parse),
            meshes: seconds(LoadStage::Meshes),
            images_decoded,
            images: seconds(LoadStage::Images),
            images_in_all: seconds(LoadStage::ImagesInAll),
            trees,
            whole,
            images_alone,
            ratio: (images_decoded > 0).then(|| whole / images_alone),
            threads: rayon::current_num_threads(),
        }
    }
}

impl<'a> Inspection<'a> {
    fn new(
        model: String,
        scene: &'a SceneDesc,
        report: &'a Report,
        trees: &Scene,
        plan: &'a EffectPlan,
        choices: &'a [String],
        seconds: Seconds,
    ) -> Self {
        let mesh_list = meshes(scene);
        let stats = trees.stats();
        let bounds = trees.bounds();
        let total = |count: fn(&Mesh<'_>) -> u64| mesh_list.iter().map(count).sum();
        let counts = Counts::new(scene);
        Self {
            model,
            files: report.files.iter().map(|f| f.display().to_string()).collect(),
            triangles: counts.triangles,
            triangles_all_scenes: report.triangles_all_scenes,
            stored_triangles: total(|m| m.triangles),
            degenerate_triangles: total(|m| m.degenerate),
            shapes: counts.shapes,
            meshes: scene.meshes.len(),
            instances: scene.instances.len(),
            materials: scene.materials.len(),
            textures: scene.images.len(),
            lights: scene.lights.len(),
            cameras: scene.cameras.len(),
            animations: report.animations.len(),
            scenes: report.scenes.len(),
            variants: &report.variants,
            bounds: bounds.is_finite().then(|| Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() }),
            material_list: scene.materials.iter().map(|m| material(&m.name, &m.model)).collect(),
            texture_list: scene
                .images
                .iter()
                .map(|i| Texture { name: &i.name, width: i.width, height: i.height })
                .collect(),
            light_list: scene.lights.iter().map(|l| Named { name: &l.name, kind: light_kind(&l.kind) }).collect(),
            camera_list: scene
                .cameras
                .iter()
                .map(|c| Named { name: &c.name, kind: projection_kind(&c.projection) })
                .collect(),
            animation_list: report
                .animations
                .iter()
                .map(|a| Animation { name: &a.name, seconds: a.seconds, channels: a.channels })
                .collect(),
            scene_list: &report.scenes,
            extensions: report
                .extensions
                .iter()
                .map(|e| Extension { name: &e.name, required: e.required, support: e.support.name(), note: e.note })
                .collect(),
            bvh: Bvh { sah_cost: stats.sah_cost, depth: stats.depth, bytes: stats.bytes },
            effects: effects(plan),
            choices,
            warnings: warnings(report),
            more_warnings: report.more_warnings,
            seconds,
            timing: None,
            mesh_list,
        }
    }
}

fn meshes(scene: &SceneDesc) -> Vec<Mesh<'_>> {
    let mut instances = vec![0; scene.meshes.len()];
    for instance in &scene.instances {
        instances[instance.mesh] += 1;
    }
    scene.meshes.iter().zip(instances).map(|(mesh, instances)| Mesh::new(mesh, instances)).collect()
}

impl<'a> Mesh<'a> {
    fn new(mesh: &'a MeshDesc, instances: u64) -> Self {
        // The geometries of a mesh differ in material, not in space: closed or not is said of them together.
        let (mut positions, mut triangles, mut shapes) = (Vec::new(), Vec::new(), 0);
        for geometry in &mesh.geometries {
            match &geometry.surface {
                SurfaceDesc::Triangles(m) => {
                    let first = positions.len() as u32;
                    positions.extend_from_slice(&m.positions);
                    triangles.extend(m.triangles.iter().map(|t| t.map(|v| v + first)));
                }
                SurfaceDesc::Shape(_) => shapes += 1,
            }
        }
        let report = (!triangles.is_empty()).then(|| MeshReport::new(&positions, &triangles));
        Self {
            name: &mesh.name,
            geometries: mesh.geometries.len(),
            instances,
            triangles: triangles.len() as u64,
            vertices: positions.len() as u64,
            shapes,
            degenerate: report.map_or(0, |r| r.degenerate),
            closed: report.map(|r| r.is_closed()),
            boundary_edges: report.map_or(0, |r| r.boundary_edges),
            manifold: report.map(|r| r.is_manifold()),
            oriented: report.map(|r| r.is_oriented()),
        }
    }
}

fn material<'a>(name: &'a str, model: &MaterialModel) -> Material<'a> {
    let plain = |kind| Material { name, kind, textures: 0, double_sided: true, alpha: "opaque" };
    match model {
        MaterialModel::Pbr(pbr) => Material {
            name,
            kind: if pbr.unlit { "unlit" } else { "metallic-roughness" },
            textures: texture_count(pbr),
            double_sided: pbr.double_sided,
            alpha: match pbr.alpha_mode {
                AlphaMode::Opaque => "opaque",
                AlphaMode::Mask { .. } => "mask",
                AlphaMode::Blend => "blend",
            },
        },
        MaterialModel::Diffuse { .. } => plain("diffuse"),
        MaterialModel::Mirror { .. } => plain("mirror"),
        MaterialModel::Glass { .. } => plain("glass"),
        MaterialModel::RoughMirror { .. } => plain("rough mirror"),
        MaterialModel::RoughGlass { .. } => plain("rough glass"),
        MaterialModel::Emission { .. } => plain("emission"),
    }
}

fn texture_count(pbr: &PbrMaterial) -> usize {
    // Metalness and roughness mostly share an image.
    let mut images: Vec<usize> = pbr.textures().map(|t| t.image).collect();
    images.sort_unstable();
    images.dedup();
    images.len()
}

fn light_kind(kind: &LightKind) -> &'static str {
    match kind {
        LightKind::Point { .. } => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional { .. } => "directional",
        LightKind::Rectangle { .. } => "rectangle",
        LightKind::Sphere { .. } => "sphere",
    }
}

fn projection_kind(projection: &Projection) -> &'static str {
    match projection {
        Projection::Perspective { .. } => "perspective",
        Projection::Orthographic { .. } => "orthographic",
    }
}
