//! A recording of the first contract and of a physics before there were versions
//! (tests/data, made by the programs of commit 8ef3e8a): everything that reads
//! recordings reads it, and its states can be drawn anew.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wheelarm_dataset::read::Episode;
use wheelarm_tests::{printed, program, root};

/// Unpacks the recording into a folder.
fn unpacked(folder: &Path) -> PathBuf {
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
fn a_recording_of_the_first_contract_is_read_validated_aligned_exported_and_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    unpacked(here);
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
    for format in [
        "wheelarm-sim",
        "csv",
        "lerobot",
        "robomimic",
        "tensors",
        "mcap",
    ] {
        let out = format!("exported-{format}");
        let export = ["dataset", "export", "old.h5", "--format", format, "--out"];
        let mut export = [&export[..], &[&out]].concat();
        if format == "lerobot" {
            // Its pictures are smaller than a video may be.
            export.extend(["--pictures", "png"]);
        }
        succeeds(here, &export);
        let written = here.join(&out);
        let something = match written.is_dir() {
            true => std::fs::read_dir(&written).expect("a folder").count() > 0,
            false => std::fs::metadata(&written).is_ok_and(|file| file.len() > 0),
        };
        assert!(something, "{format} wrote nothing");
    }
}

#[test]
fn a_recording_of_another_physics_is_drawn_from_its_recorded_states() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let old = unpacked(here);
    let refused = wheelarm(here, &["replay", "old.h5"]);
    let words = printed(&refused);
    assert!(!refused.status.success(), "{words}");
    assert!(words.contains("names no physics version"), "{words}");
    assert!(
        words.contains("wheelarm replay old.h5 --as-recorded --out"),
        "{words}"
    );

    let drawn = ["replay", "old.h5", "--as-recorded", "--out", "drawn"];
    let told = succeeds(here, &drawn);
    assert!(told.contains("drew 159 recorded states"), "{told}");
    let new = here.join("drawn/recorded-by-0-as-recorded.h5");
    let fine = succeeds(here, &["dataset", "validate", &new.to_string_lossy()]);
    assert!(fine.contains("1 of 1 recordings are fine"), "{fine}");
    let again = wheelarm(here, &["replay", &new.to_string_lossy()]);
    let words = printed(&again);
    assert!(
        words.contains("drawn from the states of another"),
        "{words}"
    );

    let [old, new] = [old, new].map(|file| Episode::open(&file).expect("an episode"));
    assert!(new.started().expect("a beginning").as_recorded);
    assert!(new.summary().expect("attributes").success);
    // The states are the recorded ones, to the last bit.
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
        assert!(equal, "{stream}/{column} is another");
    }
    // And so are the pictures, but for what the renderer may have learned since.
    for name in ["gen3", "wheelchair"] {
        let [was, is] = [&old, &new].map(|e| e.camera(name).expect("a camera"));
        assert_eq!(was.stamps(), is.stamps());
        for index in 0..is.len() {
            let was = was.rgb(&old, index).expect("a picture");
            let is = is.rgb(&new, index).expect("a picture");
            let apart: f64 = was
                .iter()
                .zip(&is)
                .map(|(a, b)| f64::from(a.abs_diff(*b)))
                .sum();
            let apart = apart / was.len() as f64;
            assert!(
                apart < 6.0,
                "{name} {index}: levels differ by {apart:.1} on average"
            );
        }
    }
}
