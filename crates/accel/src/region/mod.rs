//! Regions of space and the triangles in them; trees against trees.
//!
//! Everything here goes through one way of walking the trees ([`cursor`]), in `f64` and in the world, so that answers do not
//! depend on the layout, the tier or the instructions.

mod cast;
mod cursor;
mod overlap;
mod pairs;
mod visible;

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use firsthit_geometry::frustum::Containment;
use glam::DVec3;

use crate::scene::Inner;
use crate::{HitId, Scene};
use cursor::Cursor;

pub use cast::{BodyHit, SphereHit};
pub(crate) use cursor::At;
pub(crate) use overlap::meets;
pub(crate) use pairs::separation;
pub use pairs::{CurveSegment, Separation};
pub use visible::{Part, View};

/// A triangle as a [`Visitor`] sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisitedTriangle {
    /// Which it is.
    pub id: HitId,
    /// Its corners in the world.
    pub corners: [DVec3; 3],
    /// Whether a box around it was [`Containment::Inside`].
    pub inside: bool,
}

/// What walks through a scene's trees: see [`Scene::visit`].
pub trait Visitor {
    /// How a box in the world lies to what is looked for: nothing in it is visited if it is `Outside`; if it is `Inside`, all
    /// its triangles are, and no box in it is asked about.
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment;
    /// A triangle in a box that was not outside. Breaking ends the walk.
    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()>;
    /// Of boxes next to each other in the tree, those with the smaller number come first: by how near they are, say.
    fn order(&self, _bounds: &Aabb<f64>) -> f64 {
        0.0
    }
}

impl Scene {
    /// Walks through the scene's trees from their roots on, where the visitor wants to go. Breaks if it did.
    ///
    /// Boxes hold what is in them with all that is rounded on the way to the world. A box is asked about just before it is
    /// entered, so what was found before may decide. Triangles that no query sees (of two corners that coincide) are not
    /// visited; nor are analytic shapes. The walk has no memory of its own: visitors may ask the scene anything.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use firsthit_accel::{Geometry, HitId, SceneBuilder, VisitedTriangle, Visitor};
    /// use firsthit_geometry::{Aabb, frustum::Containment};
    /// use glam::{DAffine3, Vec3};
    ///
    /// /// All that reaches above a height.
    /// struct Above(f64, Vec<HitId>);
    /// impl Visitor for Above {
    ///     fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
    ///         if bounds.max.z > self.0 { Containment::Intersecting } else { Containment::Outside }
    ///     }
    ///     fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
    ///         if triangle.corners.iter().any(|p| p.z > self.0) {
    ///             self.1.push(triangle.id);
    ///         }
    ///         ControlFlow::Continue(())
    ///     }
    /// }
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// builder.add_instance(mesh, DAffine3::from_translation(glam::DVec3::Z));
    /// let mut above = Above(0.5, Vec::new());
    /// assert!(builder.build()?.visit(&mut above).is_continue());
    /// assert_eq!(above.1, [HitId { instance: 1, geometry: 0, primitive: 0 }]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    pub fn visit(&self, visitor: &mut dyn Visitor) -> ControlFlow<()> {
        match self.inner().cursor() {
            Some(cursor) => self.inner().visit(&cursor, false, visitor),
            None => ControlFlow::Continue(()),
        }
    }
}

impl Inner {
    /// No deeper than the trees are.
    fn visit(&self, cursor: &Cursor, inside: bool, visitor: &mut dyn Visitor) -> ControlFlow<()> {
        let inside = inside
            || match visitor.bounds(&cursor.bounds) {
                Containment::Outside => return ControlFlow::Continue(()),
                Containment::Intersecting => false,
                Containment::Inside => true,
            };
        let Some(mut below) = self.below(cursor) else {
            return self.leaf(cursor, inside, &mut |triangle| visitor.triangle(triangle));
        };
        below.sort_by_key(|c| visitor.order(&c.bounds));
        for child in below.iter() {
            self.visit(child, inside, visitor)?;
        }
        ControlFlow::Continue(())
    }
}
