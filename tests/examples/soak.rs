//! Episodes of half a second, one right after the other, every third discarded,
//! a reset now and then: every file must be complete and every discarded
//! episode gone. `cargo run --release --example soak -- [EPISODES]`, 300 by
//! default; `make soak`.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use wheelarm_dataset::read::Episode;
use wheelarm_proto::v1;
use wheelarm_tests::{Recorder, Server};

const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@10", "--quality", "fast"];
const LENGTH: Duration = Duration::from_millis(500);

fn main() -> anyhow::Result<()> {
    let episodes: u64 = std::env::args().nth(1).map_or(Ok(300), |n| n.parse())?;
    let server = Server::start("soak", &CAMERA)?;
    let client = server.client();
    let folder = tempfile::tempdir()?;
    // The recorder ends with the last one that is kept: that is the last of all.
    let is_discarded = |i: u64| i % 3 == 2 && i + 1 < episodes;
    let kept: BTreeSet<String> = (0..episodes)
        .filter(|i| !is_discarded(*i))
        .map(|i| format!("e{i}.h5"))
        .collect();
    let count = kept.len().to_string();
    let mut recorder = Recorder::start(&server, "soak", folder.path(), &["--episodes", &count]);
    while client.request(&v1::StatusRequest {})?.recorders.is_empty() {
        std::thread::sleep(Duration::from_millis(50));
    }
    let begun = Instant::now();
    for i in 0..episodes {
        let request = v1::EpisodeStartRequest {
            label: format!("e{i}"),
            require_recorders: 1,
            ..Default::default()
        };
        let _: v1::EpisodeStarted = client.request(&request)?;
        loop {
            let status: v1::Status = client.request(&v1::StatusRequest {})?;
            if status.episode.is_none() {
                bail!("episode e{i} ended before it began: {:?}", status.recorders);
            }
            if status.waiting_for.is_empty() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(LENGTH);
        let request = v1::EpisodeStopRequest {
            discard: is_discarded(i),
            ..Default::default()
        };
        let _: v1::EpisodeStopped = client.request(&request)?;
        if i % 7 == 6 {
            let _: v1::ResetReply = client.request(&v1::ResetRequest::default())?;
        }
    }
    let (status, text) = recorder.end();
    let mut found = BTreeSet::new();
    let mut partial = Vec::new();
    for entry in std::fs::read_dir(folder.path())? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".h5") {
            let summary = Episode::open(&entry.path())
                .and_then(|e| e.summary())
                .with_context(|| name.clone())?;
            if !summary.complete {
                partial.push(format!("{name}: {}", summary.problems.join("; ")));
            }
        }
        found.insert(name);
    }
    println!(
        "{episodes} episodes in {:.0} s: {} files, {} partial, {} discarded",
        begun.elapsed().as_secs_f64(),
        found.len(),
        partial.len(),
        text.matches(": discarded").count()
    );
    for line in &partial {
        println!("  PARTIAL {line}");
    }
    let missing: Vec<_> = kept.difference(&found).collect();
    let wrong: Vec<_> = found.difference(&kept).collect();
    ensure!(missing.is_empty(), "missing: {missing:?}");
    ensure!(wrong.is_empty(), "not discarded, or left over: {wrong:?}");
    ensure!(partial.is_empty() && status.success(), "{status}: {text}");
    Ok(())
}
