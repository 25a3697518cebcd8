//! Wall-time limits.

use std::sync::Arc;
use std::time::Duration;

/// Until a server serves: it may build its pipelines on a CPU.
pub const READY: Duration = Duration::from_secs(300);
/// From the end of an episode to its finished file.
pub const FINISH: Duration = Duration::from_secs(900);
/// For each way of ending a program, before the next harder one: it receives a request,
/// it is terminated, it is killed.
pub const END: Duration = Duration::from_secs(20);
/// Interval between checks of a program.
pub const LOOK: Duration = Duration::from_millis(20);
/// For the connection to a server that serves.
pub const CONNECT: Duration = Duration::from_secs(10);

/// Wall-time limits of an episode.
#[derive(Clone)]
pub struct Limits {
    /// Longest time for which the server may be silent.
    pub silence: Duration,
    /// Longest time without progress of simulated time while the server replies.
    pub stall: Duration,
    /// Returns true when the caller cancels the episode.
    pub cancelled: Arc<dyn Fn() -> bool + Send + Sync>,
}

impl Limits {
    /// The same limit for a silent server and for a stall; never cancelled.
    #[must_use]
    pub fn patience(patience: Duration) -> Self {
        Self {
            silence: patience,
            stall: patience,
            cancelled: Arc::new(|| false),
        }
    }
}

impl Default for Limits {
    /// Five minutes: for episodes that a person watches.
    fn default() -> Self {
        Self::patience(Duration::from_secs(300))
    }
}
