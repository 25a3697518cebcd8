//! Full disks, and texts that are hard to store.

use std::path::Path;
use std::process::Command;

use wheelarm_dataset::read::Episode;
use wheelarm_proto::v1;
use wheelarm_sdk::Client;
use wheelarm_tests::{Recorder, Server, printed, wait_until};

const CAMERA: [&str; 4] = ["--camera", "gen3=160x90@30", "--quality", "fast"];

/// A small file system; `None` where mounting is not allowed.
struct SmallDisk {
    folder: tempfile::TempDir,
}

impl SmallDisk {
    fn mount(size: &str) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a folder");
        let option = format!("size={size}");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &option, "tmpfs"])
            .arg(folder.path())
            .output();
        mounted
            .is_ok_and(|o| o.status.success())
            .then_some(Self { folder })
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount")
            .arg("-l")
            .arg(self.folder.path())
            .status();
    }
}

fn status(client: &Client) -> v1::Status {
    client.request(&v1::StatusRequest {}).expect("a status")
}

fn start(client: &Client, label: &str, recorders: u32) {
    wait_until("the recorders are connected", || {
        status(client).recorders.len() >= recorders as usize
    });
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        require_recorders: recorders,
        ..Default::default()
    };
    let _: v1::EpisodeStarted = client.request(&request).expect("an episode");
}

fn stop(client: &Client) {
    let request = v1::EpisodeStopRequest::default();
    let _: v1::EpisodeStopped = client.request(&request).expect("its end");
}

/// Failure message of the recorder `name`, when it has failed.
fn failure(client: &Client, name: &str) -> Option<String> {
    let recorders = status(client).recorders;
    let failed = recorders
        .into_iter()
        .find(|r| r.recorder == name && r.state() == v1::RecorderState::Failed);
    failed.map(|r| r.message)
}

/// Recovers the only log of `folder` into another folder; the number of images in the file.
fn recover(server: &Server, folder: &Path, label: &str) -> usize {
    let logs = Recorder::logs(folder);
    let [log] = &logs[..] else {
        panic!("expected one log, found {logs:?}")
    };
    let out = tempfile::tempdir().expect("a folder");
    let (log, out_text) = (log.to_string_lossy(), out.path().to_string_lossy());
    let args = ["dataset", "recover", &log, "--out", &out_text];
    let recovered = server.run_client(&args).expect("a client");
    let code = recovered.status.code();
    assert!(matches!(code, Some(0 | 3)), "{}", printed(&recovered));
    let episode = Episode::open(&out.path().join(format!("{label}.h5"))).expect("a file");
    episode.camera("gen3").expect("a camera").len()
}

#[test]
fn disk_that_fills_up_during_an_episode_loses_no_acknowledged_sample() {
    let server = Server::start("full", &CAMERA).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let good = Recorder::start(&server, "good", folder.path(), &["--episodes", "1"]);
    let disk = SmallDisk::mount("4m");
    let (out, poor) = match &disk {
        Some(disk) => {
            println!("used: a tmpfs of 4 MB");
            let poor = Recorder::start(&server, "poor", disk.path(), &[]);
            (disk.path().to_owned(), poor)
        }
        None => {
            println!("used: a limit of 3 MB for a file, for mount is not allowed here");
            let out = folder.path().join("poor");
            let limit = "trap '' XFSZ; exec prlimit --fsize=3000000 \"$0\" \"$@\"";
            let wrapper = ["sh", "-c", limit];
            let poor = Recorder::start_under(&wrapper, &server, "poor", &out, &[]);
            (out, poor)
        }
    };
    start(&client, "full", 2);
    wait_until("the disk is full", || failure(&client, "poor").is_some());
    let words = failure(&client, "poor").unwrap_or_default();
    assert!(words.contains("cannot append"), "{words}");
    assert!(
        disk.is_none() || words.contains("recover"),
        "no cure in {words}"
    );
    let names: Vec<_> = std::fs::read_dir(&out)
        .expect("the folder")
        .flatten()
        .collect();
    assert_eq!(names.len(), 1, "only the log may be there: {names:?}");
    let before = status(&client).header.unwrap_or_default().tick;
    wait_until("the simulation continues", || {
        status(&client).header.unwrap_or_default().tick > before + 120
    });
    stop(&client);
    let text = good.finish();
    assert!(text.contains("full.h5: complete"), "{text}");
    let mut poor = poor;
    poor.signal("TERM");
    assert_eq!(poor.end().0.code(), Some(1));
    let images = recover(&server, &out, "full");
    assert!(images > 10, "{images} images are left");
}

#[test]
fn disk_that_is_full_at_the_end_keeps_the_log_and_no_partial_file() {
    let Some(disk) = SmallDisk::mount("24m") else {
        println!("skipped: mount is not allowed here");
        return;
    };
    let server = Server::start("brim", &CAMERA).expect("a server");
    let client = server.client();
    let mut recorder = Recorder::start(&server, "brim", disk.path(), &["--episodes", "1"]);
    start(&client, "brim", 1);
    let log = disk.path().join("brim.h5.wal");
    let size = || std::fs::metadata(&log).map_or(0, |m| m.len());
    wait_until("samples are recorded", || size() > 2_000_000);
    // Space for the remaining samples, not for the file.
    let filler = disk.path().join("filler");
    let room = 24 * 1024 * 1024 - size() - 1_500_000;
    let filling = std::fs::write(&filler, vec![7; usize::try_from(room).expect("a size")]);
    stop(&client);
    let (ended, _) = recorder.end();
    assert!(filling.is_ok(), "{filling:?}");
    assert_eq!(ended.code(), Some(1));
    let mut names: Vec<String> = std::fs::read_dir(disk.path())
        .expect("the folder")
        .flatten()
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["brim.h5.wal", "filler"]);
    assert!(recover(&server, disk.path(), "brim") > 10);
}

#[test]
fn labels_and_instructions_are_rejected_or_stored_exactly() {
    let server = Server::start("words", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "words", folder.path(), &["--episodes", "2"]);
    wait_until("the recorder is connected", || {
        !status(&client).recorders.is_empty()
    });
    let long = "Возьми «горчицу» 🌭, bitte! ".repeat(400);
    let long: String = long.chars().take(10_000).collect();
    let tricky =
        "tab\tquote\" back\\slash\nnew line \u{202e}right to left\u{202c} é e\u{301}".to_owned();
    let request = |label: &str, instruction: &str| {
        client.request(&v1::EpisodeStartRequest {
            label: label.into(),
            instruction: Some(instruction.into()),
            require_recorders: 1,
            ..Default::default()
        })
    };
    for bad in [
        "../escape",
        "a/b",
        "a\\b",
        "",
        ".hidden",
        "naïve",
        "x\0y",
        &"l".repeat(101),
    ] {
        let error = request(bad, "").expect_err("a refusal").to_string();
        assert!(error.contains("label"), "{bad:?}: {error}");
    }
    let error = request("nul", "a\0b").expect_err("a refusal").to_string();
    assert!(error.contains("instruction"), "{error}");
    for (label, instruction) in [("long", &long), ("tricky", &tricky)] {
        request(label, instruction).expect("an episode");
        wait_until("the episode runs", || {
            status(&client).waiting_for.is_empty()
        });
        stop(&client);
    }
    recorder.finish();
    for (label, instruction) in [("long", long), ("tricky", tricky)] {
        let file = folder.path().join(format!("{label}.h5"));
        let episode = Episode::open(&file).expect("a file");
        assert_eq!(
            episode.summary().expect("a summary").instruction,
            instruction
        );
    }
    let escaped = folder.path().parent().expect("a parent").join("escape.h5");
    assert!(!escaped.exists());
}
