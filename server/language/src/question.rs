//! What is asked back where a sentence may mean several things.

use crate::grammar::{Grammar, NTH};
use crate::meaning::Meaning;
use crate::scene::{Role, Scene};
use crate::space::{Order, TIE};

/// The question that tells the meanings apart.
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
    let things: Vec<_> = targets.iter().map(|&i| &scene.things[i]).collect();
    let same = |f: &dyn Fn(usize) -> String| {
        let first = f(targets[0]);
        targets.iter().all(|&i| f(i) == first).then_some(first)
    };
    let kind = same(&|i| scene.things[i].kind.clone());
    let category = same(&|i| scene.things[i].category.clone()).filter(|c| !c.is_empty());
    let which = match (&kind, &category) {
        (Some(kind), _) => grammar.name_of(kind).to_owned(),
        (None, Some(category)) => category.clone(),
        (None, None) => "one".to_owned(),
    };
    // Things of several kinds are told apart by their names.
    if kind.is_none() {
        let names = targets.iter().map(|&i| the(grammar, scene, i));
        return format!("Which {which}, {}?", either(names.collect()));
    }
    let area = things[0].area;
    if things.iter().any(|thing| thing.area != area) {
        let places = things.iter().map(|thing| {
            let area = thing.area.map_or("house", |i| scene.areas[i].name.as_str());
            format!(
                "the one {} {}",
                grammar.preposition(area),
                grammar.area_name(area)
            )
        });
        return format!("Which {which}, {}?", either(places.collect()));
    }
    let (order, end) = match things[0].role {
        Role::Slide => (Order::Top, "top"),
        Role::Object | Role::Goal => (Order::Left, "left"),
    };
    let mut all: Vec<usize> = (0..scene.things.len())
        .filter(|&i| scene.things[i].kind == things[0].kind && scene.things[i].area == area)
        .collect();
    all.sort_by(|&a, &b| {
        order
            .key(&scene.things[a])
            .total_cmp(&order.key(&scene.things[b]))
    });
    targets.sort_by_key(|i| all.iter().position(|other| other == i));
    if let ([a, b], Role::Object) = (&targets[..], things[0].role) {
        let keys = [a, b].map(|&i| order.key(&scene.things[i]));
        if keys[1] - keys[0] >= TIE {
            return format!("Which {which}, the left or the right one?");
        }
        return format!("Which {which}, the front or the back one?");
    }
    let nth = targets.iter().map(|i| {
        let place = all.iter().position(|other| other == i).unwrap_or(0);
        format!("the {}", NTH.get(place).copied().unwrap_or("next"))
    });
    format!("Which {which}, {} from the {end}?", either(nth.collect()))
}

fn the(grammar: &Grammar, scene: &Scene, i: usize) -> String {
    let thing = &scene.things[i];
    let kind = match thing.role {
        Role::Goal => &thing.name,
        Role::Object | Role::Slide => &thing.kind,
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
