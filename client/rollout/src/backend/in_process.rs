//! Server, recorder and expert in one process: the program `wheelarm-worker`, which stays
//! from one episode to the next and passes images on without a copy.

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, anyhow};
use parking_lot::Mutex;

use super::Backend;
use super::watch::{Watch, is_reusable};
use super::worker::{RunningEpisode, Worker, WorkerOptions};
use crate::finished::Finished;
use crate::heartbeat::Heartbeat;
use crate::limits;
use crate::protocol::{EpisodeRequest, Event};
use crate::rollout::Rollout;

/// File for the last messages of the worker, in a rollout's folder.
const WORKER_LOG: &str = "worker.log";

/// Runs episodes of the expert in workers. A new worker follows one that died, failed or
/// has run its share of episodes. Episodes may overlap: while one finishes its file, the
/// next may simulate.
pub struct InProcess {
    options: WorkerOptions,
    worker: Mutex<Option<Arc<Worker>>>,
}

impl InProcess {
    /// A worker with these options; it starts with the first episode.
    #[must_use]
    pub fn new(options: WorkerOptions) -> Self {
        Self {
            options,
            worker: Mutex::new(None),
        }
    }

    fn worker(&self) -> anyhow::Result<Arc<Worker>> {
        let mut worker = self.worker.lock();
        if let Some(worker) = &*worker
            && !worker.is_worn()
            && worker.process.lock().death()?.is_none()
        {
            return Ok(Arc::clone(worker));
        }
        Ok(Arc::clone(worker.insert(Worker::start(&self.options)?)))
    }
}

impl Backend for InProcess {
    fn attempt(&self, rollout: &Rollout, simulated: &mut dyn FnMut()) -> anyhow::Result<Finished> {
        let request = EpisodeRequest::for_rollout(rollout)
            .context("a worker runs the scripted expert only; use a server and clients")?;
        let worker = self.worker()?;
        let mut run = Run {
            watch: Watch {
                rollout,
                heartbeat: Heartbeat::new(rollout.limits.silence),
                verb: "sent",
            },
            episode: worker.begin(request)?,
            recorder: None,
        };
        let result = run.simulate().and_then(|finished| {
            simulated();
            run.finish()?;
            let messages = run.messages();
            Ok(Finished {
                messages,
                ..finished
            })
        });
        if let Some(folder) = &rollout.folder {
            // A disk that rejects the log rejects the recording too, which is reported.
            let _ = std::fs::write(folder.join(WORKER_LOG), run.messages());
        }
        if !is_reusable(&result) {
            let mut current = self.worker.lock();
            if current.as_ref().is_some_and(|w| Arc::ptr_eq(w, &worker)) {
                *current = None;
            }
        }
        result
    }

    fn rest(&self) {
        *self.worker.lock() = None;
    }
}

/// An episode in a worker.
struct Run<'a> {
    watch: Watch<'a>,
    episode: RunningEpisode,
    /// Exit code and words of the recorder.
    recorder: Option<(u8, String)>,
}

impl Run<'_> {
    /// Waits for the expert.
    fn simulate(&mut self) -> anyhow::Result<Finished> {
        loop {
            match self.next()? {
                Some(Event::Finished(finished)) => return Ok(*finished),
                Some(Event::Over) => return Err(self.host_failed("the expert did not finish")),
                _ => self.check_stall()?,
            }
        }
    }

    /// Waits for the file, and until everything of the episode has ended.
    fn finish(&mut self) -> anyhow::Result<()> {
        let begun = Instant::now();
        while self.next()? != Some(Event::Over) {
            if begun.elapsed() > limits::FINISH {
                return Err(self.host_failed(&format!(
                    "the recorder did not finish within {:.0} s",
                    limits::FINISH.as_secs_f64()
                )));
            }
        }
        Ok(())
    }

    /// The next event, within [`limits::LOOK`]. An error ends the episode: the worker
    /// failed or was lost, or the caller cancelled it.
    fn next(&mut self) -> anyhow::Result<Option<Event>> {
        let event = self.episode.next(limits::LOOK);
        match event {
            Some(Event::Status(status)) => {
                self.watch.heartbeat.status(&status, Instant::now());
                self.watch.rollout.observer.status(&status);
                Ok(None)
            }
            Some(Event::Failed { cause, reason }) => Err(self.watch.failed(cause, reason)),
            Some(Event::HostFailed(words)) => Err(self.host_failed(&words)),
            Some(Event::Recorded { code, words }) => {
                let problem = match (code, words.as_str()) {
                    (0, _) => None,
                    (_, "") => Some("the recording is not complete".to_owned()),
                    (_, words) => Some(format!("the recording failed: {words}")),
                };
                self.recorder = Some((code, words));
                problem.map_or(Ok(None), |problem| Err(self.host_failed(&problem)))
            }
            Some(event @ (Event::Finished(_) | Event::Over)) => Ok(Some(event)),
            None => {
                self.watch
                    .check(&mut self.episode.worker().process.lock())?;
                Ok(None)
            }
        }
    }

    /// Ends an episode whose simulated time does not advance.
    fn check_stall(&mut self) -> anyhow::Result<()> {
        let Some(words) = self.watch.stall() else {
            return Ok(());
        };
        self.episode.cancel();
        let has_ended = self.episode.is_over_within(2 * limits::END);
        Err(self.watch.stalled(words, has_ended))
    }

    fn host_failed(&self, words: &str) -> anyhow::Error {
        anyhow!("{words}\n{}", self.messages())
    }

    /// The last messages of the worker, and the words of its recorder.
    fn messages(&self) -> String {
        let recorder = self.recorder.as_ref();
        let recorder = recorder.map(|(code, words)| format!("  the recorder: {code} {words}\n"));
        self.episode.worker().process.lock().tail() + &recorder.unwrap_or_default()
    }
}
