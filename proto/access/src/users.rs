//! The file `users.toml`: users with roles and passwords.

use std::fs;
use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use wheelarm_proto::keys::check_name;

use super::folder::{SERVER, write_private};
use super::{AccessError, Role, password};

/// Largest accepted users file, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// One user.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct User {
    /// Name, as in the keys of what it sends: 1 to 64 letters, digits, `-`, `_`.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// Whether an operator also receives full images, as a policy does.
    #[serde(
        default,
        rename = "pictures",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub images: bool,
    /// When it was added, s since 1970: certificates of an earlier user of this name
    /// are invalid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    since: Option<i64>,
    /// Argon2id hash of its password, for the web page; `None` for certificates only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    password: Option<String>,
}

impl std::fmt::Debug for User {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("User")
            .field("name", &self.name)
            .field("role", &self.role)
            .field("images", &self.images)
            .field("has_password", &self.has_password())
            .finish()
    }
}

impl User {
    /// A user without a password.
    ///
    /// # Errors
    /// [`AccessError::Name`], [`AccessError::Reserved`].
    pub fn new(name: &str, role: Role) -> Result<Self, AccessError> {
        let user = Self {
            name: name.to_owned(),
            role,
            images: false,
            since: None,
            password: None,
        };
        user.check()?;
        Ok(user)
    }

    /// The user who runs the server.
    pub(crate) fn local() -> Self {
        Self {
            name: "local".to_owned(),
            role: Role::Admin,
            images: false,
            since: None,
            password: None,
        }
    }

    /// Its name in the rules of a process that follows the users file: name, role and `images`. A
    /// connection with another role is another subject.
    #[must_use]
    pub(crate) fn subject(&self) -> String {
        let images = if self.images { " images" } else { "" };
        format!("{} {}{images}", self.name, self.role)
    }

    /// Whether a certificate issued at this time, s since 1970, belongs to this user
    /// and not to an earlier one of the same name.
    #[must_use]
    pub(crate) fn owns_issue(&self, issued: i64) -> bool {
        self.since.is_none_or(|since| issued >= since)
    }

    /// Whether it can log in with a password.
    #[must_use]
    pub fn has_password(&self) -> bool {
        self.password.is_some()
    }

    fn check(&self) -> Result<(), AccessError> {
        check_name(&self.name)?;
        match self.name == SERVER {
            true => Err(AccessError::Reserved(self.name.clone())),
            false => Ok(()),
        }
    }
}

/// All users.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Users {
    /// In the order of the file.
    #[serde(default, rename = "user", skip_serializing_if = "Vec::is_empty")]
    users: Vec<User>,
}

impl Users {
    /// Reads a users file.
    ///
    /// # Errors
    /// [`AccessError::File`], [`AccessError::Users`] with line and fix.
    pub fn load(path: &Path) -> Result<Self, AccessError> {
        Self::parse(path, &Self::text(path)?)
    }

    /// The text of a users file.
    pub(crate) fn text(path: &Path) -> Result<String, AccessError> {
        let mut text = String::new();
        fs::File::open(path)
            .and_then(|file| file.take(MOST_BYTES + 1).read_to_string(&mut text))
            .map_err(AccessError::file("reading", path))?;
        match text.len() as u64 > MOST_BYTES {
            false => Ok(text),
            true => Err(AccessError::Users {
                path: path.to_owned(),
                why: format!("it has more than {MOST_BYTES} bytes"),
            }),
        }
    }

    /// Parses the text of the file at `path`.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<Self, AccessError> {
        Self::read(text).map_err(|why| AccessError::Users {
            path: path.to_owned(),
            why,
        })
    }

    /// Parses the text of a users file.
    ///
    /// # Errors
    /// What is wrong.
    pub fn read(text: &str) -> Result<Self, String> {
        let read: Self = toml::from_str(text).map_err(|e| e.to_string())?;
        for (i, user) in read.users.iter().enumerate() {
            user.check().map_err(|e| e.to_string())?;
            if read.users[..i].iter().any(|other| other.name == user.name) {
                return Err(format!("the user {:?} is listed twice", user.name));
            }
            if user.images && user.role != Role::Operator {
                return Err(format!(
                    "{:?} is not an operator: remove its key `pictures`, because a {} has the images of its role",
                    user.name, user.role
                ));
            }
            if let Some(hash) = &user.password {
                password::check(hash).map_err(|why| {
                    format!(
                        "the password of {:?} is invalid: {why}; set it with `wheelarm users password`",
                        user.name
                    )
                })?;
            }
        }
        Ok(read)
    }

    /// Writes a file with access for its owner only.
    ///
    /// # Errors
    /// [`AccessError::File`].
    pub fn save(&self, path: &Path) -> Result<(), AccessError> {
        let text =
            toml::to_string(self).map_err(AccessError::crypto("cannot write users as TOML"))?;
        write_private(path, text.as_bytes())
    }

    /// The user with this password. Takes as long for an unknown user as for a wrong
    /// password.
    #[must_use]
    pub fn verify(&self, name: &str, password: &str) -> Option<&User> {
        let user = self.get(name);
        let stored = user.and_then(|user| user.password.as_deref());
        let right = password::verify(password, stored);
        user.filter(|_| right)
    }

    /// A user by name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&User> {
        self.users.iter().find(|user| user.name == name)
    }

    /// All users, in the order of the file.
    pub fn iter(&self) -> impl Iterator<Item = &User> {
        self.users.iter()
    }

    /// Whether the list of users is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.users.is_empty()
    }

    /// Adds a user, with the present time.
    ///
    /// # Errors
    /// [`AccessError::Taken`], [`AccessError::Name`], [`AccessError::Reserved`].
    pub fn add(&mut self, mut user: User) -> Result<(), AccessError> {
        user.check()?;
        user.since = Some(OffsetDateTime::now_utc().unix_timestamp());
        if self.get(&user.name).is_some() {
            return Err(AccessError::Taken(user.name));
        }
        self.users.push(user);
        Ok(())
    }

    /// Changes a user's role; `images` applies to operators.
    ///
    /// # Errors
    /// [`AccessError::Unknown`].
    pub fn set_role(&mut self, name: &str, role: Role, images: bool) -> Result<(), AccessError> {
        let unknown = self.unknown(name);
        let user = self.users.iter_mut().find(|user| user.name == name);
        let user = user.ok_or(unknown)?;
        user.role = role;
        user.images = images && role == Role::Operator;
        Ok(())
    }

    /// Removes a user.
    ///
    /// # Errors
    /// [`AccessError::Unknown`].
    pub fn remove(&mut self, name: &str) -> Result<User, AccessError> {
        let at = self.users.iter().position(|user| user.name == name);
        let at = at.ok_or_else(|| self.unknown(name))?;
        Ok(self.users.remove(at))
    }

    /// Sets or removes a password.
    ///
    /// # Errors
    /// [`AccessError::Unknown`], [`AccessError::Password`].
    pub fn set_password(&mut self, name: &str, new: Option<&str>) -> Result<(), AccessError> {
        let hash = new.map(password::hash).transpose()?;
        let unknown = self.unknown(name);
        let user = self.users.iter_mut().find(|user| user.name == name);
        user.ok_or(unknown)?.password = hash;
        Ok(())
    }

    /// The error for an unknown user.
    pub(crate) fn unknown(&self, name: &str) -> AccessError {
        let found: Vec<&str> = self.users.iter().map(|user| user.name.as_str()).collect();
        AccessError::Unknown {
            name: name.to_owned(),
            found: match found.is_empty() {
                true => "none".to_owned(),
                false => found.join(", "),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn users() -> Users {
        let mut users = Users::default();
        for (name, role) in [("anna", Role::Operator), ("veit", Role::Viewer)] {
            users.add(User::new(name, role).unwrap()).unwrap();
        }
        users
    }

    #[test]
    fn a_password_matches_only_its_own_user() {
        let mut users = users();
        users.set_password("anna", Some("correct horse")).unwrap();
        let verified = users.verify("anna", "correct horse");
        assert_eq!(verified.map(|user| user.role), Some(Role::Operator));
        for (name, password) in [
            ("anna", "wrong horse!"),
            ("anna", ""),
            ("veit", "correct horse"),
            ("veit", ""),
            ("unknown", "correct horse"),
            ("anna", &"x".repeat(100_000)),
        ] {
            assert_eq!(users.verify(name, password), None, "{name}");
        }
        users.set_password("anna", None).unwrap();
        assert_eq!(users.verify("anna", "correct horse"), None);
    }

    #[test]
    fn a_file_survives_a_round_trip_without_plain_passwords() {
        let mut users = users();
        users.set_password("anna", Some("correct horse")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users.toml");
        users.save(&path).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(
            text.contains("$argon2id$") && !text.contains("horse"),
            "{text}"
        );
        assert!(!format!("{users:?}").contains("argon2id"));
        assert_eq!(Users::load(&path).unwrap(), users);
        use std::os::unix::fs::PermissionsExt;
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn errors_in_a_file_include_the_fix() {
        let bcrypt = "$2b$12$R9h/cIPz0gi.URNNX3kh2OPST9/PgBkqquzi.Ss7KIUgO2t0jWMUW";
        let costly =
            "$argon2id$v=19$m=4194304,t=2,p=1$c29tZXNhbHQ$RdescudvJCsgt3ub+b0h8nTLvX5hJgtw";
        for (text, words) in [
            ("[[user]]\nname = \"a\"", "missing field `role`"),
            ("[[user]]\nname = \"a\"\nrole = \"king\"", "unknown variant"),
            ("[[user]]\nname = \"a b\"\nrole = \"viewer\"", "letters"),
            (
                "[[user]]\nname = \"a\"\nrole = \"viewer\"\nrole2 = 1",
                "unknown field",
            ),
            (
                "[[user]]\nname = \"wheelarm-server\"\nrole = \"viewer\"",
                "servers",
            ),
            (
                "[[user]]\nname = \"a\"\nrole = \"viewer\"\npictures = true",
                "not an operator",
            ),
            (
                "[[user]]\nname = \"a\"\nrole = \"viewer\"\n[[user]]\nname = \"a\"\nrole = \"admin\"",
                "twice",
            ),
            (
                &format!("[[user]]\nname = \"a\"\nrole = \"viewer\"\npassword = \"{bcrypt}\""),
                "wheelarm users password",
            ),
            (
                &format!("[[user]]\nname = \"a\"\nrole = \"viewer\"\npassword = \"{costly}\""),
                "KiB",
            ),
        ] {
            let error = Users::read(text).unwrap_err();
            assert!(error.contains(words), "{text}\n{error}");
        }
        assert!(Users::read("").unwrap().is_empty());
    }

    #[test]
    fn a_malicious_users_file_is_an_error_without_a_panic() {
        let deep = 200_000;
        for text in [
            format!("user = {}", "[".repeat(deep)),
            format!("user = {}", "{a=".repeat(deep)),
            format!("{}a = 1", "a.".repeat(deep)),
            format!("[{}a]", "a.".repeat(deep)),
            format!("[[{}a]]", "user.".repeat(deep)),
            format!("user = \"{}\"", "x".repeat(deep)),
        ] {
            assert!(Users::read(&text).is_err(), "{}", &text[..20]);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users.toml");
        fs::write(&path, " ".repeat(2 << 20)).unwrap();
        let error = Users::load(&path).unwrap_err().to_string();
        assert!(error.contains("bytes"), "{error}");
    }

    #[test]
    fn no_user_is_added_or_removed_twice() {
        let mut users = users();
        let again = users.add(User::new("anna", Role::Admin).unwrap());
        assert!(matches!(again, Err(AccessError::Taken(_))));
        users.remove("anna").unwrap();
        let error = users.remove("anna").unwrap_err().to_string();
        assert!(error.contains("available: veit"), "{error}");
        assert!(matches!(
            users.set_password("veit", Some("short")),
            Err(AccessError::Password { found: 5, .. })
        ));
    }
}
