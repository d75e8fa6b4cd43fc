//! A ray tracer and ray-query engine for triangle meshes and analytic shapes.
//!
//! # Should I use this?
//! Yes, if you want to
//! * **ask a model for hits**: what does this ray meet first, is anything in the way, for one ray or millions;
//! * **ask it for distances**: the nearest point of the surface, how far it is, whether a point is inside;
//! * **be able to rely on the answers**: no leaks through closed meshes, at any scale and distance from the origin, the
//!   same bits for any number of threads; every error bound is documented;
//! * **turn an OBJ or glTF file into a picture** without setting anything up.
//!
//! No, if you need a GPU, real time for games, physics (parry and rapier do that), or modelling operations on meshes.
//!
//! # Fifteen lines
//! ```
//! use firsthit::glam::DVec3;
//! use firsthit::{BuildOptions, Ray, SceneBuilder};
//!
//! let imported = firsthit::import::open("../../assets/box/Box.glb", &Default::default())?;
//! let scene = SceneBuilder::from_desc(&imported.scene, BuildOptions::default()).build()?;
//!
//! let ray = Ray::new(DVec3::new(0.1, 0.2, 9.0), DVec3::NEG_Z);
//! if let Some(hit) = scene.closest_hit(&ray) {
//!     println!("triangle {} at {}, facing {}", hit.id.primitive, ray.at(hit.t), hit.normal());
//!
//!     // From there: does the light reach the point?
//!     let point = scene.surface_point(&ray, &hit);
//!     let light = DVec3::new(3.0, 5.0, 4.0);
//!     let start = point.spawn(light - point.position);
//!     println!("in shadow: {}", scene.any_hit(&Ray::segment(start, light)));
//! }
//! # assert_eq!(scene.closest_hit(&ray).map(|h| (h.t, h.normal())), Some((8.5, DVec3::Z)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! With triangles in memory, [`SceneBuilder::add_mesh`] takes them, and no file format is compiled in without the
//! feature `import`. `examples/query.rs` and `examples/render.rs` are programs to start from.
//!
//! # Where is what
//! | crate | feature | for |
//! |---|---|---|
//! | [`geometry`] | | rays, boxes, triangles, analytic shapes, clipping, distances: each with its error stated |
//! | [`accel`] | | scenes: trees over instances and meshes, queries |
//! | [`import`] | `import` | OBJ, glTF and scene files |
//! | [`render`] | `render` | materials, lights, cameras, pictures |
//!
//! Both features are on by default. World space is right-handed with +Y up, in metres and f64; [`glam`] supplies the
//! vectors. Rays need no unit direction: `t` counts its lengths.
#![forbid(unsafe_code)]

pub use firsthit_accel as accel;
pub use firsthit_geometry as geometry;
#[cfg(feature = "import")]
pub use firsthit_import as import;
#[cfg(feature = "render")]
pub use firsthit_render as render;
pub use glam;

pub use firsthit_accel::{
    BodyHit, BuildOptions, ClosestPoint, Crossings, CurveSegment, Geometry, GroupMember, Hit, HitId, Moments, Part,
    Scene, SceneBuilder, SceneUpdate, Separation, SignMethod, Solid, SphereHit, SurfacePoint, View, VisitedTriangle,
    Visitor,
};
pub use firsthit_geometry::{Aabb, Precision, Ray, Shape};
