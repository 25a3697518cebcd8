//! Runs `wheelarm-dataset` as a process and records small episodes for it.

use std::path::Path;
use std::process::{Command, Output};

use parking_lot::{Mutex, MutexGuard};
use wheelarm_dataset::finish::finish;

use super::synthetic;

/// Runs one test at a time: a child process that starts while a file is written inherits
/// its lock.
pub fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock()
}

pub fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Error text of a run that must fail: a single line without jargon.
pub fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {words}");
    assert_eq!(words.lines().count(), 1, "{arguments:?}: {words}");
    for jargon in ["H5F", "errno", "eof", "[110", "os error"] {
        assert!(!words.contains(jargon), "{arguments:?}: {words}");
    }
    words
}

/// Records an episode `LABEL.h5` into the folder.
pub fn episode(folder: &Path, label: &str) {
    let log = synthetic::smooth::record(folder, label, 2, (32, 18)).unwrap();
    finish(&log, None).unwrap();
}
