//! Primitives of the user's own: the answers of the same shapes and triangles that firsthit knows.

use std::sync::Arc;

use firsthit_accel::{
    BuildError, BuildOptions, Crossings, Geometry, Hit, HitId, Layout, Scene, SceneBuilder, UserPrimitives, reference,
};
use firsthit_geometry::shapes::{ClosestOnSurface, Sphere};
use firsthit_geometry::{Aabb, Precision, Primitive, Ray, SurfaceHit};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

use crate::single::{mesh, place, vector};

/// Spheres as a user would write them.
#[derive(Debug)]
pub(crate) struct Balls(pub(crate) Vec<Sphere<f64>>);

impl UserPrimitives for Balls {
    fn count(&self) -> u32 {
        self.0.len() as u32
    }
    fn bounds(&self, i: u32) -> Aabb<f64> {
        self.0[i as usize].bounds()
    }
    fn closest_hit(&self, i: u32, ray: &Ray<f64>) -> Option<SurfaceHit<f64>> {
        self.0[i as usize].closest_hit(ray)
    }
    fn refine(&self, i: u32, point: DVec3, normal: Option<DVec3>) -> (DVec3, f64) {
        self.0[i as usize].refine(point, normal)
    }
    fn closest_point(&self, i: u32, point: DVec3) -> Option<ClosestOnSurface> {
        let ball = &self.0[i as usize];
        let outward = (point - ball.center()).normalize_or(DVec3::X);
        let point = ball.center() + outward * ball.radius();
        Some(ClosestOnSurface { point, u: 0.25, v: 0.5, normal: Some(outward) })
    }
}

/// What does not depend on the way to the object and back.
fn named(hit: Hit) -> (HitId, f64) {
    (hit.id, hit.t)
}

/// The same hits, told by other names: of shapes, each its own geometry.
fn renamed(scene: &Scene, ray: &Ray<f64>, what: Crossings, first: u32) -> Vec<Hit> {
    let shape = |mut hit: Hit| {
        if hit.id.geometry >= first {
            (hit.id.primitive, hit.id.geometry) = (hit.id.geometry - first, first);
        }
        hit
    };
    scene.all_hits(ray, what).into_iter().map(shape).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    #[test]
    fn balls_of_the_user_are_spheres(
        balls in prop::collection::vec((vector(), 0.01..1.0f64), 1..30), (positions, triangles) in mesh(), mixed: bool,
        places in prop::collection::vec(place(), 1..4), ends in prop::collection::vec((vector(), vector()), 12),
    ) {
        let balls: Vec<_> = balls.iter().map(|(c, r)| Sphere::new(*c, *r).expect("a sphere")).collect();
        let mesh = mixed.then_some(Geometry::Triangles { positions, triangles });
        let first = u32::from(mixed);
        for layout in Layout::ALL {
            for precision in [Precision::Robust, Precision::Double] {
                let scene = |geometries: Vec<Geometry>| {
                    let mut builder = SceneBuilder::new(BuildOptions { layout, precision, ..BuildOptions::default() });
                    let m = builder.add_mesh(mesh.iter().cloned().chain(geometries).collect());
                    places.iter().for_each(|at| _ = builder.add_instance(m, *at));
                    builder.build().expect("good shapes")
                };
                let known = scene(balls.iter().map(|b| Geometry::Shape((*b).into())).collect());
                let user = scene(vec![Geometry::User(Arc::new(Balls(balls.clone())))]);
                prop_assert_eq!(user.bounds(), known.bounds());
                let at = |p: DVec3| known.bounds().center() + p * known.bounds().extent();
                for (a, b) in &ends {
                    let ray = Ray::new(at(*a), at(*b) - at(*a));
                    for what in [Crossings::Triangles, Crossings::Surfaces] {
                        prop_assert_eq!(user.all_hits(&ray, what), renamed(&known, &ray, what, first));
                        prop_assert_eq!(user.count_hits(&ray, what), known.count_hits(&ray, what));
                    }
                    let hit = user.closest_hit(&ray);
                    prop_assert_eq!(user.any_hit(&ray), hit.is_some());
                    prop_assert_eq!(hit.map(|h| (h.t, h.normal_direction)), known.closest_hit(&ray).map(|h| (h.t, h.normal_direction)));
                    prop_assert_eq!(hit.map(|h| h.id), reference::closest_hit(&user, &ray).map(|h| h.id));
                    if let (Some(hit), Some(same)) = (hit, known.closest_hit(&ray)) {
                        prop_assert_eq!(user.surface_point(&ray, &hit), known.surface_point(&ray, &same));
                    }
                }
            }
        }
    }

    /// At the tier `Exact` too they are sorted in among triangles, and what the scene says is what the slow twin says.
    #[test]
    fn exact_scenes_sort_them_in(
        balls in prop::collection::vec((vector(), 0.01..1.0f64), 1..30), (positions, triangles) in mesh(),
        place in place(), ends in prop::collection::vec((vector(), vector()), 12),
    ) {
        let balls = balls.iter().map(|(c, r)| Sphere::new(*c, *r).expect("a sphere")).collect();
        let mut builder = SceneBuilder::new(BuildOptions { precision: Precision::Exact, ..BuildOptions::default() });
        let m = builder.add_mesh(vec![Geometry::User(Arc::new(Balls(balls))), Geometry::Triangles { positions, triangles }]);
        builder.add_instance(m, place);
        let scene = builder.build().expect("good shapes");
        let at = |p: DVec3| scene.bounds().center() + p * scene.bounds().extent();
        for (a, b) in &ends {
            let ray = Ray::new(at(*a), at(*b) - at(*a));
            let all = scene.all_hits(&ray, Crossings::Triangles);
            let exact = reference::exact_crossings(&scene, &ray, Crossings::Triangles);
            prop_assert!(all.iter().copied().map(named).eq(exact.into_iter().map(named)));
            prop_assert_eq!(scene.closest_hit(&ray), all.first().copied());
        }
    }
}

/// What a user may get wrong.
#[derive(Debug)]
struct Odd {
    bounds: Aabb<f64>,
    t: f64,
}

impl UserPrimitives for Odd {
    fn count(&self) -> u32 {
        2
    }
    fn bounds(&self, i: u32) -> Aabb<f64> {
        if i == 1 { self.bounds } else { Aabb::new(DVec3::ZERO, DVec3::ONE) }
    }
    fn closest_hit(&self, _: u32, ray: &Ray<f64>) -> Option<SurfaceHit<f64>> {
        assert!(ray.t_min <= ray.t_max);
        Some(SurfaceHit { t: self.t, u: f64::NAN, v: 0.0, normal: Some(DVec3::NAN) })
    }
    fn is_flat(&self) -> bool {
        true
    }
}

#[test]
fn odd_answers_of_the_user_do_no_harm() {
    let build = |bounds, t| {
        let mut builder = SceneBuilder::default();
        let m = builder.add_mesh(vec![Geometry::User(Arc::new(Odd { bounds, t }))]);
        builder.add_instance(m, glam::DAffine3::IDENTITY);
        builder.build()
    };
    let one = Aabb::new(DVec3::ZERO, DVec3::ONE);
    let ray = Ray::new(DVec3::new(0.5, 0.5, 4.0), DVec3::NEG_Z).with_interval(0.0, 9.0);
    for t in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 10.0] {
        let scene = build(one, t).expect("a box");
        assert!(scene.closest_hit(&ray).is_none() && !scene.any_hit(&ray), "{t}");
        assert!(scene.all_hits(&ray, Crossings::Surfaces).is_empty());
    }
    // Not even where the ray has no end.
    let scene = build(one, f64::INFINITY).expect("a box");
    let endless = Ray::new(ray.origin, ray.direction);
    assert!(scene.closest_hit(&endless).is_none() && reference::all_hits(&scene, &endless).is_empty());
    assert!(reference::exact_crossings(&scene, &endless, Crossings::Triangles).is_empty());
    // At the end of the interval, after which there is nothing to ask about.
    assert_eq!(build(one, 9.0).expect("a box").all_hits(&ray, Crossings::Triangles).len(), 2);
    // The same hit again and again is one hit of each.
    let scene = build(one, 3.5).expect("a box");
    assert_eq!(scene.all_hits(&ray, Crossings::Triangles).len(), 2);
    let id = scene.closest_hit(&ray).expect("a hit").id;
    assert_eq!(id.primitive, 0);
    assert_eq!(scene.closest_hit_filtered(&ray, Some(id), |_| true).map(|h| h.id.primitive), Some(1));
    // Without an end, it is tested against all rays.
    let endless = build(Aabb::new(DVec3::NEG_INFINITY, DVec3::INFINITY), 3.5).expect("no box");
    assert!(endless.any_hit(&Ray::new(DVec3::splat(100.0), DVec3::X)));
    for bounds in [Aabb::new(DVec3::NAN, DVec3::ONE), Aabb::new(DVec3::ONE, DVec3::ZERO)] {
        let unusable = BuildError::UnusableBounds { mesh: 0, geometry: 0, primitive: 1 };
        assert_eq!(build(bounds, 3.5).unwrap_err(), unusable);
    }
    // They are refitted as other shapes are.
    let moved = |t| [Geometry::User(Arc::new(Odd { bounds: one, t }))];
    assert_eq!(scene.refit(0, &moved(4.0)).expect("as many").closest_hit(&ray).map(|h| h.t), Some(4.0));
    assert!(matches!(
        scene.refit(0, &[Geometry::User(Arc::new(Balls(Vec::new())))]),
        Err(BuildError::TrianglesChanged { before: 2, now: 0, .. })
    ));
    assert!(matches!(
        scene.refit(0, &[Geometry::Triangles { positions: vec![Vec3::ZERO], triangles: vec![[0; 3]; 2] }]),
        Err(BuildError::KindChanged { .. })
    ));
}
