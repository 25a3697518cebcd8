//! Networks that learn from recordings: trained, served and measured on the CPU.
//!
//! The only package that names burn. Rows of state and action are made elsewhere
//! (`wheelarm-policy`, `wheelarm dataset export --format tensors`); large networks
//! are trained by the PyTorch programs in `python/`, whose files are read here.

#![warn(missing_docs)]

pub mod baseline;
pub mod card;
pub mod episodes;
mod figure;
pub mod language;
pub mod network;
pub mod picture;
pub mod serve;
pub mod train;
pub mod trained;
pub mod weights;
