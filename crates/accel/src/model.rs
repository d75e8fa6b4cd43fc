//! One mesh with its tree, in normalised `f32` space.

use core::marker::PhantomData;
use core::ops::{ControlFlow, Range};
use std::borrow::Cow;
use std::sync::Arc;

use firsthit_geometry::{
    Aabb, Precision, Primitive, Ray, Real, SurfaceHit, exact::Root, shapes::ClosestOnSurface, transform::Transform,
    triangle,
};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::build::Topology;
use crate::kernel::{Kernel, double};
use crate::layout::Bvh2;
use crate::layout::compact8::{self, Compact8};
use crate::layout::wide8::Reference;
use crate::layout::wide8::{self, Wide8};
use crate::local::{Extent, LocalRay};
use crate::normalise::common_scale;
use crate::offer::{OfferTo, OfferTriangle};
use crate::progress::Progress;
use crate::query::{Candidate, Closest, Collect, Collector, Dyn};
use crate::saved::TreeShape;
use crate::simd::{self, Available, Lanes, Work};
use crate::stats::{DynProbe, Off, Probe};
use crate::traverse::traverse;
use crate::user::OtherSurface;
use crate::wide::{self, Boxes, WideTree};
use crate::{BuildError, BuildOptions, Geometry, Guards, Hit, HitId, Layout};

/// The parts of one mesh, ready to be traced.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    tree: MeshTree,
    /// What lies at each place of the leaves: its number among all primitives in the caller's order. (A compact tree
    /// holds them itself.)
    numbers: Vec<u32>,
    /// Number of the first primitive of each geometry.
    firsts: Vec<u32>,
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
    pub(crate) guards: Guards,
    /// The cost of the tree when it was built: refits keep it.
    built_cost: f64,
}

/// The tree with its triangles, which lie in the order of the leaves, divided by the model's scale.
#[derive(Clone, Debug)]
enum MeshTree {
    Binary {
        tree: Bvh2<f32>,
        /// At the place of a shape there is nothing of use.
        triangles: Vec<[Vec3; 3]>,
        depth: u32,
    },
    Wide {
        tree: Wide8,
        level: Available,
    },
    Compact {
        tree: Compact8,
        level: Available,
    },
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
    /// Index into the shapes of the first, and how many there are.
    Shapes(u32, u32),
}

/// A shape in a mesh.
#[derive(Clone, Debug)]
pub(crate) struct ModelShape {
    pub(crate) geometry: u32,
    /// Among those of its geometry.
    pub(crate) primitive: u32,
    pub(crate) shape: OtherSurface,
    /// Its box, normalised.
    pub(crate) bounds: Aabb<f64>,
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
        Self::watched(mesh, geometries, options, &Progress::unwatched())
    }

    /// The same as part of some work, which may be cancelled.
    pub(crate) fn watched(
        mesh: usize,
        geometries: &[Geometry],
        options: BuildOptions,
        progress: &Progress<'_>,
    ) -> Result<Self, BuildError> {
        Self::make(mesh, geometries, options, None, progress)
    }

    /// Mesh number `mesh`, changed: a tree of the same shape with new boxes. Where that has no place for something -
    /// a triangle that had no area and now has, a shape that was unbounded - it is built anew; so are compact trees,
    /// whose leaves have room for the vertices that they have.
    pub(crate) fn refit(
        &self,
        mesh: usize,
        geometries: &[Geometry],
        options: BuildOptions,
    ) -> Result<Self, BuildError> {
        self.check_same(mesh, geometries)?;
        Self::make(mesh, geometries, options, Some(self), &Progress::unwatched())
    }

    /// Mesh number `mesh` in a tree of this shape, which has been checked; `None` where that does not fit.
    pub(crate) fn new_in_shape(
        mesh: usize,
        geometries: &[Geometry],
        options: BuildOptions,
        shape: TreeShape,
    ) -> Result<Option<Self>, BuildError> {
        let (tree, numbers) = match shape {
            TreeShape::Wide { root, children, numbers, depth } => {
                let tree = Wide8::of_shape(Reference(root), &children, numbers.len() / 4, depth);
                (MeshTree::Wide { tree, level: Available::up_to(options.simd) }, numbers)
            }
            TreeShape::Binary { root, nodes, numbers, depth } => {
                let topology = Topology { root, nodes, order: numbers.iter().map(|_| u32::MAX).collect() };
                (MeshTree::Binary { tree: Bvh2::new(&topology, &[]), triangles: Vec::new(), depth }, numbers)
            }
        };
        let shape = Self { numbers, ..Self::empty(tree, 1.0, options) };
        let model = Self::make(mesh, geometries, options, Some(&shape), &Progress::unwatched())?;
        // If it was built anew, there are other places.
        let same = |a: &MeshTree, b: &MeshTree| match (a, b) {
            (MeshTree::Wide { tree: a, .. }, MeshTree::Wide { tree: b, .. }) => a.root == b.root,
            (MeshTree::Binary { tree: a, .. }, MeshTree::Binary { tree: b, .. }) => a.first() == b.first(),
            _ => false,
        };
        Ok((same(&shape.tree, &model.tree) && shape.numbers == model.numbers).then_some(model))
    }

    /// What is below each node, and what is where. Not of compact trees.
    pub(crate) fn shape(&self) -> Option<TreeShape> {
        let numbers = self.numbers.clone();
        match &self.tree {
            MeshTree::Wide { tree, .. } => {
                let children = tree.nodes.iter().map(|n| n.children).collect();
                Some(TreeShape::Wide { root: tree.root.0, children, numbers, depth: tree.depth() })
            }
            MeshTree::Binary { tree, depth, .. } => {
                let (root, nodes) = (tree.first(), tree.children_of_all());
                Some(TreeShape::Binary { root, nodes, numbers, depth: *depth })
            }
            MeshTree::Compact { .. } => None,
        }
    }

    fn empty(tree: MeshTree, scale: f64, options: BuildOptions) -> Self {
        Self {
            tree,
            numbers: Vec::new(),
            firsts: Vec::new(),
            places: Vec::new(),
            shapes: Vec::new(),
            unbounded: Vec::new(),
            scale,
            bounds: Aabb::empty(),
            extent: Extent::default(),
            degenerate: 0,
            guards: options.guards,
            built_cost: 0.0,
        }
    }

    fn make(
        mesh: usize,
        geometries: &[Geometry],
        options: BuildOptions,
        old: Option<&Self>,
        progress: &Progress<'_>,
    ) -> Result<Self, BuildError> {
        let counts = check(mesh, geometries)?;
        let scale = common_scale(geometries, options.precision);
        let normalised = |p: Vec3| (p.as_dvec3() / scale).as_vec3();

        let nothing = Bvh2::new(&Topology::default(), &[]);
        let mut model =
            Self::empty(MeshTree::Binary { tree: nothing, triangles: Vec::new(), depth: 0 }, scale, options);
        // Everything in file order first.
        let all = counts.iter().map(|&count| count as usize).sum();
        let mut triangles: Vec<[Vec3; 3]> = Vec::with_capacity(all);
        let mut boxes = Vec::with_capacity(all);
        let mut numbers: Vec<u32> = Vec::with_capacity(all);
        let mut first = 0;
        for (g, geometry) in geometries.iter().enumerate() {
            let g = g as u32;
            model.firsts.push(first);
            match geometry {
                Geometry::Triangles { positions, triangles: indices } => {
                    model.places.push(Places::Triangles(vec![u32::MAX; indices.len()]));
                    let positions: Vec<Vec3> = positions.par_iter().map(|p| normalised(*p)).collect();
                    let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize]);
                    let flat: Vec<u32> = (0..indices.len() as u32)
                        .into_par_iter()
                        .filter(|&k| has_no_area(corners(&indices[k as usize])))
                        .collect();
                    model.degenerate += flat.len() as u64;
                    // Never hit, so in no tree. But when seen with rounded vertices, one of three vertices in a line
                    // lies beside the others: it closes the gap that its neighbours leave, so it is counted when
                    // crossings of a surface are.
                    let left_out: Vec<u32> = flat
                        .into_iter()
                        .filter(|&k| {
                            let [a, b, c] = corners(&indices[k as usize]);
                            a == b || b == c || c == a || options.precision == Precision::Fast
                        })
                        .collect();
                    let kept = |k: &u32| left_out.is_empty() || left_out.binary_search(k).is_err();
                    let before = numbers.len();
                    numbers.extend((0..indices.len() as u32).filter(kept).map(|k| first + k));
                    let new = &numbers[before..];
                    triangles.par_extend(new.par_iter().map(|n| corners(&indices[(n - first) as usize])));
                    boxes.par_extend(triangles[before..].par_iter().map(|t| Aabb::from_points(*t)));
                    first += indices.len() as u32;
                }
                Geometry::Shape(_) | Geometry::User(_) => {
                    let count = counts[g as usize];
                    model.shapes.reserve(count as usize);
                    model.places.push(Places::Shapes(model.shapes.len() as u32, count));
                    for primitive in 0..count {
                        let shape = match geometry {
                            Geometry::Shape(shape) => OtherSurface::Shape(Box::new(shape.clone())),
                            Geometry::User(user) => OtherSurface::User(Arc::clone(user), primitive),
                            Geometry::Triangles { .. } => continue,
                        };
                        let b = shape.bounds();
                        let bounds = Aabb::new(b.min / scale, b.max / scale);
                        if bounds.is_finite() {
                            triangles.push([Vec3::ZERO; 3]);
                            boxes.push(bounds.to_f32_outward());
                            numbers.push(first + primitive);
                        } else {
                            model.unbounded.push(model.shapes.len() as u32);
                        }
                        model.shapes.push(ModelShape { geometry: g, primitive, shape, bounds, scale });
                    }
                    first += count;
                }
            }
        }
        progress.advance(geometries, 1)?;
        model.bounds = boxes.iter().fold(Aabb::empty(), |a, b| a.union(*b)).to_f64();
        model.extent = Extent::new(&model.bounds);
        let small = model.bounds.is_empty() || model.bounds.min.abs().max(model.bounds.max.abs()).max_element() < 4.0;
        // Shapes have no place in blocks of triangles; and products of three large numbers would overflow there.
        let layout = match options.layout {
            _ if !(model.shapes.is_empty() && small && triangles.len() <= wide8::MOST_TRIANGLES) => Layout::Bvh2,
            Layout::Compact8 if triangles.len() > compact8::MOST_TRIANGLES => Layout::Wide8,
            layout => layout,
        };
        let number = |&i: &u32| numbers.get(i as usize).copied().unwrap_or(u32::MAX);
        // A place that is left empty has no number, so that whatever lies there is never hit.
        let reused = old.and_then(|old| Some((&old.tree, old.order_of(&numbers)?)));
        let mut was_refitted = false;
        match (layout, reused) {
            (Layout::Bvh2, Some((MeshTree::Binary { tree, depth, .. }, order))) => {
                was_refitted = true;
                let triangle = |&i: &u32| triangles.get(i as usize).copied().unwrap_or_default();
                model.numbers = order.iter().map(number).collect();
                model.tree = MeshTree::Binary {
                    tree: tree.refit(&order, &boxes),
                    triangles: order.iter().map(triangle).collect(),
                    depth: *depth,
                };
            }
            (Layout::Wide8, Some((MeshTree::Wide { tree, level }, order))) => {
                was_refitted = true;
                model.numbers = order.iter().map(number).collect();
                model.tree = MeshTree::Wide { tree: tree.refit(&order, &triangles, &boxes), level: *level };
            }
            (Layout::Bvh2, _) => {
                let topology = Topology::new(&near_one(&boxes, &model.bounds), options.quality);
                progress.advance(geometries, 5)?;
                model.numbers = topology.order.iter().map(number).collect();
                model.tree = MeshTree::Binary {
                    tree: Bvh2::new(&topology, &boxes),
                    triangles: topology.order.iter().map(|&i| triangles[i as usize]).collect(),
                    depth: topology.depth(),
                };
            }
            (Layout::Wide8, _) => {
                let topology = Topology::single(&boxes, options.quality);
                progress.advance(geometries, 5)?;
                let (tree, order) = Wide8::new(&topology, &triangles, &boxes, false);
                model.numbers = order.iter().map(number).collect();
                model.tree = MeshTree::Wide { tree, level: Available::up_to(options.simd) };
            }
            (Layout::Compact8, _) => {
                let topology = Topology::single(&boxes, options.quality);
                progress.advance(geometries, 5)?;
                let (wide, order) = Wide8::new(&topology, &triangles, &boxes, true);
                let numbers: Vec<u32> = order.iter().map(number).collect();
                let tree = Compact8::new(&wide, &numbers);
                for place in tree.places() {
                    let id = model_id(&model.firsts, tree.number(place));
                    model.remember(place, id);
                }
                model.tree = MeshTree::Compact { tree, level: Available::up_to(options.simd) };
            }
        }
        for place in 0..model.numbers.len() {
            let id = model.id(place);
            model.remember(place, id);
        }
        // A shape that was loaded has no cost until it is filled.
        let before = old.map_or(0.0, |old| old.built_cost);
        model.built_cost = if was_refitted && before > 0.0 { before } else { model.sah_cost() };
        progress.advance(geometries, if was_refitted { 7 } else { 2 })?;
        Ok(model)
    }

    /// Where a triangle is.
    fn remember(&mut self, place: usize, id: Option<PrimitiveId>) {
        if let Some(id) = id
            && let Places::Triangles(places) = &mut self.places[id.geometry as usize]
        {
            places[id.primitive as usize] = place as u32;
        }
    }

    /// Whether a mesh has the geometries and numbers of triangles of this one.
    fn check_same(&self, mesh: usize, geometries: &[Geometry]) -> Result<(), BuildError> {
        let (before, now) = (self.places.len(), geometries.len());
        if before != now {
            return Err(BuildError::GeometriesChanged { mesh, before, now });
        }
        for (geometry, (places, g)) in self.places.iter().zip(geometries).enumerate() {
            match (places, g) {
                (Places::Triangles(old), Geometry::Triangles { triangles, .. }) if old.len() != triangles.len() => {
                    let (before, now) = (old.len(), triangles.len());
                    return Err(BuildError::TrianglesChanged { mesh, geometry, before, now });
                }
                (Places::Triangles(_), Geometry::Triangles { .. }) => {}
                (Places::Shapes(_, 1), Geometry::Shape(_)) => {}
                (Places::Shapes(_, before), Geometry::User(user)) => {
                    let (before, now) = (*before as usize, user.count() as usize);
                    if before != now {
                        return Err(BuildError::TrianglesChanged { mesh, geometry, before, now });
                    }
                }
                _ => return Err(BuildError::KindChanged { mesh, geometry }),
            }
        }
        Ok(())
    }

    /// Which of some primitives, given by ascending numbers, is at each place of the leaves: `u32::MAX` where none is.
    /// `None` if one of them has no place.
    fn order_of(&self, numbers: &[u32]) -> Option<Vec<u32>> {
        let mut indices = vec![u32::MAX; numbers.last().map_or(0, |n| *n as usize + 1)];
        for (i, &n) in numbers.iter().enumerate() {
            indices[n as usize] = i as u32;
        }
        let order: Vec<u32> =
            self.numbers.iter().map(|&n| indices.get(n as usize).copied().unwrap_or(u32::MAX)).collect();
        let found = order.iter().filter(|&&i| i != u32::MAX).count();
        (found == numbers.len()).then_some(order)
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
        match &self.tree {
            MeshTree::Binary { depth, .. } => *depth,
            MeshTree::Wide { tree, .. } => tree.depth(),
            MeshTree::Compact { tree, .. } => tree.depth(),
        }
    }
    pub(crate) fn sah_cost(&self) -> f64 {
        match &self.tree {
            MeshTree::Binary { tree, .. } => tree.sah_cost(),
            MeshTree::Wide { tree, .. } => tree.sah_cost(),
            MeshTree::Compact { tree, .. } => tree.sah_cost(),
        }
    }
    /// How many times what it cost when it was built the tree costs.
    #[cfg_attr(not(feature = "import"), allow(dead_code, reason = "asked where frames follow each other"))]
    pub(crate) fn growth(&self) -> f64 {
        if self.built_cost > 0.0 { self.sah_cost() / self.built_cost } else { 1.0 }
    }
    pub(crate) fn degenerate(&self) -> u64 {
        self.degenerate
    }
    pub(crate) fn has_shapes(&self) -> bool {
        !self.shapes.is_empty()
    }
    /// How many shapes there are, and primitives of the user's own.
    pub(crate) fn shape_count(&self) -> u64 {
        self.shapes.len() as u64
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
        let tree = match &self.tree {
            MeshTree::Binary { tree, triangles, .. } => tree.bytes() + size_of_val(triangles.as_slice()),
            MeshTree::Wide { tree, .. } => tree.bytes(),
            MeshTree::Compact { tree, .. } => tree.bytes(),
        };
        tree + size_of_val(self.numbers.as_slice())
            + self.triangle_count() as usize * size_of::<u32>()
            + size_of_val(self.shapes.as_slice())
    }

    /// Everything in the tree: normalised vertices of triangles, or the box of a shape.
    pub(crate) fn extremes(&self) -> impl Iterator<Item = DVec3> + '_ {
        let corners = self.shapes.iter().filter(|s| s.bounds.is_finite()).flat_map(|s| s.bounds.corners());
        self.surfaces()
            .filter_map(|(_, surface)| if let Surface::Triangle(v) = surface { Some(v) } else { None })
            .flatten()
            .chain(corners)
    }

    /// Boxes of the shapes, normalised and perhaps infinite, with their geometries.
    pub(crate) fn shape_boxes(&self) -> impl Iterator<Item = (u32, Aabb<f64>)> + '_ {
        self.shapes.iter().map(|s| (s.geometry, s.bounds))
    }

    /// All primitives in the caller's order.
    pub(crate) fn surfaces(&self) -> impl Iterator<Item = (PrimitiveId, Surface<'_>)> + '_ {
        self.places.iter().enumerate().flat_map(move |(g, places)| {
            let count = match places {
                Places::Triangles(t) => t.len(),
                Places::Shapes(_, count) => *count as usize,
            };
            (0..count).filter_map(move |k| {
                let id = PrimitiveId { geometry: g as u32, primitive: k as u32 };
                Some((id, self.surface(id)?))
            })
        })
    }

    /// The triangle at a place of the leaves.
    fn triangle(&self, place: usize) -> Option<[Vec3; 3]> {
        match &self.tree {
            MeshTree::Binary { triangles, .. } => triangles.get(place).copied(),
            MeshTree::Wide { tree, .. } => Wide8::triangle(tree, place),
            MeshTree::Compact { tree, .. } => tree.has(place).then(|| WideTree::triangle(tree, place)),
        }
    }

    /// The number of what lies at a place of the leaves, among all primitives in the caller's order: so ids are ordered.
    #[inline(always)]
    pub(crate) fn number(&self, place: usize) -> Option<u32> {
        self.numbers.get(place).copied().or_else(|| self.compact()?.0.number(place))
    }

    /// Whether there is anything at a place of the leaves (of a tree that is not compact).
    #[inline(always)]
    pub(crate) fn has(&self, place: usize) -> bool {
        self.numbers.get(place).is_some_and(|&n| n != u32::MAX)
    }

    /// What lies at a place of the leaves; `None` where nothing does.
    #[inline(always)]
    pub(crate) fn id(&self, place: usize) -> Option<PrimitiveId> {
        model_id(&self.firsts, self.number(place))
    }

    /// The surface with this id.
    pub(crate) fn surface(&self, id: PrimitiveId) -> Option<Surface<'_>> {
        match self.places.get(id.geometry as usize)? {
            Places::Triangles(places) => {
                let place = *places.get(id.primitive as usize)?;
                Some(Surface::Triangle(double(&self.triangle(place as usize)?)))
            }
            Places::Shapes(first, count) if id.primitive < *count => {
                self.shapes.get((first + id.primitive) as usize).map(Surface::Shape)
            }
            Places::Shapes(..) => None,
        }
    }

    /// The corners of a triangle, normalised.
    pub(crate) fn corners(&self, id: PrimitiveId) -> Option<[DVec3; 3]> {
        if let Surface::Triangle(corners) = self.surface(id)? { Some(corners) } else { None }
    }

    /// The place of a triangle in the tree.
    #[inline]
    pub(crate) fn place(&self, id: PrimitiveId) -> Option<usize> {
        match self.places.get(id.geometry as usize)? {
            Places::Triangles(places) => places.get(id.primitive as usize).map(|place| *place as usize),
            Places::Shapes(..) => None,
        }
    }

    /// The shape at a place of the leaves; `None` if that is a triangle.
    fn shape_at(&self, place: usize) -> Option<u32> {
        let id = self.id(place)?;
        match self.places.get(id.geometry as usize)? {
            Places::Shapes(first, _) => Some(first + id.primitive),
            Places::Triangles(_) => None,
        }
    }

    /// Offers the hits of what is in the tree to the collector; `transform` is the instance's.
    #[inline(always)]
    pub(crate) fn trace<const SURFACES: bool, K: Kernel, C: Collector, P: Probe>(
        &self,
        ray: &Ray<f64>,
        (instance, transform): (u32, &Transform),
        precision: Precision,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        match &self.tree {
            MeshTree::Wide { tree, level } => {
                let kernel = PhantomData::<K>;
                let of = (instance, transform);
                let work =
                    TraceWide::<SURFACES, Wide8, K, C, P> { model: self, tree, ray, of, collector, probe, kernel };
                simd::by_vectors(*level, work).unwrap_or_else(|work| {
                    // In plain Rust, which is large, as below.
                    let TraceWide { model, tree, ray, of, collector, probe, kernel } = work;
                    let (collector, probe) = (&mut Dyn(collector), &mut DynProbe(probe));
                    simd::portable(TraceWide::<SURFACES, Wide8, K, _, _> {
                        model,
                        tree,
                        ray,
                        of,
                        collector,
                        probe,
                        kernel,
                    })
                })
            }
            // Compiled once for any collector and any probe.
            MeshTree::Compact { tree, level } => {
                let kernel = PhantomData::<K>;
                let (of, collector, probe) = ((instance, transform), &mut Dyn(collector), &mut DynProbe(probe));
                let work =
                    TraceWide::<SURFACES, Compact8, K, _, _> { model: self, tree, ray, of, collector, probe, kernel };
                simd::run(*level, work)
            }
            // Any collector through a pointer, so that this is not compiled for each. Meshes of triangles alone pay
            // nothing for shapes.
            MeshTree::Binary { tree, triangles, .. } => {
                let Some(ray) = &LocalRay::enter(ray, transform, &self.extent) else {
                    return ControlFlow::Continue(());
                };
                let any = &mut Dyn(collector);
                if self.shapes.is_empty() {
                    self.trace_binary::<SURFACES, false, K, P>(tree, triangles, ray, instance, precision, any, probe)
                } else {
                    self.trace_binary::<SURFACES, true, K, P>(tree, triangles, ray, instance, precision, any, probe)
                }
            }
        }
    }

    /// The wide tree, if that is what there is.
    #[inline(always)]
    pub(crate) fn wide(&self) -> Option<(&Wide8, Available)> {
        if let MeshTree::Wide { tree, level } = &self.tree { Some((tree, *level)) } else { None }
    }

    /// The compact tree, if that is what there is.
    #[inline(always)]
    pub(crate) fn compact(&self) -> Option<(&Compact8, Available)> {
        if let MeshTree::Compact { tree, level } = &self.tree { Some((tree, *level)) } else { None }
    }

    /// The binary tree, if that is what there is.
    pub(crate) fn binary(&self) -> Option<&Bvh2<f32>> {
        if let MeshTree::Binary { tree, .. } = &self.tree { Some(tree) } else { None }
    }

    /// The triangle at a place of a binary tree, with its number; `None` where there is none, but a shape perhaps.
    pub(crate) fn numbered(&self, place: usize) -> Option<(u32, [Vec3; 3])> {
        let id = self.id(place)?;
        matches!(self.places.get(id.geometry as usize)?, Places::Triangles(_)).then_some(())?;
        Some((self.number(place)?, self.triangle(place)?))
    }

    /// The shape at a place of a binary tree, with its number; `None` where there is none, but a triangle perhaps.
    pub(crate) fn numbered_shape(&self, place: usize) -> Option<(u32, &ModelShape)> {
        Some((self.number(place)?, self.shapes.get(self.shape_at(place)? as usize)?))
    }

    /// The shapes in the tree with their numbers, or those that have no finite box and are in none.
    pub(crate) fn each_shape(&self, bounded: bool, mut f: impl FnMut(u32, &ModelShape)) {
        for shape in self.shapes.iter().filter(|shape| shape.bounds.is_finite() == bounded) {
            f(self.firsts[shape.geometry as usize] + shape.primitive, shape);
        }
    }

    /// All triangles in the tree with their numbers, in the caller's order.
    pub(crate) fn each_triangle(&self, mut f: impl FnMut(u32, [Vec3; 3])) {
        for (places, &first) in self.places.iter().zip(&self.firsts) {
            let Places::Triangles(places) = places else { continue };
            for (number, &place) in (first..).zip(places) {
                if let Some(triangle) = self.triangle(place as usize) {
                    f(number, triangle);
                }
            }
        }
    }

    /// The primitive with a number.
    pub(crate) fn of_number(&self, number: u32) -> Option<PrimitiveId> {
        model_id(&self.firsts, Some(number))
    }

    /// [`Model::trace`] by the instructions of a level.
    #[inline(always)]
    pub(crate) fn trace_wide<L: Lanes, const SURFACES: bool, T: WideTree, K: Kernel, C: Collector, P: Probe>(
        &self,
        tree: &T,
        ray: &Ray<f64>,
        (instance, transform): (u32, &Transform),
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let Some(ray) = LocalRay::enter(ray, transform, &self.extent) else { return ControlFlow::Continue(()) };
        let ray = &ray;
        let offer = OfferTriangle::<SURFACES, K>::new(self, ray, instance, collector);
        let filter = K::filter::<L>(&offer.setup, ray);
        let delta = if K::padded(&offer.setup) { ray.delta } else { 0.0 };
        let boxes = Boxes::<L>::of(ray.origin32, ray.direction32, delta);
        let interval = [ray.box_t_min(collector.t_min()), ray.box_t_max(collector.t_max())];
        let ordered = collector.ordered();
        let mut visitor = OfferTo { tree, offer, collector };
        if ordered {
            wide::traverse::<L, T, _, P, true>(tree, &boxes, interval, &filter, probe, &mut visitor)
        } else {
            wide::traverse::<L, T, _, P, false>(tree, &boxes, interval, &filter, probe, &mut visitor)
        }
    }

    /// The hit of a ray with the triangle at a place of the wide tree, which has passed the filter: with the normal as it
    /// is in the object's space.
    #[cold]
    #[inline(never)]
    pub(crate) fn hit_of_one<K: Kernel>(
        &self,
        ray: &Ray<f64>,
        (instance, transform): (u32, &Transform),
        place: usize,
        triangle: &[Vec3; 3],
        known: [f32; 3],
    ) -> Option<Hit> {
        let local = LocalRay::enter(ray, transform, &self.extent)?;
        let mut first = Collect::new(ray, None, |_| true, Closest { order: |_, _| false, best: None });
        let mut offer = OfferTriangle::<false, K>::new(self, &local, instance, &first);
        // It never breaks.
        let _ = offer.offer(place, triangle, Some(known), &mut first, &mut Off);
        first.take.best
    }

    /// A function of its own, so that its loop has the registers.
    #[inline(never)]
    fn trace_binary<const SURFACES: bool, const SHAPES: bool, K: Kernel, P: Probe>(
        &self,
        tree: &Bvh2<f32>,
        triangles: &[[Vec3; 3]],
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        collector: &mut Dyn<'_>,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let mut offer = OfferTriangle::<SURFACES, K>::new(self, ray, instance, collector);
        let t_min = ray.box_t_min(collector.t_min());
        let t_max = ray.box_t_max(collector.t_max());
        let mut end = t_max;
        let padded = K::padded(&offer.setup);
        let leaf = |range: Range<usize>, probe: &mut P| {
            for place in range {
                probe.primitives(1);
                if SHAPES && let Some(index) = self.shape_at(place) {
                    let taken = if precision == Precision::Exact {
                        self.offer_exact_shape::<SURFACES, _, P>(index, ray, instance, collector, probe)?
                    } else {
                        self.offer_shape(index, ray, instance, precision, K::clamped(&offer.setup), collector)?
                    };
                    if taken {
                        end = offer.shortened(collector);
                    }
                } else if let Some(shorter) = offer.offer(place, &triangles[place], None, collector, probe)? {
                    end = shorter;
                }
            }
            ControlFlow::Continue(end)
        };
        if padded {
            traverse::<true, _, _, _>(tree, &ray.slabs::<true>(), t_min, t_max, probe, leaf)
        } else {
            traverse::<false, _, _, _>(tree, &ray.slabs::<false>(), t_min, t_max, probe, leaf)
        }
    }

    /// Offers the hits of shapes without a finite box.
    pub(crate) fn trace_unbounded<const SURFACES: bool, C: Collector, P: Probe>(
        &self,
        ray: &LocalRay,
        instance: u32,
        precision: Precision,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        for &i in &self.unbounded {
            if precision == Precision::Exact {
                self.offer_exact_shape::<SURFACES, C, P>(i, ray, instance, collector, probe)?;
            } else {
                self.offer_shape(i, ray, instance, precision, false, collector)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// [`Model::offer_shape`] by exact decisions. Where surfaces are counted, touching one is no crossing.
    fn offer_exact_shape<const SURFACES: bool, C: Collector, P: Probe>(
        &self,
        index: u32,
        ray: &LocalRay,
        instance: u32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<(), bool> {
        let Some(entry) = self.shapes.get(index as usize) else { return ControlFlow::Continue(false) };
        // The ray's own interval: what is left of it ends at a t that is rounded, and is compared with rounded ones.
        let [t_min, t_max] = ray.interval();
        let local = Ray { origin: ray.origin * self.scale, direction: ray.direction * self.scale, t_min, t_max };
        let mut outcome = ControlFlow::Continue(false);
        let fallback = entry.shape.visit_exact(&local, &mut |found, _| {
            let hit = found.hit;
            if SURFACES && !found.crosses {
                return ControlFlow::Continue(());
            }
            let id = HitId { instance, geometry: entry.geometry, primitive: entry.primitive };
            let normal = hit.normal.unwrap_or(DVec3::ZERO);
            outcome = collector.offer(Candidate::new(id, hit.t * ray.t_unscale, hit.u as f32, hit.v as f32, normal));
            // The nearest that is taken is enough.
            if matches!(outcome, ControlFlow::Continue(false)) {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        if fallback {
            probe.fallback();
        }
        outcome
    }

    /// Offers one shape's hits, nearest first, until one is taken or none is left; whether one was taken.
    fn offer_shape<C: Collector>(
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
        for _ in 0..entry.shape.most_hits() {
            let Some(hit) = shape_hit(&entry.shape, &local, precision) else { break };
            let t = if clamped { ray.line().within_box(hit.t, &entry.bounds) } else { Some(hit.t) };
            if let Some(t) = t {
                let id = HitId { instance, geometry: entry.geometry, primitive: entry.primitive };
                let normal = hit.normal.unwrap_or(DVec3::ZERO);
                let t = t * ray.t_unscale;
                let taken = collector.offer(Candidate::new(id, t, hit.u as f32, hit.v as f32, normal))?;
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
    /// The point nearest to the origin, of the shape as a map of the normalised space places it.
    pub(crate) fn closest_to_origin(&self, linear: DMat3, translation: DVec3) -> Option<ClosestOnSurface> {
        self.shape.closest_to_origin(&DAffine3 { matrix3: linear * (1.0 / self.scale), translation })
    }

    /// [`Primitive::refine`] for a point of the normalised space.
    pub(crate) fn refine(&self, point: DVec3, normal: Option<DVec3>) -> (DVec3, f64) {
        let (point, error) = self.shape.refine(point * self.scale, normal);
        (point / self.scale, error / self.scale)
    }

    /// [`Primitive::exact_root`] for a line in the normalised space.
    pub(crate) fn exact_root(&self, line: &Ray<f64>, t: f64) -> Option<Root> {
        self.shape.exact_root(&self.unscaled(line), t)
    }

    /// A ray of the normalised space in the shape's own: scaled by a power of two.
    pub(crate) fn unscaled(&self, ray: &Ray<f64>) -> Ray<f64> {
        Ray { origin: ray.origin * self.scale, direction: ray.direction * self.scale, ..*ray }
    }

    /// Whether no straight ray that leaves it can come back.
    pub(crate) fn is_flat(&self) -> bool {
        self.shape.is_flat()
    }
}

/// Damage, for tests.
#[cfg(test)]
impl Model {
    pub(crate) fn shrink_a_box(&mut self) {
        match &mut self.tree {
            MeshTree::Binary { tree, .. } => tree.shrink_a_box(),
            MeshTree::Wide { tree, .. } => tree.shrink_a_box(),
            MeshTree::Compact { tree, .. } => tree.shrink_a_box(),
        }
    }

    pub(crate) fn numbers_mut(&mut self) -> &mut [u32] {
        &mut self.numbers
    }

    pub(crate) fn wide_mut(&mut self) -> Option<&mut Wide8> {
        if let MeshTree::Wide { tree, .. } = &mut self.tree { Some(tree) } else { None }
    }
}

/// Traversal of a tree of eight children a node.
struct TraceWide<'a, const SURFACES: bool, T, K, C, P> {
    model: &'a Model,
    tree: &'a T,
    ray: &'a Ray<f64>,
    /// The instance.
    of: (u32, &'a Transform),
    collector: &'a mut C,
    probe: &'a mut P,
    kernel: PhantomData<K>,
}

impl<const SURFACES: bool, T: WideTree, K: Kernel, C: Collector, P: Probe> Work
    for TraceWide<'_, SURFACES, T, K, C, P>
{
    type Output = ControlFlow<()>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> ControlFlow<()> {
        let Self { model, tree, ray, of, collector, probe, .. } = self;
        model.trace_wide::<L, SURFACES, T, K, C, P>(tree, ray, of, collector, probe)
    }
}

/// Shapes are evaluated in `f64` at the tiers below `Exact`: by the shortest formulas or by the stable ones.
fn shape_hit(shape: &OtherSurface, ray: &Ray<f64>, precision: Precision) -> Option<SurfaceHit<f64>> {
    match precision {
        Precision::Fast => shape.closest_hit_fast(ray),
        Precision::Robust | Precision::Double => shape.closest_hit(ray),
        Precision::Exact => shape.closest_hit_exact(ray),
    }
}

/// Whether three points lie in a line, as [`triangle::area_vector`] tells; mostly without it.
fn has_no_area(vertices: [Vec3; 3]) -> bool {
    let [a, b, c] = double(&vertices);
    let (e1, e2) = (b - a, c - a);
    // Far more than what is rounded here: with an angle like this, no way to compute it gives 0.
    let certainly = e1.cross(e2).length_squared() > 1e-20 * (e1.length_squared() * e2.length_squared());
    !certainly && triangle::area_vector([a, b, c]) == DVec3::ZERO
}

/// Which primitive has a number (or none, `u32::MAX`): `firsts` are those of the geometries.
#[inline(always)]
fn model_id(firsts: &[u32], number: Option<u32>) -> Option<PrimitiveId> {
    let number = number.filter(|&n| n != u32::MAX)?;
    // Most meshes have one geometry.
    let after = if firsts.len() == 1 { 1 } else { firsts.partition_point(|&f| f <= number) };
    let geometry = after.checked_sub(1)?;
    Some(PrimitiveId { geometry: geometry as u32, primitive: number - firsts[geometry] })
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
/// How many primitives each has: what is the user's own is asked once.
fn check(mesh: usize, geometries: &[Geometry]) -> Result<Vec<u32>, BuildError> {
    let counts: Vec<u64> = geometries.iter().map(Geometry::count).collect();
    limit("primitives of a mesh", counts.iter().sum())?;
    limit("geometries of a mesh", geometries.len() as u64)?;
    // What is within the limit is a number of 32 bits.
    let counts: Vec<u32> = counts.into_iter().map(|count| count as u32).collect();
    for (geometry, (g, &count)) in geometries.iter().zip(&counts).enumerate() {
        let Geometry::Triangles { positions, triangles } = g else {
            let unusable = |i: &u32| {
                let Geometry::User(user) = g else { return false };
                let bounds = user.bounds(*i);
                bounds.is_empty() || bounds.min.is_nan() || bounds.max.is_nan()
            };
            if let Some(primitive) = (0..count).find(unusable) {
                return Err(BuildError::UnusableBounds { mesh, geometry, primitive });
            }
            continue;
        };
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
    Ok(counts)
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
