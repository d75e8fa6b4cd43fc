//! Winding numbers by clusters of triangles (Barill, Dickson, Schmidt, Levin and Jacobson, *Fast winding numbers for soups and
//! clouds*, 2018): from afar a cluster is a point with the sum of its triangles' area vectors.

use core::f64::consts::PI;
use core::ops::Range;

use firsthit_geometry::Real;
use firsthit_geometry::transform::Transform;
use glam::{DMat3, DVec3, Vec3};

use crate::model::Model;

/// Triangles of a cluster that is not divided further.
const LEAF: usize = 8;

/// A mesh's triangles in clusters.
#[derive(Clone, Debug, Default)]
pub(super) struct Clusters {
    /// The whole first; the halves of a cluster follow it.
    nodes: Vec<Node>,
    triangles: Vec<[Vec3; 3]>,
}

#[derive(Clone, Debug)]
struct Node {
    /// Mean of the triangles' centres, weighted by area; normalised.
    centre: DVec3,
    /// No vertex is farther from it.
    radius: f64,
    /// Sum of the area vectors: half the cross products.
    area: DVec3,
    /// Sum of area vectors times their places as seen from the centre: `(centre of triangle - centre) (x) area`, by columns of the
    /// area vector's components.
    first: [DVec3; 3],
    triangles: Range<u32>,
    /// The second half; the first is next. 0: not divided.
    second: u32,
}

impl Clusters {
    pub(super) fn new(model: &Model) -> Self {
        let mut clusters = Self::default();
        model.each_triangle(|_, corners| clusters.triangles.push(corners));
        let count = clusters.triangles.len();
        if count > 0 {
            clusters.divide(0..count);
        }
        clusters
    }

    /// At the median along the longest side of the box of the centres, so the depth is the logarithm.
    fn divide(&mut self, range: Range<usize>) -> u32 {
        let index = self.nodes.len() as u32;
        self.nodes.push(node(&self.triangles[range.clone()], range.clone()));
        if range.len() > LEAF {
            let triangles = &mut self.triangles[range.clone()];
            let (low, high) = triangles
                .iter()
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), t| (low.min(sum(t)), high.max(sum(t))));
            let axis = (high - low).max_position();
            let middle = range.len() / 2;
            triangles.select_nth_unstable_by(middle, |a, b| sum(a)[axis].total_cmp(&sum(b)[axis]));
            self.divide(range.start..range.start + middle);
            self.nodes[index as usize].second = self.divide(range.start + middle..range.end);
        }
        index
    }

    /// The winding number of an instance around a point of the world.
    pub(super) fn winding_number(&self, transform: &Transform, point: DVec3, accuracy: f64) -> f64 {
        // Solid angles have no size: powers of two keep products from vanishing.
        let linear = transform.linear();
        let size = linear.to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs())).power_of_two_below();
        let (linear, offset) = (linear * (1.0 / size), (transform.translation() - point) / size);
        let stretch = if transform.is_uniform() {
            linear.x_axis.x.abs()
        } else {
            linear.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        // How area vectors are mapped; a mirrored mesh keeps its outside.
        let side = if transform.mirrors() { -1.0 } else { 1.0 };
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        let areas = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * side;
        let volume = linear.determinant().abs();

        let mut sum = 0.0;
        let mut stack = Vec::with_capacity(64);
        stack.extend((!self.nodes.is_empty()).then_some(0u32));
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            let from = linear * node.centre + offset;
            let distance = from.length();
            if distance > node.radius * stretch * accuracy.max(1.0) {
                // The gradient of 1 / r, and its gradient; for the moments as they are in the object's space.
                let cube = 1.0 / (distance * distance * distance);
                let (for_places, for_areas) = (linear.transpose() * from, areas.transpose() * from);
                let [x, y, z] = node.first;
                let trace = (x.x + y.y + z.z) * volume;
                let along = for_areas.dot(DVec3::new(x.dot(for_places), y.dot(for_places), z.dot(for_places)));
                sum += cube * (node.area.dot(for_areas) + trace - 3.0 * along / (distance * distance));
            } else if node.second == 0 {
                let range = node.triangles.start as usize..node.triangles.end as usize;
                let angle = |t: &[Vec3; 3]| solid_angle(t.map(|p| linear * p.as_dvec3() + offset));
                sum += self.triangles[range].iter().map(angle).sum::<f64>() * side;
            } else {
                stack.extend([node.second, at + 1]);
            }
        }
        sum / (4.0 * PI)
    }
}

fn sum([a, b, c]: &[Vec3; 3]) -> Vec3 {
    *a + *b + *c
}

fn node(triangles: &[[Vec3; 3]], range: Range<usize>) -> Node {
    let parts = || {
        triangles.iter().map(|t| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            ((a + b + c) / 3.0, (b - a).cross(c - a) * 0.5)
        })
    };
    let whole: f64 = parts().map(|(_, area)| area.length()).sum();
    let mean = parts().fold(DVec3::ZERO, |m, (at, area)| m + at * area.length());
    let centre = if whole > 0.0 { mean / whole } else { parts().next().map_or(DVec3::ZERO, |(at, _)| at) };
    let radius = triangles.iter().flatten().map(|p| (p.as_dvec3() - centre).length()).fold(0.0, f64::max);
    let mut first = [DVec3::ZERO; 3];
    for (at, area) in parts() {
        for (axis, row) in first.iter_mut().enumerate() {
            *row += (at - centre) * area[axis];
        }
    }
    let area = parts().map(|(_, area)| area).sum();
    Node { centre, radius, area, first, triangles: range.start as u32..range.end as u32, second: 0 }
}

/// Signed solid angle of a triangle as seen from the origin (van Oosterom and Strackee 1983): positive from behind.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let around = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.cross(b).dot(c).atan2(around)
}
