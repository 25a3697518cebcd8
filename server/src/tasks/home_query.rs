//! Tasks without an area: a query over the places of a home. The seed selects a place and
//! objects of the stock, of which one is the target ([`super::home_objects`]);
//! [`TaskSpec::settled`] is then an ordinary task of one area with one variant.

use std::path::Path;

use super::area::{AreaSpec, StartSpec, Variant};
use super::file::TaskFile;
use super::goal::Goal;
use super::home_objects::Contents;
use super::home_sites::{Finder, HomeQuery, Site};
use super::joint_query;
use super::random::{shuffle, stream};
use super::spec::TaskSpec;
use super::stock;
use super::template::{Template, Verb};
use crate::robot::CorridorSettings;
use crate::scene::{Place, ReachedPlace, Scene, SceneError};

/// Simulated time of a task, seconds, unless its file states one: ways through several rooms
/// took up to 196 s.
pub(super) const TIME_LIMIT: f64 = 240.0;
/// Rounds of [`TaskSpec::choices`] in which every place takes the target of its next objects.
const ROUNDS: usize = 8;

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
    /// an area. At first each variant has the targets of its next objects, as in
    /// [`TaskSpec::settled`], then every target that fits it.
    #[must_use]
    pub fn choices(&self, seed: u64, scene: &Scene) -> Vec<(&Variant, &str)> {
        let Some(query) = &self.query else {
            return Vec::new();
        };
        let site_of = |variant: &Variant| query.sites.iter().find(|s| s.name == variant.name);
        let mut variants: Vec<_> = self.area.variants.iter().collect();
        let mut random = stream(&self.name, seed, "choices");
        shuffle(&mut random, &mut variants);
        let sampled = variants.iter().map(|variant| {
            let site = site_of(variant).filter(|site| !site.targets.is_empty());
            let contents = site.map(|site| Contents::new(query, site, scene));
            contents.map_or_else(Vec::new, |contents| {
                let targets = contents.targets(&self.name, seed).take(ROUNDS);
                targets.map(|i| query.stock[i].object.as_str()).collect()
            })
        });
        let sampled: Vec<Vec<&str>> = sampled.collect();
        let rounds = (0..ROUNDS).flat_map(|round| {
            let each = variants.iter().zip(&sampled);
            each.filter_map(move |(variant, targets)| Some((*variant, *targets.get(round)?)))
        });
        let rest = variants.iter().flat_map(|variant| {
            let site = site_of(variant);
            let targets = site.map_or(&[][..], |site| &site.targets);
            let objects = targets.iter().map(|&i| query.stock[i].object.as_str());
            let handle = site.and_then(|site| site.handle.as_deref());
            objects.chain(handle).map(|target| (*variant, target))
        });
        let mut rest: Vec<_> = rest.collect();
        shuffle(&mut random, &mut rest);
        let mut choices: Vec<(&Variant, &str)> = Vec::new();
        for choice in rounds.chain(rest) {
            let is_known =
                |known: &&(&Variant, &str)| (known.0.name == choice.0.name) && known.1 == choice.1;
            if !choices.iter().any(|known| is_known(&known)) {
                choices.push(choice);
            }
        }
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
        let contents = Contents::new(query, site, scene);
        let named = |&i: &usize| stock[i].object == target;
        let objects = match target {
            "" => contents.sampled(&self.name, seed),
            _ => site
                .targets
                .iter()
                .copied()
                .find(named)
                .map(|target| contents.sampled_with(&self.name, seed, target)),
        };
        let Some((chosen, objects)) = objects else {
            let known = site.targets.iter().map(|&i| stock[i].object.as_str());
            let known: Vec<&str> = known.collect();
            return Err(self.place().key("target").wrong(
                format!("{target:?}"),
                format!("one of {} on {}", known.join(", "), site.from.words()),
                "name one of these, or none to sample it",
            ));
        };
        let mut variant = variant.clone();
        for own in contents.places(&objects) {
            variant.places.retain(|place| place.object != own.object);
            variant.places.insert(0, own);
        }
        let is_rival = |i: &&usize| **i != chosen && site.targets.contains(i);
        let rivals = objects.iter().filter(is_rival);
        let region = site.to.as_ref().map(|to| to.furniture.as_str());
        variant.regions = region.map(str::to_owned).into_iter().collect();
        let object = stock[chosen].object.as_str();
        let template = &query.template;
        let mut spec = Self {
            conditions: template.conditions(&self.template, Some([object, ""]), region)?,
            targets: vec![object.to_owned()],
            rivals: rivals.map(|&i| stock[i].object.clone()).collect(),
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
