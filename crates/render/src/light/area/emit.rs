//! Glowing surfaces as the places where light starts.

use std::f64::consts::PI;

use firsthit_accel::{Hit, SurfacePoint};
use glam::Vec3;

use super::{AreaLights, Form};
use crate::light::choice::Chosen;
use crate::light::environment::luminance;
use crate::warp;

/// A point of a glowing surface, chosen evenly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glowing {
    /// Where it is; its normal is on the outer side.
    pub(crate) point: SurfacePoint,
    /// Of all of the light: 1 over the density of the point.
    pub(crate) area: f64,
    /// Whether it shines to the back as well.
    pub(crate) both_sides: bool,
    pub(crate) shines: Shines,
}

/// What comes from a glowing point.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shines {
    /// The same radiance in all directions.
    Evenly(Vec3),
    /// What the material there says.
    ByMaterial(Hit),
}

/// By how much a ball of the scene may differ from the shape that is meant, as a share of its radius.
const BALL_ERROR: f64 = 2e-6;

impl AreaLights {
    /// About the light that each of them sends in all directions: shapes, then triangles.
    pub(crate) fn powers(&self, powers: &mut Vec<f32>) {
        let pi = std::f32::consts::PI;
        powers.extend(self.shapes.iter().map(|s| pi * luminance(s.radiance) * s.form.area() as f32));
        let Some(mesh) = &self.mesh else { return };
        powers.extend(mesh.triangles.iter().enumerate().map(|(i, t)| {
            let sides = if t.both_sides { 2.0 } else { 1.0 };
            pi * sides * mesh.table.probability(i) * mesh.strength
        }));
    }

    /// A point of one of them. `exact`: rays are tested in more than f32.
    pub(crate) fn point_of(&self, light: Chosen, u: [f32; 2], exact: bool) -> Option<Glowing> {
        match light {
            Chosen::Shape(i) => {
                let shape = self.shapes.get(i)?;
                let (position, normal) = match &shape.form {
                    Form::Rectangle { corner, u: edge_u, v: edge_v, normal, .. } => {
                        (*corner + *edge_u * f64::from(u[0]) + *edge_v * f64::from(u[1]), *normal)
                    }
                    Form::Sphere(ball) => {
                        let normal = warp::sphere(u).as_dvec3().normalize();
                        (ball.center() + normal * ball.radius(), normal)
                    }
                };
                let error = match (&shape.form, shape.id) {
                    (Form::Sphere(ball), Some(_)) => BALL_ERROR * ball.radius(),
                    // It is not among what rays meet.
                    _ => 0.0,
                };
                Some(Glowing {
                    point: SurfacePoint { position, normal, error },
                    area: shape.form.area(),
                    both_sides: false,
                    shines: Shines::Evenly(shape.radiance),
                })
            }
            Chosen::Triangle(i) => {
                let triangle = self.mesh.as_ref()?.triangles.get(i)?;
                let [a, b, c] = if triangle.doubled { [1.0 - u[0] - u[1], u[0], u[1]] } else { warp::triangle(u) };
                let [p, q, r] = triangle.corners;
                let position = p * f64::from(a) + q * f64::from(b) + r * f64::from(c);
                // As roundings grow with the coordinates, and with how thin it is.
                let longest = (q - p).length().max((r - q).length()).max((p - r).length());
                let share = if exact { 1e-13 } else { 1e-6 };
                let error = share * (position.abs().max_element() + longest * longest * longest / triangle.area);
                let normal = triangle.normal;
                let hit = Hit { id: triangle.id, t: 0.0, u: b, v: c, normal_direction: normal };
                Some(Glowing {
                    point: SurfacePoint { position, normal, error },
                    area: triangle.area,
                    both_sides: triangle.both_sides,
                    shines: Shines::ByMaterial(hit),
                })
            }
            Chosen::Punctual(_) | Chosen::Environment => None,
        }
    }
}

impl Form {
    fn area(&self) -> f64 {
        match self {
            Self::Rectangle { area, .. } => *area,
            Self::Sphere(ball) => 4.0 * PI * ball.radius() * ball.radius(),
        }
    }
}
