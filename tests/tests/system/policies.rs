//! Policies as processes: observations equal the exported rows, and a failing policy costs one
//! episode.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::Mutex;

use serde_json::Value;
use wheelarm_dataset::convert::learning::{self, Learning, RowOptions};
use wheelarm_dataset::convert::{ReadOptions, Recording, Sees};
use wheelarm_proto::v1;
use wheelarm_rollout::policy::{self, Hold, Policy, PolicyError, PolicyOptions};
use wheelarm_tests::{Recorder, Server, printed, program, root, wait_until};

/// Holds the end effector, drives, and stores its observations.
struct Witness {
    spec: v1::PolicySpec,
    observed: Mutex<Vec<v1::PolicyObservation>>,
}

impl Policy for Witness {
    fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        assert!(!request.instruction.is_empty());
        Ok(())
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let mut chunk = Hold::default().infer(observation.clone())?;
        let mut observed = self.observed.lock().expect("a lock");
        observed.push(observation);
        chunk.values[0] += 0.02;
        chunk.values[10] = 0.2;
        chunk.values[11] = 0.3;
        match observed.len() {
            0..25 => Ok(chunk),
            _ => Err(PolicyError::Rejected("enough".to_owned())),
        }
    }
}

#[test]
fn observations_equal_the_exported_rows() {
    check_observations("observed", &[]);
}

#[test]
fn observations_of_sensor_models_equal_the_exported_rows() {
    let sensors = [
        "encoders",
        "odometry",
        "kinova_vision@gen3",
        "chair_stereo@wheelchair",
    ];
    check_observations(
        "sensed",
        &sensors.map(|sensor| ["--sensor", sensor]).concat(),
    );
}

fn check_observations(name: &str, sensors: &[&str]) {
    let arguments = [
        "--pacing",
        "lock-step",
        "--camera",
        "*=96x54@10",
        "--task",
        "pick_bowl",
    ];
    let server = Server::start(name, &[&arguments, sensors].concat()).expect("a server");
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "witness", folder.path(), &["--episodes", "1"]);
    let client = server.client();
    let status = || client.request(&v1::StatusRequest {}).expect("an answer");
    wait_until("the recorder is connected", || {
        !status().recorders.is_empty()
    });
    let camera = |name: &str| v1::PolicyCamera {
        name: name.to_owned(),
        width: 96,
        height: 54,
        // A depth sensor has its own lens and size.
        depth: name == "gen3" && sensors.is_empty(),
    };
    let policy = Witness {
        spec: v1::PolicySpec {
            name: "witness".to_owned(),
            cameras: vec![camera("gen3"), camera("wheelchair")],
            history: 2,
            rate_hz: 10.0,
            chunk: 1,
            execute: 1,
            ..Default::default()
        },
        observed: Mutex::default(),
    };
    let options = PolicyOptions {
        label: "observed".to_owned(),
        require_recorders: 1,
        ..Default::default()
    };
    let finished = policy::run(&client, &policy, &options, &mut |_| {}).expect("an episode");
    assert_eq!(
        finished.policy_error,
        Some(PolicyError::Rejected("enough".to_owned()))
    );
    // Six control ticks for each row, at 10 Hz.
    let rows = finished.ticks / 6;
    assert_eq!((rows, finished.answer_seconds.len()), (24, 24));
    recorder.finish();

    let wanted = learning::reads;
    let file = folder.path().join("observed.h5");
    let recording = Recording::open(&file, &ReadOptions::default(), &wanted).expect("a recording");
    let rows = RowOptions::default();
    let (rate, all) = Learning::on_grid(&recording, &rows, Sees::Colour).expect("rows");
    assert_eq!(rate, 10);
    let observed = policy.observed.into_inner().expect("a lock");
    // The encoder model adds a small error.
    let off = (0..6).map(|j| (all.states[20][j] - all.joints(all.rows[20])[j]).abs());
    assert_eq!(off.sum::<f64>() > 0.0, !sensors.is_empty());
    assert!(all.states.len() >= 24, "{}", all.states.len());
    for (i, (observation, state)) in observed.iter().zip(&all.states).enumerate() {
        assert_eq!(observation.first, i == 0);
        let [before, now] = observation.steps.as_slice() else {
            panic!("{} moments", observation.steps.len());
        };
        assert_eq!(&now.state_values, state, "row {i}");
        let earlier = &all.states[i.saturating_sub(1)];
        assert_eq!(&before.state_values, earlier, "row {i}");
        for image in &now.images {
            let (camera, at) = recording
                .observed(&image.camera, all.rows[i])
                .expect("an image");
            let rgb = camera.rgb(&recording.episode, at).expect("an image");
            assert!(image.color == rgb, "{} of row {i}", image.camera);
            let has_depth = image.camera == "gen3" && sensors.is_empty();
            let depth: Vec<u8> = match has_depth {
                true => {
                    let depth = camera.depth(&recording.episode, at).expect("an image");
                    depth
                        .iter()
                        .flat_map(|metres| metres.to_le_bytes())
                        .collect()
                }
                false => Vec::new(),
            };
            assert!(image.depth == depth, "depth of {} of row {i}", image.camera);
        }
    }
    // The robot moved, and the export contains the policy's rows.
    let row = &all.actions[10];
    assert!(
        (row[10] - 0.2).abs() < 0.05 && (row[11] - 0.3).abs() < 0.05,
        "{row:?}"
    );
}

fn evaluate(out: &Path, policy: &str, more: &[&str]) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(["evaluate", "--task", "pick_bowl", "--policy", policy])
        .args(["--no-grid", "--out"])
        .arg(out)
        .args(more)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process")
}

fn entries(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("episodes.jsonl")).unwrap_or_default();
    text.lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect()
}

/// The test policy, which behaves in episode `k` as word `k` of `how` states.
fn test_policy(how: &str) -> String {
    let path = program("wheelarm-test-policy").expect("the policy");
    format!("exec:{} {how}", path.display())
}

#[test]
fn failing_policy_costs_only_the_episode_of_the_failure() {
    let wrongs = [
        ("well", "the task failed: timeout"),
        ("shape", "rows of 12"),
        ("nan", "number 5 of the row is NaN"),
        ("huge", "1000000000"),
        ("words", "it is dark here"),
        ("keys", "a chunk for episode"),
        ("dies", "the network is on fire"),
        ("silent", "did not reply to `infer` within 2 s"),
        ("well", "the task failed: timeout"),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    let policy = test_policy(&wrongs.map(|(how, _)| how).join(" "));
    let more = ["--seeds", "0..9", "--jobs", "3", "--policy-patience", "2"];
    let output = evaluate(folder.path(), &policy, &more);
    let text = printed(&output);
    assert_eq!(output.status.code(), Some(3), "{text}");
    let mut all = entries(folder.path());
    all.sort_by_key(|entry| entry["seed"].as_u64());
    assert_eq!(all.len(), wrongs.len(), "{text}");
    for (entry, (how, words)) in all.iter().zip(wrongs) {
        let why = entry["why"].as_str().unwrap_or_default();
        assert!(why.contains(words), "{how}: {why}");
        let broken = if how == "well" {
            Value::Null
        } else {
            "policy".into()
        };
        assert_eq!(entry["broken"], broken, "{how}: {entry}");
        assert_eq!(entry["policy"], "test");
    }
    assert!(text.contains("broken: 7"), "{text}");
}

#[test]
fn unavailable_policy_is_reported_before_the_first_episode() {
    let folder = tempfile::tempdir().expect("a folder");
    for (policy, words) in [
        (test_policy("unfit"), "divide 60"),
        (test_policy("crash"), "weights.safetensors"),
        ("exec:/no/such/program".to_owned(), "/no/such/program"),
        (
            "act:/no/such/file".to_owned(),
            "/no/such/file does not exist",
        ),
        (
            format!("replay:{}", folder.path().display()),
            "contains no recordings",
        ),
        ("zenoh:anna".to_owned(), "no server replies"),
    ] {
        let output = evaluate(folder.path(), &policy, &["--seeds", "0..1"]);
        let text = printed(&output);
        assert_eq!(output.status.code(), Some(1), "{policy}: {text}");
        assert!(text.contains(words), "{policy}: {text}");
        assert!(entries(folder.path()).is_empty());
    }
}

#[test]
fn deterministic_evaluation_gives_equal_hashes_for_any_number_of_jobs() {
    let policy = test_policy("sways sways sways sways");
    let hashes = |jobs: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let more = ["--seeds", "0..4", "--jobs", jobs, "--deterministic"];
        let text = printed(&evaluate(folder.path(), &policy, &more));
        let mut all = entries(folder.path());
        all.sort_by_key(|entry| entry["seed"].as_u64());
        let why = all
            .iter()
            .map(|entry| entry["why"].as_str().unwrap_or_default());
        assert_eq!(
            why.filter(|why| why.contains("far enough")).count(),
            4,
            "{text}"
        );
        let hashes = all
            .iter()
            .map(|entry| entry["hash"].as_str().unwrap_or_default());
        hashes.map(str::to_owned).collect::<Vec<_>>()
    };
    let (one, four) = (hashes("1"), hashes("4"));
    let known: std::collections::BTreeSet<&String> = one.iter().collect();
    assert!(
        known.len() == 4 && !known.contains(&String::new()),
        "{one:?}"
    );
    assert_eq!(one, four);
}
