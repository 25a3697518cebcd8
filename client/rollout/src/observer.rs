//! Watches an episode while it runs.

use wheelarm_expert::run::Progress;
use wheelarm_proto::v1;
use wheelarm_sdk::Client;

/// Watches an episode while it runs. Every method has an empty default.
///
/// [`Observer::attach`], [`Observer::progress`] and [`Observer::detach`] need a client in
/// this process: an episode of [`InProcess`](crate::InProcess) does not call them.
pub trait Observer: Send + Sync {
    /// The server has set the scenario up, and the episode begins after this call.
    ///
    /// # Errors
    /// An error ends the episode.
    fn attach(&self, _link: &Client) -> anyhow::Result<()> {
        Ok(())
    }

    /// The driver answered a control tick.
    fn progress(&self, _progress: &Progress<'_>) {}

    /// The server answered a status request, about once per second.
    fn status(&self, _status: &v1::Status) {}

    /// The driver has finished; the server still runs.
    fn detach(&self) {}
}

/// Ignores everything.
impl Observer for () {}
