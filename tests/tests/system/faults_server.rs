//! Servers and demos that die: nothing that was recorded is lost, and who is
//! left goes on by itself.

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
    let output = server.client(&args).expect("a client");
    assert!(output.status.success(), "{}", printed(&output));
}

#[test]
fn a_killed_server_leaves_a_partial_file_and_its_successor_is_recorded() {
    let mut server = Server::start("mortal", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "2"]);
    let link = server.link();
    let recorders = |state: v1::RecorderState| {
        let status = link.request_within(&v1::StatusRequest {}, Duration::from_secs(2));
        status.is_ok_and(|s| s.recorders.iter().any(|r| r.state() == state))
    };
    wait_until("the recorder is there", || {
        recorders(v1::RecorderState::Idle)
    });
    let commander = link.commander("survivor", false).expect("control");
    start(&server, "cut");
    std::thread::sleep(Duration::from_secs(1));
    server.kill().expect("kill -9");
    // A server that is away may come back with the episode; its successor does not.
    let endpoint = server.endpoint.clone();
    let server = Server::start_at(&endpoint, "mortal", &CAMERA).expect("its successor");
    let cut = folder.path().join("cut.h5");
    wait_until("the episode is closed as partial", || cut.is_file());
    // Both clients come back by themselves, with the links they have.
    wait_until("the operator is in control again", || {
        commander.acquire(false).is_ok()
    });
    wait_until("the recorder is back", || {
        recorders(v1::RecorderState::Finished) || recorders(v1::RecorderState::Idle)
    });
    start(&server, "after");
    std::thread::sleep(Duration::from_secs(1));
    let stop = server.client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    let (status, text) = recorder.end();
    assert_eq!(status.code(), Some(3), "{text}");
    assert!(text.contains("cut.h5: PARTIAL"), "{text}");
    assert!(text.contains("the server went away"), "{text}");
    assert!(text.contains("after.h5: complete"), "{text}");
}

#[test]
fn a_server_that_is_killed_right_behind_its_answer_leaves_a_complete_file() {
    let mut server = Server::start("brief", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "1"]);
    start(&server, "whole");
    std::thread::sleep(Duration::from_millis(500));
    let link = server.link();
    link.stop_episode(false).expect("its end");
    server.kill().expect("kill -9");
    let (status, text) = recorder.end();
    assert_eq!(status.code(), Some(0), "{text}");
    assert!(text.contains("whole.h5: complete"), "{text}");
}

/// Processes whose command line holds `word`.
pub(super) fn processes(word: &str) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").expect("/proc").flatten();
    entries
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .filter(|pid| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            // A dead process that nobody has collected has no command line.
            String::from_utf8_lossy(&line).contains(word)
        })
        .collect()
}

#[test]
fn a_killed_demo_takes_its_server_and_its_recorder_with_it() {
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
    wait_until("they have ended", || processes(&server).is_empty());
}
