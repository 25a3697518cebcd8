//! Sessions of signed-in visitors, and the tickets that open sockets. Times are those
//! of the process; nothing is stored, so that a restart ends every session.
//!
//! A session ends by log-out, by age, when its user is removed or changed, and to make
//! room within its visitor's own share. Its sockets end with it: see [`Life`].

use std::collections::{BTreeMap, VecDeque};
use std::io::Read;
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use tokio::sync::watch;
use wheelarm_access::{User, Users};

use crate::visitor::Visitor;

/// A session ends after this long.
const LONGEST: Duration = Duration::from_secs(12 * 3600);
/// A session that is not used and has no socket ends after this long.
const IDLE: Duration = Duration::from_secs(3600);
/// A ticket is good for this long.
pub const TICKET: Duration = Duration::from_secs(30);
/// Most sessions.
const MOST: usize = 512;
/// Most sessions of one visitor.
const OF_VISITOR: usize = 64;
/// Most open tickets of one session.
const TICKETS: usize = 16;

struct Session {
    visitor: Visitor,
    /// The user's entry when it signed in; none for a link with a token.
    user: Option<User>,
    began: Instant,
    used: Instant,
    tickets: VecDeque<(String, Instant)>,
    ended: watch::Sender<&'static str>,
    /// Shared with every open socket.
    sockets: Arc<()>,
}

impl Session {
    fn has_sockets(&self) -> bool {
        Arc::strong_count(&self.sockets) > 1
    }

    fn is_over(&self, now: Instant) -> bool {
        let idle = !self.has_sockets() && now.saturating_duration_since(self.used) > IDLE;
        idle || now.saturating_duration_since(self.began) > LONGEST
    }
}

/// The life of a session, held by each of its sockets.
#[derive(Clone)]
pub struct Life {
    ended: watch::Receiver<&'static str>,
    _socket: Arc<()>,
}

impl Life {
    /// Waits until the session ends; returns why.
    pub async fn over(&mut self) -> &'static str {
        // The sender is dropped with its session, after it sent the reason.
        let _ = self.ended.wait_for(|why| !why.is_empty()).await;
        *self.ended.borrow()
    }
}

/// Sessions by the value of their cookie.
#[derive(Default)]
pub struct Sessions {
    sessions: Mutex<BTreeMap<String, Session>>,
}

impl Sessions {
    /// Begins a session and returns its cookie's value. `user` is the entry by which
    /// the visitor signed in.
    ///
    /// # Errors
    /// When the host has no random numbers.
    pub fn begin(
        &self,
        visitor: Visitor,
        user: Option<User>,
        now: Instant,
    ) -> std::io::Result<String> {
        let key = secret()?;
        self.sweep(now);
        let mut sessions = self.sessions.lock();
        if count(&sessions, &visitor) >= OF_VISITOR {
            end_oldest_of(&mut sessions, &visitor);
        } else if sessions.len() >= MOST {
            // Viewers make room before those who may drive, the largest share first.
            let largest = sessions.values().map(|session| &session.visitor);
            let largest = largest
                .max_by_key(|visitor| (!visitor.role.may_drive(), count(&sessions, visitor)));
            if let Some(largest) = largest.cloned() {
                end_oldest_of(&mut sessions, &largest);
            }
        }
        let session = Session {
            visitor,
            user,
            began: now,
            used: now,
            tickets: VecDeque::new(),
            ended: watch::Sender::new(""),
            sockets: Arc::default(),
        };
        sessions.insert(key.clone(), session);
        Ok(key)
    }

    /// The visitor of a session, which counts as used now.
    #[must_use]
    pub fn visitor(&self, key: &str, now: Instant) -> Option<Visitor> {
        let mut sessions = self.sessions.lock();
        let session = sessions.get_mut(key).filter(|s| !s.is_over(now))?;
        session.used = now;
        Some(session.visitor.clone())
    }

    /// Ends a session, and its sockets.
    pub fn end(&self, key: &str, why: &'static str) {
        end(&mut self.sessions.lock(), key, why);
    }

    /// Removes expired sessions.
    pub fn sweep(&self, now: Instant) {
        self.end_where("the session is over: sign in again", |s| s.is_over(now));
    }

    /// Ends the sessions of users that were removed or changed: another role, another
    /// password.
    pub fn keep(&self, users: &Users) {
        self.end_where(
            "your user was changed or removed: sign in again",
            |session| {
                let user = session.user.as_ref();
                user.is_some_and(|user| users.get(&user.name) != Some(user))
            },
        );
    }

    fn end_where(&self, why: &'static str, over: impl Fn(&Session) -> bool) {
        let mut sessions = self.sessions.lock();
        sessions.retain(|_, session| {
            let over = over(session);
            if over {
                session.ended.send_replace(why);
            }
            !over
        });
    }

    /// A ticket for the session `key`; `None` when that session does not exist. The
    /// session's oldest ticket is dropped when there are too many.
    ///
    /// # Errors
    /// When the host has no random numbers.
    pub fn ticket(&self, key: &str, now: Instant) -> std::io::Result<Option<String>> {
        let ticket = secret()?;
        let mut sessions = self.sessions.lock();
        let Some(session) = sessions.get_mut(key) else {
            return Ok(None);
        };
        session.tickets.retain(|(_, until)| now < *until);
        if session.tickets.len() >= TICKETS {
            session.tickets.pop_front();
        }
        session.tickets.push_back((ticket.clone(), now + TICKET));
        Ok(Some(ticket))
    }

    /// The visitor of a ticket, which becomes invalid, and the life of the session. Both
    /// the ticket and the cookie of its session are needed.
    #[must_use]
    pub fn enter(
        &self,
        ticket: &str,
        cookie: Option<&str>,
        now: Instant,
    ) -> Option<(Visitor, Life)> {
        let mut sessions = self.sessions.lock();
        let session = sessions.get_mut(cookie?).filter(|s| !s.is_over(now))?;
        let mut tickets = session.tickets.iter();
        let at = tickets.position(|(known, _)| same(known, ticket))?;
        let (_, until) = session.tickets.remove(at)?;
        if now >= until {
            return None;
        }
        session.used = now;
        let life = Life {
            ended: session.ended.subscribe(),
            _socket: Arc::clone(&session.sockets),
        };
        Some((session.visitor.clone(), life))
    }
}

fn count(sessions: &BTreeMap<String, Session>, visitor: &Visitor) -> usize {
    let theirs = sessions.values().filter(|s| s.visitor == *visitor);
    theirs.count()
}

/// Ends one session of a visitor: those without sockets first, then the oldest.
fn end_oldest_of(sessions: &mut BTreeMap<String, Session>, visitor: &Visitor) {
    let theirs = sessions.iter().filter(|(_, s)| s.visitor == *visitor);
    let oldest = theirs.min_by_key(|(_, s)| (s.has_sockets(), s.used));
    if let Some(key) = oldest.map(|(key, _)| key.clone()) {
        end(
            sessions,
            &key,
            "a newer session of yours took this one's place",
        );
    }
}

fn end(sessions: &mut BTreeMap<String, Session>, key: &str, why: &'static str) {
    if let Some(session) = sessions.remove(key) {
        session.ended.send_replace(why);
    }
}

/// 32 random hexadecimal digits.
///
/// # Errors
/// When the host has no random numbers.
pub fn secret() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Compares two secrets in constant time.
#[must_use]
pub fn same(a: &str, b: &str) -> bool {
    let differs = a
        .bytes()
        .zip(b.bytes())
        .fold(0, |all, (a, b)| all | (a ^ b));
    a.len() == b.len() && differs == 0
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;
    use wheelarm_access::Role as UserRole;

    use super::*;
    use crate::visitor::Role;

    fn visitor(name: &str, role: Role) -> Visitor {
        Visitor {
            name: name.to_owned(),
            role,
        }
    }

    fn anna() -> Visitor {
        visitor("anna", Role::Operator)
    }

    fn entered(
        sessions: &Sessions,
        ticket: &str,
        cookie: Option<&str>,
        now: Instant,
    ) -> Option<Visitor> {
        sessions
            .enter(ticket, cookie, now)
            .map(|(visitor, _)| visitor)
    }

    #[test]
    fn a_ticket_opens_one_socket_once_and_with_its_cookie_alone() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let key = sessions.begin(anna(), None, now).unwrap();
        let other = sessions.begin(anna(), None, now).unwrap();
        let ticket = || sessions.ticket(&key, now).unwrap().unwrap();
        let first = ticket();
        assert_eq!(entered(&sessions, &first, Some(&key), now), Some(anna()));
        assert_eq!(entered(&sessions, &first, Some(&key), now), None, "twice");
        assert_eq!(entered(&sessions, &ticket(), None, now), None, "no cookie");
        assert_eq!(entered(&sessions, &ticket(), Some(&other), now), None);
        let later = now + TICKET;
        assert_eq!(entered(&sessions, &ticket(), Some(&key), later), None);
        let last = ticket();
        sessions.end(&key, "signed out");
        assert_eq!(entered(&sessions, &last, Some(&key), now), None);
        assert_eq!(sessions.ticket(&key, now).unwrap(), None, "signed out");
    }

    #[test]
    fn a_session_ends_by_itself_and_not_while_a_socket_is_open() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let key = sessions.begin(anna(), None, now).unwrap();
        let minutes = |m: u64| now + Duration::from_secs(60 * m);
        assert!(sessions.visitor(&key, minutes(59)).is_some());
        assert!(
            sessions.visitor(&key, minutes(118)).is_some(),
            "it was used"
        );
        assert!(sessions.visitor(&key, minutes(180)).is_none(), "idle");
        let key = sessions.begin(anna(), None, now).unwrap();
        let ticket = sessions.ticket(&key, now).unwrap().unwrap();
        let (_, mut life) = sessions.enter(&ticket, Some(&key), now).unwrap();
        sessions.sweep(minutes(11 * 60));
        assert!(life.over().now_or_never().is_none(), "its socket is open");
        sessions.sweep(minutes(13 * 60));
        assert!(life.over().now_or_never().is_some(), "too old");
        assert!(same("ab", "ab") && !same("ab", "ac") && !same("ab", "abc"));
    }

    #[test]
    fn log_out_ends_only_the_sockets_of_its_session() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let mut lives: Vec<(String, Life)> = (0..2)
            .map(|_| {
                let key = sessions.begin(anna(), None, now).unwrap();
                let ticket = sessions.ticket(&key, now).unwrap().unwrap();
                let (_, life) = sessions.enter(&ticket, Some(&key), now).unwrap();
                (key, life)
            })
            .collect();
        sessions.end(&lives[0].0, "signed out");
        assert_eq!(lives[0].1.over().now_or_never(), Some("signed out"));
        assert_eq!(lives[1].1.over().now_or_never(), None);
    }

    #[test]
    fn a_session_ends_when_its_user_is_removed_or_gets_another_role_or_password() {
        let now = Instant::now();
        let user = |role| User::new("anna", role).unwrap();
        let mut before = Users::default();
        before.add(user(UserRole::Operator)).unwrap();
        before.set_password("anna", Some("right and long")).unwrap();
        let entry = before.get("anna").cloned();
        let mut password = before.clone();
        password.set_password("anna", Some("another word")).unwrap();
        let mut lowered = Users::default();
        lowered.add(user(UserRole::Viewer)).unwrap();
        for (users, kept) in [
            (&before, true),
            (&password, false),
            (&lowered, false),
            (&Users::default(), false),
        ] {
            let sessions = Sessions::default();
            let key = sessions.begin(anna(), entry.clone(), now).unwrap();
            let by_link = sessions.begin(anna(), None, now).unwrap();
            let ticket = sessions.ticket(&key, now).unwrap().unwrap();
            let (_, mut life) = sessions.enter(&ticket, Some(&key), now).unwrap();
            sessions.keep(users);
            assert_eq!(sessions.visitor(&key, now).is_some(), kept, "{users:?}");
            assert_eq!(life.over().now_or_never().is_none(), kept, "{users:?}");
            assert!(sessions.visitor(&by_link, now).is_some());
        }
    }

    #[test]
    fn a_flood_of_sessions_and_tickets_does_not_displace_other_users() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let driver = sessions.begin(anna(), None, now).unwrap();
        let ticket = sessions.ticket(&driver, now).unwrap().unwrap();
        for viewer in 0..10 {
            let viewer = visitor(&format!("viewer{viewer}"), Role::Viewer);
            for later in 1..80 {
                let at = now + Duration::from_millis(later);
                let key = sessions.begin(viewer.clone(), None, at).unwrap();
                for _ in 0..20 {
                    sessions.ticket(&key, at).unwrap();
                }
            }
        }
        assert!(sessions.sessions.lock().len() <= MOST);
        for session in sessions.sessions.lock().values() {
            assert!(session.tickets.len() <= TICKETS);
        }
        assert_eq!(
            entered(&sessions, &ticket, Some(&driver), now),
            Some(anna())
        );
    }
}
