//! Programs in the layout of a package: `bin` and `share` of one prefix.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;
use wheelarm_tests::{TASKS, printed, program, root};

/// A prefix with the programs in `bin` and the assets in `share/wheelarm`.
fn installed() -> TempDir {
    let prefix = tempfile::tempdir().expect("a folder");
    let (bin, share) = (
        prefix.path().join("bin"),
        prefix.path().join("share/wheelarm"),
    );
    std::fs::create_dir_all(&bin).unwrap();
    std::fs::create_dir_all(&share).unwrap();
    for name in ["wheelarm", "wheelarm-server"] {
        let built = program(name).unwrap();
        std::fs::copy(&built, bin.join(name)).expect("a copy of the program");
    }
    std::os::unix::fs::symlink(root().join("assets"), share.join("assets")).unwrap();
    prefix
}

/// Runs a program of the prefix in an empty folder.
fn run(prefix: &Path, name: &str, args: &[&str]) -> Output {
    let empty = tempfile::tempdir().expect("a folder");
    Command::new(prefix.join("bin").join(name))
        .args(args)
        .current_dir(empty.path())
        .env_remove("WHEELARM_ASSETS")
        .output()
        .expect("a process")
}

#[test]
fn installed_programs_find_their_assets() {
    let prefix = installed();
    let tasks = run(prefix.path(), "wheelarm-server", &["--list-tasks"]);
    assert!(tasks.status.success(), "{}", printed(&tasks));
    let listed = String::from_utf8_lossy(&tasks.stdout);
    for task in TASKS {
        assert!(listed.contains(task), "{task} is missing:\n{listed}");
    }

    let plan = ["collect", "assets/campaigns/small.toml", "--dry-run"];
    let plan = run(prefix.path(), "wheelarm", &plan);
    assert!(plan.status.success(), "{}", printed(&plan));

    std::fs::remove_file(prefix.path().join("share/wheelarm/assets")).unwrap();
    let none = run(prefix.path(), "wheelarm-server", &["--list-tasks"]);
    assert!(!none.status.success(), "{}", printed(&none));
    let words = String::from_utf8_lossy(&none.stderr);
    assert!(words.contains("WHEELARM_ASSETS"), "names no fix: {words}");
}
