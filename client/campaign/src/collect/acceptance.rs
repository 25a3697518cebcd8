//! Acceptance of a finished file: it must be the complete recording of the requested
//! episode, and its task must have succeeded.

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

/// Result of the check of a file.
pub enum Verdict {
    /// The file belongs to the dataset.
    Done(Box<Done>),
    /// The task failed.
    Failed(Failed),
}

/// Reads the finished file of an attempt at the scenario `requested` and decides.
/// `wall_seconds` is the duration of the attempt, s.
///
/// # Errors
/// When the file is not the complete recording of the episode.
pub fn check_file(
    episode: &Episode,
    number: u32,
    file: &Path,
    requested: &v1::Scenario,
    finished: &Finished,
    wall_seconds: f64,
) -> anyhow::Result<Verdict> {
    let seed = episode.seed_of(number);
    let recording = Recording::open(file)?;
    let summary = recording.summary()?;
    check(&summary, episode, seed)?;
    let seconds = summary.span_nanos.1.saturating_sub(summary.span_nanos.0) as f64 * 1e-9;
    let scenario = recording.scenario()?;
    check_settings(&scenario, requested)?;
    let scenario = scenario_json(&scenario);
    if recording.is_broken() || !(finished.succeeded() && summary.success) {
        let broken = recording.is_broken().then_some(FailureCause::Physics);
        return Ok(Verdict::Failed(Failed {
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
    Ok(Verdict::Done(Box::new(Done {
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
/// When the recording is incomplete or of another episode.
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

/// Checks that a recording was made with the requested settings.
///
/// Names every field of the message: a new field does not compile until its check is decided.
///
/// # Errors
/// Names the first setting that differs.
fn check_settings(recorded: &v1::Scenario, requested: &v1::Scenario) -> anyhow::Result<()> {
    let v1::Scenario {
        language,
        appearance,
        disturbances,
        sensors,
        person,
        calibration_seed,
        start_in_view,
        look_around,
        style,
        // Checked by `check`, with the label.
        task: _,
        seed: _,
        // Refused by the server when it cannot have them, and not sampled again.
        scene: _,
        robot: _,
        cameras: _,
        state_rate_hz: _,
        imu_rate_hz: _,
        scan_rate_hz: _,
        deformable_rate_hz: _,
        quality: _,
        imu_noise: _,
        pacing: _,
        starts: _,
        variant: _,
        variant_share: _,
        draws: _,
        time_limit_seconds: _,
        // Sampled by the server where the plan names none.
        objects: _,
        slides: _,
        start: _,
        instruction: _,
        target: _,
        arm_positions: _,
        knuckle: _,
        rejected_starts: _,
        layout_seed: _,
        home_style: _,
        object_split: _,
        // Digests are refused by the server when it cannot have them, and returned with all.
        packs: _,
    } = requested;
    let language_seed =
        |language: &Option<v1::Language>| language.as_ref().map(|l| (l.seed, l.split));
    let appearance_seed = |appearance: &Option<v1::Appearance>| appearance.as_ref().map(|a| a.seed);
    let strengths = |disturbances: &Option<v1::Disturbances>| {
        let by = disturbances.filter(|d| d.noise + d.pushes + d.slips > 0);
        by.map(|d| (d.noise, d.pushes, d.slips))
    };
    for (name, same) in [
        (
            "language",
            language_seed(&recorded.language) == language_seed(language),
        ),
        (
            "appearance",
            appearance_seed(&recorded.appearance) == appearance_seed(appearance),
        ),
        (
            "disturbances",
            strengths(&recorded.disturbances) == strengths(disturbances),
        ),
        ("sensors", recorded.sensors.len() == sensors.len()),
        (
            "person",
            matches_person(recorded.person.as_ref(), person.as_ref()),
        ),
        (
            "calibration_seed",
            recorded.calibration_seed == *calibration_seed,
        ),
        (
            "start_in_view",
            start_in_view.is_none() || recorded.start_in_view == *start_in_view,
        ),
        (
            "look_around",
            look_around.is_none() || recorded.look_around == *look_around,
        ),
        ("style", style.is_none() || recorded.style == *style),
    ] {
        if !same {
            bail!(
                "the recording was not made with the {name} of the plan; use programs of one version in a campaign"
            );
        }
    }
    Ok(())
}

/// Whether the recorded person matches the requested one. Only requested fields count: a
/// care task samples a person where the plan names none, and adds fields to a named person.
fn matches_person(recorded: Option<&v1::Person>, requested: Option<&v1::Person>) -> bool {
    let requested = requested.filter(|person| person.body != NO_PERSON);
    let Some(requested) = requested else {
        return true;
    };
    let recorded = recorded.filter(|person| person.body != NO_PERSON);
    recorded.is_some_and(|recorded| {
        let matches =
            |requested: &str, recorded: &str| requested.is_empty() || requested == recorded;
        matches(&requested.body, &recorded.body)
            && matches(&requested.posture, &recorded.posture)
            && (!requested.guard || recorded.guard)
            && (!requested.unguarded || !recorded.guard)
            && (!requested.mouth_open || recorded.mouth_open)
            && requested.motion.is_none_or(|m| recorded.motion == Some(m))
    })
}

/// Reason of the failure of the task.
fn reason(summary: &Summary, finished: &Finished) -> String {
    let mut parts: Vec<String> = finished.why().into_iter().collect();
    if !summary.failure_reason.is_empty() {
        parts.push(summary.failure_reason.clone());
    }
    let unmet: Vec<&str> = summary
        .conditions
        .iter()
        .filter(|(_, holds, _)| !holds)
        .map(|(name, ..)| name.as_str())
        .collect();
    if !unmet.is_empty() {
        parts.push(format!("not {}", unmet.join(", not ")));
    }
    if parts.is_empty() {
        parts.push("the operator reported a failure".to_owned());
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_added_by_a_care_task_keep_the_person_matching() {
        let read = |text: &str| v1::Person::from_text(text).unwrap();
        let waits = read("any/hands_on_armrests,motion=0.3,mouth_open,guard");
        let by_age = read("man_85/hands_on_armrests,motion=0.3,guard");
        for (requested, recorded, same) in [
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
            let requested = requested.map(read);
            let found = matches_person(recorded, requested.as_ref());
            assert_eq!(found, same, "{requested:?} of {recorded:?}");
        }
    }
}
