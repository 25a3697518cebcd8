//! The places of a home at which a task without an area is possible, and why there is none.

use super::place_query::PlaceQuery;
use super::query::Query;
use super::stock::Stock;
use super::template::Template;
use crate::scene::{ReachedPlace, Scene, SceneError};

/// A task that is a query.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HomeQuery {
    pub template: Template,
    /// Where it is possible: one for each variant of the area.
    pub sites: Vec<Site>,
    pub stock: Vec<Stock>,
}

/// One place of the task.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Site {
    /// Name of the variant.
    pub name: String,
    /// Place of the target.
    pub from: ReachedPlace,
    /// Place on which it is put.
    pub to: Option<ReachedPlace>,
    /// Objects of the stock that may be the target, by their indices.
    pub targets: Vec<usize>,
    /// Door or drawer that is opened or closed, instead of an object.
    pub handle: Option<String>,
}

/// Finds the places of a task.
pub(super) struct Finder<'a> {
    pub name: &'a str,
    pub object: &'a Query,
    pub from: &'a PlaceQuery,
    pub to: Option<&'a PlaceQuery>,
    pub scene: &'a Scene,
    pub stock: &'a [Stock],
}

impl Finder<'_> {
    /// The places, each with what may be the target.
    pub(super) fn sites(&self) -> Result<Vec<Site>, SceneError> {
        let scene = self.scene;
        let wanted = |stock: &Stock| {
            stock
                .target(scene)
                .is_some_and(|body| self.object.fits(body))
        };
        let wanted: Vec<usize> = (0..self.stock.len())
            .filter(|&i| wanted(&self.stock[i]))
            .collect();
        if wanted.is_empty() {
            let words = self.stock.iter().map(|stock| stock.words.as_str());
            let words: Vec<&str> = words.collect();
            return Err(self.refusal(
                format!("no object with {}", self.object),
                format!("objects that may be there: {}", words.join(", ")),
            ));
        }
        let from: Vec<&ReachedPlace> = scene
            .places
            .iter()
            .filter(|place| self.from.fits(place))
            .collect();
        if from.is_empty() {
            let places = self.from.alternatives(&scene.places);
            return Err(self.refusal(format!("no {}", self.from), places));
        }
        let of_place = |place: &ReachedPlace| -> Vec<usize> {
            let belongs = |i: &usize| {
                let stock = &self.stock[*i];
                stock.fits(place, scene) && stock.is_of_room(place, self.stock)
            };
            wanted.iter().copied().filter(belongs).collect()
        };
        let mut sites = Vec::new();
        for place in &from {
            let targets = of_place(place);
            if targets.is_empty() {
                continue;
            }
            let Some(query) = self.to else {
                sites.push(site(place, None, targets));
                continue;
            };
            let to = scene.places.iter().filter(|to| {
                let first = scene.surface_named(&to.furniture, None);
                query.fits(to)
                    && (to.room == place.room || !(to.apart || place.apart))
                    && to.furniture != place.furniture
                    && first.is_some_and(|surface| surface.name == to.surface)
            });
            sites.extend(to.map(|to| site(place, Some(to), targets.clone())));
        }
        if !sites.is_empty() {
            return Ok(sites);
        }
        if let Some(to) = self.to
            && from.iter().any(|place| !of_place(place).is_empty())
        {
            return Err(self.refusal(format!("no other {to}"), to.alternatives(&scene.places)));
        }
        let words = wanted.iter().map(|&i| self.stock[i].words.as_str());
        let words: Vec<&str> = words.collect();
        let kinds = from.iter().map(|place| place.words());
        let kinds: Vec<String> = kinds.collect();
        Err(self.refusal(
            format!("no {} with room for {}", self.from, words.join(" or ")),
            format!(
                "too low, too narrow or of another room: {}",
                kinds.join(", ")
            ),
        ))
    }

    fn refusal(&self, missing: String, available: String) -> SceneError {
        SceneError::NotOffered {
            task: self.name.to_owned(),
            missing,
            scene: self.scene.name.clone(),
            available,
        }
    }
}

fn site(from: &ReachedPlace, to: Option<&ReachedPlace>, targets: Vec<usize>) -> Site {
    Site {
        name: match to {
            Some(to) => format!("{}-to-{}", from.name, to.name),
            None => from.name.clone(),
        },
        from: from.clone(),
        to: to.cloned(),
        targets,
        handle: None,
    }
}
