//! One recorder process writes the episodes of several servers behind a router, without
//! knowing their names.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use wheelarm_dataset::read::Episode;
use wheelarm_tests::{Server, printed, program};

/// A program whose output is read; killed when dropped.
struct Running(Child);

impl Running {
    fn start(name: &str, args: &[&str]) -> Self {
        let child = Command::new(program(name).expect("a program"))
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        Self(child.expect("a process"))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn command(server: &Server, args: &[&str]) -> String {
    let output = server.run_client(args).expect("a client");
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

#[test]
fn one_recorder_writes_every_episode_of_three_servers_behind_a_router() {
    let mut router = Running::start("wheelarm-test-router", &[]);
    let mut first = String::new();
    BufReader::new(router.0.stdout.as_mut().expect("a pipe"))
        .read_line(&mut first)
        .expect("a line");
    let endpoint = first.trim().strip_prefix("ready ").expect("an endpoint");

    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("text");
    let sims = ["kitchen", "hall", "attic"];
    let args = [
        "--connect",
        endpoint,
        "--camera",
        "gen3=64x48@10",
        "--quality",
        "fast",
    ];
    // One server starts before the recorder, the others after it.
    let mut servers = vec![Server::start(sims[0], &args).expect("a server")];
    let mut recorder = Running::start(
        "wheelarm",
        &[
            "--connect",
            endpoint,
            "--sim",
            "*",
            "record",
            "--out",
            out,
            "--episodes",
            "6",
        ],
    );
    for sim in &sims[1..] {
        servers.push(Server::start(sim, &args).expect("a server"));
    }
    for server in &servers {
        let since = Instant::now();
        while !command(server, &["status"]).contains("recorder") {
            assert!(
                since.elapsed() < Duration::from_secs(60),
                "no recorder at {}",
                server.sim
            );
            std::thread::sleep(Duration::from_millis(100));
        }
    }
    // Routers need a moment to exchange routes to a new server.
    std::thread::sleep(Duration::from_secs(2));
    // Two episodes at the same time on all three servers, with equal labels.
    for label in ["one", "two"] {
        for server in &servers {
            let start = [
                "episode",
                "start",
                "--label",
                label,
                "--require-recorders",
                "1",
            ];
            command(server, &start);
        }
        std::thread::sleep(Duration::from_secs(1));
        for server in &servers {
            command(server, &["episode", "stop"]);
        }
    }
    let lines = BufReader::new(recorder.0.stdout.take().expect("a pipe")).lines();
    let text: Vec<String> = lines.map_while(Result::ok).collect();
    let status = recorder.0.wait().expect("its end");
    assert!(status.success(), "{status}: {text:#?}");
    for sim in sims {
        for label in ["one", "two"] {
            let file = folder.path().join(sim).join(format!("{label}.h5"));
            let summary = Episode::open(&file)
                .and_then(|episode| episode.summary())
                .expect("an episode");
            assert!(summary.complete, "{sim} {label}: {:?}", summary.problems);
            assert!(summary.streams.iter().all(|s| s.missed == 0));
            let frames = summary.streams.iter().find(|s| s.stream == "camera/gen3");
            assert!(
                frames.is_some_and(|s| s.received >= 5),
                "{sim} {label}: {frames:?}"
            );
        }
    }
}
