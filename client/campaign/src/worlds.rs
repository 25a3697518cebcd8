//! Homes, objects, words and looks that training may use, and those that are kept for tests.
//!
//! [`SHIPPED`] lists both sides and is frozen by a hash. `collect` and `multiply` refuse what is
//! kept for tests in data for training; `evaluate` refuses a split that mixes both sides.

use std::path::Path;

use anyhow::{Context, bail};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use wheelarm_homes::own_home::OwnHomeId;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{TaskSources, tasks_of_program};

use crate::frozen;

/// The file in the assets.
pub const SHIPPED: &str = "assets/splits/worlds/worlds-1.toml";

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

fn named<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    let name = String::deserialize(from)?;
    T::from_name(&name).map_err(D::Error::custom)
}

/// `homes` of a plan or a split: a side of [`SHIPPED`], or a list.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub enum HomesFile {
    /// `train` or `held_out`.
    Side(String),
    /// Names of scenes.
    List(Vec<String>),
}

impl HomesFile {
    /// The names.
    ///
    /// # Errors
    /// With the fix, when the side is unknown, the list is empty or has a name twice.
    pub fn names(self) -> Result<Vec<String>, String> {
        let names = match self {
            Self::List(names) => names,
            Self::Side(side) => {
                let worlds = Worlds::shipped().map_err(|error| format!("{error:#}"))?;
                match side.as_str() {
                    "train" => worlds.train.homes,
                    "held_out" => worlds.held_out.homes,
                    _ => {
                        return Err(format!(
                            "homes = {side:?} is not a side of {SHIPPED}; write \"train\", \"held_out\" or a list of homes"
                        ));
                    }
                }
            }
        };
        if names.is_empty() {
            return Err("homes is empty; remove it, or name a home".to_owned());
        }
        for (i, name) in names.iter().enumerate() {
            if wheelarm_proto::keys::check_name(name).is_err() {
                return Err(format!(
                    "home {name:?} must be 1 to 64 letters, digits, `-` or `_`"
                ));
            }
            if names[..i].contains(name) {
                return Err(format!("homes lists {name:?} twice; remove one"));
            }
        }
        Ok(names)
    }
}

impl Worlds {
    /// Reads [`SHIPPED`].
    ///
    /// # Errors
    /// As [`Worlds::read`].
    pub fn shipped() -> anyhow::Result<Self> {
        Self::read(&file_or_asset(Path::new(SHIPPED)))
    }

    /// Reads a file and compares it with its hash.
    ///
    /// # Errors
    /// With the file and the fix.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = crate::text_file::read(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let worlds: Self =
            toml::from_str(&text).with_context(|| format!("cannot read {}", path.display()))?;
        frozen::check(path, &text, worlds.frozen.as_deref())?;
        Ok(worlds)
    }

    /// Why a home is kept for tests; `None` when training may use it.
    #[must_use]
    pub fn held_out_home(&self, scene: &str, style: &str) -> Option<String> {
        let held_out = &self.held_out;
        let id = OwnHomeId::from_name(scene);
        let plan = id.as_ref().map_or(scene, |id| id.plan.as_str());
        let style = id.as_ref().map_or(style, |id| id.style.as_str());
        let has = |list: &[String], name: &str| list.iter().any(|known| known == name);
        if has(&held_out.plans, plan) {
            return Some(format!("the home {scene:?} is of the plan {plan:?}"));
        }
        if has(&held_out.styles, style) {
            return Some(format!("the home {scene:?} is of the style {style:?}"));
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
        if let Some(home) = self.held_out_home(&scenario.scene, &scenario.home_style) {
            return Some(home);
        }
        let mut objects = scenario.objects.iter().map(|object| &object.name);
        if let Some(name) = objects.find(|name| self.is_held_out_object(name)) {
            return Some(format!("the object {name:?}"));
        }
        let split = scenario.language.as_ref().map(v1::Language::split);
        if split.is_some_and(|split| split == self.held_out.sentences.code()) {
            return Some("a sentence of held-out words".to_owned());
        }
        let appearance = scenario.appearance.as_ref();
        let look = appearance.filter(|look| Purpose::of_seed(look.seed) == self.held_out.looks);
        look.map(|look| format!("the visual randomization of seed {}", look.seed))
    }

    /// Rejects data for training that uses what is kept for tests.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_training(&self, scenario: &v1::Scenario) -> Result<(), String> {
        match self.held_out_part(scenario) {
            None => Ok(()),
            Some(part) => Err(format!(
                "{part} is kept for tests ({SHIPPED}), and this is data for training; {FIX}"
            )),
        }
    }

    /// Rejects homes for training that are kept for tests.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_training_homes(&self, homes: &[String]) -> Result<(), String> {
        match homes.iter().find_map(|home| self.held_out_home(home, "")) {
            None => Ok(()),
            Some(part) => Err(format!(
                "{part} is kept for tests ({SHIPPED}), and this is data for training; {FIX}"
            )),
        }
    }

    /// Rejects homes of a test of which only some are kept for tests: their mean would be
    /// neither a result for homes of training nor one for others.
    ///
    /// # Errors
    /// With the fix.
    pub fn check_one_side(&self, homes: &[String]) -> anyhow::Result<()> {
        let is_held_out = |home: &&String| self.held_out_home(home, "").is_some();
        let (held_out, others): (Vec<_>, Vec<_>) = homes.iter().partition(is_held_out);
        if let (Some(one), Some(other)) = (held_out.first(), others.first()) {
            bail!(
                "homes mixes {one:?}, which is kept for tests, with {other:?}, which training may use; make two splits and report them separately"
            );
        }
        Ok(())
    }
}

/// Lists the tasks of the scene of `sources`, or of homes: of the first ones until all `wanted`
/// tasks are listed. What a home offers depends on its rooms and furniture.
///
/// # Errors
/// When the program is missing or a home cannot be used.
pub(crate) fn tasks_of_homes(
    sources: TaskSources<'_>,
    homes: &[String],
    wanted: &[&str],
) -> anyhow::Result<Vec<v1::TaskInfo>> {
    if homes.is_empty() {
        return tasks_of_program(sources);
    }
    let mut listed: Vec<v1::TaskInfo> = Vec::new();
    for scene in homes {
        let is_listed = |name: &str| listed.iter().any(|task| task.name == name);
        if !listed.is_empty() && wanted.iter().all(|name| is_listed(name)) {
            break;
        }
        for task in tasks_of_program(TaskSources { scene, ..sources })? {
            if listed.iter().all(|known| known.name != task.name) {
                listed.push(task);
            }
        }
    }
    Ok(listed)
}

/// How to correct data for training.
const FIX: &str = "use homes = \"train\" of [variation], other objects, split = \"train\" of [variation.language], or a purpose of tests";

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_homes::layout::Catalog;

    fn assets() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
    }

    #[test]
    fn sides_are_frozen_disjoint_and_agree_with_the_data() {
        let worlds = Worlds::shipped().unwrap_or_else(|error| panic!("{error:#}"));
        let (train, held_out) = (&worlds.train, &worlds.held_out);
        for (one, other) in [
            (&train.homes, &held_out.homes),
            (&train.plans, &held_out.plans),
            (&train.styles, &held_out.styles),
            (&train.categories, &held_out.categories),
        ] {
            assert!(!one.is_empty() && !other.is_empty());
            assert!(one.iter().all(|name| !other.contains(name)), "{one:?}");
        }
        assert_ne!(train.sentences, held_out.sentences);
        assert_ne!(train.looks, held_out.looks);
        assert_eq!(worlds.check_training_homes(&train.homes), Ok(()));
        for home in &held_out.homes {
            assert!(worlds.held_out_home(home, "").is_some(), "{home}");
        }
        let catalog = Catalog::read(&assets()).unwrap();
        let names = |held_out: bool| {
            let plans = catalog
                .plans
                .iter()
                .filter(|(_, plan)| plan.held_out == held_out)
                .map(|(name, _)| name.clone());
            let styles = catalog
                .styles
                .iter()
                .filter(|(_, style)| style.held_out == held_out)
                .map(|(name, _)| name.clone());
            [
                plans.collect::<Vec<String>>(),
                styles.collect::<Vec<String>>(),
            ]
        };
        assert_eq!(names(false), [train.plans.clone(), train.styles.clone()]);
        assert_eq!(
            names(true),
            [held_out.plans.clone(), held_out.styles.clone()]
        );
    }

    #[test]
    fn held_out_kinds_and_categories_agree_with_the_kinds_of_objects() {
        #[derive(Deserialize)]
        struct Kinds {
            kind: Vec<Kind>,
        }
        #[derive(Deserialize)]
        struct Kind {
            name: String,
            category: String,
            #[serde(default)]
            held_out: bool,
        }
        let text = std::fs::read_to_string(assets().join("kinds.toml")).unwrap();
        let kinds: Kinds = toml::from_str(&text).unwrap();
        let worlds = Worlds::shipped().unwrap();
        for kind in &kinds.kind {
            let is_listed = worlds.is_held_out_object(&format!("{}-white", kind.name));
            assert_eq!(is_listed, kind.held_out, "{}", kind.name);
            let mut alike = kinds
                .kind
                .iter()
                .filter(|one| one.category == kind.category);
            let category = match alike.all(|one| one.held_out) {
                true => &worlds.held_out.categories,
                false => &worlds.train.categories,
            };
            assert!(category.contains(&kind.category), "{}", kind.category);
        }
    }

    #[test]
    fn objects_of_shipped_packs_are_marked_as_their_kinds_are() {
        let worlds = Worlds::shipped().unwrap();
        let store = wheelarm_pack::Store::new(vec![assets().join("packs")]);
        for (name, path) in store.candidates() {
            let pack = wheelarm_pack::Pack::open(&path).unwrap();
            for object in pack.names("objects", "toml") {
                let file = &pack.files()[&format!("objects/{object}.toml")];
                let file: wheelarm_pack::ObjectFile =
                    toml::from_str(&String::from_utf8_lossy(file)).unwrap();
                let is_marked = file.stock.is_some_and(|stock| stock.held_out);
                assert_eq!(
                    is_marked,
                    worlds.is_held_out_object(object),
                    "{object} of {name}: make assets writes held_out of assets/kinds.toml"
                );
            }
        }
    }

    #[test]
    fn data_for_training_is_refused_what_is_kept_for_tests() {
        let worlds = Worlds::shipped().unwrap();
        let scenario = |scene: &str| v1::Scenario {
            scene: scene.to_owned(),
            ..v1::Scenario::default()
        };
        assert_eq!(worlds.check_training(&scenario("studio-nordic-3")), Ok(()));
        assert_eq!(worlds.check_training(&scenario("home")), Ok(()));
        let plan = v1::Scenario {
            layout_seed: Some(3),
            ..scenario("loft")
        };
        let style = v1::Scenario {
            layout_seed: Some(3),
            home_style: "modern".to_owned(),
            ..scenario("studio")
        };
        let sentence = v1::Scenario {
            language: Some(v1::Language {
                split: v1::LanguageSplit::HeldOut.into(),
                ..v1::Language::default()
            }),
            ..scenario("home")
        };
        let look = v1::Scenario {
            appearance: Some(v1::Appearance {
                seed: 503,
                light: 2,
                ..v1::Appearance::default()
            }),
            ..scenario("home")
        };
        for (held_out, word) in [
            (scenario("loft-nordic-3"), "loft"),
            (scenario("studio-modern-3"), "modern"),
            (plan, "loft"),
            (style, "modern"),
            (sentence, "held-out words"),
            (look, "503"),
        ] {
            let error = worlds.check_training(&held_out).unwrap_err();
            assert!(error.contains(word) && error.contains("homes ="), "{error}");
        }
    }

    #[test]
    fn homes_of_a_test_are_of_one_side() {
        let worlds = Worlds::shipped().unwrap();
        let check = |homes: &[&str]| {
            let homes: Vec<String> = homes.iter().map(|home| (*home).to_owned()).collect();
            worlds.check_one_side(&homes).map_err(|e| e.to_string())
        };
        assert_eq!(check(&["loft-nordic-3", "studio-modern-1"]), Ok(()));
        assert_eq!(check(&["studio-nordic-3"]), Ok(()));
        let error = check(&["studio-nordic-3", "loft-nordic-3"]).unwrap_err();
        assert!(error.contains("two splits"), "{error}");
    }

    #[test]
    fn list_of_homes_is_checked() {
        for (homes, word) in [
            (HomesFile::Side("all".to_owned()), "held_out"),
            (HomesFile::List(Vec::new()), "empty"),
            (
                HomesFile::List(vec!["a".to_owned(), "a".to_owned()]),
                "twice",
            ),
            (HomesFile::List(vec!["a b".to_owned()]), "letters"),
        ] {
            let error = homes.names().unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
