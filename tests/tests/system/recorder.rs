//! Recorders that start late, die, reconnect or run in pairs: no acknowledged sample is lost, and
//! no other client is disturbed.

use std::path::Path;
use std::time::{Duration, Instant};

use wheelarm_proto::{Message, v1};
use wheelarm_tests::{PATIENCE, Recorder, Server, printed, program};

/// Small images at a high rate.
const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@30", "--quality", "fast"];

/// Runs a client command until it succeeds: a recorder needs a moment to connect.
fn command(server: &Server, args: &[&str]) -> String {
    let output = server.run_client(args).expect("a client");
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

fn wait_for_status(server: &Server, words: &str) {
    let since = Instant::now();
    loop {
        let status = command(server, &["status"]);
        if status.contains(words) {
            return;
        }
        assert!(
            since.elapsed() < PATIENCE,
            "no {words:?} in the status: {status}"
        );
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn start(server: &Server, label: &str, recorders: &str) {
    let args = [
        "episode",
        "start",
        "--label",
        label,
        "--require-recorders",
        recorders,
    ];
    command(server, &args);
}

fn info(server: &Server, file: &Path) -> String {
    let file = file.to_string_lossy();
    printed(
        &server
            .run_client(&["dataset", "info", &file])
            .expect("a client"),
    )
}

#[test]
fn two_recorders_and_a_late_third_record_their_episodes() {
    let server = Server::start("several", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let first = Recorder::start(&server, "first", &out("first"), &["--episodes", "2"]);
    let second = Recorder::start(&server, "second", &out("second"), &["--episodes", "2"]);
    wait_for_status(&server, "second");
    wait_for_status(&server, "first");
    start(&server, "one", "2");
    std::thread::sleep(Duration::from_secs(2));
    command(&server, &["episode", "stop"]);
    // At once again: the announcement overtakes images of the first episode.
    start(&server, "two", "2");
    std::thread::sleep(Duration::from_secs(1));
    command(&server, &["episode", "stop"]);
    // Starts after the end of an episode that the transport still caches.
    let late = Recorder::start(&server, "late", &out("late"), &["--episodes", "1"]);
    for (recorder, name) in [(first, "first"), (second, "second")] {
        let text = recorder.finish();
        assert_eq!(text.matches(": complete").count(), 2, "{name}: {text}");
    }
    wait_for_status(&server, "late");
    start(&server, "three", "1");
    std::thread::sleep(Duration::from_secs(1));
    command(&server, &["episode", "stop"]);
    let text = late.finish();
    assert!(text.contains("three.h5: complete"), "{text}");
    assert!(info(&server, &out("first").join("one.h5")).contains("complete"));
}

#[test]
fn log_of_a_killed_recorder_becomes_a_valid_partial_file() {
    let server = Server::start("killed", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut doomed = Recorder::start(&server, "doomed", folder.path(), &[]);
    wait_for_status(&server, "doomed");
    start(&server, "cut", "1");
    std::thread::sleep(Duration::from_secs(2));
    doomed.kill();
    // The server continues, and reports that the recorder has not confirmed the end.
    let stopped = server.run_client(&["episode", "stop"]).expect("a client");
    let text = printed(&stopped);
    assert_eq!(stopped.status.code(), Some(3), "{text}");
    assert!(text.contains("NOT CONFIRMED by recorder doomed"), "{text}");
    let logs = Recorder::logs(folder.path());
    let [log] = &logs[..] else {
        panic!("expected one log, found {logs:?}")
    };
    let out = folder.path().join("recovered");
    std::fs::create_dir(&out).expect("a folder");
    let (log, out_text) = (log.to_string_lossy(), out.to_string_lossy());
    let recovered = server
        .run_client(&["dataset", "recover", &log, "--out", &out_text])
        .expect("a client");
    let text = printed(&recovered);
    assert_eq!(recovered.status.code(), Some(3), "{text}");
    let file = out.join("cut.h5");
    assert!(file.is_file(), "{text}");
    let info = info(&server, &file);
    assert!(info.to_lowercase().contains("partial"), "{info}");
}

#[test]
fn one_of_two_recorders_with_one_name_is_rejected() {
    let server = Server::start("twins", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut twins = ["a", "b"].map(|out| {
        let out = folder.path().join(out);
        Recorder::start(&server, "twin", &out, &["--episodes", "1"])
    });
    let since = Instant::now();
    while twins.iter_mut().all(Recorder::alive) {
        assert!(since.elapsed() < PATIENCE, "both were accepted");
        std::thread::sleep(Duration::from_millis(20));
    }
    let [mut first, mut second] = twins;
    if first.alive() {
        std::mem::swap(&mut first, &mut second);
    }
    assert!(!first.end().0.success());
    wait_for_status(&server, "twin");
    start(&server, "one", "1");
    command(&server, &["episode", "stop"]);
    assert!(second.finish().contains("one.h5: complete"));
}

#[test]
fn existing_recording_is_never_overwritten() {
    let server = Server::start("taken", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("precious.h5");
    std::fs::write(&file, "precious").expect("a file");
    let _recorder = Recorder::start(&server, "careful", folder.path(), &[]);
    wait_for_status(&server, "careful");
    let start = ["episode", "start", "--label", "precious"];
    let output = server
        .run_client(&[&start[..], &["--require-recorders", "1"]].concat())
        .expect("a client");
    let text = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("did not begin: recorder careful"), "{text}");
    assert!(text.contains("exists already"), "{text}");
    assert!(text.contains("next free label is precious-2"), "{text}");
    assert!(!text.contains("started"), "{text}");
    wait_for_status(&server, "exists already");
    assert_eq!(
        std::fs::read_to_string(&file).expect("the file"),
        "precious"
    );
}

#[test]
fn folder_name_that_hdf5_cannot_open_is_rejected_before_recording() {
    use std::os::unix::ffi::OsStrExt;
    let server = Server::start("bytes", &["--no-cameras"]).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join(std::ffi::OsStr::from_bytes(b"\xff"));
    let output = std::process::Command::new(program("wheelarm").expect("the client"))
        .args(["--connect", &server.endpoint, "--sim", &server.sim])
        .args(["record", "--episodes", "1", "--out"])
        .arg(&out)
        .output()
        .expect("a client");
    let text = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("UTF-8") && text.contains("--out"), "{text}");
    assert!(!out.exists());
}

#[test]
fn shutdown_during_a_recording_leaves_a_complete_file() {
    let server = Server::start("ending", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "1"]);
    wait_for_status(&server, "witness");
    start(&server, "last", "1");
    std::thread::sleep(Duration::from_secs(1));
    command(&server, &["shutdown"]);
    let text = recorder.finish();
    assert!(text.contains("last.h5: complete"), "{text}");
}

#[test]
fn images_are_compressed_once_for_all_recorders() {
    use wheelarm_proto::digest::of_message;
    let server = Server::start("once", &CAMERA).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let small = Recorder::start(&server, "small", &out("small"), &["--episodes", "1"]);
    // A recorder with another form of depth receives the uncompressed images.
    let exact = [&["--episodes", "1"][..], &["--depth", "u16"]].concat();
    let exact = Recorder::start(&server, "exact", &out("exact"), &exact);
    for name in ["small", "exact"] {
        wait_for_status(&server, name);
    }
    let client = server.client();
    let subscribe = |key: String| {
        let (sender, receiver) = std::sync::mpsc::channel();
        let subscriber = client.subscribe(&key, move |sample| {
            let _ = sender.send(sample.payload().to_bytes().into_owned());
        });
        (subscriber.expect("a subscriber"), receiver)
    };
    let (_cameras, cameras) = subscribe(client.keys().camera("gen3"));
    let (_compressed, compressed) = subscribe(client.keys().compressed("gen3"));
    start(&server, "one", "2");
    std::thread::sleep(Duration::from_secs(1));
    command(&server, &["episode", "stop"]);
    for (recorder, name) in [(small, "small"), (exact, "exact")] {
        let text = recorder.finish();
        assert!(text.contains("one.h5: complete"), "{name}: {text}");
        let file = out(name).join("one.h5");
        let file = file.to_string_lossy();
        let valid = server.run_client(&["dataset", "validate", &file]);
        let valid = valid.expect("a client");
        let text = printed(&valid);
        assert!(valid.status.success(), "{name}: {text}");
        let has_digests =
            text.contains("camera/gen3") && text.contains("as they came, by their digest");
        assert!(has_digests || name == "exact", "{text}");
    }
    let exact: Vec<_> = cameras
        .try_iter()
        .map(|bytes| {
            let frame = v1::CameraFrame::decode(&bytes[..]).expect("an image");
            (frame, of_message([&bytes[..]]))
        })
        .filter(|(frame, _)| frame.header.as_ref().is_some_and(|h| h.episode > 0))
        .collect();
    let mut pairs = 0;
    for bytes in compressed.try_iter() {
        let small = v1::CompressedCameraFrame::decode(&bytes[..]).expect("an image");
        let Some((frame, digest)) = exact.iter().find(|(f, _)| f.header == small.header) else {
            continue;
        };
        assert_eq!((&small.digest[..], small.pose), (&digest[..], frame.pose));
        let planes = [
            (&small.color, &frame.color, 1),
            (&small.depth, &frame.depth, 4),
            (&small.segmentation, &frame.segmentation, 2),
        ];
        for (small, plane, element) in planes {
            let mut shuffled = vec![0; plane.len()];
            libdeflater::Decompressor::new()
                .zlib_decompress(small, &mut shuffled)
                .expect("a zlib stream");
            let count = plane.len() / element;
            let byte = |i: usize| shuffled[i % element * count + i / element];
            assert!((0..plane.len()).all(|i| byte(i) == plane[i]));
        }
        pairs += 1;
    }
    assert!(pairs > 10 && pairs == exact.len(), "{pairs}");
}
