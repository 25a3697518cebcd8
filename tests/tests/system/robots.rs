//! Other robots than the default one, described by their folder alone, and the robot of files
//! without a description.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wheelarm_dataset::read::{Episode, first_robot};
use wheelarm_proto::robot::Roles;
use wheelarm_tests::{printed, program, root};

/// The assets with the robot of `tests/data/robots` beside the default one.
fn assets(folder: &Path) -> PathBuf {
    let (assets, robots) = (folder.join("assets"), folder.join("assets/robots"));
    fs::create_dir_all(robots.join("other")).expect("a folder");
    let symlink = |from: PathBuf, to: PathBuf| {
        std::os::unix::fs::symlink(from, to).expect("a link");
    };
    for entry in fs::read_dir(root().join("assets")).expect("the assets") {
        let entry = entry.expect("an entry");
        if entry.file_name() != "robots" {
            symlink(entry.path(), assets.join(entry.file_name()));
        }
    }
    let ours = root().join("assets/robots/wheelarm");
    symlink(ours, robots.join("wheelarm"));
    for file in ["robot.toml", "other.urdf"] {
        let from = root().join("tests/data/robots/other").join(file);
        fs::copy(from, robots.join("other").join(file)).expect("a copy");
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

/// The other robot has other names and another order of joints and frames, an
/// arm joint that turns the other way, another gripper, mount and track, and
/// three cameras.
#[test]
fn another_robot_completes_a_task_and_its_recording_is_processed() {
    let folder = tempfile::tempdir().expect("a folder");
    let assets = assets(folder.path());
    let out = folder.path().join("out");
    let out_text = out.to_string_lossy().into_owned();
    let small = ["--width", "128", "--height", "96", "--rate", "10"];
    let demo = [
        "demo", "--robot", "other", "--seed", "1", "--out", &out_text,
    ];
    // It has no laser scanner.
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(demo)
        .args(["--scan-rate-hz", "10"])
        .env("WHEELARM_ASSETS", &assets)
        .output()
        .expect("a process");
    let text = printed(&output);
    assert!(
        !output.status.success() && text.contains("no laser scanner"),
        "{text}"
    );
    let output = wheelarm(&assets, &[&demo[..], &small[..]].concat());
    let text = printed(&output);
    assert!(text.contains("missed      0 (complete)"), "{text}");
    let found = |ending: &str| {
        let entries = fs::read_dir(&out).expect("the folder").flatten();
        let mut paths = entries.map(|entry| entry.path());
        let found = paths.find(|path| path.to_string_lossy().ends_with(ending));
        found.unwrap_or_else(|| panic!("no file {ending}"))
    };
    let file = found(".h5");
    assert!(found(".png").metadata().expect("an image").len() > 10_000);
    let path = file.to_string_lossy();

    let episode = Episode::open(&file).expect("an episode");
    assert!(episode.summary().expect("a summary").success);
    let robot = episode.robot().expect("a robot");
    let roles = Roles::find(&robot).expect("every role");
    assert_eq!(robot.name, "other");
    let names = episode.names("joint_state", "position").expect("names");
    assert_eq!(names, robot.joint_names().collect::<Vec<_>>());
    let mut cameras: Vec<&str> = robot.cameras.iter().map(|c| c.name.as_str()).collect();
    cameras.sort_unstable();
    assert_eq!(episode.cameras().expect("cameras"), cameras);
    assert_eq!(cameras.len(), 3);
    // The gripper closed around an object, and the chair has driven.
    let positions = episode.f64s("joint_state", "position").expect("positions");
    let column = |index: usize| positions.iter().skip(index).step_by(names.len());
    let most = |index: usize| column(index).copied().fold(0.0, f64::max);
    let knuckle = most(roles.knuckle);
    let opening = robot.opening(knuckle).expect("a linkage");
    assert!(
        (0.02..0.08).contains(&opening),
        "{opening} m at {knuckle} rad"
    );
    assert!(most(roles.wheels[0]) > 1.0);

    let replay = wheelarm(&assets, &["replay", &path]);
    assert!(
        printed(&replay).contains("hashes equal"),
        "{}",
        printed(&replay)
    );
    let aligned = folder.path().join("aligned");
    let aligned_path = aligned.to_string_lossy();
    let align = ["dataset", "align", &path, "--reference", "palm_eye"];
    wheelarm(&assets, &[&align[..], &["--out", &aligned_path]].concat());
    let files = fs::read_dir(&aligned).expect("the folder").flatten();
    assert_eq!(files.count(), 1, "one aligned file");
    let sheet = folder.path().join("sheet.png");
    let sheet = sheet.to_string_lossy();
    wheelarm(&assets, &["dataset", "sheet", &path, "--out", &sheet]);
    wheelarm(&assets, &["dataset", "validate", &path]);
}

/// The gripper of `wheelarm_wide` opens further, closes at another knuckle angle and is
/// weaker. The expert knows it from its description alone.
#[test]
fn another_gripper_lifts_the_mustard() {
    let folder = tempfile::tempdir().expect("a folder");
    let assets = root().join("assets");
    let out = folder.path().to_string_lossy().into_owned();
    let demo = ["demo", "--robot", "wheelarm_wide", "--task", "pick_mustard"];
    let small = ["--width", "128", "--height", "96", "--no-sheet"];
    let seed = ["--seed", "1", "--out", &out];
    wheelarm(&assets, &[&demo[..], &small[..], &seed[..]].concat());
    let entries = fs::read_dir(folder.path()).expect("the folder").flatten();
    let mut paths = entries.map(|entry| entry.path());
    let file = paths.find(|path| path.extension().is_some_and(|ending| ending == "h5"));
    let episode = Episode::open(&file.expect("a recording")).expect("an episode");
    assert!(episode.summary().expect("a summary").success);
    let robot = episode.robot().expect("a robot");
    let gripper = robot.gripper_or_default();
    assert_eq!((gripper.stroke, gripper.max_force), (0.14, 60.0));

    // The gripper opened wider than that of `wheelarm` can, and held the bottle.
    let roles = Roles::find(&robot).expect("every role");
    let positions = episode.f64s("joint_state", "position").expect("positions");
    let knuckles = positions
        .iter()
        .skip(roles.knuckle)
        .step_by(robot.joints.len());
    let openings: Vec<f64> = knuckles
        .map(|&q| robot.opening(q).expect("a linkage"))
        .collect();
    let widest = openings.iter().copied().fold(0.0, f64::max);
    assert!(widest > 0.13, "{widest} m");
    let held = openings.last().expect("a sample");
    assert!((0.045..0.07).contains(held), "the bottle is {held} m wide");
    // The pads pressed, and no command requested more force than the gripper has.
    let pads = episode.f64s("contact", "pad_force").expect("pad forces");
    let hardest = pads.iter().copied().fold(0.0, f64::max);
    assert!(hardest > 10.0, "{hardest} N");
    let commands = episode.f64s("command", "gripper").expect("commands");
    let caps = commands.iter().skip(2).step_by(3);
    let caps: Vec<f64> = caps.copied().filter(|cap| cap.is_finite()).collect();
    assert!(
        !caps.is_empty() && caps.iter().all(|cap| *cap <= 60.0),
        "{caps:?}"
    );
}

/// The robot of files without a description is stored and never changes with the default robot.
#[test]
fn files_without_a_robot_use_the_first_robot() {
    let robot = first_robot().expect("a description");
    let joints: Vec<_> = robot
        .joints
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    assert_eq!(
        (joints.len(), joints[4], joints[13]),
        (16, "joint_1", "robotiq_85_left_knuckle_joint")
    );
    assert_eq!(robot.gripper.map(|gripper| gripper.stroke), Some(0.085));
}
