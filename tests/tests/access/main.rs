//! Access rights with a real server over TLS: every role may do what the table in
//! `proto/access` allows and nothing else. That package tests the table key by key; these
//! tests cover what needs a running server.
//!
//! A forbidden sample is dropped without a reply. Each test therefore sends an allowed
//! sample on the same session afterwards: when it arrives, the forbidden one must not have.

mod changes;
mod lab;
mod programs;
mod rules;
