//! Tests of tasks without an area, in the home of the assets, the flat and the kitchenette.

use std::sync::Arc;

use wheelarm_language::{Answer, Parser, Verb};
use wheelarm_pack::Pack;

use super::super::sentence::{grammar_of, language_scene};
use super::super::task_sampling;
use super::*;
use crate::scene::{Placement, SceneError, names};

const HOME_TASKS: [&str; 4] = [
    "carry_to_living_room",
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
    assert_eq!(listed(&home()), HOME_TASKS);
    assert_eq!(listed(&flat()), HOME_TASKS[1..]);
}

/// Sentences of task files, and those of the grammar, name the place so that the parser finds
/// the same target.
#[test]
fn sentences_about_every_home_parse_to_their_target() {
    let mut named = 0;
    let mut odd = flat();
    odd.places[0].room = "Salle_de_jeux".into();
    for (scene, tasks) in [
        (home(), &HOME_TASKS[..]),
        (flat(), &HOME_TASKS[1..]),
        (odd, &HOME_TASKS[1..3]),
    ] {
        for name in tasks {
            for seed in 0..6 {
                let (task, _, mut scene, sample) = sampled(name, &scene, seed);
                let placements: Vec<Option<Placement>> = sample.scene.placements;
                let mut present = placements.iter().map(Option::is_some);
                scene.objects.retain(|_| present.next().unwrap_or(false));
                let placements: Vec<Placement> = placements.into_iter().flatten().collect();
                let described = language_scene(&scene, &placements, &task);
                let grammar = grammar_of(&assets()).unwrap().for_scene(&described);
                let parser = Parser::new(&grammar, &described);
                let target = described.named(&sample.target);
                let mut texts = task.instructions.clone();
                let language = Language {
                    seed,
                    split: wheelarm_proto::settings::LanguageSplit::Any,
                    typo_share: 0.0,
                    politeness_share: 0.5,
                    ambiguous_share: 0.0,
                    template: String::new(),
                    question: String::new(),
                };
                let about = (&task, sample.target.as_str());
                let made = sentence(&assets(), about, &scene, &placements, seed, &language);
                let made = made.unwrap().expect("a sentence").text;
                named += usize::from(made.contains("in the kitchen") || made.contains("Salle"));
                texts.push(made);
                for text in texts {
                    let Answer::Clear(meaning) = parser.parse(&text) else {
                        panic!("{}: {text:?}: {:?}", scene.name, parser.parse(&text));
                    };
                    assert_eq!(Some(meaning.target), target, "{text}");
                    let verb = match task.goal {
                        Goal::Put { .. } => Verb::Put,
                        _ => Verb::Lift,
                    };
                    assert_eq!(meaning.verb, verb, "{text}");
                }
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
