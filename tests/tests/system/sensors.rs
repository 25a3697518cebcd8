//! Sensor models: recorded beside the exact streams, validated, aligned, exported and
//! reproduced bit by bit, without an effect on the simulation.

use std::path::{Path, PathBuf};
use std::process::Command;

use wheelarm_dataset::read::{Camera, Episode};
use wheelarm_proto::v1;
use wheelarm_sdk::Client;
use wheelarm_tests::{IdleCommander, Recorder, Server, printed, program, root, wait_until};

const SMALL: [&str; 4] = ["--camera", "gen3=160x96@10", "--pacing", "lock-step"];

/// Every kind of model except the command delay, which changes the simulation.
const SENSORS: [&str; 12] = [
    "--sensor",
    "kinova_vision@gen3",
    "--sensor",
    "imu",
    "--sensor",
    "odometry",
    "--sensor",
    "encoders",
    "--sensor",
    "scanner",
    "--scan-rate-hz",
    "10",
];

fn wheelarm(folder: &Path, args: &[&str]) -> String {
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .current_dir(folder)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

fn ticks(client: &Client) -> u64 {
    let status = client.request(&v1::StatusRequest {}).expect("a status");
    status.header.map_or(0, |header| header.tick)
}

/// Records two simulated seconds of an idle robot in lock-step; the file.
fn record(folder: &Path, label: &str, sensors: &[&str]) -> PathBuf {
    let args = [&SMALL[..], sensors].concat();
    let server = Server::start(label, &args).expect("a server");
    let recorder = Recorder::start(&server, "r", folder, &["--episodes", "1"]);
    let client = server.client();
    let commander = IdleCommander::start(&client);
    let request = v1::EpisodeStartRequest {
        label: label.to_owned(),
        require_recorders: 1,
        commander: IdleCommander::NAME.to_owned(),
        ..v1::EpisodeStartRequest::default()
    };
    client.request(&request).expect("an episode");
    wait_until("two seconds have passed", || ticks(&client) >= 480);
    client.stop_episode(false).expect("its end");
    drop(commander);
    recorder.finish();
    folder.join(format!("{label}.h5"))
}

#[test]
fn sensor_samples_are_recorded_and_replayed_bit_by_bit_without_changing_the_simulation() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let file = record(here, "sensed", &SENSORS);
    let path = file.to_string_lossy().into_owned();
    let fine = wheelarm(here, &["dataset", "validate", &path]);
    assert!(fine.contains("1 of 1 recordings are fine"), "{fine}");
    for stream in [
        "sensor/gen3_color",
        "sensor/gen3_depth",
        "sensed_imu",
        "sensed_scan",
    ] {
        let info = wheelarm(here, &["dataset", "info", &path]);
        assert!(info.contains(stream), "{info}");
    }

    let episode = Episode::open(&file).expect("an episode");
    let sensors = episode.sensors().expect("sensors");
    assert_eq!(sensors, ["gen3_color", "gen3_depth"]);
    let exact = episode.camera("gen3").expect("a camera");
    for name in &sensors {
        let sensor = episode.sensor(name).expect("a sensor");
        assert_eq!(sensor.made_from(), Some("gen3"));
        assert!(sensor.len() >= 15, "{} images of {name}", sensor.len());
        for (arrival, exposure) in sensor.stamps().iter().zip(sensor.exposures()) {
            let age = (arrival - exposure) as f64 * 1e-9;
            assert!((0.045..0.21).contains(&age), "{age} s");
            assert!(
                exact.stamps().contains(exposure),
                "no exact image has this exposure"
            );
        }
    }
    let depth = episode.sensor("gen3_depth").expect("a sensor");
    assert_eq!(
        (depth.size(), depth.millimetres()),
        (Some((480, 270)), true)
    );
    depth_fills_its_own_lens(&depth, &episode);
    assert_eq!(
        episode
            .f64s("sensed_joint", "position")
            .expect("rad")
            .shape()[1],
        6
    );
    let noisy = episode
        .f64s("sensed_imu", "angular_velocity")
        .expect("rad/s");
    let truth = episode.f64s("imu", "angular_velocity").expect("rad/s");
    assert_eq!(noisy.shape(), truth.shape());
    assert_ne!(noisy, truth);
    let [exact_scan, noisy_scan] =
        ["scan", "sensed_scan"].map(|stream| episode.f64s(stream, "ranges").expect("m"));
    assert_eq!(exact_scan.shape()[1], 720);
    assert!(exact_scan.shape()[0] >= 20, "{:?}", exact_scan.shape());
    assert_eq!(noisy_scan.shape(), exact_scan.shape());
    let errors = noisy_scan.iter().zip(&exact_scan);
    let errors = errors.filter(|(noisy, exact)| noisy.is_finite() && exact.is_finite());
    let most = errors.map(|(noisy, exact)| (noisy - exact).abs() / exact);
    let most = most.fold(0.0, f64::max);
    assert!((0.005..0.05).contains(&most), "{most}");

    // A replay has the same bits.
    wheelarm(here, &["replay", &path, "--out", "again"]);
    let again = Episode::open(&here.join("again/sensed-replay.h5")).expect("an episode");
    for name in &sensors {
        let [was, is] = [&episode, &again].map(|e| e.sensor(name).expect("a sensor"));
        assert_eq!(was.stamps(), is.stamps(), "{name}");
        assert_eq!(was.exposures(), is.exposures(), "{name}");
        for index in 0..was.len() {
            let same = match was.has_depth() {
                true => was.depth(&episode, index).ok() == is.depth(&again, index).ok(),
                false => was.rgb(&episode, index).ok() == is.rgb(&again, index).ok(),
            };
            assert!(same, "{name}, image {index}");
        }
    }
    for (stream, column) in [
        ("sensed_imu", "angular_velocity"),
        ("sensed_imu", "linear_acceleration"),
        ("sensed_odometry", "pose"),
        ("sensed_joint", "position"),
        ("sensed_joint", "effort"),
        ("scan", "ranges"),
        ("sensed_scan", "ranges"),
    ] {
        let [was, is] = [&episode, &again].map(|e| e.f64s(stream, column).expect("a column"));
        let same = was
            .iter()
            .zip(is.iter())
            .all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same && was.shape() == is.shape(), "{stream}/{column}");
    }

    // Sensor models do not affect the simulation.
    let plain = record(here, "plain", &[]);
    let plain = Episode::open(&plain).expect("an episode");
    assert!(plain.sensors().expect("none").is_empty());
    let [with, without] = [&episode, &plain].map(|e| e.state_hashes().expect("hashes"));
    assert_eq!(with[..2], without[..2]);
    let camera = plain.camera("gen3").expect("a camera");
    let same = camera.rgb(&plain, 3).expect("an image");
    assert_eq!(same, exact.rgb(&episode, 3).expect("an image"));

    wheelarm(here, &["dataset", "align", &path, "--out", "aligned"]);
    for (format, more) in [
        ("lerobot", &["--pictures", "png", "--depth"][..]),
        ("mcap", &[]),
    ] {
        let out = format!("exported-{format}");
        let export = [
            "dataset", "export", &path, "--format", format, "--out", &out,
        ];
        wheelarm(here, &[&export, more].concat());
    }
    let features = here.join("exported-lerobot/meta/info.json");
    let features = std::fs::read_to_string(features).expect("features");
    assert!(
        features.contains("observation.images.gen3_depth") && features.contains("observation.scan"),
        "{features}"
    );
}

/// The depth sensor sees wider than the color camera: its image has returns up to its
/// edges, and its intrinsics are those of its own lens.
fn depth_fills_its_own_lens(depth: &Camera, episode: &Episode) {
    const WIDTH: usize = 480;
    let focal = depth.intrinsics(3)[2..4].to_vec();
    assert!(
        focal.iter().all(|f| (f - 360.013).abs() < 1e-9),
        "{focal:?}"
    );
    let image = depth.depth(episode, 3).expect("an image");
    let share = |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>| {
        let mut returns = 0;
        for y in rows.clone() {
            let row = &image[y * WIDTH..(y + 1) * WIDTH];
            returns += row[columns.clone()]
                .iter()
                .filter(|z| z.is_finite())
                .count();
        }
        returns as f64 / (columns.len() * rows.len()) as f64
    };
    // The color camera's lens ends 53 columns before the right edge, 72 rows below the top.
    for (columns, rows) in [(430..480, 0..270), (60..480, 0..60)] {
        let share = share(columns.clone(), rows.clone());
        assert!(share > 0.5, "{share} of columns {columns:?}, rows {rows:?}");
    }
    let all = share(0..WIDTH, 0..270);
    assert!(all > 0.75, "{all} of the pixels have a return");
}

#[test]
fn late_and_asynchronous_sensor_images_lose_no_row() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let path = record(here, "late", &["--sensor", "kinova_vision@gen3=3"]);
    let episode = Episode::open(&path).expect("an episode");
    let first = |name: &str| episode.sensor(name).expect("a sensor").stamps()[0];
    let since = first("gen3_color").max(first("gen3_depth"));
    let camera = episode.camera("gen3").expect("a camera");
    let rows = camera.stamps().iter().filter(|&&stamp| stamp >= since);
    let rows = rows.count();
    let path = path.to_string_lossy().into_owned();
    let export = ["dataset", "export", &path, "--format", "lerobot"];
    let more = ["--pictures", "png", "--depth", "--out", "set"];
    wheelarm(here, &[&export[..], &more].concat());
    let info = std::fs::read_to_string(here.join("set/meta/info.json")).expect("a set");
    let info: serde_json::Value = serde_json::from_str(&info).expect("JSON");
    let frames = info["total_frames"].as_u64().expect("a number") as usize;
    assert!(rows >= 12 && frames + 1 >= rows, "{frames} of {rows} rows");
    let cameras = std::fs::read_to_string(here.join("set/meta/cameras.json")).expect("cameras");
    let cameras: serde_json::Value = serde_json::from_str(&cameras).expect("JSON");
    assert_eq!(cameras["by_episode"][0]["episodes"], serde_json::json!([0]));
}

#[test]
fn invalid_sensor_is_rejected_with_a_fix() {
    let cases = [
        (&["--sensor", "kinova_vision"][..], "available: gen3"),
        (&["--sensor", "kinova_vision@moon"], "available: gen3"),
        (&["--sensor", "imu@gen3"], "leave it out"),
        (&["--sensor", "eyes@gen3"], "kinova_vision"),
        (
            &["--sensor", "surfaces"],
            "unknown sensor model \"surfaces\"",
        ),
        (&["--sensor", "kinova_vision@gen3"], "disables all cameras"),
        (&["--sensor", "imu=4"], "strength"),
        (
            &["--sensor", "imu", "--sensor", "imu=2"],
            "two sensor models",
        ),
    ];
    for (args, words) in cases {
        let args = [&["--no-cameras"], args].concat();
        let error = Server::start("refused", &args).expect_err("it started");
        assert!(error.to_string().contains(words), "{args:?}: {error}");
    }
    // A camera of the robot that is not enabled.
    let args = [
        "--camera",
        "gen3=64x48@5",
        "--sensor",
        "chair_stereo@wheelchair",
    ];
    let error = Server::start("blind", &args).expect_err("it started");
    assert!(error.to_string().contains("available: gen3"), "{error}");
}
