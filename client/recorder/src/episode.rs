//! One episode: its writer and received samples while it is recorded, and the conversion
//! of its log into the file afterwards.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_dataset::coverage::Coverage;
use wheelarm_dataset::finish::{FinishError, finish};
use wheelarm_dataset::log::{Closing, Received, Recovered};
use wheelarm_dataset::writer::{EpisodeWriter, Taken, WriteError, WriterOptions};
use wheelarm_proto::topic::Rate;
use wheelarm_proto::{StreamId, TopicId, digest, v1};

use super::cache_request::{LOCK_STEP_PATIENCE, REAL_TIME_PATIENCE};
use super::compressed::{Compressed, CompressedImage};
use super::digests::Digests;
use super::gaps::{Gaps, Missing};
use super::latest::Latest;
use super::opening::Openings;

/// Result of one recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Label of the episode.
    pub label: String,
    /// The file.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// It holds every published sample.
    pub complete: bool,
    /// Reasons why it is not complete.
    pub problems: Vec<String>,
    /// Camera frames in it, of all cameras.
    pub frames: u64,
    /// Samples in it, frames included.
    pub samples: u64,
    /// Published samples that are not in it. Without the server's manifest, a lower bound:
    /// the gaps between received samples.
    pub missed: u64,
    /// The server's manifest lists how many samples it published.
    pub counted: bool,
    /// Notes for the user; the file is usable.
    pub notes: Vec<String>,
}

/// A stream of a fixed rate has ended after this time without a sample. The transport
/// holds a stream back for at most 10 s after a lost sample.
pub(super) const SILENCE: Duration = Duration::from_secs(12);

/// The newest sample of a stream of a fixed rate.
#[derive(Debug, Default)]
struct Newest {
    tick: u64,
    /// Tick at the last check, and the time since which it has not changed.
    looked: Option<(u64, Instant)>,
    is_silent: bool,
}

/// Progress up to which the recorder has every sample, for a lock-step server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Credit {
    /// Camera frames that were accepted or given up.
    pub frames: u64,
    /// Tick up to which every state stream of a fixed rate was received.
    pub tick: u64,
}

/// An episode that is being recorded.
pub(super) struct Recording {
    pub started: v1::EpisodeStarted,
    /// Folder for the file.
    dir: PathBuf,
    /// Camera frames accepted.
    pub accepted: u64,
    /// Newest sample accepted.
    pub newest: Option<Taken>,
    /// Time of the link loss; the server may return.
    pub away: Option<Instant>,
    writer: EpisodeWriter,
    received: BTreeMap<String, Coverage>,
    digests: BTreeMap<String, Digests>,
    /// By camera stream, for cameras whose images arrive compressed.
    compressed: BTreeMap<String, Compressed>,
    gaps: Gaps,
    openings: Openings,
    latest: Latest,
    /// Samples accepted.
    samples: u64,
    /// First tick of the episode.
    begun: u64,
    /// The newest samples of streams of a fixed rate, by stream.
    regular: BTreeMap<String, Newest>,
}

/// Outcome of an offered sample.
pub(super) enum Accepted {
    Frame,
    State,
    /// Already recorded, or rejected and therefore missing.
    Skipped,
}

impl Recording {
    pub fn open(
        dir: &Path,
        started: v1::EpisodeStarted,
        snapshot: &v1::SnapshotReply,
        options: &WriterOptions,
    ) -> Result<Self, WriteError> {
        let writer = EpisodeWriter::open(dir, &started, snapshot, options)?;
        let tick = started.header.as_ref().map_or(0, |header| header.tick);
        Ok(Self {
            started,
            dir: dir.to_owned(),
            accepted: 0,
            newest: None,
            away: None,
            writer,
            received: BTreeMap::new(),
            digests: BTreeMap::new(),
            compressed: BTreeMap::new(),
            gaps: Gaps::default(),
            openings: Openings::default(),
            latest: Latest::default(),
            samples: 0,
            begun: tick,
            regular: BTreeMap::new(),
        })
    }

    /// Records one sample of this episode.
    ///
    /// # Errors
    /// The reason why the log cannot be written.
    pub fn take(
        &mut self,
        stream: &str,
        sequence: u64,
        payload: Bytes,
    ) -> Result<Accepted, String> {
        let of_message = digest::of_message([&payload[..]]);
        let id = StreamId::parse(stream);
        let exact = id.clone().exact();
        if exact.is_camera() && !self.received.contains_key(&exact.to_string()) {
            self.openings
                .begin(&exact, sequence, &payload, &self.started);
        }
        let Some(camera) = id.of_compressed() else {
            let offer = |writer: &mut EpisodeWriter| writer.offer(stream, payload);
            return self.keep(stream, sequence, of_message, offer);
        };
        let camera = camera.to_string();
        let compressed = self.compressed.entry(camera.clone()).or_default();
        let Some(CompressedImage { frame, exact }) =
            compressed.take(sequence, payload, &of_message)
        else {
            return Ok(Accepted::Skipped);
        };
        let offer = |writer: &mut EpisodeWriter| writer.offer_compressed(&camera, *frame);
        let kept = self.keep(&camera, sequence, exact, offer)?;
        let there = |received: &Coverage| received.within(sequence, sequence) > 0;
        if !self.received.get(&camera).is_some_and(there) {
            self.compressed.entry(camera).or_default().refuse(sequence);
        }
        Ok(kept)
    }

    /// The sample `sequence` of a stream belongs to an earlier episode.
    pub fn is_older(&mut self, stream: &str, sequence: u64) {
        self.openings.is_older(stream, sequence);
    }

    /// Samples that were accepted.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Passes buffered samples to the log.
    pub fn flush(&mut self) {
        self.writer.flush();
    }

    /// Camera streams without any compressed image.
    pub fn silent(&self) -> impl Iterator<Item = String> {
        let cameras = self.started.cameras.iter();
        let streams = cameras.map(|camera| StreamId::camera(camera).to_string());
        streams.filter(|stream| !self.compressed.contains_key(stream))
    }

    /// Whether time has passed in the episode.
    pub fn is_under_way(&self) -> bool {
        self.accepted > 0 || self.received.contains_key(TopicId::Clock.name())
    }

    /// Whether the simulation waits for recorders.
    pub fn is_lock_step(&self) -> bool {
        let scenario = self.started.scenario.as_ref();
        scenario.is_some_and(|s| s.pacing() == v1::Pacing::LockStep)
    }

    /// Longest wait for the reply to a request for samples.
    pub fn patience(&self) -> Duration {
        match self.is_lock_step() {
            true => LOCK_STEP_PATIENCE,
            false => REAL_TIME_PATIENCE,
        }
    }

    /// Sequence number after the last received sample of a stream; `None` without any.
    pub fn next(&self, stream: &str) -> Option<u64> {
        let span = self.received.get(stream).and_then(Coverage::span);
        span.map(|(_, last)| last.saturating_add(1))
    }

    /// Writes a new sample by `offer`; `digest` is that of the exact message.
    fn keep(
        &mut self,
        stream: &str,
        sequence: u64,
        digest: digest::Digest,
        offer: impl FnOnce(&mut EpisodeWriter) -> Result<Taken, WriteError>,
    ) -> Result<Accepted, String> {
        let received = self.received.entry(stream.to_owned()).or_default();
        let digests = self.digests.entry(stream.to_owned()).or_default();
        // Recovery and history may deliver a sample twice.
        if received.within(sequence, sequence) > 0 {
            digests.repeated(sequence, &digest);
            return Ok(Accepted::Skipped);
        }
        if digests.is_late(sequence) {
            tracing::warn!(
                "sample {sequence} of {stream} arrives too late to be ordered and is skipped"
            );
            return Ok(Accepted::Skipped);
        }
        let taken = offer(&mut self.writer);
        match taken {
            Ok(taken) => {
                self.samples += 1;
                received.insert(sequence);
                digests.add(sequence, digest);
                if let Some(compressed) = self.compressed.get_mut(stream) {
                    compressed.has(sequence);
                }
                self.newest = Some(match self.newest {
                    Some(newest) if newest.tick > taken.tick => newest,
                    _ => taken,
                });
                let id = StreamId::parse(stream);
                if id.is_camera() {
                    self.accepted += 1;
                    return Ok(Accepted::Frame);
                }
                if let StreamId::State(topic) = id
                    && !matches!(topic.info().rate, Rate::Event | Rate::Second)
                {
                    let newest = self.regular.entry(stream.to_owned()).or_default();
                    newest.tick = newest.tick.max(taken.tick);
                    newest.is_silent = false;
                }
                Ok(Accepted::State)
            }
            Err(WriteError::Failed(words)) => Err(words),
            Err(problem) => {
                tracing::warn!("{problem}");
                Ok(Accepted::Skipped)
            }
        }
    }

    /// First and last sequence number of the episode in a stream, including images before
    /// the first received one; `None` without a sample.
    fn span(&self, stream: &str) -> Option<(u64, u64)> {
        let (first, last) = self.received.get(stream)?.span()?;
        Some((self.openings.first(stream, first), last))
    }

    /// Missing samples: gaps, images before the first received one, and given-up images
    /// outside of the received range.
    pub fn missed(&self) -> u64 {
        let lacks = |(stream, received): (&String, &Coverage)| {
            let (first, last) = self.span(stream)?;
            Some((last - first).saturating_add(1) - received.received())
        };
        let between: u64 = self.received.iter().filter_map(lacks).sum();
        between + self.given_up_beyond()
    }

    /// Given-up images outside of the received range.
    fn given_up_beyond(&self) -> u64 {
        let all = self.compressed.iter();
        let beyond = all.map(|(camera, compressed)| compressed.given_up(self.span(camera)));
        beyond.sum()
    }

    /// Progress up to which every sample is received or given up; `None` while a missing
    /// sample may still arrive.
    pub fn credit(&self) -> Option<Credit> {
        let mut given_up = self.given_up_beyond();
        for (stream, received) in &self.received {
            let Some((first, last)) = self.span(stream) else {
                continue;
            };
            for (first, last) in received.missing(first, last) {
                let in_vain = match self.compressed.get(stream) {
                    Some(camera) => {
                        let mut usable = camera.usable(first, last).into_iter();
                        usable.all(|(_, last)| self.gaps.gave_up(stream, last))
                            && camera.gave_up(first, last)
                    }
                    None => self.gaps.gave_up(stream, last),
                };
                if !in_vain {
                    return None;
                }
                if StreamId::parse(stream).is_camera() {
                    given_up += last - first + 1;
                }
            }
        }
        // A stream that the transport holds back has no gap yet, while others advance.
        let regular = self.regular.values().filter(|newest| !newest.is_silent);
        let least = regular.map(|newest| newest.tick).min();
        // Where a router passes no state, images show the time.
        let newest = self.newest.map_or(self.begun, |newest| newest.tick);
        Some(Credit {
            frames: self.accepted + given_up,
            tick: least.unwrap_or(newest),
        })
    }

    /// Samples to request again at `now`. In lock-step, samples of the manifest may be in
    /// flight on a slow line as long as other samples arrive.
    pub fn wanted(
        &mut self,
        stopped: Option<&v1::EpisodeStopped>,
        receives_compressed: bool,
        now: Instant,
    ) -> Vec<Missing> {
        for newest in self.regular.values_mut() {
            let (tick, since) = *newest.looked.get_or_insert((newest.tick, now));
            if tick != newest.tick {
                newest.looked = Some((newest.tick, now));
            }
            let silent = now.saturating_duration_since(since) > SILENCE;
            newest.is_silent = silent && tick == newest.tick;
        }
        // Events may arrive while the simulation is paused.
        let news = (self.accepted, self.newest.map_or(self.begun, |n| n.tick));
        let is_due = self.latest.is_due(news, now);
        let manifest = stopped.filter(|_| !self.is_lock_step() || self.latest.is_quiet(news, now));
        let (received, compressed) = (&self.received, &mut self.compressed);
        let openings = &self.openings;
        let mut wanted = self
            .gaps
            .wanted(received, openings, compressed, manifest, now);
        if is_due && self.is_under_way() && stopped.is_none() {
            let latest = self.newer_images(receives_compressed);
            self.latest.requested(latest.len(), now);
            wanted.extend(latest);
        }
        wanted
    }

    /// The connection is back; samples in flight are lost.
    pub fn restart_requests(&mut self) {
        self.latest.skip_pause();
        self.gaps.restart();
        let compressed = self.compressed.values_mut();
        compressed.for_each(Compressed::restart);
    }

    /// Requests for images after the last received ones. While compressed images are
    /// subscribed, `CameraSubscription` probes cameras without any compressed image.
    fn newer_images(&self, receives_compressed: bool) -> Vec<Missing> {
        let cameras = self.started.cameras.iter().map(StreamId::camera);
        let sensors = self.started.sensors.iter().map(StreamId::sensor);
        let newer = |id: StreamId| {
            let stream = id.to_string();
            let first = self.next(&stream).unwrap_or(0);
            let stream = match id.camera_name() {
                Some(camera) if self.compressed.contains_key(&stream) => {
                    StreamId::compressed(camera).to_string()
                }
                Some(_) if receives_compressed => return None,
                _ => stream,
            };
            Some(Missing::behind(stream, first))
        };
        cameras.chain(sensors).filter_map(newer).collect()
    }

    /// The request for `missing` was answered: all of its samples arrived.
    pub fn answered(&mut self, missing: &Missing, now: Instant) {
        let Missing { first, last, .. } = *missing;
        let Some(last) = last else {
            self.latest.answered(now);
            return;
        };
        let exact = StreamId::parse(&missing.stream).exact().to_string();
        self.gaps.answered(&exact, last, now);
        // Requested as exact images.
        if exact == missing.stream
            && let Some(compressed) = self.compressed.get_mut(&exact)
        {
            compressed.answered(first, last, now);
        }
    }

    /// Whether every sample of the manifest arrived.
    pub fn satisfies(&self, stopped: &v1::EpisodeStopped) -> bool {
        stopped.manifest.iter().all(|c| {
            let there = self.received.get(&c.stream);
            c.count == 0 || there.is_some_and(|s| s.within(c.first, c.last) >= c.count)
        })
    }

    /// Why writing failed, with the path of the log.
    pub fn failure(&self) -> Option<String> {
        Some(self.failed(&self.writer.failure()?))
    }

    /// The text of a failure, with the path of the log unless it names it.
    pub fn failed(&self, words: &str) -> String {
        with_log(words, self.writer.log())
    }

    pub fn discard(self) -> std::io::Result<()> {
        self.writer.discard()
    }

    /// The conversion that remains when the episode is over.
    pub fn finish(self, stopped: Option<v1::EpisodeStopped>, reason: String) -> Finishing {
        let late = self
            .received
            .iter()
            .filter(|(_, received)| received.late() > 0);
        let recovered = late
            .map(|(stream, received)| Recovered {
                stream: stream.clone(),
                count: received.late(),
            })
            .collect();
        let received = self.digests.iter().map(|(stream, digests)| {
            let compressed = self.compressed.get(stream);
            let manifest = stopped.iter().flat_map(|stopped| &stopped.manifest);
            let listed = manifest.into_iter().find(|count| count.stream == *stream);
            Received {
                stream: stream.clone(),
                digest: digests.value().to_vec(),
                doubtful: digests
                    .doubtful()
                    .max(compressed.map_or(0, Compressed::doubtful)),
                compressed: compressed.map_or_else(Vec::new, |c| c.digest(listed)),
            }
        });
        let received = received.collect();
        Finishing {
            of: id(self.started.header.as_ref()),
            label: self.started.label,
            dir: self.dir,
            writer: self.writer,
            closing: Closing {
                stopped,
                reason,
                recovered,
                received,
            },
        }
    }
}

/// Run of a server and number of an episode in it.
pub(super) type EpisodeId = (String, u64);

pub(super) fn id(header: Option<&v1::Header>) -> EpisodeId {
    header.map_or_else(Default::default, |h| (h.run_id.clone(), h.episode))
}

/// An episode that is over: its log is still to be made into the file, which
/// takes long and needs only the disk.
pub struct Finishing {
    of: EpisodeId,
    label: String,
    dir: PathBuf,
    writer: EpisodeWriter,
    closing: Closing,
}

/// Result of the conversion of an episode: its ID, and the file or the reason for
/// the failure.
#[derive(Clone, Debug)]
pub struct Made {
    pub(super) of: EpisodeId,
    pub(super) result: Result<Report, String>,
}

impl std::fmt::Debug for Finishing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut debug = f.debug_struct("Finishing");
        debug.field("label", &self.label).finish_non_exhaustive()
    }
}

/// Text of a failure, with the path of the log unless it names it.
fn with_log(words: &str, log: &Path) -> String {
    let log = log.display().to_string();
    match words.contains(&log) {
        true => words.to_owned(),
        false => format!("{words}; what was acknowledged is still in {log}"),
    }
}

/// Command that converts a log into a file of `dir` again.
fn again(log: &Path, dir: &Path) -> String {
    let out = match log.parent() == Some(dir) {
        true => String::new(),
        false => format!(" --out {}", dir.display()),
    };
    let log = log.display();
    format!("`wheelarm dataset recover {log}{out}` tries again")
}

impl Finishing {
    /// Closes the log and writes the file; the recorder waits for the result.
    #[must_use]
    pub fn run(self) -> Made {
        let of = self.of.clone();
        let log = self.writer.log().to_owned();
        let again = again(&log, &self.dir);
        let work = std::panic::AssertUnwindSafe(|| self.file());
        let result = std::panic::catch_unwind(work).unwrap_or_else(|_| {
            let log = log.display();
            Err(format!("making the file panicked; please report it. The recording is still in {log}, {again}"))
        });
        Made { of, result }
    }

    fn file(self) -> Result<Report, String> {
        let log = self.writer.log().to_owned();
        self.writer
            .close(self.closing)
            .map_err(|e| with_log(&e.to_string(), &log))?;
        let finished = finish(&log, Some(&self.dir)).map_err(|problem| match problem {
            // These name the log and the cure already.
            FinishError::Exists { .. } | FinishError::Io { .. } => problem.to_string(),
            other => format!(
                "{other}; the recording is still in {}, {}",
                log.display(),
                again(&log, &self.dir)
            ),
        })?;
        let account = &finished.account;
        Ok(Report {
            label: self.label,
            bytes: finished.bytes,
            complete: account.complete(),
            problems: account.problems.clone(),
            frames: account
                .streams
                .iter()
                .filter(|s| StreamId::parse(&s.stream).is_camera())
                .map(|s| s.received)
                .sum(),
            samples: account.total(|s| s.received),
            missed: account.total(|s| s.missed),
            counted: account.counted(),
            notes: finished.notes,
            path: finished.path,
        })
    }
}
