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
        Ok(Self {
            position: m.translation,
            forward,
            right,
            up: right.cross(forward),
            projection: checked(desc.projection)?,
            focal_distance: if depth > 0.0 && depth.is_finite() { depth } else { 1.0 },
        })
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
        Ok(camera)
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
        FilmCamera {
            position: self.position,
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
    forward: DVec3,
    /// From the middle of the picture to its right edge, at distance 1 (parallel projection: at any).
    right: DVec3,
    /// From the middle of the picture to its upper edge.
    up: DVec3,
    size: [f64; 2],
    pixel: f64,
    perspective: bool,
}

/// How wide a pixel's view is: a cone along the ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Width where the ray starts, world units.
    pub width: f64,
    /// How much it grows for each unit of distance.
    pub spread: f64,
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

    /// How wide a pixel's view is (in the middle of the picture).
    #[inline]
    #[must_use]
    pub fn cone(&self) -> Cone {
        if self.perspective { Cone { width: 0.0, spread: self.pixel } } else { Cone { width: self.pixel, spread: 0.0 } }
    }
}
