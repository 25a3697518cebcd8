//! [`EpisodeWriter`]: samples in, acknowledged records in a log out.
//!
//! A queue bounded in bytes, two compression workers, one log writer. Records
//! are appended in the order in which the samples were offered. State samples, which
//! are small and many, go to the log writer in groups. This module depends on neither the
//! transport nor HDF5.

mod budget;
mod encode;
mod group;
mod images;
mod memory;
mod threads;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

use bytes::Bytes;
use crossbeam_channel::Sender;
use prost::Message;
use wheelarm_proto::{StreamId, label, v1};

use crate::columns;
use crate::depth::Depth;
use crate::log::{Appender, Closing, Kind, LogError, LogFile, Preamble, RecordHeader};

use budget::Budget;
use encode::Encoder;
use group::Group;
pub use images::MAX_SIDE;
use threads::{Job, Progress, Record, Work};

/// Options of a writer.
#[derive(Clone, Debug)]
pub struct WriterOptions {
    /// How depth is stored.
    pub depth: Depth,
    /// Name of the recorder, stored in the file.
    pub recorder: String,
    /// Folder for the log until the file is made; that of the file when absent.
    pub scratch: Option<PathBuf>,
    /// Compression threads; 2 keep up with two cameras at 1280x720 and 15 Hz.
    pub workers: usize,
    /// Bytes that may wait between the threads, about four frames of two
    /// cameras at 1280x720.
    pub queue_bytes: usize,
}

impl Default for WriterOptions {
    fn default() -> Self {
        Self {
            depth: Depth::Metres,
            recorder: "recorder".into(),
            scratch: None,
            workers: 2,
            queue_bytes: 64 << 20,
        }
    }
}

/// Why a sample or an episode cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The final file exists.
    #[error(
        "{0} exists already and is never overwritten; choose another label or folder, or move the file away"
    )]
    Exists(PathBuf),
    /// A log of the same name exists.
    #[error(
        "{0} is the log of an unfinished recording; `wheelarm dataset recover {0}` turns it into a file, or another recorder is writing it just now"
    )]
    Unfinished(PathBuf),
    /// HDF5 accepts only names in UTF-8.
    #[error("the folder {0} is not in UTF-8, which HDF5 cannot take; choose another")]
    Folder(PathBuf),
    /// The episode has a label that cannot name a file, or no header.
    #[error(transparent)]
    Invalid(#[from] wheelarm_proto::check::Invalid),
    /// The log cannot be created.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A sample is not a valid message of its stream.
    #[error("a sample of {stream} is refused: {reason}")]
    Malformed {
        /// The stream.
        stream: String,
        /// The reason.
        reason: String,
    },
    /// The log failed earlier; acknowledged samples are kept.
    #[error("{0}")]
    Failed(String),
}

/// Header of an accepted sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Sequence number.
    pub sequence: u64,
    /// Simulation time, nanoseconds.
    pub stamp_nanos: u64,
    /// Physics tick.
    pub tick: u64,
}

/// Writes one episode into its log.
pub struct EpisodeWriter {
    log: PathBuf,
    file: PathBuf,
    streams: BTreeMap<String, Slot>,
    depth: Depth,
    next: u64,
    /// Buffered state samples.
    group: Group,
    queue: Option<Sender<Job>>,
    records: Option<Sender<Record>>,
    sync: Option<Sender<()>>,
    budget: Arc<Budget>,
    progress: Arc<Progress>,
    threads: Vec<JoinHandle<()>>,
}

struct Slot {
    number: u16,
    id: StreamId,
    /// Image size of the first frame; all others must have it.
    size: Option<(u32, u32)>,
}

/// Path of the file of an episode: `LABEL.h5`.
#[must_use]
pub fn file_path(dir: &Path, label: &str) -> PathBuf {
    dir.join(format!("{label}.h5"))
}

/// Path of its log until then: `LABEL.h5.wal`.
#[must_use]
pub fn log_path(dir: &Path, label: &str) -> PathBuf {
    dir.join(format!("{label}.h5.wal"))
}

/// The next label of the same stem that names no file and no log in these folders.
#[must_use]
pub fn next_free_label(dirs: &[&Path], label: &str) -> String {
    let (stem, number) = label::split(label);
    let number_of = |entry: std::fs::DirEntry| {
        let name = entry.file_name();
        let name = name.to_str()?;
        let taken = name.strip_suffix(".wal").unwrap_or(name);
        let (other, number) = label::split(taken.strip_suffix(".h5")?);
        (other == stem).then_some(number)
    };
    let taken = dirs
        .iter()
        .filter_map(|dir| std::fs::read_dir(dir).ok())
        .flat_map(|entries| entries.flatten().filter_map(number_of).collect::<Vec<_>>())
        .max();
    label::numbered(stem, taken.unwrap_or(0).max(number).saturating_add(1))
}

/// Checks that no file and no log of that label exists.
///
/// # Errors
/// [`WriteError::Exists`] or [`WriteError::Unfinished`].
pub fn check_free(dir: &Path, scratch: Option<&Path>, label: &str) -> Result<(), WriteError> {
    let file = file_path(dir, label);
    if file.exists() {
        return Err(WriteError::Exists(file));
    }
    let log = log_path(scratch.unwrap_or(dir), label);
    match log.exists() {
        true => Err(WriteError::Unfinished(log)),
        false => Ok(()),
    }
}

impl EpisodeWriter {
    /// Opens the log of an episode whose file will be in `dir`. Folders are created.
    ///
    /// # Errors
    /// When the file or its log exists, or cannot be created.
    pub fn open(
        dir: &Path,
        started: &v1::EpisodeStarted,
        snapshot: &v1::SnapshotReply,
        options: &WriterOptions,
    ) -> Result<Self, WriteError> {
        wheelarm_proto::check::label(&started.label)?;
        let scratch = options.scratch.as_deref().unwrap_or(dir);
        let (file, log) = (
            file_path(dir, &started.label),
            log_path(scratch, &started.label),
        );
        let io = |source| LogError::Io {
            path: log.display().to_string(),
            source,
        };
        if dir.to_str().is_none() {
            return Err(WriteError::Folder(dir.to_owned()));
        }
        for folder in [dir, scratch] {
            std::fs::create_dir_all(folder).map_err(|source| LogError::Io {
                path: folder.display().to_string(),
                source,
            })?;
        }
        if file.exists() {
            return Err(WriteError::Exists(file));
        }
        let handle = match crate::log::create_file(&log) {
            Err(LogError::Io { source, .. })
                if source.kind() == std::io::ErrorKind::AlreadyExists =>
            {
                return Err(WriteError::Unfinished(log));
            }
            other => other?,
        };
        let syncing = handle.try_clone().map_err(io)?;
        match Self::over(
            handle,
            Some(syncing),
            log.clone(),
            file,
            started,
            snapshot,
            options,
        ) {
            Ok(writer) => Ok(writer),
            Err(problem) => {
                // The preamble did not fit: nothing was acknowledged.
                let _ = std::fs::remove_file(&log);
                Err(problem)
            }
        }
    }

    /// Writes into any log file; `open` is what a recorder calls.
    ///
    /// # Errors
    /// When the preamble cannot be written.
    pub fn over<F: LogFile + 'static>(
        log_file: F,
        syncing: Option<File>,
        log: PathBuf,
        file: PathBuf,
        started: &v1::EpisodeStarted,
        snapshot: &v1::SnapshotReply,
        options: &WriterOptions,
    ) -> Result<Self, WriteError> {
        memory::keep();
        let names = stream_names(started);
        let preamble = Preamble {
            started: Some(started.clone()),
            snapshot: Some(snapshot.clone()),
            recorder: options.recorder.clone(),
            software: env!("CARGO_PKG_VERSION").to_owned(),
            depth_millimetres: options.depth == Depth::Millimetres,
            streams: names.clone(),
            without_depth: options.depth == Depth::Nothing,
        };
        let appender = Appender::start(log_file, &preamble).map_err(|source| LogError::Io {
            path: log.display().to_string(),
            source,
        })?;
        let streams = names
            .into_iter()
            .enumerate()
            .filter_map(|(i, name)| {
                let slot = Slot {
                    number: u16::try_from(i).ok()?,
                    id: StreamId::parse(&name),
                    size: None,
                };
                Some((name, slot))
            })
            .collect();

        let budget = Arc::new(Budget::new(options.queue_bytes));
        let progress = Arc::new(Progress::default());
        let (queue, jobs) = crossbeam_channel::unbounded();
        let (to_log, records) = crossbeam_channel::unbounded();
        let (used, spare) = crossbeam_channel::bounded(threads::SPARE);
        let mut handles = Vec::new();
        for _ in 0..options.workers.max(1) {
            let (jobs, to_log) = (jobs.clone(), to_log.clone());
            let encoder = Encoder::new(options.depth, spare.clone());
            let compressed = progress.clone();
            handles.push(std::thread::spawn(move || {
                threads::compress(&jobs, &to_log, encoder, &compressed);
            }));
        }
        let (shared, written) = (budget.clone(), progress.clone());
        handles.push(std::thread::spawn(move || {
            threads::append(&records, &used, appender, &shared, &written);
        }));
        let sync = syncing.map(|syncing| {
            let (sync, done) = crossbeam_channel::bounded(0);
            let (synced, log) = (progress.clone(), log.clone());
            handles.push(std::thread::spawn(move || {
                threads::sync(&syncing, &log, &done, &synced)
            }));
            sync
        });
        Ok(Self {
            log,
            file,
            streams,
            depth: options.depth,
            next: 0,
            group: Group::default(),
            queue: Some(queue),
            records: Some(to_log),
            sync,
            budget,
            progress,
            threads: handles,
        })
    }

    /// Takes one sample of `stream` (`camera/NAME` for a camera, `sensor/NAME` for
    /// what a sensor model makes). Waits while
    /// the queue is full; that wait is what holds a lock-step server back. A state
    /// sample may wait for others until [`EpisodeWriter::flush`].
    ///
    /// # Errors
    /// [`WriteError::Malformed`] refuses this sample alone;
    /// [`WriteError::Failed`] every one from now on.
    pub fn offer(&mut self, stream: &str, payload: Bytes) -> Result<Taken, WriteError> {
        if let Some(failure) = self.progress.failure() {
            return Err(WriteError::Failed(failure));
        }
        let malformed = |reason: String| WriteError::Malformed {
            stream: stream.to_owned(),
            reason,
        };
        let slot = self
            .streams
            .get_mut(stream)
            .ok_or_else(|| malformed("the episode does not announce this stream".into()))?;
        let bytes = payload.len();
        let (header, work) = if slot.id.sensor_name().is_some() {
            let frame = v1::SensorFrame::decode(payload).map_err(|e| malformed(e.to_string()))?;
            let size = images::sensor(&frame, slot.size).map_err(malformed)?;
            slot.size = Some(size);
            let header = frame.header.clone().unwrap_or_default();
            let record = record_header(Kind::Camera, slot.number, &header);
            (header, Work::Sensor(record, Box::new(frame)))
        } else if slot.id.is_camera() {
            let frame = v1::CameraFrame::decode(payload).map_err(|e| malformed(e.to_string()))?;
            let size = images::exact(&frame, slot.size).map_err(malformed)?;
            slot.size = Some(size);
            let header = frame.header.clone().unwrap_or_default();
            let record = record_header(Kind::Camera, slot.number, &header);
            (header, Work::Camera(record, Box::new(frame)))
        } else {
            columns::check(stream, &payload).map_err(|e| malformed(e.to_string()))?;
            let header = columns::header_of(&payload).map_err(|e| malformed(e.to_string()))?;
            let record = record_header(Kind::State, slot.number, &header);
            if self.group.add(&record, &payload) {
                self.flush();
            }
            return Ok(taken(&header));
        };
        self.send(bytes, work);
        Ok(taken(&header))
    }

    /// Takes one image of the camera's stream `stream` whose planes are compressed
    /// already. Waits as [`EpisodeWriter::offer`] does.
    ///
    /// # Errors
    /// As [`EpisodeWriter::offer`].
    pub fn offer_compressed(
        &mut self,
        stream: &str,
        frame: v1::CompressedCameraFrame,
    ) -> Result<Taken, WriteError> {
        if let Some(failure) = self.progress.failure() {
            return Err(WriteError::Failed(failure));
        }
        let malformed = |reason: String| WriteError::Malformed {
            stream: stream.to_owned(),
            reason,
        };
        let slot = self.streams.get_mut(stream);
        let slot = slot
            .filter(|slot| slot.id.is_camera())
            .ok_or_else(|| malformed("the episode does not announce this camera".into()))?;
        let size = images::compressed(&frame, slot.size, self.depth).map_err(malformed)?;
        slot.size = Some(size);
        let header = frame.header.clone().unwrap_or_default();
        let record = record_header(Kind::Camera, slot.number, &header);
        let bytes = frame.color.len() + frame.depth.len() + frame.segmentation.len();
        self.send(bytes, Work::Compressed(record, Box::new(frame)));
        Ok(taken(&header))
    }

    /// Hands the state samples that wait for others to the log.
    pub fn flush(&mut self) {
        let Some((count, data)) = self.group.take() else {
            return;
        };
        let bytes = data.len();
        self.budget.take(bytes);
        let record = Record {
            ticket: self.ticket(),
            count,
            bytes,
            data,
        };
        if let Some(records) = &self.records
            && records.send(record).is_err()
        {
            self.progress.fail("the log's thread is gone".into());
        }
    }

    fn send(&mut self, bytes: usize, work: Work) {
        self.flush();
        self.budget.take(bytes);
        let job = Job {
            ticket: self.ticket(),
            bytes,
            work,
        };
        if let Some(queue) = &self.queue
            && queue.send(job).is_err()
        {
            self.progress
                .fail("the compression threads are gone".into());
        }
    }

    /// Place of the next record or group in the log.
    fn ticket(&mut self) -> u64 {
        let ticket = self.next;
        self.next += 1;
        ticket
    }

    /// Samples that are in the log by now.
    #[must_use]
    pub fn acknowledged(&self) -> u64 {
        self.progress.acknowledged.load(Ordering::Acquire)
    }

    /// Bytes of the log by now.
    #[must_use]
    pub fn log_bytes(&self) -> u64 {
        self.progress.log_bytes.load(Ordering::Acquire)
    }

    /// Why writing failed, if it did.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        self.progress.failure()
    }

    /// Path of the log.
    #[must_use]
    pub fn log(&self) -> &Path {
        &self.log
    }

    /// Path that the finished file will have.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Writes the closing record, waits for everything to be on the disk and
    /// returns the log's path.
    ///
    /// # Errors
    /// [`WriteError::Failed`]; what was acknowledged stays in the log.
    pub fn close(mut self, closing: Closing) -> Result<PathBuf, WriteError> {
        self.send(0, Work::Closing(Box::new(closing)));
        self.end();
        match self.progress.failure() {
            Some(failure) => Err(WriteError::Failed(failure)),
            None => Ok(self.log.clone()),
        }
    }

    /// Throws the episode away: ends the threads and deletes the log.
    ///
    /// # Errors
    /// When the log cannot be deleted.
    pub fn discard(mut self) -> std::io::Result<()> {
        self.end();
        std::fs::remove_file(&self.log)
    }

    fn end(&mut self) {
        self.flush();
        self.queue = None;
        self.records = None;
        // Workers and log writer first: the last sync must come after them.
        let sync = self.sync.take();
        let last = if sync.is_some() {
            self.threads.pop()
        } else {
            None
        };
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                self.progress.fail("a recorder thread panicked".into());
            }
        }
        drop(sync);
        if let Some(thread) = last
            && thread.join().is_err()
        {
            self.progress.fail("the sync thread panicked".into());
        }
    }
}

impl Drop for EpisodeWriter {
    fn drop(&mut self) {
        self.end();
    }
}

/// Streams of an episode in the order of their record numbers.
fn stream_names(started: &v1::EpisodeStarted) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let cameras = started.cameras.iter().map(StreamId::camera);
    let sensors = started.sensors.iter().map(StreamId::sensor);
    let own = std::iter::once(StreamId::EVENTS)
        .chain(cameras)
        .chain(sensors);
    let own = own.map(|stream| stream.to_string());
    for name in started.streams.iter().cloned().chain(own) {
        if !out.contains(&name) {
            out.push(name);
        }
    }
    out
}

fn taken(header: &v1::Header) -> Taken {
    Taken {
        sequence: header.sequence,
        stamp_nanos: header.stamp_nanos,
        tick: header.tick,
    }
}

fn record_header(kind: Kind, stream: u16, header: &v1::Header) -> RecordHeader {
    RecordHeader {
        kind,
        stream,
        sequence: header.sequence,
        stamp_nanos: header.stamp_nanos,
        tick: header.tick,
    }
}
