//! Driving from anywhere: `wheelarm drive`, a gateway between browsers and one
//! server, with one origin and one port.
//!
//! [`model`] decides and is pure: intents of pages become commands, and every rule of
//! safety stands there and in [`motion`]. [`hub`] is the one thread that carries out
//! what it decides, [`site`] answers HTTP, `socket` serves the WebSockets,
//! [`skills`] takes what somebody pointed at. [`watch`], [`arm`], [`errand`] and
//! [`send`] are shared with the terminal (`wheelarm teleop`).
//!
//! A browser never speaks to the server, and nothing that it sends moves anything
//! without the model.

#![warn(missing_docs)]

pub mod arm;
mod audit;
pub mod encode;
pub mod errand;
pub mod feed;
mod files;
pub mod gateway;
pub mod hub;
pub mod ladder;
pub mod model;
pub mod motion;
pub mod phase;
pub mod pipe;
mod places;
pub mod protocol;
mod rate;
pub mod registry;
pub mod report;
pub mod send;
pub mod session;
pub mod site;
pub mod skills;
pub mod socket;
pub mod speed;
pub mod tries;
pub mod visitor;
pub mod watch;

pub use gateway::{Gateway, Options};
