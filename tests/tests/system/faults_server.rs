//! Killed servers and demos: no recorded sample is lost, and the remaining processes continue or
//! end by themselves.

use std::process::{Command, Stdio};
use std::time::Duration;

use wheelarm_proto::v1;
use wheelarm_tests::{Recorder, Server, printed, program, root, wait_until};

const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@10", "--quality", "fast"];

fn start(server: &Server, label: &str) {
    let args = [
        "episode",
        "start",
        "--label",
        label,
        "--require-recorders",
        "1",
    ];
    let output = server.run_client(&args).expect("a client");
    assert!(output.status.success(), "{}", printed(&output));
}

#[test]
fn recorder_of_a_killed_server_records_its_successor() {
    let mut server = Server::start("mortal", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "2"]);
    let client = server.client();
    let recorders = |state: v1::RecorderState| {
        let status = client.request_within(&v1::StatusRequest {}, Duration::from_secs(2));
        status.is_ok_and(|s| s.recorders.iter().any(|r| r.state() == state))
    };
    wait_until("the recorder is connected", || {
        recorders(v1::RecorderState::Idle)
    });
    let commander = client.commander("survivor", false).expect("control");
    start(&server, "cut");
    std::thread::sleep(Duration::from_secs(1));
    server.kill().expect("kill -9");
    // The recorder waits for a lost server; another server with its name ends the episode.
    let endpoint = server.endpoint.clone();
    let server = Server::start_at(&endpoint, "mortal", &CAMERA).expect("its successor");
    let cut = folder.path().join("cut.h5");
    wait_until("the episode is closed as partial", || cut.is_file());
    // Both clients reconnect by themselves.
    wait_until("the operator is in control again", || {
        commander.acquire(false).is_ok()
    });
    wait_until("the recorder is back", || {
        recorders(v1::RecorderState::Finished) || recorders(v1::RecorderState::Idle)
    });
    start(&server, "after");
    std::thread::sleep(Duration::from_secs(1));
    let stop = server.run_client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    let (status, text) = recorder.end();
    assert_eq!(status.code(), Some(3), "{text}");
    assert!(text.contains("cut.h5: PARTIAL"), "{text}");
    assert!(text.contains("the server went away"), "{text}");
    assert!(text.contains("after.h5: complete"), "{text}");
}

#[test]
fn server_killed_directly_after_the_stop_reply_leaves_a_complete_file() {
    let mut server = Server::start("brief", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "1"]);
    start(&server, "whole");
    std::thread::sleep(Duration::from_millis(500));
    let client = server.client();
    client.stop_episode(false).expect("its end");
    server.kill().expect("kill -9");
    let (status, text) = recorder.end();
    assert_eq!(status.code(), Some(0), "{text}");
    assert!(text.contains("whole.h5: complete"), "{text}");
}

/// Ids of the processes whose command line contains `word`.
pub(super) fn processes(word: &str) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").expect("/proc").flatten();
    entries
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .filter(|pid| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            // A zombie process has no command line.
            String::from_utf8_lossy(&line).contains(word)
        })
        .collect()
}

#[test]
fn killed_demo_ends_its_server_and_its_recorder() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut demo = Command::new(program("wheelarm").expect("the client"))
        .args(["demo", "--width", "64", "--height", "48", "--out"])
        .arg(folder.path())
        .env("WHEELARM_ASSETS", root().join("assets"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("a demo");
    let server = format!("local-{}", demo.id());
    wait_until("server and recorder run", || processes(&server).len() >= 2);
    demo.kill().expect("kill -9");
    demo.wait().expect("its end");
    wait_until("server and recorder end", || processes(&server).is_empty());
}
