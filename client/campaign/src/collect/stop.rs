//! Ctrl-C, SIGTERM and SIGHUP: how a campaign is ended before it is through.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use anyhow::Context;
use wheelarm_proto::signals::{ReceivedSignal, on_signals};

const FINISH: u8 = 1;
const DISCARD: u8 = 2;

/// Whether and how the campaign is to end.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    level: Arc<AtomicU8>,
}

impl Stop {
    /// No new episode begins.
    #[must_use]
    pub fn asked(&self) -> bool {
        self.level.load(Ordering::Acquire) >= FINISH
    }

    /// Running episodes are thrown away.
    #[must_use]
    pub fn at_once(&self) -> bool {
        self.level.load(Ordering::Acquire) >= DISCARD
    }

    /// Asks for the end after the running episodes.
    pub fn after_running(&self) {
        self.level.fetch_max(FINISH, Ordering::AcqRel);
    }

    /// Listens to Ctrl-C, SIGTERM and SIGHUP: the first Ctrl-C lets the running
    /// episodes finish, the second and the other signals throw them away.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn listen(&self) -> anyhow::Result<()> {
        let stop = self.clone();
        on_signals(move |heard| {
            let first = || stop.level.fetch_add(1, Ordering::AcqRel) == 0;
            if heard == ReceivedSignal::Interrupt && first() {
                eprintln!(
                    "\nthe running episodes are finished, no other begins; Ctrl-C again throws them away at once"
                );
            } else {
                stop.level.store(DISCARD, Ordering::Release);
            }
        })
        .context("cannot listen to signals")
    }
}
