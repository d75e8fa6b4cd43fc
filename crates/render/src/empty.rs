//! Where the camera meets nothing for certain: there no ray has to be cast.
//!
//! Every triangle of the scene is put on the picture, and the squares of pixels that it may touch are marked. What is left
//! is empty, whatever sample of a pixel one looks at. In a picture of a single model that is most of it.

use std::sync::atomic::{AtomicBool, Ordering};

use firsthit_geometry::{Aabb, Primitive};
use firsthit_import::scene::SurfaceDesc;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::camera::FilmCamera;
use crate::surface::World;

/// Side of the squares, pixels.
const SIDE: u32 = 4;
/// Of a mesh with more triangles in all places together, the box is put on the picture instead.
const MOST: usize = 4_000_000;
/// How far from its triangle a hit may lie, as part of the coordinates: more than what queries round, `u|o| + 8uR`.
const ROUNDED: f64 = 1e-6;
/// Triangles that one thread takes at a time.
const PORTION: usize = 8192;

/// The squares of a picture in which there may be something.
#[derive(Clone, Debug)]
pub(crate) struct Empty {
    across: usize,
    /// Row by row.
    filled: Vec<bool>,
}

/// The same while it is made.
struct Marks<'a> {
    camera: &'a FilmCamera,
    /// How far a sample may lie outside of its pixel's square, and a little for rounding.
    margin: f64,
    across: usize,
    down: usize,
    filled: Vec<AtomicBool>,
}

impl Empty {
    /// Looks where there is nothing in a picture of this size, whose samples lie at most `reach` pixels from the middle of
    /// their pixel. `None` where that cannot be told: the camera has a lens, or something is behind it or has no end.
    pub(crate) fn new(world: &World, camera: &FilmCamera, (width, height): (u32, u32), reach: f64) -> Option<Self> {
        if camera.has_lens() {
            return None;
        }
        let (across, down) = (width.div_ceil(SIDE) as usize, height.div_ceil(SIDE) as usize);
        let filled = std::iter::repeat_with(|| AtomicBool::new(false)).take(across * down).collect();
        let marks = Marks { camera, margin: reach + 1.0, across, down, filled };
        let count = |m: usize| world.scene.meshes[m].geometries.iter().map(|g| triangles(&g.surface)).sum::<usize>();
        let few = world.instances.iter().map(|i| count(i.mesh)).sum::<usize>() <= MOST;
        for instance in &world.instances {
            for geometry in &world.scene.meshes[instance.mesh].geometries {
                let known = match &geometry.surface {
                    SurfaceDesc::Shape(shape) => marks.mark_box(&shape.bounds(), &instance.transform),
                    SurfaceDesc::Triangles(mesh) if few => mesh.triangles.par_chunks(PORTION).all(|portion| {
                        portion.iter().all(|corners| {
                            let place =
                                |i: &u32| instance.transform.transform_point3(mesh.positions[*i as usize].as_dvec3());
                            marks.mark(corners.iter().map(place))
                        })
                    }),
                    SurfaceDesc::Triangles(mesh) => {
                        let points = mesh.positions.iter().map(|p| p.as_dvec3());
                        marks.mark_box(&Aabb::from_points(points), &instance.transform)
                    }
                };
                if !known {
                    return None;
                }
            }
        }
        Some(Self { across, filled: marks.filled.into_iter().map(AtomicBool::into_inner).collect() })
    }

    /// Whether the camera sees nothing from any place of this pixel.
    #[inline]
    pub(crate) fn at(&self, x: u32, y: u32) -> bool {
        !self.filled[(y / SIDE) as usize * self.across + (x / SIDE) as usize]
    }
}

fn triangles(surface: &SurfaceDesc) -> usize {
    if let SurfaceDesc::Triangles(mesh) = surface { mesh.triangles.len() } else { 0 }
}

impl Marks<'_> {
    /// Marks where the hull of some points may be; false where that is not known.
    fn mark(&self, points: impl Iterator<Item = DVec3>) -> bool {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            let Some(at) = self.camera.place(point).filter(|at| (at[0] + at[1]).is_finite()) else { return false };
            // So near that what queries may be off is to be seen.
            if self.camera.pixels(point, ROUNDED) > 0.5 {
                return false;
            }
            for k in 0..2 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
        }
        // The middle of a pixel is half a pixel from its number.
        let square = |x: f64| (x - 0.5) / f64::from(SIDE);
        // What is outside of the picture ends at its edges.
        let range = |k: usize, n: usize| {
            let (first, last) = (square(low[k] - self.margin).floor(), square(high[k] + self.margin).floor());
            (first.max(0.0) as usize, if last < 0.0 { 0 } else { (last as usize).saturating_add(1).min(n) })
        };
        let ((left, right), (top, bottom)) = (range(0, self.across), range(1, self.down));
        for row in top..bottom {
            for square in &self.filled[row * self.across..][left.min(right)..right] {
                // Most are marked already, and reading is cheaper.
                if !square.load(Ordering::Relaxed) {
                    square.store(true, Ordering::Relaxed);
                }
            }
        }
        true
    }

    fn mark_box(&self, bounds: &Aabb<f64>, place: &DAffine3) -> bool {
        // Nothing at all is known to be nowhere.
        bounds.is_empty() || self.mark(bounds.corners().into_iter().map(|corner| place.transform_point3(corner)))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use firsthit_accel::{BuildOptions, SceneBuilder};
    use firsthit_geometry::Shape;
    use firsthit_geometry::shapes::{Plane, Sphere};
    use firsthit_import::SceneDesc;
    use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, TriangleMesh};
    use glam::Vec3;

    use super::*;
    use crate::sampler::{Dimension, PixelSampler};
    use crate::{Camera, CameraChanges};

    const SIZE: (u32, u32) = (70, 45);

    fn scene(surfaces: Vec<(SurfaceDesc, DVec3)>) -> Arc<SceneDesc> {
        let mut scene = SceneDesc::default();
        for (i, (surface, at)) in surfaces.into_iter().enumerate() {
            let geometries = vec![GeometryDesc { name: String::new(), surface, material: None }];
            scene.meshes.push(MeshDesc { name: String::new(), geometries });
            let transform = DAffine3::from_translation(at);
            scene.instances.push(InstanceDesc { name: String::new(), mesh: i, transform, moves_to: None });
        }
        Arc::new(scene)
    }

    fn empty(scene: &Arc<SceneDesc>, camera: &Camera, reach: f64) -> Option<Empty> {
        let world = World::new(Arc::clone(scene), scene.instances.iter().map(|i| i.transform));
        Empty::new(&world, &camera.on_film(SIZE.0, SIZE.1), SIZE, reach)
    }

    fn ball(radius: f64) -> SurfaceDesc {
        SurfaceDesc::Shape(Shape::Sphere(Sphere::new(DVec3::ZERO, radius).unwrap()))
    }

    fn triangle() -> SurfaceDesc {
        let positions = vec![Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 0.1, 0.3), Vec3::new(0.0, 0.2, -0.4)];
        SurfaceDesc::Triangles(TriangleMesh { positions, triangles: vec![[0, 1, 2]], ..TriangleMesh::default() })
    }

    #[test]
    fn no_ray_of_an_empty_pixel_meets_anything() {
        let scene = scene(vec![
            (triangle(), DVec3::ZERO),
            (ball(0.3), DVec3::new(1.2, 0.8, 0.0)),
            // Partly outside of the picture.
            (ball(0.5), DVec3::new(-3.0, 1.0, -1.0)),
        ]);
        let accel = SceneBuilder::from_desc(&scene, BuildOptions::default()).build().unwrap();
        let camera = Camera::look_at(DVec3::new(0.5, 1.0, 4.0), DVec3::ZERO, DVec3::Y, 0.9).unwrap();
        let parallel = camera.changed(&CameraChanges { orthographic: true, ..CameraChanges::default() }).unwrap();
        for (camera, reach) in [(&camera, 0.5), (&camera, 1.5), (&parallel, 1.5)] {
            let empty = empty(&scene, camera, reach).unwrap();
            let film = camera.on_film(SIZE.0, SIZE.1);
            let (mut without, mut hits) = (0, 0);
            for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
                for sample in 0..16 {
                    let [u, v] = PixelSampler::new(1, (x, y), sample).get2(Dimension::Pixel);
                    let off = |u: f32| 0.5 + reach * (2.0 * f64::from(u) - 1.0);
                    let ray = film.ray([f64::from(x) + off(u), f64::from(y) + off(v)]);
                    let hit = accel.closest_hit(&ray).is_some();
                    assert!(!(hit && empty.at(x, y)), "{x} {y}");
                    hits += u32::from(hit);
                }
                without += u32::from(empty.at(x, y));
            }
            assert!(without > SIZE.0 * SIZE.1 / 2 && hits > 1000, "{without} {hits}");
        }
    }

    #[test]
    fn what_is_too_near_for_its_size_leaves_it_open() {
        // A thousand units of the mesh from its middle, and a millionth of them is a pixel.
        let at = DVec3::new(0.0, 1000.0, 0.0);
        let camera = |distance: f64| Camera::look_at(at + DVec3::Z * distance, at, DVec3::Y, 0.9).unwrap();
        let positions = [[-1e3, 0.0, 0.0], [1e3, 0.0, 0.0], [0.0, 1e3, 0.0]].map(Vec3::from).to_vec();
        let mesh = TriangleMesh { positions, triangles: vec![[0, 1, 2]], ..TriangleMesh::default() };
        let scene = scene(vec![(SurfaceDesc::Triangles(mesh), DVec3::ZERO)]);
        assert!(empty(&scene, &camera(1e-2), 0.5).is_none());
        assert!(empty(&scene, &camera(1e3), 0.5).is_some());
    }

    #[test]
    fn what_is_behind_the_camera_or_endless_leaves_it_open() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 0.9).unwrap();
        let behind = scene(vec![(triangle(), DVec3::ZERO), (ball(0.3), DVec3::new(0.0, 0.0, 6.0))]);
        assert!(empty(&behind, &camera, 0.5).is_none());
        let floor = SurfaceDesc::Shape(Shape::Plane(Plane::new(DVec3::ZERO, DVec3::Y).unwrap()));
        assert!(empty(&scene(vec![(floor, DVec3::ZERO)]), &camera, 0.5).is_none());
        let lens = camera.clone().with_lens(0.1, None).unwrap();
        assert!(empty(&scene(vec![(triangle(), DVec3::ZERO)]), &lens, 0.5).is_none());
        let nothing = empty(&scene(Vec::new()), &camera, 0.5).unwrap();
        assert!((0..SIZE.1).all(|y| (0..SIZE.0).all(|x| nothing.at(x, y))));
    }
}
