//! Homes and objects of a campaign, by the sides of [`SHIPPED`].
//!
//! `collect` and `multiply` refuse what is kept for tests in data for training; `evaluate`
//! refuses a split that mixes both sides.

use std::path::Path;

use anyhow::Context;
use serde::Deserialize;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{TaskSources, tasks_of_program};

pub use wheelarm_policy::worlds::{ObjectPacks, SHIPPED, SHIPPED_OBJECTS, Worlds, WorldsError};

/// Reads [`SHIPPED`].
///
/// # Errors
/// With the file and the fix.
pub fn shipped() -> anyhow::Result<Worlds> {
    read(SHIPPED, Worlds::parse)
}

/// Reads [`SHIPPED_OBJECTS`].
///
/// # Errors
/// With the file and the fix.
pub fn shipped_objects() -> anyhow::Result<ObjectPacks> {
    read(SHIPPED_OBJECTS, ObjectPacks::parse)
}

fn read<T>(file: &str, parse: fn(&str) -> Result<T, WorldsError>) -> anyhow::Result<T> {
    let path = file_or_asset(Path::new(file));
    let read = || -> anyhow::Result<T> { Ok(parse(&crate::text_file::read(&path)?)?) };
    read().with_context(|| format!("cannot read {}", path.display()))
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
                let worlds = shipped().map_err(|error| format!("{error:#}"))?;
                let Some(side) = worlds.side(&side) else {
                    return Err(format!(
                        "homes = {side:?} is not a side of {SHIPPED}; write \"train\", \"held_out\" or a list of homes"
                    ));
                };
                side.homes.clone()
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

/// Packs of objects and their split in a scenario, for `objects` of a plan or a split: the name
/// of a side of [`SHIPPED`].
///
/// # Errors
/// With the fix, when the side does not exist, or the scenario names packs or a split itself.
pub fn set_objects(side: &str, scenario: &mut v1::Scenario) -> Result<(), String> {
    if !scenario.packs.is_empty() || !scenario.object_split.is_empty() {
        return Err(
            "objects, and packs or object_split of [scenario], exclude each other; remove one"
                .to_owned(),
        );
    }
    let in_words = |error: anyhow::Error| format!("{error:#}");
    if shipped().map_err(in_words)?.side(side).is_none() {
        return Err(format!(
            "objects = {side:?} is not a side of {SHIPPED}; write \"train\" or \"held_out\", or name packs in [[scenario.packs]]"
        ));
    }
    scenario.packs = shipped_objects().map_err(in_words)?.refs();
    side.clone_into(&mut scenario.object_split);
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_homes::layout::Catalog;

    fn assets() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
    }

    #[test]
    fn sides_are_frozen_disjoint_and_agree_with_the_data() {
        let worlds = shipped().unwrap_or_else(|error| panic!("{error:#}"));
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
        let worlds = shipped().unwrap();
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
        let worlds = shipped().unwrap();
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
    fn packs_of_both_sides_are_the_shipped_ones() {
        let store = wheelarm_pack::Store::new(vec![assets().join("packs")]);
        let packs = store.candidates().into_iter();
        let packs = packs.map(|(_, path)| wheelarm_pack::Pack::open(&path).unwrap());
        let shipped = packs.filter(|pack| pack.home().is_none()).map(|pack| {
            let id = pack.id();
            (
                id.name.clone(),
                id.version.clone(),
                wheelarm_pack::to_hex(&id.physics),
            )
        });
        let shipped: Vec<_> = shipped.collect();
        let listed = shipped_objects().unwrap_or_else(|error| panic!("{error:#}"));
        let listed = listed.packs.into_iter();
        let listed: Vec<_> = listed.map(|p| (p.name, p.version, p.physics)).collect();
        assert_eq!(
            listed, shipped,
            "{SHIPPED_OBJECTS} freezes packs that have changed: write the new ones into a file of another name"
        );
    }

    #[test]
    fn objects_of_a_side_are_packs_with_digests_and_a_split() {
        let mut scenario = v1::Scenario::default();
        assert_eq!(set_objects("held_out", &mut scenario), Ok(()));
        assert_eq!(scenario.object_split, "held_out");
        assert!(scenario.packs.len() >= 4);
        assert!(
            scenario
                .packs
                .iter()
                .all(|pack| pack.physics_digest.len() == 64)
        );
        let twice = set_objects("train", &mut scenario).unwrap_err();
        assert!(twice.contains("exclude each other"), "{twice}");
        let unknown = set_objects("all", &mut v1::Scenario::default()).unwrap_err();
        assert!(unknown.contains("held_out"), "{unknown}");
    }

    #[test]
    fn data_for_training_is_refused_what_is_kept_for_tests() {
        let worlds = shipped().unwrap();
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
        let worlds = shipped().unwrap();
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
