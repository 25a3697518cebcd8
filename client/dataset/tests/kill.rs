//! The recorder's process is killed: every acknowledged sample is in
//! the file that is made of its log.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions, log_path};
use wheelarm_proto::Message;

const FOLDER: &str = "WHEELARM_KILL_TEST_FOLDER";

/// The killed process: records forever and prints the number of acknowledged samples.
#[test]
#[ignore = "runs only as the child of the test below"]
fn child() {
    let Some(dir) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return;
    };
    let started = synthetic::started("killed");
    let options = WriterOptions::default();
    let mut writer = EpisodeWriter::open(&dir, &started, &synthetic::snapshot(), &options).unwrap();
    let mut r = synthetic::Random(1);
    let mut out = std::io::stdout().lock();
    for i in 0.. {
        let header = || synthetic::header(i, 4 * i);
        let payload = r.message("applied", header(), 0);
        writer.offer("applied", payload.into()).unwrap();
        let frame = synthetic::frame("gen3", header(), (160, 90), |x, y| {
            ([x as u8, y as u8, r.below(256) as u8], 1.0 + x as f32, 0)
        });
        writer
            .offer("camera/gen3", frame.encode_to_vec().into())
            .unwrap();
        writeln!(out, "acknowledged {}", writer.acknowledged()).unwrap();
        out.flush().unwrap();
    }
}

#[test]
fn a_killed_recorder_loses_no_acknowledged_sample() {
    for round in 0..6 {
        let dir = tempfile::tempdir().unwrap();
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child", "--ignored", "--nocapture"])
            .env(FOLDER, dir.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let counts = output.lines().map_while(Result::ok).filter_map(|line| {
            let (_, count) = line.split_once("acknowledged ")?;
            count.parse::<u64>().ok()
        });
        // Killed somewhere among the writes of some sample.
        let acknowledged = counts.take(20 + 37 * round).last().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();

        let finished = finish(&log_path(dir.path(), "killed"), None).unwrap();
        let kept = finished.account.total(|s| s.received);
        assert!(kept >= acknowledged, "{kept} of {acknowledged}");
        assert!(!finished.account.complete());
        let episode = Episode::open(&finished.path).unwrap();
        let applied = episode.applied().unwrap().len() as u64;
        let camera = episode.camera("gen3").unwrap();
        assert_eq!(applied + camera.len() as u64, kept);
        if let Some(last) = camera.len().checked_sub(1) {
            let frame = camera.frame(&episode, last).unwrap();
            assert_eq!(frame.sequence, last as u64);
            assert_eq!(frame.depth[159], 160.0);
        }
    }
}
