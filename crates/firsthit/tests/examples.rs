//! The examples do what they say, on models that are here.
#![cfg(feature = "render")]

#[path = "../examples/ambient_occlusion.rs"]
mod ambient_occlusion;
#[path = "../examples/collision.rs"]
mod collision;
#[path = "../examples/lidar.rs"]
mod lidar;
#[path = "../examples/line_of_sight.rs"]
mod line_of_sight;
#[path = "../examples/nearest_part.rs"]
mod nearest_part;
#[path = "../examples/picking.rs"]
mod picking;
#[path = "../examples/slicing.rs"]
mod slicing;
#[path = "../examples/thickness.rs"]
mod thickness;
#[path = "../examples/visibility.rs"]
mod visibility;
#[path = "../examples/voxelise.rs"]
mod voxelise;

use firsthit::glam::DVec3;
use firsthit::import::scene::SurfaceDesc;

const SPOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/spot/spot.obj");
const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/cornell-box/CornellBox-Original.obj");

/// Volume and box of spot, straight from its triangles (the divergence theorem).
fn spot() -> (f64, DVec3) {
    let desc = firsthit::import::open(SPOT, &Default::default()).expect("spot").scene;
    let SurfaceDesc::Triangles(mesh) = &desc.meshes[0].geometries[0].surface else { panic!("spot is a mesh") };
    let volume = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        a.cross(b).dot(c) / 6.0
    };
    let ends = mesh
        .positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p.as_dvec3()), high.max(p.as_dvec3())));
    (mesh.triangles.iter().map(volume).sum(), ends.1 - ends.0)
}

#[test]
fn voxels_have_the_volume_of_the_mesh() {
    let (volume, _) = spot();
    let (distances, cell) = voxelise::run(SPOT, 48).expect("voxels");
    let got = distances.iter().filter(|d| **d < 0.0).count() as f64 * cell;
    assert!((got / volume - 1.0).abs() < 0.01, "{got} {volume}");
}

#[test]
fn layers_add_up_to_the_volume() {
    let (volume, size) = spot();
    let areas = (0..60).map(|k| slicing::run(SPOT, (f64::from(k) + 0.5) / 60.0, 150).expect("a layer").1);
    let got = areas.sum::<f64>() * size.y / 60.0;
    assert!((got / volume - 1.0).abs() < 0.01, "{got} {volume}");
}

#[test]
fn occlusion_is_a_part_of_the_sky() {
    let (baked, obj) = ambient_occlusion::run(SPOT).expect("a bake");
    let mean = baked.iter().sum::<f64>() / baked.len() as f64;
    assert!(baked.iter().all(|b| (0.0..=1.0).contains(b)) && (0.6..0.95).contains(&mean), "{mean}");
    assert_eq!(obj.lines().filter(|l| l.starts_with("v ")).count(), baked.len());
}

#[test]
fn sight_is_mutual() {
    let sees = line_of_sight::run(SPOT, 16).expect("posts");
    for (i, row) in sees.iter().enumerate() {
        assert!(row[i] && (0..16).all(|j| sees[j][i] == row[j]));
        assert!(row[(i + 1) % 16], "neighbours see each other past the model");
        assert!(!row[(i + 8) % 16], "the model is in the middle");
    }
}

#[test]
fn walls_are_thinner_than_the_whole() {
    let (_, size) = spot();
    let walls = thickness::run(SPOT).expect("walls");
    assert!(walls.iter().all(|t| *t > 0.0 && *t < size.length()), "spot is closed: each wall has another side");
}

#[test]
fn the_middle_of_the_picture_shows_the_model() {
    assert!(picking::run(SPOT, [640.0, 360.0]).expect("a pick").is_some());
    assert!(picking::run(SPOT, [1.0, 1.0]).expect("a pick").is_none());
}

#[test]
fn balls_rest_at_their_radius_above_the_surface() {
    let (_, size) = spot();
    let (ball, touched, steps) = collision::run(SPOT, [0.0, 0.0], 0.05).expect("a fall").expect("spot is below");
    assert!((ball.distance(touched.point) - 0.05 * size.max_element()).abs() < 1e-8 && steps < 200, "{steps}");
    assert!(collision::run(SPOT, [2.0, 0.0], 0.05).expect("a fall").is_none());
}

#[test]
fn parts_that_are_seen_cover_what_is_not_empty() {
    let (seen, pixels) = visibility::run(CORNELL, 160, 90).expect("parts");
    assert!(seen.len() >= 5 && seen.values().sum::<u32>() <= pixels, "{seen:?}");
}

#[test]
fn scanners_in_a_box_see_it_all_around() {
    let (rays, hits) = lidar::run(CORNELL).expect("a scan");
    assert_eq!(rays.len(), (lidar::BEAMS * lidar::TURN) as usize);
    // The box is open at the front.
    let share = hits.iter().flatten().count() as f64 / rays.len() as f64;
    assert!((0.7..0.95).contains(&share), "{share}");
}

#[test]
fn parts_come_by_distance() {
    let parts = nearest_part::run(CORNELL, DVec3::new(0.0, 1.5, 0.0)).expect("parts");
    assert!(parts.len() >= 2 && parts.windows(2).all(|w| w[0].1 <= w[1].1), "{parts:?}");
}
