//! Publishes events outside the streams: rejected commands, changes of control, long
//! waits.

use std::time::Instant;

use wheelarm_proto::v1;

use super::Engine;
use crate::service::command_gate::Refused;

impl Engine {
    /// Logs long waits. Between episodes a pause is normal and not reported.
    pub(super) fn log_waiting(&mut self) {
        let what = match &self.episode {
            Some(_) if !self.paused => self.waiting_for.words.as_str(),
            _ => "",
        };
        if let Some(words) = self.waiting.note(what, Instant::now()) {
            tracing::warn!("{words}");
        }
    }

    pub(super) fn publish_refusals(&self) {
        let answers = self.shared.refusals.lock().take(self.shared.now());
        let (episode, tick) = (self.episode_number(), self.sim.snapshot().tick);
        for (refused, count) in answers {
            let Refused {
                commander,
                sequence,
                code,
                reason,
            } = refused;
            let what = match count {
                1 => format!("command {sequence} of {commander:?}: {reason}"),
                _ => {
                    format!("{count} more, the last command {sequence} of {commander:?}: {reason}")
                }
            };
            self.event(v1::EventKind::Refused, &what);
            let refusal = v1::Refusal {
                header: None,
                commander,
                sequence,
                reason,
                count,
                code: code.into(),
            };
            self.shared.outbox.put(episode, tick, refusal);
        }
    }

    pub(super) fn publish_queued_events(&self) {
        let event_queue = std::mem::take(&mut *self.shared.event_queue.lock());
        for event in event_queue {
            self.publish_event(event);
        }
    }
}
