//! What a person says about a scene, and what it means: a [`Grammar`] read from
//! `assets/language`, a speaker ([`say`]) and a parser ([`Parser`]).
//!
//! Pure: no clock, no messages, nothing of the server or of a client. The parser
//! knows the grammar's files and the scene alone, never what the speaker meant;
//! the speaker says nothing that the parser does not take for the same.
//!
//! Left, right, in front and behind are those of who sits in the chair while it
//! stands at an area and looks at it: [`space`] says exactly how.

#[cfg(test)]
extern crate self as wheelarm_language;

mod chart;
mod entries;
mod grammar;
mod home;
#[cfg(test)]
mod law;
mod meaning;
mod parse;
mod question;
mod random;
mod read;
mod say;
mod scene;
pub mod space;
mod wording;
mod words;

pub use grammar::{FILES, Grammar, GrammarError, Split, Verb};
pub use home::{Home, HomeArea, HomeError};
pub use meaning::Meaning;
pub use parse::{Answer, Parser};
pub use say::{Options, Said, Wish, say};
pub use scene::{Area, Role, Scene, Thing, kind_of};
pub use words::{is_plural, normalised};
