//! What whoever holds control asks without force: the secret of its lease goes
//! with the question. Anybody may ask the same while nobody is in control.

use wheelarm_proto::v1;

use super::{Client, ClientError};

impl Client {
    /// Sets up a new scenario: the one in force with what `scenario` names
    /// replaced. Places are drawn anew, also where the seed is the same. With
    /// `force` also while somebody else is in control.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn reset(
        &self,
        mut scenario: v1::Scenario,
        force: bool,
    ) -> Result<v1::Scenario, ClientError> {
        // Everything that is not said stays as it is; the same seed says "draw".
        if scenario.seed.is_none() {
            let status = self.request(&v1::StatusRequest {})?;
            scenario.seed = status.scenario.map(|scenario| scenario.seed());
        }
        let reply = self.request(&v1::ResetRequest {
            scenario: Some(scenario),
            force,
            secret: self.secret(),
            ..v1::ResetRequest::default()
        })?;
        Ok(reply.scenario.unwrap_or_default())
    }

    /// Ends whichever episode runs; with `discard` recorders throw it away.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn stop_episode(&self, discard: bool) -> Result<v1::EpisodeStopped, ClientError> {
        self.stop(None, discard)
    }

    /// Ends the episode that was started, and never one that somebody else began
    /// after it; with `discard` recorders throw it away.
    ///
    /// # Errors
    /// [`ClientError`], with the code `NoEpisode` where it is over.
    pub fn stop_episode_of(
        &self,
        started: &v1::EpisodeStarted,
        discard: bool,
    ) -> Result<v1::EpisodeStopped, ClientError> {
        self.stop(started.header.as_ref().map(|h| h.episode), discard)
    }

    fn stop(&self, episode: Option<u64>, discard: bool) -> Result<v1::EpisodeStopped, ClientError> {
        self.request(&v1::EpisodeStopRequest {
            discard,
            episode,
            force: false,
            secret: self.secret(),
        })
    }

    /// Ends the server; with `force` also while somebody else is in control.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn shutdown(&self, force: bool) -> Result<(), ClientError> {
        let secret = self.secret();
        self.request(&v1::ShutdownRequest { force, secret })
            .map(|_| ())
    }
}
