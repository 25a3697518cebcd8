//! A cabinet whose door turns: opened and closed by the expert, recorded, replayed, labelled.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wheelarm_dataset::read::Episode;
use wheelarm_proto::program::skipped;
use wheelarm_tests::{printed, program, root};

/// Folders of the assets to which `tests/data/kitchenette` adds files.
const ADDED: [&str; 3] = ["scenes", "areas", "tasks"];

/// The assets with the files of `tests/data/kitchenette`.
fn assets(folder: &Path) -> PathBuf {
    let assets = folder.join("assets");
    let link = |from: &Path, to: PathBuf| {
        std::os::unix::fs::symlink(from, to).expect("a link");
    };
    let entries = |folder: PathBuf| fs::read_dir(folder).expect("a folder").flatten();
    fs::create_dir(&assets).expect("a folder");
    for entry in entries(root().join("assets")) {
        if !ADDED.iter().any(|added| entry.file_name() == *added) {
            link(&entry.path(), assets.join(entry.file_name()));
        }
    }
    for added in ADDED {
        let folder = assets.join(added);
        fs::create_dir(&folder).expect("a folder");
        let own = root().join("tests/data/kitchenette").join(added);
        for entry in entries(root().join("assets").join(added)).chain(entries(own)) {
            link(&entry.path(), folder.join(entry.file_name()));
        }
    }
    assets
}

fn wheelarm(assets: &Path, args: &[&str]) -> Output {
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .env("WHEELARM_ASSETS", assets)
        .output()
        .expect("a process");
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    output
}

/// Positions of the door of a successful episode, radians.
fn demonstrated(assets: &Path, task: &str, out: &Path) -> (PathBuf, Vec<f64>) {
    let out_text = out.to_string_lossy().into_owned();
    let demo = ["demo", "--scene", "kitchenette", "--task", task];
    let small = ["--width", "64", "--height", "48", "--no-sheet"];
    let scans = ["--scan-rate-hz", "10", "--sensor", "scanner"];
    let seed = ["--seed", "3", "--out", &out_text];
    wheelarm(
        assets,
        &[&demo[..], &small[..], &scans[..], &seed[..]].concat(),
    );
    let mut entries = fs::read_dir(out).expect("the folder").flatten();
    let file = entries
        .find(|entry| entry.path().extension().is_some_and(|e| e == "h5"))
        .expect("a recording")
        .path();
    let episode = Episode::open(&file).expect("an episode");
    assert!(episode.summary().expect("a summary").success, "{task}");
    let positions = episode.f64s("furniture_joint", "position");
    (file, positions.expect("positions").into_iter().collect())
}

/// Compares an export with its recording by independent libraries.
fn read_by_others(modules: &str, script: &str, args: &[&str]) {
    let python = std::env::var("WHEELARM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let import = format!("import h5py, numpy, {modules}");
    let imported = Command::new(&python).args(["-c", &import]).output();
    if !imported.is_ok_and(|output| output.status.success()) {
        return skipped(&format!(
            "{python} cannot import {modules}; `make test` installs them"
        ));
    }
    let reader = Command::new(python)
        .arg(root().join("tests/python").join(script))
        .args(args)
        .output()
        .expect("a process");
    assert!(reader.status.success(), "{}", printed(&reader));
}

#[test]
fn the_expert_opens_and_closes_a_door_that_turns() {
    let folder = tempfile::tempdir().expect("a folder");
    let assets = assets(folder.path());
    let (file, opened) = demonstrated(&assets, "open_cabinet", &folder.path().join("open"));
    let ends = |positions: &[f64]| [positions[0], positions[positions.len() - 1]];
    let [before, after] = ends(&opened);
    assert!(before.abs() < 1e-6, "{before} rad");
    assert!(after > std::f64::consts::FRAC_PI_4, "{after} rad");
    let units = hdf5::File::open(&file)
        .and_then(|file| file.dataset("streams/furniture_joint/velocity"))
        .and_then(|data| data.attr("units_by_name"))
        .and_then(|attribute| attribute.read_1d::<hdf5::types::VarLenUnicode>())
        .expect("units");
    assert_eq!(units[0].as_str(), "rad/s");
    let path = file.to_string_lossy();
    let replay = printed(&wheelarm(&assets, &["replay", &path]));
    assert!(replay.contains("hashes equal"), "{replay}");
    wheelarm(&assets, &["dataset", "validate", &path]);
    // Exports have the joint and the frames of the door, and the laser scans.
    let export = |format: &str, more: &[&str]| {
        let out = folder.path().join(format).to_string_lossy().into_owned();
        let export = [
            "dataset", "export", "--format", format, &path, "--out", &out,
        ];
        wheelarm(&assets, &[&export[..], more].concat());
        out
    };
    let bags = export("rosbag2", &[]);
    let checked = ["rosbags", &bags, &path];
    read_by_others("rosbags.rosbag2", "check_rosbag2.py", &checked);
    let log = export("mcap", &[]);
    let modules = "mcap, google.protobuf, foxglove_schemas_protobuf";
    read_by_others(modules, "check_exports.py", &["mcap", &log, &path]);
    let set = export("lerobot", &["--images", "png"]);
    let checked = ["lerobot", &set, &path];
    read_by_others("pyarrow", "check_exports.py", &checked);

    let (_, closed) = demonstrated(&assets, "close_cabinet", &folder.path().join("close"));
    let [before, after] = ends(&closed);
    assert!((50.0..60.0).contains(&before.to_degrees()), "{before} rad");
    assert!(after.to_degrees() < 3.0, "{after} rad");
}
