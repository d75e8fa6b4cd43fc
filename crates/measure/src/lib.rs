//! What accuracy costs in time, measured on the user's own model and machine; and the hard cases and scenarios that
//! say what each tier must have right.
//!
//! * [`corpus`] runs exact hard cases through every engine at every tier.
//! * [`picture`] compares pictures.
//! * [`mesh`] and [`random`] make input by rule.
//! * [`result`] is what a measurement comes to: plain data, which [`report`] turns into charts and pages.
#![forbid(unsafe_code)]

pub mod corpus;
pub mod mesh;
pub mod picture;
pub mod random;
pub mod report;
pub mod result;
