//! Options of `wheelarm evaluate`, and the scenarios that they define.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::settings::{Depth, LanguageSplit, Named, Quality, Starts, Style};
use wheelarm_proto::{defaults, v1};
use wheelarm_rollout::launcher::all_cameras;

use super::compare::CompareArgs;
use super::entry::Job;
use super::scope::{Scope, read_split};
use super::suite::VerifyArgs;
use crate::adapters::AdapterArgs;
use crate::axis::{Axis, AxisAt};
use crate::disturb::Disturb;
use crate::policy_options::PolicyArgs;
use crate::sentences::Language;
use crate::variation::Variation;
use crate::worker_mode::WorkerMode;
use wheelarm_options::choice::{MOST_SEEDS, camera, named, patience, seed_range};
use wheelarm_options::packs::{ObjectPackArgs, PackArgs};

/// Subcommands of `wheelarm evaluate`.
#[derive(clap::Subcommand, Clone, Debug)]
pub enum Subcommand {
    /// Compares two evaluations of the same episodes, pair by pair.
    Compare(CompareArgs),
    /// Checks the results of a suite, and computes their figures again from the episodes.
    Verify(Box<VerifyArgs>),
}

/// Options of `wheelarm evaluate`.
#[derive(Args, Clone, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct EvaluateArgs {
    #[command(subcommand)]
    pub subcommand: Option<Subcommand>,
    /// Task, several with commas between them, or `all`.
    #[arg(long, default_value = "all")]
    pub task: String,
    /// Seeds, `FIRST..LAST` without the last.
    #[arg(long, value_parser = seed_range, value_name = "A..B")]
    pub seeds: Option<(u64, u64)>,
    /// Episodes of each task, from seed 0 or the first of the split; 10 without any option
    /// for seeds.
    #[arg(long, value_name = "N", conflicts_with = "seeds", value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    pub episodes: Option<u64>,
    /// A frozen split, for example assets/splits/policy-claim.toml: its seeds, starts
    /// and sampling settings. With --episodes, the first of its seeds.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["seeds", "starts", "appearance", "language", "language_split", "style"])]
    pub split: Option<PathBuf>,
    /// A frozen suite, for example assets/suites/robustness-core.toml: cells of one change each,
    /// on the same seeds. An interrupted run continues.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["task", "seeds", "episodes", "split", "axis", "takeover", "starts",
        "appearance", "language", "person", "disturb", "error_share", "style", "time_limits", "scene", "robot", "objects",
        "record", "redraw_failures", "training_seeds"])]
    pub suite: Option<PathBuf>,
    /// Cells of the suite to run, separated by commas; all when absent.
    #[arg(long, value_name = "CELLS", value_delimiter = ',', requires = "suite")]
    pub cells: Vec<String>,
    /// Training ledger of the policy [default: the file beside the policy].
    #[arg(long, value_name = "FILE", requires = "suite")]
    pub ledger: Option<PathBuf>,
    /// Axis of difficulty added to seeds or split, AXIS=STRENGTH: camera, noise, light,
    /// background, layout, robot, language, depth or delay, 1 to 3. May be repeated.
    #[arg(long, value_name = "AXIS", value_parser = AxisAt::read)]
    pub axis: Vec<AxisAt>,
    #[command(flatten)]
    pub policy: PolicyArgs,
    /// The policy drives for a time that is sampled from the seed, at most this, and the
    /// scripted operator does the rest. With --record this makes corrections for DAgger;
    /// the rows of the policy are marked.
    #[arg(long, value_name = "SECONDS", value_parser = patience::<1>)]
    pub takeover: Option<Duration>,
    /// Sends the policy one observation at a time, so that a policy on a CPU returns the same
    /// bits for any --jobs.
    #[arg(long)]
    pub deterministic: bool,
    /// Processes of a worker with the scripted operator: `process` runs server, recorder and
    /// operator in one process, `socket` each in its own. Policies always use `socket`.
    #[arg(long, value_parser = named::<WorkerMode>(), default_value = "process")]
    pub worker: WorkerMode,
    /// Servers that run at the same time.
    #[arg(long, default_value = "1", value_name = "N")]
    pub jobs: NonZeroUsize,
    #[command(flatten)]
    pub graphics: AdapterArgs,
    /// Folder for the results; an interrupted run in it is resumed.
    #[arg(long, default_value = "data/evaluate", value_name = "DIR")]
    pub out: PathBuf,
    /// Records every episode as an HDF5 file into the folder.
    #[arg(long)]
    pub record: bool,
    /// Renders N failed episodes again at 720p and adds their contact sheets to report.html.
    /// Keeps recordings of failures only, unless --record is given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub redraw_failures: Option<u32>,
    /// Camera of the recordings, NAME=WIDTHxHEIGHT@HZ, or WIDTHxHEIGHT@HZ for each other camera
    /// of the robot. May be repeated; 640x360@10 when absent.
    #[arg(
        long,
        requires = "record",
        value_parser = camera,
        value_name = "CAMERA"
    )]
    pub camera: Vec<v1::CameraSetting>,
    /// Depth of the recordings: `f32` metres, `u16` millimetres, or `none`.
    #[arg(long, requires = "record", value_parser = named::<Depth>(), default_value = "f32")]
    pub depth: Depth,
    /// Repeats broken episodes, which otherwise count as done.
    #[arg(long)]
    pub again: bool,
    /// Repeats all episodes; earlier results are moved to `episodes-N.jsonl`. Required in a
    /// folder with results of other versions of the policy's files.
    #[arg(long)]
    pub fresh: bool,
    /// Start of the robot: `near` the target, or `anywhere` in the home with the arm in a
    /// sampled posture.
    #[arg(long, default_value = "near", value_parser = named::<Starts>())]
    pub starts: Starts,
    /// Seed of grammar sentences about the sampled scene; sentences of the task when absent.
    #[arg(long, value_name = "SEED")]
    pub language: Option<u64>,
    /// Templates and names of the sentences: `any`, `train` or `held_out`.
    #[arg(long, default_value = "any", value_parser = named::<LanguageSplit>(), requires = "language")]
    pub language_split: LanguageSplit,
    /// Visual randomization: SEED[:AXIS=STRENGTH,…] as the server's --appearance, `*` as the
    /// seed uses the seed of each episode. Use one folder per setting.
    #[arg(long, alias = "look", value_name = "APPEARANCE", value_parser = AppearanceText::read)]
    pub appearance: Option<AppearanceText>,
    /// Person in the chair: any (sampled by the seed), none, or BODY[/POSTURE], then
    /// ,mouth_open ,motion=0..1 ,unguarded.
    #[arg(long, value_name = "PERSON", value_parser = v1::Person::from_text, conflicts_with = "split")]
    pub person: Option<v1::Person>,
    /// Disturbances: strength of noise, pushes and slips, 1 to 3.
    #[arg(long, value_name = "STRENGTH", value_parser = clap::value_parser!(u32).range(1..=3), conflicts_with = "split")]
    pub disturb: Option<u32>,
    /// Share of episodes with a deliberate, corrected error of the operator, 0 to 1.
    #[arg(long, default_value = "0", value_parser = share, value_name = "SHARE", conflicts_with = "split")]
    pub error_share: f64,
    /// Motion of the operator: `quick`, or `human` with matching time limits.
    #[arg(long, default_value = "quick", value_parser = named::<Style>())]
    pub style: Style,
    /// Time limits from path and style instead of those of the tasks.
    #[arg(long)]
    pub time_limits: bool,
    /// Wall seconds without a reply after which a server is ended, at least 1.
    #[arg(long, default_value = "60", value_parser = patience::<1>, value_name = "SECONDS")]
    pub patience: Duration,
    /// Skips the image of the end of each task.
    #[arg(long)]
    pub no_grid: bool,
    /// Scene.
    #[arg(long, default_value = defaults::SCENE)]
    pub scene: String,
    /// Robot, a folder in assets/robots.
    #[arg(long, default_value = defaults::ROBOT)]
    pub robot: String,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
    #[command(flatten)]
    pub objects: ObjectPackArgs,
}

/// A share, 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|s| (0.0..=1.0).contains(s));
    share.ok_or_else(|| format!("{text:?} is not a share from 0 to 1"))
}

impl EvaluateArgs {
    /// The episodes to run.
    ///
    /// # Errors
    /// When the split is invalid, or needs camera images that the evaluation does not render.
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
        // Results name them, so that those of other objects are not counted together.
        if !self.objects.objects.is_empty() {
            if !shared.packs.is_empty() {
                bail!(
                    "--objects and the objects of the split exclude each other; remove --objects"
                );
            }
            shared.packs = self.objects.refs();
        }
        if self.robot != defaults::ROBOT {
            shared.robot.clone_from(&self.robot);
        }
        match (scope.variation.homes.is_empty(), self.scene.as_str()) {
            (true, defaults::SCENE) | (false, _) => {}
            (true, scene) => scene.clone_into(&mut shared.scene),
        }
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
                bail!("--axis {} is given twice; remove one", axis.axis().name());
            }
            if axis.axis() == Axis::Language && self.language.is_some() {
                bail!("--axis language and --language both define the sentences; remove one");
            }
            scope.layout |= axis.is_layout();
            scope.variation.set(*axis);
        }
        let camera_sensor = scope
            .variation
            .scenario
            .sensors
            .iter()
            .find(|s| !s.camera.is_empty());
        let has_no_cameras = !self.record && !self.policy.policy.has_cameras();
        if let Some(sensor) = camera_sensor.filter(|_| has_no_cameras) {
            bail!(
                "the sensor {} uses a camera, and an evaluation renders cameras only when it records; add --record",
                sensor.text()
            );
        }
        if let Some(count) = self.episodes {
            let last = scope.seeds.start.saturating_add(count);
            scope.seeds.end = scope.seeds.end.min(last);
        }
        Ok(scope)
    }

    /// Whether episodes are recorded, at least temporarily.
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

    /// The scenario of `job`; without a job, that of a server before its first episode.
    pub(super) fn scenario(
        &self,
        job: Option<&Job>,
        cameras: Vec<v1::CameraSetting>,
    ) -> v1::Scenario {
        let shared = job.map(|job| job.variation.for_episode(job.seed));
        let shared = shared.unwrap_or_default();
        v1::Scenario {
            scene: match shared.scene.as_str() {
                "" => self.scene.clone(),
                scene => scene.to_owned(),
            },
            robot: self.robot.clone(),
            task: Some(job.map(|job| job.task.clone()).unwrap_or_default()),
            seed: Some(job.map_or(0, |job| job.seed)),
            cameras,
            pacing: v1::Pacing::LockStep.into(),
            quality: Quality::Standard.code().into(),
            packs: match shared.packs.is_empty() {
                true => self.objects.refs(),
                false => shared.packs.clone(),
            },
            ..shared
        }
    }
}
