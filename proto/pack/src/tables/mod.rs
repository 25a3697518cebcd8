//! Layout of the TOML files of scenes, objects and materials: one struct per table. Only the
//! keys are checked here; the server checks the values.
//!
//! Lengths are metres, angles degrees (keys ending in `_deg`), masses kg.

pub mod home;
pub mod kind;
pub mod manifest;
pub mod material;
pub mod object;
pub mod part;
pub mod place;
pub mod scene;
