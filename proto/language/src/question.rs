//! Clarification questions for ambiguous sentences.

use crate::grammar::{Grammar, NTH};
use crate::meaning::Meaning;
use crate::scene::{Role, Scene};
use crate::space::{Order, TIE};

/// A question that distinguishes the meanings.
pub(crate) fn question(grammar: &Grammar, scene: &Scene, meanings: &[Meaning]) -> String {
    let mut targets: Vec<usize> = meanings.iter().map(|m| m.target).collect();
    targets.sort_unstable();
    targets.dedup();
    if let [_] = targets[..] {
        let mut goals: Vec<usize> = meanings.iter().filter_map(|m| m.goal).collect();
        goals.sort_unstable();
        goals.dedup();
        let names = goals.iter().map(|&i| the(grammar, scene, i));
        return format!("Where to, {}?", either(names.collect()));
    }
    let entities: Vec<_> = targets.iter().map(|&i| &scene.entities[i]).collect();
    let same = |f: &dyn Fn(usize) -> String| {
        let first = f(targets[0]);
        targets.iter().all(|&i| f(i) == first).then_some(first)
    };
    let kind = same(&|i| scene.entities[i].kind.clone());
    let category = same(&|i| scene.entities[i].category.clone()).filter(|c| !c.is_empty());
    let which = match (&kind, &category) {
        (Some(kind), _) => grammar.name_of(kind).to_owned(),
        (None, Some(category)) => category.clone(),
        (None, None) => "one".to_owned(),
    };
    // Entities of several kinds are distinguished by name.
    if kind.is_none() {
        let names = targets.iter().map(|&i| the(grammar, scene, i));
        return format!("Which {which}, {}?", either(names.collect()));
    }
    let area = entities[0].area;
    if entities.iter().any(|entity| entity.area != area) {
        let places = entities.iter().map(|entity| {
            let area = entity
                .area
                .map_or("house", |i| scene.areas[i].name.as_str());
            format!(
                "the one {} {}",
                grammar.preposition(area),
                grammar.area_name(area)
            )
        });
        return format!("Which {which}, {}?", either(places.collect()));
    }
    let is_slide = entities[0].role == Role::Slide;
    let order = if is_slide { Order::Top } else { Order::Left };
    let mut all: Vec<usize> = (0..scene.entities.len())
        .filter(|&i| scene.entities[i].kind == entities[0].kind && scene.entities[i].area == area)
        .collect();
    all.sort_by(|&a, &b| {
        order
            .key(&scene.entities[a])
            .total_cmp(&order.key(&scene.entities[b]))
    });
    targets.sort_by_key(|i| all.iter().position(|other| other == i));
    if let ([a, b], Role::Object) = (&targets[..], entities[0].role) {
        let keys = [a, b].map(|&i| order.key(&scene.entities[i]));
        if keys[1] - keys[0] >= TIE {
            return format!("Which {which}, the left or the right one?");
        }
        return format!("Which {which}, the front or the back one?");
    }
    let positions = targets
        .iter()
        .map(|i| all.iter().position(|other| other == i));
    let positions: Vec<usize> = positions.map(|place| place.unwrap_or(0)).collect();
    let nth = |place: &usize| format!("the {}", NTH.get(*place).copied().unwrap_or("next"));
    if !is_slide {
        let names = either(positions.iter().map(nth).collect());
        return format!("Which {which}, {names} from the left?");
    }
    // The first from the top is the top one, which also defines the start of counting.
    let end = if positions.contains(&0) {
        ""
    } else {
        " from the top"
    };
    let from_top = positions.iter().map(|place| match place {
        0 => "the top one".to_owned(),
        last if last + 1 == all.len() => "the bottom one".to_owned(),
        place => format!("{}{end}", nth(place)),
    });
    format!("Which {which}, {}?", either(from_top.collect()))
}

fn the(grammar: &Grammar, scene: &Scene, i: usize) -> String {
    let entity = &scene.entities[i];
    let kind = match entity.role {
        Role::Goal => &entity.name,
        Role::Object | Role::Slide => &entity.kind,
    };
    format!("the {}", grammar.name_of(kind))
}

/// `a, b or c`.
fn either(mut names: Vec<String>) -> String {
    let last = names.pop().unwrap_or_default();
    match names.is_empty() {
        true => last,
        false => format!("{} or {last}", names.join(", ")),
    }
}
