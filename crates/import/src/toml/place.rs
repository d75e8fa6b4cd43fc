//! Where things stand: transforms, cameras, orientations, from friendly words to matrices.

use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4};

use super::schema::Transform;

/// The matrix of an object's `transform`.
pub(super) fn affine(t: &Transform) -> Result<DAffine3, String> {
    let simple = [t.scale.is_some(), t.rotate_deg.is_some(), t.look_at.is_some(), t.translate.is_some()];
    let m = if let Some(rows) = &t.matrix {
        if simple.contains(&true) {
            return Err("'matrix' stands alone: no scale, rotate_deg, look_at or translate beside it".to_owned());
        }
        let rows: Vec<DVec4> = rows.iter().map(|r| DVec4::from(r.map(|x| x.0))).collect();
        let ([x, y, z] | [x, y, z, DVec4::W]) = rows[..] else {
            return Err("'matrix' has 3 rows of 4 numbers, or 4 of which the last is [0, 0, 0, 1]".to_owned());
        };
        DAffine3 {
            matrix3: DMat3::from_cols(x.truncate(), y.truncate(), z.truncate()).transpose(),
            translation: DVec3::new(x.w, y.w, z.w),
        }
    } else {
        let translation = t.translate.unwrap_or_default().0;
        let rotation = match (t.rotate_deg, t.look_at) {
            (Some(_), Some(_)) => return Err("give 'rotate_deg' or 'look_at', not both".to_owned()),
            (Some(angles), None) => rotation_deg(angles.0),
            (None, Some(target)) => facing(target.0 - translation, None)
                .ok_or("'look_at' must be a point other than where the object stands")?,
            (None, None) => DMat3::IDENTITY,
        };
        let scale = t.scale.map_or(DVec3::ONE, |s| s.0);
        DAffine3 { matrix3: rotation * DMat3::from_diagonal(scale), translation }
    };
    if !m.matrix3.determinant().is_finite() || !m.is_finite() {
        return Err("the transform makes the object too large".to_owned());
    }
    Ok(m)
}

/// Turned about X, then about Y, then about Z (the world's axes), in degrees, counter-clockwise.
fn rotation_deg(angles: DVec3) -> DMat3 {
    let [x, y, z] = angles.to_array().map(sin_cos_deg);
    let about_x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, x.1, x.0), DVec3::new(0.0, -x.0, x.1));
    let about_y = DMat3::from_cols(DVec3::new(y.1, 0.0, -y.0), DVec3::Y, DVec3::new(y.0, 0.0, y.1));
    let about_z = DMat3::from_cols(DVec3::new(z.1, z.0, 0.0), DVec3::new(-z.0, z.1, 0.0), DVec3::Z);
    about_z * about_y * about_x
}

/// Sine and cosine, exact for right angles: a quarter turn keeps axis-aligned things axis-aligned.
fn sin_cos_deg(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        other => other.to_radians().sin_cos(),
    }
}

/// A vector's direction, also where the square of its length is not to be had. `None` if it has none.
pub(super) fn unit(v: DVec3) -> Option<DVec3> {
    (v / v.abs().max_element()).try_normalize()
}

/// The rotation that turns +Z to `direction`, and +Y as far up as that allows. `None` if `direction` is zero, or if the
/// given `up` is parallel to it; without one, +Y is up, or -Z for what looks straight up or down.
pub(super) fn facing(direction: DVec3, up: Option<DVec3>) -> Option<DMat3> {
    let z = unit(direction)?;
    let side = |up: DVec3| {
        let x = unit(up)?.cross(z);
        (x.length() > 1e-9).then(|| x.normalize())
    };
    let x = match up {
        Some(up) => side(up)?,
        None => side(DVec3::Y).or_else(|| side(DVec3::NEG_Z))?,
    };
    Some(DMat3::from_cols(x, z.cross(x), z))
}

/// A camera at `origin` that looks at `target`: it looks along its own -Z.
pub(super) fn camera(origin: DVec3, target: DVec3, up: Option<DVec3>) -> Result<DAffine3, String> {
    if origin == target {
        return Err("'origin' and 'target' must be different points".to_owned());
    }
    let matrix3 = facing(origin - target, up).ok_or("'up' must not be zero nor point along the line of sight")?;
    Ok(DAffine3 { matrix3, translation: origin })
}

/// Puts what stands on the origin along +Y between two points; also their distance.
pub(super) fn between(from: DVec3, to: DVec3) -> Result<(DAffine3, f64), String> {
    let axis = to - from;
    let length = axis.length();
    let Some(direction) = unit(axis).filter(|_| length.is_finite()) else {
        return Err("'from' and 'to' must be different points at a finite distance".to_owned());
    };
    Ok((DAffine3::from_rotation_translation(DQuat::from_rotation_arc(DVec3::Y, direction), from), length))
}
