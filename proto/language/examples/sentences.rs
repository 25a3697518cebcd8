//! Prints sentences for the tasks of the library, as for a training plan: task, object,
//! contents of the scene, sentence.
//!
//!   cargo run --release -p wheelarm-language --example sentences -- [SEED] [TOTAL] [any|train|held_out]

#[path = "../tests/made_up/mod.rs"]
#[expect(dead_code, reason = "the tests need more of it")]
mod made_up;

use wheelarm_language::{Options, Split, generate};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| {
        let given = arguments.get(i).and_then(|text| text.parse().ok());
        given.unwrap_or(default)
    };
    let (seed, total) = (number(0, 0), number(1, 200));
    let split = match arguments.get(2).map(String::as_str) {
        Some("any") => Split::Any,
        Some("held_out") => Split::HeldOut,
        _ => Split::Train,
    };
    let (grammar, home) = (made_up::grammar(), made_up::home());
    let tasks = made_up::library();
    let options = Options {
        split,
        ..Options::default()
    };
    for n in 0..total {
        let task = &tasks[n as usize % tasks.len()];
        let own = seed + n / tasks.len() as u64;
        let scene = task.scene(&home, own);
        let wish = task.wish(&scene, own);
        let purpose = format!("{} {own}", task.name);
        let text = match generate(&grammar, &scene, &wish, &options, own, &purpose) {
            Some(sentence) => sentence.text,
            None => "NOTHING".to_owned(),
        };
        println!(
            "{}\t{}\t{text}",
            task.name, scene.entities[wish.target].name
        );
    }
}
