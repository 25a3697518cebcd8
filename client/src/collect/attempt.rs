//! One attempt at an episode: a server, a recorder and the operator as
//! programs of their own in lock-step, and what came of it.
//!
//! A failure of the task is the operator's and gets a fresh seed, and so does a
//! simulation that breaks; where a server dies or hangs, which may be the host's
//! fault, the same seed is tried once more; anything else that goes wrong is the
//! host's, and the same seed is tried again.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use wheelarm_dataset::ending::PHYSICS;
use wheelarm_dataset::read::{Episode as Recording, Summary};
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::program::{EXIT_NOT_DONE, EXIT_SCENARIO, Ready};
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1::Scenario;

use super::board::{Board, Turn, lock};
use super::episode::Episode;
use super::folder::{Folder, sha256};
use super::journal::{Done, Failed};
use super::plan::{Camera, Plan};
use super::stop::Stop;
use super::watch::{SIM, Watch};
use crate::operate::{Told, ToldOutcome};
use wheelarm_rig::process::{Process, socket_folder, words};

/// Longest time until a server is ready: it may build its pipelines on a CPU.
const READY: Duration = Duration::from_secs(300);
/// Longest time in which simulation time stands still while the server answers.
const STALL: Duration = Duration::from_secs(180);
/// Longest time from the end of an episode to its finished file.
const FINISH: Duration = Duration::from_secs(900);
/// How often the programs are looked at.
const LOOK: Duration = Duration::from_millis(50);

/// What every attempt of a campaign needs.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The plan.
    pub plan: Plan,
    /// The dataset's folder.
    pub folder: Folder,
    /// Assets folder; the server looks for it when absent.
    pub assets: Option<PathBuf>,
    /// Graphics adapter by a part of its name.
    pub adapter: Option<String>,
    /// Longest time in which a server does not answer before it is ended.
    pub patience: Duration,
}

/// What came of an attempt.
#[derive(Debug)]
pub enum Outcome {
    /// The staged file is good.
    Done(Box<Done>),
    /// The task was not done.
    Failed(Failed),
    /// The server died or hung.
    Broke(Failed),
    /// Thrown away because the campaign is to end.
    Stopped,
}

/// [`Failed::broken`] of a server that died or hung.
const SERVER: &str = "server";
/// [`Failed::broken`] of a scenario that a server refuses to set up.
const SCENARIO: &str = "scenario";

/// Makes one attempt; the file lies in the staging folder afterwards. `turn`
/// is held while it simulates and is over before the file is finished.
///
/// # Errors
/// When a program of the attempt broke, with its last words.
pub fn attempt(
    setup: &Setup,
    episode: &Episode,
    number: u32,
    turn: Turn<'_>,
    stop: &Stop,
    board: &Board,
) -> anyhow::Result<Outcome> {
    let begun = Instant::now();
    let seed = episode.seed_of(number);
    let staging = setup.folder.stage(&episode.id)?;
    let socket = socket_folder(&staging)?;
    let endpoint = format!("unixsock-stream/{}/server", socket.path().display());
    tell(board, "starting");
    let arguments = server_arguments(setup, episode, seed, &endpoint);
    let mut server = Process::start("server", "wheelarm-server", arguments, &staging)?;
    let failed = |broken: &str, reason: String, told: Option<Scenario>| Failed {
        episode: episode.id.clone(),
        task: episode.task.clone(),
        attempt: number,
        seed,
        settings: episode.settings.clone(),
        reason,
        seconds: lock(board).seconds,
        wall_seconds: begun.elapsed().as_secs_f64(),
        broken: broken.to_owned(),
        death: 0,
        scenario: Some(match told {
            Some(scenario) => scenario_json(&scenario),
            None => serde_json::json!({ "task": episode.task, "seed": seed }),
        }),
    };
    match ready(&mut server, stop) {
        Ok(true) => {}
        Ok(false) => return Ok(Outcome::Stopped),
        // Another seed may do; this one never will.
        Err(problem) if code(server.ended()?) == Some(EXIT_SCENARIO) => {
            let reason = format!("{problem:#}");
            return Ok(Outcome::Failed(failed(SCENARIO, reason, None)));
        }
        Err(problem) => return Err(problem),
    }
    let connect = |more: &[OsString]| {
        let mut all = words(["--connect", &endpoint, "--sim", SIM]);
        all.extend_from_slice(more);
        all
    };
    let mut recorder = words(["record", "--name", "collect", "--episodes", "1", "--depth"]);
    recorder.extend([
        setup.plan.depth.name().into(),
        "--out".into(),
        (&staging).into(),
    ]);
    let mut recorder = Process::start("recorder", "wheelarm", connect(&recorder), &staging)?;
    let mut operator = words([
        "operate",
        "--require-recorders",
        "1",
        "--label",
        &episode.id,
    ]);
    let report = staging.join("operator.json");
    operator.extend(["--report".into(), (&report).into()]);
    if !setup.plan.randomise.operator {
        operator.extend(words(["--profile-seed", "0"]));
    }
    let mut operator = Process::start("operator", "wheelarm", connect(&operator), &staging)?;

    let watch = Watch::start(endpoint, board, setup.patience);
    let broke =
        |watch: &Watch, reason: String| Outcome::Broke(failed(SERVER, reason, watch.scenario()));
    // Where the server dies or hangs its clients may be the first to notice: only
    // an answer that comes later shows that it was their own fault.
    let mut noticed: Option<Instant> = None;
    let lost = |server: &mut Process| -> anyhow::Result<Option<String>> {
        if let Some(status) = server.ended()? {
            return Ok(Some(died(server, status)));
        }
        let hangs = watch.silent_for() >= setup.patience;
        Ok(hangs.then(|| {
            format!(
                "the server stood still and answered nothing for {:.0} s",
                setup.patience.as_secs_f64()
            )
        }))
    };
    let operated = loop {
        if stop.at_once() {
            return Ok(Outcome::Stopped);
        }
        let operated = operator.ended()?;
        let recorded = recorder.ended()?.filter(|status| !status.success());
        if let Some(words) = lost(&mut server)? {
            return Ok(broke(&watch, words));
        }
        let fault = operated.is_some_and(|status| broken(status, &operator).is_some());
        match (operated, recorded) {
            (Some(status), _) if !fault => break status,
            (None, None) => {}
            _ if !watch.has_answered_since(*noticed.get_or_insert_with(Instant::now)) => {}
            (Some(status), _) => break status,
            (None, Some(status)) => {
                bail!("the recorder ended ({status}): {}", recorder.tail());
            }
        }
        if watch.stalled() > STALL {
            bail!(
                "simulation time stood still for {:.0} s{}",
                STALL.as_secs_f64(),
                watch.waiting_for()
            );
        }
        std::thread::sleep(LOOK);
    };
    drop(turn);
    let ended = Instant::now();
    let wall_seconds = (ended - begun).as_secs_f64();
    tell(board, "finishing the file");
    while recorder.ended()?.is_none() {
        if stop.at_once() {
            return Ok(Outcome::Stopped);
        }
        if ended.elapsed() > FINISH {
            bail!(
                "the recorder did not finish within {:.0} s: {}",
                FINISH.as_secs_f64(),
                recorder.tail()
            );
        }
        // The file may still become whole, but the recorder may also wait in vain.
        if let Some(words) = lost(&mut server)? {
            return Ok(broke(&watch, words));
        }
        // The operator broke before there was an episode.
        if let Some(words) = broken(operated, &operator) {
            bail!("the operator broke: {words}");
        }
        std::thread::sleep(LOOK);
    }
    drop(watch);
    drop(server);
    if let Some(words) = broken(operated, &operator) {
        bail!("the operator broke: {words}");
    }
    let told = told(&report)?;
    tell(board, "checking the file");
    let file = staging.join(format!("{}.h5", episode.id));
    judge(episode, number, &file, &told, wall_seconds)
        .with_context(|| format!("the recorder said: {}", recorder.tail()))
}

fn died(server: &Process, status: ExitStatus) -> String {
    let said = server.last_words();
    let words = format!("the server died ({status}): {said}");
    words.trim_end_matches(": ").to_owned()
}

fn code(status: Option<ExitStatus>) -> Option<u8> {
    status?.code().and_then(|code| u8::try_from(code).ok())
}

/// The operator's last words when it broke, rather than failed at the task.
fn broken(status: ExitStatus, operator: &Process) -> Option<String> {
    let tried = status.success() || code(Some(status)) == Some(EXIT_NOT_DONE);
    (!tried).then(|| operator.last_words())
}

/// What the operator reported.
fn told(report: &Path) -> anyhow::Result<Told> {
    let text = std::fs::read_to_string(report)
        .with_context(|| format!("reading the operator's report {}", report.display()))?;
    serde_json::from_str(&text)
        .with_context(|| format!("the operator's report {} is none", report.display()))
}

/// Reads the finished file and decides.
fn judge(
    episode: &Episode,
    number: u32,
    file: &Path,
    told: &Told,
    wall_seconds: f64,
) -> anyhow::Result<Outcome> {
    let seed = episode.seed_of(number);
    let recording = Recording::open(file)?;
    let summary = recording.summary()?;
    check(&summary, episode, seed)?;
    let seconds = summary.span_nanos.1.saturating_sub(summary.span_nanos.0) as f64 * 1e-9;
    if recording.is_broken() || !(told.outcome == ToldOutcome::Done && summary.success) {
        let physics = recording.is_broken();
        return Ok(Outcome::Failed(Failed {
            episode: episode.id.clone(),
            task: episode.task.clone(),
            attempt: number,
            seed,
            settings: episode.settings.clone(),
            reason: reason(&summary, told),
            seconds,
            wall_seconds,
            broken: String::from(if physics { PHYSICS } else { "" }),
            death: 0,
            scenario: match physics {
                true => Some(scenario_json(&recording.scenario()?)),
                false => None,
            },
        }));
    }
    let scenario = scenario_json(&recording.scenario()?);
    drop(recording);
    Ok(Outcome::Done(Box::new(Done {
        episode: episode.id.clone(),
        task: episode.task.clone(),
        attempt: number,
        seed,
        settings: episode.settings.clone(),
        file: Folder::file_name(&episode.id),
        sha256: sha256(file)?,
        bytes: std::fs::metadata(file)
            .with_context(|| format!("reading {}", file.display()))?
            .len(),
        success: summary.success,
        instruction: summary.instruction.clone(),
        seconds,
        counts: summary
            .streams
            .iter()
            .map(|stream| (stream.stream.clone(), stream.received))
            .collect(),
        missed: summary.streams.iter().map(|stream| stream.missed).sum(),
        finished_unix_millis: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_millis() as u64),
        origin: [summary.origin[0].clone(), summary.origin[1].clone()],
        scenario,
        wall_seconds,
    })))
}

/// Whether a file is the complete recording of this episode.
///
/// # Errors
/// With what it is instead.
pub fn check(summary: &Summary, episode: &Episode, seed: u64) -> anyhow::Result<()> {
    if !summary.complete {
        bail!(
            "the recording is not complete: {}",
            summary.problems.join("; ")
        );
    }
    let found = (
        summary.label.as_str(),
        summary.task[0].as_str(),
        summary.seed,
    );
    let wanted = (episode.id.as_str(), episode.task.as_str(), seed);
    if found != wanted {
        bail!(
            "the recording is of {:?}, task {:?}, seed {}; expected {:?}, task {:?}, seed {}",
            found.0,
            found.1,
            found.2,
            wanted.0,
            wanted.1,
            wanted.2
        );
    }
    Ok(())
}

/// Why the task was not done.
fn reason(summary: &Summary, told: &Told) -> String {
    let why = Some(&told.why).filter(|why| !why.is_empty());
    let mut parts: Vec<String> = why.cloned().into_iter().collect();
    if !summary.failure_reason.is_empty() {
        parts.push(summary.failure_reason.clone());
    }
    let not: Vec<&str> = summary
        .conditions
        .iter()
        .filter(|(_, holds, _)| !holds)
        .map(|(name, ..)| name.as_str())
        .collect();
    if !not.is_empty() {
        parts.push(format!("not {}", not.join(", not ")));
    }
    if parts.is_empty() {
        parts.push("the operator was not content".to_owned());
    }
    parts.join("; ")
}

fn tell(board: &Board, doing: &str) {
    let mut progress = lock(board);
    doing.clone_into(&mut progress.doing);
}

/// Waits until the server serves; `false` when the campaign is to end.
fn ready(server: &mut Process, stop: &Stop) -> anyhow::Result<bool> {
    let begun = Instant::now();
    loop {
        if server
            .messages()
            .lines()
            .any(|line| Ready::parse(line).is_some())
        {
            return Ok(true);
        }
        if let Some(status) = server.ended()? {
            bail!(
                "the server ended while starting ({status}): {}",
                server.tail()
            );
        }
        if begun.elapsed() > READY {
            bail!(
                "the server was not ready within {:.0} s: {}",
                READY.as_secs_f64(),
                server.tail()
            );
        }
        if stop.at_once() {
            return Ok(false);
        }
        std::thread::sleep(LOOK);
    }
}

fn server_arguments(setup: &Setup, episode: &Episode, seed: u64, endpoint: &str) -> Vec<OsString> {
    let plan = &setup.plan;
    let mut all = words(["--sim", SIM, "--listen", endpoint, "--pacing", "lock-step"]);
    all.extend(words(["--scene", &plan.scene, "--robot", &plan.robot]));
    all.extend(words([
        "--task",
        &episode.task,
        "--seed",
        &seed.to_string(),
    ]));
    all.extend(words(["--quality", plan.quality.name()]));
    all.extend(words(["--state-rate", &plan.state_rate.to_string()]));
    all.extend(words(["--imu-rate", &plan.imu_rate.to_string()]));
    if plan.randomise.imu_noise {
        all.push("--imu-noise".into());
    }
    if plan.cameras.is_empty() {
        all.push("--no-cameras".into());
    }
    for camera in plan.cameras.iter().map(Camera::word) {
        all.extend(words(["--camera", &camera]));
    }
    if let Some(assets) = &setup.assets {
        all.extend(["--assets".into(), assets.into()]);
    }
    if let Some(adapter) = &setup.adapter {
        all.extend(words(["--adapter", adapter]));
    }
    all
}
