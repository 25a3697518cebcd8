//! Second lists: what a document, a script or the Python package repeats from the contract,
//! from the assets or from a constant. Each test names the file to change.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use clap::ValueEnum;
use wheelarm_dataset::convert::FormatName;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::topic::{Rate, Record};
use wheelarm_proto::{TopicId, defaults};
use wheelarm_server::service::{convert, startup};
use wheelarm_tests::program;

use super::{robots, root};

fn text(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A text with single spaces and without the marks of comments.
fn flat(text: &str) -> String {
    let words = text.split_whitespace().filter(|word| *word != "//");
    words.collect::<Vec<_>>().join(" ")
}

/// Quoted words between two marks of a file.
fn quoted(path: &str, start: &str, end: &str) -> BTreeSet<String> {
    let text = text(path);
    let part = text.split(start).nth(1);
    let part = part.unwrap_or_else(|| panic!("{path} lacks {start:?}"));
    let part = part.split(end).next().unwrap_or_default();
    let words = part.split('"').skip(1).step_by(2);
    words.map(str::to_owned).collect()
}

const RECORDING: &str = "docs/start/recording.md";

#[test]
fn guide_of_recordings_names_every_recorded_stream_with_its_rate() {
    let guide = text(RECORDING);
    for topic in TopicId::ALL {
        let info = topic.info();
        let group = match info.record {
            Record::Unspecified => continue,
            // Stored as the image of its camera.
            Record::Images if topic == TopicId::CompressedCamera => continue,
            Record::Events => "`/events`".to_owned(),
            Record::Images => format!("`/streams/{topic}/{{"),
            Record::Columns if info.name.starts_with("sensed_") => "`/streams/sensed_*`".to_owned(),
            Record::Columns => format!("`/streams/{topic}`"),
        };
        let row = guide
            .lines()
            .find(|line| line.starts_with("| `") && line.contains(&group));
        let row = row.unwrap_or_else(|| panic!("{RECORDING} has no row for {group}; add one"));
        let rate = match info.rate {
            _ if group.contains("sensed_") || topic == TopicId::Sensor => continue,
            Rate::Control | Rate::State => defaults::STATE_RATE_HZ,
            Rate::Imu => defaults::IMU_RATE_HZ,
            Rate::Scan => defaults::SCAN_RATE_HZ,
            Rate::Deformable => defaults::DEFORMABLE_RATE_HZ,
            Rate::Camera => defaults::CAMERA_RATE_HZ,
            Rate::Second | Rate::Event => continue,
        };
        let stated = format!("| {rate} Hz");
        assert!(row.contains(&stated), "{RECORDING}: {rate} Hz in {row}");
    }
}

#[test]
fn contract_help_and_guides_state_the_default_rates() {
    const CONTRACT: &str = "proto/wheelarm/v1/scenario.proto";
    let contract = flat(&text(CONTRACT));
    let mut server = Command::new(program("wheelarm-server").expect("the server"));
    let help = server.arg("--help").output().expect("the server's help");
    let help = flat(&String::from_utf8_lossy(&help.stdout));
    for (field, rate) in [
        ("state_rate_hz", defaults::STATE_RATE_HZ),
        ("imu_rate_hz", defaults::IMU_RATE_HZ),
        ("deformable_rate_hz", defaults::DEFORMABLE_RATE_HZ),
        ("scan_rate_hz", defaults::SCAN_RATE_HZ),
    ] {
        let comment = format!("At start-up {rate}. optional double {field} =");
        assert!(contract.contains(&comment), "{CONTRACT} lacks {comment:?}");
        let option = format!("--{}", field.replace('_', "-"));
        let about = help.split(&option).nth(1).expect("an option of the server");
        let about = about.split(" --").next().unwrap_or_default();
        let default = format!("[default: {rate}]");
        assert!(
            about.contains(&default),
            "server/src/main.rs: {option} lacks {default}"
        );
    }
    let rate = defaults::CAMERA_RATE_HZ;
    let comment = format!("Absent means {rate}, 0 is off. optional double rate_hz =");
    assert!(contract.contains(&comment), "{CONTRACT} lacks {comment:?}");
    let [width, height] = defaults::CAMERA_SIZE;
    for default in [
        format!("[default: `*={width}x{height}@{rate}`]"),
        format!("[default: {}]", defaults::SCENE),
        format!("[default: {}]", defaults::ROBOT),
        format!("[default: {}]", defaults::TASK),
    ] {
        assert!(
            help.contains(&default),
            "server/src/main.rs lacks {default}"
        );
    }
    for (path, group, rate) in [
        ("README.md", "/streams/imu`", defaults::IMU_RATE_HZ),
        (
            "README.md",
            "/streams/joint_state`",
            defaults::STATE_RATE_HZ,
        ),
        ("README.md", "/streams/camera/", defaults::CAMERA_RATE_HZ),
        (
            "docs/integrate-and-operate/rosbag2.md",
            "| `/imu/data`",
            defaults::IMU_RATE_HZ,
        ),
    ] {
        let text = text(path);
        let row = text.lines().find(|line| line.contains(group));
        let row = row.unwrap_or_else(|| panic!("{path} has no row {group}"));
        assert!(row.contains(&format!("{rate} Hz")), "{path}: {row}");
    }
}

#[test]
fn guides_have_a_command_for_every_export_format() {
    let mut documents = String::new();
    for path in super::documents::documents() {
        documents += &fs::read_to_string(path).expect("a document");
    }
    for format in FormatName::value_variants() {
        let command = format!("wheelarm dataset export --format {} ", format.name());
        assert!(
            documents.contains(&command),
            "no guide below docs has the command `{command}…`"
        );
    }
}

/// Names of a robot's cameras; those that are off unless they are requested, too if
/// `with_requested`.
fn cameras(robot: &str, with_requested: bool) -> BTreeSet<String> {
    let file: toml::Table = text(&format!("assets/robots/{robot}/robot.toml"))
        .parse()
        .expect("TOML");
    let cameras = file["camera"].as_array().expect("cameras").iter();
    let requested = |camera: &toml::Value| {
        let flag = camera.get("on_request").and_then(toml::Value::as_bool);
        flag.unwrap_or_default()
    };
    cameras
        .filter(|camera| with_requested || !requested(camera))
        .map(|camera| camera["name"].as_str().expect("a name").to_owned())
        .collect()
}

#[test]
fn cameras_that_clients_name_are_those_of_the_robot() {
    const STAGE: &str = "client/teleop/web/page/parts/stage.js";
    let stage = text(STAGE);
    let titles = stage.split("const NAMES = {").nth(1).expect("titles");
    let titles = titles.split('}').next().unwrap_or_default();
    for robot in robots() {
        for camera in cameras(&robot, true) {
            assert!(
                titles.contains(&format!(" {camera}: \"")),
                "{STAGE}: NAMES has no title for the camera {camera} of {robot}"
            );
        }
    }
    let usual = cameras(defaults::ROBOT, false);
    let environment = "client/python/src/wheelarm/env.py";
    assert_eq!(
        quoted(environment, "\nCAMERAS = {", "}"),
        usual,
        "CAMERAS of {environment}"
    );
    let axis = "client/campaign/src/axis.rs";
    let models = quoted(axis, "Axis::Depth =>", "],");
    let placed: BTreeSet<String> = models
        .iter()
        .filter_map(|model| model.split_once('@'))
        .map(|(_, camera)| camera.to_owned())
        .collect();
    assert_eq!(placed, usual, "Axis::Depth of {axis}");
    for model in models {
        let (file, _) = model.split_once('@').unwrap_or((&model, ""));
        let path = root().join(format!("assets/sensors/{file}.toml"));
        assert!(path.is_file(), "{axis}: {model}, but no {}", path.display());
    }
    let names: Vec<&str> = usual.iter().map(String::as_str).collect();
    let group = format!("`/streams/camera/{{{}}}`", names.join(","));
    for path in ["README.md", RECORDING] {
        assert!(text(path).contains(&group), "{path} lacks {group}");
    }
}

#[test]
fn guide_of_the_page_has_a_row_for_every_preset() {
    const PAGE: &str = "docs/drive-and-record/driver-page.md";
    let script = text("client/teleop/web/page/logic/profile.js");
    let presets = script.split("export const PRESETS = {").nth(1);
    let presets = presets.and_then(|text| text.split("\n};").next());
    let labels = presets.expect("the presets").split("label: \"").skip(1);
    let labels: Vec<&str> = labels.filter_map(|text| text.split('"').next()).collect();
    assert!(labels.len() > 5, "{labels:?}");
    let guide = text(PAGE);
    for label in labels {
        assert!(
            guide.contains(&format!("\n| {label} |")),
            "{PAGE} has no row for the preset {label:?}; add one"
        );
    }
}

/// Fields that Python restores part by part, or that only the server writes.
const IN_PARTS: [&str; 4] = [
    "language",
    "person",
    "rejected_starts",
    "time_limit_seconds",
];

#[test]
fn python_knows_which_fields_a_reset_samples_again() {
    let guide = text("docs/drive-and-record/scenario.md");
    let file = guide.split("```toml\n").nth(1).expect("an example");
    let file = file.split("```").next().expect("its end");
    let request = startup::read(file).expect("a scenario of the contract");
    let scenario = startup::scenario(&request).expect("a scenario");
    let mut cleared = scenario.clone();
    cleared.clear_sampled();
    let [before, after] = [&scenario, &cleared].map(|s| scenario_json(&convert::scenario(s)));
    let before = before.as_object().expect("fields");
    let mut sampled: BTreeSet<String> = before
        .iter()
        .filter(|(field, value)| after.get(field.as_str()) != Some(*value))
        .map(|(field, _)| field.clone())
        .collect();
    for field in IN_PARTS {
        sampled.remove(field);
    }
    assert!(sampled.len() > 5, "{sampled:?}");
    // They choose what is sampled.
    sampled.extend(["task".to_owned(), "seed".to_owned()]);
    let python = "client/python/src/wheelarm/_scenario_reset.py";
    assert_eq!(
        quoted(python, "RESAMPLED = frozenset(", ")"),
        sampled,
        "RESAMPLED of {python}"
    );
}

/// Source files that a document names exist, also without their folder.
#[test]
fn source_files_that_a_document_names_exist() {
    let mut sources = Vec::new();
    let is_source = |path: &std::path::Path| path.extension().is_some();
    super::documents::tree(&root(), &is_source, &mut sources);
    let mut missing = Vec::new();
    for path in super::documents::documents() {
        let text = fs::read_to_string(&path).expect("a document");
        for name in super::documents::without_blocks(&text)
            .split('`')
            .skip(1)
            .step_by(2)
        {
            let is_file = [".rs", ".proto", ".js", ".sh"]
                .iter()
                .any(|ending| name.ends_with(ending) && name.len() > ending.len());
            let is_pattern = name.contains(['*', '{', ' ', '…'])
                || ["NAME", "FAMILY"].iter().any(|part| name.contains(part));
            if is_file && !is_pattern && !sources.iter().any(|source| source.ends_with(name)) {
                missing.push(format!("{}: {name}", super::documents::place(&path)));
            }
        }
    }
    assert!(missing.is_empty(), "missing:\n{}", missing.join("\n"));
}
