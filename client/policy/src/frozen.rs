//! Hashes that freeze files of splits: a frozen file is never changed.

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

/// A file that is not frozen, or was changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrozenError {
    /// Its content has another hash.
    #[error(
        "the split was frozen as {frozen}, and its content now has {hash}; a frozen split is never changed: undo the change, or give it a file name of its own"
    )]
    Changed {
        /// The stated hash.
        frozen: String,
        /// The hash of the content.
        hash: String,
    },
    /// It states no hash.
    #[error("it is not frozen; when it is final, add the line frozen = \"{0}\"")]
    Open(String),
    /// It is not TOML.
    #[error("{0}")]
    Malformed(String),
}

/// Compares a text with the hash in its line `frozen`.
///
/// # Errors
/// When its content has another hash, or none is stated, with the fix.
pub fn check(text: &str, frozen: Option<&str>) -> Result<(), FrozenError> {
    let hash = hash(text)?;
    match frozen {
        Some(frozen) if frozen != hash => Err(FrozenError::Changed {
            frozen: frozen.to_owned(),
            hash,
        }),
        Some(_) => Ok(()),
        None => Err(FrozenError::Open(hash)),
    }
}

/// Hash of a split or suite without its `frozen` line, 16 hexadecimal digits; independent of
/// comments and the order of lines.
///
/// # Errors
/// When the text is not TOML.
pub fn hash(text: &str) -> Result<String, FrozenError> {
    let mut table: toml::Table = text
        .parse()
        .map_err(|error: toml::de::Error| FrozenError::Malformed(error.to_string()))?;
    table.remove("frozen");
    let digest = Sha256::digest(sorted(&table.into()).to_string());
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
