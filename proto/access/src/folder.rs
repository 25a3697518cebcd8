//! The folder of keys on the server's host.
//!
//! ```text
//! keys/                      mode 0700
//!   ca.pem  ca.key           the authority; ca.key is needed only to sign
//!   server.pem  server.key   for every server of this host
//!   users.toml               users, roles and passwords
//!   users/NAME/              bundle of a user: ca.pem user.pem user.key about.toml
//! ```

use std::fs;
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use rustls_pki_types::pem::PemObject;
use rustls_pki_types::{CertificateDer, PrivateKeyDer};
use serde::{Deserialize, Serialize};
use wheelarm_proto::bundle;

use super::authority::{self, LONGEST_DAYS, Pair, SHORTEST_DAYS};
use super::{AccessError, Role, Users};

/// Common name of the servers' certificates; reserved.
pub const SERVER: &str = "wheelarm-server";

const AUTHORITY: &str = bundle::AUTHORITY;
const AUTHORITY_KEY: &str = "ca.key";
const CERTIFICATE: &str = "server.pem";
const KEY: &str = "server.key";
const USERS: &str = "users.toml";

/// A folder of keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    path: PathBuf,
}

/// A server's certificates and private key, for rustls.
#[derive(Debug)]
pub struct ServerIdentity {
    /// The server's certificate, followed by its issuers.
    pub certificates: Vec<CertificateDer<'static>>,
    /// Its private key.
    pub key: PrivateKeyDer<'static>,
}

/// Description of a user's keys, for people and programs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct About {
    /// Name of the user.
    pub user: String,
    /// Its role when the keys were made.
    pub role: Role,
    /// Last day of the certificate's validity, `YYYY-MM-DD`, UTC.
    pub until: String,
}

impl About {
    /// Reads the description next to a user's keys; `None` when it does not exist.
    #[must_use]
    pub fn beside(folder: &Path) -> Option<Self> {
        let text = fs::read_to_string(folder.join(bundle::ABOUT)).ok()?;
        toml::from_str(&text).ok()
    }

    /// Whether the certificate has expired.
    #[must_use]
    pub fn is_over(&self) -> bool {
        // Dates in this form sort by time.
        self.until < authority::last_day(0)
    }
}

impl Folder {
    /// Opens a folder with the files of a server.
    ///
    /// # Errors
    /// [`AccessError::NoKeys`] with the missing file.
    pub fn open(path: &Path) -> Result<Self, AccessError> {
        for missing in [AUTHORITY, CERTIFICATE, KEY, USERS] {
            if !path.join(missing).is_file() {
                return Err(AccessError::NoKeys {
                    folder: path.display().to_string(),
                    missing,
                });
            }
        }
        let path = std::path::absolute(path).map_err(AccessError::file("finding", path))?;
        Ok(Self { path })
    }

    /// Creates an authority, a server's certificate for `hosts` and an empty users
    /// file.
    ///
    /// # Errors
    /// [`AccessError::KeysAreThere`], [`AccessError::File`].
    pub fn init(path: &Path, hosts: &[String]) -> Result<Self, AccessError> {
        if [AUTHORITY, AUTHORITY_KEY, KEY, USERS]
            .iter()
            .any(|name| path.join(name).exists())
        {
            return Err(AccessError::KeysAreThere {
                folder: path.display().to_string(),
            });
        }
        let authority = authority::new_authority()?;
        let server = authority::new_server(&authority.key, SERVER, hosts)?;
        make_private(path)?;
        write_private(&path.join(AUTHORITY_KEY), authority.key.as_bytes())?;
        write_private(&path.join(AUTHORITY), authority.certificate.as_bytes())?;
        write_private(&path.join(KEY), server.key.as_bytes())?;
        write_private(&path.join(CERTIFICATE), server.certificate.as_bytes())?;
        Users::default().save(&path.join(USERS))?;
        Self::open(path)
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The authority's certificate.
    #[must_use]
    pub fn authority(&self) -> PathBuf {
        self.path.join(AUTHORITY)
    }

    /// The server's certificate.
    #[must_use]
    pub fn certificate(&self) -> PathBuf {
        self.path.join(CERTIFICATE)
    }

    /// The server's private key.
    #[must_use]
    pub fn key(&self) -> PathBuf {
        self.path.join(KEY)
    }

    /// Path of the users file.
    #[must_use]
    pub fn users_file(&self) -> PathBuf {
        self.path.join(USERS)
    }

    /// The users.
    ///
    /// # Errors
    /// As [`Users::load`].
    pub fn users(&self) -> Result<Users, AccessError> {
        Users::load(&self.users_file())
    }

    /// The server's certificates and key, for rustls.
    ///
    /// # Errors
    /// [`AccessError::Crypto`] when they cannot be read.
    pub fn server_identity(&self) -> Result<ServerIdentity, AccessError> {
        const DOING: &str = "cannot read the server's certificate";
        let certificates = CertificateDer::pem_file_iter(self.certificate())
            .and_then(Iterator::collect::<Result<Vec<_>, _>>)
            .map_err(AccessError::crypto(DOING))?;
        if certificates.is_empty() {
            return Err(AccessError::crypto(DOING)("the file contains none"));
        }
        let key = PrivateKeyDer::from_pem_file(self.key())
            .map_err(AccessError::crypto("cannot read the server's private key"))?;
        Ok(ServerIdentity { certificates, key })
    }

    /// Bundle folder of a user.
    #[must_use]
    pub fn bundle(&self, user: &str) -> PathBuf {
        self.path.join(bundle::USERS).join(user)
    }

    /// Issues new keys for a user, valid for `days`, and returns their folder. Earlier
    /// ones stay valid until their own last day.
    ///
    /// # Errors
    /// [`AccessError::Unknown`], [`AccessError::Days`], [`AccessError::NoKeys`] when
    /// the authority's key is not in this folder.
    pub fn issue(&self, user: &str, days: u32) -> Result<PathBuf, AccessError> {
        if !(SHORTEST_DAYS..=LONGEST_DAYS).contains(&days) {
            return Err(AccessError::Days {
                least: SHORTEST_DAYS,
                most: LONGEST_DAYS,
                found: days,
            });
        }
        self.issue_for(user, i64::from(days))
    }

    /// As [`Folder::issue`] for any number of days, negative for expired keys, for
    /// tests.
    ///
    /// # Errors
    /// As [`Folder::issue`].
    pub fn issue_for(&self, name: &str, days: i64) -> Result<PathBuf, AccessError> {
        let users = self.users()?;
        let user = users.get(name).ok_or_else(|| users.unknown(name))?;
        let signing = self.path.join(AUTHORITY_KEY);
        if !signing.is_file() {
            return Err(AccessError::NoKeys {
                folder: self.path.display().to_string(),
                missing: AUTHORITY_KEY,
            });
        }
        let signing =
            fs::read_to_string(&signing).map_err(AccessError::file("reading", &signing))?;
        let Pair { certificate, key } = authority::new_user(&signing, name, days)?;
        let about = About {
            user: name.to_owned(),
            role: user.role,
            until: authority::last_day(days),
        };
        let about = toml::to_string(&about).map_err(AccessError::crypto(
            "cannot write the description of a user",
        ))?;
        let authority = self.authority();
        let authority = fs::read(&authority).map_err(AccessError::file("reading", &authority))?;
        let folder = self.bundle(name);
        make_private(&folder)?;
        write_private(&folder.join(bundle::KEY), key.as_bytes())?;
        write_private(&folder.join(bundle::CERTIFICATE), certificate.as_bytes())?;
        write_private(&folder.join(bundle::AUTHORITY), &authority)?;
        write_private(&folder.join(bundle::ABOUT), about.as_bytes())?;
        Ok(folder)
    }

    /// Removes a user's bundle folder. Copies of it are invalid once the user is
    /// removed from the users file.
    ///
    /// # Errors
    /// [`AccessError::File`].
    pub fn discard(&self, user: &str) -> Result<(), AccessError> {
        let folder = self.bundle(user);
        match fs::remove_dir_all(&folder) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
                Err(AccessError::file("removing", &folder)(cause))
            }
            _ => Ok(()),
        }
    }
}

/// Creates a folder with access for its owner only.
fn make_private(path: &Path) -> Result<(), AccessError> {
    let made = fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path);
    made.and_then(|()| fs::set_permissions(path, fs::Permissions::from_mode(0o700)))
        .map_err(AccessError::file("making", path))
}

/// Writes a file with access for its owner only, atomically.
pub(crate) fn write_private(path: &Path, bytes: &[u8]) -> Result<(), AccessError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    let written = fs::OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(&beside)
        .and_then(|mut file| {
            file.set_permissions(fs::Permissions::from_mode(0o600))?;
            file.write_all(bytes)?;
            file.sync_all()
        })
        .and_then(|()| fs::rename(&beside, path));
    written.map_err(AccessError::file("writing", path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::User;

    fn folder() -> (tempfile::TempDir, Folder) {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path().join("keys");
        let hosts = ["localhost".to_owned(), "127.0.0.1".to_owned()];
        let folder = Folder::init(&path, &hosts).unwrap();
        let mut users = folder.users().unwrap();
        users
            .add(User::new("anna", Role::Operator).unwrap())
            .unwrap();
        users.save(&folder.users_file()).unwrap();
        (temporary, folder)
    }

    #[test]
    fn keys_are_private_and_never_overwritten() {
        let (_kept, folder) = folder();
        for path in [folder.key(), folder.path().join(AUTHORITY_KEY)] {
            let mode = fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "{}", path.display());
        }
        let mode = fs::metadata(folder.path()).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        let again = Folder::init(folder.path(), &[]);
        assert!(matches!(again, Err(AccessError::KeysAreThere { .. })));
    }

    #[test]
    fn a_bundle_contains_what_a_client_needs() {
        let (_kept, folder) = folder();
        let bundle = folder.issue("anna", 30).unwrap();
        let own = bundle::Identity::find(&bundle, None).unwrap();
        let named = bundle::Identity::find(folder.path(), Some("anna")).unwrap();
        assert_eq!(own.folder(), named.folder());
        let about = About::beside(&bundle).unwrap();
        assert_eq!((about.user.as_str(), about.role), ("anna", Role::Operator));
        assert!(!about.is_over());
        folder.issue_for("anna", -2).unwrap();
        assert!(About::beside(&bundle).unwrap().is_over());
        folder.discard("anna").unwrap();
        folder.discard("anna").unwrap();
        assert!(bundle::Identity::find(&bundle, None).is_err());
    }

    #[test]
    fn keys_are_issued_to_existing_users_for_a_limited_time() {
        let (_kept, folder) = folder();
        for days in [0, 29, 366] {
            let error = folder.issue("anna", days).unwrap_err();
            assert!(matches!(error, AccessError::Days { .. }), "{error}");
        }
        let error = folder.issue("otto", 30).unwrap_err().to_string();
        assert!(error.contains("available: anna"), "{error}");
        fs::remove_file(folder.path().join(AUTHORITY_KEY)).unwrap();
        let error = folder.issue("anna", 30).unwrap_err().to_string();
        assert!(error.contains(AUTHORITY_KEY), "{error}");
    }

    #[test]
    fn the_servers_identity_is_loaded_for_rustls() {
        let (_kept, folder) = folder();
        let identity = folder.server_identity().unwrap();
        assert_eq!(identity.certificates.len(), 1);
        fs::write(folder.certificate(), "nothing").unwrap();
        assert!(folder.server_identity().is_err());
        fs::copy(folder.authority(), folder.certificate()).unwrap();
        assert!(folder.server_identity().is_ok());
        fs::write(folder.key(), "nothing").unwrap();
        assert!(folder.server_identity().is_err());
    }
}
