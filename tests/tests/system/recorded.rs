//! A recording of the first contract, with physics before versions existed (tests/data, made by
//! the programs of commit 8ef3e8a). Every reader of recordings reads it, and its states can be
//! rendered again.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use wheelarm_dataset::convert::FormatName;
use wheelarm_dataset::read::Episode;
use wheelarm_tests::{printed, program, root};

/// Unpacks the recording into a folder; its path.
fn unpack(folder: &Path) -> PathBuf {
    let packed = root().join("tests/data/recorded-by-8ef3e8a.h5.gz");
    let packed = std::fs::read(packed).expect("the recording");
    let (_, size) = packed.split_at(packed.len() - 4);
    let size = u32::from_le_bytes(size.try_into().expect("four bytes")) as usize;
    let mut content = vec![0; size];
    let mut decompressor = libdeflater::Decompressor::new();
    let read = decompressor.gzip_decompress(&packed, &mut content);
    assert_eq!(read.expect("gzip"), size);
    let file = folder.join("old.h5");
    std::fs::write(&file, content).expect("a file");
    file
}

fn wheelarm(folder: &Path, args: &[&str]) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .current_dir(folder)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process")
}

fn succeeds(folder: &Path, args: &[&str]) -> String {
    let output = wheelarm(folder, args);
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

#[test]
fn every_dataset_command_reads_a_recording_of_the_first_contract() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    unpack(here);
    let info = succeeds(here, &["dataset", "info", "old.h5"]);
    assert!(info.contains("success       yes"), "{info}");
    let fine = succeeds(here, &["dataset", "validate", "old.h5"]);
    assert!(fine.contains("1 of 1 recordings are fine"), "{fine}");
    for command in [
        &["dataset", "align", "old.h5", "--out", "aligned"][..],
        &["dataset", "label", "old.h5", "--out", "labelled"],
        &["dataset", "sheet", "old.h5", "--out", "sheet.png"],
        &["dataset", "plot", "old.h5", "--out", "plots"],
        &["dataset", "stats", "old.h5"],
    ] {
        succeeds(here, command);
    }
    for format in FormatName::names() {
        let out = format!("exported-{format}");
        let export = ["dataset", "export", "old.h5", "--format", &format, "--out"];
        let mut export = [&export[..], &[&out]].concat();
        if format == "lerobot" {
            // The images are smaller than a video may be.
            export.extend(["--pictures", "png"]);
        }
        succeeds(here, &export);
        let written = here.join(&out);
        let has_content = match written.is_dir() {
            true => std::fs::read_dir(&written).expect("a folder").count() > 0,
            false => std::fs::metadata(&written).is_ok_and(|file| file.len() > 0),
        };
        assert!(has_content, "{format} wrote nothing");
    }
}

/// Rows of a 32-bit float tensor in a safetensors file, and the JSON metadata of the file.
fn tensor(file: &Path, name: &str) -> (Vec<Vec<f32>>, Value) {
    let bytes = std::fs::read(file).expect("a file");
    let (size, rest) = bytes.split_at(8);
    let size = u64::from_le_bytes(size.try_into().expect("eight bytes")) as usize;
    let (header, data) = rest.split_at(size);
    let header: Value = serde_json::from_slice(header).expect("a header");
    let about = header["__metadata__"]["wheelarm"].as_str().expect("a card");
    let number = |value: &Value| value.as_u64().expect("a number") as usize;
    let entry = &header[name];
    assert_eq!(entry["dtype"], "F32", "{name}");
    let [from, to] = [0, 1].map(|end| number(&entry["data_offsets"][end]));
    let numbers = data[from..to].chunks_exact(4);
    let numbers: Vec<f32> = numbers
        .map(|n| f32::from_le_bytes(n.try_into().expect("four bytes")))
        .collect();
    let rows = numbers.chunks_exact(number(&entry["shape"][1]));
    let about = serde_json::from_str(about).expect("JSON");
    (rows.map(<[f32]>::to_vec).collect(), about)
}

#[test]
fn tensors_contain_the_pose_of_the_task_object() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    unpack(here);
    let export = [
        "dataset", "export", "old.h5", "--format", "tensors", "--out", ".",
    ];
    succeeds(here, &export);
    let written = std::fs::read_dir(here).expect("a folder");
    let files = written.map(|entry| entry.expect("an entry").path());
    let file = files
        .into_iter()
        .find(|file| file.extension().is_some_and(|e| e == "safetensors"))
        .expect("an episode");
    let (aims, about) = tensor(&file, "aims");
    let (states, _) = tensor(&file, "states");
    assert_eq!(aims.len(), states.len());
    let place = |names: &Value, name: &str| {
        let names = names.as_array().expect("names");
        let found = names.iter().position(|n| n == name);
        found.unwrap_or_else(|| panic!("no {name} in {names:?}"))
    };
    let aim = |name: &str| place(&about["aim_names"], name);
    let state = |name: &str| place(&about["state_names"], name);
    let (first, last) = (aims.first().expect("rows"), aims.last().expect("rows"));
    let hand = states.last().expect("rows");
    let distance = |row: &[f32], hand: &[f32]| {
        let off = ["x", "y", "z"]
            .map(|axis| row[aim(&format!("thing.{axis}"))] - hand[state(&format!("hand.{axis}"))]);
        off.iter().map(|d| d * d).sum::<f32>().sqrt()
    };
    // At the end the gripper holds the object, which is visible from the chair.
    assert_eq!(about["task"], "pick_mustard");
    let (before, held) = (distance(first, &states[0]), distance(last, hand));
    // The hand frame is that of the arm's end; the fingers are in front of it.
    assert!(before > 1.0 && held < 0.16, "{before} m, then {held} m");
    for coordinate in ["u", "v"] {
        let value = last[aim(&format!("thing.wheelchair.{coordinate}"))];
        assert!((0.0..1.0).contains(&value), "{coordinate} {value}");
    }
    // The poses of all objects are stored too, in the order of the names.
    let (objects, _) = tensor(&file, "things");
    let names = about["thing_names"].as_array().expect("names");
    assert_eq!(objects[0].len(), 7 * names.len());
    let own = 7 * place(
        &about["thing_names"],
        about["thing"].as_str().expect("an object"),
    );
    let other = 7 * place(&about["thing_names"], "crackers");
    for (row, all) in aims.iter().zip(&objects) {
        let same = row[..7].iter().zip(&all[own..]);
        assert!(same.clone().all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(all[other..][..3].iter().all(|place| place.is_finite()));
    }
    let apart = [0, 1, 2].map(|k| (objects[0][own + k] - objects[0][other + k]).powi(2));
    assert!(apart.iter().sum::<f32>().sqrt() > 0.05, "{apart:?}");
    // The task has no goal place.
    for row in &aims {
        assert!(row[aim("thing.x")].is_finite());
        assert!(row[aim("goal.x")].is_nan() && row[aim("goal.gen3.u")].is_nan());
    }
}

#[test]
fn recording_of_another_physics_is_rendered_from_its_recorded_states() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let old = unpack(here);
    let refused = wheelarm(here, &["replay", "old.h5"]);
    let words = printed(&refused);
    assert!(!refused.status.success(), "{words}");
    assert!(words.contains("names no physics version"), "{words}");
    assert!(
        words.contains("wheelarm replay old.h5 --as-recorded --out"),
        "{words}"
    );

    let replay = ["replay", "old.h5", "--as-recorded", "--out", "rendered"];
    let text = succeeds(here, &replay);
    assert!(text.contains("rendered 159 recorded states"), "{text}");
    let new = here.join("rendered/recorded-by-0-as-recorded.h5");
    let fine = succeeds(here, &["dataset", "validate", &new.to_string_lossy()]);
    assert!(fine.contains("1 of 1 recordings are fine"), "{fine}");
    let again = wheelarm(here, &["replay", &new.to_string_lossy()]);
    let words = printed(&again);
    assert!(
        words.contains("rendered from the states of another"),
        "{words}"
    );

    let [old, new] = [old, new].map(|file| Episode::open(&file).expect("an episode"));
    assert!(new.started().expect("a beginning").as_recorded);
    assert!(new.summary().expect("attributes").success);
    // The states equal the recorded ones bit by bit.
    for (stream, column) in [
        ("joint_state", "position"),
        ("joint_state", "velocity"),
        ("pose", "pose"),
        ("object_pose", "pose"),
        ("furniture_joint", "position"),
        ("contact", "pad_force"),
        ("odometry", "twist"),
        ("imu", "linear_acceleration"),
        ("applied", "desired_pose"),
        ("evaluation", "condition_value"),
    ] {
        let [was, is] = [&old, &new].map(|e| e.f64s(stream, column).expect("a column"));
        let rows = is.shape()[0];
        assert!(rows > 100, "{stream}/{column} has {rows} samples");
        assert_eq!(was.shape()[0], rows, "{stream}/{column}");
        let equal = was
            .iter()
            .zip(is.iter())
            .all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(equal, "{stream}/{column} differs");
    }
    // The images differ only by changes of renderer and assets: smoothed ambient light changes a
    // wall that fills the image by 7 levels, other meshes and prints on the table one at the
    // grasp by 4 more.
    for name in ["gen3", "wheelchair"] {
        let [was, is] = [&old, &new].map(|e| e.camera(name).expect("a camera"));
        assert_eq!(was.stamps(), is.stamps());
        for index in 0..is.len() {
            let was = was.rgb(&old, index).expect("an image");
            let is = is.rgb(&new, index).expect("an image");
            let apart: f64 = was
                .iter()
                .zip(&is)
                .map(|(a, b)| f64::from(a.abs_diff(*b)))
                .sum();
            let apart = apart / was.len() as f64;
            assert!(
                apart < 14.0,
                "{name} {index}: levels differ by {apart:.1} on average"
            );
        }
    }
}
