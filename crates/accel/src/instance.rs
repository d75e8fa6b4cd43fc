//! Meshes placed in the world.

use std::sync::Arc;

use firsthit_geometry::{Aabb, transform::Transform};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::BuildError;
use crate::local::instance_padding;
use crate::model::Model;

/// A mesh and where it is to be, as users say it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) mesh: usize,
    pub(crate) transform: DAffine3,
    /// Layers that it belongs to; of none it is not there for any query.
    pub(crate) mask: u32,
}

impl Placed {
    /// For all queries.
    pub(crate) fn new(mesh: usize, transform: DAffine3) -> Self {
        Self { mesh, transform, mask: u32::MAX }
    }
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    /// Index of its model.
    pub(crate) model: u32,
    /// From the model's normalised space to the world.
    pub(crate) transform: Transform,
    /// Whether queries meet it.
    pub(crate) shown: bool,
}

/// So many vertices at most are transformed for tight boxes.
const TIGHT: u64 = 1 << 24;

impl Instance {
    pub(crate) fn new(index: usize, placed: &Placed, scale: f64, mask: u32) -> Result<Self, BuildError> {
        let transform = Transform::new(placed.transform).map_err(|_| BuildError::IllConditioned { instance: index })?;
        let transform = transform.with_object_scale(scale);
        Ok(Self { model: placed.mesh as u32, transform, shown: placed.mask & mask != 0 })
    }

    /// What the tree over instances holds: the model's box in the world, padded for all that is rounded on either side.
    pub(crate) fn padded_box(&self, model: &Model, tight: &Aabb<f64>) -> Aabb<f64> {
        let pad = instance_padding(model.bounds());
        let world = self.transform.linear().abs() * pad * 2.0;
        let rounding = self.transform.point_error(model.bounds().min.abs().max(model.bounds().max.abs()), DVec3::ZERO);
        let pad = world + rounding * 4.0;
        Aabb::new(tight.min - pad, tight.max + pad)
    }
}

/// Boxes in the world of what is bounded in each instance: of the vertices themselves where they are not too many in
/// all, else of the model's box. Empty for those that are not shown.
pub(crate) fn tight_boxes(instances: &[Instance], models: &[Arc<Model>]) -> Vec<Aabb<f64>> {
    let corners = |m: &Model| m.triangle_count() * 3 + m.shape_count() * 8;
    let all: u64 = instances.iter().filter(|i| i.shown).map(|i| corners(&models[i.model as usize])).sum();
    instances
        .par_iter()
        .map(|i| {
            let model = &models[i.model as usize];
            if !i.shown {
                Aabb::empty()
            } else if i.transform.is_uniform() && !model.bounds().is_empty() && !model.has_shapes() {
                // Each axis is mapped by itself, so the corners tell.
                Aabb::from_points(model.bounds().corners().map(|p| i.transform.point(p)))
            } else if all <= TIGHT {
                Aabb::from_points(model.extremes().map(|p| i.transform.point(p)))
            } else {
                i.transform.aabb(model.bounds())
            }
        })
        .collect()
}
