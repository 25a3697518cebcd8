//! Requests that change the server: reset, stop and shutdown. They carry the secret of
//! this client's lease. While no client holds control, they need no lease.

use wheelarm_proto::v1;

use super::{Client, ClientError};

impl Client {
    /// Sets up a new scenario: the present one with the fields of `scenario` replaced.
    /// Object poses are sampled again, also for the same seed. `force` works while
    /// another client is in control. Returns the scenario in force.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn reset(
        &self,
        mut scenario: v1::Scenario,
        force: bool,
    ) -> Result<v1::Scenario, ClientError> {
        // An absent field keeps its value; a seed, also an equal one, samples again.
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

    /// Ends the running episode; with `discard` recorders delete it.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn stop_episode(&self, discard: bool) -> Result<v1::EpisodeStopped, ClientError> {
        self.stop(None, discard)
    }

    /// Ends the given episode, never a later one; with `discard` recorders delete it.
    ///
    /// # Errors
    /// [`ClientError`], with the code `NoEpisode` when it has ended already.
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

    /// Ends the server; `force` works while another client is in control.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn shutdown(&self, force: bool) -> Result<(), ClientError> {
        let secret = self.secret();
        self.request(&v1::ShutdownRequest { force, secret })
            .map(|_| ())
    }
}
