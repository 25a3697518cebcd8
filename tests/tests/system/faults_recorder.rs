//! Recorders that are killed or stopped, and several recorders. Acknowledged samples are kept;
//! neither the simulation nor another recorder is disturbed.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use wheelarm_dataset::log;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::{CREDIT_TICKS, TICKS_PER_CONTROL, v1};
use wheelarm_sdk::Client;
use wheelarm_tests::{IdleCommander, Recorder, Server, printed, wait_until};

const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@30", "--quality", "fast"];

fn status(client: &Client) -> v1::Status {
    client.request(&v1::StatusRequest {}).expect("a status")
}

fn tick(client: &Client) -> u64 {
    status(client).header.unwrap_or_default().tick
}

fn wait_for_recorders(client: &Client, count: usize) {
    wait_until("the recorders are connected", || {
        status(client).recorders.len() >= count
    });
}

fn start(client: &Client, label: &str, recorders: u32) {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        require_recorders: recorders,
        ..Default::default()
    };
    let started: v1::EpisodeStarted = client.request(&request).expect("an episode");
    assert_eq!(started.label, label);
    wait_until("the episode runs", || status(client).waiting_for.is_empty());
}

fn stop(client: &Client) {
    let request = v1::EpisodeStopRequest::default();
    let _: v1::EpisodeStopped = client.request(&request).expect("its end");
}

/// Waits for `seconds` of simulation time.
fn pass(client: &Client, seconds: f64) {
    let until = tick(client) + (seconds * 240.0) as u64;
    wait_until("simulated time passes", || tick(client) >= until);
}

/// Number of applied commands and images in the log of a killed recorder, or in its file when
/// the log is gone.
fn samples_left(server: &Server, folder: &Path, label: &str) -> u64 {
    let file = folder.join(format!("{label}.h5"));
    let rescued = tempfile::tempdir().expect("a folder");
    let logs = Recorder::logs(folder);
    let path = match &logs[..] {
        [] => file,
        [log] => {
            let out = rescued.path().to_string_lossy().into_owned();
            let args = ["dataset", "recover", &log.to_string_lossy(), "--out", &out];
            let recovered = server.run_client(&args).expect("a client");
            let code = recovered.status.code();
            assert!(matches!(code, Some(0 | 3)), "{}", printed(&recovered));
            // A file with the final name must be readable as well.
            if file.exists() {
                Episode::open(&file).expect("a readable file");
            }
            rescued.path().join(format!("{label}.h5"))
        }
        more => panic!("expected one log, found {more:?}"),
    };
    let episode = Episode::open(&path).expect("a readable file");
    let mut images = 0;
    for name in episode.cameras().expect("the cameras") {
        let camera = episode.camera(&name).expect("the camera");
        for i in 0..camera.len() {
            camera.frame(&episode, i).expect("a readable image");
        }
        images += camera.len();
    }
    let applied = episode.applied().expect("the applied commands");
    (applied.len() + images) as u64
}

/// Number of samples of the same streams in the log now: written, so acknowledged.
fn acknowledged(folder: &Path) -> u64 {
    let Some(log) = Recorder::logs(folder).pop() else {
        return 0;
    };
    let Ok(scan) = log::scan(&log) else { return 0 };
    let wanted = |name: &String| name == "applied" || name == "camera/gen3";
    let of = |entry: &&log::Entry| wanted(&scan.preamble.streams[usize::from(entry.header.stream)]);
    scan.entries.iter().filter(of).count() as u64
}

#[test]
fn closed_terminal_leaves_the_file_that_sigterm_leaves() {
    let server = Server::start("hangup", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["TERM", "HUP"] {
        // Under `nohup` the tests inherit an ignored SIGHUP.
        let fresh = ["env", "--default-signal=HUP"];
        let mut recorder = Recorder::start_under(&fresh, &server, name, folder.path(), &[]);
        wait_for_recorders(&client, 1);
        start(&client, name, 1);
        pass(&client, 0.5);
        recorder.signal(name);
        let (status, text) = recorder.end();
        assert_eq!(status.code(), Some(3), "{name}: {text}");
        assert!(text.contains(&format!("{name}.h5: PARTIAL")), "{text}");
        Episode::open(&folder.path().join(format!("{name}.h5"))).expect("a readable file");
        stop(&client);
    }
}

#[test]
fn recorder_killed_at_any_time_keeps_acknowledged_samples() {
    let server = Server::start("anytime", &CAMERA).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let witness = Recorder::start(
        &server,
        "witness",
        &folder.path().join("witness"),
        &["--episodes", "4"],
    );
    for (round, millis) in [40, 310, 730, 1170].into_iter().enumerate() {
        let out = folder.path().join(format!("doomed{round}"));
        let mut doomed = Recorder::start(&server, "doomed", &out, &[]);
        wait_for_recorders(&client, 2);
        let label = format!("round{round}");
        start(&client, &label, 2);
        std::thread::sleep(Duration::from_millis(millis));
        let known = acknowledged(&out);
        doomed.kill();
        pass(&client, 0.2);
        stop(&client);
        let left = samples_left(&server, &out, &label);
        assert!(left >= known, "{left} of {known} after {millis} ms");
        wait_until("its loss is detected", || {
            status(&client)
                .recorders
                .iter()
                .all(|r| r.recorder != "doomed")
        });
    }
    let text = witness.finish();
    assert_eq!(text.matches(": complete").count(), 4, "{text}");
}

fn can_trace() -> bool {
    let traced = Command::new("strace")
        .args(["-f", "-o", "/dev/null", "true"])
        .output();
    let can = traced.is_ok_and(|o| o.status.success());
    if !can {
        println!("skipped: strace is not installed or may not trace (scripts/setup.sh strace)");
    }
    can
}

/// Records one short episode under `strace` with these injections; exit code and output.
fn record_under(
    server: &Server,
    inject: &[&str],
    out: &Path,
    label: &str,
) -> (Option<i32>, String) {
    let client = server.client();
    let mut wrapper = vec!["strace", "-f", "-qq", "-o", "/dev/null"];
    for what in inject {
        wrapper.extend(["-e", what]);
    }
    let mut recorder = Recorder::start_under(&wrapper, server, label, out, &["--episodes", "1"]);
    wait_until("the recorder is connected", || {
        status(&client)
            .recorders
            .iter()
            .any(|r| r.recorder == label)
    });
    start(&client, label, 1);
    pass(&client, 0.3);
    stop(&client);
    let (ended, text) = recorder.end();
    (ended.code(), text)
}

#[test]
fn file_system_without_link_or_unlink_gets_whole_files() {
    if !can_trace() {
        return;
    }
    let server = Server::start("poor", &["--no-cameras"]).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let neither = [
        "inject=renameat2:error=EINVAL",
        "inject=link,linkat:error=EPERM",
    ];

    // Rename still works: the file is whole.
    let out = folder.path().join("plain");
    let (_, text) = record_under(&server, &neither, &out, "plain");
    assert!(text.contains("plain.h5: complete"), "{text}");

    // The rename fails: no empty file has the final name, and the log stays.
    let out = folder.path().join("broken");
    let broken = [&neither[..], &["inject=rename,renameat:error=EIO"]].concat();
    let (code, text) = record_under(&server, &broken, &out, "broken");
    assert_eq!(code, Some(1), "{text}");
    assert!(!out.join("broken.h5").exists(), "an empty file is left");
    assert!(samples_left(&server, &out, "broken") > 0);

    // Killed at the rename: the named file is empty, and the log takes precedence.
    let out = folder.path().join("killed");
    let killed = [&neither[..], &["inject=rename,renameat:signal=KILL"]].concat();
    record_under(&server, &killed, &out, "killed");
    let file = out.join("killed.h5");
    assert_eq!(std::fs::metadata(&file).expect("a file").len(), 0);
    let log = out.join("killed.h5.wal").display().to_string();
    let recovered = server
        .run_client(&["dataset", "recover", &log])
        .expect("a client");
    assert_eq!(recovered.status.code(), Some(0), "{}", printed(&recovered));
    let summary = Episode::open(&file).and_then(|e| e.summary());
    assert!(summary.expect("a readable file").complete);

    // The log cannot be removed: the file is good, and the recorder reports that.
    let out = folder.path().join("stuck");
    let stuck = ["inject=unlink,unlinkat:error=EIO"];
    let (code, text) = record_under(&server, &stuck, &out, "stuck");
    assert_eq!(code, Some(0), "{text}");
    let reported =
        text.contains("stuck.h5: complete") && text.contains("the file is good; its log");
    assert!(reported, "{text}");
}

#[test]
fn recorder_killed_at_any_system_call_keeps_acknowledged_samples() {
    if !can_trace() {
        return;
    }
    let server = Server::start("calls", &CAMERA).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    // The recorder uses write and fdatasync for the log, pwrite64 and fsync for the file,
    // renameat2 for its name, and unlink for the log. Only writes into the log count: threads
    // also wake each other by writing.
    for (round, (call, when)) in [
        ("fdatasync", 1),
        ("fdatasync", 4),
        ("write", 2),
        ("write", 40),
        ("pwrite64", 1),
        ("pwrite64", 9),
        ("fsync", 1),
        ("renameat2", 1),
        ("unlink,unlinkat", 1),
    ]
    .into_iter()
    .enumerate()
    {
        let out = folder.path().join(format!("calls{round}"));
        let inject = format!("inject={call}:signal=KILL:when={when}");
        let trace = format!("trace={call}");
        let label = format!("call{round}");
        let log = out.join(format!("{label}.h5.wal")).display().to_string();
        let mut wrapper = vec![
            "strace",
            "-f",
            "-qq",
            "-o",
            "/dev/null",
            "-e",
            trace.as_str(),
            "-e",
            inject.as_str(),
        ];
        if call == "write" {
            wrapper.extend(["-P", log.as_str()]);
        }
        let name = format!("traced{round}");
        let mut doomed =
            Recorder::start_under(&wrapper, &server, &name, &out, &["--episodes", "1"]);
        let is_connected =
            |client: &Client| status(client).recorders.iter().any(|r| r.recorder == name);
        wait_until("the recorder is connected or dead", || {
            is_connected(&client) || !doomed.alive()
        });
        if !doomed.alive() {
            println!("{call} {when}: died before it was ready");
            continue;
        }
        // No recorder is required: it may die before it is ready. An episode that ends before the
        // recorder starts on a slow host would leave it waiting.
        start(&client, &label, 0);
        wait_until("the recorder records or is dead", || {
            !doomed.alive() || (out.is_dir() && !Recorder::logs(&out).is_empty())
        });
        let mut known = 0;
        let begun = std::time::Instant::now();
        while doomed.alive() && begun.elapsed() < Duration::from_millis(700) {
            known = known.max(acknowledged(&out));
            std::thread::sleep(Duration::from_millis(30));
        }
        stop(&client);
        let (ended, _) = doomed.end();
        if known > 0 || !Recorder::logs(&out).is_empty() {
            let left = samples_left(&server, &out, &label);
            println!("{call} {when}: {ended}, {left} left of {known} known");
            assert!(left >= known, "{call} {when}: {left} of {known}");
        }
        wait_until("its loss is detected", || !is_connected(&client));
    }
}

#[test]
fn stopped_recorder_in_real_time_damages_only_its_own_file() {
    let camera = ["--camera", "gen3=320x180@30", "--quality", "fast"];
    let server = Server::start("stalled", &camera).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let mut slow = Recorder::start(&server, "slow", &out("slow"), &["--episodes", "1"]);
    let good = Recorder::start(&server, "good", &out("good"), &["--episodes", "1"]);
    wait_for_recorders(&client, 2);
    start(&client, "stall", 2);
    pass(&client, 0.5);
    slow.signal("STOP");
    // More than sockets and caches hold: about 14 MB of images per second.
    pass(&client, 4.0);
    slow.signal("CONT");
    pass(&client, 0.5);
    stop(&client);
    let text = good.finish();
    assert!(text.contains("stall.h5: complete"), "{text}");
    let (status, text) = slow.end();
    assert_eq!(status.code(), Some(3), "{text}");
    assert!(text.contains("stall.h5: PARTIAL"), "{text}");
    assert!(
        text.contains("camera/gen3") && text.contains("are missing"),
        "{text}"
    );
}

#[test]
fn lock_step_waits_for_a_stopped_recorder_and_names_it() {
    let args = [&CAMERA[..], &["--pacing", "lock-step"]].concat();
    let server = Server::start("patient", &args).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let names = ["one", "two", "three", "four"];
    let recorders: Vec<_> = names
        .iter()
        .map(|name| {
            let out = folder.path().join(name);
            Recorder::start(&server, name, &out, &["--episodes", "1"])
        })
        .collect();
    wait_for_recorders(&client, 4);
    let idle = IdleCommander::start(&server.client());
    start_lock_step(&client, "pair");
    pass(&client, 1.0);
    recorders[1].signal("STOP");
    wait_until("the status names the recorder and the reason", || {
        let words = status(&client).waiting_for;
        words.contains("recorder two") && words.contains("does not answer")
    });
    let before = tick(&client);
    // Longer than the ten seconds after which the transport drops a silent client.
    for _ in 0..13 {
        std::thread::sleep(Duration::from_secs(1));
        let status = status(&client);
        assert!(status.waiting_for.contains("recorder two"), "{status:?}");
    }
    assert_eq!(tick(&client), before, "time passed");
    recorders[1].signal("CONT");
    pass(&client, 1.0);
    stop(&client);
    drop(idle);
    for recorder in recorders {
        let text = recorder.finish();
        assert!(text.contains("pair.h5: complete"), "{text}");
    }
    let read =
        |name: &str| Episode::open(&folder.path().join(name).join("pair.h5")).expect("a file");
    let first = read(names[0]);
    for name in &names[1..] {
        check_equal(&first, &read(name));
    }
}

#[test]
fn end_of_an_episode_names_a_stopped_recorder() {
    let server = Server::start("still", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "one", folder.path(), &["--episodes", "1"]);
    wait_for_recorders(&client, 1);
    start(&client, "still", 1);
    pass(&client, 0.5);
    recorder.signal("STOP");
    wait_until("the status reports its silence", || {
        let recorders = status(&client).recorders;
        recorders.iter().any(|one| one.silent_seconds.is_some())
    });
    let ended = server.run_client(&["episode", "stop"]).expect("a client");
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    let text = printed(&ended);
    assert!(text.contains("NOT CONFIRMED by recorder one"), "{text}");
    recorder.signal("CONT");
    let text = recorder.finish();
    assert!(text.contains("still.h5: complete"), "{text}");
}

#[test]
fn lock_step_waits_for_a_stopped_recorder_without_cameras_too() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("dark", &args).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "one", folder.path(), &["--episodes", "1"]);
    wait_for_recorders(&client, 1);
    let idle = IdleCommander::start(&server.client());
    start_lock_step(&client, "dark");
    pass(&client, 1.0);
    recorder.signal("STOP");
    let stopped = tick(&client);
    wait_until("the status names the recorder", || {
        status(&client).waiting_for.contains("recorder one")
    });
    let before = tick(&client);
    // Fewer ticks than the server's caches hold.
    let passed = before - stopped;
    assert!(passed <= CREDIT_TICKS + TICKS_PER_CONTROL, "{passed} ticks");
    std::thread::sleep(Duration::from_secs(2));
    assert!(status(&client).waiting_for.contains("recorder one"));
    assert_eq!(tick(&client), before, "time passed");
    recorder.signal("CONT");
    pass(&client, 1.0);
    stop(&client);
    drop(idle);
    let text = recorder.finish();
    let whole = text.contains("dark.h5: complete") && text.contains(" 0 missed");
    assert!(whole, "{text}");
}

fn start_lock_step(client: &Client, label: &str) {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        commander: IdleCommander::NAME.into(),
        ..Default::default()
    };
    let _: v1::EpisodeStarted = client.request(&request).expect("an episode");
}

/// Checks that states, commands and images are equal bit by bit.
fn check_equal(a: &Episode, b: &Episode) {
    assert_eq!(
        a.state_hashes().expect("hashes"),
        b.state_hashes().expect("hashes")
    );
    let (first, second) = (a.applied().expect("applied"), b.applied().expect("applied"));
    assert!(!first.is_empty() && format!("{first:?}") == format!("{second:?}"));
    let (one, two) = (
        a.camera("gen3").expect("a camera"),
        b.camera("gen3").expect("a camera"),
    );
    assert_eq!(one.len(), two.len());
    for i in 0..one.len() {
        let (x, y) = (
            one.frame(a, i).expect("a frame"),
            two.frame(b, i).expect("a frame"),
        );
        assert!(x.rgb == y.rgb && x.ids == y.ids, "image {i}");
        let bits = |d: &[f32]| d.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&x.depth), bits(&y.depth), "depth {i}");
    }
}

#[test]
fn two_recorders_in_real_time_miss_nothing() {
    let camera = ["--camera", "gen3=640x360@10", "--quality", "fast"];
    let server = Server::start("both", &camera).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let start_one = |name: &str| {
        Recorder::start(
            &server,
            name,
            &folder.path().join(name),
            &["--episodes", "1"],
        )
    };
    let recorders = [start_one("left"), start_one("right")];
    wait_for_recorders(&client, 2);
    start(&client, "both", 2);
    pass(&client, 3.0);
    stop(&client);
    for recorder in recorders {
        let text = recorder.finish();
        assert!(
            text.contains("both.h5: complete") && text.contains(" 0 missed"),
            "{text}"
        );
    }
}
