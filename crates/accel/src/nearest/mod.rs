//! What is nearest to a point: trees are searched from the nearest box on, and what is farther than what is wanted is left
//! out.
//!
//! Boxes and triangles are looked at in single precision, eight at a time, with bounds that are never too large; what may
//! be near enough is measured in `f64`, relative to the point, so that answers are sharp far from the world's origin too.
//! They depend neither on the tree nor on the instructions.

mod bounds;
mod walk;

use firsthit_geometry::distance::{ClosestPoint, closest_on_triangle};
use firsthit_geometry::transform::Transform;
use glam::{DMat3, DVec3, Vec3};

use crate::kernel::double;
use crate::model::{Model, ModelShape};
use crate::simd;
use walk::{Search, Triangles};

/// Of a mesh of size near 1.
const FAR: f32 = (1 << 30) as f32;

pub(crate) use bounds::Point;
pub(crate) use walk::{Boxed, squared_distance, walk, walk_binary};

/// A point near the one that is asked about: of an instance's triangle, or of something else in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// Index of the instance.
    pub(crate) instance: u32,
    /// Of the primitive, among all of its mesh.
    pub(crate) number: u32,
    /// Squared distance in the world.
    pub(crate) squared: f64,
    /// The point, relative to the one that is asked about, and where on the triangle it is; of a shape, somewhere inside.
    pub(crate) at: ClosestPoint<f64>,
}

impl Near {
    /// Nearer ones come first, of those that are equally near the one with the smaller id.
    pub(crate) fn comes_before(&self, other: &Self) -> bool {
        (self.squared, self.instance, self.number) < (other.squared, other.instance, other.number)
    }
}

/// What a query keeps of what is found.
pub(crate) trait Keep {
    /// Squared distance beyond which nothing is wanted.
    fn limit(&self) -> f64;
    /// Gets what lies within the limit.
    fn offer(&mut self, near: Near);
    /// Whether what is no triangle is wanted too.
    fn shapes(&self) -> bool {
        true
    }
}

/// An instance as seen from the point.
pub(crate) struct Seen<'a> {
    pub(crate) model: &'a Model,
    instance: u32,
    linear: DMat3,
    /// From the point to where the object's origin lies.
    offset: DVec3,
    /// Size of the linear part, if that is a multiple of the identity.
    uniform: Option<f64>,
    /// The point in the object's space.
    point: Vec3,
    /// By how much that is off, in the world, before it was rounded to single precision.
    off: f64,
    /// And in the object's space by being rounded.
    rounded: f64,
    longest_preimage: f64,
}

impl<'a> Seen<'a> {
    pub(crate) fn new(model: &'a Model, instance: u32, transform: &Transform, point: DVec3) -> Self {
        let linear = transform.linear();
        let offset = transform.translation() - point;
        let local = transform.vector_to_object(-offset);
        let back = linear * local;
        // What the inverse is off by shows on the way back.
        let noise = (linear.abs() * local.abs() + offset.abs()).max_element() * 2f64.powi(-48);
        let off = (back + offset).length() + noise;
        let point = local.as_vec3();
        // The boxes of compact nodes are rounded too.
        let rounded = (local - point.as_dvec3()).length() * (1.0 + 1e-9) + 2f64.powi(-21);
        let uniform = transform.is_uniform().then_some(linear.x_axis.x);
        let longest_preimage = transform.longest_preimage();
        Self { model, instance, linear, offset, uniform, point, off, rounded, longest_preimage }
    }

    /// The limit in the object's space, as squared distance from the rounded point: never too small.
    fn limit(&self, squared: f64) -> f32 {
        let limit = self.wide_limit(squared);
        // What is not a number is any distance.
        if limit < f64::from(f32::MAX) { (limit as f32).next_up() } else { f32::MAX }
    }

    /// The same without an end.
    fn wide_limit(&self, squared: f64) -> f64 {
        let far = (squared.sqrt() * (1.0 + 1e-9) + self.off) * self.longest_preimage + self.rounded;
        // Room for what is rounded where it is compared.
        far * far * (1.0 + 1e-5)
    }

    /// Offers what of the model lies within the limit.
    pub(crate) fn search(&self, keep: &mut dyn Keep) {
        let model = self.model;
        // From so far that single precision tells nothing (or from where distances are no numbers) all is looked at.
        if !(self.point.abs().max_element() < FAR) {
            model.each_triangle(|number, vertices| self.triangle(number, &double(&vertices), keep));
            if keep.shapes() {
                model.each_shape(true, |number, shape| self.shape(number, shape, keep));
            }
        } else if let Some((tree, level)) = model.wide() {
            simd::run(level, Search(Triangles { seen: self, tree, keep }));
        } else if let Some((tree, level)) = model.compact() {
            simd::run(level, Search(Triangles { seen: self, tree, keep }));
        } else if let Some(tree) = model.binary() {
            let point = self.point.as_dvec3();
            let limit = |keep: &dyn Keep| self.wide_limit(keep.limit());
            walk_binary(
                tree,
                |b| squared_distance(b, point),
                limit(keep),
                |places| {
                    for place in places {
                        if let Some((number, vertices)) = model.numbered(place) {
                            self.triangle(number, &double(&vertices), keep);
                        } else if let Some((number, shape)) = model.numbered_shape(place).filter(|_| keep.shapes()) {
                            self.shape(number, shape, keep);
                        }
                    }
                    limit(keep)
                },
            );
        }
    }

    /// Offers those shapes of the model that lie within the limit and have no finite box, so that they are in no tree.
    pub(crate) fn search_unbounded(&self, keep: &mut dyn Keep) {
        self.model.each_shape(false, |number, shape| self.shape(number, shape, keep));
    }

    /// Measures the shape with this number, if it has nearest points.
    pub(crate) fn shape(&self, number: u32, shape: &ModelShape, keep: &mut dyn Keep) {
        let Some(nearest) = shape.closest_to_origin(self.linear, self.offset) else { return };
        let squared = nearest.point.length_squared();
        if squared <= keep.limit() {
            let at = ClosestPoint { point: nearest.point, weights: [1.0 / 3.0; 3] };
            keep.offer(Near { instance: self.instance, number, squared, at });
        }
    }

    /// Measures the triangle with this number.
    pub(crate) fn triangle(&self, number: u32, &[a, b, c]: &[DVec3; 3], keep: &mut dyn Keep) {
        let relative = match self.uniform {
            Some(s) => [a * s + self.offset, b * s + self.offset, c * s + self.offset],
            None => [self.linear * a + self.offset, self.linear * b + self.offset, self.linear * c + self.offset],
        };
        let at = closest_on_triangle::<f64>(relative, DVec3::ZERO);
        let squared = at.point.length_squared();
        if squared <= keep.limit() {
            keep.offer(Near { instance: self.instance, number, squared, at });
        }
    }
}
