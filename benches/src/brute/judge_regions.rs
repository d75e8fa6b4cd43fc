//! What brute force says of a region, and what the library says. Spheres and capsules are judged by distances in numbers of
//! twice as many digits, what has plane sides by clipping: with room for roundings on either side, so that each triangle is
//! in, out, or too near to the boundary to tell.

use firsthit_accel::{HitId, Scene, SphereHit};
use firsthit_geometry::clip::HalfSpace;
use firsthit_geometry::exact::ExactRay;
use firsthit_geometry::overlap::{Capsule, Region};
use firsthit_geometry::{Aabb, Ray};
use glam::DVec3;

use super::precise::{Number, Pair, between_segments, to_triangle};
use super::regions::{Asked, Moving, Placed};
use super::tally::{Source, Tally};

/// Units in the last place of the largest coordinate that are too near to tell.
const ROOM: f64 = 512.0;

/// The name of the query about spheres that move.
pub const CAST: &str = "cast_sphere";

/// What the library says: whether anything overlaps, and what.
#[must_use]
pub fn ask(scene: &Scene, region: &Asked) -> (bool, Vec<u32>) {
    fn both(scene: &Scene, region: &impl Region) -> (bool, Vec<u32>) {
        let found: Vec<HitId> = scene.overlapping(region);
        (scene.overlaps(region), found.iter().map(|id| id.primitive).collect())
    }
    match region {
        Asked::Box(b) => both(scene, b),
        Asked::Ball(s) => both(scene, s),
        Asked::Oriented(b) => both(scene, b),
        Asked::Capsule(c) => both(scene, c),
        Asked::Frustum(f) => both(scene, f),
        Asked::Convex(c) => both(scene, c),
    }
}

/// Judges an answer by the triangles of a list; the others are too far away for certain. `size` is that of the mesh.
pub fn judge(
    answer: &(bool, Vec<u32>),
    placed: &Placed,
    corners: &[[DVec3; 3]],
    of: &[u32],
    (source, size): (Source, f64),
    tally: &mut Tally,
) {
    let (any, found) = answer;
    let name = placed.region.name();
    let room = ROOM * f64::EPSILON * (size + placed.middle.length() + placed.reach);
    let judge = Sides::new(&placed.region);
    let (mut missed, mut wrong, mut near) = (None, None, 0);
    let mut at = 0;
    for &triangle in of {
        while at < found.len() && found[at] < triangle {
            // Not on the list.
            wrong = wrong.or(Some(found[at]));
            at += 1;
        }
        let said = found.get(at) == Some(&triangle);
        at += usize::from(said);
        match judge.meets(corners[triangle as usize], room) {
            Some(true) if !said => missed = missed.or(Some(triangle)),
            Some(false) if said => wrong = wrong.or(Some(triangle)),
            Some(_) => {}
            None => near += 1,
        }
    }
    wrong = wrong.or(found.get(at).copied());
    let right = missed.is_none() && wrong.is_none() && *any != found.is_empty();
    tally.add(name, (source, 0), right, || {
        format!("missed {missed:?}, not there {wrong:?}, any {any}, {} found: {:?}", found.len(), placed.region)
    });
    if near > 0 {
        tally.leave_out(name, (source, 0));
    }
}

/// A region as it is judged.
enum Sides<'a> {
    /// Within so far of a segment (perhaps a point).
    Round(DVec3, DVec3, f64),
    /// Between planes with unit normals. The box itself, too: what has a corner in it meets it, without any room.
    Flat(Vec<HalfSpace<f64>>, Option<&'a Aabb<f64>>),
}

impl<'a> Sides<'a> {
    fn new(region: &'a Asked) -> Self {
        let unit = |h: &HalfSpace<f64>| HalfSpace::new(h.normal / h.normal.length(), h.offset / h.normal.length());
        match region {
            Asked::Ball(s) => Self::Round(s.center, s.center, s.radius),
            Asked::Capsule(Capsule { a, b, radius }) => Self::Round(*a, *b, *radius),
            Asked::Box(b) => {
                let faces = DVec3::AXES
                    .into_iter()
                    .flat_map(|axis| [HalfSpace::new(axis, axis.dot(b.max)), HalfSpace::new(-axis, -axis.dot(b.min))]);
                Self::Flat(faces.collect(), Some(b))
            }
            Asked::Oriented(b) => {
                let faces = (0..3).flat_map(|k| {
                    let axis = b.axes.col(k);
                    let at = axis.dot(b.center);
                    [HalfSpace::new(axis, at + b.half[k]), HalfSpace::new(-axis, b.half[k] - at)]
                });
                Self::Flat(faces.collect(), None)
            }
            Asked::Frustum(f) => Self::Flat(f.planes().iter().map(unit).collect(), None),
            Asked::Convex(c) => Self::Flat(c.half_spaces.iter().map(unit).collect(), None),
        }
    }

    /// `None` if that is too near to tell.
    fn meets(&self, corners: [DVec3; 3], room: f64) -> Option<bool> {
        match self {
            Self::Round(a, b, radius) => {
                let distance = from_segment(*a, *b, corners, *radius, room / (ROOM * f64::EPSILON));
                if distance > radius + room { Some(false) } else { (distance <= radius - room).then_some(true) }
            }
            Self::Flat(planes, bounds) => {
                if bounds.is_some_and(|b| corners.iter().any(|c| b.contains(*c))) || is_left(planes, corners, -room) {
                    Some(true)
                } else {
                    (!is_left(planes, corners, room)).then_some(false)
                }
            }
        }
    }
}

/// Distance of a triangle from a segment: by plain numbers where that is not near `limit`, by those of twice as many digits
/// where it is.
fn from_segment(a: DVec3, b: DVec3, corners: [DVec3; 3], limit: f64, size: f64) -> f64 {
    let plain = distance::<f64>(a, b, corners);
    if (plain - limit).abs() > size * 1e-6 { plain } else { distance::<Pair>(a, b, corners) }
}

fn distance<N: Number>(a: DVec3, b: DVec3, corners: [DVec3; 3]) -> f64 {
    let [x, y, z] = corners;
    let mut least = to_triangle::<N>(corners, a).rounded();
    if a != b {
        least = least.min(to_triangle::<N>(corners, b).rounded());
        for (p, q) in [(x, y), (y, z), (z, x)] {
            least = least.min(between_segments::<N>((a, b), (p, q)).rounded());
        }
        if ExactRay::new(Ray::segment(a, b)).is_some_and(|ray| ray.hit(corners).is_some()) {
            return 0.0;
        }
    }
    least.max(0.0).sqrt()
}

/// Whether anything is left of a triangle between planes that are moved outwards by so much (Sutherland and Hodgman 1974).
fn is_left(planes: &[HalfSpace<f64>], corners: [DVec3; 3], room: f64) -> bool {
    let mut left = corners.to_vec();
    for plane in planes {
        let beyond = |p: &DVec3| plane.normal.dot(*p) - plane.offset - room;
        let mut next = Vec::with_capacity(left.len() + 1);
        for (i, p) in left.iter().enumerate() {
            let q = &left[(i + 1) % left.len()];
            let (from, to) = (beyond(p), beyond(q));
            if from <= 0.0 {
                next.push(*p);
            }
            if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
                next.push(*p + (*q - *p) * (from / (from - to)));
            }
        }
        if next.is_empty() {
            return false;
        }
        left = next;
    }
    true
}

/// Judges where a sphere that moves first touches.
pub fn judge_cast(
    answer: Option<&SphereHit>,
    Moving { way, radius }: &Moving,
    corners: &[[DVec3; 3]],
    of: &[u32],
    (source, size): (Source, f64),
    tally: &mut Tally,
) {
    let middle = way.origin.length() + way.direction.length();
    let room = ROOM * f64::EPSILON * (size + middle + radius);
    // Before it touches it is farther from every triangle than its radius, then from one as far.
    let end = answer.map_or(way.t_max, |hit| hit.t);
    let (mut pierced, mut near) = (None, false);
    // Where it touches at the start, there is no way before.
    for &triangle in of.iter().filter(|_| end > way.t_min) {
        let least = nearest_on_way(way, end, corners[triangle as usize], radius + room);
        // It may be there at the end, but not before.
        if least.0 < radius - room && (answer.is_none() || least.1 < end) {
            let before = to_triangle::<Pair>(corners[triangle as usize], way.at(end)).root().rounded();
            // Deeper on the way than where it stops.
            if before > least.0 + room || answer.is_none() || before < radius - room && end > way.t_min {
                pierced = pierced.or(Some((triangle, least)));
            }
        } else if least.0 <= radius + room {
            near = true;
        }
    }
    let touches = answer.is_none_or(|hit| {
        let distance = to_triangle::<Pair>(corners[hit.id.primitive as usize], way.at(hit.t)).root().rounded();
        // At the start it may be deep in.
        (distance - radius).abs() <= room || hit.t == way.t_min && distance <= radius + room
    });
    tally.add(CAST, (source, 0), pierced.is_none() && touches, || {
        format!("touches: {touches}, before that {pierced:?}: {answer:?}, {way:?}, {radius}")
    });
    if near && answer.is_none() {
        tally.leave_out(CAST, (source, 0));
    }
}

/// Whether a triangle may be touched at all: by a box about it.
#[must_use]
pub fn is_near(moving: &Moving, corners: [DVec3; 3]) -> bool {
    let bounds = Aabb::<f64>::from_points(corners);
    let reach = DVec3::splat(moving.radius * 1.001 + bounds.max.abs().max(bounds.min.abs()).max_element() * 1e-9);
    let grown = Aabb::<f64>::new(bounds.min - reach, bounds.max + reach);
    firsthit_geometry::clip::liang_barsky(&grown, &moving.way).is_some()
}

/// The least distance of a triangle from a point on its way to `end`, and where that is: distances from convex bodies have
/// one valley along a line. Where plain numbers say that it is not below `enough` by far, that is all that is told.
fn nearest_on_way(way: &Ray<f64>, end: f64, corners: [DVec3; 3], enough: f64) -> (f64, f64) {
    let (length, ends) = (way.direction.length(), (way.t_min, end));
    let room = enough * (1.0 + 1e-6) + length * 1e-6;
    let plain = |t: f64| to_triangle::<f64>(corners, way.at(t)).max(0.0).sqrt();
    // Nothing on the way is nearer than it is far away less how far there is to go.
    let far = |least: f64, rest: f64| least - rest * length > room;
    let near = valley(ends, plain, far);
    if near.0 > room {
        return near;
    }
    valley(ends, |t| to_triangle::<Pair>(corners, way.at(t)).root().rounded(), |_, _| false)
}

/// The least value of a function with one valley, and where it is, by golden sections; or until enough is known of a value and
/// of the length that is left.
fn valley((first, last): (f64, f64), at: impl Fn(f64) -> f64, enough: impl Fn(f64, f64) -> bool) -> (f64, f64) {
    const SECTION: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (first, last);
    let mut inner = [high - (high - low) * SECTION, low + (high - low) * SECTION];
    let mut values = inner.map(&at);
    for _ in 0..100 {
        if enough(values[0].min(values[1]), high - low) {
            break;
        }
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - (high - low) * SECTION, inner[0]];
            values = [at(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + (high - low) * SECTION];
            values = [values[1], at(inner[1])];
        }
    }
    let least = |a: (f64, f64), t: f64| {
        let value = at(t);
        if value < a.0 { (value, t) } else { a }
    };
    [first, inner[0], inner[1], last].into_iter().fold((f64::INFINITY, last), least)
}
