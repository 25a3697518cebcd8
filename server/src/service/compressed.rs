//! Compresses images once for all recorders. One thread per camera takes its exact
//! images in order and publishes them as `CompressedCameraFrame`. The planes are
//! included where a recorder receives them, or did so earlier in this episode.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;

use bytes::Bytes;
use parking_lot::Mutex;
use wheelarm_codec::Deflate;
use wheelarm_codec::depth::to_millimetres;
use wheelarm_proto::digest::Digest;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;

use super::error::ServiceError;
use super::outbox::{Outbox, Published};
use super::priority::step_back;
use super::wakeup::Wakeup;
use crate::sensors::camera::Deflated;

/// Images of a camera that may wait; more block the render thread.
const QUEUE: usize = 2;

/// Bytes per element of each plane, for HDF5's shuffle filter.
const RGB: usize = 1;
const METRES: usize = 4;
const MILLIMETRES: usize = 2;
const IDS: usize = 2;

/// An image published in its exact form.
pub struct Exact {
    /// Its message, without a header.
    pub frame: v1::CameraFrame,
    /// Planes that the GPU already compressed, depth in the requested form.
    pub deflated: Deflated,
    /// Number and digest of its message.
    pub published: Published,
    /// Sequence number and digest of its message.
    pub episode: u64,
    /// Its tick.
    pub tick: u64,
}

/// Handle of the threads; they end with it.
pub struct Compressed {
    cameras: Vec<Camera>,
    failed: Arc<Mutex<Option<String>>>,
}

struct Camera {
    jobs: SyncSender<Exact>,
    waiting: Arc<AtomicUsize>,
    thread: JoinHandle<()>,
}

impl Camera {
    /// Whether all its images are published, or never will be.
    fn is_idle(&self) -> bool {
        self.waiting.load(Ordering::Acquire) == 0 || self.thread.is_finished()
    }
}

impl Compressed {
    /// Starts a thread per camera, names in the scenario's order. `depth` is the form
    /// of compressed depth.
    ///
    /// # Errors
    /// When a thread cannot start.
    pub fn start(
        names: &[String],
        depth: Depth,
        outbox: &Arc<Outbox>,
        wakeup: &Arc<Wakeup>,
    ) -> Result<Self, ServiceError> {
        let failed = Arc::new(Mutex::new(None));
        let mut cameras = Vec::new();
        for name in names {
            let (jobs, queue) = mpsc::sync_channel(QUEUE);
            let (name, outbox) = (name.clone(), Arc::clone(outbox));
            let waiting = Arc::new(AtomicUsize::new(0));
            let (left, wakeup, failure) = (
                Arc::clone(&waiting),
                Arc::clone(wakeup),
                Arc::clone(&failed),
            );
            let thread = std::thread::Builder::new()
                .name("compress".to_owned())
                .spawn(move || {
                    step_back();
                    let work = std::panic::AssertUnwindSafe(|| {
                        publish(&name, depth, &queue, &outbox, || {
                            left.fetch_sub(1, Ordering::AcqRel);
                            wakeup.raise();
                        });
                    });
                    if std::panic::catch_unwind(work).is_err() {
                        let words = "compressing an image panicked; please report it";
                        *failure.lock() = Some(words.to_owned());
                        wakeup.raise();
                    }
                });
            let problem = |e| ServiceError::Thread(format!("for compression cannot start: {e}"));
            cameras.push(Camera {
                jobs,
                waiting,
                thread: thread.map_err(problem)?,
            });
        }
        Ok(Self { cameras, failed })
    }

    /// Queues the next image of a camera, by its index in the scenario. Blocks while
    /// the queue is full.
    pub fn offer(&self, camera: usize, image: Exact) {
        if let Some(camera) = self.cameras.get(camera) {
            camera.waiting.fetch_add(1, Ordering::AcqRel);
            // A thread that ended early has stored its reason.
            let _ = camera.jobs.send(image);
        }
    }

    /// Why a thread ended early.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        self.failed.lock().clone()
    }

    /// Whether every queued image is published, or never will be.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.cameras.iter().all(Camera::is_idle)
    }
}

impl Drop for Compressed {
    fn drop(&mut self) {
        let cameras = std::mem::take(&mut self.cameras);
        let threads: Vec<_> = cameras.into_iter().map(|camera| camera.thread).collect();
        for thread in threads {
            let _ = thread.join();
        }
    }
}

/// Publishes the images of one camera until the queue is closed.
fn publish(
    name: &str,
    depth: Depth,
    queue: &Receiver<Exact>,
    outbox: &Outbox,
    published: impl Fn(),
) {
    let mut compressor = Compressor::new(depth);
    // A recorder that lost its connection in this episode returns and requests what it
    // missed.
    let mut wanted_in = 0;
    for image in queue {
        let (episode, tick) = (image.episode, image.tick);
        let Published { sequence, digest } = image.published;
        if outbox.wants_compressed(name) {
            wanted_in = episode;
        }
        let message = match digest {
            Some(digest) if wanted_in == episode => compressor.compress(image, &digest),
            _ => v1::CompressedCameraFrame::default(),
        };
        outbox.compressed(name, sequence, episode, tick, message);
        published();
    }
}

/// Compresses images.
struct Compressor {
    depth: Depth,
    deflate: Deflate,
    millimetres: Vec<u8>,
}

impl Compressor {
    fn new(depth: Depth) -> Self {
        Self {
            depth,
            deflate: Deflate::default(),
            millimetres: Vec::new(),
        }
    }

    /// The compressed form of an image, without its header.
    fn compress(
        &mut self,
        Exact {
            frame, deflated, ..
        }: Exact,
        digest: &Digest,
    ) -> v1::CompressedCameraFrame {
        let [rgb, depth, ids] = deflated;
        let depth = depth.unwrap_or_else(|| self.depth_of(&frame.depth));
        let mut plane = |bytes: &Bytes, element, deflated: Option<Bytes>| {
            deflated.unwrap_or_else(|| deflate(&mut self.deflate, bytes, element))
        };
        let depth_format = match self.depth {
            Depth::Millimetres => v1::PixelFormat::DepthMillimetresU16.into(),
            Depth::Metres | Depth::Nothing => frame.depth_format,
        };
        v1::CompressedCameraFrame {
            header: None,
            camera: frame.camera,
            intrinsics: frame.intrinsics,
            pose: frame.pose,
            color: plane(&frame.color, RGB, rgb),
            depth,
            segmentation: plane(&frame.segmentation, IDS, ids),
            color_format: frame.color_format,
            depth_format,
            segmentation_format: frame.segmentation_format,
            digest: digest.to_vec().into(),
        }
    }

    /// Converts metres to the stored form and deflates them.
    fn depth_of(&mut self, metres: &Bytes) -> Bytes {
        match self.depth {
            Depth::Metres => deflate(&mut self.deflate, metres, METRES),
            Depth::Millimetres => {
                to_millimetres(metres, &mut self.millimetres);
                deflate(&mut self.deflate, &self.millimetres, MILLIMETRES)
            }
            Depth::Nothing => Bytes::new(),
        }
    }
}

/// A plane deflated.
fn deflate(deflate: &mut Deflate, bytes: &[u8], element: usize) -> Bytes {
    // Estimate: depth shrinks to a fifth or more, the rest to less.
    let mut out = Vec::with_capacity(bytes.len() / 4);
    deflate.append(bytes, element, &mut out);
    Bytes::from(out)
}

#[cfg(test)]
mod tests {
    use wheelarm_codec::inflate;

    use super::*;

    fn plane(byte: u8, bytes: usize) -> Bytes {
        Bytes::from(vec![byte; bytes])
    }

    fn frame() -> v1::CameraFrame {
        let metres = (0..100).flat_map(|i| (0.25 * i as f32).to_le_bytes());
        v1::CameraFrame {
            camera: "gen3".into(),
            color: plane(1, 300),
            depth: metres.collect::<Vec<_>>().into(),
            segmentation: plane(3, 200),
            depth_format: v1::PixelFormat::DepthMetresF32.into(),
            ..v1::CameraFrame::default()
        }
    }

    fn compressed(depth: Depth, deflated: Deflated) -> v1::CompressedCameraFrame {
        let image = Exact {
            frame: frame(),
            deflated,
            published: Published::default(),
            episode: 1,
            tick: 8,
        };
        Compressor::new(depth).compress(image, &[7; 32])
    }

    #[test]
    fn planes_compressed_by_the_gpu_are_used_and_others_are_compressed_here() {
        let by_adapter = [Some(Bytes::from_static(b"by the adapter")), None, None];
        let message = compressed(Depth::Metres, by_adapter);
        assert_eq!(&message.color[..], b"by the adapter");
        let exact = frame();
        for (stream, exact, element) in [
            (&message.depth, &exact.depth, METRES),
            (&message.segmentation, &exact.segmentation, IDS),
        ] {
            let again = inflate(stream, element, exact.len());
            assert_eq!(again.ok().as_deref(), Some(&exact[..]));
        }
        assert_eq!(
            (&message.camera[..], &message.digest[..]),
            ("gen3", &[7; 32][..])
        );
        assert_eq!(message.depth_format(), v1::PixelFormat::DepthMetresF32);
    }

    #[test]
    fn depth_is_compressed_in_its_stored_form() {
        let message = compressed(Depth::Millimetres, Deflated::default());
        let format = v1::PixelFormat::DepthMillimetresU16;
        assert_eq!(message.depth_format(), format);
        let again = inflate(&message.depth, MILLIMETRES, 200).unwrap();
        let expected: Vec<u8> = (0..100)
            .flat_map(|i| (250 * i as u16).to_le_bytes())
            .collect();
        assert_eq!(again, expected);
        let none = compressed(Depth::Nothing, Deflated::default());
        assert!(none.depth.is_empty() && !none.segmentation.is_empty());
    }
}
