//! Pictures that were lost before the first that came of an episode. Numbers go on from
//! one episode to the next, so that nothing but the time tells that they lack: a camera
//! draws at its rate from the first tick of an episode on, and skips nothing.

use std::collections::BTreeMap;

use wheelarm_dataset::columns::header_of;
use wheelarm_proto::limits::CREDIT_IMAGES;
use wheelarm_proto::{PHYSICS_HZ, StreamId, v1};

/// Numbers with which the cameras' streams should have begun, by stream.
#[derive(Debug, Default)]
pub(super) struct Openings(BTreeMap<String, u64>);

impl Openings {
    /// Takes account of the first picture that came of the camera of `stream`, number
    /// `sequence`.
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

    /// Number of the first picture of `stream`, of which `first` is the first that came.
    pub fn first(&self, stream: &str, first: u64) -> u64 {
        self.0.get(stream).map_or(first, |begun| first.min(*begun))
    }

    /// The picture `sequence` of `stream` is of an earlier episode, whatever the time
    /// tells.
    pub fn is_older(&mut self, stream: &str, sequence: u64) {
        let stream = StreamId::parse(stream).exact().to_string();
        if let Some(begun) = self.0.get_mut(&stream) {
            *begun = (*begun).max(sequence.saturating_add(1));
        }
    }
}

/// How many pictures the camera of `stream` drew in the episode before that of
/// `payload`; `None` where the time does not tell, as where recorded states are shown.
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
