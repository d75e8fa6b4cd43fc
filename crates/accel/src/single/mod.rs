//! One ray in a scene of one instance, for the tiers that are asked most: the shortest way in, through the tree and out.
//!
//! It is what a ray of these tiers goes through when it is asked alone, so the work that is done once a ray counts as much as
//! the tree. Entering is done with all axes side by side; of a triangle nothing is worked out but `t` until it is known to be the nearest;
//! what is rare is left to the tier's [`Kernel`](crate::kernel::Kernel). The answers are that kernel's, bit by bit.

mod enter;
mod tier;

use core::marker::PhantomData;
use core::ops::ControlFlow;

use firsthit_geometry::{Ray, transform::Transform};

pub(crate) use enter::{Entered, delta_of, four, reciprocals};
pub(crate) use tier::{Lean, careful, tell};

use crate::model::Model;
use crate::simd::Lanes;
use crate::stats::Off;
use crate::wide::{self, Boxes, Visit, WideTree};
use crate::{Hit, HitId, Scene};
use tier::Seen;

/// One instance, of a model with a wide tree (or a compact one): what is above it, if anything, has been traversed.
pub(crate) struct Only<'a, T> {
    pub(crate) model: &'a Model,
    pub(crate) tree: &'a T,
    pub(crate) transform: &'a Transform,
    /// Its number in the scene.
    pub(crate) instance: u32,
}

// Not derived: a tree need not be `Copy` for it.
impl<T> Clone for Only<'_, T> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Only<'_, T> {}

impl<T: WideTree> Only<'_, T> {
    /// The nearest hit. Of a ray that leaves the triangle at a place, that one is not tested.
    #[inline(always)]
    pub(crate) fn closest_hit<L: Lanes, K: Lean>(
        &self,
        scene: &Scene,
        ray: &Ray<f64>,
        leaves: Option<usize>,
    ) -> Option<Hit> {
        let entered = Entered::<L>::new(ray, self.transform, self.model.extent())?;
        let from = ray.t_min * entered.t_scale;
        let best = Best { place: NOTHING, unclear: false, known: [0.0; 3], kept: K::Kept::default() };
        let mut nearest = Nearest { only: *self, scene, ray, entered, from, leaves, t_max: ray.t_max, best };
        let _ = self.walk::<L, K, true>(&entered, &mut nearest);
        let Nearest { t_max, best, .. } = nearest;
        if best.place == NOTHING {
            return None;
        }
        if best.unclear {
            let hit = self.unclear::<K>(ray, best.place, best.known)?;
            return Some(Hit { normal_direction: self.transform.normal_direction(hit.normal_direction), ..hit });
        }
        let hit = self.clear::<K>(best, t_max)?;
        Some(Hit { normal_direction: self.transform.normal_direction(hit.normal_direction), ..hit })
    }

    /// Whether there is a hit; likewise.
    #[inline(always)]
    pub(crate) fn any_hit<L: Lanes, K: Lean>(&self, ray: &Ray<f64>, leaves: Option<usize>) -> bool {
        let Some(entered) = Entered::<L>::new(ray, self.transform, self.model.extent()) else { return false };
        let from = ray.t_min * entered.t_scale;
        let mut first = First { only: *self, ray, entered, from, leaves, tier: PhantomData::<K> };
        self.walk::<L, K, false>(&entered, &mut first).is_break()
    }

    #[inline(always)]
    fn walk<L: Lanes, K: Lean, const ORDERED: bool>(
        &self,
        entered: &Entered<L>,
        visitor: &mut impl Visit<Off>,
    ) -> ControlFlow<()> {
        let delta = L::splat(if K::PADDED { entered.delta } else { 0.0 });
        let boxes = Boxes::<L>::inverted(entered.origin, entered.direction, entered.inverse, delta);
        let picks = K::picks::<L>(entered);
        wide::traverse::<L, T, _, Off, ORDERED>(self.tree, &boxes, entered.interval, &picks, &mut Off, visitor)
    }

    /// A hit with its normal in the object's space.
    #[inline(always)]
    fn clear<K: Lean>(&self, best: Best<K>, t: f64) -> Option<Hit> {
        let id = self.model.id(best.place)?;
        let (u, v, normal_direction) = K::finish(&self.tree.triangle(best.place), best.known, best.kept);
        let id = HitId { instance: self.instance, geometry: id.geometry, primitive: id.primitive };
        Some(Hit { id, t, u, v, normal_direction })
    }

    // What is rare. By value: what is passed by reference has to be kept in memory by the caller, always.

    /// The hit of one triangle by the tier's kernel.
    #[cold]
    #[inline(never)]
    fn unclear<K: Lean>(self, ray: &Ray<f64>, place: usize, known: [f32; 3]) -> Option<Hit> {
        let of = (self.instance, self.transform);
        self.model.hit_of_one::<K>(ray, of, place, &self.tree.triangle(place), known)
    }

    /// Whether, of two hits at the same distance, the first comes first.
    #[cold]
    #[inline(never)]
    fn comes_first<K: Lean>(self, scene: &Scene, ray: &Ray<f64>, t: f64, new: Best<K>, old: Best<K>) -> bool {
        let at = |best: Best<K>| match best.unclear {
            true => self.unclear::<K>(ray, best.place, best.known),
            false => self.clear::<K>(best, t),
        };
        match (at(new), at(old)) {
            (Some(new), Some(old)) => scene.comes_first(ray, new, old),
            (new, _) => new.is_some(),
        }
    }
}

/// No place: nothing was found.
const NOTHING: usize = usize::MAX;

/// A triangle and what the filter knows of it.
struct Best<K: Lean> {
    place: usize,
    /// The kernel had to tell, and is asked again in the end: it is rare, and what it told need not be kept.
    unclear: bool,
    known: [f32; 3],
    kept: K::Kept,
}

// Not derived: a tier need not be `Copy` for it.
impl<K: Lean> Clone for Best<K> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<K: Lean> Copy for Best<K> {}

/// Keeps the nearest, of several at the same distance the first in order.
struct Nearest<'a, L: Lanes, T, K: Lean> {
    only: Only<'a, T>,
    scene: &'a Scene,
    ray: &'a Ray<f64>,
    entered: Entered<L>,
    /// Start of the interval, local.
    from: f64,
    /// The place of the triangle that the ray leaves.
    leaves: Option<usize>,
    /// The world's parameter of the nearest, or the end of the interval.
    t_max: f64,
    best: Best<K>,
}

impl<L: Lanes, T: WideTree, K: Lean> Nearest<'_, L, T, K> {
    /// The new end of the boxes' interval if it is the nearest so far; `local` is its distance from the moved origin.
    #[inline(always)]
    fn take(&mut self, t: f64, local: f32, best: Best<K>) -> Option<f32> {
        let better = |n: &Self| n.best.place == NOTHING || n.only.comes_first::<K>(n.scene, n.ray, t, best, n.best);
        if t < self.t_max || (t == self.t_max && better(self)) {
            (self.t_max, self.best) = (t, best);
            return Some(self.entered.end(local));
        }
        None
    }
}

impl<L: Lanes, T: WideTree, K: Lean> Visit<Off> for Nearest<'_, L, T, K> {
    #[inline(always)]
    fn visit(&mut self, place: usize, known: [f32; 3], _: &mut Off) -> ControlFlow<(), Option<f32>> {
        if self.leaves == Some(place) {
            return ControlFlow::Continue(None);
        }
        let triangle = self.only.tree.triangle(place);
        ControlFlow::Continue(match K::seen(&self.entered, &triangle, known, self.from) {
            Seen::At(t, local, kept) => {
                // -0 becomes 0, as of a `Candidate`.
                let t = t * self.entered.t_unscale + 0.0;
                let inside = self.ray.t_min <= t && t.abs() <= f64::MAX;
                if inside { self.take(t, local, Best { place, unclear: false, known, kept }) } else { None }
            }
            Seen::Nowhere => None,
            Seen::Unclear => match self.only.unclear::<K>(self.ray, place, known) {
                Some(hit) => {
                    let local = (hit.t * self.entered.t_scale - self.entered.line.shift) as f32;
                    self.take(hit.t, local, Best { place, unclear: true, known, kept: K::Kept::default() })
                }
                None => None,
            },
        })
    }
}

/// Stops at the first.
struct First<'a, L: Lanes, T, K> {
    only: Only<'a, T>,
    ray: &'a Ray<f64>,
    entered: Entered<L>,
    /// Start of the interval, local.
    from: f64,
    /// The place of the triangle that the ray leaves.
    leaves: Option<usize>,
    tier: PhantomData<K>,
}

impl<L: Lanes, T: WideTree, K: Lean> Visit<Off> for First<'_, L, T, K> {
    #[inline(always)]
    fn visit(&mut self, place: usize, known: [f32; 3], _: &mut Off) -> ControlFlow<(), Option<f32>> {
        if self.leaves == Some(place) {
            return ControlFlow::Continue(None);
        }
        let hit = match K::seen(&self.entered, &self.only.tree.triangle(place), known, self.from) {
            Seen::At(t, ..) => {
                let t = t * self.entered.t_unscale;
                self.ray.t_min <= t && t <= self.ray.t_max && t.abs() <= f64::MAX
            }
            Seen::Nowhere => false,
            Seen::Unclear => self.only.unclear::<K>(self.ray, place, known).is_some(),
        };
        if hit { ControlFlow::Break(()) } else { ControlFlow::Continue(None) }
    }
}
