//! Every task of the library, completed by the expert.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Output;

use nalgebra::{Isometry3, Point3, Rotation3, Vector3};
use serde_json::Value;
use wheelarm_proto::settings::LanguageSplit;
use wheelarm_server::sensors::camera::{
    Binding, CameraSpec, Intrinsics, Quality, RenderScene, Renderer,
};
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_server::tasks::{Language, POLITENESS};
use wheelarm_tests::{TASKS, printed, program, root, wheelarm};

use super::hashes;

/// The tested seed.
const SEED: &str = "1..2";

/// Tasks whose recordings are replayed: a lift, a drawer, the soft bear and a person who is
/// served.
const REPLAYED: [&str; 4] = [
    "pick_mustard",
    "open_drawer",
    "place_teddy_bear",
    "serve_drink",
];

fn evaluate(out: &Path, more: &[&str]) -> Output {
    let folder = out.to_string_lossy();
    let own = ["evaluate", "--seeds", SEED, "--jobs", "2", "--no-grid"];
    wheelarm(&[&own[..], &["--out", &folder], more].concat())
}

/// The results in a folder, by task.
fn entries(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("episodes.jsonl")).expect("the results");
    let mut entries: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("a JSON object"))
        .collect();
    entries.sort_by_key(|entry| entry["task"].to_string());
    entries
}

fn files(out: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(out)
        .expect("the folder")
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "h5"))
        .collect()
}

#[test]
fn expert_completes_every_task_with_the_stored_hashes_and_recordings_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("all");
    let small = ["--record", "--camera", "wheelchair=64x48@1"];
    let output = evaluate(&out, &small);
    assert!(output.status.success(), "{}", printed(&output));
    let done = entries(&out);
    let names: Vec<_> = done.iter().filter_map(|e| e["task"].as_str()).collect();
    assert_eq!(names, TASKS);
    for entry in &done {
        assert_eq!(entry["success"], true, "{entry}");
    }
    let hash = |entry: &Value| entry["hash"].as_str().expect("a hash").to_owned();
    let hashes: BTreeMap<_, _> = TASKS
        .map(str::to_owned)
        .into_iter()
        .zip(done.iter().map(hash))
        .collect();
    // The stored hashes are those of episodes without recorder and cameras.
    assert_eq!(hashes, hashes::of_seed("1"));
    let recorded = files(&out);
    assert_eq!(recorded.len(), TASKS.len(), "{recorded:?}");
    for task in REPLAYED {
        let file = out.join(format!("{task}-seed1.h5"));
        let replay = wheelarm(&["replay", &file.to_string_lossy()]);
        let text = printed(&replay);
        assert!(replay.status.success(), "{task}: {text}");
        assert!(text.contains("hashes equal"), "{task}: {text}");
    }

    // A second run repeats no completed episode.
    let output = evaluate(&out, &small);
    assert!(output.status.success(), "{}", printed(&output));
    let text = printed(&output);
    assert!(text.contains("19 of 19 episodes are in"), "{text}");
}

/// The first images must not reveal the task.
#[test]
fn tasks_of_an_area_begin_with_equal_images() {
    let assets = root().join("assets");
    let first_images = |task: &str, seed: u64| {
        let scenario = Scenario {
            task: task.to_owned(),
            seed,
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let sim = Simulation::new(&assets, scenario).expect("a simulation");
        let mut cameras = CameraSpec::all(sim.model(), sim.scene(), [160, 90]).expect("cameras");
        // The robot's cameras do not face the table at the start: add one above it.
        let eye = Point3::new(-8.3, 1.9, 1.6);
        let down = Rotation3::face_towards(&(Point3::new(-9.0, 1.9, 0.5) - eye), &-Vector3::z());
        cameras.push(CameraSpec {
            name: "above".into(),
            binding: Binding::World,
            mount: Isometry3::from_parts(eye.coords.into(), down.into()),
            intrinsics: Intrinsics::centred([160, 90], 1.2),
            range: [0.05, 100.0],
        });
        let scene = RenderScene::new(sim.model(), sim.scene(), &assets).expect("a scene");
        let mut renderer =
            Renderer::new(&scene, &cameras, Quality::Fast, None).expect("a renderer");
        let all: Vec<usize> = (0..cameras.len()).collect();
        let frames = renderer.render(sim.snapshot(), &all).expect("images");
        let frames = frames.into_iter();
        frames
            .map(|frame| (frame.rgb, frame.depth))
            .collect::<Vec<_>>()
    };
    let mustard = first_images("pick_mustard", 9000);
    assert!(
        mustard == first_images("pick_crackers", 9000),
        "other images"
    );
    assert!(
        mustard != first_images("pick_crackers", 9001),
        "equal images for another seed"
    );
}

/// `--sentences` prints the instructions of episodes with the same seeds.
#[test]
fn sentences_are_printed_without_an_episode() {
    let printed_by = |args: &[&str]| {
        let mut command = std::process::Command::new(program("wheelarm-server").unwrap());
        let assets = root().join("assets");
        let output = command.args(args).arg("--assets").arg(assets).output();
        output.expect("a process")
    };
    let sentences = |split: &str| -> Vec<Value> {
        let task = ["--task", "select_coke", "--sentences", "500..502"];
        let output = printed_by(&[&task[..], &["--each", "2", "--language-split", split]].concat());
        assert!(output.status.success(), "{}", printed(&output));
        let text = String::from_utf8(output.stdout).expect("text");
        let lines = text.lines().map(serde_json::from_str);
        lines.collect::<Result<_, _>>().expect("JSON")
    };
    let train = sentences("train");
    assert_eq!(train.len(), 4);
    for (place, line) in train.iter().enumerate() {
        let (seed, sentence) = (500 + place as u64 / 2, place as u64 % 2);
        let scenario = Scenario {
            task: "select_coke".to_owned(),
            seed,
            cameras: Vec::new(),
            language: Some(Language {
                seed: sentence,
                split: LanguageSplit::Train,
                typo_share: 0.0,
                politeness_share: POLITENESS,
                ambiguous_share: 0.0,
                template: String::new(),
                question: String::new(),
            }),
            ..Scenario::default()
        };
        let sim = Simulation::new(&root().join("assets"), scenario).expect("a simulation");
        assert_eq!(line["seed"], seed);
        assert_eq!(line["target"], sim.scenario().target.as_str());
        assert_eq!(line["instruction"], sim.scenario().instruction.as_str());
    }
    assert_ne!(train[0]["instruction"], train[1]["instruction"]);
    let held_out = sentences("held_out");
    assert_eq!(held_out[0]["target"], train[0]["target"]);
    assert_ne!(held_out[0]["instruction"], train[0]["instruction"]);

    let none = printed_by(&["--task", "", "--sentences", "0..1"]);
    let words = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(
        !none.status.success() && words.contains("--task"),
        "{words}"
    );
}
