//! Ctrl-C, SIGTERM and SIGHUP: end a campaign early.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use anyhow::Context;
use wheelarm_proto::signals::{ReceivedSignal, on_signals};

const FINISH: u8 = 1;
const DISCARD: u8 = 2;

/// Shared request to end the campaign.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    level: Arc<AtomicU8>,
}

impl Stop {
    /// Whether no new episode may begin.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.level.load(Ordering::Acquire) >= FINISH
    }

    /// Whether running episodes are discarded.
    #[must_use]
    pub fn at_once(&self) -> bool {
        self.level.load(Ordering::Acquire) >= DISCARD
    }

    /// Requests the end after the running episodes.
    pub fn after_running(&self) {
        self.level.fetch_max(FINISH, Ordering::AcqRel);
    }

    /// Listens to Ctrl-C, SIGTERM and SIGHUP. The first Ctrl-C waits for the running
    /// episodes; the second and the other signals discard them.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn listen(&self) -> anyhow::Result<()> {
        let stop = self.clone();
        on_signals(move |signal| {
            let first = || stop.level.fetch_add(1, Ordering::AcqRel) == 0;
            if signal == ReceivedSignal::Interrupt && first() {
                eprintln!(
                    "\nwaiting for the running episodes, no new one begins; Ctrl-C again discards them"
                );
            } else {
                stop.level.store(DISCARD, Ordering::Release);
            }
        })
        .context("cannot listen to signals")
    }
}
