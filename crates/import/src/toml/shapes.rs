//! What objects are: analytic shapes and meshes made here, or models to be read. What stands between two points is
//! made along +Y and placed there.

use firsthit_geometry::shapes::{Cuboid, Disk, Plane, Polygon, Quadric, Solid, Sphere};
use firsthit_geometry::{self as geometry, Aabb};
use glam::{DAffine3, DVec3};

use super::place::between;
use super::schema::{Model, Shape};
use super::values::{Pair, Triple, positive};
use crate::scene::TriangleMesh;
use crate::unit;

/// What an object is.
pub(super) enum Body<'a> {
    /// A file to be read.
    Model(&'a Model),
    /// Triangles.
    Mesh(TriangleMesh),
    /// A shape, and where it stands.
    Shape(Box<geometry::Shape<f64>>, DAffine3),
}

/// Makes what an object is.
pub(super) fn body(s: &Shape) -> Result<Body<'_>, String> {
    let text = |e: geometry::ShapeError| e.to_string();
    let here = |shape: geometry::Shape<f64>| Ok(Body::Shape(shape.into(), DAffine3::IDENTITY));
    match s {
        Shape::Model(model) => Ok(Body::Model(model)),
        Shape::Mesh { positions, triangles, normals, uvs } => Ok(Body::Mesh(mesh(positions, triangles, normals, uvs)?)),
        Shape::Sphere { center, radius } => here(Sphere::new(center.0, radius.0).map_err(text)?.into()),
        Shape::Plane { point, normal, cull_back } => {
            here(Plane::new(point.0, normal.0).map_err(text)?.with_culling(*cull_back).into())
        }
        Shape::Disk { center, normal, radius, inner_radius } => {
            let inner = inner_radius.map_or(0.0, |r| r.0);
            here(Disk::new(center.0, normal.0, radius.0, inner).map_err(text)?.into())
        }
        Shape::Polygon { loops } => {
            let loops = loops.iter().map(|l| l.iter().map(|p| p.0).collect()).collect();
            here(Polygon::new(loops).map_err(text)?.into())
        }
        Shape::Box { min, max } => here(Cuboid::new(min.0, max.0).map_err(text)?.into()),
        Shape::Quadric { coefficients, clip_min, clip_max, caps } => {
            let clip =
                Aabb::new(clip_min.map_or(DVec3::NEG_INFINITY, |p| p.0), clip_max.map_or(DVec3::INFINITY, |p| p.0));
            let surface = Quadric::new(coefficients.map(|c| c.0)).and_then(|q| q.with_clip(clip)).map_err(text)?;
            here(closed_if(*caps, surface))
        }
        Shape::Ellipsoid { center, radii } => {
            let surface = Quadric::ellipsoid(radii.0).map_err(text)?;
            Ok(Body::Shape(Box::new(surface.into()), DAffine3::from_translation(center.0)))
        }
        Shape::Cylinder { from, to, radius, caps } => {
            let (standing, length) = between(from.0, to.0)?;
            let surface = Quadric::cylinder(radius.0, 0.0, length).map_err(text)?;
            Ok(Body::Shape(closed_if(*caps, surface).into(), standing))
        }
        Shape::Cone { from, to, radius, top_radius, caps } => {
            let (standing, length) = between(from.0, to.0)?;
            let top = top_radius.map_or(0.0, |r| r.0);
            if !(0.0..radius.0).contains(&top) {
                return Err(format!("'top_radius' must be at least 0 and below 'radius', but is {top}"));
            }
            let apex = length * radius.0 / (radius.0 - top);
            let upright = Aabb::new(
                DVec3::new(f64::NEG_INFINITY, 0.0, f64::NEG_INFINITY),
                DVec3::new(f64::INFINITY, length, f64::INFINITY),
            );
            let surface = Quadric::cone(radius.0, 0.0, apex).and_then(|q| q.with_clip(upright)).map_err(text)?;
            Ok(Body::Shape(closed_if(*caps, surface).into(), standing))
        }
        Shape::Paraboloid { from, to, radius, caps } => {
            let (standing, length) = between(from.0, to.0)?;
            let surface = Quadric::paraboloid(radius.0, length).map_err(text)?;
            Ok(Body::Shape(closed_if(*caps, surface).into(), standing))
        }
        Shape::HyperboloidOne { from, to, waist_radius, radius, caps } => {
            let (standing, length) = between(from.0, to.0)?;
            let (waist, half) = (positive("waist_radius", *waist_radius)?, length / 2.0);
            if radius.0 <= waist {
                return Err("'radius' (at the rims) must be larger than 'waist_radius'".to_owned());
            }
            let rise = half / ((radius.0 / waist).powi(2) - 1.0).sqrt();
            let surface = Quadric::hyperboloid_one(waist, rise, -half, half).map_err(text)?;
            Ok(Body::Shape(closed_if(*caps, surface).into(), standing * DAffine3::from_translation(DVec3::Y * half)))
        }
        Shape::HyperboloidTwo { from, to, gap, radius, caps } => {
            let (standing, length) = between(from.0, to.0)?;
            let (rise, half) = (positive("gap", *gap)? / 2.0, length / 2.0);
            if rise >= half {
                return Err("'gap' must be smaller than the distance of 'from' and 'to'".to_owned());
            }
            let slope = positive("radius", *radius)? / ((half / rise).powi(2) - 1.0).sqrt();
            let surface = Quadric::hyperboloid_two(slope, rise, -half, half).map_err(text)?;
            Ok(Body::Shape(closed_if(*caps, surface).into(), standing * DAffine3::from_translation(DVec3::Y * half)))
        }
    }
}

fn closed_if(caps: bool, surface: Quadric<f64>) -> geometry::Shape<f64> {
    if caps { Solid::new(surface).into() } else { surface.into() }
}

fn mesh(
    positions: &[Triple],
    triangles: &[[u32; 3]],
    normals: &[Triple],
    uvs: &[Pair],
) -> Result<TriangleMesh, String> {
    for (what, len) in [("normals", normals.len()), ("uvs", uvs.len())] {
        if len != 0 && len != positions.len() {
            return Err(format!("{len} {what} for {} positions: give one each, or none", positions.len()));
        }
    }
    if let Some((t, i)) = triangles
        .iter()
        .enumerate()
        .find_map(|(t, tri)| tri.iter().find(|&&i| i as usize >= positions.len()).map(|i| (t, i)))
    {
        return Err(format!("triangles[{t}]: position {i} does not exist; there are {}", positions.len()));
    }
    let narrow: Vec<_> = positions.iter().map(|p| p.0.as_vec3()).collect();
    if let Some(i) = narrow.iter().position(|p| !p.is_finite()) {
        return Err(format!("positions[{i}] is too large"));
    }
    let unit = |(i, n): (usize, &Triple)| {
        unit::double(n.0).map(|n| n.as_vec3()).ok_or_else(|| format!("normals[{i}] has no direction"))
    };
    Ok(TriangleMesh {
        positions: narrow,
        triangles: triangles.to_vec(),
        normals: normals.iter().enumerate().map(unit).collect::<Result<_, _>>()?,
        uvs: if uvs.is_empty() { Vec::new() } else { vec![uvs.iter().map(|uv| uv.0.as_vec2()).collect()] },
        ..TriangleMesh::default()
    })
}
