//! Server and recorder as separate programs, and the driver on a thread of this
//! process, in lock-step over a socket.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use parking_lot::Mutex;
use wheelarm_expert::run::DriverError;
use wheelarm_proto::v1;
use wheelarm_sdk::{Client, ClientError};

use super::Backend;
use super::watch::{Watch, is_reusable};
use crate::failure::{Failure, FailureCause};
use crate::finished::Finished;
use crate::heartbeat::Heartbeat;
use crate::launcher::{Lifetime, Record, Recorder, Server, ServerOptions, StartError, Work};
use crate::limits;
use crate::observer::Observer;
use crate::rollout::Rollout;
use crate::session::Session;

/// Time between two status requests.
const STATUS: Duration = Duration::from_secs(1);
/// Longest wait for the answer to one.
const ANSWER: Duration = Duration::from_secs(20);

/// Runs episodes with a server and a recorder in separate processes.
pub struct Processes {
    assets: Option<PathBuf>,
    packs: Vec<PathBuf>,
    adapter: Option<String>,
    /// Settings of programs that are kept between episodes.
    kept: Option<Kept>,
    programs: Mutex<Option<Programs>>,
}

struct Kept {
    scenario: v1::Scenario,
    record: Option<Record>,
    /// An episode had another scene: each reset names its own from then on.
    has_left_scene: AtomicBool,
}

impl Kept {
    /// The scene that a reset to `scene` names: none while all episodes have that of the start.
    fn reset_scene(&self, scene: &str) -> String {
        let is_other = !scene.is_empty() && scene != self.scenario.scene;
        match self.has_left_scene.fetch_or(is_other, Ordering::Relaxed) || is_other {
            true => scene.to_owned(),
            false => String::new(),
        }
    }
}

impl Processes {
    /// A new server and recorder for each episode.
    #[must_use]
    pub fn new(assets: Option<PathBuf>, adapter: Option<String>) -> Self {
        Self {
            assets,
            packs: Vec::new(),
            adapter,
            kept: None,
            programs: Mutex::new(None),
        }
    }

    /// With folders of world packs.
    #[must_use]
    pub fn with_packs(self, packs: &[PathBuf]) -> Self {
        Self {
            packs: packs.to_vec(),
            ..self
        }
    }

    /// One server and one recorder for all episodes. The server starts with `scenario` and
    /// is reset to the scenario of each episode, whose robot, cameras, pacing and quality stay
    /// those of `scenario`.
    #[must_use]
    pub fn keeping(self, scenario: v1::Scenario, record: Option<Record>) -> Self {
        Self {
            kept: Some(Kept {
                scenario,
                record,
                has_left_scene: AtomicBool::new(false),
            }),
            ..self
        }
    }

    fn start(&self, rollout: &Rollout) -> anyhow::Result<Programs> {
        let (scenario, record) = match &self.kept {
            Some(kept) => (&kept.scenario, &kept.record),
            None => (&rollout.scenario, &rollout.record),
        };
        let options = ServerOptions {
            scenario: scenario.clone(),
            assets: self.assets.clone(),
            packs: self.packs.clone(),
            adapter: self.adapter.clone(),
            folder: rollout.folder.clone(),
        };
        let failed = |cause, reason| Failure {
            cause,
            reason,
            seconds: 0.0,
            scenario: None,
        };
        let server = Server::start_unless(&options, || (rollout.limits.cancelled)());
        let server = server.map_err(|problem| match problem {
            StartError::CalledOff => failed(FailureCause::Cancelled, problem.to_string()).into(),
            StartError::Scenario(words) if self.kept.is_none() => {
                failed(FailureCause::Scenario, words).into()
            }
            StartError::Scenario(words) => anyhow!(words),
            StartError::Broke(problem) => problem,
        })?;
        let client = server.client()?;
        // A folder has room for the messages of one episode.
        let lifetime = match rollout.folder {
            Some(_) => Lifetime::OneEpisode,
            None => Lifetime::Lasting,
        };
        let recorder = record
            .as_ref()
            .map(|record| Recorder::start(server.connect(), record, lifetime))
            .transpose()?;
        Ok(Programs {
            server,
            client,
            recorder,
            lifetime,
        })
    }
}

impl Backend for Processes {
    fn attempt(&self, rollout: &Rollout, simulated: &mut dyn FnMut()) -> anyhow::Result<Finished> {
        let programs = self.programs.lock().take();
        let mut programs = match programs {
            Some(programs) => programs,
            None => self.start(rollout)?,
        };
        let result = self.episode(rollout, &mut programs, simulated);
        match self.kept.is_some() && is_reusable(&result) {
            true => *self.programs.lock() = Some(programs),
            false => programs.end(result.is_ok()),
        }
        result
    }

    fn rest(&self) {
        *self.programs.lock() = None;
    }
}

impl Processes {
    fn episode(
        &self,
        rollout: &Rollout,
        programs: &mut Programs,
        simulated: &mut dyn FnMut(),
    ) -> anyhow::Result<Finished> {
        let heartbeat = Heartbeat::new(rollout.limits.silence);
        let status = Status::start(&programs.client, &heartbeat, rollout, self.kept.is_some());
        let driver = self.drive(rollout, programs, &heartbeat)?;
        let mut run = Run {
            watch: Watch {
                rollout,
                heartbeat,
                verb: "answered",
            },
            programs,
            driver: Some(driver),
        };
        let result = run.simulate().and_then(|finished| {
            simulated();
            run.finish(finished)
        });
        drop(status);
        result
    }

    /// Starts the driver on a separate thread.
    fn drive(
        &self,
        rollout: &Rollout,
        programs: &Programs,
        heartbeat: &Heartbeat,
    ) -> anyhow::Result<Work<anyhow::Result<Finished>>> {
        let reset = self.kept.as_ref().map(|kept| v1::Scenario {
            scene: kept.reset_scene(&rollout.scenario.scene),
            robot: String::new(),
            cameras: Vec::new(),
            pacing: v1::Pacing::Unspecified.into(),
            quality: v1::RenderQuality::Unspecified.into(),
            ..rollout.scenario.clone()
        });
        let (client, heartbeat, rollout) =
            (programs.client.clone(), heartbeat.clone(), rollout.clone());
        let recorders = u32::from(programs.recorder.is_some());
        Work::start("driver", move || {
            if let Some(scenario) = reset {
                match client.reset(scenario, false) {
                    Ok(scenario) => heartbeat.set_scenario(&scenario),
                    Err(ClientError::Refused { message, .. }) => {
                        return Err(heartbeat.failure(FailureCause::Scenario, message).into());
                    }
                    Err(problem) => return Err(problem.into()),
                }
            }
            rollout.observer.attach(&client)?;
            let log = rollout.operator_log();
            let finished = rollout.driver.run(&Session {
                client: &client,
                label: &rollout.label,
                recorders,
                log: log.as_deref(),
                heartbeat: &heartbeat,
                observer: rollout.observer.as_ref(),
            });
            rollout.observer.detach();
            finished
        })
    }
}

/// A server and its clients.
struct Programs {
    server: Server,
    client: Client,
    recorder: Option<Recorder>,
    lifetime: Lifetime,
}

impl Programs {
    /// Ends the programs. A lasting recorder of an episode that failed keeps the partial
    /// file.
    fn end(mut self, is_finished: bool) {
        if is_finished {
            // A client that leaves first sees no lost connection. The server ends anyway.
            let _ = self.client.close();
        }
        self.server.process.kill();
        if let Some(recorder) = self
            .recorder
            .take_if(|_| self.lifetime == Lifetime::Lasting && !is_finished)
        {
            recorder.end();
        }
    }
}

/// An episode whose driver runs in this process.
struct Run<'a> {
    watch: Watch<'a>,
    programs: &'a mut Programs,
    driver: Option<Work<anyhow::Result<Finished>>>,
}

impl Run<'_> {
    /// Waits for the driver. When the server dies or hangs, its clients may notice first:
    /// only an answer of the server after that proves that the error is their own.
    fn simulate(&mut self) -> anyhow::Result<Finished> {
        let mut error: Option<(Instant, anyhow::Error)> = None;
        loop {
            self.watch.check(&mut self.programs.server.process)?;
            if let Some(driver) = self.driver.take_if(|driver| driver.is_over()) {
                match driver.outcome() {
                    Ok(Ok(finished)) => return Ok(finished),
                    Ok(Err(problem)) if problem.is::<Failure>() => return Err(problem),
                    Ok(Err(problem)) => {
                        let problem = self.of_driver(problem);
                        error.get_or_insert((Instant::now(), problem));
                    }
                    Err(panicked) => {
                        let words = format!("the operator panicked: {}", panicked.0);
                        return Err(self.watch.failed(FailureCause::Operator, words));
                    }
                }
            }
            if error.is_none()
                && let Some(problem) = self.recorder_error()?
            {
                error = Some((Instant::now(), problem));
            }
            if let Some((_, problem)) =
                error.take_if(|(since, _)| self.watch.heartbeat.has_answered_since(*since))
            {
                return Err(problem);
            }
            self.check_stall()?;
            std::thread::sleep(limits::LOOK);
        }
    }

    /// Waits for the finished file.
    fn finish(&mut self, finished: Finished) -> anyhow::Result<Finished> {
        let begun = Instant::now();
        let Some(recorder) = &mut self.programs.recorder else {
            return Ok(finished);
        };
        if self.programs.lifetime == Lifetime::Lasting {
            let status = recorder.finished(&self.programs.client, finished.episode())?;
            return Ok(Finished {
                messages: recorder.process.tail(),
                recorded: Some(status),
                ..finished
            });
        }
        loop {
            // The recorder may wait for a server that is lost.
            self.watch.check(&mut self.programs.server.process)?;
            let Some(recorder) = &mut self.programs.recorder else {
                return Ok(finished);
            };
            if recorder.process.ended()?.is_some() {
                return Ok(Finished {
                    messages: recorder.process.tail(),
                    ..finished
                });
            }
            if begun.elapsed() > limits::FINISH {
                return Err(anyhow!(
                    "the recorder did not finish within {:.0} s:\n{}",
                    limits::FINISH.as_secs_f64(),
                    recorder.process.tail()
                ));
            }
            std::thread::sleep(limits::LOOK);
        }
    }

    /// Ends an episode whose simulated time does not advance.
    fn check_stall(&mut self) -> anyhow::Result<()> {
        let Some(words) = self.watch.stall() else {
            return Ok(());
        };
        self.programs.server.process.kill();
        let driver = self.driver.take();
        let has_ended = driver.is_none_or(|driver| driver.is_over_within(limits::END));
        Err(self.watch.stalled(words, has_ended))
    }

    /// The error of a recorder that ended too early.
    fn recorder_error(&mut self) -> anyhow::Result<Option<anyhow::Error>> {
        let Some(recorder) = &mut self.programs.recorder else {
            return Ok(None);
        };
        let status = recorder.process.ended()?.filter(|status| !status.success());
        Ok(status.map(|status| {
            anyhow!(
                "the recorder ended ({status}):\n{}",
                recorder.process.tail()
            )
        }))
    }

    /// The error of the driver: a stall where a request timed out, else as it is.
    fn of_driver(&self, problem: anyhow::Error) -> anyhow::Error {
        if is_unanswered(&problem) {
            let words = format!("the server did not answer and was ended: {problem:#}");
            return self.watch.failed(FailureCause::Stall, words);
        }
        let tail = self.programs.server.process.tail();
        problem.context(format!("the driver failed; output of the server:\n{tail}"))
    }
}

impl Drop for Run<'_> {
    fn drop(&mut self) {
        if let Some(driver) = &self.driver {
            // The driver ends with its server; one that hangs is abandoned.
            self.programs.server.process.kill();
            let _ = driver.is_over_within(limits::END);
        }
    }
}

/// Whether a server that lives did not answer a request in time.
fn is_unanswered(problem: &anyhow::Error) -> bool {
    let of_link = |problem: &ClientError| {
        matches!(
            problem,
            ClientError::Gone { .. }
                | ClientError::Silent { .. }
                | ClientError::Unanswered { .. }
                | ClientError::Transport { .. }
        )
    };
    match problem.downcast_ref::<DriverError>() {
        Some(DriverError::Client(problem)) => of_link(problem),
        Some(DriverError::Silent(..)) => true,
        Some(_) => false,
        None => problem.downcast_ref().is_some_and(of_link),
    }
}

/// Requests the server's status on a separate thread, so that a server that does not
/// answer cannot delay the end of the episode. Stops when dropped.
struct Status(Arc<AtomicBool>);

impl Status {
    fn start(client: &Client, heartbeat: &Heartbeat, rollout: &Rollout, is_kept: bool) -> Self {
        let wanted = Arc::new(AtomicBool::new(true));
        let (client, heartbeat) = (client.clone(), heartbeat.clone());
        let observer: Arc<dyn Observer> = Arc::clone(&rollout.observer);
        let answer = ANSWER.min(heartbeat.longest());
        let is_wanted = Arc::clone(&wanted);
        std::thread::spawn(move || {
            while is_wanted.load(Ordering::Acquire) {
                let sent = Instant::now();
                if let Ok(mut status) = client.request_within(&v1::StatusRequest {}, answer)
                    && is_wanted.load(Ordering::Acquire)
                {
                    if is_kept {
                        // It may still be that of the episode before.
                        status.scenario = None;
                    }
                    heartbeat.status(&status, sent);
                    observer.status(&status);
                }
                std::thread::sleep(STATUS);
            }
        });
        Self(wanted)
    }
}

impl Drop for Status {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}
