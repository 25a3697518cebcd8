//! Recorders that are killed, stopped or many: what was acknowledged is kept,
//! and neither the simulation nor another recorder notices.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use wheelarm_dataset::log;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::{CREDIT_TICKS, TICKS_PER_CONTROL, v1};
use wheelarm_sdk::Client;
use wheelarm_tests::{IdleCommander, Recorder, Server, printed, wait_until};

const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@30", "--quality", "fast"];

fn status(link: &Client) -> v1::Status {
    link.request(&v1::StatusRequest {}).expect("a status")
}

fn tick(link: &Client) -> u64 {
    status(link).header.unwrap_or_default().tick
}

fn wait_for_recorders(link: &Client, count: usize) {
    wait_until("the recorders are there", || {
        status(link).recorders.len() >= count
    });
}

fn start(link: &Client, label: &str, recorders: u32) {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        require_recorders: recorders,
        ..Default::default()
    };
    let started: v1::EpisodeStarted = link.request(&request).expect("an episode");
    assert_eq!(started.label, label);
    wait_until("the episode runs", || status(link).waiting_for.is_empty());
}

fn stop(link: &Client) {
    let request = v1::EpisodeStopRequest::default();
    let _: v1::EpisodeStopped = link.request(&request).expect("its end");
}

/// Simulated time goes on for `seconds`.
fn pass(link: &Client, seconds: f64) {
    let until = tick(link) + (seconds * 240.0) as u64;
    wait_until("simulated time passes", || tick(link) >= until);
}

/// What is in the log of a killed recorder, or in the file if it came to that.
fn samples_left(server: &Server, folder: &Path, label: &str) -> u64 {
    let file = folder.join(format!("{label}.h5"));
    let rescued = tempfile::tempdir().expect("a folder");
    let logs = Recorder::logs(folder);
    let path = match &logs[..] {
        [] => file,
        [log] => {
            let out = rescued.path().to_string_lossy().into_owned();
            let args = ["dataset", "recover", &log.to_string_lossy(), "--out", &out];
            let recovered = server.client(&args).expect("a client");
            let code = recovered.status.code();
            assert!(matches!(code, Some(0 | 3)), "{}", printed(&recovered));
            // Whatever lies under the final name must be whole as well.
            if file.exists() {
                Episode::open(&file).expect("a readable file");
            }
            rescued.path().join(format!("{label}.h5"))
        }
        more => panic!("expected one log, found {more:?}"),
    };
    let episode = Episode::open(&path).expect("a readable file");
    let mut pictures = 0;
    for name in episode.cameras().expect("the cameras") {
        let camera = episode.camera(&name).expect("the camera");
        for i in 0..camera.len() {
            camera.frame(&episode, i).expect("a readable picture");
        }
        pictures += camera.len();
    }
    let applied = episode.applied().expect("what was applied");
    (applied.len() + pictures) as u64
}

/// Samples of the same streams that a log holds now: acknowledged, for they
/// are written.
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
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["TERM", "HUP"] {
        // Under `nohup` the tests inherit that SIGHUP is ignored.
        let fresh = ["env", "--default-signal=HUP"];
        let mut recorder = Recorder::start_under(&fresh, &server, name, folder.path(), &[]);
        wait_for_recorders(&link, 1);
        start(&link, name, 1);
        pass(&link, 0.5);
        recorder.signal(name);
        let (status, text) = recorder.end();
        assert_eq!(status.code(), Some(3), "{name}: {text}");
        assert!(text.contains(&format!("{name}.h5: PARTIAL")), "{text}");
        Episode::open(&folder.path().join(format!("{name}.h5"))).expect("a readable file");
        stop(&link);
    }
}

#[test]
fn a_recorder_killed_at_any_time_keeps_what_it_acknowledged() {
    let server = Server::start("anytime", &CAMERA).expect("a server");
    let link = server.link();
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
        wait_for_recorders(&link, 2);
        let label = format!("round{round}");
        start(&link, &label, 2);
        std::thread::sleep(Duration::from_millis(millis));
        let known = acknowledged(&out);
        doomed.kill();
        pass(&link, 0.2);
        stop(&link);
        let left = samples_left(&server, &out, &label);
        assert!(left >= known, "{left} of {known} after {millis} ms");
        wait_until("its loss is seen", || {
            status(&link)
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

/// Records one short episode under `strace` with these injections.
fn record_under(
    server: &Server,
    inject: &[&str],
    out: &Path,
    label: &str,
) -> (Option<i32>, String) {
    let link = server.link();
    let mut wrapper = vec!["strace", "-f", "-qq", "-o", "/dev/null"];
    for what in inject {
        wrapper.extend(["-e", what]);
    }
    let mut recorder = Recorder::start_under(&wrapper, server, label, out, &["--episodes", "1"]);
    wait_until("the recorder is there", || {
        status(&link).recorders.iter().any(|r| r.recorder == label)
    });
    start(&link, label, 1);
    pass(&link, 0.3);
    stop(&link);
    let (ended, text) = recorder.end();
    (ended.code(), text)
}

#[test]
fn a_file_system_that_cannot_link_or_unlink_gets_no_empty_file_and_no_alarm() {
    if !can_trace() {
        return;
    }
    let server = Server::start("poor", &["--no-cameras"]).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let neither = [
        "inject=renameat2:error=EINVAL",
        "inject=link,linkat:error=EPERM",
    ];

    // It can still rename: the file is whole.
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

    // It dies there: what has the name is empty, and the log beside it wins.
    let out = folder.path().join("killed");
    let killed = [&neither[..], &["inject=rename,renameat:signal=KILL"]].concat();
    record_under(&server, &killed, &out, "killed");
    let file = out.join("killed.h5");
    assert_eq!(std::fs::metadata(&file).expect("a file").len(), 0);
    let log = out.join("killed.h5.wal").display().to_string();
    let recovered = server
        .client(&["dataset", "recover", &log])
        .expect("a client");
    assert_eq!(recovered.status.code(), Some(0), "{}", printed(&recovered));
    let summary = Episode::open(&file).and_then(|e| e.summary());
    assert!(summary.expect("a readable file").complete);

    // The log cannot be removed: the file is good, and that is what is said.
    let out = folder.path().join("stuck");
    let stuck = ["inject=unlink,unlinkat:error=EIO"];
    let (code, text) = record_under(&server, &stuck, &out, "stuck");
    assert_eq!(code, Some(0), "{text}");
    let said = text.contains("stuck.h5: complete") && text.contains("the file is good; its log");
    assert!(said, "{text}");
}

#[test]
fn a_recorder_killed_at_any_system_call_keeps_what_it_acknowledged() {
    if !can_trace() {
        return;
    }
    let server = Server::start("calls", &CAMERA).expect("a server");
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    // The log is written by write and fdatasync, the file by pwrite64 and
    // fsync, put in place by renameat2, and the log removed by unlink. Of the writes
    // only those into the log count: threads wake each other by writing, too.
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
        let there = |link: &Client| status(link).recorders.iter().any(|r| r.recorder == name);
        wait_until("the recorder came or died", || {
            there(&link) || !doomed.alive()
        });
        if !doomed.alive() {
            println!("{call} {when}: died before it was ready");
            continue;
        }
        // Nobody is required: it may die while it gets ready. An episode that is
        // over before a slow host has let it begin would leave it waiting.
        start(&link, &label, 0);
        wait_until("it records or died", || {
            !doomed.alive() || (out.is_dir() && !Recorder::logs(&out).is_empty())
        });
        let mut known = 0;
        let begun = std::time::Instant::now();
        while doomed.alive() && begun.elapsed() < Duration::from_millis(700) {
            known = known.max(acknowledged(&out));
            std::thread::sleep(Duration::from_millis(30));
        }
        stop(&link);
        let (ended, _) = doomed.end();
        if known > 0 || !Recorder::logs(&out).is_empty() {
            let left = samples_left(&server, &out, &label);
            println!("{call} {when}: {ended}, {left} left of {known} known");
            assert!(left >= known, "{call} {when}: {left} of {known}");
        }
        wait_until("its loss is seen", || !there(&link));
    }
}

#[test]
fn a_stopped_recorder_in_real_time_harms_only_its_own_file() {
    let camera = ["--camera", "gen3=320x180@30", "--quality", "fast"];
    let server = Server::start("stalled", &camera).expect("a server");
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let mut slow = Recorder::start(&server, "slow", &out("slow"), &["--episodes", "1"]);
    let good = Recorder::start(&server, "good", &out("good"), &["--episodes", "1"]);
    wait_for_recorders(&link, 2);
    start(&link, "stall", 2);
    pass(&link, 0.5);
    slow.signal("STOP");
    // More than sockets and caches hold: about 14 MB of pictures per second.
    pass(&link, 4.0);
    slow.signal("CONT");
    pass(&link, 0.5);
    stop(&link);
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
fn lock_step_waits_for_a_stopped_recorder_and_says_for_whom() {
    let args = [&CAMERA[..], &["--pacing", "lock-step"]].concat();
    let server = Server::start("patient", &args).expect("a server");
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    let names = ["one", "two", "three", "four"];
    let recorders: Vec<_> = names
        .iter()
        .map(|name| {
            let out = folder.path().join(name);
            Recorder::start(&server, name, &out, &["--episodes", "1"])
        })
        .collect();
    wait_for_recorders(&link, 4);
    let idle = IdleCommander::start(&server.link());
    start_lock_step(&link, "pair");
    pass(&link, 1.0);
    recorders[1].signal("STOP");
    wait_until("the server says for whom it waits, and why", || {
        let words = status(&link).waiting_for;
        words.contains("recorder two") && words.contains("does not answer")
    });
    let before = tick(&link);
    // Longer than the ten seconds after which the transport takes a silent
    // client for gone.
    for _ in 0..13 {
        std::thread::sleep(Duration::from_secs(1));
        let status = status(&link);
        assert!(status.waiting_for.contains("recorder two"), "{status:?}");
    }
    assert_eq!(tick(&link), before, "time passed");
    recorders[1].signal("CONT");
    pass(&link, 1.0);
    stop(&link);
    drop(idle);
    for recorder in recorders {
        let text = recorder.finish();
        assert!(text.contains("pair.h5: complete"), "{text}");
    }
    let read =
        |name: &str| Episode::open(&folder.path().join(name).join("pair.h5")).expect("a file");
    let first = read(names[0]);
    for name in &names[1..] {
        equal(&first, &read(name));
    }
}

#[test]
fn the_end_of_an_episode_names_a_recorder_that_stands_still() {
    let server = Server::start("still", &["--no-cameras"]).expect("a server");
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "one", folder.path(), &["--episodes", "1"]);
    wait_for_recorders(&link, 1);
    start(&link, "still", 1);
    pass(&link, 0.5);
    recorder.signal("STOP");
    wait_until("its silence is told", || {
        let recorders = status(&link).recorders;
        recorders.iter().any(|one| one.silent_seconds.is_some())
    });
    let ended = server.client(&["episode", "stop"]).expect("a client");
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
    let link = server.link();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "one", folder.path(), &["--episodes", "1"]);
    wait_for_recorders(&link, 1);
    let idle = IdleCommander::start(&server.link());
    start_lock_step(&link, "dark");
    pass(&link, 1.0);
    recorder.signal("STOP");
    let stopped = tick(&link);
    wait_until("the server says for whom it waits", || {
        status(&link).waiting_for.contains("recorder one")
    });
    let before = tick(&link);
    // Less than the server's caches hold of a sample at every tick.
    let passed = before - stopped;
    assert!(passed <= CREDIT_TICKS + TICKS_PER_CONTROL, "{passed} ticks");
    std::thread::sleep(Duration::from_secs(2));
    assert!(status(&link).waiting_for.contains("recorder one"));
    assert_eq!(tick(&link), before, "time passed");
    recorder.signal("CONT");
    pass(&link, 1.0);
    stop(&link);
    drop(idle);
    let text = recorder.finish();
    let whole = text.contains("dark.h5: complete") && text.contains(" 0 missed");
    assert!(whole, "{text}");
}

fn start_lock_step(link: &Client, label: &str) {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        commander: IdleCommander::NAME.into(),
        ..Default::default()
    };
    let _: v1::EpisodeStarted = link.request(&request).expect("an episode");
}

/// The same states, commands and pictures, bit for bit.
fn equal(a: &Episode, b: &Episode) {
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
        assert!(x.rgb == y.rgb && x.ids == y.ids, "picture {i}");
        let bits = |d: &[f32]| d.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&x.depth), bits(&y.depth), "depth {i}");
    }
}

#[test]
fn two_recorders_in_real_time_miss_nothing() {
    let camera = ["--camera", "gen3=640x360@10", "--quality", "fast"];
    let server = Server::start("both", &camera).expect("a server");
    let link = server.link();
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
    wait_for_recorders(&link, 2);
    start(&link, "both", 2);
    pass(&link, 3.0);
    stop(&link);
    for recorder in recorders {
        let text = recorder.finish();
        assert!(
            text.contains("both.h5: complete") && text.contains(" 0 missed"),
            "{text}"
        );
    }
}
