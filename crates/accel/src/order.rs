//! Which of several hits comes first.

use core::cmp::Ordering;

use firsthit_geometry::{Precision, Ray, exact::ExactRay};

use crate::model::Surface;
use crate::{Hit, Scene};

impl Scene {
    /// The order of two hits of a ray: by `t`, then by id.
    ///
    /// At [`Precision::Exact`] `t` is rounded, and of triangles of one instance with equal `t` the exact order decides
    /// before the id; shapes come after them.
    pub(crate) fn order(&self, ray: &Ray<f64>, a: &Hit, b: &Hit) -> Ordering {
        a.t.total_cmp(&b.t).then_with(|| {
            let exact = self.options().precision == Precision::Exact && a.id.instance == b.id.instance;
            if exact { self.exact_order(ray, a, b) } else { Ordering::Equal }.then(a.id.cmp(&b.id))
        })
    }

    #[cold]
    fn exact_order(&self, ray: &Ray<f64>, a: &Hit, b: &Hit) -> Ordering {
        let (Some((instance, a)), Some((_, b))) = (self.surface(&a.id), self.surface(&b.id)) else {
            return Ordering::Equal;
        };
        match (a, b) {
            // Coincident triangles may be many.
            (Surface::Triangle(a), Surface::Triangle(b)) if a == b => Ordering::Equal,
            (Surface::Triangle(a), Surface::Triangle(b)) => {
                let line = instance.transform.ray_to_object(ray).with_interval(f64::NEG_INFINITY, f64::INFINITY);
                let hits = ExactRay::new(line).and_then(|line| Some((line.hit(a)?, line.hit(b)?, line)));
                hits.map_or(Ordering::Equal, |(a, b, line)| line.order(&a, &b))
            }
            (Surface::Triangle(_), Surface::Shape(_)) => Ordering::Less,
            (Surface::Shape(_), Surface::Triangle(_)) => Ordering::Greater,
            (Surface::Shape(_), Surface::Shape(_)) => Ordering::Equal,
        }
    }
}
