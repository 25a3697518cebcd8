//! `wheelarm keys` and `wheelarm users`: users of the servers of this host and their roles,
//! kept in files. `wheelarm router`: the same rules in front of many servers.

mod keys;
mod router;
mod secret;
mod users;

pub use keys::{KeysCommand, keys};
pub use router::{RouterArgs, route};
pub use users::{UsersCommand, users};

use std::path::{Path, PathBuf};

use anyhow::Context;

/// The folder of keys, which every command of this module needs.
fn folder(named: Option<&PathBuf>) -> anyhow::Result<&Path> {
    named
        .map(PathBuf::as_path)
        .context("name the folder of keys with --keys DIR or WHEELARM_KEYS")
}
