//! The rows of a recording, played open loop through public commands: what a
//! policy that answers exactly these would do.

use std::path::Path;

use anyhow::{Context, bail};
use wheelarm_dataset::convert::learning::{self, Learning, RowOptions};
use wheelarm_dataset::convert::{ReadOptions, Recording};
use wheelarm_link::{Link, Turn};
use wheelarm_policy::{ActionKind, Player};
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{PHYSICS_HZ, TICKS_PER_CONTROL, TopicId, v1};

use crate::{PATIENCE, Server};

/// Rows for which the last one is held while the task has not been done.
const HELD: usize = 30;

/// The rows of one recording.
#[derive(Debug)]
pub struct Rows {
    /// What was simulated.
    pub scenario: v1::Scenario,
    /// An action per picture, rounded to the 32 bits that an export keeps.
    pub actions: Vec<Vec<f64>>,
    /// What makes commands of them.
    pub player: Player,
    /// Control ticks before the first picture.
    before: u32,
    /// Where the chair is in the frames of `PoseSet`.
    chair: usize,
    /// True pose of the chair at the last picture.
    end: [f64; 7],
}

/// What came of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Played {
    /// The task was done.
    pub success: bool,
    /// How far the chair was from where it had been at the last picture, m.
    pub chair_off: f64,
    /// What the server refused, or why the task failed.
    pub words: String,
}

impl Rows {
    /// Reads a recording; `shift` lets every row have the action of so many
    /// rows before.
    ///
    /// # Errors
    /// When it cannot be read or has no rows.
    pub fn read(file: &Path, kind: ActionKind, shift: usize) -> anyhow::Result<Self> {
        let wanted = |stream: &str| learning::STREAMS.contains(&stream);
        let recording = Recording::open(file, &ReadOptions::default(), &wanted)?;
        let options = RowOptions {
            action: kind,
            trim_idle: None,
        };
        let (rate, all) = Learning::on_grid(&recording, &options)?;
        let last = all.rows.len() - 1;
        let rounded =
            |row: &[f64]| -> Vec<f64> { row.iter().map(|v| f64::from(*v as f32)).collect() };
        let actions = (0..=last).map(|i| rounded(&all.actions[i.saturating_sub(shift)]));
        let mut player = Player::new(kind, &recording.robot, f64::from(rate));
        player.device = v1::Device::Replay;
        // A force cap is no part of a row: the scene tells a policy what to take.
        let applied = recording.episode.applied()?;
        let caps = applied.iter().filter_map(|a| a.gripper?.max_force);
        player.max_force = caps.reduce(f64::min);
        let started = recording.episode.started()?.header.unwrap_or_default();
        let stamp = recording.aligned.stamps[all.rows[0]] as f64 * 1e-9;
        let tick = (stamp * PHYSICS_HZ as f64).round() as u64;
        let before = tick.saturating_sub(started.tick) / TICKS_PER_CONTROL;
        let chair = all.chair(all.rows[last]);
        Ok(Self {
            scenario: recording.episode.scenario()?,
            actions: actions.collect(),
            player,
            before: u32::try_from(before)?,
            chair: Roles::find(&recording.robot)?.chair,
            end: std::array::from_fn(|k| chair[k]),
        })
    }

    /// Starts a server with the scenario, and plays the rows there.
    ///
    /// # Errors
    /// When it does not start or answer.
    pub fn play(&self, sim: &str) -> anyhow::Result<Played> {
        let seed = self.scenario.seed().to_string();
        let server = Server::start(
            sim,
            &[
                "--scene",
                &self.scenario.scene,
                "--robot",
                &self.scenario.robot,
                "--task",
                self.scenario.task(),
                "--seed",
                &seed,
                "--no-cameras",
                "--pacing",
                "lock-step",
            ],
        )?;
        self.play_at(&server.link())
    }

    fn play_at(&self, link: &Link) -> anyhow::Result<Played> {
        let topics = [TopicId::Evaluation, TopicId::Pose];
        let mut turns = link.turns("rows", false, &topics)?;
        let started = link.ask(&v1::EpisodeStartRequest {
            label: "rows".to_owned(),
            ..Default::default()
        })?;
        let episode = started.header.unwrap_or_default().episode;
        let (mut evaluation, mut chair) = (v1::Evaluation::default(), None);
        let (mut sent, mut off, mut waits) = (0, f64::NAN, self.before);
        loop {
            let mut see = |sample| match sample {
                Sample::Evaluation(sample) => evaluation = sample,
                Sample::Pose(sample) => {
                    let frame = sample.frames.get(self.chair);
                    chair = frame.and_then(|frame| frame.pose?.position);
                }
                _ => {}
            };
            let clock = match turns.next(PATIENCE, &mut see)? {
                Turn::Answer(clock) => clock.header.unwrap_or_default(),
                Turn::Refused(refusal) => bail!("refused: {}", refusal.reason),
                Turn::Ended(_) => bail!("somebody else ended the episode"),
                Turn::Silent(status) => bail!("silence: {}", status.waiting_for),
            };
            if clock.episode != episode {
                continue;
            }
            if sent + 1 == self.actions.len() {
                let at = chair.context("no pose of the chair")?;
                off = (at.x - self.end[0]).hypot(at.y - self.end[1]);
            }
            if evaluation.done || sent == self.actions.len() + HELD {
                break;
            }
            if waits > 0 {
                let over_ticks = std::mem::take(&mut waits);
                turns.answer(v1::Command {
                    over_ticks,
                    ..Default::default()
                })?;
                continue;
            }
            let row = &self.actions[sent.min(self.actions.len() - 1)];
            turns.answer(self.player.command(row)?)?;
            sent += 1;
        }
        let stopped = link.stop_episode(false)?;
        let told = stopped.evaluation.unwrap_or(evaluation);
        Ok(Played {
            success: told.success,
            chair_off: off,
            words: told.failure,
        })
    }
}
