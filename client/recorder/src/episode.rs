//! One episode while it is recorded, with its writer and which samples are
//! there, and afterwards, until it is in its file.

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

use super::compressed::{Compressed, Picture};
use super::digests::Digests;
use super::gaps::{Gaps, Missing};
use super::latest::Latest;
use super::opening::Openings;
use super::question::{LOCK_STEP_PATIENCE, REAL_TIME_PATIENCE};

/// What became of one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Label of the episode.
    pub label: String,
    /// The file.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// It holds everything that was published.
    pub complete: bool,
    /// Why not.
    pub problems: Vec<String>,
    /// Camera frames in it, of all cameras.
    pub frames: u64,
    /// Samples in it, frames included.
    pub samples: u64,
    /// Samples that were published and are not in it; without the server's
    /// word those between the ones that came, which are the least.
    pub missed: u64,
    /// The server told how many it published.
    pub counted: bool,
    /// What else there is to know, for people; the file is good.
    pub notes: Vec<String>,
}

/// A stream of a fixed rate that is silent for so long has ended; one of which a sample
/// was lost is held back by the transport for ten seconds at most.
pub(super) const SILENCE: Duration = Duration::from_secs(12);

/// The newest sample of a stream of a fixed rate.
#[derive(Debug, Default)]
struct Newest {
    tick: u64,
    /// What it was at the last look, since when, and whether that is too long ago.
    looked: Option<(u64, Instant)>,
    is_silent: bool,
}

/// How far the server may take it that everything is here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Credit {
    /// Camera frames that were accepted or given up.
    pub frames: u64,
    /// Tick up to which every state stream of a fixed rate is here.
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
    /// Since when the server is away; it may come back.
    pub away: Option<Instant>,
    writer: EpisodeWriter,
    seen: BTreeMap<String, Coverage>,
    digests: BTreeMap<String, Digests>,
    /// Of cameras whose pictures came compressed.
    compressed: BTreeMap<String, Compressed>,
    gaps: Gaps,
    openings: Openings,
    latest: Latest,
    /// Samples accepted.
    samples: u64,
    /// Tick of the beginning.
    begun: u64,
    /// The newest samples of streams of a fixed rate, by stream.
    regular: BTreeMap<String, Newest>,
}

/// What became of an offered sample.
pub(super) enum Accepted {
    Frame,
    State,
    /// It is there already, or it was refused and is missing from now on.
    Not,
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
            seen: BTreeMap::new(),
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

    /// Takes one sample of this episode.
    ///
    /// # Errors
    /// The words of the log's failure.
    pub fn take(
        &mut self,
        stream: &str,
        sequence: u64,
        payload: Bytes,
    ) -> Result<Accepted, String> {
        let of_message = digest::of_message([&payload[..]]);
        let id = StreamId::parse(stream);
        let exact = id.clone().exact();
        if exact.is_camera() && !self.seen.contains_key(&exact.to_string()) {
            self.openings
                .begin(&exact, sequence, &payload, &self.started);
        }
        let Some(camera) = id.of_compressed() else {
            let offer = |writer: &mut EpisodeWriter| writer.offer(stream, payload);
            return self.keep(stream, sequence, of_message, offer);
        };
        let camera = camera.to_string();
        let compressed = self.compressed.entry(camera.clone()).or_default();
        let Some(Picture { frame, exact }) = compressed.take(sequence, payload, &of_message) else {
            return Ok(Accepted::Not);
        };
        let offer = |writer: &mut EpisodeWriter| writer.offer_compressed(&camera, *frame);
        let kept = self.keep(&camera, sequence, exact, offer)?;
        let there = |seen: &Coverage| seen.within(sequence, sequence) > 0;
        if !self.seen.get(&camera).is_some_and(there) {
            self.compressed.entry(camera).or_default().refuse(sequence);
        }
        Ok(kept)
    }

    /// The sample `sequence` of a stream came, and is of an earlier episode.
    pub fn is_older(&mut self, stream: &str, sequence: u64) {
        self.openings.is_older(stream, sequence);
    }

    /// Samples that were accepted.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Hands the samples that wait for others to the log.
    pub fn flush(&mut self) {
        self.writer.flush();
    }

    /// Cameras of which nothing came in compressed form.
    pub fn silent(&self) -> impl Iterator<Item = String> {
        let cameras = self.started.cameras.iter();
        let streams = cameras.map(|camera| StreamId::camera(camera).to_string());
        streams.filter(|stream| !self.compressed.contains_key(stream))
    }

    /// Whether time has passed in the episode.
    pub fn is_under_way(&self) -> bool {
        self.accepted > 0 || self.seen.contains_key(TopicId::Clock.name())
    }

    /// Whether time waits for recorders.
    pub fn is_lock_step(&self) -> bool {
        let scenario = self.started.scenario.as_ref();
        scenario.is_some_and(|s| s.pacing() == v1::Pacing::LockStep)
    }

    /// Longest wait for the answer to a question for samples.
    pub fn patience(&self) -> Duration {
        match self.is_lock_step() {
            true => LOCK_STEP_PATIENCE,
            false => REAL_TIME_PATIENCE,
        }
    }

    /// Number behind the last sample of a stream that is there; `None` without any.
    pub fn next(&self, stream: &str) -> Option<u64> {
        let span = self.seen.get(stream).and_then(Coverage::span);
        span.map(|(_, last)| last.saturating_add(1))
    }

    /// Writes what is new by `offer`; `digest` is that of the exact message.
    fn keep(
        &mut self,
        stream: &str,
        sequence: u64,
        digest: digest::Digest,
        offer: impl FnOnce(&mut EpisodeWriter) -> Result<Taken, WriteError>,
    ) -> Result<Accepted, String> {
        let seen = self.seen.entry(stream.to_owned()).or_default();
        let digests = self.digests.entry(stream.to_owned()).or_default();
        // Recovery and history may deliver a sample twice.
        if seen.within(sequence, sequence) > 0 {
            digests.again(sequence, &digest);
            return Ok(Accepted::Not);
        }
        if digests.is_late(sequence) {
            tracing::warn!("sample {sequence} of {stream} comes far too late and is left out");
            return Ok(Accepted::Not);
        }
        let taken = offer(&mut self.writer);
        match taken {
            Ok(taken) => {
                self.samples += 1;
                seen.insert(sequence);
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
                Ok(Accepted::Not)
            }
        }
    }

    /// First and last number of a stream that are known to be of the episode, those of
    /// pictures before the first that came included; `None` without a sample.
    fn span(&self, stream: &str) -> Option<(u64, u64)> {
        let (first, last) = self.seen.get(stream)?.span()?;
        Some((self.openings.first(stream, first), last))
    }

    /// Samples missing between those that came, pictures before them, and pictures
    /// beyond that were asked for in vain.
    pub fn missed(&self) -> u64 {
        let lacks = |(stream, seen): (&String, &Coverage)| {
            let (first, last) = self.span(stream)?;
            Some((last - first).saturating_add(1) - seen.received())
        };
        let between: u64 = self.seen.iter().filter_map(lacks).sum();
        between + self.given_up_beyond()
    }

    /// Pictures beyond those that came that were asked for in vain.
    fn given_up_beyond(&self) -> u64 {
        let all = self.compressed.iter();
        let beyond = all.map(|(camera, compressed)| compressed.given_up(self.span(camera)));
        beyond.sum()
    }

    /// Up to where everything is here or given up; `None` while a sample is missing that
    /// may still come.
    pub fn credit(&self) -> Option<Credit> {
        let mut given_up = self.given_up_beyond();
        for (stream, seen) in &self.seen {
            let Some((first, last)) = self.span(stream) else {
                continue;
            };
            for (first, last) in seen.missing(first, last) {
                let in_vain = match self.compressed.get(stream) {
                    Some(heard) => {
                        let mut usable = heard.usable(first, last).into_iter();
                        usable.all(|(_, last)| self.gaps.gave_up(stream, last))
                            && heard.gave_up(first, last)
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
        // What the transport holds back is no gap yet, while other streams go on.
        let regular = self.regular.values().filter(|newest| !newest.is_silent);
        let least = regular.map(|newest| newest.tick).min();
        // Where a router lets no state through, pictures tell the time.
        let newest = self.newest.map_or(self.begun, |newest| newest.tick);
        Some(Credit {
            frames: self.accepted + given_up,
            tick: least.unwrap_or(newest),
        })
    }

    /// Samples to ask for again at `now`. In lock-step what the manifest lists may be under
    /// way on a slow line as long as something comes.
    pub fn wanted(
        &mut self,
        stopped: Option<&v1::EpisodeStopped>,
        hears_compressed: bool,
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
        // Events may come while time stands still.
        let news = (self.accepted, self.newest.map_or(self.begun, |n| n.tick));
        let is_due = self.latest.is_due(news, now);
        let told = stopped.filter(|_| !self.is_lock_step() || self.latest.is_quiet(news, now));
        let (seen, compressed) = (&self.seen, &mut self.compressed);
        let openings = &self.openings;
        let mut wanted = self.gaps.wanted(seen, openings, compressed, told, now);
        if is_due && self.is_under_way() && stopped.is_none() {
            let latest = self.newer_pictures(hears_compressed);
            self.latest.asked(latest.len(), now);
            wanted.extend(latest);
        }
        wanted
    }

    /// The connection is back; what was under way is lost.
    pub fn look_again(&mut self) {
        self.latest.hurry();
        self.gaps.begin_again();
        let compressed = self.compressed.values_mut();
        compressed.for_each(Compressed::begin_again);
    }

    /// What may have been published behind the last pictures that came; a camera of which
    /// nothing came compressed while that is heard is looked for in another way.
    fn newer_pictures(&self, hears_compressed: bool) -> Vec<Missing> {
        let cameras = self.started.cameras.iter().map(StreamId::camera);
        let sensors = self.started.sensors.iter().map(StreamId::sensor);
        let newer = |id: StreamId| {
            let stream = id.to_string();
            let first = self.next(&stream).unwrap_or(0);
            let stream = match id.camera_name() {
                Some(camera) if self.compressed.contains_key(&stream) => {
                    StreamId::compressed(camera).to_string()
                }
                Some(_) if hears_compressed => return None,
                _ => stream,
            };
            Some(Missing::behind(stream, first))
        };
        cameras.chain(sensors).filter_map(newer).collect()
    }

    /// A question for `missing` was answered: all that is sent for it has come.
    pub fn answered(&mut self, missing: &Missing, now: Instant) {
        let Missing { first, last, .. } = *missing;
        let Some(last) = last else {
            self.latest.answered(now);
            return;
        };
        let exact = StreamId::parse(&missing.stream).exact().to_string();
        self.gaps.answered(&exact, last, now);
        // Asked for as they are.
        if exact == missing.stream
            && let Some(compressed) = self.compressed.get_mut(&exact)
        {
            compressed.answered(first, last, now);
        }
    }

    /// Whether everything that the manifest lists has come.
    pub fn satisfies(&self, stopped: &v1::EpisodeStopped) -> bool {
        stopped.manifest.iter().all(|c| {
            let there = self.seen.get(&c.stream);
            c.count == 0 || there.is_some_and(|s| s.within(c.first, c.last) >= c.count)
        })
    }

    /// Why writing failed, with the place of the log.
    pub fn failure(&self) -> Option<String> {
        Some(self.failed(&self.writer.failure()?))
    }

    /// The words of a failure, with the place of the log unless they name it.
    pub fn failed(&self, words: &str) -> String {
        with_log(words, self.writer.log())
    }

    pub fn discard(self) -> std::io::Result<()> {
        self.writer.discard()
    }

    /// What is left to do when the episode is over.
    pub fn finish(self, stopped: Option<v1::EpisodeStopped>, reason: String) -> Finishing {
        let late = self.seen.iter().filter(|(_, seen)| seen.late() > 0);
        let recovered = late
            .map(|(stream, seen)| Recovered {
                stream: stream.clone(),
                count: seen.late(),
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
/// takes long and needs nothing but the disk.
pub struct Finishing {
    of: EpisodeId,
    label: String,
    dir: PathBuf,
    writer: EpisodeWriter,
    closing: Closing,
}

/// What came of making a file: of which episode, and the file or why there is
/// none.
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

/// The words of a failure, with the place of what was acknowledged unless they name it.
fn with_log(words: &str, log: &Path) -> String {
    let log = log.display().to_string();
    match words.contains(&log) {
        true => words.to_owned(),
        false => format!("{words}; what was acknowledged is still in {log}"),
    }
}

/// How a log is made into a file of `dir` once more.
fn again(log: &Path, dir: &Path) -> String {
    let out = match log.parent() == Some(dir) {
        true => String::new(),
        false => format!(" --out {}", dir.display()),
    };
    let log = log.display();
    format!("`wheelarm dataset recover {log}{out}` tries again")
}

impl Finishing {
    /// Closes the log and makes the file; the recorder waits for what came of it.
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
