//! What a finished file says of an attempt: whether it is the recording of the
//! episode that was asked for, and whether its task was done.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use wheelarm_dataset::read::{Episode as Recording, Summary};
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::person::NO_PERSON;
use wheelarm_proto::v1;
use wheelarm_rollout::{FailureCause, Finished};

use super::episode::Episode;
use super::folder::{Folder, sha256};
use super::journal::{Done, Failed};

/// What a file is worth.
pub enum Judged {
    /// It belongs into the dataset.
    Done(Box<Done>),
    /// The task was not done.
    Failed(Failed),
}

/// Reads the finished file of an attempt at the scenario `asked` and decides.
/// `wall_seconds` is what the attempt took.
///
/// # Errors
/// When it is not the complete recording of the episode.
pub fn judge(
    episode: &Episode,
    number: u32,
    file: &Path,
    asked: &v1::Scenario,
    finished: &Finished,
    wall_seconds: f64,
) -> anyhow::Result<Judged> {
    let seed = episode.seed_of(number);
    let recording = Recording::open(file)?;
    let summary = recording.summary()?;
    check(&summary, episode, seed)?;
    let seconds = summary.span_nanos.1.saturating_sub(summary.span_nanos.0) as f64 * 1e-9;
    let scenario = recording.scenario()?;
    check_settings(&scenario, asked)?;
    let scenario = scenario_json(&scenario);
    if recording.is_broken() || !(finished.succeeded() && summary.success) {
        let broken = recording.is_broken().then_some(FailureCause::Physics);
        return Ok(Judged::Failed(Failed {
            episode: episode.id.clone(),
            task: episode.task.clone(),
            attempt: number,
            seed,
            settings: episode.settings.clone(),
            reason: reason(&summary, finished),
            seconds,
            wall_seconds,
            broken,
            death: 0,
            loss: None,
            scenario: broken.map(|_| scenario),
        }));
    }
    drop(recording);
    Ok(Judged::Done(Box::new(Done {
        episode: episode.id.clone(),
        task: episode.task.clone(),
        attempt: number,
        seed,
        settings: episode.settings.clone(),
        file: Folder::file_name(&episode.id),
        sha256: sha256(file)?,
        bytes: std::fs::metadata(file)
            .with_context(|| format!("reading {}", file.display()))?
            .len(),
        success: summary.success,
        instruction: summary.instruction.clone(),
        seconds,
        counts: summary
            .streams
            .iter()
            .map(|stream| (stream.stream.clone(), stream.received))
            .collect(),
        missed: summary.streams.iter().map(|stream| stream.missed).sum(),
        finished_unix_millis: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_millis() as u64),
        target_in_first_images: summary.target_in_first_images,
        origin: [summary.origin[0].clone(), summary.origin[1].clone()],
        scenario,
        wall_seconds,
    })))
}

/// Whether a file is the complete recording of this episode.
///
/// # Errors
/// With what it is instead.
pub fn check(summary: &Summary, episode: &Episode, seed: u64) -> anyhow::Result<()> {
    if !summary.complete {
        bail!(
            "the recording is not complete: {}",
            summary.problems.join("; ")
        );
    }
    let found = (
        summary.label.as_str(),
        summary.task[0].as_str(),
        summary.seed,
    );
    let wanted = (episode.id.as_str(), episode.task.as_str(), seed);
    if found != wanted {
        bail!(
            "the recording is of {:?}, task {:?}, seed {}; expected {:?}, task {:?}, seed {}",
            found.0,
            found.1,
            found.2,
            wanted.0,
            wanted.1,
            wanted.2
        );
    }
    Ok(())
}

/// Whether a recording was made with the settings that were asked for.
///
/// # Errors
/// With the setting that is another.
fn check_settings(recorded: &v1::Scenario, asked: &v1::Scenario) -> anyhow::Result<()> {
    let language = |scenario: &v1::Scenario| {
        let said = scenario.language.as_ref();
        said.map(|said| (said.seed, said.split))
    };
    let appearance = |scenario: &v1::Scenario| {
        scenario
            .appearance
            .as_ref()
            .map(|appearance| appearance.seed)
    };
    let hindered = |scenario: &v1::Scenario| {
        let by = scenario
            .disturbances
            .filter(|d| d.noise + d.pushes + d.slips > 0);
        by.map(|d| (d.noise, d.pushes, d.slips))
    };
    let sensors = |scenario: &v1::Scenario| scenario.sensors.len();
    for (name, same) in [
        ("language", language(recorded) == language(asked)),
        ("look", appearance(recorded) == appearance(asked)),
        ("disturbances", hindered(recorded) == hindered(asked)),
        ("sensors", sensors(recorded) == sensors(asked)),
        (
            "person",
            is_person(recorded.person.as_ref(), asked.person.as_ref()),
        ),
        (
            "calibration_seed",
            recorded.calibration_seed == asked.calibration_seed,
        ),
        (
            "start_in_view",
            asked.start_in_view.is_none() || recorded.start_in_view == asked.start_in_view,
        ),
        (
            "look_around",
            asked.look_around.is_none() || recorded.look_around == asked.look_around,
        ),
        (
            "style",
            asked.style.is_none() || recorded.style == asked.style,
        ),
    ] {
        if !same {
            bail!(
                "the recording was not made with the {name} that the plan asks for; programs of one version make a campaign"
            );
        }
    }
    Ok(())
}

/// Whether the one who was recorded is the one who was asked for. Only what was asked
/// counts: a care task draws somebody where the plan names nobody, and adds what it
/// needs of a person that the plan names.
fn is_person(recorded: Option<&v1::Person>, asked: Option<&v1::Person>) -> bool {
    let asked = asked.filter(|person| person.body != NO_PERSON);
    let Some(asked) = asked else {
        return true;
    };
    let recorded = recorded.filter(|person| person.body != NO_PERSON);
    recorded.is_some_and(|recorded| {
        let is = |asked: &str, recorded: &str| asked.is_empty() || asked == recorded;
        is(&asked.body, &recorded.body)
            && is(&asked.posture, &recorded.posture)
            && (!asked.guard || recorded.guard)
            && (!asked.unguarded || !recorded.guard)
            && (!asked.mouth_open || recorded.mouth_open)
            && asked.motion.is_none_or(|m| recorded.motion == Some(m))
    })
}

/// Why the task was not done.
fn reason(summary: &Summary, finished: &Finished) -> String {
    let mut parts: Vec<String> = finished.why().into_iter().collect();
    if !summary.failure_reason.is_empty() {
        parts.push(summary.failure_reason.clone());
    }
    let not: Vec<&str> = summary
        .conditions
        .iter()
        .filter(|(_, holds, _)| !holds)
        .map(|(name, ..)| name.as_str())
        .collect();
    if !not.is_empty() {
        parts.push(format!("not {}", not.join(", not ")));
    }
    if parts.is_empty() {
        parts.push("the operator was not content".to_owned());
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_care_task_adds_to_a_person_is_no_other_person() {
        let read = |text: &str| v1::Person::from_text(text).unwrap();
        let waits = read("any/hands_on_armrests,motion=0.3,mouth_open,guard");
        let by_age = read("man_85/hands_on_armrests,motion=0.3,guard");
        for (asked, recorded, same) in [
            (None, None, true),
            (None, Some(&waits), true),
            (Some("none"), Some(&waits), true),
            (Some("any"), Some(&waits), true),
            (Some("any"), None, false),
            (Some("any,motion=0.3,guard"), Some(&waits), true),
            (Some("any,motion=1"), Some(&waits), false),
            (Some("man_85"), Some(&by_age), true),
            (Some("man_85,mouth_open"), Some(&by_age), false),
            (Some("man_60"), Some(&by_age), false),
            (Some("man_85/hands_in_lap"), Some(&by_age), false),
        ] {
            let asked = asked.map(read);
            let found = is_person(recorded, asked.as_ref());
            assert_eq!(found, same, "{asked:?} of {recorded:?}");
        }
    }
}
