//! Tasks without an area: a query over the places of a home. The seed selects a place, an
//! object of the stock, and others as clutter; [`TaskSpec::settled`] is then
//! an ordinary task of one area with one variant.

use std::path::Path;

use super::area::{AreaSpec, PlaceSpec, Range, StartSpec, Variant};
use super::file::TaskFile;
use super::goal::Goal;
use super::home_sites::{Finder, HomeQuery, Site};
use super::joint_query;
use super::random::{fraction, index, shuffle, stream};
use super::spec::TaskSpec;
use super::stock;
use super::template::{Template, Verb};
use crate::robot::CorridorSettings;
use crate::scene::{Place, ReachedPlace, Scene, SceneError};

/// Simulated time of a task, seconds, unless its file states one: ways through several rooms
/// took up to 196 s.
pub(super) const TIME_LIMIT: f64 = 240.0;
/// Most objects beside the target.
const CLUTTER: usize = 3;
/// Probability of each of them.
const CLUTTER_CHANCE: f64 = 0.6;
/// Clutter is behind the target on a surface of this depth, metres.
const DEEP: f64 = 0.45;
/// Its least and greatest distance from the edge then, and its distance from the ends, metres.
const BEHIND: [f64; 2] = [0.32, 0.6];
const END: f64 = 0.1;
/// Otherwise it is beside the target, on a place of this length, metres.
const LONG: f64 = 0.5;

/// The scene with the objects of the stock, which are optional, when the task of a file is a
/// query.
pub(super) fn stocked(assets: &Path, scene: &Scene) -> Result<Scene, SceneError> {
    let mut scene = scene.clone();
    let stock = stock::read(assets, &scene)?;
    scene.add_optional_objects(assets, stock.iter().map(|stock| stock.object.as_str()))?;
    Ok(scene)
}

/// Reads the task of a file without an area for a scene with the objects of the stock.
pub(super) fn read(
    assets: &Path,
    (name, path): (&str, &str),
    file: TaskFile,
    scene: &Scene,
    hand: &CorridorSettings,
) -> Result<TaskSpec, SceneError> {
    let place = &Place::file(path);
    let template = Template::read(assets, place, &file.template, &file.thresholds)?;
    if matches!(template.goal, Verb::Open | Verb::Close) {
        return joint_query::read((name, path), file, template, scene, hand);
    }
    let to = match (template.goal, &file.place) {
        (Verb::Lift | Verb::Give, None) => None,
        (Verb::Put, Some(to)) => Some(to.place_query(&place.key("place"))?),
        (Verb::Put, None) => {
            return Err(place.key("place").wrong(
                "absent",
                "where to put the object",
                "for example place = { kind = \"table\", room = \"living room\" }",
            ));
        }
        (Verb::Lift | Verb::Give, Some(_)) => {
            return Err(place.key("place").wrong(
                "given",
                format!("none with the template {:?}", file.template),
                "leave it out, or take the template \"put\"",
            ));
        }
        (Verb::Bring | Verb::Open | Verb::Close, _) => {
            return Err(place.key("template").wrong(
                format!("{:?}", file.template),
                "lift, give, put, open or close, for a task without an area",
                "take one of these, or name an area",
            ));
        }
    };
    let from = file.from.clone().unwrap_or_default();
    let stock = stock::read(assets, scene)?;
    let finder = Finder {
        name,
        object: &file.object,
        from: &from,
        to: to.as_ref(),
        scene,
        stock: &stock,
    };
    let sites = finder.sites()?;
    let share = 1.0 / sites.len() as f64;
    let variant = |site: &Site| Variant {
        name: site.name.clone(),
        share,
        furniture: Vec::new(),
        regions: Vec::new(),
        places: stock::every_object(scene, &stock, &site.from),
    };
    let mut targets: Vec<usize> = sites.iter().flat_map(|s| s.targets.clone()).collect();
    targets.sort_unstable();
    targets.dedup();
    let area = AreaSpec {
        name: name.to_owned(),
        scene: scene.name.clone(),
        hand: *hand,
        start: StartSpec::near(&sites[0].from),
        slides: Vec::new(),
        variants: sites.iter().map(variant).collect(),
        elsewhere: 0.0,
        surroundings: Vec::new(),
    };
    let goal = match template.goal {
        Verb::Give => Goal::Give,
        Verb::Put => Goal::Put { on: String::new() },
        _ => Goal::Lift,
    };
    let targets = targets.iter().map(|&i| stock[i].object.clone());
    TaskSpec::from_query(
        (name, path),
        file,
        (area, targets.collect(), goal),
        HomeQuery {
            template,
            sites,
            stock,
        },
    )
}

impl TaskSpec {
    /// Whether it is a query over the places of a home.
    #[must_use]
    pub fn is_query(&self) -> bool {
        self.query.is_some()
    }

    /// Variants and targets of a query, in an order that the seed samples; none for a task of
    /// an area.
    #[must_use]
    pub fn choices(&self, seed: u64) -> Vec<(&Variant, &str)> {
        let Some(query) = &self.query else {
            return Vec::new();
        };
        let variants = self.area.variants.iter();
        let choices = variants.flat_map(|variant| {
            let site = query.sites.iter().find(|site| site.name == variant.name);
            let targets = site.map_or(&[][..], |site| &site.targets);
            let objects = targets.iter().map(|&i| query.stock[i].object.as_str());
            let handle = site.and_then(|site| site.handle.as_deref());
            let targets = objects.chain(handle);
            targets.map(move |target| (variant, target))
        });
        let mut choices: Vec<_> = choices.collect();
        shuffle(&mut stream(&self.name, seed, "choices"), &mut choices);
        choices
    }

    /// The task in one variant, with the target that the seed selects, or `target`; a task of
    /// an area stays as it is. `scene` is that of the task.
    ///
    /// # Errors
    /// When the target does not fit the place of the variant.
    pub fn settled(
        &self,
        variant: &Variant,
        scene: &Scene,
        seed: u64,
        target: &str,
    ) -> Result<(Self, Variant), SceneError> {
        let Some(query) = &self.query else {
            return Ok((self.clone(), variant.clone()));
        };
        let mut sites = query.sites.iter();
        let Some(site) = sites.find(|site| site.name == variant.name) else {
            return Ok((self.clone(), variant.clone()));
        };
        if let Some(handle) = &site.handle {
            return joint_query::settled(self, site, handle, (variant, scene), target);
        }
        let stock = &query.stock;
        let mut random = stream(&self.name, seed, "object");
        let sampled = index(&mut random, site.targets.len());
        let named = |&&i: &&usize| stock[i].object == target;
        let chosen = match target {
            "" => site.targets.get(sampled),
            _ => site.targets.iter().find(named),
        };
        let Some(&chosen) = chosen else {
            let known = site.targets.iter().map(|&i| stock[i].object.as_str());
            let known: Vec<&str> = known.collect();
            return Err(self.place().key("target").wrong(
                format!("{target:?}"),
                format!("one of {} on {}", known.join(", "), site.from.words()),
                "name one of these, or none to sample it",
            ));
        };
        let mut variant = variant.clone();
        let clutter = clutter(query, site, scene, chosen, seed, &self.name);
        for own in clutter
            .into_iter()
            .chain([stock[chosen].at(&site.from, 1.0)])
        {
            variant.places.retain(|place| place.object != own.object);
            variant.places.insert(0, own);
        }
        let region = site.to.as_ref().map(|to| to.furniture.as_str());
        variant.regions = region.map(str::to_owned).into_iter().collect();
        let object = stock[chosen].object.as_str();
        let template = &query.template;
        let mut spec = Self {
            conditions: template.conditions(&self.template, Some([object, ""]), region)?,
            targets: vec![object.to_owned()],
            query: None,
            ..self.clone()
        };
        if let (Goal::Put { on }, Some(region)) = (&mut spec.goal, region) {
            region.clone_into(on);
        }
        spec.area.start = StartSpec::near(&site.from);
        spec.area.variants = vec![variant.clone()];
        let to = site
            .to
            .as_ref()
            .map(ReachedPlace::words)
            .unwrap_or_default();
        spec.name_in_sentences(&stock[chosen].words, &site.from.words(), &to);
        spec.check_resolved(scene)?;
        Ok((spec, variant))
    }
}

/// Objects of the room beside the target: behind it, or beside it on a long shallow place.
fn clutter(
    query: &HomeQuery,
    site: &Site,
    scene: &Scene,
    chosen: usize,
    seed: u64,
    task: &str,
) -> Vec<PlaceSpec> {
    let place = &site.from;
    let Some(surface) = scene.surface_named(&place.furniture, Some(&place.surface)) else {
        return Vec::new();
    };
    let [low, high] = place.along;
    let is_deep = surface.depth >= DEEP;
    if !is_deep && high - low < LONG {
        return Vec::new();
    }
    let mut others: Vec<usize> = (0..query.stock.len())
        .filter(|&i| {
            let stock = &query.stock[i];
            i != chosen
                && stock.body(scene).is_some()
                && stock.fits(place, scene)
                && stock.is_of_room(place, &query.stock)
        })
        .collect();
    let mut random = stream(task, seed, "clutter");
    shuffle(&mut random, &mut others);
    others.truncate(if is_deep { CLUTTER } else { 1 });
    others.retain(|_| fraction(&mut random) < CLUTTER_CHANCE);
    let at = |i: usize| {
        let own = query.stock[i].at(place, CLUTTER_CHANCE);
        let half = surface.width / 2.0 - END;
        match is_deep {
            true => PlaceSpec {
                inwards: Range {
                    min: BEHIND[0],
                    max: BEHIND[1].min(surface.depth - END),
                },
                along: Range {
                    min: -half,
                    max: half,
                },
                ..own
            },
            false => own,
        }
    };
    others.into_iter().map(at).collect()
}
