//! One attempt at an episode: a server and a recorder as programs of their own
//! and the operator on a thread, in lock-step, and what came of it.
//!
//! A failure of the task is the operator's and gets a fresh seed, and so does a
//! simulation that breaks and an operator that panics or stalls; where a server
//! dies or hangs, which may be the host's fault, the same seed is tried once
//! more; anything else that goes wrong is the host's, and the same seed is tried
//! again.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use wheelarm_dataset::read::Episode as Recording;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_link::{Connect, Link};
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions, Progress, Report};
use wheelarm_proto::v1;
use wheelarm_rig::{Recorder, RecorderOptions, Server, ServerOptions, StartError, Work, limits};

use super::activity::Activity;
use super::episode::Episode;
use super::folder::{Folder, sha256};
use super::journal::{Done, Failed};
use super::judge::{Judged, judge};
use super::loss::{self, Loss};
use super::plan::Plan;
use super::slot::Permit;
use super::stop::Stop;
use super::watch::Watch;
use crate::broken::Broken;
use crate::episode_seed::EpisodeSeed;

/// Simulation time may stall for as long as the server may be silent, and
/// for this long in any case, while the server answers.
const STALL: Duration = Duration::from_secs(60);

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
    /// The task was not done, or it was no fault of a server or the host.
    Failed(Failed),
    /// The server died or hung.
    Broke(Failed),
    /// Thrown away because the campaign is to end.
    Stopped,
}

/// Makes one attempt; the file lies in the staging folder afterwards. `permit`
/// is held while it simulates and is over before the file is finished.
///
/// # Errors
/// When a program of the attempt broke, with its last words.
pub fn attempt(
    setup: &Setup,
    episode: &Episode,
    number: u32,
    permit: Permit<'_>,
    stop: &Stop,
    activity: &Activity,
) -> anyhow::Result<Outcome> {
    let attempt = Attempt {
        setup,
        episode,
        number,
        seed: episode.seed_of(number),
        staging: setup.folder.stage(&episode.id)?,
        stop,
        activity,
        begun: Instant::now(),
    };
    match attempt.run(permit) {
        Ok(outcome) => Ok(outcome),
        Err(Halt::Over(outcome)) => Ok(*outcome),
        Err(Halt::Trouble(problem)) => Err(problem),
    }
}

struct Attempt<'a> {
    setup: &'a Setup,
    episode: &'a Episode,
    number: u32,
    seed: u64,
    staging: PathBuf,
    stop: &'a Stop,
    activity: &'a Activity,
    begun: Instant,
}

/// Why an attempt ends before its file is there.
enum Halt {
    Over(Box<Outcome>),
    Trouble(anyhow::Error),
}

impl From<anyhow::Error> for Halt {
    fn from(problem: anyhow::Error) -> Self {
        Self::Trouble(problem)
    }
}

fn over(outcome: Outcome) -> Halt {
    Halt::Over(Box::new(outcome))
}

/// What the operator came to.
enum Operated {
    /// It tried.
    Tried(Box<Report>),
    /// It could not work, and whose fault that is must be found out.
    Unable(OperateError),
    /// It panicked.
    Panicked(String),
}

/// An attempt's server with its clients. When it is dropped the server is
/// killed, with which the operator's work ends.
struct Rig {
    server: Server,
    recorder: Recorder,
    operator: Option<Work<Result<Report, OperateError>>>,
    watch: Watch,
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.server.kill();
        if let Some(operator) = &self.operator {
            // One that stalls is left behind.
            let _ = operator.is_over_within(limits::END);
        }
    }
}

impl Rig {
    /// What the operator came to, once.
    fn operated(&mut self) -> Option<Operated> {
        let operator = self.operator.take_if(|operator| operator.is_over())?;
        Some(match operator.outcome() {
            Ok(Ok(report)) => Operated::Tried(Box::new(report)),
            Ok(Err(problem)) => Operated::Unable(problem),
            Err(panicked) => Operated::Panicked(panicked.0),
        })
    }

    /// How the server was lost, if it was.
    fn lost(&mut self, patience: Duration) -> anyhow::Result<Option<String>> {
        if let Some(death) = self.server.death(Duration::ZERO)? {
            return Ok(Some(death));
        }
        let hangs = self.watch.silent_for() >= patience;
        Ok(hangs.then(|| {
            format!(
                "the server stalled and answered nothing for {:.0} s",
                patience.as_secs_f64()
            )
        }))
    }
}

impl Attempt<'_> {
    fn run(&self, permit: Permit<'_>) -> Result<Outcome, Halt> {
        self.activity.tell("starting");
        let server = self.server()?;
        let mut rig = self.rig(server)?;
        let report = self.simulate(&mut rig)?;
        drop(permit);
        let wall_seconds = self.begun.elapsed().as_secs_f64();
        self.activity.tell("finishing the file");
        self.finish(&mut rig)?;
        let recorder_said = rig.recorder.tail();
        drop(rig);
        self.activity.tell("checking the file");
        let file = self.staging.join(format!("{}.h5", self.episode.id));
        let judged = judge(
            self.episode,
            self.number,
            &file,
            &self.scenario(),
            &report,
            wall_seconds,
        );
        let judged = judged.with_context(|| format!("the recorder said:\n{recorder_said}"))?;
        Ok(match judged {
            Judged::Done(done) => Outcome::Done(done),
            Judged::Failed(mut failed) => {
                if self.setup.plan.keep_failed && failed.broken.is_none() {
                    failed.loss = Some(Box::new(self.keep(&file)?));
                }
                Outcome::Failed(failed)
            }
        })
    }

    /// Keeps the recording of an attempt that failed at its task.
    fn keep(&self, file: &Path) -> anyhow::Result<Loss> {
        let (cause, tick) = loss::of(&Recording::open(file)?);
        let sha256 = sha256(file)?;
        let name = format!("{}-attempt-{}", self.episode.id, self.number);
        let file = self.setup.folder.keep_recording(file, &name)?;
        Ok(Loss {
            cause,
            tick,
            file,
            sha256,
        })
    }

    /// From what the episode is drawn.
    fn drawn(&self) -> EpisodeSeed {
        EpisodeSeed {
            scene: self.seed,
            sentence: self.episode.sentence,
        }
    }

    /// The scenario that is asked for.
    fn scenario(&self) -> v1::Scenario {
        let plan = &self.setup.plan;
        let mut scenario = v1::Scenario {
            scene: plan.scene.clone(),
            robot: plan.robot.clone(),
            task: Some(self.episode.task.clone()),
            seed: Some(self.seed),
            cameras: plan.cameras.iter().map(|camera| camera.setting()).collect(),
            state_rate_hz: Some(plan.state_rate),
            imu_rate_hz: Some(plan.imu_rate),
            imu_noise: Some(plan.randomise.imu_noise),
            pacing: v1::Pacing::LockStep.into(),
            quality: plan.quality.code().into(),
            ..v1::Scenario::default()
        };
        plan.variation.apply(self.drawn(), &mut scenario);
        scenario
    }

    fn server(&self) -> Result<Server, Halt> {
        let options = ServerOptions {
            scenario: self.scenario(),
            assets: self.setup.assets.clone(),
            adapter: self.setup.adapter.clone(),
            folder: Some(self.staging.clone()),
        };
        let started = Server::start_unless(&options, || self.stop.at_once());
        started.map_err(|problem| match problem {
            StartError::CalledOff => over(Outcome::Stopped),
            // Another seed may do; this one never will.
            StartError::Scenario(words) => {
                over(Outcome::Failed(self.failed(Broken::Scenario, words, None)))
            }
            StartError::Broke(problem) => Halt::Trouble(problem),
        })
    }

    /// A server's clients.
    fn rig(&self, server: Server) -> anyhow::Result<Rig> {
        let recorder = Recorder::start(
            server.connect(),
            &RecorderOptions {
                name: "collect".to_owned(),
                out: self.staging.clone(),
                depth: self.setup.plan.depth,
                one_episode: true,
            },
        )?;
        let work = OperateOptions {
            label: Some(self.episode.id.clone()),
            require_recorders: 1,
            forced: self.setup.plan.variation.forced(self.drawn()),
            profile_seed: match self.setup.plan.randomise.operator {
                // The scenario's seed, for the first sentence of a scene.
                true => (self.episode.sentence > 0).then(|| self.drawn().own()),
                false => Some(0),
            },
            ..OperateOptions::default()
        };
        let connect = server.connect().clone();
        let mut log = Log::create(&self.staging)?;
        let operator = Work::start("operator", move || work_at(&connect, &work, &mut log))?;
        let watch = Watch::start(server.connect().clone(), self.activity, self.setup.patience);
        Ok(Rig {
            server,
            recorder,
            operator: Some(operator),
            watch,
        })
    }

    /// Waits for the operator. Where the server dies or hangs its clients may be
    /// the first to notice: only an answer that comes later shows that it was
    /// their own fault.
    fn simulate(&self, rig: &mut Rig) -> Result<Report, Halt> {
        let mut noticed: Option<Instant> = None;
        let mut unable: Option<OperateError> = None;
        loop {
            let recorded = rig.recorder.ended()?.filter(|status| !status.success());
            match rig.operated() {
                Some(Operated::Tried(report)) => {
                    self.look(rig)?;
                    return Ok(*report);
                }
                Some(Operated::Panicked(words)) => {
                    let reason = format!("the operator panicked: {words}");
                    let failed = self.failed(Broken::Operator, reason, rig.watch.scenario());
                    return Err(over(Outcome::Failed(failed)));
                }
                Some(Operated::Unable(problem)) => unable = Some(problem),
                None => {}
            }
            self.look(rig)?;
            if unable.is_some() || recorded.is_some() {
                let noticed = *noticed.get_or_insert_with(Instant::now);
                if rig.watch.has_answered_since(noticed) {
                    let trouble = match (unable.take(), recorded) {
                        (Some(problem), _) => {
                            anyhow::Error::from(problem).context("the operator broke")
                        }
                        (None, status) => anyhow!(
                            "the recorder ended ({}):\n{}",
                            status.map(|status| status.to_string()).unwrap_or_default(),
                            rig.recorder.tail()
                        ),
                    };
                    return Err(Halt::Trouble(trouble));
                }
            }
            self.check_stall(rig)?;
            std::thread::sleep(limits::LOOK);
        }
    }

    /// Waits for the finished file.
    fn finish(&self, rig: &mut Rig) -> Result<(), Halt> {
        let begun = Instant::now();
        while rig.recorder.ended()?.is_none() {
            // The file may still become whole, but the recorder may also wait in vain.
            self.look(rig)?;
            if begun.elapsed() > limits::FINISH {
                return Err(Halt::Trouble(anyhow!(
                    "the recorder did not finish within {:.0} s:\n{}",
                    limits::FINISH.as_secs_f64(),
                    rig.recorder.tail()
                )));
            }
            std::thread::sleep(limits::LOOK);
        }
        Ok(())
    }

    /// Ends the attempt when the campaign is to end at once, and when the server
    /// is lost.
    fn look(&self, rig: &mut Rig) -> Result<(), Halt> {
        if self.stop.at_once() {
            return Err(over(Outcome::Stopped));
        }
        match rig.lost(self.setup.patience)? {
            None => Ok(()),
            Some(reason) => {
                let failed = self.failed(Broken::Server, reason, rig.watch.scenario());
                Err(over(Outcome::Broke(failed)))
            }
        }
    }

    /// Ends the attempt when simulation time stalls for too long while the
    /// server answers: an operator that does not come back from the end of its
    /// server is what stalled.
    fn check_stall(&self, rig: &mut Rig) -> Result<(), Halt> {
        let patience = self.setup.patience.max(STALL);
        if rig.watch.stalled() < patience {
            return Ok(());
        }
        let words = format!(
            "simulation time stalled for {:.0} s{}",
            patience.as_secs_f64(),
            rig.watch.waiting_for()
        );
        rig.server.kill();
        let operator = rig.operator.take();
        if operator.is_some_and(|operator| !operator.is_over_within(limits::END)) {
            let reason = format!("the operator stalled: {words}");
            let failed = self.failed(Broken::Operator, reason, rig.watch.scenario());
            return Err(over(Outcome::Failed(failed)));
        }
        Err(Halt::Trouble(anyhow!(words)))
    }

    /// The journal's entry where something broke; `told` is the scenario that
    /// the server told.
    fn failed(&self, broken: Broken, reason: String, told: Option<v1::Scenario>) -> Failed {
        let asked = || serde_json::json!({ "task": self.episode.task, "seed": self.seed });
        Failed {
            episode: self.episode.id.clone(),
            task: self.episode.task.clone(),
            attempt: self.number,
            seed: self.seed,
            settings: self.episode.settings.clone(),
            reason,
            seconds: self.activity.seconds(),
            wall_seconds: self.begun.elapsed().as_secs_f64(),
            broken: Some(broken),
            death: 0,
            loss: None,
            scenario: Some(told.as_ref().map_or_else(asked, scenario_json)),
        }
    }
}

/// The operator at work, which writes down how it goes.
fn work_at(
    connect: &Connect,
    options: &OperateOptions,
    log: &mut Log,
) -> Result<Report, OperateError> {
    let link = Link::open(connect)?;
    let report = operate::run(&link, options, &mut |progress| log.follow(progress));
    match &report {
        Ok(report) => log.line(&report.why().unwrap_or_else(|| "done".to_owned())),
        Err(problem) => log.line(&format!("error: {problem}")),
    }
    // The server may be gone already.
    let _ = link.close();
    report
}

/// `operator.log`: phases and notes, for whoever wonders why an attempt failed.
struct Log {
    file: File,
    phase: String,
}

impl Log {
    fn create(staging: &Path) -> anyhow::Result<Self> {
        let path = staging.join("operator.log");
        let file = File::create(&path).with_context(|| format!("making {}", path.display()))?;
        let phase = String::new();
        Ok(Self { file, phase })
    }

    fn follow(&mut self, progress: &Progress<'_>) {
        if progress.phase != self.phase {
            progress.phase.clone_into(&mut self.phase);
            self.line(&format!("{:7.2} s  {}", progress.time, progress.phase));
        }
        for note in progress.notes {
            self.line(&format!("{:7.2} s  {note}", progress.time));
        }
    }

    fn line(&mut self, words: &str) {
        // A disk that takes no log takes no recording either, which is told.
        let _ = writeln!(self.file, "{words}");
    }
}
