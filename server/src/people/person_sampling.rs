//! Samples the open values of the person in a scenario.

use std::path::Path;

use super::file::{AppearancesFile, PersonFile, PostureList};
use super::folder::{FOLDER, bodies, find_known, read};
use super::random;
use super::setting::{PersonSetting, SampledPerson};
use crate::scene::SceneError;

/// Random streams.
const BODY: u64 = 11;
const POSTURE: u64 = 12;
const SKIN: u64 = 13;
const HAIR: u64 = 14;
const CLOTHES: u64 = 15;

impl PersonSetting {
    /// Samples open values from `scenario_seed`, unless they have been sampled before.
    ///
    /// # Errors
    /// When a name is not in `assets/people`; the error lists the available ones.
    pub fn sample(&self, assets: &Path, scenario_seed: u64) -> Result<SampledPerson, SceneError> {
        let seed = self.seed.unwrap_or(scenario_seed);
        let all = bodies(assets)?;
        let appearances: AppearancesFile = read(assets, &format!("{FOLDER}/looks.toml"))?;
        let postures: PostureList = read(assets, &format!("{FOLDER}/postures.toml"))?;
        let given = self.drawn.clone().unwrap_or_default();
        let pick = |what, given: &str, requested: &str, names: &[&str], row| {
            let name = if given.is_empty() { requested } else { given };
            if !name.is_empty() {
                return find_known(what, name, names).map(str::to_owned);
            }
            let chosen = names.get(random::index(seed, row, names.len()));
            Ok(chosen.copied().unwrap_or_default().to_owned())
        };
        let names: Vec<&str> = all.iter().map(String::as_str).collect();
        let body = pick("person.body", &given.body, &self.body, &names, BODY)?;
        let person: PersonFile = read(assets, &format!("{FOLDER}/{body}/person.toml"))?;
        let names: Vec<&str> = appearances.skin.iter().map(|s| s.name.as_str()).collect();
        let skin = pick("person.skin", &given.skin, &self.skin, &names, SKIN)?;
        let names: Vec<&str> = appearances
            .clothes
            .iter()
            .map(|c| c.name.as_str())
            .collect();
        let clothes = pick(
            "person.clothes",
            &given.clothes,
            &self.clothes,
            &names,
            CLOTHES,
        )?;
        let all = appearances.hair.iter().map(|h| h.name.as_str());
        let suits = appearances
            .hair
            .iter()
            .filter(|h| h.ages.contains(&person.age));
        // A requested hair colour is used as it is; a sampled one fits the body.
        let open = given.hair.is_empty() && self.hair.is_empty();
        let names: Vec<&str> = match open {
            true => suits.map(|h| h.name.as_str()).collect(),
            false => all.collect(),
        };
        let hair = pick("person.hair", &given.hair, &self.hair, &names, HAIR)?;
        let name = match given.posture.is_empty() {
            true => &self.posture,
            false => &given.posture,
        };
        let posture = match name.is_empty() {
            true => postures
                .at_share(random::uniform(seed, POSTURE, 0))
                .to_owned(),
            false => {
                let names: Vec<&str> = postures.names().collect();
                find_known("person.posture", name, &names)?.to_owned()
            }
        };
        Ok(SampledPerson {
            body,
            posture,
            skin,
            hair,
            clothes,
        })
    }
}
