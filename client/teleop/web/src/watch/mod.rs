//! State for a person at the controls: [`ServerConnection`] keeps a connection open, [`Situation`]
//! stores the newest samples and status. This module sends no commands.

mod files;
mod hand;
mod server_connection;
mod situation;

pub use files::{Files, Verdict};
pub use hand::chair_directions;
pub use server_connection::{ConnectionEvent, ServerConnection};
pub use situation::{Connection, Happening, Situation, Target};

#[cfg(test)]
pub(crate) mod tests;
