//! A tree over lights: one of many is found by chance in proportion to about how much it gives to a point.
//!
//! Conty Estevez and Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting" (2018): every node bounds
//! where its lights are, which way they face and how strong they are together; from the root down one of two children
//! is taken by chance in proportion to a bound of what they give. The probability is that of the way, so the answer is
//! right however rough the bounds are.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};

/// What is known of one light, or of several together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightBounds {
    /// The box around it, in the world.
    pub(crate) min: DVec3,
    /// Its upper corner.
    pub(crate) max: DVec3,
    /// Luminance times area, or luminous intensity: irradiance one unit of length away where it is strongest.
    pub(crate) strength: f32,
    /// The middle of the directions that it faces, unit.
    pub(crate) axis: Vec3,
    /// Cosine of the widest angle between the axis and a direction that it faces; -1: every direction.
    pub(crate) cos_facing: f32,
    /// Cosine of the angle from a faced direction within which it shines.
    pub(crate) cos_shining: f32,
    /// It shines to the back as well.
    pub(crate) both_sides: bool,
}

impl LightBounds {
    fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    fn and(self, other: Self) -> Self {
        if !(self.strength > 0.0) {
            return other;
        }
        if !(other.strength > 0.0) {
            return self;
        }
        let (axis, cos_facing) = cone_around((self.axis, self.cos_facing), (other.axis, other.cos_facing));
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            strength: self.strength + other.strength,
            axis,
            cos_facing,
            cos_shining: self.cos_shining.min(other.cos_shining),
            both_sides: self.both_sides || other.both_sides,
        }
    }

    /// The cost of a node of these lights: strength x solid angle shone into x area of the box.
    fn cost(&self) -> f32 {
        if !(self.strength > 0.0) {
            return 0.0;
        }
        let facing = self.cos_facing.clamp(-1.0, 1.0).acos();
        let end = (facing + self.cos_shining.clamp(-1.0, 1.0).acos()).min(PI);
        // Conty Estevez and Kulla, equation 1.
        let sin = facing.sin();
        let angles = 2.0 * PI * (1.0 - facing.cos())
            + 0.5 * PI * (2.0 * end * sin - (facing - 2.0 * end).cos() - 2.0 * facing * sin + facing.cos());
        let d = (self.max - self.min).as_vec3();
        let area = d.x * d.y + d.y * d.z + d.z * d.x;
        // Lines and points keep a little, so that they are still told apart.
        self.strength * angles * (area + 1e-3 * d.length_squared())
    }
}

/// The smallest cone around two cones, each by its axis and the cosine of its half angle.
fn cone_around((a, cos_a): (Vec3, f32), (b, cos_b): (Vec3, f32)) -> (Vec3, f32) {
    let (angle_a, angle_b) = (cos_a.clamp(-1.0, 1.0).acos(), cos_b.clamp(-1.0, 1.0).acos());
    let between = a.dot(b).clamp(-1.0, 1.0).acos();
    if (between + angle_b).min(PI) <= angle_a {
        return (a, cos_a);
    }
    if (between + angle_a).min(PI) <= angle_b {
        return (b, cos_b);
    }
    let half = 0.5 * (angle_a + between + angle_b);
    let Some(turned) = a.cross(b).try_normalize().filter(|_| half < PI) else { return (a, -1.0) };
    let angle = half - angle_a;
    let across = turned.cross(a);
    ((a * angle.cos() + across * angle.sin()).normalize(), half.cos())
}

/// A point that is to be lit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    pub(crate) point: DVec3,
    /// Unit, on the side that is seen.
    pub(crate) normal: Vec3,
    /// The least cosine that any direction is taken to have: 0 where what lies below the horizon gives nothing for
    /// certain.
    pub(crate) least_cos: f32,
}

#[derive(Clone, Debug)]
struct Node {
    center: DVec3,
    radius2: f32,
    strength: f32,
    axis: Vec3,
    facing: [f32; 2],
    cos_shining: f32,
    both_sides: bool,
    /// Of two children the second (the first is the next node); 0: a leaf.
    second: u32,
    /// Of a leaf: which light.
    light: u32,
}

impl Node {
    fn new(b: &LightBounds) -> Self {
        let cos = b.cos_facing.clamp(-1.0, 1.0);
        Self {
            center: b.center(),
            radius2: (0.25 * (b.max - b.min).length_squared()) as f32,
            strength: b.strength,
            axis: b.axis,
            facing: [(1.0 - cos * cos).max(0.0).sqrt(), cos],
            cos_shining: b.cos_shining,
            both_sides: b.both_sides,
            second: 0,
            light: 0,
        }
    }

    /// About the irradiance at a point: 0 only where it is 0 for certain.
    #[inline]
    fn importance(&self, to: &Receiver) -> f32 {
        let way = (self.center - to.point).as_vec3();
        let d2 = way.length_squared();
        // The angle under which the lights are seen.
        let (sin_seen, cos_seen) = if d2 > self.radius2 {
            ((self.radius2 / d2).sqrt(), (1.0 - self.radius2 / d2).sqrt())
        } else {
            (0.0, -1.0)
        };
        let direction = way / d2.sqrt().max(f32::MIN_POSITIVE);
        let mut cos = -self.axis.dot(direction);
        if self.both_sides {
            cos = cos.abs();
        }
        let (sin_off, cos_off) = less([sine(cos), cos], self.facing);
        let (_, cos_off) = less([sin_off, cos_off], [sin_seen, cos_seen]);
        if !(cos_off > self.cos_shining) {
            return 0.0;
        }
        let cos = to.normal.dot(direction);
        let (_, cos_in) = less([sine(cos), cos], [sin_seen, cos_seen]);
        // A point light's bounds have no size: what is right at it gets all there is.
        self.strength * cos_off.max(0.05) * cos_in.max(to.least_cos) / d2.max(self.radius2).max(1e-20)
    }
}

fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

/// Sine and cosine of max(a - b, 0) for angles from 0 to pi.
fn less([sin_a, cos_a]: [f32; 2], [sin_b, cos_b]: [f32; 2]) -> (f32, f32) {
    if cos_a > cos_b {
        return (0.0, 1.0);
    }
    (sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b)
}

/// Lights with a place, by place.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightTree {
    nodes: Vec<Node>,
    /// For each light the way to its leaf: one bit a level from the lowest, 1 for the second child; 64: not in the
    /// tree, since it gives nothing.
    ways: Vec<(u64, u8)>,
}

/// A way in the tree has a bit for each level.
const MOST_LEVELS: u8 = 63;

impl LightTree {
    pub(crate) fn new(lights: &[LightBounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), ways: vec![(0, 64); lights.len()] };
        let mut order: Vec<u32> = (0..lights.len() as u32).filter(|i| lights[*i as usize].strength > 0.0).collect();
        if !order.is_empty() {
            tree.nodes.reserve(2 * order.len());
            tree.build(lights, &mut order, 0, 0);
        }
        tree
    }

    fn build(&mut self, lights: &[LightBounds], order: &mut [u32], way: u64, level: u8) {
        if let [light] = order {
            self.nodes.push(Node { light: *light, ..Node::new(&lights[*light as usize]) });
            self.ways[*light as usize] = (way, level);
            return;
        }
        let all = order.iter().map(|i| lights[*i as usize]).reduce(LightBounds::and);
        let Some(all) = all else { return };
        let here = self.nodes.len();
        self.nodes.push(Node::new(&all));
        // Halving needs at most 32 levels more.
        let cut = if level < MOST_LEVELS - 33 { cheapest_cut(lights, order, &all) } else { None };
        let cut = cut.unwrap_or_else(|| halve(lights, order, &all));
        let (first, second) = order.split_at_mut(cut);
        self.build(lights, first, way, level + 1);
        self.nodes[here].second = self.nodes.len() as u32;
        self.build(lights, second, way | 1 << level, level + 1);
    }

    /// Whether there is at most one light.
    #[inline]
    pub(crate) fn is_single(&self) -> bool {
        self.nodes.len() <= 1
    }

    /// About the irradiance that all lights give to a point.
    #[inline]
    pub(crate) fn total(&self, to: &Receiver) -> f32 {
        match self.nodes.first() {
            None => 0.0,
            Some(root) if root.second == 0 => root.importance(to),
            Some(root) => self.nodes[1].importance(to) + self.nodes[root.second as usize].importance(to),
        }
    }

    /// Chooses a light for a point, and says with which probability; `None`: no light gives anything.
    #[inline]
    pub(crate) fn sample(&self, to: &Receiver, mut u: f32) -> Option<(usize, f32)> {
        let (mut at, mut probability) = (0, 1.0);
        loop {
            let node = self.nodes.get(at)?;
            if node.second == 0 {
                return (node.strength > 0.0).then_some((node.light as usize, probability));
            }
            let (first, second) = (at + 1, node.second as usize);
            let a = self.nodes[first].importance(to);
            let b = self.nodes[second].importance(to);
            let share = a / (a + b);
            if !share.is_finite() {
                return None;
            }
            if u < share {
                (at, u) = (first, u / share);
                probability *= share;
            } else {
                (at, u) = (second, ((u - share) / (1.0 - share)).min(1.0 - f32::EPSILON / 2.0));
                probability *= 1.0 - share;
            }
        }
    }

    /// The probability with which [`LightTree::sample`] chooses a light.
    #[inline]
    pub(crate) fn probability(&self, light: usize, to: &Receiver) -> f32 {
        let (mut way, levels) = self.ways[light];
        if levels > MOST_LEVELS {
            return 0.0;
        }
        let (mut at, mut probability) = (0, 1.0);
        for _ in 0..levels {
            let (first, second) = (at + 1, self.nodes[at].second as usize);
            let a = self.nodes[first].importance(to);
            let b = self.nodes[second].importance(to);
            let share = a / (a + b);
            if !share.is_finite() {
                return 0.0;
            }
            if way & 1 == 0 {
                at = first;
                probability *= share;
            } else {
                at = second;
                probability *= 1.0 - share;
            }
            way >>= 1;
        }
        probability
    }
}

/// Where to cut so that the children cost least, by bins along each axis; `None` where all are at one place. Sorts
/// `order` by the cut.
fn cheapest_cut(lights: &[LightBounds], order: &mut [u32], all: &LightBounds) -> Option<usize> {
    const BINS: usize = 12;
    let centers = || order.iter().map(|i| lights[*i as usize].center());
    let low = centers().fold(DVec3::INFINITY, DVec3::min);
    let high = centers().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = high - low;
    let bin_of = |axis: usize, light: &LightBounds| {
        let x = (light.center()[axis] - low[axis]) / size[axis];
        ((x * BINS as f64) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        if !(size[axis] > 0.0) {
            continue;
        }
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        for i in order.iter() {
            let light = lights[*i as usize];
            let bin = &mut bins[bin_of(axis, &light)];
            *bin = Some(bin.map_or(light, |b| b.and(light)));
        }
        let mut after = [0.0; BINS];
        let mut sum: Option<LightBounds> = None;
        for k in (1..BINS).rev() {
            sum = match (sum, bins[k]) {
                (Some(a), Some(b)) => Some(a.and(b)),
                (a, b) => a.or(b),
            };
            after[k] = sum.map_or(0.0, |s| s.cost());
        }
        // Thin boxes are cut along their length rather than across.
        let longest = size.max_element() / size[axis];
        let mut sum: Option<LightBounds> = None;
        for k in 0..BINS - 1 {
            sum = match (sum, bins[k]) {
                (Some(a), Some(b)) => Some(a.and(b)),
                (a, b) => a.or(b),
            };
            let empty = sum.is_none() || bins[k + 1..].iter().all(Option::is_none);
            let cost = longest as f32 * (sum.map_or(0.0, |s| s.cost()) + after[k + 1]);
            if !empty && cost.is_finite() && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, k));
            }
        }
    }
    let (_, axis, last) = best?;
    order.sort_by_key(|i| bin_of(axis, &lights[*i as usize]) > last);
    let cut = order.partition_point(|i| bin_of(axis, &lights[*i as usize]) <= last);
    debug_assert!(cut > 0 && cut < order.len() && all.strength > 0.0);
    Some(cut)
}

/// Cuts in the middle along the longest side.
fn halve(lights: &[LightBounds], order: &mut [u32], all: &LightBounds) -> usize {
    let size = all.max - all.min;
    let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(0);
    let middle = order.len() / 2;
    let place = |i: &u32| lights[*i as usize].center()[axis];
    order.select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
    middle
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(at: DVec3, strength: f32) -> LightBounds {
        LightBounds { min: at, max: at, strength, axis: Vec3::Z, cos_facing: -1.0, cos_shining: 0.0, both_sides: false }
    }

    fn tile(at: DVec3, axis: Vec3) -> LightBounds {
        let half = DVec3::splat(0.1);
        LightBounds { min: at - half, max: at + half, axis, cos_facing: 1.0, ..lamp(at, 1.0) }
    }

    /// Some hundred lights here and there, facing all ways.
    fn lights() -> Vec<LightBounds> {
        let fraction = |i: u32, by: f64| (f64::from(i) * by).fract() * 10.0 - 5.0;
        (0..300)
            .map(|i| {
                let at = DVec3::new(fraction(i, 0.618_034), fraction(i, 0.754_878), fraction(i, 0.569_84));
                let axis = Vec3::new(fraction(i, 0.3) as f32, fraction(i, 0.7) as f32, 1.0).normalize();
                if i % 7 == 0 { lamp(at, 0.5) } else { tile(at, axis) }
            })
            .collect()
    }

    fn receivers() -> [Receiver; 3] {
        let at = |x, y, z| Receiver { point: DVec3::new(x, y, z), normal: Vec3::Y, least_cos: 0.0 };
        [at(0.0, 0.0, 0.0), at(3.0, -8.0, 1.0), Receiver { least_cos: 0.1, ..at(-4.0, 20.0, 2.0) }]
    }

    #[test]
    fn probabilities_are_those_of_sampling() {
        let lights = lights();
        let tree = LightTree::new(&lights);
        for to in receivers() {
            let sum: f32 = (0..lights.len()).map(|i| tree.probability(i, &to)).sum();
            let n = 20_000;
            let mut counts = vec![0; lights.len()];
            let mut none = 0;
            for k in 0..n {
                // A way may end where all that is left turns out to give nothing.
                let Some((light, p)) = tree.sample(&to, (k as f32 + 0.5) / n as f32) else {
                    none += 1;
                    continue;
                };
                counts[light] += 1;
                assert!((p - tree.probability(light, &to)).abs() <= 1e-5 * p);
            }
            assert!((sum + none as f32 / n as f32 - 1.0).abs() < 1e-2, "{sum}, {none}");
            for (i, count) in counts.iter().enumerate() {
                let expected = tree.probability(i, &to) * n as f32;
                assert!((*count as f32 - expected).abs() < 40.0 + 0.1 * expected, "{i}: {count} against {expected}");
            }
        }
    }

    #[test]
    fn what_gives_light_is_never_out_of_reach() {
        let lights = lights();
        let tree = LightTree::new(&lights);
        for to in receivers() {
            for (i, light) in lights.iter().enumerate() {
                let way = (light.center() - to.point).as_vec3().normalize();
                let shines = light.cos_facing < 0.0 || -way.dot(light.axis) > 0.01;
                if shines && way.dot(to.normal) > 0.01 {
                    assert!(tree.probability(i, &to) > 0.0, "{i}");
                }
            }
        }
    }

    #[test]
    fn near_lights_are_preferred_to_far_ones() {
        let lights: Vec<_> = (0..100).map(|i| lamp(DVec3::new(f64::from(i), 1.0, 0.0), 1.0)).collect();
        let tree = LightTree::new(&lights);
        let to = Receiver { point: DVec3::new(50.0, 0.0, 0.0), normal: Vec3::Y, least_cos: 0.0 };
        assert!(tree.probability(50, &to) > 20.0 * tree.probability(90, &to));
    }

    #[test]
    fn lights_at_one_place_or_of_no_strength_are_no_trouble() {
        let mut lights = vec![lamp(DVec3::ONE, 1.0); 100];
        lights.push(lamp(DVec3::ZERO, 0.0));
        let tree = LightTree::new(&lights);
        let to = receivers()[0];
        assert_eq!(tree.probability(100, &to), 0.0);
        assert!((tree.probability(7, &to) - 0.01).abs() < 1e-3);
        assert!(LightTree::new(&lights[100..]).sample(&to, 0.5).is_none());
        assert_eq!(LightTree::new(&[]).total(&to), 0.0);
    }
}
