//! What can be wrong with users and keys, in words that name the cure.

use std::path::{Path, PathBuf};

use wheelarm_proto::keys::BadName;

/// What can be wrong with users and keys.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// A file cannot be read or written.
    #[error("{doing} {path}: {cause}")]
    File {
        /// Reading, writing or making.
        doing: &'static str,
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The folder holds no keys.
    #[error(
        "{folder} holds no {missing}: make the keys with `wheelarm keys init --keys {folder}`, or name another folder"
    )]
    NoKeys {
        /// Where they were looked for.
        folder: String,
        /// File that is not there.
        missing: &'static str,
    },
    /// There are keys already.
    #[error(
        "{folder} holds keys already: with new ones every user's would be worth nothing; name another folder, or remove this one first"
    )]
    KeysAreThere {
        /// Where.
        folder: String,
    },
    /// The users' file cannot be understood.
    #[error("{path} is no file of users: {why}")]
    Users {
        /// Which file.
        path: PathBuf,
        /// What is wrong, with the line.
        why: String,
    },
    /// A name cannot stand in a key.
    #[error(transparent)]
    Name(#[from] BadName),
    /// A name belongs to servers.
    #[error("no user may be called {0:?}: servers are")]
    Reserved(String),
    /// There is such a user.
    #[error("there is a user {0:?} already: remove it first, or choose another name")]
    Taken(String),
    /// There is no such user.
    #[error("there is no user {name:?} (there are: {found}): add it with `wheelarm users add`")]
    Unknown {
        /// Who was asked for.
        name: String,
        /// Who is there.
        found: String,
    },
    /// A password is too short or too long.
    #[error("a password has {least} to {most} characters, this one has {found}")]
    Password {
        /// Fewest characters.
        least: usize,
        /// Most.
        most: usize,
        /// How many it has.
        found: usize,
    },
    /// A certificate cannot be as asked.
    #[error("a user's certificate is valid for {least} to {most} days, not {found}")]
    Days {
        /// Fewest days.
        least: u32,
        /// Most.
        most: u32,
        /// What was asked for.
        found: u32,
    },
    /// Cryptography failed.
    #[error("{doing} failed: {cause}")]
    Crypto {
        /// What was tried.
        doing: &'static str,
        /// In the library's words.
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
