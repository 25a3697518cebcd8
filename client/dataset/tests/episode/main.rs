//! Laws of episode files: every number survives bit for bit, a log that ends
//! anywhere gives its valid prefix, a full disk loses nothing acknowledged,
//! no file is ever overwritten, and later changes are found.

#[path = "../../examples/synthetic/mod.rs"]
mod synthetic;

mod commands;
mod digests;
mod exact;
mod images;
mod losses;
mod recording;
mod refusals;
