//! Tasks without an area in the home of a world pack: the expert completes one, its recording
//! replays, and a home that does not satisfy a task says what it has.

use std::path::Path;
use std::process::{Command, Output};

use wheelarm_dataset::read::Episode;
use wheelarm_tests::{printed, program, root};

/// Runs a program with the packs of `tests/data`.
fn run(name: &str, args: &[&str]) -> Output {
    Command::new(program(name).expect("the program"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .env("WHEELARM_PACKS", root().join("tests/data"))
        .output()
        .expect("a process")
}

fn only_recording(folder: &Path) -> std::path::PathBuf {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut paths = entries.map(|entry| entry.path());
    let found = paths.find(|path| path.extension().is_some_and(|ending| ending == "h5"));
    found.expect("a recording")
}

#[test]
fn expert_completes_a_task_by_query_and_its_recording_replays() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_string_lossy().into_owned();
    let evaluate = run(
        "wheelarm",
        &[
            "evaluate",
            "--scene",
            "flat",
            "--task",
            "take_from_table",
            "--seeds",
            "1..2",
            "--no-grid",
            "--record",
            "--camera",
            "wheelchair=64x48@1",
            "--out",
            &out,
        ],
    );
    let text = printed(&evaluate);
    assert!(evaluate.status.success(), "{text}");
    let results = std::fs::read_to_string(folder.path().join("episodes.jsonl")).expect("results");
    let result: serde_json::Value = serde_json::from_str(results.trim()).expect("one result");
    assert_eq!(result["success"], true, "{result}\n{text}");
    let file = only_recording(folder.path());
    let episode = Episode::open(&file).expect("a recording");
    let instruction = episode.started().expect("its start").instruction;
    assert!(
        instruction.contains("the table in the kitchen"),
        "{instruction}"
    );
    let replay = run("wheelarm", &["replay", &file.to_string_lossy()]);
    let text = printed(&replay);
    assert!(
        replay.status.success() && text.contains("hashes equal"),
        "{text}"
    );
}

#[test]
fn refused_task_lists_what_the_home_has() {
    let args = ["--scene", "flat", "--task", "carry_to_living_room"];
    let server = run(
        "wheelarm-server",
        &[&args[..], &["--draws", "0..1"]].concat(),
    );
    let evaluate = run("wheelarm", &[&["evaluate"], &args[..]].concat());
    for output in [server, evaluate] {
        let text = printed(&output);
        assert!(!output.status.success(), "{text}");
        for part in [
            "living room in flat",
            "tables: kitchen",
            "living rooms: none",
        ] {
            assert!(text.contains(part), "{part:?} is missing in: {text}");
        }
    }
}
