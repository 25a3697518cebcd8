//! Questions about the state at some samples, with the answers that it gives.
//!
//! The definitions are those of `wheelarm_language::space` and of [`State`]; the
//! arguments and the value are for programs, question and answer for people.

use serde_json::{Value, json};
use wheelarm_language::Scene;
use wheelarm_language::space::{self, Side};

use super::state::{OPEN, State};
use crate::pose;

/// Types of questions by their code, from 0.
pub const KINDS: [&str; 6] = ["where", "count", "side", "reach", "held", "open"];

/// Nanoseconds between two samples that are asked about.
const EVERY: u64 = 1_000_000_000;

/// A question with its answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Sample of `object_pose`.
    pub row: usize,
    /// Simulation time, nanoseconds.
    pub stamp: u64,
    /// Tick.
    pub tick: u64,
    /// Index into [`KINDS`].
    pub kind: usize,
    /// In words.
    pub question: String,
    /// In words.
    pub answer: String,
    /// What is asked about, JSON.
    pub arguments: Value,
    /// The answer, JSON.
    pub value: Value,
}

/// Picks things in turn, another one each time.
struct Turns(usize);

impl Turns {
    fn next<'a, T>(&mut self, list: &'a [T]) -> Option<&'a T> {
        self.0 = self.0.wrapping_mul(31).wrapping_add(17) % 10_007;
        list.get(self.0 % list.len().max(1))
    }
}

/// Questions about an episode: one of each type every second.
pub(super) fn questions(state: &State) -> Vec<Question> {
    let mut out = Vec::new();
    let mut turns = Turns(state.stamps.len());
    let mut due = state.stamps.first().copied().unwrap_or(0);
    for row in 0..state.stamps.len().min(state.poses.len()) {
        if state.stamps[row] < due {
            continue;
        }
        due = state.stamps[row] + EVERY;
        let scene = state.scene(row);
        let asked = [
            place(state, row, &mut turns),
            count(state, row, &mut turns),
            side(state, &scene, row, &mut turns),
            reach(state, row, &mut turns),
            held(state, row),
            open(state, row, &mut turns),
        ];
        for (kind, asked) in asked.into_iter().enumerate() {
            let Some((question, answer, arguments, value)) = asked else {
                continue;
            };
            out.push(Question {
                row,
                stamp: state.stamps[row],
                tick: state.ticks[row],
                kind,
                question,
                answer,
                arguments,
                value,
            });
        }
    }
    out
}

type Asked = Option<(String, String, Value, Value)>;

fn words(name: &str) -> String {
    name.replace('_', " ")
}

/// Where an object is: `hand`, an area, `floor` or `elsewhere`.
fn where_is(state: &State, row: usize, object: usize) -> String {
    if state.held[row] == Some(object) {
        return "hand".to_owned();
    }
    let [x, y, z, ..] = state.poses[row][object];
    let carries = |area: &&wheelarm_language::Area| area.carries([x, y, z]);
    match state.home.areas.iter().find(carries) {
        Some(area) => area.name.clone(),
        None if z < 0.15 => "floor".to_owned(),
        None => "elsewhere".to_owned(),
    }
}

fn place(state: &State, row: usize, turns: &mut Turns) -> Asked {
    let all: Vec<usize> = (0..state.objects.len()).collect();
    let object = *turns.next(&all)?;
    let name = &state.objects[object];
    let found = where_is(state, row, object);
    let answer = match found.as_str() {
        "hand" => "in the hand".to_owned(),
        "floor" => "on the floor".to_owned(),
        "elsewhere" => "somewhere else".to_owned(),
        area => format!("on the {}", words(area)),
    };
    Some((
        format!("Where is {}?", state.called(name)),
        answer,
        json!({"object": name}),
        json!(found),
    ))
}

/// Categories and areas of the home, of which there are some two times of three.
fn count(state: &State, row: usize, turns: &mut Turns) -> Asked {
    let all: Vec<usize> = (0..state.objects.len()).collect();
    let object = *turns.next(&all)?;
    let [category, _] = state.home.words_of(&state.objects[object]);
    if category.is_empty() {
        return None;
    }
    let areas: Vec<&str> = state.home.areas.iter().map(|a| a.name.as_str()).collect();
    let own = where_is(state, row, object);
    let stands = areas.iter().find(|area| **area == own).copied();
    let area = match stands {
        Some(area) if *turns.next(&[true, true, false])? => area,
        _ => *turns.next(&areas)?,
    };
    let is_counted = |object: &usize| {
        let [own, _] = state.home.words_of(&state.objects[*object]);
        own == category && where_is(state, row, *object) == area
    };
    let number = all.iter().filter(|object| is_counted(object)).count();
    Some((
        format!("How many {} are on the {}?", several(category), words(area)),
        number.to_string(),
        json!({"category": category, "area": area}),
        json!(number),
    ))
}

/// The plural of a category.
fn several(category: &str) -> String {
    match category {
        "knife" => "knives".to_owned(),
        "fruit" => "pieces of fruit".to_owned(),
        word if word.ends_with('x') => format!("{word}es"),
        word => format!("{word}s"),
    }
}

const SIDES: [(&str, Side, &str); 4] = [
    ("left", Side::Left, "to the left of"),
    ("right", Side::Right, "to the right of"),
    ("front", Side::Front, "in front of"),
    ("behind", Side::Behind, "behind"),
];

fn side(state: &State, scene: &Scene, row: usize, turns: &mut Turns) -> Asked {
    let is_there = |object: usize| where_is(state, row, object);
    let stands: Vec<usize> = (0..state.objects.len())
        .filter(|&i| state.home.areas.iter().any(|a| a.name == is_there(i)))
        .collect();
    let object = *turns.next(&stands)?;
    let (word, side, words) = *turns.next(&SIDES)?;
    let thing = &scene.things[scene.named(&state.objects[object])?];
    let beside = stands.iter().filter(|&&other| other != object);
    let mut names: Vec<&str> = beside
        .filter(|&&other| {
            let other = scene.named(&state.objects[other]);
            other.is_some_and(|i| space::is(&scene.things[i], thing, side))
        })
        .map(|&other| state.objects[other].as_str())
        .collect();
    names.sort_unstable();
    let called: Vec<String> = names.iter().map(|name| state.called(name)).collect();
    let answer = match called.is_empty() {
        true => "nothing".to_owned(),
        false => called.join(", "),
    };
    Some((
        format!(
            "What stands {words} {}?",
            state.called(&state.objects[object])
        ),
        answer,
        json!({"object": state.objects[object], "side": word}),
        json!(names),
    ))
}

/// Whether an object's origin lies within the outer radius of the arm's reach.
fn reach(state: &State, row: usize, turns: &mut Turns) -> Asked {
    let all: Vec<usize> = (0..state.objects.len()).collect();
    let object = *turns.next(&all)?;
    let base = &state.base[row];
    let (centre, radius) = state.reach;
    let turned = pose::turned(pose::orientation(base), centre);
    let own = &state.poses[row][object];
    let far: f64 = (0..3).map(|k| (own[k] - base[k] - turned[k]).powi(2)).sum();
    let is_near = far.sqrt() <= radius;
    let name = &state.objects[object];
    Some((
        format!("Is {} within reach of the arm?", state.called(name)),
        if is_near { "yes" } else { "no" }.to_owned(),
        json!({"object": name}),
        json!(is_near),
    ))
}

fn held(state: &State, row: usize) -> Asked {
    let name = state.held[row].map(|i| state.objects[i].as_str());
    Some((
        "What is in the hand?".to_owned(),
        name.map_or("nothing".to_owned(), |name| state.called(name)),
        json!({}),
        json!(name),
    ))
}

fn open(state: &State, row: usize, turns: &mut Turns) -> Asked {
    let all: Vec<usize> = (0..state.home.slides.len()).collect();
    let slide = *turns.next(&all)?;
    let name = &state.home.slides[slide].name;
    let is_open = state.slides[row][slide] >= OPEN;
    Some((
        format!("Is {} open?", state.called(name)),
        if is_open { "yes" } else { "no" }.to_owned(),
        json!({"slide": name}),
        json!(is_open),
    ))
}
