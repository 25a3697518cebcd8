//! Error messages about paths and recordings that commands reject.

mod program;
#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::path::Path;

use hdf5::types::VarLenUnicode;
use program::{alone, episode, refused, run};
use wheelarm_dataset::convert::FormatName;
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;

#[test]
fn a_path_that_is_not_an_episode_is_named_with_the_fix() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let info = |name: &str| refused(folder, &["info", name]);
    assert_eq!(info("none.h5"), "none.h5: the file does not exist");
    assert_eq!(
        info("."),
        ".: it is a folder without an episode file (*.h5)"
    );
    std::os::unix::fs::symlink("nowhere.h5", folder.join("link.h5")).unwrap();
    assert_eq!(
        info("link.h5"),
        "link.h5: it is a link to nowhere.h5, which does not exist"
    );
    std::fs::remove_file(folder.join("link.h5")).unwrap();

    let log = synthetic::smooth::record(folder, "late", 2, (32, 18)).unwrap();
    assert!(info("late.h5").contains("`wheelarm dataset recover late.h5.wal`"));
    assert!(info("late.h5.wal").contains("`wheelarm dataset recover late.h5.wal`"));

    std::fs::write(folder.join("whole.h5"), finished(&log)).unwrap();
    let all = std::fs::read(folder.join("whole.h5")).unwrap();
    std::fs::write(folder.join("cut.h5"), &all[..all.len() / 2]).unwrap();
    let cut = info("cut.h5");
    let half = format!("{} of {} bytes are there", all.len() / 2, all.len());
    assert!(
        cut.contains(&half) && cut.ends_with("copy it again from where it was recorded"),
        "{cut}"
    );
    std::fs::copy(&log, folder.join("cut.h5.wal")).unwrap();
    let cut = info("cut.h5");
    assert!(
        cut.contains("move this file away, then `wheelarm dataset recover cut.h5.wal`"),
        "{cut}"
    );
    assert!(info(".").contains("name one of its 2 files, for example ./cut.h5"));

    std::fs::write(folder.join("empty.h5"), []).unwrap();
    assert!(info("empty.h5").starts_with("empty.h5: the file is empty; copy it again"));
    std::fs::write(folder.join("notes.h5"), "not HDF5 at all").unwrap();
    assert_eq!(
        info("notes.h5"),
        "notes.h5 is not a WheelArm episode: it is not an HDF5 file"
    );
    drop(hdf5::File::create(folder.join("foreign.h5")).unwrap());
    assert!(
        info("foreign.h5")
            .ends_with("it is an HDF5 file of another program, without the attribute `format`")
    );
}

/// A copy of `whole.h5` whose dataset at `path` is cut to `rows` and `width`.
fn resized(folder: &Path, name: &str, path: &str, (rows, width): (usize, usize)) {
    std::fs::copy(folder.join("whole.h5"), folder.join(name)).unwrap();
    let file = hdf5::File::open_rw(folder.join(name)).unwrap();
    file.unlink(path).unwrap();
    let data = file.new_dataset::<f64>().shape([rows, width]);
    let data = data.create(path).unwrap();
    data.write_raw(&vec![0.0; rows * width]).unwrap();
}

#[test]
fn a_dataset_of_the_wrong_size_is_named_and_the_others_are_checked() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let path = "streams/joint_state/position";
    let file = hdf5::File::open(folder.join("whole.h5")).unwrap();
    let shape = file.dataset(path).unwrap().shape();
    drop(file);
    let [rows, width] = shape[..] else {
        panic!("{shape:?}")
    };
    for (name, size, words) in [
        (
            "short.h5",
            (rows - 3, width),
            format!("{path} has {} rows, expected {rows}", rows - 3),
        ),
        (
            "narrow.h5",
            (rows, width - 1),
            format!(
                "{path} has rows of [{}] numbers, expected [{width}]",
                width - 1
            ),
        ),
    ] {
        resized(folder, name, path, size);
        let output = run(folder, &["stats", "whole.h5", name]);
        let (out, err) = (
            String::from_utf8_lossy(&output.stdout).into_owned(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        );
        assert_eq!(output.status.code(), Some(1), "{err}");
        assert!(out.contains("trajectories"), "{out}");
        assert!(
            err.contains(&format!("{name}: {words}")) && err.contains("copy it again"),
            "{err}"
        );
        let checked = run(folder, &["validate", name]);
        let lines = String::from_utf8_lossy(&checked.stdout).into_owned();
        assert_eq!(checked.status.code(), Some(3), "{lines}");
        assert!(lines.contains(&format!("PROBLEM {words}")), "{lines}");
    }
}

/// A change of a recording's file.
type Change<'a> = &'a dyn Fn(&hdf5::File);

#[test]
fn a_hostile_recording_is_rejected_before_anything_in_it_is_read() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    std::fs::write(folder.join("secret"), vec![b'x'; 1 << 20]).unwrap();
    let (image, robot) = ("streams/camera/gen3/rgb", "robot/message");
    let moved = |file: &hdf5::File, path: &str| {
        let shape = file.dataset(path).unwrap().shape();
        file.unlink(path).unwrap();
        let outside = folder.join("secret");
        let data = file.new_dataset::<u8>().shape(shape);
        let data = data.with_dcpl(|p| p.external(outside.to_str().unwrap(), 0, 0));
        data.create(path).unwrap();
    };
    let claims = |file: &hdf5::File, path: &str, bytes: usize| {
        file.unlink(path).unwrap();
        let data = file.new_dataset::<u8>().chunk(1 << 20).deflate(9);
        data.shape(bytes).create(path).unwrap();
    };
    let cases: [(&str, Change<'_>, &str); 9] = [
        (
            "image",
            &|file| moved(file, image),
            "rgb is stored in another file",
        ),
        (
            "text",
            &|file| moved(file, robot),
            "robot/message is stored in another file",
        ),
        (
            "external",
            &|file| {
                file.unlink(robot).unwrap();
                file.link_external("whole.h5", "/robot/message", robot)
                    .unwrap();
            },
            "robot/message is a link to another file",
        ),
        (
            "soft",
            &|file| file.link_soft("/robot", "streams/robot").unwrap(),
            "streams/robot is a soft link",
        ),
        (
            "cycle",
            &|file| file.link_hard("/streams", "streams/camera/again").unwrap(),
            "nested more than 16 groups deep",
        ),
        (
            "snapshot",
            &|file| claims(file, "initial_state/snapshot", 8 << 30),
            "initial_state/snapshot claims 8589934592 bytes, at most 268435456",
        ),
        (
            "robot",
            &|file| claims(file, robot, 17 << 20),
            "robot/message claims 17825792 bytes, at most 16777216",
        ),
        (
            "frame",
            &|file| {
                file.unlink(image).unwrap();
                let data = file.new_dataset::<u8>().shape([10, 1 << 17, 1 << 17, 3]);
                data.create(image).unwrap();
            },
            "rgb claims 51539607552 bytes",
        ),
        (
            "column",
            &|file| {
                file.unlink("streams/imu/stamp_nanos").unwrap();
                let data = file.new_dataset::<u64>().chunk(1 << 20).shape(1 << 30);
                data.create("streams/imu/stamp_nanos").unwrap();
            },
            "stamp_nanos and the columns before it claim",
        ),
    ];
    for (name, change, words) in cases {
        let name = format!("{name}.h5");
        std::fs::copy(folder.join("whole.h5"), folder.join(&name)).unwrap();
        let file = hdf5::File::open_rw(folder.join(&name)).unwrap();
        change(&file);
        file.close().unwrap();
        // All commands open recordings alike.
        let commands = [
            &["info", &name][..],
            &["validate", &name],
            &["export", "--format", "csv", "--out", "out", &name],
        ];
        let commands = match name.as_str() {
            "image.h5" => &commands[..],
            _ => &commands[..1],
        };
        for command in commands {
            let error = refused(folder, command);
            assert!(error.contains(words), "{command:?}: {error}");
            assert!(error.contains("no recorder writes such a file"), "{error}");
        }
    }
}

#[test]
fn rows_that_share_one_stored_list_claim_no_more_memory_than_the_file_has() {
    use std::os::unix::fs::FileExt;
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let path = folder.join("whole.h5");
    let file = hdf5::File::open_rw(&path).unwrap();
    let column = "streams/phase/phase";
    let rows = file.dataset(column).unwrap().shape()[0];
    file.unlink(column).unwrap();
    let data = file.new_dataset::<VarLenUnicode>().shape(rows);
    let data = data.create(column).unwrap();
    let mut words = vec!["short".parse::<VarLenUnicode>().unwrap(); rows];
    words[0] = "x".repeat(100_000).parse().unwrap();
    data.write(&words).unwrap();
    let at = data.offset().unwrap();
    drop(data);
    file.close().unwrap();
    let bytes = std::fs::File::options()
        .read(true)
        .write(true)
        .open(&path)
        .unwrap();
    // Length, address of the heap and number of the list in it.
    let mut first = [0; 16];
    bytes.read_exact_at(&mut first, at).unwrap();
    for row in 1..rows as u64 {
        bytes.write_all_at(&first, at + 16 * row).unwrap();
    }
    let episode = Episode::open(&path).unwrap();
    let found = episode.texts("phase", "phase").unwrap_err().to_string();
    assert!(found.contains("its lists need more than "), "{found}");
}

#[test]
fn corrections_of_an_unknown_episode_are_an_error_and_those_of_a_file_beside_are_not() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for label in ["a", "b"] {
        episode(folder, label);
    }
    let align = |out: &str, table: &str| {
        std::fs::write(folder.join("labels.csv"), table).unwrap();
        let options = ["--no-pictures", "--corrections", "labels.csv", "--out", out];
        run(folder, &[&["align", "a.h5"][..], &options].concat())
    };
    let header = "label,episode,from_seconds";
    let output = align("o", &format!("{header}\n2,a,0\n3,c,0\n"));
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{words}");
    assert!(
        words.contains("labels.csv, line 3: no recording named \"c\""),
        "{words}"
    );
    assert!(!folder.join("o").exists());
    let output = align("o", &format!("{header}\n2,a.h5,0\n3,b,0\n"));
    assert!(output.status.success(), "{output:?}");
    let file = hdf5::File::open(folder.join("o/a.aligned.h5")).unwrap();
    let labels: Vec<u8> = file.dataset("label").unwrap().read_raw().unwrap();
    assert!(labels.iter().all(|label| *label == 2), "{labels:?}");
}

#[test]
fn a_label_that_leads_out_of_the_folder_is_refused() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let file = hdf5::File::open_rw(folder.join("whole.h5")).unwrap();
    let label: VarLenUnicode = "../escaped".parse().unwrap();
    file.attr("label").unwrap().write_scalar(&label).unwrap();
    drop(file);
    for format in FormatName::names() {
        // A format that joins episodes adds a line: no data set was written.
        let arguments = ["export", "--format", &format, "--out", "in/out", "whole.h5"];
        let output = run(folder, &arguments);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{format}: {words}");
        assert!(words.contains("the attribute `label`"), "{words}");
        let left = std::fs::read_dir(folder).unwrap().flatten();
        let left: Vec<_> = left.map(|entry| entry.file_name()).collect();
        assert!(
            left.iter().all(|name| name == "whole.h5" || name == "in"),
            "{left:?}"
        );
        assert!(!folder.join("in/escaped").exists());
    }
}

#[test]
fn a_special_file_is_rejected_without_waiting() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::os::unix::net::UnixListener::bind(folder.join("pipe.h5")).unwrap();
    for command in ["info", "recover"] {
        let words = refused(folder, &[command, "pipe.h5"]);
        assert!(words.contains("name a regular file"), "{words}");
    }
}

/// Bytes of the file that a log becomes; the log stays.
fn finished(log: &Path) -> Vec<u8> {
    let other = tempfile::tempdir().unwrap();
    let copy = other.path().join("copy.wal");
    std::fs::copy(log, &copy).unwrap();
    std::fs::read(finish(&copy, None).unwrap().path).unwrap()
}

#[test]
fn a_file_that_is_not_a_log_is_not_recovered_with_a_reason() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let recover = |name: &str| refused(folder, &["recover", name]);
    assert_eq!(recover("none.wal"), "none.wal: the file does not exist");
    assert_eq!(
        recover("."),
        ".: it is a folder; name a log in it, LABEL.h5.wal"
    );
    assert!(
        recover("whole.h5")
            .contains("it is an HDF5 file, `wheelarm dataset info whole.h5` shows what it holds")
    );
    std::fs::write(folder.join("notes.wal"), "shopping: mustard, crackers").unwrap();
    let words = recover("notes.wal");
    assert!(
        words.contains("it does not begin like a log; a log is named LABEL.h5.wal"),
        "{words}"
    );
    std::fs::write(folder.join("newer.wal"), b"WHLLOG7\n and more of it").unwrap();
    assert!(recover("newer.wal").contains("it is a log of format '7', this program reads '1'"));
}

#[test]
fn ids_of_no_instance_and_columns_that_cannot_be_opened_are_found() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let problems = |name: &str| {
        let output = run(folder, &["validate", name]);
        let both = [output.stdout, output.stderr].concat();
        String::from_utf8_lossy(&both).into_owned()
    };
    let words = problems("whole.h5");
    assert!(!words.contains("{251}"), "{words}");

    /// Puts something else in the place of a column.
    fn replace(folder: &Path, path: &str, with: impl FnOnce(&hdf5::File, &[usize])) {
        let file = hdf5::File::open_rw(folder.join("whole.h5")).unwrap();
        let shape = file.dataset(path).unwrap().shape();
        file.unlink(path).unwrap();
        with(&file, &shape);
        let words = refused(folder, &["info", "whole.h5"]);
        assert!(
            words.ends_with("another program has it open for writing: close it there"),
            "{words}"
        );
        file.close().unwrap();
    }
    let path = "streams/camera/gen3/ids";
    replace(folder, path, |file, shape| {
        let mut ids = vec![0_u8; shape.iter().product()];
        ids[7] = 251;
        let data = file.new_dataset::<u8>().shape(shape).create(path).unwrap();
        data.write_raw(&ids).unwrap();
    });
    let words = problems("whole.h5");
    assert!(
        words.contains("camera/gen3: ids of no instance: {251}"),
        "{words}"
    );
    let path = "streams/joint_state/position";
    replace(folder, path, |file, _| {
        file.link_soft("/nowhere", path).unwrap();
    });
    let words = problems("whole.h5");
    assert!(words.contains(path), "{words}");
}

#[test]
fn an_image_does_not_replace_a_recording() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "a");
    let before = std::fs::read(folder.join("a.h5")).unwrap();
    let words = "a.h5: an image is written as PNG: name it *.png";
    assert_eq!(refused(folder, &["sheet", "--out", "a.h5", "a.h5"]), words);
    assert_eq!(refused(folder, &["stats", "--plot", "a.h5", "a.h5"]), words);
    assert!(std::fs::read(folder.join("a.h5")).unwrap() == before);
    assert!(run(folder, &["sheet", "a.h5"]).status.success());
    let mut left: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .filter(|name| name.to_string_lossy().contains("png"))
        .collect();
    left.sort();
    assert_eq!(left, ["a.png"]);
}
