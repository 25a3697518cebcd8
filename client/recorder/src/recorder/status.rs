//! The status of a recorder, with the credit for a lock-step server.

use wheelarm_dataset::writer::{WriteError, next_free_label};
use wheelarm_proto::{CREDIT_STATUS_TICKS, v1};

use super::super::episode::Recording;
use super::{Output, Recorder, Stage};

impl Recorder {
    /// Gives up the current episode. Dropping the writer keeps its log.
    pub(super) fn fail(&mut self, words: String) {
        self.last = self.current();
        self.stage = Stage::Idle;
        self.fail_with(words);
    }

    /// Gives up the current episode, whose label exists already, and proposes a free label.
    pub(super) fn fail_existing(&mut self, problem: &WriteError) {
        let label = match &self.stage {
            Stage::Opening { started, .. } => started.label.clone(),
            _ => String::new(),
        };
        let scratch = self.options.scratch.as_deref();
        let dirs = [Some(self.dir.as_path()), scratch];
        let dirs: Vec<_> = dirs.into_iter().flatten().collect();
        let free = next_free_label(&dirs, &label);
        let words = format!("{problem}; the next free label is {free}");
        self.status.free_label = free;
        self.fail(words);
    }

    pub(super) fn fail_with(&mut self, words: String) {
        self.counted += 1;
        self.prebuffer.forget(self.last.as_ref());
        self.status.state = v1::RecorderState::Failed.into();
        self.status.message.clone_from(&words);
        self.out.push(Output::Status(self.status.clone()));
        self.out.push(Output::Failed(words));
    }

    /// Whether the credit has changed enough to publish it.
    pub(super) fn has_new_credit(&self) -> bool {
        let Stage::Recording(recording) = &self.stage else {
            return false;
        };
        recording.credit().is_some_and(|credit| {
            self.status.credit_frames != Some(credit.frames)
                || credit.tick >= self.status.credit_tick.unwrap_or(0) + CREDIT_STATUS_TICKS
        })
    }

    /// Publishes readiness and credit.
    pub(super) fn publish(&mut self) {
        if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &self.stage {
            update_status(&mut self.status, recording);
        }
        self.out.push(Output::Status(self.status.clone()));
    }
}

/// Updates a status from the received samples. The credit stays while a missing sample
/// may still arrive.
pub(super) fn update_status(status: &mut v1::RecorderStatus, recording: &Recording) {
    status.accepted_frames = recording.accepted;
    status.missed = recording.missed();
    if let Some(credit) = recording.credit() {
        status.credit_frames = Some(credit.frames);
        status.credit_tick = Some(credit.tick);
    }
    if let (Some(header), Some(newest)) = (&mut status.header, recording.newest) {
        header.sequence = newest.sequence;
        header.stamp_nanos = newest.stamp_nanos;
        header.tick = newest.tick;
    }
}
