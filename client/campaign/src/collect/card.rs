//! A dataset's card, `README.md` in the form of the Hugging Face dataset card: content,
//! coverage of its axes, authors and licenses of world packs, and how it was made. Written
//! from the journals; the packs are in the recordings.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use anyhow::Context;
use wheelarm_dataset::credits::{PackCredits, card_section};
use wheelarm_dataset::read::Episode as Recording;
use wheelarm_homes::own_home::OwnHomeId;
use wheelarm_policy::ledger::Ledger;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::Named;
use wheelarm_proto::{CONTRACT_VERSION, PHYSICS_VERSION, v1};

use super::estimate::{bytes, duration};
use super::failure_analysis;
use super::folder::{Folder, write_whole};
use super::journal::Done;
use super::manifest::Manifest;
use super::plan::Plan;
use crate::variation::camera_words;

/// Widest bar of a histogram, characters.
const BAR: usize = 40;
/// Side of a cell of the floor in the histogram of starts, m.
const CELL: f64 = 1.0;
/// Bins of durations, simulated seconds.
const DURATION: f64 = 5.0;

/// An episode with its sampled scenario.
struct SampledEpisode<'a> {
    done: &'a Done,
    scenario: v1::Scenario,
}

/// Writes the card of a dataset into its folder, and its training ledger `ledger.json`.
///
/// # Errors
/// When a file cannot be written.
pub fn write(folder: &Folder, plan: &Plan, manifest: &Manifest) -> anyhow::Result<()> {
    match training_ledger(manifest) {
        Ok(ledger) => write_whole(&folder.root().join("ledger.json"), ledger.text().as_bytes())?,
        // Without a ledger a policy is undeclared, which is true.
        Err(error) => tracing::warn!("no training ledger is written: {error:#}"),
    }
    let text = card(plan, manifest, &Recorded::read(folder, manifest));
    write_whole(&folder.root().join("README.md"), text.as_bytes())
}

/// The training ledger of the episodes.
///
/// # Errors
/// When the scenario of an episode is of an earlier contract.
fn training_ledger(manifest: &Manifest) -> anyhow::Result<Ledger> {
    let mut ledger = Ledger::default();
    for done in &manifest.episodes {
        let scenario: v1::Scenario = serde_json::from_value(done.scenario.clone())
            .with_context(|| format!("the scenario of {}", done.episode))?;
        ledger.add(&scenario);
    }
    Ok(ledger)
}

/// What recordings say about world packs.
#[derive(Debug, Default)]
struct Recorded {
    /// Authors and licenses.
    credits: Vec<PackCredits>,
    /// Categories of objects.
    categories: BTreeMap<String, String>,
}

impl Recorded {
    /// From the first recording with each set of packs. A recording that cannot be read was
    /// reported when its episode was checked.
    fn read(folder: &Folder, manifest: &Manifest) -> Self {
        let (mut listed, mut found) = (BTreeSet::new(), Self::default());
        for done in &manifest.episodes {
            let packs = done.scenario.get("packs").map(ToString::to_string);
            if !listed.insert(packs.unwrap_or_default()) {
                continue;
            }
            let Ok(recording) = Recording::open(&folder.root().join(&done.file)) else {
                continue;
            };
            for one in PackCredits::of_episode(&recording).unwrap_or_default() {
                if !found.credits.contains(&one) {
                    found.credits.push(one);
                }
            }
            let assets = recording.snapshot().map(|snapshot| snapshot.assets);
            for asset in assets.unwrap_or_default() {
                let name = asset.path.strip_prefix("objects/");
                let name = name.and_then(|name| name.strip_suffix(".toml"));
                let table = asset.text.parse::<toml::Table>().ok();
                let category = table
                    .as_ref()
                    .and_then(|table| table.get("category")?.as_str());
                if let Some((name, category)) = name.zip(category) {
                    found
                        .categories
                        .insert(name.to_owned(), category.to_owned());
                }
            }
        }
        found
    }
}

/// The card of a dataset.
fn card(plan: &Plan, manifest: &Manifest, recorded: &Recorded) -> String {
    let episodes: Vec<SampledEpisode<'_>> = manifest
        .episodes
        .iter()
        .map(|done| SampledEpisode {
            done,
            scenario: serde_json::from_value(done.scenario.clone()).unwrap_or_default(),
        })
        .collect();
    let mut text = head(plan, manifest);
    text += &composition(manifest);
    text += &by_home_and_object(&episodes, &recorded.categories);
    text += &coverage(&episodes);
    text += &card_section(&recorded.credits);
    text += &making(plan, manifest, &episodes);
    text
}

/// The YAML block and the summary.
fn head(plan: &Plan, manifest: &Manifest) -> String {
    let count = manifest.episodes.len();
    let size = match count {
        0..1_000 => "n<1K",
        1_000..10_000 => "1K<n<10K",
        10_000..100_000 => "10K<n<100K",
        _ => "100K<n<1M",
    };
    format!(
        "---\n\
         pretty_name: {name}\n\
         license: {license}\n\
         language:\n- en\n\
         task_categories:\n- robotics\n\
         tags:\n- WheelArm\n- simulation\n- mobile-manipulation\n- assistive-robotics\n- wheelchair\n\
         size_categories:\n- {size}\n\
         ---\n\n\
         # {name}\n\n\
         {line}. Recordings of a WHILL Model CR2 wheelchair with a Kinova Gen3 arm and a Robotiq \
         2F-85 gripper in a simulated home, one HDF5 file per episode, made by the scripted \
         operator of WheelArm.\n\n\
         Its seeds are for **{purpose}** ({seeds}). Data of different purposes is never mixed: \
         training data is not evaluation data.\n\n",
        name = plan.name,
        license = plan.license,
        line = manifest.line(),
        purpose = plan.purpose.name(),
        seeds = plan.purpose.seeds(),
    )
}

/// Content by task.
fn composition(manifest: &Manifest) -> String {
    let mut text = "## Composition\n\n| task | episodes | failed attempts | scenes | sentences | simulated s | mean s |\n|---|---|---|---|---|---|---|\n".to_owned();
    let mut tasks: BTreeMap<&str, Vec<&Done>> = BTreeMap::new();
    for done in &manifest.episodes {
        tasks.entry(&done.task).or_default().push(done);
    }
    for (task, done) in tasks {
        let failed = manifest.failed_attempts.iter().filter(|f| f.task == task);
        let seconds: f64 = done.iter().map(|d| d.seconds).sum();
        let scenes: BTreeSet<u64> = done.iter().map(|d| d.seed).collect();
        let sentences: BTreeSet<&str> = done.iter().map(|d| d.instruction.as_str()).collect();
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "| {task} | {} | {} | {} | {} | {seconds:.0} | {:.1} |",
            done.len(),
            failed.count(),
            scenes.len(),
            sentences.len(),
            seconds / done.len() as f64
        );
    }
    text + "\n"
}

/// Episodes by home.
fn homes_of<'a>(
    episodes: &'a [SampledEpisode<'_>],
) -> BTreeMap<&'a str, Vec<&'a SampledEpisode<'a>>> {
    let mut homes: BTreeMap<&str, Vec<&SampledEpisode<'_>>> = BTreeMap::new();
    for episode in episodes {
        let scene = episode.scenario.scene.as_str();
        homes.entry(scene).or_default().push(episode);
    }
    homes
}

/// Objects that were in the scene, with the number of episodes in which they were, and of
/// those in which they were the target.
fn placed_in<'a>(episodes: &'a [SampledEpisode<'_>]) -> BTreeMap<&'a str, [usize; 2]> {
    let mut objects: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for episode in episodes {
        for object in &episode.scenario.objects {
            let counts = objects.entry(object.name.as_str()).or_default();
            counts[0] += 1;
            counts[1] += usize::from(episode.scenario.target() == object.name);
        }
    }
    objects
}

fn counted(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

/// Content by home, by category and by object.
fn by_home_and_object(
    episodes: &[SampledEpisode<'_>],
    categories: &BTreeMap<String, String>,
) -> String {
    let mut text =
        "| home | plan, style | episodes | tasks | targets |\n|---|---|---|---|---|\n".to_owned();
    for (home, own) in homes_of(episodes) {
        let kind = match OwnHomeId::from_name(home) {
            Some(id) => format!("{}, {}", id.plan, id.style),
            None => "–".to_owned(),
        };
        let tasks: BTreeSet<&str> = own.iter().map(|one| one.done.task.as_str()).collect();
        let targets: BTreeSet<&str> = own.iter().map(|one| one.scenario.target()).collect();
        let _ = writeln!(
            text,
            "| {home} | {kind} | {} | {} | {} |",
            own.len(),
            tasks.len(),
            targets.len()
        );
    }
    let mut by_category: BTreeMap<&str, [usize; 3]> = BTreeMap::new();
    for (object, [present, target]) in placed_in(episodes) {
        if let Some(category) = categories.get(object) {
            let counts = by_category.entry(category).or_default();
            let more = [1, present, target];
            *counts = [0, 1, 2].map(|i| counts[i] + more[i]);
        }
    }
    if !by_category.is_empty() {
        text += "\n| category | objects | placed | as the target |\n|---|---|---|---|\n";
    }
    for (category, [objects, placed, target]) in by_category {
        let _ = writeln!(text, "| {category} | {objects} | {placed} | {target} |");
    }
    text += "\n| object | episodes | as the target |\n|---|---|---|\n";
    for (object, [present, target]) in placed_in(episodes) {
        let _ = writeln!(text, "| {object} | {present} | {target} |");
    }
    text + "\n"
}

/// Coverage of the axes.
fn coverage(episodes: &[SampledEpisode<'_>]) -> String {
    let mut text = "## Coverage\n\n".to_owned();
    let scenarios = || episodes.iter().map(|d| &d.scenario);
    let starts = scenarios().filter_map(|s| Some((s.start?.position?, s.start?.orientation?)));
    let (mut cells, mut headings) = (Vec::new(), Vec::new());
    for (at, q) in starts {
        let corner = |v: f64| (v / CELL).floor() * CELL;
        cells.push(format!("x {:>4.0} y {:>4.0} m", corner(at.x), corner(at.y)));
        let yaw = 2.0 * q.z.atan2(q.w).to_degrees();
        headings.push(format!("{:>4.0}..{:.0}°", sector(yaw), sector(yaw) + 45.0));
    }
    text += &histogram("Start of the chair, by square metre", cells);
    text += &histogram("Heading at the start", headings);
    let arms = scenarios().map(|s| {
        let words = s.arm_positions.iter().map(|q| format!("{q:.2}"));
        words.collect::<Vec<_>>().join(" ")
    });
    text += &histogram("Posture of the arm at the start, rad", arms);
    let grippers = scenarios().map(|s| match s.knuckle {
        Some(knuckle) => format!("knuckle at {knuckle:.1} rad"),
        None => "as described".to_owned(),
    });
    text += &histogram("Gripper at the start", grippers);
    text += &histogram(
        "Variant of the area",
        scenarios().map(|s| match s.variant() {
            "" => "the only one".to_owned(),
            name => name.to_owned(),
        }),
    );
    text += &histogram(
        "Specimen of the robot",
        scenarios().map(|s| match s.calibration_seed {
            Some(seed) => format!("{seed}"),
            None => "as described".to_owned(),
        }),
    );
    let visibility = episodes
        .iter()
        .map(|d| match d.done.target_in_first_images {
            Some(true) => "shown".to_owned(),
            Some(false) => "not shown".to_owned(),
            None => "unknown".to_owned(),
        });
    text += &histogram("Target in the first images", visibility);
    text += &histogram(
        "Phase that looks around",
        scenarios().map(|s| if s.look_around() { "yes" } else { "no" }.to_owned()),
    );
    text += &histogram("Disturbances", scenarios().map(disturbance_words));
    let seated_person = |of: fn(&v1::SampledPerson) -> &String| {
        scenarios().map(
            move |s| match s.person.as_ref().and_then(|p| p.sampled.as_ref()) {
                Some(person) => of(person).clone(),
                None => "none".to_owned(),
            },
        )
    };
    text += &histogram("Person in the chair", seated_person(|person| &person.body));
    text += &histogram(
        "Posture of the person",
        seated_person(|person| &person.posture),
    );
    let durations = episodes.iter().map(|d| {
        let from = (d.done.seconds / DURATION).floor() * DURATION;
        format!("{from:>4.0}..{:.0} s", from + DURATION)
    });
    text += &histogram("Duration", durations);
    let words: BTreeSet<String> = episodes
        .iter()
        .flat_map(|d| d.done.instruction.split_whitespace())
        .map(|word| {
            let letters = word.chars().filter(|c| c.is_alphanumeric());
            letters.collect::<String>().to_lowercase()
        })
        .filter(|word| !word.is_empty())
        .collect();
    let sentences: BTreeSet<&str> = episodes
        .iter()
        .map(|d| d.done.instruction.as_str())
        .collect();
    let _ = writeln!(
        text,
        "Instructions: {} distinct sentences, {} distinct words.\n",
        sentences.len(),
        words.len()
    );
    text
}

/// Disturbances of a scenario.
fn disturbance_words(scenario: &v1::Scenario) -> String {
    let disturbances = scenario.disturbances.unwrap_or_default();
    let v1::Disturbances {
        noise,
        pushes,
        slips,
        ..
    } = disturbances;
    match noise + pushes + slips {
        0 => "none".to_owned(),
        _ => format!("noise {noise}, pushes {pushes}, slips {slips}"),
    }
}

/// Lower edge of the 45° sector that contains an angle, degrees from -180.
fn sector(degrees: f64) -> f64 {
    let turned = (degrees + 180.0).rem_euclid(360.0);
    (turned / 45.0).floor() * 45.0 - 180.0
}

/// Number of episodes by value of one axis; one line when all have the same value.
fn histogram(title: &str, values: impl IntoIterator<Item = String>) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for value in values {
        *counts.entry(value).or_default() += 1;
    }
    let Some(most) = counts.values().max().copied().filter(|_| counts.len() > 1) else {
        let all = counts.into_keys().next();
        return all.map_or(String::new(), |value| {
            format!("{title}: {} in all.\n\n", value.trim())
        });
    };
    let widest = counts.keys().map(|key| key.chars().count()).max();
    let mut text = format!("{title}: {} values.\n\n```text\n", counts.len());
    for (value, count) in counts {
        let bar = "#".repeat((count * BAR).div_ceil(most));
        let _ = writeln!(
            text,
            "{value:<w$} {count:>6} {bar}",
            w = widest.unwrap_or(0)
        );
    }
    text + "```\n\n"
}

/// Settings that differ between episodes.
fn differs(plan: &Plan) -> String {
    let mut words = plan.variation.words(0);
    if let Some(language) = &plan.variation.language {
        words += &format!(" sentences={}", language.sentences);
    }
    match words.trim() {
        "" => "the samples of the tasks".to_owned(),
        words => format!("the samples of the tasks, and {words}"),
    }
}

/// Commands, versions and settings of the dataset.
fn making(plan: &Plan, manifest: &Manifest, episodes: &[SampledEpisode<'_>]) -> String {
    let origins: BTreeSet<&[String; 2]> = manifest.episodes.iter().map(|d| &d.origin).collect();
    let origins: Vec<String> = origins
        .iter()
        .map(|o| format!("{}, {}", o[0], o[1]))
        .collect();
    let cameras: Vec<String> = camera_words(plan.scenario());
    let mut text = "## How it was made\n\n```sh\nwheelarm collect plan.toml\n```\n\n".to_owned();
    for (key, value) in [
        ("Program", env!("CARGO_PKG_VERSION").to_owned()),
        ("Contract", CONTRACT_VERSION.to_string()),
        ("Physics", PHYSICS_VERSION.to_string()),
        ("Server and graphics adapter", origins.join("; ")),
        (
            "Scene, robot",
            match plan.variation.homes.len() {
                0 => format!("{}, {}", plan.scenario().scene, plan.scenario().robot),
                homes => format!("{homes} homes, {}", plan.scenario().robot),
            },
        ),
        ("Cameras", cameras.join(", ")),
        ("Differs between episodes", differs(plan)),
        (
            "Size",
            format!(
                "{}, {} simulated",
                bytes(manifest.bytes as f64),
                duration(manifest.seconds)
            ),
        ),
    ] {
        let _ = writeln!(text, "- {key}: {value}");
    }
    let purposes: BTreeSet<Purpose> = manifest
        .episodes
        .iter()
        .map(|d| Purpose::of_seed(d.seed))
        .collect();
    let purposes: Vec<&str> = purposes.into_iter().map(Named::name).collect();
    let losses = manifest
        .failed_attempts
        .iter()
        .filter_map(|f| f.loss.as_deref());
    let _ = write!(
        text,
        "- Purposes of its seeds: {}\n\
         - `manifest.json` has the SHA-256, the seed and the whole scenario of every file, and \
         every failed attempt; `plan.toml` is the plan, `wheelarm replay FILE` runs any episode \
         again and compares its states.\n\n\
         ## Limits\n\n\
         Everything is simulated: {homes}, {objects}, a scripted operator that knows the true \
         state. Failed attempts are {} of {} and not in `episodes/`. {kept}{images}.\n",
        purposes.join(", "),
        manifest.failed_attempts.len(),
        manifest.failed_attempts.len() + manifest.episodes.len(),
        homes = counted(homes_of(episodes).len(), "furnished home"),
        objects = counted(placed_in(episodes).len(), "object"),
        kept = failure_analysis::sentence(losses).map_or(String::new(), |kept| format!(
            "{kept} (a separate split: `manifest.json` has the cause and the tick of each loss). "
        )),
        images = if plan.scenario().sensors.is_empty() {
            "Images are exact and without noise"
        } else {
            "Images of `camera/*` are exact and without noise; `sensor/*` and `sensed_*` model \
             the real sensors"
        }
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_listed_by_home_and_object() {
        let done = Done {
            task: "take_anything".to_owned(),
            ..Done::default()
        };
        let episode = |scene: &str, target: &str| SampledEpisode {
            done: &done,
            scenario: v1::Scenario {
                scene: scene.to_owned(),
                target: Some(target.to_owned()),
                objects: ["coke", "mustard"]
                    .map(|name| v1::ObjectPlacement {
                        name: name.to_owned(),
                        ..v1::ObjectPlacement::default()
                    })
                    .to_vec(),
                ..v1::Scenario::default()
            },
        };
        let episodes = [
            episode("studio-nordic-3", "coke"),
            episode("studio-nordic-3", "mustard"),
            episode("home", "coke"),
        ];
        let categories = [("coke", "can"), ("mug", "mug")];
        let categories = categories.map(|(name, of)| (name.to_owned(), of.to_owned()));
        let categories = BTreeMap::from(categories);
        let text = by_home_and_object(&episodes, &categories);
        for row in [
            "| can | 1 | 3 | 2 |",
            "| studio-nordic-3 | studio, nordic | 2 | 1 | 2 |",
            "| home | – | 1 | 1 | 1 |",
            "| coke | 3 | 2 |",
            "| mustard | 3 | 1 |",
        ] {
            assert!(text.contains(row), "{text}");
        }
    }

    #[test]
    fn angles_map_to_their_sector() {
        for (angle, lower) in [
            (-180.0, -180.0),
            (-1.0, -45.0),
            (0.0, 0.0),
            (44.9, 0.0),
            (180.0, -180.0),
        ] {
            assert_eq!(sector(angle), lower, "{angle}");
        }
    }

    #[test]
    fn histogram_scales_to_the_most_frequent_value() {
        let values = ["a", "b", "b", "b", "b"].map(str::to_owned);
        let text = histogram("Axis", values);
        assert!(
            text.contains(&format!("b      4 {}", "#".repeat(BAR))),
            "{text}"
        );
        assert!(
            text.contains(&format!("a      1 {}\n", "#".repeat(BAR / 4))),
            "{text}"
        );
        assert_eq!(
            histogram("Axis", ["a".to_owned(), "a".to_owned()]),
            "Axis: a in all.\n\n"
        );
        assert_eq!(histogram("Axis", []), "");
    }
}
