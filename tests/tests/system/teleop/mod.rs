//! A person at the keys of the real `wheelarm teleop`, on a real terminal, at
//! a real server: an episode from start to file, and what happens when the
//! terminal dies, the link breaks or somebody else is in control.

mod person;
mod pick;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use person::Person;
use wheelarm_proto::TopicId;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_tests::{Server, printed, program};

/// Small pictures.
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

fn client(server: &Server, args: &[&str]) -> String {
    printed(&server.run_client(args).expect("a client"))
}

#[test]
fn a_person_picks_up_the_mustard_by_keys_and_the_episode_replays_bit_by_bit() {
    let server = Server::start("person", &[&["--seed", "4"], &CAMERAS[..]].concat());
    let server = server.expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, folder.path());
    let mut person = Person::sit_down(
        &server,
        &[
            "--target-hint",
            "--require-recorders",
            "1",
            "--label",
            "hand-picked",
        ],
    );
    person.waits_for("control is yours");
    person.waits_for("ready  0 images");
    person.presses("s");
    person.waits_for("start an episode");
    // Whatever is typed here is text and drives nothing.
    person.presses("\x15Bring mir den Senf, bitte: jik");
    person.waits_for("jik");
    person.presses("\r");
    person.waits_for("RUNS 1 hand-picked");
    person.goes_to_the_bottle();
    person.takes_the_bottle();
    person.presses("\x1b[C");
    person.waits_for("hand-picked: kept in");
    person.presses("\x03");
    assert!(person.end().success(), "{}", person.reads());

    let text = recorder.finish();
    assert!(text.contains("hand-picked.h5: complete"), "{text}");
    let file = folder.path().join("hand-picked.h5");
    let file = file.to_string_lossy();
    let info = client(&server, &["dataset", "info", &file]);
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
fn a_terminal_that_dies_stops_the_chair_and_gives_control_back() {
    let server = Server::start("dying", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let refusals = client.streams(&[TopicId::Refusal]);
    let refusals = refusals.expect("the refusals");
    let mut person = Person::sit_down(&server, &["--commander", "anna", "--no-page"]);
    person.waits_for("control is yours");
    person.presses("j");
    person.waits("a turning chair", |_| {
        person.numbers("turns ").is_some_and(|n| n[0] > 0.3)
    });
    person.loses_the_terminal();
    assert!(!person.end().success());
    let since = Instant::now();
    loop {
        let status = client(&server, &["status"]);
        if status.contains("yes chair_stopped") && status.contains("control     none") {
            break;
        }
        assert!(since.elapsed() < Duration::from_secs(10), "{status}");
    }
    while let Some(Sample::Refusal(refusal)) = refusals.next(Duration::ZERO).expect("no error") {
        // Where the host is busy a command may come late; none is wrong.
        assert_eq!(refusal.code(), RefusalCode::TooOld, "{}", refusal.reason);
    }
}

#[test]
fn a_signal_leaves_the_terminal_as_it_was() {
    let server = Server::start("signal", &["--no-cameras"]).expect("a server");
    let mut person = Person::sit_down(&server, &["--commander", "anna", "--no-page"]);
    person.waits_for("control is yours");
    let process = person.process().to_string();
    let kill = Command::new("kill").args(["-TERM", &process]).status();
    assert!(kill.is_ok_and(|s| s.success()));
    person.end();
    // What it says last is read here some time after its end.
    person.waits("why it ended", |_| {
        person.written().contains("ended by SIGTERM")
    });
    let written = person.written();
    let entered = written.rfind("\x1b[?1049h");
    let left = written.rfind("\x1b[?1049l");
    assert!(entered.is_some() && left > entered, "{written}");
    assert!(written.rfind("\x1b[?25h") > written.rfind("\x1b[?25l"));
}

#[test]
fn a_picture_drawn_anew_asks_the_terminal_nothing_and_swallows_no_key() {
    let server = Server::start("anew", &["--no-cameras"]).expect("a server");
    let mut person = Person::sit_down(&server, &["--commander", "anna", "--no-page"]);
    person.waits_for("control is yours");
    // Ctrl-L, and keys that would be taken for the terminal's answer.
    for _ in 0..5 {
        person.presses("\x0ck[;Rk");
        std::thread::sleep(Duration::from_millis(50));
    }
    person.presses("\x0cj");
    person.waits("a turning chair", |_| {
        person.numbers("turns ").is_some_and(|n| n[0] > 0.3)
    });
    let asks = person.written().contains("\x1b[6n");
    assert!(!asks, "the program asks where the cursor is");
    person.presses("k\x03");
    assert!(person.end().success());
}

#[test]
fn a_second_person_is_told_who_is_in_control_and_takes_it_only_explicitly() {
    let server = Server::start("two", &["--no-cameras"]).expect("a server");
    let anna = Person::sit_down(&server, &["--commander", "anna", "--no-page"]);
    anna.waits_for("control is yours");
    let mut bernd = Person::sit_down(&server, &["--commander", "bernd", "--no-page"]);
    bernd.waits_for("anna HOLDS CONTROL");
    bernd.presses("i");
    bernd.waits_for("anna holds control; ! takes it over");
    bernd.presses("!");
    bernd.waits_for("y takes control");
    bernd.presses("y");
    bernd.waits_for("control is yours");
    anna.waits_for("bernd HOLDS CONTROL");
    bernd.presses("\x03");
    assert!(bernd.end().success());
    anna.waits_for("control is yours");
}

#[test]
fn a_lost_server_is_shown_keys_do_nothing_and_a_new_one_is_found() {
    let endpoint = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        format!("tcp/{}", listener.local_addr().expect("an address"))
    };
    // The later `--listen` is a second endpoint, known before the start.
    let args = ["--no-cameras", "--listen", &endpoint];
    let mut server = Server::start("lost", &args).expect("a server");
    server.endpoint.clone_from(&endpoint);
    let mut person = Person::sit_down(&server, &["--commander", "anna", "--no-page"]);
    person.waits_for("control is yours");
    drop(server);
    person.waits_for("LINK LOST");
    person.presses("v");
    person.waits_for("the connection is lost: nothing is sent");
    let server = Server::start("lost", &args).expect("a server");
    person.waits("control again", |text| {
        text.contains("● connected") && text.contains("control is yours")
    });
    person.presses("j");
    person.waits("a turning chair", |_| {
        person.numbers("turns ").is_some_and(|n| n[0] > 0.2)
    });
    drop(server);
}
