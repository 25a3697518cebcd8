//! Runs the commands of the guides, and reads their output with third-party libraries.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use wheelarm_dataset::convert::FormatName;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::program::skipped;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_tests::{PATIENCE, Recorder, Server, printed, program, root, wait_until};

const CHAPTERS: [&str; 6] = [
    "train-and-evaluate/process.md",
    "start/view-episodes.md",
    "train-and-evaluate/lerobot.md",
    "train-and-evaluate/robomimic.md",
    "drive-and-record/language.md",
    "integrate-and-operate/rosbag2.md",
];

/// Blocks of one language in a chapter.
fn blocks(chapter: &str, language: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("docs").join(chapter)).expect("a chapter");
    text.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|b| b.strip_prefix(language)?.strip_prefix('\n'))
        .map(str::to_owned)
        .collect()
}

/// Runs a shell line in `folder` with our programs first on PATH.
fn shell(folder: &Path, line: &str) -> Output {
    let programs = program("wheelarm").expect("the client");
    let mut path = std::ffi::OsString::from(programs.parent().expect("a folder"));
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    Command::new("sh")
        .args(["-e", "-c", line])
        .current_dir(folder)
        .env("PATH", path)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a shell")
}

/// The interpreter, if it has the modules.
fn python(modules: &str) -> Option<String> {
    let python = std::env::var("WHEELARM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let imported = Command::new(&python)
        .args(["-c", &format!("import {modules}")])
        .output();
    if imported.is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    skipped(&format!(
        "{python} cannot import {modules}; `make test` installs them"
    ));
    None
}

fn recordings(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the recordings")
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "h5"))
        .collect();
    found.sort();
    found
}

fn check(folder: &Path, format: &str, what: &str, recordings: &[PathBuf], modules: &str) {
    let Some(python) = python(modules) else {
        return;
    };
    let output = Command::new(python)
        .arg(root().join("tests/python/check_exports.py"))
        .args([format, what])
        .args(recordings)
        .current_dir(folder)
        .output()
        .expect("a process");
    assert!(output.status.success(), "{format}: {}", printed(&output));
}

#[test]
fn commands_of_the_guides_run_and_other_libraries_read_their_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for chapter in CHAPTERS {
        for block in blocks(chapter, "sh") {
            let output = shell(folder, &block);
            assert!(
                output.status.success(),
                "{chapter}: {block}{}",
                printed(&output)
            );
            if block.contains("dataset label") {
                let text = printed(&output);
                // The rule labels a chair that backs off with an object as navigation.
                let most =
                    ["50.0", "100.0"].map(|share| format!("phases: {share} % of 2 episodes"));
                assert!(most.iter().any(|words| text.contains(words)), "{text}");
            }
        }
    }
    let all = recordings(&folder.join("data/session"));
    assert_eq!(all.len(), 2);
    check(folder, "aligned", "data/aligned", &all, "h5py, numpy");
    for format in FormatName::value_variants() {
        let name = format.name();
        let check = |what, modules| check(folder, &name, what, &all, modules);
        match format {
            FormatName::Csv => check("data/csv", "h5py, numpy"),
            FormatName::WheelarmSim => check("data/original", "h5py, numpy"),
            FormatName::Robomimic => check("data/robomimic.hdf5", "h5py, numpy"),
            FormatName::Lerobot => check("data/lerobot", "h5py, numpy, pyarrow"),
            FormatName::Mcap => check(
                "data/mcap",
                "h5py, numpy, mcap, google.protobuf, foxglove_schemas_protobuf",
            ),
            FormatName::Rosbag2 => check_bag(folder, &all[0]),
            // Their reader is the test of `recorded.rs`.
            FormatName::Tensors => {}
        }
    }
    check_videos(folder, &all[0]);
    if let Some(python) = python("h5py, numpy") {
        for block in blocks("train-and-evaluate/process.md", "python") {
            let output = Command::new(&python)
                .args(["-c", &block])
                .current_dir(folder)
                .output();
            let output = output.expect("a process");
            assert!(output.status.success(), "{block}{}", printed(&output));
        }
    }
    check_labels(folder);
    check_page(&folder.join("data/pages/pick_mustard-seed0.html"));
    check_rows_between_samples(folder);
    check_problems(folder, &all);
}

/// Runs a script of `tests/python`.
fn run_script(folder: &Path, python: &str, script: &str, arguments: &[&str]) {
    let output = Command::new(python)
        .arg(root().join("tests/python").join(script))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("a process");
    assert!(output.status.success(), "{script}: {}", printed(&output));
}

/// Reads the guide's bag with a library that has its own message definitions, and with the
/// Python lines of the guide.
fn check_bag(folder: &Path, recording: &Path) {
    let Some(python) = python("h5py, numpy, rosbags.rosbag2") else {
        return;
    };
    let recording = recording.to_string_lossy();
    let arguments = ["rosbags", "data/bags", &*recording];
    run_script(folder, &python, "check_rosbag2.py", &arguments);
    for block in blocks("integrate-and-operate/rosbag2.md", "python") {
        let output = Command::new(&python)
            .args(["-c", &block])
            .current_dir(folder)
            .output();
        let output = output.expect("a process");
        assert!(output.status.success(), "{block}{}", printed(&output));
    }
}

/// The guide's videos, and one of a single camera, show the recorded images. Impossible
/// requests fail with a fix.
fn check_videos(folder: &Path, recording: &Path) {
    let file = recording.display();
    let line = format!(
        "wheelarm dataset video {file} --out data/plain.mp4 --plain --camera gen3 --width 192"
    );
    let output = shell(folder, &line);
    assert!(output.status.success(), "{line}: {}", printed(&output));
    if let Some(python) = python("h5py, numpy") {
        let recording = recording.to_string_lossy();
        let arguments = [
            &*recording,
            "data/plain.mp4",
            "gen3",
            "data/episode.gif",
            "2",
            "10",
        ];
        run_script(folder, &python, "check_video.py", &arguments);
    }
    for (options, words) in [
        ("--camera room", "--camera room=640x360@10"),
        ("--out data/episode.avi", "end in .mp4 or .gif"),
        ("--out data/late.mp4 --from 900", "s long"),
        ("--out data/plain.mp4", "exists already"),
    ] {
        let output = shell(folder, &format!("wheelarm dataset video {file} {options}"));
        let text = printed(&output);
        assert!(
            output.status.code() == Some(1) && text.contains(words),
            "{options}: {text}"
        );
    }
    let left = std::fs::read_dir(folder.join("data")).expect("the folder");
    let left = left.flatten().map(|e| e.file_name());
    let partial: Vec<_> = left
        .filter(|name| name.to_string_lossy().contains(".part"))
        .collect();
    assert!(partial.is_empty(), "{partial:?}");
}

/// A script computes the labels again from the file; the language columns have LeRobot's form.
fn check_labels(folder: &Path) {
    let answers = "tests/python/check_answers.py";
    let labelled = recordings(&folder.join("data/labels"));
    assert_eq!(labelled.len(), 2);
    let language = (
        "pyarrow",
        "tests/python/check_language.py",
        vec![folder.join("data/lerobot-language")],
    );
    for (modules, script, files) in [("h5py, numpy", answers, labelled), language] {
        let Some(python) = python(modules) else {
            continue;
        };
        let output = Command::new(python)
            .arg(root().join(script))
            .args(files)
            .output();
        let output = output.expect("a process");
        assert!(output.status.success(), "{script}: {}", printed(&output));
    }
}

/// Stand-ins for the scripts of WheelArm-Sim, which were saved from Google Colab with a drive
/// to mount and a typed number. They process our export and produce the table that our CSV
/// export contains. `make test-original` runs the original scripts.
#[test]
fn stand_ins_of_the_original_scripts_process_our_files() {
    let Some(python) = python("h5py, numpy") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // Images of the size that the stand-ins expect, and more than their 249 samples.
    let output = shell(
        folder,
        "wheelarm demo --seed 0 --width 64 --height 36 --rate 20 --no-sheet --out raw\n\
         wheelarm dataset export --format wheelarm-sim raw --out original\n\
         wheelarm dataset export --format csv raw --out csv",
    );
    assert!(output.status.success(), "{}", printed(&output));
    let run = |scripts: &Path, samples: &str, work: &str| {
        Command::new(&python)
            .arg(root().join("tests/python/run_original_scripts.py"))
            .arg(scripts)
            .args([samples, "csv/pick_mustard-seed0/final_data.csv", work])
            .current_dir(folder)
            .output()
            .expect("a process")
    };
    let standins = root().join("tests/python/standins");
    let output = run(&standins, "original/pick_mustard-seed0.hdf5", "work");
    let text = printed(&output);
    assert!(output.status.success(), "{text}");
    for words in [
        "hdf5_to_csv.py: n = 1 -> n = 6",
        "synchronization.py: range(1, 21) -> range(6, 7)",
        "final_data.csv: 249 rows as in ours",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }

    // A module is searched by its full name: another `google` package does not replace it.
    let lacking = folder.join("lacking");
    std::fs::create_dir(&lacking).expect("a folder");
    for script in std::fs::read_dir(&standins)
        .expect("the stand-ins")
        .flatten()
    {
        let text = std::fs::read_to_string(script.path()).expect("a script");
        let text = format!("from google.nowhere import nothing\n{text}");
        std::fs::write(lacking.join(script.file_name()), text).expect("a copy");
    }
    let samples = "work/organization/picking/pick_mustard/Experiment6/experiment6.hdf5";
    let output = run(&lacking, samples, "again");
    let text = printed(&output);
    assert_eq!(output.status.code(), Some(77), "{text}");
    assert!(text.contains("imports google.nowhere"), "{text}");
}

/// Chromium runs the page's script and finds every image.
fn check_page(page: &Path) {
    let browsers = ["chromium", "chromium-browser", "google-chrome"];
    let Some(browser) = browsers.iter().find(|b| {
        Command::new(b)
            .arg("--version")
            .output()
            .is_ok_and(|o| o.status.success())
    }) else {
        skipped(&format!(
            "none of {browsers:?} is installed; run: scripts/setup.sh chromium"
        ));
        return;
    };
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"])
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("a browser");
    let dom = String::from_utf8_lossy(&output.stdout);
    let value = |name: &str| -> usize {
        let at = dom
            .split(&format!("{name}=\""))
            .nth(1)
            .and_then(|r| r.split('"').next());
        at.and_then(|n| n.parse().ok()).unwrap_or(0)
    };
    let (rows, images) = (value("data-rows"), value("data-images"));
    assert!(
        rows > 50 && images == 4 * rows,
        "{rows} rows, {images} images"
    );
    assert!(
        dom.matches("src=\"data:image/jpeg").count() == 4,
        "four images are shown"
    );
    assert!(
        !dom.contains("Drawers that moved"),
        "drawers that never moved are shown"
    );
    let ticks = dom.split("data-ticks=\"").nth(1).expect("ticks");
    let ticks = ticks.split('"').next().unwrap_or_default();
    let ticks: Vec<Vec<String>> =
        serde_json::from_str(&ticks.replace("&quot;", "\"")).expect("lists of words");
    assert!(ticks.len() > 5, "{ticks:?}");
    for words in &ticks {
        let all: Vec<f64> = words.iter().flat_map(|w| w.parse()).collect();
        assert!(all.len() >= 2, "{words:?}");
        for pair in all.windows(2) {
            let step = pair[1] - pair[0];
            let digit = step / 10_f64.powf((step * 1.000_001).log10().floor());
            let round = [1.0, 2.0, 5.0].iter().any(|r| (digit - r).abs() < 1e-3);
            assert!(round, "{words:?} are not round");
        }
    }
}

/// At 8 Hz images fall between the samples of 60 Hz. Compares both interpolations with those
/// of numpy, and the chair's pose with its camera's.
fn check_rows_between_samples(folder: &Path) {
    let output = shell(
        folder,
        "wheelarm replay data/session/pick_mustard-seed0.h5 --camera gen3=64x48@8 \\\n\
         --camera wheelchair=64x48@8 --out data/eight\n\
         wheelarm dataset align data/eight --out data/eight-aligned\n\
         wheelarm dataset align data/eight --interpolation linear --out data/eight-linear",
    );
    assert!(output.status.success(), "{}", printed(&output));
    let all = recordings(&folder.join("data/eight"));
    check(folder, "aligned", "data/eight-aligned", &all, "h5py, numpy");
    check(folder, "aligned", "data/eight-linear", &all, "h5py, numpy");
}

/// A failure is reported and does not affect other files.
fn check_problems(folder: &Path, all: &[PathBuf]) {
    let broken = folder.join("data/broken.h5");
    std::fs::write(&broken, b"no HDF5").expect("a file");
    let first = all[0].display();
    let line = format!(
        "wheelarm dataset export --format csv {} {first} --out data/rest",
        broken.display()
    );
    let output = shell(folder, &line);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(
        printed(&output).contains("broken.h5 is not a WheelArm episode"),
        "{}",
        printed(&output)
    );
    assert!(
        folder
            .join("data/rest/pick_mustard-seed0/final_data.csv")
            .is_file()
    );

    let again = shell(folder, &line);
    assert!(
        printed(&again).contains("never overwritten"),
        "{}",
        printed(&again)
    );

    // Killed during the export: no file has the final name.
    let mut child = Command::new(program("wheelarm-dataset").expect("the program"))
        .args(["export", "--format", "wheelarm-sim", "--out", "data/killed"])
        .arg(&all[0])
        .current_dir(folder)
        .stdout(Stdio::null())
        .spawn()
        .expect("a process");
    let begun = Instant::now();
    let part =
        || std::fs::read_dir(folder.join("data/killed")).is_ok_and(|mut d| d.next().is_some());
    while !part() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("a kill");
    child.wait().expect("an end");
    assert!(!folder.join("data/killed/pick_mustard-seed0.hdf5").exists());

    // Interrupted and started again: the label tables cover all episodes.
    let line = format!("wheelarm dataset annotate {first} {first} --out data/notes");
    let output = shell(folder, &line);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(
        printed(&output).contains("of the same label"),
        "{}",
        printed(&output)
    );
    let labels = folder.join("data/notes");
    let table = std::fs::read_to_string(labels.join("subtasks.csv")).expect("a table");
    for name in ["subtasks.csv", "questions.csv"] {
        std::fs::remove_file(labels.join(name)).expect("a table");
    }
    let line = format!("wheelarm dataset annotate {first} --out data/notes");
    let output = shell(folder, &line);
    assert!(
        printed(&output).contains("never overwritten"),
        "{}",
        printed(&output)
    );
    let again = std::fs::read_to_string(labels.join("subtasks.csv")).expect("a table");
    assert_eq!(again, table);

    let Some(python) = python("h5py, numpy") else {
        return;
    };
    let spoil = "import h5py, shutil, sys\n\
        shutil.copy(sys.argv[1], 'data/spoilt.h5')\n\
        f = h5py.File('data/spoilt.h5', 'r+')\n\
        f['streams/joint_state/position'][5, 3] = float('nan')\n\
        f['streams/pose/pose'][9, 6, 3:] *= 1.01\n\
        s = f['streams/imu/stamp_nanos']; s[20] = s[19]\n\
        f['streams/camera/gen3/rgb'][4] = 0\n";
    let output = Command::new(python)
        .args(["-c", spoil])
        .arg(&all[0])
        .current_dir(folder)
        .output();
    let output = output.expect("a process");
    assert!(output.status.success(), "{}", printed(&output));
    let output = shell(folder, "wheelarm dataset validate data/spoilt.h5");
    assert_eq!(output.status.code(), Some(3), "{}", printed(&output));
    let text = printed(&output);
    for words in [
        "joint_state: position: 1 numbers are not finite",
        "pose: pose: the norm of a quaternion is off by 1.00e-2",
        "imu: stamps do not rise at sample 20",
        "camera/gen3: 1 images of one colour",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let output = shell(folder, "wheelarm dataset align data/spoilt.h5");
    assert!(
        printed(&output).contains("the stamps of imu do not rise"),
        "{}",
        printed(&output)
    );
}

#[test]
fn episode_driven_by_hand_in_real_time_is_aligned() {
    let args = ["--camera", "gen3=64x48@10", "--quality", "fast"];
    let server = Server::start("by-hand-aligned", &args).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::start(&server, "hand", folder.path(), &["--episodes", "1"]);
    let client = server.client();
    wait_until("the recorder is connected", || {
        let status = client.request(&v1::StatusRequest {}).expect("a status");
        !status.recorders.is_empty()
    });
    let mut hand = client.commander("hand", false).expect("control");
    let clocks = client.streams(&[TopicId::Clock]).expect("the clock");
    let request = v1::EpisodeStartRequest {
        label: "by-hand".into(),
        require_recorders: 1,
        ..Default::default()
    };
    client.request(&request).expect("an episode");
    // A client that sends faster than the control rate has several commands per tick.
    let mut ticks = 0;
    while ticks < 60 {
        let Some(Sample::Clock(clock)) = clocks.next(PATIENCE).expect("no error") else {
            panic!("no clock");
        };
        let header = clock.header.expect("a header");
        if header.episode > 0 {
            for _ in 0..3 {
                hand.answer(&header, v1::Command::default())
                    .expect("a command");
            }
            ticks += 1;
        }
    }
    let stop = server.run_client(&["episode", "stop"]).expect("a client");
    assert!(stop.status.success(), "{}", printed(&stop));
    let (status, text) = recorder.end();
    assert!(status.success(), "{text}");
    let stamps = Episode::open(&folder.path().join("by-hand.h5"))
        .and_then(|episode| episode.stamps("command"))
        .expect("the commands");
    let shared = stamps.windows(2).filter(|w| w[0] == w[1]).count();
    assert!(shared > 0, "no two commands share a tick");
    let line = "wheelarm dataset align by-hand.h5 --out aligned";
    let aligned = shell(folder.path(), line);
    let text = printed(&aligned);
    assert!(aligned.status.success(), "{text}");
    println!(
        "{} commands, {shared} in the tick of another\n{text}",
        stamps.len()
    );
}
