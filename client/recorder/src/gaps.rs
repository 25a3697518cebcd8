//! Gap recovery: selects the samples to request from the server's cache. The transport
//! recovers lost states, but gives up on samples that are lost during recovery, which
//! happens on a host that cannot keep up. It does not recover images at all.

use std::collections::BTreeMap;
use std::time::Instant;

use wheelarm_dataset::coverage::Coverage;
use wheelarm_proto::{StreamId, v1};

use super::cache_request::CacheRequest;
use super::compressed::Compressed;
use super::opening::Openings;

/// Missing samples of one stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// Stream name (`camera/NAME` for a camera).
    pub stream: String,
    /// First sequence number.
    pub first: u64,
    /// Last sequence number; `None`: every later sample.
    pub last: Option<u64>,
}

impl Missing {
    /// Every sample of a stream from `first` on.
    pub(super) fn behind(stream: String, first: u64) -> Self {
        Self {
            stream,
            first,
            last: None,
        }
    }
}

/// Attempts to request the compressed image before the exact one: the exact image takes
/// five times as long on a slow line, which may be the only cause.
const COMPRESSED_TRIES: u32 = 2;

/// Requests for missing samples.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    /// By stream and last number of the gap.
    requests: BTreeMap<String, BTreeMap<u64, CacheRequest>>,
}

impl Gaps {
    /// Whether the gap that ends with `last` is given up.
    pub(super) fn gave_up(&self, stream: &str, last: u64) -> bool {
        let request = self.requests.get(stream).and_then(|gaps| gaps.get(&last));
        request.is_some_and(CacheRequest::is_given_up)
    }

    /// The request for the gap of `stream` that ends with `last` was answered.
    pub(super) fn answered(&mut self, stream: &str, last: u64, now: Instant) {
        let request = self
            .requests
            .get_mut(stream)
            .and_then(|gaps| gaps.get_mut(&last));
        if let Some(request) = request {
            request.answered(now);
        }
    }

    /// The connection was lost.
    pub(super) fn restart(&mut self) {
        let all = self.requests.values_mut().flat_map(BTreeMap::values_mut);
        all.for_each(CacheRequest::restart);
    }

    /// Samples to request at `now`: gaps between received samples and before the first
    /// images, and with the manifest those at both ends. A lost image of a `compressed`
    /// camera is requested in compressed form first and as exact image later; one without
    /// a compressed form as exact image at once.
    pub(super) fn wanted(
        &mut self,
        received: &BTreeMap<String, Coverage>,
        openings: &Openings,
        compressed: &mut BTreeMap<String, Compressed>,
        stopped: Option<&v1::EpisodeStopped>,
        now: Instant,
    ) -> Vec<Missing> {
        let mut wanted = Vec::new();
        let mut look = |stream: &str, coverage: &Coverage, first, last| {
            let missing = coverage.missing(first, last);
            if missing.is_empty() {
                return;
            }
            let requests = self.requests.entry(stream.to_owned()).or_default();
            let by_compressed = compressed.get(stream);
            // The exact images of the others are requested below.
            let usable = |(first, last)| match by_compressed {
                Some(by_compressed) => by_compressed.usable(first, last),
                None => vec![(first, last)],
            };
            for (first, last) in missing.into_iter().flat_map(usable) {
                let request = requests.entry(last).or_default();
                if !request.start_if_due(now) {
                    continue;
                }
                let has_compressed_form = by_compressed.is_some();
                let stream = match StreamId::parse(stream).camera_name() {
                    Some(camera) if has_compressed_form && request.tries() <= COMPRESSED_TRIES => {
                        StreamId::compressed(camera).to_string()
                    }
                    _ => stream.to_owned(),
                };
                wanted.push(Missing {
                    stream,
                    first,
                    last: Some(last),
                });
            }
        };
        match stopped {
            Some(stopped) => {
                let none = Coverage::default();
                for count in stopped.manifest.iter().filter(|c| c.count > 0) {
                    let coverage = received.get(&count.stream).unwrap_or(&none);
                    look(&count.stream, coverage, count.first, count.last);
                }
            }
            None => {
                for (stream, coverage) in received {
                    if let Some((first, last)) = coverage.span() {
                        look(stream, coverage, openings.first(stream, first), last);
                    }
                }
            }
        }
        for (camera, compressed) in compressed {
            let due = compressed.due(now).into_iter();
            wanted.extend(due.map(|(first, last)| Missing {
                stream: camera.clone(),
                first,
                last: Some(last),
            }));
        }
        wanted
    }
}

#[cfg(test)]
mod tests {
    use super::super::cache_request::{PAUSE, TRIES};
    use super::*;

    fn missing(stream: &str, first: u64, last: u64) -> Missing {
        Missing {
            stream: stream.into(),
            first,
            last: Some(last),
        }
    }

    #[test]
    fn gaps_are_requested_a_few_times_and_the_ends_once_the_manifest_is_known() {
        let start = Instant::now();
        let mut coverage = Coverage::default();
        for sequence in [4, 5, 8, 9, 11] {
            coverage.insert(sequence);
        }
        let mut received = BTreeMap::from([("imu".to_owned(), coverage)]);
        let (mut gaps, mut none) = (Gaps::default(), BTreeMap::new());
        let begun = Openings::default();
        let first = [missing("imu", 6, 7), missing("imu", 10, 10)];
        assert_eq!(
            gaps.wanted(&received, &begun, &mut none, None, start),
            first
        );
        assert_eq!(
            gaps.wanted(&received, &begun, &mut none, None, start + PAUSE),
            []
        );
        gaps.answered("imu", 7, start);
        gaps.answered("imu", 10, start);
        assert_eq!(
            gaps.wanted(&received, &begun, &mut none, None, start + PAUSE / 2),
            []
        );
        received.get_mut("imu").unwrap().insert(10);
        let again = gaps.wanted(&received, &begun, &mut none, None, start + PAUSE);
        assert_eq!(again, [missing("imu", 6, 7)]);
        gaps.answered("imu", 7, start + PAUSE);
        let count = |stream: &str, first, last| v1::StreamCount {
            stream: stream.into(),
            first,
            last,
            count: last - first + 1,
            ..Default::default()
        };
        let stopped = v1::EpisodeStopped {
            manifest: vec![count("imu", 3, 12), count("clock", 0, 1)],
            ..Default::default()
        };
        let ends = gaps.wanted(&received, &begun, &mut none, Some(&stopped), start + PAUSE);
        let expected = [
            missing("imu", 3, 3),
            missing("imu", 12, 12),
            missing("clock", 0, 1),
        ];
        assert_eq!(ends, expected);
        let mut requests = ends;
        for second in 2..60 {
            let now = start + second * PAUSE;
            requests.extend(gaps.wanted(&received, &begun, &mut none, Some(&stopped), now));
            for missing in &requests {
                gaps.answered(&missing.stream, missing.last.unwrap(), now);
            }
        }
        let times = |of: &Missing| requests.iter().filter(|missing| *missing == of).count();
        for missing in &expected {
            assert_eq!(times(missing), TRIES as usize, "{missing:?}");
            assert!(gaps.gave_up(&missing.stream, missing.last.unwrap()));
        }
    }
}
