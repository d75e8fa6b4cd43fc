//! Bakes ambient occlusion into vertex colours: `cargo run --release -p firsthit --example ambient_occlusion -- MODEL baked.obj`
//!
//! From each vertex rays go out over the hemisphere around its normal, more of them along it; what part of them is free is
//! how bright the vertex is.

use std::error::Error;
use std::fmt::Write;

use firsthit::glam::DVec3;
use firsthit::import::scene::SurfaceDesc;
use firsthit::{BuildOptions, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const RAYS: u32 = 128;

/// How much of the sky each vertex of the model's first mesh sees, 0 to 1, and the mesh as OBJ with these as colours.
pub(crate) fn run(model: &str) -> Result<(Vec<f64>, String)> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let instance = imported.scene.instances.first().ok_or("there is nothing in the model")?;
    let mut baked = Vec::new();
    let mut obj = String::new();
    for geometry in &imported.scene.meshes[instance.mesh].geometries {
        let SurfaceDesc::Triangles(mesh) = &geometry.surface else { continue };
        let first = baked.len() + 1;
        // Smooth normals, of the triangles around each vertex.
        let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| instance.transform.transform_point3(mesh.positions[i as usize].as_dvec3()));
            t.iter().for_each(|&i| normals[i as usize] += (b - a).cross(c - a));
        }
        for (position, normal) in mesh.positions.iter().zip(&normals) {
            let normal = normal.normalize_or(DVec3::Y);
            let (x, y) = normal.any_orthonormal_pair();
            // A hair above the surface: the vertex is shared by several triangles.
            let size = scene.bounds().extent().max_element();
            let origin = instance.transform.transform_point3(position.as_dvec3()) + normal * (size * 1e-4);
            let free = (0..RAYS).filter(|&k| {
                // A spiral of equal areas on the disk, lifted to the hemisphere.
                let (r, angle) = (((f64::from(k) + 0.5) / f64::from(RAYS)).sqrt(), f64::from(k) * 2.399_963);
                let to = x * (r * angle.cos()) + y * (r * angle.sin()) + normal * (1.0 - r * r).sqrt();
                !scene.any_hit(&Ray::new(origin, to))
            });
            let sky = free.count() as f64 / f64::from(RAYS);
            writeln!(obj, "v {} {} {} {sky:.3} {sky:.3} {sky:.3}", position.x, position.y, position.z)?;
            baked.push(sky);
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| i as usize + first);
            writeln!(obj, "f {a} {b} {c}")?;
        }
    }
    Ok((baked, obj))
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments.next().unwrap_or_else(|| "assets/spot/spot.obj".into());
    let file = arguments.next().unwrap_or_else(|| "baked.obj".into());
    let (baked, obj) = run(&model)?;
    std::fs::write(&file, obj)?;
    println!(
        "{file}: {} vertices see {:.2} of the sky on average",
        baked.len(),
        baked.iter().sum::<f64>() / baked.len() as f64
    );
    Ok(())
}
