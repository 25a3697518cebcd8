//! What a sentence asks for, and what a phrase denotes in a scene.

use crate::grammar::{Grammar, Means, Names, Noun, Verb};
use crate::scene::{Role, Scene, Thing};
use crate::space::{at_place, is, might, nth_of};

/// What a sentence asks for: indices of things of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Meaning {
    /// What is to be done.
    pub verb: Verb,
    /// With what.
    pub target: usize,
    /// Where it is put.
    pub goal: Option<usize>,
}

/// A name with a colour or without: indices into the grammar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Named {
    pub colour: Option<usize>,
    pub noun: usize,
}

/// A phrase as it was understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Node {
    /// With the number of `{nth}` in it.
    pub means: Means,
    pub noun: Named,
    pub other: Option<Named>,
    /// Index of the place's name.
    pub at: Option<usize>,
}

/// Further from another thing nothing is next to it, metres.
const NEXT: f64 = 0.5;

/// Whether a name is one of a thing.
pub(crate) fn is_called(noun: &Noun, thing: &Thing) -> bool {
    match &noun.names {
        Names::Kinds(kinds) => thing.role != Role::Goal && kinds.contains(&thing.kind),
        Names::Category(category) => thing.role != Role::Goal && *category == thing.category,
        Names::Goal(goal) => thing.role == Role::Goal && *goal == thing.name,
    }
}

/// Things of the scene that a name fits.
pub(crate) fn fits(grammar: &Grammar, scene: &Scene, named: Named) -> Vec<usize> {
    let noun = &grammar.nouns[named.noun];
    let colour = named.colour.map(|i| grammar.colours[i].name.as_str());
    let all = scene.things.iter().enumerate();
    all.filter(|(_, thing)| is_called(noun, thing) && colour.is_none_or(|c| c == thing.colour))
        .map(|(i, _)| i)
        .collect()
}

/// What a phrase may denote among things of a role; with `place`, on that area
/// alone. One thing: the phrase tells it from all others.
pub(crate) fn denotes(
    grammar: &Grammar,
    scene: &Scene,
    node: &Node,
    role: Role,
    place: Option<usize>,
) -> Vec<usize> {
    let area = |name: usize| {
        let name = &grammar.places[name].area;
        scene.areas.iter().position(|area| area.name == *name)
    };
    let asked: Vec<_> = [node.at, place].into_iter().flatten().map(area).collect();
    let mut set = fits(grammar, scene, node.noun);
    set.retain(|&i| {
        let thing = &scene.things[i];
        thing.role == role && asked.iter().all(|a| a.is_some() && *a == thing.area)
    });
    let others = || {
        node.other
            .map_or(Vec::new(), |other| fits(grammar, scene, other))
    };
    let mut found = match node.means {
        Means::Plain => set,
        Means::Beside(side) => {
            let others = others();
            let holds = |test: &dyn Fn(&Thing, &Thing) -> bool| -> Vec<usize> {
                let any = |&i: &usize| {
                    let mut others = others.iter().filter(|&&other| other != i);
                    others.any(|&other| test(&scene.things[i], &scene.things[other]))
                };
                set.iter().copied().filter(any).collect()
            };
            match holds(&|a, b| is(a, b, side)).is_empty() {
                true => Vec::new(),
                false => holds(&|a, b| might(a, b, side)),
            }
        }
        Means::Next => {
            let nearest = others().into_iter().flat_map(|other| {
                let origin = &scene.things[other];
                let far = |i: usize| {
                    let [x, y] = [0, 1].map(|k| scene.things[i].at[k] - origin.at[k]);
                    (x * x + y * y).sqrt()
                };
                let mut near = set.clone();
                near.retain(|&i| {
                    let same = scene.things[i].area == origin.area && origin.area.is_some();
                    i != other && same && far(i) <= NEXT
                });
                nth_of(&near, far, 0)
            });
            nearest.collect()
        }
        Means::Order(order, place) => {
            let of_area = |area: usize| {
                let mut among = set.clone();
                among.retain(|&i| scene.things[i].area == Some(area));
                at_place(scene, &among, order, place.unwrap_or(0))
            };
            (0..scene.areas.len()).flat_map(of_area).collect()
        }
    };
    found.sort_unstable();
    found.dedup();
    found
}
