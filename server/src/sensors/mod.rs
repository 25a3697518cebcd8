//! (being built)

pub mod camera;
