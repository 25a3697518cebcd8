//! An attempt with a server and a recorder as programs of their own and the operator
//! on a thread, in lock-step over a socket.

use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use wheelarm_link::{Connect, Link};
use wheelarm_operate::log::Log;
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions, Report};
use wheelarm_rollout::launcher::{
    Recorder, RecorderOptions, Server, ServerOptions, StartError, Work,
};
use wheelarm_rollout::limits;

use super::attempt::{Attempt, Halt, OPERATOR_LOG, Outcome, STALL, over};
use super::slot::Permit;
use super::watch::Watch;
use crate::broken::Broken;

/// Makes the attempt; `permit` is over before the file is finished.
///
/// # Errors
/// [`Halt`].
pub fn run(attempt: &Attempt<'_>, permit: Permit<'_>) -> Result<Outcome, Halt> {
    attempt.activity.tell("starting");
    let server = attempt.server()?;
    let mut rig = attempt.rig(server)?;
    let report = attempt.simulate(&mut rig)?;
    drop(permit);
    let wall_seconds = attempt.begun.elapsed().as_secs_f64();
    attempt.activity.tell("finishing the file");
    attempt.finish(&mut rig)?;
    let recorder_said = rig.recorder.tail();
    drop(rig);
    Ok(attempt.judged(&report, wall_seconds, &recorder_said)?)
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
    fn server(&self) -> Result<Server, Halt> {
        let options = ServerOptions {
            scenario: self.scenario(),
            assets: self.setup.assets.clone(),
            adapter: self.slot.adapter().map(str::to_owned),
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
                scratch: self.setup.folder.scratch(&self.episode.id),
                depth: self.setup.plan.depth,
                one_episode: true,
            },
        )?;
        let work = OperateOptions {
            label: Some(self.episode.id.clone()),
            require_recorders: 1,
            forced: self.setup.plan.variation.forced(self.drawn()),
            profile_seed: self.profile_seed(),
            ..OperateOptions::default()
        };
        let connect = server.connect().clone();
        let path = self.staging.join(OPERATOR_LOG);
        let mut log = Log::create(&path).with_context(|| format!("making {}", path.display()))?;
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
            Some(death) if rig.server.was_killed() => Err(over(Outcome::Killed(death))),
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
}

/// The operator at work, which writes down how it goes.
fn work_at(
    connect: &Connect,
    options: &OperateOptions,
    log: &mut Log,
) -> Result<Report, OperateError> {
    let link = Link::open(connect)?;
    let report = operate::run(&link, options, &mut |progress| log.follow(progress));
    log.end(&report);
    // The server may be gone already.
    let _ = link.close();
    report
}
