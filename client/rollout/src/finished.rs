//! The result of an episode whose driver reached its end.

use serde::{Deserialize, Serialize};
use wheelarm_expert::operator::Outcome;
use wheelarm_expert::run::Report;
use wheelarm_proto::v1;

use crate::comparison::Comparison;
use crate::failure::FailureCause;
use crate::policy::PolicyError;
use crate::serde_text::message;

/// An episode whose driver reached its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finished {
    /// The driver's own verdict.
    pub outcome: Outcome,
    /// Start of the episode.
    #[serde(with = "message")]
    pub started: v1::EpisodeStarted,
    /// End of the episode; empty when the server did not report it.
    #[serde(with = "message")]
    pub stopped: v1::EpisodeStopped,
    /// Last evaluation of the task.
    #[serde(with = "message")]
    pub evaluation: v1::Evaluation,
    /// The scenario that was in force, with its sampled values.
    #[serde(with = "message")]
    pub scenario: v1::Scenario,
    /// Control ticks that the driver answered.
    pub ticks: u64,
    /// Events of the expert, each with its simulated time.
    pub notes: Vec<String>,
    /// Hash of the newest published state; absent when none was published.
    pub hash: Option<u64>,
    /// Wall time from the first control tick to the end, s.
    pub wall_seconds: f64,
    /// Label of the demonstration that was adapted; absent for other drivers.
    pub source: Option<String>,
    /// Last messages of the recorder and of the worker, for errors about the file.
    pub messages: String,
    /// The error of the policy that ended the episode.
    #[serde(skip)]
    pub policy_error: Option<PolicyError>,
    /// Wall time of each answer of the policy, s.
    #[serde(skip)]
    pub answer_seconds: Vec<f64>,
    /// State hashes of a replay beside the recorded ones.
    #[serde(skip)]
    pub comparison: Option<Comparison>,
    /// Status of the recorder after it finished the file; absent for a worker and for a
    /// recorder that records one episode.
    #[serde(skip)]
    pub recorded: Option<v1::RecorderStatus>,
}

impl From<Report> for Finished {
    fn from(report: Report) -> Self {
        Self {
            outcome: report.outcome,
            scenario: report.started.scenario.clone().unwrap_or_default(),
            started: report.started,
            stopped: report.stopped.unwrap_or_default(),
            evaluation: report.evaluation,
            ticks: report.ticks,
            source: report.source,
            notes: Vec::new(),
            hash: None,
            wall_seconds: 0.0,
            messages: String::new(),
            policy_error: None,
            answer_seconds: Vec::new(),
            comparison: None,
            recorded: None,
        }
    }
}

impl Finished {
    /// The driver and the task agree that the task is done.
    #[must_use]
    pub fn succeeded(&self) -> bool {
        self.outcome.is_success(&self.evaluation)
    }

    /// Reason of the failure, as text; absent after success.
    #[must_use]
    pub fn why(&self) -> Option<String> {
        self.outcome.why(&self.evaluation)
    }

    /// The part that failed; absent when only the task did.
    #[must_use]
    pub fn failure(&self) -> Option<FailureCause> {
        match (&self.outcome, &self.policy_error) {
            (Outcome::Broken(_), _) => Some(FailureCause::Physics),
            (_, Some(_)) => Some(FailureCause::Policy),
            (Outcome::Success | Outcome::Failure(_), None) => None,
        }
    }

    /// End of the episode, in a word or two: `success`, the task's reason to fail
    /// (`timeout`, `dropped`, …), `gave up` when the driver did, or the part that failed.
    #[must_use]
    pub fn end(&self) -> String {
        use v1::FailureReason as Reason;
        if self.succeeded() {
            return "success".to_owned();
        }
        if let Some(problem) = &self.policy_error {
            return format!("policy {}", problem.kind());
        }
        if let Some(cause) = self.failure() {
            return cause.words().to_owned();
        }
        match self.evaluation.failure_reason() {
            Reason::Unspecified | Reason::None => "gave up".to_owned(),
            reason => {
                let name = reason.as_str_name().trim_start_matches("FAILURE_REASON_");
                name.to_lowercase().replace('_', " ")
            }
        }
    }

    /// Number of the episode in its server's run.
    #[must_use]
    pub fn episode(&self) -> u64 {
        self.started.header.as_ref().map_or(0, |h| h.episode)
    }

    /// Simulated seconds from the episode's start to its end; 0 when the server did not report the end.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let stamp = |header: Option<&v1::Header>| header.map_or(0, |h| h.stamp_nanos);
        let begun = stamp(self.started.header.as_ref());
        let ended = stamp(self.stopped.header.as_ref());
        ended.saturating_sub(begun) as f64 * 1e-9
    }
}
