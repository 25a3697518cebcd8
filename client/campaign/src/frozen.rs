//! Files of splits and suites that are frozen by a hash.

use std::path::Path;

use anyhow::anyhow;
pub use wheelarm_policy::frozen::hash;

/// Compares a file with the hash in its line `frozen`.
///
/// # Errors
/// When its content has another hash, or none is stated, with the fix.
pub fn check(path: &Path, text: &str, frozen: Option<&str>) -> anyhow::Result<()> {
    let checked = wheelarm_policy::frozen::check(text, frozen);
    checked.map_err(|error| anyhow!("{}: {error}", path.display()))
}
