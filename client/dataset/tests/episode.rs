//! Laws of episode files: every number survives bit for bit, a log that ends
//! anywhere gives its valid prefix, a full disk loses nothing acknowledged,
//! nothing is ever overwritten, and h5py reads it all.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use synthetic::Random;
use wheelarm_dataset::align::{AlignOptions, align};
use wheelarm_dataset::columns::{Cell, Context, Kind, MAX_CONTACTS, header_of, streams};
use wheelarm_dataset::depth::Depth;
use wheelarm_dataset::finish::{FinishError, finish};
use wheelarm_dataset::log::{Closing, LogFile, Received, scan};
use wheelarm_dataset::read::{Episode, Values};
use wheelarm_dataset::validate::validate;
use wheelarm_dataset::writer::{EpisodeWriter, WriteError, WriterOptions, log_path};
use wheelarm_proto::{Message, StreamId, digest, v1};

const SIZE: (u32, u32) = (32, 20);

/// Everything that was offered to a writer, by stream in order.
type Offered = BTreeMap<String, Vec<Bytes>>;

fn camera_frame(r: &mut Random, camera: &str, sequence: u64) -> Bytes {
    let header = synthetic::header(sequence, 24 * sequence);
    let frame = synthetic::frame(camera, header, SIZE, |x, y| {
        let depth = match (x + y) % 7 {
            0 => f32::INFINITY,
            _ => 0.5 + (r.below(1000) as f32) * 0.01,
        };
        ([x as u8, y as u8, r.below(256) as u8], depth, (x % 3) as u8)
    });
    Bytes::from(frame.encode_to_vec())
}

/// Offers `samples` of every stream, mixed, with sequence numbers from 100.
fn offer_all(writer: &mut EpisodeWriter, seed: u64, samples: u64) -> Offered {
    let mut r = Random(seed);
    let mut offered = Offered::new();
    for i in 0..samples {
        for stream in &StreamId::all([], [])
            .map(|s| s.to_string())
            .collect::<Vec<_>>()
        {
            let header = synthetic::header(100 + i, 4 * i);
            let payload = Bytes::from(r.message(stream, header, 3));
            writer.offer(stream, payload.clone()).unwrap();
            offered.entry(stream.clone()).or_default().push(payload);
        }
        if i % 6 == 0 {
            for camera in ["gen3", "wheelchair"] {
                let payload = camera_frame(&mut r, camera, i / 6);
                let stream = StreamId::camera(camera).to_string();
                writer.offer(&stream, payload.clone()).unwrap();
                offered.entry(stream).or_default().push(payload);
            }
        }
    }
    offered
}

fn manifest(offered: &Offered) -> Vec<(String, u64, u64)> {
    let first = |s: &str| if s.starts_with("camera/") { 0 } else { 100 };
    offered
        .iter()
        .map(|(s, list)| (s.clone(), first(s), list.len() as u64))
        .collect()
}

fn closing(offered: &Offered) -> Closing {
    Closing {
        stopped: Some(synthetic::stopped(600, &manifest(offered))),
        ..Default::default()
    }
}

fn record(dir: &Path, label: &str, options: &WriterOptions, samples: u64) -> (PathBuf, Offered) {
    let started = synthetic::started(label);
    let mut writer = EpisodeWriter::open(dir, &started, &synthetic::snapshot(), options).unwrap();
    let offered = offer_all(&mut writer, 1, samples);
    let log = writer.close(closing(&offered)).unwrap();
    (log, offered)
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Whether two cells hold the same, NaN for NaN.
fn same(a: &Cell, b: &Cell) -> bool {
    let equal = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
    match (a, b) {
        (Cell::F64(a), Cell::F64(b)) => a.len() == b.len() && a.iter().zip(b).all(equal),
        (a, b) => a == b,
    }
}

#[test]
fn every_stream_survives_the_file_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    // More samples than one chunk has rows.
    let (log, offered) = record(dir.path(), "exact", &WriterOptions::default(), 1100);
    let finished = finish(&log, None).unwrap();
    assert!(
        finished.account.complete(),
        "{:?}",
        finished.account.problems
    );
    assert!(!log.exists());

    let episode = Episode::open(&finished.path).unwrap();
    let context = Context {
        objects: synthetic::started("").objects,
        furniture_joints: synthetic::started("").joints,
        vertices: 4,
        conditions: episode.names("evaluation", "condition_holds").unwrap(),
        ..Context::of(&episode.robot().unwrap())
    };
    assert_eq!(context.conditions.len(), 3);
    for stream in streams() {
        let name = stream.name();
        let rows: Vec<Vec<Cell>> = offered[name]
            .iter()
            .map(|p| stream.extract(p, &context).unwrap().0)
            .collect();
        // Put together again, a sample is stored as it was: no column is lost.
        let samples = episode.samples(name).unwrap();
        for (i, row) in rows.iter().enumerate() {
            let again = samples.encoded(i).unwrap();
            let (cells, regular) = stream.extract(&again, &context).unwrap();
            assert!(regular, "{name}, sample {i}");
            for (column, (cell, was)) in stream.columns().iter().zip(cells.iter().zip(row)) {
                // A file holds so many contacts, and how many there were.
                let cut = |cell: &Cell| match cell {
                    Cell::U64(v) if column.name == "count" => {
                        Cell::U64(vec![v[0].min(MAX_CONTACTS as u64)])
                    }
                    cell => cell.clone(),
                };
                let what = format!("{name}/{}: {cell:?}, was {was:?}", column.name);
                assert!(same(&cut(cell), &cut(was)), "{what}");
            }
            let header = header_of(&again).unwrap();
            assert_eq!(header.sequence, 100 + i as u64, "{name}");
        }
        for (c, column) in stream.columns().into_iter().enumerate() {
            let cells = rows.iter().map(|row| &row[c]);
            let what = format!("{name}/{}", column.name);
            match column.kind {
                Kind::F64 => {
                    let all: Vec<f64> = cells
                        .flat_map(|c| match c {
                            Cell::F64(v) => v.clone(),
                            _ => Vec::new(),
                        })
                        .collect();
                    let read = episode.f64s(name, column.name).unwrap();
                    assert_eq!(read.shape()[0], 1100, "{what}");
                    assert_eq!(bits(read.as_slice().unwrap()), bits(&all), "{what}");
                }
                Kind::U64 => {
                    let all: Vec<u64> = cells
                        .flat_map(|c| match c {
                            Cell::U64(v) => v.clone(),
                            _ => Vec::new(),
                        })
                        .collect();
                    assert_eq!(episode.u64s(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Flag => {
                    let all: Vec<bool> = cells
                        .flat_map(|c| match c {
                            Cell::Flag(v) => v.iter().map(|&b| b != 0).collect(),
                            _ => Vec::new(),
                        })
                        .collect();
                    assert_eq!(episode.flags(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Text => {
                    let all: Vec<String> = cells
                        .map(|c| match c {
                            Cell::Text(v) => v.clone(),
                            _ => String::new(),
                        })
                        .collect();
                    assert_eq!(episode.texts(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Bytes => {}
            }
        }
        let sequences: Vec<u64> = (100..1200).collect();
        assert_eq!(episode.u64s(name, "sequence").unwrap(), sequences);
    }
    // What replay reads are the very messages.
    let sent: Vec<Vec<u8>> = offered["applied"].iter().map(|p| p.to_vec()).collect();
    let read: Vec<Vec<u8>> = episode
        .applied()
        .unwrap()
        .iter()
        .map(Message::encode_to_vec)
        .collect();
    assert_eq!(read, sent);
    assert_eq!(episode.state_hashes().unwrap().len(), 1100);
    assert_eq!(episode.snapshot().unwrap(), synthetic::snapshot());
    assert_eq!(episode.started().unwrap(), synthetic::started("exact"));
    assert_eq!(
        episode.scenario().unwrap(),
        synthetic::started("exact").scenario.unwrap()
    );
    let events = episode.texts("event", "source").unwrap();
    assert_eq!(events.iter().filter(|s| *s == "event").count(), 1100);

    for camera in ["gen3", "wheelchair"] {
        let sent = &offered[&format!("camera/{camera}")];
        let read = episode.camera(camera).unwrap();
        assert_eq!(read.len(), sent.len());
        for (i, payload) in sent.iter().enumerate() {
            let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
            let frame = read.frame(&episode, i).unwrap();
            let depth: Vec<u8> = frame.depth.iter().flat_map(|d| d.to_le_bytes()).collect();
            assert_eq!(frame.rgb, sent.rgb);
            assert_eq!(depth, sent.depth);
            assert_eq!(wheelarm_dataset::ids::write(&frame.ids, 2), sent.ids);
            assert_eq!(Some(frame.intrinsics), sent.intrinsics);
            assert_eq!(frame.pose, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
        }
    }
    let summary = episode.summary().unwrap();
    assert!(summary.complete && summary.success);
    assert_eq!(summary.conditions.len(), 2);
}

#[test]
fn a_log_that_ends_or_breaks_anywhere_gives_its_valid_prefix() {
    let dir = tempfile::tempdir().unwrap();
    let (log, _) = record(dir.path(), "whole", &WriterOptions::default(), 13);
    let whole = std::fs::read(&log).unwrap();
    let full = scan(&log).unwrap();
    assert!(full.damage.is_none() && full.closing.is_some());
    let ends: Vec<u64> = full
        .entries
        .iter()
        .map(|e| e.offset + e.length as u64)
        .collect();
    let first = full.entries[0].offset - 40;

    let broken = dir.path().join("broken.wal");
    let mut r = Random(5);
    for case in 0..300 {
        let mut bytes = whole.clone();
        let at = r.below(whole.len() as u64);
        if case % 2 == 0 {
            bytes.truncate(at as usize);
        } else {
            bytes[at as usize] ^= 1 << r.below(8);
        }
        std::fs::write(&broken, &bytes).unwrap();
        if at < first {
            assert!(scan(&broken).is_err(), "a damaged preamble was taken");
            continue;
        }
        let kept = scan(&broken).unwrap();
        let expected = ends.iter().filter(|&&end| end <= at).count();
        assert_eq!(kept.entries[..], full.entries[..expected], "cut at {at}");
        assert_eq!(kept.good + kept.lost, bytes.len() as u64);
        assert_eq!(kept.closing, None);
        // A cut between two records loses nothing that the file could show.
        assert_eq!(kept.damage.is_some(), kept.lost > 0);
    }
}

#[test]
fn recovery_of_a_torn_log_gives_a_valid_partial_file() {
    let dir = tempfile::tempdir().unwrap();
    let (log, _) = record(dir.path(), "torn", &WriterOptions::default(), 13);
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() * 2 / 3]).unwrap();
    let kept = scan(&log).unwrap().entries.len() as u64;
    let out = dir.path().join("elsewhere");
    let finished = finish(&log, Some(&out)).unwrap();
    assert_eq!(finished.path, out.join("torn.h5"));
    assert!(!finished.account.complete());
    assert_eq!(finished.account.total(|s| s.received), kept);
    let summary = Episode::open(&finished.path).unwrap().summary().unwrap();
    assert!(!summary.complete);
    assert!(summary.problems.len() >= 2, "{:?}", summary.problems);
}

#[test]
fn missing_samples_make_the_file_partial_and_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("gap");
    let mut writer = EpisodeWriter::open(
        dir.path(),
        &started,
        &synthetic::snapshot(),
        &WriterOptions::default(),
    )
    .unwrap();
    let mut r = Random(2);
    // 5 is missing, 7 comes late, 8 comes twice.
    for sequence in [3, 4, 6, 8, 8, 7] {
        let payload = r.message("imu", synthetic::header(sequence, sequence), 0);
        writer.offer("imu", payload.into()).unwrap();
    }
    let counts = [("imu".to_owned(), 3, 7)];
    let log = writer
        .close(Closing {
            stopped: Some(synthetic::stopped(9, &counts)),
            ..Default::default()
        })
        .unwrap();
    let finished = finish(&log, None).unwrap();
    let imu = finished
        .account
        .streams
        .iter()
        .find(|s| s.stream == "imu")
        .unwrap();
    // 5 and 9, which the manifest lists and which never came.
    assert_eq!((imu.expected, imu.received, imu.missed), (7, 5, 2));
    let episode = Episode::open(&finished.path).unwrap();
    assert_eq!(episode.u64s("imu", "sequence").unwrap(), [3, 4, 6, 7, 8]);
    assert!(!episode.summary().unwrap().complete);
}

#[test]
fn an_existing_file_is_never_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let (log, _) = record(dir.path(), "twice", &WriterOptions::default(), 3);
    let started = synthetic::started("twice");
    let open = || {
        EpisodeWriter::open(
            dir.path(),
            &started,
            &synthetic::snapshot(),
            &WriterOptions::default(),
        )
    };
    assert!(matches!(open(), Err(WriteError::Unfinished(_))));

    // The file appears between the start and the end of a recording.
    let file = dir.path().join("twice.h5");
    std::fs::write(&file, "mine").unwrap();
    assert!(matches!(
        finish(&log, None),
        Err(FinishError::Exists { .. })
    ));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    assert!(log.exists(), "the log must stay");
    assert!(matches!(open(), Err(WriteError::Exists(_))));

    std::fs::remove_file(&file).unwrap();
    assert!(finish(&log, None).unwrap().account.complete());
    let names: Vec<_> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(names, ["twice.h5"], "nothing else may be left behind");
}

/// A disk with room for `left` bytes; it writes what fits, as disks do.
struct FullDisk {
    file: std::fs::File,
    left: usize,
}

impl LogFile for FullDisk {
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let fits = bytes.len().min(self.left);
        self.left -= fits;
        self.file.append(&bytes[..fits])?;
        if fits < bytes.len() {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        Ok(())
    }

    fn truncate(&mut self, length: u64) -> std::io::Result<()> {
        self.file.truncate(length)
    }
}

#[test]
fn a_full_disk_keeps_what_was_acknowledged_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("full");
    let log = log_path(dir.path(), "full");
    let file = std::fs::File::options()
        .append(true)
        .create_new(true)
        .open(&log)
        .unwrap();
    let disk = FullDisk {
        file,
        left: 200_000,
    };
    let mut writer = EpisodeWriter::over(
        disk,
        None,
        log.clone(),
        dir.path().join("full.h5"),
        &started,
        &synthetic::snapshot(),
        &WriterOptions::default(),
    )
    .unwrap();
    let mut r = Random(3);
    let problem = (0..)
        .find_map(|i| {
            let payload = r.message("applied", synthetic::header(i, i), 0);
            writer.offer("applied", payload.into()).err()
        })
        .unwrap();
    assert!(problem.to_string().contains("free space"), "{problem}");
    let acknowledged = writer.acknowledged();
    assert!(writer.close(Closing::default()).is_err());

    let kept = scan(&log).unwrap();
    assert!(acknowledged > 10);
    assert_eq!(kept.entries.len() as u64, acknowledged);
    assert_eq!(kept.lost, 0, "the torn record must be cut off");
    let finished = finish(&log, None).unwrap();
    assert!(!finished.account.complete());
    assert_eq!(finished.account.total(|s| s.received), acknowledged);
}

#[test]
fn depth_in_millimetres_is_the_rounded_depth_in_metres() {
    let dir = tempfile::tempdir().unwrap();
    let options = WriterOptions {
        depth: Depth::Millimetres,
        ..Default::default()
    };
    let (log, offered) = record(dir.path(), "mm", &options, 7);
    let episode = Episode::open(&finish(&log, None).unwrap().path).unwrap();
    let camera = episode.camera("gen3").unwrap();
    for (i, payload) in offered["camera/gen3"].iter().enumerate() {
        let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
        let read = camera.frame(&episode, i).unwrap();
        for (bytes, &metres) in sent.depth.chunks_exact(4).zip(&read.depth) {
            let exact = f32::from_le_bytes(bytes.try_into().unwrap());
            let same = exact.is_infinite() && metres.is_infinite();
            assert!(same || (exact - metres).abs() <= 5.1e-4, "{exact} {metres}");
        }
    }
    assert_eq!(episode.summary().unwrap().depth_unit, "mm");
}

#[test]
fn without_depth_there_are_colour_and_ids_as_they_came() {
    let dir = tempfile::tempdir().unwrap();
    let options = WriterOptions {
        depth: Depth::Nothing,
        ..Default::default()
    };
    let (log, offered) = record(dir.path(), "colour", &options, 7);
    let finished = finish(&log, None).unwrap();
    let episode = Episode::open(&finished.path).unwrap();
    let camera = episode.camera("gen3").unwrap();
    assert!(camera.has_rgb() && !camera.has_depth());
    assert_eq!(camera.len(), offered["camera/gen3"].len());
    for (i, payload) in offered["camera/gen3"].iter().enumerate() {
        let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
        let read = camera.frame(&episode, i).unwrap();
        assert_eq!(read.rgb, sent.rgb);
        assert!(read.depth.is_empty());
        assert!(camera.encoded(&episode, i).unwrap().is_none());
    }
    let asked = camera.depth(&episode, 0).unwrap_err().to_string();
    assert!(asked.contains("depth"), "{asked}");
    assert_eq!(episode.summary().unwrap().depth_unit, "none");
}

#[test]
fn samples_of_the_wrong_kind_are_refused_and_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = EpisodeWriter::open(
        dir.path(),
        &synthetic::started("bad"),
        &synthetic::snapshot(),
        &WriterOptions::default(),
    )
    .unwrap();
    let mut r = Random(4);
    let good = camera_frame(&mut r, "gen3", 0);
    assert!(
        writer
            .offer("camera/gen3", good.slice(..good.len() - 1))
            .is_err()
    );
    let cut = v1::CameraFrame {
        rgb: Bytes::from_static(b"short"),
        ..v1::CameraFrame::decode(good.clone()).unwrap()
    };
    assert!(
        writer
            .offer("camera/gen3", cut.encode_to_vec().into())
            .is_err()
    );
    assert!(
        writer
            .offer("imu", Bytes::from_static(b"\xff\xff"))
            .is_err()
    );
    assert!(writer.offer("nobody", Bytes::new()).is_err());
    writer.offer("camera/gen3", good).unwrap();
    let log = writer.close(Closing::default()).unwrap();
    assert_eq!(scan(&log).unwrap().entries.len(), 1);
    assert!(!finish(&log, None).unwrap().account.complete());
}

#[test]
fn pictures_whose_ids_have_8_bits_are_read_like_those_of_16() {
    let dir = tempfile::tempdir().unwrap();
    let mut r = Random(5);
    let wide = v1::CameraFrame::decode(camera_frame(&mut r, "gen3", 0)).unwrap();
    let ids = wheelarm_dataset::ids::read(&wide.ids, 2);
    // As the first contract sent it: 8 bits, and no word on formats.
    let narrow = v1::CameraFrame {
        ids: wheelarm_dataset::ids::write(&ids, 1).into(),
        rgb_format: 0,
        depth_format: 0,
        ids_format: 0,
        ..wide.clone()
    };
    for (label, frame, each) in [("narrow", narrow, 1), ("wide", wide, 2)] {
        let started = synthetic::started(label);
        let options = WriterOptions::default();
        let mut writer =
            EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
        let sent = frame.encode_to_vec();
        writer.offer("camera/gen3", sent.clone().into()).unwrap();
        let log = writer.close(Closing::default()).unwrap();
        let episode = Episode::open(&finish(&log, None).unwrap().path).unwrap();
        let camera = episode.camera("gen3").unwrap();
        assert_eq!(camera.id_bytes(), each);
        assert_eq!(camera.ids(&episode, 0).unwrap(), ids);
        // The message is made again to the bit: its digest holds.
        assert_eq!(camera.encoded(&episode, 0).unwrap(), Some(sent));
    }
}

#[test]
fn commands_of_one_tick_and_pauses_between_them_are_no_faults() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("byhand");
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
    let mut r = Random(3);
    // Several in a tick, then silence, as a person sends them.
    for (sequence, tick) in [0, 4, 4, 8, 8, 8, 12, 240].into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        let payload = r.message("command", header, 0);
        writer.offer("command", payload.into()).unwrap();
    }
    for (sequence, tick) in [0, 4, 4, 240].into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        writer
            .offer("clock", r.message("clock", header, 0).into())
            .unwrap();
    }
    let counts = [("command".to_owned(), 0, 8), ("clock".to_owned(), 0, 4)];
    let closing = Closing {
        stopped: Some(synthetic::stopped(240, &counts)),
        ..Default::default()
    };
    let finished = finish(&writer.close(closing).unwrap(), None).unwrap();
    let found = validate(&finished.path, 1).unwrap();
    let about = |stream: &str| -> Vec<&String> {
        let begins = |p: &&String| p.starts_with(stream);
        found.problems.iter().filter(begins).collect()
    };
    assert!(about("command: ").is_empty(), "{:?}", found.problems);
    // A stream with a rate of its own is still held to it.
    let [order, gap] = &about("clock: ")[..] else {
        panic!("{:?}", found.problems)
    };
    assert!(order.contains("do not rise at sample 2"), "{order}");
    assert!(gap.contains("1 gaps"), "{gap}");
}

#[test]
fn of_the_commands_of_one_tick_the_last_is_aligned() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("aligned");
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
    let mut r = Random(3);
    // As in real time by hand: more often than not several in a tick.
    let ticks = [0, 4, 4, 8, 8, 12, 16, 20, 20, 24, 24, 24, 28, 28, 48];
    for (sequence, tick) in ticks.into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        let payload = r.message("command", header, 0);
        writer.offer("command", payload.into()).unwrap();
    }
    // At the ticks 0, 24 and 48.
    for sequence in 0..3 {
        let payload = camera_frame(&mut r, "gen3", sequence);
        writer.offer("camera/gen3", payload).unwrap();
    }
    let counts = [
        ("command".to_owned(), 0, 15),
        ("camera/gen3".to_owned(), 0, 3),
    ];
    let closing = Closing {
        stopped: Some(synthetic::stopped(48, &counts)),
        ..Default::default()
    };
    let finished = finish(&writer.close(closing).unwrap(), None).unwrap();
    let episode = Episode::open(&finished.path).unwrap();
    let aligned = align(&episode, &AlignOptions::default(), &|_| true).unwrap();
    assert_eq!(aligned.coverage["command"].valid, [true; 3]);
    let mut compared = 0;
    for signal in aligned
        .signals
        .iter()
        .filter(|s| s.meta.stream == "command")
    {
        let width = signal.meta.width();
        let Values::F64(all) = episode.values(&signal.meta).unwrap() else {
            continue;
        };
        // The last of those that came at the picture's tick.
        for (row, sample) in [0, 11, 14].into_iter().enumerate() {
            let there = &all[sample * width..(sample + 1) * width];
            assert_eq!(bits(signal.row(row)), bits(there), "{}", signal.meta.name);
        }
        compared += 1;
    }
    assert!(compared >= 3, "{compared} columns");
}

#[test]
fn what_was_changed_after_recording_is_found_by_the_digest() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("digest");
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
    let offered = offer_all(&mut writer, 5, 20);
    let received: Vec<Received> = offered
        .iter()
        .map(|(stream, payloads)| {
            let all: Vec<_> = payloads
                .iter()
                .map(|p| digest::of_message([&p[..]]))
                .collect();
            Received {
                stream: stream.clone(),
                digest: digest::StreamDigest::of(&all).to_vec(),
                doubtful: 0,
            }
        })
        .collect();
    let mut stopped = synthetic::stopped(600, &manifest(&offered));
    for line in &mut stopped.manifest {
        let same = received.iter().find(|r| r.stream == line.stream);
        line.digest = same.map(|r| r.digest.clone()).unwrap_or_default();
    }
    let closing = Closing {
        stopped: Some(stopped),
        received,
        ..Default::default()
    };
    let finished = finish(&writer.close(closing).unwrap(), None).unwrap();
    assert!(
        finished.account.complete(),
        "{:?}",
        finished.account.problems
    );
    let facts = validate(&finished.path, 1).unwrap().facts;
    for stream in ["applied", "command", "camera/gen3", "camera/wheelchair"] {
        let said = |f: &String| f.starts_with(&format!("{stream}: ")) && f.contains("digest");
        assert!(facts.iter().any(said), "{stream}: {facts:?}");
    }
    // One stamp of one picture, one nanosecond.
    let file = hdf5::File::open_rw(&finished.path).unwrap();
    let data = file.dataset("streams/camera/gen3/stamp_nanos").unwrap();
    let mut stamps: Vec<u64> = data.read_raw().unwrap();
    stamps[1] += 1;
    data.write_raw(&stamps).unwrap();
    file.close().unwrap();
    let problems = validate(&finished.path, 1).unwrap().problems;
    let named = |p: &String| p.starts_with("camera/gen3: the messages in the file are not");
    assert!(problems.iter().any(named), "{problems:?}");
}
