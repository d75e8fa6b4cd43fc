//! The loops of edges at which surfaces end, in trees: a side is told without looking at every edge.
//!
//! A winding number is the number of signed crossings of a ray, and what the loops add as seen from its origin: the signed sum of the
//! spherical triangles between each edge and the direction against the ray's (van Oosterom and Strackee 1983). From afar a chain of edges
//! is its chord. Between the two there is a surface of some area `A`; a ray that passes by it does not tell them apart, and
//! from a distance of at least `d` it has a solid angle of at most `A / d^2`.

use core::f64::consts::PI;
use core::ops::Range;
use std::collections::{BinaryHeap, HashMap};
use std::sync::Arc;

use firsthit_geometry::transform::Transform;
use glam::{DMat3, DVec3, Vec3};

/// Edges of a chain that is not divided further.
const LEAF: usize = 4;

/// What is not known better than this is looked at closely: no more can be told from it.
const MOST: f64 = 32.0 * PI;

/// Numbers that are nearer to one half than this, but for what is not known, are told by the sum over all edges.
const ROUNDED: f64 = 1e-9;

/// Closed loops of edges, normalised.
#[derive(Clone, Debug, Default)]
pub(super) struct Loops {
    /// One loop after the other, each from edge to edge.
    edges: Vec<[Vec3; 2]>,
    /// The whole first; the halves of a node follow it.
    nodes: Vec<Node>,
}

/// Some loops, or a chain of edges of one.
#[derive(Clone, Debug)]
struct Node {
    centre: DVec3,
    /// No vertex is farther from it.
    radius: f64,
    /// Area of a surface between the chain and its chord, or of one that the loops bound; it lies within the convex hull.
    area: f64,
    edges: Range<u32>,
    /// Whether these are loops, which have no chord.
    whole: bool,
    /// The second half; the first is next. 0: not divided.
    second: u32,
}

impl Loops {
    /// Of directed edges between points, of which as many end at each point as begin there.
    pub(super) fn new(points: &[Vec3], edges: &[[u32; 2]]) -> Self {
        let mut apart: Vec<Vec<[Vec3; 2]>> = Vec::new();
        for corners in take_apart(edges) {
            let at = |k: usize| points[corners[k % corners.len()] as usize];
            apart.push((0..corners.len()).map(|k| [at(k), at(k + 1)]).collect());
        }
        let mut loops = Self::default();
        if !apart.is_empty() {
            loops.group(&mut apart);
        }
        loops
    }

    /// Adds loops and what is above them: divided at the median along the longest side of the box of their starts.
    fn group(&mut self, apart: &mut [Vec<[Vec3; 2]>]) {
        let start = self.edges.len();
        if let [single] = apart {
            self.edges.extend_from_slice(single);
            self.divide(start..self.edges.len(), true);
            return;
        }
        let index = self.nodes.len();
        self.nodes.push(Node::of(&[], 0..0));
        let starts = || apart.iter().map(|l| l[0][0]);
        let [low, high] = [starts().fold(Vec3::INFINITY, Vec3::min), starts().fold(Vec3::NEG_INFINITY, Vec3::max)];
        let axis = (high - low).max_position();
        let middle = apart.len() / 2;
        apart.select_nth_unstable_by(middle, |a, b| a[0][0][axis].total_cmp(&b[0][0][axis]));
        let (first, second) = apart.split_at_mut(middle);
        self.group(first);
        let second_half = self.nodes.len();
        self.group(second);
        let area = self.nodes[index + 1].area + self.nodes[second_half].area;
        let node = Node::of(&self.edges[start..], start..self.edges.len());
        self.nodes[index] = Node { area, whole: true, second: second_half as u32, ..node };
    }

    /// Adds nodes for a chain of edges. The surface between it and its chord: those of its halves, and the triangle of the
    /// three chords.
    fn divide(&mut self, range: Range<usize>, whole: bool) {
        let index = self.nodes.len();
        let node = Node::of(&self.edges[range.clone()], range.clone());
        self.nodes.push(Node { whole, ..node });
        if range.len() > LEAF {
            let middle = range.start + range.len() / 2;
            self.divide(range.start..middle, false);
            let second = self.nodes.len();
            self.divide(middle..range.end, false);
            let [[a, _], [b, _], [_, c]] = [self.edges[range.start], self.edges[middle], self.edges[range.end - 1]];
            let halves = self.nodes[index + 1].area + self.nodes[second].area;
            let node = &mut self.nodes[index];
            (node.area, node.second) = (halves + area([a, b, c]), second as u32);
        }
    }
}

impl Node {
    /// With the area of a chain that is not divided: triangles from its start to each of its edges.
    fn of(edges: &[[Vec3; 2]], range: Range<usize>) -> Self {
        let starts = || edges.iter().flatten();
        let low = starts().fold(Vec3::INFINITY, |low, p| low.min(*p)).as_dvec3();
        let high = starts().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p)).as_dvec3();
        let centre = (low + high) * 0.5;
        let radius = starts().fold(0.0, |radius: f64, p| radius.max(p.as_dvec3().distance(centre)));
        let area = edges.iter().map(|[b, c]| area([edges[0][0], *b, *c])).sum();
        Self { centre, radius, area, edges: range.start as u32..range.end as u32, whole: false, second: 0 }
    }
}

fn area(corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    (b - a).cross(c - a).length() * 0.5
}

/// The points of each of the loops that the edges are: none of them passes a point twice.
fn take_apart(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut left: HashMap<u32, Vec<u32>> = HashMap::new();
    for [from, to] in edges {
        left.entry(*from).or_default().push(*to);
    }
    let mut loops = Vec::new();
    // Where on the path a point is.
    let mut places: HashMap<u32, usize> = HashMap::new();
    for [start, _] in edges {
        let mut path = vec![*start];
        places.insert(*start, 0);
        while let Some(next) = path.last().and_then(|last| left.get_mut(last)?.pop()) {
            let Some(&place) = places.get(&next) else {
                places.insert(next, path.len());
                path.push(next);
                continue;
            };
            loops.push(path[place..].to_vec());
            path.drain(place + 1..).for_each(|point| {
                places.remove(&point);
            });
        }
        places.clear();
    }
    loops
}

/// The loops of an instance.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    loops: Arc<Loops>,
    linear: DMat3,
    translation: DVec3,
    /// Nothing becomes longer than so many times its length.
    stretch: f64,
    /// A mirrored mesh keeps its outside.
    side: f64,
}

/// Some of the loops, as far as they were looked at.
struct Seen {
    /// Their angle is not farther off.
    off: f64,
    angle: f64,
    instance: u32,
    node: u32,
}

impl PartialEq for Seen {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Seen {}

impl PartialOrd for Seen {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// What is known worst comes first.
impl Ord for Seen {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        self.off.total_cmp(&other.off)
    }
}

/// What is seen from where a ray begins.
#[derive(Clone, Copy)]
pub(super) struct Viewpoint {
    point: DVec3,
    /// Against the ray.
    apex: DVec3,
    /// What is rounded in the scene is relative to it.
    size: f64,
}

impl Viewpoint {
    pub(super) fn new(point: DVec3, direction: DVec3, size: f64) -> Self {
        Self { point, apex: -direction.normalize_or_zero(), size }
    }

    /// What is rounded: single precision, many times over.
    fn close(&self, distances: f64) -> f64 {
        (self.size + distances) * 2f64.powi(-18)
    }

    /// The angle of an edge between these points, given with how far they are; `None` if the ray passes so close to it
    /// that it is not certain on which side: there the sum jumps by 4 pi, as does the number of crossings.
    fn angle(&self, (a, la): (DVec3, f64), (b, lb): (DVec3, f64)) -> Option<f64> {
        let volume = a.cross(b).dot(self.apex);
        let around = la * lb + a.dot(b) + b.dot(self.apex) * la + self.apex.dot(a) * lb;
        // The distance is that of the two lines.
        if around <= la * lb * 1e-4 && volume.abs() <= (b - a).cross(self.apex).length() * self.close(la + lb) {
            return None;
        }
        Some(2.0 * volume.atan2(around))
    }

    /// The sum over all edges.
    pub(super) fn sum(&self, of: &[Placed]) -> Option<f64> {
        of.iter().map(|placed| self.edges(placed, &placed.loops.edges)).sum()
    }

    fn edges(&self, placed: &Placed, edges: &[[Vec3; 2]]) -> Option<f64> {
        let mut sum = 0.0;
        let mut last = (Vec3::NAN, (DVec3::NAN, 0.0));
        for [a, b] in edges {
            let a = if *a == last.0 { last.1 } else { placed.seen(*a, self.point) };
            last = (*b, placed.seen(*b, self.point));
            sum += self.angle(a, last.1)?;
        }
        Some(sum * placed.side)
    }

    /// Whether a winding number of so many crossings, and of what the loops add, is beyond one half of either sign. `None` as of
    /// [`Viewpoint::sum`].
    pub(super) fn is_beyond_half(&self, of: &[Placed], crossings: f64) -> Option<bool> {
        let mut sums = Sums { from: self, of, angle: 0.0, off: 0.0, seen: Vec::new(), keeps: false };
        // Mostly a first look will do: nothing is kept for a second one.
        for keeps in [false, true] {
            sums = Sums { angle: 0.0, off: 0.0, keeps, ..sums };
            for (instance, placed) in (0..).zip(of) {
                if !placed.loops.nodes.is_empty() {
                    sums.look(instance, 0)?;
                }
            }
            if let Some(beyond) = sums.tell(crossings) {
                return Some(beyond);
            }
        }
        let mut seen = BinaryHeap::from(std::mem::take(&mut sums.seen));
        while let Some(worst) = seen.pop() {
            sums.angle -= worst.angle;
            sums.off -= worst.off;
            sums.look_closely(worst.instance, worst.node)?;
            seen.extend(sums.seen.drain(..));
            if let Some(beyond) = sums.tell(crossings) {
                return Some(beyond);
            }
        }
        Some(sums.beyond(crossings) > 0.0)
    }
}

/// What is known so far.
struct Sums<'a> {
    from: &'a Viewpoint,
    of: &'a [Placed],
    angle: f64,
    off: f64,
    /// What was looked at, if it is kept.
    seen: Vec<Seen>,
    keeps: bool,
}

impl Sums<'_> {
    /// How far the number is beyond one half of either sign.
    fn beyond(&self, crossings: f64) -> f64 {
        (crossings + self.angle / (4.0 * PI)).abs() - 0.5
    }

    /// Whether it is, if that is known.
    fn tell(&self, crossings: f64) -> Option<bool> {
        let beyond = self.beyond(crossings);
        (beyond.abs() > self.off / (4.0 * PI) + ROUNDED).then_some(beyond > 0.0)
    }

    fn look(&mut self, instance: u32, node: u32) -> Option<()> {
        let placed = &self.of[instance as usize];
        match placed.about(node, self.from) {
            Some((angle, off)) => {
                self.angle += angle;
                self.off += off;
                if self.keeps {
                    self.seen.push(Seen { off, angle, instance, node });
                }
                Some(())
            }
            None => self.look_closely(instance, node),
        }
    }

    fn look_closely(&mut self, instance: u32, node: u32) -> Option<()> {
        let placed = &self.of[instance as usize];
        let Node { second, edges, .. } = &placed.loops.nodes[node as usize];
        if *second == 0 {
            let edges = &placed.loops.edges[edges.start as usize..edges.end as usize];
            self.angle += self.from.edges(placed, edges)?;
            return Some(());
        }
        self.look(instance, node + 1)?;
        self.look(instance, *second)
    }
}

impl Placed {
    pub(super) fn new(loops: Arc<Loops>, transform: &Transform) -> Self {
        let linear = transform.linear();
        let stretch = if transform.is_uniform() {
            linear.x_axis.x.abs()
        } else {
            linear.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        let side = if transform.mirrors() { -1.0 } else { 1.0 };
        Self { loops, linear, translation: transform.translation(), stretch: stretch * (1.0 + 1e-9), side }
    }

    /// A point and how far it is.
    fn seen(&self, p: Vec3, from: DVec3) -> (DVec3, f64) {
        let p = self.linear * p.as_dvec3() + (self.translation - from);
        (p, p.length())
    }

    /// The angle of a node, and how far off it is at most; `None` where that tells nothing: it is too near, or the ray may pass
    /// between the chain and its chord.
    fn about(&self, node: u32, from: &Viewpoint) -> Option<(f64, f64)> {
        let node = &self.loops.nodes[node as usize];
        let centre = self.linear * node.centre + (self.translation - from.point);
        let (distance, radius) = (centre.length(), node.radius * self.stretch);
        let room = radius + from.close(distance + radius);
        let ahead = from.apex.dot(centre) < 0.0;
        if distance <= room || ahead && from.apex.cross(centre).length_squared() <= room * room {
            return None;
        }
        let off = node.area * self.stretch * self.stretch / ((distance - radius) * (distance - radius));
        // Also what is not a number.
        if !(off <= MOST) {
            return None;
        }
        if node.whole {
            return Some((0.0, off));
        }
        let edges = &self.loops.edges;
        let [[a, _], [_, b]] = [edges[node.edges.start as usize], edges[node.edges.end as usize - 1]];
        Some((from.angle(self.seen(a, from.point), self.seen(b, from.point))? * self.side, off))
    }
}
