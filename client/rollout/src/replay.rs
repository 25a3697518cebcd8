//! The commands of a recording, applied again tick by tick, and the state hashes of both
//! runs side by side.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use wheelarm_expert::operator::Outcome;
use wheelarm_expert::run::{Progress, Report};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Client, Turn, Turns};

use crate::comparison::Comparison;
use crate::finished::Finished;
use crate::session::Session;

/// Name under which a replay commands and records.
pub const REPLAY: &str = "replay";
/// Silence after which the replay gives up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Compares the texts of the recorded assets with the loaded ones.
type CheckAssets = dyn Fn(&[v1::AssetText]) -> anyhow::Result<()> + Send + Sync;

/// Script of a replay.
#[derive(Clone)]
pub struct Replay {
    /// The scenario of the recording with its sampled values, and the cameras of the replay.
    pub scenario: v1::Scenario,
    /// Instruction of the recording.
    pub instruction: String,
    /// State at the first tick.
    pub snapshot: bytes::Bytes,
    /// First tick.
    pub first_tick: u64,
    /// Last tick.
    pub last_tick: u64,
    /// The commands by tick, without a gap.
    pub commands: BTreeMap<u64, v1::Command>,
    /// The recorded state hashes by tick.
    pub hashes: Vec<(u64, u64)>,
    /// Rejects assets with which the robot would move differently.
    pub check_assets: Arc<CheckAssets>,
}

/// Runs the replay as a session.
pub(crate) fn replay(session: &Session<'_>, script: &Replay) -> anyhow::Result<Finished> {
    let begun = Instant::now();
    let client = session.client;
    reset(client, script)?;
    session.heartbeat.set_scenario(&script.scenario);
    // Subscribed before the episode begins, so that its first state arrives.
    let mut turns = client.turns(REPLAY, false, &[TopicId::StateHash])?;
    let started = client.request(&v1::EpisodeStartRequest {
        label: session.label.to_owned(),
        instruction: Some(script.instruction.clone()),
        require_recorders: session.recorders,
        commander: REPLAY.to_owned(),
        replay: true,
        ..v1::EpisodeStartRequest::default()
    })?;
    let loaded = client.request(&v1::SnapshotRequest {})?.assets;
    let fed =
        (script.check_assets)(&loaded).and_then(|()| feed(session, &mut turns, script, &started));
    // The file of a replay that failed is discarded.
    let stopped = client.stop_episode_of(&started, fed.is_err())?;
    let comparison = fed?;
    Ok(Finished {
        wall_seconds: begun.elapsed().as_secs_f64(),
        hash: comparison.newest(),
        comparison: Some(comparison),
        ..Finished::from(Report {
            outcome: Outcome::Success,
            started,
            evaluation: stopped.evaluation.clone().unwrap_or_default(),
            stopped: Some(stopped),
            ticks: script.commands.len() as u64,
            source: None,
        })
    })
}

/// Restores the state at the start of the episode.
fn reset(client: &Client, script: &Replay) -> anyhow::Result<()> {
    let mut scenario = script.scenario.clone();
    // Whatever paced the recording, its commands are applied tick by tick.
    scenario.pacing = v1::Pacing::LockStep.into();
    // The server was started with the quality.
    scenario.quality = v1::RenderQuality::Unspecified.into();
    let reply = client.request(&v1::ResetRequest {
        scenario: Some(scenario),
        snapshot: script.snapshot.clone(),
        ..v1::ResetRequest::default()
    })?;
    let tick = reply.header.unwrap_or_default().tick;
    if tick != script.first_tick {
        bail!(
            "the snapshot puts the server at tick {tick}, the episode began at tick {}; was the file made by another version?",
            script.first_tick
        );
    }
    Ok(())
}

/// Sends the commands by tick and collects the state hashes.
fn feed(
    session: &Session<'_>,
    turns: &mut Turns,
    script: &Replay,
    started: &v1::EpisodeStarted,
) -> anyhow::Result<Comparison> {
    let first = started.header.clone().unwrap_or_default();
    let mut comparison = Comparison::with(script.hashes.clone());
    let mut newest = script.first_tick;
    loop {
        let turn = turns.next(PATIENCE, &mut |sample| {
            if let Sample::StateHash(sample) = sample {
                let header = sample.header.unwrap_or_default();
                if header.episode == first.episode {
                    comparison.insert(header.tick, sample.hash);
                }
            }
        })?;
        let clock = match turn {
            Turn::Answer(clock) => clock,
            Turn::Refused(refusal) => {
                bail!("the server refused a recorded command: {}", refusal.reason);
            }
            Turn::Ended(_) => bail!("another client ended the episode"),
            Turn::Silent(status) => bail!(
                "nothing arrived for {:.0} s after tick {newest}; the server waits for: {}",
                PATIENCE.as_secs_f64(),
                status.waiting_for
            ),
        };
        let factor = clock.real_time_factor;
        let header = clock.header.unwrap_or_default();
        if header.episode != first.episode {
            continue;
        }
        newest = header.tick;
        session.progress(&Progress {
            time: header.stamp_nanos.saturating_sub(first.stamp_nanos) as f64 * 1e-9,
            phase: REPLAY,
            factor,
            notes: &[],
        });
        if newest > script.last_tick {
            return Ok(comparison);
        }
        let command = script.commands.get(&newest);
        let command = command.with_context(|| format!("the recording has no tick {newest}"))?;
        turns.answer(command.clone())?;
        comparison.count_tick();
    }
}
