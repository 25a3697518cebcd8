//! What the server says of its episodes. A recorder believes nothing that it
//! hears on `episode/start` and `episode/stop`, which anybody could publish,
//! and which can overtake each other: they only make it ask the server, whose
//! answer tells ends before beginnings.

use std::time::Instant;

use wheelarm_proto::v1;

use super::super::episode::id;
use super::{
    Asking, END_LOST, FAREWELL_PATIENCE, HINT_PAUSE, MANIFEST_PATIENCE, Output, Recorder,
    SERVER_LOST, STATE_RETRY, Stage,
};

impl Recorder {
    /// Something may have begun or ended: asks the server.
    pub(super) fn request(&mut self) {
        self.asking = match self.asking {
            Asking::Yes | Asking::Again => Asking::Again,
            Asking::No | Asking::At(_) => {
                self.out.push(Output::AskState);
                Asking::Yes
            }
        };
    }

    /// The server told what it runs and what it has run lately.
    pub(super) fn told(&mut self, reply: Result<v1::EpisodeState, String>, now: Instant) {
        let again = self.asking == Asking::Again;
        self.asking = Asking::No;
        let state = match reply {
            Ok(state) => state,
            Err(words) => {
                tracing::debug!("the server does not say what it runs: {words}");
                self.asking = Asking::At(now + STATE_RETRY);
                return;
            }
        };
        if again {
            // Whoever makes up beginnings and ends makes up no flood of questions.
            self.asking = Asking::At(now + HINT_PAUSE);
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
        self.tell_unrecorded(&run, &state.ended);
        if let Some(started) = state.running {
            self.begun = Some(id(started.header.as_ref()));
            self.started(started, now);
        }
    }

    /// An episode that began and ended between two answers is in no file.
    fn tell_unrecorded(&mut self, run: &str, ended: &[v1::EpisodeStopped]) {
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

    /// The episode goes on after the server was away.
    fn rejoin(&mut self, now: Instant) {
        if let Stage::Recording(recording) = &mut self.stage
            && let Some(since) = recording.away.take()
        {
            recording.look_again();
            tracing::warn!(
                "the server is back after {:.1} s and runs episode {:?} on",
                now.duration_since(since).as_secs_f64(),
                recording.started.label
            );
        }
    }

    /// The episode ran on while nobody could ask, and its end is forgotten.
    fn end_lost(&mut self, now: Instant) {
        self.give_up_opening();
        self.stop_without_manifest(END_LOST, now + MANIFEST_PATIENCE);
    }

    /// Another server has taken the place of ours. What ours had sent may still
    /// be under way.
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

    /// The way to the server is gone. It may come back with the episode still
    /// running.
    pub(super) fn server_lost(&mut self, now: Instant) {
        match &mut self.stage {
            Stage::Recording(recording) if recording.away.is_none() => {
                recording.away = Some(now);
                tracing::warn!(
                    "the server is away; episode {:?} is kept open for {} s",
                    recording.started.label,
                    super::AWAY_PATIENCE.as_secs()
                );
            }
            // What lacks can be had from nobody but the server.
            Stage::Stopping { deadline, .. } => {
                *deadline = (*deadline).min(now + FAREWELL_PATIENCE);
            }
            _ => {}
        }
    }

    /// The episode at hand is over before its snapshot came.
    pub(super) fn too_late_to_open(&mut self) {
        if let Stage::Opening {
            stopped: Some(_), ..
        } = &self.stage
        {
            self.give_up_opening();
        } else {
            self.request();
        }
    }

    /// Lets go of an episode of which nothing is recorded yet.
    pub(super) fn give_up_opening(&mut self) {
        if let Stage::Opening { started, .. } = &self.stage {
            tracing::warn!("episode {:?} is over and not recorded", started.label);
            self.last = Some(id(started.header.as_ref()));
            self.early.forget(self.last.as_ref());
            self.stage = Stage::Idle;
        }
    }
}

fn number(stopped: &v1::EpisodeStopped) -> u64 {
    stopped.header.as_ref().map_or(0, |h| h.episode)
}
