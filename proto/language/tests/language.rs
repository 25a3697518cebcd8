//! The grammar in `assets/language` against scenes by the ranges of `assets/areas`.

#[expect(dead_code, reason = "the law and the examples need more of it")]
mod made_up;

use std::collections::BTreeSet;

use made_up::{TestRandom, grammar, home, scene};
use wheelarm_language::{
    Answer, Grammar, Meaning, Options, Parser, Split, Verb, generate, normalised,
};

#[test]
fn generated_sentences_have_the_intended_meaning() {
    let (grammar, home) = (grammar(), home());
    let options = [
        Options::default(),
        Options {
            typos: 1.0,
            ..Options::default()
        },
        Options {
            split: Split::Train,
            ..Options::default()
        },
        Options {
            split: Split::HeldOut,
            ..Options::default()
        },
        Options {
            ambiguous: 1.0,
            ..Options::default()
        },
    ];
    let (mut total, mut ambiguous) = (0, 0);
    for seed in 0..40 {
        let scene = scene(&home, seed);
        let parser = Parser::new(&grammar, &scene);
        for (n, wish) in made_up::wishes(&scene).iter().enumerate() {
            let option = &options[(seed as usize + n) % options.len()];
            let sentence = generate(&grammar, &scene, wish, option, seed, "test")
                .unwrap_or_else(|| panic!("no sentence for {wish:?} with {option:?}"));
            total += 1;
            match parser.parse(&sentence.text) {
                Answer::Clear(meaning) => {
                    assert!(!sentence.is_ambiguous(), "{}", sentence.text);
                    assert_eq!(meaning, *wish, "{}", sentence.text);
                }
                Answer::Ambiguous { meanings, question } => {
                    ambiguous += 1;
                    assert!(meanings.contains(wish), "{}", sentence.text);
                    assert_eq!(question, sentence.question);
                }
                other => panic!("{:?}: {other:?}", sentence.text),
            }
            let held_out = grammar.is_held_out(&sentence.template);
            match option.split {
                Split::Train => assert!(!held_out, "{}", sentence.template),
                Split::HeldOut => assert!(held_out, "{}", sentence.template),
                Split::Any => {}
            }
        }
    }
    assert!(
        total > 500 && ambiguous > 20,
        "{total} sentences, {ambiguous} ambiguous"
    );
}

#[test]
fn only_the_same_seed_gives_the_same_sentence() {
    let (grammar, home) = (grammar(), home());
    let scene = scene(&home, 3);
    let wish = made_up::wishes(&scene)[0];
    let of = |seed| {
        generate(&grammar, &scene, &wish, &Options::default(), seed, "x")
            .unwrap()
            .text
    };
    assert_eq!(of(1), of(1));
    let different: BTreeSet<String> = (0..50).map(of).collect();
    assert!(different.len() > 40, "{}", different.len());
}

#[test]
fn the_grammar_has_its_documented_size() {
    let grammar = grammar();
    let (templates, held_out) = grammar.template_count();
    assert!(
        templates >= 150 && 5 * held_out >= templates,
        "{templates}, {held_out}"
    );
    let (nouns, held_out) = grammar.noun_count();
    assert!(5 * held_out >= nouns, "{nouns}, {held_out}");
}

#[test]
fn names_of_the_splits_are_disjoint() {
    let (grammar, home) = (grammar(), home());
    let mut by_split = [Split::Train, Split::HeldOut].map(|split| {
        let mut all = BTreeSet::new();
        for seed in 0..60 {
            let scene = scene(&home, seed);
            let wish = scene.named("mustard").unwrap();
            let wish = Meaning {
                verb: Verb::Lift,
                target: wish,
                goal: None,
            };
            let options = Options {
                split,
                politeness: 0.0,
                ..Options::default()
            };
            all.insert(normalised(
                &generate(&grammar, &scene, &wish, &options, seed, "x")
                    .unwrap()
                    .text,
            ));
        }
        all
    });
    let [train, held_out] = &mut by_split;
    assert!(train.is_disjoint(held_out));
    let held = |text: &String| {
        ["condiment bottle", "sauce bottle", "seasoning bottle"]
            .iter()
            .any(|n| text.contains(n))
    };
    assert!(held_out.iter().all(held), "{held_out:?}");
    assert!(!train.iter().any(held));
}

/// Tasks of the library and their targets.
#[test]
fn the_sentences_of_the_tasks_are_understood() {
    let (grammar, home) = (grammar(), home());
    let mut count = 0;
    for ((task, sentences), own) in made_up::tasks().into_iter().zip(made_up::library()) {
        let scene = own.scene(&home, 5);
        let parser = Parser::new(&grammar, &scene);
        let (verb, object) = task.split_once('_').unwrap();
        let verb = match verb {
            "pick" | "select" | "take" => Verb::Lift,
            "place" | "throw" => Verb::Put,
            "open" => Verb::Open,
            "serve" if object == "remote" => Verb::Give,
            "serve" => Verb::Bring,
            _ => Verb::Close,
        };
        let object = match object.trim_start_matches("floor_") {
            "drink" => "straw_cup",
            "spoonful" => "feeding_spoon",
            "remote" => "remote_control",
            other => other,
        };
        for sentence in sentences {
            count += 1;
            let numbered = object == "coke" || object == "drawer";
            let sentence = ["{from_left}", "{from_right}"]
                .iter()
                .fold(sentence, |s, key| s.replace(key, "second"));
            let by_height = ["top drawer", "second drawer from the top", "bottom drawer"];
            let sentence = sentence.replace("{by_height}", by_height[count % 3]);
            let Answer::Clear(meaning) = parser.parse(&sentence) else {
                panic!("{task}: {sentence:?} is {:?}", parser.parse(&sentence));
            };
            assert_eq!(meaning.verb, verb, "{sentence}");
            let name = &scene.entities[meaning.target].name;
            match numbered {
                true => assert!(name.starts_with(object), "{sentence}: {name}"),
                false => assert_eq!(name, object, "{sentence}"),
            }
            let goal = meaning.goal.map(|i| scene.entities[i].name.as_str());
            let expected = match object {
                "knife" => Some("placemat"),
                "teddy_bear" => Some("bear_cushion"),
                _ if task.starts_with("throw_") => Some("table_bin"),
                _ => None,
            };
            assert_eq!(goal, expected, "{sentence}");
        }
    }
    assert!(count >= 70, "{count}");
}

/// Hand-written: the meaning in the scene of [`made_up::fixed`], or the question.
#[test]
fn fifty_hand_written_sentences_are_understood() {
    let (grammar, home) = (grammar(), home());
    let scene = made_up::fixed(&home);
    let parser = Parser::new(&grammar, &scene);
    let mut wrong = Vec::new();
    for line in include_str!("by_hand.txt")
        .lines()
        .filter(|l| !l.starts_with('#') && !l.is_empty())
    {
        let (sentence, expected) = line.split_once(" => ").expect("sentence => meaning");
        let name = |i: usize| scene.entities[i].name.clone();
        let found = match parser.parse(sentence) {
            Answer::Clear(m) => {
                let goal = m.goal.map_or(String::new(), |i| format!(" {}", name(i)));
                format!("{} {}{goal}", m.verb.word(), name(m.target))
            }
            Answer::Ambiguous { question, .. } => question,
            Answer::Nothing => "nothing".to_owned(),
            Answer::Unknown => "unknown".to_owned(),
        };
        if found != expected {
            wrong.push(format!(
                "{sentence}\n  found {found}\n  expected {expected}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn errors_in_a_file_include_line_key_value_and_allowed_values() {
    for (file, from, to, line, key, allowed) in [
        (
            "phrases.toml",
            "means = \"left_of\"",
            "means = \"left_off\"",
            0,
            "means",
            "left_of",
        ),
        (
            "lift.toml",
            "\"pick up {object}\", ",
            "\"pick up {objekt}\", ",
            0,
            "texts",
            "{object}",
        ),
        (
            "lift.toml",
            "split = \"held_out\"",
            "split = \"held\"",
            0,
            "split",
            "held_out",
        ),
        (
            "nouns.toml",
            "[[noun]]\nof = [\"mustard\"]",
            "[[noun]]\nuff = [\"mustard\"]",
            1,
            "uff",
            "texts",
        ),
        (
            "reasons.toml",
            "of = [\"mustard\"]",
            "of = [\"mostard\"]",
            0,
            "of",
            "mustard",
        ),
        (
            "put.toml",
            "\"put {object} {at_goal}\", ",
            "\"put {object} away\", ",
            0,
            "texts",
            "{goal}",
        ),
        (
            "places.toml",
            "where = [\"on\"]",
            "where = []",
            0,
            "where",
            "single words",
        ),
    ] {
        let changed = |name: &str| {
            let text = made_up::text(&format!("language/{name}"));
            Some(if name == file {
                assert!(text.contains(from), "{file} has no {from}");
                text.replacen(from, to, 1)
            } else {
                text
            })
        };
        let error = Grammar::read(&changed).unwrap_err();
        assert_eq!(
            (error.file.as_str(), error.key.as_str()),
            (file, key),
            "{error}"
        );
        let text = made_up::text(&format!("language/{file}"));
        let before = text.split(from).next().expect("the text before it");
        let expected = 1 + before.matches('\n').count() + line;
        assert_eq!(error.line, expected, "{error}");
        assert!(error.allowed.contains(allowed), "{error}");
        assert!(!error.found.is_empty(), "{error}");
    }
    let none = Grammar::read(&|name| {
        (name != "put.toml").then(|| made_up::text(&format!("language/{name}")))
    });
    assert!(none.unwrap_err().to_string().contains("put.toml"));
}

#[test]
fn random_numbers_differ_and_stay_in_range() {
    let mut draws = TestRandom::from_seed(1);
    let first: Vec<f64> = (0..3).map(|_| draws.fraction()).collect();
    assert!(first.iter().all(|f| (0.0..1.0).contains(f)) && first[0] != first[1]);
}
