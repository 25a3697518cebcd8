//! The server's replies about its episodes. Messages on `episode/start` and
//! `episode/stop` can be forged and can overtake each other, so they are only hints: the
//! recorder requests the episode state, which lists ends before the running episode.

use std::time::Instant;

use wheelarm_proto::v1;

use super::super::episode::id;
use super::{
    END_LOST, FAREWELL_PATIENCE, HINT_PAUSE, MANIFEST_PATIENCE, Output, Recorder, SERVER_LOST,
    STATE_RETRY, Stage, StateQuery,
};

impl Recorder {
    /// An episode may have begun or ended: requests the episode state.
    pub(super) fn request_state(&mut self) {
        self.state_query = match self.state_query {
            StateQuery::Pending | StateQuery::PendingAgain => StateQuery::PendingAgain,
            StateQuery::Idle | StateQuery::RetryAt(_) => {
                self.out.push(Output::RequestState);
                StateQuery::Pending
            }
        };
    }

    /// Handles the reply with the running and the recently ended episodes.
    pub(super) fn episode_state(&mut self, reply: Result<v1::EpisodeState, String>, now: Instant) {
        let again = self.state_query == StateQuery::PendingAgain;
        self.state_query = StateQuery::Idle;
        let state = match reply {
            Ok(state) => state,
            Err(words) => {
                tracing::debug!("cannot read the episode state: {words}");
                self.state_query = StateQuery::RetryAt(now + STATE_RETRY);
                return;
            }
        };
        if again {
            // Forged hints must not cause a flood of requests.
            self.state_query = StateQuery::RetryAt(now + HINT_PAUSE);
        }
        let run = state.header.unwrap_or_default().run_id;
        let running = state.running.as_ref().map(|s| id(s.header.as_ref()));
        if let Some(ours) = self.current() {
            if ours.0 != run {
                self.replaced(now);
            } else if running.as_ref() == Some(&ours) {
                self.rejoin(now);
            } else if !state.ended.iter().any(|s| id(s.header.as_ref()) == ours) {
                self.end_lost(now);
            }
        }
        for stopped in &state.ended {
            self.stopped(stopped, now);
        }
        self.report_unrecorded(&run, &state.ended);
        if let Some(started) = state.running {
            self.begun = Some(id(started.header.as_ref()));
            self.started(started, now);
        }
    }

    /// Reports episodes that began and ended between two replies as not recorded.
    fn report_unrecorded(&mut self, run: &str, ended: &[v1::EpisodeStopped]) {
        let newest = ended.iter().map(number).max().unwrap_or(0);
        let begun = match &self.begun {
            Some((of, begun)) if of == run => *begun,
            _ => newest,
        };
        self.begun = Some((run.to_owned(), begun.max(newest)));
        if self.limit.is_some_and(|limit| self.counted >= limit) {
            return;
        }
        for stopped in ended.iter().filter(|s| number(s) > begun && !s.discard) {
            self.out.push(Output::Failed(format!(
                "episode {} of this server was over before the recorder could begin it; start episodes with --require-recorders",
                number(stopped)
            )));
        }
    }

    /// The episode continues after a link loss.
    fn rejoin(&mut self, now: Instant) {
        if let Stage::Recording(recording) = &mut self.stage
            && let Some(since) = recording.away.take()
        {
            recording.restart_requests();
            tracing::warn!(
                "the server is back after {:.1} s and continues episode {:?}",
                now.duration_since(since).as_secs_f64(),
                recording.started.label
            );
        }
    }

    /// The episode ended during a link loss and the server no longer lists its end.
    fn end_lost(&mut self, now: Instant) {
        self.give_up_opening();
        self.stop_without_manifest(END_LOST, now + MANIFEST_PATIENCE);
    }

    /// Another server replaced ours. Samples of ours may still be in flight.
    fn replaced(&mut self, now: Instant) {
        self.give_up_opening();
        self.stop_without_manifest(SERVER_LOST, now + FAREWELL_PATIENCE);
    }

    fn stop_without_manifest(&mut self, reason: &'static str, end: Instant) {
        match std::mem::replace(&mut self.stage, Stage::Idle) {
            Stage::Recording(recording) => {
                self.stage = Stage::Stopping {
                    samples: recording.samples(),
                    recording,
                    stopped: None,
                    deadline: end,
                    reason,
                };
            }
            Stage::Stopping {
                recording,
                stopped,
                deadline,
                samples,
                reason,
            } => {
                self.stage = Stage::Stopping {
                    recording,
                    stopped,
                    samples,
                    deadline: deadline.min(end),
                    reason,
                };
            }
            stage => self.stage = stage,
        }
    }

    /// The link to the server is lost. It may return with the episode still running.
    pub(super) fn server_lost(&mut self, now: Instant) {
        match &mut self.stage {
            Stage::Recording(recording) if recording.away.is_none() => {
                recording.away = Some(now);
                tracing::warn!(
                    "the link to the server is lost; episode {:?} is kept open for {} s",
                    recording.started.label,
                    super::AWAY_PATIENCE.as_secs()
                );
            }
            // Only the server could send the missing samples.
            Stage::Stopping { deadline, .. } => {
                *deadline = (*deadline).min(now + FAREWELL_PATIENCE);
            }
            _ => {}
        }
    }

    /// The current episode may have ended before its snapshot arrived.
    pub(super) fn too_late_to_open(&mut self) {
        if let Stage::Opening {
            stopped: Some(_), ..
        } = &self.stage
        {
            self.give_up_opening();
        } else {
            self.request_state();
        }
    }

    /// Drops an episode before anything of it is recorded.
    pub(super) fn give_up_opening(&mut self) {
        if let Stage::Opening { started, .. } = &self.stage {
            tracing::warn!("episode {:?} is over and not recorded", started.label);
            self.last = Some(id(started.header.as_ref()));
            self.prebuffer.forget(self.last.as_ref());
            self.stage = Stage::Idle;
        }
    }
}

fn number(stopped: &v1::EpisodeStopped) -> u64 {
    stopped.header.as_ref().map_or(0, |h| h.episode)
}
