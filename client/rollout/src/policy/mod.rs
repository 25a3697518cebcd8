//! Policies: processes that answer three queries ([`Remote`]).
//!
//! - [`Host`] starts a policy, and starts it again when it dies or times out.
//! - [`Batched`] lets many episodes query one policy together.
//! - [`run`] shows a policy the observations of an episode and executes its answers.
//! - [`wheelarm_sdk::policy::serve`] is the other side: a program calls it to be a policy.
//! - [`openpi`] queries policies that use openpi's protocol.
//!
//! `wheelarm-policy` defines the rows of state and action. Nothing here knows a task, a
//! file or the layers of a network. A policy that fails costs its episode, not the program.

mod batched;
mod host;
mod interface;
mod observation;
pub mod openpi;
mod remote;
mod run;
mod trivial;

pub use batched::Batched;
pub use host::Host;
pub use interface::{Policy, PolicyError, checked};
pub use remote::{PATIENCE, Remote, listen, listen_at};
pub use run::{PolicyOptions, run};
pub use trivial::{Hold, Repeat};
