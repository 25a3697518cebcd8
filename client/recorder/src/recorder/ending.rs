//! The end of an episode (stopped by the server, cut short or discarded) and the result
//! of its file.

use std::time::Instant;

use wheelarm_proto::v1;

use super::super::episode::{EpisodeId, Recording, Report, id};
use super::status::update_status;
use super::{MANIFEST_PATIENCE, Output, Recorder, Stage};

impl Recorder {
    /// Handles an ended episode of the server's reply, which repeats it for a while.
    pub(super) fn stopped(&mut self, stopped: &v1::EpisodeStopped, now: Instant) {
        let of = id(stopped.header.as_ref());
        if let Some(next) = self.next.take_if(|n| id(n.header.as_ref()) == of) {
            self.last = Some(of);
            if !stopped.discard {
                self.report_too_busy(&next);
            }
            return;
        }
        if self.current() != Some(of) {
            return;
        }
        if let Stage::Opening { stopped, .. } | Stage::Stopping { stopped, .. } = &self.stage
            && stopped.is_some()
        {
            return;
        }
        let boxed = Box::new(stopped.clone());
        match std::mem::replace(&mut self.stage, Stage::Idle) {
            Stage::Idle => {}
            Stage::Opening {
                started,
                since,
                requested,
                ..
            } => {
                self.stage = Stage::Opening {
                    started,
                    since,
                    requested,
                    stopped: Some(boxed),
                };
            }
            Stage::Recording(recording) | Stage::Stopping { recording, .. } => {
                if stopped.discard {
                    self.discard(*recording);
                    return;
                }
                self.stage = Stage::Stopping {
                    samples: recording.samples(),
                    recording,
                    stopped: Some(boxed),
                    deadline: now + MANIFEST_PATIENCE,
                    reason: "",
                };
            }
        }
    }

    /// Finishes an episode whose samples are all received or overdue. On a slow line they
    /// arrive one by one.
    pub(super) fn settle(&mut self, now: Instant) {
        let Stage::Stopping {
            recording,
            stopped,
            deadline,
            samples,
            ..
        } = &mut self.stage
        else {
            return;
        };
        if stopped.is_some() && *samples != recording.samples() {
            *samples = recording.samples();
            *deadline = (*deadline).max(now + MANIFEST_PATIENCE);
        }
        let all = stopped.as_ref().is_some_and(|s| recording.satisfies(s));
        if !all && now < *deadline {
            return;
        }
        let Stage::Stopping {
            recording,
            stopped,
            reason,
            ..
        } = std::mem::replace(&mut self.stage, Stage::Idle)
        else {
            return;
        };
        self.finish(*recording, stopped.map(|s| *s), reason.to_owned());
        if let Some(next) = self.next.take() {
            self.started(*next, now);
        }
    }

    /// Closes the open episode and starts no other.
    pub(super) fn shut_down(&mut self) {
        self.is_ending = true;
        if let Some(next) = self.next.take() {
            self.prebuffer.forget(Some(&id(next.header.as_ref())));
            self.out.push(Output::Failed(format!(
                "episode {:?} is not recorded: the recorder was stopped while the file of an earlier one was being written",
                next.label
            )));
        }
        self.end("the recorder was stopped before the episode ended");
    }

    /// Closes the open episode before its end.
    pub(super) fn end(&mut self, reason: &str) {
        match std::mem::replace(&mut self.stage, Stage::Idle) {
            Stage::Idle => {}
            Stage::Opening { started, .. } => {
                self.last = Some(id(started.header.as_ref()));
                self.fail_with(format!("episode {:?}: {reason}", started.label));
            }
            Stage::Recording(recording) => self.finish(*recording, None, reason.to_owned()),
            Stage::Stopping {
                recording, stopped, ..
            } => {
                // The manifest itself shows missing samples.
                let reason = if stopped.is_some() { "" } else { reason };
                self.finish(*recording, stopped.map(|s| *s), reason.to_owned());
            }
        }
    }

    pub(super) fn finish(
        &mut self,
        recording: Recording,
        stopped: Option<v1::EpisodeStopped>,
        reason: String,
    ) {
        self.last = Some(id(recording.started.header.as_ref()));
        self.prebuffer.forget(self.last.as_ref());
        update_status(&mut self.status, &recording);
        self.counted += 1;
        self.status.state = v1::RecorderState::Finishing.into();
        self.finishing.push(self.status.clone());
        self.out.push(Output::Status(self.status.clone()));
        let finishing = recording.finish(stopped, reason);
        self.out.push(Output::Finish(Box::new(finishing)));
    }

    /// The conversion of an episode into its file succeeded or failed.
    pub(super) fn done(&mut self, of: &EpisodeId, result: Result<Report, String>, now: Instant) {
        let place = |s: &v1::RecorderStatus| id(s.header.as_ref()) == *of;
        let Some(place) = self.finishing.iter().position(place) else {
            return;
        };
        let mut status = self.finishing.remove(place);
        match &result {
            Ok(report) => {
                status.state = v1::RecorderState::Finished.into();
                status.path = report.path.display().to_string();
                status.complete = report.complete;
                status.missed = report.missed;
                status.message = report.problems.join("; ");
            }
            Err(words) => {
                status.state = v1::RecorderState::Failed.into();
                status.message.clone_from(words);
            }
        }
        if id(self.status.header.as_ref()) == *of {
            self.status = status.clone();
        }
        self.out.push(Output::Status(status));
        self.out.push(match result {
            Ok(report) => Output::Finished(report),
            Err(words) => Output::Failed(words),
        });
        if let Some(next) = self.next.take() {
            self.started(*next, now);
        }
    }

    pub(super) fn discard(&mut self, recording: Recording) {
        self.last = Some(id(recording.started.header.as_ref()));
        self.prebuffer.forget(self.last.as_ref());
        update_status(&mut self.status, &recording);
        let label = recording.started.label.clone();
        let message = match recording.discard() {
            Ok(()) => "discarded".to_owned(),
            Err(problem) => format!("discarded, but its log cannot be deleted: {problem}"),
        };
        self.status.state = v1::RecorderState::Finished.into();
        self.status.message = message;
        // Without a path a finished episode is a discarded one.
        self.status.path.clear();
        self.out.push(Output::Status(self.status.clone()));
        self.out.push(Output::Discarded(label));
    }
}
