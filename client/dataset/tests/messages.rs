//! What the program says of a path that is no episode, and what it leaves.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::path::Path;
use std::process::{Command, Output};

use parking_lot::{Mutex, MutexGuard};
use wheelarm_dataset::finish::finish;

/// One test at a time: a child that starts while a file is written inherits its
/// lock.
fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock()
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The words of a run that must fail: one line, which names the path once.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {words}");
    assert_eq!(words.lines().count(), 1, "{arguments:?}: {words}");
    for jargon in ["H5F", "errno", "eof", "[110", "os error"] {
        assert!(!words.contains(jargon), "{arguments:?}: {words}");
    }
    words
}

/// An episode `LABEL.h5` in the folder.
fn episode(folder: &Path, label: &str) {
    let log = synthetic::smooth::record(folder, label, 2, (32, 18)).unwrap();
    finish(&log, None).unwrap();
}

#[test]
fn a_path_that_is_no_episode_is_named_with_its_cure() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let info = |name: &str| refused(folder, &["info", name]);
    assert_eq!(info("none.h5"), "none.h5: there is no such file");
    assert_eq!(
        info("."),
        ".: it is a folder without an episode file (*.h5)"
    );
    std::os::unix::fs::symlink("nowhere.h5", folder.join("link.h5")).unwrap();
    assert_eq!(
        info("link.h5"),
        "link.h5: it is a link to nowhere.h5, and there is no such file"
    );
    std::fs::remove_file(folder.join("link.h5")).unwrap();

    let log = synthetic::smooth::record(folder, "late", 2, (32, 18)).unwrap();
    assert!(info("late.h5").contains("`wheelarm dataset recover late.h5.wal`"));
    assert!(info("late.h5.wal").contains("`wheelarm dataset recover late.h5.wal`"));

    std::fs::write(folder.join("whole.h5"), finished(&log)).unwrap();
    let all = std::fs::read(folder.join("whole.h5")).unwrap();
    std::fs::write(folder.join("cut.h5"), &all[..all.len() / 2]).unwrap();
    let cut = info("cut.h5");
    let half = format!("{} of {} bytes are there", all.len() / 2, all.len());
    assert!(
        cut.contains(&half) && cut.ends_with("copy it again from where it was recorded"),
        "{cut}"
    );
    std::fs::copy(&log, folder.join("cut.h5.wal")).unwrap();
    let cut = info("cut.h5");
    assert!(
        cut.contains("move this file away, then `wheelarm dataset recover cut.h5.wal`"),
        "{cut}"
    );
    assert!(info(".").contains("name one of its 2 files, for example ./cut.h5"));

    std::fs::write(folder.join("empty.h5"), []).unwrap();
    assert!(info("empty.h5").starts_with("empty.h5: the file is empty; copy it again"));
    std::fs::write(folder.join("notes.h5"), "not HDF5 at all").unwrap();
    assert_eq!(
        info("notes.h5"),
        "notes.h5 is no WheelArm episode: it is no HDF5 file"
    );
    drop(hdf5::File::create(folder.join("foreign.h5")).unwrap());
    assert!(
        info("foreign.h5")
            .ends_with("it is an HDF5 file of another program, without the attribute `format`")
    );
}

/// Bytes of the file that a log becomes; the log stays.
fn finished(log: &Path) -> Vec<u8> {
    let other = tempfile::tempdir().unwrap();
    let copy = other.path().join("copy.wal");
    std::fs::copy(log, &copy).unwrap();
    std::fs::read(finish(&copy, None).unwrap().path).unwrap()
}

#[test]
fn a_file_that_is_no_log_is_not_recovered_and_told_why() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let recover = |name: &str| refused(folder, &["recover", name]);
    assert_eq!(recover("none.wal"), "none.wal: there is no such file");
    assert_eq!(
        recover("."),
        ".: it is a folder; name a log in it, LABEL.h5.wal"
    );
    assert!(
        recover("whole.h5")
            .contains("it is an HDF5 file, `wheelarm dataset info whole.h5` shows what it holds")
    );
    std::fs::write(folder.join("notes.wal"), "shopping: mustard, crackers").unwrap();
    let words = recover("notes.wal");
    assert!(
        words.contains("it does not begin like one; a log is named LABEL.h5.wal"),
        "{words}"
    );
    std::fs::write(folder.join("newer.wal"), b"WHLLOG7\n and more of it").unwrap();
    assert!(recover("newer.wal").contains("it is a log of format '7', this program reads '1'"));
}

#[test]
fn without_one_good_file_there_is_no_table_and_no_leftover() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("notes.h5"), "not HDF5 at all").unwrap();
    for arguments in [
        &["label", "--out", "left.csv", "notes.h5"][..],
        &["label", "notes.h5"],
        &[
            "stats", "--csv", "left.csv", "--plot", "left.png", "notes.h5",
        ],
        &["stats", "notes.h5"],
        &["align", "--out", "left", "notes.h5"],
        &["plot", "--out", "left", "notes.h5"],
        &["view", "--out", "left", "notes.h5"],
        &["sheet", "--out", "left.png", "notes.h5"],
        &["export", "--format", "csv", "--out", "left", "notes.h5"],
        &["export", "--format", "mcap", "--out", "left", "notes.h5"],
    ] {
        refused(folder, arguments);
        let output = run(folder, arguments);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(printed.is_empty(), "{arguments:?} prints {printed}");
        let left: Vec<_> = std::fs::read_dir(folder).unwrap().flatten().collect();
        assert_eq!(left.len(), 1, "{arguments:?} leaves {left:?}");
    }
    // With a good file beside it the table is made of that one.
    episode(folder, "whole");
    let output = run(
        folder,
        &["label", "--out", "left.csv", "notes.h5", "whole.h5"],
    );
    assert_eq!(output.status.code(), Some(1));
    let table = std::fs::read_to_string(folder.join("left.csv")).unwrap();
    assert!(
        table.lines().count() > 1 && table.contains("whole"),
        "{table}"
    );
}
