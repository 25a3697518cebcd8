//! The networks equal PyTorch's, whose outputs `python/reference.py` stored; weights of other
//! networks are rejected.

use std::path::{Path, PathBuf};

use burn::prelude::Device;
use safetensors::SafeTensors;
use wheelarm_learn::network::{Network, Shape};
use wheelarm_learn::trained::Trained;
use wheelarm_learn::weights::{Weights, WeightsFile};
use wheelarm_proto::v1;
use wheelarm_sdk::policy::PolicyService;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// Input and output of PyTorch.
struct Reference {
    observation: v1::PolicyObservation,
    noise: Vec<f32>,
    rows: Vec<f32>,
}

fn reference(name: &str) -> Reference {
    let bytes = std::fs::read(data(&format!("{name}.answers.safetensors"))).expect("a file");
    let (_, header) = SafeTensors::read_metadata(&bytes).expect("a header");
    let sentence = header.metadata().as_ref().expect("metadata")["wheelarm"].clone();
    let file = SafeTensors::deserialize(&bytes).expect("tensors");
    let numbers = |name: &str| -> Vec<f32> {
        let view = file.tensor(name).expect("a tensor");
        let numbers = view.data().chunks_exact(4);
        numbers
            .map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")))
            .collect()
    };
    let images = file.tensor("pictures").expect("images");
    let [_, height, width, _] = images.shape() else {
        panic!("{:?}", images.shape())
    };
    let each = images.data().chunks(height * width * 3);
    let images = ["left", "right"]
        .iter()
        .zip(each)
        .map(|(camera, rgb)| v1::PolicyImage {
            camera: (*camera).to_owned(),
            width: *width as u32,
            height: *height as u32,
            color: rgb.to_vec().into(),
            ..Default::default()
        });
    let step = v1::PolicyStep {
        state_values: numbers("state").into_iter().map(f64::from).collect(),
        images: images.collect(),
    };
    Reference {
        observation: v1::PolicyObservation {
            episode_key: "one".to_owned(),
            seed: 3,
            tick: 240,
            instruction: sentence,
            steps: vec![step],
            ..Default::default()
        },
        noise: numbers("noise"),
        rows: numbers("rows"),
    }
}

fn apart(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
}

/// Damages a step, so that it does not fit.
type Spoil = fn(&mut v1::PolicyStep);

const CASES: [&str; 7] = [
    "act",
    "act-frozen",
    "act-16bit",
    "act-8bit",
    "act-film",
    "act-text",
    "flow",
];

#[test]
fn rows_equal_those_of_pytorch() {
    for name in CASES {
        let policy = Trained::read(&data(&format!("{name}.safetensors"))).expect("a policy");
        let expected = reference(name);
        let rows = policy
            .answer(&expected.observation, &expected.noise)
            .expect("rows");
        let error = apart(&rows, &expected.rows);
        println!("{name}: {error:e}");
        assert!(error < 1e-4, "{name}: {error}");
        // Sentence and image affect the rows, so equality is significant.
        let mut other = expected.observation.clone();
        other.steps[0].images[1].color = vec![90; 41 * 50 * 3].into();
        assert!(
            apart(
                &policy.answer(&other, &expected.noise).expect("rows"),
                &rows
            ) > 1e-3
        );
        if !policy.card().vocabulary.is_empty() {
            let mut other = expected.observation.clone();
            other.instruction = "mug".to_owned();
            assert!(
                apart(
                    &policy.answer(&other, &expected.noise).expect("rows"),
                    &rows
                ) > 1e-3
            );
        }
    }
}

#[test]
fn batch_returns_chunks_in_order_and_a_problem_for_invalid_observations() {
    for name in ["act", "flow"] {
        let mut policy = Trained::read(&data(&format!("{name}.safetensors"))).expect("a policy");
        let expected = reference(name);
        let key = |observation: &v1::PolicyObservation, key: &str| v1::PolicyObservation {
            episode_key: key.to_owned(),
            ..observation.clone()
        };
        let mut all = vec![key(&expected.observation, "good")];
        let spoilt: [(&str, Spoil); 5] = [
            ("state has 4", |m| m.state_values.truncate(4)),
            ("beta is NaN", |m| m.state_values[1] = f64::NAN),
            ("1 images", |m| m.images.truncate(1)),
            ("41x50", |m| {
                (m.images[0].width, m.images[0].height) = (41, 50)
            }),
            ("5 bytes", |m| m.images[1].color = vec![0; 5].into()),
        ];
        for (words, spoil) in spoilt {
            let mut observation = key(&expected.observation, words);
            spoil(&mut observation.steps[0]);
            all.push(observation);
        }
        let mut late = key(&expected.observation, "late");
        late.steps[0].state_values[0] += 1.0;
        all.push(late);
        let mut empty = key(&expected.observation, "no steps");
        empty.steps.clear();
        all.push(empty);
        let reply = policy.infer(&v1::InferRequest { observations: all });
        assert_eq!(reply.chunks.len(), 8);
        for chunk in &reply.chunks {
            let fits = ["good", "late"].contains(&chunk.episode_key.as_str());
            assert_eq!(chunk.values.len(), if fits { 36 } else { 0 });
            assert_eq!(chunk.tick, 240);
            let is_named = fits || chunk.problem.contains(&chunk.episode_key);
            assert!(is_named, "{}: {}", chunk.episode_key, chunk.problem);
        }
        let alone = policy.infer(&v1::InferRequest {
            observations: vec![key(&expected.observation, "good")],
        });
        assert!(apart(&alone.chunks[0].values, &reply.chunks[0].values) < 1e-5);
        assert!(apart(&reply.chunks[0].values, &reply.chunks[6].values) > 1e-3);
    }
}

#[test]
fn spec_equals_the_card() {
    let policy = Trained::read(&data("act.safetensors")).expect("a policy");
    let spec = policy.spec();
    assert_eq!((spec.chunk, spec.execute, spec.rate_hz), (4, 2, 10.0));
    assert_eq!(spec.action(), v1::PolicyAction::NextJoints);
    assert_eq!(spec.weights_sha256.len(), 64);
    let seeds: Vec<_> = spec
        .training_seeds
        .iter()
        .map(|r| (r.first, r.end))
        .collect();
    assert_eq!(seeds, [(1, 4), (9, 10)]);
}

#[test]
fn written_weights_are_read_unchanged() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["act", "act-frozen", "flow"] {
        let file = WeightsFile::read(&data(&format!("{name}.safetensors"))).expect("a file");
        let policy = Trained::read(&data(&format!("{name}.safetensors"))).expect("a policy");
        let shape = policy.card().network.clone();
        let network = file
            .weights
            .clone()
            .into_network(Network::new(&shape, &Device::flex()))
            .expect("fits");
        let path = folder.path().join("again.safetensors");
        Weights::of_network(&network)
            .write(&path, file.card.as_deref())
            .expect("written");
        let again = WeightsFile::read(&path).expect("a file");
        assert_eq!(again.card, file.card);
        let count = again.weights.names().count();
        assert!(count > 60, "{count} tensors");
        for name in again.weights.names() {
            assert_eq!(again.weights.get(name), file.weights.get(name), "{name}");
        }
    }
}

#[test]
fn weights_of_another_network_are_rejected_with_the_tensor() {
    let file = WeightsFile::read(&data("act.safetensors")).expect("a file");
    let shape = Trained::read(&data("act.safetensors"))
        .expect("a policy")
        .card()
        .network
        .clone();
    let refused = |shape: &Shape| {
        let network = Network::new(shape, &Device::flex());
        file.weights
            .clone()
            .into_network(network)
            .unwrap_err()
            .to_string()
    };
    let wider = Shape {
        dim: 32,
        ..shape.clone()
    };
    let error = refused(&wider);
    assert!(
        error.contains("32]") && error.contains("[48, 16]"),
        "{error}"
    );
    let fewer = Shape {
        encoder_layers: 1,
        ..shape.clone()
    };
    let error = refused(&fewer);
    assert!(error.contains("model.encoder.layers.1"), "{error}");
    let more = Shape {
        decoder_layers: 2,
        ..shape
    };
    let error = refused(&more);
    assert!(
        error.contains("model.decoder.layers.1") && error.contains("none"),
        "{error}"
    );
}

#[test]
fn file_that_is_not_a_policy_is_rejected_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bad.safetensors");
    let good = std::fs::read(data("act.safetensors")).expect("a file");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("written");
        format!("{:#}", Trained::read(&path).unwrap_err())
    };
    let error = refused(b"");
    assert!(error.contains("not a safetensors file"), "{error}");
    let error = refused(&good[..good.len() / 2]);
    assert!(error.contains("not a safetensors file"), "{error}");
    let error = refused(&std::fs::read(data("act.answers.safetensors")).expect("a file"));
    assert!(error.contains("U8"), "{error}");
    let weights = WeightsFile::read(&data("act.safetensors"))
        .expect("a file")
        .weights;
    weights.write(&path, None).expect("written");
    let error = format!("{:#}", Trained::read(&path).unwrap_err());
    assert!(error.contains("no model card"), "{error}");
    let text = String::from_utf8_lossy(&good).into_owned();
    for (from, to, words) in [
        (
            "wheelarm-policy/1",
            "wheelarm-policy/9",
            "wheelarm-policy/9",
        ),
        (r#"\"chunk\": 4"#, r#"\"chunk\": 5"#, "5"),
        (r#"\"heads\": 2"#, r#"\"heads\": 3"#, "heads"),
        (r#"\"history\": 1"#, r#"\"history\": 2"#, "history"),
    ] {
        assert!(text.contains(from), "{from}");
        // The length is the same, so that the header stays valid.
        let at = good
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .expect("there");
        let mut bad = good.clone();
        bad[at..at + to.len()].copy_from_slice(to.as_bytes());
        let error = refused(&bad);
        assert!(error.contains(words), "{error}");
    }
}
