//! Pictures compressed once for all who record: each camera has a thread that
//! takes its exact pictures in their order and publishes them as
//! `CompressedCameraFrame`, with planes where a recorder listens and without where
//! none does.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;

use bytes::Bytes;
use wheelarm_compress::Deflate;
use wheelarm_proto::digest::Digest;
use wheelarm_proto::v1;

use super::error::ServiceError;
use super::outbox::Outbox;
use super::priority::step_back;
use super::signal::Signal;

/// Pictures of a camera that may wait; more hold the cameras up.
const QUEUE: usize = 2;

/// Bytes of the elements of each plane, by which HDF5's shuffle takes them apart.
const RGB: usize = 1;
const DEPTH: usize = 4;
const IDS: usize = 2;

/// A picture that was published as it is.
pub struct Exact {
    /// Its message, without a header.
    pub frame: v1::CameraFrame,
    /// Digest of its message; none outside of episodes.
    pub digest: Option<Digest>,
    /// Its episode, 0 for none.
    pub episode: u64,
    /// Its tick.
    pub tick: u64,
}

/// Handle of the threads; they end with it.
pub struct Compressed {
    cameras: Vec<(SyncSender<Exact>, JoinHandle<()>)>,
    waiting: Arc<AtomicUsize>,
}

impl Compressed {
    /// Starts a thread for each camera, names in the scenario's order.
    ///
    /// # Errors
    /// When a thread cannot start.
    pub fn start(
        names: &[String],
        outbox: &Arc<Outbox>,
        signal: &Arc<Signal>,
    ) -> Result<Self, ServiceError> {
        let waiting = Arc::new(AtomicUsize::new(0));
        let mut cameras = Vec::new();
        for name in names {
            let (jobs, queue) = mpsc::sync_channel(QUEUE);
            let (name, outbox) = (name.clone(), Arc::clone(outbox));
            let (waiting, signal) = (Arc::clone(&waiting), Arc::clone(signal));
            let thread = std::thread::Builder::new()
                .name("compress".to_owned())
                .spawn(move || {
                    step_back();
                    publish(&name, &queue, &outbox, || {
                        waiting.fetch_sub(1, Ordering::AcqRel);
                        signal.raise();
                    });
                });
            let failed = |e| ServiceError::Thread(format!("for compression cannot start: {e}"));
            cameras.push((jobs, thread.map_err(failed)?));
        }
        Ok(Self { cameras, waiting })
    }

    /// Hands over the next picture of a camera, by its index in the scenario; waits
    /// while others wait.
    pub fn offer(&self, camera: usize, picture: Exact) {
        let Some((jobs, _)) = self.cameras.get(camera) else {
            return;
        };
        self.waiting.fetch_add(1, Ordering::AcqRel);
        if jobs.send(picture).is_err() {
            self.waiting.fetch_sub(1, Ordering::AcqRel);
        }
    }

    /// Whether every picture that was handed over is published, or never will be.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        let ended = |(_, thread): &(_, JoinHandle<()>)| thread.is_finished();
        self.waiting.load(Ordering::Acquire) == 0 || self.cameras.iter().any(ended)
    }
}

impl Drop for Compressed {
    fn drop(&mut self) {
        for (jobs, thread) in std::mem::take(&mut self.cameras) {
            drop(jobs);
            let _ = thread.join();
        }
    }
}

/// Publishes the pictures of one camera until the queue is closed.
fn publish(name: &str, queue: &Receiver<Exact>, outbox: &Outbox, published: impl Fn()) {
    let mut deflate = Deflate::default();
    for picture in queue {
        let (episode, tick) = (picture.episode, picture.tick);
        let message = match picture.digest {
            Some(digest) if outbox.wants_compressed(name) => {
                compress(&mut deflate, &picture.frame, &digest)
            }
            _ => v1::CompressedCameraFrame::default(),
        };
        outbox.compressed(name, episode, tick, message);
        published();
    }
}

/// The compressed form of a picture, without its header.
fn compress(
    deflate: &mut Deflate,
    frame: &v1::CameraFrame,
    digest: &Digest,
) -> v1::CompressedCameraFrame {
    let mut plane = |bytes: &Bytes, element: usize| {
        // A guess: depth shrinks to a fifth and more, the rest to less.
        let mut out = Vec::with_capacity(bytes.len() / 4);
        deflate.append(bytes, element, &mut out);
        Bytes::from(out)
    };
    v1::CompressedCameraFrame {
        header: None,
        camera: frame.camera.clone(),
        intrinsics: frame.intrinsics,
        pose: frame.pose,
        rgb: plane(&frame.rgb, RGB),
        depth: plane(&frame.depth, DEPTH),
        ids: plane(&frame.ids, IDS),
        rgb_format: frame.rgb_format,
        depth_format: frame.depth_format,
        ids_format: frame.ids_format,
        digest: digest.to_vec().into(),
    }
}
