//! The states of a recording, rendered and published again without computing them: for
//! recordings of another physics version.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use wheelarm_expert::operator::Outcome;
use wheelarm_expert::run::{Progress, Report};
use wheelarm_proto::v1;
use wheelarm_sdk::Client;

use crate::finished::Finished;
use crate::session::Session;

/// Settings of a playback.
#[derive(Clone)]
pub struct Playback {
    /// The scenario of the recording, with the cameras of the playback.
    pub scenario: v1::Scenario,
    /// Instruction of the recording.
    pub instruction: String,
    /// The recorded states, one at least.
    pub states: Vec<v1::PlaybackRequest>,
    /// Receives the robot that the server loaded.
    pub check_robot: Arc<dyn Fn(&v1::RobotDescription) + Send + Sync>,
}

/// Runs the playback as a session.
pub(crate) fn play(session: &Session<'_>, script: &Playback) -> anyhow::Result<Finished> {
    let begun = Instant::now();
    let client = session.client;
    client.request(&v1::ResetRequest {
        scenario: Some(v1::Scenario {
            pacing: v1::Pacing::LockStep.into(),
            // The server was started with the quality.
            quality: v1::RenderQuality::Unspecified.into(),
            ..script.scenario.clone()
        }),
        playback: true,
        ..v1::ResetRequest::default()
    })?;
    if let Some(loaded) = client.request(&v1::SceneRequest {})?.robot {
        (script.check_robot)(&loaded);
    }
    let (first, others) = script.states.split_first().context("no recorded state")?;
    client.request(first).with_context(|| {
        "the recorded states do not fit the assets; replay with those of the recording: --assets"
    })?;
    let started = client.request(&v1::EpisodeStartRequest {
        label: session.label.to_owned(),
        instruction: Some(script.instruction.clone()),
        require_recorders: session.recorders,
        ..v1::EpisodeStartRequest::default()
    })?;
    let shown = show(session, client, others);
    // The file of a playback that failed is discarded.
    let stopped = client.stop_episode_of(&started, shown.is_err())?;
    shown?;
    Ok(Finished {
        wall_seconds: begun.elapsed().as_secs_f64(),
        ..Finished::from(Report {
            outcome: Outcome::Success,
            started,
            evaluation: stopped.evaluation.clone().unwrap_or_default(),
            stopped: Some(stopped),
            ticks: script.states.len() as u64,
            source: None,
        })
    })
}

fn show(
    session: &Session<'_>,
    client: &Client,
    states: &[v1::PlaybackRequest],
) -> anyhow::Result<()> {
    for state in states {
        client
            .request(state)
            .with_context(|| format!("showing the state of tick {}", state.tick))?;
        session.progress(&Progress {
            time: wheelarm_proto::stamp_nanos(state.tick) as f64 * 1e-9,
            phase: "playback",
            factor: 0.0,
            notes: &[],
        });
    }
    Ok(())
}
