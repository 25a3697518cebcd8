//! Messages about paths that are not episodes, and leftovers of failed commands.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use hdf5::types::VarLenUnicode;
use parking_lot::{Mutex, MutexGuard};
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;

/// One test at a time: a child that starts while a file is written inherits its
/// lock.
fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock()
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The words of a run that must fail: one line, which names the path once.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {words}");
    assert_eq!(words.lines().count(), 1, "{arguments:?}: {words}");
    for jargon in ["H5F", "errno", "eof", "[110", "os error"] {
        assert!(!words.contains(jargon), "{arguments:?}: {words}");
    }
    words
}

/// An episode `LABEL.h5` in the folder.
fn episode(folder: &Path, label: &str) {
    let log = synthetic::smooth::record(folder, label, 2, (32, 18)).unwrap();
    finish(&log, None).unwrap();
}

#[test]
fn a_path_that_is_no_episode_is_named_with_its_cure() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let info = |name: &str| refused(folder, &["info", name]);
    assert_eq!(info("none.h5"), "none.h5: there is no such file");
    assert_eq!(
        info("."),
        ".: it is a folder without an episode file (*.h5)"
    );
    std::os::unix::fs::symlink("nowhere.h5", folder.join("link.h5")).unwrap();
    assert_eq!(
        info("link.h5"),
        "link.h5: it is a link to nowhere.h5, and there is no such file"
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
        "notes.h5 is no WheelArm episode: it is no HDF5 file"
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
fn a_recording_of_the_wrong_size_is_told_with_its_dataset_and_the_rest_goes_on() {
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
        let said = String::from_utf8_lossy(&checked.stdout).into_owned();
        assert_eq!(checked.status.code(), Some(3), "{said}");
        assert!(said.contains(&format!("PROBLEM {words}")), "{said}");
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
            let told = refused(folder, command);
            assert!(told.contains(words), "{command:?}: {told}");
            assert!(told.contains("no recorder writes such a file"), "{told}");
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
    let told = align("o", &format!("{header}\n2,a,0\n3,c,0\n"));
    let words = String::from_utf8_lossy(&told.stderr).into_owned();
    assert_eq!(told.status.code(), Some(1), "{words}");
    assert!(
        words.contains("labels.csv, line 3: there is no recording \"c\""),
        "{words}"
    );
    assert!(!folder.join("o").exists());
    let told = align("o", &format!("{header}\n2,a.h5,0\n3,b,0\n"));
    assert!(told.status.success(), "{told:?}");
    let file = hdf5::File::open(folder.join("o/a.aligned.h5")).unwrap();
    let labels: Vec<u8> = file.dataset("label").unwrap().read_raw().unwrap();
    assert!(labels.iter().all(|label| *label == 2), "{labels:?}");
}

#[test]
fn no_chunk_of_an_exported_mcap_is_empty() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "a");
    for (format, file) in [("mcap", "mcap/a.mcap"), ("rosbag2", "rosbag2/a/a_0.mcap")] {
        let told = run(
            folder,
            &["export", "--format", format, "--out", format, "a.h5"],
        );
        assert!(told.status.success(), "{told:?}");
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert!(!summary.chunk_indexes.is_empty());
        for chunk in &summary.chunk_indexes {
            assert!(!chunk.message_index_offsets.is_empty(), "{file}: {chunk:?}");
        }
    }
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
    for format in ["csv", "mcap", "tensors", "wheelarm-sim", "rosbag2"] {
        let words = refused(
            folder,
            &["export", "--format", format, "--out", "in/out", "whole.h5"],
        );
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
fn what_is_no_regular_file_is_refused_and_not_waited_for() {
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
fn a_file_that_is_no_log_is_not_recovered_and_told_why() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let recover = |name: &str| refused(folder, &["recover", name]);
    assert_eq!(recover("none.wal"), "none.wal: there is no such file");
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
        words.contains("it does not begin like one; a log is named LABEL.h5.wal"),
        "{words}"
    );
    std::fs::write(folder.join("newer.wal"), b"WHLLOG7\n and more of it").unwrap();
    assert!(recover("newer.wal").contains("it is a log of format '7', this program reads '1'"));
}

#[test]
fn without_one_good_file_there_is_no_table_and_no_leftover() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("notes.h5"), "not HDF5 at all").unwrap();
    for arguments in [
        &["label", "--out", "left.csv", "notes.h5"][..],
        &["label", "notes.h5"],
        &[
            "stats", "--csv", "left.csv", "--plot", "left.png", "notes.h5",
        ],
        &["stats", "notes.h5"],
        &["align", "--out", "left", "notes.h5"],
        &["plot", "--out", "left", "notes.h5"],
        &["view", "--out", "left", "notes.h5"],
        &["sheet", "--out", "left.png", "notes.h5"],
        &["export", "--format", "csv", "--out", "left", "notes.h5"],
        &["export", "--format", "mcap", "--out", "left", "notes.h5"],
    ] {
        refused(folder, arguments);
        let output = run(folder, arguments);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(printed.is_empty(), "{arguments:?} prints {printed}");
        let left: Vec<_> = std::fs::read_dir(folder).unwrap().flatten().collect();
        assert_eq!(left.len(), 1, "{arguments:?} leaves {left:?}");
    }
    // With a good file beside it the table is made of that one.
    episode(folder, "whole");
    let output = run(
        folder,
        &["label", "--out", "left.csv", "notes.h5", "whole.h5"],
    );
    assert_eq!(output.status.code(), Some(1));
    let table = std::fs::read_to_string(folder.join("left.csv")).unwrap();
    assert!(
        table.lines().count() > 1 && table.contains("whole"),
        "{table}"
    );
}

#[test]
fn several_processes_export_what_one_does_and_say_what_failed() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for number in 0..10 {
        episode(folder, &format!("a{number}"));
    }
    std::fs::write(folder.join("a4.h5"), "no episode").unwrap();
    let export = |jobs: &str, out: &str| {
        let told = run(
            folder,
            &[
                "export", "--format", "csv", ".", "--out", out, "--jobs", jobs,
            ],
        );
        assert_eq!(told.status.code(), Some(1));
        let problems = String::from_utf8_lossy(&told.stderr).into_owned();
        assert_eq!(problems.lines().count(), 1, "{problems}");
        assert!(problems.contains("a4.h5"), "{problems}");
        let said = String::from_utf8_lossy(&told.stdout).replace(out, "OUT");
        let mut said: Vec<String> = said.lines().map(str::to_owned).collect();
        said.sort();
        said
    };
    // Four at once are two processes, which have every second file each.
    assert_eq!(export("1", "one"), export("4", "four"));
    let files = |out: &str| {
        let mut files = Vec::new();
        for number in (0..10).filter(|number| *number != 4) {
            let file = folder.join(out).join(format!("a{number}/final_data.csv"));
            files.push(std::fs::read_to_string(&file).unwrap());
        }
        files
    };
    // Their rows name the number of the recording among all.
    assert!(files("one") == files("four"));
    assert!(files("four")[0] != files("four")[1]);

    for (part, cure) in [("3/2/1", "unset it"), ("0/2/1", "run it again")] {
        let odd = Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
            .args(["export", "--format", "csv", "a0.h5", "--out", "odd"])
            .env("WHEELARM_EXPORT_PART", part)
            .current_dir(folder)
            .output()
            .unwrap();
        let words = String::from_utf8_lossy(&odd.stderr).into_owned();
        assert_eq!(odd.status.code(), Some(1));
        assert!(words.contains(cure), "{words}");
    }
}

/// Places of the heaps that hold a file's texts and messages.
fn heaps(file: &[u8]) -> Vec<usize> {
    let begin = b"GCOL\x01\0\0\0";
    let places = file.windows(begin.len()).enumerate();
    let places = places.filter(|(_, bytes)| bytes == begin);
    places.map(|(place, _)| place).collect()
}

#[test]
fn a_file_that_crashes_or_holds_up_its_library_is_named_and_the_rest_goes_on() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for number in 0..10 {
        episode(folder, &format!("a{number}"));
    }
    // A heap object larger than memory, and one that takes no room, so that the
    // next is the same again.
    for (name, value) in [("a3.h5", (1_i64 << 32) + 16), ("a7.h5", -16)] {
        let path = folder.join(name);
        let mut bytes = std::fs::read(&path).unwrap();
        let heaps = heaps(&bytes);
        assert!(!heaps.is_empty());
        for heap in heaps {
            bytes[heap + 24..heap + 32].copy_from_slice(&value.to_le_bytes());
        }
        std::fs::write(path, bytes).unwrap();
    }
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_wheelarm-dataset"))
            .args(arguments)
            .env("WHEELARM_DATASET_PATIENCE", "5")
            .current_dir(folder)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {output:?}");
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        for name in ["a3.h5", "a7.h5"] {
            assert!(words.contains(name), "{arguments:?}: {words}");
        }
        assert!(!words.contains("a1.h5"), "{arguments:?}: {words}");
        words
    };
    for jobs in ["1", "4"] {
        let words = run(&[
            "export", "--format", "csv", "--out", jobs, "--jobs", jobs, ".",
        ]);
        assert!(words.contains("came to no end within 5 s"), "{words}");
        let mut there: Vec<_> = std::fs::read_dir(folder.join(jobs))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        there.sort();
        // Nothing hidden stays of the processes that broke.
        assert_eq!(there, ["a0", "a1", "a2", "a4", "a5", "a6", "a8", "a9"]);
    }
    run(&["stats", "."]);
}

#[test]
fn an_interrupted_export_goes_on_and_a_label_is_not_taken_twice() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for label in ["a", "b"] {
        episode(folder, label);
    }
    let export = ["export", "--format", "csv", "--out", "out", "."];
    assert!(run(folder, &export).status.success());
    let table = |name: &str| {
        std::fs::metadata(folder.join(name))
            .unwrap()
            .modified()
            .unwrap()
    };
    let first = table("out/a");
    std::fs::remove_dir_all(folder.join("out/b")).unwrap();
    let again = run(folder, &export);
    let words = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.success(), "{words}");
    assert!(words.contains("1 of 2 exist already"), "{words}");
    assert_eq!(table("out/a"), first);
    table("out/b");
    // A single file is not skipped: the existing output may be of other options.
    let alone = refused(
        folder,
        &["export", "--format", "csv", "--out", "out", "a.h5"],
    );
    assert!(alone.contains("never overwritten"), "{alone}");

    std::fs::create_dir(folder.join("more")).unwrap();
    std::fs::copy(folder.join("a.h5"), folder.join("more/a.h5")).unwrap();
    let twice = ["export", "--format", "csv", "--out", "new", "a.h5", "more"];
    // A second run fails in the same way.
    for _ in 0..2 {
        let output = run(folder, &twice);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(
            words.contains("another recording of the same label"),
            "{words}"
        );
    }
    for asked in [
        "export --format csv --out x --jobs 0 .",
        "align --max-age imo=0.1 a.h5 b.h5",
    ] {
        let asked: Vec<&str> = asked.split(' ').collect();
        let output = run(folder, &asked);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{words}");
        assert!(
            words.contains("1 or more") || words.contains("no stream \"imo\""),
            "{words}"
        );
    }
}

#[test]
fn what_is_partial_is_told_by_an_export_too() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // As a killed recorder leaves it: the log ends in the middle of a record.
    let log = synthetic::smooth::record(folder, "cut", 2, (32, 18)).unwrap();
    let all = std::fs::read(&log).unwrap();
    std::fs::write(&log, &all[..all.len() * 3 / 4]).unwrap();
    run(folder, &["recover", "cut.h5.wal"]);
    episode(folder, "whole");
    let export = ["export", "--format", "csv", "--out", "out", "."];
    let words = String::from_utf8_lossy(&run(folder, &export).stdout).into_owned();
    let notes_of = |file: &str| {
        let lines = words.lines().skip_while(|line| !line.starts_with(file));
        let notes = lines.skip(1).take_while(|line| line.starts_with(' '));
        notes.collect::<Vec<_>>().join("\n")
    };
    let told = notes_of("cut.h5 ->");
    assert!(told.contains("the recording is partial: "), "{words}");
    assert!(!notes_of("whole.h5 ->").contains("partial"), "{words}");
}

#[test]
fn ids_of_no_instance_and_columns_that_cannot_be_opened_are_found() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "whole");
    let said = |name: &str| {
        let output = run(folder, &["validate", name]);
        let both = [output.stdout, output.stderr].concat();
        String::from_utf8_lossy(&both).into_owned()
    };
    let words = said("whole.h5");
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
    let words = said("whole.h5");
    assert!(
        words.contains("camera/gen3: ids of no instance: {251}"),
        "{words}"
    );
    let path = "streams/joint_state/position";
    replace(folder, path, |file, _| {
        file.link_soft("/nowhere", path).unwrap();
    });
    let words = said("whole.h5");
    assert!(words.contains(path), "{words}");
}

#[test]
fn a_picture_does_not_take_the_place_of_a_recording() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "a");
    let before = std::fs::read(folder.join("a.h5")).unwrap();
    let words = "a.h5: a picture is written as PNG: name it *.png";
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

#[cfg(target_os = "linux")]
#[test]
fn a_process_of_an_export_ends_with_it() {
    use std::io::{BufRead, BufReader};
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    // A part that waits for its files, which never come; then who asks for it is killed.
    let script = "exec 3<&0
        WHEELARM_EXPORT_PART=0/1/$$ \"$0\" export --format csv . --out out <&3 &
        echo $!
        kill -9 $$";
    let mut asks = Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_wheelarm-dataset")])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let _held_open = asks.stdin.take();
    let mut part = String::new();
    let said = asks.stdout.take().unwrap();
    BufReader::new(said).read_line(&mut part).unwrap();
    asks.wait().unwrap();
    let stat = format!("/proc/{}/stat", part.trim());
    // An ended process may wait until its parent collects it.
    let is_there = || std::fs::read_to_string(&stat).is_ok_and(|told| !told.contains(") Z"));
    for _ in 0..3000 {
        if !is_there() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("it runs on: {stat}");
}
