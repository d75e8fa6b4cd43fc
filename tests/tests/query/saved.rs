//! Saved trees give the same answers, and nothing that a file says can make them wrong.

use firsthit_accel::{BuildOptions, Geometry, Layout, SavedTreesError, Scene, SceneBuilder};
use firsthit_geometry::Ray;
use firsthit_tests::oracle::read_obj;
use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::bits;
use crate::single::{mesh, place, vector};

fn builder(layout: Layout, (positions, triangles): &(Vec<Vec3>, Vec<[u32; 3]>), places: &[DAffine3]) -> SceneBuilder {
    let mut builder = SceneBuilder::new(BuildOptions { layout, ..BuildOptions::default() });
    let geometry = Geometry::Triangles { positions: positions.clone(), triangles: triangles.clone() };
    let mesh = builder.add_mesh(vec![geometry]);
    for place in places {
        builder.add_instance(mesh, *place);
    }
    builder
}

/// Through the middle of the scene and beside it.
fn rays(scene: &Scene, ends: &[(DVec3, DVec3)]) -> Vec<Ray<f64>> {
    let bounds = scene.bounds();
    let at = |p: DVec3| bounds.center() + p * bounds.extent();
    ends.iter().map(|(a, b)| Ray::new(at(*a), at(*b) - at(*a))).collect()
}

fn same(a: &Scene, b: &Scene, rays: &[Ray<f64>]) -> Result<(), TestCaseError> {
    prop_assert_eq!(a.stats().depth, b.stats().depth);
    for ray in rays {
        prop_assert_eq!(bits(&a.closest_hit(ray)), bits(&b.closest_hit(ray)));
        prop_assert_eq!(a.closest_point(ray.origin), b.closest_point(ray.origin));
    }
    Ok(())
}

/// A file with its checksum made right.
fn signed(mut content: Vec<u8>) -> Vec<u8> {
    let sum = twox_hash::XxHash3_64::oneshot(&content);
    content.extend(sum.to_le_bytes());
    content
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn saved_trees_give_the_same_answers(
        mesh in mesh(), places in prop::collection::vec(place(), 1..3), ends in prop::collection::vec((vector(), vector()), 20),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u32>()), 1..4), bit in any::<prop::sample::Index>(),
        cut in any::<prop::sample::Index>(),
    ) {
        for layout in Layout::ALL {
            let builder = builder(layout, &mesh, &places);
            let scene = builder.clone().build().map_err(|e| TestCaseError::fail(e.to_string()))?;
            let rays = rays(&scene, &ends);
            let file = scene.save_trees();
            let again = builder.clone().build_with_trees(&file).map_err(|e| TestCaseError::fail(e.to_string()))?;
            same(&scene, &again, &rays)?;
            prop_assert_eq!(again.save_trees(), file.clone());

            // Any bit that is not what it was is noticed, and so is a missing end.
            let mut damaged = file.clone();
            let bit = bit.index(file.len() * 8);
            damaged[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(builder.clone().build_with_trees(&damaged).is_err());
            prop_assert!(builder.clone().build_with_trees(&file[..cut.index(file.len())]).is_err());

            // With a checksum that fits, a file is refused, or the answers are the same.
            let mut hostile = file[..file.len() - 8].to_vec();
            for (at, to) in &changes {
                let at = at.index(hostile.len() / 4) * 4;
                // Small numbers are more likely to mean something.
                let to = if to % 3 == 0 { *to } else { (to % 64) | (to & 0x8000_0000) };
                hostile[at..at + 4].copy_from_slice(&to.to_le_bytes());
            }
            if let Ok(other) = builder.clone().build_with_trees(&signed(hostile)) {
                prop_assert_eq!(other.validate(), Ok(()));
                for ray in &rays {
                    prop_assert_eq!(bits(&scene.closest_hit(ray)), bits(&other.closest_hit(ray)));
                }
            }
        }
    }
}

#[test]
fn trees_of_something_else_are_refused() {
    let square = (vec![Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y], vec![[0u32, 1, 2], [0, 2, 3]]);
    let moved = (vec![Vec3::ZERO, Vec3::X * 1.5, Vec3::ONE, Vec3::Y], square.1.clone());
    let fewer = (square.0.clone(), vec![square.1[0]]);
    let place = [DAffine3::IDENTITY];
    for layout in [Layout::Wide8, Layout::Bvh2] {
        let file = builder(layout, &square, &place).build().expect("a square").save_trees();
        for other in [&moved, &fewer] {
            let got = builder(layout, other, &place).build_with_trees(&file);
            assert!(matches!(got, Err(SavedTreesError::Other(_))), "{got:?}");
        }
        let other = if layout == Layout::Wide8 { Layout::Bvh2 } else { Layout::Wide8 };
        let got = builder(other, &square, &place).build_with_trees(&file);
        assert!(matches!(got, Err(SavedTreesError::Other(_))), "{got:?}");
        assert!(builder(layout, &square, &[DAffine3::from_scale(DVec3::splat(2.0))]).build_with_trees(&file).is_ok());
        let mut newer = file.clone();
        newer[8] += 1;
        assert!(matches!(
            builder(layout, &square, &place).build_with_trees(&newer),
            Err(SavedTreesError::Version { found: 2 })
        ));
    }
    let got = builder(Layout::Wide8, &square, &place).build_with_trees(b"not a tree at all");
    assert!(matches!(got, Err(SavedTreesError::Foreign)));
}

/// A file need not be read into memory first: its bytes may be a map of it.
#[test]
fn a_mapped_file_gives_the_same_answers() {
    let grid = (0..400u32).map(|k| Vec3::new((k % 20) as f32, (k * k % 7) as f32, (k / 20) as f32)).collect();
    let quads = (0..380u32).filter(|k| k % 20 < 19);
    let mesh = (grid, quads.flat_map(|a| [[a, a + 1, a + 20], [a + 1, a + 21, a + 20]]).collect());
    let folder = tempfile::tempdir().expect("a temporary folder");
    for layout in Layout::ALL {
        let builder = builder(layout, &mesh, &[DAffine3::IDENTITY]);
        let scene = builder.clone().build().expect("a grid");
        let path = folder.path().join(layout.name());
        std::fs::write(&path, scene.save_trees()).expect("room for a file");
        let file = std::fs::File::open(&path).expect("the file");
        // SAFETY: nobody changes the file while it is mapped: it lies in a folder of this test's own.
        let mapped = unsafe { memmap2::Mmap::map(&file) }.expect("a map of the file");
        let again = builder.build_with_trees(&mapped).expect("its trees");
        // Nothing of it is kept.
        drop(mapped);
        std::fs::remove_file(&path).expect("the file");
        let ends: Vec<_> =
            (0..100).map(|k| f64::from(k) / 100.0 - 0.5).map(|x| (DVec3::new(x, 1.0, -x), DVec3::X * x)).collect();
        same(&scene, &again, &rays(&scene, &ends)).expect("the same answers");
        assert_eq!(again.validate(), Ok(()));
    }
}

/// A real mesh: as before, and files changed in many places.
#[test]
fn the_bunny_from_a_file() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let bunny = read_obj(&shared.join("assets/stanford-bunny/stanford-bunny.obj")).expect("the bunny");
    let bunny = (bunny.positions, bunny.triangles);
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    let mut accepted = 0;
    for layout in [Layout::Wide8, Layout::Bvh2] {
        let builder = builder(layout, &bunny, &[DAffine3::IDENTITY]);
        let scene = builder.clone().build().expect("the bunny");
        let mut unit = || f64::from(random()) / 2f64.powi(31) - 0.5;
        let ends: Vec<_> =
            (0..500).map(|_| (DVec3::new(unit(), unit(), unit()) * 3.0, DVec3::new(unit(), unit(), unit()))).collect();
        let rays = rays(&scene, &ends);
        let file = scene.save_trees();
        same(&scene, &builder.clone().build_with_trees(&file).expect("the same trees"), &rays)
            .expect("the same answers");
        for _ in 0..20 {
            let mut hostile = file[..file.len() - 8].to_vec();
            // Two of the tree's words change places: mostly no tree any more, or the same triangles in other leaves.
            let place = |x: u32| (28 + x as usize % (hostile.len() - 32)) / 4 * 4;
            let (a, b) = (place(random()), place(random()));
            for k in 0..4 {
                hostile.swap(a + k, b + k);
            }
            if let Ok(other) = builder.clone().build_with_trees(&signed(hostile)) {
                accepted += 1;
                assert_eq!(other.validate(), Ok(()));
                for ray in &rays {
                    assert_eq!(bits(&scene.closest_hit(ray)), bits(&other.closest_hit(ray)));
                }
            }
        }
    }
    firsthit_tests::summary(&format!("saved trees of the bunny: 40 changed files, {accepted} of them still trees"));
}
