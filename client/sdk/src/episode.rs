//! Starts an episode and waits until it runs.

use std::time::Duration;

use wheelarm_proto::v1;

use super::{Client, ClientError};

/// Time between two status queries.
const POLL: Duration = Duration::from_millis(50);

/// Most labels that are tried when recorders have files of the first ones. Each retry
/// continues after the labels in use, so that several recorders agree soon.
const LABELS: usize = 8;

impl Client {
    /// Starts an episode and waits until it runs: after `require_recorders` recorders
    /// have opened their files.
    ///
    /// # Errors
    /// [`ClientError::NotBegun`] when a recorder cannot record it or none is ready in time.
    pub fn start_episode(
        &self,
        request: &v1::EpisodeStartRequest,
    ) -> Result<v1::EpisodeStarted, ClientError> {
        let started = self.request(request)?;
        loop {
            let status = self.request(&v1::StatusRequest {})?;
            match stage(&started, request.require_recorders, &status) {
                Stage::Runs => return Ok(started),
                Stage::Waits => std::thread::sleep(POLL),
                Stage::Failed { why, free_label } => {
                    return Err(ClientError::NotBegun {
                        label: request.label.clone(),
                        why,
                        free_label,
                    });
                }
                Stage::Over => {
                    self.check_begun(&started)?;
                    return Ok(started);
                }
            }
        }
    }

    /// As [`Client::start_episode`] for a generated label: when a recorder has a file of
    /// that label, the episode uses the next label that is free there.
    ///
    /// # Errors
    /// As [`Client::start_episode`].
    pub fn start_episode_numbered(
        &self,
        mut request: v1::EpisodeStartRequest,
    ) -> Result<v1::EpisodeStarted, ClientError> {
        for _ in 1..LABELS {
            match self.start_episode(&request) {
                Err(ClientError::NotBegun {
                    free_label: Some(label),
                    ..
                }) => request.label = label,
                other => return other,
            }
        }
        self.start_episode(&request)
    }

    /// Returns an error unless the episode began before it ended.
    fn check_begun(&self, started: &v1::EpisodeStarted) -> Result<(), ClientError> {
        let ours = id(started.header.as_ref());
        let state = self.request(&v1::EpisodeRequest::default())?;
        let mut ended = state.ended.iter();
        let end = ended.find(|end| id(end.header.as_ref()) == ours);
        if end.is_some_and(|end| end.cause() == v1::EndCause::Recorders) {
            return Err(ClientError::NotBegun {
                label: started.label.clone(),
                why: "its recorders were not ready in time; `wheelarm status` shows which are \
                      connected, `wheelarm record` starts another"
                    .to_owned(),
                free_label: None,
            });
        }
        Ok(())
    }
}

/// State of an announced episode.
#[derive(Debug, PartialEq)]
enum Stage {
    /// It waits for recorders.
    Waits,
    Runs,
    /// A recorder cannot record it.
    Failed {
        why: String,
        free_label: Option<String>,
    },
    /// It has ended, or never began.
    Over,
}

/// Run and number of an episode.
fn id(header: Option<&v1::Header>) -> (String, u64) {
    let header = header.cloned().unwrap_or_default();
    (header.run_id, header.episode)
}

fn stage(started: &v1::EpisodeStarted, required: u32, status: &v1::Status) -> Stage {
    let ours = id(started.header.as_ref());
    let of_ours = || {
        let recorders = status.recorders.iter();
        recorders.filter(|recorder| id(recorder.header.as_ref()) == ours)
    };
    let count = |state| of_ours().filter(|r| r.state() == state).count();
    let running = status.episode.as_ref();
    let is_running = running.is_some_and(|episode| id(episode.header.as_ref()) == ours);
    let waits = status.waiting_for_code() == v1::WaitingFor::Recorders;
    if is_running && !waits && count(v1::RecorderState::Ready) >= required as usize {
        return Stage::Runs;
    }
    let mut failed: Vec<_> = of_ours()
        .filter(|r| r.state() == v1::RecorderState::Failed)
        .collect();
    // Prefer a recorder with a free label; of several, the highest label.
    failed.sort_by_key(|r| (r.free_label.len(), r.free_label.clone()));
    match failed.last() {
        Some(failed) => Stage::Failed {
            why: format!(
                "recorder {} cannot record it: {}",
                failed.recorder, failed.message
            ),
            free_label: (!failed.free_label.is_empty()).then(|| failed.free_label.clone()),
        },
        None if is_running => Stage::Waits,
        None => Stage::Over,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::{RecorderState, WaitingFor};

    fn header(episode: u64) -> Option<v1::Header> {
        Some(v1::Header {
            run_id: "run".to_owned(),
            episode,
            ..v1::Header::default()
        })
    }

    fn started() -> v1::EpisodeStarted {
        v1::EpisodeStarted {
            header: header(3),
            ..v1::EpisodeStarted::default()
        }
    }

    fn recorder(episode: u64, state: RecorderState, message: &str) -> v1::RecorderStatus {
        v1::RecorderStatus {
            header: header(episode),
            recorder: "r".to_owned(),
            state: state.into(),
            message: message.to_owned(),
            ..v1::RecorderStatus::default()
        }
    }

    #[test]
    fn episode_runs_only_after_its_recorders_are_ready() {
        let status = |waiting: WaitingFor, recorders: &[v1::RecorderStatus]| v1::Status {
            episode: Some(started()),
            waiting_for_code: waiting.into(),
            recorders: recorders.to_vec(),
            ..v1::Status::default()
        };
        let stage = |required, status: &v1::Status| stage(&started(), required, status);
        let earlier = recorder(2, RecorderState::Failed, "of an episode before");
        let ready = recorder(3, RecorderState::Ready, "");
        let failed = recorder(3, RecorderState::Failed, "no disk");
        let none = status(WaitingFor::Unspecified, &[]);
        assert_eq!(stage(0, &none), Stage::Runs);
        assert_eq!(stage(1, &none), Stage::Waits);
        let waits = status(WaitingFor::Recorders, std::slice::from_ref(&earlier));
        assert_eq!(stage(0, &waits), Stage::Waits);
        let both = [earlier.clone(), ready, failed.clone()];
        let runs = status(WaitingFor::Commander, &both);
        assert_eq!(stage(1, &runs), Stage::Runs, "one recorder is required");
        let refused = |free: Option<&str>| Stage::Failed {
            why: "recorder r cannot record it: no disk".to_owned(),
            free_label: free.map(str::to_owned),
        };
        assert_eq!(stage(2, &runs), refused(None));
        let mut over = status(WaitingFor::Recorders, &[earlier, failed]);
        over.episode = None;
        assert_eq!(stage(1, &over), refused(None));
        // Of several recorders, the label that is free at all of them is used.
        for label in ["a-10", "a-9"] {
            let mut taken = recorder(3, RecorderState::Failed, "no disk");
            taken.free_label = label.to_owned();
            over.recorders.push(taken);
        }
        assert_eq!(stage(1, &over), refused(Some("a-10")));
        over.recorders.clear();
        assert_eq!(stage(1, &over), Stage::Over);
    }
}
