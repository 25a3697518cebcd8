//! Replies of the server as text.

use std::fmt::Write as _;

use wheelarm_proto::program::goal_word;
use wheelarm_proto::v1;

/// One line that names an episode.
#[must_use]
pub fn episode_line(started: &v1::EpisodeStarted) -> String {
    let number = started.header.as_ref().map_or(0, |header| header.episode);
    format!(
        "episode {number} {:?}: {:?}",
        started.label, started.instruction
    )
}

/// One line per condition, then the result.
#[must_use]
pub fn evaluation_lines(evaluation: &v1::Evaluation) -> String {
    let mut text = String::new();
    for condition in &evaluation.conditions {
        let mark = match (condition.holds, condition.required) {
            (true, _) => "yes",
            (false, true) => "NO ",
            (false, false) => "no ",
        };
        let _ = writeln!(text, "  {mark} {} ({:.4})", condition.name, condition.value);
    }
    let result = if evaluation.success {
        "success".to_owned()
    } else if evaluation.failure.is_empty() {
        "not reached".to_owned()
    } else {
        format!("failed: {}", evaluation.failure)
    };
    let _ = writeln!(text, "  {result} after {:.1} s", evaluation.elapsed_seconds);
    text
}

pub(super) fn status_text(sim: &str, status: &v1::Status) -> String {
    let mut text = String::new();
    let header = status.header.clone().unwrap_or_default();
    let scenario = status.scenario.clone().unwrap_or_default();
    let mut line = |name: &str, value: String| {
        if !value.is_empty() {
            let _ = writeln!(text, "{name:<12}{value}");
        }
    };
    line("server", format!("{sim} (version {})", status.version));
    line("run", header.run_id.clone());
    line(
        "scenario",
        format!(
            "scene {}, task {}, seed {}",
            scenario.scene,
            if scenario.task().is_empty() {
                "none"
            } else {
                scenario.task()
            },
            scenario.seed()
        ),
    );
    line("pacing", pacing(scenario.pacing()).to_owned());
    line("adapter", status.adapter.clone());
    line(
        "time",
        format!(
            "{:.3} s{}, {:.2} simulated s per s",
            header.stamp_nanos as f64 * 1e-9,
            if status.paused { " (paused)" } else { "" },
            status.real_time_factor
        ),
    );
    line(
        "episode",
        status
            .episode
            .as_ref()
            .map_or_else(|| "none runs".to_owned(), episode_line),
    );
    line("BROKEN", status.broken.clone());
    line("waits for", status.waiting_for.clone());
    line(
        "control",
        match status.holder.as_str() {
            "" => "none".to_owned(),
            holder => format!("{holder:?}, for {:.0} s", status.held_seconds),
        },
    );
    line("refused", format!("{} commands", status.refused));
    line("reached", reached(status.access()).to_owned());
    if status.strange > 0 {
        let strange = "messages named another client than their key, or could not be decoded";
        line("STRANGE", format!("{} {strange}", status.strange));
    }
    for recorder in &status.recorders {
        line("recorder", recorder_line(recorder));
    }
    if let Some(evaluation) = &status.evaluation {
        let _ = write!(text, "task\n{}", evaluation_lines(evaluation));
    }
    text
}

fn recorder_line(recorder: &v1::RecorderStatus) -> String {
    let mut line = format!(
        "{} {}, {} frames, {} missed",
        recorder.recorder,
        match recorder.state() {
            v1::RecorderState::Unspecified => "of unknown state",
            v1::RecorderState::Idle => "idle",
            v1::RecorderState::Ready => "recording",
            v1::RecorderState::Finished => "finished",
            v1::RecorderState::Failed => "FAILED",
            v1::RecorderState::Finishing => "finishing its file",
        },
        recorder.accepted_frames,
        recorder.missed
    );
    if let Some(seconds) = recorder.silent_seconds {
        let _ = write!(line, ", DOES NOT ANSWER for {seconds:.0} s");
    }
    for more in [&recorder.path, &recorder.message] {
        if !more.is_empty() {
            let _ = write!(line, ", {more}");
        }
    }
    line
}

fn reached(access: v1::Access) -> &'static str {
    match access {
        v1::Access::Unspecified => "",
        v1::Access::Local => "from its own host",
        v1::Access::Keys => "with keys",
        v1::Access::Insecure => "INSECURE, from every host and by every client",
    }
}

fn pacing(pacing: v1::Pacing) -> &'static str {
    match pacing {
        v1::Pacing::Unspecified | v1::Pacing::RealTime => "real time",
        v1::Pacing::LockStep => "lock-step",
        v1::Pacing::Fast => "as fast as possible",
    }
}

pub(super) fn tasks_text(tasks: &[v1::TaskInfo]) -> String {
    let mut text = String::new();
    for task in tasks {
        let _ = writeln!(text, "{} ({}, {})", task.name, task.activity, task.area);
        let (goal, targets) = (goal_word(task.goal()), task.targets.join(" or "));
        let _ = writeln!(text, "  goal  {goal} {targets}");
        for instruction in &task.instructions {
            let _ = writeln!(text, "  text  {instruction}");
        }
        for predicate in &task.predicates {
            let _ = writeln!(text, "  needs {predicate}");
        }
    }
    text
}

pub(super) fn stopped_text(stopped: &v1::EpisodeStopped) -> String {
    let header = stopped.header.clone().unwrap_or_default();
    let mut text = format!(
        "episode {} stopped at {:.3} s{}, {:.1} s of wall time\n",
        header.episode,
        header.stamp_nanos as f64 * 1e-9,
        if stopped.discard { ", discarded" } else { "" },
        stopped.wall_seconds
    );
    for recorder in &stopped.unconfirmed_recorders {
        let _ = writeln!(
            text,
            "  NOT CONFIRMED by recorder {recorder}: its file may be missing or incomplete"
        );
    }
    if stopped.cause() == v1::EndCause::Physics {
        text.push_str("  ended by the server: the physics broke\n");
    }
    for anomaly in &stopped.anomalies {
        let _ = writeln!(text, "  anomaly: {anomaly}");
    }
    for stream in &stopped.manifest {
        let _ = writeln!(text, "  {:>7} {}", stream.count, stream.stream);
    }
    if let Some(evaluation) = &stopped.evaluation {
        text.push_str(&evaluation_lines(evaluation));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_required_condition_is_in_capitals() {
        let condition = |name: &str, holds, required| v1::Condition {
            predicate: String::new(),
            name: name.to_owned(),
            holds,
            required,
            value: 0.5,
        };
        let text = evaluation_lines(&v1::Evaluation {
            failure: "time limit".to_owned(),
            conditions: vec![
                condition("lifted", false, true),
                condition("upright", false, false),
                condition("held", true, true),
            ],
            ..Default::default()
        });
        assert!(text.contains("NO  lifted"), "{text}");
        assert!(text.contains("no  upright"), "{text}");
        assert!(text.contains("yes held"), "{text}");
        assert!(text.contains("failed: time limit"), "{text}");
    }
}
