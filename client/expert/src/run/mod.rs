//! The operator at work over the network: streams in, commands out.

mod trial;

use std::time::Duration;

use nalgebra::Isometry3;
use wheelarm_proto::check::Invalid;
use wheelarm_proto::geometry;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::settings::{Named, Style};
use wheelarm_proto::v1;

use crate::base_placement::ArmReachability;
use crate::demonstration::Demonstrations;
use crate::forced::ForcedError;
use crate::goal::Goal;
use crate::observation::{self, Collector};
use crate::operator::{Operator, Outcome, Trouble};
use crate::profile::OperatorProfile;
use crate::scene::SceneModel;
use wheelarm_sdk::{Client, ClientError, Turn, Turns};

/// Options of [`run`].
#[derive(Clone, Debug)]
pub struct OperateOptions {
    /// Task; the one in force when absent, else the scenario is reset to it.
    pub task: Option<String>,
    /// Label of the episode; task and seed when absent.
    pub label: Option<String>,
    /// Instruction sentence; the scenario's when empty.
    pub instruction: String,
    /// Recorders that must be ready before simulation time starts.
    pub require_recorders: u32,
    /// Name under which the operator commands.
    pub commander: String,
    /// Takes control over from another commander.
    pub take: bool,
    /// Seed of the operator profile; the scenario's when absent.
    pub profile_seed: Option<u64>,
    /// An error that the operator makes on purpose and corrects.
    pub forced: Option<ForcedError>,
    /// Goes on from where the hand is ([`Operator::on_the_spot`]).
    pub on_the_spot: bool,
    /// Demonstrations for the grasp ([`Operator::shown`]); empty for the operator's own
    /// plan.
    pub shown: Demonstrations,
    /// Tests the object after the task, which fails when it slips while it is shaken, or when it
    /// was put down and does not rest (`shake`).
    pub shakes: bool,
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
            forced: None,
            on_the_spot: false,
            shown: Demonstrations::default(),
            shakes: false,
        }
    }
}

/// Why a driver (the expert or a policy) could not finish an episode.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The connection.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A message violates the contract.
    #[error("a message of the server is wrong: {0}")]
    Message(#[from] Invalid),
    /// The scene, or an observation of it, cannot be used.
    #[error("{0}")]
    Scene(String),
    /// Another client ended the episode.
    #[error("another client ended the episode")]
    Ended,
    /// The task was done or lost before.
    #[error("the task is over already: set it up anew with `wheelarm reset`")]
    Over,
    /// Nothing came for a long time.
    #[error("the server sent nothing for {0:.0} s; it waits for: {1}")]
    Silent(f64, String),
}

/// Progress of the operator.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<'a> {
    /// Simulated seconds since the episode began.
    pub time: f64,
    /// Fine name of the phase.
    pub phase: &'a str,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// Notes for people.
    pub notes: &'a [String],
}

/// Result of [`run`].
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The operator's own word.
    pub outcome: Outcome,
    /// The episode.
    pub started: v1::EpisodeStarted,
    /// End of the episode; `None` when another client started it and it goes on.
    pub stopped: Option<v1::EpisodeStopped>,
    /// Last evaluation of the task.
    pub evaluation: v1::Evaluation,
    /// Control ticks answered.
    pub ticks: u64,
    /// The episode whose demonstration was adapted, if one was.
    pub source: Option<String>,
}

impl Report {
    /// The operator is content and the task agrees.
    #[must_use]
    pub fn succeeded(&self) -> bool {
        self.outcome.is_success(&self.evaluation)
    }

    /// Why the task was not done, for people; absent when it was.
    #[must_use]
    pub fn why(&self) -> Option<String> {
        self.outcome.why(&self.evaluation)
    }
}

/// Silence after which the operator requests the status of the server.
const PATIENCE: Duration = Duration::from_secs(1);
/// Silence after which it gives up, in units of [`PATIENCE`].
const GIVE_UP: u32 = 60;

fn broke(words: &str) -> Outcome {
    Outcome::Broken(format!("the physics broke: {words}"))
}

/// An episode that a driver started. It ends when this is dropped: in lock-step, time would
/// wait for the driver for good.
pub struct OwnEpisode<'a> {
    client: &'a Client,
    started: v1::EpisodeStarted,
    is_open: bool,
}

impl<'a> OwnEpisode<'a> {
    /// The episode `started`, where it is `ours`; otherwise nothing is ended.
    #[must_use]
    pub fn new(client: &'a Client, started: &v1::EpisodeStarted, is_ours: bool) -> Self {
        Self {
            client,
            started: started.clone(),
            is_open: is_ours,
        }
    }

    /// Whether it still runs and is to be ended here.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Leaves it as it is: it has ended, or another driver continues it.
    pub fn leave(&mut self) {
        self.is_open = false;
    }

    /// Ends it, unless it was left.
    ///
    /// # Errors
    /// As [`Client::stop_episode_of`].
    pub fn end(&mut self) -> Result<Option<v1::EpisodeStopped>, ClientError> {
        match std::mem::take(&mut self.is_open) {
            true => self.client.stop_episode_of(&self.started, false).map(Some),
            false => Ok(None),
        }
    }
}

impl Drop for OwnEpisode<'_> {
    fn drop(&mut self) {
        if let Err(problem) = self.end() {
            tracing::warn!("the episode could not be ended: {problem}");
        }
    }
}

/// Does the task: joins the running episode, or starts one and stops it.
///
/// # Errors
/// [`DriverError`]; a task that was tried and failed is a [`Report`].
pub fn run(
    client: &Client,
    options: &OperateOptions,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<Report, DriverError> {
    let turns = client.turns(&options.commander, options.take, &observation::STREAMS)?;
    let (scenario, running) = set_up(client, options.task.as_deref())?;
    let reply = client.request(&v1::SceneRequest {})?;
    let scene = SceneModel::read(&reply)?;
    let goal = Goal::read(&reply, &scene)?;
    let puts = matches!(goal, Some(Goal::Put { .. }));
    let roles = Roles::find(&reply.robot.unwrap_or_default())?;
    let style = Style::from_name(scenario.style()).unwrap_or_default();
    let seed = options.profile_seed.unwrap_or(scenario.seed());
    let profile = OperatorProfile::new(seed).in_style(style, seed);
    let operator = Operator::new(scene, goal, profile);
    let mut operator = operator
        .map_err(DriverError::Scene)?
        .shown(options.shown.clone());
    if options.on_the_spot {
        operator = operator.on_the_spot();
    }
    if scenario.look_around() {
        operator = operator.looking_around();
    }
    let operator = operator.troubled(Trouble {
        hindered: scenario
            .disturbances
            .is_some_and(|d| d.noise + d.pushes + d.slips > 0),
        forced: options.forced,
        time_limit: scenario.time_limit_seconds,
    });
    let (started, is_ours) = match running {
        Some(running) => (running, false),
        None => (start(client, options, &scenario)?, true),
    };
    let mut work = Work {
        own: OwnEpisode::new(client, &started, is_ours),
        turns,
        operator,
        collector: Collector::new(roles),
        reach: RemoteReach::new(client),
        first: started.header.clone().unwrap_or_default(),
        started,
        pressed: 0.0,
        stopped: None,
    };
    let mut outcome = work.until_over(progress)?;
    if options.shakes && outcome == Outcome::Success {
        outcome = match puts {
            true => work.rest(progress)?,
            false => work.shake(progress)?,
        };
    }
    work.finish(outcome, is_ours)
}

/// Resets the scenario to `task` if that is not in force; returns what is in
/// force, and the episode that runs, if one does.
fn set_up(
    client: &Client,
    task: Option<&str>,
) -> Result<(v1::Scenario, Option<v1::EpisodeStarted>), DriverError> {
    let status: v1::Status = client.request(&v1::StatusRequest {})?;
    let scenario = status.scenario.unwrap_or_default();
    if let (Some(task), None) = (task, &status.episode)
        && task != scenario.task()
    {
        let wanted = v1::Scenario {
            task: Some(task.to_owned()),
            ..v1::Scenario::default()
        };
        return Ok((client.reset(wanted, false)?, None));
    }
    if status.episode.is_none() && status.evaluation.is_some_and(|e| e.done) {
        return Err(DriverError::Over);
    }
    Ok((scenario, status.episode))
}

/// The operator in its episode.
struct Work<'a> {
    /// Ended before control is given back with the turns.
    own: OwnEpisode<'a>,
    turns: Turns,
    operator: Operator,
    collector: Collector,
    reach: RemoteReach<'a>,
    started: v1::EpisodeStarted,
    /// Header of the beginning.
    first: v1::Header,
    /// Simulated time at which a pad last pressed, seconds.
    pressed: f64,
    stopped: Option<v1::EpisodeStopped>,
}

impl Work<'_> {
    /// Answers every tick of the episode until the operator or the episode is
    /// at its end.
    fn until_over(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Outcome, DriverError> {
        let mut silent = 0;
        loop {
            let collector = &mut self.collector;
            let turn = self.turns.next(PATIENCE, &mut |s| collector.take(s))?;
            let outcome = match turn {
                Turn::Answer(clock) => {
                    let episode = clock.header.as_ref().map_or(0, |header| header.episode);
                    if episode != self.first.episode {
                        continue;
                    }
                    silent = 0;
                    self.answer(&clock, progress)?
                }
                Turn::Refused(refusal) => {
                    tracing::warn!("command {} refused: {}", refusal.sequence, refusal.reason);
                    None
                }
                Turn::Ended(end) => self.ended(end)?,
                Turn::Silent(status) => {
                    silent += 1;
                    self.silent(silent, &status)?
                }
            };
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
        }
    }

    /// Decides and answers one tick.
    fn answer(
        &mut self,
        clock: &v1::Clock,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Option<Outcome>, DriverError> {
        let stamp = clock.header.as_ref().map_or(0, |h| h.stamp_nanos);
        let Some(observation) = self.collector.observe(stamp)? else {
            self.turns.answer(v1::Command::default())?;
            return Ok(None);
        };
        if observation.pad_force.iter().any(|force| *force > 0.0) {
            self.pressed = observation.time;
        }
        let (act, outcome) = self.operator.step(&observation, &mut self.reach);
        if let Some(error) = self.reach.take_error() {
            return Err(error.into());
        }
        tracing::debug!(
            "{:.3} s {}: chair {:?} at {:?}, knuckle {:.3} rad, pads {:.1?} N, \
             object in hand {:?}, base {:?}, {}",
            observation.time,
            act.name,
            observation.chair(),
            observation.chair_speed,
            observation.knuckle,
            observation.pad_force,
            self.operator.object_in_hand(&observation),
            act.base,
            observation.arm_problem,
        );
        let incident = self.operator.incident();
        self.turns.answer(v1::Command {
            incident: incident.into(),
            ..self.operator.command(&act)
        })?;
        let notes = self.operator.notes();
        progress(&Progress {
            time: stamp.saturating_sub(self.first.stamp_nanos) as f64 * 1e-9,
            phase: act.name,
            factor: clock.real_time_factor,
            notes: &notes,
        });
        Ok(outcome)
    }

    /// An episode has ended under the operator's hands: its own, or another.
    fn ended(&mut self, end: v1::EpisodeStopped) -> Result<Option<Outcome>, DriverError> {
        if !self.is_end(&end) {
            return Ok(None);
        }
        self.own.leave();
        if end.cause() != v1::EndCause::Physics {
            return Err(DriverError::Ended);
        }
        let outcome = broke(end.anomalies.last().map_or("", String::as_str));
        self.stopped = Some(end);
        Ok(Some(outcome))
    }

    /// Nothing came for `silent` times the patience.
    fn silent(&mut self, silent: u32, status: &v1::Status) -> Result<Option<Outcome>, DriverError> {
        if status.episode.is_none() {
            self.own.leave();
            return match status.broken.as_str() {
                "" => Err(DriverError::Ended),
                words => Ok(Some(broke(words))),
            };
        }
        if silent > GIVE_UP && !status.paused {
            let seconds = PATIENCE.as_secs_f64() * f64::from(silent);
            return Err(DriverError::Silent(seconds, status.waiting_for.clone()));
        }
        Ok(None)
    }

    /// Ends the episode if it is the operator's own, and reports.
    fn finish(mut self, outcome: Outcome, is_ours: bool) -> Result<Report, DriverError> {
        // Let the last command take effect before the end is requested: otherwise
        // chance decides whether its tick still belongs to the episode.
        while self.stopped.is_none() && (self.own.is_open() || !is_ours) {
            let collector = &mut self.collector;
            match self.turns.next(PATIENCE, &mut |s| collector.take(s))? {
                Turn::Answer(_) | Turn::Silent(_) => break,
                Turn::Ended(end) if self.is_end(&end) => {
                    self.own.leave();
                    self.stopped = Some(end);
                }
                Turn::Ended(_) | Turn::Refused(_) => {}
            }
        }
        if let Some(stopped) = self.own.end()? {
            self.stopped = Some(stopped);
        }
        let evaluation = self.stopped.as_ref().and_then(|s| s.evaluation.clone());
        let mut evaluation = evaluation.unwrap_or_else(|| self.collector.evaluation());
        // The state broke in the very last tick.
        let outcome = match &self.stopped {
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
            ticks: self.turns.commander().sent(),
            source: self.operator.source().map(str::to_owned),
            started: self.started,
            stopped: self.stopped,
            evaluation,
        })
    }

    fn is_end(&self, stopped: &v1::EpisodeStopped) -> bool {
        stopped.header.as_ref().map_or(0, |h| h.episode) == self.first.episode
    }
}

fn start(
    client: &Client,
    options: &OperateOptions,
    scenario: &v1::Scenario,
) -> Result<v1::EpisodeStarted, ClientError> {
    let mut request = v1::EpisodeStartRequest {
        instruction: (!options.instruction.is_empty()).then(|| options.instruction.clone()),
        require_recorders: options.require_recorders,
        commander: options.commander.clone(),
        ..Default::default()
    };
    match &options.label {
        Some(label) => {
            request.label.clone_from(label);
            client.request(&request)
        }
        None => {
            request.label = format!("{}-seed{}", scenario.task(), scenario.seed());
            client.start_episode_numbered(request)
        }
    }
}

/// Asks the server's kinematics.
pub struct RemoteReach<'a> {
    client: &'a Client,
    error: Option<ClientError>,
}

impl<'a> RemoteReach<'a> {
    /// Of the server at the other end of `client`.
    #[must_use]
    pub fn new(client: &'a Client) -> Self {
        Self {
            client,
            error: None,
        }
    }

    /// Why a question was not answered, since the last call.
    pub fn take_error(&mut self) -> Option<ClientError> {
        self.error.take()
    }
}

impl ArmReachability for RemoteReach<'_> {
    fn follows(&mut self, poses: &[Isometry3<f64>], max_joint_change: f64) -> bool {
        let mut poses = poses.iter().map(geometry::pose);
        let request = v1::ReachRequest {
            pose: poses.next(),
            near_joints: Vec::new(),
            next_poses: poses.collect(),
            max_joint_change: Some(max_joint_change),
        };
        match self.client.request(&request) {
            Ok(reply) => reply.reachable,
            Err(error) => {
                self.error.get_or_insert(error);
                false
            }
        }
    }
}
