//! Glowing surfaces, sampled as lights.

mod emit;

use std::collections::HashMap;
use std::f64::consts::PI;

use firsthit_accel::{Hit, HitId};
use firsthit_geometry::{Primitive, Ray, Shape, shapes::Sphere};
use firsthit_import::scene::{LightKind, SurfaceDesc};
use glam::{DVec3, Vec3};

use super::choice::{Chosen, around, flat};
use super::environment::luminance;
use super::tree::LightBounds;
use super::{LightEnd, LightSample};
use crate::distribution::Distribution1D;
use crate::surface::World;
use crate::{EffectSet, tally, warp};

pub(crate) use emit::Shines;

/// A glowing rectangle or ball.
#[derive(Clone, Debug)]
pub(crate) struct ShapeLight {
    form: Form,
    pub(crate) radiance: Vec3,
    /// The primitive of the scene that it is; `None`: a light of its own, met by rays beside the scene's trees.
    pub(crate) id: Option<HitId>,
}

#[derive(Clone, Debug)]
enum Form {
    Rectangle { corner: DVec3, u: DVec3, v: DVec3, normal: DVec3, area: f64 },
    Sphere(Sphere<f64>),
}

impl ShapeLight {
    /// `None` for other lights, and for those that no light comes from.
    pub(crate) fn new(kind: &LightKind) -> Option<Self> {
        let (form, radiance) = match *kind {
            LightKind::Rectangle { corner, edge_u, edge_v, radiance } => {
                let normal = edge_u.cross(edge_v);
                let area = normal.length();
                let normal = normal.try_normalize()?;
                (Form::Rectangle { corner, u: edge_u, v: edge_v, normal, area }, radiance)
            }
            LightKind::Sphere { center, radius, radiance } => {
                (Form::Sphere(Sphere::new(center, radius).ok()?), radiance)
            }
            _ => return None,
        };
        (radiance.max_element() > 0.0).then_some(Self { form, radiance, id: None })
    }

    /// A ball that is a shape of the scene, if the instance leaves it one.
    fn of_scene(world: &World, id: HitId, shape: &Shape<f64>, radiance: Vec3) -> Option<Self> {
        let Shape::Sphere(sphere) = shape else { return None };
        let m = world.instances[id.instance as usize].transform;
        let lengths = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(DVec3::length);
        let right_angles = m.matrix3.x_axis.dot(m.matrix3.y_axis).abs()
            + m.matrix3.y_axis.dot(m.matrix3.z_axis).abs()
            + m.matrix3.z_axis.dot(m.matrix3.x_axis).abs();
        let even = lengths.iter().all(|l| (l / lengths[0] - 1.0).abs() < 1e-6);
        if !even || right_angles > 1e-6 * lengths[0] * lengths[0] {
            return None;
        }
        let ball = Sphere::new(m.transform_point3(sphere.center()), sphere.radius() * lengths[0]).ok()?;
        Some(Self { form: Form::Sphere(ball), radiance, id: Some(id) })
    }

    /// Where a ray meets its glowing side; from behind a rectangle is not there.
    fn hit(&self, ray: &Ray<f64>) -> Option<f64> {
        match &self.form {
            Form::Rectangle { corner, u, v, normal, .. } => {
                let facing = normal.dot(ray.direction);
                let t = normal.dot(*corner - ray.origin) / facing;
                let p = ray.at(t) - *corner;
                // Coordinates along edges that need not be at right angles.
                let (across, along) = (p.cross(*v).dot(*normal), u.cross(p).dot(*normal));
                let area = u.cross(*v).dot(*normal);
                let inside = across >= 0.0 && across <= area && along >= 0.0 && along <= area;
                (facing < 0.0 && inside && ray.contains(t)).then_some(t)
            }
            Form::Sphere(sphere) => {
                let hit = sphere.closest_hit(ray)?;
                (hit.normal?.dot(ray.direction) < 0.0).then_some(hit.t)
            }
        }
    }

    /// Density of [`ShapeLight::sample`] over solid angle for a direction from `from` that meets the light at
    /// `distance`.
    pub(crate) fn pdf(&self, from: DVec3, direction: DVec3, distance: f64) -> f32 {
        match &self.form {
            Form::Rectangle { normal, area, .. } => {
                (distance * distance / (area * -normal.dot(direction)).max(f64::MIN_POSITIVE)) as f32
            }
            Form::Sphere(sphere) => match one_minus_cos_of_ball(sphere, from) {
                // Only the near side is asked: the far one may be seen through alpha.
                Some(x) if distance * distance <= (sphere.center() - from).length_squared() => {
                    (1.0 / (2.0 * PI * x)) as f32
                }
                _ => 0.0,
            },
        }
    }

    /// A direction from `from` to the light.
    pub(crate) fn sample(&self, from: DVec3, u: [f32; 2]) -> Option<LightSample> {
        tally::sample(EffectSet::AREA_LIGHTS);
        match &self.form {
            Form::Rectangle { corner, u: edge_u, v: edge_v, normal, area } => {
                let at = *corner + *edge_u * f64::from(u[0]) + *edge_v * f64::from(u[1]);
                from_surface(from, at, *normal, *area, self.radiance, false, self.id)
            }
            Form::Sphere(sphere) => {
                let x = one_minus_cos_of_ball(sphere, from)?;
                let to = sphere.center() - from;
                let axis = to.normalize().as_vec3();
                let (tx, ty) = warp::frame(axis);
                let w = warp::cone(u, x as f32);
                let direction = tx * w.x + ty * w.y + axis * w.z;
                // Directions at the rim may miss the ball by a rounding: they end at its middle's distance.
                let d = direction.as_dvec3();
                let t = sphere.closest_hit(&Ray::new(from, d)).map_or(to.dot(d), |h| h.t);
                Some(LightSample {
                    direction,
                    radiance: self.radiance * (2.0 * PI * x) as f32,
                    pdf: Some((1.0 / (2.0 * PI * x)) as f32),
                    end: LightEnd::At(from + d * t),
                    target: self.id,
                })
            }
        }
    }
}

impl ShapeLight {
    /// Where it is and shines.
    fn bounds(&self) -> LightBounds {
        let radiance = luminance(self.radiance);
        match &self.form {
            Form::Rectangle { corner, u, v, normal, area } => {
                let corners = [*corner, *corner + *u, *corner + *v, *corner + *u + *v];
                flat(&corners, normal.as_vec3(), radiance * *area as f32, false)
            }
            Form::Sphere(ball) => {
                let (min, max) = around(&[ball.center() - ball.radius(), ball.center() + ball.radius()]);
                // Its disk as it is seen from anywhere.
                let area = PI * ball.radius() * ball.radius();
                let strength = radiance * area as f32;
                LightBounds { min, max, strength, axis: Vec3::Z, cos_facing: -1.0, cos_shining: 0.0, both_sides: false }
            }
        }
    }
}

/// 1 - cos of the half angle under which a ball is seen; `None` from inside.
fn one_minus_cos_of_ball(sphere: &Sphere<f64>, from: DVec3) -> Option<f64> {
    let sin2 = sphere.radius() * sphere.radius() / (sphere.center() - from).length_squared();
    // sin^2 / (1 + cos): exact for small angles, where 1 - cos is not.
    (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
}

/// The sample for a point that was chosen evenly on a flat light.
fn from_surface(
    from: DVec3,
    at: DVec3,
    normal: DVec3,
    area: f64,
    radiance: Vec3,
    both_sides: bool,
    target: Option<HitId>,
) -> Option<LightSample> {
    let to = at - from;
    let distance2 = to.length_squared();
    let direction = to / distance2.sqrt();
    let cos = -normal.dot(direction);
    let cos = if both_sides { cos.abs() } else { cos };
    let pdf = distance2 / (area * cos);
    if !(cos > 0.0 && pdf > 0.0 && pdf.is_finite()) {
        return None;
    }
    Some(LightSample {
        direction: direction.as_vec3(),
        radiance: radiance / pdf as f32,
        pdf: Some(pdf as f32),
        end: LightEnd::At(at),
        target,
    })
}

/// A triangle of a glowing mesh, in the world; or two that are a parallelogram and glow evenly.
#[derive(Clone, Debug)]
struct GlowingTriangle {
    /// Its own id, or that of the first.
    id: HitId,
    corners: [DVec3; 3],
    normal: DVec3,
    /// Of all of it.
    area: f64,
    both_sides: bool,
    /// It is a parallelogram: the first corner and the others span it.
    doubled: bool,
    /// What comes from it, if that is the same everywhere.
    radiance: Option<Vec3>,
}

impl GlowingTriangle {
    /// The corner across from the first of a parallelogram.
    fn fourth(&self) -> DVec3 {
        self.corners[1] + self.corners[2] - self.corners[0]
    }

    /// This and another as one, if they are the halves of a parallelogram.
    fn doubled(&self, other: &Self) -> Option<Self> {
        let size = (self.corners[1] - self.corners[0]).abs() + (self.corners[2] - self.corners[0]).abs();
        let same = |a: DVec3, b: DVec3| (a - b).abs().max_element() <= 1e-6 * size.max_element();
        // Turned so that the first corner is the one that the other triangle lacks.
        let turned = (0..3).map(|k| [0, 1, 2].map(|i| self.corners[(i + k) % 3])).find(|corners| {
            let fourth = corners[1] + corners[2] - corners[0];
            [fourth, corners[1], corners[2]].iter().all(|p| other.corners.iter().any(|q| same(*p, *q)))
        })?;
        let facing = self.normal.dot(other.normal) > 0.999;
        facing.then(|| Self { corners: turned, area: 2.0 * self.area, doubled: true, ..self.clone() })
    }
}

/// All glowing triangles, chosen in proportion to the light they give.
#[derive(Clone, Debug)]
pub(crate) struct MeshLight {
    triangles: Vec<GlowingTriangle>,
    table: Distribution1D,
    /// The light of all of them: luminance times area.
    strength: f32,
    /// Which of them each triangle of a glowing mesh is, or is part of.
    parts: Vec<u32>,
    /// Where among the parts the triangles of each (instance, geometry) begin.
    first: HashMap<(u32, u32), usize>,
}

impl MeshLight {
    /// A point on a glowing triangle as seen from `from`: radiance 1 is returned with the hit, for the caller to
    /// multiply with what the material there says. A triangle does not light itself.
    pub(crate) fn sample(&self, from: DVec3, choice: f32, u: [f32; 2], receiver: HitId) -> Option<(LightSample, Hit)> {
        let (i, _) = self.table.sample(choice);
        let area = 1.0 / f64::from(self.table.probability(i));
        self.sample_triangle(i, area, from, u, receiver)
    }

    /// A point of one triangle as seen from `from`, with the density of a triangle that is `factor` times as large:
    /// 1 over the probability of choosing it.
    pub(crate) fn sample_triangle(
        &self,
        i: usize,
        factor: f64,
        from: DVec3,
        u: [f32; 2],
        receiver: HitId,
    ) -> Option<(LightSample, Hit)> {
        tally::sample(EffectSet::AREA_LIGHTS);
        let triangle = &self.triangles[i];
        if triangle.id == receiver {
            return None;
        }
        let [a, b, c] = if triangle.doubled { [1.0 - u[0] - u[1], u[0], u[1]] } else { warp::triangle(u) };
        let [p, q, r] = triangle.corners;
        let at = p * f64::from(a) + q * f64::from(b) + r * f64::from(c);
        let area = triangle.area * factor;
        let sample = from_surface(from, at, triangle.normal, area, Vec3::ONE, triangle.both_sides, Some(triangle.id))?;
        Some((sample, Hit { id: triangle.id, t: 1.0, u: b, v: c, normal_direction: triangle.normal }))
    }

    /// Density of [`MeshLight::sample`] over solid angle for a direction that meets triangle `id` at `distance`; 0
    /// for what is not in the table.
    pub(crate) fn pdf(&self, id: HitId, direction: DVec3, distance: f64) -> f32 {
        let Some(i) = self.index(id) else { return 0.0 };
        self.table.probability(i) * self.pdf_of_triangle(i, direction, distance)
    }

    /// What comes from a triangle, if that is the same everywhere on it.
    #[inline]
    pub(crate) fn even_radiance(&self, i: usize) -> Option<Vec3> {
        self.triangles[i].radiance
    }

    /// The place of a triangle of the scene among the glowing ones.
    #[inline]
    pub(crate) fn index(&self, id: HitId) -> Option<usize> {
        let first = self.first.get(&(id.instance, id.geometry))?;
        self.parts.get(first + id.primitive as usize).filter(|i| **i != NO_LIGHT).map(|i| *i as usize)
    }

    /// Density over solid angle of a point that is chosen evenly on a triangle.
    #[inline]
    pub(crate) fn pdf_of_triangle(&self, i: usize, direction: DVec3, distance: f64) -> f32 {
        let triangle = &self.triangles[i];
        let cos = triangle.normal.dot(direction).abs();
        let pdf = distance * distance / (triangle.area * cos);
        if pdf.is_finite() { pdf as f32 } else { 0.0 }
    }
}

/// In place of a glowing triangle: it is black.
const NO_LIGHT: u32 = u32::MAX;

/// How a geometry glows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glow {
    /// To the back as well.
    pub(crate) both_sides: bool,
    /// The same everywhere: there is no texture.
    pub(crate) even: bool,
    /// Not the same in all directions.
    pub(crate) by_view: bool,
    /// Radiance where it is brightest, if its texture shows nothing beyond white.
    pub(crate) most: f32,
}

/// Glowing surfaces of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct AreaLights {
    pub(crate) shapes: Vec<ShapeLight>,
    pub(crate) mesh: Option<MeshLight>,
    /// Some of the shapes are lights of their own.
    own: bool,
    /// Glowing shapes that cannot be sampled: they are seen, but light nothing but mirrors.
    pub(crate) unsampled: usize,
    /// The most radiance of any.
    brightest: f32,
}

impl AreaLights {
    /// `radiance(id, u, v)` says about how much comes from a point of a glowing geometry; `None` for others. Of triangles
    /// that are `dark` nothing comes for certain: they are not asked.
    pub(crate) fn new(
        lights: impl Iterator<Item = ShapeLight>,
        world: &World,
        glowing: impl Fn(HitId) -> Option<Glow>,
        dark: impl Fn(HitId) -> bool,
        radiance: impl Fn(HitId, f32, f32) -> Vec3,
    ) -> Self {
        let mut area = Self { shapes: lights.collect(), ..Self::default() };
        area.own = !area.shapes.is_empty();
        area.brightest = area.shapes.iter().map(|l| l.radiance.max_element()).fold(0.0, f32::max);
        let (mut triangles, mut weights, mut first) = (Vec::<GlowingTriangle>::new(), Vec::new(), HashMap::new());
        let mut parts = Vec::new();
        for (i, instance) in world.instances.iter().enumerate() {
            for (g, geometry) in world.mesh(instance).geometries.iter().enumerate() {
                let id = HitId { instance: i as u32, geometry: g as u32, primitive: 0 };
                let Some(Glow { both_sides, even, by_view, most }) = glowing(id) else { continue };
                area.brightest = area.brightest.max(most);
                match &geometry.surface {
                    SurfaceDesc::Triangles(mesh) => {
                        first.insert((id.instance, id.geometry), parts.len());
                        let before = triangles.len();
                        for (k, corners) in mesh.triangles.iter().enumerate() {
                            let id = HitId { primitive: k as u32, ..id };
                            if !even && dark(id) {
                                parts.push(NO_LIGHT);
                                continue;
                            }
                            let local = corners.map(|c| mesh.positions[c as usize].as_dvec3());
                            let corners = local.map(|p| instance.transform.transform_point3(p));
                            let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                            let area = 0.5 * cross.length();
                            // A mirrored mesh keeps its outside: glTF 2.0, section 3.7.4.
                            let side = instance.transform.matrix3.determinant().signum();
                            let normal = cross.normalize_or_zero() * side;
                            let light = radiance(id, 1.0 / 3.0, 1.0 / 3.0);
                            let glow = light.max_element();
                            let triangle = GlowingTriangle {
                                id,
                                corners,
                                normal,
                                area,
                                both_sides,
                                doubled: false,
                                radiance: even.then_some(light),
                            };
                            let last = triangles.len().checked_sub(1).filter(|i| *i >= before && even);
                            let last = last.filter(|i| !triangles[*i].doubled);
                            if let Some((i, both)) = last.and_then(|i| Some((i, triangles[i].doubled(&triangle)?))) {
                                parts.push(i as u32);
                                weights[i] += area as f32 * glow;
                                triangles[i] = both;
                                continue;
                            }
                            parts.push(triangles.len() as u32);
                            triangles.push(triangle);
                            weights.push(area as f32 * glow);
                        }
                    }
                    SurfaceDesc::Shape(shape) => match ShapeLight::of_scene(world, id, shape, radiance(id, 0.5, 0.5)) {
                        Some(light) if !by_view => area.shapes.push(light),
                        _ => area.unsampled += 1,
                    },
                }
            }
        }
        // A texture may glow where the estimate sees nothing: every triangle gets a small share.
        let total: f32 = weights.iter().sum();
        let whole: f64 = triangles.iter().map(|t| t.area).sum();
        for (weight, triangle) in weights.iter_mut().zip(&triangles) {
            *weight += 0.05 * total * (triangle.area / whole) as f32;
        }
        let strength = 1.05 * total;
        area.mesh = Distribution1D::new(&weights).map(|table| MeshLight { triangles, table, strength, parts, first });
        area
    }

    /// Where the shapes are and shine, then the triangles, in their order.
    pub(crate) fn bounds(&self, bounds: &mut Vec<LightBounds>) {
        bounds.extend(self.shapes.iter().map(ShapeLight::bounds));
        let Some(mesh) = &self.mesh else { return };
        bounds.extend(mesh.triangles.iter().enumerate().map(|(i, t)| {
            let strength = mesh.table.probability(i) * mesh.strength;
            let [p, q, r] = t.corners;
            let corners = if t.doubled { [p, q, r, t.fourth()] } else { [p, q, r, r] };
            flat(&corners, t.normal.as_vec3(), strength, t.both_sides)
        }));
    }

    /// The nearest light of its own (not part of the scene's trees) in a ray's way.
    pub(crate) fn hit(&self, ray: &Ray<f64>) -> Option<(f64, &ShapeLight)> {
        let own = self.shapes.iter().filter(|l| l.id.is_none());
        let hits = own.filter_map(|l| l.hit(ray).map(|t| (t, l)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// About the radiance of the brightest, by its brightest colour.
    pub(crate) fn brightest(&self) -> f32 {
        self.brightest
    }

    /// Whether there are lights of their own.
    #[inline]
    pub(crate) fn has_own(&self) -> bool {
        self.own
    }

    /// The nearest light of its own in a ray's way, by its place among the shapes.
    pub(crate) fn own_hit(&self, ray: &Ray<f64>) -> Option<(f64, usize)> {
        let own = self.shapes.iter().enumerate().filter(|(_, l)| l.id.is_none());
        let hits = own.filter_map(|(i, l)| l.hit(ray).map(|t| (t, i)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The light that a primitive of the scene is, if it can be asked.
    pub(crate) fn light_of(&self, id: HitId) -> Option<Chosen> {
        match self.shapes.iter().position(|l| l.id == Some(id)) {
            Some(i) => Some(Chosen::Shape(i)),
            None => self.mesh.as_ref().and_then(|m| m.index(id)).map(Chosen::Triangle),
        }
    }

    /// Density over solid angle of the directions to one of the lights, once it is chosen.
    pub(crate) fn density(&self, light: Chosen, from: DVec3, direction: DVec3, distance: f64) -> f32 {
        match light {
            Chosen::Shape(i) => self.shapes[i].pdf(from, direction, distance),
            Chosen::Triangle(i) => self.mesh.as_ref().map_or(0.0, |m| m.pdf_of_triangle(i, direction, distance)),
            Chosen::Punctual(_) | Chosen::Environment => 0.0,
        }
    }

    /// Density with which direct light would have chosen this way to glowing primitive `id` of the scene.
    pub(crate) fn pdf_of_primitive(&self, id: HitId, from: DVec3, direction: DVec3, distance: f64) -> f32 {
        match self.shapes.iter().find(|l| l.id == Some(id)) {
            Some(light) => light.pdf(from, direction, distance),
            None => self.mesh.as_ref().map_or(0.0, |m| m.pdf(id, direction, distance)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle() -> ShapeLight {
        ShapeLight::new(&LightKind::Rectangle {
            corner: DVec3::new(-0.5, 2.0, -0.5),
            edge_u: DVec3::X,
            edge_v: DVec3::Z * 1.5,
            radiance: Vec3::ONE,
        })
        .unwrap()
    }

    fn ball() -> ShapeLight {
        ShapeLight::new(&LightKind::Sphere { center: DVec3::new(1.0, 2.0, 0.5), radius: 0.7, radiance: Vec3::ONE })
            .unwrap()
    }

    /// The mean of 1 / pdf is the solid angle, and samples hit what they are drawn from.
    #[test]
    fn samples_cover_the_solid_angle() {
        let below = DVec3::new(0.3, 0.4, 0.2);
        for (light, from) in [(ball(), DVec3::ZERO), (rectangle(), below)] {
            let n = 400;
            let (mut mean, mut samples) = (0.0, 0);
            for i in 0..n {
                for j in 0..n {
                    let u = [(i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32];
                    let Some(s) = light.sample(from, u) else { continue };
                    let pdf = s.pdf.unwrap();
                    mean += 1.0 / f64::from(pdf) / f64::from(n * n);
                    let d = s.direction.as_dvec3();
                    if let Some(t) = light.hit(&Ray::new(from, d)) {
                        assert!((light.pdf(from, d, t) / pdf - 1.0).abs() < 1e-3);
                        samples += 1;
                    }
                }
            }
            assert!(samples > n * n * 99 / 100);
            let expected = solid_angle(&light, from);
            assert!((mean / expected - 1.0).abs() < 1e-3, "{mean} instead of {expected}");
        }
    }

    /// In closed form: a cap of the sphere, or four right-angled pyramids.
    fn solid_angle(light: &ShapeLight, from: DVec3) -> f64 {
        match &light.form {
            Form::Sphere(ball) => {
                let sin = ball.radius() / (ball.center() - from).length();
                2.0 * PI * (1.0 - sin.asin().cos())
            }
            Form::Rectangle { corner, u, v, .. } => {
                let (c, h) = (*corner - from, (*corner - from).y);
                let pyramid = |a: f64, b: f64| (a * b / (h * (a * a + b * b + h * h).sqrt())).atan();
                let (x0, x1, z0, z1) = (c.x, c.x + u.x, c.z, c.z + v.z);
                pyramid(x1, z1) - pyramid(x0, z1) - pyramid(x1, z0) + pyramid(x0, z0)
            }
        }
    }

    #[test]
    fn a_rectangle_shines_to_one_side_only() {
        let light = rectangle();
        // edge_u x edge_v = X x Z = -Y.
        assert!(light.hit(&Ray::new(DVec3::ZERO, DVec3::Y)).is_some());
        assert!(light.hit(&Ray::new(DVec3::new(0.0, 4.0, 0.0), DVec3::NEG_Y)).is_none());
        assert!(light.sample(DVec3::new(0.0, 4.0, 0.0), [0.5; 2]).is_none());
    }

    #[test]
    fn halves_of_a_parallelogram_are_one_light() {
        let triangle = |corners: [DVec3; 3]| {
            let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let id = HitId { instance: 0, geometry: 0, primitive: 0 };
            let (normal, area) = (cross.normalize(), 0.5 * cross.length());
            GlowingTriangle { id, corners, normal, area, both_sides: false, doubled: false, radiance: None }
        };
        let [a, b, c, d] = [DVec3::ZERO, DVec3::X, DVec3::new(1.3, 1.0, 0.0), DVec3::new(0.3, 1.0, 0.0)];
        for (first, second) in [([a, b, c], [a, c, d]), ([b, c, a], [c, d, a]), ([a, b, d], [b, c, d])] {
            let both = triangle(first).doubled(&triangle(second)).unwrap();
            assert!((both.area - 1.0).abs() < 1e-12);
            let corners = [both.corners[0], both.corners[1], both.corners[2], both.fourth()];
            for p in [a, b, c, d] {
                assert!(corners.iter().any(|q| (p - *q).length() < 1e-12), "{corners:?}");
            }
        }
        assert!(triangle([a, b, c]).doubled(&triangle([a, d, c])).is_none(), "it faces the other way");
        assert!(triangle([a, b, c]).doubled(&triangle([a, c, d + DVec3::Y])).is_none());
    }

    #[test]
    fn there_is_no_light_inside_a_ball() {
        assert!(ball().sample(DVec3::new(1.0, 2.0, 0.4), [0.5; 2]).is_none());
    }
}
