//! `wheelarm demo`: runs a server, a recorder and the scripted operator or a policy on
//! loopback in lock-step, and prints the result, the file and its contact sheet.
//!
//! The demo uses only the three programs and the client SDK.

mod summary;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use parking_lot::Mutex;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::settings::Quality;
use wheelarm_proto::{defaults, v1};

use summary::Summary;
use wheelarm_campaign::listed_tasks::check_task;
use wheelarm_campaign::policy_options::{DriverChoice, PolicyArgs, Start};
use wheelarm_expert::run::Progress;
use wheelarm_options::choice::{camera, make_folder, named, seed_range};
use wheelarm_options::packs::{ObjectPackArgs, PackArgs};
use wheelarm_rollout::launcher::{
    Input, Launch, Process, Program, TaskSources, all_cameras, tasks_of_program,
};
use wheelarm_rollout::{Backend, Limits, Observer, Processes, Record, Rollout, free_label};

/// Interval of progress lines where standard error is not a terminal, for example in a notebook.
const PROGRESS_INTERVAL: Duration = Duration::from_secs(15);
/// Longest time for rendering a contact sheet.
const SHEET_PATIENCE: Duration = Duration::from_secs(120);

/// Options of `wheelarm demo`.
#[derive(Args, Clone, Debug)]
pub struct DemoArgs {
    /// Seed of the scenario.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Several seeds, `FIRST..LAST` without the last, for example `0..10`.
    #[arg(long, value_parser = seed_range, value_name = "A..B", conflicts_with = "seed")]
    pub seeds: Option<(u64, u64)>,
    /// Folder for the files.
    #[arg(long, default_value = "data/demo", value_name = "DIR")]
    pub out: PathBuf,
    /// Task.
    #[arg(long, default_value = defaults::TASK)]
    pub task: String,
    /// Scene.
    #[arg(long, default_value = defaults::SCENE)]
    pub scene: String,
    /// Robot, a folder in assets/robots.
    #[arg(long, default_value = defaults::ROBOT)]
    pub robot: String,
    /// Camera, NAME=WIDTHxHEIGHT@HZ, or WIDTHxHEIGHT@HZ for every camera of the robot. May be
    /// repeated; 1280x720@10 when absent. The rate divides 240.
    #[arg(long, value_name = "CAMERA", value_parser = camera)]
    pub camera: Vec<v1::CameraSetting>,
    /// Image width, pixels.
    #[arg(long, hide = true, default_value_t = defaults::CAMERA_SIZE[0], conflicts_with = "camera")]
    pub width: u32,
    /// Image height, pixels.
    #[arg(long, hide = true, default_value_t = defaults::CAMERA_SIZE[1], conflicts_with = "camera")]
    pub height: u32,
    /// Images per simulated second of each camera; divides 240.
    #[arg(long, hide = true, default_value_t = defaults::CAMERA_RATE_HZ, conflicts_with = "camera")]
    pub rate: f64,
    /// Rate of the laser scanner, Hz; divides 60; 0 is off [default: 0].
    #[arg(long, value_name = "HZ")]
    pub scan_rate_hz: Option<f64>,
    /// Active sensor model, MODEL or MODEL@CAMERA, a file in assets/sensors; with
    /// =STRENGTH from 0 to 3. May be repeated.
    #[arg(long, value_parser = v1::SensorSetting::from_text, value_name = "MODEL@CAMERA")]
    pub sensor: Vec<v1::SensorSetting>,
    /// Rendering quality.
    #[arg(long, value_parser = named::<Quality>(), default_value = "standard")]
    pub quality: Quality,
    /// Visual randomization: SEED[:AXIS=STRENGTH,…] as the server's --appearance; `*` as the
    /// seed uses the seed of each episode.
    #[arg(long, alias = "look", value_name = "APPEARANCE", value_parser = AppearanceText::read)]
    pub appearance: Option<AppearanceText>,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
    #[command(flatten)]
    pub objects: ObjectPackArgs,
    /// Skips the contact sheet.
    #[arg(long)]
    pub no_sheet: bool,
    #[command(flatten)]
    pub policy: PolicyArgs,
}

impl DemoArgs {
    fn scenario(&self, seed: u64, cameras: Vec<v1::CameraSetting>) -> v1::Scenario {
        v1::Scenario {
            scene: self.scene.clone(),
            task: Some(self.task.clone()),
            robot: self.robot.clone(),
            seed: Some(seed),
            cameras,
            pacing: v1::Pacing::LockStep.into(),
            quality: self.quality.code().into(),
            appearance: self
                .appearance
                .map(|appearance| appearance.for_episode(seed)),
            scan_rate_hz: self.scan_rate_hz,
            sensors: self.sensor.clone(),
            packs: self.objects.refs(),
            ..v1::Scenario::default()
        }
    }
}

/// Runs the demo for every seed. Exit code 0 when every task succeeded and every recording
/// is complete, 3 when only recordings are incomplete, otherwise 1.
///
/// # Errors
/// When a program cannot be started or stops replying.
pub fn run(args: &DemoArgs) -> anyhow::Result<ExitCode> {
    let (first, end) = args.seeds.unwrap_or((args.seed, args.seed + 1));
    let sources = TaskSources {
        assets: args.assets.as_deref(),
        packs: &args.packs.packs,
        scene: &args.scene,
        objects: &args.objects.objects,
    };
    let tasks = tasks_of_program(sources)?;
    if !args.task.is_empty() {
        check_task(sources, &tasks, &args.task)?;
    }
    make_folder(&args.out)?;
    let driver = DriverChoice::start(
        &args.policy,
        &Start {
            seeds: first..end,
            log: &args.out,
            alone: true,
            takeover: None,
        },
    )?;
    if let Some(policy) = driver.description() {
        println!("{policy}");
    }
    let mut done = Vec::new();
    for seed in first..end {
        let summary = record_episode(args, &driver, seed)?;
        print!("{summary}");
        done.push(summary);
    }
    if done.len() > 1 {
        let good = done.iter().filter(|summary| summary.is_good()).count();
        println!(
            "{good} of {} episodes succeeded and are complete",
            done.len()
        );
        for summary in done.iter().filter(|summary| !summary.is_good()) {
            println!("  not seed {}: {}", summary.seed, summary.problem());
        }
    }
    Ok(if done.iter().all(Summary::is_good) {
        ExitCode::SUCCESS
    } else if done.iter().all(|summary| summary.finished.succeeded()) {
        ExitCode::from(3)
    } else {
        ExitCode::FAILURE
    })
}

/// Records one episode.
fn record_episode(args: &DemoArgs, driver: &DriverChoice, seed: u64) -> anyhow::Result<Summary> {
    let begun = Instant::now();
    let bar = ProgressBar::new_spinner().with_style(ProgressStyle::with_template(
        "{spinner} {elapsed_precise} {msg}",
    )?);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar.set_message(format!("seed {seed}: starting the server"));
    let lines = (!std::io::stderr().is_terminal()).then(|| Mutex::new(begun));
    // A policy receives the images that it was trained with, and these are recorded.
    let cameras = match args.camera.is_empty() {
        true => vec![all_cameras(args.width, args.height, args.rate)],
        false => args.camera.clone(),
    };
    let display = Arc::new(Display {
        bar: bar.clone(),
        seed,
        begun,
        newest: Mutex::default(),
        lines,
    });
    let rollout = Rollout {
        scenario: args.scenario(seed, driver.cameras(cameras, false)?),
        label: free_label(&args.out, &format!("{}-seed{seed}", args.task)),
        driver: driver.for_episode(seed, None),
        record: Some(Record::new("demo", &args.out)),
        limits: Limits::default(),
        folder: None,
        observer: display.clone(),
    };
    let backend = Processes::new(args.assets.clone(), None).with_packs(&args.packs.packs);
    let result = backend.run_and_then(&rollout, &mut || {
        bar.set_message(format!("seed {seed}: finishing the file"));
    });
    let mut finished = result??;
    let recorded = finished.recorded.take().context("nothing was recorded")?;
    let wall = begun.elapsed();
    let sheet = if args.no_sheet || recorded.path.is_empty() {
        None
    } else {
        bar.set_message(format!("seed {seed}: rendering the contact sheet"));
        sheet(Path::new(&recorded.path))?
    };
    bar.finish_and_clear();
    let newest = std::mem::take(&mut *display.newest.lock());
    Ok(Summary {
        seed,
        finished,
        recorded,
        adapter: newest.adapter,
        first_image: newest.first_image,
        wall,
        sheet,
    })
}

/// Shows the progress of an episode.
struct Display {
    bar: ProgressBar,
    seed: u64,
    begun: Instant,
    newest: Mutex<NewestStatus>,
    /// Time of the newest progress line, where standard error is not a terminal.
    lines: Option<Mutex<Instant>>,
}

/// Values of the newest status message.
#[derive(Default)]
struct NewestStatus {
    adapter: String,
    frames: u64,
    first_image: Option<Duration>,
}

impl Observer for Display {
    fn progress(&self, progress: &Progress<'_>) {
        for note in progress.notes {
            self.bar
                .println(format!("  {:6.1} s  {note}", progress.time));
        }
        let line = format!(
            "seed {}: {:5.1} s simulated, {:<11} {:4} images, {:.2}x real time",
            self.seed,
            progress.time,
            progress.phase,
            self.newest.lock().frames,
            progress.factor
        );
        if let Some(mut printed) = self.lines.as_ref().map(Mutex::lock)
            && printed.elapsed() >= PROGRESS_INTERVAL
        {
            *printed = Instant::now();
            eprintln!("{line}");
        }
        self.bar.set_message(line);
    }

    fn status(&self, status: &v1::Status) {
        let mut newest = self.newest.lock();
        newest.adapter.clone_from(&status.adapter);
        newest.frames = status.recorders.iter().map(|r| r.accepted_frames).sum();
        if newest.frames > 0 {
            newest
                .first_image
                .get_or_insert_with(|| self.begun.elapsed());
        }
    }
}

/// Renders the contact sheet. Returns its path, or `None` after printing the failure.
fn sheet(file: &Path) -> anyhow::Result<Option<PathBuf>> {
    let image = file.with_extension("png");
    let mut program = Process::start(Launch {
        name: "sheet",
        program: Program::Own("wheelarm-dataset"),
        environment: Vec::new(),
        arguments: vec![
            "sheet".into(),
            file.into(),
            "--out".into(),
            image.clone().into(),
        ],
        input: Input::Text(String::new()),
        folder: None,
    })?;
    let status = program.ended_within(SHEET_PATIENCE)?;
    if status.is_none_or(|status| !status.success()) || !image.is_file() {
        let how = status.map_or_else(
            || format!("it took longer than {:.0} s", SHEET_PATIENCE.as_secs_f64()),
            |status| status.to_string(),
        );
        eprintln!("no contact sheet ({how}):\n{}", program.tail());
        return Ok(None);
    }
    Ok(Some(image))
}
