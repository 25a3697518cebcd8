//! The objects of one place of a home. All of them are sampled and placed by one rule, and the
//! target is one of those that the task could request, each with equal probability: neither
//! place nor kind of the objects reveals it.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;

use super::area::PlaceSpec;
use super::home_sites::{HomeQuery, Site};
use super::random::{fraction, index, shuffle, stream};
use crate::scene::Scene;

/// Most objects of a place.
const MOST: usize = 4;
/// Length of the reached strip for each object after the first, metres.
const SPACING: f64 = 0.2;
/// Probability of each object after the first.
const CHANCE: f64 = 0.7;
/// Probability that two of the objects are of one category.
const ALIKE: f64 = 0.3;
/// Probability of a sampled object that no task requests. Below 1, so that it needs no room for
/// the hand ([`PlaceSpec::is_certain`]).
const SCENERY: f64 = 0.9;
/// Most sampled lists of objects until one has a possible or a named target.
const LISTS: usize = 20_000;

/// What may be on the place of a site.
pub(super) struct Contents<'a> {
    query: &'a HomeQuery,
    site: &'a Site,
    /// Objects of the stock by category: targets, and those that no task requests.
    categories: Vec<Vec<usize>>,
}

impl<'a> Contents<'a> {
    /// Of a site of a query.
    pub(super) fn new(query: &'a HomeQuery, site: &'a Site, scene: &Scene) -> Self {
        let mut categories: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (i, stock) in query.stock.iter().enumerate() {
            let Some(body) = stock.body(scene) else {
                continue;
            };
            let is_scenery = || {
                stock.target(scene).is_none()
                    && stock.fits(&site.from, scene)
                    && stock.is_of_room(&site.from, &query.stock)
            };
            if site.targets.contains(&i) || is_scenery() {
                categories.entry(&body.category).or_default().push(i);
            }
        }
        let categories = categories.into_values().collect();
        Self {
            query,
            site,
            categories,
        }
    }

    /// The target and all objects.
    pub(super) fn sampled(&self, task: &str, seed: u64) -> Option<(usize, Vec<usize>)> {
        self.lists(task, seed).next()
    }

    /// The same with a named target: of the sampled lists the first one with it.
    pub(super) fn sampled_with(&self, task: &str, seed: u64, target: usize) -> (usize, Vec<usize>) {
        let mut lists = self.lists(task, seed).map(|(_, list)| list);
        let found = lists.find(|list| list.contains(&target));
        (target, found.unwrap_or_else(|| vec![target]))
    }

    /// Targets of the sampled lists.
    pub(super) fn targets(&self, task: &str, seed: u64) -> impl Iterator<Item = usize> {
        self.lists(task, seed).map(|(target, _)| target)
    }

    /// Sampled lists of objects with a possible target, and one of these.
    fn lists(&self, task: &str, seed: u64) -> impl Iterator<Item = (usize, Vec<usize>)> {
        let mut random = stream(task, seed, &format!("objects {}", self.site.name));
        let lists = std::iter::repeat_with(move || {
            let list = self.list(&mut random);
            let targets: Vec<usize> = list
                .iter()
                .copied()
                .filter(|i| self.site.targets.contains(i))
                .collect();
            let target = targets.get(index(&mut random, targets.len()));
            target.copied().map(|target| (target, list))
        });
        lists.take(LISTS).flatten()
    }

    /// Objects of distinct categories, as far as there are so many, and sometimes two of one.
    fn list(&self, random: &mut ChaCha8Rng) -> Vec<usize> {
        let [low, high] = self.site.from.along;
        let room = ((high - low) / SPACING) as usize;
        let count = 1
            + (0..room.min(MOST - 1))
                .filter(|_| fraction(random) < CHANCE)
                .count();
        let mut order: Vec<usize> = (0..self.categories.len()).collect();
        shuffle(random, &mut order);
        if count > 1 && fraction(random) < ALIKE {
            order.insert(0, order[0]);
        }
        let mut list: Vec<usize> = Vec::new();
        // A category with too few objects leaves its turn to the next one.
        for &category in order.iter().cycle().take(order.len() + count) {
            if list.len() == count {
                break;
            }
            let left = self.categories[category].iter().copied();
            let left: Vec<usize> = left.filter(|i| !list.contains(i)).collect();
            list.extend(left.get(index(random, left.len())));
        }
        list
    }

    /// Ranges of objects.
    pub(super) fn places(&self, objects: &[usize]) -> impl Iterator<Item = PlaceSpec> {
        let chance = |i: usize| match self.site.targets.contains(&i) {
            true => 1.0,
            false => SCENERY,
        };
        let place = &self.site.from;
        let objects = objects.iter();
        objects.map(move |&i| self.query.stock[i].at(place, chance(i)))
    }
}
