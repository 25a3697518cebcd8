//! Tests of tasks without an area, in the home of the assets, the flat and the kitchenette.

use std::sync::Arc;

use wheelarm_language::{Answer, Parser, Verb};
use wheelarm_pack::Pack;

use super::super::sentence::{grammar_of, language_scene};
use super::super::task_sampling;
use super::home_words::parsed_sentences;
use super::*;
use crate::scene::{SceneError, names};

const HOME_TASKS: [&str; 8] = [
    "carry_to_living_room",
    "close_any_door",
    "close_any_drawer",
    "open_any_door",
    "open_any_drawer",
    "take_anything",
    "take_from_table",
    "take_mug_in_kitchen",
];

fn flat() -> Scene {
    let folder = assets().join("../tests/data/flat");
    let pack = Pack::open(&folder).unwrap_or_else(|error| panic!("{error}"));
    Scene::from_pack(&assets(), &Arc::new(pack)).unwrap_or_else(|error| panic!("{error}"))
}

/// A task of every home with this seed, in its scene.
fn sampled(name: &str, scene: &Scene, seed: u64) -> (TaskSpec, Variant, Scene, TaskSample) {
    let scene = stocked(&assets(), name, scene.clone()).expect("a stocked home");
    let task = TaskSpec::load(&assets(), name, &scene, &hand()).expect("a task");
    let variant = variant_of(&task, seed, None).expect("a place");
    let (task, variant) = task.settled(variant, &scene, seed, "").expect("a place");
    let sample = task_sampling::sample(&task, &variant, &scene, seed, None);
    (task, variant, scene, sample)
}

fn refusal(name: &str, scene: &Scene) -> String {
    match TaskSpec::load(&assets(), name, scene, &hand()) {
        Ok(_) => panic!("{name} is offered"),
        Err(error @ SceneError::NotOffered { .. }) => error.to_string(),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn target_stands_in_the_reached_strip_with_room_for_the_hand() {
    for (scene, name, seeds) in [
        (flat(), "take_from_table", 0..12),
        (home(), "take_anything", 0..24),
    ] {
        for seed in seeds {
            let (task, variant, scene, sample) = sampled(name, &scene, seed);
            assert!(!task.is_query());
            assert_eq!(task.targets, std::slice::from_ref(&sample.target));
            assert!(sample.scene.clearance >= 0.0, "{name} {seed}");
            let place = scene.place_named(&variant.name).expect("a place");
            let surface = scene.surface_named(&place.furniture, Some(&place.surface));
            let object = scene.object_named(&sample.target).expect("the target");
            let placed = sample.scene.placements[object].expect("it exists");
            let at = (surface.expect("a surface").edge.inverse() * placed.pose).translation;
            let is_in = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
            assert!(
                is_in(at.x, place.inwards) && is_in(at.y, place.along),
                "{at:?}"
            );
            assert!(
                sample.instruction.contains(&place.room_words()),
                "{}",
                sample.instruction
            );
            assert!(!sample.instruction.contains('{'), "{}", sample.instruction);
        }
    }
}

#[test]
fn seeds_select_places_objects_and_clutter() {
    let mut places = std::collections::BTreeSet::new();
    let mut targets = std::collections::BTreeSet::new();
    let mut most = 0;
    for seed in 0..24 {
        let (_, variant, _, sample) = sampled("take_anything", &home(), seed);
        places.insert(variant.name);
        targets.insert(sample.target);
        most = most.max(sample.scene.placements.iter().flatten().count());
    }
    assert_eq!(places.len(), 3, "{places:?}");
    assert!(targets.len() >= 4, "{targets:?}");
    assert!((2..=4).contains(&most), "{most}");
}

#[test]
fn place_of_an_object_does_not_reveal_that_it_is_the_target() {
    let scene = stocked(&assets(), "take_anything", home()).expect("a stocked home");
    let query = TaskSpec::load(&assets(), "take_anything", &scene, &hand()).expect("a task");
    let (mut scenes, mut expected, mut variance, mut nearest) = (0, 0.0, 0.0, 0.0);
    for seed in 0..160 {
        let variant = variant_of(&query, seed, None).expect("a place");
        let settled = query.settled(variant, &scene, seed, "");
        let (task, variant) = settled.expect("a place");
        let sample = task_sampling::sample(&task, &variant, &scene, seed, None);
        if task.rivals.is_empty() {
            continue;
        }
        let place = scene.place_named(&variant.name).expect("a place");
        let surface = scene.surface_named(&place.furniture, Some(&place.surface));
        let edge = surface.expect("a surface").edge.inverse();
        let inwards = |name: &String| {
            let object = scene.object_named(name).expect("an object");
            let placed = sample.scene.placements[object].expect("it exists");
            (edge * placed.pose).translation.x
        };
        let own = inwards(&sample.target);
        nearest += f64::from(task.rivals.iter().all(|rival| inwards(rival) > own));
        let chance = 1.0 / (1 + task.rivals.len()) as f64;
        (scenes, expected) = (scenes + 1, expected + chance);
        variance += chance * (1.0 - chance);
    }
    assert!(scenes > 30, "{scenes}");
    assert!(
        (nearest - expected).abs() < 3.0 * variance.sqrt(),
        "{nearest} of {scenes}, expected {expected}"
    );
}

#[test]
fn named_target_has_the_objects_of_its_sample() {
    let scene = stocked(&assets(), "take_anything", home()).expect("a stocked home");
    let task = TaskSpec::load(&assets(), "take_anything", &scene, &hand()).expect("a task");
    for seed in 0..40 {
        let variant = variant_of(&task, seed, None).expect("a place");
        let (one, places) = task.settled(variant, &scene, seed, "").expect("a place");
        let again = task.settled(variant, &scene, seed, &one.targets[0]);
        let (other, same) = again.expect("its target");
        assert_eq!((&one.rivals, places), (&other.rivals, same), "{seed}");
        for rival in &one.rivals {
            let (other, _) = task.settled(variant, &scene, seed, rival).expect("a rival");
            assert!(other.rivals.contains(&one.targets[0]), "{seed} {rival}");
        }
    }
}

#[test]
fn category_and_room_restrict_target_and_place() {
    for seed in 0..8 {
        let (task, variant, ..) = sampled("take_mug_in_kitchen", &home(), seed);
        assert_eq!(
            (task.targets[0].as_str(), variant.name.as_str()),
            ("blue_mug", "kitchen_table")
        );
    }
}

#[test]
fn put_task_names_the_place_of_its_goal() {
    let (task, variant, _, sample) = sampled("carry_to_living_room", &home(), 0);
    assert_eq!(
        task.goal,
        Goal::Put {
            on: "coffee_table".into()
        }
    );
    assert_eq!(variant.name, "kitchen_table-to-coffee_table");
    assert_eq!(task.region_name(), Some("coffee_table"));
    assert!(
        sample.instruction.contains("in the living room"),
        "{}",
        sample.instruction
    );
}

#[test]
fn refusal_lists_what_the_home_has() {
    let text = refusal("carry_to_living_room", &flat());
    for part in [
        "no other table in a living room",
        "in flat",
        "tables: kitchen",
        "living rooms: none",
    ] {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
    let mut bare = flat();
    bare.places.clear();
    let text = refusal("take_from_table", &bare);
    assert!(text.contains("import the home again"), "{text}");
    let mut other = flat();
    other.places[0].room = "Salle_de_jeux".into();
    other.places[0].kind = "desk".into();
    let text = refusal("take_mug_in_kitchen", &other);
    assert!(text.contains("kitchens: none"), "{text}");
    let text = refusal("take_from_table", &other);
    assert!(text.contains("tables: none"), "{text}");
}

#[test]
fn unsuitable_target_is_rejected_with_the_possible_ones() {
    let scene = stocked(&assets(), "take_from_table", flat()).unwrap();
    let task = TaskSpec::load(&assets(), "take_from_table", &scene, &hand()).unwrap();
    let variant = variant_of(&task, 0, None).unwrap();
    let error = task.settled(variant, &scene, 0, "knife").unwrap_err();
    assert!(error.to_string().contains("blue_mug"), "{error}");
    let (task, _) = task.settled(variant, &scene, 0, "coke").unwrap();
    assert_eq!(task.targets, ["coke"]);
}

#[test]
fn homes_offer_the_tasks_that_they_satisfy() {
    let listed = |scene: &Scene| -> Vec<String> {
        let tasks = usable(&assets(), Some(scene), &hand()).unwrap();
        let queries = tasks.iter().filter(|task| task.is_query());
        queries.map(|task| task.name.clone()).collect()
    };
    assert_eq!(names(&assets(), "home_tasks").unwrap(), HOME_TASKS);
    let without = |left_out: &[&str]| -> Vec<&str> {
        let mut tasks = HOME_TASKS.to_vec();
        tasks.retain(|task| !left_out.contains(task));
        tasks
    };
    let doors = ["close_any_door", "open_any_door"];
    assert_eq!(listed(&home()), without(&doors));
    let of_flat = without(&[&doors[..], &HOME_TASKS[..1]].concat());
    assert_eq!(listed(&flat()), of_flat);
    // A home without places has doors and drawers nevertheless.
    let mut bare = flat();
    bare.places.clear();
    assert_eq!(listed(&bare), ["close_any_drawer", "open_any_drawer"]);
}

#[test]
fn drawer_is_selected_by_seed_and_starts_closed_or_open() {
    let mut targets = std::collections::BTreeSet::new();
    for seed in 0..6 {
        for (name, range) in [
            ("open_any_drawer", [0.0, 1e-9]),
            ("close_any_drawer", [0.15, 0.25]),
        ] {
            let (task, variant, scene, sample) = sampled(name, &home(), seed);
            assert_eq!(variant.name, sample.target, "{name} {seed}");
            let joint = scene.joint_of_furniture(&sample.target).expect("a joint");
            let joint = scene.joint_named(&joint.name).expect("its index");
            let position = sample.scene.positions[joint];
            assert!(
                (range[0]..=range[1]).contains(&position),
                "{name}: {position}"
            );
            let others = sample.scene.positions.iter().enumerate();
            let mut others = others.filter(|(i, _)| *i != joint);
            assert!(
                others.all(|(_, position)| *position == 0.0),
                "{name} {seed}"
            );
            assert_eq!(sample.scene.placements.iter().flatten().count(), 0);
            assert!(
                matches!(task.goal, Goal::Open(_) | Goal::Close(_)),
                "{name}"
            );
            assert!(!sample.instruction.contains('{'), "{}", sample.instruction);
            targets.insert(sample.target);
        }
    }
    assert!(targets.len() >= 3, "{targets:?}");
}

#[test]
fn handle_that_is_not_of_the_variant_is_rejected() {
    let home = home();
    let task = TaskSpec::load(&assets(), "open_any_drawer", &home, &hand()).unwrap();
    let variant = task.variants().next().unwrap();
    let error = task.settled(variant, &home, 0, "drawer_3").unwrap_err();
    assert!(error.to_string().contains("drawer_1"), "{error}");
    let (own, _) = task.settled(variant, &home, 0, "drawer_1").unwrap();
    assert_eq!(own.targets, ["drawer_1"]);
}

#[test]
fn refused_door_lists_the_doors_and_drawers_of_the_home() {
    let text = refusal("open_any_door", &flat());
    for part in [
        "no door of furniture",
        "in flat",
        "drawer of the table in the kitchen",
    ] {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
    // A drawer that ends before the bound cannot be opened far enough, but be closed.
    let mut short = flat();
    short.joints[0].travel = 0.19;
    let offers = |name: &str| TaskSpec::load(&assets(), name, &short, &hand()).is_ok();
    assert!(!offers("open_any_drawer") && offers("close_any_drawer"));
    let mut bare = flat();
    bare.handles.clear();
    let text = refusal("open_any_drawer", &bare);
    assert!(text.contains("imported again"), "{text}");
}

/// Sentences of task files, and those of the grammar, name the place so that the parser finds
/// the same target.
#[test]
fn sentences_about_every_home_parse_to_their_target() {
    let mut named = 0;
    let mut odd = flat();
    odd.places[0].room = "Salle_de_jeux".into();
    for (scene, tasks) in [
        (
            home(),
            &[&HOME_TASKS[..1], &HOME_TASKS[2..3], &HOME_TASKS[4..]].concat()[..],
        ),
        (flat(), &[&HOME_TASKS[2..3], &HOME_TASKS[4..]].concat()[..]),
        (odd, &HOME_TASKS[5..7]),
    ] {
        for name in tasks {
            for seed in 0..4 {
                let (task, _, scene, sample) = sampled(name, &scene, seed);
                let texts = parsed_sentences(&task, &scene, &sample, seed, 1);
                let is_named =
                    |text: &String| text.contains("in the kitchen") || text.contains("Salle");
                named += usize::from(texts.last().is_some_and(is_named));
            }
        }
    }
    assert!(named >= 3, "{named} sentences name a room");
}

#[test]
fn doors_are_named_by_their_furniture() {
    let kitchenette = crate::scene::tests::Copy::new("kitchenette");
    let path = "scenes/kitchenette.toml";
    let text = std::fs::read_to_string(assets().join("../tests/data/kitchenette").join(path));
    kitchenette.write(path, &text.unwrap());
    let kitchenette = Scene::load(&kitchenette.0, "kitchenette").unwrap();
    let task = sampled("take_from_table", &flat(), 0).0;
    for (scene, door, texts) in [
        (
            flat(),
            "door_1",
            [
                "Open the door of the cabinet in the kitchen",
                "Please open the door of the cupboard",
            ],
        ),
        (
            kitchenette,
            "cabinet_door",
            ["Open the door", "Go to the cabinet and open the door"],
        ),
    ] {
        let described = language_scene(&scene, &[], &task);
        let grammar = grammar_of(&assets()).unwrap().for_scene(&described);
        let parser = Parser::new(&grammar, &described);
        for text in texts {
            let answer = parser.parse(text);
            let Answer::Clear(meaning) = answer else {
                panic!("{text:?}: {answer:?}");
            };
            assert_eq!(described.entities[meaning.target].name, door, "{text}");
            assert_eq!(meaning.verb, Verb::Open);
        }
    }
}
