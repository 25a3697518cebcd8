//! The episodes of an evaluation: seeds and variation, from the command line or a frozen
//! split.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1;

use crate::axis::AxisAt;
use crate::frozen;
use crate::renamed_keys::translated;
use crate::variation::{Variation, VariationFile};
use crate::worlds;

/// The episodes of an evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Scope {
    /// The split, if one is named: its name.
    pub split: Option<String>,
    /// Seeds of each task.
    pub seeds: Range<u64>,
    /// Variation between episodes beside the sampling of their task.
    pub variation: Variation,
    /// Whether other layouts are requested, which skips tasks with one layout.
    pub layout: bool,
}

impl Scope {
    /// Purpose of the seeds; `mixed` for several purposes.
    #[must_use]
    pub fn purpose(&self) -> &'static str {
        Purpose::of_range(self.seeds.clone()).map_or("mixed", Named::name)
    }
}

/// A split: TOML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SplitFile {
    #[serde(deserialize_with = "named")]
    purpose: Purpose,
    seeds: Vec<u64>,
    #[serde(default = "empty")]
    scenario: Spanned<v1::Scenario>,
    #[serde(default)]
    variation: VariationFile,
    /// Applied in order, after all else.
    #[serde(default)]
    axes: Vec<AxisAt>,
    frozen: Option<String>,
}

fn empty() -> Spanned<v1::Scenario> {
    Spanned::new(0..0, v1::Scenario::default())
}

/// Deserializes a named value.
///
/// # Errors
/// When no value has the name.
pub fn named<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    let name = String::deserialize(from)?;
    T::from_name(&name).map_err(D::Error::custom)
}

/// Reads a split and compares it with the hash that froze it.
///
/// # Errors
/// With file, line and fix: it cannot be read, is invalid, mixes purposes, or differs from
/// the frozen text.
pub fn read_split(path: &Path) -> anyhow::Result<Scope> {
    let path = &file_or_asset(path);
    let text = crate::text_file::read(path).with_context(|| {
        format!(
            "reading the split {}; name a file, for example assets/splits/policy-claim.toml",
            path.display()
        )
    })?;
    parse(path, &text)
}

fn parse(path: &Path, text: &str) -> anyhow::Result<Scope> {
    let at = |span: Option<Range<usize>>, what: &str| {
        let before = span.and_then(|span| text.get(..span.start));
        let line = before.map_or(0, |before| before.matches('\n').count()) + 1;
        anyhow::anyhow!("{}:{line}: {}", path.display(), what.trim())
    };
    let (table, warnings) = translated(text).map_err(|what| at(None, &what))?;
    for warning in &warnings {
        eprintln!("warning: {}: {warning}", path.display());
    }
    // Without former keys the text itself is parsed, so that errors have its lines.
    let file: SplitFile = match warnings.is_empty() {
        true => toml::from_str(text).map_err(|e| at(e.span(), e.message()))?,
        false => toml::from_str(&table).map_err(|e| at(None, e.message()))?,
    };
    if !file.variation.operator {
        bail!(
            "{}: variation.operator = false is for plans; the operator of an evaluation varies",
            path.display()
        );
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let &[first, end] = file.seeds.as_slice() else {
        bail!(
            "{}: seeds has {} numbers; write the first and the one after the last",
            path.display(),
            file.seeds.len()
        );
    };
    if first >= end {
        bail!(
            "{}: seeds = [{first}, {end}] is empty; write the first and the one after the last",
            path.display()
        );
    }
    let found = Purpose::of_range(first..end).with_context(|| path.display().to_string())?;
    if found != file.purpose {
        bail!(
            "{}: the seeds {first}..{end} are for {}; those for {} are {}",
            path.display(),
            found.name(),
            file.purpose.name(),
            file.purpose.seeds()
        );
    }
    let scenario = file.scenario.get_ref();
    if !scenario.scene.is_empty() || !scenario.robot.is_empty() || !scenario.cameras.is_empty() {
        bail!(
            "{}: [scenario] of a split has no scene, robot or cameras; use --scene, --robot and --camera",
            path.display()
        );
    }
    let variation = file.variation.checked(file.scenario);
    let mut variation = variation.map_err(|(span, what)| at(Some(span), &what))?;
    if !variation.homes.is_empty() {
        let one_side = worlds::shipped()?.check_one_side(&variation.homes);
        one_side
            .map_err(anyhow::Error::msg)
            .with_context(|| path.display().to_string())?;
    }
    frozen::check(path, text, file.frozen.as_deref())?;
    let layout = file.axes.iter().any(|axis| axis.is_layout());
    file.axes.into_iter().for_each(|axis| variation.set(axis));
    Ok(Scope {
        layout,
        split: Some(name.into_owned()),
        seeds: first..end,
        variation,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(text: &str) -> String {
        let problem = parse(Path::new("s.toml"), text).unwrap_err();
        format!("{problem:#}")
    }

    #[test]
    fn shipped_splits_are_frozen() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/splits");
        let folders = [folder.join("axes"), folder];
        let entries = folders.iter().flat_map(|f| std::fs::read_dir(f).unwrap());
        let paths = entries.map(|entry| entry.unwrap().path());
        let shipped: Vec<_> = paths.filter(|path| path.is_file()).collect();
        assert!(shipped.len() >= 7 + 27, "{shipped:?}");
        for path in shipped {
            let split = read_split(&path).unwrap_or_else(|p| panic!("{p:#}"));
            assert_eq!(split.split.as_deref(), path.file_stem().unwrap().to_str());
        }
    }

    #[test]
    fn split_is_compared_with_its_frozen_hash() {
        let open = "purpose = \"develop\"\nseeds = [0, 5]\nscenario.starts = \"anywhere\"\n";
        let problem_text = problem(open);
        let (_, hash) = problem_text.split_once("frozen = \"").unwrap();
        let line = format!("frozen = \"{}\"\n", &hash[..16]);
        let scope = parse(Path::new("s.toml"), &format!("# why\n{line}{open}")).unwrap();
        assert_eq!(
            (scope.seeds, scope.variation.scenario.starts()),
            (0..5, v1::Starts::Anywhere)
        );
        let changed = format!("{line}{}", open.replace('5', "6"));
        assert!(
            problem(&changed).contains("never changed"),
            "{}",
            problem(&changed)
        );
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (text, words) in [
            (
                "purpose = \"develop\"\nseed = 3",
                "s.toml:2: unknown field `seed`",
            ),
            (
                "[variation]\nappearance = \"7:light=4\"",
                "s.toml:2: appearance has \"light=4\", expected a strength",
            ),
            (
                "purpose = \"test\"\nseeds = [0, 5]",
                "s.toml:1: purpose \"test\" is none of",
            ),
            (
                "purpose = \"train\"\nseeds = [0, 5]",
                "those for train are 10000..1000000",
            ),
            (
                "purpose = \"develop\"\nseeds = [190, 230]",
                "below 200 for develop",
            ),
            ("purpose = \"develop\"\nseeds = [5, 5]", "is empty"),
            (
                "purpose = \"develop\"\nseeds = [0, 5, 9]",
                "seeds has 3 numbers",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\n[[scenario.sensors]]\nmodel = \"imu\"\nstrength = 4.0",
                "the strength of the sensor \"imu\" is 4; allowed is 0 to 3",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\nsensors = [\"imu\", \"imu=2\"]",
                "the sensor \"imu=2\" is listed twice",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\naxes = [\"light=2\", \"night=1\"]",
                "s.toml:3: axis \"night\" is none of",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\nsensors = [\"imu=much\"]",
                "\"imu=much\" is not MODEL",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\n[variation.language]\ntypos = 2.0",
                "s.toml:4: language.typos is 2",
            ),
            (
                "purpose = \"develop\"\nseeds = [0, 5]\nscenario.variant_share = 2.0",
                "0 to 1",
            ),
        ] {
            assert!(problem(text).contains(words), "{text:?}: {}", problem(text));
        }
    }
}
