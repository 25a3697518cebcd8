//! Networks that learn from recordings: trained, served and measured on the CPU.
//!
//! The only package that names burn. Other packages make rows of state and action
//! (`wheelarm-policy`, `wheelarm dataset export --format tensors`). The PyTorch programs in
//! `python/` train large networks; this crate reads their files.
//!
//! A policy is one safetensors file with LeRobot's names and a model card in its metadata.
//! `python/network.py` and `src/network` are the same network: `tests/reference.rs` compares
//! Rust with stored answers of PyTorch. Training derives every random choice from the seed
//! and the number of the step, so an interrupted run ends with the same bits.

#![warn(missing_docs)]

pub mod baseline;
pub mod card;
pub mod episodes;
mod figure;
pub mod image;
pub mod language;
pub mod network;
pub mod train;
pub mod trained;
pub mod weights;
