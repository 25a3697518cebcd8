//! Which subject of the rules a connection is, and how long it may last. A process that
//! follows a list of users says so with [`admit`], for the links that come in at a
//! listener; without it a connection is the name in its certificate.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parking_lot::Mutex;
use tokio::sync::watch;

use super::peer::Peer;

/// The subject of the rules for the name in a certificate and the first second of its
/// validity, s since 1970.
pub type Admission = Arc<dyn Fn(&str, i64) -> String + Send + Sync>;

type Sender = watch::Sender<Option<Admission>>;

/// By the file of the certificate that a listener shows.
static ADMISSIONS: Mutex<BTreeMap<PathBuf, Sender>> = Mutex::new(BTreeMap::new());

/// Sets what the connections to listeners with this certificate are. Those that are
/// another subject than before end within a moment, and may connect again. Call it
/// again after every change of what `admission` returns.
pub fn admit(certificate: &Path, admission: Admission) {
    let mut all = ADMISSIONS.lock();
    let sender = all.entry(certificate.to_owned()).or_default();
    sender.send_replace(Some(admission));
}

/// What the connections to one listener are.
#[derive(Clone)]
pub(crate) struct Admissions(watch::Receiver<Option<Admission>>);

impl Admissions {
    pub(crate) fn of_listener(certificate: &str) -> Self {
        let mut all = ADMISSIONS.lock();
        let sender = all.entry(PathBuf::from(certificate)).or_default();
        Self(sender.subscribe())
    }

    /// A connection by this peer.
    pub(crate) fn admitted(&self, peer: &Peer) -> Admitted {
        let mut now = self.0.clone();
        now.mark_unchanged();
        Admitted {
            name: peer.name.clone(),
            since: peer.since.unix_timestamp(),
            subject: subject(&now, peer.name.as_deref(), peer.since.unix_timestamp()),
            now,
            is_over: false,
        }
    }
}

fn subject(
    now: &watch::Receiver<Option<Admission>>,
    name: Option<&str>,
    since: i64,
) -> Option<String> {
    let admission = now.borrow().clone();
    match (admission, name) {
        (Some(admission), Some(name)) => Some(admission(name, since)),
        (None, Some(name)) => Some(name.to_owned()),
        (_, None) => None,
    }
}

/// What a connection was when it began.
pub(crate) struct Admitted {
    name: Option<String>,
    since: i64,
    subject: Option<String>,
    now: watch::Receiver<Option<Admission>>,
    is_over: bool,
}

impl Admitted {
    /// The subject of the rules.
    pub(crate) fn subject(&self) -> Option<String> {
        self.subject.clone()
    }

    /// Waits until the connection is another subject than when it began. After that it
    /// is over for good.
    pub(crate) async fn over(&mut self) {
        while !self.is_over {
            // The senders live as long as the process.
            if self.now.changed().await.is_err() {
                return std::future::pending().await;
            }
            let subject = subject(&self.now, self.name.as_deref(), self.since);
            self.is_over = subject != self.subject;
        }
    }
}
