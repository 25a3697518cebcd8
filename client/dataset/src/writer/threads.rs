//! The threads behind an `EpisodeWriter`: compression workers, one log writer
//! that restores the order of arrival, one that syncs about every 200 ms.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender};
use parking_lot::Mutex;
use wheelarm_proto::v1;

use super::budget::Budget;
use super::encode::{self, Encoder};
use crate::log::{Appender, Closing, LogFile, RecordHeader, is_at};
use crate::publish;

/// Pause between two group syncs.
const SYNC_PERIOD: Duration = Duration::from_millis(200);
/// Bytes of the log after which the next sync does not wait.
const SYNC_BYTES: u64 = 16 << 20;
/// How often is looked whether there are as many.
const SYNC_LOOK: Duration = Duration::from_millis(20);
/// Small records are written together up to this size, bytes.
pub(super) const GROUP: usize = 1 << 16;
/// Memory of so many written records is kept for the next ones.
pub(super) const SPARE: usize = 4;

/// One piece of work, numbered in the order of arrival.
pub(super) struct Job {
    pub ticket: u64,
    pub bytes: usize,
    pub work: Work,
}

pub(super) enum Work {
    Camera(RecordHeader, Box<v1::CameraFrame>),
    Compressed(RecordHeader, Box<v1::CompressedCameraFrame>),
    Sensor(RecordHeader, Box<v1::SensorFrame>),
    Closing(Box<Closing>),
}

/// A record, or a group of them, that is ready to be appended.
pub(super) struct Record {
    pub ticket: u64,
    /// How many they are.
    pub count: u64,
    /// What they took of the budget.
    pub bytes: usize,
    pub data: Vec<u8>,
}

/// Progress that the threads report to the writer.
#[derive(Default)]
pub(super) struct Progress {
    /// Records that are in the log.
    pub acknowledged: AtomicU64,
    /// Bytes of the log.
    pub log_bytes: AtomicU64,
    failed: AtomicBool,
    failure: Mutex<Option<String>>,
}

impl Progress {
    pub fn fail(&self, words: String) {
        self.failure.lock().get_or_insert(words);
        self.failed.store(true, Ordering::Release);
    }

    /// Words of the first failure, if there was one.
    pub fn failure(&self) -> Option<String> {
        if !self.failed.load(Ordering::Acquire) {
            return None;
        }
        self.failure.lock().clone()
    }
}

/// Compresses until the queue is closed.
pub(super) fn compress(
    jobs: &Receiver<Job>,
    records: &Sender<Record>,
    mut encoder: Encoder,
    progress: &Progress,
) {
    for job in jobs {
        let data = match job.work {
            Work::Camera(header, frame) => encoder.camera(&header, &frame),
            Work::Compressed(header, frame) => match encoder.compressed(&header, *frame) {
                Ok(data) => data,
                Err(words) => {
                    // Nothing of it is written; those behind it are, and its bytes
                    // are given back.
                    progress.fail(words);
                    Vec::new()
                }
            },
            Work::Sensor(header, frame) => encoder.sensor(&header, *frame),
            Work::Closing(message) => encode::closing(&message),
        };
        let record = Record {
            ticket: job.ticket,
            count: 1,
            bytes: job.bytes,
            data,
        };
        if records.send(record).is_err() {
            return;
        }
    }
}

/// Appends in the order of the tickets until the workers are gone; the memory of
/// large records goes back to the workers.
pub(super) fn append<F: LogFile>(
    records: &Receiver<Record>,
    used: &Sender<Vec<u8>>,
    mut log: Appender<F>,
    budget: &Budget,
    progress: &Progress,
) {
    let mut waiting = BTreeMap::new();
    let mut next = 0;
    let mut group = Vec::new();
    let mut grouped = (0, 0);
    while let Ok(record) = records.recv() {
        waiting.insert(record.ticket, record);
        while let Ok(record) = records.try_recv() {
            waiting.insert(record.ticket, record);
        }
        while let Some(record) = waiting.remove(&next) {
            next += 1;
            grouped.0 += record.count;
            grouped.1 += record.bytes;
            if group.is_empty() && record.data.len() >= GROUP {
                let before = std::mem::replace(&mut group, record.data);
                if before.capacity() >= GROUP {
                    // Who has enough of it lets it go.
                    let _ = used.try_send(before);
                }
            } else {
                group.extend_from_slice(&record.data);
            }
            if group.len() >= GROUP {
                flush(&mut log, &mut group, &mut grouped, budget, progress);
            }
        }
        flush(&mut log, &mut group, &mut grouped, budget, progress);
    }
}

fn flush<F: LogFile>(
    log: &mut Appender<F>,
    group: &mut Vec<u8>,
    grouped: &mut (u64, usize),
    budget: &Budget,
    progress: &Progress,
) {
    if grouped.0 == 0 {
        return;
    }
    match log.append(group) {
        Ok(()) => {
            progress.acknowledged.fetch_add(grouped.0, Ordering::AcqRel);
            progress.log_bytes.store(log.length(), Ordering::Release);
        }
        Err(words) => progress.fail(words),
    }
    budget.give(grouped.1);
    group.clear();
    *grouped = (0, 0);
}

/// Syncs in groups until `done` is closed, and a last time then. Notices a log that was
/// removed or replaced meanwhile.
pub(super) fn sync(file: &File, log: &Path, done: &Receiver<()>, progress: &Arc<Progress>) {
    let (mut synced, mut bytes, mut since) = (0, 0, Instant::now());
    let mut is_there = true;
    loop {
        let last =
            done.recv_timeout(SYNC_LOOK) != Err(crossbeam_channel::RecvTimeoutError::Timeout);
        let written = progress.acknowledged.load(Ordering::Acquire);
        let length = progress.log_bytes.load(Ordering::Acquire);
        if is_there && !is_at(file, log) {
            is_there = false;
            progress.fail(removed(file, log));
        }
        // What is much goes at once, so that the last sync finds little to do.
        let due = since.elapsed() >= SYNC_PERIOD || length.saturating_sub(bytes) >= SYNC_BYTES;
        if (due && written != synced) || last {
            if let Err(problem) = publish::sync_data(file) {
                progress.fail(format!("cannot sync the log to the disk: {problem}"));
            }
            (synced, bytes, since) = (written, length, Instant::now());
        }
        if last {
            return;
        }
    }
}

/// Saves the contents of a log that was removed, which live as long as it is open.
fn removed(file: &File, log: &Path) -> String {
    let log_name = log.display();
    let what = format!("the log {log_name} was removed or replaced while it was written");
    match save(file, log) {
        Ok(saved) => {
            let saved = saved.display();
            format!(
                "{what}; what was acknowledged is saved in {saved}: `wheelarm dataset recover \
                 {saved}` makes the file of it"
            )
        }
        Err(problem) => format!(
            "{what}, and its contents cannot be saved ({problem}): record the episode again"
        ),
    }
}

/// Copies an open file to its name, or beside it where the name is taken.
fn save(file: &File, log: &Path) -> io::Result<PathBuf> {
    // The log is open for appending alone; Linux opens it once more by its descriptor.
    let mut from = File::open(format!("/proc/self/fd/{}", file.as_raw_fd()))?;
    if let Some(folder) = log.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let beside = log.with_added_extension("saved");
    let mut taken = io::Error::from(io::ErrorKind::AlreadyExists);
    for name in [log, &beside] {
        match File::create_new(name) {
            Ok(mut to) => {
                io::copy(&mut from, &mut to)?;
                publish::sync_file(&to)?;
                return Ok(name.to_owned());
            }
            Err(problem) => taken = problem,
        }
    }
    Err(taken)
}
