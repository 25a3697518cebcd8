//! Who may do what, with a real server over TLS: every role does what the table in
//! `proto/access` says, and nothing else gets through. The table itself is tried
//! key by key in that package; here stands what only a running server shows.
//!
//! What is refused ends without a word or never arrives. So each refusal is
//! followed, on the same session, by something that is let through and seen: what
//! was sent before it must not have been.

mod changes;
mod lab;
mod programs;
mod rules;
