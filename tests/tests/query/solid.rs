//! Inside and outside are told alike by all methods where they apply, and winding numbers are those of the slow twin.

use std::collections::HashSet;

use firsthit_accel::{BuildOptions, Crossings, Geometry, Layout, SceneBuilder, SignMethod, Solid, reference};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::bumpy_sphere;
use firsthit_tests::oracle::{Aim, Mesh, Rng, icosphere, read_obj, soup};
use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::single::{mesh, place, vector};
use crate::triangles;

const CUBE: [[u32; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

fn cube(triangles: &[[u32; 3]]) -> Geometry {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
    Geometry::Triangles { positions: (0..8).map(corner).collect(), triangles: triangles.to_vec() }
}

const METHODS: [SignMethod; 6] = [
    SignMethod::Winding,
    SignMethod::FastWinding { accuracy: 2.0 },
    SignMethod::Parity { votes: 1 },
    SignMethod::Parity { votes: 5 },
    SignMethod::Pseudonormal,
    SignMethod::Exact,
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// A placed cube: inside is what is within 0 and 1 of its own coordinates.
    #[test]
    fn all_methods_know_a_cube(place in place(), points in prop::collection::vec(vector(), 30), aimed in 0..8usize) {
        let to_object = place.inverse();
        for precision in Precision::ALL {
            for layout in Layout::ALL {
                let mut builder = SceneBuilder::new(BuildOptions { precision, layout, ..BuildOptions::default() });
                let mesh = builder.add_mesh(vec![cube(&CUBE)]);
                builder.add_instance(mesh, place);
                let scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?;
                prop_assert_eq!(Solid::new(&scene).method(), SignMethod::Winding);
                for method in METHODS {
                    let solid = Solid::with_method(&scene, method);
                    prop_assert!(solid.is_watertight() && solid.boundary_edges() == 0);
                    for p in &points {
                        // Some lie where edges and faces go on, or beside corners.
                        let mut local = *p * 1.5 + 0.5;
                        for axis in 0..3 {
                            if aimed >> axis & 1 == 1 && local.to_array().iter().any(|x| !(-0.01..1.01).contains(x)) {
                                local[axis] = local[axis].round();
                            }
                        }
                        let p = place.transform_point3(local);
                        let local = to_object.transform_point3(p);
                        // Not on the surface, as far as can be told.
                        let margin = local.to_array().map(|x| x.abs().min((x - 1.0).abs())).into_iter().fold(1.0, f64::min);
                        let inside = local.cmpgt(DVec3::ZERO).all() && local.cmplt(DVec3::ONE).all();
                        let outside = local.cmplt(DVec3::splat(-1e-3)).any() || local.cmpgt(DVec3::splat(1.001)).any();
                        if margin < 1e-3 && !outside {
                            continue;
                        }
                        prop_assert_eq!(solid.contains(p), inside, "{:?} {:?} {:?} {}", precision, layout, method, local);
                        let distance = scene.distance(p);
                        prop_assert_eq!(solid.signed_distance(p), if inside { -distance } else { distance });
                    }
                }
            }
        }
    }

    /// Of anything at all, mirrored and stretched, several times.
    #[test]
    fn winding_numbers_are_those_of_the_slow_twin(
        (positions, indices) in mesh(), places in prop::collection::vec(place(), 1..4), points in prop::collection::vec(vector(), 20),
    ) {
        let mut builder = SceneBuilder::default();
        let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: indices }]);
        for place in &places {
            builder.add_instance(mesh, *place);
        }
        let scene = builder.build().map_err(|e| TestCaseError::fail(e.to_string()))?;
        let solid = Solid::with_method(&scene, SignMethod::Winding);
        let bounds = scene.bounds();
        for p in points {
            let p = bounds.center() + p * bounds.extent();
            let expected = reference::winding_number(&scene, p);
            let got = solid.winding_number(p);
            // Close to a sheet it changes by 1.
            if scene.distance(p) > 1e-6 * bounds.extent().max_element() {
                prop_assert!((got - expected).abs() < 1e-6, "{} {}", got, expected);
                if (expected.abs() - 0.5).abs() > 1e-6 {
                    prop_assert_eq!(solid.contains(p), expected.abs() > 0.5, "{}", expected);
                }
            }
        }
    }
}

#[test]
fn what_is_not_finite_is_not_inside() {
    let mut builder = SceneBuilder::default();
    let mesh = builder.add_mesh(vec![cube(&CUBE)]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    let scene = builder.build().expect("a cube");
    for method in METHODS {
        let solid = Solid::with_method(&scene, method);
        for p in [DVec3::NAN, DVec3::new(0.5, f64::INFINITY, 0.5)] {
            assert!(!solid.contains(p) && solid.winding_number(p).is_nan() && solid.signed_distance(p).is_nan());
        }
        assert!(!solid.contains(DVec3::splat(1e300)));
    }
    let nothing = Solid::new(&SceneBuilder::default().build().expect("nothing"));
    assert!(!nothing.contains(DVec3::ZERO) && nothing.signed_distance(DVec3::ZERO) == f64::INFINITY);
}

#[test]
fn the_default_suits_the_mesh() {
    let solid = |triangles: &[[u32; 3]]| {
        let mut builder = SceneBuilder::default();
        let mesh = builder.add_mesh(vec![cube(triangles)]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        Solid::new(&builder.build().expect("a cube"))
    };
    let middle = DVec3::new(0.5, 0.45, 0.55);
    // Inside out it has the same inside.
    let turned: Vec<_> = CUBE.iter().map(|&[a, b, c]| [a, c, b]).collect();
    assert!(solid(&turned).contains(middle) && solid(&turned).winding_number(middle) == -1.0);
    // One triangle turned.
    let mut mixed = CUBE;
    mixed[3].swap(0, 1);
    let mixed = solid(&mixed);
    assert_eq!((mixed.method(), mixed.is_watertight()), (SignMethod::Parity { votes: 1 }, true));
    assert!(mixed.contains(middle) && !mixed.contains(middle + DVec3::X));
    // Without a face it has a lid all the same.
    let open = solid(&CUBE[2..]);
    assert_eq!((open.method(), open.is_watertight(), open.boundary_edges()), (SignMethod::Winding, false, 4));
    assert!((open.winding_number(middle) - reference::winding_number(open.scene(), middle)).abs() < 1e-12);
    assert!(open.contains(middle) && !open.contains(DVec3::new(0.5, 0.5, -0.5)) && !open.contains(DVec3::splat(3.0)));
}

/// The bunny has holes: winding numbers against the sum over all its triangles; the fast way is close to them.
#[test]
fn the_open_bunny() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let bunny = read_obj(&shared.join("assets/stanford-bunny/stanford-bunny.obj")).expect("the bunny");
    let mut builder = SceneBuilder::default();
    let mesh = builder.add_mesh(vec![triangles(&bunny)]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    let scene = builder.build().expect("the bunny");
    let solid = Solid::new(&scene);
    assert_eq!((solid.method(), solid.boundary_edges()), (SignMethod::Winding, 223));
    let fast = Solid::with_method(&scene, SignMethod::FastWinding { accuracy: 2.0 });
    let bounds = scene.bounds();
    let (mut inside, mut worst, mut count) = (0, 0.0f64, 0);
    for i in 0..1000u32 {
        // A sequence that fills space (Roberts 2018).
        let k = f64::from(i);
        let at = DVec3::new(k * 0.819_172_513, k * 0.671_043_606, k * 0.549_700_478).fract();
        let p = bounds.min + bounds.extent() * at;
        let expected = reference::winding_number(&scene, p);
        assert!((solid.winding_number(p) - expected).abs() < 1e-9, "{p}");
        worst = worst.max((fast.winding_number(p) - expected).abs());
        assert_eq!(solid.contains(p), expected > 0.5, "{p}");
        inside += u32::from(solid.contains(p));
        count += 1;
    }
    assert!(worst < 0.1 && (200..600).contains(&inside), "{worst} {inside}");
    firsthit_tests::summary(&format!(
        "winding numbers of the open bunny: {count} points, {inside} inside; fast: {worst:.4} off at most"
    ));
}

/// The edges that one triangle has and no other in the opposite direction.
fn border(mesh: &Mesh) -> Vec<[DVec3; 2]> {
    let edges = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let all: HashSet<[u32; 2]> = edges.clone().collect();
    let open = edges.filter(|[a, b]| !all.contains(&[*b, *a]));
    open.map(|edge| edge.map(|i| mesh.positions[i as usize].as_dvec3())).collect()
}

/// Sides are told without summing all edges of the border: as the sum over all triangles says, in the volume and at all distances
/// from the border, of one loop and of many.
#[test]
fn sides_of_open_meshes_are_those_of_all_their_triangles() {
    let mut rng = Rng(3);
    let mut halved = icosphere(4);
    halved.triangles.retain(|t| t.iter().map(|&i| halved.positions[i as usize].z).sum::<f32>() < 1.0);
    let mut pierced = bumpy_sphere(4);
    let mut index = 0;
    pierced.triangles.retain(|_| {
        index += 1;
        index % 5 != 0 && !(300..700).contains(&index)
    });
    let mut meshes = vec![halved, pierced, soup(&mut rng, 300)];
    if let Some(shared) = firsthit_tests::shared() {
        meshes.push(read_obj(&shared.join("assets/stanford-bunny/stanford-bunny.obj")).expect("the bunny"));
    }
    for mesh in &meshes {
        let border = border(mesh);
        let points = if mesh.triangles.len() > 10_000 { 200 } else { 4000 };
        for place in [DAffine3::IDENTITY, DAffine3::from_scale(DVec3::new(-1.0, 2.0, 0.4))] {
            let mut builder = SceneBuilder::default();
            let placed = builder.add_mesh(vec![triangles(mesh)]);
            builder.add_instance(placed, place);
            let scene = builder.build().expect("a mesh");
            let solid = Solid::with_method(&scene, SignMethod::Winding);
            let (bounds, size) = (scene.bounds(), scene.bounds().extent().max_element());
            let (mut sides, mut left) = ([0, 0], 0);
            for k in 0..points {
                let p = if k % 4 == 0 {
                    bounds.center() + rng.in_cube() * bounds.extent() * 0.6
                } else {
                    let [a, b] = border[rng.below(border.len())];
                    let off = rng.in_cube() * size * 10f64.powi(-(rng.below(10) as i32));
                    place.transform_point3(a.lerp(b, rng.unit())) + off
                };
                let expected = reference::winding_number(&scene, p).abs();
                if (expected - 0.5).abs() < 1e-7 {
                    left += 1;
                    continue;
                }
                assert_eq!(solid.contains(p), expected > 0.5, "{p}: {expected}");
                sides[usize::from(expected > 0.5)] += 1;
            }
            assert!(sides[0] > points / 5 && left < points / 50, "{sides:?} {left}");
            firsthit_tests::summary(&format!(
                "sides of an open mesh of {} triangles, {} edges of its border: {sides:?} outside and inside",
                mesh.triangles.len(),
                border.len()
            ));
        }
    }
}

/// Beside edges and corners, where the neighbours' distances are rounded apart, the side is that of exact crossings.
#[test]
fn pseudonormals_see_all_neighbours_beside_the_surface() {
    let (mut rng, mut asked) = (Rng(41), 0);
    let middle = DVec3::new(41.4, -70.0, -223.1);
    let mesh = bumpy_sphere(3).map(|p| (p.as_dvec3() * 200.0 + middle).as_vec3());
    let mut builder = SceneBuilder::default();
    let placed = builder.add_mesh(vec![triangles(&mesh)]);
    builder.add_instance(placed, DAffine3::IDENTITY);
    let scene = builder.build().expect("a mesh");
    let solid = Solid::with_method(&scene, SignMethod::Pseudonormal);
    for k in 0..6000 {
        let on = Aim::ALL[k % 3].point(mesh.corners(rng.below(mesh.triangles.len())), &mut rng);
        let p = on + rng.in_cube() * 10f64.powi(-(rng.below(12) as i32));
        // What is nearer cannot be told: the size is some 400.
        if scene.distance(p) > 1e-12 {
            let ray = Ray::new(p, rng.direction());
            let inside = reference::exact_crossings(&scene, &ray, Crossings::Surfaces).len() % 2 == 1;
            assert_eq!(solid.contains(p), inside, "{p} at {:e}", scene.distance(p));
            asked += 1;
        }
    }
    assert!(asked > 5000, "{asked}");
}

/// Found by brute force: 5e-11 away, where the triangle on the other side of the nearest edge is farther by a millionth of that.
#[test]
fn pseudonormals_of_nefertiti_beside_an_edge() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let path = shared.join("assets/nefertiti/nefertiti.obj.zst");
    let desc = firsthit_import::open(&path, &firsthit_import::Options::default()).expect("nefertiti").scene;
    let scene = SceneBuilder::from_desc(&desc, BuildOptions::default()).build().expect("nefertiti");
    let p = DVec3::new(41.363_300_323_502_656, -69.958_499_908_490_6, -223.135_002_136_210_9);
    for method in [SignMethod::Exact, SignMethod::Pseudonormal] {
        assert!(!Solid::with_method(&scene, method).contains(p), "{method:?}");
    }
}

/// An open quad, bent.
fn quad() -> Geometry {
    let corner = |x, y, z| Vec3::new(x, y, z);
    Geometry::Triangles {
        positions: vec![Vec3::ZERO, corner(1.0, 0.1, 0.0), corner(0.9, 1.0, 0.3), corner(0.0, 1.0, 0.1)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// Where a ray would pass the edge at which a surface ends, another one is taken: on which side it passes is not certain.
#[test]
fn winding_numbers_do_not_jump_where_rays_meet_edges() {
    let corners = [DVec3::ZERO, DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.9, 1.0, 0.3), DVec3::new(0.0, 1.0, 0.1)]
        .map(|p| p.as_vec3().as_dvec3());
    for precision in Precision::ALL {
        let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
        let mesh = builder.add_mesh(vec![quad()]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        let scene = builder.build().expect("a quad");
        let solid = Solid::with_method(&scene, SignMethod::Winding);
        // The directions that rays of its first vote have, in any of their orders.
        let tilt = [0.312_7 * 0.7f64.cos() + 0.011_3, 0.287_1 * 0.7f64.sin() - 0.017_9];
        let mut checked = 0;
        for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
            let mut direction = DVec3::ZERO;
            direction[axis] = side;
            direction[(axis + 1) % 3] = tilt[0];
            direction[(axis + 2) % 3] = tilt[1];
            for k in 0..4 {
                for step in 0..400 {
                    let on = corners[k].lerp(corners[(k + 1) % 4], f64::from(step) / 400.0);
                    for s in [0.01, 0.1, 0.3] {
                        let p = on - direction * s;
                        let (got, expected) = (solid.winding_number(p), reference::winding_number(&scene, p));
                        assert!((got - expected).abs() < 1e-6, "{precision} {p}: {got} {expected}");
                        checked += 1;
                    }
                }
            }
        }
        assert_eq!(checked, 28_800);
    }
}

/// Stretched, turned, mirrored, tiny: the clusters' sum is near the exact one. (The twin's products vanish where all is tiny.)
#[test]
fn clusters_of_stretched_instances() {
    let sheared = glam::DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(-0.3, 0.4, 1.0));
    let mirrored = DVec3::new(-1.0, 1.0, 1.0);
    for (place, size) in [
        (DAffine3::from_scale(DVec3::new(1.0, 1.0, 10.0)), 1.0),
        (DAffine3::from_scale(DVec3::new(-5.0, 5.0, 1.0)), 1.0),
        (DAffine3::from_scale(mirrored), 1e-110),
        (DAffine3::from_mat3(sheared), 1.0),
    ] {
        let scene = |place| {
            let mut builder = SceneBuilder::default();
            let mesh = builder.add_mesh(vec![quad(), cube(&CUBE[2..])]);
            builder.add_instance(mesh, place);
            builder.build().expect("a mesh")
        };
        let (of_size, plain) = (scene(DAffine3::from_scale(DVec3::splat(size)) * place), scene(place));
        let fast = Solid::with_method(&of_size, SignMethod::FastWinding { accuracy: 2.0 });
        let exact = Solid::with_method(&of_size, SignMethod::Winding);
        for p in [DVec3::new(0.1, 0.1, -1.0), DVec3::new(0.4, 0.5, 0.6), DVec3::new(3.0, -2.0, 1.0)] {
            let p = place.transform_point3(p);
            let expected = reference::winding_number(&plain, p);
            let (fast, exact) = (fast.winding_number(p * size), exact.winding_number(p * size));
            assert!(
                (fast - expected).abs() < 0.02 && (exact - expected).abs() < 1e-6,
                "{place:?} {fast} {exact} {expected}"
            );
        }
    }
}
