//! Pictures that were lost before the first that came of an episode. Numbers go on from
//! one episode to the next, so that nothing but the time tells that they lack: a camera
//! draws at its rate from the beginning on, and skips nothing.

use std::collections::BTreeMap;

use bytes::Bytes;
use wheelarm_dataset::columns::header_of;
use wheelarm_proto::{Message, PHYSICS_HZ, StreamId, v1};

/// Where the streams of pictures should have begun.
#[derive(Debug, Default)]
pub(super) struct Openings(BTreeMap<String, u64>);

impl Openings {
    /// Takes account of the first picture that came of `stream`, number `sequence`.
    pub fn begin(
        &mut self,
        stream: &str,
        sequence: u64,
        payload: &Bytes,
        started: &v1::EpisodeStarted,
    ) {
        let before = earlier(stream, payload, started).unwrap_or(0);
        if before > 0 {
            self.0
                .insert(stream.to_owned(), sequence.saturating_sub(before));
        }
    }

    /// Number of the first picture of `stream`, of which `first` is the first that came.
    pub fn first(&self, stream: &str, first: u64) -> u64 {
        self.0.get(stream).map_or(first, |begun| first.min(*begun))
    }

    /// The picture `sequence` of `stream` is of an earlier episode: while nobody watches,
    /// nothing is drawn, and the time tells too many.
    pub fn is_older(&mut self, stream: &str, sequence: u64) {
        let stream = StreamId::parse(stream).exact().to_string();
        if let Some(begun) = self.0.get_mut(&stream) {
            *begun = (*begun).max(sequence + 1);
        }
    }
}

/// How many pictures the camera of `stream` drew in the episode before the one of
/// `payload`; `None` where nothing tells.
fn earlier(stream: &str, payload: &Bytes, started: &v1::EpisodeStarted) -> Option<u64> {
    let scenario = started.scenario.as_ref()?;
    let (camera, tick) = match StreamId::parse(stream) {
        StreamId::Camera(name) | StreamId::Compressed(name) => {
            (name, header_of(payload).ok()?.tick)
        }
        StreamId::Sensor(_) => {
            let frame = v1::SensorFrame::decode(payload.clone()).ok()?;
            (frame.camera, frame.exposure_tick)
        }
        StreamId::State(_) | StreamId::Other(_) => return None,
    };
    let setting = scenario.cameras.iter().find(|c| c.name == camera)?;
    let ticks = PHYSICS_HZ as f64 / setting.rate_hz.filter(|rate| *rate > 0.0)?;
    let begun = started.header.as_ref()?.tick as f64;
    let before = (tick as f64 / ticks).floor() - (begun / ticks).ceil();
    Some(before.max(0.0) as u64)
}
