//! Tests of words for the places of homes: rooms, kinds of furniture, doors.

use crate::parse::{Answer, Parser};
use crate::{Area, Grammar, Meaning, Options, Role, Scene, Verb, generate, made_up};

/// A table in the kitchen with a mug, one in a room of unknown kind, and a cabinet in the
/// kitchen with two doors side by side.
fn flat() -> Scene {
    let table = |name: &str, x: f64, room: &str| Area {
        name: format!("{name}/top"),
        edge: [x, 0.0, 0.7],
        depth: 0.8,
        width: 1.2,
        kind: "table".into(),
        room: room.into(),
        furniture: name.into(),
        ..Area::default()
    };
    let mut scene = Scene {
        areas: vec![
            table("table_1", 0.0, "kitchen"),
            table("table_2", 5.0, "Salle_de_jeux"),
            Area {
                name: "cabinet_1/leaves".into(),
                edge: [2.0, 2.0, 0.4],
                kind: "cabinet".into(),
                room: "kitchen".into(),
                has_leaves: true,
                ..Area::default()
            },
        ],
        entities: Vec::new(),
    };
    let mug = ["mug", "blue"];
    scene.add("blue_mug", mug, Role::Object, [0.3, 0.0, 0.7], None);
    scene.add("blue_mug_2", mug, Role::Object, [5.3, 0.0, 0.7], None);
    for (name, left) in [("cabinet_1_door_1", 2.2), ("cabinet_1_door_2", 1.8)] {
        let at = [2.0, left, 0.4];
        let area = Some("cabinet_1/leaves");
        scene.add(name, ["door", ""], Role::Slide, at, area);
    }
    scene
}

fn grammar(scene: &Scene) -> Grammar {
    made_up::grammar().for_scene(scene)
}

#[test]
fn place_is_named_by_furniture_and_room() {
    let scene = flat();
    let grammar = grammar(&scene);
    let parser = Parser::new(&grammar, &scene);
    for (text, verb, target) in [
        (
            "Take the mug from the table in the kitchen",
            Verb::Lift,
            "blue_mug",
        ),
        (
            "Take the mug from the kitchen table",
            Verb::Lift,
            "blue_mug",
        ),
        (
            "Go to the table in the Salle de jeux and pick up the mug",
            Verb::Lift,
            "blue_mug_2",
        ),
        (
            "Open the left door of the cabinet",
            Verb::Open,
            "cabinet_1_door_1",
        ),
        (
            "Please close the right door of the cabinet in the kitchen",
            Verb::Close,
            "cabinet_1_door_2",
        ),
    ] {
        let wish = Meaning {
            verb,
            target: scene.named(target).unwrap(),
            goal: None,
        };
        assert_eq!(parser.parse(text), Answer::Clear(wish), "{text}");
    }
    let answer = parser.parse("Take the mug from the table");
    let Answer::Ambiguous { meanings, question } = answer else {
        panic!("{answer:?}: two tables have a mug");
    };
    assert_eq!(meanings.len(), 2);
    let places = "the one on the table in the kitchen or the one on the table in the Salle de jeux";
    assert!(question.contains(places), "{question}");
}

#[test]
fn generated_sentences_name_rooms_and_sides() {
    let scene = flat();
    let grammar = grammar(&scene);
    let parser = Parser::new(&grammar, &scene);
    for (verb, target, words) in [
        (Verb::Lift, "blue_mug", &["the table in the kitchen"][..]),
        (
            Verb::Lift,
            "blue_mug_2",
            &["the table in the Salle de jeux"],
        ),
        (Verb::Open, "cabinet_1_door_1", &["left"]),
        (Verb::Close, "cabinet_1_door_2", &["right"]),
    ] {
        let wish = Meaning {
            verb,
            target: scene.named(target).unwrap(),
            goal: None,
        };
        for seed in 0..8 {
            let options = Options::default();
            let sentence = generate(&grammar, &scene, &wish, &options, seed, "words");
            let text = sentence.expect("a sentence").text;
            assert_eq!(parser.parse(&text), Answer::Clear(wish), "{text}");
            assert!(words.iter().all(|part| text.contains(part)), "{text}");
        }
    }
}

#[test]
fn goal_is_a_table_of_another_room() {
    let mut scene = flat();
    scene.entities.retain(|entity| entity.name != "blue_mug_2");
    scene.add("table_2", ["", ""], Role::Goal, [5.4, 0.0, 0.7], None);
    let grammar = grammar(&scene);
    let parser = Parser::new(&grammar, &scene);
    let wish = Meaning {
        verb: Verb::Put,
        target: scene.named("blue_mug").unwrap(),
        goal: scene.named("table_2"),
    };
    let text =
        "Take the mug from the table in the kitchen and put it on the table in the Salle de jeux";
    assert_eq!(parser.parse(text), Answer::Clear(wish));
    for seed in 0..8 {
        let sentence = generate(&grammar, &scene, &wish, &Options::default(), seed, "goal");
        let text = sentence.expect("a sentence").text;
        assert_eq!(parser.parse(&text), Answer::Clear(wish), "{text}");
    }
}

#[test]
fn scene_without_kinds_keeps_the_grammar() {
    let scene = made_up::library()[0].scene(&made_up::home(), 1);
    assert_eq!(grammar(&scene), made_up::grammar());
}
