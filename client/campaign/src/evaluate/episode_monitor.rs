//! Monitors the streams of an episode to measure its progress.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context;
use parking_lot::Mutex;
use wheelarm_expert::run::Progress;
use wheelarm_proto::v1;
use wheelarm_rollout::Observer;
use wheelarm_sdk::Client;

use super::milestone::Course;
use super::progress::{Follower, STREAMS};

/// Wait for samples that were published and have not arrived.
const LATE: Duration = Duration::from_millis(5);

/// Monitors one episode of a server outside of this process.
#[derive(Default)]
pub struct EpisodeMonitor {
    is_over: Arc<AtomicBool>,
    thread: Mutex<Option<JoinHandle<Follower>>>,
    seconds: Mutex<f64>,
}

impl EpisodeMonitor {
    /// Progress of the episode; absent when it was not monitored.
    #[must_use]
    pub fn course(&self, success: bool, seconds: f64) -> Option<Course> {
        self.is_over.store(true, Ordering::Release);
        let follower = self.thread.lock().take()?.join().ok()?;
        Some(follower.course(success, seconds))
    }

    /// Simulated seconds so far.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        *self.seconds.lock()
    }
}

impl Observer for EpisodeMonitor {
    fn attach(&self, client: &Client) -> anyhow::Result<()> {
        let mut follower = Follower::new(&client.request(&v1::SceneRequest {})?)?;
        let streams = client.streams(&STREAMS)?;
        let is_over = Arc::clone(&self.is_over);
        let watch = move || {
            loop {
                let is_last = is_over.load(Ordering::Acquire);
                match streams.next(LATE) {
                    Ok(Some(sample)) => follower.add(&sample),
                    Ok(None) if is_last => break,
                    Ok(None) => {}
                    // The driver reports a lost connection.
                    Err(_) => break,
                }
            }
            follower
        };
        let thread = std::thread::Builder::new().name("monitor".to_owned());
        *self.thread.lock() = Some(thread.spawn(watch).context("starting a thread")?);
        Ok(())
    }

    fn progress(&self, progress: &Progress<'_>) {
        *self.seconds.lock() = progress.time;
    }

    fn detach(&self) {
        self.is_over.store(true, Ordering::Release);
    }
}

impl Drop for EpisodeMonitor {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
    }
}
