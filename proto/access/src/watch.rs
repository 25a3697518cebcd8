//! Follows the users file: a removed user, a changed role and a changed password take
//! effect within [`PAUSE`] on running servers, routers and gateways.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::authority::issued;
use super::{AccessError, Folder, SERVER, Users};

/// Polling interval. The content is compared, not the modification time, on which
/// network file systems and editors do not agree.
const PAUSE: Duration = Duration::from_millis(500);
/// A changed file is used when it is unchanged after this time; at most this many
/// attempts.
const SETTLE: Duration = Duration::from_millis(30);
const MOST_LOOKS: usize = 10;

/// Called with the users after each change, by the thread that found it.
type OnChange = Box<dyn Fn(&Users) + Send + Sync>;

struct State {
    /// Content of the file at the last reading.
    text: String,
    /// The newest valid users.
    users: Arc<Users>,
    /// Why the file cannot be read now; empty when it can.
    problem: String,
    ended: bool,
}

struct Shared {
    path: PathBuf,
    /// Held while the file is read and `changed` runs, so that the next reader finds
    /// both done. A hanging file system does not block callers who only need the users.
    looking: Mutex<()>,
    state: Mutex<State>,
    end: Condvar,
    changed: OnChange,
}

/// The present users; followed until this is dropped.
pub struct Watch {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Loads the users of a folder and follows them. A file that becomes unreadable
    /// changes nothing until it is readable again: connections stay, and `problem` is
    /// called once with the reason.
    ///
    /// # Errors
    /// As [`Folder::users`], and when no thread can be started.
    pub fn start(
        folder: &Folder,
        changed: impl Fn(&Users) + Send + Sync + 'static,
        problem: impl Fn(&str) + Send + 'static,
    ) -> Result<Self, AccessError> {
        let path = folder.users_file();
        let text = Users::text(&path)?;
        let users = Arc::new(Users::parse(&path, &text)?);
        let shared = Arc::new(Shared {
            path,
            looking: Mutex::default(),
            state: Mutex::new(State {
                text,
                users,
                problem: String::new(),
                ended: false,
            }),
            end: Condvar::new(),
            changed: Box::new(changed),
        });
        let followed = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("users".to_owned())
            .spawn(move || followed.follow(&problem))
            .map_err(AccessError::file("following", &folder.users_file()))?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// The users at the last reading.
    #[must_use]
    pub fn users(&self) -> Arc<Users> {
        Arc::clone(&self.shared.state().users)
    }

    /// Reads the file now.
    ///
    /// # Errors
    /// As [`Folder::users`].
    pub fn reread(&self) -> Result<Arc<Users>, AccessError> {
        self.shared.reread()
    }
}

/// Returns the subject of the rules for the name in a certificate and the start of its
/// validity, s since 1970: see [`Users::subject`].
pub type Subject = Arc<dyn Fn(&str, i64) -> String + Send + Sync>;

/// Follows the users of a folder until the process ends. `admit` receives the
/// certificate of the folder's listeners and the subject of each connection, now and
/// after each change; `problem` is as in [`Watch::start`].
///
/// # Errors
/// As [`Watch::start`].
pub fn follow(
    folder: &Folder,
    admit: impl Fn(&Path, Subject) + Send + Sync + 'static,
    problem: impl Fn(&str) + Send + 'static,
) -> Result<Arc<Users>, AccessError> {
    let certificate = folder.certificate();
    let admit = move |users: &Users| {
        let users = users.clone();
        let subject = move |name: &str, since| users.subject(name, since);
        admit(&certificate, Arc::new(subject));
    };
    let admit = Arc::new(admit);
    let again = Arc::clone(&admit);
    let watch = Watch::start(folder, move |users| again(users), problem)?;
    let users = watch.reread()?;
    admit(&users);
    // The thread ends with the process.
    std::mem::forget(watch);
    Ok(users)
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.state().ended = true;
        self.shared.end.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has already been printed.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn reread(&self) -> Result<Arc<Users>, AccessError> {
        let _turn = self.looking.lock().unwrap_or_else(PoisonError::into_inner);
        let mut text = Users::text(&self.path)?;
        let before = {
            let state = self.state();
            if text == state.text {
                return Ok(Arc::clone(&state.users));
            }
            Arc::clone(&state.users)
        };
        // An editor that writes in place leaves the file empty or truncated for a
        // moment, which would disconnect every user.
        for _ in 0..MOST_LOOKS {
            std::thread::sleep(SETTLE);
            let again = Users::text(&self.path)?;
            if again == text {
                break;
            }
            text = again;
        }
        let users = Arc::new(Users::parse(&self.path, &text)?);
        {
            let mut state = self.state();
            state.text = text;
            state.users = Arc::clone(&users);
        }
        if *users != *before {
            (self.changed)(&users);
        }
        Ok(users)
    }

    fn follow(&self, problem: &dyn Fn(&str)) {
        loop {
            let found = self.reread().err().map(|error| error.to_string());
            let mut state = self.state();
            if state.ended {
                return;
            }
            let found = found.unwrap_or_default();
            let is_new = !found.is_empty() && found != state.problem;
            state.problem.clone_from(&found);
            if is_new {
                drop(state);
                problem(&found);
                state = self.state();
            }
            let waited = self
                .end
                .wait_timeout_while(state, PAUSE, |state| !state.ended);
            if waited.is_ok_and(|(state, _)| state.ended) {
                return;
            }
        }
    }
}

impl Users {
    /// The subject of a connection in the rules, by the name in its certificate and the
    /// start of its validity (s since 1970); see [`crate::Subjects::Roles`]. A name
    /// without a user, now or when the certificate was issued, is a subject without
    /// rules: it connects but may send and receive nothing, and its program can report
    /// that.
    #[must_use]
    pub fn subject(&self, name: &str, not_before: i64) -> String {
        if name == SERVER {
            return SERVER.to_owned();
        }
        let user = self.get(name);
        let user = user.filter(|user| user.owns_issue(issued(not_before)));
        // Subjects of users have more than one word.
        user.map_or_else(|| "stranger".to_owned(), |user| user.subject())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};

    use super::*;
    use crate::{Role, User};

    const PATIENCE: Duration = Duration::from_secs(20);

    struct Lab {
        _temporary: tempfile::TempDir,
        folder: Folder,
        watch: Watch,
        changes: Receiver<Users>,
        problems: Receiver<String>,
    }

    fn lab() -> Lab {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder::init(&temporary.path().join("keys"), &[]).unwrap();
        save(&folder, |users| {
            for name in ["anna", "ben"] {
                users.add(User::new(name, Role::Operator).unwrap()).unwrap();
            }
        });
        let (changed, changes) = channel();
        let (problem, problems) = channel();
        let watch = Watch::start(
            &folder,
            move |users| changed.send(users.clone()).unwrap(),
            move |words| problem.send(words.to_owned()).unwrap(),
        );
        Lab {
            _temporary: temporary,
            folder,
            watch: watch.unwrap(),
            changes,
            problems,
        }
    }

    fn save(folder: &Folder, change: impl Fn(&mut Users)) {
        let mut users = folder.users().unwrap();
        change(&mut users);
        users.save(&folder.users_file()).unwrap();
    }

    #[test]
    fn a_removed_user_and_a_changed_role_take_effect() {
        let lab = lab();
        let valid_from = time::OffsetDateTime::now_utc().unix_timestamp() - 86_400 + 5;
        let subject = |name: &str| lab.watch.users().subject(name, valid_from);
        assert_eq!(subject("anna"), "anna operator");
        assert_eq!(subject(SERVER), SERVER);
        assert_eq!(subject("carl"), "stranger");
        save(&lab.folder, |users| {
            users.remove("ben").unwrap();
            users.set_role("anna", Role::Viewer, false).unwrap();
        });
        let users = lab.changes.recv_timeout(PATIENCE).unwrap();
        assert!(users.get("ben").is_none());
        assert_eq!(subject("anna"), "anna viewer");
        assert_eq!(subject("ben"), "stranger");
        // `look` finds a change at once.
        save(&lab.folder, |users| {
            users.set_password("anna", Some("right and long")).unwrap();
        });
        assert!(
            lab.watch
                .reread()
                .unwrap()
                .get("anna")
                .unwrap()
                .has_password()
        );
    }

    #[test]
    fn an_unreadable_file_removes_no_user() {
        let lab = lab();
        std::fs::write(lab.folder.users_file(), "[[user]").unwrap();
        let problem = lab.problems.recv_timeout(PATIENCE).unwrap();
        assert!(problem.contains("users.toml"), "{problem}");
        assert!(lab.watch.reread().is_err());
        assert!(lab.watch.users().get("anna").is_some());
        assert!(lab.changes.try_recv().is_err());
    }

    #[test]
    fn certificates_of_a_removed_user_are_invalid_for_a_new_one_of_that_name() {
        let mut users = Users::default();
        users
            .add(User::new("anna", Role::Operator).unwrap())
            .unwrap();
        let now = time::OffsetDateTime::now_utc().unix_timestamp();
        let day = 86_400;
        assert_eq!(users.subject("anna", now - day), "anna operator");
        assert_eq!(users.subject("anna", now - day - 60), "stranger");
        // A folder of an older version does not contain the time when users were added.
        let users = Users::read("[[user]]\nname = \"anna\"\nrole = \"viewer\"").unwrap();
        assert_eq!(users.subject("anna", 0), "anna viewer");
    }
}
