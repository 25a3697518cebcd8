//! What a task asks for, by words instead of by name: resolved against what an
//! area offers. A query that nothing there satisfies says what there is.

use serde::Deserialize;

use super::area::{AreaSpec, Variant};
use crate::scene::{Body, Place, Scene, SceneError};

/// Words that all must fit.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Query {
    name: Option<String>,
    category: Option<String>,
    colour: Option<String>,
}

impl Query {
    fn fits(&self, body: &Body) -> bool {
        let fits =
            |asked: &Option<String>, is: &str| asked.as_deref().is_none_or(|asked| asked == is);
        fits(&self.name, &body.name)
            && fits(&self.category, &body.category)
            && fits(&self.colour, &body.colour)
    }

    /// Names of the objects of an area that fit, can be grasped and are there in
    /// some variant whenever it is drawn.
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
        let things: Vec<&Body> = scene.objects.iter().filter(offered).collect();
        self.among(place, &things, "objects that can be grasped", area)
    }

    /// Names of the furniture of an area that fits, slides and can be grasped.
    pub(super) fn sliding(
        &self,
        place: &Place,
        area: &AreaSpec,
        scene: &Scene,
    ) -> Result<Vec<String>, SceneError> {
        let things: Vec<_> = area
            .sliding(scene)
            .filter(|b| !b.grasps.is_empty())
            .collect();
        self.among(place, &things, "furniture that slides", area)
    }

    /// Name of the one region of an area that fits.
    pub(super) fn region(
        &self,
        place: &Place,
        area: &AreaSpec,
        scene: &Scene,
    ) -> Result<String, SceneError> {
        let is_region = |name: &String| area.variants.iter().any(|v| v.regions.contains(name));
        let bodies = scene.furniture.iter();
        let things: Vec<_> = bodies.filter(|body| is_region(&body.name)).collect();
        let mut found = self.among(place, &things, "regions", area)?;
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
        things: &[&Body],
        what: &str,
        area: &AreaSpec,
    ) -> Result<Vec<String>, SceneError> {
        let found: Vec<String> = things
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
        let known: Vec<_> = things.iter().map(words).collect();
        let known = match known.is_empty() {
            true => "none".to_owned(),
            false => known.join(", "),
        };
        Err(place.wrong(
            format!("{self}"),
            format!("what fits one of the {what} of {}: {known}", area.name),
            format!(
                "ask for one of these, or add it to areas/{}.toml",
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
