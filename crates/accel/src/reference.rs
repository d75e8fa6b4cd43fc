//! The slow twin: every primitive tested in `f64`, no tree.
//!
//! Obvious, and right wherever double precision can decide. Queries of any tier and layout are tested against it; it is
//! public so that you can do so too.

use core::ops::ControlFlow;
use std::collections::BTreeMap;

use firsthit_geometry::distance::{Feature, closest_on_triangle};
use firsthit_geometry::overlap::Region;
use firsthit_geometry::sweep::{ConvexBody, convex_to_triangle, sphere_to_triangle};
use firsthit_geometry::triangle_pair::{meet, meet_otherwise};
use firsthit_geometry::{
    Primitive, Ray,
    exact::{ExactRay, Root},
    transform::Transform,
    triangle::{self, Shear},
};
use glam::DVec3;

use crate::model::{ModelShape, Surface};
use crate::region::{meets, separation};
use crate::{BodyHit, ClosestPoint, Crossings, Hit, HitId, Part, Scene, Separation, SphereHit, VisitedTriangle};

/// All hits in the ray's closed interval, by `t`, then by id, those of the closed triangles
/// ([`Crossings::Triangles`]). Of a shape that a ray meets more than once, all.
#[must_use]
pub fn all_hits(scene: &Scene, ray: &Ray<f64>) -> Vec<Hit> {
    crossings(scene, ray, Crossings::Triangles)
}

/// How many hits there are.
#[must_use]
pub fn count_hits(scene: &Scene, ray: &Ray<f64>, what: Crossings) -> u32 {
    crossings(scene, ray, what).len() as u32
}

/// All hits in the ray's closed interval, by `t`, then by id: with [`Crossings::Surfaces`], each crossing of a surface
/// once, by the rule of [`Shear::crosses`] in `f64`.
#[must_use]
pub fn crossings(scene: &Scene, ray: &Ray<f64>, what: Crossings) -> Vec<Hit> {
    let mut hits = Vec::new();
    if !ray.is_valid() {
        return hits;
    }
    for (i, instance) in scene.shown() {
        let Some(model) = scene.models().get(instance.model as usize) else { continue };
        let transform = &instance.transform;
        let local = transform.ray_to_object(ray);
        for (id, surface) in model.surfaces() {
            let id = HitId { instance: i, geometry: id.geometry, primitive: id.primitive };
            match surface {
                Surface::Triangle(v) => {
                    let crossed = what == Crossings::Triangles
                        || Shear::<f64>::new(local.direction).crosses(v.map(|p| p - local.origin)).is_some();
                    if let Some(h) = triangle::watertight(v, &local).filter(|_| crossed) {
                        let normal = triangle::normal(v).map_or(DVec3::ZERO, |n| transform.normal(n));
                        hits.push(Hit { id, t: h.t + 0.0, u: h.u as f32, v: h.v as f32, normal_direction: normal });
                    }
                }
                Surface::Shape(s) => {
                    let scale = model.scale();
                    let mut rest = Ray { origin: local.origin * scale, direction: local.direction * scale, ..local };
                    for _ in 0..s.shape.most_hits() {
                        let Some(h) = s.shape.closest_hit(&rest) else { break };
                        let normal = h.normal.map_or(DVec3::ZERO, |n| transform.normal(n));
                        hits.push(Hit { id, t: h.t + 0.0, u: h.u as f32, v: h.v as f32, normal_direction: normal });
                        rest.t_min = h.t.next_up();
                    }
                }
            }
        }
    }
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.id.cmp(&b.id)));
    hits
}

/// All hits in the ray's closed interval, decided exactly in each instance's own space, for the ray as rounded there:
/// `t` correctly rounded, in exact order within an instance.
///
/// At [`Precision::Exact`](firsthit_geometry::Precision::Exact) the scene answers the same, bit for bit (-0 is given
/// as 0 by both).
#[must_use]
pub fn exact_crossings(scene: &Scene, ray: &Ray<f64>, what: Crossings) -> Vec<Hit> {
    let mut hits = Vec::new();
    for (i, instance) in scene.shown() {
        let Some(model) = scene.models().get(instance.model as usize) else { continue };
        let transform = &instance.transform;
        let local = transform.ray_to_object(ray);
        let Some(exact) = ExactRay::new(local) else { continue };
        let counts = |crosses: bool| crosses || what == Crossings::Triangles;
        for (id, surface) in model.surfaces() {
            let id = HitId { instance: i, geometry: id.geometry, primitive: id.primitive };
            match surface {
                Surface::Triangle(v) => {
                    if let Some(h) = exact.hit(v).filter(|h| counts(h.crosses)) {
                        let normal = triangle::normal(v).map_or(DVec3::ZERO, |n| transform.normal(n));
                        let hit = Hit { id, t: h.t + 0.0, u: h.u as f32, v: h.v as f32, normal_direction: normal };
                        hits.push((exact.root(&h), hit));
                    }
                }
                Surface::Shape(s) => {
                    // The first of the hits that are rounded to one `t` stands for them.
                    let mut first: Option<(f64, Root)> = None;
                    s.shape.visit_exact(&s.unscaled(&local), &mut |found, root| {
                        let h = found.hit;
                        let (_, root) = first.take().filter(|(t, _)| *t == h.t).unwrap_or_else(|| (h.t, root()));
                        first = Some((h.t, root.clone()));
                        if counts(found.crosses) {
                            let normal = h.normal.map_or(DVec3::ZERO, |n| transform.normal(n));
                            hits.push((
                                root,
                                Hit { id, t: h.t + 0.0, u: h.u as f32, v: h.v as f32, normal_direction: normal },
                            ));
                        }
                        ControlFlow::Continue(())
                    });
                }
            }
        }
        let of_instance = |(_, hit): &(_, Hit)| hit.id.instance == i;
        let start = hits.partition_point(|h| !of_instance(h));
        hits[start..].sort_by(|(x, a), (y, b)| a.t.total_cmp(&b.t).then_with(|| x.cmp(y)).then(a.id.cmp(&b.id)));
    }
    // Sorting is stable: across instances the rounded t decides, then the instance.
    hits.sort_by(|(_, a), (_, b)| a.t.total_cmp(&b.t));
    hits.into_iter().map(|(_, hit)| hit).collect()
}

/// The nearest hit, of equally near ones the smallest id.
#[must_use]
pub fn closest_hit(scene: &Scene, ray: &Ray<f64>) -> Option<Hit> {
    all_hits(scene, ray).into_iter().next()
}

/// Whether there is a hit.
#[must_use]
pub fn any_hit(scene: &Scene, ray: &Ray<f64>) -> bool {
    !all_hits(scene, ray).is_empty()
}

/// The nearest point of all triangles and shapes, each measured in the world in `f64`; of several that are equally near,
/// that of the smallest id.
#[must_use]
pub fn closest_point(scene: &Scene, point: DVec3) -> Option<ClosestPoint> {
    nearest_k(scene, point, 1, f64::INFINITY).into_iter().next()
}

/// So many triangles and shapes with their nearest points, not farther than `radius`: by distance, then by id.
#[must_use]
pub fn nearest_k(scene: &Scene, point: DVec3, count: usize, radius: f64) -> Vec<ClosestPoint> {
    if !point.is_finite() {
        return Vec::new();
    }
    let mut all = Vec::new();
    for (id, corners) in placed(scene, point) {
        let at = closest_on_triangle::<f64>(corners, DVec3::ZERO);
        let squared = at.point.length_squared();
        if squared.sqrt() <= radius {
            let [a, b, c] = corners;
            let (distance, [_, u, v]) = (at.point.length(), at.weights.map(|w| w as f32));
            let (point, feature, normal_direction) = (point + at.point, at.feature(), (b - a).cross(c - a));
            all.push((squared, ClosestPoint { id, point, distance, u, v, feature, normal_direction }));
        }
    }
    for (id, transform, shape) in shapes(scene) {
        let seen = shape.closest_to_origin(transform.linear(), transform.translation() - point);
        let Some(on) = seen.filter(|on| on.point.length_squared().sqrt() <= radius) else { continue };
        let (distance, u, v) = (on.point.length(), on.u as f32, on.v as f32);
        let normal_direction = transform.normal_direction(on.normal.unwrap_or(DVec3::ZERO));
        let (squared, point, feature) = (on.point.length_squared(), point + on.point, Feature::Face);
        all.push((squared, ClosestPoint { id, point, distance, u, v, feature, normal_direction }));
    }
    all.sort_by(|(d, a), (e, b)| d.total_cmp(e).then(a.id.cmp(&b.id)));
    all.into_iter().map(|(_, nearest)| nearest).take(count).collect()
}

/// The point of all triangles that is furthest away, a vertex, each measured in the world in `f64`; of several that are
/// equally far, that of the smallest id.
#[must_use]
pub fn furthest_point(scene: &Scene, point: DVec3) -> Option<ClosestPoint> {
    let mut best: Option<(f64, ClosestPoint)> = None;
    for (id, corners) in placed(scene, point).filter(|_| point.is_finite()) {
        for (vertex, corner) in (0u8..).zip(corners) {
            let (squared, distance) = (corner.length_squared(), corner.length());
            let most = best.map_or(f64::NEG_INFINITY, |(most, _)| most);
            if squared > most {
                let ([a, b, c], [_, u, v]) = (corners, [0, 1, 2].map(|k| f32::from(u8::from(k == vertex))));
                let (feature, normal_direction) = (Feature::Vertex(vertex), (b - a).cross(c - a));
                let point = point + corner;
                best = Some((squared, ClosestPoint { id, point, distance, u, v, feature, normal_direction }));
            }
        }
    }
    best.map(|(_, furthest)| furthest)
}

/// The triangles that meet a region, by id.
#[must_use]
pub fn overlapping(scene: &Scene, region: &impl Region) -> Vec<HitId> {
    let of = |(id, corners)| meets(region, corners).then_some(id);
    if region.is_valid() { triangles(scene).filter_map(of).collect() } else { Vec::new() }
}

/// The parts that meet a region: see [`Scene::parts_in`].
#[must_use]
pub fn parts_in(scene: &Scene, region: &impl Region) -> Vec<Part> {
    let mut parts: Vec<Part> = overlapping(scene, region).into_iter().map(Part::from).collect();
    if region.is_valid() {
        parts.extend(scene.shapes_near(region));
    }
    parts.sort_unstable();
    parts.dedup();
    parts
}

/// Which parts the rays meet first, and how many each.
#[must_use]
pub fn parts_along(scene: &Scene, rays: &[Ray<f64>]) -> Vec<(Part, u64)> {
    let mut counts = BTreeMap::new();
    for hit in rays.iter().filter_map(|ray| closest_hit(scene, ray)) {
        *counts.entry(Part::from(hit.id)).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

/// Where a moving sphere first touches a triangle, each tried.
#[must_use]
pub fn cast_sphere(scene: &Scene, ray: &Ray<f64>, radius: f64) -> Option<SphereHit> {
    let touches = triangles(scene).filter_map(|(id, corners)| {
        let touch = sphere_to_triangle(ray, radius, corners)?;
        Some(SphereHit { id, t: touch.t, point: touch.point, center: ray.at(touch.t) })
    });
    // The first of those that come at once.
    touches.min_by(|a, b| a.t.total_cmp(&b.t).then(a.id.cmp(&b.id)))
}

/// Where a moving convex body first touches a triangle, each tried.
#[must_use]
pub fn cast_convex(scene: &Scene, ray: &Ray<f64>, body: &ConvexBody) -> Option<BodyHit> {
    let touches = triangles(scene).filter_map(|(id, corners)| {
        let (touch, normal) = convex_to_triangle(ray, body, corners)?;
        Some(BodyHit { id, t: touch.t, point: touch.point, normal })
    });
    touches.min_by(|a, b| a.t.total_cmp(&b.t).then(a.id.cmp(&b.id)))
}

/// All pairs of triangles that meet, by id: each pair tried.
#[must_use]
pub fn intersecting_pairs(scene: &Scene, other: &Scene) -> Vec<[HitId; 2]> {
    let of = |(a, x)| triangles(other).filter_map(move |(b, y)| meet(x, y).then_some([a, b]));
    triangles(scene).flat_map(of).collect()
}

/// All pairs of triangles that meet otherwise than in common corners and edges, by id: each pair tried.
#[must_use]
pub fn self_intersections(scene: &Scene) -> Vec<[HitId; 2]> {
    let of = |(a, x)| {
        let later = triangles(scene).filter(move |(b, _)| a < *b);
        later.filter_map(move |(b, y)| meet_otherwise(x, y).then_some([a, b]))
    };
    triangles(scene).flat_map(of).collect()
}

/// The nearest points of two scenes: each pair of triangles tried.
#[must_use]
pub fn distance_between(scene: &Scene, other: &Scene) -> Option<Separation> {
    let seen = |(id, corners)| VisitedTriangle { id, corners, inside: false };
    let of = |a| triangles(other).map(move |b| separation(&seen(a), &seen(b)));
    triangles(scene).flat_map(of).min_by(|a, b| a.distance.total_cmp(&b.distance).then(a.ids.cmp(&b.ids)))
}

/// How often the triangles wind around a point: the sum of their solid angles as seen from there, over 4 pi.
#[must_use]
pub fn winding_number(scene: &Scene, point: DVec3) -> f64 {
    let angles = placed(scene, point).map(|(id, [a, b, c])| {
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let around = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let angle = 2.0 * a.cross(b).dot(c).atan2(around);
        // A mirrored mesh keeps its outside.
        let mirrored = scene.instances()[id.instance as usize].transform.mirrors();
        if mirrored { -angle } else { angle }
    });
    angles.sum::<f64>() / (4.0 * core::f64::consts::PI)
}

/// All triangles in the world, as seen from a point.
fn placed(scene: &Scene, point: DVec3) -> impl Iterator<Item = (HitId, [DVec3; 3])> {
    scene.shown().flat_map(move |(i, instance)| {
        let (linear, offset) = (instance.transform.linear(), instance.transform.translation() - point);
        scene.models()[instance.model as usize].surfaces().filter_map(move |(id, surface)| {
            let Surface::Triangle(corners) = surface else { return None };
            let id = HitId { instance: i, geometry: id.geometry, primitive: id.primitive };
            Some((id, corners.map(|p| linear * p + offset)))
        })
    })
}

/// All that is no triangle, with the transforms of the instances.
fn shapes(scene: &Scene) -> impl Iterator<Item = (HitId, &Transform, &ModelShape)> {
    scene.shown().flat_map(move |(i, instance)| {
        scene.models()[instance.model as usize].surfaces().filter_map(move |(id, surface)| {
            let Surface::Shape(shape) = surface else { return None };
            let id = HitId { instance: i, geometry: id.geometry, primitive: id.primitive };
            Some((id, &instance.transform, shape))
        })
    })
}

/// All triangles in the world.
fn triangles(scene: &Scene) -> impl Iterator<Item = (HitId, [DVec3; 3])> {
    scene.shown().flat_map(move |(i, instance)| {
        scene.models()[instance.model as usize].surfaces().filter_map(move |(id, surface)| {
            let Surface::Triangle(corners) = surface else { return None };
            let id = HitId { instance: i, geometry: id.geometry, primitive: id.primitive };
            Some((id, corners.map(|p| instance.transform.point(p))))
        })
    })
}
