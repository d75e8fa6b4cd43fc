//! Cameras: where camera rays start and go.

use firsthit_geometry::{Aabb, Ray};
use firsthit_import::scene::{CameraDesc, Projection};
use glam::{DQuat, DVec3};

use crate::CameraChanges;

/// A view of the world, in f64, whatever the picture's size.
///
/// ```
/// use firsthit_render::Camera;
/// use glam::DVec3;
/// let camera = Camera::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 40_f64.to_radians()).unwrap();
/// let film = camera.on_film(256, 256);
/// let ray = film.ray([128.0, 128.0]);
/// assert_eq!((ray.origin, ray.direction), (DVec3::new(0.0, 0.0, 4.0), DVec3::NEG_Z));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    position: DVec3,
    /// Unit, orthogonal, right-handed: `right` x `up` = -`forward`.
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    projection: Projection,
    focal_distance: f64,
    /// Radius of its lens, world units; 0: a pinhole.
    lens_radius: f64,
    /// How far away things are sharp, if that is not at the focal point.
    focus_distance: Option<f64>,
}

/// A camera that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A number is NaN or infinite.
    #[error("the camera's {0} is not finite")]
    NotFinite(&'static str),
    /// It stands where it looks.
    #[error("the camera's position and focal point are the same")]
    NoDirection,
    /// An angle of view out of range.
    #[error("the camera's view angle must be more than 0 and less than 180 degrees")]
    ViewAngle,
    /// A size of view or zoom factor out of range.
    #[error("the camera's {0} must be more than 0")]
    NotPositive(&'static str),
    /// The opening of its lens is out of range.
    #[error("the camera's aperture must be 0 or more")]
    Aperture,
    /// Its transform has no inverse.
    #[error("the camera's transform is degenerate")]
    Degenerate,
}

impl Camera {
    /// A perspective camera at `position`, looking at `focal_point`, with this full vertical angle of view (radians).
    /// Where `view_up` is no help (parallel to the line of sight, or zero), another direction is taken.
    ///
    /// # Errors
    /// When it has no direction, or a number is out of range.
    pub fn look_at(
        position: DVec3,
        focal_point: DVec3,
        view_up: DVec3,
        vertical_fov: f64,
    ) -> Result<Self, CameraError> {
        let projection = Projection::Perspective { vertical_fov, aspect: None };
        let mut camera = Self {
            position,
            forward: DVec3::NEG_Z,
            right: DVec3::X,
            up: DVec3::Y,
            projection: checked(projection)?,
            focal_distance: 1.0,
            lens_radius: 0.0,
            focus_distance: None,
        };
        camera.aim(position, focal_point, view_up)?;
        Ok(camera)
    }

    /// A file's camera. What it looks at is taken to be at the depth of the middle of `bounds`, if that is in front.
    /// Scale and shear of its transform are left out, as glTF asks.
    ///
    /// # Errors
    /// When a number is not finite or out of range.
    pub fn from_desc(desc: &CameraDesc, bounds: &Aabb<f64>) -> Result<Self, CameraError> {
        let m = &desc.transform;
        if !m.is_finite() {
            return Err(CameraError::NotFinite("transform"));
        }
        let forward = (-m.matrix3.z_axis).try_normalize().ok_or(CameraError::Degenerate)?;
        let right = forward.cross(m.matrix3.y_axis).try_normalize().ok_or(CameraError::Degenerate)?;
        let depth = (bounds.center() - m.translation).dot(forward);
        let camera = Self {
            position: m.translation,
            forward,
            right,
            up: right.cross(forward),
            projection: checked(desc.projection)?,
            focal_distance: if depth > 0.0 && depth.is_finite() { depth } else { 1.0 },
            lens_radius: 0.0,
            focus_distance: None,
        };
        match desc.lens {
            Some(lens) => camera.with_lens(lens.aperture, lens.focus_distance),
            None => Ok(camera),
        }
    }

    /// The same with a thin lens whose opening is `aperture` wide (diameter, world units; 0: a pinhole) and before which
    /// things are sharp at this distance along the line of sight; `None`: at the focal point. Parallel projections blur
    /// as well: each of their rays has a lens of its own.
    ///
    /// # Errors
    /// When the aperture is negative, the distance is not positive, or one of them is not finite.
    pub fn with_lens(self, aperture: f64, focus_distance: Option<f64>) -> Result<Self, CameraError> {
        if !(aperture >= 0.0 && aperture.is_finite()) {
            return Err(CameraError::Aperture);
        }
        if !focus_distance.is_none_or(|d| d > 0.0 && d.is_finite()) {
            return Err(CameraError::NotPositive("focus distance"));
        }
        Ok(Self { lens_radius: 0.5 * aperture, focus_distance, ..self })
    }

    /// Whether it has more than a pinhole.
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0
    }

    /// The same as a pinhole.
    pub(crate) fn without_lens(self) -> Self {
        Self { lens_radius: 0.0, ..self }
    }

    /// This camera with the user's changes: first where it is and looks, then the turns about the focal point
    /// (azimuth, then elevation), then its lens.
    ///
    /// # Errors
    /// When the changes leave it without a direction, or a number is out of range.
    pub fn changed(&self, changes: &CameraChanges) -> Result<Self, CameraError> {
        let mut camera = self.clone();
        if changes.position.is_some() || changes.focal_point.is_some() || changes.view_up.is_some() {
            camera.aim(
                changes.position.unwrap_or(self.position),
                changes.focal_point.unwrap_or(self.focal_point()),
                changes.view_up.unwrap_or(self.up),
            )?;
        }
        camera.turn(changes.azimuth, changes.elevation)?;
        if let Some(angle) = changes.view_angle {
            camera.projection = match camera.projection {
                Projection::Perspective { .. } => Projection::Perspective { vertical_fov: angle, aspect: None },
                Projection::Orthographic { .. } => {
                    Projection::Orthographic { half_height: camera.focal_distance * (0.5 * angle).tan(), aspect: None }
                }
            };
        }
        if let Some(zoom) = changes.zoom {
            if !(zoom > 0.0 && zoom.is_finite()) {
                return Err(CameraError::NotPositive("zoom factor"));
            }
            camera.projection = match camera.projection {
                Projection::Perspective { vertical_fov, aspect } => {
                    Projection::Perspective { vertical_fov: 2.0 * ((0.5 * vertical_fov).tan() / zoom).atan(), aspect }
                }
                Projection::Orthographic { half_height, aspect } => {
                    Projection::Orthographic { half_height: half_height / zoom, aspect }
                }
            };
        }
        camera.projection = checked(camera.projection)?;
        if let (true, Projection::Perspective { vertical_fov, aspect }) = (changes.orthographic, camera.projection) {
            // What is at the focal point keeps its size.
            let half_height = camera.focal_distance * (0.5 * vertical_fov).tan();
            camera.projection = checked(Projection::Orthographic { half_height, aspect })?;
        }
        let focus = changes.focus_distance.or(camera.focus_distance);
        camera.with_lens(changes.aperture.unwrap_or(2.0 * self.lens_radius), focus)
    }

    /// Where it stands.
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Unit direction of its line of sight.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// Unit direction that is up in the picture.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Unit direction that is right in the picture.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// The point it looks at and is turned about.
    #[must_use]
    pub fn focal_point(&self) -> DVec3 {
        self.position + self.forward * self.focal_distance
    }

    /// Its lens.
    #[must_use]
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// The rays of this camera for a picture of this many pixels.
    ///
    /// The vertical extent is the camera's. Only where a file's camera says its width / height and the picture is
    /// narrower, the vertical extent grows, so that all that the camera was made to show is in the picture.
    #[must_use]
    pub fn on_film(&self, width: u32, height: u32) -> FilmCamera {
        let (width, height) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let shape = width / height;
        let (half_height, made_for, perspective) = match self.projection {
            Projection::Perspective { vertical_fov, aspect } => ((0.5 * vertical_fov).tan(), aspect, true),
            Projection::Orthographic { half_height, aspect } => (half_height, aspect, false),
        };
        let half_height = half_height * made_for.map_or(1.0, |a| (a / shape).max(1.0));
        let lens = self.has_lens().then(|| Lens {
            right: self.right * self.lens_radius,
            up: self.up * self.lens_radius,
            focus: self.focus_distance.unwrap_or(self.focal_distance),
        });
        FilmCamera {
            position: self.position,
            lens,
            forward: self.forward,
            right: self.right * (half_height * shape),
            up: self.up * half_height,
            size: [width, height],
            pixel: 2.0 * half_height / height,
            perspective,
        }
    }

    fn aim(&mut self, position: DVec3, focal_point: DVec3, view_up: DVec3) -> Result<(), CameraError> {
        for (what, v) in [("position", position), ("focal point", focal_point), ("up direction", view_up)] {
            if !v.is_finite() {
                return Err(CameraError::NotFinite(what));
            }
        }
        let sight = focal_point - position;
        // Scaled first, so that neither huge nor tiny distances lose their direction.
        let scale = sight.abs().max_element();
        if !(scale > 0.0) || !scale.is_finite() {
            return Err(CameraError::NoDirection);
        }
        let forward = (sight / scale).normalize();
        let up = view_up.try_normalize().unwrap_or(DVec3::Y);
        let right = [up, DVec3::Y, DVec3::NEG_Z]
            .into_iter()
            .map(|up| forward.cross(up))
            .find(|right| right.length() > 1e-9)
            .ok_or(CameraError::Degenerate)?
            .normalize();
        self.position = position;
        self.forward = forward;
        self.right = right;
        self.up = right.cross(forward);
        self.focal_distance = (sight / scale).length() * scale;
        Ok(())
    }

    fn turn(&mut self, azimuth: f64, elevation: f64) -> Result<(), CameraError> {
        if !azimuth.is_finite() {
            return Err(CameraError::NotFinite("azimuth"));
        }
        if !elevation.is_finite() {
            return Err(CameraError::NotFinite("elevation"));
        }
        if azimuth == 0.0 && elevation == 0.0 {
            return Ok(());
        }
        let focal_point = self.focal_point();
        let about_up = DQuat::from_axis_angle(self.up, azimuth);
        let right = about_up * self.right;
        let turn = DQuat::from_axis_angle(right, -elevation) * about_up;
        self.forward = (turn * self.forward).normalize();
        self.right = right.normalize();
        self.up = self.right.cross(self.forward);
        self.position = focal_point - self.forward * self.focal_distance;
        Ok(())
    }
}

fn checked(projection: Projection) -> Result<Projection, CameraError> {
    match projection {
        Projection::Perspective { vertical_fov, .. } => {
            if !(vertical_fov > 0.0 && vertical_fov < std::f64::consts::PI) {
                return Err(CameraError::ViewAngle);
            }
        }
        Projection::Orthographic { half_height, .. } => {
            if !(half_height > 0.0 && half_height.is_finite()) {
                return Err(CameraError::NotPositive("height of view"));
            }
        }
    }
    Ok(projection)
}

/// The rays of a camera for a picture of some size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmCamera {
    position: DVec3,
    lens: Option<Lens>,
    forward: DVec3,
    /// From the middle of the picture to its right edge, at distance 1 (parallel projection: at any).
    right: DVec3,
    /// From the middle of the picture to its upper edge.
    up: DVec3,
    size: [f64; 2],
    pixel: f64,
    perspective: bool,
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lens {
    /// From its middle to its rim.
    right: DVec3,
    up: DVec3,
    /// Where things are sharp.
    focus: f64,
}

/// How wide a pixel's view is: a cone along the ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Width where the ray starts, world units.
    pub width: f64,
    /// How much it grows for each unit of distance.
    pub spread: f64,
}

/// A point of the world as a camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Where in the picture, in pixels, as [`FilmCamera::ray`] counts them.
    pub at: [f64; 2],
    /// Where the ray that sees it starts.
    pub eye: DVec3,
    /// How many pixels one unit of area covers there that faces the camera.
    pub pixels_per_area: f64,
}

impl FilmCamera {
    /// The ray through a point of the picture, in pixels: (0, 0) is the upper left corner of the upper left pixel,
    /// the middle of pixel (i, j) is (i + 0.5, j + 0.5). Its direction is unit.
    #[inline]
    #[must_use]
    pub fn ray(&self, [x, y]: [f64; 2]) -> Ray<f64> {
        let across = self.right * (2.0 * x / self.size[0] - 1.0) + self.up * (1.0 - 2.0 * y / self.size[1]);
        if self.perspective {
            Ray::new(self.position, (self.forward + across).normalize())
        } else {
            Ray::new(self.position + across, self.forward)
        }
    }

    /// Whether it has more than a pinhole.
    #[inline]
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// The ray through a point of the picture, as [`FilmCamera::ray`], and through this point of the lens, in radii from
    /// its middle: to the right, upwards.
    #[inline]
    #[must_use]
    pub fn ray_through_lens(&self, at: [f64; 2], on_lens: [f64; 2]) -> Ray<f64> {
        let middle = self.ray(at);
        let Some(lens) = &self.lens else { return middle };
        let offset = lens.right * on_lens[0] + lens.up * on_lens[1];
        // Where all rays through this point of the picture meet.
        let sharp = middle.direction * (lens.focus / middle.direction.dot(self.forward));
        Ray::new(middle.origin + offset, (sharp - offset).normalize())
    }

    /// Where in the picture a point of the world is seen through a point of the lens, as of
    /// [`FilmCamera::ray_through_lens`]; `None` of what is not in front of the camera.
    #[inline]
    #[must_use]
    pub fn project(&self, point: DVec3, on_lens: [f64; 2]) -> Option<Projected> {
        let depth = (point - self.position).dot(self.forward);
        if !(depth > 0.0) {
            return None;
        }
        let (offset, focus) = match &self.lens {
            Some(lens) => (lens.right * on_lens[0] + lens.up * on_lens[1], lens.focus),
            None => (DVec3::ZERO, depth),
        };
        let (across, eye) = if self.perspective {
            // Where the way from the lens to the point meets the plane of what is sharp.
            let sharp = offset + (point - self.position - offset) * (focus / depth);
            (sharp / focus, self.position + offset)
        } else {
            let middle = point - offset - (self.forward * focus - offset) * (depth / focus) - self.position;
            (middle, self.position + middle + offset)
        };
        let to = point - eye;
        let cos = depth / to.length();
        let pixels_per_area = if self.perspective {
            // A pixel at distance 1 / cos is seen under this share of its area.
            1.0 / (self.pixel * self.pixel * cos.powi(3) * to.length_squared())
        } else {
            1.0 / (self.pixel * self.pixel * cos)
        };
        let (x, y) =
            (across.dot(self.right) / self.right.length_squared(), across.dot(self.up) / self.up.length_squared());
        Some(Projected { at: [0.5 * (x + 1.0) * self.size[0], 0.5 * (1.0 - y) * self.size[1]], eye, pixels_per_area })
    }

    /// Where in the picture a point of the world is, as [`FilmCamera::ray`] counts, seen through the middle of the lens;
    /// `None` of what is not in front of the camera.
    #[inline]
    pub(crate) fn place(&self, point: DVec3) -> Option<[f64; 2]> {
        let from = point - self.position;
        let depth = from.dot(self.forward);
        let scale = if self.perspective { depth } else { 1.0 };
        let x = from.dot(self.right) / (scale * self.right.length_squared());
        let y = from.dot(self.up) / (scale * self.up.length_squared());
        (depth > 0.0).then(|| [0.5 * (x + 1.0) * self.size[0], 0.5 * (1.0 - y) * self.size[1]])
    }

    /// How many pixels such a part of the coordinates of the camera and a point in front of it makes, there.
    #[inline]
    pub(crate) fn pixels(&self, point: DVec3, part: f64) -> f64 {
        let length = (point.abs() + self.position.abs()).max_element() * part;
        let depth = if self.perspective { (point - self.position).dot(self.forward) } else { 1.0 };
        length / (depth * self.pixel)
    }

    /// How wide a pixel's view is (in the middle of the picture).
    #[inline]
    #[must_use]
    pub fn cone(&self) -> Cone {
        if self.perspective { Cone { width: 0.0, spread: self.pixel } } else { Cone { width: self.pixel, spread: 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3};
    use proptest::prelude::*;

    fn close(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-12 * (1.0 + a.length()), "{a} is not {b}");
    }

    fn standard() -> Camera {
        Camera::look_at(DVec3::new(0.0, 1.8, 5.5), DVec3::new(0.0, 0.6, 0.0), DVec3::Y, 40_f64.to_radians()).unwrap()
    }

    /// What is projected is on the ray of that place; and a little disk of area is as many pixels as is said.
    #[test]
    fn projecting_undoes_rays() {
        let orthographic = CameraChanges { orthographic: true, ..Default::default() };
        for (camera, on_lens) in [
            (standard(), [0.0, 0.0]),
            (standard().with_lens(0.4, Some(3.0)).unwrap(), [0.3, -0.8]),
            (standard().changed(&orthographic).unwrap(), [0.0, 0.0]),
            (standard().changed(&orthographic).unwrap().with_lens(0.4, None).unwrap(), [-0.5, 0.6]),
        ] {
            let film = camera.on_film(120, 80);
            for (at, t) in [([10.0, 20.0], 2.0), ([61.0, 39.5], 7.0), ([110.0, 75.0], 4.0)] {
                let ray = film.ray_through_lens(at, on_lens);
                let point = ray.at(t);
                let seen = film.project(point, on_lens).unwrap();
                close(seen.eye, ray.origin);
                assert!((seen.at[0] - at[0]).abs() < 1e-9 && (seen.at[1] - at[1]).abs() < 1e-9, "{seen:?}");
                let (u, v) = (ray.direction.any_orthonormal_vector(), 1e-5);
                let w = ray.direction.cross(u);
                let place = |p: DVec3| glam::DVec2::from(film.project(p, on_lens).unwrap().at);
                let (du, dv) =
                    (place(point + u * v) - place(point - u * v), place(point + w * v) - place(point - w * v));
                let pixels = du.perp_dot(dv).abs() / (4.0 * v * v);
                assert!((pixels / seen.pixels_per_area - 1.0).abs() < 1e-5, "{pixels} {seen:?}");
            }
            assert_eq!(film.project(camera.position() - camera.forward(), on_lens), None);
        }
        assert_eq!(standard().with_lens(-0.1, None), Err(CameraError::Aperture));
        assert_eq!(standard().with_lens(f64::NAN, None), Err(CameraError::Aperture));
        assert_eq!(standard().with_lens(0.1, Some(0.0)), Err(CameraError::NotPositive("focus distance")));
    }

    /// The formula of the reference scenes, written out: d = f + (2 px/W - 1) tan(fov/2) r + (1 - 2 py/H) tan(fov/2) u.
    #[test]
    fn rays_follow_the_references_formula() {
        let (origin, target) = (DVec3::new(0.0, 1.8, 5.5), DVec3::new(0.0, 0.6, 0.0));
        let f = (target - origin).normalize();
        let r = f.cross(DVec3::Y).normalize();
        let u = r.cross(f);
        let tan = 20_f64.to_radians().tan();
        let film = standard().on_film(256, 256);
        for (px, py) in [(0.0, 0.0), (128.0, 128.0), (256.0, 0.0), (3.25, 200.75), (255.5, 255.5)] {
            let ray = film.ray([px, py]);
            let d = f + r * ((2.0 * px / 256.0 - 1.0) * tan) + u * ((1.0 - 2.0 * py / 256.0) * tan);
            close(ray.origin, origin);
            close(ray.direction, d.normalize());
        }
    }

    #[test]
    fn the_angle_of_view_is_vertical() {
        let film = standard().on_film(320, 200);
        let angle = |a: [f64; 2], b: [f64; 2]| film.ray(a).direction.angle_between(film.ray(b).direction);
        assert!((angle([160.0, 0.0], [160.0, 200.0]) - 40_f64.to_radians()).abs() < 1e-12);
        let across = 2.0 * (20_f64.to_radians().tan() * 1.6).atan();
        assert!((angle([0.0, 100.0], [320.0, 100.0]) - across).abs() < 1e-12);
        // A pixel's cone is as wide as the pixel, in the middle.
        let pixel = (angle([160.0, 99.5], [160.0, 100.5]) / 2.0).tan() * 2.0;
        assert!((film.cone().spread - pixel).abs() < 1e-6 && film.cone().width == 0.0);
    }

    #[test]
    fn a_files_camera_looks_along_its_minus_z() {
        let turn = DMat3::from_rotation_y(0.5) * DMat3::from_rotation_x(-0.3);
        let desc = CameraDesc {
            name: String::new(),
            // Scale does not matter.
            transform: DAffine3::from_mat3_translation(turn * 3.0, DVec3::new(1.0, 2.0, 3.0)),
            projection: Projection::Perspective { vertical_fov: 0.7, aspect: None },
            lens: None,
            moves_to: None,
        };
        let camera = Camera::from_desc(&desc, &Aabb::empty()).unwrap();
        close(camera.forward(), turn * DVec3::NEG_Z);
        close(camera.up(), turn * DVec3::Y);
        close(camera.right(), turn * DVec3::X);
        close(camera.position(), DVec3::new(1.0, 2.0, 3.0));
        let bounds = Aabb::new(DVec3::splat(-11.0), DVec3::splat(-9.0));
        let depth = (DVec3::splat(-10.0) - camera.position()).dot(camera.forward());
        let camera = Camera::from_desc(&desc, &bounds).unwrap();
        close(camera.focal_point(), camera.position() + camera.forward() * depth.max(1.0));
    }

    #[test]
    fn a_narrow_picture_shows_all_that_a_files_camera_shows() {
        let projection = Projection::Perspective { vertical_fov: 0.8, aspect: Some(2.0) };
        let desc =
            CameraDesc { name: String::new(), transform: DAffine3::IDENTITY, projection, lens: None, moves_to: None };
        let camera = Camera::from_desc(&desc, &Aabb::empty()).unwrap();
        let half_width = |w, h| {
            let d = camera.on_film(w, h).ray([f64::from(w), 0.5 * f64::from(h)]).direction;
            d.x / -d.z
        };
        let made_for = 2.0 * 0.4_f64.tan();
        for (w, h) in [(200, 100), (100, 100), (50, 100)] {
            assert!((half_width(w, h) - made_for).abs() < 1e-12, "{w}x{h}");
        }
        assert!((half_width(400, 100) - 2.0 * made_for).abs() < 1e-12);
    }

    #[test]
    fn orthographic_rays_are_parallel_and_keep_the_size_at_the_focal_point() {
        let changes = CameraChanges { orthographic: true, ..Default::default() };
        let (wide, flat) = (standard().on_film(100, 100), standard().changed(&changes).unwrap().on_film(100, 100));
        let distance = (DVec3::new(0.0, 1.8, 5.5) - DVec3::new(0.0, 0.6, 0.0)).length();
        for p in [[0.0, 0.0], [100.0, 30.0], [50.0, 50.0]] {
            let (a, b) = (wide.ray(p), flat.ray(p));
            close(b.direction, standard().forward());
            // They meet in the plane through the focal point.
            let t = distance / a.direction.dot(standard().forward());
            close(a.at(t), b.at(distance));
        }
        assert_eq!(flat.cone().spread, 0.0);
    }

    #[test]
    fn changes_do_what_their_names_say() {
        let camera = standard();
        let changed = |c: CameraChanges| camera.changed(&c).unwrap();
        assert_eq!(changed(CameraChanges::default()), camera);

        let moved = changed(CameraChanges { position: Some(DVec3::new(5.0, 0.6, 0.0)), ..Default::default() });
        close(moved.forward(), DVec3::NEG_X);
        close(moved.focal_point(), camera.focal_point());

        // From above, a camera at +Z that turns counter-clockwise comes to +X.
        let level = Camera::look_at(DVec3::Z * 4.0, DVec3::ZERO, DVec3::Y, 0.5).unwrap();
        let quarter = std::f64::consts::FRAC_PI_2;
        let turned = level.changed(&CameraChanges { azimuth: quarter, ..Default::default() }).unwrap();
        close(turned.position(), DVec3::X * 4.0);
        close(turned.forward(), DVec3::NEG_X);
        let raised = level.changed(&CameraChanges { elevation: quarter / 3.0, ..Default::default() }).unwrap();
        close(raised.position(), DVec3::new(0.0, 2.0, 4.0 * (quarter / 3.0).cos()));
        close(raised.focal_point(), DVec3::ZERO);
        assert!(raised.up().y > 0.0);

        let tan = |c: &Camera| match c.projection() {
            Projection::Perspective { vertical_fov, .. } => (0.5 * vertical_fov).tan(),
            Projection::Orthographic { half_height, .. } => half_height,
        };
        let zoomed = changed(CameraChanges { zoom: Some(2.0), ..Default::default() });
        assert!((tan(&zoomed) - 0.5 * tan(&camera)).abs() < 1e-12, "twice as large in the picture");
        let wide = changed(CameraChanges { view_angle: Some(1.0), ..Default::default() });
        assert!((tan(&wide) - 0.5_f64.tan()).abs() < 1e-12);
        let sideways = changed(CameraChanges { view_up: Some(DVec3::X), ..Default::default() });
        assert!(sideways.up().x > 0.99);
    }

    #[test]
    fn what_makes_no_camera_is_refused() {
        let camera = standard();
        let refused = |c: CameraChanges| camera.changed(&c).unwrap_err();
        assert_eq!(
            refused(CameraChanges { position: Some(camera.focal_point()), ..Default::default() }),
            CameraError::NoDirection
        );
        assert_eq!(
            refused(CameraChanges { position: Some(DVec3::NAN), ..Default::default() }),
            CameraError::NotFinite("position")
        );
        for angle in [0.0, -1.0, 3.2, f64::NAN] {
            assert_eq!(
                refused(CameraChanges { view_angle: Some(angle), ..Default::default() }),
                CameraError::ViewAngle
            );
        }
        for zoom in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            let c = CameraChanges { zoom: Some(zoom), ..Default::default() };
            assert_eq!(refused(c), CameraError::NotPositive("zoom factor"));
        }
        let c = CameraChanges { azimuth: f64::INFINITY, ..Default::default() };
        assert_eq!(refused(c), CameraError::NotFinite("azimuth"));
        let desc = CameraDesc {
            name: String::new(),
            transform: DAffine3::ZERO,
            projection: Projection::Orthographic { half_height: 1.0, aspect: None },
            lens: None,
            moves_to: None,
        };
        assert_eq!(Camera::from_desc(&desc, &Aabb::empty()), Err(CameraError::Degenerate));
    }

    proptest! {
        /// Any position, target and up, at scales from 1e-9 to 1e9: an orthonormal frame whose middle ray meets the target.
        #[test]
        fn frames_are_orthonormal(
            p in prop::array::uniform3(-1.0_f64..1.0), t in prop::array::uniform3(-1.0_f64..1.0),
            up in prop::sample::select(vec![DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::ZERO]),
            exponent in -9..9,
        ) {
            let scale = 10_f64.powi(exponent);
            let (p, t) = (DVec3::from(p) * scale, DVec3::from(t) * scale);
            prop_assume!((p - t).length() > 1e-6 * scale);
            let c = Camera::look_at(p, t, up, 0.5).unwrap();
            prop_assert!((c.right().cross(c.up()) + c.forward()).length() < 1e-12);
            prop_assert!(c.right().dot(c.up()).abs() < 1e-12);
            let ray = c.on_film(64, 48).ray([32.0, 24.0]);
            let along = (t - p).length();
            prop_assert!((ray.at(along) - t).length() < 1e-12 * scale);
        }
    }
}
