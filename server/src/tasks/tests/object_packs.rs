//! Tests of the objects of packs as stock of tasks without an area.

use std::collections::BTreeMap;
use std::sync::Arc;

use wheelarm_pack::{Digest, Pack};
use wheelarm_proto::settings::ObjectSplit;

use super::super::task_sampling;
use super::*;
use crate::scene::SceneError;

const JAR: &str = r#"
origin = "drawn for tests"
license = "CC0-1.0"
category = "flask"
colour = "blue"
mass = 0.35
inertia = [0.0004, 0.0004, 0.0002]
friction = 0.5
material = "ceramic_blue"
parts = [{ cylinder = { radius = 0.033, height = 0.10 } }]
grasps = [{ name = "side", point = [0, 0, 0], approach = [1, 0, 0], closing = [0, 1, 0], width = 0.066, symmetric = true }]
"#;
const STOCK: &str = "[stock]\nwords = \"blue flask\"\nheadroom = 0.3\ndepth = 0.2\nyaw_deg = 180\n";

/// A pack with one object.
fn pack(name: &str, object: &str, stock: &str) -> Arc<Pack> {
    let manifest = format!("format = 1\nname = \"{name}\"\nversion = \"1\"\n");
    let files = BTreeMap::from([
        ("pack.toml".to_owned(), manifest.into_bytes()),
        (
            format!("objects/{object}.toml"),
            format!("{JAR}{stock}").into_bytes(),
        ),
    ]);
    Arc::new(Pack::from_files(files).unwrap_or_else(|error| panic!("{error}")))
}

fn home_with(packs: &[Arc<Pack>]) -> Scene {
    let mut scene = home();
    scene.object_packs = packs.to_vec();
    scene
}

fn load(scene: &Scene) -> Result<TaskSpec, SceneError> {
    let scene = stocked(&assets(), "take_anything", scene.clone())?;
    TaskSpec::load(&assets(), "take_anything", &scene, &hand())
}

#[test]
fn object_of_a_pack_is_sampled_and_named() {
    let scene = home_with(&[pack("flasks", "flask", STOCK)]);
    let task = load(&scene).unwrap();
    assert!(
        task.targets.iter().any(|name| name == "flask"),
        "{:?}",
        task.targets
    );
    let scene = stocked(&assets(), "take_anything", scene).unwrap();
    let body = &scene.objects[scene.object_named("flask").unwrap()];
    assert!(body.optional && body.category == "flask");
    let variant = task.variants().next().unwrap();
    let (task, variant) = task.settled(variant, &scene, 3, "flask").unwrap();
    assert_eq!(task.targets, ["flask"]);
    assert!(
        task.instructions[0].contains("blue flask"),
        "{:?}",
        task.instructions
    );
    let sample = task_sampling::sample(&task, &variant, &scene, 3, None);
    let index = scene.object_named("flask").unwrap();
    let placed = sample.scene.placements[index].expect("it exists");
    assert!(
        (placed.mass - 0.35).abs() < 1e-9,
        "its own mass: {}",
        placed.mass
    );
    let texts = scene.packed_texts();
    assert!(texts.iter().any(|text| text.path == "objects/flask.toml"));
    assert!(!scene.files.iter().any(|path| path == "objects/flask.toml"));
}

#[test]
fn scenery_and_objects_without_stock_are_no_targets() {
    for stock in ["", &format!("{STOCK}scenery = true\n")] {
        let task = load(&home_with(&[pack("flasks", "flask", stock)])).unwrap();
        assert!(
            !task.targets.iter().any(|name| name == "flask"),
            "{stock:?}"
        );
    }
}

#[test]
fn held_out_objects_are_targets_of_their_split_alone() {
    let held_out = format!("{STOCK}held_out = true\n");
    let packs = [pack("a", "vial", STOCK), pack("b", "flask", &held_out)];
    let targets = |split| {
        let scene = Scene {
            object_split: split,
            ..home_with(&packs)
        };
        load(&scene).unwrap().targets
    };
    let has = |targets: &[String], name: &str| targets.iter().any(|target| target == name);
    let any = targets(ObjectSplit::Any);
    assert!(has(&any, "vial") && has(&any, "flask"), "{any:?}");
    let train = targets(ObjectSplit::Train);
    assert!(has(&train, "vial") && !has(&train, "flask"), "{train:?}");
    assert_eq!(targets(ObjectSplit::HeldOut), ["flask"]);
}

#[test]
fn equal_names_of_objects_are_an_error_with_the_fix() {
    for (packs, part) in [
        (
            vec![pack("a", "flask", STOCK), pack("b", "flask", STOCK)],
            "pack \"a\"",
        ),
        (vec![pack("a", "blue_mug", STOCK)], "the assets"),
    ] {
        let error = stocked(&assets(), "take_anything", home_with(&packs)).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(part) && message.contains("rename"),
            "{message}"
        );
    }
}

#[test]
fn packs_do_not_change_what_the_assets_sample() {
    let digest: Digest = pack("a", "flask", STOCK).id().physics;
    assert_ne!(digest, pack("a", "flask", "").id().physics);
    let plain = load(&home()).unwrap();
    let with = load(&home_with(&[pack("a", "flask", "")])).unwrap();
    assert_eq!(plain.targets, with.targets);
}
