//! What accuracy costs in time, measured on the user's own model and machine; and the hard cases and scenarios that
//! say what each tier must have right.
//!
//! * [`run()`] measures: each [`Subject`] at every tier, and with each guard of the robust tier, on the ray sets of
//!   [`workload`], timed by [`timing`], compared with the most careful tier by [`metric`].
//! * [`bench`] measures speed alone: builds and queries, obvhs's own traversals beside them.
//! * [`result`] is what a measurement comes to: plain data, which [`report`] turns into charts and a page.
//! * [`corpus`] runs exact hard cases through every engine at every tier.
//! * [`scenario`] holds what must be so on whole meshes, in any size; [`flat`] is a ray caster of its own for that.
//! * [`picture`] compares pictures.
//! * [`mesh`] and [`random`] make input by rule.
#![forbid(unsafe_code)]

pub mod bench;
pub mod corpus;
pub mod decision;
pub mod flat;
pub mod mesh;
pub mod metric;
pub mod picture;
pub mod random;
pub mod report;
pub mod result;
mod run;
pub mod scenario;
mod shapes;
pub mod subject;
pub mod timing;
pub mod verdict;
pub mod workload;

pub use run::{Effort, MeasureError, Options, run};
pub use subject::Subject;
