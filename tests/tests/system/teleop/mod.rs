//! An operator at the keys of `wheelarm teleop`, on a pseudo-terminal with a real server: an
//! episode from start to file, a closed terminal, a lost connection, and another holder of
//! control.

mod operator;
mod pick;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use operator::Operator;
use wheelarm_proto::TopicId;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_tests::{Server, printed, program};

/// Small images.
const CAMERAS: [&str; 6] = [
    "--camera",
    "gen3=64x48@10",
    "--camera",
    "wheelchair=64x48@10",
    "--quality",
    "fast",
];

struct Recorder(Child);

impl Recorder {
    fn start(server: &Server, out: &Path) -> Self {
        let child = Command::new(program("wheelarm").expect("the client"))
            .args(["--connect", &server.endpoint, "--sim", &server.sim])
            .args(["record", "--episodes", "1", "--out"])
            .arg(out)
            .stdout(Stdio::piped())
            .spawn()
            .expect("a recorder");
        Self(child)
    }

    fn finish(mut self) -> String {
        let pipe = self.0.stdout.take().expect("a pipe");
        let lines: Vec<_> = BufReader::new(pipe).lines().map_while(Result::ok).collect();
        lines.join("\n")
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn run_client(server: &Server, args: &[&str]) -> String {
    printed(&server.run_client(args).expect("a client"))
}

#[test]
fn operator_lifts_the_mustard_by_keys_and_the_episode_replays_bit_by_bit() {
    let server = Server::start("operator", &[&["--seed", "4"], &CAMERAS[..]].concat());
    let server = server.expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, folder.path());
    let mut operator = Operator::start(
        &server,
        &[
            "--target-hint",
            "--require-recorders",
            "1",
            "--label",
            "hand-picked",
        ],
    );
    operator.wait_for("control is yours");
    operator.wait_for("ready  0 images");
    operator.press("s");
    operator.wait_for("start an episode");
    // Keys in a text field do not drive.
    operator.press("\x15Bring mir den Senf, bitte: jik");
    operator.wait_for("jik");
    operator.press("\r");
    operator.wait_for("RUNS 1 hand-picked");
    operator.drive_to_the_bottle();
    operator.lift_the_bottle();
    operator.press("\x1b[C");
    operator.wait_for("hand-picked: kept in");
    operator.press("\x03");
    assert!(operator.end().success(), "{}", operator.screen_text());

    let text = recorder.finish();
    assert!(text.contains("hand-picked.h5: complete"), "{text}");
    let file = folder.path().join("hand-picked.h5");
    let file = file.to_string_lossy();
    let info = run_client(&server, &["dataset", "info", &file]);
    assert!(info.contains("Bring mir den Senf, bitte: jik"), "{info}");
    drop(server);
    let replay = Command::new(program("wheelarm").expect("the client"))
        .args(["replay", &file])
        .env("WHEELARM_ASSETS", wheelarm_tests::root().join("assets"))
        .output()
        .expect("a replay");
    assert!(replay.status.success(), "{}", printed(&replay));
    assert!(
        printed(&replay).contains("hashes equal"),
        "{}",
        printed(&replay)
    );
}

#[test]
fn closed_terminal_stops_the_chair_and_releases_control() {
    let server = Server::start("dying", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let refusals = client.streams(&[TopicId::Refusal]);
    let refusals = refusals.expect("the refusals");
    let mut operator = Operator::start(&server, &["--commander", "anna", "--no-page"]);
    operator.wait_for("control is yours");
    operator.press("j");
    operator.wait_until("a turning chair", |_| {
        operator.numbers("turns ").is_some_and(|n| n[0] > 0.3)
    });
    operator.close_terminal();
    assert!(!operator.end().success());
    let since = Instant::now();
    loop {
        let status = run_client(&server, &["status"]);
        if status.contains("yes chair_stopped") && status.contains("control     none") {
            break;
        }
        assert!(since.elapsed() < Duration::from_secs(10), "{status}");
    }
    while let Some(Sample::Refusal(refusal)) = refusals.next(Duration::ZERO).expect("no error") {
        // A command may be late on a busy host; none is invalid.
        assert_eq!(refusal.code(), RefusalCode::TooOld, "{}", refusal.reason);
    }
}

#[test]
fn signal_restores_the_terminal() {
    let server = Server::start("signal", &["--no-cameras"]).expect("a server");
    let mut operator = Operator::start(&server, &["--commander", "anna", "--no-page"]);
    operator.wait_for("control is yours");
    let process = operator.process().to_string();
    let kill = Command::new("kill").args(["-TERM", &process]).status();
    assert!(kill.is_ok_and(|s| s.success()));
    operator.end();
    // Its last output is read some time after its end.
    operator.wait_until("the reason of the end", |_| {
        operator.written().contains("ended by SIGTERM")
    });
    let written = operator.written();
    let entered = written.rfind("\x1b[?1049h");
    let left = written.rfind("\x1b[?1049l");
    assert!(entered.is_some() && left > entered, "{written}");
    assert!(written.rfind("\x1b[?25h") > written.rfind("\x1b[?25l"));
}

#[test]
fn redraw_sends_no_terminal_query_and_loses_no_key() {
    let server = Server::start("anew", &["--no-cameras"]).expect("a server");
    let mut operator = Operator::start(&server, &["--commander", "anna", "--no-page"]);
    operator.wait_for("control is yours");
    // Ctrl-L, and keys that look like a reply of the terminal.
    for _ in 0..5 {
        operator.press("\x0ck[;Rk");
        std::thread::sleep(Duration::from_millis(50));
    }
    operator.press("\x0cj");
    operator.wait_until("a turning chair", |_| {
        operator.numbers("turns ").is_some_and(|n| n[0] > 0.3)
    });
    let has_query = operator.written().contains("\x1b[6n");
    assert!(!has_query, "the program queries the cursor position");
    operator.press("k\x03");
    assert!(operator.end().success());
}

#[test]
fn second_operator_sees_the_holder_and_takes_control_only_explicitly() {
    let server = Server::start("two", &["--no-cameras"]).expect("a server");
    let anna = Operator::start(&server, &["--commander", "anna", "--no-page"]);
    anna.wait_for("control is yours");
    let mut bernd = Operator::start(&server, &["--commander", "bernd", "--no-page"]);
    bernd.wait_for("anna HOLDS CONTROL");
    bernd.press("i");
    bernd.wait_for("anna holds control; ! takes it over");
    bernd.press("!");
    bernd.wait_for("y takes control");
    bernd.press("y");
    bernd.wait_for("control is yours");
    anna.wait_for("bernd HOLDS CONTROL");
    bernd.press("\x03");
    assert!(bernd.end().success());
    anna.wait_for("control is yours");
}

#[test]
fn teleop_shows_a_lost_server_and_reconnects_to_a_new_one() {
    let endpoint = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        format!("tcp/{}", listener.local_addr().expect("an address"))
    };
    // The later `--listen` is a second endpoint, known before the start.
    let args = ["--no-cameras", "--listen", &endpoint];
    let mut server = Server::start("lost", &args).expect("a server");
    server.endpoint.clone_from(&endpoint);
    let mut operator = Operator::start(&server, &["--commander", "anna", "--no-page"]);
    operator.wait_for("control is yours");
    drop(server);
    operator.wait_for("LINK LOST");
    operator.press("v");
    operator.wait_for("the connection is lost: nothing is sent");
    let server = Server::start("lost", &args).expect("a server");
    operator.wait_until("control again", |text| {
        text.contains("● connected") && text.contains("control is yours")
    });
    operator.press("j");
    operator.wait_until("a turning chair", |_| {
        operator.numbers("turns ").is_some_and(|n| n[0] > 0.2)
    });
    drop(server);
}
