//! Policies at work: a policy is a process of its own that answers three queries
//! ([`Remote`]); one that this program starts is started again when it dies or
//! falls silent ([`Host`]); many episodes ask one policy together ([`Batched`]);
//! and [`fly`] carries its answers out, an episode at a time, in lock-step. [`serve`]
//! is the other side: what a program calls to be a policy. [`openpi`] asks policies that
//! speak that protocol instead.
//!
//! What a row of state or action is stands in `wheelarm-policy`. Nothing here
//! knows a task, a file or a network's layers. A policy that breaks costs the
//! episode that broke it, never the program.

#![warn(missing_docs)]

mod batched;
mod error;
mod eyes;
pub mod fly;
mod host;
pub mod openpi;
mod policy;
mod remote;
mod serve;
mod trivial;

pub use batched::Batched;
pub use host::{Host, NAME_VARIABLE, POLICY_VARIABLE};
pub use policy::{Policy, PolicyError, checked};
pub use remote::{PATIENCE, Remote, listen, listen_at};
pub use serve::{Answers, serve};
pub use trivial::{Hold, Repeat};
