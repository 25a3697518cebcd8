//! The worker's standard output: lines of the protocol, each written whole.

use std::io::Write;
use std::sync::Arc;

use parking_lot::Mutex;
use wheelarm_rollout::protocol::{Event, Reply};

/// The output of the worker.
#[derive(Clone, Default)]
pub struct Output(Arc<Mutex<()>>);

/// The output about one episode.
#[derive(Clone)]
pub struct EpisodeOutput {
    output: Output,
    number: u64,
}

impl Output {
    /// Writes a line.
    pub fn write(&self, reply: &Reply) {
        let Ok(mut line) = serde_json::to_vec(reply) else {
            return;
        };
        line.push(b'\n');
        let _turn = self.0.lock();
        let mut out = std::io::stdout().lock();
        // A reader that is gone has closed the input as well, which ends the worker.
        let _ = out.write_all(&line).and_then(|()| out.flush());
    }

    /// The output about the episode of a request.
    #[must_use]
    pub fn for_episode(&self, number: u64) -> EpisodeOutput {
        EpisodeOutput {
            output: self.clone(),
            number,
        }
    }
}

impl EpisodeOutput {
    /// Writes an event of the episode.
    pub fn write(&self, event: Event) {
        let number = self.number;
        self.output.write(&Reply::Episode { number, event });
    }
}
