//! Meaning of a sentence, and denotation of a phrase in a scene.

use crate::grammar::{Grammar, Means, Names, Noun, Verb};
use crate::scene::{Entity, Role, Scene};
use crate::space::{at_place, is_on_side, might, nth_of};

/// Meaning of a sentence: indices of entities of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Meaning {
    /// Action.
    pub verb: Verb,
    /// Target.
    pub target: usize,
    /// Goal of `put`.
    pub goal: Option<usize>,
}

/// A name with an optional colour: indices into the grammar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Named {
    pub colour: Option<usize>,
    pub noun: usize,
}

/// A parsed phrase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Node {
    /// With the number of `{nth}`.
    pub means: Means,
    pub noun: Named,
    pub other: Option<Named>,
    /// Index of the place's name.
    pub at: Option<usize>,
}

/// Largest distance of "next to", metres.
const NEXT: f64 = 0.5;

/// Whether a name refers to an entity.
pub(crate) fn is_called(noun: &Noun, entity: &Entity) -> bool {
    match &noun.names {
        Names::Kinds(kinds) => entity.role != Role::Goal && kinds.contains(&entity.kind),
        Names::Category(category) => entity.role != Role::Goal && *category == entity.category,
        Names::Goal(goal) => entity.role == Role::Goal && *goal == entity.name,
    }
}

/// Entities of the scene that a name matches.
pub(crate) fn fits(grammar: &Grammar, scene: &Scene, named: Named) -> Vec<usize> {
    let noun = &grammar.nouns[named.noun];
    let colour = named.colour.map(|i| grammar.colours[i].name.as_str());
    let all = scene.entities.iter().enumerate();
    all.filter(|(_, entity)| is_called(noun, entity) && colour.is_none_or(|c| c == entity.colour))
        .map(|(i, _)| i)
        .collect()
}

/// Possible denotations of a phrase among entities of a role; with `place`, only on
/// that area. A single one means that the phrase is unique.
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
    let areas: Vec<_> = [node.at, place].into_iter().flatten().map(area).collect();
    let mut set = fits(grammar, scene, node.noun);
    set.retain(|&i| {
        let entity = &scene.entities[i];
        entity.role == role && areas.iter().all(|a| a.is_some() && *a == entity.area)
    });
    let others = || {
        node.other
            .map_or(Vec::new(), |other| fits(grammar, scene, other))
    };
    let mut found = match node.means {
        Means::Plain => set,
        Means::Beside(side) => {
            let others = others();
            let holds = |test: &dyn Fn(&Entity, &Entity) -> bool| -> Vec<usize> {
                let any = |&i: &usize| {
                    let mut others = others.iter().filter(|&&other| other != i);
                    others.any(|&other| test(&scene.entities[i], &scene.entities[other]))
                };
                set.iter().copied().filter(any).collect()
            };
            match holds(&|a, b| is_on_side(a, b, side)).is_empty() {
                true => Vec::new(),
                false => holds(&|a, b| might(a, b, side)),
            }
        }
        Means::Next => {
            let nearest = others().into_iter().flat_map(|other| {
                let origin = &scene.entities[other];
                let far = |i: usize| {
                    let [x, y] = [0, 1].map(|k| scene.entities[i].at[k] - origin.at[k]);
                    (x * x + y * y).sqrt()
                };
                let mut near = set.clone();
                near.retain(|&i| {
                    let same = scene.entities[i].area == origin.area && origin.area.is_some();
                    i != other && same && far(i) <= NEXT
                });
                nth_of(&near, far, 0)
            });
            nearest.collect()
        }
        Means::Order(order, place) => {
            let of_area = |area: usize| {
                let mut among = set.clone();
                among.retain(|&i| scene.entities[i].area == Some(area));
                at_place(scene, &among, order, place.unwrap_or(0))
            };
            (0..scene.areas.len()).flat_map(of_area).collect()
        }
    };
    found.sort_unstable();
    found.dedup();
    found
}
