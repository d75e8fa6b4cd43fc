//! Which of several hits comes first.

use core::cmp::Ordering;

use firsthit_geometry::{
    Precision, Ray,
    exact::{ExactRay, Root},
};

use crate::model::Surface;
use crate::{Hit, Scene};

impl Scene {
    /// The order of two hits of a ray: by `t`, then by id.
    ///
    /// At [`Precision::Exact`] `t` is rounded, and of hits in one instance with equal `t` the exact order decides before
    /// the id. (Several hits of one shape with equal `t` stay together, where the first of them is.)
    pub(crate) fn order(&self, ray: &Ray<f64>, a: &Hit, b: &Hit) -> Ordering {
        a.t.total_cmp(&b.t).then_with(|| {
            let exact = self.options().precision == Precision::Exact && a.id.instance == b.id.instance;
            if exact { self.exact_order(ray, a, b) } else { Ordering::Equal }.then(a.id.cmp(&b.id))
        })
    }

    /// Whether the first of two hits comes before the second.
    #[cold]
    #[inline(never)]
    pub(crate) fn comes_first(&self, ray: &Ray<f64>, a: Hit, b: Hit) -> bool {
        self.order(ray, &a, &b).is_lt()
    }

    #[cold]
    fn exact_order(&self, ray: &Ray<f64>, a: &Hit, b: &Hit) -> Ordering {
        let t = a.t;
        let (Some((instance, a)), Some((_, b))) = (self.surface(&a.id), self.surface(&b.id)) else {
            return Ordering::Equal;
        };
        if let (Surface::Triangle(a), Surface::Triangle(b)) = (&a, &b)
            && a == b
        {
            // Coincident triangles may be many.
            return Ordering::Equal;
        }
        let line = instance.transform.ray_to_object(ray).with_interval(f64::NEG_INFINITY, f64::INFINITY);
        a.root(&line, t).zip(b.root(&line, t)).map_or(Ordering::Equal, |(a, b)| a.cmp(&b))
    }
}

impl Surface<'_> {
    /// The exact parameter of a line's first hit whose rounded one is `t`.
    pub(crate) fn root(&self, line: &Ray<f64>, t: f64) -> Option<Root> {
        match self {
            Surface::Triangle(v) => {
                let line = ExactRay::new(*line)?;
                line.hit(*v).map(|hit| line.root(&hit))
            }
            Surface::Shape(shape) => shape.exact_root(line, t),
        }
    }
}
