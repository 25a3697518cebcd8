//! Episode files of WheelArm: the write-ahead log of a recorder, the HDF5 file made from it,
//! reading, checking and plotting such files, and exports for other readers.
//!
//! The crate has no transport: a recorder passes messages as bytes. A file states whether it
//! is complete. An existing file is never overwritten, except by [`convert::change`]. All
//! calls into HDF5 share one lock, inside `hdf5`.
//!
//! `columns` is the one table between file and message, in both directions: exports and
//! replay use it. `read` is the only module that opens a recording, because a hostile file
//! can name other files or absurd sizes. `align` and `label` are pure. A row of state and
//! action is made in `wheelarm-policy` only. A result gets its final name by a rename after
//! it is complete (`publish`).

#![warn(missing_docs)]

pub mod account;
pub mod align;
pub mod annotate;
pub mod calibration;
pub mod columns;
pub mod composition;
pub mod convert;
pub mod coverage;
pub mod credits;
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
pub use wheelarm_codec as compress;
