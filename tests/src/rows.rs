//! Plays the rows of a recording open loop through public commands, like a policy that
//! returns exactly these rows.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use wheelarm_dataset::convert::learning::{self, Learning, RowOptions};
use wheelarm_dataset::convert::{ReadOptions, Recording, Sees};
use wheelarm_policy::{ActionKind, Player};
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{PHYSICS_HZ, TICKS_PER_CONTROL, TopicId, v1};
use wheelarm_sdk::{Client, Turn};

use crate::exported::Exported;
use crate::{PATIENCE, Server};

/// Number of repetitions of the last row while the task is not done.
const HELD: usize = 30;

/// The rows of one recording.
#[derive(Debug)]
pub struct Rows {
    /// Scenario of the recording.
    pub scenario: v1::Scenario,
    /// An action per image, rounded to the 32 bits that an export keeps.
    pub actions: Vec<Vec<f64>>,
    /// Converts actions to commands.
    pub player: Player,
    /// Control ticks before the first image.
    before: u32,
    /// Indices of chair and end effector in the frames of `PoseSet`.
    frames: [usize; 2],
    /// Their true positions at every image, m.
    path: Vec<[[f64; 3]; 2]>,
}

/// Result of playing the rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Played {
    /// The task was done.
    pub success: bool,
    /// Distance of chair and end effector from their recorded positions, mean over the
    /// images, m.
    pub off: [f64; 2],
    /// Why the task failed; empty when it did not.
    pub words: String,
}

impl Rows {
    /// Reads a recording; each row has the action of `shift` rows before.
    ///
    /// # Errors
    /// When it cannot be read or has no rows.
    pub fn read(file: &Path, kind: ActionKind, shift: usize) -> anyhow::Result<Self> {
        let wanted = learning::reads;
        let recording = Recording::open(file, &ReadOptions::default(), &wanted)?;
        let options = RowOptions {
            action: kind,
            trim_idle: None,
        };
        let (rate, all) = Learning::on_grid(&recording, &options, Sees::Colour)?;
        let last = all.rows.len() - 1;
        let rounded =
            |row: &[f64]| -> Vec<f64> { row.iter().map(|v| f64::from(*v as f32)).collect() };
        let actions = (0..=last).map(|i| rounded(&all.actions[i.saturating_sub(shift)]));
        let actions = actions.collect();
        Self::of(&recording, &all, rate, kind, (0..last + 1, actions))
    }

    /// Reads a recording, with the actions of a LeRobot set that was exported from it.
    ///
    /// # Errors
    /// When the set does not hold the recording's rows.
    pub fn exported(file: &Path, set: &Exported) -> anyhow::Result<Self> {
        let wanted = learning::reads;
        let recording = Recording::open(file, &ReadOptions::default(), &wanted)?;
        let kinds = [
            ActionKind::NextPose,
            ActionKind::NextJoints,
            ActionKind::Applied,
        ];
        let mut kinds = kinds.into_iter();
        let kind = kinds.find(|kind| kind.names(&recording.robot) == set.names);
        let kind = kind.context("the set's actions are of no known kind")?;
        let label = &recording.summary.label;
        let rows = set.episodes.get(label);
        let rows = rows.with_context(|| format!("the set does not hold {label}"))?;
        let options = RowOptions {
            action: kind,
            trim_idle: None,
        };
        let (rate, all) = Learning::on_grid(&recording, &options, Sees::Colour)?;
        let time = |row: &usize| recording.aligned.stamps[*row] as f64 * 1e-9;
        let times: Vec<f64> = all.rows.iter().map(time).collect();
        let first = times.partition_point(|time| *time < rows[0].0 - 1e-6);
        let here = first..first + rows.len();
        let found = times
            .get(here.clone())
            .context("rows beyond the recording")?;
        let far = found.iter().zip(rows).any(|(a, b)| (a - b.0).abs() > 1e-6);
        ensure!(!far, "the set's rows of {label} have other times");
        let actions = rows.iter().map(|row| row.1.clone()).collect();
        Self::of(&recording, &all, rate, kind, (here, actions))
    }

    /// Actions of some rows of a recording, and the positions to compare with.
    fn of(
        recording: &Recording,
        all: &Learning<'_>,
        rate: u32,
        kind: ActionKind,
        (rows, actions): (Range<usize>, Vec<Vec<f64>>),
    ) -> anyhow::Result<Self> {
        let places = &all.rows[rows];
        let mut player = Player::new(kind, &recording.robot, f64::from(rate));
        player.device = v1::Device::Replay;
        // A row has no force cap: a policy reads it from the scene.
        let applied = recording.episode.applied()?;
        let caps = applied.iter().filter_map(|a| a.gripper?.max_force);
        player.max_force = caps.reduce(f64::min);
        let started = recording.episode.started()?.header.unwrap_or_default();
        let stamp = recording.aligned.stamps[places[0]] as f64 * 1e-9;
        let tick = (stamp * PHYSICS_HZ as f64).round() as u64;
        let before = tick.saturating_sub(started.tick) / TICKS_PER_CONTROL;
        let place = |pose: &[f64]| -> [f64; 3] { std::array::from_fn(|k| pose[k]) };
        let path = places
            .iter()
            .map(|row| [all.chair(*row), all.effector(*row)].map(place));
        let roles = Roles::find(&recording.robot)?;
        Ok(Self {
            scenario: recording.episode.scenario()?,
            actions,
            player,
            before: u32::try_from(before)?,
            frames: [roles.chair, roles.end_effector],
            path: path.collect(),
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
        self.play_at(&server.client())
    }

    fn play_at(&self, client: &Client) -> anyhow::Result<Played> {
        let topics = [TopicId::Evaluation, TopicId::Pose];
        let mut turns = client.turns("rows", false, &topics)?;
        let started = client.request(&v1::EpisodeStartRequest {
            label: "rows".to_owned(),
            ..Default::default()
        })?;
        let episode = started.header.unwrap_or_default().episode;
        let (mut evaluation, mut poses) = (v1::Evaluation::default(), Vec::new());
        let (mut sent, mut off, mut waits) = (0, Vec::new(), self.before);
        loop {
            let mut on_sample = |sample| match sample {
                Sample::Evaluation(sample) => evaluation = sample,
                Sample::Pose(sample) => poses = sample.frames,
                _ => {}
            };
            let clock = match turns.next(PATIENCE, &mut on_sample)? {
                Turn::Answer(clock) => clock.header.unwrap_or_default(),
                Turn::Refused(refusal) => bail!("refused: {}", refusal.reason),
                Turn::Ended(_) => bail!("another client ended the episode"),
                Turn::Silent(status) => bail!("silence: {}", status.waiting_for),
            };
            if clock.episode != episode {
                continue;
            }
            if let Some(path) = self.path.get(sent).filter(|_| waits == 0) {
                off.push(self.off(&poses, path)?);
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
        let stopped = client.stop_episode(false)?;
        let evaluation = stopped.evaluation.unwrap_or(evaluation);
        let mean = |k: usize| {
            let values: Vec<f64> = off.iter().map(|off| off[k]).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        Ok(Played {
            success: evaluation.success,
            off: [mean(0), mean(1)],
            words: evaluation.failure,
        })
    }

    /// Distance of chair and end effector from their recorded positions, m.
    fn off(&self, poses: &[v1::FramePose], path: &[[f64; 3]; 2]) -> anyhow::Result<[f64; 2]> {
        let mut off = [0.0; 2];
        for ((off, frame), was) in off.iter_mut().zip(self.frames).zip(path) {
            let pose = poses.get(frame).and_then(|frame| frame.pose?.position);
            let at = pose.context("no pose of the robot")?;
            *off = (at.x - was[0]).hypot(at.y - was[1]).hypot(at.z - was[2]);
        }
        Ok(off)
    }
}
