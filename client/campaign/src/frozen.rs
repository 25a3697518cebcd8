//! Hashes that freeze files of splits: a frozen file is never changed.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::bail;
use sha2::{Digest, Sha256};

/// Compares a file with the hash in its line `frozen`.
///
/// # Errors
/// When its content has another hash, or none is stated, with the fix.
pub fn check(path: &Path, text: &str, frozen: Option<&str>) -> anyhow::Result<()> {
    let hash = hash(text)?;
    match frozen {
        Some(frozen) if frozen != hash => bail!(
            "{}: the split was frozen as {frozen}, and its content now has {hash}; a frozen split is never changed: undo the change, or give it a file name of its own",
            path.display()
        ),
        Some(_) => Ok(()),
        None => bail!(
            "{}: it is not frozen; when it is final, add the line frozen = \"{hash}\"",
            path.display()
        ),
    }
}

/// Hash of a split or suite without its `frozen` line, 16 hexadecimal digits; independent of
/// comments and the order of lines.
///
/// # Errors
/// When the text is not TOML.
pub fn hash(text: &str) -> anyhow::Result<String> {
    let mut table: toml::Table = text.parse()?;
    table.remove("frozen");
    let digest = Sha256::digest(serde_json::to_string(&sorted(&table.into()))?);
    let digits: Vec<String> = digest[..8].iter().map(|b| format!("{b:02x}")).collect();
    Ok(digits.concat())
}

/// As JSON, with the keys in order.
fn sorted(value: &toml::Value) -> serde_json::Value {
    match value {
        toml::Value::Table(table) => {
            let entries: BTreeMap<_, _> = table
                .iter()
                .map(|(key, v)| (key.clone(), sorted(v)))
                .collect();
            serde_json::Value::from_iter(entries)
        }
        toml::Value::Array(values) => values.iter().map(sorted).collect(),
        other => serde_json::json!(other),
    }
}
