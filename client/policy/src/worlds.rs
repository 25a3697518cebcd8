//! Homes, objects, words and looks that training may use, and those that are kept for tests.
//!
//! The file [`SHIPPED`] lists both sides and is frozen by a hash. Programs that make data for
//! training, and programs that train, refuse what is kept for tests.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;

use crate::frozen;

/// The file in the assets.
pub const SHIPPED: &str = "assets/splits/worlds/worlds-1.toml";
/// The file of the packs of objects of both sides, frozen by a hash of its own.
pub const SHIPPED_OBJECTS: &str = "assets/splits/worlds/objects-1.toml";
/// Purposes of seeds of published results: no training uses them.
const CLAIMS: [Purpose; 2] = [Purpose::PolicyClaim, Purpose::OperatorClaim];

/// Both sides.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Worlds {
    frozen: Option<String>,
    /// For training and for tests of other seeds.
    pub train: Side,
    /// For tests alone.
    pub held_out: Side,
}

/// One side.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Side {
    /// Own homes of campaigns, PLAN-STYLE-SEED. Each of them is ready.
    pub homes: Vec<String>,
    /// Plans of own homes.
    pub plans: Vec<String>,
    /// Styles of own homes.
    pub styles: Vec<String>,
    /// Categories of objects.
    pub categories: Vec<String>,
    /// Kinds of objects; of the side of training all others.
    #[serde(default)]
    pub objects: Vec<String>,
    /// Templates and names of sentences.
    #[serde(deserialize_with = "named")]
    pub sentences: LanguageSplit,
    /// Purpose of the seeds of visual randomization.
    #[serde(deserialize_with = "named")]
    pub looks: Purpose,
}

/// Packs of the objects of both sides; in them the held-out objects are marked.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ObjectPacks {
    frozen: Option<String>,
    /// The packs.
    #[serde(rename = "pack")]
    pub packs: Vec<ObjectPack>,
}

impl ObjectPacks {
    /// Reads the text of a file and compares it with its hash.
    ///
    /// # Errors
    /// [`WorldsError`].
    pub fn parse(text: &str) -> Result<Self, WorldsError> {
        let objects: Self = toml::from_str(text)?;
        frozen::check(text, objects.frozen.as_deref())?;
        Ok(objects)
    }

    /// As a field of a scenario.
    #[must_use]
    pub fn refs(&self) -> Vec<v1::PackRef> {
        let refs = self.packs.iter().map(|pack| v1::PackRef {
            name: pack.name.clone(),
            version: pack.version.clone(),
            physics_digest: pack.physics.clone(),
            ..v1::PackRef::default()
        });
        refs.collect()
    }
}

/// A pack whose objects the tasks of homes place.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct ObjectPack {
    /// Name.
    pub name: String,
    /// Version, for messages.
    pub version: String,
    /// Its physics digest, hexadecimal: shapes, masses, grasps and verdicts of trials.
    pub physics: String,
}

/// What an episode uses of the worlds.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(default)]
pub struct Used {
    /// Scene.
    pub home: String,
    /// Style of an own home that the scene does not name.
    pub style: String,
    /// Objects in the scene.
    pub objects: Vec<String>,
    /// Their categories, where they are known.
    pub categories: Vec<String>,
    /// Split of the grammar; empty for a sentence of the task.
    pub sentences: String,
    /// Seed of visual randomization.
    pub appearance_seed: Option<u64>,
    /// Seed of the scenario.
    pub seed: Option<u64>,
}

impl Used {
    /// Of a scenario. The categories of its objects are not known.
    #[must_use]
    pub fn from_scenario(scenario: &v1::Scenario) -> Self {
        let split = scenario.language.as_ref().map(v1::Language::split);
        Self {
            home: scenario.scene.clone(),
            style: scenario.home_style.clone(),
            objects: scenario.objects.iter().map(|o| o.name.clone()).collect(),
            categories: Vec::new(),
            sentences: split
                .and_then(LanguageSplit::from_proto)
                .map_or_else(String::new, |split| split.name().to_owned()),
            appearance_seed: scenario.appearance.as_ref().map(|look| look.seed),
            seed: scenario.seed,
        }
    }
}

/// A file of worlds that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorldsError {
    /// It is not TOML of this form.
    #[error("{0}")]
    Malformed(#[from] toml::de::Error),
    /// Its content has another hash than it states.
    #[error("{0}")]
    Frozen(#[from] frozen::FrozenError),
}

impl Worlds {
    /// Reads the text of a file and compares it with its hash.
    ///
    /// # Errors
    /// [`WorldsError`].
    pub fn parse(text: &str) -> Result<Self, WorldsError> {
        let worlds: Self = toml::from_str(text)?;
        frozen::check(text, worlds.frozen.as_deref())?;
        Ok(worlds)
    }

    /// The hash that freezes the file.
    #[must_use]
    pub fn hash(&self) -> &str {
        self.frozen.as_deref().unwrap_or_default()
    }

    /// The side with this name: `train` or `held_out`.
    #[must_use]
    pub fn side(&self, name: &str) -> Option<&Side> {
        match name {
            "train" => Some(&self.train),
            "held_out" => Some(&self.held_out),
            _ => None,
        }
    }

    /// Why a home is kept for tests; `None` when training may use it.
    #[must_use]
    pub fn held_out_home(&self, scene: &str, style: &str) -> Option<String> {
        let held_out = &self.held_out;
        let (plan, own_style) = plan_and_style(scene).unwrap_or((scene, style));
        let has = |list: &[String], name: &str| list.iter().any(|known| known == name);
        if has(&held_out.plans, plan) {
            return Some(format!("the home {scene:?} is of the plan {plan:?}"));
        }
        if has(&held_out.styles, own_style) {
            return Some(format!("the home {scene:?} is of the style {own_style:?}"));
        }
        has(&held_out.homes, scene).then(|| format!("the home {scene:?}"))
    }

    /// Whether an object is kept for tests, by its kind: its name up to `-`, or without a number.
    #[must_use]
    pub fn is_held_out_object(&self, name: &str) -> bool {
        let kind = name.split_once('-').map_or(name, |(kind, _)| kind);
        let number = kind.rsplit_once('_').filter(|(_, number)| {
            !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
        });
        let plain = number.map_or(kind, |(plain, _)| plain);
        let all = &self.held_out.objects;
        all.iter().any(|known| known == kind || known == plain)
    }

    /// What of a scenario is kept for tests; `None` when training may use all of it.
    #[must_use]
    pub fn held_out_part(&self, scenario: &v1::Scenario) -> Option<String> {
        self.held_out_in(&Used::from_scenario(scenario))
    }

    /// What of an episode is kept for tests; `None` when training may use all of it.
    #[must_use]
    pub fn held_out_in(&self, used: &Used) -> Option<String> {
        if let Some(home) = self.held_out_home(&used.home, &used.style) {
            return Some(home);
        }
        let mut objects = used.objects.iter();
        if let Some(name) = objects.find(|name| self.is_held_out_object(name)) {
            return Some(format!("the object {name:?}"));
        }
        let held_out = &self.held_out;
        let mut categories = used.categories.iter();
        if let Some(name) = categories.find(|name| held_out.categories.contains(name)) {
            return Some(format!("an object of the category {name:?}"));
        }
        if used.sentences == held_out.sentences.name() {
            return Some("a sentence of held-out words".to_owned());
        }
        let look = used.appearance_seed;
        let look = look.filter(|seed| Purpose::of_seed(*seed) == held_out.looks);
        look.map(|seed| format!("the visual randomization of seed {seed}"))
    }

    /// Rejects an episode for training that uses what is kept for tests, or a seed of published
    /// results.
    ///
    /// # Errors
    /// With the reason; the caller adds the fix.
    pub fn check_episode(&self, used: &Used) -> Result<(), String> {
        if let Some(part) = self.held_out_in(used) {
            return Err(format!("{part} is kept for tests"));
        }
        if !["", self.train.sentences.name()].contains(&used.sentences.as_str()) {
            return Err(format!(
                "a sentence of the split {:?} may have held-out words",
                used.sentences
            ));
        }
        match used.seed.map(|seed| (seed, Purpose::of_seed(seed))) {
            Some((seed, purpose)) if CLAIMS.contains(&purpose) => Err(format!(
                "the seed {seed} is for {}, those for training are {}",
                purpose.name(),
                Purpose::Train.seeds()
            )),
            _ => Ok(()),
        }
    }

    /// Rejects data for training that uses what is kept for tests.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_training(&self, scenario: &v1::Scenario) -> Result<(), String> {
        refused(self.held_out_part(scenario))
    }

    /// Rejects homes for training that are kept for tests.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_training_homes(&self, homes: &[String]) -> Result<(), String> {
        refused(homes.iter().find_map(|home| self.held_out_home(home, "")))
    }

    /// Rejects homes of a test of which only some are kept for tests: their mean would be
    /// neither a result for homes of training nor one for others.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_one_side(&self, homes: &[String]) -> Result<(), String> {
        let is_held_out = |home: &&String| self.held_out_home(home, "").is_some();
        let (held_out, others): (Vec<_>, Vec<_>) = homes.iter().partition(is_held_out);
        match (held_out.first(), others.first()) {
            (Some(one), Some(other)) => Err(format!(
                "homes mixes {one:?}, which is kept for tests, with {other:?}, which training may use; make two splits and report them separately"
            )),
            _ => Ok(()),
        }
    }
}

fn named<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    let name = String::deserialize(from)?;
    T::from_name(&name).map_err(D::Error::custom)
}

/// Plan and style of an own home, PLAN-STYLE-SEED.
fn plan_and_style(scene: &str) -> Option<(&str, &str)> {
    let (rest, seed) = scene.rsplit_once('-')?;
    seed.parse::<u64>().ok()?;
    rest.rsplit_once('-')
}

/// The error for a part of data for training that is kept for tests.
fn refused(part: Option<String>) -> Result<(), String> {
    match part {
        None => Ok(()),
        Some(part) => Err(format!(
            "{part} is kept for tests ({SHIPPED}), and this is data for training; {FIX}"
        )),
    }
}

/// How to correct data for training.
const FIX: &str = "use homes = \"train\" and objects = \"train\" of [variation], split = \"train\" of [variation.language], or a purpose of tests";
