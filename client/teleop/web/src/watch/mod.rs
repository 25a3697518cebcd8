//! What a person at the controls is told: [`Line`] keeps a connection open,
//! [`Situation`] keeps the newest of everything. Nothing here commands.

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
