//! How thick are the walls: `cargo run --release -p firsthit --example thickness -- MODEL`
//!
//! From the middle of each triangle a ray goes inward; what it meets first is the other side of the wall.

use std::error::Error;

use firsthit::import::scene::SurfaceDesc;
use firsthit::{BuildOptions, Ray, SceneBuilder};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Thickness below the middle of each triangle, in world units; infinite where there is no other side.
pub(crate) fn run(model: &str) -> Result<Vec<f64>> {
    let imported = firsthit::import::open(model, &Default::default())?;
    let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
    let mut walls = Vec::new();
    for (i, instance) in imported.scene.instances.iter().enumerate() {
        for (g, geometry) in imported.scene.meshes[instance.mesh].geometries.iter().enumerate() {
            let SurfaceDesc::Triangles(mesh) = &geometry.surface else { continue };
            for (k, t) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = t.map(|v| instance.transform.transform_point3(mesh.positions[v as usize].as_dvec3()));
                let inward = -(b - a).cross(c - a).normalize_or_zero();
                let ray = Ray::new((a + b + c) / 3.0, inward);
                // Not the triangle itself: it is told by its id, not by an offset.
                let own = firsthit::HitId { instance: i as u32, geometry: g as u32, primitive: k as u32 };
                let hit = scene.closest_hit_filtered(&ray, Some(own), |_| true);
                walls.push(hit.map_or(f64::INFINITY, |hit| hit.t));
            }
        }
    }
    Ok(walls)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<()> {
    let model = std::env::args().nth(1).unwrap_or_else(|| "assets/spot/spot.obj".into());
    let mut walls = run(&model)?;
    walls.sort_by(f64::total_cmp);
    for part in [0.0, 0.01, 0.1, 0.5, 0.9] {
        println!(
            "{:3.0} % of {} places are thinner than {:.4}",
            part * 100.0,
            walls.len(),
            walls[(walls.len() as f64 * part) as usize]
        );
    }
    Ok(())
}
