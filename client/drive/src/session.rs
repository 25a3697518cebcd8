//! Who has signed in, and the tickets that open sockets. Times are those of the
//! process; nothing is written down, so that a restart ends every session.

use std::collections::BTreeMap;
use std::io::Read;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::visitor::Visitor;

/// A session ends after this long.
const LONGEST: Duration = Duration::from_secs(12 * 3600);
/// A session that is not used ends after this long.
const IDLE: Duration = Duration::from_secs(3600);
/// A ticket is good for this long.
pub const TICKET: Duration = Duration::from_secs(30);
/// Most sessions, and most tickets that are open.
const MOST: usize = 512;

struct Session {
    visitor: Visitor,
    began: Instant,
    used: Instant,
}

impl Session {
    fn is_over(&self, now: Instant) -> bool {
        now - self.began > LONGEST || now - self.used > IDLE
    }
}

/// Sessions and tickets.
#[derive(Default)]
pub struct Sessions {
    sessions: Mutex<BTreeMap<String, Session>>,
    /// By ticket: the session's key, and until when.
    tickets: Mutex<BTreeMap<String, (String, Instant)>>,
}

impl Sessions {
    /// Begins a session; its cookie's value.
    ///
    /// # Errors
    /// When the host has no random numbers.
    pub fn begin(&self, visitor: Visitor, now: Instant) -> std::io::Result<String> {
        let key = secret()?;
        let mut sessions = self.sessions.lock();
        sessions.retain(|_, session| !session.is_over(now));
        if sessions.len() >= MOST {
            let oldest = sessions.iter().min_by_key(|(_, s)| s.used);
            if let Some(key) = oldest.map(|(key, _)| key.clone()) {
                sessions.remove(&key);
            }
        }
        let session = Session {
            visitor,
            began: now,
            used: now,
        };
        sessions.insert(key.clone(), session);
        Ok(key)
    }

    /// Whose session it is, which is used now.
    #[must_use]
    pub fn visitor(&self, key: &str, now: Instant) -> Option<Visitor> {
        let mut sessions = self.sessions.lock();
        let session = sessions.get_mut(key).filter(|s| !s.is_over(now))?;
        session.used = now;
        Some(session.visitor.clone())
    }

    /// Ends a session.
    pub fn end(&self, key: &str) {
        self.sessions.lock().remove(key);
        self.tickets.lock().retain(|_, (session, _)| session != key);
    }

    /// A ticket for the session `key`.
    ///
    /// # Errors
    /// When the host has no random numbers.
    pub fn ticket(&self, key: &str, now: Instant) -> std::io::Result<String> {
        let ticket = secret()?;
        let mut tickets = self.tickets.lock();
        tickets.retain(|_, (_, until)| now < *until);
        if tickets.len() >= MOST {
            tickets.pop_first();
        }
        tickets.insert(ticket.clone(), (key.to_owned(), now + TICKET));
        Ok(ticket)
    }

    /// Whose ticket it is; it is used up.
    #[must_use]
    pub fn enter(&self, ticket: &str, cookie: Option<&str>, now: Instant) -> Option<Visitor> {
        let (key, until) = self.tickets.lock().remove(ticket)?;
        // The cookie came with the request for the socket: both are needed.
        if now >= until || cookie != Some(key.as_str()) {
            return None;
        }
        self.visitor(&key, now)
    }
}

/// 32 hexadecimal digits that nobody can guess.
///
/// # Errors
/// When the host has no random numbers.
pub fn secret() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether two secrets are the same, in a time that does not tell where they differ.
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
    use super::*;
    use crate::visitor::Role;

    fn anna() -> Visitor {
        Visitor {
            name: "anna".to_owned(),
            role: Role::Operator,
        }
    }

    #[test]
    fn a_ticket_opens_one_socket_once_and_with_its_cookie_alone() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let key = sessions.begin(anna(), now).unwrap();
        let other = sessions.begin(anna(), now).unwrap();
        let ticket = sessions.ticket(&key, now).unwrap();
        assert_eq!(sessions.enter(&ticket, Some(&key), now), Some(anna()));
        assert_eq!(sessions.enter(&ticket, Some(&key), now), None, "twice");
        let ticket = sessions.ticket(&key, now).unwrap();
        assert_eq!(sessions.enter(&ticket, None, now), None, "no cookie");
        let ticket = sessions.ticket(&key, now).unwrap();
        assert_eq!(sessions.enter(&ticket, Some(&other), now), None);
        let ticket = sessions.ticket(&key, now).unwrap();
        let later = now + TICKET;
        assert_eq!(sessions.enter(&ticket, Some(&key), later), None, "expired");
        let ticket = sessions.ticket(&key, now).unwrap();
        sessions.end(&key);
        assert_eq!(sessions.enter(&ticket, Some(&key), now), None, "signed out");
    }

    #[test]
    fn a_session_ends_by_itself() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let key = sessions.begin(anna(), now).unwrap();
        let minutes = |m: u64| now + Duration::from_secs(60 * m);
        assert!(sessions.visitor(&key, minutes(59)).is_some());
        assert!(
            sessions.visitor(&key, minutes(118)).is_some(),
            "it was used"
        );
        assert!(sessions.visitor(&key, minutes(180)).is_none(), "idle");
        let key = sessions.begin(anna(), now).unwrap();
        for hour in 1..=16 {
            let known = sessions.visitor(&key, minutes(50 * hour)).is_some();
            assert_eq!(known, 50 * hour <= 12 * 60, "{hour}");
        }
        assert!(same("ab", "ab") && !same("ab", "ac") && !same("ab", "abc"));
    }
}
