//! Tests of whole sentences: politeness, reasons and words for ends.

use crate::grammar::Form;
use crate::parse::{Answer, Parser};
use crate::{Grammar, Meaning, Options, Split, Verb, generate, made_up};

/// Sentences of a task with politeness, in the order of the seeds.
fn sentences(grammar: &Grammar, task: &made_up::Task, seeds: std::ops::Range<u64>) -> Vec<String> {
    let home = made_up::home();
    let options = Options {
        politeness: 1.0,
        ..Options::default()
    };
    let of_seed = |seed| {
        let scene = task.scene(&home, seed);
        let wish = task.wish(&scene, seed);
        let sentence = generate(grammar, &scene, &wish, &options, seed, &task.name);
        sentence.expect("a sentence").text
    };
    seeds.map(of_seed).collect()
}

/// Thanks follow a request; a wish has "please", a statement neither.
#[test]
fn statements_have_no_thanks_and_no_statement_promises_a_handover() {
    let (grammar, home) = (made_up::grammar(), made_up::home());
    let options = Options {
        split: Split::Any,
        politeness: 1.0,
        ..Options::default()
    };
    let mut count = [0; 3];
    for task in made_up::library() {
        for seed in 0..60 {
            let scene = task.scene(&home, seed);
            let wish = task.wish(&scene, seed);
            let sentence =
                generate(&grammar, &scene, &wish, &options, seed, &task.name).expect("a sentence");
            let template = grammar
                .templates
                .iter()
                .find(|t| t.id == sentence.template)
                .expect("a template");
            let has = |words: &str| sentence.text.contains(words);
            match template.form {
                Form::Request => count[0] += 1,
                Form::Wish => {
                    count[1] += 1;
                    assert!(!has("thank") && has(", please"), "{}", sentence.text);
                }
                Form::Statement => {
                    count[2] += 1;
                    assert!(!has("thank") && !has("please"), "{}", sentence.text);
                }
            }
        }
    }
    assert!(count.iter().all(|count| *count > 20), "{count:?}");
}

/// Every form of address with every reason in every order.
#[test]
fn a_form_of_address_is_the_first_word_of_the_utterance() {
    let (grammar, home) = (made_up::grammar(), made_up::home());
    let scene = made_up::fixed(&home);
    let parser = Parser::new(&grammar, &scene);
    let mug = Meaning {
        verb: Verb::Lift,
        target: scene.named("blue_mug").expect("a mug"),
        goal: None,
    };
    let openers: Vec<&str> = grammar
        .before
        .iter()
        .filter(|before| before.opens)
        .map(|before| before.text.as_str())
        .collect();
    assert!(openers.contains(&"robot"), "{openers:?}");
    for opener in &openers {
        for frame in &grammar.frames {
            for (n, reason) in grammar.reasons.iter().enumerate() {
                let text = frame.joined(Some(opener), &reason.text, "lift the mug");
                assert!(text.starts_with(&format!("{opener}, ")), "{text}");
                assert_eq!(text.matches(opener).count(), 1, "{text}");
                if n % 20 == 0 {
                    assert_eq!(parser.parse(&text), Answer::Clear(mug), "{text}");
                }
            }
        }
    }
    let (mut alone, mut before_reason) = (0, 0);
    for task in made_up::library() {
        for text in sentences(&grammar, &task, 0..40) {
            let text = text.to_lowercase();
            for opener in &openers {
                let behind = |mark: &str| text.contains(&format!("{mark} {opener},"));
                let is_late = [".", ",", " so", " because"].into_iter().any(behind);
                assert!(!is_late, "{text}");
                let Some(rest) = text.strip_prefix(&format!("{opener}, ")) else {
                    continue;
                };
                alone += 1;
                let leads = |reason: &str| rest.starts_with(&reason.to_lowercase());
                before_reason += usize::from(grammar.reasons.iter().any(|r| leads(&r.text)));
            }
        }
    }
    assert!(alone > 40 && before_reason > 5, "{alone} {before_reason}");
}

/// Words for the ends of a column.
const UPRIGHT: [&str; 6] = [
    "top",
    "topmost",
    "uppermost",
    "bottom",
    "bottommost",
    "lowest",
];

/// The ends of a column of drawers have words of their own: they are not counted.
/// Objects beside each other have none.
#[test]
fn the_top_and_the_bottom_drawer_are_not_counted() {
    let grammar = made_up::grammar();
    let mut ends = [0; 2];
    for task in made_up::library() {
        if !task.name.ends_with("_drawer") {
            for text in sentences(&grammar, &task, 0..10) {
                let has = |word: &str| text.contains(&format!("the {word} "));
                assert!(!UPRIGHT.iter().any(|word| has(word)), "{text}");
            }
            continue;
        }
        for text in sentences(&grammar, &task, 0..150) {
            for counted in ["first", "fourth", "workstation"] {
                assert!(!text.contains(counted), "{text}");
            }
            ends[0] += usize::from(
                ["the top", "the uppermost"]
                    .iter()
                    .any(|w| text.contains(w)),
            );
            ends[1] += usize::from(
                ["the bottom", "the lowest"]
                    .iter()
                    .any(|w| text.contains(w)),
            );
        }
    }
    assert!(ends.iter().all(|count| *count > 40), "{ends:?}");
}

/// "It" in a reason would mean an object that the request has yet to name.
#[test]
fn no_reason_means_the_object_by_it() {
    for reason in &made_up::grammar().reasons {
        let at = reason.words.iter().rposition(|word| word == "it");
        let is_weather = |at: usize| at == 0 && ["is", "will"].contains(&&*reason.words[1]);
        assert!(at.is_none_or(is_weather), "{}", reason.text);
    }
}
