//! Options of `wheelarm evaluate`, and the scenarios they ask for.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::settings::{Depth, LanguageSplit, Named, Quality, Starts, Style};
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::all_cameras;

use super::compare::CompareArgs;
use super::entry::Job;
use super::scope::{Scope, read_split};
use crate::adapters::AdapterArgs;
use crate::axis::{Axis, AxisAt};
use crate::disturb::Disturb;
use crate::policy_options::PolicyArgs;
use crate::sentences::Language;
use crate::variation::Variation;
use crate::worker_mode::WorkerMode;
use wheelarm_options::choice::{MOST_SEEDS, named, patience, seed_range};

/// What `wheelarm evaluate` can do instead of evaluating.
#[derive(clap::Subcommand, Clone, Debug)]
pub enum Instead {
    /// Compares two evaluations of the same episodes, pair by pair.
    Compare(CompareArgs),
}

/// Options of `wheelarm evaluate`.
#[derive(Args, Clone, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct EvaluateArgs {
    #[command(subcommand)]
    pub instead: Option<Instead>,
    /// Task, or `all`.
    #[arg(long, default_value = "all")]
    pub task: String,
    /// Seeds, `FIRST..LAST` without the last.
    #[arg(long, value_parser = seed_range, value_name = "A..B")]
    pub seeds: Option<(u64, u64)>,
    /// Episodes of each task, from seed 0 or the first of the split; 10 when nothing
    /// says the seeds.
    #[arg(long, value_name = "N", conflicts_with = "seeds", value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    pub episodes: Option<u64>,
    /// A frozen split, for example assets/splits/policy-claim.toml: its seeds, starts
    /// and all else that it draws. With --episodes the first of its seeds.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["seeds", "starts", "appearance", "language", "language_split", "style"])]
    pub split: Option<PathBuf>,
    /// One thing that is made harder than seeds or split say, AXIS=STRENGTH: camera,
    /// noise, light, background, layout, robot, language, depth or delay, 1 to 3. May be
    /// given several times.
    #[arg(long, value_name = "AXIS", value_parser = AxisAt::read)]
    pub axis: Vec<AxisAt>,
    #[command(flatten)]
    pub policy: PolicyArgs,
    /// The policy drives for a time that the seed draws, this at most, and the scripted
    /// operator does the rest: with --record corrections to learn from (DAgger), whose
    /// rows by the policy are marked.
    #[arg(long, value_name = "SECONDS", value_parser = patience::<1>)]
    pub takeover: Option<Duration>,
    /// Asks the policy about one observation at a time, so that a policy on a processor
    /// answers the same bits for any --jobs.
    #[arg(long)]
    pub deterministic: bool,
    /// How a worker with the scripted operator runs: `process` is server, recorder and
    /// operator in one process, `socket` each in its own; a policy's is always that.
    #[arg(long, value_parser = named::<WorkerMode>(), default_value = "process")]
    pub worker: WorkerMode,
    /// Servers at work at one time.
    #[arg(long, default_value = "1", value_name = "J")]
    pub jobs: NonZeroUsize,
    #[command(flatten)]
    pub graphics: AdapterArgs,
    /// Folder for the results; an interrupted run in it is resumed.
    #[arg(long, default_value = "data/evaluate")]
    pub out: PathBuf,
    /// Records every episode as an HDF5 file into the folder.
    #[arg(long)]
    pub record: bool,
    /// Draws so many failed episodes again at 720p, from recordings that are kept of
    /// failures alone unless there is --record; their contact sheets stand in
    /// report.html.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub redraw_failures: Option<u32>,
    /// Camera of the recordings, `NAME=WIDTHxHEIGHT@HZ`, may be given several
    /// times, `*` for each of the robot's that is not named; `*=640x360@10` when absent.
    #[arg(
        long,
        requires = "record",
        value_parser = v1::CameraSetting::from_text,
        value_name = "CAMERA"
    )]
    pub camera: Vec<v1::CameraSetting>,
    /// Depth of the recordings: `f32` metres, `u16` millimetres, or `none`.
    #[arg(long, requires = "record", value_parser = named::<Depth>(), default_value = "f32")]
    pub depth: Depth,
    /// Does those episodes anew in which something broke; without it they count as done.
    #[arg(long)]
    pub again: bool,
    /// Does all episodes anew; the results of before are set aside as `episodes-N.jsonl`.
    /// Needed in a folder whose results are of another state of the policy's files.
    #[arg(long)]
    pub fresh: bool,
    /// Where the robot starts: `near` by, or `anywhere` in the home with the arm in
    /// any of its postures.
    #[arg(long, default_value = "near", value_parser = named::<Starts>())]
    pub starts: Starts,
    /// Says each task by the grammar, in a sentence of this seed about the scene as it
    /// is drawn; without it one of the task's own.
    #[arg(long, value_name = "SEED")]
    pub language: Option<u64>,
    /// Which templates and names are said: `any`, `train` or `held_out`.
    #[arg(long, default_value = "any", value_parser = named::<LanguageSplit>(), requires = "language")]
    pub language_split: LanguageSplit,
    /// Visual randomization: SEED[:AXIS=STRENGTH,…] as the server's --appearance, `*` in the
    /// place of the seed for each episode's own. Give each its own folder.
    #[arg(long, alias = "look", value_name = "APPEARANCE", value_parser = AppearanceText::read)]
    pub appearance: Option<AppearanceText>,
    /// Who sits in the chair: any (drawn by the seed), none, or BODY[/POSTURE], then
    /// ,mouth_open ,motion=0..1 ,unguarded.
    #[arg(long, value_name = "PERSON", value_parser = v1::Person::from_text, conflicts_with = "split")]
    pub person: Option<v1::Person>,
    /// Hinders the robot: strength of noise, pushes and slips, 1 to 3.
    #[arg(long, value_name = "STRENGTH", value_parser = clap::value_parser!(u32).range(1..=3), conflicts_with = "split")]
    pub disturb: Option<u32>,
    /// Share of episodes in which the operator errs on purpose and corrects it, 0 to 1.
    #[arg(long, default_value = "0", value_parser = share, value_name = "SHARE", conflicts_with = "split")]
    pub error_share: f64,
    /// How the operator moves: `quick`, or `human` with time limits to match.
    #[arg(long, default_value = "quick", value_parser = named::<Style>())]
    pub style: Style,
    /// Time limits from the way and the style, in place of those of the tasks.
    #[arg(long)]
    pub time_limits: bool,
    /// Wall seconds without a sign of life after which a server is ended, 1 at least.
    #[arg(long, default_value = "60", value_parser = patience::<1>, value_name = "SECONDS")]
    pub patience: Duration,
    /// No picture of the end of each task.
    #[arg(long)]
    pub no_grid: bool,
    /// Scene.
    #[arg(long, default_value = "home")]
    pub scene: String,
    /// Robot, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    pub robot: String,
    /// Assets folder; the server looks for it when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
}

/// A share, 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|s| (0.0..=1.0).contains(s));
    share.ok_or_else(|| format!("{text:?} is no share, 0 to 1"))
}

impl EvaluateArgs {
    /// Which episodes are done.
    ///
    /// # Errors
    /// When the split holds a mistake, or asks for pictures that are not taken.
    pub(super) fn scope(&self) -> anyhow::Result<Scope> {
        let mut scope = match &self.split {
            Some(path) => read_split(path)?,
            None => {
                let (first, end) = self.seeds.unwrap_or((0, self.episodes.unwrap_or(10)));
                Scope {
                    layout: false,
                    split: None,
                    seeds: first..end,
                    variation: Variation {
                        scenario: v1::Scenario {
                            starts: self.starts.code().into(),
                            ..v1::Scenario::default()
                        },
                        appearance: self.appearance,
                        ..Variation::default()
                    },
                }
            }
        };
        if self.disturb.is_some() || self.error_share > 0.0 {
            scope.variation.disturb = Some(Disturb::all(
                self.disturb.unwrap_or_default(),
                self.error_share,
            ));
        }
        let shared = &mut scope.variation.scenario;
        if self.style != Style::default() {
            shared.style = Some(self.style.name().to_owned());
        }
        if self.person.is_some() {
            shared.person.clone_from(&self.person);
        }
        scope.variation.time_limits = self.time_limits || self.style == Style::Human;
        if let Some(seed) = self.language {
            scope.variation.language = Some(Language::new(seed, self.language_split));
        }
        for (i, axis) in self.axis.iter().enumerate() {
            if self.axis[..i]
                .iter()
                .any(|before| before.axis() == axis.axis())
            {
                bail!(
                    "--axis {} stands there twice; say it once",
                    axis.axis().name()
                );
            }
            if axis.axis() == Axis::Language && self.language.is_some() {
                bail!(
                    "--axis language says how tasks are said, and so does --language; leave one out"
                );
            }
            scope.layout |= axis.is_layout();
            scope.variation.set(*axis);
        }
        let sees = scope
            .variation
            .scenario
            .sensors
            .iter()
            .find(|s| !s.camera.is_empty());
        let is_blind = !self.record && !self.policy.policy.has_cameras();
        if let Some(sensor) = sees.filter(|_| is_blind) {
            bail!(
                "the sensor {} sees through a camera, and an evaluation has cameras only where it records; add --record",
                sensor.text()
            );
        }
        if let Some(count) = self.episodes {
            let last = scope.seeds.start.saturating_add(count);
            scope.seeds.end = scope.seeds.end.min(last);
        }
        Ok(scope)
    }

    /// Whether episodes are recorded, be it for a time.
    pub(super) fn records(&self) -> bool {
        self.record || self.redraw_failures.is_some()
    }

    /// Cameras of the recordings.
    pub(super) fn cameras(&self) -> Vec<v1::CameraSetting> {
        match (self.record, self.camera.is_empty()) {
            (false, _) => Vec::new(),
            (true, true) => vec![all_cameras(640, 360, 10.0)],
            (true, false) => self.camera.clone(),
        }
    }

    /// The scenario of `job`; without a job that of a server before its first episode.
    pub(super) fn scenario(
        &self,
        job: Option<&Job>,
        cameras: Vec<v1::CameraSetting>,
    ) -> v1::Scenario {
        let shared = job.map(|job| job.variation.for_episode(job.seed));
        v1::Scenario {
            scene: self.scene.clone(),
            robot: self.robot.clone(),
            task: Some(job.map(|job| job.task.clone()).unwrap_or_default()),
            seed: Some(job.map_or(0, |job| job.seed)),
            cameras,
            pacing: v1::Pacing::LockStep.into(),
            quality: Quality::Standard.code().into(),
            ..shared.unwrap_or_default()
        }
    }
}
