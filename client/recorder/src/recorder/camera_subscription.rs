//! Chooses the subscribed form of the cameras' images: compressed once by the server for
//! all recorders, or exact.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use wheelarm_proto::StreamId;

use super::super::episode::Recording;
use super::super::gaps::Missing;
use super::port::Output;

/// A camera without any image is probed after this time: the server's cache holds few
/// images.
pub const LOOK: Duration = Duration::from_millis(300);
/// Pause after a probe that returned images; after one without images the pause doubles.
const AGAIN: Duration = Duration::from_millis(100);
/// Longest pause.
pub const LONGEST: Duration = Duration::from_secs(5);
/// After this time with exact and without compressed images, the camera counts as not
/// available in compressed form. Shorter times are a temporarily slow server.
pub const PATIENCE: Duration = Duration::from_secs(2);
/// The same in lock-step, where a compressed image may be in flight on a slow line.
const LOCK_STEP_PATIENCE: Duration = Duration::from_secs(10);

/// The preferred and the current form of the images.
#[derive(Debug, Default)]
pub struct CameraSubscription {
    /// Compressed images are preferred.
    prefers_compressed: bool,
    /// Compressed images are subscribed now.
    is_compressed: bool,
    /// Cameras without a compressed image in this episode, by stream.
    silent: BTreeMap<String, Silence>,
}

/// A camera without compressed images.
#[derive(Debug)]
struct Silence {
    /// Time of the last probe.
    looked: Instant,
    pause: Duration,
    /// First sequence number of that probe.
    first: u64,
    /// The probe is not answered yet.
    is_pending: bool,
    /// The compressed form was probed, or need not be.
    compressed_requested: bool,
    /// Time of the first exact image.
    exact: Option<Instant>,
}

/// Pause before the first probe. In lock-step the simulation waits and the cache drops
/// nothing, so an image in flight on a slow line may take its time. A request for the exact
/// image would occupy that line five times as long.
fn first_pause(recording: &Recording) -> Duration {
    match recording.is_lock_step() {
        true => LONGEST,
        false => LOOK,
    }
}

impl CameraSubscription {
    /// Starts with compressed or exact images.
    #[must_use]
    pub fn new(compressed: bool) -> Self {
        Self {
            prefers_compressed: compressed,
            is_compressed: compressed,
            silent: BTreeMap::new(),
        }
    }

    /// An episode begins whose server offers compressed images or not. Returns the new
    /// subscription where it changes.
    pub fn begin(&mut self, offered: bool) -> Option<Output> {
        self.change(self.prefers_compressed && offered)
    }

    fn change(&mut self, compressed: bool) -> Option<Output> {
        self.silent.clear();
        let changes = self.is_compressed != compressed;
        self.is_compressed = compressed;
        changes.then_some(Output::SubscribeCameras { compressed })
    }

    /// Requests the newest exact images of cameras without compressed ones. Where only
    /// exact images arrive (for example, a router drops the compressed ones), the recorder
    /// subscribes to exact images from then on.
    pub fn probe(&mut self, recording: &Recording, now: Instant) -> Vec<Output> {
        // Nothing is published yet: the server may wait for other recorders.
        if !self.is_compressed || recording.away.is_some() || !recording.is_under_way() {
            self.silent.clear();
            return Vec::new();
        }
        let still: Vec<String> = recording.silent().collect();
        self.silent.retain(|stream, _| still.contains(stream));
        let mut out = Vec::new();
        for stream in still {
            let next = recording.next(&stream);
            let silence = self.silent.entry(stream.clone()).or_insert(Silence {
                looked: now,
                pause: first_pause(recording),
                first: 0,
                is_pending: false,
                compressed_requested: !recording.is_lock_step(),
                exact: None,
            });
            if next.is_some() {
                let since = *silence.exact.get_or_insert(now);
                let patience = match recording.is_lock_step() {
                    true => LOCK_STEP_PATIENCE,
                    false => PATIENCE,
                };
                if now.saturating_duration_since(since) >= patience {
                    tracing::warn!("no compressed images arrive; recording exact images instead");
                    self.prefers_compressed = false;
                    return self.change(false).into_iter().collect();
                }
            }
            let first = next.unwrap_or(0);
            if first > silence.first {
                silence.pause = AGAIN;
            }
            let rests = now.saturating_duration_since(silence.looked) < silence.pause;
            if silence.is_pending || rests {
                continue;
            }
            let compressed = StreamId::parse(&stream)
                .camera_name()
                .map(StreamId::compressed);
            let stream = match compressed.filter(|_| !silence.compressed_requested) {
                Some(compressed) => compressed.to_string(),
                None => stream,
            };
            *silence = Silence {
                looked: now,
                pause: (2 * silence.pause).min(LONGEST),
                first,
                is_pending: true,
                compressed_requested: true,
                exact: silence.exact,
            };
            out.push(Output::RequestSamples {
                missing: Missing::behind(stream, first),
                patience: recording.patience(),
            });
        }
        out
    }

    /// Whether compressed images are subscribed.
    #[must_use]
    pub fn is_compressed(&self) -> bool {
        self.is_compressed
    }

    /// A request was answered; returns whether it was a probe of this type.
    pub fn answered(&mut self, missing: &Missing, now: Instant) -> bool {
        let stream = StreamId::parse(&missing.stream).exact().to_string();
        let silence = self.silent.get_mut(&stream);
        let Some(silence) = silence.filter(|s| s.is_pending && missing.last.is_none()) else {
            return false;
        };
        (silence.is_pending, silence.looked) = (false, now);
        true
    }
}
