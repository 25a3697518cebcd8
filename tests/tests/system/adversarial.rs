//! What once broke the physics.

use std::path::PathBuf;
use std::process::Command;

use wheelarm_tests::adversary::Recorded;
use wheelarm_tests::{printed, program, root};

/// Commands that pressed, tore and threw the bear until an earlier physics came
/// to 10¹⁷ N and a panic, each to two seconds behind that.
#[test]
fn commands_that_broke_the_bear_once_do_not_break_it() {
    let folder = root().join("tests/data/adversarial");
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .expect("the stored commands")
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "commands"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 9, "{files:?}");
    let assets = root().join("assets");
    std::thread::scope(|scope| {
        for half in files.chunks(files.len().div_ceil(2)) {
            let assets = &assets;
            scope.spawn(move || {
                for file in half {
                    let run = Recorded::read(file).expect("stored commands");
                    let verdict = run.play(assets).expect("a scenario");
                    println!("{}: {verdict:?}", file.display());
                    assert!(verdict.broken.is_empty(), "{}: {verdict:?}", file.display());
                    assert!(
                        verdict.unlawful.is_empty(),
                        "{}: {verdict:?}",
                        file.display()
                    );
                    assert!(verdict.ticks > 240 * 2, "{}: {verdict:?}", file.display());
                }
            });
        }
    });
}

/// The seed of the bear's task on which an earlier physics broke by itself.
#[test]
fn the_seed_that_broke_the_bear_once_succeeds() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(program("wheelarm").expect("the client"))
        .args([
            "evaluate",
            "--task",
            "place_teddy_bear",
            "--seeds",
            "1001..1002",
        ])
        .args(["--no-grid", "--out"])
        .arg(folder.path().join("out"))
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    assert!(output.status.success(), "{}", printed(&output));
    assert!(printed(&output).contains("1/1"), "{}", printed(&output));
}
