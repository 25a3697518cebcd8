//! One episode from the view of its driver: a client of the server, and receivers of
//! progress.

use std::path::Path;

use wheelarm_expert::run::Progress;
use wheelarm_sdk::Client;

use crate::heartbeat::Heartbeat;
use crate::observer::Observer;

/// One episode from the view of its driver.
pub struct Session<'a> {
    /// Connection to the server, which is paused and has no running episode.
    pub client: &'a Client,
    /// Label of the episode.
    pub label: &'a str,
    /// Recorders that the episode waits for.
    pub recorders: u32,
    /// File for the phases and notes of the expert.
    pub log: Option<&'a Path>,
    /// Receives every control tick.
    pub heartbeat: &'a Heartbeat,
    /// Watches the episode.
    pub observer: &'a dyn Observer,
}

impl Session<'_> {
    /// Passes a control tick on to the heartbeat and the observer.
    pub(crate) fn progress(&self, progress: &Progress<'_>) {
        self.heartbeat.tick(progress.time);
        self.observer.progress(progress);
    }
}
