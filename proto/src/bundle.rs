//! Names of the files in a user's key folder.

use std::path::{Path, PathBuf};

/// Certificate of the authority that signed the server's and the user's.
pub const AUTHORITY: &str = "ca.pem";
/// Certificate of the user; its common name is the user's name.
pub const CERTIFICATE: &str = "user.pem";
/// Private key of the user.
pub const KEY: &str = "user.key";
/// Description of the user, for people and programs, as TOML.
pub const ABOUT: &str = "about.toml";
/// Folder with the bundles of all users, in a folder of keys.
pub const USERS: &str = "users";

/// Environment variable that names a folder of keys, as the default of an option.
pub const KEYS_VARIABLE: &str = "WHEELARM_KEYS";
/// Environment variable that names the user in that folder.
pub const USER_VARIABLE: &str = "WHEELARM_USER";

/// Files that identify a user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Certificate of the authority.
    pub authority: PathBuf,
    /// Certificate of the user.
    pub certificate: PathBuf,
    /// Private key of the user.
    pub key: PathBuf,
}

/// The keys are missing.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "{folder} holds no {missing}: name the folder that you were given (--keys DIR), or on the \
     server's host its folder of keys with --user NAME, after `wheelarm keys user NAME`"
)]
pub struct NoIdentity {
    /// Folder that was searched.
    pub folder: String,
    /// Missing file.
    pub missing: &'static str,
}

impl Identity {
    /// The identity in a user's own folder, or of `user` in a folder of all keys.
    ///
    /// # Errors
    /// [`NoIdentity`] when a file is missing.
    pub fn find(folder: &Path, user: Option<&str>) -> Result<Self, NoIdentity> {
        let folder = match user {
            // The user may also be named for a folder with a single bundle.
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

    /// As [`Identity::find`], if the environment names a folder.
    ///
    /// # Errors
    /// As [`Identity::find`].
    pub fn from_environment() -> Result<Option<Self>, NoIdentity> {
        let user = std::env::var(USER_VARIABLE).ok();
        std::env::var_os(KEYS_VARIABLE)
            .map(|folder| Self::find(Path::new(&folder), user.as_deref()))
            .transpose()
    }

    /// Folder of the files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.key.parent().unwrap_or(Path::new("."))
    }
}
