//! firsthit itself.

use firsthit_accel::{BuildOptions, Geometry, Hit, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::Mesh;
use glam::DAffine3;

use super::{Answer, Batch, Peer, Ray32};
use crate::rays::Kind;
use crate::reference::double;

/// A scene of one mesh.
pub struct Firsthit(Scene);

impl Firsthit {
    /// Builds the tree at a tier, otherwise by default.
    ///
    /// # Panics
    /// If the mesh cannot be built: vertices that are not finite, or indices out of range.
    #[must_use]
    pub fn new(mesh: &Mesh, precision: Precision) -> Self {
        Self::build(Self::prepare(mesh, BuildOptions { precision, ..BuildOptions::default() }))
            .expect("a mesh that can be built")
    }

    /// Hands over the mesh, with nothing built yet.
    #[must_use]
    pub fn prepare(mesh: &Mesh, options: BuildOptions) -> SceneBuilder {
        let mut builder = SceneBuilder::new(options);
        let geometry = Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
        let mesh = builder.add_mesh(vec![geometry]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        builder
    }

    /// Builds the tree.
    ///
    /// # Errors
    /// When the mesh cannot be built.
    pub fn build(builder: SceneBuilder) -> Result<Self, String> {
        builder.build().map(Self).map_err(|e| e.to_string())
    }
}

fn answer(hit: &Hit) -> Answer {
    Answer { t: hit.t, triangle: hit.id.primitive, u: hit.u, v: hit.v }
}

impl Peer for Firsthit {
    #[inline(always)]
    fn closest(&self, ray: &Ray32) -> Option<Answer> {
        self.0.closest_hit(&double(ray)).map(|hit| answer(&hit))
    }

    #[inline(always)]
    fn any(&self, ray: &Ray32) -> bool {
        self.0.any_hit(&double(ray))
    }

    fn batch<'a>(&'a self, rays: &[Ray32], kind: Kind) -> Option<Box<dyn Batch + 'a>> {
        let (rays, scene) = (rays.iter().map(double).collect::<Vec<_>>(), &self.0);
        Some(if kind.any() {
            Box::new(Any { scene, hits: vec![false; rays.len()], rays })
        } else {
            Box::new(Closest { scene, hits: vec![None; rays.len()], rays })
        })
    }

    fn own_bytes(&self) -> Option<u64> {
        Some(self.0.stats().bytes)
    }
}

struct Closest<'a> {
    scene: &'a Scene,
    rays: Vec<Ray<f64>>,
    hits: Vec<Option<Hit>>,
}

impl Batch for Closest<'_> {
    fn ask(&mut self, parallel: bool) {
        match parallel {
            true => self.scene.par_closest_hits(&self.rays, &mut self.hits),
            false => self.scene.closest_hits(&self.rays, &mut self.hits),
        }
    }

    fn answers(&self) -> Vec<Answer> {
        self.hits.iter().map(|h| h.as_ref().map_or(Answer::MISS, answer)).collect()
    }
}

struct Any<'a> {
    scene: &'a Scene,
    rays: Vec<Ray<f64>>,
    hits: Vec<bool>,
}

impl Batch for Any<'_> {
    fn ask(&mut self, parallel: bool) {
        match parallel {
            true => self.scene.par_any_hits(&self.rays, &mut self.hits),
            false => self.scene.any_hits(&self.rays, &mut self.hits),
        }
    }

    fn answers(&self) -> Vec<Answer> {
        self.hits.iter().map(|&hit| if hit { Answer { triangle: 0, ..Answer::MISS } } else { Answer::MISS }).collect()
    }
}
