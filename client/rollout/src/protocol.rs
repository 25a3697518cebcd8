//! What a worker is asked and what it says: one line of JSON each, on its standard
//! input and output. An order is one episode.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use wheelarm_operate::operator::Outcome;
use wheelarm_operate::run::Report;
use wheelarm_proto::v1;

/// What a worker is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Asked {
    /// To make an episode.
    Do(Box<Order>),
    /// To end an order that is under way: its recorder keeps what it has.
    Cancel {
        /// Its number.
        order: u64,
    },
}

/// An episode of the scripted operator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Its number, of one worker.
    pub number: u64,
    /// What is simulated; without cameras nothing is drawn.
    #[serde(with = "message")]
    pub scenario: v1::Scenario,
    /// Label of the episode, and name of its file.
    pub label: String,
    /// How it is recorded, if it is.
    pub record: Option<Recording>,
    /// File for what the operator does, in words.
    pub log: Option<PathBuf>,
    /// Seed of the operator's profile; the scenario's when absent.
    pub profile_seed: Option<u64>,
    /// Name of the error that the operator makes on purpose.
    pub forced: Option<String>,
    /// Demonstrations by which the thing is taken; the operator's own ways without.
    pub shown: Option<ShownFile>,
}

/// Demonstrations for one episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShownFile {
    /// A list of [`Demonstration`](wheelarm_operate::demonstration::Demonstration) as JSON.
    pub file: PathBuf,
    /// Which are liked best, and how the hand is off.
    pub seed: u64,
    /// Deviation of the hand from what was shown, metres.
    pub noise: f64,
}

/// How an episode is recorded.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recording {
    /// Folder for the file.
    pub out: PathBuf,
    /// Folder for what is being recorded; `out` when absent.
    #[serde(default)]
    pub scratch: Option<PathBuf>,
    /// Name of how depth is stored.
    pub depth: String,
    /// Name of the recorder.
    pub name: String,
}

/// What a worker says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Said {
    /// It takes orders, several at a time.
    Ready,
    /// Of an order.
    Of {
        /// Its number.
        order: u64,
        /// What.
        told: Told,
    },
}

/// What a worker tells of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Told {
    /// The scenario cannot be simulated, in its words.
    Scenario(String),
    /// The simulation's state, once a second.
    Status(#[serde(with = "message")] Box<v1::Status>),
    /// The operator is at its end.
    Tried(Box<Tried>),
    /// The operator panicked.
    Panicked(String),
    /// The simulation or its service ended by itself.
    Broke(String),
    /// Something else went wrong that may be the host's fault.
    Trouble(String),
    /// The recorder has ended: 0 for a whole file.
    Recorded {
        /// As the exit code of `wheelarm record`.
        code: u8,
        /// What failed, in words.
        words: String,
    },
    /// Nothing of it is left: the last that is told of an order.
    Over,
}

/// What the operator came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Its own word.
    pub came: Came,
    /// The episode.
    #[serde(with = "message")]
    pub started: v1::EpisodeStarted,
    /// Its end.
    #[serde(with = "message")]
    pub stopped: v1::EpisodeStopped,
    /// Last evaluation of the task.
    #[serde(with = "message")]
    pub evaluation: v1::Evaluation,
    /// The scenario that was in force.
    #[serde(with = "message")]
    pub scenario: v1::Scenario,
    /// Control ticks answered.
    pub ticks: u64,
    /// What happened, each with its time.
    pub notes: Vec<String>,
    /// The last state's hash, where one was published.
    pub hash: Option<u64>,
    /// Wall time from the first control tick to the end, s.
    pub wall_seconds: f64,
    /// The episode whose demonstration was adapted, if one was.
    pub source: Option<String>,
}

/// The operator's own word.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Came {
    /// The task's conditions hold.
    Success,
    /// Why it was abandoned.
    Failure(String),
    /// The simulation broke under its hands.
    Broken(String),
}

impl Tried {
    /// The operator's report.
    #[must_use]
    pub fn report(&self) -> Report {
        Report {
            outcome: match &self.came {
                Came::Success => Outcome::Success,
                Came::Failure(why) => Outcome::Failure(why.clone()),
                Came::Broken(why) => Outcome::Broken(why.clone()),
            },
            started: self.started.clone(),
            stopped: Some(self.stopped.clone()),
            evaluation: self.evaluation.clone(),
            ticks: self.ticks,
            source: self.source.clone(),
        }
    }
}

impl From<&Outcome> for Came {
    fn from(outcome: &Outcome) -> Self {
        match outcome {
            Outcome::Success => Self::Success,
            Outcome::Failure(why) => Self::Failure(why.clone()),
            Outcome::Broken(why) => Self::Broken(why.clone()),
        }
    }
}

/// A message of the contract as text: protobuf in base64.
mod message {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};
    use wheelarm_proto::Message;

    pub(super) fn serialize<M: Message, S: Serializer>(
        message: &M,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.serialize_str(&STANDARD.encode(message.encode_to_vec()))
    }

    pub(super) fn deserialize<'de, M: Message + Default, D: Deserializer<'de>>(
        from: D,
    ) -> Result<M, D::Error> {
        let text = String::deserialize(from)?;
        let bytes = STANDARD.decode(text).map_err(D::Error::custom)?;
        M::decode(&*bytes).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_as_they_are_written() {
        let scenario = v1::Scenario {
            task: Some("pick_bowl".into()),
            seed: Some(u64::MAX),
            ..v1::Scenario::default()
        };
        let asked = Asked::Do(Box::new(Order {
            number: 3,
            scenario: scenario.clone(),
            label: "pick_bowl-0001".into(),
            record: None,
            log: Some("logs/a \"b\"\n.log".into()),
            profile_seed: Some(7),
            forced: None,
            shown: None,
        }));
        let line = serde_json::to_string(&asked).unwrap();
        assert!(!line.contains('\n'), "{line}");
        assert_eq!(serde_json::from_str::<Asked>(&line).unwrap(), asked);
        let tried = Tried {
            came: Came::Failure("no way".into()),
            started: v1::EpisodeStarted::default(),
            stopped: v1::EpisodeStopped::default(),
            evaluation: v1::Evaluation::default(),
            scenario,
            ticks: 12,
            notes: vec!["1.00 s begun".into()],
            hash: Some(u64::MAX),
            wall_seconds: 0.5,
            source: None,
        };
        assert_eq!(tried.report().why(), Some("no way".into()));
        let said = Said::Of {
            order: 3,
            told: Told::Tried(Box::new(tried)),
        };
        let line = serde_json::to_string(&said).unwrap();
        assert_eq!(serde_json::from_str::<Said>(&line).unwrap(), said);
        assert!(serde_json::from_str::<Said>("thread panicked").is_err());
    }
}
