//! What accuracy costs in time, measured on the user's own model and machine.
//!
//! [`result`] is what a measurement comes to: plain data, which reports turn into tables, JSON, charts and pages.
#![forbid(unsafe_code)]

pub mod result;
