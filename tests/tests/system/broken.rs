//! What breaks costs one episode: the physics, a server that dies, one that
//! hangs. Everything goes on, and the ledgers and files say what happened.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Client, ClientError};
use wheelarm_tests::{IdleCommander, Recorder, Server, printed, program, root, wait_until};

use super::faults_server::processes;

/// The scenario in force with the chair in the middle of a table.
fn chair_in_the_table(link: &Client) -> v1::Scenario {
    let scene: v1::SceneReply = link.request(&v1::SceneRequest {}).expect("the scene");
    let table = scene.bodies.iter().find(|b| b.name == "kitchen_table");
    let middle = table.and_then(|table| table.boxes.first()?.pose?.position);
    let middle = middle.expect("a table with a box");
    let status: v1::Status = link.request(&v1::StatusRequest {}).expect("the status");
    let mut scenario = status.scenario.expect("a scenario");
    scenario.start = Some(v1::Pose {
        position: Some(v1::Vector3 { z: 0.0, ..middle }),
        orientation: Some(v1::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    });
    scenario
}

fn reset(link: &Client, scenario: v1::Scenario) -> Result<v1::ResetReply, ClientError> {
    let request = v1::ResetRequest {
        scenario: Some(scenario),
        force: true,
        ..Default::default()
    };
    link.request(&request)
}

fn start(link: &Client, label: &str, recorders: u32) -> Result<v1::EpisodeStarted, ClientError> {
    let request = v1::EpisodeStartRequest {
        label: label.to_owned(),
        require_recorders: recorders,
        ..Default::default()
    };
    link.request(&request)
}

#[test]
fn physics_that_breaks_ends_the_episode_and_not_the_server() {
    let arguments = ["--pacing", "lock-step", "--no-cameras"];
    let mut server = Server::start("sturdy", &arguments).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "2"]);
    let link = server.link();
    let status = || link.request(&v1::StatusRequest {}).expect("an answer");
    wait_until("the recorder is there", || !status().recorders.is_empty());
    let commander = IdleCommander::start(&link);
    let sound = status().scenario.expect("a scenario");
    let refused = reset(&link, chair_in_the_table(&link)).expect_err("an overlap");
    assert!(refused.to_string().contains("kitchen_table"), "{refused}");
    // A playback goes where the recording was.
    let request = v1::ResetRequest {
        scenario: Some(chair_in_the_table(&link)),
        force: true,
        playback: true,
        ..Default::default()
    };
    link.request(&request).expect("it can be set up");
    assert_eq!(status().broken, "");
    let ends = link.streams(&[TopicId::EpisodeStop]).expect("the ends");
    start(&link, "broken", 1).expect("an episode");

    let end = loop {
        if let Some(Sample::EpisodeStop(end)) = ends.next(Duration::from_secs(60)).unwrap() {
            break end;
        }
    };
    assert_eq!(end.cause(), v1::EndCause::Physics, "{end:?}");
    let words = end.anomalies.last().cloned();
    let words = &words.expect("the anomaly in words");
    assert!(words.contains("press with"), "{words}");
    let kind = end.anomaly_kinds().next_back();
    assert_eq!(kind, Some(v1::AnomalyKind::FaultContactForce));
    assert_eq!(end.anomaly_kinds.len(), end.anomalies.len());
    let evaluation = end.evaluation.clone().expect("an evaluation");
    assert!(evaluation.done && !evaluation.success, "{evaluation:?}");
    assert_eq!(evaluation.failure, "physics");

    // Time is paused, everything is answered, nothing can be begun.
    // The end is told before the next turn, which says what it waits for.
    wait_until("it waits for a reset", || {
        status().waiting_for.contains("reset")
    });
    let now = status();
    assert_eq!(now.broken, *words);
    assert!(now.episode.is_none());
    let refused = start(&link, "next", 0).expect_err("a broken state");
    assert!(refused.to_string().contains("reset"), "{refused}");
    let told = server.client(&["status"]).expect("a client");
    assert!(printed(&told).contains(words), "{}", printed(&told));

    // A reset cures it.
    reset(&link, sound).expect("a reset");
    assert_eq!(status().broken, "");
    start(&link, "sound", 1).expect("an episode");
    let first = status().header.expect("a stamp").tick;
    wait_until("time goes on", || {
        status().header.expect("a stamp").tick > first + 240
    });
    let stop = server.client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    drop(commander);
    assert!(server.alive());
    let (_, text) = recorder.end();

    let broken = Episode::open(&folder.path().join("broken.h5")).expect("a file");
    let summary = broken.summary().expect("a summary");
    assert!(broken.is_broken() && !summary.success, "{text}");
    assert!(summary.complete, "{:?}\n{text}", summary.problems);
    assert_eq!(summary.failure_reason, "physics");
    assert_eq!(summary.anomalies.last(), Some(words));
    let kind = summary.anomaly_kinds.last().map(String::as_str);
    assert_eq!(kind, Some("fault_contact_force"));
    let sound = Episode::open(&folder.path().join("sound.h5")).expect("a file");
    let summary = sound.summary().expect("a summary");
    assert!(!sound.is_broken() && summary.anomalies.is_empty());
    assert_eq!(summary.end_cause, "asked");
    let validate = Command::new(program("wheelarm").expect("the client"))
        .args(["dataset", "validate"])
        .arg(folder.path().join("broken.h5"))
        .output()
        .expect("a process");
    let text = printed(&validate);
    assert_eq!(validate.status.code(), Some(3), "{text}");
    assert!(text.contains("the physics broke"), "{text}");
}

#[test]
fn a_state_that_is_cut_or_changed_is_refused_and_the_world_stays() {
    let server = Server::start("picky", &["--pacing", "lock-step", "--no-cameras"]);
    let server = server.expect("a server");
    let link = server.link();
    let _commander = IdleCommander::start(&link);
    start(&link, "source", 0).expect("an episode");
    let reply: v1::SnapshotReply = link.request(&v1::SnapshotRequest {}).expect("a snapshot");
    let stop = server.client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    let before: v1::Status = link.request(&v1::StatusRequest {}).expect("the status");
    let put = |snapshot: Vec<u8>| {
        let request = v1::ResetRequest {
            scenario: before.scenario.clone(),
            snapshot: snapshot.into(),
            force: true,
            ..Default::default()
        };
        link.request(&request)
    };
    let good = reply.snapshot.to_vec();
    let mut changed = good.clone();
    changed[good.len() / 2] ^= 0x40;
    let cut = good[..good.len() - 1].to_vec();
    for (bytes, why) in [
        (changed, "checksum"),
        (cut, "should have"),
        (vec![7; 900], "begin"),
    ] {
        let refused = put(bytes).expect_err("a damaged state");
        assert!(refused.to_string().contains(why), "{refused}");
        let now: v1::Status = link.request(&v1::StatusRequest {}).expect("the status");
        let tick = |status: &v1::Status| status.header.as_ref().map(|h| h.tick);
        assert_eq!(tick(&now), tick(&before), "the world stays as it was");
    }
    put(good).expect("the state itself");
}

/// A running evaluation; killed when dropped.
struct Evaluation(Child);

impl Evaluation {
    fn start(out: &Path, more: &[&str]) -> Self {
        let mut command = Command::new(program("wheelarm").expect("the client"));
        command
            .args(["evaluate", "--task", "pick_mustard", "--no-grid"])
            .arg("--out")
            .arg(out)
            .args(more)
            .env("WHEELARM_ASSETS", root().join("assets"))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        Self(command.spawn().expect("an evaluation"))
    }

    /// Sends a signal to the evaluation's server once `done` results are in,
    /// while the next episode runs.
    fn hurt_server(&self, out: &Path, done: usize, signal: &str, name: &str) {
        wait_until("the results before are in", || entries(out).len() >= done);
        // Some simulated seconds of the next one.
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!(entries(out).len(), done, "the next episode runs");
        let servers = processes(name);
        assert_eq!(servers.len(), 1, "{servers:?}");
        let line = format!("kill -{signal} {}", servers[0]);
        let status = Command::new("sh").args(["-c", &line]).status();
        assert!(status.expect("a shell").success(), "{line}");
    }

    fn end(mut self) -> (Option<i32>, String) {
        let read = |pipe: Option<&mut dyn std::io::Read>| {
            let mut text = String::new();
            pipe.expect("a pipe")
                .read_to_string(&mut text)
                .expect("text");
            text
        };
        let out = read(self.0.stdout.as_mut().map(|p| p as _));
        let err = read(self.0.stderr.as_mut().map(|p| p as _));
        let status = self.0.wait().expect("its end");
        (status.code(), format!("{out}\n{err}"))
    }
}

impl Drop for Evaluation {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn entries(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("episodes.jsonl")).unwrap_or_default();
    let lines = text
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok());
    lines.collect()
}

#[test]
fn a_worker_that_dies_and_one_that_hangs_cost_one_episode_each() {
    one_episode_each("worker", |out, _| format!("--for\0{}\0", out.display()));
}

#[test]
fn a_server_that_dies_and_one_that_hangs_cost_one_episode_each() {
    one_episode_each("server", |_, evaluation| format!("local-{evaluation}"));
}

/// `name` is what the command line of what simulates holds of the folder and the
/// evaluation's process.
fn one_episode_each(what: &str, name: impl Fn(&Path, u32) -> String) {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path();
    let worker = if what == "worker" {
        "process"
    } else {
        "socket"
    };
    let args = ["--seeds", "0..4", "--patience", "5", "--worker", worker];
    let run = Evaluation::start(out, &args);
    let name = name(out, run.0.id());
    run.hurt_server(out, 1, "KILL", &name);
    run.hurt_server(out, 3, "STOP", &name);
    let (code, text) = run.end();
    assert_eq!(code, Some(3), "{text}");
    let done = entries(out);
    assert_eq!(done.len(), 4, "{text}");
    for (seed, (entry, words)) in done
        .iter()
        .zip([
            "",
            &format!("the {what} died (signal: 9"),
            "",
            &format!("the {what} stalled"),
        ])
        .enumerate()
    {
        assert_eq!(entry["seed"], seed as u64, "{entry}");
        assert_eq!(entry["success"], words.is_empty(), "{entry}");
        let why = entry["why"].as_str().expect("a reason");
        assert!(why.starts_with(words), "{entry}");
        // What broke can be done again from what the ledger says.
        let told = &entry["scenario"];
        assert_eq!(told.is_object(), !words.is_empty(), "{entry}");
        if told.is_object() {
            assert_eq!(told["task"], "pick_mustard", "{entry}");
            assert_eq!(entry["broken"], "server", "{entry}");
        }
    }
    assert!(
        text.contains(&format!("the {what} died (signal: 9")),
        "{text}"
    );
    assert!(!text.contains("did not finish within"), "{text}");
    // They count as done, unless they are asked for.
    let (code, text) = Evaluation::start(out, &["--seeds", "0..4"]).end();
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("4 of 4 episodes are in"), "{text}");
    let (code, text) = Evaluation::start(out, &["--seeds", "1..2", "--again"]).end();
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(entries(out).len(), 5, "{text}");
}
