//! Which samples to ask for again. The transport repairs losses of states by itself,
//! but gives up on what gets lost while it repairs: on a host that cannot keep up, that
//! is where samples would go missing. Pictures nobody else asks for. The server's cache
//! still has them.

use std::collections::BTreeMap;
use std::time::Instant;

use wheelarm_dataset::coverage::Coverage;
use wheelarm_proto::{StreamId, v1};

use super::compressed::Compressed;
use super::opening::Openings;
use super::question::Question;

/// Samples of one stream that did not come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// Stream name (`camera/NAME` for a camera).
    pub stream: String,
    /// First sequence number.
    pub first: u64,
    /// Last sequence number; `None`: whatever there is.
    pub last: Option<u64>,
}

impl Missing {
    /// Whatever of a stream there is from `first` on.
    pub(super) fn behind(stream: String, first: u64) -> Self {
        Self {
            stream,
            first,
            last: None,
        }
    }
}

/// So often a picture that is heard compressed is asked for so: as it is it takes five
/// times as long on a slow line, which may be all that is wrong.
const COMPRESSED_TRIES: u32 = 2;

/// What was asked for.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    /// By stream and last number of the gap.
    asked: BTreeMap<String, BTreeMap<u64, Question>>,
}

impl Gaps {
    /// Whether a gap that ends with `last` was asked for in vain.
    pub(super) fn gave_up(&self, stream: &str, last: u64) -> bool {
        let asked = self.asked.get(stream).and_then(|gaps| gaps.get(&last));
        asked.is_some_and(Question::is_given_up)
    }

    /// A question for a gap of `stream` that ends with `last` was answered.
    pub(super) fn answered(&mut self, stream: &str, last: u64, now: Instant) {
        let asked = self
            .asked
            .get_mut(stream)
            .and_then(|gaps| gaps.get_mut(&last));
        if let Some(question) = asked {
            question.answered(now);
        }
    }

    /// The connection was lost.
    pub(super) fn begin_again(&mut self) {
        let all = self.asked.values_mut().flat_map(BTreeMap::values_mut);
        all.for_each(Question::begin_again);
    }

    /// What to ask for at `now`: gaps between the samples that came and before the
    /// first pictures, and with the manifest those at both ends. A lost picture of a camera that is heard
    /// `compressed` is asked for so first, later as it is; one that has no compressed
    /// form at once as it is.
    pub(super) fn wanted(
        &mut self,
        seen: &BTreeMap<String, Coverage>,
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
            let asked = self.asked.entry(stream.to_owned()).or_default();
            let heard = compressed.get(stream);
            // The others are asked for as they are, below.
            let usable = |(first, last)| match heard {
                Some(heard) => heard.usable(first, last),
                None => vec![(first, last)],
            };
            for (first, last) in missing.into_iter().flat_map(usable) {
                let question = asked.entry(last).or_default();
                if !question.request(now) {
                    continue;
                }
                let is_heard = heard.is_some();
                let stream = match StreamId::parse(stream).camera_name() {
                    Some(camera) if is_heard && question.tries() <= COMPRESSED_TRIES => {
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
                    let coverage = seen.get(&count.stream).unwrap_or(&none);
                    look(&count.stream, coverage, count.first, count.last);
                }
            }
            None => {
                for (stream, coverage) in seen {
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
    use super::super::question::{PAUSE, TRIES};
    use super::*;

    fn missing(stream: &str, first: u64, last: u64) -> Missing {
        Missing {
            stream: stream.into(),
            first,
            last: Some(last),
        }
    }

    #[test]
    fn gaps_are_asked_for_a_few_times_and_the_ends_once_they_are_known() {
        let start = Instant::now();
        let mut coverage = Coverage::default();
        for sequence in [4, 5, 8, 9, 11] {
            coverage.insert(sequence);
        }
        let mut seen = BTreeMap::from([("imu".to_owned(), coverage)]);
        let (mut gaps, mut none) = (Gaps::default(), BTreeMap::new());
        let begun = Openings::default();
        let first = [missing("imu", 6, 7), missing("imu", 10, 10)];
        assert_eq!(gaps.wanted(&seen, &begun, &mut none, None, start), first);
        assert_eq!(
            gaps.wanted(&seen, &begun, &mut none, None, start + PAUSE),
            []
        );
        gaps.answered("imu", 7, start);
        gaps.answered("imu", 10, start);
        assert_eq!(
            gaps.wanted(&seen, &begun, &mut none, None, start + PAUSE / 2),
            []
        );
        seen.get_mut("imu").unwrap().insert(10);
        let again = gaps.wanted(&seen, &begun, &mut none, None, start + PAUSE);
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
        let ends = gaps.wanted(&seen, &begun, &mut none, Some(&stopped), start + PAUSE);
        let expected = [
            missing("imu", 3, 3),
            missing("imu", 12, 12),
            missing("clock", 0, 1),
        ];
        assert_eq!(ends, expected);
        let mut asked = ends;
        for second in 2..60 {
            let now = start + second * PAUSE;
            asked.extend(gaps.wanted(&seen, &begun, &mut none, Some(&stopped), now));
            for missing in &asked {
                gaps.answered(&missing.stream, missing.last.unwrap(), now);
            }
        }
        let times = |of: &Missing| asked.iter().filter(|missing| *missing == of).count();
        for missing in &expected {
            assert_eq!(times(missing), TRIES as usize, "{missing:?}");
            assert!(gaps.gave_up(&missing.stream, missing.last.unwrap()));
        }
    }
}
