//! Own homes by rules ([`layout`]), what a robot reaches in a home ([`home_report`]), and the
//! places of its tasks ([`home_places`]). [`own_home`] makes the home that a scenario names.
//!
//! Units: metres, z up, angles counter-clockwise. Equal data gives equal bytes on every machine:
//! arithmetic is that of `wheelarm_proto::exact`, and all collections are ordered.

#![warn(missing_docs)]

mod asset_file;
pub mod home_places;
pub mod home_report;
pub mod layout;
pub mod own_home;

pub use asset_file::AssetFileError;
