//! Who watches an episode beside whoever does it: a thread that hears the server's
//! streams until it is asked what it saw.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context;
use wheelarm_link::Link;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use super::progress::{Follower, STREAMS};

/// For what has been published to arrive.
const LATE: Duration = Duration::from_millis(5);

/// Watches until it is asked.
pub struct Witness {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<Seen>>,
}

/// What it saw.
pub struct Seen {
    /// How far it came.
    pub follower: Follower,
    /// Hash of the newest state, hexadecimal; empty where none came.
    pub hash: String,
}

impl Witness {
    /// Watches the episode of the task in force that begins next.
    ///
    /// # Errors
    /// When the server's scene is not as the contract says, or the link fails.
    pub fn start(link: &Link) -> anyhow::Result<Self> {
        let mut follower = Follower::new(&link.ask(&v1::SceneRequest {})?)?;
        let topics = [&STREAMS[..], &[TopicId::StateHash]].concat();
        let streams = link.streams(&topics)?;
        let over = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&over);
        let watch = move || {
            let mut hash = String::new();
            loop {
                let last = is_over.load(Ordering::Acquire);
                match streams.next(LATE) {
                    Ok(Some(Sample::StateHash(sample))) => hash = format!("{:016x}", sample.hash),
                    Ok(Some(sample)) => follower.take(&sample),
                    Ok(None) if last => break,
                    Ok(None) => {}
                    // Whoever does the episode says what is the matter.
                    Err(_) => break,
                }
            }
            Seen { follower, hash }
        };
        let thread = std::thread::Builder::new().name("witness".to_owned());
        Ok(Self {
            over,
            thread: Some(thread.spawn(watch).context("starting a thread")?),
        })
    }

    /// What it saw, once everything has come.
    #[must_use]
    pub fn saw(mut self) -> Option<Seen> {
        self.over.store(true, Ordering::Release);
        self.thread.take().and_then(|thread| thread.join().ok())
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
    }
}
