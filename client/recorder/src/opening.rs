//! Finds images that were lost before the first received image of an episode. Sequence
//! numbers continue across episodes, so only the time shows the loss: a camera renders at
//! its rate from the first tick of an episode and skips no image.

use std::collections::BTreeMap;

use wheelarm_dataset::columns::header_of;
use wheelarm_proto::limits::CREDIT_IMAGES;
use wheelarm_proto::{PHYSICS_HZ, StreamId, v1};

/// Expected first sequence number of each camera stream.
#[derive(Debug, Default)]
pub(super) struct Openings(BTreeMap<String, u64>);

impl Openings {
    /// Registers `sequence`, the first received image of the camera `stream`.
    pub fn begin(
        &mut self,
        stream: &StreamId,
        sequence: u64,
        payload: &[u8],
        started: &v1::EpisodeStarted,
    ) {
        let before = earlier(stream, payload, started).unwrap_or(0);
        if (1..CREDIT_IMAGES).contains(&before) {
            let begun = sequence.saturating_sub(before);
            self.0.entry(stream.to_string()).or_insert(begun);
        }
    }

    /// Sequence number of the first image of `stream`; `first` is the first received one.
    pub fn first(&self, stream: &str, first: u64) -> u64 {
        self.0.get(stream).map_or(first, |begun| first.min(*begun))
    }

    /// The image `sequence` of `stream` belongs to an earlier episode, even where the
    /// time suggests otherwise.
    pub fn is_older(&mut self, stream: &str, sequence: u64) {
        let stream = StreamId::parse(stream).exact().to_string();
        if let Some(begun) = self.0.get_mut(&stream) {
            *begun = (*begun).max(sequence.saturating_add(1));
        }
    }
}

/// Number of images that the camera of `stream` rendered in this episode before that of
/// `payload`; `None` where the time does not show it, as in a playback.
fn earlier(stream: &StreamId, payload: &[u8], started: &v1::EpisodeStarted) -> Option<u64> {
    let camera = stream.camera_name()?;
    let cameras = &started.scenario.as_ref()?.cameras;
    let rate = cameras.iter().find(|c| c.name == camera)?.rate_hz;
    let ticks = PHYSICS_HZ as f64 / rate.filter(|rate| *rate > 0.0)?;
    let begun = started.header.as_ref()?.tick as f64;
    let tick = header_of(payload).ok()?.tick as f64;
    let before = (tick / ticks).floor() - (begun / ticks).ceil();
    (!started.as_recorded).then_some(before.max(0.0) as u64)
}
