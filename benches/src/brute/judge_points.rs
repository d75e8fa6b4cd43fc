//! What brute force says of a point, and what the library says.

use firsthit_accel::{ClosestPoint, Scene, SignMethod, Solid};
use firsthit_geometry::Ray;
use firsthit_geometry::distance::{Feature, closest_on_triangle};
use glam::DVec3;

use super::judge_rays::all_hits;
use super::precise::{Number as _, Pair, to_triangle};
use super::tally::{Source, Tally};

/// Of the nearest triangles so many are asked for, at most.
pub const FEW: usize = 6;

/// Methods that tell inside from outside, with the queries' names. The first is what `Solid::new` takes. Winding numbers are
/// exact, parities too; the others round, and are not asked for sides where the surface is within 16 roundings.
pub const METHODS: [(SignMethod, &str); 6] = [
    (SignMethod::Winding, "contains, winding"),
    (SignMethod::FastWinding { accuracy: 2.0 }, "contains, fast winding"),
    (SignMethod::Parity { votes: 1 }, "contains, parity"),
    (SignMethod::Parity { votes: 3 }, "contains, parity of three"),
    (SignMethod::Exact, "contains, exact"),
    (SignMethod::Pseudonormal, "contains, pseudonormal"),
];

/// A scene with all that is asked of it about points.
pub struct Asked {
    scene: Scene,
    /// By method, those that are right on this mesh.
    solids: Vec<(Solid, &'static str)>,
}

impl Asked {
    /// With these methods.
    #[must_use]
    pub fn new(scene: &Scene, methods: &[(SignMethod, &'static str)]) -> Self {
        let solid = |(method, name): &(SignMethod, &'static str)| (Solid::with_method(scene, *method), *name);
        Self { scene: scene.clone(), solids: methods.iter().map(solid).collect() }
    }
}

/// Everything that the library says about some points.
pub struct Answers {
    single: Vec<Option<ClosestPoint>>,
    batch: Vec<Option<ClosestPoint>>,
    distances: Vec<f64>,
    nearest: Vec<Vec<ClosestPoint>>,
    signed: Vec<f64>,
    winding: Vec<f64>,
    inside: Vec<Vec<bool>>,
}

/// So many of the nearest are asked for, of the point of an index.
const fn few(index: usize) -> usize {
    1 + index % FEW
}

impl Answers {
    /// Asks everything.
    #[must_use]
    pub fn new(asked: &Asked, points: &[DVec3]) -> Self {
        let Asked { scene, solids } = asked;
        let mut answers = Self {
            single: points.iter().map(|p| scene.closest_point(*p)).collect(),
            batch: vec![None; points.len()],
            distances: vec![0.0; points.len()],
            nearest: points.iter().enumerate().map(|(i, p)| scene.nearest_k(*p, few(i), f64::INFINITY)).collect(),
            signed: vec![0.0; points.len()],
            winding: Vec::new(),
            inside: Vec::new(),
        };
        scene.closest_points(points, f64::INFINITY, &mut answers.batch);
        scene.distances(points, &mut answers.distances);
        if let Some((solid, _)) = solids.first() {
            solid.signed_distances(points, &mut answers.signed);
            answers.winding = points.iter().map(|p| solid.winding_number(*p)).collect();
        }
        for (solid, _) in solids {
            let mut inside = vec![false; points.len()];
            solid.contains_each(points, &mut inside);
            answers.inside.push(inside);
        }
        answers
    }
}

/// A triangle as seen from a point.
struct Near {
    triangle: u32,
    point: DVec3,
    distance: f64,
    weights: [f32; 2],
    feature: Feature,
}

/// The nearest triangles of a list: measured as the library does, each.
fn nearest(p: DVec3, corners: &[[DVec3; 3]], of: &[u32], few: usize) -> Vec<Near> {
    let at = |triangle: u32| closest_on_triangle::<f64>(corners[triangle as usize].map(|c| c - p), DVec3::ZERO);
    let mut all: Vec<(f64, u32)> = of.iter().map(|&t| (at(t).point.length_squared(), t)).collect();
    let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if all.len() > few {
        all.select_nth_unstable_by(few - 1, order);
        all.truncate(few);
    }
    all.sort_by(order);
    let near = |(_, triangle): (f64, u32)| {
        let at = at(triangle);
        let weights = [at.weights[1] as f32, at.weights[2] as f32];
        Near { triangle, point: p + at.point, distance: at.point.length(), weights, feature: at.feature() }
    };
    all.into_iter().map(near).collect()
}

fn same(got: &ClosestPoint, near: &Near) -> bool {
    got.id.primitive == near.triangle
        && got.distance.to_bits() == near.distance.to_bits()
        && got.point == near.point
        && [got.u, got.v] == near.weights
        && got.feature == near.feature
}

/// What is inside by brute force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inside {
    /// How often the surface winds around the point; `None`: on the surface it has no certain answer.
    pub winding: Option<f64>,
    /// Whether the number of crossings is odd, of closed meshes.
    pub odd: bool,
}

impl Inside {
    /// By all crossings of a ray from the point, decided exactly. Only of closed meshes, and of bodies without normals that
    /// are hard to tell from the ray's.
    #[must_use]
    pub fn of_closed(ray: &Ray<f64>, corners: &[[DVec3; 3]], of: &[u32]) -> Self {
        let hits = all_hits(ray, corners, of.iter().copied());
        let mut inside = Self { winding: Some(0.0), odd: false };
        for found in hits {
            if found.hit.t == 0.0 {
                inside.winding = None;
            }
            if !found.hit.crosses {
                continue;
            }
            let [a, b, c] = corners[found.triangle as usize];
            let normal = (b - a).cross(c - a);
            let along = normal.dot(ray.direction);
            // Directions are drawn at random: this does not happen but to what has no area.
            if along.abs() < 1e-10 * normal.length() * ray.direction.length() {
                inside.winding = None;
            }
            inside.odd = !inside.odd;
            inside.winding = inside.winding.map(|w| w + along.signum());
        }
        inside
    }
}

/// Judges answers about points of a mesh.
pub struct Judge<'a> {
    /// The mesh.
    pub corners: &'a [[DVec3; 3]],
    /// Whether it has no end.
    pub closed: bool,
    /// Its size.
    pub size: f64,
    /// The largest error of a distance that was met, in units of the last place of the larger of the distance and the
    /// triangle's coordinates as seen from the point.
    pub worst_distance: f64,
    /// The largest error of a winding number that was met.
    pub worst_winding: f64,
}

/// Units in the last place that a distance may be off.
const ALLOWED: f64 = 16.0;

impl Judge<'_> {
    /// Against the triangles of a list, which must have the [`FEW`] nearest; `inside` by brute force too.
    pub fn judge(
        &mut self,
        (asked, answers): (&Asked, &Answers),
        (i, p): (usize, DVec3),
        of: &[u32],
        inside: Inside,
        source: Source,
        tally: &mut Tally,
    ) {
        let key = (source, 0);
        let near = nearest(p, self.corners, of, FEW);
        let [first, ..] = &near[..] else { return };
        let tell = |got: &dyn std::fmt::Debug| format!("{p:?}: {got:?}, {} at {}", first.triangle, first.distance);
        for (query, got) in [("closest_point", answers.single[i]), ("closest_points", answers.batch[i])] {
            tally.add(query, key, got.is_some_and(|got| same(&got, first)), || tell(&got));
        }
        let (few, got) = (few(i), &answers.nearest[i]);
        let equal = got.len() == few && got.iter().zip(&near).all(|(g, n)| same(g, n));
        tally.add("nearest_k", key, equal, || tell(got));
        let least = self.distance((i, p), answers, &near, key, tally);
        // Exactly on the surface it has no certain side.
        let on = least <= 1e-28 * self.size;
        self.sides(asked, answers, (i, p), (first.distance, on), inside, key, tally);
    }

    /// The distance against one of twice as many digits, which is given back.
    fn distance(
        &mut self,
        (i, p): (usize, DVec3),
        answers: &Answers,
        near: &[Near],
        key: (Source, i32),
        tally: &mut Tally,
    ) -> f64 {
        // Of several that are as near in f64, another may be the nearest.
        let distance = |n: &Near| to_triangle::<Pair>(self.corners[n.triangle as usize], p).root().rounded();
        let least = near.iter().map(distance).fold(f64::INFINITY, f64::min);
        let seen = near.iter().flat_map(|n| self.corners[n.triangle as usize]);
        let unit = seen.fold(least, |m, c| m.max((c - p).abs().max_element())) * f64::EPSILON;
        let got = answers.distances[i];
        let off = if unit > 0.0 { (got - least).abs() / unit } else { 0.0 };
        self.worst_distance = self.worst_distance.max(off);
        tally.add("distance", key, off <= ALLOWED, || format!("{p:?}: {got:e}, not {least:e}: {off} units"));
        least
    }

    fn sides(
        &mut self,
        asked: &Asked,
        answers: &Answers,
        (i, p): (usize, DVec3),
        (distance, on): (f64, bool),
        inside: Inside,
        key: (Source, i32),
        tally: &mut Tally,
    ) {
        let Some(winding) = inside.winding.filter(|_| !on) else {
            for query in ["winding_number", "signed_distance"].into_iter().chain(asked.solids.iter().map(|s| s.1)) {
                tally.leave_out(query, key);
            }
            return;
        };
        let got = answers.winding[i];
        let off = (got - winding).abs();
        let touches = distance <= 16.0 * f64::EPSILON * (self.size + p.length());
        if self.closed {
            tally.add("winding_number", key, off == 0.0, || format!("{p:?}: {got}, not {winding}"));
        } else {
            self.worst_winding = self.worst_winding.max(off);
            // Beside an edge at which the surface ends it changes with the angle: as if the point were moved by some roundings.
            let allowed = 1e-9 + 16.0 * f64::EPSILON * self.size / distance;
            tally.add("winding_number", key, off < allowed, || format!("{p:?}: {got}, not {winding}"));
        }
        let open_doubt = !self.closed && (winding.abs() - 0.5).abs() < 1e-9;
        let within = winding.abs() > 0.5;
        for ((solid, query), got) in asked.solids.iter().zip(&answers.inside) {
            let (expected, doubt) = match solid.method() {
                SignMethod::Winding => (within, open_doubt),
                // Nearly the number; where that is nearly one half it may say either.
                SignMethod::FastWinding { .. } => (within, touches || (winding.abs() - 0.5).abs() < 0.1),
                SignMethod::Parity { .. } | SignMethod::Exact => (inside.odd, false),
                _ => (within, touches),
            };
            if doubt {
                tally.leave_out(query, key);
            } else {
                tally.add(query, key, got[i] == expected, || format!("{p:?} at {distance:e}: {}, {inside:?}", got[i]));
            }
        }
        if open_doubt || distance == 0.0 {
            tally.leave_out("signed_distance", key);
        } else {
            let expected = if within { -distance } else { distance };
            let got = answers.signed[i];
            tally.add("signed_distance", key, got == expected, || format!("{p:?}: {got:e}, not {expected:e}"));
        }
    }
}

/// Against the answers `whole` for the mesh and the points that these are a power of two of.
pub fn compare(asked: &Asked, scaled: &Answers, whole: &Answers, exponent: i32, source: Source, tally: &mut Tally) {
    let of = (source, exponent);
    let scale = 2f64.powi(exponent);
    let equal = |a: &ClosestPoint, b: &ClosestPoint| {
        let parts = |c: &ClosestPoint, scale: f64| {
            (c.id, c.feature, c.u.to_bits(), c.v.to_bits(), (c.distance * scale).to_bits(), c.point * scale)
        };
        parts(a, 1.0) == parts(b, scale)
    };
    let lists =
        |a: &[ClosestPoint], b: &[ClosestPoint]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b));
    for i in 0..scaled.single.len() {
        let pairs = [
            ("closest_point", scaled.single[i].as_slice(), whole.single[i].as_slice()),
            ("closest_points", scaled.batch[i].as_slice(), whole.batch[i].as_slice()),
            ("nearest_k", &scaled.nearest[i], &whole.nearest[i]),
        ];
        for (query, a, b) in pairs {
            tally.add(query, of, lists(a, b), || format!("{a:?} {b:?}"));
        }
        for (query, a, b) in
            [("distance", &scaled.distances, &whole.distances), ("signed_distance", &scaled.signed, &whole.signed)]
        {
            tally.add(query, of, a[i] == b[i] * scale, || format!("{:e} {:e}", a[i], b[i]));
        }
        let (a, b) = (scaled.winding[i], whole.winding[i]);
        tally.add("winding_number", of, a == b, || format!("{a} {b}"));
        for ((_, query), (a, b)) in asked.solids.iter().zip(scaled.inside.iter().zip(&whole.inside)) {
            tally.add(query, of, a[i] == b[i], String::new);
        }
    }
}
