//! Counts sentences, templates and words of the grammar; prints samples.
//!
//!   cargo run --release -p wheelarm-language --example count -- [SCENES] [PER WISH]
//!
//! Sentences are counted in lower case and without punctuation, politeness and typing
//! errors. The output is deterministic. With 60 scenes or more it exits with 1 below
//! 20,000 distinct sentences, 900 words or 150 templates.

#[path = "../tests/made_up/mod.rs"]
#[expect(dead_code, reason = "the tests need more of it")]
mod made_up;

use std::collections::{BTreeMap, BTreeSet};

use wheelarm_language::{Options, Split, generate, normalised};

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    let scenes: u64 = numbers.next().unwrap_or(60);
    let each: u64 = numbers.next().unwrap_or(25);
    let samples: usize = numbers.next().unwrap_or(0) as usize;
    let (grammar, home) = (made_up::grammar(), made_up::home());
    let options = Options {
        politeness: 0.0,
        ..Options::default()
    };
    let (mut total, mut distinct) = (0, BTreeSet::new());
    let mut words: BTreeSet<String> = BTreeSet::new();
    let mut templates = BTreeSet::new();
    let mut by_kind: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for seed in 0..scenes {
        let scene = made_up::scene(&home, seed);
        for wish in made_up::wishes(&scene) {
            let entity = &scene.entities[wish.target];
            for n in 0..each {
                let purpose = format!("{} {}", entity.name, wish.verb.word());
                let sentence =
                    generate(&grammar, &scene, &wish, &options, seed * each + n, &purpose);
                let sentence = sentence
                    .unwrap_or_else(|| panic!("no sentence: {purpose}, scene {seed}, number {n}"));
                total += 1;
                let text = normalised(&sentence.text);
                words.extend(text.split(' ').map(str::to_owned));
                templates.insert(sentence.template);
                distinct.insert(text);
                if n < 5 {
                    let polite = Options {
                        politeness: 0.5,
                        split: Split::Any,
                        ..options
                    };
                    let sentence =
                        generate(&grammar, &scene, &wish, &polite, seed * each + n, &purpose);
                    let key = format!("{} {}", wish.verb.word(), entity.kind);
                    by_kind
                        .entry(key)
                        .or_default()
                        .extend(sentence.map(|t| t.text));
                }
            }
        }
    }
    let (all, held_out) = grammar.template_count();
    println!(
        "{total} sentences over {scenes} scenes, {} distinct",
        distinct.len()
    );
    println!(
        "{} words in them, {} in the grammar",
        words.len(),
        grammar.word_count()
    );
    println!(
        "{} of {all} templates used, {held_out} held out",
        templates.len()
    );
    let (nouns, held_out) = grammar.noun_count();
    println!("{nouns} names of objects, {held_out} held out");
    let is_small = distinct.len() < 20_000 || words.len() < 900 || templates.len() < 150;
    for (kind, texts) in by_kind.iter().filter(|_| samples > 0) {
        println!("\n{kind}");
        for text in texts
            .iter()
            .step_by((texts.len() / samples).max(1))
            .take(samples)
        {
            println!("  {text}");
        }
    }
    if scenes >= 60 && is_small {
        println!("fewer than 20,000 sentences, 900 words or 150 templates");
        std::process::exit(1);
    }
}
