//! The paper's baseline on synthetic episodes: a column of the state determines the motion of the
//! chair, which neither naive predictor uses.

use std::path::Path;

use burn::module::Module;
use safetensors::tensor::{Dtype, TensorView};
use wheelarm_learn::baseline::columns::{Trial, split, trial};
use wheelarm_learn::baseline::errors::{errors, extrapolated, repeated, truth};
use wheelarm_learn::baseline::{self, BaselineTask, Kind, RunOptions, TaskOptions};
use wheelarm_learn::episodes::{self, Episode};
use wheelarm_learn::train::{self, Schedule};
use wheelarm_learn::weights::WeightsFile;

const ROWS: usize = 70;
const SIDE: usize = 32;
const OUTPUTS: [&str; 16] = [
    "robot_arm_end_effector_pos_x",
    "robot_arm_end_effector_pos_y",
    "robot_arm_end_effector_pos_z",
    "robot_arm_end_effector_quat_x",
    "robot_arm_end_effector_quat_y",
    "robot_arm_end_effector_quat_z",
    "robot_arm_end_effector_quat_w",
    "wheelchair_pos_x",
    "wheelchair_pos_y",
    "wheelchair_pos_z",
    "wheelchair_quat_x",
    "wheelchair_quat_y",
    "wheelchair_quat_z",
    "wheelchair_quat_w",
    "robotiq_85_left_knuckle_joint_pos",
    "robotiq_85_right_knuckle_joint_pos",
];

/// Writes an episode in which the chair jumps forward and back; the last column is the next
/// direction.
fn write(folder: &Path, seed: u64, first: usize) {
    let mut names: Vec<String> = OUTPUTS.map(str::to_owned).to_vec();
    names.push("direction".to_owned());
    let width = names.len();
    let mut table = Vec::new();
    let mut x = 0.0_f32;
    for row in 0..ROWS {
        let mut values = vec![0.0; width];
        (values[6], values[13]) = (1.0, if row % 2 == 0 { 1.0 } else { -1.0 });
        let mixed = (seed * 7919 + row as u64 * 104_729) % 1009;
        let direction = if mixed.is_multiple_of(2) { 1.0 } else { -1.0 };
        values[7] = x;
        values[16] = direction;
        x += 0.1 * direction;
        if row < first {
            values[16] = f32::NAN;
        }
        table.extend(values.iter().flat_map(|v: &f32| v.to_le_bytes()));
    }
    let bytes = |count: usize| vec![0_u8; count];
    let (states, actions) = (bytes(ROWS * 4 * 2), bytes(ROWS * 4 * 9));
    let images = vec![90_u8; ROWS * SIDE * SIDE * 3];
    let depth: Vec<u8> = (0..ROWS * SIDE * SIDE)
        .flat_map(|i| (1000 + (i % 777) as u16).to_le_bytes())
        .collect();
    let names_of = |count: usize| (0..count).map(|k| format!("n{k}")).collect::<Vec<_>>();
    let about = serde_json::json!({
        "layout": "wheelarm-tensors/1", "label": format!("jump-{seed}"), "instruction": "go to and fro",
        "task": "jump", "seed": seed, "success": true, "rate_hz": 10, "robot": "none",
        "action": "next-joints", "state_names": names_of(2), "action_names": names_of(9),
        "action_units": names_of(9), "table_names": names,
    });
    let view = |dtype, shape: &[usize], bytes| TensorView::new(dtype, shape.to_vec(), bytes);
    let tensors = [
        ("states", view(Dtype::F32, &[ROWS, 2], &states)),
        ("actions", view(Dtype::F32, &[ROWS, 9], &actions)),
        ("table", view(Dtype::F32, &[ROWS, width], &table)),
        (
            "pictures.eye",
            view(Dtype::U8, &[ROWS, SIDE, SIDE, 3], &images),
        ),
        ("depth.eye", view(Dtype::U16, &[ROWS, SIDE, SIDE], &depth)),
    ];
    let tensors = tensors.map(|(name, view)| (name, view.expect("a tensor")));
    let metadata = [("wheelarm".to_owned(), about.to_string())].into();
    let bytes = safetensors::serialize(tensors, Some(metadata)).expect("bytes");
    std::fs::write(folder.join(format!("jump-{seed}.safetensors")), bytes).expect("written");
}

#[test]
fn episodes_that_are_kept_for_tests_are_refused_in_training() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), 10_000, 0);
    let episodes = episodes::read(&[folder.path().to_owned()]).expect("episodes");
    let worlds = episodes::shipped_worlds().expect("the shipped file");
    let checked = |used: serde_json::Value, seed: u64| {
        let mut episode = episodes[0].clone();
        episode.about.seed = seed;
        episode.about.world = Some(serde_json::from_value(used).expect("a world"));
        episodes::check_training(&[episode], &worlds).map_err(|error| error.to_string())
    };
    let known = serde_json::json!({
        "home": "studio-nordic-3", "objects": ["mustard", "phone-black"], "categories": ["phone"],
        "sentences": "train", "appearance_seed": 10_000,
    });
    assert_eq!(checked(known.clone(), 10_000), Ok(()));
    assert_eq!(episodes::check_training(&episodes, &worlds).ok(), Some(()));
    for (key, value, word) in [
        ("home", serde_json::json!("loft-nordic-3"), "loft"),
        ("home", serde_json::json!("studio-modern-3"), "modern"),
        ("style", serde_json::json!("modern"), ""),
        ("objects", serde_json::json!(["vase-white"]), "vase-white"),
        ("categories", serde_json::json!(["clock"]), "clock"),
        ("sentences", serde_json::json!("held_out"), "held-out words"),
        ("sentences", serde_json::json!("any"), "held-out words"),
        ("appearance_seed", serde_json::json!(503), "503"),
    ] {
        let mut used = known.clone();
        used[key] = value;
        let found = checked(used, 10_000);
        match word {
            // The scene names its own style.
            "" => assert_eq!(found, Ok(())),
            word => {
                let error = found.unwrap_err();
                assert!(
                    error.contains(word) && error.contains("jump-10000"),
                    "{error}"
                );
                assert!(error.contains(worlds.hash()), "{error}");
            }
        }
    }
    for seed in [500, 9000, 1_000_699] {
        assert!(checked(known.clone(), seed).is_err(), "{seed}");
    }
    assert_eq!(checked(known, 7), Ok(()));
}

fn made(folder: &Path, seeds: u64) -> Vec<Episode> {
    (0..seeds).for_each(|seed| write(folder, seed, (seed % 3) as usize));
    episodes::read(&[folder.to_owned()]).expect("episodes")
}

#[test]
fn corrected_baseline_learns_from_columns_and_beats_naive_predictors() {
    let folder = tempfile::tempdir().expect("a folder");
    let episodes = made(folder.path(), 12);
    let trials = episodes
        .iter()
        .enumerate()
        .map(|(n, e)| trial(n, e).expect("columns"));
    let trials: Vec<Trial> = trials.collect();
    assert!(trials.iter().all(|t| t.outputs.len() == ROWS - t.first));
    // The chair's quaternion changes its sign in the file only.
    assert!(trials.iter().all(|t| t.outputs.iter().all(|o| o[13] > 0.0)));
    let [learned, held, tests] = split(trials);
    let options = TaskOptions {
        length: 5,
        ahead: vec![1],
        rate: 2e-3,
        fall: 1000,
        ..TaskOptions::of(Kind::CorrectedBlind)
    };
    let task = BaselineTask::new(options, &episodes, None, (&learned, &held), None)
        .expect("a training task");
    let out = folder.path().join("run");
    let schedule = Schedule {
        out: out.clone(),
        steps: 300,
        limit: None,
        interval: 50,
        patience: None,
        weight_decay: 1e-4,
        clip: 1.0,
    };
    train::run(&task, task.network(), &schedule).expect("trained");
    let found = task.predict(&task.best(&out).expect("weights"), &tests);
    let truth = truth(&tests, 5, 1, 1);
    let corrected = errors(&found[0], &truth).mae[7];
    let repeated = errors(&repeated(&tests, 5, 1), &truth).mae[7];
    let on = errors(&extrapolated(&tests, 5, 1, 1), &truth).mae[7];
    assert!((repeated - 0.1).abs() < 1e-4, "{repeated}");
    assert!(
        corrected < 0.5 * repeated.min(on),
        "{corrected} against {repeated} and {on}"
    );
}

#[test]
fn run_writes_every_table_and_a_second_run_repeats_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let episodes = made(folder.path(), 6);
    let options = RunOptions {
        out: folder.path().join("out"),
        length: 20,
        epochs: 1,
        backbone: None,
        vectors: None,
        seed: 0,
    };
    let report = baseline::run(&episodes, &options).expect("a report");
    assert_eq!(report.trials, [4, 1, 1]);
    assert_eq!(report.ahead.len(), 3);
    assert!(report.ahead.iter().all(|a| a.of.len() == 5));
    for file in [
        "table.md",
        "table.csv",
        "table.json",
        "figure-1.png",
        "features.safetensors",
    ] {
        assert!(options.out.join(file).is_file(), "{file}");
    }
    // Networks with images use depth too, the one without does not.
    for (kind, has_depth) in [("as-printed", true), ("corrected--without-images", false)] {
        let path = options.out.join(kind).join("baseline.safetensors");
        let file = WeightsFile::read(&path).expect("weights");
        let layer = file.weights.get("depth.conv1.weight");
        assert_eq!(
            layer.map(|(shape, _)| shape),
            has_depth.then_some(&[16, 1, 5, 5][..])
        );
    }
    // A second run trains nothing and returns the same numbers.
    let again = baseline::run(&episodes, &options).expect("a report");
    let of = |report| baseline::of(report, 10, "corrected").map(|e| e.mae);
    assert_eq!(of(&report), of(&again));
}

#[test]
fn backbone_accepts_weights_of_torchvision_and_rejects_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let episodes = made(folder.path(), 1);
    let path = folder.path().join("resnet18.safetensors");
    let shape = wheelarm_learn::network::Shape {
        norm: wheelarm_learn::network::NormKind::FrozenBatch,
        ..Default::default()
    };
    let network = wheelarm_learn::network::ResNet18::new(&shape, &burn::prelude::Device::flex());
    assert!(network.num_params() > 11_000_000);
    wheelarm_learn::weights::Weights::of_network(&network)
        .write(&path, None)
        .expect("written");
    let cache = folder.path().join("cache.safetensors");
    let features = baseline::features(&episodes, Some(&path), true, &cache).expect("features");
    assert_eq!(features.row(0, 3).len(), 512);
    assert!(features.rows[0].iter().all(|v| v.is_finite()));
    let narrow = wheelarm_learn::network::Shape { width: 16, ..shape };
    let network = wheelarm_learn::network::ResNet18::new(&narrow, &burn::prelude::Device::flex());
    wheelarm_learn::weights::Weights::of_network(&network)
        .write(&path, None)
        .expect("written");
    let problem =
        baseline::features(&episodes, Some(&path), true, &cache).expect_err("another width");
    assert!(problem.to_string().contains("conv1.weight"), "{problem}");
    let nothing = folder.path().join("nothing.pth");
    std::fs::write(&nothing, b"no checkpoint").expect("written");
    let problem =
        baseline::features(&episodes, Some(&nothing), true, &cache).expect_err("not a checkpoint");
    assert!(problem.to_string().contains("torch.save"), "{problem}");
}
