//! Which light to ask: one for each point, in proportion to about how much each gives there.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};

use super::area::AreaLights;
use super::environment::{Environment, luminance};
use super::punctual::PunctualLight;
use super::tree::{LightBounds, LightTree, Receiver};

/// A light that was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chosen {
    /// One of the lights without extent.
    Punctual(usize),
    /// One of the glowing shapes.
    Shape(usize),
    /// One of the glowing triangles.
    Triangle(usize),
    /// The surroundings.
    Environment,
}

/// The probabilities with which a point asks the kinds of light.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shares {
    pub(crate) environment: f32,
    distant: f32,
    tree: f32,
}

/// Chooses among all lights of a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightChoice {
    tree: LightTree,
    /// Indices of punctual lights that are in the tree: its first lights.
    placed: Vec<u32>,
    /// How many glowing shapes come next; the triangles follow.
    shapes: usize,
    /// Indices of punctual lights that have no place.
    distant: Vec<u32>,
    /// About the irradiance from around; 0: it is not to be asked.
    environment: f32,
    /// In even light, which paths find without asking, and where they can find all lights too: the noise (radiance x
    /// irradiance) that a unit of the lights' irradiance would leave to paths alone, over that which the even light leaves
    /// to them. 0: lights are always asked.
    contrast: f32,
}

/// No kind of light that gives anything is asked less often than this: what stands in the way is not known.
const LEAST_SHARE: f32 = 0.1;

impl LightChoice {
    /// A light at the camera counts only `with_headlight`: it is there for want of other light. `followed`: paths go on
    /// from surface to surface, so that they may meet all that has an extent.
    pub(crate) fn new(
        punctual: &[PunctualLight],
        area: &AreaLights,
        environment: Option<&Environment>,
        with_headlight: bool,
        followed: bool,
    ) -> Self {
        let mut choice = Self { shapes: area.shapes.len(), ..Self::default() };
        let mut bounds: Vec<LightBounds> = Vec::new();
        for (i, light) in punctual.iter().enumerate() {
            match light.bounds() {
                _ if matches!(light, PunctualLight::Headlight { .. }) && !with_headlight => {}
                Some(b) => {
                    choice.placed.push(i as u32);
                    bounds.push(b);
                }
                None => choice.distant.push(i as u32),
            }
        }
        area.bounds(&mut bounds);
        choice.tree = LightTree::new(&bounds);
        // A constant one is found by following surfaces at least as well.
        choice.environment =
            environment.filter(|e| !e.is_constant()).map_or(0.0, |e| PI * luminance(e.mean_radiance()));
        if punctual.is_empty()
            && let Some(even) = environment.filter(|e| followed && e.is_constant())
        {
            // Chance finds light with a variance of about radiance x irradiance.
            let radiance = luminance(even.mean_radiance());
            let contrast = area.brightest() / (PI * radiance * radiance);
            choice.contrast = if contrast.is_finite() { contrast } else { 0.0 };
        }
        choice
    }

    /// About the irradiance of a light without a place.
    fn of_distant(light: &PunctualLight, to: &Receiver) -> f32 {
        let Some((direction, irradiance, spread)) = light.afar(to.point) else { return 0.0 };
        irradiance * (direction.dot(to.normal) + spread).clamp(to.least_cos, 1.0)
    }

    /// Whether a light without extent is asked at all.
    pub(crate) fn asks(&self, punctual: usize) -> bool {
        self.placed.iter().chain(&self.distant).any(|i| *i as usize == punctual)
    }

    /// Whether there is nothing to choose: it is always the same light.
    #[inline]
    pub(crate) fn is_single(&self) -> bool {
        self.distant.is_empty() && self.environment == 0.0 && self.contrast == 0.0 && self.tree.is_single()
    }

    /// How a point divides its questions.
    #[inline]
    pub(crate) fn shares(&self, punctual: &[PunctualLight], to: &Receiver) -> Shares {
        // Where there is but one kind, nothing is to be divided.
        if self.distant.is_empty() && self.environment == 0.0 {
            return Shares { tree: self.share_beside_even_light(to), ..Shares::default() };
        }
        let distant: f32 = self.distant.iter().map(|i| Self::of_distant(&punctual[*i as usize], to)).sum();
        let tree = self.tree.total(to);
        let near = distant + tree;
        let environment = match (self.environment > 0.0, near > 0.0) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => (self.environment / (self.environment + near)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
        };
        if !(near > 0.0) {
            return Shares { environment, ..Shares::default() };
        }
        let of_distant = match (distant > 0.0, tree > 0.0) {
            (true, true) => (distant / near).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
            (there, _) => f32::from(u8::from(there)),
        };
        let rest = 1.0 - environment;
        Shares { environment, distant: rest * of_distant, tree: rest * (1.0 - of_distant) }
    }

    /// How often lights are asked at all: beside even light only in proportion to the noise that they would leave to
    /// paths, where it is less.
    #[inline]
    fn share_beside_even_light(&self, to: &Receiver) -> f32 {
        if self.contrast > 0.0 { (self.contrast * self.tree.total(to)).clamp(LEAST_SHARE, 1.0) } else { 1.0 }
    }

    /// Chooses a light, and says with which probability. `None`: none is asked this time.
    #[inline]
    pub(crate) fn sample(
        &self,
        punctual: &[PunctualLight],
        shares: &Shares,
        to: &Receiver,
        u: f32,
    ) -> Option<(Chosen, f32)> {
        if u < shares.environment {
            return Some((Chosen::Environment, shares.environment));
        }
        let u = u - shares.environment;
        if u < shares.distant {
            return self.sample_distant(punctual, shares, to, u / shares.distant);
        }
        let u = (u - shares.distant) / shares.tree;
        if !(shares.tree > 0.0) || (self.contrast > 0.0 && u >= 1.0) {
            return None;
        }
        let u = u.clamp(0.0, 1.0 - f32::EPSILON / 2.0);
        let (i, p) = self.tree.sample(to, u)?;
        let p = p * shares.tree;
        Some(if let Some(light) = self.placed.get(i) {
            (Chosen::Punctual(*light as usize), p)
        } else if i < self.placed.len() + self.shapes {
            (Chosen::Shape(i - self.placed.len()), p)
        } else {
            (Chosen::Triangle(i - self.placed.len() - self.shapes), p)
        })
    }

    fn sample_distant(
        &self,
        punctual: &[PunctualLight],
        shares: &Shares,
        to: &Receiver,
        u: f32,
    ) -> Option<(Chosen, f32)> {
        let weight = |i: &u32| Self::of_distant(&punctual[*i as usize], to);
        let total: f32 = self.distant.iter().map(weight).sum();
        let mut left = u * total;
        let mut chosen = None;
        for i in &self.distant {
            let w = weight(i);
            if w > 0.0 {
                chosen = Some((Chosen::Punctual(*i as usize), shares.distant * w / total));
                left -= w;
                if left < 0.0 {
                    break;
                }
            }
        }
        chosen
    }

    /// The probability with which a point asks this glowing shape or triangle.
    #[inline]
    pub(crate) fn probability(&self, chosen: Chosen, shares: &Shares, to: &Receiver) -> f32 {
        let in_tree = match chosen {
            Chosen::Shape(i) => self.placed.len() + i,
            Chosen::Triangle(i) => self.placed.len() + self.shapes + i,
            Chosen::Environment => return shares.environment,
            // It has no extent, and nothing meets it by chance.
            Chosen::Punctual(_) => return 0.0,
        };
        if shares.tree > 0.0 { shares.tree * self.tree.probability(in_tree, to) } else { 0.0 }
    }
}

/// The box around some points.
pub(super) fn around(points: &[DVec3]) -> (DVec3, DVec3) {
    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
}

/// A light that shines evenly from a flat surface.
pub(super) fn flat(corners: &[DVec3], normal: Vec3, strength: f32, both_sides: bool) -> LightBounds {
    let (min, max) = around(corners);
    LightBounds { min, max, strength, axis: normal, cos_facing: 1.0, cos_shining: 0.0, both_sides }
}
