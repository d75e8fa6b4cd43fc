//! What is raced over: one mesh in the world, and from where it is looked at.

use std::path::Path;

use firsthit_import::scene::SurfaceDesc;
use firsthit_measure::mesh::Mesh;
use glam::Vec3;

use crate::generated;

/// A mesh with its name.
#[derive(Clone, Debug)]
pub struct Model {
    /// The file's or folder's name without extensions, or the word of a generated scene.
    pub name: String,
    /// All triangles of all instances, in the world.
    pub mesh: Mesh,
}

/// Names of models that are looked at from inside.
const ROOMS: [&str; 6] = ["kitchen", "sponza", "conference", "sibenik", "room", "interior"];

/// From where a model is looked at.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The camera's place.
    pub eye: Vec3,
    /// What it looks at.
    pub at: Vec3,
    /// Its full angle, in degrees.
    pub angle: f32,
    /// Where the light is that shadow rays go to.
    pub light: Vec3,
}

impl Model {
    /// `forest` (7,568,000 triangles) and `terrain` (5,780,000) are generated; anything else is a file, or a folder with
    /// one model in it. Shapes other than triangles are left out.
    ///
    /// # Errors
    /// When the file cannot be read or has no triangle.
    pub fn open(word: &str) -> Result<Self, String> {
        let name = word.to_owned();
        match word {
            "forest" => return Ok(Self { name, mesh: generated::forest(1500) }),
            "terrain" => return Ok(Self { name, mesh: generated::terrain(1700) }),
            _ => {}
        }
        let path = Path::new(word);
        let scene = firsthit_import::open(path, &firsthit_import::Options::default()).map_err(|e| e.to_string())?.scene;
        let mut mesh = Mesh::default();
        for instance in &scene.instances {
            for geometry in &scene.meshes[instance.mesh].geometries {
                let SurfaceDesc::Triangles(part) = &geometry.surface else { continue };
                let first = mesh.positions.len() as u32;
                let placed = |p: &Vec3| instance.transform.transform_point3(p.as_dvec3()).as_vec3();
                mesh.positions.extend(part.positions.iter().map(placed));
                mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
            }
        }
        if mesh.triangles.is_empty() {
            return Err(format!("{word}: there is no triangle in it"));
        }
        let full = path.canonicalize().map_err(|e| format!("{word}: {e}"))?;
        let name = full.file_name().unwrap_or_default().to_string_lossy();
        let name = if full.is_dir() { &*name } else { name.split('.').next().unwrap_or_default() };
        Ok(Self { name: name.to_owned(), mesh })
    }

    /// The least and greatest coordinates of all triangles.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let corners = self.mesh.triangles.iter().flatten().map(|&i| self.mesh.positions[i as usize]);
        corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// The length of the box's diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f32 {
        let (low, high) = self.bounds();
        (high - low).length()
    }

    /// Objects are seen from outside, rooms (told by their names) from one end, the forest from between its crowns.
    #[must_use]
    pub fn view(&self) -> View {
        let (low, high) = self.bounds();
        let (center, extent) = ((low + high) * 0.5, high - low);
        let room = self.name.to_lowercase();
        match self.name.as_str() {
            "terrain" => View {
                eye: Vec3::new(200.0, 260.0, 120.0),
                at: Vec3::new(600.0, 90.0, 620.0),
                angle: 60.0,
                light: Vec3::new(300.0, 900.0, 900.0),
            },
            "forest" => View {
                eye: Vec3::new(425.0, high.y.min(150.0), 425.0),
                at: Vec3::new(500.0, 105.0, 500.0),
                angle: 65.0,
                light: Vec3::new(800.0, 500.0, 300.0),
            },
            _ if ROOMS.iter().any(|r| room.contains(r)) => {
                let long = if extent.x > extent.z { Vec3::X } else { Vec3::Z } * extent;
                let level = |share: f32| Vec3::new(center.x, low.y + share * extent.y, center.z);
                View { eye: level(0.55) - long * 0.30, at: level(0.42) + long * 0.45, angle: 75.0, light: level(0.80) }
            }
            _ => {
                let radius = 0.5 * extent.length();
                let towards = |x, y, z| Vec3::new(x, y, z).normalize();
                View {
                    eye: center + towards(0.55, 0.35, 0.76) * (1.55 * radius),
                    at: center,
                    angle: 50.0,
                    light: center + towards(-0.4, 0.9, 0.5) * (2.5 * radius),
                }
            }
        }
    }
}
