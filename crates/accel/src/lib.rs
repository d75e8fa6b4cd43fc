//! Trees over meshes and shapes, and the queries they answer.
//!
//! obvhs builds the trees; the layouts, the traversal and every intersection are our own. World space is f64; f32
//! begins inside an instance.
//!
//! ```
//! use firsthit_accel::{Geometry, SceneBuilder};
//! use firsthit_geometry::Ray;
//! use glam::{DAffine3, DVec3, Vec3};
//!
//! let mut builder = SceneBuilder::default();
//! let mesh = builder.add_mesh(vec![Geometry::Triangles {
//!     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
//!     triangles: vec![[0, 1, 2]],
//! }]);
//! builder.add_instance(mesh, DAffine3::from_translation(DVec3::new(0.0, 0.0, -5.0)));
//! let scene = builder.build()?;
//!
//! let hit = scene.closest_hit(&Ray::new(DVec3::new(0.25, 0.25, 0.0), DVec3::NEG_Z)).unwrap();
//! assert_eq!((hit.id.instance, hit.id.geometry, hit.id.primitive), (0, 0, 0));
//! assert_eq!(hit.t, 5.0);
//! assert!(scene.any_hit(&Ray::segment(DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.25, 0.25, -9.0))));
//! # Ok::<(), firsthit_accel::BuildError>(())
//! ```

#![deny(unsafe_code)]

mod above;
mod build;
mod build_options;
mod builder;
mod error;
#[cfg(feature = "import")]
mod follow;
mod groups;
mod guards;
mod hit;
mod instance;
mod kernel;
mod layout;
mod local;
mod memory;
mod model;
mod moments;
mod nearest;
mod normalise;
mod offer;
mod order;
mod packet;
#[allow(unsafe_code, reason = "advice to the system about memory")]
mod pages;
mod progress;
mod query;
pub mod reference;
mod refit;
mod region;
mod renew;
mod saved;
mod scene;
#[allow(unsafe_code, reason = "the room for instructions of the processor")]
mod simd;
mod single;
mod solid;
mod stats;
mod surface_point;
mod traverse;
mod update;
mod user;
mod validate;
mod visit_order;
mod wide;

pub use build_options::{BuildOptions, BuildQuality, Layout};
pub use builder::{Geometry, SceneBuilder};
pub use error::BuildError;
pub use groups::GroupMember;
pub use guards::Guards;
pub use hit::{Hit, HitId, SurfacePoint, TraversalCounts};
pub use moments::Moments;
pub use query::{ClosestPoint, Crossings, HitLists};
pub use region::{BodyHit, CurveSegment, Part, Separation, SphereHit, View, VisitedTriangle, Visitor};
pub use renew::Followed;
pub use saved::SavedTreesError;
pub use scene::{Scene, SceneStats};
pub use simd::Level;
pub use solid::{SignMethod, Solid};
pub use update::SceneUpdate;
pub use user::UserPrimitives;
pub use validate::{InvalidTree, TreeFault};
#[doc(hidden)]
pub use visit_order::VisitOrder;
