//! The line protocol between this crate and `wheelarm-worker`: one JSON object per line on
//! the worker's standard input and output.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use wheelarm_proto::v1;

use crate::driver::{DemonstrationFile, Driver, Expert};
use crate::failure::FailureCause;
use crate::finished::Finished;
use crate::launcher::Record;
use crate::rollout::Rollout;
use crate::serde_text::message;

/// A request to a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Run an episode.
    Run(Box<EpisodeRequest>),
    /// End an episode early; its recorder keeps what it has.
    Cancel {
        /// Number of the request.
        number: u64,
    },
}

/// An episode of the scripted expert.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRequest {
    /// Number of the request, unique for one worker.
    pub number: u64,
    /// The scenario to simulate; without cameras nothing is rendered.
    #[serde(with = "message")]
    pub scenario: v1::Scenario,
    /// Label of the episode, and name of its file.
    pub label: String,
    /// Recording of the episode; none when absent.
    pub record: Option<Record>,
    /// File for the phases and notes of the expert.
    pub log: Option<PathBuf>,
    /// Settings of the expert.
    pub expert: Expert,
    /// Demonstrations that the expert adapts; its own grasps when absent.
    pub demonstrations: Option<DemonstrationFile>,
}

impl EpisodeRequest {
    /// The request for a rollout; absent when its driver runs outside of workers.
    #[must_use]
    pub fn for_rollout(rollout: &Rollout) -> Option<Self> {
        let (expert, demonstrations) = match &rollout.driver {
            Driver::Expert(expert) => (expert.clone(), None),
            Driver::Demonstrations(file) => (Expert::default(), Some(file.clone())),
            Driver::Policy(_) | Driver::Replay(_) | Driver::Playback(_) => return None,
        };
        Some(Self {
            number: 0,
            scenario: rollout.scenario.clone(),
            label: rollout.label.clone(),
            record: rollout.record.clone(),
            log: rollout.operator_log(),
            expert,
            demonstrations,
        })
    }

    /// The driver of the episode.
    #[must_use]
    pub fn driver(&self) -> Driver {
        match &self.demonstrations {
            Some(file) => Driver::Demonstrations(file.clone()),
            None => Driver::Expert(self.expert.clone()),
        }
    }
}

/// A line of a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// The worker accepts requests, several at a time.
    Ready,
    /// An event of an episode.
    Episode {
        /// Number of the request.
        number: u64,
        /// The event.
        event: Event,
    },
}

/// An event of an episode in a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The state of the simulation, once per second.
    Status(#[serde(with = "message")] Box<v1::Status>),
    /// The expert has finished.
    Finished(Box<Finished>),
    /// The episode failed.
    Failed {
        /// The part that failed.
        cause: FailureCause,
        /// Reason, as text.
        reason: String,
    },
    /// Something failed that may be the host's fault.
    HostFailed(String),
    /// The recorder has ended.
    Recorded {
        /// Its exit code, as that of `wheelarm record`: 0 for a complete file.
        code: u8,
        /// The failure, as text.
        words: String,
    },
    /// Everything of the episode has ended; the last event.
    Over,
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_expert::forced::ForcedError;
    use wheelarm_expert::operator::Outcome;
    use wheelarm_expert::run::Report;
    use wheelarm_proto::settings::Depth;

    #[test]
    fn lines_are_read_as_they_are_written() {
        let scenario = v1::Scenario {
            task: Some("pick_bowl".into()),
            seed: Some(u64::MAX),
            ..v1::Scenario::default()
        };
        let request = Request::Run(Box::new(EpisodeRequest {
            number: 3,
            scenario: scenario.clone(),
            label: "pick_bowl-0001".into(),
            record: Some(Record {
                out: "data".into(),
                scratch: None,
                depth: Depth::Millimetres,
                name: "collect".into(),
            }),
            log: Some("logs/a \"b\"\n.log".into()),
            expert: Expert {
                profile_seed: Some(7),
                forced: Some(ForcedError::Drop),
                shakes: true,
            },
            demonstrations: None,
        }));
        let line = serde_json::to_string(&request).unwrap();
        assert!(!line.contains('\n'), "{line}");
        assert_eq!(serde_json::from_str::<Request>(&line).unwrap(), request);
        let finished = Finished {
            scenario,
            notes: vec!["1.00 s begun".into()],
            hash: Some(u64::MAX),
            wall_seconds: 0.5,
            ..Finished::from(Report {
                outcome: Outcome::Failure("no way".into()),
                started: v1::EpisodeStarted::default(),
                stopped: Some(v1::EpisodeStopped::default()),
                evaluation: v1::Evaluation::default(),
                ticks: 12,
                source: None,
            })
        };
        assert_eq!(finished.why(), Some("no way".into()));
        for event in [
            Event::Finished(Box::new(finished)),
            Event::Failed {
                cause: FailureCause::Scenario,
                reason: "no task".into(),
            },
        ] {
            let reply = Reply::Episode { number: 3, event };
            let line = serde_json::to_string(&reply).unwrap();
            assert_eq!(serde_json::from_str::<Reply>(&line).unwrap(), reply);
        }
        assert!(serde_json::from_str::<Reply>("thread panicked").is_err());
    }
}
