//! Episode files of WheelArm: the write-ahead log that a recorder appends to,
//! the HDF5 file that is made of it, reading, checking and showing such files,
//! and turning them into what other people's readers load.
//!
//! No transport in here: a recorder hands over messages as bytes. A file is
//! either complete and says so, or says what it lacks; an existing file is
//! never overwritten, but for [`convert::change`]. All calls into HDF5 take one lock, inside `hdf5`.

#![warn(missing_docs)]

pub mod account;
pub mod align;
pub mod annotate;
pub mod calibration;
pub mod columns;
pub mod composition;
pub mod convert;
pub mod coverage;
pub mod depth;
pub mod ending;
pub mod finish;
mod hdf;
pub mod ids;
pub mod info;
pub mod label;
pub mod log;
pub mod plot;
pub mod pose;
pub mod publish;
pub mod read;
pub mod scenario_text;
pub mod sheet;
pub mod urdf;
pub mod validate;
pub mod video;
pub mod view;
pub mod writer;

pub use hdf::add_texts;
pub use wheelarm_compress as compress;
