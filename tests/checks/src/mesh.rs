//! Meshes of any numbers and indices, built at every tier in every layout.

use core::cmp::Ordering;

use firsthit_accel::{BuildError, BuildOptions, BuildQuality, Crossings, Geometry, Hit, HitId, Layout};
use firsthit_accel::{Scene, SceneBuilder, VisitOrder};
use firsthit_geometry::{Precision, Ray, mesh::MeshReport};
use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::bytes::Bytes;
use crate::exact::{self, Crossed};

/// Triangles by their vertices, which need not exist.
#[derive(Clone, Debug)]
struct Part {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Part {
    fn corners(&self, k: usize) -> [DVec3; 3] {
        self.triangles[k].map(|i| self.positions[i as usize].as_dvec3())
    }
}

/// A mesh of one or two parts, placed a few times, and rays. The build names the first thing that is wrong, the same at
/// every tier, or there is a scene, whose queries agree with each other, with tests of all primitives one by one, and in
/// all layouts; at the exact tier with exact numbers. Every line crosses a closed mesh an even number of times.
pub fn mesh(data: &[u8]) -> bool {
    let mut bytes = Bytes::new(data);
    let quality = [BuildQuality::Balanced, BuildQuality::Fast, BuildQuality::High][bytes.below(3)];
    let parts: Vec<Part> = (0..1 + bytes.below(2)).map(|_| part(&mut bytes)).collect();
    let places: Vec<DAffine3> = (0..1 + bytes.below(3)).map(|_| place(&mut bytes)).collect();
    let rays: Vec<Ray<f64>> = (0..4)
        .map(|_| {
            let target = aim(&parts, &mut bytes);
            let place = places[bytes.below(places.len())];
            let double = bytes.flag();
            bytes.ray(place.transform_point3(target), double)
        })
        .collect();

    let (mut errors, mut met) = (Vec::new(), false);
    for precision in Precision::ALL {
        let mut answers: Option<Vec<Answers>> = None;
        for layout in Layout::ALL {
            let options = BuildOptions { precision, quality, layout, ..BuildOptions::default() };
            let scene = match build(&parts, &places, options) {
                Ok(scene) => scene,
                Err(error) => {
                    errors.push(error);
                    continue;
                }
            };
            assert_eq!(wrong(&parts), None, "{options:?}");
            let say = |ray: &Ray<f64>| format!("{options:?} {parts:?} {places:?} {ray:?}");
            let all: Vec<Answers> = rays.iter().map(|ray| Answers::new(&scene, ray)).collect();
            for (ray, a) in rays.iter().zip(&all) {
                a.agree(&scene, ray, &|| say(ray));
                if precision != Precision::Fast {
                    a.stand_alone(&scene, ray, &|| say(ray));
                    a.cross_closed(&parts, ray, &|| say(ray));
                }
                if precision == Precision::Exact && places == [DAffine3::IDENTITY] && tame(ray) && kept(&parts) {
                    a.are_exact(&parts, ray, &|| say(ray));
                }
            }
            met |= all.iter().any(|a| a.any);
            in_batches(&scene, &rays, &all);
            // The fast tier may lose hits, in each layout others.
            if precision != Precision::Fast {
                assert!(answers.is_none_or(|before| before == all), "{options:?} {parts:?} {places:?} {rays:?}");
                answers = Some(all);
            }
        }
    }
    // At all tiers and in all layouts, or at none.
    if let Some(first) = errors.first() {
        assert_eq!(errors, vec![first.clone(); Precision::ALL.len() * Layout::ALL.len()]);
        if !matches!(first, BuildError::IllConditioned { .. }) {
            assert_eq!(Some(first), wrong(&parts).as_ref());
        }
    }
    met
}

/// A soup of triangles that may share vertices, or a tetrahedron; some of it twice.
fn part(bytes: &mut Bytes<'_>) -> Part {
    let closed = bytes.flag();
    let count = if closed { 4 } else { 1 + bytes.below(9) };
    let positions: Vec<Vec3> = (0..count).map(|_| bytes.vec3()).collect();
    let mut triangles = if closed {
        vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]
    } else {
        let index = |bytes: &mut Bytes<'_>| match bytes.byte() {
            255 => u32::MAX,
            254 => count as u32,
            i => u32::from(i) % count as u32,
        };
        (0..bytes.below(12)).map(|_| [(); 3].map(|()| index(bytes))).collect()
    };
    for _ in 0..bytes.below(16).saturating_sub(12) {
        triangles.extend_from_within(..);
    }
    Part { positions, triangles }
}

fn place(bytes: &mut Bytes<'_>) -> DAffine3 {
    let scale = |bytes: &mut Bytes<'_>| 2f64.powi(i32::from(bytes.byte() as i8));
    match bytes.byte() % 8 {
        0..=3 => DAffine3::IDENTITY,
        4 => DAffine3::from_translation(bytes.vector(true)),
        5 => DAffine3::from_scale(DVec3::splat(scale(bytes))),
        6 => DAffine3::from_rotation_y(bytes.double().clamp(-4.0, 4.0)),
        _ => {
            let matrix3 = DMat3::from_cols(bytes.vector(true), bytes.vector(true), bytes.vector(true));
            DAffine3 { matrix3, translation: bytes.vector(true) }
        }
    }
}

/// A vertex, the middle of an edge, or a point inside of some triangle.
fn aim(parts: &[Part], bytes: &mut Bytes<'_>) -> DVec3 {
    let part = &parts[bytes.below(parts.len())];
    let [kind, which] = [bytes.below(3), bytes.below(256)];
    let corner = |i: &u32| part.positions.get(*i as usize).map_or(DVec3::ZERO, |p| p.as_dvec3());
    let [a, b, c] = match part.triangles.len() {
        0 => [DVec3::ZERO; 3],
        n => part.triangles[which % n].each_ref().map(corner),
    };
    [a, a.midpoint(b), (a + b + c) / 3.0][kind]
}

/// Of numbers that stay what they are in an instance's space, where products of them are in the range of `f64`.
fn tame(ray: &Ray<f64>) -> bool {
    let numbers = ray.origin.to_array().into_iter().chain(ray.direction.to_array());
    ray.is_valid() && numbers.filter(|x| *x != 0.0).all(|x| (1e-150..1e150).contains(&x.abs()))
}

/// Whether one power of two brings all coordinates into the range of `f32` without loss, room for squares left.
fn kept(parts: &[Part]) -> bool {
    let coordinates = || parts.iter().flat_map(|p| &p.positions).flat_map(|p| p.to_array()).filter(|x| *x != 0.0);
    let largest = coordinates().fold(0.0, |m: f64, x| m.max(x.abs().into()));
    // The unit in the last place of a normal number, or more than that of a smaller one.
    coordinates().all(|x| f64::from(x.abs()).max(1.2e-38) * 2f64.powi(-23) * 2f64.powi(247) > largest)
}

/// What is wrong with the parts, the first of it.
fn wrong(parts: &[Part]) -> Option<BuildError> {
    let mesh = 0;
    parts.iter().enumerate().find_map(|(geometry, part)| {
        let count = part.positions.len();
        let vertex = part.positions.iter().position(|p| !p.is_finite());
        vertex.map(|vertex| BuildError::NotFinite { mesh, geometry, vertex }).or_else(|| {
            let bad = |t: &[u32; 3]| t.iter().copied().find(|&i| i as usize >= count);
            let (triangle, index) = part.triangles.iter().enumerate().find_map(|(k, t)| Some((k, bad(t)?)))?;
            Some(BuildError::IndexOutOfRange { mesh, geometry, triangle, index, count })
        })
    })
}

fn build(parts: &[Part], places: &[DAffine3], options: BuildOptions) -> Result<Scene, BuildError> {
    let mut builder = SceneBuilder::new(options);
    let geometry = |m: &Part| Geometry::Triangles { positions: m.positions.clone(), triangles: m.triangles.clone() };
    let mesh = builder.add_mesh(parts.iter().map(geometry).collect());
    for place in places {
        builder.add_instance(mesh, *place);
    }
    builder.build()
}

/// A hit to the last bit.
type Bits = (HitId, u64, [u32; 2], [u64; 3]);

fn bits(h: &Hit) -> Bits {
    (h.id, h.t.to_bits(), [h.u.to_bits(), h.v.to_bits()], h.normal_direction.to_array().map(f64::to_bits))
}

/// Such that lists can be compared that broke a tie in another way.
fn sorted(hits: &[Hit]) -> Vec<Bits> {
    let mut bits: Vec<Bits> = hits.iter().map(bits).collect();
    bits.sort_unstable();
    bits
}

/// What a scene says of a ray.
#[derive(Debug, PartialEq)]
struct Answers {
    closest: Option<Hit>,
    any: bool,
    triangles: Vec<Hit>,
    surfaces: Vec<Hit>,
    counts: [u32; 2],
}

impl Answers {
    fn new(scene: &Scene, ray: &Ray<f64>) -> Self {
        let kinds = [Crossings::Triangles, Crossings::Surfaces];
        let [triangles, surfaces] = kinds.map(|what| scene.all_hits(ray, what));
        let counts = kinds.map(|what| scene.count_hits(ray, what));
        Self { closest: scene.closest_hit(ray), any: scene.any_hit(ray), triangles, surfaces, counts }
    }

    /// What holds at every tier: good numbers, and no query contradicts another.
    fn agree(&self, scene: &Scene, ray: &Ray<f64>, say: &dyn Fn() -> String) {
        assert!(ray.is_valid() || self.triangles.is_empty() && self.surfaces.is_empty(), "{}", say());
        assert_eq!(self.any, self.closest.is_some(), "{}", say());
        for (hits, count) in [(&self.triangles, self.counts[0]), (&self.surfaces, self.counts[1])] {
            assert_eq!(hits.len() as u32, count, "{}", say());
            assert!(hits.is_sorted_by(|a, b| a.t <= b.t), "{hits:?} {}", say());
            let mut ids: Vec<HitId> = hits.iter().map(|h| h.id).collect();
            ids.sort_unstable();
            assert!(ids.is_sorted_by(|a, b| a < b), "each once: {hits:?} {}", say());
            for h in hits {
                assert!(h.t.is_finite() && ray.contains(h.t), "{h:?} {}", say());
                assert!([h.u, h.v].iter().all(|w| (0.0..=1.0).contains(w)), "{h:?} {}", say());
                assert!(h.u + h.v <= 1.0 + 4.0 * f32::EPSILON, "{h:?} {}", say());
                assert!((h.normal().length() - 1.0).abs() < 1e-12 || h.normal() == DVec3::ZERO, "{h:?} {}", say());
                let point = scene.surface_point(ray, h);
                assert!(!point.error.is_nan() && point.error >= 0.0, "{h:?} {point:?} {}", say());
            }
        }
        if let Some(closest) = self.closest {
            assert!(self.triangles.iter().any(|h| bits(h) == bits(&closest)), "{closest:?} {}", say());
        } else {
            assert!(self.triangles.is_empty(), "{:?} {}", self.triangles, say());
        }
    }

    /// At the careful tiers no box changes an answer, nor does the order in which they are met.
    fn stand_alone(&self, scene: &Scene, ray: &Ray<f64>, say: &dyn Fn() -> String) {
        assert_eq!(self.closest.as_ref().map(bits), self.triangles.first().map(bits), "{}", say());
        for order in [VisitOrder::FarFirst, VisitOrder::Exhaustive] {
            let closest = scene.closest_hit_in_order(ray, order);
            assert_eq!(self.closest.as_ref().map(bits), closest.as_ref().map(bits), "{order:?} {}", say());
        }
        for (hits, what) in [(&self.triangles, Crossings::Triangles), (&self.surfaces, Crossings::Surfaces)] {
            let each = scene.all_hits_exhaustively(ray, what);
            assert_eq!(sorted(hits), sorted(&each), "{what:?} {}", say());
        }
    }

    /// A line crosses closed parts an even number of times.
    fn cross_closed(&self, parts: &[Part], ray: &Ray<f64>, say: &dyn Fn() -> String) {
        let line = ray.t_min == f64::NEG_INFINITY && ray.t_max == f64::INFINITY;
        for (g, part) in parts.iter().enumerate() {
            if line && MeshReport::new(&part.positions, &part.triangles).is_closed() {
                let crossed = self.surfaces.iter().filter(|h| h.id.geometry == g as u32).count();
                assert_eq!(crossed % 2, 0, "geometry {g}: {:?} {}", self.surfaces, say());
            }
        }
    }

    /// One instance where its mesh is: exactly the hits that exact numbers find, in their order.
    fn are_exact(&self, parts: &[Part], ray: &Ray<f64>, say: &dyn Fn() -> String) {
        let mut truth: Vec<([usize; 2], Crossed)> = Vec::new();
        for (g, part) in parts.iter().enumerate() {
            for k in 0..part.triangles.len() {
                truth.extend(exact::ray_triangle(ray, part.corners(k)).map(|h| ([g, k], h)));
            }
        }
        // Stable: of equal ones the first.
        truth.sort_by(|a, b| a.1.t.compare(&b.1.t));
        let crossed: Vec<_> = truth.iter().filter(|t| t.1.crosses).cloned().collect();
        for (hits, truth) in [(&self.triangles, truth), (&self.surfaces, crossed)] {
            let ids = |h: &Hit| [h.id.geometry as usize, h.id.primitive as usize];
            let expected: Vec<_> = truth.iter().map(|t| t.0).collect();
            assert_eq!(hits.iter().map(ids).collect::<Vec<_>>(), expected, "{}", say());
            for (h, (_, truth)) in hits.iter().zip(&truth) {
                let near = exact::is_nearest(h.t, |x| -> Ordering { truth.t.cmp_exact(x) });
                assert!(near, "{h:?} {}", say());
            }
        }
    }
}

/// Many rays at once give what each gives alone.
fn in_batches(scene: &Scene, rays: &[Ray<f64>], each: &[Answers]) {
    let mut closest = vec![None; rays.len()];
    scene.closest_hits(rays, &mut closest);
    assert!(closest.iter().zip(each).all(|(h, a)| h.as_ref().map(bits) == a.closest.as_ref().map(bits)));
    let mut any = vec![false; rays.len()];
    scene.any_hits(rays, &mut any);
    assert!(any.iter().zip(each).all(|(h, a)| *h == a.any));
    let lists = scene.all_hits_each(rays, Crossings::Surfaces);
    assert!(lists.iter().zip(each).all(|(h, a)| sorted(h) == sorted(&a.surfaces)));
}
