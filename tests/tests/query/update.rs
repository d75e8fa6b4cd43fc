//! Scenes that change, groups and masks: the answers of scenes that were built so from the start.

use core::ops::ControlFlow;
use std::sync::Mutex;

use firsthit_accel::{
    BuildError, BuildOptions, ClosestPoint, Crossings, Geometry, GroupMember, Hit, Layout, Moments, Scene,
    SceneBuilder, SignMethod, Solid,
};
use firsthit_geometry::overlap::Sphere;
use firsthit_geometry::{Precision, Ray, shapes};
use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::single::{mesh, place, vector};

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

fn triangles((positions, triangles): &Mesh) -> Geometry {
    Geometry::Triangles { positions: positions.clone(), triangles: triangles.clone() }
}

/// Meshes and what of them is where: an instance with `None` is not there.
struct World {
    meshes: Vec<Mesh>,
    placed: Vec<Option<(usize, DAffine3)>>,
}

impl World {
    /// Built anew, of what is there; and the index of each instance in the world.
    fn scene(&self, options: BuildOptions) -> (Scene, Vec<u32>) {
        let mut builder = SceneBuilder::new(options);
        for mesh in &self.meshes {
            builder.add_mesh(vec![triangles(mesh)]);
        }
        let mut ids = Vec::new();
        for (i, placed) in (0..).zip(&self.placed) {
            if let Some((mesh, transform)) = placed {
                builder.add_instance(*mesh, *transform);
                ids.push(i);
            }
        }
        (builder.build().expect("good meshes"), ids)
    }
}

/// All kinds of answers are those of the other scene, whose instances have these indices here.
fn agree(scene: &Scene, (other, ids): &(Scene, Vec<u32>), ends: &[(DVec3, DVec3)]) -> Result<(), TestCaseError> {
    let named = |mut hit: Hit| {
        hit.id.instance = ids[hit.id.instance as usize];
        hit
    };
    let near = |mut point: ClosestPoint| {
        point.id.instance = ids[point.id.instance as usize];
        point
    };
    let bounds = other.bounds();
    prop_assert_eq!(scene.bounds(), bounds);
    let at = |p: DVec3| if bounds.is_empty() { p } else { bounds.center() + p * bounds.extent() };
    let rays: Vec<Ray<f64>> = ends.iter().map(|(a, b)| Ray::new(at(*a), at(*b) - at(*a))).collect();
    let mut batch = vec![None; rays.len()];
    scene.closest_hits(&rays, &mut batch);
    for (ray, of_batch) in rays.iter().zip(batch) {
        let hit = other.closest_hit(ray).map(named);
        prop_assert_eq!(scene.closest_hit(ray), hit);
        prop_assert_eq!(of_batch, hit);
        prop_assert_eq!(scene.any_hit(ray), hit.is_some());
        let all: Vec<Hit> = other.all_hits(ray, Crossings::Triangles).into_iter().map(named).collect();
        prop_assert_eq!(scene.all_hits(ray, Crossings::Triangles), all);
        prop_assert_eq!(scene.closest_point(ray.origin), other.closest_point(ray.origin).map(near));
        prop_assert_eq!(scene.count_hits(ray, Crossings::Surfaces), other.count_hits(ray, Crossings::Surfaces));
        let first: Vec<Hit> = other.first_k_hits(ray, 2, Crossings::Triangles).into_iter().map(named).collect();
        prop_assert_eq!(scene.first_k_hits(ray, 2, Crossings::Triangles), first);
        let few: Vec<_> = other.nearest_k(ray.origin, 3, f64::INFINITY).into_iter().map(near).collect();
        prop_assert_eq!(scene.nearest_k(ray.origin, 3, f64::INFINITY), few);
        prop_assert_eq!(scene.cast_sphere(ray, 0.1).map(|h| h.t), other.cast_sphere(ray, 0.1).map(|h| h.t));
        let sphere = Sphere { center: ray.origin, radius: bounds.extent().length().min(1e300) * 0.2 };
        prop_assert_eq!(scene.overlapping(&sphere).len(), other.overlapping(&sphere).len());
    }
    let of = |scene| Solid::with_method(scene, SignMethod::Winding);
    prop_assert_eq!(of(scene).boundary_edges() > 0, of(other).boundary_edges() > 0);
    prop_assert_eq!(scene.stats().instances, other.stats().instances);
    Ok(())
}

/// One change: which kind, to what, and what it becomes.
type Change = (u8, prop::sample::Index, prop::sample::Index, DAffine3, Mesh);

/// Rays with a time each: the answers of a scene built anew for the middle of the step that the time falls to.
#[test]
fn moments_answer_as_scenes_built_anew_for_their_times() {
    let corners = |x: f32| [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p + Vec3::X * x).to_vec();
    let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let bent = |time: f64| corners(2.0).iter().map(|p| *p + Vec3::Y * (time as f32 * p.x * p.x)).collect();
    let turned = |time: f64| DAffine3::from_rotation_y(3.0 * time) * DAffine3::from_translation(DVec3::Z * time);
    let at = |time: f64| {
        let mut builder = SceneBuilder::default();
        for positions in [corners(0.0), bent(time)] {
            let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: faces.clone() }]);
            builder.add_instance(mesh, if mesh == 0 { turned(time) } else { DAffine3::IDENTITY });
        }
        builder.build().expect("good meshes")
    };
    for steps in [0, 1, 7] {
        let moments = Moments::new(&at(0.0), steps, |time, update| {
            update.set_transform(0, turned(time));
            update.move_vertices(1, vec![Geometry::Triangles { positions: bent(time), triangles: faces.clone() }]);
        })
        .expect("good moments");
        assert_eq!(moments.scenes().len(), steps.max(1));
        let mut met = 0;
        for k in 0..400 {
            let time = f64::from(k) / 399.0;
            let expected = Moments::middle(moments.step(time), steps.max(1));
            assert!((time - expected).abs() <= 0.5 / steps.max(1) as f64 + 1e-12);
            let across = f64::from(k * 37 % 400) / 100.0 - 0.5;
            let ray = Ray::new(DVec3::new(across, 0.3, 9.0), DVec3::new(0.02, 0.01, -1.0));
            let hit = moments.at(time).closest_hit(&ray);
            assert_eq!(hit, at(expected).closest_hit(&ray));
            met += usize::from(hit.is_some());
        }
        assert!(met > 50, "{met}");
        assert_eq!([f64::NAN, -1.0, 0.0].map(|t| moments.step(t)), [0; 3]);
        assert_eq!([1.0, 7.0, f64::INFINITY].map(|t| moments.step(t)), [steps.max(1) - 1; 3]);
    }
    let wrong = Moments::new(&at(0.0), 3, |_, update| _ = update.set_transform(9, DAffine3::IDENTITY));
    assert!(matches!(wrong, Err(BuildError::NoSuchInstance { instance: 9, .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn updates_answer_as_scenes_built_anew(
        meshes in prop::collection::vec(mesh(), 1..3), places in prop::collection::vec((any::<prop::sample::Index>(), place()), 1..6),
        changes in prop::collection::vec((0u8..6, any::<prop::sample::Index>(), any::<prop::sample::Index>(), place(), mesh()), 1..6),
        ends in prop::collection::vec((vector(), vector()), 12), moved in 0.0f32..2.0,
    ) {
        let placed = |world: &World, (i, at): &(prop::sample::Index, DAffine3)| Some((i.index(world.meshes.len()), *at));
        for layout in Layout::ALL {
            for precision in [Precision::Robust, Precision::Exact] {
                let options = BuildOptions { layout, precision, ..BuildOptions::default() };
                let mut world = World { meshes: meshes.clone(), placed: Vec::new() };
                world.placed = places.iter().map(|p| placed(&world, p)).collect();
                let (before, _) = world.scene(options);
                let first = World { meshes: meshes.clone(), placed: world.placed.clone() };
                let mut update = before.update();
                for (kind, which, other, at, mesh) in &changes as &[Change] {
                    let (i, m) = (which.index(world.placed.len()), other.index(world.meshes.len()));
                    match kind {
                        0 => {
                            update.set_transform(i, *at);
                            if let Some((_, transform)) = &mut world.placed[i] {
                                *transform = *at;
                            }
                        }
                        1 => {
                            update.remove_instance(i);
                            world.placed[i] = None;
                        }
                        2 => {
                            prop_assert_eq!(update.add_instance(m, *at), world.placed.len());
                            world.placed.push(Some((m, *at)));
                        }
                        3 => {
                            prop_assert_eq!(update.add_mesh(vec![triangles(mesh)]), world.meshes.len());
                            world.meshes.push(mesh.clone());
                        }
                        _ if m < meshes.len() => {
                            // Not only moved but turned inside out, so that some trees have to be built anew.
                            world.meshes[m].0.iter_mut().for_each(|p| *p = *p * (1.0 - moved) + Vec3::new(p.z, p.x, p.y) * moved);
                            update.move_vertices(m, vec![triangles(&world.meshes[m])]);
                        }
                        _ => {}
                    }
                }
                let (after, done) = update.finish().expect("good changes");
                prop_assert_eq!(done.kept + done.refitted + done.built, world.meshes.len());
                agree(&after, &world.scene(options), &ends)?;
                // Who asks the old one gets the old answers.
                agree(&before, &first.scene(options), &ends)?;
            }
        }
    }

    #[test]
    fn masks_hide_instances_from_all_queries(
        mesh in mesh(), places in prop::collection::vec((place(), 0u32..8), 1..8), asked in 0u32..9,
        ends in prop::collection::vec((vector(), vector()), 12),
    ) {
        for layout in Layout::ALL {
            let options = BuildOptions { layout, ..BuildOptions::default() };
            let mut builder = SceneBuilder::new(options);
            let m = builder.add_mesh(vec![triangles(&mesh)]);
            for (place, mask) in &places {
                let i = builder.add_instance(m, *place);
                builder.set_mask(i, *mask);
            }
            let all = builder.build().expect("a good mesh");
            for asked in [asked, u32::MAX] {
                let there = |(at, mask): &(DAffine3, u32)| (mask & asked != 0).then_some((0, *at));
                let world = World { meshes: vec![mesh.clone()], placed: places.iter().map(there).collect() };
                agree(&all.seen_by(asked), &world.scene(options), &ends)?;
                // From another one, which hides others.
                agree(&all.seen_by(1).seen_by(asked), &world.scene(options), &ends)?;
            }
        }
    }

    /// A filter sees the hits that users get, wherever the instance is: here all of them, and those of one side.
    #[test]
    fn filters_see_hits_as_they_are_given(
        mesh in mesh(), places in prop::collection::vec(place(), 1..4), ends in prop::collection::vec((vector(), vector()), 12),
    ) {
        for layout in Layout::ALL {
            let mut builder = SceneBuilder::new(BuildOptions { layout, ..BuildOptions::default() });
            let m = builder.add_mesh(vec![triangles(&mesh)]);
            places.iter().for_each(|at| _ = builder.add_instance(m, *at));
            let scene = builder.build().expect("a good mesh");
            let at = |p: DVec3| scene.bounds().center() + p * scene.bounds().extent();
            for (a, b) in &ends {
                let ray = Ray::new(at(*a), at(*b) - at(*a));
                let mut seen = Vec::new();
                let keep = |hit: &Hit| {
                    seen.push(*hit);
                    false
                };
                prop_assert!(!scene.any_hit_filtered(&ray, None, keep));
                seen.sort_by(|a, b| (a.t, a.id).partial_cmp(&(b.t, b.id)).expect("numbers"));
                let all = scene.all_hits(&ray, Crossings::Triangles);
                prop_assert_eq!(&seen, &all);
                for side in [-1.0, 1.0] {
                    let on_side = |hit: &Hit| hit.normal_direction.dot(ray.direction) * side > 0.0;
                    let first = all.iter().copied().find(on_side);
                    prop_assert_eq!(scene.closest_hit_filtered(&ray, None, on_side), first);
                    prop_assert_eq!(scene.any_hit_filtered(&ray, None, on_side), first.is_some());
                    let of_side: Vec<Hit> = all.iter().copied().filter(on_side).collect();
                    let (what, mut found) = (Crossings::Triangles, Vec::new());
                    scene.all_hits_filtered_into(&ray, what, None, on_side, &mut found);
                    prop_assert_eq!(&found, &of_side);
                    prop_assert_eq!(scene.count_hits_filtered(&ray, what, None, on_side) as usize, of_side.len());
                    scene.first_k_hits_filtered_into(&ray, 2, what, None, on_side, &mut found);
                    prop_assert_eq!(&found[..], &of_side[..of_side.len().min(2)]);
                }
            }
        }
    }

    #[test]
    fn groups_are_the_instances_they_hold(
        mesh in mesh(), inner in prop::collection::vec(place(), 0..4), outer in prop::collection::vec((any::<bool>(), place()), 0..4),
        places in prop::collection::vec((0u8..3, place()), 1..4), ends in prop::collection::vec((vector(), vector()), 12),
    ) {
        let mut builder = SceneBuilder::default();
        let m = builder.add_mesh(vec![triangles(&mesh)]);
        let group = builder.add_group(inner.iter().map(|at| (GroupMember::Mesh(m), *at)));
        let child = |of_group: bool| if of_group { GroupMember::Group(group) } else { GroupMember::Mesh(m) };
        let groups = builder.add_group(outer.iter().map(|(of_group, at)| (child(*of_group), *at)));
        let mut world = World { meshes: vec![mesh.clone()], placed: Vec::new() };
        let mut paths = Vec::new();
        let mut add = |path: Vec<u32>, transform: DAffine3| {
            world.placed.push(Some((0, transform)));
            paths.push(path);
        };
        let mut count = 0;
        for (kind, at) in &places {
            let start = count;
            let mut next = |path: Vec<usize>, transform| {
                add([start].into_iter().chain(path).map(|i| i as u32).collect(), transform);
                count += 1;
            };
            match kind {
                0 => {
                    prop_assert_eq!(builder.add_instance(m, *at), start);
                    next(vec![], *at);
                }
                1 => {
                    for (i, own) in inner.iter().enumerate() {
                        next(vec![i], *at * *own);
                    }
                    prop_assert_eq!(builder.add_instances_of(group, *at), start..count);
                }
                _ => {
                    for (i, (of_group, own)) in outer.iter().enumerate() {
                        if *of_group {
                            for (j, innermost) in inner.iter().enumerate() {
                                next(vec![i, j], *at * *own * *innermost);
                            }
                        } else {
                            next(vec![i], *at * *own);
                        }
                    }
                    prop_assert_eq!(builder.add_instances_of(groups, *at), start..count);
                }
            }
        }
        // Three ill-conditioned transforms may be a worse one.
        let Ok(scene) = builder.build() else { return Ok(()) };
        for (i, path) in (0..).zip(&paths) {
            prop_assert_eq!(&scene.instance_path(i), path);
        }
        agree(&scene, &world.scene(BuildOptions::default()), &ends)?;
    }
}

#[test]
fn what_does_not_exist_is_an_error() {
    let mesh = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let mut builder = SceneBuilder::default();
    let m = builder.add_mesh(vec![triangles(&mesh)]);
    builder.add_instance(m, DAffine3::IDENTITY);
    let scene = builder.clone().build().expect("a triangle");

    let failed = |change: &dyn Fn(&mut firsthit_accel::SceneUpdate)| {
        let mut update = scene.update();
        change(&mut update);
        update.finish().map(|_| ()).unwrap_err()
    };
    let instance = BuildError::NoSuchInstance { instance: 1, count: 1 };
    assert_eq!(failed(&|u| _ = u.remove_instance(1)), instance);
    assert_eq!(failed(&|u| _ = u.set_transform(1, DAffine3::IDENTITY)), instance);
    assert_eq!(failed(&|u| _ = u.move_vertices(1, vec![])), BuildError::UnknownMesh { mesh: 1, count: 1 });
    assert!(matches!(failed(&|u| _ = u.move_vertices(0, vec![])), BuildError::GeometriesChanged { .. }));
    assert!(matches!(failed(&|u| _ = u.add_instance(7, DAffine3::IDENTITY)), BuildError::NoSuchMesh { mesh: 7, .. }));

    let mut masked = builder.clone();
    masked.set_mask(1, 1);
    assert_eq!(masked.build().unwrap_err(), instance);
    let mut unknown = builder.clone();
    assert_eq!(unknown.add_instances_of(0, DAffine3::IDENTITY), 1..1);
    assert_eq!(unknown.build().unwrap_err(), BuildError::NoSuchGroup { group: 0, count: 0 });
    // A group holds groups that were there before it: no circles.
    let mut circle = builder.clone();
    circle.add_group([(GroupMember::Group(1), DAffine3::IDENTITY), (GroupMember::Group(0), DAffine3::IDENTITY)]);
    circle.add_group([(GroupMember::Group(0), DAffine3::IDENTITY), (GroupMember::Group(1), DAffine3::IDENTITY)]);
    circle.add_instances_of(0, DAffine3::IDENTITY);
    circle.add_instances_of(1, DAffine3::IDENTITY);
    assert_eq!(circle.build().unwrap_err(), BuildError::NoSuchGroup { group: 1, count: 0 });
    // Two of two of two ...: counted before anything is made.
    let mut child = GroupMember::Mesh(m);
    for _ in 0..100 {
        child = GroupMember::Group(builder.add_group([(child, DAffine3::IDENTITY), (child, DAffine3::IDENTITY)]));
    }
    let GroupMember::Group(all) = child else { unreachable!("a group") };
    assert_eq!(builder.add_instances_of(all, DAffine3::IDENTITY), 1..1);
    assert!(matches!(builder.build().unwrap_err(), BuildError::TooMany { what: "instances", .. }));
}

/// Deep groups, and nothing of nothing of nothing, in no time and no stack.
#[test]
fn groups_may_be_deep_and_empty() {
    let at = DAffine3::IDENTITY;
    let mut builder = SceneBuilder::default();
    let m = builder.add_mesh(vec![triangles(&(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]))]);
    let mut empty = builder.add_group([]);
    for _ in 0..70 {
        empty = builder.add_group([(GroupMember::Group(empty), at), (GroupMember::Group(empty), at)]);
    }
    assert_eq!(builder.add_instances_of(empty, at), 0..0);
    let mut deep = builder.add_group([(GroupMember::Group(empty), at), (GroupMember::Mesh(m), at)]);
    for _ in 0..100_000 {
        deep = builder.add_group([(GroupMember::Group(deep), at)]);
    }
    assert_eq!(builder.add_instances_of(deep, at), 0..1);
    let scene = builder.build().expect("a triangle");
    let path = scene.instance_path(0);
    assert_eq!((path.len(), path.first(), path.last()), (100_002, Some(&0), Some(&1)));
    assert!(scene.any_hit(&Ray::new(DVec3::new(0.2, 0.2, 1.0), DVec3::NEG_Z)));
}

#[test]
fn shapes_of_hidden_instances_are_not_met() {
    let mut builder = SceneBuilder::default();
    let plane =
        builder.add_mesh(vec![Geometry::Shape(shapes::Plane::new(DVec3::ZERO, DVec3::Z).expect("a plane").into())]);
    builder.add_instance(plane, DAffine3::IDENTITY);
    let scene = builder.build().expect("a plane");
    let ray = Ray::new(DVec3::Z, DVec3::NEG_Z);
    assert!(scene.any_hit(&ray));
    assert!(!scene.seen_by(0).any_hit(&ray));
    let mut update = scene.update();
    update.remove_instance(0);
    assert!(!update.finish().expect("one less").0.any_hit(&ray));
}

#[test]
fn a_watched_build_tells_how_far_it_is_and_can_be_cancelled() {
    let mut builder = SceneBuilder::default();
    for z in 0..20 {
        let at = |x: f32, y: f32| Vec3::new(x, y, z as f32);
        let positions: Vec<Vec3> = (0..300).flat_map(|i| [at(i as f32, 0.0), at(i as f32, 1.0)]).collect();
        let triangles = (0..598).map(|i| [i, i + 1, i + 2]).collect();
        let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles }]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
    }
    let told = Mutex::new(Vec::new());
    let watch = |done: f64| {
        told.lock().expect("no panic").push(done);
        ControlFlow::Continue(())
    };
    let scene = builder.clone().build_watched(&watch).expect("good meshes");
    let mut told = told.into_inner().expect("no panic");
    told.sort_by(f64::total_cmp);
    assert_eq!((told.len(), told.last()), (60, Some(&1.0)));
    assert!(told[0] > 0.0);
    let ray = Ray::new(DVec3::new(7.5, 0.5, 40.0), DVec3::NEG_Z);
    assert_eq!(scene.closest_hit(&ray), builder.clone().build().expect("good meshes").closest_hit(&ray));

    for most in [0.0, 0.3, 0.9] {
        let watch = |done| if done > most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        assert_eq!(builder.clone().build_watched(&watch).unwrap_err(), BuildError::Cancelled);
    }
}
