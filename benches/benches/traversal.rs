//! Closest hit and any hit by tier, beside obvhs's own traversal of its binary tree (f32, no padding, leaks).
//!
//! `cargo bench -p firsthit-benches --bench traversal`. Meshes are scans from the shared folder where there is one, and a
//! generated sphere. Times are for the whole batch of rays on one thread.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_tests::oracle::{Mesh, Rng, icosphere, read_obj};
use glam::{DAffine3, DVec3, Vec3};
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::{BvhBuildParams, ray::RayHit, triangle::Triangle};

fn meshes() -> Vec<(&'static str, Mesh)> {
    let mut meshes = vec![("sphere", icosphere(7))];
    if let Some(shared) = firsthit_tests::shared() {
        for (name, file) in [("bunny", "stanford-bunny/stanford-bunny.obj"), ("sibenik", "sibenik/sibenik.obj")] {
            meshes.extend(read_obj(&shared.join("assets").join(file)).map(|m| (name, m)));
        }
        meshes.extend(dragon(&shared.join("assets/stanford-dragon")).map(|m| ("dragon", m)));
    }
    meshes
}

fn dragon(folder: &std::path::Path) -> Option<Mesh> {
    let file = std::fs::read_dir(folder)
        .ok()?
        .find_map(|f| Some(f.ok()?.path()).filter(|p| p.extension() == Some("glb".as_ref())))?;
    let scene = firsthit_import::open(&file, &firsthit_import::Options::default()).ok()?.scene;
    scene.meshes.iter().flat_map(|m| &m.geometries).find_map(|g| match &g.surface {
        firsthit_import::scene::SurfaceDesc::Triangles(t) => {
            Some(Mesh { positions: t.positions.clone(), triangles: t.triangles.clone() })
        }
        firsthit_import::scene::SurfaceDesc::Shape(_) => None,
    })
}

fn scene(mesh: &Mesh, precision: Precision) -> Scene {
    let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
    let m = builder
        .add_mesh(vec![Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() }]);
    builder.add_instance(m, DAffine3::IDENTITY);
    builder.build().expect("a good mesh")
}

/// 256 x 256 rays from outside through the model's box, and one diffuse bounce from each hit.
fn rays(scene: &Scene) -> (Vec<Ray<f64>>, Vec<Ray<f64>>) {
    let b = scene.bounds();
    let (center, size) = (b.center(), b.extent().length());
    let eye = center + DVec3::new(0.6, 0.5, 0.9).normalize() * size * if size > 30.0 { 0.2 } else { 1.0 };
    let primary: Vec<Ray<f64>> = (0..256 * 256)
        .map(|k| {
            let (x, y) = (f64::from(k % 256) / 255.0 - 0.5, f64::from(k / 256) / 255.0 - 0.5);
            Ray::new(eye, center + DVec3::new(x, y, -x) * size * 0.5 - eye)
        })
        .collect();
    let mut rng = Rng(1);
    let diffuse = primary
        .iter()
        .filter_map(|r| {
            let hit = scene.closest_hit(r)?;
            let d = hit.normal_against(r.direction) * 1.001 + rng.direction();
            Some(Ray::new(scene.surface_point(r, &hit).spawn(d), d))
        })
        .collect();
    (primary, diffuse)
}

struct Peer {
    bvh: Bvh2,
    triangles: Vec<Triangle>,
}

impl Peer {
    fn new(mesh: &Mesh) -> Self {
        let triangles: Vec<Triangle> = mesh
            .triangles
            .iter()
            .map(|t| {
                let v = t.map(|i| Vec3::into(mesh.positions[i as usize]));
                Triangle { v0: v[0], v1: v[1], v2: v[2] }
            })
            .collect();
        let bvh = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Self { bvh, triangles }
    }
    fn closest(&self, r: &Ray<f64>) -> f32 {
        let ray = obvhs::ray::Ray::new_inf(r.origin.as_vec3a(), r.direction.as_vec3a());
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        hit.t
    }
}

fn traversal(c: &mut Criterion) {
    for (name, mesh) in meshes() {
        let robust = scene(&mesh, Precision::Robust);
        let (primary, diffuse) = rays(&robust);
        let peer = Peer::new(&mesh);
        for (kind, rays) in [("primary", &primary), ("diffuse", &diffuse)] {
            let mut group = c.benchmark_group(format!("{name}/{kind}"));
            group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function("obvhs", |b| b.iter(|| rays.iter().map(|r| peer.closest(black_box(r))).sum::<f32>()));
            for precision in Precision::ALL {
                let scene = scene(&mesh, precision);
                let mut hits = vec![None; rays.len()];
                group.bench_function(precision.name(), |b| b.iter(|| scene.closest_hits(black_box(rays), &mut hits)));
                let mut any = vec![false; rays.len()];
                group.bench_function(format!("{precision} any"), |b| {
                    b.iter(|| scene.any_hits(black_box(rays), &mut any))
                });
            }
        }
    }
}

criterion_group!(benches, traversal);
criterion_main!(benches);
