//! Broken physics, a killed server and a stalled server cost one episode each. The run
//! continues, and logs and files state the reason.

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

/// The current scenario with the chair inside a table.
fn chair_in_the_table(client: &Client) -> v1::Scenario {
    let scene: v1::SceneReply = client.request(&v1::SceneRequest {}).expect("the scene");
    let table = scene.bodies.iter().find(|b| b.name == "kitchen_table");
    let middle = table.and_then(|table| table.boxes.first()?.pose?.position);
    let middle = middle.expect("a table with a box");
    let status: v1::Status = client.request(&v1::StatusRequest {}).expect("the status");
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

fn reset(client: &Client, scenario: v1::Scenario) -> Result<v1::ResetReply, ClientError> {
    let request = v1::ResetRequest {
        scenario: Some(scenario),
        force: true,
        ..Default::default()
    };
    client.request(&request)
}

fn start(client: &Client, label: &str, recorders: u32) -> Result<v1::EpisodeStarted, ClientError> {
    let request = v1::EpisodeStartRequest {
        label: label.to_owned(),
        require_recorders: recorders,
        ..Default::default()
    };
    client.request(&request)
}

#[test]
fn broken_physics_ends_the_episode_but_not_the_server() {
    let arguments = ["--pacing", "lock-step", "--no-cameras"];
    let mut server = Server::start("sturdy", &arguments).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "2"]);
    let client = server.client();
    let status = || client.request(&v1::StatusRequest {}).expect("an answer");
    wait_until("the recorder is connected", || {
        !status().recorders.is_empty()
    });
    let commander = IdleCommander::start(&client);
    let valid = status().scenario.expect("a scenario");
    let refused = reset(&client, chair_in_the_table(&client)).expect_err("an overlap");
    assert!(refused.to_string().contains("kitchen_table"), "{refused}");
    // A playback may set up such a state: a recording may contain it.
    let request = v1::ResetRequest {
        scenario: Some(chair_in_the_table(&client)),
        force: true,
        playback: true,
        ..Default::default()
    };
    client.request(&request).expect("it can be set up");
    assert_eq!(status().broken, "");
    let ends = client.streams(&[TopicId::EpisodeStop]).expect("the ends");
    start(&client, "broken", 1).expect("an episode");

    let end = loop {
        if let Some(Sample::EpisodeStop(end)) = ends.next(Duration::from_secs(60)).unwrap() {
            break end;
        }
    };
    assert_eq!(end.cause(), v1::EndCause::Physics, "{end:?}");
    let words = end.anomalies.last().cloned();
    let words = &words.expect("the text of the anomaly");
    assert!(words.contains("press with"), "{words}");
    let kind = end.anomaly_kinds().next_back();
    assert_eq!(kind, Some(v1::AnomalyKind::FaultContactForce));
    assert_eq!(end.anomaly_kinds.len(), end.anomalies.len());
    let evaluation = end.evaluation.clone().expect("an evaluation");
    assert!(evaluation.done && !evaluation.success, "{evaluation:?}");
    assert_eq!(evaluation.failure, "physics");

    // Time is paused, queries are answered, and no episode can start. `waiting_for` is set one
    // step after the published end.
    wait_until("the server waits for a reset", || {
        status().waiting_for.contains("reset")
    });
    let now = status();
    assert_eq!(now.broken, *words);
    assert!(now.episode.is_none());
    let refused = start(&client, "next", 0).expect_err("a broken state");
    assert!(refused.to_string().contains("reset"), "{refused}");
    let status_output = server.run_client(&["status"]).expect("a client");
    assert!(
        printed(&status_output).contains(words),
        "{}",
        printed(&status_output)
    );

    // A reset repairs the state.
    reset(&client, valid).expect("a reset");
    assert_eq!(status().broken, "");
    start(&client, "sound", 1).expect("an episode");
    let first = status().header.expect("a stamp").tick;
    wait_until("simulation time advances", || {
        status().header.expect("a stamp").tick > first + 240
    });
    let stop = server.run_client(&["episode", "stop"]).expect("a client");
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
    let valid = Episode::open(&folder.path().join("sound.h5")).expect("a file");
    let summary = valid.summary().expect("a summary");
    assert!(!valid.is_broken() && summary.anomalies.is_empty());
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
fn damaged_snapshot_is_rejected_and_leaves_the_world_unchanged() {
    let server = Server::start("picky", &["--pacing", "lock-step", "--no-cameras"]);
    let server = server.expect("a server");
    let client = server.client();
    let _commander = IdleCommander::start(&client);
    start(&client, "source", 0).expect("an episode");
    let reply: v1::SnapshotReply = client.request(&v1::SnapshotRequest {}).expect("a snapshot");
    let stop = server.run_client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    let before: v1::Status = client.request(&v1::StatusRequest {}).expect("the status");
    let put = |snapshot: Vec<u8>| {
        let request = v1::ResetRequest {
            scenario: before.scenario.clone(),
            snapshot: snapshot.into(),
            force: true,
            ..Default::default()
        };
        client.request(&request)
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
        let now: v1::Status = client.request(&v1::StatusRequest {}).expect("the status");
        let tick = |status: &v1::Status| status.header.as_ref().map(|h| h.tick);
        assert_eq!(tick(&now), tick(&before), "the world changed");
    }
    put(good).expect("the intact snapshot");
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

    /// Sends a signal to the evaluation's simulation process after `done` results, while the
    /// next episode runs.
    fn signal_simulation(&self, out: &Path, done: usize, signal: &str, name: &str) {
        wait_until("the earlier results are in", || entries(out).len() >= done);
        // Some simulated seconds of the next episode.
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
fn killed_and_stalled_workers_cost_one_episode_each() {
    check_one_lost_episode_each("worker", |out, _| format!("--for\0{}\0", out.display()));
}

#[test]
fn killed_and_stalled_servers_cost_one_episode_each() {
    check_one_lost_episode_each("server", |_, evaluation| format!("local-{evaluation}"));
}

/// `name` returns a part of the command line of the simulation process, from the output
/// folder and the id of the evaluation's process.
fn check_one_lost_episode_each(what: &str, name: impl Fn(&Path, u32) -> String) {
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
    run.signal_simulation(out, 1, "KILL", &name);
    run.signal_simulation(out, 3, "STOP", &name);
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
        // The entry of a broken episode holds the scenario that repeats it.
        let scenario = &entry["scenario"];
        assert_eq!(scenario.is_object(), !words.is_empty(), "{entry}");
        if scenario.is_object() {
            assert_eq!(scenario["task"], "pick_mustard", "{entry}");
            assert_eq!(entry["broken"], "server", "{entry}");
        }
    }
    assert!(
        text.contains(&format!("the {what} died (signal: 9")),
        "{text}"
    );
    assert!(!text.contains("did not finish within"), "{text}");
    // Broken episodes count as done, unless `--again` repeats them.
    let (code, text) = Evaluation::start(out, &["--seeds", "0..4"]).end();
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("4 of 4 episodes are in"), "{text}");
    let (code, text) = Evaluation::start(out, &["--seeds", "1..2", "--again"]).end();
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(entries(out).len(), 5, "{text}");
}
