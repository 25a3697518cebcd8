//! Converts a log into an episode file: written beside its final name, checked,
//! synced and renamed without replacing a file; only then the log is removed.

mod error;
mod events;
mod root;
mod streams;
mod visibility;

pub use error::FinishError;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};
use prost::Message;
use wheelarm_proto::{StreamId, TopicId, v1};

use crate::account::Account;
use crate::columns::{self, Context};
use crate::hdf::{self, Attributes};
use crate::log::{Locked, LogError, Scan, hold, is_at, outline, read_ahead, scan};
use crate::publish;
use crate::read::{Episode, first_robot};
use crate::writer::file_path;

use events::{Phases, Row};
use visibility::Visibility;

/// Pause between two syncs of a file while it is written, so that the last one has
/// little to do.
const SYNC_PERIOD: Duration = Duration::from_millis(40);

/// Attempts to claim a name that another process gives up meanwhile.
const CLAIMS: usize = 8;

/// A finished file.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Its path.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// Its recorded and missing samples.
    pub account: Account,
    /// Notes for the user; the file is usable.
    pub notes: Vec<String>,
}

/// Makes the episode file of a log, in `out` or else beside the log.
///
/// # Errors
/// [`FinishError`]; the log stays and no partial file is left.
pub fn finish(log: &Path, out: Option<&Path>) -> Result<Finished, FinishError> {
    // Lock before reading: samples that a recorder appends meanwhile would be lost
    // with the log.
    let _held = hold(log)?;
    // A log that was closed in order is read once: whether a record is damaged
    // shows when it is copied, and then the whole log is scanned first.
    if let Some(outline) = outline(log)? {
        match make(log, out, outline) {
            Err(FinishError::Log(LogError::Damaged { .. })) => {}
            made => return made,
        }
    }
    make(log, out, scan(log)?)
}

/// Writes the file of the samples that `scan` found.
fn make(log: &Path, out: Option<&Path>, scan: Scan) -> Result<Finished, FinishError> {
    let label = scan.preamble.started.as_ref().map_or("", |s| &s.label);
    if let Err(invalid) = wheelarm_proto::check::label(label) {
        return Err(LogError::NoLog {
            path: log.display().to_string(),
            reason: invalid.to_string(),
        }
        .into());
    }
    let beside = log.parent().unwrap_or(Path::new("."));
    let target = file_path(out.unwrap_or(beside), label);
    let io = |path: &Path| {
        let (path, log) = (path.to_owned(), log.to_owned());
        move |source| FinishError::Io { path, log, source }
    };
    let exists = || FinishError::Exists {
        path: target.clone(),
        log: log.to_owned(),
    };
    if let Some(out) = out {
        std::fs::create_dir_all(out).map_err(io(out))?;
    }
    let account = Account::from_scan(&scan);
    if target.exists() && !is_placeholder(&target, log) {
        // A crash between publishing the file and removing the log.
        return match is_made_of(&target, &scan, &account) {
            true => Ok(published(
                log,
                target,
                scan,
                account,
                publish::Published::default(),
            )),
            false => Err(exists()),
        };
    }

    let temporary = target.with_extension("h5.tmp");
    let _claimed = claim(&temporary).map_err(io(&temporary))?;
    let written = write(&temporary, &scan, &account);
    if let Err(problem) = written {
        let _ = std::fs::remove_file(&temporary);
        return Err(problem);
    }
    if is_placeholder(&target, log) {
        std::fs::remove_file(&target).map_err(io(&target))?;
    }
    match publish::file(&temporary, &target) {
        Ok(named) => Ok(published(log, target, scan, account, named)),
        Err(problem) => {
            let _ = std::fs::remove_file(&temporary);
            Err(match problem.kind() {
                std::io::ErrorKind::AlreadyExists => exists(),
                _ => io(&target)(problem),
            })
        }
    }
}

/// The file has its name, so later failures are not errors. A log that cannot be removed
/// costs only space; it is kept where a loss of power may undo the rename.
fn published(
    log: &Path,
    path: PathBuf,
    scan: Scan,
    account: Account,
    named: publish::Published,
) -> Finished {
    let mut notes = Vec::new();
    let removed = match named.not_durable {
        Some(problem) => Err(problem),
        None => std::fs::remove_file(log),
    };
    match removed {
        Ok(()) => drop(publish::settle(log)),
        Err(problem) => notes.push(format!(
            "the file is good; its log {} stays behind and can be deleted ({problem})",
            log.display()
        )),
    }
    // The system takes a long log apart when its last handle is closed.
    std::thread::spawn(move || drop(scan));
    Finished {
        bytes: std::fs::metadata(&path).map_or(0, |metadata| metadata.len()),
        path,
        account,
        notes,
    }
}

/// Whether `file` was made of this log: the same episode with the same digests of all
/// streams. `false` without digests.
fn is_made_of(file: &Path, scan: &Scan, account: &Account) -> bool {
    let header = scan
        .preamble
        .started
        .as_ref()
        .and_then(|s| s.header.as_ref());
    let Some(header) = header else {
        return false;
    };
    let Ok(episode) = Episode::open(file) else {
        return false;
    };
    let is_same = |run: &(String, u64)| run.0 == header.run_id && run.1 == header.episode;
    let Ok(summary) = episode.summary() else {
        return false;
    };
    let mut expected = account.streams.iter().filter(|stream| stream.received > 0);
    episode.run().is_ok_and(|run| is_same(&run))
        && summary.complete == account.complete()
        && account.total(|stream| stream.received) > 0
        && expected.all(|stream| !stream.digest.is_empty() && summary.streams.contains(stream))
}

/// Locks the name under which a file is made: a log of the same name may be made into
/// a file of the same folder at the same time. Unlike HDF5's own lock this one does not
/// get inherited by child processes.
fn claim(temporary: &Path) -> std::io::Result<Locked> {
    for _ in 0..CLAIMS {
        let mut opening = File::options();
        let file = opening.create(true).truncate(false).write(true);
        let file = file.open(temporary)?;
        let Ok(file) = Locked::lock(file) else {
            break;
        };
        // Its owner may have renamed it just now.
        if is_at(&file, temporary) {
            return Ok(file);
        }
    }
    Err(std::io::Error::new(
        std::io::ErrorKind::ResourceBusy,
        "another program is making it just now",
    ))
}

/// Whether `target` is an empty file that a recorder left beside its own log:
/// it died while it gave the file its name, on a file system that cannot do so
/// in one step.
fn is_placeholder(target: &Path, log: &Path) -> bool {
    let own = target.with_added_extension("wal") == *log;
    let found = target.symlink_metadata();
    own && found.is_ok_and(|found| found.is_file() && found.len() == 0)
}

/// Writes the file and syncs it meanwhile.
fn write(path: &Path, scan: &Scan, account: &Account) -> Result<(), FinishError> {
    let io = |source| FinishError::Io {
        path: path.to_owned(),
        log: scan.path().to_owned(),
        source,
    };
    let file = hdf::unlocked().create(path)?;
    let syncing = File::open(path).map_err(io)?;
    let (done, ended) = crossbeam_channel::bounded(0);
    std::thread::scope(|scope| {
        // The kernel reports a disk error to one sync only, so that this one's
        // result matters as much as that of the last.
        let synced = scope.spawn(move || sync(&syncing, &ended));
        let filled = fill(file, path, scan, account);
        drop(done);
        let failed = || std::io::Error::other("the thread that syncs it panicked");
        let synced = synced.join().unwrap_or_else(|_| Err(failed()));
        filled.and_then(|()| synced.map_err(io))
    })
}

/// Syncs periodically until `ended` is closed.
fn sync(file: &File, ended: &Receiver<()>) -> std::io::Result<()> {
    while ended.recv_timeout(SYNC_PERIOD) == Err(RecvTimeoutError::Timeout) {
        publish::sync_data(file)?;
    }
    Ok(())
}

fn fill(file: hdf5::File, path: &Path, scan: &Scan, account: &Account) -> Result<(), FinishError> {
    let started = scan.preamble.started.clone().unwrap_or_default();
    let evaluation_stream = index(scan, "evaluation");
    let last = last_evaluation(scan, evaluation_stream)?;
    let robot = started.robot.clone().or_else(|| first_robot().ok());
    let robot = robot.unwrap_or_default();
    let context = Context {
        objects: started.objects.clone(),
        furniture_joints: started.joints.clone(),
        furniture_turns: (started.joint_types())
            .map(|motion| motion == v1::JointType::Revolute)
            .collect(),
        vertices: vertices(scan, index(scan, "deformable"))?,
        conditions: conditions(scan, evaluation_stream)?,
        ..Context::from_description(&robot)
    };
    root::attributes(&file, scan, account, last.as_ref(), &context)?;
    root::scenario(&file, scan)?;
    root::initial_state(&file, &scan.preamble)?;
    root::packs(&file, &scan.preamble)?;
    root::robot(&file, &robot)?;

    let group = file.create_group("streams")?;
    let cameras = group.create_group("camera")?;
    let sensors = match started.sensors.is_empty() {
        true => None,
        false => Some(group.create_group("sensor")?),
    };
    let depth = scan.preamble.depth();
    let mut visibility = Visibility::new(&scan.preamble);
    let mut counts = BTreeMap::new();
    let mut rows = begun(&started);
    let mut buffer = Vec::new();
    for (number, name) in scan.preamble.streams.iter().enumerate() {
        let samples = streams::samples(scan, number);
        let id = StreamId::parse(name);
        if id == StreamId::EVENTS {
            for entry in &samples {
                rows.extend(Row::event(scan.payload(entry, &mut buffer)?));
            }
            continue;
        }
        if id == StreamId::State(TopicId::Phase) {
            let mut phases = Phases::default();
            for entry in &samples {
                rows.extend(phases.changed(scan.payload(entry, &mut buffer)?));
            }
        }
        let stream = if let Some(camera) = id.camera_name() {
            let stream = cameras.create_group(camera)?;
            read_ahead(scan, &samples, |payloads| {
                streams::camera(&stream, camera, depth, payloads, &samples)
            })?;
            visibility.add(&stream)?;
            stream
        } else if let Some((sensor, sensors)) = id.sensor_name().zip(sensors.as_ref()) {
            let stream = sensors.create_group(sensor)?;
            read_ahead(scan, &samples, |payloads| {
                streams::sensor(&stream, sensor, payloads, &samples)
            })?;
            stream
        } else {
            let stream = group.create_group(name)?;
            match columns::for_stream(&id) {
                Some(table) => {
                    let irregular = streams::state(&stream, table, &context, scan, &samples)?;
                    Attributes::for_object(&stream).set("irregular_samples", irregular as u64)?;
                }
                None => streams::unknown(&stream, scan, &samples)?,
            }
            stream
        };
        counts.insert(format!("streams/{name}"), samples.len());
        if let Some(account) = account.streams.iter().find(|a| a.stream == *name) {
            root::account(&stream, account)?;
        }
    }
    visibility.finish(&file)?;
    rows.extend(ended(scan));
    let events = events::write(&file, rows)?;
    if let Some(a) = account
        .streams
        .iter()
        .find(|a| StreamId::parse(&a.stream) == StreamId::EVENTS)
    {
        root::account(&file.group("events")?, a)?;
    }
    counts.insert("events".to_owned(), events);
    drop((group, cameras, sensors));
    file.flush()?;
    file.close()?;
    verify(path, &counts)
}

/// Rows of `/events` for the start of the episode.
fn begun(started: &v1::EpisodeStarted) -> Vec<Row> {
    let row = |kind, text: &str| Row::new(started.header.clone(), "episode", kind, text);
    vec![
        row("started", &started.label),
        row("instruction", &started.instruction),
    ]
}

/// How it ended, if the server reported it.
fn ended(scan: &Scan) -> Option<Row> {
    let stopped = scan.closing.as_ref()?.stopped.as_ref()?;
    let success = stopped.evaluation.as_ref().is_some_and(|e| e.success);
    let text = match stopped.cause() {
        v1::EndCause::Physics => "the physics broke",
        _ if success => "success",
        _ => "no success",
    };
    let header = stopped.header.clone();
    Some(Row::new(header, "episode", "stopped", text))
}

/// Opens the written file again and compares every dataset's length.
fn verify(path: &Path, counts: &BTreeMap<String, usize>) -> Result<(), FinishError> {
    let file = hdf::unlocked().open(path)?;
    for (name, &expected) in counts {
        for data in file.group(name)?.datasets()? {
            let samples = data.shape().first().copied().unwrap_or(0);
            // Images have one chunk per sample; one that was not written
            // would read as zeros.
            let chunks = match data.chunk() {
                Some(chunk) if chunk.len() > 2 && chunk[0] == 1 => data.num_chunks(),
                _ => None,
            };
            for got in [Some(samples), chunks].into_iter().flatten() {
                if got != expected {
                    return Err(FinishError::Verify {
                        dataset: data.name(),
                        got,
                        expected,
                    });
                }
            }
        }
    }
    Ok(())
}

fn index(scan: &Scan, stream: &str) -> Option<usize> {
    scan.preamble.streams.iter().position(|s| s == stream)
}

/// The task's state at the end: by the server's closing message, or else by
/// the last sample.
fn last_evaluation(
    scan: &Scan,
    stream: Option<usize>,
) -> Result<Option<v1::Evaluation>, FinishError> {
    let closing = scan.closing.as_ref().and_then(|c| c.stopped.as_ref());
    if let Some(evaluation) = closing.and_then(|s| s.evaluation.clone()) {
        return Ok(Some(evaluation));
    }
    let Some(stream) = stream else {
        return Ok(None);
    };
    let Some(last) = streams::samples(scan, stream).pop() else {
        return Ok(None);
    };
    Ok(v1::Evaluation::decode(scan.payload(last, &mut Vec::new())?).ok())
}

/// Vertices of the deformable object in the first sample that has it.
fn vertices(scan: &Scan, stream: Option<usize>) -> Result<usize, FinishError> {
    let first = stream.and_then(|stream| streams::samples(scan, stream).into_iter().next());
    let Some(first) = first else {
        return Ok(0);
    };
    let sample = v1::Deformable::decode(scan.payload(first, &mut Vec::new())?);
    Ok(sample.map_or(0, |shape| shape.vertices.len() / 3))
}

/// Names of all conditions in the order in which they first appear.
fn conditions(scan: &Scan, stream: Option<usize>) -> Result<Vec<String>, FinishError> {
    let mut out: Vec<String> = Vec::new();
    let Some(stream) = stream else {
        return Ok(out);
    };
    let mut buffer = Vec::new();
    for entry in streams::samples(scan, stream) {
        let Ok(sample) = v1::Evaluation::decode(scan.payload(entry, &mut buffer)?) else {
            continue;
        };
        for condition in sample.conditions {
            if !out.contains(&condition.name) {
                out.push(condition.name);
            }
        }
    }
    Ok(out)
}
