//! Digests reveal changes after recording.

use std::path::{Path, PathBuf};

use wheelarm_dataset::finish::finish;
use wheelarm_dataset::log::{Closing, Received};
use wheelarm_dataset::validate::validate;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_proto::digest;

use crate::recording::{manifest, offer_all};
use crate::synthetic;

/// The log of an episode whose streams all have digests.
fn record(dir: &Path) -> PathBuf {
    let started = synthetic::started("digest");
    let options = WriterOptions::default();
    let mut writer = EpisodeWriter::open(dir, &started, &synthetic::snapshot(), &options).unwrap();
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
                digest: digest::StreamDigest::from_messages(&all).to_vec(),
                doubtful: 0,
                compressed: Vec::new(),
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
    writer.close(closing).unwrap()
}

#[test]
fn a_log_whose_file_was_published_before_is_recovered_without_a_second_file() {
    let dir = tempfile::tempdir().unwrap();
    let log = record(dir.path());
    let bytes = std::fs::read(&log).unwrap();
    let first = finish(&log, None).unwrap();
    // The publisher of the file did not remove its log.
    std::fs::write(&log, &bytes).unwrap();
    let again = finish(&log, None).unwrap();
    assert_eq!((&again.path, again.bytes), (&first.path, first.bytes));
    assert!(!log.exists());
    // Another file of that name is never touched.
    std::fs::write(&log, &bytes).unwrap();
    std::fs::write(&first.path, "mine").unwrap();
    let error = finish(&log, None).unwrap_err().to_string();
    assert!(error.contains("exists already") && log.exists(), "{error}");
}

#[test]
fn changes_after_recording_are_found_by_the_digest() {
    let dir = tempfile::tempdir().unwrap();
    let finished = finish(&record(dir.path()), None).unwrap();
    assert!(
        finished.account.complete(),
        "{:?}",
        finished.account.problems
    );
    let facts = validate(&finished.path, 1).unwrap().facts;
    for stream in ["applied", "command", "camera/gen3", "camera/wheelchair"] {
        let names_it = |f: &String| f.starts_with(&format!("{stream}: ")) && f.contains("digest");
        assert!(facts.iter().any(names_it), "{stream}: {facts:?}");
    }
    // One stamp of one image, one nanosecond.
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
