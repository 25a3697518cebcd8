//! Disturbances behind the gate and forced errors: recorded, reproduced by a replay from the
//! scenario alone, and absent unless a scenario requests them.

use std::path::Path;

use wheelarm_dataset::read::Episode;
use wheelarm_tests::{printed, wheelarm};

/// Records one episode, successful or not.
fn record(out: &Path, more: &[&str]) -> Episode {
    let folder = out.to_string_lossy();
    let own = ["evaluate", "--task", "pick_mustard", "--seeds", "1..2"];
    let small = ["--no-grid", "--record", "--camera", "wheelchair=64x48@1"];
    let output = wheelarm(&[&own[..], &small, &["--out", &folder], more].concat());
    let file = out.join("pick_mustard-seed1.h5");
    assert!(file.is_file(), "{}", printed(&output));
    Episode::open(&file).expect("a recording")
}

/// An episode and its replay have equal marks at equal ticks, and exports with equal rows.
fn check_marks_of_replay(original: &Episode, replayed: &Path) {
    let replayed = Episode::open(replayed).expect("a recording");
    for column in [
        "device",
        "mode",
        "assistance",
        "incident",
        "phase",
        "phase_name",
    ] {
        let marks = |episode: &Episode| -> Vec<(u64, String)> {
            let ticks = episode.u64s("command", "tick").expect("ticks");
            let texts = episode.texts("command", column).expect("texts");
            let all = ticks.into_iter().zip(texts);
            all.filter(|(_, text)| !text.is_empty()).collect()
        };
        assert_eq!(marks(&replayed), marks(original), "{column}");
    }
    let exported = |episode: &Episode| {
        let out = episode.path().with_extension("csv");
        let (file, folder) = (episode.path().to_string_lossy(), out.to_string_lossy());
        let export = [
            "dataset", "export", "--format", "csv", "--out", &folder, &file,
        ];
        let export = wheelarm(&export);
        assert!(export.status.success(), "{}", printed(&export));
        let episode = std::fs::read_dir(&out).expect("a folder").next();
        let rows = episode.expect("an episode").expect("a folder").path();
        std::fs::read_to_string(rows.join("rows.csv")).expect("rows")
    };
    let rows = exported(original);
    let marked = rows.lines().skip(1).filter(|row| !row.ends_with(",0"));
    assert!(marked.count() > 0, "no row is marked");
    assert_eq!(exported(&replayed), rows);
}

#[test]
fn disturbances_are_recorded_beside_commands_and_replayed_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let disturbed = record(
        &folder.path().join("disturbed"),
        &["--disturb", "2", "--error-share", "1"],
    );
    let scenario = disturbed.scenario().expect("the scenario");
    let strengths = scenario.disturbances.map(|d| (d.noise, d.pushes, d.slips));
    assert_eq!(strengths, Some((2, 2, 2)));
    let ticks = |stream: &str| disturbed.u64s(stream, "tick").expect("ticks");
    assert_eq!(ticks("disturbance"), ticks("applied"));
    let offsets = disturbed
        .f64s("disturbance", "joint_offset")
        .expect("offsets");
    assert!(offsets.iter().any(|o| o.abs() > 1e-3));
    assert!(offsets.iter().all(|o| o.abs() < 0.05));
    let pushed = disturbed.texts("disturbance", "pushed").expect("names");
    assert!(pushed.iter().any(|name| !name.is_empty()));
    let incidents = disturbed.texts("command", "incident").expect("codes");
    let forced = incidents.iter().filter(|code| code.starts_with("forced_"));
    assert_eq!(forced.count(), 1);

    let again = folder.path().join("again");
    let file = disturbed.path().to_string_lossy();
    let replay = ["replay", &file, "--appearances", "1", "--out"];
    let replay = wheelarm(&[&replay[..], &[&again.to_string_lossy()]].concat());
    let text = printed(&replay);
    assert!(replay.status.success(), "{text}");
    assert!(text.contains("hashes equal"), "{text}");
    check_marks_of_replay(&disturbed, &again.join("pick_mustard-seed1-look1.h5"));

    let calm = record(&folder.path().join("calm"), &[]);
    assert!(
        calm.scenario()
            .expect("the scenario")
            .disturbances
            .is_none()
    );
    let none = calm.u64s("disturbance", "tick").expect("an empty stream");
    assert!(none.is_empty(), "{none:?}");
    let first = |of: &Episode| of.state_hashes().expect("hashes")[1];
    assert_ne!(first(&calm), first(&disturbed));
}
