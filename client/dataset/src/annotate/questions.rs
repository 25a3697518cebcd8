//! Questions about the state at some samples, with the answers that it gives.
//!
//! The definitions are those of `wheelarm_language::space` and of [`State`]; the
//! arguments and the value are for programs, question and answer for people.

use serde_json::{Value, json};
use wheelarm_language::space::{self, Side};
use wheelarm_language::{Scene, is_plural};

use super::sight::Sight;
use super::state::State;
use crate::pose;
use crate::read::{Episode, ReadError};

/// Types of questions by their code, from 0.
pub const KINDS: [&str; 6] = ["where", "count", "side", "reach", "held", "open"];

/// Nanoseconds between two samples with questions.
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
    /// Text.
    pub question: String,
    /// Text.
    pub answer: String,
    /// The subject of the questions, JSON.
    pub arguments: Value,
    /// The answer, JSON.
    pub value: Value,
    /// Cameras whose images show the subjects of question and answer at that time; with
    /// none the question is one from memory.
    pub cameras: Vec<String>,
}

impl Question {
    /// Whether no image of that time shows its subjects.
    #[must_use]
    pub fn is_from_memory(&self) -> bool {
        self.cameras.is_empty()
    }
}

/// Picks indices in turn, another one each time.
struct Turns(usize);

impl Turns {
    fn next<'a, T>(&mut self, list: &'a [T]) -> Option<&'a T> {
        self.0 = self.0.wrapping_mul(31).wrapping_add(17) % 10_007;
        list.get(self.0 % list.len().max(1))
    }
}

/// Subject of a question, as text and JSON.
struct Draft {
    question: String,
    answer: String,
    arguments: Value,
    value: Value,
    /// Instances that an image must show for the answer to be seen in it.
    shown: Vec<String>,
}

/// Objects that the cameras show at the samples with questions.
///
/// # Errors
/// When images cannot be read.
pub(super) fn sight(episode: &Episode, state: &State) -> Result<Sight, ReadError> {
    let slides = state.home.slides.iter().map(|slide| slide.name.clone());
    let names = state.objects.iter().cloned().chain(slides);
    let names = names.chain(state.tips.iter().cloned()).collect();
    let stamps: Vec<u64> = rows(state).into_iter().map(|r| state.stamps[r]).collect();
    Sight::read(episode, names, &stamps)
}

/// The samples that have questions: one every second.
fn rows(state: &State) -> Vec<usize> {
    let mut due = state.stamps.first().copied().unwrap_or(0);
    let mut rows = Vec::new();
    for row in 0..state.stamps.len().min(state.poses.len()) {
        if state.stamps[row] >= due {
            due = state.stamps[row] + EVERY;
            rows.push(row);
        }
    }
    rows
}

/// Questions about an episode: one of each type every second. Each is about what an
/// image shows wherever possible, and otherwise a question from
/// memory elsewhere.
pub(super) fn questions(state: &State, sight: &Sight) -> Vec<Question> {
    let mut out = Vec::new();
    let mut turns = Turns(state.stamps.len());
    for row in rows(state) {
        let stamp = state.stamps[row];
        let scene = state.scene(row);
        let objects = 0..state.objects.len();
        let is_visible = |name: &str| !sight.cameras(stamp, &[name]).is_empty();
        let visible: Vec<usize> = objects
            .clone()
            .filter(|&i| is_visible(&state.objects[i]))
            .collect();
        let all = if visible.is_empty() {
            objects.collect()
        } else {
            visible
        };
        let slides = 0..state.home.slides.len();
        let is_slide_visible = |i: &usize| is_visible(&state.home.slides[*i].name);
        let visible: Vec<usize> = slides.clone().filter(is_slide_visible).collect();
        let slides = if visible.is_empty() {
            slides.collect()
        } else {
            visible
        };
        let drafts = [
            place(state, row, &all, &mut turns),
            count(state, row, &all, &mut turns),
            side(state, &scene, row, &all, &mut turns),
            reach(state, row, &all, &mut turns),
            held(state, row),
            open(state, row, &slides, &mut turns),
        ];
        for (kind, draft) in drafts.into_iter().enumerate() {
            let Some(draft) = draft else { continue };
            let shown: Vec<&str> = draft.shown.iter().map(String::as_str).collect();
            out.push(Question {
                row,
                stamp,
                tick: state.ticks[row],
                kind,
                question: draft.question,
                answer: draft.answer,
                arguments: draft.arguments,
                value: draft.value,
                cameras: sight.cameras(stamp, &shown),
            });
        }
    }
    out
}

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

/// `is` or `are`, as the name of an object wants it.
fn be(name: &str) -> &'static str {
    if is_plural(&words(name)) { "are" } else { "is" }
}

fn place(state: &State, row: usize, all: &[usize], turns: &mut Turns) -> Option<Draft> {
    let object = *turns.next(all)?;
    let name = &state.objects[object];
    let found = where_is(state, row, object);
    let answer = match found.as_str() {
        "hand" => "in the hand".to_owned(),
        "floor" => "on the floor".to_owned(),
        "elsewhere" => "somewhere else".to_owned(),
        area => format!("on the {}", words(area)),
    };
    Some(Draft {
        question: format!("Where {} {}?", be(name), state.called(name)),
        answer,
        arguments: json!({"object": name}),
        value: json!(found),
        shown: vec![name.clone()],
    })
}

/// Categories and areas of the home, of which there are some two times of three.
fn count(state: &State, row: usize, all: &[usize], turns: &mut Turns) -> Option<Draft> {
    let object = *turns.next(all)?;
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
    let counted: Vec<usize> = (0..state.objects.len()).filter(is_counted).collect();
    // An image cannot show "none": the whole area may not be in it.
    let shown = counted.iter().map(|&i| state.objects[i].clone());
    Some(Draft {
        question: format!("How many {} are on the {}?", several(category), words(area)),
        answer: counted.len().to_string(),
        arguments: json!({"category": category, "area": area}),
        value: json!(counted.len()),
        shown: shown.collect(),
    })
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

fn side(
    state: &State,
    scene: &Scene,
    row: usize,
    all: &[usize],
    turns: &mut Turns,
) -> Option<Draft> {
    let is_there = |object: usize| where_is(state, row, object);
    let stands: Vec<usize> = (0..state.objects.len())
        .filter(|&i| state.home.areas.iter().any(|a| a.name == is_there(i)))
        .collect();
    let able: Vec<usize> = stands.iter().copied().filter(|i| all.contains(i)).collect();
    let able = if able.is_empty() {
        stands.clone()
    } else {
        able
    };
    let object = *turns.next(&able)?;
    let (word, side, words) = *turns.next(&SIDES)?;
    let entity = &scene.entities[scene.named(&state.objects[object])?];
    let beside = stands.iter().filter(|&&other| other != object);
    let mut names: Vec<&str> = beside
        .filter(|&&other| {
            let other = scene.named(&state.objects[other]);
            other.is_some_and(|i| space::is_on_side(&scene.entities[i], entity, side))
        })
        .map(|&other| state.objects[other].as_str())
        .collect();
    names.sort_unstable();
    let called: Vec<String> = names.iter().map(|name| state.called(name)).collect();
    let answer = match called.is_empty() {
        true => "nothing".to_owned(),
        false => called.join(", "),
    };
    // "Nothing" is visible where everything else on that furniture is.
    let own = is_there(object);
    let mut shown = vec![state.objects[object].clone()];
    match names.is_empty() {
        true => {
            let neighbours = stands.iter().filter(|&&other| is_there(other) == own);
            shown.extend(neighbours.map(|&other| state.objects[other].clone()));
        }
        false => shown.extend(names.iter().map(|name| (*name).to_owned())),
    }
    Some(Draft {
        question: format!("What is {words} {}?", state.called(&state.objects[object])),
        answer,
        arguments: json!({"object": state.objects[object], "side": word}),
        value: json!(names),
        shown,
    })
}

/// Whether an object's origin is within the outer radius of the arm's reach.
fn reach(state: &State, row: usize, all: &[usize], turns: &mut Turns) -> Option<Draft> {
    let object = *turns.next(all)?;
    let base = &state.base[row];
    let (centre, radius) = state.reach;
    let turned = pose::turned(pose::orientation(base), centre);
    let own = &state.poses[row][object];
    let far: f64 = (0..3).map(|k| (own[k] - base[k] - turned[k]).powi(2)).sum();
    let is_near = far.sqrt() <= radius;
    let name = &state.objects[object];
    let be = if be(name) == "are" { "Are" } else { "Is" };
    Some(Draft {
        question: format!("{be} {} within reach of the arm?", state.called(name)),
        answer: if is_near { "yes" } else { "no" }.to_owned(),
        arguments: json!({"object": name}),
        value: json!(is_near),
        shown: vec![name.clone()],
    })
}

fn held(state: &State, row: usize) -> Option<Draft> {
    let name = state.held[row].map(|i| state.objects[i].as_str());
    Some(Draft {
        question: "What is in the hand?".to_owned(),
        answer: name.map_or("nothing".to_owned(), |name| state.called(name)),
        arguments: json!({}),
        value: json!(name),
        // An empty hand is visible where its finger tips are.
        shown: name.map_or_else(|| state.tips.clone(), |name| vec![name.to_owned()]),
    })
}

fn open(state: &State, row: usize, slides: &[usize], turns: &mut Turns) -> Option<Draft> {
    let slide = *turns.next(slides)?;
    let name = &state.home.slides[slide].name;
    let is_open = state.is_open(row, slide);
    Some(Draft {
        question: format!("Is {} open?", state.called(name)),
        answer: if is_open { "yes" } else { "no" }.to_owned(),
        arguments: json!({"slide": name}),
        value: json!(is_open),
        shown: vec![name.clone()],
    })
}
