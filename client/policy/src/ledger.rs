//! Training ledger of a policy: the seeds, homes, objects and sentences of the episodes that
//! it was trained on. A benchmark compares it with what it tests.
//!
//! A kind of content that the ledger leaves out is undeclared: training may have used any
//! of it. An empty list declares that training used none.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use wheelarm_proto::v1;

/// Version of the layout.
pub const FORMAT: &str = "wheelarm-ledger/1";
/// Bytes of the hash of a sentence and of a ledger.
const HASHED: usize = 8;
/// Most numbers of a kind, which bounds the memory for a file of another author.
const MOST: u64 = 1_000_000;
/// Entries of an overlap that an error lists.
const LISTED: usize = 3;

/// A kind of content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Seeds of scenarios.
    Seeds,
    /// Seeds of visual randomization; they also define camera poses and lenses of its axes.
    AppearanceSeeds,
    /// Specimens of the robot (`calibration_seed`), each with its own cameras.
    Specimens,
    /// Homes: the digest of a pack's home, the name of another scene.
    Homes,
    /// Objects that were targets.
    Objects,
    /// Hashes of sentences.
    Sentences,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 6] = [
        Self::Seeds,
        Self::AppearanceSeeds,
        Self::Specimens,
        Self::Homes,
        Self::Objects,
        Self::Sentences,
    ];

    /// Name in files and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Seeds => "seeds",
            Self::AppearanceSeeds => "appearance_seeds",
            Self::Specimens => "specimens",
            Self::Homes => "homes",
            Self::Objects => "objects",
            Self::Sentences => "sentences",
        }
    }
}

/// Content of one kind, sorted: numbers as decimal text.
type Content = BTreeSet<String>;

/// A training ledger, or the content of a test.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    /// SHA-256 of the policy's weights, hexadecimal; empty where the policy has none.
    pub policy: String,
    /// Remarks for readers.
    pub note: String,
    declared: BTreeMap<Kind, Content>,
}

/// A ledger that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LedgerError {
    /// It is not JSON of this layout.
    #[error("it is not a training ledger: {0}")]
    Malformed(#[from] serde_json::Error),
    /// It is of another version.
    #[error("its format is {0:?}, expected {expected:?}; write it again with this version", expected = FORMAT)]
    Format(String),
    /// A range of numbers ends before it begins, or is longer than any training.
    #[error(
        "the range {0} to {1} of {2} is empty or too long; write the first and the last number"
    )]
    Range(u64, u64, &'static str),
}

/// The file: numbers as ranges, first and last.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    #[serde(default)]
    policy: String,
    #[serde(default)]
    note: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    seeds: Option<Vec<(u64, u64)>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    appearance_seeds: Option<Vec<(u64, u64)>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    specimens: Option<Vec<(u64, u64)>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    homes: Option<Content>,
    #[serde(skip_serializing_if = "Option::is_none")]
    objects: Option<Content>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sentences: Option<Content>,
}

impl Ledger {
    /// The ledger of a policy without training: it declares that nothing was used.
    #[must_use]
    pub fn untrained() -> Self {
        Self {
            declared: Kind::ALL.map(|kind| (kind, Content::new())).into(),
            ..Self::default()
        }
    }

    /// Reads the text of a ledger's file.
    ///
    /// # Errors
    /// [`LedgerError`].
    pub fn read(text: &str) -> Result<Self, LedgerError> {
        let file: File = serde_json::from_str(text)?;
        if file.format != FORMAT {
            return Err(LedgerError::Format(file.format));
        }
        let mut declared = BTreeMap::new();
        for (kind, ranges) in [
            (Kind::Seeds, file.seeds),
            (Kind::AppearanceSeeds, file.appearance_seeds),
            (Kind::Specimens, file.specimens),
        ] {
            let Some(ranges) = ranges else { continue };
            let (mut content, mut left) = (Content::new(), MOST);
            for (first, last) in ranges {
                let count = last.checked_sub(first).filter(|more| *more < left);
                let Some(more) = count else {
                    return Err(LedgerError::Range(first, last, kind.name()));
                };
                left -= more + 1;
                content.extend((first..=last).map(|number| number.to_string()));
            }
            declared.insert(kind, content);
        }
        for (kind, content) in [
            (Kind::Homes, file.homes),
            (Kind::Objects, file.objects),
            (Kind::Sentences, file.sentences),
        ] {
            declared.extend(content.map(|content| (kind, content)));
        }
        Ok(Self {
            policy: file.policy,
            note: file.note,
            declared,
        })
    }

    /// The text of its file.
    #[must_use]
    pub fn text(&self) -> String {
        let ranges = |kind: Kind| self.declared.get(&kind).map(ranges);
        let names = |kind: Kind| self.declared.get(&kind).cloned();
        let file = File {
            format: FORMAT.to_owned(),
            policy: self.policy.clone(),
            note: self.note.clone(),
            seeds: ranges(Kind::Seeds),
            appearance_seeds: ranges(Kind::AppearanceSeeds),
            specimens: ranges(Kind::Specimens),
            homes: names(Kind::Homes),
            objects: names(Kind::Objects),
            sentences: names(Kind::Sentences),
        };
        serde_json::to_string(&file).unwrap_or_default() + "\n"
    }

    /// Hash of the ledger, hexadecimal.
    #[must_use]
    pub fn hash(&self) -> String {
        hashed(&self.text())
    }

    /// Declares one value of a kind.
    pub fn declare(&mut self, kind: Kind, value: impl fmt::Display) {
        let content = self.declared.entry(kind).or_default();
        content.insert(value.to_string());
    }

    /// Adds an episode with its sampled scenario.
    pub fn add(&mut self, scenario: &v1::Scenario) {
        for kind in Kind::ALL {
            self.declared.entry(kind).or_default();
        }
        self.declare(Kind::Seeds, scenario.seed());
        let appearance = scenario.appearance.as_ref();
        if let Some(appearance) = appearance.filter(|appearance| is_randomized(appearance)) {
            self.declare(Kind::AppearanceSeeds, appearance.seed);
        }
        if let Some(specimen) = scenario.calibration_seed {
            self.declare(Kind::Specimens, specimen);
        }
        if !scenario.scene.is_empty() {
            self.declare(Kind::Homes, home(scenario));
        }
        if !scenario.target().is_empty() {
            self.declare(Kind::Objects, scenario.target());
        }
        if !scenario.instruction().is_empty() {
            self.declare(Kind::Sentences, sentence(scenario.instruction()));
        }
    }

    /// Whether the ledger declares this kind.
    #[must_use]
    pub fn declares(&self, kind: Kind) -> bool {
        self.declared.contains_key(&kind)
    }

    /// What both ledgers contain of `kind`, in words; absent without an overlap.
    #[must_use]
    pub fn overlap(&self, tested: &Self, kind: Kind) -> Option<String> {
        let [one, other] = [self, tested].map(|ledger| ledger.declared.get(&kind));
        let both: Vec<&str> = one?.intersection(other?).map(String::as_str).collect();
        let more = match both.len() {
            0 => return None,
            count if count > LISTED => format!(" and {} more", count - LISTED),
            _ => String::new(),
        };
        let listed = both.iter().take(LISTED).copied().collect::<Vec<_>>();
        Some(format!("{} {}{more}", kind.name(), listed.join(", ")))
    }
}

/// Whether any axis is randomized.
fn is_randomized(appearance: &v1::Appearance) -> bool {
    let still = v1::Appearance {
        seed: appearance.seed,
        ..v1::Appearance::default()
    };
    *appearance != still
}

/// Identity of the home of a scenario: the digest of its pack, else the name of the scene.
fn home(scenario: &v1::Scenario) -> String {
    let mut packs = scenario.packs.iter();
    let pack = packs.find(|pack| pack.name == scenario.scene);
    match pack.filter(|pack| !pack.physics_digest.is_empty()) {
        Some(pack) => pack.physics_digest.clone(),
        None => scenario.scene.clone(),
    }
}

/// Identity of a sentence: a hash of its lower-case words without punctuation.
#[must_use]
pub fn sentence(text: &str) -> String {
    let words = text.split(|c: char| !c.is_alphanumeric());
    let words: Vec<String> = words
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    hashed(&words.join(" "))
}

fn hashed(text: &str) -> String {
    let digest = Sha256::digest(text);
    let digits = digest.iter().take(HASHED).map(|byte| format!("{byte:02x}"));
    digits.collect()
}

/// Consecutive numbers as ranges: first and last.
fn ranges(content: &Content) -> Vec<(u64, u64)> {
    let mut numbers: Vec<u64> = content
        .iter()
        .filter_map(|text| text.parse().ok())
        .collect();
    numbers.sort_unstable();
    let mut ranges: Vec<RangeInclusive<u64>> = Vec::new();
    for number in numbers {
        match ranges.last_mut() {
            Some(last) if last.end().checked_add(1) == Some(number) => {
                *last = *last.start()..=number;
            }
            _ => ranges.push(number..=number),
        }
    }
    ranges.into_iter().map(RangeInclusive::into_inner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(seed: u64) -> v1::Scenario {
        v1::Scenario {
            scene: "home".to_owned(),
            seed: Some(seed),
            target: Some("mustard".to_owned()),
            instruction: Some("Take the mustard, please!".to_owned()),
            appearance: Some(v1::Appearance {
                seed: seed + 7,
                light: 2,
                ..v1::Appearance::default()
            }),
            ..v1::Scenario::default()
        }
    }

    #[test]
    fn ledger_is_read_as_it_was_written_and_its_hash_changes_with_its_content() {
        let mut ledger = Ledger::default();
        for seed in [5, 6, 7, 10] {
            ledger.add(&scenario(seed));
        }
        ledger.policy = "ab12".to_owned();
        let text = ledger.text();
        assert!(text.contains("\"seeds\":[[5,7],[10,10]]"), "{text}");
        assert!(text.contains("\"specimens\":[]"), "{text}");
        assert_eq!(Ledger::read(&text).unwrap(), ledger);
        let before = ledger.hash();
        ledger.add(&scenario(8));
        assert_ne!(ledger.hash(), before);
    }

    #[test]
    fn overlaps_are_listed_and_undeclared_content_is_not_an_overlap() {
        let (mut trained, mut tested) = (Ledger::default(), Ledger::default());
        (10..16).for_each(|seed| trained.add(&scenario(seed)));
        (12..20).for_each(|seed| tested.add(&scenario(seed)));
        let overlap = |kind| trained.overlap(&tested, kind);
        assert_eq!(
            overlap(Kind::Seeds).as_deref(),
            Some("seeds 12, 13, 14 and 1 more")
        );
        assert_eq!(
            overlap(Kind::AppearanceSeeds).as_deref(),
            Some("appearance_seeds 19, 20, 21 and 1 more")
        );
        assert_eq!(overlap(Kind::Specimens), None);
        assert_eq!(overlap(Kind::Objects).as_deref(), Some("objects mustard"));
        let undeclared = Ledger::default();
        assert!(!undeclared.declares(Kind::Seeds));
        assert_eq!(undeclared.overlap(&tested, Kind::Seeds), None);
        assert!(Ledger::untrained().declares(Kind::Seeds));
    }

    #[test]
    fn spelling_of_a_sentence_does_not_hide_an_overlap() {
        let hash = sentence("Take the mustard, please!");
        assert_eq!(hash, sentence("take  the Mustard please"));
        assert_ne!(hash, sentence("take the mustad please"));
        // The same constant is in client/python/tests/test_ledger.py.
        assert_eq!(hash, "f35ab74f0527182e");
    }

    #[test]
    fn home_of_a_pack_is_known_by_its_digest() {
        let mut scenario = scenario(1);
        assert_eq!(home(&scenario), "home");
        scenario.packs.push(v1::PackRef {
            name: "home".to_owned(),
            physics_digest: "d1".to_owned(),
            ..v1::PackRef::default()
        });
        assert_eq!(home(&scenario), "d1");
    }

    #[test]
    fn malformed_ledgers_are_rejected_with_the_reason() {
        for (text, words) in [
            ("{", "not a training ledger"),
            (
                r#"{"format":"wheelarm-ledger/0"}"#,
                "expected \"wheelarm-ledger/1\"",
            ),
            (
                r#"{"format":"wheelarm-ledger/1","seed":[]}"#,
                "unknown field `seed`",
            ),
            (
                r#"{"format":"wheelarm-ledger/1","seeds":[[3,2]]}"#,
                "3 to 2 of seeds is empty",
            ),
            (
                r#"{"format":"wheelarm-ledger/1","seeds":[[0,10000000000]]}"#,
                "too long",
            ),
        ] {
            let error = Ledger::read(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
