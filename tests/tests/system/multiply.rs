//! `multiply` makes episodes of other scenes from recorded ones, and marks their source.

use std::path::Path;

use wheelarm_campaign::multiply::mark;
use wheelarm_dataset::read::Episode;
use wheelarm_tests::{printed, wheelarm};

fn recordings(folder: &Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let paths = entries.map(|entry| entry.expect("a file").path());
    let mut paths: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|end| end == "h5"))
        .collect();
    paths.sort();
    paths
}

#[test]
fn multiplied_episodes_are_new_scenes_and_name_their_source() {
    let folder = tempfile::tempdir().expect("a folder");
    let (sources, out) = (folder.path().join("sources"), folder.path().join("out"));
    let [from, to] = [&sources, &out].map(|path| path.to_str().expect("a name"));
    let task = ["--task", "pick_mustard"];
    let small = ["--no-grid", "--record", "--camera", "wheelchair=32x24@1"];
    let recorded = ["evaluate", "--seeds", "1..3", "--out", from];
    let made = wheelarm(&[&recorded[..], &task, &small].concat());
    assert!(made.status.success(), "{}", printed(&made));

    let multiply = ["multiply", from, "--episodes", "2", "--seeds", "40..42"];
    // Otherwise a resumed run would read its own output as sources.
    let mixed = wheelarm(&[&multiply[..], &task, &["--out", from]].concat());
    let text = printed(&mixed);
    assert!(!mixed.status.success(), "{text}");
    assert!(text.contains("is the folder of the sources"), "{text}");
    assert_eq!(recordings(&sources).len(), 2);
    let multiplied = wheelarm(&[&multiply[..], &task, &["--out", to]].concat());
    let text = printed(&multiplied);
    assert!(text.contains("sources     2"), "{text}");
    let kept = recordings(&out);
    assert!(!kept.is_empty(), "{text}");
    for file in &kept {
        let [source, _] = mark::read(file).expect("a mark");
        assert!(source.starts_with("pick_mustard-seed"), "{source}");
        let episode = Episode::open(file).expect("a recording");
        let summary = episode.summary().expect("a summary");
        assert!(summary.success && summary.complete && (40..42).contains(&summary.seed));
        assert!(episode.cameras().expect("cameras").is_empty());
    }
    let report = std::fs::read_to_string(out.join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["kept"], kept.len());
    assert_eq!(report["left_out"].as_array().map(Vec::len), Some(0));
    assert!(!out.join("staging").exists());

    // A multiplied episode replays like any other, and the replay keeps its mark.
    let rendered = folder.path().join("rendered");
    let again = ["replay", kept[0].to_str().expect("a name"), "--out"];
    let camera = ["--camera", "wheelchair=32x24@1"];
    let replay = wheelarm(&[&again[..], &[rendered.to_str().expect("a name")], &camera].concat());
    let text = printed(&replay);
    assert!(
        replay.status.success() && text.contains("hashes equal"),
        "{text}"
    );
    let file = &recordings(&rendered)[0];
    assert_eq!(mark::read(file), mark::read(&kept[0]));
    let cameras = Episode::open(file).expect("a recording").cameras();
    assert_eq!(cameras.expect("cameras"), ["wheelchair"]);
}
