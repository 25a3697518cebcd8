//! Losses: logs that end anywhere, samples that never arrive, a
//! full disk.

use wheelarm_dataset::finish::finish;
use wheelarm_dataset::log::{Closing, LogFile, scan};
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions, log_path};

use crate::recording::record;
use crate::synthetic::{self, Random};

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
        // A cut between two records loses no sample that the file could list.
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
    // 5 is missing, 7 arrives late, 8 arrives twice.
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
    // 5 and 9, which the manifest lists and which never arrived.
    assert_eq!((imu.expected, imu.received, imu.missed), (7, 5, 2));
    let episode = Episode::open(&finished.path).unwrap();
    assert_eq!(episode.u64s("imu", "sequence").unwrap(), [3, 4, 6, 7, 8]);
    assert!(!episode.summary().unwrap().complete);
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
fn a_full_disk_keeps_acknowledged_samples_and_is_reported() {
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
