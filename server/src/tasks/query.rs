//! Queries of a task for objects by properties instead of names, resolved against the
//! contents of an area. A query without a match reports the available objects.

use serde::Deserialize;

use super::area::{AreaSpec, Variant};
use crate::scene::{Body, Place, Scene, SceneError};

/// Properties that must all match.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Query {
    pub name: Option<String>,
    pub category: Option<String>,
    pub colour: Option<String>,
}

impl Query {
    pub(super) fn fits(&self, body: &Body) -> bool {
        let fits =
            |wanted: &Option<String>, is: &str| wanted.as_deref().is_none_or(|wanted| wanted == is);
        fits(&self.name, &body.name)
            && fits(&self.category, &body.category)
            && fits(&self.colour, &body.colour)
    }

    /// Names of the matching objects of an area that can be grasped and exist in some
    /// variant.
    pub(super) fn objects(
        &self,
        place: &Place,
        area: &AreaSpec,
        scene: &Scene,
    ) -> Result<Vec<String>, SceneError> {
        let offered = |body: &&Body| {
            let mut variants = area.variants.iter();
            let is_certain = |v: &Variant| v.place(&body.name).is_some_and(|p| p.is_certain());
            !body.grasps.is_empty() && variants.any(is_certain)
        };
        let candidates: Vec<&Body> = scene.objects.iter().filter(offered).collect();
        self.among(place, &candidates, "objects that can be grasped", area)
    }

    /// Names of the matching furniture of an area that slides and can be grasped.
    pub(super) fn sliding(
        &self,
        place: &Place,
        area: &AreaSpec,
        scene: &Scene,
    ) -> Result<Vec<String>, SceneError> {
        let candidates: Vec<_> = area
            .sliding(scene)
            .filter(|b| !b.grasps.is_empty())
            .collect();
        self.among(place, &candidates, "furniture that slides", area)
    }

    /// Name of the single matching region of an area.
    pub(super) fn region(
        &self,
        place: &Place,
        area: &AreaSpec,
        scene: &Scene,
    ) -> Result<String, SceneError> {
        let is_region = |name: &String| area.variants.iter().any(|v| v.regions.contains(name));
        let bodies = scene.furniture.iter();
        let candidates: Vec<_> = bodies.filter(|body| is_region(&body.name)).collect();
        let mut found = self.among(place, &candidates, "regions", area)?;
        if found.len() > 1 {
            return Err(place.wrong(
                format!("{self}, which {} are", found.join(" and ")),
                "one region",
                "name the one that is meant",
            ));
        }
        Ok(found.remove(0))
    }

    fn among(
        &self,
        place: &Place,
        candidates: &[&Body],
        what: &str,
        area: &AreaSpec,
    ) -> Result<Vec<String>, SceneError> {
        let found: Vec<String> = candidates
            .iter()
            .filter(|body| self.fits(body))
            .map(|body| body.name.clone())
            .collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let words = |body: &&Body| {
            let words = [body.colour.as_str(), body.category.as_str()];
            let words: Vec<_> = words.into_iter().filter(|word| !word.is_empty()).collect();
            match words.is_empty() {
                true => body.name.clone(),
                false => format!("{} ({})", body.name, words.join(" ")),
            }
        };
        let known: Vec<_> = candidates.iter().map(words).collect();
        let known = match known.is_empty() {
            true => "none".to_owned(),
            false => known.join(", "),
        };
        Err(place.wrong(
            format!("{self}"),
            format!("a match among the {what} of {}: {known}", area.name),
            format!(
                "request one of these, or add it to areas/{}.toml",
                area.name
            ),
        ))
    }
}

impl std::fmt::Display for Query {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [
            ("name", &self.name),
            ("category", &self.category),
            ("colour", &self.colour),
        ];
        let words = words.into_iter();
        let words = words.filter_map(|(key, word)| Some(format!("{key} {:?}", word.as_ref()?)));
        let words: Vec<_> = words.collect();
        f.write_str(&match words.is_empty() {
            true => "anything".to_owned(),
            false => words.join(" and "),
        })
    }
}
