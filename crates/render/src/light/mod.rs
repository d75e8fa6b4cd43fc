//! Where light comes from.

pub mod environment;
pub mod studio;
