//! A suite: a frozen file of cells, each with one change of the scenario, on the same seeds.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use toml::Spanned;
use wheelarm_policy::ledger::Kind;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1;

use super::super::entry::Job;
use super::super::scope::named;
use crate::axis::AxisAt;
use crate::frozen::hash;
use crate::variation::{Variation, VariationFile};

/// Name of the cell that the others are compared with.
pub const BASE: &str = "base";
/// Greatest strength of a cell.
const MAX_STRENGTH: u32 = 3;
/// Folder of the shipped suites.
const SHIPPED: &str = "assets/suites";

/// A suite.
#[derive(Clone, Debug, PartialEq)]
pub struct Suite {
    /// Name: that of the file.
    pub name: String,
    /// Hash of its content, which is also in the file.
    pub hash: String,
    /// Seeds of every task in every cell.
    pub seeds: Range<u64>,
    /// Cells, the base first.
    pub cells: Vec<Cell>,
}

/// A cell of a suite: all its episodes have the same change.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Name, for example `light-2`.
    pub name: String,
    /// Axis of the change; empty for the base.
    pub axis: String,
    /// Strength of the change, 1 to 3; 0 for the base.
    pub strength: u32,
    /// Name of the cell that it is compared with; empty for the base.
    pub against: String,
    /// Tasks.
    pub tasks: Vec<String>,
    /// Scenes, used in turn by the seeds; empty for the default scene.
    pub scenes: Vec<String>,
    /// Content that the policy must not have been trained on.
    pub unseen: BTreeSet<Kind>,
    /// Scenarios of its episodes.
    pub variation: Variation,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SuiteFile {
    #[serde(deserialize_with = "named")]
    purpose: Purpose,
    seeds: [u64; 2],
    tasks: Vec<String>,
    #[serde(default)]
    unseen: BTreeSet<Kind>,
    #[serde(default)]
    scenario: toml::Table,
    #[serde(default)]
    variation: toml::Table,
    cell: Vec<CellFile>,
    frozen: Option<String>,
}

/// `[[cell]]`: its tables are added to those of the suite.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CellFile {
    name: String,
    #[serde(default)]
    axis: String,
    #[serde(default)]
    strength: u32,
    against: Option<String>,
    #[serde(default)]
    axes: Vec<AxisAt>,
    #[serde(default)]
    scenario: toml::Table,
    #[serde(default)]
    variation: toml::Table,
    #[serde(default)]
    scenes: Vec<String>,
    tasks: Option<Vec<String>>,
    #[serde(default)]
    unseen: BTreeSet<Kind>,
}

/// Scenario and variation of a cell.
#[derive(Deserialize)]
struct Settings {
    scenario: Spanned<v1::Scenario>,
    variation: VariationFile,
}

impl Suite {
    /// Reads a suite and compares it with the hash that froze it.
    ///
    /// # Errors
    /// When it cannot be read, is invalid, is not frozen, or was changed.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let path = &file_or_asset(path);
        let text = crate::text_file::read(path).with_context(|| {
            format!(
                "reading the suite {}; name a file, for example {SHIPPED}/robustness-core.toml",
                path.display()
            )
        })?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(&name, &text).with_context(|| path.display().to_string())
    }

    /// Path of a shipped suite.
    pub fn shipped(name: &str) -> PathBuf {
        Path::new(SHIPPED).join(format!("{name}.toml"))
    }

    /// Reads the text of a suite.
    ///
    /// # Errors
    /// As [`Suite::read`].
    pub fn parse(name: &str, text: &str) -> anyhow::Result<Self> {
        let file: SuiteFile = toml::from_str(text)?;
        let hash = hash(text)?;
        match &file.frozen {
            Some(frozen) if *frozen != hash => bail!(
                "the suite was frozen as {frozen}, and its content now has {hash}; a frozen suite is never changed: undo the change, or give it a file name of its own"
            ),
            Some(_) => {}
            None => bail!(
                "the suite is not frozen; when it is final, add the line frozen = \"{hash}\" at its beginning"
            ),
        }
        let [first, end] = file.seeds;
        ensure!(
            first < end,
            "seeds = [{first}, {end}] is empty; write the first and the one after the last"
        );
        let found = Purpose::of_range(first..end)?;
        ensure!(
            found == file.purpose,
            "the seeds {first}..{end} are for {}; those for {} are {}",
            found.name(),
            file.purpose.name(),
            file.purpose.seeds()
        );
        let cells = file
            .cell
            .iter()
            .map(|cell| cell_of(&file, cell).with_context(|| format!("the cell {:?}", cell.name)));
        let suite = Self {
            name: name.to_owned(),
            hash,
            seeds: first..end,
            cells: cells.collect::<anyhow::Result<_>>()?,
        };
        suite.check()?;
        Ok(suite)
    }

    fn check(&self) -> anyhow::Result<()> {
        let base = self.cells.first();
        ensure!(
            base.is_some_and(|cell| cell.name == BASE && cell.strength == 0),
            "the first cell is not {BASE:?} with strength 0; put it before the others"
        );
        let mut names = BTreeSet::new();
        let mut settings = BTreeSet::new();
        for cell in &self.cells {
            let name = &cell.name;
            ensure!(
                names.insert(name),
                "two cells are named {name:?}; rename one"
            );
            let usual = format!("{}-{}", cell.axis, cell.strength);
            ensure!(
                name == BASE || *name == usual,
                "the cell {name:?} has the axis {:?} and the strength {}; name it {usual:?}",
                cell.axis,
                cell.strength
            );
            let same = (cell.variation.words(0), &cell.scenes);
            ensure!(
                settings.insert(same),
                "the cell {name:?} has the settings of another cell; remove one"
            );
            ensure!(!cell.tasks.is_empty(), "the cell {name:?} has no tasks");
            let tasks: BTreeSet<&String> = cell.tasks.iter().collect();
            ensure!(
                tasks.len() == cell.tasks.len(),
                "the cell {name:?} lists a task twice; remove one"
            );
            ensure!(
                cell.against.is_empty() || names.contains(&cell.against),
                "the cell {name:?} is compared with {:?}, which is not a cell before it",
                cell.against
            );
        }
        Ok(())
    }

    /// The cell of this name.
    #[must_use]
    pub fn cell(&self, name: &str) -> Option<&Cell> {
        self.cells.iter().find(|cell| cell.name == name)
    }

    /// The cells that `names` lists; all without names. A cell is always compared with
    /// another one, which the caller may have run before.
    ///
    /// # Errors
    /// When a name is not a cell.
    pub fn chosen(&self, names: &[String]) -> anyhow::Result<Vec<&Cell>> {
        let all = || self.cells.iter().map(|cell| cell.name.as_str());
        if let Some(unknown) = names.iter().find(|name| self.cell(name).is_none()) {
            bail!(
                "--cells: no cell named {unknown:?} in {}; available: {}",
                self.name,
                all().collect::<Vec<_>>().join(", ")
            );
        }
        let cells = self.cells.iter();
        Ok(cells
            .filter(|cell| names.is_empty() || names.contains(&cell.name))
            .collect())
    }

    /// Episodes of a cell, seed by seed.
    pub fn episodes<'a>(&'a self, cell: &'a Cell) -> impl Iterator<Item = (&'a str, u64)> {
        let tasks = &cell.tasks;
        let seeds = self.seeds.clone();
        seeds.flat_map(move |seed| tasks.iter().map(move |task| (task.as_str(), seed)))
    }

    /// The episode of a task and a seed in a cell, without its policy.
    #[must_use]
    pub fn job(&self, cell: &Cell, task: &str, seed: u64) -> Job {
        let mut variation = cell.variation.clone();
        let index = seed.saturating_sub(self.seeds.start) as usize;
        if let Some(scene) = cell.scenes.get(index % cell.scenes.len().max(1)) {
            variation.scenario.scene.clone_from(scene);
        }
        Job {
            task: task.to_owned(),
            seed,
            variation,
            policy: String::new(),
            policy_files: String::new(),
        }
    }
}

fn cell_of(suite: &SuiteFile, cell: &CellFile) -> anyhow::Result<Cell> {
    let is_base = cell.name == BASE;
    ensure!(
        is_base == (cell.strength == 0) && is_base == cell.axis.is_empty(),
        "a cell has an axis and a strength from 1 to {MAX_STRENGTH}; {BASE:?} alone has neither"
    );
    ensure!(
        cell.strength <= MAX_STRENGTH,
        "its strength is {}; the greatest is {MAX_STRENGTH}",
        cell.strength
    );
    let mut settings = toml::Table::new();
    for (key, shared, own) in [
        ("scenario", &suite.scenario, &cell.scenario),
        ("variation", &suite.variation, &cell.variation),
    ] {
        let mut all = shared.clone();
        all.extend(own.clone());
        settings.insert(key.to_owned(), all.into());
    }
    let text = toml::to_string(&settings)?;
    let settings: Settings =
        toml::from_str(&text).map_err(|error| anyhow::anyhow!("{}", error.message()))?;
    let scenario = settings.scenario.get_ref();
    ensure!(
        scenario.scene.is_empty() && scenario.robot.is_empty() && scenario.cameras.is_empty(),
        "a suite sets no scene, robot or cameras in [scenario]; use scenes"
    );
    let variation = settings.variation.checked(settings.scenario);
    let mut variation = variation.map_err(|(_, what)| anyhow::anyhow!("{what}"))?;
    cell.axes.iter().for_each(|axis| variation.set(*axis));
    Ok(Cell {
        name: cell.name.clone(),
        axis: cell.axis.clone(),
        strength: cell.strength,
        against: match &cell.against {
            Some(against) => against.clone(),
            None if is_base => String::new(),
            None => BASE.to_owned(),
        },
        tasks: cell.tasks.clone().unwrap_or_else(|| suite.tasks.clone()),
        scenes: cell.scenes.clone(),
        unseen: suite.unseen.union(&cell.unseen).copied().collect(),
        variation,
    })
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{SMALL, frozen};
    use super::*;

    fn problem(text: &str) -> String {
        format!("{:#}", Suite::parse("s", text).unwrap_err())
    }

    #[test]
    fn shipped_suites_are_frozen_and_name_existing_tasks() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
        let read = |name: &str| {
            let path = assets.join("suites").join(format!("{name}.toml"));
            Suite::read(&path).unwrap_or_else(|problem| panic!("{problem:#}"))
        };
        let (all, core) = (read("robustness"), read("robustness-core"));
        let count = |suite: &Suite| {
            let cells = suite.cells.iter();
            cells
                .map(|cell| suite.episodes(cell).count())
                .sum::<usize>()
        };
        assert_eq!((core.cells.len(), count(&core)), (7, 840));
        // Base, ten axes in three strengths; the layout changes five tasks only.
        assert_eq!(all.cells.len(), 31);
        for task in all.cells.iter().flat_map(|cell| &cell.tasks) {
            assert!(
                assets.join(format!("tasks/{task}.toml")).is_file(),
                "{task}"
            );
        }
        // A cell of the core is a cell of the whole suite.
        for cell in &core.cells {
            assert_eq!(all.cell(&cell.name), Some(cell));
        }
        assert_eq!(all.seeds, core.seeds);
    }

    #[test]
    fn cells_add_to_the_settings_of_the_suite_and_scenes_alternate_with_the_seeds() {
        let suite = Suite::parse("s", &frozen(SMALL)).unwrap();
        let [base, start, home] = &suite.cells[..] else {
            panic!("three cells");
        };
        assert_eq!(base.variation.scenario.starts(), v1::Starts::Near);
        assert_eq!(start.variation.scenario.starts(), v1::Starts::Anywhere);
        assert_eq!((base.against.as_str(), start.against.as_str()), ("", BASE));
        assert_eq!(suite.episodes(base).count(), 4);
        let scene = |seed| suite.job(home, "pick_bowl", seed).variation.scenario.scene;
        assert_eq!([scene(600), scene(601), scene(602)], ["a", "b", "a"]);
        assert_ne!(
            suite.job(home, "pick_bowl", 600).settings(),
            suite.job(home, "pick_bowl", 601).settings()
        );
        assert_eq!(home.unseen, [Kind::Seeds, Kind::Homes].into());
        let names = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            suite.chosen(&names).map(|cells| cells.len())
        };
        assert_eq!(names(&[]).unwrap(), 3);
        assert_eq!(names(&["home-1"]).unwrap(), 1);
        let unknown = names(&["light-2"]).unwrap_err().to_string();
        assert!(
            unknown.contains("available: base, start-2, home-1"),
            "{unknown}"
        );
    }

    #[test]
    fn unfrozen_changed_and_malformed_suites_are_rejected() {
        assert!(problem(SMALL).contains("not frozen"));
        let changed = frozen(SMALL).replace("602", "603");
        assert!(problem(&changed).contains("never changed"));
        for (from, to, words) in [
            ("602", "600", "is empty"),
            ("[600, 602]", "[10000, 10002]", "are for train"),
            ("\"base\"", "\"start-1\"", "alone has neither"),
            ("\"home-1\"", "\"start-2\"", "two cells are named"),
            (
                "scenes = [\"a\", \"b\"]",
                "against = \"x\"\nscenario.starts = \"anywhere\"",
                "settings of another cell",
            ),
            (
                "scenes = [\"a\", \"b\"]",
                "against = \"x\"\nscenes = [\"a\"]",
                "not a cell before it",
            ),
            ("strength = 2", "strength = 4", "the greatest is 3"),
            ("strength = 2", "strength = 1", "name it \"start-1\""),
            ("\"anywhere\"", "\"up\"", "up"),
            ("[\"homes\"]", "[\"houses\"]", "houses"),
        ] {
            let text = frozen(&SMALL.replacen(from, to, 1));
            assert!(problem(&text).contains(words), "{to}: {}", problem(&text));
        }
        let missing = Suite::read(Path::new("assets/suites/none.toml")).unwrap_err();
        assert!(format!("{missing:#}").contains("robustness-core.toml"));
    }
}
