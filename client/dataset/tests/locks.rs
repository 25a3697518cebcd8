//! Locks of a log and of its file, in a binary of its
//! own, because child processes inherit open files.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::process::{Command, Stdio};
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

use wheelarm_dataset::finish::finish;

/// One test at a time: a program has the open files and their locks for a moment while it
/// is started.
static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// HDF5's files are inherited by every program that is started while they are
/// open: servers, policies, encoders.
#[test]
fn a_program_started_while_a_file_is_written_does_not_lock_it() {
    let _alone = ALONE.lock();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (done, ended) = std::sync::mpsc::channel::<()>();
    let starts = std::thread::spawn(move || {
        let mut started = Vec::new();
        while started.len() < 200 && ended.try_recv() != Err(TryRecvError::Disconnected) {
            let mut program = Command::new("sleep");
            program
                .arg("20")
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            started.push(program.spawn().unwrap());
            std::thread::sleep(Duration::from_millis(1));
        }
        started
    });
    for number in 0..3 {
        let log = synthetic::smooth::record(folder, &format!("busy{number}"), 2, (32, 18));
        finish(&log.unwrap(), None).unwrap();
    }
    drop(done);
    let started = starts.join().unwrap();
    let opened = [0, 1, 2].map(|number| {
        let file = folder.join(format!("busy{number}.h5"));
        hdf5::File::open_rw(file).map(drop)
    });
    for mut program in started {
        program.kill().unwrap();
        program.wait().unwrap();
    }
    assert!(opened.iter().all(Result::is_ok), "{opened:?}");
}

#[test]
fn a_log_and_its_file_name_belong_to_one_program_at_a_time() {
    let _alone = ALONE.lock();
    let folder = tempfile::tempdir().unwrap();
    let [one, other, out] = ["one", "other", "out"].map(|name| folder.path().join(name));
    for folder in [&one, &other, &out] {
        std::fs::create_dir_all(folder).unwrap();
    }
    let record = |folder| synthetic::smooth::record(folder, "same", 2, (32, 18)).unwrap();
    let (first, second) = (record(&one), record(&other));
    // A log that another process holds.
    let held = wheelarm_dataset::log::hold(&first).unwrap();
    let error = finish(&first, Some(&out)).unwrap_err().to_string();
    assert!(error.contains("is being written by a recorder"), "{error}");
    drop(held);
    // The name under which another process makes a file.
    let making = std::fs::File::create(out.join("same.h5.tmp")).unwrap();
    making.try_lock().unwrap();
    let error = finish(&second, Some(&out)).unwrap_err().to_string();
    assert!(error.contains("another program is making it"), "{error}");
    assert!(error.contains("wheelarm dataset recover"), "{error}");
    assert!(second.exists() && out.join("same.h5.tmp").exists());
    drop(making);
    finish(&first, Some(&out)).unwrap();
    let error = finish(&second, Some(&out)).unwrap_err().to_string();
    assert!(error.contains("exists already"), "{error}");
    assert!(second.exists() && !first.exists());
}

/// Calls that some file systems lack: no lock (NFS without its service, Lustre), and no
/// sync of a folder (VirtualBox's shares, old CIFS).
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <sys/stat.h>
int flock(int fd, int op) { (void)fd; (void)op; errno = ENOLCK; return -1; }
int fsync(int fd) {
    struct stat found;
    if (fstat(fd, &found) == 0 && S_ISDIR(found.st_mode)) { errno = EINVAL; return -1; }
    return ((int (*)(int))dlsym(RTLD_NEXT, "fsync"))(fd);
}
"#;

#[cfg(target_os = "linux")]
#[test]
fn recordings_are_made_and_read_on_a_file_system_without_locks_and_folder_syncs() {
    let _alone = ALONE.lock();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (source, shim) = (folder.join("shim.c"), folder.join("shim.so"));
    std::fs::write(&source, SHIM).unwrap();
    let built = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([&shim, &source])
        .arg("-ldl")
        .status();
    assert!(built.unwrap().success());
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
            .args(arguments)
            .env("LD_PRELOAD", &shim)
            .current_dir(folder)
            .output()
            .unwrap();
        let words = [output.stdout, output.stderr].concat();
        (
            output.status.code(),
            String::from_utf8_lossy(&words).into_owned(),
        )
    };
    let log = synthetic::smooth::record(folder, "far", 2, (32, 18)).unwrap();
    let (code, words) = run(&["recover", "far.h5.wal"]);
    assert_eq!(code, Some(0), "{words}");
    assert!(!log.exists() && folder.join("far.h5").exists(), "{words}");
    for command in [
        &["info", "far.h5"][..],
        &["validate", "far.h5"],
        &["export", "--format", "csv", "--out", "out", "far.h5"],
    ] {
        let (code, words) = run(command);
        assert_ne!(code, Some(1), "{words}");
        assert!(!words.contains("damaged"), "{words}");
    }
}
