//! The folder of keys that a user carries: how its files are called.

use std::path::{Path, PathBuf};

/// Certificate of the authority that signed the server's and the user's.
pub const AUTHORITY: &str = "ca.pem";
/// Certificate of the user; its common name is the user's name.
pub const CERTIFICATE: &str = "user.pem";
/// Private key of the user.
pub const KEY: &str = "user.key";
/// Who the user is, for people and programs, as TOML.
pub const ABOUT: &str = "about.toml";
/// Folder of all users' bundles in a folder of keys.
pub const USERS: &str = "users";

/// Variable of the environment that names a folder of keys where no option does.
pub const KEYS_VARIABLE: &str = "WHEELARM_KEYS";
/// Variable that names the user of that folder.
pub const USER_VARIABLE: &str = "WHEELARM_USER";

/// Files by which a user shows who it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Certificate of the authority.
    pub authority: PathBuf,
    /// Certificate of the user.
    pub certificate: PathBuf,
    /// Private key of the user.
    pub key: PathBuf,
}

/// No keys lie where they were looked for.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "{folder} holds no {missing}: name the folder that you were given (--keys DIR), or on the \
     server's host its folder of keys with --user NAME, after `wheelarm keys user NAME`"
)]
pub struct NoIdentity {
    /// Where it was looked for.
    pub folder: String,
    /// File that is not there.
    pub missing: &'static str,
}

impl Identity {
    /// The identity in a user's own folder, or of `user` in a folder of all keys.
    ///
    /// # Errors
    /// [`NoIdentity`] when a file is not there.
    pub fn find(folder: &Path, user: Option<&str>) -> Result<Self, NoIdentity> {
        let folder = match user {
            // Who has one bundle only may say its name all the same.
            Some(user) if folder.join(USERS).is_dir() => folder.join(USERS).join(user),
            _ => folder.to_owned(),
        };
        let file = |name: &'static str| {
            let path = folder.join(name);
            match path.is_file() {
                true => Ok(path),
                false => Err(NoIdentity {
                    folder: folder.display().to_string(),
                    missing: name,
                }),
            }
        };
        Ok(Self {
            authority: file(AUTHORITY)?,
            certificate: file(CERTIFICATE)?,
            key: file(KEY)?,
        })
    }

    /// As [`Identity::find`] where the environment says, if it does.
    ///
    /// # Errors
    /// As [`Identity::find`].
    pub fn of_environment() -> Result<Option<Self>, NoIdentity> {
        let user = std::env::var(USER_VARIABLE).ok();
        std::env::var_os(KEYS_VARIABLE)
            .map(|folder| Self::find(Path::new(&folder), user.as_deref()))
            .transpose()
    }

    /// The folder that it lies in.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.key.parent().unwrap_or(Path::new("."))
    }
}
