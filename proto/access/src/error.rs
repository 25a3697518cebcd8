//! Errors of users and keys, with their fix.

use std::path::{Path, PathBuf};

use wheelarm_proto::keys::BadName;

/// Errors of users and keys.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// A file error.
    #[error("{doing} {path}: {cause}")]
    File {
        /// What was attempted.
        doing: &'static str,
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// Missing keys.
    #[error(
        "{folder} does not contain {missing}: create the keys with `wheelarm keys init --keys {folder}`, or name another folder"
    )]
    NoKeys {
        /// Folder that was searched.
        folder: String,
        /// Missing file.
        missing: &'static str,
    },
    /// Keys exist already.
    #[error(
        "{folder} already contains keys, and new ones would invalidate every user's: name another folder, or remove this one first"
    )]
    KeysAreThere {
        /// The folder.
        folder: String,
    },
    /// An invalid users file.
    #[error("{path} is not a users file: {why}")]
    Users {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the line.
        why: String,
    },
    /// An invalid name.
    #[error(transparent)]
    Name(#[from] BadName),
    /// A reserved name.
    #[error("no user may have the name {0:?}: it is reserved for servers")]
    Reserved(String),
    /// A user that exists already.
    #[error("a user {0:?} exists already: remove it first, or choose another name")]
    Taken(String),
    /// An unknown user.
    #[error("unknown user {name:?} (available: {found}): add it with `wheelarm users add`")]
    Unknown {
        /// Requested user.
        name: String,
        /// Existing users.
        found: String,
    },
    /// A password of invalid length.
    #[error("a password has {least} to {most} characters, this one has {found}")]
    Password {
        /// Fewest characters.
        least: usize,
        /// Most.
        most: usize,
        /// How many it has.
        found: usize,
    },
    /// An invalid validity of a certificate.
    #[error("a user's certificate is valid for {least} to {most} days, not {found}")]
    Days {
        /// Fewest days.
        least: u32,
        /// Most.
        most: u32,
        /// Requested days.
        found: u32,
    },
    /// An error of cryptography.
    #[error("{doing} failed: {cause}")]
    Crypto {
        /// What was attempted.
        doing: &'static str,
        /// Message of the library.
        cause: String,
    },
}

impl AccessError {
    pub(crate) fn file(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::File { doing, path, cause }
    }

    pub(crate) fn crypto<E: std::fmt::Display>(doing: &'static str) -> impl FnOnce(E) -> Self {
        move |cause| Self::Crypto {
            doing,
            cause: cause.to_string(),
        }
    }
}
