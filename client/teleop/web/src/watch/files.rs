//! State of the recordings of an operator's episodes. An episode is kept when a recorder
//! reports a complete file, and not before. Pure; times are seconds of the
//! caller's clock.

use std::collections::{BTreeMap, VecDeque};

use wheelarm_proto::v1;

/// Most episodes that are followed at a time.
const FOLLOWED: usize = 4;
/// A recorder that is missing for this long after the end no longer counts, s. One
/// that stalled returns within five.
const GONE: f64 = 8.0;
/// A recorder may still appear for this long after the end, s.
const APPEARS: f64 = 2.0;

/// Result for an episode's file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// Nothing was kept, or not everything.
    pub bad: bool,
    /// Text for the person.
    pub text: String,
}

/// State of an episode at one recorder.
#[derive(Clone, Debug)]
struct File {
    status: v1::RecorderStatus,
    /// The recorder disconnected at this time, s.
    missing: Option<f64>,
}

#[derive(Clone, Debug)]
struct Episode {
    id: (String, u64),
    label: String,
    practice: bool,
    /// This client started it.
    ours: bool,
    files: BTreeMap<String, File>,
    /// Since when it runs without a recorder that the server lists, s.
    unrecorded: Option<f64>,
    /// No recorder appeared for longer than [`APPEARS`].
    is_lost: bool,
    /// When it ended, s.
    ended: Option<f64>,
    /// The server confirmed the end, which states whether it is discarded.
    confirmed: bool,
}

/// The files of the running episode and of those that ended recently.
#[derive(Clone, Debug, Default)]
pub struct Files {
    episodes: VecDeque<Episode>,
}

fn id(header: Option<&v1::Header>) -> (String, u64) {
    header.map_or_else(Default::default, |h| (h.run_id.clone(), h.episode))
}

impl Files {
    /// An episode started, by this client or (`ours` false) by another one.
    pub fn began(&mut self, started: &v1::EpisodeStarted, ours: bool) {
        let id = id(started.header.as_ref());
        if let Some(known) = self.episodes.iter_mut().find(|episode| episode.id == id) {
            known.ours |= ours;
            return;
        }
        if self.episodes.len() == FOLLOWED {
            self.episodes.pop_front();
        }
        self.episodes.push_back(Episode {
            id,
            label: started.label.clone(),
            practice: started.practice,
            ours,
            files: BTreeMap::new(),
            unrecorded: None,
            is_lost: false,
            ended: None,
            confirmed: false,
        });
    }

    /// An episode ended; a discarded one needs no file.
    pub fn ended(&mut self, stopped: &v1::EpisodeStopped, now: f64) {
        let id = id(stopped.header.as_ref());
        if stopped.discard {
            self.episodes.retain(|episode| episode.id != id);
        } else if let Some(episode) = self.episodes.iter_mut().find(|e| e.id == id) {
            episode.ended.get_or_insert(now);
            episode.confirmed = true;
        }
    }

    /// Handles the server's list of recorders. Returns results of files.
    pub fn status(&mut self, status: &v1::Status, now: f64) -> Vec<Verdict> {
        let running = status.episode.as_ref();
        let waits = status.waiting_for_code() == v1::WaitingFor::Recorders;
        if let Some(started) = running.filter(|_| !waits) {
            self.began(started, false);
        }
        let running = running.map(|started| id(started.header.as_ref()));
        let mut verdicts = Vec::new();
        self.episodes.retain_mut(|episode| {
            if running.as_ref() != Some(&episode.id) {
                // The end was missed: the server may be another one.
                episode.ended.get_or_insert(now);
            }
            for file in episode.files.values_mut() {
                file.missing.get_or_insert(now);
            }
            for recorder in &status.recorders {
                if id(recorder.header.as_ref()) == episode.id {
                    let file = File {
                        status: recorder.clone(),
                        missing: None,
                    };
                    episode.files.insert(recorder.recorder.clone(), file);
                }
            }
            // A recorder that ends right after the start is never listed.
            if episode.files.is_empty() {
                let since = *episode.unrecorded.get_or_insert(now);
                episode.is_lost = now - since > APPEARS;
            } else {
                (episode.unrecorded, episode.is_lost) = (None, false);
            }
            let Some(verdict) = episode.verdict(now) else {
                return true;
            };
            // Other clients may run episodes without a recorder.
            if episode.ours || !episode.files.is_empty() {
                verdicts.push(verdict);
            }
            false
        });
        verdicts
    }

    /// Whether a connected recorder has the newest episode.
    #[must_use]
    pub fn is_recorded(&self) -> bool {
        let newest = self.episodes.back();
        newest.is_some_and(|episode| {
            let mut files = episode.files.iter();
            files.any(|(name, file)| file.problem(name).is_none())
        })
    }

    /// Problem of the recording of the running episode.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let running = self.episodes.back()?;
        if running.ended.is_some() || running.practice {
            return None;
        }
        if running.ours && running.is_lost {
            return Some("NOTHING IS RECORDED: no recorder has this episode".to_owned());
        }
        let problems: Vec<String> = running
            .files
            .iter()
            .filter_map(|(name, file)| file.problem(name))
            .collect();
        let still = running.files.len() - problems.len();
        match (problems.is_empty(), still) {
            (true, _) => None,
            (false, 0) => Some(format!(
                "NOTHING IS RECORDED any more: {}",
                problems.join("; ")
            )),
            (false, _) => Some(problems.join("; ")),
        }
    }
}

impl File {
    fn problem(&self, name: &str) -> Option<String> {
        match (self.status.state(), self.missing) {
            (v1::RecorderState::Failed, _) => {
                Some(format!("recorder {name} failed: {}", self.status.message))
            }
            (v1::RecorderState::Ready, Some(_)) => Some(format!("recorder {name} is gone")),
            (v1::RecorderState::Ready, None) if self.status.silent_seconds.is_some() => {
                Some(format!("recorder {name} does not answer"))
            }
            _ => None,
        }
    }

    /// Stops following an episode.
    fn is_settled(&self, now: f64) -> bool {
        let over = [v1::RecorderState::Finished, v1::RecorderState::Failed];
        let silent = self.status.silent_seconds;
        over.contains(&self.status.state())
            || self.missing.is_some_and(|at| now - at > GONE)
            || silent.is_some_and(|seconds| seconds > GONE)
    }

    fn is_kept(&self) -> bool {
        self.status.state() == v1::RecorderState::Finished && !self.status.path.is_empty()
    }
}

impl Episode {
    fn verdict(&self, now: f64) -> Option<Verdict> {
        let ended = self.ended?;
        let settled = self.files.values().all(|file| file.is_settled(now));
        let early = !self.confirmed || self.files.is_empty();
        if !settled || (early && now - ended < APPEARS) {
            return None;
        }
        if self.practice {
            return Some(Verdict {
                bad: false,
                text: format!("{} was practice: nothing is kept", self.label),
            });
        }
        let mut lines = Vec::new();
        let mut complete = 0;
        for (name, file) in &self.files {
            let status = &file.status;
            match (file.is_kept(), status.complete) {
                (true, true) => {
                    complete += 1;
                    lines.push(format!("kept in {}", status.path));
                }
                (true, false) => lines.push(format!(
                    "kept, but INCOMPLETE, in {}: {}",
                    status.path, status.message
                )),
                (false, _) => lines.push(file.problem(name).unwrap_or_else(|| {
                    format!("recorder {name} made no file: {}", status.message)
                })),
            }
        }
        let kept = self.files.values().any(File::is_kept);
        let text = match (kept, lines.is_empty()) {
            (true, _) => format!("episode {}: {}", self.label, lines.join("; ")),
            (false, true) => format!(
                "episode {} is NOT KEPT: no recorder recorded it",
                self.label
            ),
            (false, false) => format!("episode {} is NOT KEPT: {}", self.label, lines.join("; ")),
        };
        Some(Verdict {
            bad: complete == 0 || complete < self.files.len(),
            text,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::RecorderState::{Failed, Finished, Finishing, Ready};

    fn header() -> Option<v1::Header> {
        Some(v1::Header {
            run_id: "run".to_owned(),
            episode: 3,
            ..v1::Header::default()
        })
    }

    fn started(practice: bool) -> v1::EpisodeStarted {
        v1::EpisodeStarted {
            header: header(),
            label: "a-1".to_owned(),
            practice,
            ..v1::EpisodeStarted::default()
        }
    }

    fn stopped() -> v1::EpisodeStopped {
        v1::EpisodeStopped {
            header: header(),
            ..v1::EpisodeStopped::default()
        }
    }

    fn recorder(name: &str, state: v1::RecorderState) -> v1::RecorderStatus {
        let finished = state == Finished;
        v1::RecorderStatus {
            header: header(),
            recorder: name.to_owned(),
            state: state.into(),
            complete: finished,
            path: if finished { "d/a-1.h5" } else { "" }.to_owned(),
            message: if state == Failed { "no disk" } else { "" }.to_owned(),
            ..v1::RecorderStatus::default()
        }
    }

    fn status(runs: bool, recorders: &[v1::RecorderStatus]) -> v1::Status {
        v1::Status {
            episode: runs.then(|| started(false)),
            recorders: recorders.to_vec(),
            ..v1::Status::default()
        }
    }

    #[test]
    fn an_episode_is_kept_when_a_recorder_confirms_its_file_and_not_before() {
        let mut files = Files::default();
        let ready = [recorder("disk", Ready)];
        assert_eq!(files.status(&status(true, &ready), 0.0), []);
        files.ended(&stopped(), 5.0);
        // A status from before the end still lists it as running.
        assert_eq!(files.status(&status(true, &ready), 5.1), []);
        let finishing = [recorder("disk", Finishing)];
        assert_eq!(files.status(&status(false, &finishing), 60.0), []);
        let finished = [recorder("disk", Finished)];
        let verdicts = files.status(&status(false, &finished), 61.0);
        let [verdict] = &verdicts[..] else {
            panic!("{verdicts:?}")
        };
        assert!(
            !verdict.bad && verdict.text.contains("kept in d/a-1.h5"),
            "{verdict:?}"
        );
        assert_eq!(
            files.status(&status(false, &finished), 62.0),
            [],
            "reported once"
        );
    }

    #[test]
    fn an_episode_without_a_complete_file_is_not_reported_as_kept() {
        let partial = v1::RecorderStatus {
            complete: false,
            ..recorder("disk", Finished)
        };
        let cases: [(&[v1::RecorderStatus], &[v1::RecorderStatus], &str); 4] = [
            (&[], &[], "NOT KEPT: no recorder"),
            (
                &[recorder("disk", Ready)],
                &[recorder("disk", Failed)],
                "NOT KEPT: recorder disk failed: no disk",
            ),
            (
                &[recorder("disk", Ready)],
                &[],
                "NOT KEPT: recorder disk is gone",
            ),
            (&[recorder("disk", Ready)], &[partial], "INCOMPLETE"),
        ];
        for (before, after, words) in cases {
            let mut files = Files::default();
            files.began(&started(false), true);
            assert_eq!(files.status(&status(true, before), 0.0), []);
            files.ended(&stopped(), 1.0);
            let mut verdicts = files.status(&status(false, after), 1.1);
            verdicts.extend(files.status(&status(false, after), 1.2 + GONE));
            let [verdict] = &verdicts[..] else {
                panic!("{words}: {verdicts:?}")
            };
            assert!(verdict.bad && verdict.text.contains(words), "{verdict:?}");
        }
    }

    #[test]
    fn episode_whose_recorder_never_appeared_is_a_problem() {
        let mut files = Files::default();
        let running = status(true, &[]);
        files.began(running.episode.as_ref().expect("an episode"), true);
        files.status(&running, 0.0);
        assert_eq!(files.problem(), None);
        files.status(&running, 1.1 * APPEARS);
        let problem = files.problem().unwrap_or_default();
        assert!(problem.starts_with("NOTHING IS RECORDED"), "{problem}");
        files.status(&status(true, &[recorder("a", Ready)]), 2.0 * APPEARS);
        assert_eq!(files.problem(), None, "it has appeared");
    }

    #[test]
    fn a_recorder_that_fails_or_disconnects_is_a_problem_at_once() {
        let mut files = Files::default();
        let both = [recorder("a", Ready), recorder("b", Ready)];
        files.status(&status(true, &both), 0.0);
        assert_eq!(files.problem(), None);
        let failed = [recorder("a", Ready), recorder("b", Failed)];
        files.status(&status(true, &failed), 1.0);
        assert_eq!(
            files.problem().as_deref(),
            Some("recorder b failed: no disk")
        );
        files.status(&status(true, &failed[1..]), 1.4);
        let problem = files.problem().unwrap_or_default();
        assert!(problem.starts_with("NOTHING IS RECORDED"), "{problem}");
        files.status(&status(true, &both), 2.0);
        assert_eq!(files.problem(), None, "they are back");
    }

    #[test]
    fn a_recorder_that_does_not_answer_is_a_problem_and_keeps_nothing() {
        let mut files = Files::default();
        let hung = v1::RecorderStatus {
            silent_seconds: Some(4.0),
            ..recorder("disk", Ready)
        };
        files.status(&status(true, &[recorder("disk", Ready)]), 0.0);
        assert!(files.is_recorded());
        files.status(&status(true, std::slice::from_ref(&hung)), 4.0);
        let problem = files.problem().unwrap_or_default();
        assert!(
            problem.ends_with("recorder disk does not answer"),
            "{problem}"
        );
        assert!(!files.is_recorded());
        files.ended(&stopped(), 5.0);
        assert_eq!(
            files.status(&status(false, std::slice::from_ref(&hung)), 5.0),
            []
        );
        let hung = v1::RecorderStatus {
            silent_seconds: Some(1.1 * GONE),
            ..hung
        };
        let verdicts = files.status(&status(false, &[hung]), 9.0);
        assert!(verdicts[0].text.contains("NOT KEPT"), "{verdicts:?}");
    }

    #[test]
    fn practice_and_discarded_episodes_need_no_recorder() {
        let mut files = Files::default();
        files.began(&started(true), true);
        files.status(
            &v1::Status {
                episode: Some(started(true)),
                ..Default::default()
            },
            0.0,
        );
        assert_eq!(files.problem(), None);
        let discarded = v1::EpisodeStopped {
            discard: true,
            ..stopped()
        };
        files.ended(&discarded, 1.0);
        assert_eq!(files.status(&status(false, &[]), 99.0), []);
        // Other clients may run episodes without a recorder.
        files.status(&status(true, &[]), 100.0);
        files.ended(&stopped(), 101.0);
        assert_eq!(files.status(&status(false, &[]), 199.0), []);
    }
}
