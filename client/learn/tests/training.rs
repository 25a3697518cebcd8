//! The training loop: it reduces the error, continues from a checkpoint with the same bits, and its
//! policy returns the learned actions.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use burn::module::Module;
use safetensors::tensor::{Dtype, TensorView};
use wheelarm_learn::episodes::{self, Episode};
use wheelarm_learn::network::Shape;
use wheelarm_learn::serve::Policy;
use wheelarm_learn::train::act::{ActOptions, ActTask};
use wheelarm_learn::train::{self, Schedule};
use wheelarm_learn::trained::Trained;
use wheelarm_learn::weights::Weights;
use wheelarm_proto::v1;

/// The process has one generator of random numbers: these tests run one at a time.
static GENERATOR: Mutex<()> = Mutex::new(());

fn lock_generator() -> MutexGuard<'static, ()> {
    GENERATOR.lock().unwrap_or_else(PoisonError::into_inner)
}

const ROWS: usize = 24;
const SIDES: [usize; 2] = [18, 40];

/// Writes an episode whose actions follow from the image alone: a moving bar.
fn write(folder: &Path, seed: u64) {
    let [height, width] = SIDES;
    let place = |row: usize| (row + seed as usize) % ROWS;
    let image = |row: usize| -> Vec<u8> {
        let bar = place(row) * (width - 4) / ROWS;
        let pixels = (0..height * width).map(|at| at % width);
        pixels
            .flat_map(|x| match (bar..bar + 4).contains(&x) {
                true => [250, 250, 250],
                false => [20, 30, 40],
            })
            .collect()
    };
    let images: Vec<u8> = (0..ROWS).flat_map(image).collect();
    let numbers = |value: &dyn Fn(usize) -> Vec<f32>| -> Vec<u8> {
        let values = (0..ROWS).flat_map(value);
        values.flat_map(f32::to_le_bytes).collect()
    };
    let states = numbers(&|_| vec![0.3; 3]);
    let phase = |row: usize| place(row) as f32 * std::f32::consts::TAU / ROWS as f32;
    let actions = numbers(&|row| (0..9).map(|k| (phase(row) + k as f32).sin()).collect());
    let names = |what: &str, count: usize| -> Vec<String> {
        (0..count).map(|k| format!("{what}{k}")).collect()
    };
    let about = serde_json::json!({
        "layout": "wheelarm-tensors/1", "label": format!("bar-{seed}"), "instruction": "follow the bar",
        "task": "bar", "seed": seed, "success": seed < 100, "rate_hz": 10, "robot": "none",
        "action": "next-joints", "state_names": names("s", 3), "action_names": names("a", 9),
        "action_units": names("u", 9), "table_names": null,
    });
    let view = |dtype, shape: &[usize], bytes| TensorView::new(dtype, shape.to_vec(), bytes);
    let tensors = [
        ("states", view(Dtype::F32, &[ROWS, 3], &states)),
        ("actions", view(Dtype::F32, &[ROWS, 9], &actions)),
        (
            "pictures.eye",
            view(Dtype::U8, &[ROWS, height, width, 3], &images),
        ),
    ];
    let tensors = tensors.map(|(name, view)| (name, view.expect("a tensor")));
    let metadata = [("wheelarm".to_owned(), about.to_string())].into();
    let bytes = safetensors::serialize(tensors, Some(metadata)).expect("bytes");
    std::fs::write(folder.join(format!("bar-{seed}.safetensors")), bytes).expect("written");
}

fn task(episodes: Vec<Episode>, steps: u64, vae_layers: usize) -> ActTask {
    let shape = Shape {
        chunk: 4,
        width: 4,
        group_channels: 2,
        dim: 32,
        feedforward: 32,
        heads: 2,
        encoder_layers: 1,
        vae_layers,
        latent: 4,
        word_width: 8,
        ..Shape::default()
    };
    let options = ActOptions {
        name: "bar".to_owned(),
        shape,
        execute: 2,
        batch: 8,
        rate: 3e-3,
        warm_up: 10,
        steps,
        divergence: 1.0,
        shift: 0,
        language: true,
        seed: 1,
    };
    let (learned, held) = episodes::split(episodes, 0.3);
    ActTask::new(options, learned, held).expect("a training task")
}

fn schedule(out: &Path, steps: u64) -> Schedule {
    Schedule {
        out: out.to_owned(),
        steps,
        limit: None,
        interval: 20,
        patience: None,
        weight_decay: 1e-4,
        clip: 10.0,
    }
}

#[test]
fn act_learns_actions_from_images_and_its_policy_returns_them() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let data = folder.join("data");
    std::fs::create_dir(&data).expect("a folder");
    for seed in [0, 7, 13, 100] {
        write(&data, seed);
    }
    let episodes = episodes::read(&[data]).expect("episodes");
    assert_eq!(episodes.len(), 3, "one failed");
    let all = episodes.clone();
    let task = task(episodes, 300, 1);
    let out = folder.join("run");
    let (network, progress) =
        train::run(&task, task.network(), &schedule(&out, 300)).expect("a run");
    assert!(progress.is_over && progress.step == 300);
    let [error, held] = task.errors(&network.valid(), &all, 1000);
    println!("L1 {error:.4}, holding {held:.4}, best {:?}", progress.best);
    assert!(error < 0.1 && held > 3.0 * error, "{error}, {held}");
    assert!(
        std::fs::metadata(out.join("curves.png"))
            .expect("curves")
            .len()
            > 1000
    );

    // The best network on the held-out seeds.
    let mut policy = Trained::read(&out.join("policy.safetensors")).expect("a policy");
    assert_eq!(policy.card().validation_seeds.len(), 1);
    let (mut sum, mut count) = (0.0, 0.0_f32);
    for row in 0..ROWS - 4 {
        let observation = v1::PolicyObservation {
            instruction: "follow the bar".to_owned(),
            steps: vec![v1::PolicyStep {
                state_values: vec![0.3; 3],
                images: vec![v1::PolicyImage {
                    camera: "eye".to_owned(),
                    width: SIDES[1] as u32,
                    height: SIDES[0] as u32,
                    color: all[0].image("eye", row).to_vec().into(),
                    ..Default::default()
                }],
            }],
            ..Default::default()
        };
        let reply = policy.infer(&v1::InferRequest {
            observations: vec![observation],
        });
        let wanted = (row..row + 4).flat_map(|row| all[0].actions.row(row).to_vec());
        for (found, wanted) in reply.chunks[0].values.iter().zip(wanted) {
            sum += (found - wanted).abs();
            count += 1.0;
        }
    }
    println!("served: mean error {:.4}", sum / count);
    assert!(sum / count < 0.15, "{}", sum / count);
}

#[test]
fn interrupted_run_ends_with_the_same_bits() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, 0);
    let episodes = episodes::read(&[folder.to_owned()]).expect("episodes");
    let weights = |out: &Path, cuts: bool| {
        let task = task(episodes.clone(), 40, 0);
        if cuts {
            let cut = Schedule {
                limit: Some(Duration::ZERO),
                ..schedule(out, 40)
            };
            for made in 1..=2 {
                let (_, progress) = train::run(&task, task.network(), &cut).expect("a run");
                assert_eq!((progress.step, progress.is_over), (made, false));
            }
        }
        let done = train::run(&task, task.network(), &schedule(out, 40));
        let (network, progress) = done.expect("a run");
        assert_eq!((progress.step, progress.log.len()), (40, 2));
        Weights::of_network(&network.valid())
    };
    let whole = weights(&folder.join("whole"), false);
    let pieces = weights(&folder.join("pieces"), true);
    assert!(whole == pieces, "the same bits");
    // Another network cannot continue from this checkpoint.
    let other = task(episodes.clone(), 40, 1);
    let refused = train::run(
        &other,
        other.network(),
        &schedule(&folder.join("whole"), 80),
    );
    let words = refused.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(words.contains("choose another folder"), "{words}");
}

#[test]
fn run_without_progress_ends() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for seed in [0, 7, 13] {
        write(folder, seed);
    }
    let episodes = episodes::read(&[folder.to_owned()]).expect("episodes");
    let task = task(episodes, 400, 0);
    let stuck = Schedule {
        interval: 1,
        patience: Some(2),
        // A gradient of zero: no progress.
        clip: 0.0,
        weight_decay: 0.0,
        ..schedule(&folder.join("run"), 400)
    };
    let (_, progress) = train::run(&task, task.network(), &stuck).expect("a run");
    assert!(progress.is_over && progress.step < 10, "{}", progress.step);
}
