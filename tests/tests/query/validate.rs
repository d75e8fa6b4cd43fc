//! The trees of every scene are what they should be.

use firsthit_accel::{BuildOptions, BuildQuality, Geometry, Layout, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_geometry::shapes::{Plane, Sphere};
use glam::DVec3;
use proptest::prelude::*;

use crate::single::{mesh, place, vector};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Built in any way, refitted, updated, looked at in part and made of saved shapes.
    #[test]
    fn every_tree_is_valid(
        (positions, triangles) in mesh(), (other, others) in mesh(), copies in 1usize..20, shapes in 0usize..9,
        places in prop::collection::vec(place(), 1..40), (from, to) in (vector(), vector()),
    ) {
        // Enough triangles for several levels, coincident ones among them.
        let part = |positions: &[glam::Vec3], triangles: &[[u32; 3]]| {
            let triangles = triangles.iter().copied().cycle().take(triangles.len() * copies).collect();
            Geometry::Triangles { positions: positions.to_vec(), triangles }
        };
        let mut mixed = vec![part(&positions, &triangles), part(&other, &others)];
        for i in 0..shapes {
            let at = from.lerp(to, i as f64 / 9.0);
            mixed.push(Geometry::Shape(Sphere::new(at, 0.1).expect("a sphere").into()));
        }
        if shapes > 6 {
            mixed.push(Geometry::Shape(Plane::new(from, DVec3::Y).expect("a plane").into()));
        }
        for layout in Layout::ALL {
            for quality in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::High] {
                for precision in [Precision::Robust, Precision::Exact] {
                    let options = BuildOptions { layout, quality, precision, ..BuildOptions::default() };
                    let mut builder = SceneBuilder::new(options);
                    let meshes = [builder.add_mesh(vec![part(&positions, &triangles)]), builder.add_mesh(mixed.clone())];
                    for (i, place) in places.iter().enumerate() {
                        builder.add_instance(meshes[i % 2], *place);
                    }
                    let scene = builder.clone().build().expect("good meshes");
                    prop_assert_eq!(scene.validate(), Ok(()));
                    prop_assert_eq!(builder.build_with_trees(&scene.save_trees()).expect("its trees").validate(), Ok(()));
                    let bent: Vec<_> = positions.iter().map(|p| glam::Vec3::new(p.y * 0.5, p.x, p.z - p.x)).collect();
                    let refit = scene.refit(0, &[part(&bent, &triangles)]).expect("as many");
                    prop_assert_eq!(refit.validate(), Ok(()));
                    // All without area, so in no leaf.
                    let flat = vec![positions[0]; positions.len()];
                    prop_assert_eq!(refit.refit(0, &[part(&flat, &triangles)]).expect("as many").validate(), Ok(()));
                    let mut update = scene.update();
                    update.remove_instance(0).set_mask(places.len() - 1, 2);
                    update.add_instance(1, places[0]);
                    let (updated, _) = update.finish().expect("a good update");
                    prop_assert_eq!(updated.validate(), Ok(()));
                    prop_assert_eq!(updated.seen_by(2).validate(), Ok(()));
                }
            }
        }
    }
}
