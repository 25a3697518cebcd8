//! One episode of a policy: the policy receives observations at the times of images, and
//! its rows are executed in lock-step until the task is over.

use std::time::{Duration, Instant};

use wheelarm_expert::operator::Outcome;
use wheelarm_expert::run::{DriverError, OwnEpisode, Report};
use wheelarm_policy::{ChunkExecutor, ExecutorOptions, Player};
use wheelarm_proto::robot::Roles;
use wheelarm_proto::{TICKS_PER_CONTROL, v1};
use wheelarm_sdk::{Client, Turn, Turns};

use super::interface::{Policy, PolicyError, checked};
use super::observation::{Collector, STREAMS};
use crate::finished::Finished;

/// Silence after which the status of the server is requested.
const SILENCE: Duration = Duration::from_secs(1);
/// Periods of silence after which the episode is aborted.
const GIVE_UP: u32 = 60;
/// Longest wait for an image.
const IMAGE_PATIENCE: Duration = Duration::from_secs(60);

/// Settings of an episode.
#[derive(Clone, Debug)]
pub struct PolicyOptions {
    /// Label of the episode.
    pub label: String,
    /// Instruction sentence; the scenario's when empty.
    pub instruction: String,
    /// Recorders that must be ready before time runs.
    pub require_recorders: u32,
    /// Commander name of the policy.
    pub commander: String,
    /// Executed rows of a chunk; the policy's own number when absent.
    pub execute: Option<u32>,
    /// Rows between a request and the use of its chunk.
    pub latency: u32,
    /// Temporal ensemble: see [`ExecutorOptions::ensemble`].
    pub ensemble: Option<f64>,
    /// Simulated seconds after which the policy releases control; another driver continues
    /// the episode.
    pub until_seconds: Option<f64>,
    /// Device label of the commands.
    pub device: v1::Device,
}

impl Default for PolicyOptions {
    fn default() -> Self {
        Self {
            label: String::new(),
            instruction: String::new(),
            require_recorders: 0,
            commander: "policy".to_owned(),
            execute: None,
            latency: 0,
            ensemble: None,
            until_seconds: None,
            device: v1::Device::Policy,
        }
    }
}

/// Runs the task in force, which must wait for an episode in lock-step.
/// `progress` receives the simulated seconds at every row.
///
/// # Errors
/// [`DriverError`] when server or scenario are at fault; an error of the policy ends the
/// episode and is part of [`Finished`].
pub fn run(
    client: &Client,
    policy: &dyn Policy,
    options: &PolicyOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<Finished, DriverError> {
    let spec = policy.spec();
    let scene = client.request(&v1::SceneRequest {})?;
    let status = client.request(&v1::StatusRequest {})?;
    let scenario = status.scenario.unwrap_or_default();
    let cap = force_cap(&scene);
    let robot = scene.robot.unwrap_or_default();
    let fits = fitting(spec, &robot);
    let (kind, over_ticks) = match fits {
        Ok(fits) => fits,
        Err(problem) => return Err(DriverError::Scene(problem.to_string())),
    };
    let mut player = Player::new(kind, &robot, spec.rate_hz);
    player.device = options.device;
    player.max_force = cap;
    let turns = client.turns(&options.commander, false, &STREAMS)?;
    let collector = Collector::open(client, spec, Roles::find(&robot)?)?;
    let started = client.request(&v1::EpisodeStartRequest {
        label: options.label.clone(),
        instruction: (!options.instruction.is_empty()).then(|| options.instruction.clone()),
        require_recorders: options.require_recorders,
        commander: options.commander.clone(),
        ..Default::default()
    })?;
    let instruction = match started.instruction.is_empty() {
        true => scenario.instruction().to_owned(),
        false => started.instruction.clone(),
    };
    let first = started.header.clone().unwrap_or_default();
    let mut work = Work {
        client,
        own: OwnEpisode::new(client, &started, true),
        policy,
        turns,
        collector,
        executor: ChunkExecutor::new(
            player,
            ExecutorOptions {
                execute: options.execute.unwrap_or(spec.execute) as usize,
                latency: options.latency as usize,
                ensemble: options.ensemble,
            },
        )
        .at_most(spec.chunk as usize),
        over_ticks,
        key: format!("{}-{}", first.run_id, first.episode),
        seed: scenario.seed(),
        instruction,
        first,
        until: options.until_seconds,
        started,
        stopped: None,
        error: None,
        broken: None,
        rows: 0,
        answer_seconds: Vec::new(),
    };
    let over = work.execute(progress)?;
    work.finish(over)
}

/// Kind of the rows and control ticks of one, where the policy fits the robot.
fn fitting(
    spec: &v1::PolicySpec,
    robot: &v1::RobotDescription,
) -> Result<(wheelarm_policy::ActionKind, u32), PolicyError> {
    let (kind, ticks) = checked(spec)?;
    let names = [
        (
            "state",
            &spec.state_names,
            wheelarm_policy::state_names(robot),
        ),
        ("action", &spec.action_names, kind.names(robot)),
    ];
    for (what, theirs, ours) in names {
        if !theirs.is_empty() && *theirs != ours {
            let differs = theirs.iter().zip(&ours).position(|(a, b)| a != b);
            let at = differs.unwrap_or(theirs.len().min(ours.len()));
            let name = |list: &[String]| list.get(at).cloned().unwrap_or_default();
            return Err(PolicyError::Unfit(format!(
                "its {what} has {} numbers and at place {at} {:?}; that of this robot {} and {:?}",
                theirs.len(),
                name(theirs),
                ours.len(),
                name(&ours)
            )));
        }
    }
    Ok((kind, ticks))
}

/// Limit of the pads' force for a deformable object, N.
fn force_cap(scene: &v1::SceneReply) -> Option<f64> {
    let own = scene
        .grasps
        .iter()
        .filter(|grasp| grasp.object == scene.target);
    own.filter_map(|grasp| grasp.force).reduce(f64::min)
}

/// End of the loop.
enum Over {
    /// The task is over, or the policy broke: the episode is to be ended.
    Done,
    /// Another driver continues.
    Given,
    /// It was ended by the server.
    Stopped,
}

struct Work<'a> {
    client: &'a Client,
    /// Ended before control is given back with the turns.
    own: OwnEpisode<'a>,
    policy: &'a dyn Policy,
    turns: Turns,
    collector: Collector,
    executor: ChunkExecutor,
    over_ticks: u32,
    key: String,
    seed: u64,
    instruction: String,
    first: v1::Header,
    until: Option<f64>,
    started: v1::EpisodeStarted,
    stopped: Option<v1::EpisodeStopped>,
    /// The error of the policy, which ends the episode.
    error: Option<PolicyError>,
    /// Description of a divergence of the simulation.
    broken: Option<String>,
    /// Rows that were executed.
    rows: u64,
    /// Wall time of each answer of the policy, s.
    answer_seconds: Vec<f64>,
}

impl Work<'_> {
    fn execute(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Over, DriverError> {
        let mut silent = 0;
        let reset = v1::PolicyResetRequest {
            episode_key: self.key.clone(),
            seed: self.seed,
            instruction: self.instruction.clone(),
        };
        if let Err(problem) = self.policy.reset(reset) {
            self.error = Some(problem);
            return Ok(Over::Done);
        }
        loop {
            let collector = &mut self.collector;
            match self.turns.next(SILENCE, &mut |s| collector.take(s))? {
                Turn::Answer(clock) => {
                    let header = clock.header.unwrap_or_default();
                    if header.episode != self.first.episode {
                        continue;
                    }
                    silent = 0;
                    let since = header.stamp_nanos.saturating_sub(self.first.stamp_nanos);
                    let since = since as f64 * 1e-9;
                    progress(since);
                    if self.collector.evaluation.done {
                        return Ok(Over::Done);
                    }
                    if self.until.is_some_and(|until| since >= until) {
                        return Ok(Over::Given);
                    }
                    if !self.answer(&header)? {
                        return Ok(Over::Done);
                    }
                }
                Turn::Refused(refusal) => {
                    self.error = Some(PolicyError::Refused(refusal.reason));
                    return Ok(Over::Done);
                }
                Turn::Ended(end) if self.is_end(&end) => {
                    self.own.leave();
                    if end.cause() != v1::EndCause::Physics {
                        return Err(DriverError::Ended);
                    }
                    self.stopped = Some(end);
                    return Ok(Over::Stopped);
                }
                Turn::Ended(_) => {}
                Turn::Silent(status) => {
                    silent += 1;
                    if status.episode.is_none() {
                        self.own.leave();
                        if status.broken.is_empty() {
                            return Err(DriverError::Ended);
                        }
                        self.broken = Some(status.broken);
                        return Ok(Over::Stopped);
                    }
                    if silent > GIVE_UP && !status.paused {
                        let seconds = SILENCE.as_secs_f64() * f64::from(silent);
                        return Err(DriverError::Silent(seconds, status.waiting_for));
                    }
                }
            }
        }
    }

    /// Replies to one turn. Returns whether the policy succeeded.
    fn answer(&mut self, now: &v1::Header) -> Result<bool, DriverError> {
        let image_ticks = u64::from(self.over_ticks) * TICKS_PER_CONTROL;
        let beyond = now.tick % image_ticks;
        if beyond != 0 {
            // Until the first image.
            let rest = (image_ticks - beyond) / TICKS_PER_CONTROL;
            self.turns.answer(v1::Command {
                over_ticks: rest as u32,
                ..Default::default()
            })?;
            return Ok(true);
        }
        let over_ticks = self.over_ticks;
        let hold = || v1::Command {
            over_ticks,
            ..Default::default()
        };
        let Some(is_first) = self.collector.observe(self.client, now, IMAGE_PATIENCE)? else {
            // A sensor has not sent its first image.
            self.turns.answer(hold())?;
            return Ok(true);
        };
        let command = match self.request(now, is_first) {
            Ok(command) => command,
            Err(problem) => {
                self.error = Some(problem);
                return Ok(false);
            }
        };
        self.turns.answer(command.unwrap_or_else(hold))?;
        self.rows += 1;
        Ok(true)
    }

    /// The policy's command until the next image.
    fn request(
        &mut self,
        now: &v1::Header,
        first: bool,
    ) -> Result<Option<v1::Command>, PolicyError> {
        if self.executor.needs_chunk() {
            let begun = Instant::now();
            let chunk = self.policy.infer(v1::PolicyObservation {
                episode_key: self.key.clone(),
                seed: self.seed,
                first,
                tick: now.tick,
                instruction: self.instruction.clone(),
                steps: self.collector.moments(),
            })?;
            self.answer_seconds.push(begun.elapsed().as_secs_f64());
            self.executor.add(chunk.rows as usize, &chunk.values)?;
        }
        Ok(self.executor.command()?)
    }

    /// Ends the episode, unless another driver continues it or it has ended.
    fn finish(mut self, over: Over) -> Result<Finished, DriverError> {
        if matches!(over, Over::Given) {
            self.own.leave();
        }
        if let Some(stopped) = self.own.end()? {
            self.stopped = Some(stopped);
        }
        let end = self.stopped.as_ref();
        let evaluation = end.and_then(|stopped| stopped.evaluation.clone());
        let mut evaluation = evaluation.unwrap_or_else(|| self.collector.evaluation.clone());
        if let Some(end) = end.filter(|end| end.cause() == v1::EndCause::Physics) {
            let words = end.anomalies.last().cloned().unwrap_or_default();
            self.broken.get_or_insert(words);
        }
        evaluation.success &= self.broken.is_none() && self.error.is_none();
        let outcome = match (&self.broken, &self.error) {
            (Some(words), _) => Outcome::Broken(format!("the physics broke: {words}")),
            (None, Some(problem)) => Outcome::Failure(problem.to_string()),
            (None, None) if evaluation.success => Outcome::Success,
            (None, None) => Outcome::Failure(format!("the task failed: {}", evaluation.failure)),
        };
        Ok(Finished {
            policy_error: self.error,
            answer_seconds: self.answer_seconds,
            ..Finished::from(Report {
                outcome,
                started: self.started,
                stopped: self.stopped,
                evaluation,
                ticks: self.rows * u64::from(self.over_ticks),
                source: None,
            })
        })
    }

    fn is_end(&self, stopped: &v1::EpisodeStopped) -> bool {
        stopped.header.as_ref().map_or(0, |h| h.episode) == self.first.episode
    }
}
