//! Tests of words for objects of packs: categories, their own nouns, colors, sizes.

use std::collections::BTreeSet;

use serde::Deserialize;

use crate::parse::{Answer, Parser};
use crate::{Area, Grammar, Meaning, Options, Role, Scene, Split, Verb, generate, made_up};

#[derive(Deserialize)]
struct Categories {
    category: Vec<Category>,
}

#[derive(Deserialize)]
struct Category {
    name: String,
    words: Vec<String>,
}

fn categories() -> Vec<Category> {
    let read: Categories = toml::from_str(&made_up::text("categories.toml")).expect("categories");
    read.category
}

fn table(name: &str, x: f64, room: &str) -> Area {
    Area {
        name: format!("{name}/top"),
        edge: [x, 0.0, 0.7],
        depth: 0.8,
        width: 1.2,
        kind: "table".into(),
        room: room.into(),
        furniture: name.into(),
        ..Area::default()
    }
}

/// Objects of packs on a table in the kitchen: name, category, color, own noun, largest extent.
type Objects<'a> = &'a [(&'a str, [&'a str; 2], &'a str, f64)];

fn kitchen(objects: Objects<'_>) -> Scene {
    let mut scene = Scene {
        areas: vec![table("table_1", 0.0, "kitchen")],
        entities: Vec::new(),
    };
    for (i, (name, words, noun, size)) in objects.iter().enumerate() {
        let at = [0.3, 0.45 - 0.15 * i as f64, 0.7];
        scene.add(name, *words, Role::Object, at, None);
        scene.describe(noun, *size);
    }
    scene
}

fn lift(scene: &Scene, target: &str) -> Meaning {
    Meaning {
        verb: Verb::Lift,
        target: scene.named(target).expect("an object"),
        goal: None,
    }
}

#[test]
fn every_category_of_objects_has_words_for_training_and_held_out_ones() {
    let grammar = made_up::grammar();
    let without: Vec<String> = categories()
        .into_iter()
        .filter(|category| {
            let (train, held_out) = grammar.category_name_count(&category.name);
            train == 0 || held_out == 0
        })
        .map(|category| category.name)
        .collect();
    assert!(
        without.is_empty(),
        "categories without words: {}; add a [[noun]] for training and one with split = \"held_out\" to assets/language/categories.toml",
        without.join(", ")
    );
}

#[test]
fn sentences_about_every_category_are_understood_in_both_splits() {
    let grammar = made_up::grammar();
    let mut sentences = BTreeSet::new();
    for category in categories() {
        let own = (&*category.name, &*category.words[0]);
        let other = if own.0 == "mug" { "can" } else { "mug" };
        let scene = kitchen(&[
            ("probe-a", [own.0, "red"], own.1, 0.10),
            ("probe-b", [own.0, "blue"], own.1, 0.16),
            ("probe-c", [other, "white"], other, 0.10),
        ]);
        let grammar = grammar.for_scene(&scene);
        let parser = Parser::new(&grammar, &scene);
        for split in [Split::Train, Split::HeldOut] {
            let options = Options {
                split,
                ..Options::default()
            };
            for (seed, target) in [(0, "probe-a"), (1, "probe-b"), (2, "probe-a")] {
                let wish = lift(&scene, target);
                let sentence = generate(&grammar, &scene, &wish, &options, seed, own.0);
                let text = sentence.expect(own.0).text;
                assert_eq!(parser.parse(&text), Answer::Clear(wish), "{text}");
                sentences.insert(text);
            }
        }
    }
    assert!(sentences.len() > 150, "{}", sentences.len());
}

#[test]
fn object_is_named_by_its_noun_color_and_size() {
    let scene = kitchen(&[
        (
            "pill_organiser-white",
            ["organiser", "white"],
            "pill organiser",
            0.10,
        ),
        (
            "pill_organiser-blue",
            ["organiser", "blue"],
            "pill organiser",
            0.20,
        ),
        (
            "water_bottle-blue",
            ["bottle", "blue"],
            "water bottle",
            0.22,
        ),
    ]);
    let grammar = made_up::grammar().for_scene(&scene);
    let parser = Parser::new(&grammar, &scene);
    for (text, target) in [
        ("Take the white pill organiser", "pill_organiser-white"),
        ("Take the smaller pill organiser", "pill_organiser-white"),
        ("Take the largest organiser", "pill_organiser-blue"),
        (
            "Pick up the bottle from the kitchen table",
            "water_bottle-blue",
        ),
        (
            "Take the blue water bottle from the table in the kitchen",
            "water_bottle-blue",
        ),
    ] {
        let wish = lift(&scene, target);
        assert_eq!(parser.parse(text), Answer::Clear(wish), "{text}");
    }
    let answer = parser.parse("Take the pill organiser");
    assert!(matches!(answer, Answer::Ambiguous { .. }), "{answer:?}");
    let by_size = (0..400).any(|seed| {
        let wish = lift(&scene, "pill_organiser-blue");
        let sentence = generate(&grammar, &scene, &wish, &Options::default(), seed, "size");
        let text = sentence.expect("a sentence").text;
        ["larger", "largest", "bigger", "biggest"]
            .iter()
            .any(|word| text.contains(word))
    });
    assert!(by_size);
}

#[test]
fn sizes_that_are_alike_or_unknown_distinguish_nothing() {
    for sizes in [[0.10, 0.12], [0.0, 0.2]] {
        let scene = kitchen(&[
            ("cup-a", ["cup", "white"], "cup", sizes[0]),
            ("cup-b", ["cup", "white"], "cup", sizes[1]),
        ]);
        let grammar = made_up::grammar().for_scene(&scene);
        let answer = Parser::new(&grammar, &scene).parse("Take the largest cup");
        assert!(!matches!(answer, Answer::Clear(_)), "{answer:?}");
    }
}

#[test]
fn known_objects_keep_their_words() {
    let scene = made_up::library()[0].scene(&made_up::home(), 1);
    let grammar = made_up::grammar();
    assert_eq!(grammar.for_scene(&scene), grammar);
    // An unknown category is its own word.
    let scene = kitchen(&[("widget-1", ["garden_tool", ""], "", 0.0)]);
    let grammar: Grammar = grammar.for_scene(&scene);
    let answer = Parser::new(&grammar, &scene).parse("Take the garden tool");
    assert_eq!(answer, Answer::Clear(lift(&scene, "widget-1")));
}
