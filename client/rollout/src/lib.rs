//! Runs one episode: launches the programs that it needs and drives it.

#![warn(missing_docs)]

mod label;
pub mod launcher;
pub mod limits;
pub mod policy;
pub mod protocol;

pub use label::free_label;
