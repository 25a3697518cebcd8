//! Imports of whole homes, built here: what is in the pack, and what malformed files give.

mod doors;
mod flat;
mod home;
mod malformed;
mod objects;
mod places;
