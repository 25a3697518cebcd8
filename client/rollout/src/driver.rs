//! The program that drives the robot in an episode, and how it runs as a client.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use wheelarm_expert::demonstration::Demonstrations;
use wheelarm_expert::forced::ForcedError;
use wheelarm_expert::log::Log;
use wheelarm_expert::run::{self as expert, DriverError, OperateOptions, Progress, Report};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::Streams;

use crate::finished::Finished;
use crate::heartbeat::Heartbeat;
use crate::playback::{Playback, play};
use crate::policy::{self, Policy, PolicyError, PolicyOptions};
use crate::replay::{Replay, replay};
use crate::session::Session;

/// Wait for samples that were published and have not arrived.
const LATE: Duration = Duration::from_millis(5);

/// The program that drives the robot.
#[derive(Clone)]
pub enum Driver {
    /// The scripted expert.
    Expert(Expert),
    /// The expert, which adapts recorded demonstrations to the scene.
    Demonstrations(DemonstrationFile),
    /// A policy.
    Policy(PolicyDriver),
    /// The commands of a recording.
    Replay(Arc<Replay>),
    /// The states of a recording.
    Playback(Arc<Playback>),
}

/// Settings of the scripted expert.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expert {
    /// Seed of its profile; the scenario's when absent.
    pub profile_seed: Option<u64>,
    /// The error that it makes on purpose and corrects.
    pub forced: Option<ForcedError>,
    /// Tests the object after the task, which fails when it slips while it is shaken, or when it
    /// was put down and does not rest.
    #[serde(default)]
    pub shakes: bool,
}

/// Demonstrations for one episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DemonstrationFile {
    /// A list of [`Demonstration`](wheelarm_expert::demonstration::Demonstration) as JSON.
    pub file: PathBuf,
    /// Seed of the choice among the demonstrations and of the noise.
    pub seed: u64,
    /// Deviation of the hand from the demonstration, metres.
    pub noise: f64,
}

impl DemonstrationFile {
    fn read(&self) -> anyhow::Result<Demonstrations> {
        let context = || format!("reading {}", self.file.display());
        let text = std::fs::read_to_string(&self.file).with_context(context)?;
        Ok(Demonstrations {
            list: serde_json::from_str(&text).with_context(context)?,
            seed: self.seed,
            noise: self.noise,
        })
    }
}

/// A policy, and how its answers are executed.
#[derive(Clone)]
pub struct PolicyDriver {
    /// The policy.
    pub policy: Arc<dyn Policy>,
    /// Execution of its chunks.
    pub options: PolicyOptions,
    /// The expert takes over after so many simulated seconds.
    pub takeover: Option<Takeover>,
}

/// Takeover of the expert from a policy.
#[derive(Clone, Debug, PartialEq)]
pub struct Takeover {
    /// Simulated seconds after the start of the episode.
    pub seconds: f64,
    /// Settings of the expert.
    pub expert: Expert,
}

impl Driver {
    /// Drives an episode to its end.
    ///
    /// # Errors
    /// When the connection, the server or a file fails, mostly as a [`DriverError`]. A task
    /// that was tried and not done is [`Finished`], and so is the error of a policy.
    pub fn run(&self, session: &Session<'_>) -> anyhow::Result<Finished> {
        let log = session
            .log
            .map(|path| Log::create(path).with_context(|| format!("making {}", path.display())));
        let mut log = log.transpose()?;
        let hashes = session.client.streams(&[TopicId::StateHash])?;
        let mut notes = Vec::new();
        let begun = Instant::now();
        let mut client = EpisodeClient {
            session,
            log: log.as_mut(),
            notes: &mut notes,
        };
        let finished = match self {
            Self::Replay(script) => return replay(session, script),
            Self::Playback(script) => return play(session, script),
            Self::Expert(expert) => client.expert(expert, Demonstrations::default())?,
            Self::Demonstrations(file) => client.expert(&Expert::default(), file.read()?)?,
            Self::Policy(driver) => client.policy(driver)?,
        };
        Ok(Finished {
            notes,
            wall_seconds: begun.elapsed().as_secs_f64(),
            hash: newest_hash(&hashes)?,
            ..finished
        })
    }
}

/// The expert or a policy as a client of one episode.
struct EpisodeClient<'a> {
    session: &'a Session<'a>,
    log: Option<&'a mut Log>,
    notes: &'a mut Vec<String>,
}

impl EpisodeClient<'_> {
    fn expert(&mut self, expert: &Expert, shown: Demonstrations) -> Result<Finished, DriverError> {
        let options = OperateOptions {
            label: Some(self.session.label.to_owned()),
            require_recorders: self.session.recorders,
            forced: expert.forced,
            profile_seed: expert.profile_seed,
            shakes: expert.shakes,
            shown,
            ..OperateOptions::default()
        };
        Ok(self.operate(&options)?.into())
    }

    fn operate(&mut self, options: &OperateOptions) -> Result<Report, DriverError> {
        let report = expert::run(self.session.client, options, &mut |progress| {
            self.session.progress(progress);
            let new = progress.notes.iter();
            let new = new.map(|note| format!("{:.2} s {note}", progress.time));
            self.notes.extend(new);
            if let Some(log) = &mut self.log {
                log.follow(progress);
            }
        });
        if let Some(log) = &mut self.log {
            log.end(&report);
        }
        report
    }

    fn policy(&mut self, driver: &PolicyDriver) -> Result<Finished, DriverError> {
        let session = self.session;
        let timed = Timed {
            policy: driver.policy.as_ref(),
            heartbeat: session.heartbeat,
        };
        let options = PolicyOptions {
            label: self.session.label.to_owned(),
            require_recorders: self.session.recorders,
            until_seconds: driver.takeover.as_ref().map(|takeover| takeover.seconds),
            ..driver.options.clone()
        };
        let begun = Instant::now();
        let finished = policy::run(session.client, &timed, &options, &mut |time| {
            session.progress(&Progress {
                time,
                phase: "policy",
                factor: time / begun.elapsed().as_secs_f64().max(1e-9),
                notes: &[],
            });
        })?;
        let goes_on = finished.stopped.header.is_none() && finished.failure().is_none();
        let Some(takeover) = driver.takeover.as_ref().filter(|_| goes_on) else {
            return Ok(finished);
        };
        let seconds = session.heartbeat.seconds();
        self.notes
            .push(format!("{seconds:.2} s the operator takes over"));
        let options = OperateOptions {
            label: Some(self.session.label.to_owned()),
            require_recorders: self.session.recorders,
            forced: takeover.expert.forced,
            on_the_spot: true,
            ..OperateOptions::default()
        };
        let mut report = self.operate(&options)?;
        // The policy started the episode, so the expert does not end it.
        if report.stopped.is_none() {
            report.stopped = Some(session.client.stop_episode_of(&report.started, false)?);
        }
        Ok(report.into())
    }
}

fn newest_hash(hashes: &Streams) -> anyhow::Result<Option<u64>> {
    let mut newest = None;
    while let Some(sample) = hashes.next(LATE)? {
        if let Sample::StateHash(sample) = sample {
            newest = Some(sample.hash);
        }
    }
    Ok(newest)
}

/// A policy whose computing time does not count as a stall of the server.
struct Timed<'a> {
    policy: &'a dyn Policy,
    heartbeat: &'a Heartbeat,
}

impl Timed<'_> {
    fn timed<T>(&self, request: impl FnOnce(&dyn Policy) -> T) -> T {
        self.heartbeat.set_policy_turn(true);
        let reply = request(self.policy);
        self.heartbeat.set_policy_turn(false);
        reply
    }
}

impl Policy for Timed<'_> {
    fn spec(&self) -> &v1::PolicySpec {
        self.policy.spec()
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        self.timed(|policy| policy.reset(request))
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        self.timed(|policy| policy.infer(observation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns errors, and checks the clock while it computes.
    struct Slow<'a>(v1::PolicySpec, &'a Heartbeat);

    impl Slow<'_> {
        fn compute(&self) {
            std::thread::sleep(Duration::from_millis(2));
            self.1.update();
            self.1.status(&v1::Status::default(), Instant::now());
            assert_eq!(self.1.stalled_for(), Duration::ZERO);
        }
    }

    impl Policy for Slow<'_> {
        fn spec(&self) -> &v1::PolicySpec {
            &self.0
        }

        fn reset(&self, _: v1::PolicyResetRequest) -> Result<(), PolicyError> {
            self.compute();
            Err(PolicyError::Rejected("no".to_owned()))
        }

        fn infer(&self, _: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
            self.compute();
            Ok(v1::PolicyChunk::default())
        }
    }

    #[test]
    fn stall_clock_pauses_during_inference_and_continues_after_an_error() {
        let heartbeat = Heartbeat::new(Duration::from_secs(60));
        let policy = Slow(v1::PolicySpec::default(), &heartbeat);
        let timed = Timed {
            policy: &policy,
            heartbeat: &heartbeat,
        };
        assert!(timed.infer(v1::PolicyObservation::default()).is_ok());
        assert!(timed.reset(v1::PolicyResetRequest::default()).is_err());
        std::thread::sleep(Duration::from_millis(2));
        heartbeat.update();
        heartbeat.status(&v1::Status::default(), Instant::now());
        assert!(heartbeat.stalled_for() > Duration::ZERO);
    }
}
