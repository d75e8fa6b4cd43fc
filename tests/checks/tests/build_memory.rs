//! What a build is said to take of memory is what it takes at most, and not much more.

use firsthit_accel::{BuildError, BuildOptions, BuildQuality, Geometry, Layout, SavedTreesError, Scene, SceneBuilder};
use firsthit_checks::files::Counting;
use glam::{DAffine3, DVec3, Vec3};

#[global_allocator]
static COUNTING: Counting = Counting;

/// A wavy square of `2 side^2` triangles that share their vertices.
fn terrain(side: u32) -> Geometry {
    let row = side + 1;
    let at = |i: u32| {
        let (x, y) = ((i % row) as f32, (i / row) as f32);
        Vec3::new(x, (0.1 * x).sin() * (0.07 * y).cos() * 9.0, y)
    };
    let quads = (0..side * side).map(|k| k % side + k / side * row);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + row], [a + 1, a + row + 1, a + row]]).collect();
    Geometry::Triangles { positions: (0..row * row).map(at).collect(), triangles }
}

/// So many triangles that share nothing, each made of a number.
fn each(count: u32, corners: impl Fn(u32) -> [Vec3; 3]) -> Geometry {
    let triangles = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Geometry::Triangles { positions: (0..count).flat_map(corners).collect(), triangles }
}

fn soup(count: u32) -> Geometry {
    let random = |k: u32| (k.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
    let point = move |k: u32| Vec3::new(random(k), random(k ^ 0x5bd1_e995), random(k.wrapping_mul(3) + 1));
    each(count, move |k| [0, 1, 2].map(|i| point(k) + point(7 * k + i) * 0.02))
}

/// Ever smaller triangles, each beside all that are smaller still, and coincident ones.
fn nested(count: u32) -> Geometry {
    each(count, |k| [Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 2f32.powi(-((k % 100) as i32))))
}

fn row(count: u32) -> Geometry {
    each(count, |k| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::X * (4 * k) as f32))
}

fn builder(options: BuildOptions, meshes: &[Vec<Geometry>], instances: usize) -> SceneBuilder {
    let mut builder = SceneBuilder::new(options);
    meshes.iter().for_each(|mesh| _ = builder.add_mesh(mesh.clone()));
    for i in 0..instances {
        let place = DVec3::new((i % 17) as f64, (i % 23) as f64, (i % 29) as f64);
        builder.add_instance(i % meshes.len(), DAffine3::from_translation(place * 100.0));
    }
    builder
}

fn limited(options: BuildOptions, limit: u64) -> BuildOptions {
    BuildOptions { memory_limit: Some(limit), ..options }
}

/// What is said to be enough, and what is taken when no more is allowed.
fn need_and_most(options: BuildOptions, meshes: &[Vec<Geometry>], instances: usize) -> (u64, u64) {
    let refused = builder(limited(options, 0), meshes, instances);
    let before = Counting::restart();
    let Err(BuildError::OutOfMemory { need, limit: 0 }) = refused.build() else { panic!("no limit") };
    let taken = Counting::most() - before;
    assert!(taken < 4096, "{taken} bytes to refuse");
    let less = builder(limited(options, need - 1), meshes, instances);
    assert_eq!(less.build().unwrap_err(), BuildError::OutOfMemory { need, limit: need - 1 });

    let allowed = builder(limited(options, need), meshes, instances);
    let before = Counting::restart();
    let scene: Scene = allowed.build().expect("enough");
    let most = (Counting::most() - before) as u64;
    assert!(most <= need, "{most} bytes of {need}: {options:?}");
    assert!(scene.stats().bytes <= most, "{} bytes are kept of {most}", scene.stats().bytes);
    (need, most)
}

/// One test, so that nothing else is counted.
#[test]
fn builds_take_no_more_memory_than_they_say() {
    let meshes: [(&str, f64, Vec<Geometry>); 7] = [
        ("terrain", 1.6, vec![terrain(200)]),
        ("soup", 1.6, vec![soup(100_000)]),
        ("two soups", 1.6, vec![soup(50_000), soup(30_000)]),
        ("nested", 9.0, vec![nested(20_000)]),
        ("row", 9.0, vec![row(50_000)]),
        ("small", 9.0, vec![terrain(9)]),
        ("one", 99.0, vec![soup(1)]),
    ];
    // The threads are started by the first.
    builder(BuildOptions::default(), &[vec![soup(1)]], 1).build().expect("a triangle");
    for layout in Layout::ALL {
        for quality in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::High] {
            let options = BuildOptions { layout, quality, ..BuildOptions::default() };
            for (name, room, mesh) in &meshes {
                let (need, most) = need_and_most(options, std::slice::from_ref(mesh), 1);
                let times = need as f64 / most as f64;
                println!("{} {quality:?} {name}: {need} for {most}, {times:.2} times", layout.name());
                assert!(times <= *room, "{} {quality:?} {name}: {times}", layout.name());
            }
        }
        // Many instances, and meshes that fit only one after the other.
        let options = BuildOptions { layout, ..BuildOptions::default() };
        let (need, most) = need_and_most(options, &[vec![terrain(4)]], 50_000);
        println!("{} instances: {need} for {most}", layout.name());
        let many = vec![vec![terrain(60)]; 20];
        let (need, most) = need_and_most(options, &many, 20);
        println!("{} many meshes: {need} for {most}", layout.name());
        let before = Counting::restart();
        let scene = builder(options, &many, 20).build().expect("as much as it takes");
        println!("{} all at once: {}", layout.name(), Counting::most() - before);

        // What is made of a scene has its limit too: for what is built, not for what stays.
        let saved = scene.save_trees();
        let limit = limited(options, need);
        let scene = builder(limit, &many, 20).build_with_trees(&saved).expect("enough");
        let (mut moved, mut added) = (scene.update(), scene.update());
        moved.move_vertices(3, vec![terrain(60)]);
        added.add_mesh(vec![terrain(400)]);
        assert!(scene.refit(0, &[terrain(60)]).is_ok() && moved.finish().is_ok());
        assert!(matches!(added.finish().unwrap_err(), BuildError::OutOfMemory { .. }));
        let less = builder(limited(options, need / 2), &many, 20).build_with_trees(&saved);
        assert!(matches!(less.unwrap_err(), SavedTreesError::Build(BuildError::OutOfMemory { .. })));
    }
}
