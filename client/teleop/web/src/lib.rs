//! Driving from a browser: `wheelarm drive`, a gateway between browsers and one server, with
//! one origin and one port.
//!
//! [`model`] decides and is pure: intents of pages become commands. It and [`motion`] hold
//! every safety rule. [`hub`] is the one thread that executes its decisions, [`site`]
//! answers HTTP, `socket` serves the WebSockets, [`skills`] runs the scripted operator for
//! an object that the person selected. [`watch`], [`arm`], [`pending_operation`] and [`send`] are
//! shared with the terminal (`wheelarm teleop`).
//!
//! A browser never reaches the server, and no message moves the robot without the model. An
//! intent carries a number, its press (epoch) and the tick of the displayed image, so that
//! the gate measures the same loop. A press that ended never moves the robot again.

#![warn(missing_docs)]

pub mod arm;
mod audit;
pub mod encode;
pub mod feed;
mod files;
pub mod gateway;
pub mod hub;
pub mod ladder;
pub mod model;
pub mod motion;
pub mod password_attempts;
pub mod pending_operation;
pub mod phase;
pub mod pipe;
mod places;
pub mod preview;
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
pub mod visitor;
pub mod watch;

pub use gateway::{Gateway, Options};
