//! A commander that answers every control tick with an empty command, so that a lock-step
//! server advances.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::Client;

/// Answers until it is dropped.
pub struct IdleCommander {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl IdleCommander {
    /// Its name.
    pub const NAME: &str = "idle";

    /// Takes control; the episode may begin afterwards.
    ///
    /// # Panics
    /// When another commander holds control.
    #[must_use]
    pub fn start(client: &Client) -> Self {
        let streams = client.streams(&[TopicId::Clock]).expect("the clock");
        let mut commander = client.commander(Self::NAME, false).expect("control");
        let ended = Arc::new(AtomicBool::new(false));
        let thread = {
            let ended = Arc::clone(&ended);
            let client = client.clone();
            std::thread::spawn(move || {
                while !ended.load(Ordering::Acquire) {
                    let sample = streams.next(Duration::from_millis(200)).expect("a clock");
                    let header = match sample {
                        Some(Sample::Clock(clock)) => clock.header,
                        // Time is paused, perhaps since before the subscription.
                        _ => client
                            .request(&v1::StatusRequest {})
                            .ok()
                            .filter(|status| status.episode.is_some())
                            .and_then(|status| status.header),
                    };
                    if let Some(header) = header {
                        commander
                            .answer(&header, v1::Command::default())
                            .expect("a command");
                    }
                }
            })
        };
        Self {
            ended,
            thread: Some(thread),
        }
    }
}

impl Drop for IdleCommander {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
