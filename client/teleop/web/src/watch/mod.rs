//! State for a person at the controls: [`Line`] keeps a connection open, [`Situation`]
//! stores the newest samples and status. This module sends no commands.

mod files;
mod hand;
mod line;
mod situation;

pub use files::{Files, Verdict};
pub use hand::seen_from_the_chair;
pub use line::{Heard, Line};
pub use situation::{Connection, Happening, Situation, Target};

#[cfg(test)]
pub(crate) mod tests;
