//! Language about a scene: a [`Grammar`] loaded from `assets/language`, a generator
//! ([`generate`]) and a parser ([`Parser`]).
//!
//! Pure: no clock, no messages, independent of server and clients. The parser uses only
//! the grammar's files and the scene, never the generator's intent; the generator
//! returns only sentences that the parser understands as intended.
//!
//! Left, right, in front and behind are relative to a person in a chair that faces the
//! area: see [`space`].

#[cfg(test)]
extern crate self as wheelarm_language;

#[cfg(test)]
mod agreement_tests;
mod chart;
mod entries;
mod file;
mod generator;
mod grammar;
mod home;
mod home_words;
#[cfg(test)]
mod home_words_tests;
#[cfg(test)]
#[path = "../tests/made_up/mod.rs"]
#[expect(dead_code, reason = "the tests of the crate need more of it")]
mod made_up;
mod meaning;
mod object_words;
#[cfg(test)]
mod object_words_tests;
mod parse;
mod question;
mod random;
mod read;
mod scene;
#[cfg(test)]
mod sentence_tests;
pub mod space;
mod wording;
mod words;

pub use generator::{Options, Sentence, Wish, generate};
pub use grammar::{FILES, Grammar, GrammarError, Split, Verb};
pub use home::{Home, HomeArea, HomeError};
pub use meaning::Meaning;
pub use parse::{Answer, Parser};
pub use scene::{Area, Entity, Role, Scene, kind_of};
pub use words::{is_plural, normalised};
