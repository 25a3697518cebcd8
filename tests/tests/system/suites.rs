//! A suite from its file to checked results, with a policy that stays at rest.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use wheelarm_tests::{printed, program, root};

/// Two cells of two episodes, which end after two simulated seconds.
const SUITE: &str = r#"
purpose = "policy-claim"
seeds = [600, 602]
tasks = ["pick_mustard"]
unseen = ["seeds"]
[scenario]
starts = "near"
time_limit_seconds = 2.0
[[cell]]
name = "base"
[[cell]]
name = "start-2"
axis = "start"
strength = 2
scenario.starts = "anywhere"
"#;

/// Runs `wheelarm evaluate` in `folder`. Returns its exit code and output.
fn evaluate(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(program("wheelarm").expect("the client"))
        .arg("evaluate")
        .args(arguments)
        .current_dir(folder)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    (output.status.code(), printed(&output))
}

#[test]
fn suite_is_run_in_sessions_and_its_results_are_checked_and_repeated() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("a file");
    let run = |more: &[&str]| {
        let usual = ["--suite", "s.toml", "--policy", "hold", "--jobs", "2"];
        evaluate(folder, &[&usual, more].concat())
    };

    write("s.toml", SUITE);
    let (code, text) = run(&["--out", "out"]);
    assert_eq!(code, Some(1), "{text}");
    let (_, rest) = text.split_once("frozen = \"").expect("the hash");
    write("s.toml", &format!("frozen = \"{}\"\n{SUITE}", &rest[..16]));

    // A policy that was trained on a seed of the suite.
    write(
        "l.json",
        r#"{"format":"wheelarm-ledger/1","seeds":[[601,601]]}"#,
    );
    let (code, text) = run(&["--out", "trained", "--ledger", "l.json"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("seeds 601"), "{text}");

    // Two sessions.
    let (code, text) = run(&["--out", "out", "--cells", "start-2"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("the cell base is not complete"), "{text}");
    let (code, text) = run(&["--out", "out"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains("2 of 4 episodes of 2 cells are open"),
        "{text}"
    );
    for name in ["report.html", "chart.svg"] {
        assert!(folder.join("out").join(name).is_file(), "{name}");
    }
    let results = std::fs::read_to_string(folder.join("out/s.json")).expect("the results");
    let value: Value = serde_json::from_str(&results).expect("JSON");
    let rows = value["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 4);
    // The start differs, so the last state does.
    let state = |cell: &str| {
        let row = |row: &&Value| row["cell"] == cell && row["seed"] == 600;
        rows.iter().find(row).expect("a row")["state"].clone()
    };
    assert_ne!(state("base"), state("start-2"));
    assert!(
        rows.iter()
            .all(|row| row["cause"].as_str().expect("words").starts_with("timeout"))
    );

    let verify = |more: &[&str]| {
        let usual = [
            "verify",
            "out/s.json",
            "--suite",
            "s.toml",
            "--out",
            "again",
        ];
        evaluate(folder, &[&usual, more].concat())
    };
    let (code, text) = verify(&["--rerun", "2"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains("2 of 2 episodes are equal bit by bit"),
        "{text}"
    );
    write(
        "out/s.json",
        &results.replacen("\"success\":false", "\"success\":true", 1),
    );
    let (code, text) = verify(&[]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("edited"), "{text}");
}
