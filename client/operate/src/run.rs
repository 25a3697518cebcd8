//! The operator at work over the network: streams in, commands out.

use std::time::Duration;

use nalgebra::Isometry3;
use wheelarm_proto::check::Invalid;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use super::base_placement::ArmReachability;
use super::observation::{self, Collector};
use super::operator::{Operator, Outcome};
use super::profile::OperatorProfile;
use super::scene::{SceneModel, write_pose};
use wheelarm_link::{Link, LinkError};

/// What the operator is asked to do.
#[derive(Clone, Debug)]
pub struct OperateOptions {
    /// Task; the one in force when absent, else the scenario is reset to it.
    pub task: Option<String>,
    /// Label of the episode; task and seed when absent.
    pub label: Option<String>,
    /// Instruction sentence; the scenario's when empty.
    pub instruction: String,
    /// Recorders that must be ready before time goes on.
    pub require_recorders: u32,
    /// Name under which the operator commands.
    pub commander: String,
    /// Takes control over from whoever holds it.
    pub take: bool,
    /// Seed of the operator profile; the scenario's when absent.
    pub profile_seed: Option<u64>,
}

impl Default for OperateOptions {
    fn default() -> Self {
        Self {
            task: None,
            label: None,
            instruction: String::new(),
            require_recorders: 0,
            commander: "operator".to_owned(),
            take: false,
            profile_seed: None,
        }
    }
}

/// Why the operator could not work.
#[derive(Debug, thiserror::Error)]
pub enum OperateError {
    /// The connection.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A message is not as the contract says.
    #[error("a message of the server is wrong: {0}")]
    Message(#[from] Invalid),
    /// The scene cannot be worked with.
    #[error("{0}")]
    Scene(String),
    /// The episode ended under the operator's hands.
    #[error("the episode was ended by somebody else")]
    Ended,
    /// The task was done or lost before.
    #[error("the task is over already: set it up anew with `wheelarm reset`")]
    Over,
    /// Nothing came for a long time.
    #[error("the server sent nothing for {0:.0} s; it waits for: {1}")]
    Silent(f64, String),
}

/// How it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<'a> {
    /// Simulated seconds since the episode began.
    pub time: f64,
    /// Fine name of the phase.
    pub phase: &'a str,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// What happened, in words.
    pub notes: &'a [String],
}

/// How it went.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The operator's own word.
    pub outcome: Outcome,
    /// The episode.
    pub started: v1::EpisodeStarted,
    /// Its end; absent when the episode was somebody else's and goes on.
    pub stopped: Option<v1::EpisodeStopped>,
    /// Last evaluation of the task.
    pub evaluation: v1::Evaluation,
    /// Control ticks answered.
    pub ticks: u64,
}

impl Report {
    /// The operator is content and the task agrees.
    #[must_use]
    pub fn succeeded(&self) -> bool {
        self.outcome == Outcome::Success && self.evaluation.success
    }
}

/// Silence after which the operator asks what the server waits for.
const PATIENCE: Duration = Duration::from_secs(1);
/// Silence after which it gives up, in units of [`PATIENCE`].
const GIVE_UP: u32 = 60;

fn broke(words: &str) -> Outcome {
    Outcome::Broken(format!("the physics broke: {words}"))
}

fn is_end_of(stopped: &v1::EpisodeStopped, episode: u64) -> bool {
    stopped.header.as_ref().map_or(0, |h| h.episode) == episode
}

/// Ends the operator's own episode when the operator cannot go on: in
/// lock-step, time would wait for it for good.
struct OwnEpisode<'a> {
    link: &'a Link,
    open: bool,
}

impl Drop for OwnEpisode<'_> {
    fn drop(&mut self) {
        if self.open
            && let Err(e) = self.link.stop_episode(false)
        {
            tracing::warn!("the episode could not be ended: {e}");
        }
    }
}

/// Does the task: joins the running episode, or starts one and stops it.
///
/// # Errors
/// [`OperateError`]; a task that was tried and failed is a [`Report`].
pub fn run(
    link: &Link,
    options: &OperateOptions,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<Report, OperateError> {
    let mut wanted = observation::STREAMS.to_vec();
    wanted.extend([TopicId::Clock, TopicId::Refusal, TopicId::EpisodeStop]);
    let streams = link.streams(&wanted)?;
    let status: v1::Status = link.ask(&v1::StatusRequest {})?;
    let mut scenario = status.scenario.clone().unwrap_or_default();
    if let (Some(task), None) = (&options.task, &status.episode)
        && *task != scenario.task()
    {
        let wanted = v1::Scenario {
            task: Some(task.clone()),
            ..v1::Scenario::default()
        };
        scenario = link.reset(wanted, false)?;
    } else if status.episode.is_none() && status.evaluation.as_ref().is_some_and(|e| e.done) {
        return Err(OperateError::Over);
    }
    let scene = link.ask(&v1::SceneRequest {})?;
    let model = SceneModel::read(&scene)?;
    let roles = Roles::find(&scene.robot.unwrap_or_default())?;
    let profile = OperatorProfile::new(options.profile_seed.unwrap_or(scenario.seed()));
    let mut operator = Operator::new(model, profile).map_err(OperateError::Scene)?;
    let mut commander = link.commander(&options.commander, options.take)?;
    let (started, is_ours) = match status.episode {
        Some(running) => (running, false),
        None => (start(link, options, &scenario)?, true),
    };
    let first = started.header.clone().unwrap_or_default();
    let mut own = OwnEpisode {
        link,
        open: is_ours,
    };

    let mut collector = Collector::new(roles);
    let mut reach = RemoteReach { link, error: None };
    let mut answered: Option<u64> = None;
    let mut silent = 0;
    let mut evaluation = v1::Evaluation::default();
    let mut stopped: Option<v1::EpisodeStopped> = None;
    let outcome = loop {
        let clock = match streams.next(PATIENCE)? {
            Some(Sample::Clock(clock)) => clock,
            Some(Sample::EpisodeStop(end)) => {
                if !is_end_of(&end, first.episode) {
                    continue;
                }
                own.open = false;
                if end.cause() != v1::EndCause::Physics {
                    return Err(OperateError::Ended);
                }
                let words = end.anomalies.last().cloned().unwrap_or_default();
                stopped = Some(end);
                break broke(&words);
            }
            Some(Sample::Refusal(refusal)) => {
                if refusal.commander == options.commander {
                    tracing::warn!("command {} refused: {}", refusal.sequence, refusal.reason);
                }
                continue;
            }
            Some(sample) => {
                if let Sample::Evaluation(sample) = &sample {
                    evaluation.clone_from(sample);
                }
                collector.take(sample);
                continue;
            }
            None => {
                silent += 1;
                let status: v1::Status = link.ask(&v1::StatusRequest {})?;
                if status.episode.is_none() {
                    own.open = false;
                    if status.broken.is_empty() {
                        return Err(OperateError::Ended);
                    }
                    break broke(&status.broken);
                }
                if silent > GIVE_UP && !status.paused {
                    let seconds = PATIENCE.as_secs_f64() * f64::from(silent);
                    return Err(OperateError::Silent(seconds, status.waiting_for));
                }
                // A lost clock must not stop the world: the state that is
                // there is answered.
                let header = status.header.unwrap_or_default();
                if answered == Some(header.tick) || status.paused {
                    continue;
                }
                v1::Clock {
                    header: Some(header),
                    real_time_factor: status.real_time_factor,
                }
            }
        };
        let header = clock.header.unwrap_or_default();
        let is_new = answered.is_none_or(|last| header.tick > last);
        if header.episode != first.episode || !is_new {
            continue;
        }
        silent = 0;
        let Some(seen) = collector.observe(header.stamp_nanos)? else {
            commander.answer(&header, v1::Command::default())?;
            answered = Some(header.tick);
            continue;
        };
        let (act, outcome) = operator.step(&seen, &mut reach);
        if let Some(error) = reach.error.take() {
            return Err(error.into());
        }
        tracing::debug!(
            "{:.3} s {}: chair {:?} at {:?}, knuckle {:.3} rad, pads {:.1?} N, \
             object in hand {:?}, base {:?}, {}",
            seen.time,
            act.name,
            seen.chair(),
            seen.chair_speed,
            seen.knuckle,
            seen.pad_force,
            operator.thing_in_hand(&seen),
            act.base,
            seen.arm_problem,
        );
        commander.answer(&header, operator.command(&act))?;
        answered = Some(header.tick);
        let notes = operator.notes();
        progress(&Progress {
            time: header.stamp_nanos.saturating_sub(first.stamp_nanos) as f64 * 1e-9,
            phase: act.name,
            factor: clock.real_time_factor,
            notes: &notes,
        });
        if let Some(outcome) = outcome {
            break outcome;
        }
    };
    // The last command takes effect before the end is asked for: otherwise it
    // would be chance whether its tick still belongs to the episode.
    while stopped.is_none() && (own.open || !is_ours) {
        let Some(sample) = streams.next(PATIENCE)? else {
            break;
        };
        match sample {
            Sample::Clock(clock) => {
                let tick = clock.header.as_ref().map(|header| header.tick);
                if tick > answered {
                    break;
                }
            }
            Sample::EpisodeStop(end) if is_end_of(&end, first.episode) => {
                own.open = false;
                stopped = Some(end);
                break;
            }
            Sample::Evaluation(sample) => evaluation = sample,
            _ => {}
        }
    }
    if std::mem::take(&mut own.open) {
        stopped = Some(link.stop_episode(false)?);
    }
    if let Some(last) = stopped.as_ref().and_then(|s| s.evaluation.clone()) {
        evaluation = last;
    }
    // The state broke in the very last tick.
    let outcome = match &stopped {
        Some(end) if end.cause() == v1::EndCause::Physics => {
            broke(end.anomalies.last().map_or("", String::as_str))
        }
        _ => outcome,
    };
    if matches!(outcome, Outcome::Broken(_)) {
        evaluation.success = false;
    }
    Ok(Report {
        outcome,
        started,
        stopped,
        evaluation,
        ticks: commander.sent(),
    })
}

fn start(
    link: &Link,
    options: &OperateOptions,
    scenario: &v1::Scenario,
) -> Result<v1::EpisodeStarted, LinkError> {
    link.ask(&v1::EpisodeStartRequest {
        label: options
            .label
            .clone()
            .unwrap_or_else(|| format!("{}-seed{}", scenario.task(), scenario.seed())),
        instruction: (!options.instruction.is_empty()).then(|| options.instruction.clone()),
        require_recorders: options.require_recorders,
        commander: options.commander.clone(),
        ..Default::default()
    })
}

/// Asks the server's kinematics.
struct RemoteReach<'a> {
    link: &'a Link,
    error: Option<LinkError>,
}

impl ArmReachability for RemoteReach<'_> {
    fn reach(
        &mut self,
        base_from_tool: &Isometry3<f64>,
        near: Option<&[f64; 6]>,
    ) -> Option<[f64; 6]> {
        let request = v1::ReachRequest {
            pose: Some(write_pose(base_from_tool)),
            near_joints: near.map(|joints| joints.to_vec()).unwrap_or_default(),
        };
        match self.link.ask(&request) {
            Ok(reply) if reply.reachable => reply.joints.as_slice().try_into().ok(),
            Ok(_) => None,
            Err(error) => {
                self.error.get_or_insert(error);
                None
            }
        }
    }
}
