//! Exports by several processes: results, interruptions, failures and leftovers.

mod program;
#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::process::Command;

use program::{alone, episode, refused, run};

#[test]
fn no_chunk_of_an_exported_mcap_is_empty() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    episode(folder, "a");
    for (format, file) in [("mcap", "mcap/a.mcap"), ("rosbag2", "rosbag2/a/a_0.mcap")] {
        let output = run(
            folder,
            &["export", "--format", format, "--out", format, "a.h5"],
        );
        assert!(output.status.success(), "{output:?}");
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert!(!summary.chunk_indexes.is_empty());
        for chunk in &summary.chunk_indexes {
            assert!(!chunk.message_index_offsets.is_empty(), "{file}: {chunk:?}");
        }
    }
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
fn several_processes_export_the_same_as_one_and_report_failures() {
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for number in 0..10 {
        episode(folder, &format!("a{number}"));
    }
    std::fs::write(folder.join("a4.h5"), "no episode").unwrap();
    let export = |jobs: &str, out: &str| {
        let output = run(
            folder,
            &[
                "export", "--format", "csv", ".", "--out", out, "--jobs", jobs,
            ],
        );
        assert_eq!(output.status.code(), Some(1));
        let problems = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(problems.lines().count(), 1, "{problems}");
        assert!(problems.contains("a4.h5"), "{problems}");
        let lines = String::from_utf8_lossy(&output.stdout).replace(out, "OUT");
        let mut lines: Vec<String> = lines.lines().map(str::to_owned).collect();
        lines.sort();
        lines
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

/// Offsets of the heaps with a file's texts and messages.
fn heaps(file: &[u8]) -> Vec<usize> {
    let begin = b"GCOL\x01\0\0\0";
    let places = file.windows(begin.len()).enumerate();
    let places = places.filter(|(_, bytes)| bytes == begin);
    places.map(|(place, _)| place).collect()
}

#[test]
fn a_file_that_crashes_or_blocks_its_library_is_named_and_the_others_are_exported() {
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
        assert!(words.contains("did not end within 5 s"), "{words}");
        let mut there: Vec<_> = std::fs::read_dir(folder.join(jobs))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        there.sort();
        // No hidden file of the crashed processes is left.
        assert_eq!(there, ["a0", "a1", "a2", "a4", "a5", "a6", "a8", "a9"]);
    }
    run(&["stats", "."]);
}

#[test]
fn an_interrupted_export_resumes_and_a_label_is_not_exported_twice() {
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
    for command in [
        "export --format csv --out x --jobs 0 .",
        "align --max-age imo=0.1 a.h5 b.h5",
    ] {
        let arguments: Vec<&str> = command.split(' ').collect();
        let output = run(folder, &arguments);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{words}");
        assert!(
            words.contains("1 or more") || words.contains("no stream \"imo\""),
            "{words}"
        );
    }
}

#[test]
fn an_export_reports_partial_recordings() {
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
    let notes = notes_of("cut.h5 ->");
    assert!(notes.contains("the recording is partial: "), "{words}");
    assert!(!notes_of("whole.h5 ->").contains("partial"), "{words}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_process_of_an_export_ends_with_it() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;
    use std::time::Duration;
    let _turn = alone();
    let folder = tempfile::tempdir().unwrap();
    // A worker waits for files that never arrive; then its parent is killed.
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
    let stdout = asks.stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut part).unwrap();
    asks.wait().unwrap();
    let stat = format!("/proc/{}/stat", part.trim());
    // An ended process may wait until its parent collects it.
    let is_there = || std::fs::read_to_string(&stat).is_ok_and(|status| !status.contains(") Z"));
    for _ in 0..3000 {
        if !is_there() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("it runs on: {stat}");
}
