//! One mesh with its tree, in normalised `f32` space.

use core::ops::{ControlFlow, Range};
use std::borrow::Cow;

use firsthit_geometry::{Aabb, Precision, Primitive, Ray, Real, Shape, SurfaceHit, triangle};
use glam::{DVec3, Vec3};

use crate::build::Topology;
use crate::kernel::{Found, Kernel, double};
use crate::layout::Bvh2;
use crate::local::{Extent, LocalRay};
use crate::normalise::common_scale;
use crate::query::{Candidate, Collector};
use crate::stats::Probe;
use crate::traverse::traverse;
use crate::{BuildError, BuildOptions, Geometry};

/// The parts of one mesh, ready to be traced.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    tree: Bvh2<f32>,
    depth: u32,
    /// Triangles in the order of the leaves, divided by `scale`. At the place of a shape there is nothing of use.
    triangles: Vec<[Vec3; 3]>,
    /// What lies at each place of the leaves.
    ids: Vec<PrimitiveId>,
    /// Place of each primitive of each geometry.
    places: Vec<Places>,
    shapes: Vec<ModelShape>,
    /// Indices into `shapes` of those without a finite box.
    unbounded: Vec<u32>,
    /// The power of two by which coordinates were divided.
    scale: f64,
    /// Of all that is bounded, normalised.
    bounds: Aabb<f64>,
    extent: Extent,
    degenerate: u64,
}

/// A primitive of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PrimitiveId {
    pub(crate) geometry: u32,
    /// The triangle in its geometry.
    pub(crate) primitive: u32,
}

/// Where a geometry's primitives are.
#[derive(Clone, Debug)]
enum Places {
    /// Position in the leaves' order of each triangle; none (`u32::MAX`) for those without area.
    Triangles(Vec<u32>),
    /// Index into the shapes.
    Shape(u32),
}

/// A shape in a mesh.
#[derive(Clone, Debug)]
pub(crate) struct ModelShape {
    pub(crate) geometry: u32,
    pub(crate) shape: Shape<f64>,
    /// Its box, normalised.
    bounds: Aabb<f64>,
    /// Size of the normalised space's unit, a power of two.
    scale: f64,
}

/// What a hit's id stands for.
pub(crate) enum Surface<'a> {
    /// A triangle, normalised.
    Triangle([DVec3; 3]),
    Shape(&'a ModelShape),
}

impl Model {
    /// Checks and builds mesh number `mesh`.
    pub(crate) fn new(mesh: usize, geometries: &[Geometry], options: BuildOptions) -> Result<Self, BuildError> {
        check(mesh, geometries)?;
        let scale = common_scale(geometries, options.precision);
        let normalised = |p: Vec3| (p.as_dvec3() / scale).as_vec3();

        let mut model = Self {
            tree: Bvh2::new(&Topology::default(), &[]),
            depth: 0,
            triangles: Vec::new(),
            ids: Vec::new(),
            places: Vec::new(),
            shapes: Vec::new(),
            unbounded: Vec::new(),
            scale,
            bounds: Aabb::empty(),
            extent: Extent::default(),
            degenerate: 0,
        };
        // Everything in file order first.
        let mut triangles = Vec::new();
        let mut boxes = Vec::new();
        let mut ids = Vec::new();
        for (g, geometry) in geometries.iter().enumerate() {
            let g = g as u32;
            match geometry {
                Geometry::Triangles { positions, triangles: indices } => {
                    model.places.push(Places::Triangles(vec![u32::MAX; indices.len()]));
                    for (k, t) in indices.iter().enumerate() {
                        let vertices = t.map(|i| normalised(positions[i as usize]));
                        if triangle::area_vector(vertices.map(|v| v.as_dvec3())) == DVec3::ZERO {
                            model.degenerate += 1;
                            // Never hit, so in no tree. But when seen with rounded vertices, one of three vertices in a
                            // line lies beside the others: it closes the gap that its neighbours leave, so it is
                            // counted when crossings of a surface are.
                            let [a, b, c] = vertices;
                            if a == b || b == c || c == a || options.precision == Precision::Fast {
                                continue;
                            }
                        }
                        triangles.push(vertices);
                        boxes.push(Aabb::from_points(vertices));
                        ids.push(PrimitiveId { geometry: g, primitive: k as u32 });
                    }
                }
                Geometry::Shape(shape) => {
                    let index = model.shapes.len() as u32;
                    model.places.push(Places::Shape(index));
                    let b = shape.bounds();
                    let bounds = Aabb::new(b.min / scale, b.max / scale);
                    if bounds.is_finite() {
                        triangles.push([Vec3::ZERO; 3]);
                        boxes.push(bounds.to_f32_outward());
                        ids.push(PrimitiveId { geometry: g, primitive: 0 });
                    } else {
                        model.unbounded.push(index);
                    }
                    model.shapes.push(ModelShape { geometry: g, shape: shape.clone(), bounds, scale });
                }
            }
        }
        model.bounds = boxes.iter().fold(Aabb::empty(), |a, b| a.union(*b)).to_f64();
        model.extent = Extent::new(&model.bounds);
        let topology = Topology::new(&near_one(&boxes, &model.bounds), options.quality);
        model.tree = Bvh2::new(&topology, &boxes);
        model.depth = topology.depth();
        model.triangles = topology.order.iter().map(|&i| triangles[i as usize]).collect();
        model.ids = topology.order.iter().map(|&i| ids[i as usize]).collect();
        for (place, id) in model.ids.iter().enumerate() {
            if let Places::Triangles(places) = &mut model.places[id.geometry as usize] {
                places[id.primitive as usize] = place as u32;
            }
        }
        Ok(model)
    }

    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }
    /// Box of all that is bounded, normalised; empty when there is nothing.
    pub(crate) fn bounds(&self) -> &Aabb<f64> {
        &self.bounds
    }
    /// What a ray needs to know of it.
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }
    pub(crate) fn depth(&self) -> u32 {
        self.depth
    }
    pub(crate) fn sah_cost(&self) -> f64 {
        self.tree.sah_cost()
    }
    pub(crate) fn degenerate(&self) -> u64 {
        self.degenerate
    }
    pub(crate) fn has_unbounded(&self) -> bool {
        !self.unbounded.is_empty()
    }
    /// Number of triangles.
    pub(crate) fn triangle_count(&self) -> u64 {
        self.places.iter().map(|p| if let Places::Triangles(t) = p { t.len() as u64 } else { 0 }).sum()
    }
    /// Memory of tree and primitives.
    pub(crate) fn bytes(&self) -> usize {
        self.tree.bytes()
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.ids.as_slice())
            + self.triangle_count() as usize * size_of::<u32>()
            + size_of_val(self.shapes.as_slice())
    }

    /// Everything in the tree: normalised vertices of triangles, or the box of a shape.
    pub(crate) fn extremes(&self) -> impl Iterator<Item = DVec3> + '_ {
        let corners = self.shapes.iter().filter(|s| s.bounds.is_finite()).flat_map(|s| s.bounds.corners());
        self.triangles
            .iter()
            .zip(&self.ids)
            .filter(|(_, id)| matches!(self.places[id.geometry as usize], Places::Triangles(_)))
            .flat_map(|(t, _)| t.map(|v| v.as_dvec3()))
            .chain(corners)
    }

    /// All primitives in the caller's order.
    pub(crate) fn surfaces(&self) -> impl Iterator<Item = (PrimitiveId, Surface<'_>)> + '_ {
        self.places.iter().enumerate().flat_map(move |(g, places)| {
            let count = if let Places::Triangles(t) = places { t.len() } else { 1 };
            (0..count).filter_map(move |k| {
                let id = PrimitiveId { geometry: g as u32, primitive: k as u32 };
                Some((id, self.surface(id)?))
            })
        })
    }

    /// The surface with this id.
    pub(crate) fn surface(&self, id: PrimitiveId) -> Option<Surface<'_>> {
        match self.places.get(id.geometry as usize)? {
            Places::Triangles(places) => {
                let place = *places.get(id.primitive as usize)?;
                Some(Surface::Triangle(double(self.triangles.get(place as usize)?)))
            }
            Places::Shape(index) => self.shapes.get(*index as usize).map(Surface::Shape),
        }
    }

    /// Offers the hits of what is in the tree to the collector.
    #[inline(always)]
    pub(crate) fn trace<const SURFACES: bool, K: Kernel, C: Collector + ?Sized, P: Probe>(
        &self,
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // Meshes of triangles alone, nearly all, pay nothing for shapes.
        if self.shapes.is_empty() {
            self.trace_tree::<SURFACES, false, K, C, P>(ray, instance, precision, collector, probe)
        } else {
            self.trace_tree::<SURFACES, true, K, C, P>(ray, instance, precision, collector, probe)
        }
    }

    /// A function of its own, so that its loop has the registers.
    #[inline(never)]
    fn trace_tree<const SURFACES: bool, const SHAPES: bool, K: Kernel, C: Collector + ?Sized, P: Probe>(
        &self,
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let setup = K::setup(ray);
        let t_min = ray.box_t_min(collector.t_min());
        let t_max = ray.box_t_max(collector.t_max());
        let mut end = t_max;
        let mut limit = collector.t_max() * ray.t_scale;
        let leaf = |range: Range<usize>, probe: &mut P| {
            let mut taken = false;
            for place in range {
                probe.primitive();
                if SHAPES && let Some(Places::Shape(index)) = self.places.get(self.ids[place].geometry as usize) {
                    taken |= self.offer_shape::<C>(*index, ray, instance, precision, K::CLAMPED, collector)?;
                    continue;
                }
                let found = if SURFACES {
                    K::crosses(&setup, ray, &self.triangles[place], limit)
                } else {
                    K::test(&setup, ray, &self.triangles[place], limit)
                };
                let Some(Found { t, u, v, fallback }) = found else { continue };
                if fallback {
                    probe.fallback();
                }
                let t = if K::CLAMPED { within_triangle(ray, t, &self.triangles[place]) } else { Some(t) };
                let Some(t) = t else { continue };
                let PrimitiveId { geometry, primitive } = self.ids[place];
                taken |= collector.offer(Candidate::new(instance, geometry, primitive, t / ray.t_scale, u, v))?;
            }
            if taken {
                end = ray.box_t_max(collector.t_max());
                limit = collector.t_max() * ray.t_scale;
            }
            ControlFlow::Continue(end)
        };
        if K::PADDED {
            traverse::<true, _, _, _>(&self.tree, &ray.slabs::<true>(), t_min, t_max, probe, leaf)
        } else {
            traverse::<false, _, _, _>(&self.tree, &ray.slabs::<false>(), t_min, t_max, probe, leaf)
        }
    }

    /// Offers the hits of shapes without a finite box.
    pub(crate) fn trace_unbounded<C: Collector + ?Sized>(
        &self,
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        collector: &mut C,
    ) -> ControlFlow<()> {
        self.unbounded
            .iter()
            .try_for_each(|&i| self.offer_shape(i, ray, instance, precision, false, collector).map_continue(drop))
    }

    /// Offers one shape's hits, nearest first, until one is taken or none is left; whether one was taken.
    fn offer_shape<C: Collector + ?Sized>(
        &self,
        index: u32,
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        clamped: bool,
        collector: &mut C,
    ) -> ControlFlow<(), bool> {
        let Some(entry) = self.shapes.get(index as usize) else { return ControlFlow::Continue(false) };
        let mut local = Ray {
            origin: ray.origin * self.scale,
            direction: ray.direction * self.scale,
            t_min: collector.t_min() * ray.t_scale,
            t_max: collector.t_max() * ray.t_scale,
        };
        // No ray meets one of the shapes more often than this.
        for _ in 0..16 {
            let Some(hit) = shape_hit(&entry.shape, &local, precision) else { break };
            let t = if clamped { ray.within_box(hit.t, &entry.bounds) } else { Some(hit.t) };
            if let Some(t) = t {
                let taken = collector.offer(Candidate {
                    normal: hit.normal.unwrap_or(DVec3::ZERO),
                    ..Candidate::new(instance, entry.geometry, 0, t / ray.t_scale, hit.u as f32, hit.v as f32)
                })?;
                if taken {
                    return ControlFlow::Continue(true);
                }
            }
            // Refused by a filter, perhaps: then the next root may be taken.
            local.t_min = hit.t.next_up();
        }
        ControlFlow::Continue(false)
    }
}

impl ModelShape {
    /// [`Primitive::refine`] for a point of the normalised space.
    pub(crate) fn refine(&self, point: DVec3, normal: Option<DVec3>) -> (DVec3, f64) {
        let (point, error) = self.shape.refine(point * self.scale, normal);
        (point / self.scale, error / self.scale)
    }

    /// Whether no straight ray that leaves it can come back.
    pub(crate) fn is_flat(&self) -> bool {
        self.shape.is_flat()
    }
}

/// [`LocalRay::within_box`] for a triangle. Apart from the loop, since few triangles come so far.
#[inline(never)]
fn within_triangle(ray: &LocalRay, t: f64, vertices: &[Vec3; 3]) -> Option<f64> {
    let [a, b, c] = double(vertices);
    ray.within_box(t, &Aabb::new(a.min(b).min(c), a.max(b).max(c)))
}

/// Shapes are evaluated in `f64` at every tier: by the shortest formulas or by the stable ones.
fn shape_hit(shape: &Shape<f64>, ray: &Ray<f64>, precision: Precision) -> Option<SurfaceHit<f64>> {
    match precision {
        Precision::Fast => shape.closest_hit_fast(ray),
        Precision::Robust | Precision::Double | Precision::Exact => shape.closest_hit(ray),
    }
}

/// Boxes for the builder, whose areas must not overflow: only the shape of the tree comes from them.
fn near_one<'a>(boxes: &'a [Aabb<f32>], bounds: &Aabb<f64>) -> Cow<'a, [Aabb<f32>]> {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if boxes.is_empty() || largest < 4.0 {
        return boxes.into();
    }
    let k = (1.0 / largest.power_of_two_below()) as f32;
    boxes.iter().map(|b| Aabb::new(b.min * k, b.max * k)).collect()
}

/// Everything finite, in range and countable.
fn check(mesh: usize, geometries: &[Geometry]) -> Result<(), BuildError> {
    let mut primitives = 0u64;
    for (geometry, g) in geometries.iter().enumerate() {
        let Geometry::Triangles { positions, triangles } = g else {
            primitives += 1;
            continue;
        };
        primitives += triangles.len() as u64;
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(BuildError::NotFinite { mesh, geometry, vertex });
        }
        let count = positions.len();
        for (triangle, t) in triangles.iter().enumerate() {
            if let Some(&index) = t.iter().find(|&&i| i as usize >= count) {
                return Err(BuildError::IndexOutOfRange { mesh, geometry, triangle, index, count });
            }
        }
    }
    limit("primitives of a mesh", primitives)?;
    limit("geometries of a mesh", geometries.len() as u64)
}

/// Trees of obvhs have `2 n - 1` nodes, counted in 32 bits.
pub(crate) fn limit(what: &'static str, count: u64) -> Result<(), BuildError> {
    let limit = u64::from(u32::MAX / 2);
    if count > limit { Err(BuildError::TooMany { what, count, limit }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_limited_before_anything_is_allocated() {
        assert!(limit("things", 0).is_ok() && limit("things", (1 << 31) - 1).is_ok());
        for count in [1 << 31, 1 << 32, u64::MAX] {
            assert!(matches!(limit("things", count), Err(BuildError::TooMany { count: c, .. }) if c == count));
        }
    }
}
