//! One episode with several visual randomizations: equal physics, different colors.

use std::path::{Path, PathBuf};
use std::process::Command;

use wheelarm_dataset::read::Episode;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_tests::{printed, program, root, wheelarm};

fn succeeds(args: &[&str]) -> String {
    let output = wheelarm(args);
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

/// The files of a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut files: Vec<_> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "h5"));
    files.sort();
    files
}

#[test]
fn appearances_change_colors_but_not_states_depth_or_segmentation() {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, again] = ["first", "again"].map(|name| folder.path().join(name));
    let out = first.to_string_lossy();
    let small = ["--width", "64", "--height", "48", "--rate", "2"];
    let demo = [
        "demo",
        "--appearance",
        "9:light=1,lens=2",
        "--no-sheet",
        "--out",
        &out,
    ];
    succeeds(&[&demo[..], &small].concat());
    let recorded = files(&first).remove(0);
    let file = recorded.to_string_lossy();
    let original = Episode::open(&recorded).expect("an episode");
    let scenario = original.scenario().expect("a scenario");
    let appearance = AppearanceText::read("9:light=1,lens=2")
        .expect("an appearance")
        .for_episode(0);
    assert_eq!(scenario.appearance, Some(appearance));
    assert!(
        scenario
            .cameras
            .iter()
            .all(|c| c.lens.is_some() && c.place.is_none())
    );

    let out = again.to_string_lossy();
    let axes = "light=3,background=3,materials=3,exposure=3";
    let replay = [
        "replay",
        &file,
        "--appearances",
        "2",
        "--appearance-axes",
        axes,
        "--out",
        &out,
    ];
    let text = succeeds(&[&replay[..], &["--appearance-seed", "20"]].concat());
    assert_eq!(text.matches("hashes equal").count(), 2, "{text}");
    let made = files(&again);
    let appearances: Vec<Episode> = made
        .iter()
        .map(|file| Episode::open(file).expect("an episode"))
        .collect();
    assert_eq!(appearances.len(), 2, "{made:?}");
    let hashes = original.state_hashes().expect("hashes");
    for (appearance, seed) in appearances.iter().zip(20..) {
        assert_eq!(appearance.state_hashes().expect("hashes"), hashes);
        let scenario = appearance.scenario().expect("a scenario");
        assert_eq!(
            scenario.appearance.map(|appearance| appearance.seed),
            Some(seed)
        );
    }
    let [one, two] = [&appearances[0], &appearances[1]];
    for name in original.cameras().expect("cameras") {
        let [a, b] = [one, two].map(|e| e.camera(&name).expect("a camera"));
        let count = a.stamps().len();
        assert!(count > 10 && count == b.stamps().len());
        let mut differ = 0;
        for i in 0..count {
            let depths = [(&a, one), (&b, two)].map(|(c, e)| c.depth(e, i).expect("depth"));
            assert_eq!(depths[0], depths[1], "{name} {i}");
            let ids = [(&a, one), (&b, two)].map(|(c, e)| c.ids(e, i).expect("ids"));
            assert_eq!(ids[0], ids[1], "{name} {i}");
            let colors = [(&a, one), (&b, two)].map(|(c, e)| c.rgb(e, i).expect("color"));
            differ += usize::from(colors[0] != colors[1]);
        }
        assert_eq!(differ, count, "{name}");
    }
}

#[test]
fn invalid_appearance_is_rejected_with_file_line_and_allowed_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scenario.toml");
    let server = program("wheelarm-server").expect("the server");
    for (text, words) in [
        (
            "appearance = { seed = 1, light = 4 }",
            "strength 4, expected 0 (off), 1, 2 or 3",
        ),
        (
            "appearance = { seed = 1, lihgt = 1 }",
            "unknown field `lihgt`",
        ),
    ] {
        std::fs::write(&file, format!("seed = 3\n{text}\n")).expect("a file");
        let output = Command::new(&server)
            .args(["--no-cameras", "--scenario", &file.to_string_lossy()])
            .env("WHEELARM_ASSETS", root().join("assets"))
            .output()
            .expect("a process");
        let text = printed(&output);
        assert!(!output.status.success(), "{text}");
        for part in ["scenario.toml", "line 2", words] {
            assert!(text.contains(part), "{text}");
        }
    }
    let wrong = wheelarm(&["demo", "--appearance", "7:light=5"]);
    assert!(printed(&wrong).contains("\"light=5\", expected a strength"));
}
