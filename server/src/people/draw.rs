//! What a seed draws of who sits there, where the scenario leaves it open.

use std::path::Path;

use super::file::{Looks, PersonFile, PostureList};
use super::folder::{FOLDER, bodies, known, read};
use super::random;
use super::setting::{DrawnPerson, PersonSetting};
use crate::scene::SceneError;

/// Rows of random numbers.
const BODY: u64 = 11;
const POSTURE: u64 = 12;
const SKIN: u64 = 13;
const HAIR: u64 = 14;
const CLOTHES: u64 = 15;

impl PersonSetting {
    /// Draws what is left open by `scenario_seed`, unless it has been drawn.
    ///
    /// # Errors
    /// When a name is not one of those in `assets/people`; the error lists them.
    pub fn draw(&self, assets: &Path, scenario_seed: u64) -> Result<DrawnPerson, SceneError> {
        let seed = self.seed.unwrap_or(scenario_seed);
        let all = bodies(assets)?;
        let looks: Looks = read(assets, &format!("{FOLDER}/looks.toml"))?;
        let postures: PostureList = read(assets, &format!("{FOLDER}/postures.toml"))?;
        let given = self.drawn.clone().unwrap_or_default();
        let pick = |what, given: &str, asked: &str, names: &[&str], row| {
            let told = if given.is_empty() { asked } else { given };
            if !told.is_empty() {
                return known(what, told, names).map(str::to_owned);
            }
            let chosen = names.get(random::index(seed, row, names.len()));
            Ok(chosen.copied().unwrap_or_default().to_owned())
        };
        let names: Vec<&str> = all.iter().map(String::as_str).collect();
        let body = pick("person.body", &given.body, &self.body, &names, BODY)?;
        let person: PersonFile = read(assets, &format!("{FOLDER}/{body}/person.toml"))?;
        let names: Vec<&str> = looks.skin.iter().map(|s| s.name.as_str()).collect();
        let skin = pick("person.skin", &given.skin, &self.skin, &names, SKIN)?;
        let names: Vec<&str> = looks.clothes.iter().map(|c| c.name.as_str()).collect();
        let clothes = pick(
            "person.clothes",
            &given.clothes,
            &self.clothes,
            &names,
            CLOTHES,
        )?;
        let all = looks.hair.iter().map(|h| h.name.as_str());
        let suits = looks.hair.iter().filter(|h| h.ages.contains(&person.age));
        // Asked for, any hair will do; drawn, it suits.
        let open = given.hair.is_empty() && self.hair.is_empty();
        let names: Vec<&str> = match open {
            true => suits.map(|h| h.name.as_str()).collect(),
            false => all.collect(),
        };
        let hair = pick("person.hair", &given.hair, &self.hair, &names, HAIR)?;
        let told = match given.posture.is_empty() {
            true => &self.posture,
            false => &given.posture,
        };
        let posture = match told.is_empty() {
            true => postures
                .at_share(random::uniform(seed, POSTURE, 0))
                .to_owned(),
            false => {
                let names: Vec<&str> = postures.names().collect();
                known("person.posture", told, &names)?.to_owned()
            }
        };
        Ok(DrawnPerson {
            body,
            posture,
            skin,
            hair,
            clothes,
        })
    }
}
