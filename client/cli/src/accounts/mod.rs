//! `wheelarm keys` and `wheelarm users`: who may connect to the servers of this
//! host, and what each may do there. They work on files alone. `wheelarm router`: the
//! same rules in front of many servers.

mod keys;
mod router;
mod secret;
mod users;

pub use keys::{KeysCommand, keys};
pub use router::{RouterArgs, route};
pub use users::{UsersCommand, users};

use std::path::{Path, PathBuf};

use anyhow::Context;

/// The folder of keys, which every command here needs.
fn folder(named: Option<&PathBuf>) -> anyhow::Result<&Path> {
    named
        .map(PathBuf::as_path)
        .context("name the folder of keys with --keys DIR or WHEELARM_KEYS")
}
