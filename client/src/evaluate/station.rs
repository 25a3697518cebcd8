//! Where one episode of an evaluation is done after another: in one process, or by a
//! server with clients.

use super::args::EvaluateArgs;
use super::entry::{Entry, Job};
use super::one_process::OneProcess;
use super::worker::Worker;
use crate::policy::Driver;
use crate::way::Way;

/// A place for one episode at a time.
pub enum Station {
    /// Server, recorder and scripted operator in one process.
    Process(Box<OneProcess>),
    /// Each in its own.
    Socket(Box<Worker>),
}

impl Station {
    /// Starts it; the first scenario comes with the first episode.
    ///
    /// # Errors
    /// When a program does not start.
    pub fn start(args: &EvaluateArgs, driver: &Driver, index: usize) -> anyhow::Result<Self> {
        match (args.worker, driver) {
            // What is kept of failures alone is told apart there.
            (Way::Process, Driver::Operator) if args.redraw_failures.is_none() => {
                let process = OneProcess::start(args, index)?;
                Ok(Self::Process(Box::new(process)))
            }
            // A policy is asked from this process.
            _ => {
                let worker = Worker::start(args, driver, index)?;
                Ok(Self::Socket(Box::new(worker)))
            }
        }
    }

    /// Does one episode, and whether the station can do another. What breaks in it is
    /// an [`Entry`] too.
    ///
    /// # Errors
    /// When something else than the server and the task fails: the recorder, the disk,
    /// a client.
    pub fn episode(&mut self, job: &Job) -> anyhow::Result<(Entry, bool)> {
        match self {
            Self::Process(process) => process.episode(job),
            Self::Socket(worker) => worker.episode(job),
        }
    }

    /// Ends it.
    ///
    /// # Errors
    /// When a server cannot be asked.
    pub fn stop(self) -> anyhow::Result<()> {
        match self {
            Self::Process(_) => Ok(()),
            Self::Socket(worker) => worker.stop(),
        }
    }
}
